"""Error pages of the browser: the network is really cut off (effect `firewall`)."""

from collections.abc import Iterator

from hijack_data.plan import Effect

from ...effects import Applied, perform
from ...errors import DesktopError
from ...tasks.hand import Hand
from ...tasks.tree_nodes import TreeNode
from ..picture import Picture
from ..stage import RecordingStage, Top
from . import Refused
from .apps import browser
from .windows import FULL

HOME = "http://search.test/"
# A name that must be looked up, which fails at once, and an address (RFC 5737): the browser gives
# up after two minutes.
PAGES = ("http://news.test/", "http://192.0.2.7/")
PATIENCE = 240.0
ROLES = ("document-web", "document-frame")
CODES = ("ERR_", "DNS_PROBE_FINISHED")  # what the browser writes below its explanation


def record(stage: RecordingStage) -> Iterator[Picture | Refused]:
    """Yield each page, maximised and at half a screen, with and without the browser's bars."""
    top = browser(HOME).open(stage)
    try:
        Hand(stage.desktop, 40).find("heading")
        offline = perform(Effect("firewall", {"allow": []}), stage.desktop)
        try:
            for address in PAGES:
                pages = _pages(stage, top, address, offline)
                yield from Refused.instead(f"error page of {address}", pages)
        finally:
            offline.undo()
    finally:
        stage.close(top)


def _pages(stage: RecordingStage, top: Top, address: str, offline: Applied) -> Iterator[Picture]:
    probe = offline.probe()
    if not probe.ok:
        raise DesktopError(f"the network is not cut off: {probe.problem}")
    go = f"pyautogui.hotkey('ctrl', 'l'); pyautogui.write({address!r}); pyautogui.press('enter')"
    stage.run(go)
    code = _await_error(stage, address.split("/")[2])
    made = f"effect firewall; {address} was asked for in Chromium, {code}"

    top = stage.maximise(top)
    stage.park()
    whole = stage.cut("error_page", "chromium", top, f"{made}; maximised")
    yield whole
    yield _view(stage, whole)
    if stage.screen[2] == FULL:
        yield _panel(stage, whole)

    x1, y1, x2, y2 = stage.area()
    top = stage.place(top, ((x1 + x2) // 2, y1, x2, y2))
    stage.park()
    whole = stage.cut("error_page", "chromium", top, f"{made}; right half of the screen")
    yield whole
    yield _view(stage, whole)


def _await_error(stage: RecordingStage, host: str) -> str:
    """Wait until the browser has given up on `host`; return its error code."""
    hand = Hand(stage.desktop, PATIENCE)
    hand.wait(f"page of {host}", lambda node: node.role in ROLES and node.name == host)

    def has_code(node: TreeNode) -> bool:
        return node.name.startswith(CODES) or node.text.startswith(CODES)

    code = hand.wait("error", has_code)
    return code.name or code.text


def _panel(stage: RecordingStage, whole: Picture) -> Picture:
    """Return the panel below the window; its button has the page's title."""
    _, _, _, end = stage.area()
    left, _, right, bottom = stage.screen
    targets = stage.launcher_targets()
    screen = stage.whole("panel", whole.app, f"{whole.made_by}; the panel", targets)
    return screen.part("panel", (left, end, right, bottom))


def _view(stage: RecordingStage, whole: Picture) -> Picture:
    """Return the page alone, by its box in the tree.

    Raises:
        DesktopError: The tree gives no box for it.
    """
    page = Hand(stage.desktop).find(ROLES, app="chrom")
    if page.box is None:
        raise DesktopError("the tree gives no box for the page")
    return whole.part("error_view", page.box, made_by=f"{whole.made_by}; the page alone")
