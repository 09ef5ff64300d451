"""The base class of every corruption, and the registry that finds it by name.

A corruption is a frozen dataclass whose fields are declared with `params.param`, plus one method,
`make_plan`. Being registered is enough: configuration, command line, documentation, gallery and the
conformance tests follow from it.
"""

import dataclasses
import functools
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeAlias, TypeVar, cast, get_args

from . import declaration
from . import params as p
from .actions.input_faults import FaultKind, InputFault
from .entry_points import describe_error, error_location
from .errors import (
    HijackError,
    ParameterError,
    ParameterTypeError,
    PlanningError,
    UnknownNameError,
    short_repr,
    suggest,
)
from .frozen import freeze
from .plan import Effect, Op, Plan
from .planner import Planner
from .registry import Registry
from .rng import Stream
from .types import Scene

Category: TypeAlias = Literal["visual_disruptor", "unexpected_operation", "environment_error"]
Scope: TypeAlias = Literal["observation", "transition", "state", "action"]

CHOICES = {"category": get_args(Category), "scope": get_args(Scope)}


@dataclass(frozen=True)
class Draft:
    """The result of `make_plan`.

    Args:
        ops: operations on the picture, in their order.
        effects: what to do to the machine.
        notes: sentences for the reader of the plan.
        inputs: what happens to actions of the agent on their way to the machine.
    """

    ops: tuple[Op, ...] = ()
    effects: tuple[Effect, ...] = ()
    notes: tuple[str, ...] = ()
    inputs: tuple[InputFault, ...] = ()


