"""Full-text search over a few dozen documents.

There is no index file: they are scored one by one.
"""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

TITLE_WEIGHT = 8
SNIPPET_WORDS = 34
WORDS_BEFORE = 6  # the first match in a snippet
MAX_WORDS = 12  # of a query
SHORTEST_PLURAL = 4  # letters

Piece = tuple[str, bool]


@dataclass(frozen=True)
class Document:
    """A page that can be found."""

    host: str
    path: str
    title: str
    text: str
    kind: str
    picture: str | None = None

    @cached_property
    def weights(self) -> Counter[str]:
        """How often each word occurs; one in the title counts `TITLE_WEIGHT` times."""
        counts = Counter(words(self.text))
        for word in words(self.title):
            counts[word] += TITLE_WEIGHT
        return counts


@dataclass(frozen=True)
class Hit:
    """A document that was found.

    Attributes:
        document: the page.
        snippet: the part of its text around the first match, as pieces `(text, is a match)`.
    """

    document: Document
    snippet: tuple[Piece, ...]


def words(text: str) -> list[str]:
    """Lower-case words without a plural `s`: enough to find *bees* by *bee*."""
    tokens = re.findall(r"\w+", text.lower())
    return [_stem(word) for word in tokens]


def _stem(word: str) -> str:
    is_plural = word.endswith("s") and not word.endswith("ss")
    if is_plural and len(word) >= SHORTEST_PLURAL:
        return word[:-1]
    return word


def find(text: str, documents: Sequence[Document]) -> list[Hit]:
    """Search for words.

    Args:
        text: the query.
        documents: where to search.

    Returns:
        The documents that contain every word, or if there are none, those that contain any; best
        first, ties in the given order.
    """
    terms = list(dict.fromkeys(words(text)))[:MAX_WORDS]
    if not terms:
        return []
    rarity = _rarity(terms, documents)
    scored = [(_score(document, rarity), document) for document in documents]
    partial = [pair for pair in scored if pair[0] > 0]
    full = [pair for pair in partial if all(pair[1].weights[word] for word in terms)]
    candidates = full or partial
    candidates.sort(key=lambda pair: -pair[0])
    return [Hit(document, _snippet(document.text, set(terms))) for _, document in candidates]


def _rarity(terms: list[str], documents: Sequence[Document]) -> dict[str, float]:
    """Return the weight of each word that occurs: more if it occurs in few documents."""
    rarity: dict[str, float] = {}
    for word in terms:
        count = sum(1 for document in documents if document.weights[word])
        if count:
            rarity[word] = math.log(1 + len(documents) / count)
    return rarity


def _score(document: Document, rarity: dict[str, float]) -> float:
    score = 0.0
    for word, weight in rarity.items():
        count = document.weights[word]
        if count:
            score += weight * math.log1p(count)
    return score


def _snippet(text: str, terms: set[str]) -> tuple[Piece, ...]:
    tokens = text.split()
    is_match = [not terms.isdisjoint(words(token)) for token in tokens]
    first = is_match.index(True) if True in is_match else 0
    start = max(0, first - WORDS_BEFORE)
    end = start + SNIPPET_WORDS
    pieces: list[Piece] = []
    if start:
        pieces.append(("... ", False))
    for token, matches in zip(tokens[start:end], is_match[start:end], strict=True):
        pieces.append((token + " ", matches))
    if end < len(tokens):
        pieces.append(("...", False))
    return tuple(pieces)
