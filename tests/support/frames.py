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
    pack: Path,
    *,
    size: tuple[int, int] = SIZE,
    boxes: Any = (),
    action: hj.Action | None = None,
    seed: int = 0,
    screen: Any = None,
    apps: tuple[str, ...] = ("editor",),
    domain: str = "",
    platform: Any = "linux-xfce",
    allow_platform_mismatch: bool = False,
    before: tuple[hj.Action, ...] = (),
    recorded: bool = True,
    instruction: str = "do it",
) -> Frame:
    """A frame whose recorded action is a click at (100, 50), or `action`, after those `before`.

    Its picture is black, but for the first pixel of each element: they stand out.
    """
    action = hj.Action("click", 100, 50) if action is None else action
    elements = tuple(tuple(box) for box in boxes) if recorded else ()
    step = hj.Step(len(before), "0.png", action, elements=elements)
    steps = (*(hj.Step(k, "0.png", value) for k, value in enumerate(before)), step)
    trajectory = RecordedTrajectory(
        "t", "jsonl", instruction, steps, domain, apps, screen=screen, platform=platform
    )
    scene = hj.Scene(size, list(boxes) or None, apps, as_target(action.point))  # type: ignore[arg-type]
    image = np.zeros((*size, 3), np.uint8)
    for x, y, *_ in boxes:
        image[min(y, size[0] - 1), min(x, size[1] - 1)] = 255
    return Frame(
        trajectory=trajectory,
        step=step,
        scene=scene,
        image=image,
        pack=AssetPack.load(pack),
        stream=Stream(seed, "test", "t"),
        allow_platform_mismatch=allow_platform_mismatch,
    )


def drawn(frame: Frame, edit: Any) -> np.ndarray:
    """What an edit makes of the frame's picture."""
    return hj.apply(hj.Plan("test-v1", frame.scene.size, ops=edit.ops), frame.image)