@dataclass(frozen=True)
class Corruption(Planner):
    """Base class of all corruptions.

    Subclasses set `name`, `category` and `scope`, declare their fields with `param(...)` and
    implement `make_plan`. Corruptions of scope `state` and `transition` name in `effects` the kinds
    of effects that their plans may hold, and in `pictures` the kinds of recorded pictures that show
    those effects in a dataset. Corruptions of scope `action` name in `inputs` the kinds of faults
    that change what an agent does on its way to the machine. `severities` holds five sets of field
    values; the third is empty, because level 3 is the default, in the paper's nine that of the
    paper.
    """

    name: ClassVar[str] = ""
    version: ClassVar[int] = 1
    category: ClassVar[Category]
    scope: ClassVar[Scope]
    effects: ClassVar[tuple[str, ...]] = ()  # pyright: ignore[reportIncompatibleMethodOverride]
    inputs: ClassVar[tuple[FaultKind, ...]] = ()  # pyright: ignore[reportIncompatibleMethodOverride]
    pictures: ClassVar[tuple[str, ...]] = ()
    paper: ClassVar[str] = ""
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = ()

    def __post_init__(self) -> None:
        for key, (parameter, _) in p.parameters(self).items():
            value = parameter.check(f"{self.name}.{key}", getattr(self, key))
            object.__setattr__(self, key, value)

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone, so that planning does not change the pickle."""
        return {key: value for key, value in vars(self).items() if key != "_plan_params"}

    @property
    def label(self) -> str:
        """The name, such as `"marks"`."""
        return self.name

    @property
    def id(self) -> str:
        """Name and version, such as `"marks-v1"`."""
        return f"{self.name}-v{self.version}"

    @property
    def steps(self) -> p.Steps | None:
        """The steps at which the corruption acts; `None` for every step.

        -1 is before the episode.
        """
        return getattr(self, "step", None)

    @property
    def needs_elements(self) -> bool:
        """Whether the plan depends on where the interactive elements are."""
        return bool(getattr(self, "avoid_elements", False))

    def is_due(self, step: int) -> bool:
        """Return whether the corruption acts at `step`."""
        return self.steps is None or p.is_due(self.steps, step)

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Decide what to do to `scene`; each corruption overrides this method.

        An implementation raises `ParameterError` for a screen that cannot hold what the parameters
        ask for.

        Args:
            scene: the screen, which must not be changed.
            stream: the source of every random draw.
            step: a step at which the corruption acts.

        Raises:
            TypeError: the class does not override this method.
        """
        raise TypeError(
            f"{type(self).__name__} must define make_plan(self, scene, stream, step) -> Draft"
        )

    def plan(
        self,
        scene: Scene,
        *,
        seed: int,
        sample: int | str = 0,
        step: int | None = None,
        epoch: int = 0,
    ) -> Plan:
        """Return the plan for one screen.

        The same arguments give the same plan, on any machine, in any order.

        Args:
            scene: the screen: size, element boxes, apps, target.
            seed: 0 to 2**64 - 1.
            sample: id of the sample or trajectory.
            step: step in the trajectory; by default the first at which the corruption acts.
            epoch: training epoch.

        Raises:
            ParameterTypeError: `scene` is no `Scene`.
            PlanningError: `make_plan` raised an exception that is not a `HijackError`, which is
                the cause; or it planned faults of the input that the class does not declare.
            ParameterError: the screen cannot hold what the parameters ask for.
            HijackError: the screen cannot be corrupted as asked for another reason.
        """
        if not isinstance(cast(object, scene), Scene):
            raise ParameterTypeError(
                f"scene must be a hijack_data.Scene, got {type(scene).__name__}"
            )
        step = self.first_step() if step is None else step
        stream = Stream(seed, self.id, sample, step, epoch)
        if not self.is_due(step):
            note = f"{self.name} does not act at step {step}"
            return Plan(self.id, scene.size, self._plan_params, notes=(*scene.notes, note))
        try:
            draft = self.make_plan(scene, stream, step)
            self._check_inputs(draft.inputs)
            notes = scene.notes + draft.notes
            return Plan(
                self.id,
                scene.size,
                self._plan_params,
                draft.ops,
                draft.effects,
                notes,
                draft.inputs,
            )
        except HijackError:
            raise
        except (Exception, SystemExit) as error:
            message = f"make_plan raised {describe_error(error)} ({error_location(error)})"
            raise PlanningError(f"{self.id}: {message}") from error

    def _check_inputs(self, faults: tuple[InputFault, ...]) -> None:
        """Check that a plan keeps to what the class declares, which decides where it may be used.

        Raises:
            PlanningError: the plan has a kind of fault that `inputs` does not name, has one kind
                twice, or depends on elements although `needs_elements` is false.
        """
        kinds = [fault.fault for fault in faults]
        for fault in faults:
            if fault.fault not in self.inputs:
                raise PlanningError(
                    f"{self.id} plans the fault {fault.fault!r}, and inputs is {self.inputs}: name"
                    " it there"
                )
            if kinds.count(fault.fault) > 1:
                raise PlanningError(
                    f"{self.id} plans the fault {fault.fault!r} twice at one step, and the last"
                    " would replace the others: plan one, whose `of` names all inputs it can hit"
                )
            if fault.needs_elements and not self.needs_elements:
                raise PlanningError(
                    f"{self.id} plans an offset in percent of the target, and needs_elements is"
                    " false: override needs_elements"
                )

    def first_step(self) -> int:
        """Return the first step at which the corruption acts; 0 if it acts at every step."""
        match self.steps:
            case None:
                return 0
            case p.Every(every=every):
                return every
            case int() as step:
                return step
            case several:
                return several[0]

    def params(self) -> dict[str, Any]:
        """Return the parameters as JSON data."""
        return {key: p.to_json(getattr(self, key)) for key in p.parameters(self)}

    @functools.cached_property
    def _plan_params(self) -> Mapping[str, Any]:
        """The parameters as all plans of this corruption share them."""
        return freeze(self.params(), "plan: params")

    def to_config(self) -> dict[str, dict[str, Any]]:
        """Return its entry in a configuration: the name with all parameters."""
        return {self.name: self.params()}

    def replace(self, **changes: Any) -> "Corruption":
        """Return a copy with some parameters changed.

        Raises:
            UnknownNameError: a name is not a parameter.
            ParameterError: a parameter does not accept its value.
        """
        check_names(type(self), changes)
        return dataclasses.replace(self, **changes)

    @classmethod
    def at(cls: "type[C]", severity: int, **changes: Any) -> "C":
        """Return the corruption at a severity, with some parameters changed.

        Args:
            severity: 1 (mild) to 5 (harsh); level 3 is the paper's default.
            **changes: parameters, which override those of the level.

        Raises:
            ParameterTypeError: `severity` is not an integer.
            ParameterError: `severity` is out of range, or the corruption has no severity levels.
            UnknownNameError: a name is not a parameter.
        """
        if isinstance(severity, bool) or not hasattr(severity, "__index__"):
            raise ParameterTypeError(f"severity must be an integer in 1..5, got {severity!r}")
        if not 1 <= severity <= 5:
            raise ParameterError(f"severity must be in 1..5, got {severity}")
        if not cls.severities and severity != 3:
            raise ParameterError(
                f"{cls.name} has no severity scale (it happens or not); use severity=3"
            )
        check_names(cls, changes)
        values: dict[str, Any] = {}
        if cls.severities:
            values.update(cls.severities[severity - 1])
        return cls(**{**values, **changes})

    @classmethod
    def summary(cls) -> str:
        """Return the first line of the documentation."""
        return (cls.__doc__ or "").strip().split("\n")[0]


