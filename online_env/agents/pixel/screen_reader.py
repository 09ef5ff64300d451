"""Read the text of a screen by OCR: only the changes since the last picture, each once.

The text of a part of a picture depends only on its pixels, which are the key of the cache. So an
agent reads the same text whatever others have read before.
"""

import hashlib
import time
from collections import OrderedDict
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import metadata
from pathlib import Path

import numpy as np

from hijack_data.elements.ocr import MAX_RATIO, boxes_from_ocr
from hijack_data.types import Box, Size, UInt8Array

from .picture_changes import changed_boxes, merged, touch
from .shared_texts import TextFiles, TextLines

MARGIN_PX = 16  # px around what is read, as the detector wants some background
WHOLE_PICTURE_SHARE = 0.6  # of the picture: from there on it is read as one
MAX_CACHED_PARTS = 400  # parts of pictures whose text is remembered in a process


@dataclass(frozen=True, kw_only=True)
class TextLine:
    """One line of text on a picture.

    Args:
        text: What it says, as far as OCR could tell.
        box: `xyxy` in pixels of the picture.
        since: The number of the picture on which it first appeared at this place, from 0.
    """

    text: str
    box: Box
    since: int = 0

    @property
    def height(self) -> int:
        """Its height in pixels."""
        return self.box[3] - self.box[1]


@dataclass
class ReadingCounts:
    """The cost of reading.

    Args:
        pictures: Pictures that were read.
        calls: Calls of the OCR.
        kept: Parts whose text was known, to this process or to another one of the run.
        pixels: Pixels that went through the OCR.
        seconds: Time of the calls.
    """

    pictures: int = 0
    calls: int = 0
    kept: int = 0
    pixels: int = 0
    seconds: float = 0.0


class TextCache:
    """The lines of parts of pictures, by their pixels; those that were not asked for go first.

    Args:
        size: How many parts are remembered; 0 for none.
    """

    def __init__(self, size: int = MAX_CACHED_PARTS) -> None:
        self._size = size
        self._lines: OrderedDict[str, tuple[TextLine, ...]] = OrderedDict()
        self._files: TextFiles | None = None

    def share_in(self, folder: Path) -> None:
        """Share what is read with other processes, through the files of a folder."""
        self._files = TextFiles(folder)

    def read(self, part: UInt8Array, counts: ReadingCounts) -> tuple[TextLine, ...]:
        """Return the lines of a part, in its own pixels, and count what that cost."""
        key = _digest(part)
        known = self._lines.get(key)
        if known is not None:
            self._lines.move_to_end(key)
            counts.kept += 1
            return known
        found = tuple(TextLine(text=text, box=box) for text, box in self._read(key, part, counts))
        self._lines[key] = found
        while len(self._lines) > self._size:
            self._lines.popitem(last=False)
        return found

    def _read(self, key: str, part: UInt8Array, counts: ReadingCounts) -> TextLines:
        """Return what another process has read, or read it."""

        def read() -> TextLines:
            start = time.perf_counter()
            found = _read(part)
            counts.seconds += time.perf_counter() - start
            counts.calls += 1
            counts.pixels += part.shape[0] * part.shape[1]
            return found

        if self._files is None:
            return read()
        found, known = self._files.read(key, read)
        counts.kept += known
        return found


SHARED = TextCache()  # of a process: the episodes of a run begin with the same pictures


