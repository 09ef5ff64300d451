"""UI-TARS' prompts in their authors' wording, read from the user's copy of a Python file.

The models were trained on this wording, which belongs to others, so the packaged prompts `ui_tars`
and `ui_tars_1.5` are in words of our own. Files that have it are `mm_agents/prompts.py` of OSWorld
and of the paper's authors (these also have the onlooker's two prompts), and
`codes/ui_tars/prompt.py` of UI-TARS. The file is parsed and never run.
"""

import ast
import atexit
import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

import yaml

from ...errors import AgentSetupError
from .onlooker import CHECK, SUMMARY
from .prompts import FIELDS, SUFFIX

NAME = "ui-tars"  # --prompts ui-tars is answered with where the files are
SOURCES = (
    "git clone https://github.com/super-jw/AgentHijack and --prompts"
    " AgentHijack/mm_agents/prompts.py, or git clone https://github.com/bytedance/UI-TARS and"
    " --prompts UI-TARS/codes/ui_tars/prompt.py"
)
MAX_BYTES = 2**20
_TEMPLATE = "UITARS_USR_PROMPT_THOUGHT"
# Our prompts by what they are made of: the text, and the text that takes the place of
# `{action_space}`. The first entry whose texts are there is taken.
_RECIPES: tuple[tuple[str, str, str | None], ...] = (
    ("ui_tars", _TEMPLATE, "UITARS_CALL_USR_ACTION_SPACE"),
    ("ui_tars", _TEMPLATE, "UITARS_ACTION_SPACE"),
    ("ui_tars_1.5", _TEMPLATE, "UITARS_NORMAL_ACTION_SPACE"),
    ("ui_tars_1.5", "COMPUTER_USE_DOUBAO", None),
    (SUMMARY, "UITARS_SUMMARIZE_PROMPT", None),
    (CHECK, "UITARS_REMINDER_PROMPT", None),
)
_RENAMED = {"{response}": "{action}"}
_FIELD = re.compile(r"\{(\w+)\}")


def read_ui_tars_prompts(path: Path) -> dict[str, str]:
    """Return the texts of the prompts that a Python file has, by our name of each.

    Raises:
        AgentSetupError: the file cannot be read, has none of the prompts, or one of them has a
            field that is unknown here.
    """
    constants = _text_constants(path)
    texts: dict[str, str] = {}
    for name, template, action_space in _RECIPES:
        parts = (template,) if action_space is None else (template, action_space)
        if name in texts or not all(part in constants for part in parts):
            continue
        text = constants[template]
        if action_space is not None:
            text = text.replace("{action_space}", constants[action_space])
        for published, ours in _RENAMED.items():
            text = text.replace(published, ours)
        unknown = sorted(set(_FIELD.findall(text)) - set(FIELDS))
        if unknown:
            raise AgentSetupError(
                f"--prompts {path}: {template} has the field {{{unknown[0]}}}, which nothing fills"
                f" in; known: {', '.join(FIELDS)}"
            )
        texts[name] = text
    if not texts:
        names = ", ".join(dict.fromkeys(template for _, template, _ in _RECIPES))
        raise AgentSetupError(
            f"--prompts {path}: has none of {names}, with their action spaces; for UI-TARS' own"
            f" wording: {SOURCES}"
        )
    return texts


def write_prompts(texts: Mapping[str, str]) -> Path:
    """Write prompts as files into a folder that lasts as long as this process, and return it."""
    folder = Path(tempfile.mkdtemp(prefix="hijack-prompts-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for name, text in texts.items():
        content = yaml.safe_dump({"first": text}, allow_unicode=True)
        (folder / f"{name}{SUFFIX}").write_text(content, encoding="utf-8")
    return folder


def _text_constants(path: Path) -> dict[str, str]:
    """Return the texts that a file assigns to names at its top level.

    Raises:
        AgentSetupError: the file cannot be read as Python.
    """
    try:
        data = path.read_bytes()
        if len(data) > MAX_BYTES:
            raise AgentSetupError(f"--prompts {path}: larger than {MAX_BYTES} bytes")
        module = ast.parse(data, str(path))
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise AgentSetupError(
            f"--prompts {path}: cannot be read as Python ({error}); for UI-TARS' own wording:"
            f" {SOURCES}"
        ) from None
    constants: dict[str, str] = {}
    for statement in module.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Constant(value=str(text))):
                constants[name] = text
            case _:
                pass
    return constants