C = TypeVar("C", bound=Corruption)


def _problems(cls: type[Any], _: str) -> Iterator[str]:
    """Yield what is wrong with the declaration of a class."""
    if not isinstance(cast(object, cls), type):
        yield "it is not a class"
        return
    for key in ("name", "category", "scope"):
        if not getattr(cls, key, ""):
            yield f"{key} is not set"
    if not issubclass(cls, Corruption):
        yield "it is not a subclass of hijack_data.plugin.Corruption"
        return
    if "__dataclass_fields__" not in vars(cls) or "make_plan" not in vars(cls):
        yield "it must be a frozen dataclass that defines make_plan"
    about = (cls.__doc__ or "").strip()
    documented = about and not about.startswith(f"{cls.__name__}(")
    if not documented and sys.flags.optimize < 2:  # python -OO removes docstrings
        yield "it has no docstring"
    yield from declaration.problems(cls, Corruption, CHOICES)


def register(cls: type[C]) -> type[C]:
    """Class decorator: register a corruption under its name and under `name-vN`.

    Raises:
        ParameterError: the class is incomplete, declares something unknown or something that plans
            would not keep, or its name is taken; the message lists every problem.
        ParameterTypeError: the decorated object is not a class.
    """
    if not isinstance(cast(object, cls), type):
        raise ParameterTypeError(
            f"register decorates a class of a corruption, got {short_repr(cls)}"
        )
    CORRUPTIONS.add(cls)
    return cls


def _suggest_parameters(cls: type[Corruption]) -> type[Corruption]:
    """Make `Marks(nmber=5)` raise an error that suggests `number`, as `get` does."""
    original: Any = cls.__init__
    if hasattr(original, "__wrapped__"):
        return cls  # it was registered before

    @functools.wraps(original)
    def init(self: Corruption, *args: Any, **values: Any) -> None:
        check_names(type(self), values)
        original(self, *args, **values)

    setattr(cls, "__init__", init)  # noqa: B010 - the checker knows it as a method that is not assigned to
    return cls


def check_usable(cls: type[Corruption]) -> None:
    """Make and describe a class once, so that a broken plug-in cannot break later listings.

    It raises whatever the class raises: for a default that its own check refuses, a value that is
    not JSON, or a broken `__post_init__`.
    """
    spec = cls()
    defaults = {key: p.to_json(default) for key, (_, default) in p.parameters(cls).items()}
    levels = [{key: p.to_json(value) for key, value in level.items()} for level in cls.severities]
    json.dumps([defaults, levels, spec.params(), cls.paper])
    for word in ("steps", "needs_elements"):
        getattr(spec, word)


