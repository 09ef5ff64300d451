"""Minimised desktops: windows are open, and the desktop is really shown (effect `minimise`).

The click on a panel button that brings a window back is tried out.
"""

from collections.abc import Iterator, Sequence

from hijack_data.plan import Effect

from ...effects import perform
from ...errors import DesktopError
from ...recording.captured_picture import ClickTarget, Picture
from ...recording.stage import RecordingStage, TopWindow, click, write_code
from . import UnrecordedScene
from .apps import APPS, App, browser, installed
from .windows import FULL_WIDTH

PANEL = "xfce4-panel"
_BY_NAME = {app.name: app for app in APPS}
_BY_NAME["chromium"] = browser("http://search.test/")
# The open windows, bottom to top: the last one is in front, and brought back.
OPEN = (
    ("chromium",),
    ("thunar", "mousepad"),
    ("mousepad", "geany", "chromium"),
    ("chromium", "libreoffice_writer"),
    ("thunar", "libreoffice_calc"),
    ("mousepad", "thunar"),
)
MAX_SMALL_SCREEN_APPS = 2  # how many of these are recorded on other than the usual screen


def record(stage: RecordingStage) -> Iterator[Picture | UnrecordedScene]:
    """Yield the desktop after one to three windows were minimised."""
    groups = OPEN if stage.screen[2] == FULL_WIDTH else OPEN[:MAX_SMALL_SCREEN_APPS]
    for names in groups:
        apps = installed(stage, tuple(_BY_NAME[name] for name in names))
        if len(apps) == len(names):
            description = f"desktop with {', '.join(names)} minimised"
            yield from UnrecordedScene.instead(description, _pictures(stage, apps))


def _pictures(stage: RecordingStage, apps: Sequence[App]) -> Iterator[Picture]:
    windows: list[TopWindow] = []
    try:
        for app in apps:
            windows.append(app.open(stage))  # noqa: PERF401  (those that did open are closed)
        effect = perform(Effect("minimise", {}), stage.desktop)
        try:
            probe = effect.probe()
            if not probe.ok:
                raise DesktopError(f"the windows are not minimised: {probe.problem}")
            yield _picture(stage, apps, windows)
        finally:
            effect.undo()
    finally:
        for top in reversed(windows):
            stage.close(top)


def _picture(stage: RecordingStage, apps: Sequence[App], windows: Sequence[TopWindow]) -> Picture:
    titles = {w["id"]: w["title"] for w in stage.guest.x("state")["windows"]}
    height, width = stage.desktop.size
    stage.park((width * 5 // 8, height // 2))
    stage.settled()
    targets = stage.launcher_targets()
    title = titles[windows[-1].client]
    button = next((t for t in targets if t.name == title and "button" in t.role), None)
    if button is None:
        raise DesktopError(f"the panel has no button {title!r}")
    names = ", ".join(app.name for app in apps)
    made_by = f"{names} opened, the last in front; effect minimise"
    picture = stage.whole_screen(
        "desktop", apps[-1].name, made_by, targets, recover=click("click", button)
    )
    _comes_back(stage, picture, windows[-1], button)
    return picture


def _comes_back(
    stage: RecordingStage, picture: Picture, top: TopWindow, button: ClickTarget
) -> None:
    if picture.recover is None:
        raise DesktopError("the picture of a minimised window has no click that brings it back")
    stage.run(write_code(picture.recover))
    stage.settled()
    if not any(window.client == top.client for window in stage.top_windows()):
        raise DesktopError(
            f"a click on the panel's button {button.name!r} does not bring its window back"
        )
