"""The parts of the page: a tile with before and after, and a tile with a message."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ..composites import Composite
from ..kernels import lower
from ..plan import Paste, Plan
from ..safety import Safety
from ..types import Scene, Size
from .data_uris import Embedded, caption
from .markup import Html, escape, fill, join, pretty, wrap
from .reproduce import cli_call, maker, python_call, schedule

# Distance of the divider from the painted area
DIVIDER_MARGIN_PERCENT = 2


@dataclass(frozen=True, eq=False, kw_only=True)
class GalleryPicture:
    """One picture of the gallery.

    Attributes:
        index: its position on the page.
        name: its sample id.
        scene: its size and elements.
        scale: the factor at which it is shown.
        seed: the seed of all plans.
        detected: whether the scene has the elements that the command line would find.
    """

    index: int
    name: str
    scene: Scene
    scale: float
    seed: int
    detected: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class Tile:
    """One corruption of one picture.

    Attributes:
        index: its position on the page.
        title: the title of the corruption.
        number: the position of the corruption among the filters.
        plan: the plan that made the picture.
        safety: how much of the elements is still visible.
        after: the corrupted picture.
        painted: the rectangles that the plan painted, `xyxy`.
        corruption_plan: the plan of the corruption: `plan` itself or, for a corruption of the
            machine, the plan whose effect `composited` shows.
        composited: the picture of the effect, for a corruption of the machine.
    """

    index: int
    title: str
    number: int
    plan: Plan
    safety: Safety
    after: Embedded
    painted: list[list[int]]
    corruption_plan: Plan
    composited: Composite | None = None


def painted(plan: Plan) -> list[list[int]]:
    """Return the rectangles that a plan paints, `xyxy` in pixels of the screen.

    A resize paints nothing.
    """
    height, width = plan.size
    size = plan.size
    boxes: list[list[int]] = []
    for op in plan.ops:
        if isinstance(op, Paste):
            boxes += _painted_boxes(op, size, width / size[1], height / size[0])
        else:
            size = op.size
    return boxes


def _painted_boxes(op: Paste, size: Size, sx: float, sy: float) -> Iterator[list[int]]:
    for stamp in lower(op, size):
        h, w = stamp.sprite.size
        for y, x in zip(stamp.ys.tolist(), stamp.xs.tolist(), strict=True):
            left = round(x * sx)
            top = round(y * sy)
            right = round((x + w) * sx)
            bottom = round((y + h) * sy)
            yield [left, top, right, bottom]


def tile(content: Tile, shot: GalleryPicture) -> Html:
    """Return the tile of a corruption that changes the picture."""
    plan = content.plan
    after = content.after
    return fill(
        "tile.html",
        index=content.index,
        number=content.number,
        picture=shot.index,
        title=content.title,
        name=shot.name,
        category=_category(plan),
        uri=after.uri,
        width=after.size[1],
        height=after.size[0],
        screen_width=plan.size[1],
        screen_height=plan.size[0],
        start=_start(content.painted, plan.size[1]),
        size=caption([plan.size, plan.out_size], shot.scale),
        boxes=len(shot.scene.boxes),
        painted=len(content.painted),
        paintless=Html("" if content.painted else " disabled"),
        figures=_figures(content, shot),
        notes=wrap("p", plan.notes),
        remake=_remake(content, shot),
        plan=_plan(plan),
    )


def message_tile(title: str, message: str, number: int | None) -> Html:
    """Return a tile with a message instead of a picture; without a `number` no filter hides it."""
    shown_number = "" if number is None else number
    return fill("message.html", title=title, message=message, number=shown_number)


def _start(boxes: list[list[int]], width: int) -> int:
    """Return the first position of the divider in percent: left of everything painted."""
    if not boxes:
        return 50
    left = min(box[0] for box in boxes)
    percent = 100 * left // width - DIVIDER_MARGIN_PERCENT
    return min(90, max(0, percent))


def _figures(content: Tile, shot: GalleryPicture) -> Html:
    """Return the figures of a tile; for an effect also its time and the fidelity of its picture."""
    safety = content.safety
    height, width = content.plan.out_size
    changed_share = safety.changed_pixels / (height * width)
    covered = f"{len(safety.covered)} of {len(shot.scene.boxes)}"
    resized = content.plan.out_size != content.plan.size
    changed_pixels = "all, resized" if resized else f"{safety.changed_pixels:,}"
    share = f"{100 * changed_share:.1f} %"
    rows = [
        ("Elements covered", covered),
        ("Pixels changed", changed_pixels),
        ("Share of the screen", share),
    ]
    return _rows([*rows, *_effect(content)])


def _effect(content: Tile) -> list[tuple[str, str]]:
    if content.composited is None:
        return []
    corruption = maker(content.corruption_plan)
    schedule_rows = [("When", schedule(corruption))] if corruption else []
    kinds = ", ".join(effect.kind for effect in content.corruption_plan.effects)
    return [
        ("Effect on the machine", kinds),
        *schedule_rows,
        ("Fidelity", content.composited.fidelity),
    ]


def _remake(content: Tile, shot: GalleryPicture) -> Html:
    plan = content.corruption_plan
    scene = shot.scene
    calls = [
        (
            "Python",
            python_call(
                plan, scene, shot.seed, shot.name, composited=content.composited is not None
            ),
        ),
        ("Command line", cli_call(plan, shot.seed, shot.name, detected=shot.detected)),
    ]
    lines = [fill("code.html", what=heading, text=text) for heading, text in calls if text]
    return join([*lines, _parameters(plan)])


def _parameters(plan: Plan) -> Html:
    if not plan.params:
        return Html()
    rows: list[tuple[str, str]] = []
    for key, value in plan.params.items():
        rows.append((key, value if isinstance(value, str) else pretty(value)))
    return fill("parameters.html", rows=_rows(rows))


def _plan(plan: Plan) -> Html:
    digest = plan.digest()
    return fill("plan.html", digest=digest, short=digest[:12], text=pretty(plan.to_data()))


def _category(plan: Plan) -> str:
    corruption = maker(plan)
    if corruption is None:
        return plan.corruption.replace("+", " + ")
    return _words(corruption.category)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _rows(rows: list[tuple[str, Any]]) -> Html:
    """Return pairs as the rows of a definition list."""
    cells = [f"<div><dt>{escape(key)}</dt><dd>{escape(value)}</dd></div>" for key, value in rows]
    return Html("".join(cells))
