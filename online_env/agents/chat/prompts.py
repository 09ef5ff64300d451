"""Prompts as data: one YAML file per prompt, in `online_env/agents/prompts/` or in a user's folder.

A prompt has up to three texts: `system`, `first` (opens the conversation) and `each` (precedes
every picture). Fields such as `{instruction}` are filled in; other braces stay unchanged.
"""

import hashlib
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from hijack_data.config.nodes import MappingNode, Position, Problems, ScalarNode, describe_node
from hijack_data.config.yaml_reader import read_yaml
from hijack_data.errors import UnknownNameError, suggest

OURS = Path(__file__).resolve().parent.parent / "prompts"
SUFFIX = ".yaml"
PATTERN = f"*{SUFFIX}"
KEYS = ("system", "first", "each")
FIELDS = ("instruction", "action", "errors", "language", "reminder", "width", "height", "password")
_FIELD = re.compile(r"\{(" + "|".join(FIELDS) + r")\}")
MAX_BYTES = 2**18
# The fields that a prompt must have, without which its model does not know what it is asked about.
# The onlooker's check may have its errors in its own words; an agent's prompt has the task.
NEEDED_FIELDS = {"onlooker_check": (), "onlooker_summary": ("action",)}
NEEDED_BY_AGENTS = ("instruction",)


@dataclass(frozen=True, kw_only=True)
class Prompt:
    """The texts of a prompt, with unfilled fields."""

    system: str = ""
    first: str = ""
    each: str = ""

    def fill(self, values: Mapping[str, object]) -> "Prompt":
        """Return the prompt with its fields filled in; braces in values stay unchanged."""

        def value(field: re.Match[str]) -> str:
            return str(values.get(field[1], field[0]))

        return Prompt(
            system=_FIELD.sub(value, self.system),
            first=_FIELD.sub(value, self.first),
            each=_FIELD.sub(value, self.each),
        )

    def has(self, field: str) -> bool:
        """Return whether one of the texts has a field."""
        return f"{{{field}}}" in f"{self.system} {self.first} {self.each}"


def names(folder: str | os.PathLike[str] | None = None) -> list[str]:
    """Return the names of all prompts: the packaged ones, and those of a folder."""
    files = list(OURS.glob(PATTERN))
    if folder is not None:
        files += Path(folder).glob(PATTERN)
    return sorted({path.stem for path in files})


def read_prompt(name: str, folders: tuple[str | os.PathLike[str], ...] = ()) -> Prompt:
    """Read a prompt by its name, from the first folder that has it, or else the packaged one.

    Raises:
        UnknownNameError: there is no prompt of this name.
        ConfigError: all mistakes of the file.
    """
    for folder in (*folders, OURS):
        path = Path(folder) / f"{name}{SUFFIX}"
        if path.is_file():
            return _read(path)
    hint = suggest(name, names())
    raise UnknownNameError(f"no prompt {name!r}{hint}")


def digest(folder: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of all prompts of a folder."""
    hasher = hashlib.sha256()
    for path in sorted(Path(folder).glob(PATTERN)):
        content = path.read_bytes()
        head = f"{path.name}\0{len(content)}\0"
        hasher.update(head.encode())
        hasher.update(content)
    return hasher.hexdigest()


def _read(path: Path) -> Prompt:
    problems = Problems()
    data = path.read_bytes()
    start = Position(str(path), 1, 1)
    if len(data) > MAX_BYTES:
        problems.stop(start, f"larger than {MAX_BYTES} bytes; is it a prompt?")
    tree = read_yaml(data, str(path), problems)
    if not isinstance(tree, MappingNode) or not tree.items:
        problems.stop(start, f"a prompt is a mapping of {', '.join(KEYS)} to texts")
    texts: dict[str, str] = {}
    for key, item in tree.items.items():
        if key not in KEYS:
            hint = suggest(key, KEYS)
            problems.add(tree.keys[key], f"a prompt has no key {key!r}{hint}")
            continue
        value = item.value if isinstance(item, ScalarNode) else None
        if isinstance(value, str):
            texts[key] = value.strip("\n")
        else:
            problems.add(item.position, f"{key} must be a text, got {describe_node(item)}")
    problems.check()
    prompt = Prompt(**texts)
    for field in NEEDED_FIELDS.get(path.stem, NEEDED_BY_AGENTS):
        if not prompt.has(field):
            problems.add(tree.position, f"no text of the prompt has the field {{{field}}}; add it")
    problems.check()
    return prompt
