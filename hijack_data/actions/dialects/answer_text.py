"""Separate the answer in a model's reply from its thoughts.

A thought stands in tags such as `<think>...</think>` at the beginning of a line. Some servers leave
out the opening tag, so text that begins inside a thought ends with the first closing tag. An action
inside a thought was considered, not taken.
"""

import re

from ...errors import ActionError, ParameterTypeError, short_repr

_NAMES = "think|thinking|thinkt|gui_think|grounding_think|seed:think"
_OPEN = re.compile(rf"^[ \t]*<({_NAMES})>", re.MULTILINE | re.IGNORECASE)
_CLOSE = re.compile(rf"</(?:{_NAMES})>", re.IGNORECASE)
_TOKENS = re.compile(r"<\|(?:begin|end)_of_box\|>|<\|im_end\|>|\[EOS\]")


def answer_text(reply: object, dialect: str) -> str:
    """Return the reply with its thoughts and box tokens replaced by spaces.

    Every character of the answer keeps its position in the reply.

    Raises:
        ActionError: a thought does not end, so the reply was cut off before its answer.
        ParameterTypeError: the reply is not text.
    """
    if not isinstance(reply, str):
        raise ParameterTypeError(f"a reply in {dialect} must be a string, got {short_repr(reply)}")
    pieces: list[str] = []
    position = 0
    opening = _OPEN.search(reply)
    closing = _CLOSE.search(reply)
    if closing is not None and (opening is None or closing.start() < opening.start()):
        pieces.append(_blank(reply[: closing.end()]))
        position = closing.end()
        opening = _OPEN.search(reply, position)
    while opening is not None:
        closing = _CLOSE.search(reply, opening.end())
        if closing is None:
            raise ActionError(
                f"the thought <{opening[1]}> does not end, so nothing after it is an action: "
                f"{short_repr(reply)}; close it with </{opening[1]}> before the answer"
            )
        pieces += [
            reply[position : opening.start()],
            _blank(reply[opening.start() : closing.end()]),
        ]
        position = closing.end()
        # A thought may follow another on the same line.
        opening = _OPEN.search(reply, position)
    pieces.append(reply[position:])
    return _TOKENS.sub(lambda token: " " * len(token[0]), "".join(pieces))


def _blank(text: str) -> str:
    return re.sub(r"[^\r\n]", " ", text)
