"""`PlaywrightBrowser`: the browser of somebody else's Playwright, as effects and plans need it."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from types import MappingProxyType
from typing import Any, cast
from urllib.parse import parse_qs

from hijack_data.types import Size

from ..effects.base import EffectRecord, LiveEffect, Probe, Undone
from ..effects.guest import Guest
from .cover_pages import SHOW, cover_page, sign_in_page
from .desktop import BrowserDesktop
from .devtools import DevToolsError
from .effects import BROWSER_EFFECTS, HideWindow, OtherWindow
from .input_devices import InputDevices, InputEvent
from .session import BrowserPage, _network

LOAD_TIMEOUT_MS = 15_000


class PlaywrightPage(BrowserPage):
    """A page of Playwright's, with a session of DevTools of its own."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.devtools = page.context.new_cdp_session(page)
        target = self.devtools.send("Target.getTargetInfo")["targetInfo"]["targetId"]
        prepared: Future[dict[str, Any]] = Future()
        super().__init__(target, "", prepared)


class PlaywrightBrowser(BrowserDesktop):
    """A running browser of Playwright's synchronous interface, as a desktop.

    All methods must be called in Playwright's thread. The browser's own shortcuts are not known:
    whoever drives it has functions for tabs and navigation.

    Args:
        context: Playwright's `BrowserContext`.
        size: (height, width) of the pictures in pixels.
        scale: Pixels of the pictures for each CSS pixel.
        get_front: Returns the page that the agent sees.
        set_front: Called with the page that the agent is to see.
    """

    def __init__(
        self,
        context: Any,
        size: Size,
        scale: float,
        get_front: Callable[[], Any],
        set_front: Callable[[Any], object],
    ) -> None:
        self.size = size
        self.scale = cast("int", scale)  # what uses it multiplies and divides by it
        self.acted = False
        self.walled_documents = 0
        self.notices = []
        self.task_is_over: Callable[[], bool] = lambda: False
        self.input = InputDevices(self._send_input, lambda keys, key: False, size, self.scale)
        self._context = context
        self._get_front = get_front
        self._set_front = set_front
        self._known: dict[Any, PlaywrightPage] = {}
        self._order: list[Any] = []  # the pages that were in front, in the order of their use
        self._offline = False
        self._wall: str | None = None
        context.expose_binding(SHOW, self._show_from_cover)

    def resize(self, size: Size, scale: float) -> None:
        """Take another size of the pictures, and other pixels for each CSS pixel."""
        self.size = size
        self.scale = cast("int", scale)
        self.input = InputDevices(self._send_input, lambda keys, key: False, size, self.scale)

    def close(self) -> None:
        """Take everything of ours away; the browser is not ours to end."""
        self.set_wall(None)
        for page in self._known.values():
            if not page.page.is_closed():
                page.devtools.detach()
        self._known.clear()

    # Pages

    @property
    def front(self) -> PlaywrightPage:
        """The page that the agent sees."""
        return self._find(self._get_front())

    @property
    def pages(self) -> list[BrowserPage]:
        """All pages; the last is in front."""
        front = self._get_front()
        self._order = [page for page in self._order if page is not front] + [front]
        last = {page: index for index, page in enumerate(self._order)}
        pages = [page for page in self._context.pages if not page.is_closed()]
        return [self._find(page) for page in sorted(pages, key=lambda page: last.get(page, -1))]

    def call(self, method: str, page: BrowserPage | None = None, **params: Any) -> dict[str, Any]:
        """Send a DevTools command to a page.

        Raises:
            DevToolsError: The browser refuses it, or the page is gone.
        """
        from playwright.sync_api import Error  # pyright: ignore[reportMissingImports]

        try:
            target = cast("PlaywrightPage", page or self.front)
            return target.devtools.send(method, params)
        except Error as error:
            raise DevToolsError(f"the browser refused {method}: {error}") from None

    def title(self, page: BrowserPage) -> str:
        """Return the title of a page."""
        return cast("PlaywrightPage", page).page.title()

    def open_page(self, url: str, *, is_cover: bool = False) -> BrowserPage:
        """Open a page in front of the others."""
        page = self._find(self._context.new_page())
        page.is_cover = is_cover
        # BrowserGym's own attribute: by how much its pictures of a page are enlarged.
        page.page._bgym_scale_factor = float(self.scale)
        page.page.goto(url)
        self.show(page)
        return page

    def cover(self, app: str = "") -> BrowserPage:
        """Open a page of ours in front that lists the others."""
        windows = {page.target: self.title(page) for page in self.pages if not page.is_cover}
        return self.open_page(cover_page(windows, app), is_cover=True)

    def show(self, page: BrowserPage) -> None:
        """Bring a page to the front."""
        playwright_page = cast("PlaywrightPage", page).page
        playwright_page.bring_to_front()
        self._set_front(playwright_page)

    def close_page(self, page: BrowserPage) -> None:
        """Close a page; the one that was used before it comes to the front."""
        cast("PlaywrightPage", page).page.close()
        other_pages = [open_page for open_page in self.pages if open_page is not page]
        if other_pages:
            self.show(other_pages[-1])

    def tidy(self) -> None:
        """Close pages of ours that the agent has left; what it went to comes to the front."""
        front = self.front
        cover_pages = [page for page in self.pages if page.is_cover and page is not front]
        for page in cover_pages:
            cast("PlaywrightPage", page).page.close()
        if cover_pages:
            front.page.bring_to_front()

    def navigate(self, url: str, page: BrowserPage | None = None) -> None:
        """Load an address, and wait until it is there."""
        cast("PlaywrightPage", page or self.front).page.goto(url)

    def reload(self, page: BrowserPage) -> None:
        """Load a page again, and wait until it is there, or cannot be loaded.

        Raises:
            DevToolsError: It does not load, and the network is on.
        """
        from playwright.sync_api import Error  # pyright: ignore[reportMissingImports]

        try:
            cast("PlaywrightPage", page).page.reload(timeout=LOAD_TIMEOUT_MS)
        except Error as error:
            if not self._offline:
                raise DevToolsError(f"the page does not load: {error}") from None
            self.wait_until_loaded()

    def wait_until_loaded(self) -> None:
        """Wait until the page in front has loaded."""
        self._get_front().wait_for_load_state("load", timeout=LOAD_TIMEOUT_MS)

    # What effects change

    def set_offline(self, offline: bool) -> None:
        """Switch the network of all pages, also of those to come."""
        self._offline = offline
        self._context.set_offline(offline)
        for page in self.pages:
            self.call("Network.enable", page)
            self.call("Network.emulateNetworkConditions", page, **_network(offline))

    def set_wall(self, password: str | None) -> None:
        """Show a sign-in page instead of every page that is loaded, or take it away."""
        if password is not None and self._wall is None:
            self._context.route("**/*", self._answer)
        if password is None and self._wall is not None:
            self._context.unroute("**/*", self._answer)
        self._wall = password

    # Inside

    def _find(self, page: Any) -> PlaywrightPage:
        if page not in self._known:
            self._known[page] = PlaywrightPage(page)
        return self._known[page]

    def _send_input(self, events: Sequence[InputEvent]) -> None:
        for method, params in events:
            self.call(method, **params)

    def _show_from_cover(self, source: Mapping[str, Any], target: str = "") -> None:
        """Answer a click on a button of our pages; called by Playwright."""
        cover = source["page"]
        pages = [page for page in self._known.values() if not page.page.is_closed()]
        behind = [page for page in pages if not page.is_cover]
        next_page = next((page for page in behind if page.target == target), None)
        next_page = next_page or next((page for page in reversed(behind)), None)
        if next_page is not None and self._known[cover].is_cover:
            self._set_front(next_page.page)

    def _answer(self, route: Any) -> None:
        """Answer a request while the wall is up."""
        request = route.request
        if self._wall is None or not request.is_navigation_request():
            route.fallback()
            return
        password = parse_qs(request.post_data or "").get("password", [""])[0]
        if password == self._wall:
            self._wall = None
            route.fulfill(status=303, headers={"Location": request.url})
            return
        self.walled_documents += 1
        page = sign_in_page(is_wrong=request.method == "POST")
        route.fulfill(status=200, content_type="text/html; charset=utf-8", body=page)


class _InFront(LiveEffect):
    """Proves a page of ours by what the agent is shown: Playwright hides no page from itself."""

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Check that our page is in front of the one before."""
        browser = cast("PlaywrightBrowser", guest.desktop)
        targets = [page.target for page in browser.pages]
        facts = {"in_front": targets[-1] == record["page"], "pages": len(targets)}
        problem = ""
        if not facts["in_front"]:
            problem = "the page that was opened is not in front"
        elif record["before"] not in targets:
            problem = "the page of the task is gone"
        return Probe(not problem, facts, problem)

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Close the page; without a record, all pages of this kind."""
        browser = cast("PlaywrightBrowser", guest.desktop)
        target = record.get("page")
        for page in browser.pages:
            if page.is_cover and target in (page.target, None):
                browser.close_page(page)
        is_left = any(page.target == target for page in browser.pages)
        return Undone(not is_left, {"closed": not is_left})


class _OtherWindow(_InFront, OtherWindow):
    """Opens another application's window in front."""


class _HideWindow(_InFront, HideWindow):
    """Shows an empty desktop."""


PlaywrightBrowser.effects = MappingProxyType(
    {**BROWSER_EFFECTS, "launch_app": _OtherWindow(), "minimise": _HideWindow()}
)
