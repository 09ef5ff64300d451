"""Advice on values that YAML reads differently from what their authors mean."""

import re

from ..params import Parameter
from .nodes import ConfigNode, ScalarNode

_HEX = re.compile(r"(?:[0-9a-fA-F]{3}){1,2}")
_TEXT_KINDS = ("str", "choice", "color", "ip")
_NUMBERS = ("int", "float", "steps")
_TRUTH = {"yes": "true", "on": "true", "y": "true", "no": "false", "off": "false", "n": "false"}
_CLOCK = re.compile(r"[-+]?[0-9]+(?::[0-9]+)+")
_NUMBER_OR_BOOL = re.compile(r"[-+.0-9eE]+|true|false")


def hint(parameter: Parameter, tree: ConfigNode) -> str:
    """Return advice to append to the message about a refused value, or `""`."""
    if not isinstance(tree, ScalarNode):
        return ""
    if tree.text is None:
        return _unquote(parameter.kind, tree.value)
    text = tree.text
    if parameter.kind == "color":
        return _color(text, tree.value)
    if parameter.kind == "bool":
        meaning = _TRUTH.get(text.lower())
        return f"; write {meaning}" if meaning else ""
    is_text = isinstance(tree.value, str)
    if parameter.kind in _NUMBERS and is_text and _CLOCK.fullmatch(text):
        return "; numbers to the base of 60 are not read, write the number out"
    if parameter.kind in ("int", "steps"):
        return _whole_number(text, tree.value)
    if parameter.kind in _TEXT_KINDS and not is_text:
        return _quote(text)
    return ""


def _color(text: str, value: object) -> str:
    if text in ("", "~", "null"):
        return "; an unquoted # starts a comment: write '#rrggbb' in quotes"
    if _HEX.fullmatch(text):
        return f"; write '#{text}' in quotes"
    return "" if isinstance(value, str) else _quote(text)


def _quote(text: str) -> str:
    return f"; for the text write '{text}' in quotes"


def _whole_number(text: str, value: object) -> str:
    if isinstance(value, float) and value.is_integer():
        return f"; write {value:.0f}" if abs(value) < 1e16 else ""
    digits = text.replace("_", "").lstrip("+-")
    is_number = digits.isascii() and digits.isdigit()
    if not isinstance(value, str) or len(text) > 20 or not is_number:
        return ""
    number = -int(digits) if text.startswith("-") else int(digits)
    octal = " (octal is not read)" if digits.startswith("0") else ""
    return f"; write {number}{octal}"


def _unquote(kind: str, value: object) -> str:
    takes_text = kind not in (*_NUMBERS, "bool")
    if takes_text or not isinstance(value, str):
        return ""
    return "; remove the quotes" if _NUMBER_OR_BOOL.fullmatch(value) else ""
