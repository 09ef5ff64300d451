"""App minimization: a step on the bare desktop, undone from the panel (paper, Algorithm "App Minimization")."""

from hijack_data.corruptions.multi_apps import normalize_app
from hijack_data.plan import Effect

from .base import EditedStep, Frame, NotApplicable
from .screens import whole_screen

EVENT = "All windows were minimised; only the desktop and the panel can be seen."


def edit(frame: Frame, effect: Effect) -> EditedStep:
    """Insert a recorded desktop whose windows are minimised, and the click on the panel that brought one back."""
    names = {asset.app for asset in frame.pack.pictures("desktop") if normalize_app(asset.app) in frame.apps}
    shown = whole_screen(frame, "desktop", "desktop with its windows minimised", frozenset(names))
    if shown.asset.recover is None:
        raise NotApplicable(f"nothing was recorded that undoes {shown.asset.id}")
    deed = shown.deed(shown.asset.recover)
    return EditedStep(shown.ops, EVENT, shown.fidelity, deed, inserted=True, boxes=shown.boxes, notes=shown.notes)