class ScreenReader:
    """Reads the pictures of one episode, one after the other.

    Args:
        cache: What was read before; that of the process if omitted.
        whole: Read every picture as a whole, to compare.
    """

    def __init__(self, cache: TextCache | None = None, *, whole: bool = False) -> None:
        self._cache = SHARED if cache is None else cache
        self._whole = whole
        self._picture: UInt8Array | None = None
        self._lines: tuple[TextLine, ...] = ()
        self.counts = ReadingCounts()

    def forget(self) -> None:
        """Begin a new episode."""
        self._picture = None
        self._lines = ()
        self.counts = ReadingCounts()

    def read(self, picture: UInt8Array) -> tuple[TextLine, ...]:
        """Return the lines of a picture, from top to bottom.

        Raises `MissingDependencyError` without the extra `ocr`.

        Args:
            picture: uint8 RGB `[H, W, 3]`.
        """
        if self._picture is not None and self._picture.shape != picture.shape:
            self._lines = ()  # their places are those of another picture
        boxes = self._boxes(picture)
        if not boxes and self._picture is not None:
            return self._lines
        number = self.counts.pictures
        self.counts.pictures += 1
        old = [line for line in self._lines if not any(touch(line.box, box) for box in boxes)]
        new: list[TextLine] = []
        for box in boxes:
            new += self._within(picture, box)
        dated = [replace(line, since=self._since(line, number)) for line in new]
        self._lines = tuple(sorted([*old, *dated], key=lambda line: (line.box[1], line.box[0])))
        self._picture = picture.copy()
        return self._lines

    def _since(self, line: TextLine, number: int) -> int:
        """Return on which picture a line first stood where it stands."""
        for before in self._lines:
            if before.text == line.text and touch(before.box, line.box):
                return before.since
        return number

    def _boxes(self, picture: UInt8Array) -> list[Box]:
        """Return the boxes to read: they cut no line, and no two of them touch."""
        height, width = picture.shape[:2]
        everything = [(0, 0, width, height)]
        if self._picture is None or self._whole:
            return everything
        boxes = self._around_lines(changed_boxes(self._picture, picture))
        area = sum((box[2] - box[0]) * (box[3] - box[1]) for box in boxes)
        return everything if area > WHOLE_PICTURE_SHARE * height * width else boxes

    def _around_lines(self, changed: list[Box]) -> list[Box]:
        """Return boxes that hold what changed, and the whole of every line that they touch."""
        boxes = merged(changed)
        while True:
            grown = list(boxes)
            for line in self._lines:
                grown += [line.box for box in boxes if touch(line.box, box)]
            grown = merged(grown)
            if grown == boxes:
                return boxes
            boxes = grown

    def _within(self, picture: UInt8Array, box: Box) -> list[TextLine]:
        """Return the lines of a part of the picture, in pixels of the picture."""
        height, width = picture.shape[:2]
        left, top, right, bottom = _padded(box, (height, width))
        found: list[TextLine] = []
        for line in self._cache.read(picture[top:bottom, left:right], self.counts):
            x1, y1, x2, y2 = line.box
            moved = (x1 + left, y1 + top, x2 + left, y2 + top)
            if touch(moved, box):
                found.append(replace(line, box=moved))
        return found


def _padded(box: Box, size: Size) -> Box:
    """Return a box with a margin, high and wide enough for the OCR."""
    height, width = size
    left, top, right, bottom = box
    longest = max(right - left, bottom - top) + 2 * MARGIN_PX
    least = -(-longest // MAX_RATIO)
    across = max(MARGIN_PX, (least - (right - left) + 1) // 2)
    along = max(MARGIN_PX, (least - (bottom - top) + 1) // 2)
    return (
        max(left - across, 0),
        max(top - along, 0),
        min(right + across, width),
        min(bottom + along, height),
    )


def _read(part: UInt8Array) -> TextLines:
    found = boxes_from_ocr(part)
    lines: TextLines = []
    for (x1, y1, x2, y2), text in zip(found.boxes.tolist(), found.names, strict=True):
        if text.strip():
            lines.append((text.strip(), (x1, y1, x2, y2)))
    return lines


def _digest(part: UInt8Array) -> str:
    """Return a name for the pixels of a part and for the OCR that reads them."""
    digest = hashlib.blake2b(repr((part.shape, _ocr())).encode(), digest_size=16)
    digest.update(np.ascontiguousarray(part).data)
    return digest.hexdigest()


@lru_cache(maxsize=1)
def _ocr() -> tuple[str, ...]:
    return tuple(metadata.version(package) for package in ("rapidocr", "onnxruntime"))
