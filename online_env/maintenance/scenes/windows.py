"""Windows of second applications: tiled to the right half of the screen, and loose."""

from collections.abc import Iterator

from ...recording.captured_picture import Picture
from ...recording.stage import RecordingStage
from ..desktop_looks import GOLDEN
from . import UnrecordedScene
from .apps import APPS, MORE_APPS, App, browser, installed

SITES = (
    "http://shop.test/",
    "http://wiki.test/wiki/Lighthouse",
    "http://mail.test/",
    "http://docs.test/",
)
# Applications that are recorded on every size of screen.
COMMON_APPS = ("geany", "mousepad", "thunar", "xfce4-terminal", "chromium")
LOOSE_SIZES = (
    (1120, 760),
    (860, 620),
    (640, 460),
)  # width and height of windows that are not tiled
# In other looks windows are small or narrow, for screens that are.
SMALL_SIZES = ((760, 560), (520, 380), (420, 560), (620, 300))
FULL_WIDTH = (
    1920  # width of the screen on which everything is recorded; others get tiled windows only
)


def record(stage: RecordingStage) -> Iterator[Picture | UnrecordedScene]:
    """Yield every application at half the screen, and on a large screen in loose windows, too."""
    for app in installed(stage, _apps(stage)):
        description = f"window of {app.name} ({app.shows})"
        yield from UnrecordedScene.instead(description, _pictures(stage, app))


def _apps(stage: RecordingStage) -> tuple[App, ...]:
    if _other_look(stage):
        return *APPS, *MORE_APPS
    if _is_full(stage):
        return *APPS, *(browser(site) for site in SITES)
    return tuple(app for app in APPS if app.name in COMMON_APPS)


def _pictures(stage: RecordingStage, app: App) -> Iterator[Picture]:
    x1, y1, x2, y2 = stage.area()
    top = app.open(stage)
    try:
        top = stage.place(top, ((x1 + x2) // 2, y1, x2, y2))
        stage.park((x1 + 5, y2 - 5))
        made_by = f"{app.program} with {app.shows}"
        # A window that cannot be made as small is not tiled.
        fits = abs(top.box[2] - x2) < 12 and top.box[3] <= y2
        if fits and not _other_look(stage):
            tiled = f"{made_by}; tiled to the right half of the screen"
            yield stage.cut("window", app.name, top, tiled)
        for width, height in _loose_sizes(stage):
            left = x2 - width - 60
            top = stage.place(top, (left, y1 + 120, left + width, y1 + 120 + height))
            yield stage.cut("window", app.name, top, f"{made_by}; a loose window")
    finally:
        stage.close(top)


def _loose_sizes(stage: RecordingStage) -> tuple[tuple[int, int], ...]:
    if not _is_full(stage):
        return ()
    return SMALL_SIZES if _other_look(stage) else LOOSE_SIZES


def _is_full(stage: RecordingStage) -> bool:
    return stage.screen[2] == FULL_WIDTH


def _other_look(stage: RecordingStage) -> bool:
    return stage.style not in ("", GOLDEN)
