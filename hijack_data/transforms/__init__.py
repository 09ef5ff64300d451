"""Corruptions as torchvision v2 transforms.

    import hijack_data.transforms as tr

    train = v2.Compose([tr.OneOf([tr.PopUps(), tr.Marks(), tr.Subtitle()], seed=3, p_clean=0.2),
    v2.ToDtype(...)])

A sample is a dictionary, a tuple with a dictionary in it, or a picture alone. Its pictures are PIL
images, uint8 tensors `[3, H, W]` or NumPy and JAX arrays `[H, W, 3]`, also lists and stacks of
them (`[T, 3, H, W]`), that are the sample itself, the first item of a tuple, or under a name of a
picture (`hijack_data.sample_pictures`); all of them follow one plan. Bounding boxes, key points and masks
of `tv_tensors` follow the pixels, and so do the entries that `hijack_data.samples` names and those
that `labels=` declares. If the size changes, any other entry that is not harmless by its type is an
error (`hijack_data.labels.undeclared_entries`).

The `id` of a sample, the seed and the epoch decide its corruption, not the worker, the order or a
global generator. A batch has a list of ids, and a picture, list or stack of pictures for each; it
gets a plan for each id.
"""

from collections.abc import Callable, Iterable, Mapping
from collections.abc import Sequence as SequenceOf
from typing import Any

from .. import compose, corruptions, extras
from ..config import load_config
from ..corruption import Corruption, corruption_names, find_corruption
from ..errors import ParameterError, ParameterTypeError, suggest
from ..plan import Plan
from ..planner import Planner
from ..sample_pictures import SamplePicture
from ..types import Size

extras.require("hijack_data.transforms", "torch", ("torch", "torchvision"))

from .base import Corrupt, unwrap_planner  # noqa: E402 - these import torch
from .sample_parts import PICTURE_KEYS, DatasetRow, sample_content_id  # noqa: E402

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


_SHARED = (
    "seed",
    "id_from",
    "label_policy",
    "return_plan",
    "id_key",
    "image_key",
    "p",
    "labels",
    "target",
)


class _Named(Corrupt):
    """A transform named after one corruption."""

    spec: type[Corruption]

    def __init__(self, *, severity: int | None = None, **values: Any) -> None:
        shared = {key: values.pop(key) for key in _SHARED if key in values}
        super().__init__(self.spec.at(3 if severity is None else severity, **values), **shared)


class PopUps(_Named):
    """Pop-up windows: `PopUps(seed=3, small_factor=2, ...)` takes the parameters of `hj.PopUps`."""

    spec = corruptions.PopUps


class Marks(_Named):
    """Marks over the screen: `Marks(seed=3, number=100)` takes the parameters of `hj.Marks`."""

    spec = corruptions.Marks


class Subtitle(_Named):
    """Lines of text: `Subtitle(seed=3, position="top")` takes the parameters of `hj.Subtitle`.

    Lines that do not fit a picture are shrunk, since pictures of a training set differ in size;
    `fit="error"` raises instead.
    """

    spec = corruptions.Subtitle

    def __init__(self, *, severity: int | None = None, **values: Any) -> None:
        super().__init__(severity=severity, **{"fit": "shrink", **values})


class Resolution(_Named):
    """The screen at another resolution.

    `Resolution(scale=0.5, restore=True)` keeps the shape of the batch.
    """

    spec = corruptions.Resolution


class OneOf(Corrupt):
    """One of several corruptions, drawn for each sample.

    For example `OneOf([Marks(), Subtitle()], seed=3, p_clean=0.2, weights=[2, 1])`.
    """

    def __init__(
        self,
        options: "Iterable[Planner | Corrupt]",
        *,
        p_clean: float = 0.0,
        weights: SequenceOf[float] | None = None,
        **shared: Any,
    ) -> None:
        planners = [unwrap_planner(option) for option in options]
        chosen = compose.OneOf(planners, p_clean=p_clean, weights=weights)
        super().__init__(chosen, **shared)


class Sequence(Corrupt):
    """Several corruptions in order: `Sequence([Resolution(scale=0.5), Marks()], seed=3)`."""

    def __init__(self, parts: "Iterable[Planner | Corrupt]", **shared: Any) -> None:
        super().__init__(compose.Sequence([unwrap_planner(p) for p in parts]), **shared)


class Schedule(Corrupt):
    """A corruption that changes with the epoch.

    `at` must be picklable (a module-level function) for workers.
    """

    def __init__(self, at: "Callable[[int], Planner]", **shared: Any) -> None:
        super().__init__(compose.Schedule(at), **shared)


class FromConfig(Corrupt):
    """One of a configuration's corruptions for each sample, or always the one named `label`.

    Args:
        source: a path, the name of a packaged configuration, or a mapping; see
            `hijack_data.config`.
        label: use this entry only.
        p_clean: probability that a sample stays clean.
        shared: the arguments of `Corrupt`; the seed is the configuration's by default.
    """

    def __init__(
        self, source: Any, *, label: str | None = None, p_clean: float = 0.0, **shared: Any
    ) -> None:
        config = load_config(source)
        if label is not None and label not in config.corruptions:
            raise ParameterError(
                f"{config.source} has no corruption {label!r}; it has"
                f" {', '.join(config.corruptions)}"
            )
        chosen = list(config.corruptions.values()) if label is None else [config.corruptions[label]]
        super().__init__(
            compose.OneOf(chosen, p_clean=p_clean),
            **{"seed": config.options.get("seed", 0), **shared},
        )


class Replay(Corrupt):
    """Applies saved plans.

    Args:
        plan: a `Plan` or its JSON text for every sample, a mapping from ids to those, or `None` to
            take the plan that the sample carries under `"plan"`.
    """

    seeded = False

    def __init__(
        self, plan: "Plan | str | Mapping[Any, Plan | str] | None" = None, **shared: Any
    ) -> None:
        if "p" in shared:
            raise ParameterError(
                "Replay applies the plans it is given to every sample; it has no p"
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
    if name in {find_corruption(known).__name__ for known in corruption_names()}:
        advice = (
            "build a dataset with it (hijack build), or wrap a corruption of your own that draws:"
            " Corrupt(planner)"
        )
        why = "it changes the machine, not the picture"
        raise AttributeError(f"hijack_data.transforms has no {name}: {why}; {advice}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}{suggest(name, __all__)}")


def _as_plan(value: object) -> Plan:
    if isinstance(value, Plan):
        return value
    if isinstance(value, str | bytes):
        return Plan.from_json(value)
    raise ParameterTypeError(f"expected a Plan or its JSON text, got {type(value).__name__}")
