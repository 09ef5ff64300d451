"""Find a text among the lines that OCR read: OCR loses spaces, and takes 0 for O and 1 for l."""

import difflib
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hijack_data.types import Box, Point

from .screen_reader import TextLine

WHOLE_LINE = 1.0
WHOLE_WORDS = 0.95
PART_OF_WORD = 0.85  # inside a longer word
MIN_INEXACT_CHARS = 4  # characters: what has fewer must be read exactly, and as whole words
MIN_LIKENESS = 0.78  # of a text that OCR read with mistakes: two of ten letters may be wrong
_ALIKE = str.maketrans(
    {
        "0": "o",
        "1": "l",
        "i": "l",
        "|": "l",
        "’": "'",
        "‘": "'",
        "`": "'",
        "“": '"',
        "”": '"',
        "–": "-",
        "—": "-",
        "…": "...",
    }
)


@dataclass(frozen=True, kw_only=True)
class TextMatch:
    """Where a text was found.

    Args:
        box: `xyxy` of the text itself, which may be a part of the line.
        likeness: How well it fits, 0 to 1.
        line: The line that holds it.
    """

    box: Box
    likeness: float
    line: TextLine

    @property
    def centre(self) -> Point:
        """The middle of the text."""
        return (self.box[0] + self.box[2]) // 2, (self.box[1] + self.box[3]) // 2


def find_text(
    lines: Iterable[TextLine], text: str, near: Sequence[TextMatch] = ()
) -> TextMatch | None:
    """Return where a text stands; `None` if it is not there.

    Of several places, the one that fits best is taken, then what came last onto the screen, then
    the first in the order of reading. With `near`, the closest to any of those places is taken.

    Args:
        lines: What was read.
        text: The text.
        near: The places of an anchor.
    """
    matches = all_texts(lines, text)
    if not matches:
        return None
    if near:
        return min(
            matches, key=lambda match_found: min(_distance(match_found, anchor) for anchor in near)
        )
    best = max(match_found.likeness for match_found in matches)
    equals = [match_found for match_found in matches if match_found.likeness == best]
    return min(
        equals,
        key=lambda match_found: (-match_found.line.since, match_found.box[1], match_found.box[0]),
    )


def all_texts(lines: Iterable[TextLine], text: str) -> list[TextMatch]:
    """Return all places of a text; those that were read with mistakes only if no other is there."""
    exact: list[TextMatch] = []
    alike: list[TextMatch] = []
    for line in lines:
        match_found = _match_exactly(line, text)
        if match_found is not None:
            exact.append(match_found)
            continue
        match_found = _match_roughly(line, text)
        if match_found is not None:
            alike.append(match_found)
    return exact or alike


def closest_text(lines: Iterable[TextLine], target: str) -> str:
    """Return the line that is most like a text, for messages; "" if there are no lines."""
    key = even(target)
    return max(
        (line.text for line in lines), key=lambda text: likeness(even(text), key), default=""
    )


def even(text: str) -> str:
    """Return a text without what OCR confuses: case, space, and characters that look alike."""
    return "".join(_significant_characters(text)[0])


def _significant_characters(text: str) -> tuple[list[str], list[int]]:
    """Return the characters that count, and the place of each in the text."""
    characters: list[str] = []
    indices: list[int] = []
    for index, character in enumerate(text):
        normalized = unicodedata.normalize("NFKC", character).casefold().translate(_ALIKE)
        for letter in normalized:
            if not letter.isspace():
                characters.append(letter)
                indices.append(index)
    return characters, indices


def _match_exactly(line: TextLine, text: str) -> TextMatch | None:
    key = even(text)
    characters, places = _significant_characters(line.text)
    evened = "".join(characters)
    if not key:
        return None
    if evened == key:
        return TextMatch(box=line.box, likeness=WHOLE_LINE, line=line)
    start = evened.find(key)
    inside: TextMatch | None = None
    while start >= 0:
        first, last = places[start], places[start + len(key) - 1]
        if _are_words(line.text, first, last):
            return _part(line, first, last, WHOLE_WORDS)
        if inside is None and len(key) >= MIN_INEXACT_CHARS:
            inside = _part(line, first, last, PART_OF_WORD)
        start = evened.find(key, start + 1)
    return inside


def _match_roughly(line: TextLine, text: str) -> TextMatch | None:
    key = even(text)
    if len(key) < MIN_INEXACT_CHARS or len(key) > 2 * len(line.text):
        return None
    characters, places = _significant_characters(line.text)
    evened = "".join(characters)
    line_likeness = likeness(evened, key)
    if line_likeness >= MIN_LIKENESS:
        return TextMatch(box=line.box, likeness=line_likeness * PART_OF_WORD, line=line)
    matcher = difflib.SequenceMatcher(None, evened, key, autojunk=False)
    block = matcher.find_longest_match()
    start = max(block.a - block.b, 0)
    window = evened[start : start + len(key)]
    part = likeness(window, key)
    if part < MIN_LIKENESS or block.size < 2:
        return None
    return _part(line, places[start], places[start + len(window) - 1], part * PART_OF_WORD)


def likeness(first: str, second: str) -> float:
    """Return how alike two texts are, 0 to 1, after `even`."""
    return difflib.SequenceMatcher(None, first, second, autojunk=False).ratio()


def _are_words(text: str, first: int, last: int) -> bool:
    """Return whether no letter or digit touches a part of a text."""
    before = text[first - 1 : first]
    after = text[last + 1 : last + 2]
    return not before.isalnum() and not after.isalnum()


def _part(line: TextLine, first: int, last: int, likeness: float) -> TextMatch:
    """Return the place of some characters of a line, as if all had the same width."""
    left, top, right, bottom = line.box
    width = (right - left) / len(line.text)
    box = (round(left + first * width), top, round(left + (last + 1) * width), bottom)
    return TextMatch(box=box, likeness=likeness, line=line)


def _distance(first: TextMatch, second: TextMatch) -> float:
    """Return how far two texts are apart, in pixels; a line's height counts four times."""
    across = max(first.box[0] - second.box[2], second.box[0] - first.box[2], 0)
    along = abs(first.centre[1] - second.centre[1])
    return float(across + 4 * along)
