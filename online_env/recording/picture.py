"""One picture of the asset pack before it is written: pixels, where they were, what can be clicked, what undoes it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hijack_data.types import Box, UInt8Array


@dataclass(frozen=True)
class Target:
    """Something that can be clicked: its name, role, and box `xyxy` in pixels of the screen."""

    name: str
    role: str
    box: Box


@dataclass(frozen=True, eq=False)
class Picture:
    """A part of a screen.

    Args:
        kind: one of `hijack_data.pack.KINDS`.
        app: the application that drew it (for a desktop, the one that `recover` brings back), as its program is called.
        box: `xyxy` on the screen.
        pixels: uint8 RGB `[h, w, 3]`, or RGBA where the window's corners are not part of it.
        made_by: what was done to get it, one line.
        targets: in pixels of the screen.
        recover: the action that really undoes it, in pixels of the screen, or `None`.
        opened_by: the click that opened it, in pixels of the screen, where a click did.
    """

    kind: str
    app: str
    box: Box
    pixels: UInt8Array
    made_by: str
    targets: Sequence[Target] = ()
    recover: Mapping[str, Any] | None = None
    opened_by: Mapping[str, Any] | None = None

    def part(self, kind: str, box: Box, **changes: Any) -> "Picture":
        """What of it lies in `box` (pixels of the screen), with the targets that are wholly inside."""
        left, above, right, below = self.box
        x1, y1, x2, y2 = max(box[0], left), max(box[1], above), min(box[2], right), min(box[3], below)
        pixels = self.pixels[y1 - above : y2 - above, x1 - left : x2 - left, :3].copy()
        inside = [t for t in self.targets if x1 <= t.box[0] and y1 <= t.box[1] and t.box[2] <= x2 and t.box[3] <= y2]
        return replace(self, kind=kind, box=(x1, y1, x2, y2), pixels=pixels, targets=inside, **changes)

    def entry(self) -> dict[str, Any]:
        """The picture as JSON, without its file; all places in pixels of the picture."""
        moved = [{"name": t.name, "role": t.role, "box": self._inside(t.box)} for t in self.targets]
        entry = {
            "kind": self.kind, "app": self.app, "box": list(self.box), "targets": moved,
            "recover": self._moved(self.recover), "made_by": self.made_by,
        }  # fmt: skip
        return entry if self.opened_by is None else {**entry, "opened_by": self._moved(self.opened_by)}

    def _inside(self, box: Sequence[int]) -> list[int]:
        left, top, right, bottom = self.box
        wide, high = right - left, bottom - top
        x1, y1, x2, y2 = (v - (left, top)[i % 2] for i, v in enumerate(box))
        return [min(max(x1, 0), wide), min(max(y1, 0), high), min(max(x2, 0), wide), min(max(y2, 0), high)]

    def _moved(self, action: Mapping[str, Any] | None) -> dict[str, Any] | None:
        if action is None:
            return None
        corner = {"x": self.box[0], "y": self.box[1], "x2": self.box[0], "y2": self.box[1]}
        moved = {key: value - corner.get(key, 0) if key in corner else value for key, value in action.items()}
        if "target_box" in moved:
            moved["target_box"] = [v - self.box[i % 2] for i, v in enumerate(moved["target_box"])]
        return moved
