"""Error pages of the browser: the network is really cut off (effect `firewall`)."""

from collections.abc import Iterator

from hijack_data.plan import Effect

from ...effects import Applied, perform
from ...errors import DesktopError
from ...recording.captured_picture import Picture
from ...recording.stage import RecordingStage, TopWindow
from ...tasks.hand import Hand
from ...tasks.tree_nodes import TreeNode
from . import UnrecordedScene
from .apps import browser
from .windows import FULL_WIDTH

HOME = "http://search.test/"
# A name that must be looked up, which fails at once, and an address (RFC 5737): the browser gives
# up after two minutes.
PAGES = ("http://news.test/", "http://192.0.2.7/")
PAGE_TIMEOUT_S = 240.0
ROLES = ("document-web", "document-frame")
CODES = ("ERR_", "DNS_PROBE_FINISHED")  # what the browser writes below its explanation


def record(stage: RecordingStage) -> Iterator[Picture | UnrecordedScene]:
    """Yield each page, maximised and at half a screen, with and without the browser's bars."""
    top = browser(HOME).open(stage)
    try:
        Hand(stage.desktop, 40).find("heading")
        offline = perform(Effect("firewall", {"allow": []}), stage.desktop)
        try:
            for address in PAGES:
                pages = _pages(stage, top, address, offline)
                yield from UnrecordedScene.instead(f"error page of {address}", pages)
        finally:
            offline.undo()
    finally:
        stage.close(top)


def _pages(
    stage: RecordingStage, top: TopWindow, address: str, offline: Applied
) -> Iterator[Picture]:
    probe = offline.probe()
    if not probe.ok:
        raise DesktopError(f"the network is not cut off: {probe.problem}")
    go = f"pyautogui.hotkey('ctrl', 'l'); pyautogui.write({address!r}); pyautogui.press('enter')"
    stage.run(go)
    code = _await_error(stage, address.split("/")[2])
    made_by = f"effect firewall; {address} was asked for in Chromium, {code}"

    top = stage.maximise(top)
    stage.park()
    window_picture = stage.cut("error_page", "chromium", top, f"{made_by}; maximised")
    yield window_picture
    yield _view(stage, window_picture)
    if stage.screen[2] == FULL_WIDTH:
        yield _panel(stage, window_picture)

    x1, y1, x2, y2 = stage.area()
    top = stage.place(top, ((x1 + x2) // 2, y1, x2, y2))
    stage.park()
    window_picture = stage.cut(
        "error_page", "chromium", top, f"{made_by}; right half of the screen"
    )
    yield window_picture
    yield _view(stage, window_picture)


def _await_error(stage: RecordingStage, host: str) -> str:
    """Wait until the browser has given up on `host`; return its error code."""
    hand = Hand(stage.desktop, PAGE_TIMEOUT_S)
    hand.wait(f"page of {host}", lambda node: node.role in ROLES and node.name == host)

    def has_code(node: TreeNode) -> bool:
        return node.name.startswith(CODES) or node.text.startswith(CODES)

    code = hand.wait("error", has_code)
    return code.name or code.text


def _panel(stage: RecordingStage, window_picture: Picture) -> Picture:
    """Return the panel below the window; its button has the page's title."""
    _, _, _, end = stage.area()
    left, _, right, bottom = stage.screen
    targets = stage.launcher_targets()
    screen = stage.whole_screen(
        "panel", window_picture.app, f"{window_picture.made_by}; the panel", targets
    )
    return screen.part("panel", (left, end, right, bottom))


def _view(stage: RecordingStage, window_picture: Picture) -> Picture:
    """Return the page alone, by its box in the tree.

    Raises:
        DesktopError: The tree gives no box for it.
    """
    page = Hand(stage.desktop).find(ROLES, app="chrom")
    if page.box is None:
        raise DesktopError("the tree gives no box for the page")
    return window_picture.part(
        "error_view", page.box, made_by=f"{window_picture.made_by}; the page alone"
    )
