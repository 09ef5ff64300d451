"""The names, keys and values of the paper's table and of its authors' `config/default.yaml`.

They are read on request (`paper_compat: true`), and in a file whose corruptions are under `noise:`,
as only the authors' file has them.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import cast

from ..apps import normalize_app
from ..corruption import Corruption
from ..corruptions.pop_ups import TEMPLATES
from ..drawing.text import is_bundled
from ..errors import ParameterError
from ..params import Parameter, parameters

# The authors' file has the corruptions under this key.
WRAPPER = "noise"
# The words of which the names of window strings are made; `tag` is in those of PopupAttack, on
# whose code the authors' is built, and stands for a mark of a set that no corruption draws.
_NAME_WORDS = re.compile(r"\b(instruct|tgt|tag)\b", re.IGNORECASE)

# Spellings from the algorithm boxes and from typesetting, in addition to the keys of the table
# (`paper=` of each parameter).
_ALSO: Mapping[str, Mapping[str, str]] = {
    "marks": {"size": "mark_size", "type": "mark_type"},
    "subtitle": {"text": "subtitle_text", "size": "font_size", "font": "font_path"},
    "multi_apps": {"app": "another_app"},
    "accidental_touch": {"w\\/o_app": "without_app", "wo_app": "without_app"},
    "network_error": {"ip": "local_ip"},
}

# What the paper's `overlap` means for our `avoid_elements`. Its table explains both as "whether can
# overlap buttons", but Algorithm 1 searches the largest space free of elements when a pop-up's
# overlap is True, while Algorithm 3 checks a mark's place only when overlap is False. The
# algorithms are what ran.
_OVERLAP_AVOIDS: Mapping[str, bool] = {"pop_ups": True, "marks": False}


def _avoid_elements(key: str, value: object) -> object:
    """Check the flag; a value that is neither true nor false is a `ParameterTypeError`."""
    return Parameter("bool", "").check(key, value)


def _not_avoid_elements(key: str, value: object) -> object:
    return not _avoid_elements(key, value)


def _local_ip(key: str, value: object) -> object:
    return None if value == "-" else value  # the paper's table prints - for "none"


def _window_string(key: str, value: object) -> object:
    """Return a name or a text unchanged; raise for a text in the words of names that is none.

    Raises:
        ParameterError: the text has the word instruct, tgt or tag, and is not a name.
    """
    if not isinstance(value, str) or value in TEMPLATES or not _NAME_WORDS.search(value):
        return value
    names = ", ".join(map(repr, TEMPLATES))
    raise ParameterError(
        f"{key} = {value!r} is none of the names {names}; a text of your own has none of the"
        " words instruct, tgt and tag, and {x} and {y} instead of a position"
    )


def _subtitle_text(key: str, value: object) -> object:
    """Join a list of lines.

    Raises:
        ParameterError: an item of the list is not a text.
    """
    if not isinstance(value, list):
        return value
    lines = cast("list[object]", value)
    for index, line in enumerate(lines):
        if not isinstance(line, str):
            raise ParameterError(f"{key}[{index}] must be a text in quotes, got {line!r}")
    return "\n".join(cast("list[str]", lines))


def _font_path(key: str, value: object) -> object:
    """Return the bundled font's name for its file name; the authors' code looks the file up."""
    if isinstance(value, str) and value.endswith(".ttf") and "/" not in value:
        stem = PurePosixPath(value).stem
        return stem if is_bundled(stem) else value
    return value


def _position(key: str, value: object) -> object:
    return "center" if value == "middle" else value


def _another_app(key: str, value: object) -> object:
    return normalize_app(value) if isinstance(value, str) else value


# Values that the paper or its authors' file writes differently, by corruption and our parameter.
_VALUES: Mapping[tuple[str, str], Callable[[str, object], object]] = {
    ("pop_ups", "window_string"): _window_string,
    ("subtitle", "subtitle_text"): _subtitle_text,
    ("subtitle", "font_path"): _font_path,
    ("subtitle", "position"): _position,
    ("multi_apps", "another_app"): _another_app,
    ("network_error", "local_ip"): _local_ip,
}


@dataclass(frozen=True)
class PaperKey:
    """Our parameter for one of the paper's keys.

    Attributes:
        name: the name of our parameter.
        opposite: whether its flag is inverted.
        translate: returns our value for a value of the paper, given the parameter's place for
            messages; `None` if the values are the same.
    """

    name: str
    opposite: bool = False
    translate: Callable[[str, object], object] | None = None


def paper_keys(cls: type[Corruption]) -> dict[str, PaperKey]:
    """Return the paper's keys of a corruption whose name or meaning differs from ours."""
    keys: dict[str, PaperKey] = {}
    for name, (parameter, _) in parameters(cls).items():
        translate = _VALUES.get((cls.name, name))
        for paper in (parameter.paper, name if translate else None):
            if paper is not None:
                keys[paper] = PaperKey(name, translate=translate)
    for paper, name in _ALSO.get(cls.name, {}).items():
        keys[paper] = PaperKey(name, translate=_VALUES.get((cls.name, name)))
    if cls.name in _OVERLAP_AVOIDS:
        opposite = not _OVERLAP_AVOIDS[cls.name]
        translate = _not_avoid_elements if opposite else _avoid_elements
        keys["overlap"] = PaperKey("avoid_elements", opposite, translate)
    return keys


def paper_name(name: str, names: Iterable[str]) -> str | None:
    """Return the name in `names` that the paper prints as `name`, or `None`.

    `"Pop UPs"` is `"pop_ups"`.
    """
    letters = _letters(name)
    if not letters:
        return None
    return next((candidate for candidate in names if _letters(candidate) == letters), None)


def _letters(name: str) -> str:
    return "".join(character for character in name.lower() if character.isalnum())
