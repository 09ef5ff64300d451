"""Show effects on a single screenshot without a recording, for the gallery and `hijack apply`."""

from collections.abc import Iterator
from dataclasses import replace

from hijack_data.composites import Composite
from hijack_data.pack import AssetPack
from hijack_data.plan import Effect, Plan
from hijack_data.rng import Stream
from hijack_data.types import Action, Box, Scene, Step, UInt8Array

from ..fidelity import row_fidelity
from ..readers.recording_facts import RecordedTrajectory
from . import EDITS
from .base import Edit, EditedStep, Frame, NotApplicable


def composite(
    plan: Plan, image: UInt8Array, scene: Scene, *, seed: int, sample: int | str
) -> Composite:
    """Show the effects of a plan; see `hijack_data.composites.composite`.

    Raises:
        NotApplicable: the effects cannot be shown on this screenshot.
    """
    if len(plan.effects) != 1:
        raise NotApplicable(
            f"{plan.corruption} has {len(plan.effects)} effects, and what several leave was not"
            " recorded"
        )
    (effect,) = plan.effects
    if effect.kind not in EDITS:
        raise NotApplicable(f"no edit shows the effect {effect.kind!r} on a picture")
    stream = Stream(seed, f"edit-{effect.kind}-v1", sample, 0)
    step = _edited(EDITS[effect.kind], effect, image, scene, stream)
    notes = (step.event, *step.notes, *plan.notes)
    whole = replace(plan, ops=step.ops + plan.ops, notes=notes)
    fidelity = row_fidelity(step.fidelity, is_drawn_over=bool(plan.ops))
    return Composite(whole, fidelity, step.event)


def _edited(
    edit: Edit, effect: Effect, image: UInt8Array, scene: Scene, stream: Stream
) -> EditedStep:
    """Return the edit under the first assumption about the applications that allows it."""
    pack = AssetPack.load()
    step = Step(0, "", Action("wait"), elements=tuple(_elements(scene)))
    problem = NotApplicable("nothing of it was recorded")
    for apps in _assumed(edit, scene, pack, stream):
        trajectory = RecordedTrajectory(
            "picture", "picture", "", (step,), apps=apps, screen="desktop"
        )
        # A user who asks for a picture of an effect wants one, whatever the screenshot shows.
        frame = Frame(
            trajectory=trajectory,
            step=step,
            scene=scene,
            image=image,
            pack=pack,
            stream=stream,
            allow_platform_mismatch=True,
            guess=True,
        )
        try:
            made = edit.apply(frame, effect)
        except NotApplicable as reason:
            problem = reason
            continue
        return replace(made, fidelity=row_fidelity(made.fidelity, is_foreign=frame.is_foreign))
    raise problem


def _elements(scene: Scene) -> Iterator[Box]:
    yield from map(tuple, scene.boxes.tolist())


def _assumed(
    edit: Edit, scene: Scene, pack: AssetPack, stream: Stream
) -> Iterator[tuple[str, ...]]:
    """Yield the applications that the screenshot may show: the known ones, if there are any."""
    if scene.apps:
        yield tuple(scene.apps)
        return
    yield from edit.assumed_apps(pack, stream)
