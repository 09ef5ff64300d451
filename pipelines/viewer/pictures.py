"""Pictures as the page gets them: made on demand, the last ones kept up to a number of bytes."""

import io

from PIL import Image

from hijack_data.cache import Cache

from ..dataset.images import encode
from .source import ViewerSource

THUMB = 480
BUDGET = 64 * 2**20


class Pictures:
    """The encoded pictures of a source.

    Args:
        source: the dataset or the run.
        budget: the most bytes of encoded pictures that are kept.
    """

    def __init__(self, source: ViewerSource, budget: int = BUDGET) -> None:
        self.source = source
        self.kept = Cache(budget)

    def get(self, kind: str, row: int) -> bytes:
        """Return a `picture`, or the one `before` its corruption, as PNG, or a `thumb` as JPEG.

        A row without that picture is a `HijackError`.
        """
        data = self.kept.get((kind, row))
        if data is None:
            data = self._make(kind, row)
            self.kept.put((kind, row), data, len(data))
        return data

    def _make(self, kind: str, row: int) -> bytes:
        pixels = self.source.picture(row, kind == "before")
        if kind != "thumb":
            return encode(pixels)
        small = Image.fromarray(pixels)
        # a tenth of the time of Lanczos
        small.thumbnail((THUMB, THUMB), Image.Resampling.BOX, reducing_gap=1.0)
        out = io.BytesIO()
        small.save(out, "JPEG", quality=85, subsampling=0)
        return out.getvalue()
