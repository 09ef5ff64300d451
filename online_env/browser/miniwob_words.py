"""What the instructions of MiniWoB++ name, for the scripts and the plans that solve its pages."""

import re
from collections.abc import Sequence

_QUOTED = re.compile(r'"([^"]*)"')
_ORDINAL = re.compile(r"(\d+)(?:st|nd|rd|th)")
_OPTIONS = re.compile(r"Select (.*?)(?: and click|,? and then click)")
_ENTRY = re.compile(r"Select (.*) from the list")
_TAB = re.compile(r"Tab #\d")
_MOMENT = re.compile(r"Enter ([\d/:]+)\s*([AP]M)?")
_AMOUNT = re.compile(r"Select (-?\d+)")


def quoted_texts(instruction: str) -> list[str]:
    """Return the texts in quotation marks."""
    return [text.strip() for text in _QUOTED.findall(instruction)]


def cased_text(instruction: str) -> str:
    """Return the text in quotation marks, in the case that is asked for."""
    (text,) = quoted_texts(instruction)
    return text.upper() if "upper case" in instruction else text.lower()


def ordinals(instruction: str) -> list[int]:
    """Return the places that are named, 0 for the 1st."""
    return [int(number) - 1 for number in _ORDINAL.findall(instruction)]


def option_names(instruction: str) -> list[str]:
    """Return the names of the boxes to tick."""
    names = re.split(r", ?| and ", _first(_OPTIONS, instruction))
    return [name for name in names if name and name != "nothing"]


def list_entry(instruction: str) -> str:
    """Return the entry of a list to select."""
    return _first(_ENTRY, instruction)


def tab_name(instruction: str) -> str:
    """Return the name of the tab to open."""
    match = _TAB.search(instruction)
    return match[0] if match else ""


def moment_parts(instruction: str) -> Sequence[str]:
    """Return the parts of a date or a time, as they are typed into Chromium's field for one."""
    match = _MOMENT.search(instruction)
    if match is None:
        return ()
    parts = [part.zfill(2) for part in re.split("[/:]", match[1])]
    return (*parts, match[2][0].lower()) if match[2] else parts


def spinner_value(instruction: str) -> int:
    """Return the number to set."""
    return int(_first(_AMOUNT, instruction) or 0)


def _first(pattern: re.Pattern[str], text: str) -> str:
    match = pattern.search(text)
    return match[1] if match else ""
