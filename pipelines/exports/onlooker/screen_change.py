"""Measure how much of a screen changed, and where, and describe it in words."""

from dataclasses import dataclass

import numpy as np

from hijack_data.types import UInt8Array

# Differences of a channel up to this (of 256 levels) are ignored, because JPEG recordings are never
# equal.
TOLERANCE = 8
# A part of the screen with at least this share of the change is named as its location.
MIN_LOCATION_SHARE = 0.6
_ROWS = ("upper", "middle", "lower")
_COLUMNS = ("left", "middle", "right")


@dataclass(frozen=True)
class ScreenChange:
    """The difference between two screens.

    Args:
        share: share of the changed pixels, 0..1; 1 if the size changed.
        location: the part of the screen with most of it, as the end of a sentence, or empty.
        resized: whether the two screens differ in size.
    """

    share: float
    location: str = ""
    resized: bool = False

    def text(self) -> str:
        """Return the difference as one sentence."""
        if self.resized:
            return "The size of the screen changed."
        if not self.share:
            return "No change of the screen was measured."
        percent = round(100 * self.share)
        amount = f"About {percent} %" if percent else "Less than 1 %"
        return f"{amount} of the screen changed, {self.location}."


def measure(before: UInt8Array, after: UInt8Array) -> ScreenChange:
    """Return the difference of two screens, both uint8 RGB `[H, W, 3]`."""
    if before.shape != after.shape:
        return ScreenChange(1.0, resized=True)
    difference = np.maximum(before, after) - np.minimum(before, after)
    changed_mask = (difference > TOLERANCE).any(axis=2)
    counts = np.zeros((3, 3))
    for row, band in enumerate(np.array_split(changed_mask, 3)):
        for column, part in enumerate(np.array_split(band, 3, axis=1)):
            counts[row, column] = part.sum()
    shares = counts / max(1, counts.sum())
    return ScreenChange(float(changed_mask.mean()), _describe_location(shares))


def _describe_location(shares: "np.ndarray[tuple[int, int], np.dtype[np.float64]]") -> str:
    """Return the smallest part of a grid of three by three that has most of the change."""
    row, column = divmod(int(shares.argmax()), 3)
    if shares[row, column] >= MIN_LOCATION_SHARE:
        if row == column == 1:
            return "mostly in the middle"
        return f"mostly in the {_ROWS[row]} {_COLUMNS[column]}"
    rows = shares.sum(axis=1)
    columns = shares.sum(axis=0)
    if max(rows.max(), columns.max()) < MIN_LOCATION_SHARE:
        return "in several places"
    if rows.max() >= columns.max():
        return f"mostly in the {_ROWS[int(rows.argmax())]} third"
    return f"mostly in the {_COLUMNS[int(columns.argmax())]} third"
