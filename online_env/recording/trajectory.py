"""Trajectories in our plain input format: `trajectories.jsonl` beside `images/`.

Each line has the screen before an action, and the action.
"""

import contextlib
import json
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from hijack_data.elements.interactive_roles import INTERACTIVE_ENDINGS, INTERACTIVE_ROLES
from hijack_data.errors import HijackError
from hijack_data.file_io import write_atomic
from hijack_data.picture_io import encode_png
from hijack_data.platforms import OURS
from hijack_data.types import Action, Box, Size, UInt8Array

from ..effects.elements import LAUNCHERS
from ..tasks.tree_nodes import TreeNode, read_tree
from .stage import RecordingStage, TopWindow, at_point

RECORDS = "trajectories.jsonl"
IMAGES = "images"
DOMAIN = "embedded"
ENABLED = "enabled"


@dataclass(frozen=True, eq=False)
class RecordedView:
    """One screen: the screenshot, uint8 RGB `[H, W, 3]`, and the boxes that could be clicked."""

    frame: UInt8Array
    boxes: tuple[Box, ...]

    @classmethod
    def of(cls, stage: RecordingStage) -> "RecordedView":
        """Return the screen as soon as it has settled."""
        frame = stage.settled()
        return cls(frame, visible_boxes(stage, stage.desktop.accessibility()))


def visible_boxes(stage: RecordingStage, xml: str) -> tuple[Box, ...]:
    """Return the boxes of the enabled interactive elements that really show, each box once.

    Text fields are included.

    Args:
        stage: The desktop, whose windows may cover elements.
        xml: Its accessibility tree.
    """
    tops = stage.top_windows()
    elements = read_tree(xml)
    # Other applications do not report which of their elements are enabled.
    reporting = {node.app for node in elements if ENABLED in node.states}
    boxes: dict[Box, None] = {}
    for node in elements:
        box = _on_screen(node, stage.desktop.size)
        if box is None or not _interactive(node.role):
            continue
        enabled = ENABLED in node.states or node.app not in reporting
        if enabled and _is_visible(node.app, at_point(tops, node.centre)):
            boxes[box] = None
    return tuple(boxes)


def _interactive(role: str) -> bool:
    return role in INTERACTIVE_ROLES or role.endswith(INTERACTIVE_ENDINGS)


def _on_screen(node: TreeNode, size: Size) -> Box | None:
    if node.box is None:
        return None
    height, width = size
    x1 = max(node.box[0], 0)
    y1 = max(node.box[1], 0)
    x2 = min(node.box[2], width)
    y2 = min(node.box[3], height)
    if x1 >= x2 or y1 >= y2:
        return None
    return x1, y1, x2, y2


def _is_visible(app: str, top: TopWindow | None) -> bool:
    """Return whether an application's element shows, if `top` is the window at its centre.

    It does not if only the desktop or a panel is there: then its window is minimised.
    """
    if top is None or app.lower() in LAUNCHERS:
        return True
    return top.name.partition(".")[0] not in LAUNCHERS


@dataclass
class EpisodeRecording:
    """One episode while it is recorded.

    Args:
        id: The name that the trajectory should get.
        instruction: What was to be done.
        apps: The applications that it needs.
        domain: The domain in its rows.
        steps: The screen before each action, the action, and its code.
    """

    id: str
    instruction: str
    apps: Sequence[str]
    domain: str = DOMAIN
    steps: list[tuple[RecordedView, Action, str]] = field(default_factory=list[Any])

    def add(self, view: RecordedView, action: Action, code: str) -> None:
        """Add an action, and the screen on which it was decided."""
        self.steps.append((view, action, code))

    def rows(self, name: str) -> Iterable[dict[str, Any]]:
        """Yield the lines of the file, for a trajectory called `name`."""
        for step, (view, action, code) in enumerate(self.steps):
            fields = {key: value for key, value in asdict(action).items() if value is not None}
            row = {
                "id": f"{name}-{step:02d}",
                "trajectory_id": name,
                "step": step,
                "instruction": self.instruction,
                "domain": self.domain,
                "apps": list(self.apps),
                "platform": OURS,
                "image": f"{IMAGES}/{name}-{step:02d}.png",
                "action": fields,
                "action_code": code,
                "elements": [list(box) for box in view.boxes],
            }
            target = find_target(action, view.boxes)
            if target is not None:
                row["target_box"] = list(target)
            yield row


def find_target(action: Action, boxes: Sequence[Box]) -> Box | None:
    """Return the smallest of the boxes that contain the action's point."""
    if action.x is None or action.y is None:
        return None
    hit = [b for b in boxes if b[0] <= action.x < b[2] and b[1] <= action.y < b[3]]
    return min(hit, key=_area, default=None)


def free_name(folder: Path, stem: str) -> str:
    """Return `stem`, or `stem-2`, `stem-3` ... if that name is taken in the folder."""
    names = {json.loads(line)["trajectory_id"] for line in _lines(folder)}
    name = stem
    number = 2
    while name in names:
        name = f"{stem}-{number}"
        number += 1
    return name


def prepare(folder: Path) -> None:
    """Make the folder of trajectories, and check that one can be added, before one is recorded.

    Raises:
        HijackError: The folder cannot be written, or holds something else.
    """
    try:
        (folder / IMAGES).mkdir(parents=True, exist_ok=True)
        free_name(folder, "")
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError, KeyError, TypeError) as error:
        problem = f"{type(error).__name__}: {error}"
        raise HijackError(f"cannot add a trajectory to {folder}: {problem}") from None


@contextlib.contextmanager
def saved_at_end(
    trajectory: EpisodeRecording, folder: Path, say: Callable[[str], object]
) -> Iterator[None]:
    """Save what is recorded in the block, also where an error ends it.

    Args:
        trajectory: What is recorded.
        folder: As for `save`.
        say: Called with a line about what was saved.
    """
    try:
        yield
    finally:
        if trajectory.steps:
            name = save(trajectory, folder)
            say(f"{name}: {len(trajectory.steps)} steps in {folder}")


def save(trajectory: EpisodeRecording, folder: Path) -> str:
    """Append a trajectory to the folder, its lines last.

    Returns:
        The name that it got.

    Raises:
        HijackError: The folder cannot be written, or holds something else.
    """
    prepare(folder)
    name = free_name(folder, trajectory.id)
    rows = list(trajectory.rows(name))
    for row, (view, _, _) in zip(rows, trajectory.steps, strict=True):
        write_atomic(folder / row["image"], encode_png(view.frame))
    lines = _lines(folder)
    lines += [json.dumps(row, ensure_ascii=False) for row in rows]
    write_atomic(folder / RECORDS, "".join(f"{line}\n" for line in lines))
    return name


def _area(box: Box) -> int:
    return (box[2] - box[0]) * (box[3] - box[1])


def _lines(folder: Path) -> list[str]:
    path = folder / RECORDS
    if not path.exists():
        return []
    # Not `splitlines`, which also ends a line at U+2028 and the like within a text.
    return [line for line in path.read_text(encoding="utf-8").split("\n") if line]
