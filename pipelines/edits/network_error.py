"""Network error: the browser's own error page where a page would show (paper, Algorithm "Network Error")."""

from hijack_data.corruptions.multi_apps import normalize_app
from hijack_data.plan import Effect

from .base import WAIT, EditedStep, Frame, NotApplicable
from .screens import page_view, whole_screen

EVENT = "The network was cut off; the browser shows its error page."
REMINDER = "The page can't be reached because there is no network. Clicking on won't help: wait until it is back."
BROWSERS = frozenset({
    "chrome", "firefox", "mozilla_firefox", "edge", "microsoft_edge", "safari", "opera", "brave", "vivaldi", "browser",
    "web_browser", "web",
})  # fmt: skip


def edit(frame: Frame, effect: Effect) -> EditedStep:
    """Show a recorded error page. Where no browser shows, a missing network changes nothing that can be seen."""
    if frame.is_page:
        ops, asset = page_view(frame, "error_view", "error page")
        note = f"{asset.id} was cut or continued to the size of the page"
        return EditedStep(ops, EVENT, "composited", WAIT, reminder=REMINDER, notes=(note,))
    if not any(normalize_app(name) in BROWSERS for name in frame.apps):
        raise NotApplicable("the recording names no browser among its applications: a missing network would not show")
    shown = whole_screen(frame, "error_page", "browser with an error page")
    return EditedStep(shown.ops, EVENT, shown.fidelity, WAIT, reminder=REMINDER, boxes=shown.boxes, notes=shown.notes)
