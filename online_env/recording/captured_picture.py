"""A picture of the asset pack before it is written: pixels, place, targets and the way back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hijack_data.types import Box, UInt8Array


@dataclass(frozen=True)
class ClickTarget:
    """Something that can be clicked: its name, role, and box `xyxy` in pixels of the screen."""

    name: str
    role: str
    box: Box


@dataclass(frozen=True, eq=False)
class Picture:
    """A part of a screen.

    Args:
        kind: One of `hijack_data.pack.picture_kinds()`.
        app: The program of the application that drew it (for a desktop, of the one that `recover`
            brings back).
        box: `xyxy` on the screen.
        pixels: uint8 RGB `[h, w, 3]`, or RGBA if the window's corners are not part of it.
        made_by: How it was made, one line.
        targets: What can be clicked, in pixels of the screen.
        recover: The action that undoes it, in pixels of the screen, or `None`.
        opened_by: The click that opened it, in pixels of the screen, or `None`.
    """

    kind: str
    app: str
    box: Box
    pixels: UInt8Array
    made_by: str
    targets: Sequence[ClickTarget] = ()
    recover: Mapping[str, Any] | None = None
    opened_by: Mapping[str, Any] | None = None

    def part(self, kind: str, box: Box, **changes: Any) -> "Picture":
        """Return the part of it in `box` (pixels of the screen).

        Args:
            kind: The kind of the part.
            box: `xyxy` on the screen; it is clipped to the picture.
            **changes: Other fields of the part. Its targets are those that lie wholly inside.
        """
        left, above, right, below = self.box
        x1 = max(box[0], left)
        y1 = max(box[1], above)
        x2 = min(box[2], right)
        y2 = min(box[3], below)
        clipped: Box = (x1, y1, x2, y2)
        pixels = self.pixels[y1 - above : y2 - above, x1 - left : x2 - left, :3].copy()
        inside = [target for target in self.targets if _contains(clipped, target.box)]
        return replace(self, kind=kind, box=clipped, pixels=pixels, targets=inside, **changes)

    def entry(self) -> dict[str, Any]:
        """Return the picture as JSON, without its file; places are in pixels of the picture."""
        targets = [
            {"name": target.name, "role": target.role, "box": self._clipped(target.box)}
            for target in self.targets
        ]
        entry: dict[str, Any] = {
            "kind": self.kind,
            "app": self.app,
            "box": list(self.box),
            "targets": targets,
            "recover": self._relative_action(self.recover),
            "made_by": self.made_by,
        }
        if self.opened_by is not None:
            entry["opened_by"] = self._relative_action(self.opened_by)
        return entry

    def _clipped(self, box: Sequence[int]) -> list[int]:
        """Return a box in pixels of the picture, clipped to it."""
        left, top, right, bottom = self.box
        limits = (right - left, bottom - top) * 2
        relative_box = self._relative_box(box)
        return [
            min(max(value, 0), limit) for value, limit in zip(relative_box, limits, strict=True)
        ]

    def _relative_box(self, box: Sequence[int]) -> list[int]:
        left, top = self.box[:2]
        return [box[0] - left, box[1] - top, box[2] - left, box[3] - top]

    def _relative_action(self, action: Mapping[str, Any] | None) -> dict[str, Any] | None:
        """Return an action in pixels of the picture."""
        if action is None:
            return None
        left, top = self.box[:2]
        relative_action = dict(action)
        for key, corner in (("x", left), ("y", top), ("x2", left), ("y2", top)):
            if key in relative_action:
                relative_action[key] -= corner
        if "target_box" in relative_action:
            relative_action["target_box"] = self._relative_box(relative_action["target_box"])
        return relative_action


def _contains(outer: Box, inner: Box) -> bool:
    if inner[0] < outer[0] or inner[1] < outer[1]:
        return False
    return inner[2] <= outer[2] and inner[3] <= outer[3]
