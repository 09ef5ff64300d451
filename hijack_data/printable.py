"""Text of others on a terminal: agents, models and recordings must not control it.

A terminal obeys the control characters that it is sent: it moves its cursor, clears what is above,
sets its title, and some write files. So they are printed as Python escapes.
"""

import re

# C0 without tab and newline, DEL, C1, and the marks that change the direction of text.
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")


def printable(text: str) -> str:
    """Return a text with each control character as an escape, as Python writes it."""
    return _CONTROL.sub(lambda match: ascii(match.group())[1:-1], text)
