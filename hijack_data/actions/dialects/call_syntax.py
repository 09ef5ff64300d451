"""Find calls in the text of models: calls as in Python, JSON, and XML of tool calls.

Every function works in one pass over the text, and returns calls that know where they stand.
"""

import ast
import contextlib
import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias, cast

from ...errors import ActionError, short_repr
from ..agent_actions import fenced_spans
from ..python_source import TextEdit, apply_edits
from .action_rules import ActionCall
from .field_checks import as_fields

_JSON = json.JSONDecoder()
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "'": "'", '"': '"', "\\": "\\"}
_NAME = re.compile(r"\s*(\w+)\s*=\s*")
_SPACE = re.compile(r"[\s,;]*")
_BARE = re.compile(r"[^\s,()\[\]'\"]+")
_MAX_NESTING = 20
TOOL_CALL = re.compile(r"<(seed:)?tool_call>")


# Returns a value with other arguments; and of a value the name of its action, its arguments, and
# such a function.
Rebuild: TypeAlias = Callable[[dict[str, Any]], Any]
CallDecoder: TypeAlias = Callable[[Any], tuple[object, Mapping[str, Any], Rebuild]]


class WrittenArgument(NamedTuple):
    """An argument as written: its value, and where it stands in the text."""

    value: Any
    start: int
    end: int


def unescape(text: str) -> str:
    r"""Return quoted text with `\n`, `\'` and the like replaced; other backslashes stay."""
    return _ESCAPE.sub(lambda match: _ESCAPES.get(match[1], match[0]), text)


# --- Calls as in Python


def python_calls(text: str, dialect: str, names: Collection[str], example: str) -> list[ActionCall]:
    """Return the run of calls in a text: `click(box=[[1,2,3,4]], info='OK')`.

    Args:
        text: the reply; its thoughts are blank.
        dialect: for messages.
        names: the names of the actions.
        example: an action as it should be written, for messages.

    Raises:
        ActionError: there is no call, a call is not whole, or there is prose between two calls, so
            that one of them may only be mentioned.
    """
    begins = re.compile(rf"(?<![\w.])({'|'.join(map(re.escape, names))})\s*\(")
    calls: list[ActionCall] = []
    position = 0
    end = -1
    while match := begins.search(text, position):
        arguments, position = _python_arguments(text, match.end(), match[1])
        if calls and _SPACE.fullmatch(text, end, match.start()) is None:
            between = short_repr(text[end : match.start()].strip())
            raise ActionError(
                f"{dialect}: {between} stands between two actions, so one of them may only be"
                f" mentioned; write the action alone, such as {example}"
            )
        values = {name: argument.value for name, argument in arguments.items()}
        calls.append(ActionCall(match[1], values, match.start(), position))
        end = position
    if not calls:
        raise ActionError(
            f"{dialect}: no action in {short_repr(text.strip())}; write one such as {example}; the"
            f" actions are {', '.join(names)}"
        )
    return calls


def _python_arguments(text: str, start: int, name: str) -> tuple[dict[str, WrittenArgument], int]:
    """Return the arguments of a call, and where the call ends.

    Raises:
        ActionError: an argument cannot be read, or is given twice.
    """
    arguments: dict[str, WrittenArgument] = {}
    position = start
    while True:
        position = _skip(text, position)
        if text[position : position + 1] == ")":
            return arguments, position + 1
        match = _NAME.match(text, position)
        if match is None:
            remainder = short_repr(text[position : position + 80])
            raise ActionError(f"{name}: cannot read {remainder}; write {name}(name='value')")
        if match[1] in arguments:
            raise ActionError(f"{name}: {match[1]} is given twice; give one action for each point")
        value, end = _python_value(text, match.end(), name)
        arguments[match[1]] = WrittenArgument(value, match.end(), end)
        position = end


def _python_value(text: str, start: int, name: str) -> tuple[Any, int]:
    opening = text[start : start + 1]
    if opening and opening in "'\"":
        end = _quote_end(text, start, name)
        return unescape(text[start + 1 : end]), end + 1
    if opening and opening in "[(":
        end = _bracket_end(text, start, name)
        return text[start:end], end
    word = _BARE.match(text, start)
    if word is None:
        raise ActionError(f"{name}: it is not clear where its arguments end; close its brackets")
    constants = {"None": None, "True": True, "False": False, "true": True, "false": False}
    return constants.get(word[0], word[0]), word.end()


