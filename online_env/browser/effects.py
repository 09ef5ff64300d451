"""How a browser carries out the effects of corruptions: applied, proved by a probe, and undone.

The plans are those of desktops; only what they mean here differs, and docs/browser.md says how. The
probes ask Chromium, or look at a page from an isolated world that its code cannot reach.
"""

import json
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar

from hijack_data.rng import Stream

from ..desktops.protocol import Capability
from ..effects.base import EffectError, EffectRecord, LiveEffect, Probe, Undone
from ..effects.elements import MAX_CLICKS, draw_element, live_elements, read_touch_boxes
from ..effects.guest import Guest
from .cover_pages import SIGN_IN
from .session import BrowserPage, BrowserSession

NOTES = "Notes"  # the title of the application that stands for another one
_FETCH = (
    "fetch(%s, {mode: 'no-cors', cache: 'no-store', signal: AbortSignal.timeout(3000)})"
    ".then(() => '', error => String(error))"
)
_ERROR_CODE = "document.querySelector('.error-code')?.textContent || 'error page'"
IS_HIDDEN = "document.visibilityState === 'hidden'"
IS_WALL = f"!!document.querySelector('form#{SIGN_IN} input[type=password]')"
# Notes, in our own world, the clicks that the browser itself delivered, and where they were.
_WATCH = """(() => { const seen = globalThis.clicks = []; addEventListener('click', event => {
if (event.isTrusted) seen.push([event.clientX, event.clientY]); }, true); })()"""


def _browser(guest: Guest) -> BrowserSession:
    """Return the browser.

    Raises:
        EffectError: The desktop is another one.
    """
    if not isinstance(guest.desktop, BrowserSession):
        raise EffectError(f"this effect needs a browser, not a {type(guest.desktop).__name__}")
    return guest.desktop


