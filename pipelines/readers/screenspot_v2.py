"""ScreenSpot-v2 as it is published: three tables beside the folder of their pictures."""

import re
from pathlib import Path

from hijack_data.types import Size

from ..choices import PIXELS, XYWH
from .base import register
from .fields import JsonObject
from .published_set import GroundingTarget, PublishedSet, click_at

_TABLE = re.compile(r"screenspot_(desktop|mobile|web)_v2\.json")


@register
class ScreenSpotV2(PublishedSet):
    """Reads ScreenSpot-v2.

    Coordinates: pixels of the picture; `bbox` is x, y, width, height. `data_type` and `data_source`
    are kept in `extra`.
    """

    name = "screenspot_v2"
    layout = (
        "screenspot_desktop_v2.json, screenspot_mobile_v2.json or screenspot_web_v2.json beside the"
        " folder screenspotv2_image"
    )
    picture = "img_filename"
    folder = "screenspotv2_image"
    extra_fields = ("data_type", "data_source")

    def is_table(self, file: Path) -> bool:
        """Return whether the name is that of one of the three tables."""
        return bool(_TABLE.fullmatch(file.name))

    def target(self, record: JsonObject, size: Size) -> GroundingTarget:
        """Return a click at the middle of the box; see `PublishedSet.target`."""
        return click_at(record, "bbox", (PIXELS, XYWH), size)