def _quote_end(text: str, start: int, name: str) -> int:
    """Return where quoted text ends: at a quote that is followed by another argument or by `)`.

    Raises:
        ActionError: the text does not end.
    """
    quote = text[start]
    follows = re.compile(rf"{quote}(?=\s*(?:\)|,\s*\w+\s*=))")
    position = start + 1
    while match := follows.search(text, position):
        slashes = match.start() - len(text[start : match.start()].rstrip("\\")) - start
        if slashes % 2 == 0:
            return match.start()
        position = match.end()
    raise ActionError(f"{name}: the text {short_repr(text[start:])} does not end; close its quotes")


def _bracket_end(text: str, start: int, name: str) -> int:
    """Return where a list ends, with the lists, calls and quoted texts inside it.

    Raises:
        ActionError: the list does not end.
    """
    depth = 0
    for match in re.finditer(r"'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\"|[\[\]()]", text[start:]):
        if match[0] in "[(":
            depth += 1
        elif match[0] in "])":
            depth -= 1
            if depth == 0:
                return start + match.end()
    raise ActionError(f"{name}: {short_repr(text[start:])} does not end; close its brackets")


def _skip(text: str, position: int) -> int:
    match = _SPACE.match(text, position)
    return match.end() if match else position


# --- JSON


def json_calls(
    text: str, dialect: str, read: CallDecoder, example: str, python: bool = False
) -> list[ActionCall]:
    """Return the actions of a text that is JSON: one value or several, also in a ``` fence.

    Args:
        text: the part of a reply that should be JSON; the rest of it is blank.
        dialect: for messages.
        read: returns of a value the name of the action, its arguments, and a function that returns
            the value with other arguments.
        example: an action as it should be written, for messages.
        python: the values are written as Python writes them: `{'a': None}`.

    Raises:
        ActionError: the text is no JSON.
    """
    json_text = _outside_prose(text)
    calls: list[ActionCall] = []
    position = _skip(json_text, 0)
    while position < len(json_text):
        value, end = _decoded(json_text, position, dialect, example, python)
        for item in cast("list[Any]", value) if _is_list_of_dicts(value) else [value]:
            name, arguments, rebuild = read(item)
            calls.append(
                ActionCall(name, arguments, position, end, _dumped(rebuild, value, item, python))
            )
        position = _skip(json_text, end)
    if not calls:
        raise ActionError(f"{dialect}: no action in {short_repr(text.strip())}; write {example}")
    return calls


def holds_json(text: str) -> bool:
    """Return whether a text begins with a JSON object, or has one in a ``` fence."""
    return _outside_prose(text).lstrip().startswith("{")


def _outside_prose(text: str) -> str:
    """Return a text with everything blank outside its ``` fences, if it has any."""
    spans = fenced_spans(text)
    if not spans:
        return text
    pieces: list[str] = []
    position = 0
    for start, end in spans:
        pieces += [" " * (start - position), text[start:end]]
        position = end
    return "".join([*pieces, " " * (len(text) - position)])


def _decoded(text: str, start: int, dialect: str, example: str, python: bool) -> tuple[Any, int]:
    try:
        if python:
            with contextlib.suppress(ValueError, RecursionError):  # JSON is welcome, too
                return _JSON.raw_decode(text, start)
        else:
            return _JSON.raw_decode(text, start)
        end = _bracket_end_of_value(text, start, dialect)
        return ast.literal_eval(text[start:end]), end
    except (ValueError, RecursionError, SyntaxError, MemoryError) as error:
        reason = str(error).split("\n")[0][:80]
        raise ActionError(
            f"{dialect}: {short_repr(text[start:].strip())} is no action ({reason}); write"
            f" {example}"
        ) from None


def _bracket_end_of_value(text: str, start: int, dialect: str) -> int:
    depth = 0
    has_bracket = False
    for match in re.finditer(r"'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\"|[\[\](){}]", text[start:]):
        if not has_bracket and match.start():
            break
        has_bracket = True
        if match[0] in "[({":
            depth += 1
            if depth > _MAX_NESTING:
                break
        elif match[0] in "])}":
            depth -= 1
            if depth == 0:
                return start + match.end()
    raise ValueError("it is neither a dictionary nor a list")


def _is_list_of_dicts(value: object) -> bool:
    parts = cast("list[Any]", value) if isinstance(value, list) else []
    return bool(parts) and all(isinstance(part, dict) for part in parts)


