"""The script of an episode: one plan per step, computed from seed, task and screen only."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from hijack_data.corruption import make_corruption
from hijack_data.errors import HijackError, ParameterError
from hijack_data.plan import CLEAN, Effect, Plan, Resample
from hijack_data.planner import Planner, as_planner
from hijack_data.rng import Stream
from hijack_data.runs.run_planners import get_label
from hijack_data.types import BoxArray, Scene, Size, as_boxes

from ..choices import DrawingLayer
from ..desktops.capability_survey import lacks
from ..desktops.protocol import Capability, Desktop
from ..effects import find
from ..effects.base import PASSWORD
from ..effects.duration import Duration, read_delay
from ..effects.guest import Guest
from ..errors import MissingCapabilityError

BEFORE = -1  # the step number of effects before the episode


def find_planner(value: object) -> Planner | None:
    """Return the corruption with a name, or a planner unchanged; `None` for `None` and `"clean"`.

    Raises:
        UnknownNameError: No corruption has this name; the message has the closest one.
        ParameterTypeError: `value` is neither a name nor a planner.
    """
    if value is None or value == CLEAN:
        return None
    if isinstance(value, str):
        return make_corruption(value)
    return as_planner(value, "a corruption is a name or an object such as Subtitle()")


@dataclass(frozen=True)
class Script:
    """The plans of one episode.

    Args:
        planner: the corruption; `None` for a clean episode.
        seed: 0 to 2**64 - 1.
        sample: id of the task, so that every agent gets the same draws.
        apps: normalised names of the applications that the task uses.
        size: `(height, width)` of the screen.
    """

    planner: Planner | None
    seed: int
    sample: str
    apps: tuple[str, ...]
    size: Size

    def plan(self, step: int, boxes: BoxArray | None = None) -> Plan:
        """Return the plan of a step on a screen with these elements.

        Args:
            step: of the episode; `BEFORE` is before it.
            boxes: of the elements, int32 `[N, 4]`, `xyxy`; none by default.
        """
        if self.planner is None:
            return Plan.clean(self.size)
        scene = Scene(self.size, as_boxes(boxes), self.apps)
        return self.planner.plan(scene, seed=self.seed, sample=self.sample, step=step)

    def needs_tree(self, step: int) -> bool:
        """Return whether the plan of this step depends on where the elements are.

        A planner may do nothing where there are none: it is also asked about a screen with some.
        """
        if self.planner is None or not self.planner.needs_elements:
            return False
        if _acts(self.plan(step)):
            return True
        try:
            return _acts(self.plan(step, _elements_on(self.size)))
        except HijackError:  # of elements that are not there
            return True

    def stream(self, kind: str, step: int) -> Stream:
        """Return the random draws for decisions that need the live desktop."""
        return Stream(self.seed, f"effect-{kind}", self.sample, step)

    def check(
        self,
        steps: int,
        desktop: Desktop,
        *,
        layer: DrawingLayer = "picture",
        allow_code: bool = False,
    ) -> Size:
        """Plan `steps` steps ahead, and refuse a corruption that cannot work before it begins.

        Args:
            steps: the most observations after the first.
            desktop: where it is played.
            layer: who draws what plans paste; see `EvalSettings`.
            allow_code: whether the agent's actions may be any code.

        Returns:
            The size of the agent's pictures, (height, width).

        Raises:
            ParameterError: The screen is too small, the pictures have several sizes, a node of a
                page cannot do what the corruption does, two of its parts cannot act in one episode,
                or the agent may run any code, which faults of the input cannot read.
            MissingCapabilityError: The desktop lacks capabilities, all of which are named.
            UnknownNameError: An effect is of an unknown kind.
        """
        plans = self.plan_ahead(steps)
        self._check_capabilities(plans, desktop)
        if allow_code and any(plan.inputs for plan in plans):
            raise ParameterError(
                f"{get_label(self.planner)} changes the agent's input, which it reads call by call;"
                " an agent that may run any code (allow_code) cannot be played under it"
            )
        if layer == "dom" and not hasattr(desktop, "page_layer"):
            raise MissingCapabilityError(
                f"layer='dom' draws into the page of a browser, not on {type(desktop).__name__}:"
                " use layer='picture'"
            )
        return self.picture_size(plans, layer)

    def picture_size(self, plans: list[Plan], layer: DrawingLayer) -> Size:
        """Return the size of the agent's pictures, (height, width), which all plans must share.

        Args:
            plans: from `plan_ahead`.
            layer: who draws what plans paste; see `EvalSettings`.

        Raises:
            ParameterError: There are several sizes, or a node of a page is to resize the picture.
        """
        if layer == "dom" and any(isinstance(op, Resample) for plan in plans for op in plan.ops):
            raise ParameterError(
                f"{get_label(self.planner)} resizes the picture, which no node of a page can do:"
                " use the layer 'picture', or leave the corruption out"
            )
        sizes = {plan.out_size for plan in plans[1:]}
        if len(sizes) > 1:
            raise ParameterError(
                f"{get_label(self.planner)} gives pictures of {len(sizes)} sizes (height, width) in"
                f" one episode, {sorted(sizes)}; an environment has one: use"
                " Resolution(restore=True)"
            )
        return sizes.pop()

    def plan_ahead(self, steps: int) -> list[Plan]:
        """Return the plans before the episode and of steps 0 to `steps`, without elements.

        Raises:
            ParameterError: The screen is too small; two effects exclude each other; when one
                begins or ends is wrong; or one plan holds an effect or a kind of fault twice: only
                one would act.
        """
        plans = [self.plan(step) for step in range(BEFORE, steps + 1)]
        name = get_label(self.planner)
        kinds = sorted({effect.kind for plan in plans for effect in plan.effects})
        for kind in kinds:
            for other, reason in find(kind).conflicts.items():
                if other in kinds:
                    raise ParameterError(
                        f"{name} has the effects {kind!r} and {other!r}, which cannot be combined:"
                        f" {reason}; leave one of them out"
                    )
        for step, plan in enumerate(plans, BEFORE):
            for effect in plan.effects:
                _check_times(name, effect, step)
            effects = [effect.to_data() for effect in plan.effects]
            faults = [fault.fault for fault in plan.inputs]
            same = next((each for each in effects if effects.count(each) > 1), None)
            same_fault = next((each for each in faults if faults.count(each) > 1), None)
            if same is not None or same_fault is not None:
                kind = same_fault if same is None else same["effect"]
                raise ParameterError(
                    f"{name} plans {kind!r} twice at one step, of which only one would act;"
                    " give the parts different steps, or leave one out"
                )
        return plans

    def _check_capabilities(self, plans: list[Plan], desktop: Desktop) -> None:
        kinds = {effect.kind for plan in plans for effect in plan.effects}
        desktop_effects: Mapping[str, object] = getattr(desktop, "effects", dict.fromkeys(kinds))
        unknown = sorted(kinds - desktop_effects.keys())
        if unknown:
            raise MissingCapabilityError(
                f"{get_label(self.planner)} needs the effect {', '.join(unknown)}, which"
                f" {type(desktop).__name__} does not have: play it on a desktop, or leave it out"
            )
        capabilities: set[Capability] = {
            capability for kind in kinds for capability in find(kind).needs
        }
        missing = sorted(capabilities - desktop.capabilities)
        if missing:
            raise MissingCapabilityError(
                f"{get_label(self.planner)} needs {', '.join(missing)}, {lacks(desktop, missing)}"
            )
        for kind in kinds:
            find(kind, desktop).require(Guest(desktop, PASSWORD, None))


def check_plans(
    planners: Iterable[Planner | None], steps: int, size: Size, layer: DrawingLayer = "picture"
) -> None:
    """Refuse corruptions that cannot work on any desktop of this size, without one.

    Raises:
        ParameterError: The screen is too small, parts of a corruption exclude each other, pictures
            have several sizes in an episode, or a node of a page is to resize the picture.
    """
    for planner in planners:
        script = Script(planner, 0, "", (), size)
        script.picture_size(script.plan_ahead(steps), layer)


def check_corruptions(
    planners: Iterable[Planner | None],
    steps: int,
    desktop: Desktop,
    layer: DrawingLayer = "picture",
) -> None:
    """Refuse corruptions that cannot work on a desktop, before any episode begins.

    Raises:
        ParameterError: The screen is too small, or pictures have several sizes in an episode.
        MissingCapabilityError: The desktop lacks capabilities, all of which are named.
        UnknownNameError: An effect is of an unknown kind.
    """
    for planner in planners:
        Script(planner, 0, "", (), desktop.size).check(steps, desktop, layer=layer)


def _check_times(name: str, effect: Effect, step: int) -> None:
    """Check when an effect is to begin and to end, before any episode begins.

    Raises:
        ParameterError: Its parameter `begins` or `lasts` is wrong.
    """
    try:
        Duration.read(effect.params)
        if read_delay(effect.params) and step == BEFORE:
            raise ParameterError("what begins at a second is planned at step 0 or later")
    except ParameterError as error:
        raise ParameterError(f"{name}: {effect.kind}: {error}") from None


def _acts(plan: Plan) -> bool:
    return bool(plan.ops or plan.effects or any(fault.needs_elements for fault in plan.inputs))


def _elements_on(size: Size) -> BoxArray:
    """Return the boxes of a screen with nine elements, in rows of three."""
    height, width = size
    return as_boxes(
        [
            (width * i // 4, height * j // 4, width * i // 4 + width // 8, height * j // 4 + 20)
            for j in (1, 2, 3)
            for i in (0, 1, 2)
        ]
    )
