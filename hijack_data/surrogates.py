"""Half of a surrogate pair: what JSON may hold as an escape, and no UTF-8 can.

Everything that reads text of others asks here whether it can be written again.
"""

import re

_HALF = re.compile("[\ud800-\udfff]")


def has_half(text: str) -> bool:
    """Return whether a text holds half of a surrogate pair."""
    return _HALF.search(text) is not None


def without_halves(text: str) -> str:
    """Return a text with each half replaced by the replacement character."""
    return _HALF.sub("\N{REPLACEMENT CHARACTER}", text)
