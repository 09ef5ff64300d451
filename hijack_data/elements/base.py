"""The result type of all sources of elements."""

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from ..errors import ElementsError, suggest
from ..types import BoxArray, as_boxes

ElementSource: TypeAlias = Literal["tree", "labels", "picture", "ocr", "none"]
SOURCES = ("tree", "labels", "picture", "ocr", "none")


@dataclass(frozen=True, eq=False)
class Elements:
    """The elements of one screen: their boxes, names and roles.

    Args:
        boxes: int32 `[N, 4]`, `xyxy`, pixels of the screen.
        names: the name of each element, `""` where it is unknown; empty if all are unknown.
        roles: the role of each element (`"push-button"`), `""` where it is unknown; empty if all
            are unknown.
        source: the origin of the boxes: `"tree" | "labels" | "picture" | "ocr" | "none"`.
        notes: which elements were left out, and why.

    Raises:
        ElementsError: `names` or `roles` do not match the boxes, or the source is unknown.
    """

    boxes: BoxArray = field(default_factory=lambda: as_boxes(None))
    names: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()
    source: ElementSource = "none"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "boxes", as_boxes(self.boxes))
        if self.source not in SOURCES:
            raise ElementsError(f"unknown source {self.source!r}{suggest(self.source, SOURCES)}")
        for field_name in ("names", "roles"):
            texts = tuple(getattr(self, field_name)) or ("",) * len(self)
            if len(texts) != len(self):
                raise ElementsError(
                    f"{len(texts)} {field_name} for {len(self)} boxes: give one for each box, or"
                    " none"
                )
            object.__setattr__(self, field_name, texts)

    def __len__(self) -> int:
        return len(self.boxes)
