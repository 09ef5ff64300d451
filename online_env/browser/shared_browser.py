"""`SharedBrowser`: a corrupted Chromium that a DevTools client of the user drives."""

import os
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass
from typing import Any, ClassVar

from hijack_data.elements.interactive_nodes import boxes_from_tree
from hijack_data.errors import ParameterError
from hijack_data.plan import Plan, Resample
from hijack_data.planner import Planner
from hijack_data.rng import Stream
from hijack_data.types import Scene, Size, as_boxes

from ..effects import find, perform
from ..errors import DesktopError
from .cdp_relay import CdpRelay
from .desktop import BrowserDesktop
from .effects import IS_HIDDEN, IS_WALL
from .page_layer import PageLayer
from .session import LOAD_TIMEOUT_S, BrowserPage

LOOK_EVERY_S = 0.05
HIDE_TIMEOUT_S = 3.0  # for a page to notice that another one is in front
# The kinds of effects that a browser has while a client drives it.
EFFECTS = frozenset({"launch_app", "minimise", "touch", "lock"})
SAMPLE = "by hand"  # the key of the random draws
_VIEW = "[innerHeight, innerWidth, devicePixelRatio]"
_IS_DRAWN = "Boolean(globalThis.agenthijackLayer?.look().shown)"


@dataclass
class _Document:
    """A page with what was drawn into it last."""

    page: BrowserPage
    layer: PageLayer


