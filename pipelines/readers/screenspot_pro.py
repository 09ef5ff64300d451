"""ScreenSpot-Pro as it is published: a table for each application and system in `annotations`."""

from pathlib import Path

from hijack_data.types import Size

from ..choices import PIXELS, XYXY
from .base import register
from .fields import JsonObject
from .published_set import GroundingTarget, PublishedSet, click_at


@register
class ScreenSpotPro(PublishedSet):
    """Reads ScreenSpot-Pro, with its instructions in English.

    Coordinates: pixels of the picture; `bbox` is left, top, right, bottom. `img_size` must be that
    of the picture. `id`, `ui_type`, `group` and `instruction_cn` are kept in `extra`.
    """

    name = "screenspot_pro"
    layout = "tables in annotations/*.json, and their pictures below images/"
    picture = "img_filename"
    folder = "images"
    size_field = "img_size"
    extra_fields = ("id", "ui_type", "group", "instruction_cn")

    def is_table(self, file: Path) -> bool:
        """Return whether it is a JSON file in a folder `annotations`."""
        return file.suffix == ".json" and file.parent.name == "annotations"

    def target(self, record: JsonObject, size: Size) -> GroundingTarget:
        """Return a click at the middle of the box; see `PublishedSet.target`."""
        return click_at(record, "bbox", (PIXELS, XYXY), size)
