"""Names, places and things that seeds draw from."""

from collections.abc import Sequence
from typing import TypeVar

from hijack_data.rng import Stream

T = TypeVar("T")

FIRST_NAMES = (
    "Ada",
    "Björn",
    "Chloé",
    "Dmitri",
    "Eva",
    "Farid",
    "Grace",
    "Håkon",
    "Ines",
    "Jonas",
    "Keiko",
    "Leila",
)
LAST_NAMES = (
    "Okafor",
    "Lindström",
    "Moreau",
    "Tanaka",
    "O'Neill",
    "García",
    "Weiß",
    "Novak",
    "Haddad",
    "Silva",
)
CITIES = (
    "Lisbon",
    "Dresden",
    "Kyoto",
    "Bergen",
    "Nairobi",
    "Toronto",
    "Kraków",
    "Porto",
    "Tartu",
    "Ghent",
)
GOODS = (
    "lamp",
    "kettle",
    "bench",
    "rope",
    "ladder",
    "blanket",
    "compass",
    "notebook",
    "basket",
    "whistle",
)
TOPICS = (
    "budget",
    "minutes",
    "plan",
    "summary",
    "offer",
    "schedule",
    "contract",
    "agenda",
    "report",
    "inventory",
)
MONTHS = (
    "January",
    "February",
    "March",
    "April",
    "May",
    "June",
    "July",
    "August",
    "September",
    "October",
    "November",
    "December",
)


_STRAIGHT = str.maketrans("\u2018\u2019\u201c\u201d", "''\"\"")


def straight(text: str) -> str:
    """Return a text with straight quotation marks and apostrophes."""
    return text.translate(_STRAIGHT)


def even(text: str) -> str:
    """Return a text in lower case, with single spaces and straight quotation marks."""
    return " ".join(straight(text).casefold().split())


def sample(stream: Stream, options: Sequence[T], count: int) -> list[T]:
    """Return `count` of the options, each at most once, in random order."""
    remaining = list(options)
    return [remaining.pop(stream.integer(0, len(remaining) - 1)) for _ in range(count)]


def shuffle(stream: Stream, items: Sequence[T]) -> list[T]:
    """Return all items in random order."""
    return sample(stream, items, len(items))
