"""Separate the answer in a model's reply from its thoughts.

A thought stands in tags such as `<think>...</think>` at the beginning of a line. Some servers leave
out the opening tag, so text that begins inside a thought ends with the first closing tag. An action
inside a thought was considered, not taken.
"""

import re

from ...errors import ActionError, ParameterTypeError, shown

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
        raise ParameterTypeError(f"a reply in {dialect} must be a string, got {shown(reply)}")
    pieces: list[str] = []
    done = 0
    opened = _OPEN.search(reply)
    closed = _CLOSE.search(reply)
    if closed is not None and (opened is None or closed.start() < opened.start()):
        pieces.append(_blank(reply[: closed.end()]))
        done = closed.end()
        opened = _OPEN.search(reply, done)
    while opened is not None:
        closed = _CLOSE.search(reply, opened.end())
        if closed is None:
            raise ActionError(
                f"the thought <{opened[1]}> does not end, so nothing after it is an action: "
                f"{shown(reply)}; close it with </{opened[1]}> before the answer"
            )
        pieces += [reply[done : opened.start()], _blank(reply[opened.start() : closed.end()])]
        done = closed.end()
        # A thought may follow another on the same line.
        opened = _OPEN.search(reply, done)
    pieces.append(reply[done:])
    return _TOKENS.sub(lambda token: " " * len(token[0]), "".join(pieces))


def _blank(text: str) -> str:
    return re.sub(r"[^\r\n]", " ", text)
