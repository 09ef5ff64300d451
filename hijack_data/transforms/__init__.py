"""Corruptions as torchvision v2 transforms.

    import hijack_data.transforms as tr

    train = v2.Compose([tr.OneOf([tr.PopUps(), tr.Marks(), tr.Subtitle()], seed=3, p_clean=0.2),
    v2.ToDtype(...)])

A sample is a dictionary, a tuple with a dictionary in it, or a picture alone. Its pictures are PIL
images, uint8 tensors `[3, H, W]` or NumPy and JAX arrays `[H, W, 3]`, also lists and stacks of
them (`[T, 3, H, W]`), that are the sample itself, the first item of a tuple, or under a name of a
picture (`hijack_data.sample_pictures`); all of them follow one plan. Bounding boxes, key points and
masks of `tv_tensors` follow the pixels, and so do the entries that `hijack_data.samples` names and
those that `labels=` declares. If the size changes, any other entry that is not harmless by its type
is an error (`hijack_data.labels.undeclared_entries`).

The `id` of a sample, the seed and the epoch decide its corruption, not the worker, the order or a
global generator. A batch has a list of ids, and a picture, list or stack of pictures for each; it
gets a plan for each id.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from collections.abc import Sequence as SequenceOf
from types import MappingProxyType
from typing import Any

from .. import compose, corruptions, extras
from ..config import load_config
from ..corruption import SETS, Corruption, corruption_names, find_corruption
from ..errors import ParameterError, ParameterTypeError, suggest
from ..plan import Plan
from ..planner import Planner
from ..sample_pictures import SamplePicture
from ..types import Size

extras.require("hijack_data.transforms", "torch", ("torch", "torchvision"))

from .base import Corrupt, unwrap_planner  # noqa: E402 - these import torch
from .sample_parts import PICTURE_KEYS, DatasetRow, sample_content_id  # noqa: E402
from .signatures import explicit  # noqa: E402

__all__ = [
    "PICTURE_KEYS",
    "Corrupt",
    "FromConfig",
    "Marks",
    "OneOf",
    "PopUps",
    "Replay",
    "Resolution",
    "Schedule",
    "Sequence",
    "Subtitle",
]


class _Named(Corrupt):
    """A transform named after one corruption."""

    spec: type[Corruption]
    defaults: Mapping[str, Any] = MappingProxyType({})

    def __init__(self, *, severity: int | None = None, **values: Any) -> None:
        names = inspect.signature(Corrupt).parameters
        shared = {key: values.pop(key) for key in names if key in values}
        level = 3 if severity is None else severity
        super().__init__(self.spec.at(level, **{**self.defaults, **values}), **shared)


@explicit(corruptions.PopUps)
class PopUps(_Named):
    """Covers a part of each screen with a pop-up window that asks to be clicked.

    Raises:
        UnknownNameError: an argument is not a parameter; the message suggests the closest one.
        ParameterError: a value is out of its range.
        ParameterTypeError: a value has the wrong type.

    Examples:
        >>> corrupt = tr.PopUps(seed=3, small_factor=2)
        >>> corrupt({"image": image, "id": "traj-3/0"})["image"].shape  # uint8 [3, H, W]
        torch.Size([3, 1080, 1920])
    """

    spec = corruptions.PopUps


@explicit(corruptions.Marks)
class Marks(_Named):
    """Strews stars, circles or rectangles over each screen.

    Raises:
        UnknownNameError: an argument is not a parameter; the message suggests the closest one.
        ParameterError: a value is out of its range.
        ParameterTypeError: a value has the wrong type.

    Examples:
        >>> corrupt = tr.Marks(seed=3, number=100, color="blue")
        >>> corrupt({"image": image, "id": "traj-3/0"})["image"].shape  # uint8 [3, H, W]
        torch.Size([3, 1080, 1920])
    """

    spec = corruptions.Marks


@explicit(corruptions.Subtitle, defaults={"fit": "shrink"})
class Subtitle(_Named):
    """Writes outlined lines of text at the top, centre or bottom of each screen.

    Lines that do not fit a picture are shrunk, since pictures of a training set differ in size;
    `fit="error"` raises instead.

    Raises:
        UnknownNameError: an argument is not a parameter; the message suggests the closest one.
        ParameterError: a value is out of its range.
        ParameterTypeError: a value has the wrong type.

    Examples:
        >>> corrupt = tr.Subtitle(seed=3, position="top")
        >>> corrupt({"image": image, "id": "traj-3/0"})["image"].shape  # uint8 [3, H, W]
        torch.Size([3, 1080, 1920])
    """

    spec = corruptions.Subtitle
    defaults = MappingProxyType({"fit": "shrink"})


@explicit(corruptions.Resolution)
class Resolution(_Named):
    """Resizes each screen; boxes, points and actions of the sample follow the pixels.

    `restore=True` scales back, and keeps the shape of the batch.

    Raises:
        UnknownNameError: an argument is not a parameter; the message suggests the closest one.
        ParameterError: a value is out of its range.
        ParameterTypeError: a value has the wrong type.

    Examples:
        >>> corrupt = tr.Resolution(seed=3, scale=0.5)
        >>> corrupt({"image": image, "id": "traj-3/0"})["image"].shape  # uint8 [3, H/2, W/2]
        torch.Size([3, 540, 960])
    """

    spec = corruptions.Resolution


@explicit()
class OneOf(Corrupt):
    """One of several corruptions, drawn for each sample.

    Args:
        options: corruptions, combinators or transforms.
        p_clean: probability that a sample stays clean, 0..1.
        weights: relative weights of the options, finite and >= 0; equal by default.

    Raises:
        ParameterError: there are no options, or a number is out of its range.
        ParameterTypeError: an option plans nothing, or a value has the wrong type.

    Examples:
        >>> corrupt = tr.OneOf([tr.Marks(), tr.Subtitle()], seed=3, p_clean=0.2, weights=[2, 1])
        >>> corrupt({"image": image, "id": "traj-3/0"})["image"].shape  # uint8 [3, H, W]
        torch.Size([3, 1080, 1920])
    """

    def __init__(
        self,
        options: Iterable[Planner | Corrupt],
        *,
        p_clean: float = 0.0,
        weights: SequenceOf[float] | None = None,
        **shared: Any,
    ) -> None:
        planners = [unwrap_planner(option) for option in options]
        planner = compose.OneOf(planners, p_clean=p_clean, weights=weights)
        super().__init__(planner, **shared)


@explicit()
class Sequence(Corrupt):
    """Several corruptions of each sample, one after the other.

    Args:
        parts: corruptions, combinators or transforms, in their order.

    Raises:
        ParameterError: there are no parts, or a number is out of its range.
        ParameterTypeError: a part plans nothing, or a value has the wrong type.

    Examples:
        >>> corrupt = tr.Sequence([tr.Resolution(scale=0.5), tr.Marks()], seed=3)
        >>> corrupt({"image": image, "id": "traj-3/0"})["image"].shape  # uint8 [3, H/2, W/2]
        torch.Size([3, 540, 960])
    """

    def __init__(self, parts: Iterable[Planner | Corrupt], **shared: Any) -> None:
        super().__init__(compose.Sequence([unwrap_planner(part) for part in parts]), **shared)


@explicit()
class Schedule(Corrupt):
    """A corruption that changes with the epoch.

    Args:
        at: called with the epoch, an integer >= 0, returns the planner for it; must be picklable (a
            module-level function) for workers.

    Raises:
        ParameterTypeError: `at` is not callable, or returns something that plans nothing.

    Examples:
        >>> def harder(epoch):
        ...     return hj.Marks(number=10 * (1 + epoch))
        >>> corrupt = tr.Schedule(harder, seed=3)
        >>> corrupt.set_epoch(2)
        >>> corrupt({"image": image, "id": "traj-3/0"})["image"].shape  # uint8 [3, H, W]
        torch.Size([3, 1080, 1920])
    """

    def __init__(self, at: Callable[[int], Planner], **shared: Any) -> None:
        super().__init__(compose.Schedule(at), **shared)


@explicit()
class FromConfig(Corrupt):
    """One of a configuration's corruptions for each sample, or always the one named `label`.

    Args:
        source: a path, the name of a packaged configuration, or a mapping; see
            `hijack_data.config`.
        label: use this entry only.
        p_clean: probability that a sample stays clean, 0..1.
        seed: 0 to 2**64 - 1; the configuration's by default.
        label_policy: `"keep"`, or `"avoid"` to draw again until the sample's target (of a drag,
            both ends) is visible, and to leave it clean if no draw succeeds; the configuration's by
            default.

    Raises:
        ConfigError: the configuration has mistakes; the message lists all of them.
        ParameterError: the configuration has no corruption `label`, or one that acts on more than
            pictures, or a number is out of its range.

    Examples:
        >>> corrupt = tr.FromConfig("paper", label="marks")
        >>> corrupt({"image": image, "id": "traj-3/0"})["image"].shape  # uint8 [3, H, W]
        torch.Size([3, 1080, 1920])
    """

    def __init__(
        self,
        source: Any,
        *,
        label: str | None = None,
        p_clean: float = 0.0,
        seed: int | None = None,
        label_policy: str | None = None,
        **shared: Any,
    ) -> None:
        config = load_config(source)
        if label is not None and label not in config.corruptions:
            raise ParameterError(
                f"{config.source} has no corruption {label!r}; it has"
                f" {', '.join(config.corruptions)}"
            )
        planners = (
            list(config.corruptions.values()) if label is None else [config.corruptions[label]]
        )
        policy = config.options.get("label_policy", "keep")
        super().__init__(
            compose.OneOf(planners, p_clean=p_clean),
            seed=config.options.get("seed", 0) if seed is None else seed,
            label_policy=policy if label_policy is None else label_policy,
            **shared,
        )


_DRAWING = ("p", "seed", "label_policy")  # arguments that decide how plans are drawn


@explicit(without=_DRAWING)
class Replay(Corrupt):
    """Applies saved plans.

    Args:
        plan: a `Plan` or its JSON text for every sample, a mapping from ids to those, or `None` to
            take the plan that the sample carries under `"plan"`.

    Raises:
        ParameterError: `p`, `seed` or `label_policy` is passed, or a sample has no plan.
        ParameterTypeError: a plan is neither a `Plan` nor its JSON text.
        PlanError: the JSON text of a plan is damaged.

    Examples:
        >>> plan = hj.Marks().plan(hj.Scene(size=(1080, 1920)), seed=3, sample="traj-3/0")
        >>> tr.Replay(plan)({"image": image})["image"].shape  # uint8 [3, H, W]
        torch.Size([3, 1080, 1920])
    """

    seeded = False

    def __init__(
        self, plan: Plan | str | Mapping[Any, Plan | str] | None = None, **shared: Any
    ) -> None:
        drawing = next((name for name in _DRAWING if name in shared), None)
        if drawing is not None:
            raise ParameterError(
                f"Replay applies the plans it is given to every sample; it has no {drawing}"
            )
        super().__init__(compose.Sequence([_Nothing()]), **shared)
        several = isinstance(plan, Mapping)
        self.plan = None if plan is None or several else _as_plan(plan)
        self.by_id = {str(k): _as_plan(v) for k, v in plan.items()} if several else None

    def extra_repr(self) -> str:
        """Return which plans are replayed, for `repr`."""
        return "the sample's own" if self.plan is None else self.plan.corruption

    def _plan(self, size: Size, row: DatasetRow, pictures: list[SamplePicture]) -> Plan:
        if isinstance(self.plan, Plan):
            return self.plan
        if self.by_id is None:
            plan = row.get("plan")
            if plan is None:
                raise ParameterError(
                    "Replay() takes the plan from the sample's 'plan' entry, but there is none"
                )
            return _as_plan(plan)
        by_content = self.id_from == "content"
        key = sample_content_id(pictures) if by_content else self.settings.key(row)
        if str(key) not in self.by_id:
            raise ParameterError(f"Replay holds no plan for the sample {key!r}")
        return self.by_id[str(key)]


class _Nothing(Planner):
    """A placeholder planner for `Replay`, which has its plans already."""

    @property
    def needs_elements(self) -> bool:
        return False

    def plan(self, scene: Any, **_key: Any) -> Plan:
        return Plan.clean(scene.size)


def __getattr__(name: str) -> Any:
    """Explain why a transform does not exist.

    Raises:
        AttributeError: always.
    """
    names = [name for kind in ("all", *SETS) for name in corruption_names(kind)]
    cls = {cls.__name__: cls for cls in map(find_corruption, names)}.get(name)
    if cls is not None:
        changed = "agent's input" if cls.scope == "action" else "machine"
        reason = f"it changes the {changed}, not the picture"
        advice = (
            "build a dataset with it (hijack build), or wrap a corruption of your own that draws:"
            " Corrupt(planner)"
        )
        raise AttributeError(f"hijack_data.transforms has no {name}: {reason}; {advice}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}{suggest(name, __all__)}")


def _as_plan(value: object) -> Plan:
    if isinstance(value, Plan):
        return value
    if isinstance(value, str | bytes):
        return Plan.from_json(value)
    raise ParameterTypeError(f"expected a Plan or its JSON text, got {type(value).__name__}")