class _Cover(LiveEffect):
    """Opens a page of ours in front of the task's, which must be brought back."""

    app: ClassVar[str]
    needs: ClassVar[frozenset[Capability]] = frozenset({"windows"})

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Open the page."""
        browser = _browser(guest)
        front = browser.front
        page = browser.cover(self.app)
        return {"page": page.target, "before": front.target, "title": browser.title(front)}

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Check that our page is in front, and Chromium says that the former one is hidden."""
        browser = _browser(guest)
        pages = {page.target: page for page in browser.pages}
        before = pages.get(record["before"])
        facts: EffectRecord = {
            "in_front": bool(pages) and browser.pages[-1].target == record["page"],
            "hidden": before is not None and browser.examine(IS_HIDDEN, before) is True,
            "pages": len(pages),
        }
        problems = [
            text
            for text, is_wrong in (
                ("the page that was opened is not in front", not facts["in_front"]),
                ("the page of the task is gone", before is None),
                ("the page of the task is still visible", not facts["hidden"]),
            )
            if is_wrong
        ]
        return Probe(not problems, facts, "; ".join(problems))

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Close the page; without a record, all pages of this kind."""
        browser = _browser(guest)
        target = record.get("page")
        for page in browser.pages:
            if page.is_cover and target in (page.target, None):
                browser.close_page(page)
        before = _page(browser, record.get("before"))
        if before is not None and before is not browser.front:
            browser.show(before)
        is_left = any(page.target == target for page in browser.pages)
        visible = before is None or not browser.examine(IS_HIDDEN, before)
        facts = {"closed": not is_left, "visible": visible}
        problem = "" if visible and not is_left else "the page of the task is still hidden"
        return Undone(not problem, facts, problem)


class OtherWindow(_Cover):
    """Opens another application's window in front: a page with notes."""

    kind: ClassVar[str] = "launch_app"
    needs: ClassVar[frozenset[Capability]] = frozenset({"apps", "windows"})
    app: ClassVar[str] = NOTES

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Open the page, and note for which application of the plan it stands."""
        return {**super().apply(guest, params), "stands_for": str(params.get("app", ""))}


class HideWindow(_Cover):
    """Shows an empty desktop with a panel, from which the page must be brought back."""

    kind: ClassVar[str] = "minimise"
    app: ClassVar[str] = ""


class ClickElement(LiveEffect):
    """Clicks the first element, in the plan's order, that is still there.

    Buttons, which may hand a task in, are clicked only where there is nothing else.
    """

    kind: ClassVar[str] = "touch"
    needs: ClassVar[frozenset[Capability]] = frozenset({"accessibility", "windows"})
    lasting: ClassVar[bool] = False

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Draw an element and click it; draw another if the page does not get the click."""
        browser = _browser(guest)
        stream = guest.stream or Stream(0, "touch-v1")
        elements = live_elements(guest.desktop.accessibility(), browser.size)
        elements = [
            candidate for candidate in elements if candidate.role != "push-button"
        ] or elements
        record: EffectRecord = {"attempts": [], "clicked": None, "over": browser.task_is_over()}
        boxes = read_touch_boxes(params)
        while len(record["attempts"]) < MAX_CLICKS and record["clicked"] is None:
            element = draw_element(elements, boxes, stream)
            if element is None:
                break
            elements.remove(element)
            page = browser.front
            frames = browser.frame_ids(page)
            for frame in frames:
                browser.examine(_WATCH, page, frame)
            browser.input.move(element.centre)
            browser.input.click()
            delivered = page in browser.pages and _was_clicked(browser, page, frames)
            attempt = {
                "element": element.to_data(),
                "point": list(element.centre),
                "delivered": delivered,
            }
            record["attempts"].append(attempt)
            if delivered:
                record["clicked"] = attempt
        browser.wait_until_loaded()
        return record

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Check that the pointer is there, and the page got a click of the browser's own."""
        browser = _browser(guest)
        pointer = list(browser.input.position)
        facts: EffectRecord = {"attempts": record["attempts"], "pointer": pointer}
        ended = browser.task_is_over() and not record["over"]
        problem = ""
        if not record["attempts"]:
            problem = "the page has no element to click"
        elif record["clicked"] is None:
            problem = f"{len(record['attempts'])} elements were tried, and the page got no click"
        elif pointer != record["clicked"]["point"]:
            problem = f"the pointer is at {pointer}, not at {record['clicked']['point']}"
        elif ended:
            problem = (
                "the click ended the task, so this corruption has no meaning on it; leave the task"
                " or accidental_touch out"
            )
        return Probe(not problem, facts, problem)

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Do nothing: a click is an event, not a state."""
        return Undone(True, {"undone": False, "why": "a click cannot be taken back"})


class Offline(LiveEffect):
    """Switches the browser's network off; before the first action the page is loaded once more."""

    kind: ClassVar[str] = "firewall"
    needs: ClassVar[frozenset[Capability]] = frozenset({"firewall"})

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Check that the site answers, then close the network."""
        browser = _browser(guest)
        page = browser.front
        url = _failed_url(browser, page) or str(browser.evaluate("location.href", page))
        record: EffectRecord = {
            "url": url,
            "page": page.target,
            "already": browser.is_offline,
            "before": _reach(browser, page, url),
            "reloaded": not browser.acted,
        }
        browser.set_offline(True)
        if record["reloaded"]:
            browser.reload(page)
        return record

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Ask for the address once more, from the page that shows now."""
        browser = _browser(guest)
        page = _page(browser, record["page"]) or browser.front
        now = _reach(browser, page, record["url"])
        facts: EffectRecord = {
            "before": record["before"],
            "now": now,
            "on_line": browser.examine("navigator.onLine", page),
        }
        problem = ""
        if not record["before"]["ok"] and not record["already"]:
            problem = f"{record['url']} did not answer before: {record['before']['error']}"
        elif now["ok"] or facts["on_line"]:
            problem = f"{record['url']} can be reached"
        elif record["reloaded"] and not now["error_page"]:
            problem = "the page of the task shows in spite of it"
        return Probe(not problem, facts, problem)

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Switch the network on; the site must answer, and an error page gives way to it."""
        browser = _browser(guest)
        browser.set_offline(False)
        if "url" not in record:
            return Undone(True, {"on_line": True})
        page = _page(browser, record["page"]) or browser.front
        now = _reach(browser, page, record["url"])
        problem = "" if now["ok"] else f"{record['url']} is out of reach: {now['error']}"
        return Undone(now["ok"], {"on_line": True, "now": now}, problem)

    def can_be_lifted(self, guest: Guest) -> bool:
        """Return False: nothing that a page or an agent can click changes it."""
        return False


class EndSession(LiveEffect):
    """Ends the session: every page that is loaded asks for the password first."""

    kind: ClassVar[str] = "lock"
    needs: ClassVar[frozenset[Capability]] = frozenset({"lock"})

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Put up the wall and load the page in front again.

        Raises:
            EffectError: The page comes from no site.
        """
        browser = _browser(guest)
        page = browser.front
        url = str(browser.evaluate("location.href", page))
        if not url.startswith("http"):
            raise EffectError(f"{url:.80} is of no site, so no session can end there")
        browser.set_wall(guest.password)
        browser.reload(page)
        return {"url": url, "page": page.target}

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Look at the page in front: it must be the wall instead of the task's page."""
        browser = _browser(guest)
        facts = {
            "walled": browser.is_walled,
            "documents": browser.walled_documents,
            "form": browser.examine(IS_WALL) is True,
        }
        problem = ""
        if not facts["walled"]:
            problem = "the password was given, or the wall was never up"
        elif not facts["form"] or not facts["documents"]:
            problem = "the page in front is not the sign-in page"
        return Probe(not problem, facts, problem)

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Take the wall away, and load the pages that show it."""
        browser = _browser(guest)
        by = "force" if browser.is_walled else "was not up"
        browser.set_wall(None)
        for page in browser.pages:
            if browser.examine(IS_WALL, page):
                browser.reload(page)
        is_left = any(browser.examine(IS_WALL, page) for page in browser.pages)
        return Undone(not is_left, {"by": by}, "the sign-in page still shows" if is_left else "")


BROWSER_EFFECTS: Mapping[str, LiveEffect] = MappingProxyType(
    {
        effect.kind: effect
        for effect in (OtherWindow(), HideWindow(), ClickElement(), Offline(), EndSession())
    }
)


def _page(browser: BrowserSession, target: object) -> BrowserPage | None:
    return next((page for page in browser.pages if page.target == target), None)


def _reach(browser: BrowserSession, page: BrowserPage, url: str) -> EffectRecord:
    """Return whether a page reaches an address now, and its error.

    An error page is loaded again, as a user would. From another page, our own world asks, which
    may ask what the page may not; it does not read the answer.
    """
    if not url.startswith("http"):
        return {"ok": False, "error": "it is of no site", "error_page": False}
    if _failed_url(browser, page):
        browser.reload(page)
        failed = bool(_failed_url(browser, page))
        error = str(browser.evaluate(_ERROR_CODE, page)) if failed else ""
        return {"ok": not failed, "error": error, "error_page": failed}
    error = str(browser.examine(_FETCH % json.dumps(url), page))
    return {"ok": not error, "error": error, "error_page": False}


def _failed_url(browser: BrowserSession, page: BrowserPage) -> str:
    """Return the address that a page could not load and shows an error for; "" if it loaded."""
    frame = browser.call("Page.getFrameTree", page)["frameTree"]["frame"]
    return str(frame.get("unreachableUrl", ""))


def _was_clicked(browser: BrowserSession, page: BrowserPage, frames: Sequence[str]) -> bool:
    """Return whether one of a page's frames got a click since; a frame that changed did."""
    remaining = browser.frame_ids(page)
    return any(
        frame not in remaining or browser.examine("globalThis.clicks?.length", page, frame) != 0
        for frame in frames
    )