class SharedBrowser(BrowserDesktop):
    """A Chromium with an address for Playwright, browser-use and other DevTools clients.

    What a plan pastes is drawn into each document of each tab as nodes; effects come once the first
    page of a site has loaded. When the last client has gone, Chromium starts again with a fresh
    profile at the same address, and so does the corruption.

    Args:
        size: `(height, width)` of its windows in pixels.
        planner: The corruption; `None` for none.
        seed: Decides its draws.
        headed: Whether its windows show on this machine's display.
        port: Of the loopback interface; 0 for a free one.

    Raises:
        ParameterError: A browser that a client drives cannot have the corruption, the port is in
            use, or there is no display for windows.
        MissingPackageError: There is no Chromium, or it is too old.
        DesktopError: Chromium does not start.
    """

    is_shared: ClassVar[bool] = True

    def __init__(
        self,
        size: Size = (720, 1280),
        planner: Planner | None = None,
        seed: int = 0,
        *,
        headed: bool = False,
        port: int = 0,
    ) -> None:
        if headed and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise ParameterError(
                "a browser with windows needs a display, and DISPLAY is not set: leave out --headed"
            )
        self.is_headed = headed
        self._planner = planner
        self._seed = seed
        self._is_ready = threading.Event()
        self._documents: dict[str, _Document] = {}
        self._problems: dict[str, str] = {}  # by target: what was said last
        self._pings: dict[str, Future[dict[str, Any]]] = {}  # of pages that have not answered yet
        self._is_applied = False
        self._check(self._plan(size))
        try:
            self._relay = CdpRelay(self._get_port, port)
        except OSError as error:
            raise ParameterError(f"port {port} cannot be used: {error.strerror}") from None
        try:
            super().__init__(size, 1, ("--remote-debugging-port=0",))
        except BaseException:
            self._relay.close()
            raise

    @property
    def address(self) -> str:
        """The address for `connect_over_cdp`."""
        return self._relay.address

    def begin(self, url: str = "", scripts: Sequence[str] = ()) -> None:
        """Wait for the first tab, in a Chromium with a fresh profile.

        Raises:
            DesktopError: It does not come up.
        """
        self._documents.clear()
        self._problems.clear()
        self._pings.clear()
        self._is_applied = False
        deadline = time.monotonic() + LOAD_TIMEOUT_S
        while not self.pages or not self._chromium.read_port():
            if time.monotonic() > deadline:
                raise DesktopError(f"the browser opened no tab within {LOAD_TIMEOUT_S:g} s")
            time.sleep(LOOK_EVERY_S)
        self.task_page = self.front
        self._is_ready.set()

    def cover(self, app: str = "") -> BrowserPage:
        """Open a page of ours in front, in the window of the page that the client sees."""
        behind = self.front
        info = self._devtools.call("Target.getTargetInfo", targetId=behind.target)["targetInfo"]
        self._context = info.get("browserContextId", "")
        try:
            page = super().cover(app)
        finally:
            self._context = ""
        self.show(page)
        deadline = time.monotonic() + HIDE_TIMEOUT_S
        while not self.examine(IS_HIDDEN, behind) and time.monotonic() < deadline:
            time.sleep(LOOK_EVERY_S)
        return page

    def close(self) -> None:
        """End Chromium, and stop listening."""
        super().close()
        self._relay.close()

    def follow(self) -> Iterator[str]:
        """Corrupt what clients open, until Chromium ends; yield what was done, in words.

        Raises:
            DesktopError: Chromium has ended.
        """
        while True:
            if self._relay.clients_left.is_set():
                self._is_ready.clear()
                self._relay.clients_left.clear()
                self._restart()
                yield "the client has gone; the next one begins with a fresh profile"
            if not self._devtools.is_open:
                if self._relay.clients_left.wait(LOOK_EVERY_S * 20):
                    continue  # a client has ended Chromium
                raise DesktopError(self._chromium.explain_end())
            for page in self.pages:
                if page.is_loading or page.is_cover or page.problem or not self._answers(page):
                    continue
                try:
                    yield from self._corrupt(page)
                    self._problems.pop(page.target, None)
                except DesktopError as error:
                    problem = str(error)
                    is_new = problem != self._problems.get(page.target)
                    if is_new and page in self.pages and not page.is_loading:
                        self._problems[page.target] = problem
                        yield f"{page.target}: {problem}"
            time.sleep(LOOK_EVERY_S)

    def _answers(self, page: BrowserPage) -> bool:
        """Return whether a page answers, without waiting for one that hangs or shows a dialog."""
        answer = self._pings.pop(page.target, None)
        if answer is None:
            answer = self._devtools.send("Runtime.evaluate", page.session, expression="0")
            wait([answer], LOOK_EVERY_S)
        if not answer.done():
            self._pings[page.target] = answer
        return answer.done()

    def _restart(self) -> None:
        self._disconnect()
        with self._lock:
            self._pages.clear()
            self._tabs.clear()
        self._offline = False
        self._wall = None
        self._connect()
        self.begin()

    def _get_port(self) -> int:
        """Return the port of the running Chromium, and wait while it starts again."""
        deadline = time.monotonic() + LOAD_TIMEOUT_S
        # `follow` notices later than the relay that the last client has gone.
        while self._relay.clients_left.is_set() and time.monotonic() < deadline:
            time.sleep(LOOK_EVERY_S)
        self._is_ready.wait(max(0.0, deadline - time.monotonic()))
        return self._chromium.read_port()

    def _plan(self, size: Size, tree: str | None = None) -> Plan:
        if self._planner is None:
            return Plan.clean(size)
        boxes = as_boxes(None) if tree is None else boxes_from_tree(tree, size).boxes
        scene = Scene(size, boxes, ("chrome",))
        return self._planner.plan(scene, seed=self._seed, sample=SAMPLE)

    @staticmethod
    def _check(plan: Plan) -> None:
        """Refuse what is not proved here.

        Raises:
            ParameterError: The message has the reason.
        """
        kinds = {effect.kind for effect in plan.effects}
        reason = ""
        if any(isinstance(op, Resample) for op in plan.ops):
            reason = "it resizes the picture, which no node of a page can do"
        elif plan.inputs:
            reason = "it changes the agent's input, and the client sends its own"
        elif "firewall" in kinds:
            reason = (
                "being offline is not proved while a client shares the browser: play network_error"
                " by hijack bench, or have the client switch its network off"
            )
        elif kinds - EFFECTS:
            reason = f"its effect {min(kinds - EFFECTS)} needs a desktop: play it by hijack bench"
        if reason:
            raise ParameterError(f"{plan.corruption}: {reason}")

    def _corrupt(self, page: BrowserPage) -> Iterator[str]:
        """Corrupt a page that has loaded, unless that was done.

        Raises:
            DesktopError: The page cannot hold what the plan pastes, or does not answer.
        """
        if self._planner is None or not str(self.examine("location.href", page)).startswith("http"):
            return
        if self.is_walled and not self.examine(IS_WALL, page):
            self.reload(page)  # the first document of a new tab comes before requests are caught
            return
        if self.examine(_IS_DRAWN, page):
            return
        is_new = page.target not in self._documents
        height, width, ratio = self.examine(_VIEW, page)
        size = round(height * ratio), round(width * ratio)
        tree = self.read_tree(page, ratio) if self._planner.needs_elements else None
        plan = self._plan(size, tree)
        if plan.effects and not self._is_applied:
            self._is_applied = True
            self.show(page)
            for effect in plan.effects:
                applied = perform(effect, self, Stream(self._seed, plan.corruption, SAMPLE, 0))
                probe = applied.probe()
                words = find(effect.kind, self).in_words(probe.facts)
                yield f"{effect.kind}: {probe.problem or words}"
        if plan.ops:
            document = self._documents.setdefault(page.target, _Document(page, PageLayer(self)))
            problem = document.layer.draw(plan, page, ratio)
            if problem:
                raise DesktopError(problem)
            if is_new:
                yield f"{plan.corruption} is drawn into every page of tab {page.target}"