CORRUPTIONS = Registry[type[Corruption]](
    "corruption",
    "corruptions",
    package="hijack_data.corruptions",
    own_name="name",
    problems=_problems,
    prepare=_suggest_parameters,
    check=check_usable,
)


# Named sets of corruptions that are not the paper's; "all" leaves them out.
SETS: Mapping[str, tuple[str, ...]] = {
    "everyday": (
        *("missed_input", "repeated_input", "slipped_pointer"),
        *("app_freeze", "slow_network"),
    )
}


def corruption_names(of: str = "all") -> list[str]:
    """Return the names of corruptions.

    Args:
        of: `"all"`: the paper's nine in order, plug-ins, loaded files. `"everyday"`: the faults of
            everyday life, which `"all"` leaves out.

    Raises:
        PluginError: a file of `AGENTHIJACK_LOAD` cannot be loaded.
        UnknownNameError: there is no such set.
    """
    registered = CORRUPTIONS.names()
    if of in SETS:
        return [name for name in SETS[of] if name in registered]
    if of != "all":
        raise UnknownNameError(f"no set of corruptions {of!r}{suggest(of, ['all', *SETS])}")
    in_sets = {name for names in SETS.values() for name in names}
    return [name for name in registered if name not in in_sets]


def find_corruption(name: str) -> type[Corruption]:
    """Return the class registered as `name` or `name-vN`.

    Raises:
        ParameterTypeError: the name is not a string.
        UnknownNameError: there is no such corruption, or the installed one has another version.
        PluginError: the plug-in that should register it is broken.
    """
    if not isinstance(cast(object, name), str):
        raise ParameterTypeError(f"the name of a corruption must be a string, got {name!r}")
    CORRUPTIONS.load_ours()
    if CORRUPTIONS.is_reference(name) and name not in CORRUPTIONS.entries:
        raise UnknownNameError(
            f"{name!r} is a file or a module, not the name of a corruption: load it first (hijack"
            " --load FILE.py COMMAND; in Python, import it), and give the name that it registers"
        )
    base, _, version = name.rpartition("-v")
    if name not in CORRUPTIONS.entries and base not in CORRUPTIONS.entries:
        CORRUPTIONS.load()
    if not version.isdigit():
        return CORRUPTIONS.get(name)
    if base not in CORRUPTIONS.entries:
        check_not_broken(base)
        return CORRUPTIONS.get(name)
    cls = CORRUPTIONS.get(base)
    if int(version) != cls.version:
        raise UnknownNameError(f"{base} is at version {cls.version} here, not {version}")
    return cls


def check_not_broken(name: str) -> None:
    """Check that `name` does not belong to a plug-in that was left out because it is broken.

    Raises:
        PluginError: it does; the message names the plug-in and its problem.
    """
    CORRUPTIONS.check_not_broken(name)


def make_corruption(name: str, **values: Any) -> Corruption:
    """Return a corruption by name, such as `make_corruption("marks", number=50)`.

    Args:
        name: the name, or `name-vN` for one version.
        **values: parameters; the others have their defaults.

    Raises:
        UnknownNameError: there is no such corruption, version or parameter.
        ParameterError: a parameter does not accept its value.
        PluginError: the plug-in that should register the corruption is broken.
    """
    cls = find_corruption(name)
    check_names(cls, values)
    return cls(**values)


def from_plan(plan: Plan) -> Corruption:
    """Return the corruption that made a plan, from its id and parameters; not for a `Sequence`.

    Raises:
        UnknownNameError: the corruption is not registered, or has another version here.
        ParameterError: a parameter does not accept its value.
    """
    return make_corruption(plan.corruption, **plan.params)


def check_names(cls: type[Corruption], values: Mapping[str, Any]) -> None:
    """Raise `UnknownNameError` for the first key that is not a parameter of `cls`.

    Raises:
        UnknownNameError: a key is not a parameter.
    """
    parameters_by_name = p.parameters(cls)
    for key in values:
        if key not in parameters_by_name:
            raise UnknownNameError(
                f"{cls.name} has no parameter {key!r}{suggest(key, parameters_by_name)}"
            )
