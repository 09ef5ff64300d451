"""App minimization in a recording: an inserted step on the bare desktop, undone from the panel.

The spec is `hijack_data/corruptions/app_minimization.py`, the effect on a live machine
`online_env/effects/app_minimization.py`.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

from hijack_data.apps import normalize_app
from hijack_data.pack import AssetPack
from hijack_data.plan import Effect
from hijack_data.rng import Stream

from . import screen_layout
from .base import (
    NAME_APPS,
    Answer,
    Edit,
    EditedStep,
    Frame,
    NotApplicable,
    between_bars,
    name_programs,
    recorded_apps,
)
from .whole_screens import whole_screen


class MinimiseEdit(Edit):
    """Inserts a desktop with its windows minimised, and the click that brings one back.

    That window belongs to an application of the recording, because a model could not learn which
    other window to bring back. This holds on a foreign desktop, too.
    """

    kind: ClassVar[str] = "minimise"
    event: ClassVar[str] = "All windows were minimised; only the desktop and the panel can be seen."
    answer: ClassVar[Answer] = "undo"
    inserted: ClassVar[bool] = True

    def apply(self, frame: Frame, effect: Effect) -> EditedStep:
        """Return the bare desktop; see `Edit.apply`.

        Raises:
            NotApplicable: the event cannot be shown realistically; the message is the reason.
        """
        frame.check_desktop()
        if _is_bare(frame):
            raise NotApplicable("no window is open on this screen that could be minimised")
        limited_frame = replace(frame, pack=_allowed_desktops(frame))
        description = "desktop with its windows minimised"
        screen = whole_screen(limited_frame, "desktop", description, screen_layout.desktop)
        recover = screen.asset.recover
        if recover is None:
            raise NotApplicable(f"nothing was recorded that undoes {screen.asset.id}")
        return self.make_step(
            ops=screen.ops,
            fidelity=screen.fidelity,
            response=screen.mapped(recover),
            boxes=screen.boxes,
            notes=screen.notes,
        )

    def assumed_apps(self, pack: AssetPack, stream: Stream) -> Iterator[tuple[str, ...]]:
        """Yield the applications whose minimised windows were recorded."""
        return recorded_apps(pack, ("desktop",), stream)


def _is_bare(frame: Frame) -> bool:
    """Return whether all recorded elements are in the bars of the screen."""
    first, end = between_bars(frame.scene.size)
    elements = frame.step.elements
    return bool(elements) and not any(first <= (box[1] + box[3]) // 2 < end for box in elements)


def _allowed_desktops(frame: Frame) -> AssetPack:
    """Return the pack without the desktops whose window must not be brought back.

    Raises:
        NotApplicable: the event cannot be shown realistically; the message is the reason.
    """
    desktops = frame.pack.pictures("desktop")
    allowed_desktops = [asset for asset in desktops if normalize_app(asset.app) in frame.apps]
    if not allowed_desktops and frame.apps:
        listed = ", ".join(sorted(frame.apps))
        raise NotApplicable(
            "no desktop was recorded with a minimised window of what the recording uses"
            f" ({listed}){name_programs(frame.apps)}"
        )
    if not allowed_desktops:
        raise NotApplicable(
            f"the recording does not say whose window would be minimised; {NAME_APPS}"
        )
    assets = tuple(
        asset for asset in frame.pack.assets if asset.kind != "desktop" or asset in allowed_desktops
    )
    return replace(frame.pack, assets=assets)
