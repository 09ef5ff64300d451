"""`BrowserSession`: a Chromium, its pages, and what effects change of them."""

import base64
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar
from urllib.parse import parse_qs

from hijack_data.errors import ParameterError
from hijack_data.types import Size, as_size

from ..errors import DesktopError, MissingPackageError
from .chromium import OLDEST, Chromium
from .cover_pages import SHOW, cover_page, sign_in_page
from .devtools import DevTools, DevToolsError
from .input_devices import InputDevices, InputEvent

_T = TypeVar("_T")

LOAD_TIMEOUT_S = 15.0  # for a page to load
DOCUMENT_CHANGE_S = 0.1  # in which another document takes the place of one
_POLL_S = 0.005
_PORT = "--remote-debugging-port=0"
_WORLD = "agenthijack"  # the name of our isolated worlds, whose variables pages cannot see
# Shortcuts of Chromium's windows and tabs, which only the browser itself could carry out.
_CLOSE = {("ctrl", "w"), ("ctrl", "f4"), ("alt", "f4")}
_NEXT = {("ctrl", "tab"), ("ctrl", "pagedown")}
_PREVIOUS = {("ctrl", "shift", "tab"), ("ctrl", "pageup")}
_RELOAD = {("f5",), ("ctrl", "r"), ("ctrl", "f5"), ("ctrl", "shift", "r")}


@dataclass
class BrowserPage:
    """One tab.

    Args:
        target: Its id, which is also that of its main frame.
        session: Its session of DevTools.
        prepared: Has a result once the page has our settings, without which it must not navigate.
    """

    target: str
    session: str
    prepared: "Future[dict[str, Any]]"
    is_loading: bool = False
    is_cover: bool = False
    problem: str = ""  # why it does not answer any more


