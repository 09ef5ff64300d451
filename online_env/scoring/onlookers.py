"""Scoring an onlooker: whether it gives a reminder where one is needed, and how it summarises."""

import re
import string
from collections import Counter

NONE = "none"
_PREFIX = re.compile(r"^\s*reminder\s*:\s*", re.IGNORECASE)
_ARTICLES = re.compile(r"\b(a|an|the)\b")


def is_reminder(answer: str | None) -> bool:
    """Return whether the answer of `check` is a reminder.

    `None`, an empty text and the word None, also behind `Reminder:`, are none.
    """
    if answer is None:
        return False
    text = _PREFIX.sub("", answer).strip().strip(".'\"`").lower()
    return text not in ("", NONE)


def overlap(answer: str, reference: str) -> float:
    """Return the F1 of the words that two texts share, 0..1, as SQuAD defines it.

    Case, punctuation, articles and white space do not count.
    """
    answer_words = _words(answer)
    reference_words = _words(reference)
    common = (answer_words & reference_words).total()
    if not common:
        return float(not answer_words and not reference_words)
    precision = common / answer_words.total()
    recall = common / reference_words.total()
    return 2 * precision * recall / (precision + recall)


def _words(text: str) -> Counter[str]:
    letters = text.lower().translate(str.maketrans("", "", string.punctuation))
    return Counter(_ARTICLES.sub(" ", letters).split())