def _dumped(
    rebuild: Rebuild, value: Any, part: Any, python: bool
) -> Callable[[dict[str, Any]], str]:
    """Return a function that writes a value again, when one of its actions has other arguments."""

    def write(arguments: dict[str, Any]) -> str:
        rebuilt = rebuild(arguments)
        if value is not part:
            raise ActionError("a list of actions in pixels cannot be mapped; give them one by one")
        return repr(rebuilt) if python else json.dumps(rebuilt, ensure_ascii=False)

    return write


def flat_call_decoder(field: str, dialect: str) -> CallDecoder:
    """Return the reader of dicts whose arguments stand beside the name of the action."""

    def read(value: Any) -> tuple[object, Mapping[str, Any], Rebuild]:
        fields = as_fields(value, dialect)
        start = {key: part for key, part in fields.items() if key == field}
        name = fields.pop(field, None)

        def rebuild(arguments: dict[str, Any]) -> dict[str, Any]:
            return {**start, **arguments}

        return name, fields, rebuild

    return read


# --- Tool calls


def tool_call_blocks(text: str, example: str) -> list[tuple[str, int, int]]:
    """Return the content of each `<tool_call>` of a text, and where it begins and ends.

    A missing `</tool_call>` at the end of the text is tolerated, as servers strip it.

    Raises:
        ActionError: a call does not end before the next one begins.
    """
    starts = list(TOOL_CALL.finditer(text))
    blocks: list[tuple[str, int, int]] = []
    for index, start in enumerate(starts):
        closing = f"</{start[1] or ''}tool_call>"
        limit = starts[index + 1].start() if index + 1 < len(starts) else len(text)
        end = text.find(closing, start.end(), limit)
        if end < 0 and limit < len(text):
            raise ActionError(
                f"the tool call {short_repr(text[start.start() : limit])} does not end; write"
                f" {example}"
            )
        end = limit if end < 0 else end
        blocks.append((text[start.end() : end], start.end(), end))
    return blocks


_FUNCTION = re.compile(r"<function(?:=|\s+name=[\"']?)([\w.-]+)[\"']?>")
_PARAMETER = re.compile(r"\s*<parameter(?:=|\s+name=[\"']?)([\w.-]+)[\"']?>[ \t]*\r?\n?")


def xml_functions(
    text: str, offset: int = 0
) -> Iterator[tuple[str, dict[str, WrittenArgument], int, int]]:
    """Yield the `<function=NAME>` of a text: name, arguments, and where it begins and ends.

    Raises:
        ActionError: a function or a parameter does not end, or a parameter is given twice.
    """
    position = 0
    while match := _FUNCTION.search(text, position):
        end = text.find("</function>", match.end())
        if end < 0:
            raise ActionError(f"{match[1]}: the function does not end; close it with </function>")
        arguments: dict[str, WrittenArgument] = {}
        inner = match.end()
        while parameter := _PARAMETER.match(text, inner, end):
            close = text.find("</parameter>", parameter.end(), end)
            if close < 0:
                raise ActionError(f"{match[1]} {parameter[1]}: close it with </parameter>")
            if parameter[1] in arguments:
                raise ActionError(f"{match[1]}: {parameter[1]} is given twice; give it once")
            stop = close
            if text[stop - 1 : stop] == "\n" and stop > parameter.end():
                stop -= 2 if text[stop - 2 : stop] == "\r\n" else 1
            arguments[parameter[1]] = WrittenArgument(
                text[parameter.end() : stop], offset + parameter.end(), offset + stop
            )
            inner = close + len("</parameter>")
        if text[inner:end].strip():
            raise ActionError(
                f"{match[1]}: {short_repr(text[inner:end].strip())} is no <parameter=...>"
            )
        position = end + len("</function>")
        yield match[1], arguments, offset + match.start(), offset + position


def rewriter(
    part: str, arguments: Mapping[str, WrittenArgument], start: int
) -> Callable[[dict[str, Any]], str]:
    """Return a function that writes a part of a text with other values of its arguments.

    Args:
        part: the part as it is.
        arguments: its arguments, with their positions in the text.
        start: where the part begins in the text.
    """

    def write(values: dict[str, Any]) -> str:
        edits = [
            TextEdit(argument.start - start, argument.end - start, str(values[name]))
            for name, argument in arguments.items()
            if values.get(name) != argument.value
        ]
        return apply_edits(part, edits)

    return write