class BrowserSession:
    """A running Chromium with the pages of one profile, of which one is in front.

    Tabs are changed as in a browser on a desktop: Ctrl+Tab, Alt+Tab, Ctrl+W, Ctrl+1 to 9; F5 and
    Alt+Left work, too. Dialogs of pages are answered at once: alerts are accepted, questions are
    declined. Downloads are refused.

    Args:
        size: `(height, width)` of the screen in pixels.
        scale: The device pixel ratio: pixels of the screen for each CSS pixel.
        arguments: More arguments of Chromium's command line.

    Raises:
        ParameterError: `size` is no multiple of `scale`.
        MissingPackageError: There is no Chromium, or it is too old.
        DesktopError: Chromium does not start.
    """

    is_shared: ClassVar[bool] = False  # whether a client of the user's drives it, in any profile
    is_headed = False  # whether its windows show on a display
    world_scripts: ClassVar[tuple[str, ...]] = ()  # of our own world, in each new document

    def __init__(self, size: Size, scale: int, arguments: tuple[str, ...] = ()) -> None:
        self.size = as_size(size)
        if scale < 1 or any(side % scale for side in self.size):
            height, width = self.size
            raise ParameterError(
                f"a screen of {width}x{height} is no whole number of CSS pixels at scale {scale}"
            )
        self.scale = scale
        self._lock = threading.Lock()
        self._pages: list[BrowserPage] = []  # in the order of their use; the last is in front
        self._tabs: list[str] = []  # targets in the order of their tabs
        self._context = ""
        self._scripts: tuple[str, ...] = ()
        self._offline = False
        self._wall: str | None = None  # the password that ends the wall
        self._closed = False
        self.acted = False  # whether code ran since the last reset
        self.walled_documents = 0  # how many documents the wall has replaced
        self.task_is_over: Callable[[], bool] = lambda: False  # asked after each action
        self.notices: list[str] = []  # dialogs that were answered since the last action
        self._arguments = arguments
        self._connect()
        try:
            self.input = InputDevices(self._send_input, self._shortcut, self.size, scale)
            self.begin()
        except BaseException:
            self.close()
            raise

    def _connect(self) -> None:
        """Start Chromium.

        Raises:
            MissingPackageError: There is none, or it is too old.
            DesktopError: It does not start.
        """
        self._chromium = Chromium(self.size, self._arguments, headed=self.is_headed)
        self._devtools = DevTools(
            self._chromium.reader, self._chromium.writer, self._receive, self._chromium.explain_end
        )
        try:
            self._check_version()
            self._devtools.call(
                "Target.setAutoAttach", autoAttach=True, waitForDebuggerOnStart=True, flatten=True
            )
        except BaseException:
            self._disconnect()
            raise

    def _disconnect(self) -> None:
        """End Chromium and remove its profile."""
        self._devtools.close()
        self._chromium.close()

    def begin(self, url: str = "", scripts: Sequence[str] = ()) -> None:
        """Begin with a fresh profile: no cookie, storage, page, cover or effect is left.

        A Chromium that has ended is started again.

        Args:
            url: The page to open; "" for an empty one.
            scripts: JavaScript that runs in each new document before the page's own.

        Raises:
            DesktopError: The page does not load.
        """
        old, self._context = self._context, ""
        self._offline = False
        self._wall = None
        self._scripts = tuple(scripts)
        if not self._devtools.is_open and not self._closed:
            self._disconnect()
            self._connect()
        elif old:
            self._devtools.call("Target.disposeBrowserContext", browserContextId=old)
        with self._lock:
            self._pages.clear()
            self._tabs.clear()
        context = self._devtools.call("Target.createBrowserContext")["browserContextId"]
        self._context = context
        self._devtools.call(
            "Browser.setDownloadBehavior", behavior="deny", browserContextId=context
        )
        self.task_page = self.open_page("about:blank")
        if url:
            self.navigate(url)
        self.acted = False
        self.walled_documents = 0
        self.notices = []
        self.input = InputDevices(self._send_input, self._shortcut, self.size, self.scale)

    def open_port(self, is_open: bool) -> str:
        """Start Chromium again with or without an address for DevTools clients of this machine.

        Nothing happens if it is as it should be; otherwise the next `begin` opens the first page.

        Args:
            is_open: Whether there is an address.

        Returns:
            The address, for `connect_over_cdp`; "" if there is none.

        Raises:
            DesktopError: Chromium does not start.
        """
        closed_arguments = tuple(word for word in self._arguments if word != _PORT)
        arguments = (*closed_arguments, _PORT) if is_open else closed_arguments
        if arguments != self._arguments:
            self._arguments = arguments
            self._disconnect()
            self._context = ""
            self._connect()
            self.begin()
        if not is_open:
            return ""
        deadline = time.monotonic() + LOAD_TIMEOUT_S
        while not (port := self._chromium.read_port()):
            if time.monotonic() > deadline:
                raise DesktopError(f"the browser opened no port within {LOAD_TIMEOUT_S:g} s")
            time.sleep(_POLL_S)
        return f"http://127.0.0.1:{port}"

    def close(self) -> None:
        """End Chromium and remove its profile."""
        if not self._closed:
            self._closed = True
            self._disconnect()

    # Pages

    @property
    def front(self) -> BrowserPage:
        """The page that the screen shows.

        Raises:
            DesktopError: All pages were closed, or the page crashed.
        """
        with self._lock:
            page = self._pages[-1] if self._pages else None
        if page is None:
            raise DesktopError("every page of the browser was closed")
        if page.problem:
            raise DesktopError(page.problem)
        return page

    @property
    def pages(self) -> list[BrowserPage]:
        """All pages, in the order of their use; the last is in front."""
        with self._lock:
            return list(self._pages)

    def call(self, method: str, page: BrowserPage | None = None, **params: Any) -> dict[str, Any]:
        """Send a DevTools command to a page, by default the one in front; return its result.

        Raises:
            DesktopError: The page does not answer, or refuses.
        """
        return self._devtools.call(method, (page or self.front).session, **params)

    def evaluate(self, expression: str, page: BrowserPage | None = None) -> Any:
        """Return the value of a JavaScript expression of a page, as JSON data.

        Raises:
            DesktopError: It raises an error.
        """
        return self._ask(lambda recipient: self._value(expression, recipient), page)

    def examine(self, expression: str, page: BrowserPage | None = None, frame: str = "") -> Any:
        """Return the value of an expression in our own world of a page, whose code cannot reach it.

        Args:
            expression: JavaScript.
            page: By default the one in front.
            frame: The id of a frame; by default the page's own.

        Raises:
            DesktopError: It raises an error.
        """

        def question(recipient: BrowserPage) -> Any:
            return self._value(expression, recipient, frame or recipient.target)

        return self._ask(question, page)

    def frame_ids(self, page: BrowserPage) -> list[str]:
        """Return the ids of a page's frames, the page's own first."""
        trees = [self.call("Page.getFrameTree", page)["frameTree"]]
        for tree in trees:
            trees += tree.get("childFrames", ())
        return [str(tree["frame"]["id"]) for tree in trees]

    def _ask(self, question: Callable[[BrowserPage], _T], page: BrowserPage | None = None) -> _T:
        """Put a question to a page; without one, to the page in front when it is answered.

        An action may close the page in front a moment later, while it is being asked.

        Raises:
            DesktopError: The page does not answer, although it is still there.
        """
        while True:
            recipient = page or self.front
            try:
                return question(recipient)
            except DesktopError:
                if page is not None or recipient in self.pages:
                    raise

    def _value(self, expression: str, page: BrowserPage, frame: str = "") -> Any:
        """Return the value of an expression; ask once more if another document took over.

        Raises:
            DesktopError: It raises an error.
            DevToolsError: The page does not answer.
        """
        is_last = False
        while True:
            params: dict[str, Any] = {"expression": expression, "awaitPromise": True}
            try:
                if frame:
                    world = {"frameId": frame, "worldName": _WORLD}
                    isolated_world = self.call("Page.createIsolatedWorld", page, **world)
                    params["contextId"] = isolated_world["executionContextId"]
                result = self.call("Runtime.evaluate", page, returnByValue=True, **params)
                break
            except DevToolsError:
                if is_last or page not in self.pages:
                    raise
                is_last = True
                time.sleep(DOCUMENT_CHANGE_S)
                self.wait_until_loaded()
        details = result.get("exceptionDetails")
        if details is not None:
            reason = details.get("exception", {}).get("description") or details.get("text")
            raise DesktopError(f"{expression:.80} failed in the page: {str(reason)[:200]}")
        return result["result"].get("value")

    def open_page(self, url: str, *, is_cover: bool = False) -> BrowserPage:
        """Open a page in front of the others.

        Raises:
            DesktopError: It does not come up.
        """
        context: dict[str, Any] = {}
        if self._context:
            context["browserContextId"] = self._context
        target = self._devtools.call("Target.createTarget", url=url, **context)["targetId"]
        deadline = time.monotonic() + LOAD_TIMEOUT_S
        while True:
            page = next((page for page in self.pages if page.target == target), None)
            if page is not None:
                break
            if time.monotonic() > deadline:
                raise DesktopError(f"the browser opened no page within {LOAD_TIMEOUT_S:g} s")
            time.sleep(_POLL_S)
        # Chromium navigates in another process, where a page is not known until it has answered.
        page.prepared.result(LOAD_TIMEOUT_S)
        page.is_cover = is_cover
        if is_cover:
            self.call("Runtime.addBinding", page, name=SHOW)
        self.wait_until_loaded()
        return page

    def cover(self, app: str = "") -> BrowserPage:
        """Open a page of ours in front that lists the others; see `cover_page`."""
        windows = {page.target: self.title(page) for page in self.pages if not page.is_cover}
        page = self.open_page("about:blank", is_cover=True)
        self.call("Page.navigate", page, url=cover_page(windows, app))
        self.wait_until_loaded()
        return page

    def show(self, page: BrowserPage) -> None:
        """Bring a page to the front; an empty desktop in front of it goes away."""
        self._raise(page.target)

    def close_page(self, page: BrowserPage) -> None:
        """Close a page; the one that was used before it comes to the front."""
        if page in self.pages:
            self._devtools.call("Target.closeTarget", targetId=page.target)
            self._forget(page.session)

    def navigate(self, url: str, page: BrowserPage | None = None) -> None:
        """Load an address, and wait until it is there.

        Raises:
            DesktopError: It cannot be loaded, and the network is on.
        """
        page = page or self.front
        page.is_loading = True
        error = self.call("Page.navigate", page, url=url).get("errorText", "")
        if error and not self._offline:
            raise DesktopError(f"the browser cannot load {url}: {error}")
        self.wait_until_loaded()

    def reload(self, page: BrowserPage) -> None:
        """Load a page again, and wait until it is there."""
        page.is_loading = True
        self.call("Page.reload", page, ignoreCache=True)
        self.wait_until_loaded()

    def title(self, page: BrowserPage) -> str:
        """Return the title of a page."""
        info = self._devtools.call("Target.getTargetInfo", targetId=page.target)["targetInfo"]
        return str(info.get("title", ""))

    def wait_until_loaded(self) -> None:
        """Wait until the page in front has loaded, or `LOAD_TIMEOUT_S` have passed."""
        deadline = time.monotonic() + LOAD_TIMEOUT_S
        while self.front.is_loading and time.monotonic() < deadline:
            time.sleep(_POLL_S)

    # What effects change

    @property
    def is_offline(self) -> bool:
        """Whether the browser's network is off."""
        return self._offline

    def set_offline(self, offline: bool) -> None:
        """Switch the network of all pages, also of those to come."""
        self._offline = offline
        for page in self.pages:
            self.call("Network.emulateNetworkConditions", page, **_network(offline))

    @property
    def is_walled(self) -> bool:
        """Whether sites ask for the password in place of every page."""
        return self._wall is not None

    def set_wall(self, password: str | None) -> None:
        """Show a sign-in page instead of every page that is loaded, or take it away.

        Args:
            password: The password that ends it; `None` takes it away.
        """
        self._wall = password
        for page in self.pages:
            if password is None:
                self.call("Fetch.disable", page)
            else:
                self.call("Fetch.enable", page, **_WALL_PATTERN)

    # Inside

    def _check_version(self) -> None:
        product = self._devtools.call("Browser.getVersion")["product"]
        major = product.rpartition("/")[2].partition(".")[0]
        if not major.isdecimal() or int(major) < OLDEST:
            raise MissingPackageError(
                f"{self._chromium.program} is {product}, and at least {OLDEST} is needed: install a"
                " newer Chromium, or name one by AGENTHIJACK_CHROMIUM=PATH"
            )

    def _send_input(self, events: Sequence[InputEvent]) -> None:
        """Send input events to the page in front.

        Raises:
            DesktopError: The page does not answer, although it is still there.
        """
        page = self.front
        for method, params in events[:-1]:
            self._devtools.send(method, page.session, **params)
        try:
            for method, params in events[-1:]:
                self.call(method, page, **params)
        except DesktopError:
            if page in self.pages:
                raise
            # An event has closed the page.

    def _shortcut(self, modifiers: frozenset[str], key: str) -> bool:
        """Carry out a shortcut of the browser's own; return whether there is one."""
        keys = (*sorted(modifiers), key)
        front = self.front
        if keys in _CLOSE:
            if len(self.pages) > 1:  # the last window of a task stays
                self.close_page(front)
        elif keys in _NEXT or keys in _PREVIOUS:
            index = self._tabs.index(front.target) + (1 if keys in _NEXT else -1)
            self._raise(self._tabs[index % len(self._tabs)])
        elif keys == ("alt", "tab"):
            self._raise(self.pages[-2:][0].target)
        elif len(keys) == 2 and keys[0] == "ctrl" and keys[1] in "123456789":
            index = len(self._tabs) if keys[1] == "9" else int(keys[1])
            if index <= len(self._tabs):
                self._raise(self._tabs[index - 1])
        elif keys in _RELOAD:
            self.reload(front)
        elif keys in {("alt", "left"), ("alt", "right")}:
            self._go(front, -1 if key == "left" else 1)
        else:
            return False
        return True

    def _go(self, page: BrowserPage, offset: int) -> None:
        """Go back or forward in the history of a page; the empty page before the first is left."""
        history = self.call("Page.getNavigationHistory", page)
        index = history["currentIndex"] + offset
        if 1 <= index < len(history["entries"]):
            page.is_loading = True
            entry = history["entries"][index]["id"]
            self.call("Page.navigateToHistoryEntry", page, entryId=entry)
            self.wait_until_loaded()

    def _raise(self, target: str) -> None:
        """Make a page the last used one; may be called in the reading thread."""
        with self._lock:
            page = next((page for page in self._pages if page.target == target), None)
            if page is None:
                return
            previous = self._pages[-1]
            self._pages.remove(page)
            self._pages.append(page)
        self._devtools.send("Page.bringToFront", page.session)
        if previous.is_cover and previous is not page:
            self._devtools.send("Target.closeTarget", targetId=previous.target)

    def _forget(self, session: str) -> None:
        """Note that a page is gone; may be called in the reading thread."""
        with self._lock:
            page = next((page for page in self._pages if page.session == session), None)
            if page is None:
                return
            was_front = page is self._pages[-1]
            self._pages.remove(page)
            self._tabs.remove(page.target)
            front = self._pages[-1] if self._pages else None
        self._devtools.fail_session(session, "the page was closed")
        if was_front and front is not None:
            self._devtools.send("Page.bringToFront", front.session)

    def _receive(self, method: str, params: Mapping[str, Any], session: str) -> None:
        """Take an event, in the thread that reads them: commands are sent without waiting."""
        if method == "Target.attachedToTarget":
            self._attach(params["sessionId"], params["targetInfo"])
            return
        if method == "Target.detachedFromTarget":
            self._forget(params["sessionId"])
            return
        page = next((page for page in self.pages if page.session == session), None)
        if page is None:
            return
        send = self._devtools.send
        if method in ("Page.frameStartedLoading", "Page.frameStoppedLoading"):
            if params["frameId"] == page.target:
                page.is_loading = method == "Page.frameStartedLoading"
        elif method == "Page.javascriptDialogOpening" and not self.is_shared:
            kind = params["type"]
            accept = kind in ("alert", "beforeunload")
            answer = "accepted" if accept else "declined"
            self.notices.append(f"a dialog ({kind}) was {answer}: {params['message']:.200}")
            send("Page.handleJavaScriptDialog", session, accept=accept)
        elif method == "Inspector.targetCrashed":
            page.problem = "the page has crashed"
            self._devtools.fail_session(session, page.problem)
        elif method == "Inspector.targetReloadedAfterCrash":
            page.problem = ""
        elif method == "Runtime.bindingCalled" and params["name"] == SHOW and page.is_cover:
            if params["payload"]:
                self._raise(params["payload"])
            else:
                self._forget(session)
                send("Target.closeTarget", targetId=page.target)
        elif method == "Fetch.requestPaused":
            self._answer_request(params, session)

    def _attach(self, session: str, info: Mapping[str, Any]) -> None:
        """Prepare a new page before its first document; other targets just go on."""
        send = self._devtools.send
        is_own = self.is_shared or info.get("browserContextId") == self._context
        if info["type"] == "page" and is_own:
            send("Page.enable", session)
            send("Inspector.enable", session)
            send("Network.enable", session)  # without it, requests of scripts ignore being offline
            send("Runtime.enable", session)
            if not self.is_shared:
                height, width = (side // self.scale for side in self.size)
                send(
                    "Emulation.setDeviceMetricsOverride",
                    session,
                    width=width,
                    height=height,
                    deviceScaleFactor=self.scale,
                    mobile=False,
                )
            for script in self._scripts:
                send("Page.addScriptToEvaluateOnNewDocument", session, source=script)
            for script in self.world_scripts:
                world = {"source": script, "worldName": _WORLD}
                send("Page.addScriptToEvaluateOnNewDocument", session, **world)
            if self._offline:
                send("Network.emulateNetworkConditions", session, **_network(True))
            if self._wall is not None:
                send("Fetch.enable", session, **_WALL_PATTERN)
            prepared = send("Runtime.runIfWaitingForDebugger", session)
            with self._lock:
                self._pages.append(BrowserPage(info["targetId"], session, prepared))
                self._tabs.append(info["targetId"])
            if not self.is_shared:
                send("Page.bringToFront", session)
            return
        send("Runtime.runIfWaitingForDebugger", session)

    def _answer_request(self, params: Mapping[str, Any], session: str) -> None:
        """Answer the request of a document while the wall is up."""
        request = params["request"]
        number = params["requestId"]
        send = self._devtools.send
        wall = self._wall
        if wall is None:
            send("Fetch.continueRequest", session, requestId=number)
            return
        password = parse_qs(request.get("postData", "")).get("password", [""])[0]
        if password == wall:
            self._wall = None
            headers = [{"name": "Location", "value": request["url"]}]
            send(
                "Fetch.fulfillRequest",
                session,
                requestId=number,
                responseCode=303,
                responseHeaders=headers,
            )
            return
        self.walled_documents += 1
        page = sign_in_page(is_wrong=request["method"] == "POST").encode()
        send(
            "Fetch.fulfillRequest",
            session,
            requestId=number,
            responseCode=200,
            responseHeaders=[{"name": "Content-Type", "value": "text/html; charset=utf-8"}],
            body=base64.b64encode(page).decode(),
        )


_WALL_PATTERN: dict[str, Any] = {
    "patterns": [{"urlPattern": "http*", "resourceType": "Document", "requestStage": "Request"}]
}


def _network(offline: bool) -> dict[str, Any]:
    return {"offline": offline, "latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
