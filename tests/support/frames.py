"""Frames for edits: a step of a made-up recording, on a screen of 320x200."""

from pathlib import Path
from typing import Any

import numpy as np

import hijack_data as hj
from hijack_data.pack import AssetPack
from hijack_data.rng import Stream
from hijack_data.types import as_target
from pipelines.edits import Frame
from pipelines.readers import RecordedTrajectory

SIZE = (200, 320)


def frame_of(
    pack: Path, *, size: tuple[int, int] = SIZE, boxes: Any = (), action: hj.Action | None = None, seed: int = 0,
    screen: Any = None, apps: tuple[str, ...] = (), domain: str = "",
) -> Frame:  # fmt: skip
    """A frame whose recorded action is a click at (100, 50), or `action`."""
    action = hj.Action("click", 100, 50) if action is None else action
    step = hj.Step(0, "0.png", action, elements=tuple(tuple(box) for box in boxes))
    trajectory = RecordedTrajectory("t", "jsonl", "do it", (step,), domain, apps, screen=screen)
    scene = hj.Scene(size, list(boxes) or None, apps, as_target(action.point))  # type: ignore[arg-type]
    image = np.zeros((*size, 3), np.uint8)
    return Frame(trajectory, step, scene, image, AssetPack.load(pack), Stream(seed, "test", "t"))


def drawn(frame: Frame, edit: Any) -> np.ndarray:
    """What an edit makes of the frame's picture."""
    return hj.apply(hj.Plan("test-v1", frame.scene.size, ops=edit.ops), frame.image)
