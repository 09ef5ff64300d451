"""Network error in a recording: the browser's own error page instead of a page.

The spec is `hijack_data/corruptions/network_error.py`, the effect on a live machine
`online_env/effects/network_error.py`.
"""

from collections.abc import Iterator, Sequence
from typing import ClassVar

from hijack_data.apps import is_browser
from hijack_data.pack import Asset, AssetPack
from hijack_data.plan import Effect, Op, Paste
from hijack_data.rng import Stream
from hijack_data.types import Box, Point

from .base import DASH, NAME_APPS, Answer, Edit, EditedStep, Frame, NotApplicable, window_buttons
from .browser_pages import error_page
from .whole_screens import page_view, whole_screen

NO_BROWSER = (
    "the recording names no browser among its applications: a missing network would not show"
)
# Browsers for which the recorded error page fits; `browser` stands for any.
RECORDED = frozenset({"chrome", "browser"})
# The least width of a free part of a panel.
FREE = 16


class FirewallEdit(Edit):
    """Shows an error page; without a browser, a missing network changes nothing visible."""

    kind: ClassVar[str] = "firewall"
    event: ClassVar[str] = "The network was cut off; the browser shows its error page."
    answer: ClassVar[Answer] = "wait"
    reminder: ClassVar[str | None] = (
        "The page can't be reached because there is no network. Clicking on won't help: wait until"
        " it is back."
    )

    def apply(self, frame: Frame, effect: Effect) -> EditedStep:
        """Return the error page, alone or in a browser's window; see `Edit.apply`."""
        if frame.is_page:
            _check_page(frame)
            page, asset = page_view(frame, "error_view", "error page")
            note = f"{asset.id} was cut or continued to the size of the page"
            return self.make_step(ops=page, fidelity="composited", notes=(note,))
        _check_browser(frame)
        shown = whole_screen(frame, "error_page", "browser with an error page", error_page)
        return self.make_step(
            ops=tuple(_with_panels(shown.ops, shown.asset, frame.pack)),
            fidelity=shown.fidelity,
            boxes=shown.boxes,
            notes=shown.notes,
        )

    def assumed_apps(self, pack: AssetPack, stream: Stream) -> Iterator[tuple[str, ...]]:
        """Yield the browser whose error page was recorded."""
        yield ("chrome",)


def _with_panels(ops: Sequence[Op], window: Asset, pack: AssetPack) -> Iterator[Op]:
    """Yield the operations for the screen, without other windows in the desktop's window list."""
    desktops = {asset.id: asset for asset in pack.pictures("desktop")}
    for op in ops:
        yield op
        # parts of a panel are laid out to agree
        if not isinstance(op, Paste) or "crop" in op.sprite:
            continue
        below = desktops.get(str(op.sprite.get("id")))
        if below is None:
            continue
        x, y = op.at[0]
        for part, corners in _emptied(below, window):
            places = tuple((x + left, y + top) for left, top in corners)
            yield Paste(below.recipe(part), places)


def _emptied(below: Asset, window: Asset) -> Iterator[tuple[Box, list[Point]]]:
    """Yield free parts of a panel, and the places at which they cover the buttons of other windows.

    Raises `NotApplicable` if the panel has no free part.
    """
    buttons = window_buttons(below)
    title = _title(window)
    others = [
        button.box for button in buttons if title is None or not button.name.startswith(title)
    ]
    if not others:
        return
    free = _free_part(below, [button.box for button in buttons])
    start, top, end, bottom = free
    width = end - start
    for left, _, right, _ in others:
        whole = list(range(left, right - width + 1, width))
        if whole:
            yield free, [(x, top) for x in whole]
        rest = left + len(whole) * width
        if rest < right:
            yield (start, top, start + right - rest, bottom), [(rest, top)]


def _title(window: Asset) -> str | None:
    """Return the beginning of a window's title: the name of its page."""
    for target in window.targets:
        if target.role == "page-tab":
            return target.name.split(DASH)[0]
    return None


def _free_part(below: Asset, buttons: list[Box]) -> Box:
    """Return the part of a panel between the last window button and what follows it.

    Raises:
        NotApplicable: the event cannot be shown realistically; the message is the reason.
    """
    _, top, start, bottom = max(buttons, key=lambda box: box[2])
    boxes = [target.box for target in below.targets]
    rights = [box[0] for box in boxes if box[0] >= start and box[1] >= top]
    end = min(rights, default=below.size[1])
    if end - start < FREE:
        raise NotApplicable(
            "the recorded panel lists other windows than the browser's, and has no free part"
        )
    return start, top, end, bottom


def _check_browser(frame: Frame) -> None:
    """Check that a browser with the recorded error page is known to be on the screen.

    Raises:
        NotApplicable: the event cannot be shown realistically; the message is the reason.
    """
    if not any(map(is_browser, frame.apps)):
        raise NotApplicable(NO_BROWSER if frame.apps else f"{NO_BROWSER}; {NAME_APPS}")
    frame.check_desktop()
    _check_page(frame)


def _check_page(frame: Frame) -> None:
    """Check that the error page of a recording's browser, as far as it is named, was recorded.

    Raises:
        NotApplicable: it looks otherwise.
    """
    browsers = sorted(filter(is_browser, frame.apps))
    if browsers and not RECORDED.intersection(browsers):
        raise NotApplicable(
            f"the recorded error page is Chromium's, and the recording shows {', '.join(browsers)}"
        )
