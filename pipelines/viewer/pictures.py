"""Pictures as the page gets them: made on demand, and the last ones kept, up to a number of bytes."""

import io
from collections import OrderedDict
from threading import Lock

from PIL import Image

from ..images import encode
from .source import Source

THUMB = 480
BUDGET = 64 * 2**20


class Pictures:
    """The pictures of a source. `budget` is how many bytes of finished pictures are kept."""

    def __init__(self, source: Source, budget: int = BUDGET) -> None:
        self.source, self.budget, self.held = source, budget, 0
        self._kept: OrderedDict[tuple[str, int], bytes] = OrderedDict()
        self._lock = Lock()

    def get(self, kind: str, row: int) -> bytes:
        """Return a `picture` or what was `before` it as PNG, or a `thumb` as JPEG. Raises `HijackError`."""
        with self._lock:
            if (kind, row) in self._kept:
                self._kept.move_to_end((kind, row))
                return self._kept[kind, row]
        data = self._make(kind, row)
        with self._lock:
            self.held += len(data) - len(self._kept.pop((kind, row), b""))
            self._kept[kind, row] = data
            while self.held > self.budget:
                self.held -= len(self._kept.popitem(last=False)[1])
        return data

    def _make(self, kind: str, row: int) -> bytes:
        pixels = self.source.picture(row, kind == "before")
        if kind != "thumb":
            return encode(pixels)
        small = Image.fromarray(pixels)
        small.thumbnail((THUMB, THUMB), Image.Resampling.BOX, reducing_gap=1.0)  # a tenth of the time of Lanczos
        out = io.BytesIO()
        small.save(out, "JPEG", quality=85, subsampling=0)
        return out.getvalue()
