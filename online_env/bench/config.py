"""The configuration of a benchmark: a YAML file.

All its mistakes are reported at once, each with file, line and fix.
"""

import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import yaml

from hijack_data.compose import Sequence
from hijack_data.config import dump, load_config
from hijack_data.config.build import Builder
from hijack_data.config.corruption_settings import check
from hijack_data.config.nodes import (
    ConfigNode,
    MappingNode,
    Position,
    Problems,
    ScalarNode,
    SequenceNode,
    describe_node,
    from_python,
)
from hijack_data.config.yaml_reader import read_yaml
from hijack_data.config_files import read_config
from hijack_data.corruption import (
    CORRUPTIONS,
    SETS,
    Corruption,
    check_not_broken,
    corruption_names,
    find_corruption,
    make_corruption,
)
from hijack_data.errors import (
    ConfigError,
    HijackError,
    HijackWarning,
    ParameterError,
    UnknownNameError,
    suggest,
)
from hijack_data.loading import find_source
from hijack_data.params import Parameter
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner
from hijack_data.registry import Registry, is_ours
from hijack_data.runs.run_log import UNTIL_RETENTION, draw_task_order
from hijack_data.types import Size

from ..agents.guards import is_file
from ..agents.makers import FileAgentMaker
from ..agents.references import AgentReference
from ..agents.registry import AGENTS
from ..choices import ERROR_ORDERS, LAYERS, POLICIES, DrawingLayer, ErrorOrder, Recovery
from ..results.stop_rule import StopRule
from ..tasks import TASKS, Task, families, task_sets
from ..tasks.machines import MachineSettings
from .providers import EMBEDDED, OSWORLD, PROVIDERS

if TYPE_CHECKING:
    from ..environment.settings import EvalSettings

AnyRegistry: TypeAlias = Registry[Any]
Planners: TypeAlias = dict[str, Planner | None]
ALL = "all"
SIDE = Parameter("int", "", low=200, high=8192)
SEED = Parameter("int", "", low=0, high=2**64 - 1)
NUMBERS = {
    "max_steps": Parameter(
        "int", "Actions of an agent until an episode is cut off", low=1, high=1000
    ),
    "retries": Parameter("int", "How often an invalid episode is run again", low=0, high=10),
    "agent_timeout": Parameter(
        "int", "Seconds that an agent may take for one answer", low=1, high=86_400
    ),
    "episode_timeout": Parameter(
        "int", "Seconds that an episode may take altogether", low=1, high=604_800
    ),
}
RECOVERY = Parameter("choice", "What a request of the agent for help leads to", choices=POLICIES)
ENVIRONMENT_ERRORS = Parameter(
    "choice", "When the network is cut that is down from the beginning", choices=ERROR_ORDERS
)
LAYER = Parameter("choice", "Who draws what plans paste", choices=LAYERS)
CHOICES = {"recovery": RECOVERY, "environment_errors": ENVIRONMENT_ERRORS, "layer": LAYER}
DESKTOP_KEYS = ("provider", "size")
TEXT_BOXES = Parameter("bool", "Whether pop-ups and marks keep lines of text free")
KEYS = (
    "desktop",
    "agents",
    "tasks",
    "corruptions",
    "seeds",
    *NUMBERS,
    *CHOICES,
    "text_boxes",
    "osworld_files",
)


@dataclass(frozen=True, kw_only=True)
class Bench:
    """The configuration of a benchmark.

    Args:
        source: the file, for messages.
        provider: name of the desktop's provider, in `providers.PROVIDERS`.
        osworld_files: OSWorld's file cache, for tasks of OSWorld; "" if none needs files.
        machines: machines of the user for tasks of OSWorld; `None` for embedded desktops.
        unplayable: tasks that are not played, each with `reason`, `apps` and `infeasible`.
        unplayable_score: what an episode of such a task counts: 0.0, or `None` for nothing.
        size: `(height, width)` of the desktop in pixels.
        agents: names in `agents.AGENTS`.
        tasks: names in `online_env.tasks`.
        corruptions: by label, in order; `None` is the clean condition.
        seeds: each seed gives every task another variant and every corruption different draws.
        max_steps: the most actions of an episode.
        recovery: `none`, `repair` or `reset`.
        environment_errors: `before_setup` or `after_setup`; see `EvalSettings`.
        text_boxes: whether pop-ups and marks keep the lines of text free, which OCR finds.
        layer: `picture` or `dom`; see `EvalSettings`.
        retries: how often an invalid episode is repeated.
        agent_timeout: seconds that an agent may take for one answer.
        episode_timeout: seconds that an episode may take altogether.
        in_process: whether agents of users run in the process of the runner, for debugging.
        agent_memory: GiB that the process of an agent and all that it starts may use; 0 for three
            quarters of the machine's memory.
        until_retention: when the run ends before all is played; `None` for never.
        guard: what watches every agent: `rules`, `model`, or an agent file; "" for nothing.
    """

    source: str = ""
    provider: str = EMBEDDED
    osworld_files: str = ""
    machines: MachineSettings | None = None
    unplayable: Mapping[str, Mapping[str, Any]] = field(default_factory=dict[str, Any])
    unplayable_score: float | None = None
    size: Size = (1080, 1920)
    agents: tuple[str, ...] = ("oracle",)
    tasks: tuple[str, ...] = ()
    corruptions: Mapping[str, Planner | None] | None = None
    seeds: tuple[int, ...] = (0,)
    max_steps: int = 15
    recovery: Recovery = "none"
    environment_errors: ErrorOrder = "before_setup"
    text_boxes: bool = False
    layer: DrawingLayer = "picture"
    retries: int = 1
    agent_timeout: int = 600
    episode_timeout: int = 3600
    in_process: bool = False
    agent_memory: float = 0.0
    until_retention: StopRule | None = None
    guard: str = ""

    def settings(self, agent: str, log: Path | None = None) -> "EvalSettings":
        """Return the settings of the episodes of an agent.

        Args:
            agent: its name in the records.
            log: the folder of the run; `None` writes nothing.
        """
        from ..environment.settings import EvalSettings

        return EvalSettings(
            max_steps=self.max_steps,
            recovery=self.recovery,
            environment_errors=self.environment_errors,
            text_boxes=self.text_boxes,
            layer=self.layer,
            log=log,
            agent=agent,
        )

    @property
    def planners(self) -> Mapping[str, Planner | None]:
        """The corruptions by label; all of them if the file names none."""
        return all_planners() if self.corruptions is None else self.corruptions

    @property
    def files(self) -> Path | None:
        """The folder of `osworld_files`."""
        return Path(self.osworld_files) if self.osworld_files else None

    def to_data(self) -> dict[str, Any]:
        """Return the resolved configuration as JSON data.

        Every parameter of every corruption is written out. `code` has the file, with its SHA-256,
        of each agent, task and provider that does not come with this library, and of what judges
        the tasks of a family; the key is left out if there is none.
        """
        width_first = [self.size[1], self.size[0]]
        data: dict[str, Any] = {
            "source": self.source,
            "desktop": {"provider": self.provider, "size": width_first},
            "agents": list(self.agents),
            "tasks": list(self.tasks),
            "corruptions": self._corruptions(),
            "seeds": list(self.seeds),
            "max_steps": self.max_steps,
            "recovery": self.recovery,
            "environment_errors": self.environment_errors,
            "retries": self.retries,
            "agent_timeout": self.agent_timeout,
            "episode_timeout": self.episode_timeout,
        }
        if self.text_boxes:
            data["text_boxes"] = True
        if self.layer != "picture":
            data["layer"] = self.layer
        if self.osworld_files:
            data["osworld_files"] = self.osworld_files
        if self.machines is not None:
            data["desktop"] |= self.machines.to_data()
        if self.unplayable:
            data["unplayable"] = dict(self.unplayable)
            data["unplayable_score"] = self.unplayable_score
        if self.in_process:
            data["in_process"] = True
        if self.agent_memory:
            data["agent_memory"] = self.agent_memory
        if self.until_retention is not None:
            data[UNTIL_RETENTION] = self.until_retention.to_data()
        if self.guard:
            data["guard"] = self.guard
        code = dict(self._code())
        if code:
            data["code"] = code
        return data

    def to_file_data(self) -> dict[str, Any]:
        """Return the settings as its file has them, without agents and corruptions."""
        data = self.to_data()
        left_out = ("agents", "corruptions")
        return {key: data[key] for key in KEYS if key in data and key not in left_out}

    @property
    def asked_agents(self) -> tuple[str, ...]:
        """The agents, with the guard if it is an agent file."""
        guard = (self.guard,) if is_file(self.guard) else ()
        return tuple(dict.fromkeys((*self.agents, *guard)))

    def _corruptions(self) -> list[Any]:
        clean = [CLEAN] if CLEAN in self.planners else []
        planners = {
            label: planner for label, planner in self.planners.items() if planner is not None
        }
        if not planners:
            return clean
        entries = yaml.safe_load(dump(planners))
        return [*clean, *entries["corruptions"]]

    def _code(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield the files of the agents, tasks and provider that do not come with this library.

        And of what judges the tasks of a family.
        """
        for _, name, entry in self.foreign():
            source = entry.source if is_from_data(entry) else find_source(entry)
            if source:
                yield name, dict(source)
        named = (getattr(TASKS.entries.get(name), "family", "") for name in self.tasks)
        for family in dict.fromkeys(filter(None, named)):
            for name, source in families.load_family(family).judging_code().items():
                yield name, dict(source)

    def foreign(self) -> Iterator[tuple[AnyRegistry, str, Any]]:
        """Yield registry, name and class of agents, tasks and provider from outside the library."""
        registries: tuple[tuple[AnyRegistry, tuple[str, ...]], ...] = (
            (AGENTS, self.asked_agents),
            (TASKS, self.tasks),
            (PROVIDERS, (self.provider,)),
        )
        for registry, names in registries:
            for name in names:
                entry = registry.entries.get(name)
                if entry is None:
                    continue
                if is_from_data(entry) or not is_ours(entry):
                    yield registry, name, entry


def is_from_data(entry: Any) -> bool:
    """Return whether an entry is a reference to an agent, or made from an agent file or task file.

    Its `source` then has the path and the SHA-256 of the file.
    """
    if isinstance(entry, FileAgentMaker | AgentReference):
        return True
    return isinstance(entry, type) and issubclass(entry, Task) and bool(entry.family)


def all_planners(of: str = ALL) -> Planners:
    """Return the clean condition and corruptions with their defaults, by label.

    Args:
        of: `ALL`, or a set that `corruption_names` knows, such as `"everyday"`.
    """
    return {CLEAN: None, **{name: make_corruption(name) for name in corruption_names(of)}}


def load_bench(path_or_name: str | os.PathLike[str]) -> Bench:
    """Read a benchmark from a path or by the bare name of a packaged one (`"embedded_small"`).

    Raises:
        ConfigError: All mistakes of the file, each as `file:line:column: message`.
    """
    problems = Problems()
    name, data = read_config(path_or_name, "benchmark")
    tree = read_yaml(data, name, problems)
    if not isinstance(tree, MappingNode):
        start = Position(name, 1, 1)
        content = "the file is empty" if tree is None else f"got {describe_node(tree)}"
        problems.stop(start, f"a benchmark is a mapping such as tasks: [write_note], {content}")
    bench = _Reader(problems).read(tree, name)
    problems.check()
    return bench


def bench_from_data(data: Mapping[str, Any], name: str) -> Bench:
    """Return the benchmark of settings as a file has them.

    Args:
        data: The settings.
        name: Where they are from, for messages.

    Raises:
        ConfigError: All mistakes in them.
    """
    problems = Problems()
    bench = _Reader(problems).read(cast("MappingNode", from_python(data, name, problems)), name)
    problems.check()
    return bench


def override(
    bench: Bench,
    agent: str | None = None,
    task: str | None = None,
    corruption: str | None = None,
    seeds: int | None = None,
    osworld_files: str | None = None,
    recovery: Recovery | None = None,
    environment_errors: ErrorOrder | None = None,
    max_steps: int | None = None,
    layer: DrawingLayer | None = None,
) -> Bench:
    """Return the benchmark with the values of the command line.

    Args:
        bench: the benchmark of the file.
        agent: names, `package.module:Class` or `file.py:Class`, separated by commas, or `all`.
        task: the same for tasks, or the name of a set, such as `core`.
        corruption: labels and names of corruptions, or `all`.
        seeds: the number of seeds, which begin at 0.
        osworld_files: OSWorld's file cache.
        recovery: the recovery policy.
        environment_errors: when the network is cut that is down from the beginning.
        max_steps: actions until an episode is cut off.
        layer: who draws what plans paste.

    Raises:
        UnknownNameError: There is no such name; the message has the closest one.
        ParameterError: A list is empty, or names something twice.
        PluginError: A file, module or plug-in cannot be loaded.
    """
    if osworld_files is not None:
        bench = replace(bench, osworld_files=osworld_files)
    if recovery is not None:
        bench = replace(bench, recovery=recovery)
    if environment_errors is not None:
        bench = replace(bench, environment_errors=environment_errors)
    if max_steps is not None:
        bench = replace(bench, max_steps=max_steps)
    if layer is not None:
        bench = replace(bench, layer=layer)
    if agent is not None:
        bench = replace(bench, agents=_registered_names("--agent", agent, AGENTS))
    if task is not None:
        is_set = task.strip() in task_sets.set_names()
        names = task_sets.members(task.strip()) if is_set else _task_names(task)
        bench = replace(bench, tasks=names)
    if corruption is not None:
        bench = replace(bench, corruptions=_planners(bench, corruption))
    if seeds is not None:
        bench = replace(bench, seeds=tuple(range(seeds)))
    return bench


def at_severities(bench: Bench, text: str | None) -> Bench:
    """Return the benchmark with each corruption at several severities, labelled `marks_s1`.

    A corruption without levels stays as it is: it happens or not.

    Args:
        bench: the benchmark.
        text: levels such as `1-5` or `1,3,5`; `None` for no change.

    Raises:
        ParameterError: the text is no list of levels, a corruption is a combination or has
            parameters of its own, or none has levels.
    """
    if text is None:
        return bench
    levels = _parse_levels(text)
    planners: dict[str, Planner | None] = {}
    for label, planner in bench.planners.items():
        if planner is not None and (
            not isinstance(planner, Corruption) or planner != type(planner)()
        ):
            raise ParameterError(
                f"--severities: {label!r} is not a corruption with its default parameters, so its"
                " levels are not known; leave it out with --corruptions, or list levels in the file"
            )
        if isinstance(planner, Corruption) and planner.severities:
            planners |= {f"{label}_s{level}": type(planner).at(level) for level in levels}
        else:
            planners[label] = planner
    if planners == bench.planners:
        raise ParameterError(
            f"--severities: no corruption of the run has levels ({', '.join(planners)}); leave it"
            " out, or name others with --corruptions"
        )
    return replace(bench, corruptions=planners)


def _parse_levels(text: str) -> list[int]:
    """Return the levels in `1-5` or `1,3,5`.

    Raises:
        ParameterError: it has another form.
    """
    levels: list[int] = []
    for part in text.split(","):
        first, _, last = part.strip().partition("-")
        if not (first.isdecimal() and (last or first).isdecimal()):
            levels = []
            break
        levels += range(int(first), int(last or first) + 1)
    if not levels or not set(levels) <= {1, 2, 3, 4, 5} or len(set(levels)) < len(levels):
        raise ParameterError(
            f"--severities: {text!r} must be levels of 1 to 5, such as 1-5 or 1,3,5"
        )
    return levels


def end_at_retention(bench: Bench, retention: float | None) -> Bench:
    """Return the benchmark that ends once a retention is shown; unchanged if it is `None`.

    Its tasks are put into a random order, since one that begins with easy tasks would end too soon.

    Raises:
        ParameterError: it has several agents, or no condition to compare.
    """
    if retention is None:
        return bench
    rule = StopRule(retention=retention)
    bench = replace(bench, until_retention=rule, tasks=draw_task_order(bench.tasks, rule.seed))
    StopRule.read(bench.to_data())
    return bench


def on_machines(
    bench: Bench, vm: tuple[str, ...], count: int, options: tuple[str, ...], reset_command: str
) -> Bench:
    """Return the benchmark on machines of the user; unchanged if none is named.

    Args:
        bench: The benchmark, whose tasks are those of a family.
        vm: Addresses of running machines and names of providers.
        count: How many machines each provider starts.
        options: Arguments for the providers, such as `region=us-east-1`.
        reset_command: The command that makes a running machine pristine.

    Raises:
        ParameterError: The machines and the tasks or options don't go together.
    """
    if not vm:
        if bench.provider == OSWORLD:
            raise ParameterError(f"{bench.source}: desktop.provider: {OSWORLD} needs --vm")
        if options or reset_command or count > 1:
            raise ParameterError("--machines, --vm-option and --reset-command need --vm")
        return bench
    family = families.shared_family({name: TASKS.get(name) for name in bench.tasks})
    if family is None:
        raise ParameterError(
            "--vm plays OSWorld's tasks: name their folder, --tasks evaluation_examples"
        )
    settings = MachineSettings(
        vm=vm, count=count, options=family.read_options(options), reset_command=reset_command
    )
    return replace(bench, provider=OSWORLD, machines=settings)


def _planners(bench: Bench, text: str) -> Planners:
    """Return the corruptions that a text lists: labels of the file, names, `all`, or a named set.

    The path of a configuration of corruptions, such as the authors' `default.yaml`, stands for all
    that it lists.
    """
    planners = {key: planner for of in (ALL, *SETS) for key, planner in all_planners(of).items()}
    planners |= bench.planners
    labels: list[str] = []
    for name in _split_names(text):
        if name in (ALL, *SETS):
            listed = all_planners(name)
            labels += [label for label in listed if label != CLEAN or CLEAN not in labels]
            continue
        if name.endswith((".yaml", ".yml")):
            in_file = load_config(name)
            if in_file.options:
                warnings.warn(
                    f"{name}: a run does not read its {', '.join(in_file.options)}, which is for"
                    " datasets: use --seeds, and clean among --corruptions",
                    HijackWarning,
                    stacklevel=2,
                )
            planners.update(in_file.corruptions)
            labels += in_file.corruptions
            continue
        if "+" in name and name not in planners:
            planners[name] = _combine(name, planners)
        if name not in planners:
            check_not_broken(name)
            if CORRUPTIONS.is_reference(name):
                find_corruption(name)  # which says how a file is loaded
        labels.append(name)
    return {
        label: planners[label]
        for label in _check_names("--corruptions", ",".join(labels), planners)
    }


def _combine(text: str, planners: Planners) -> Planner:
    """Return the sequence that `pop_ups+slow_network` stands for.

    Raises:
        UnknownNameError: One of the names is not known.
        ParameterError: One of them is given twice.
    """
    corrupting = {label: planner for label, planner in planners.items() if planner is not None}
    names = _check_names("--corruptions", text.replace("+", ","), corrupting)
    return Sequence(corrupting[name] for name in names)


def _registered_names(option: str, text: str, registry: AnyRegistry) -> tuple[str, ...]:
    """Return names, after loading any `file.py:Class` and `module:Class`.

    Raises:
        HijackError: a name does not exist, or cannot be loaded.
        ConfigError: An agent file or a task file has mistakes.
    """
    registry.load()  # plug-ins are loaded first, so broken ones are known
    names: list[str] = []
    for name in _split_names(text):
        try:
            names.append(registry.find(name) if registry.is_reference(name) else name)
            registry.check_not_broken(name)
        except ConfigError:
            raise  # the error names the file and all its mistakes
        except HijackError as error:
            raise type(error)(f"{option}: {error}") from error
    return _check_names(option, ",".join(names), registry.names(), registry.hint)


def _task_names(text: str) -> tuple[str, ...]:
    """Return the tasks that a text lists; a folder stands for the tasks in its files."""
    listed: list[str] = []
    for name in _split_names(text):
        listed += _files_in(name) if _is_folder(name) else [name]
    return _registered_names("--tasks", ",".join(listed), TASKS)


def _is_folder(name: object) -> bool:
    """Return whether a name is that of a folder, and of no task: names of ours come first."""
    if not isinstance(name, str) or name == ALL or name in TASKS.names():
        return False
    return os.path.isdir(name)


def _files_in(folder: str) -> list[str]:
    """Return the task files in a folder."""
    return families.find_by_folder(Path(folder)).list_files(folder)


def _split_names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")]


def _check_names(
    option: str, text: str, choices: Iterable[str], hint: Callable[[str], str] | None = None
) -> tuple[str, ...]:
    """Return the names that a text lists.

    Raises:
        UnknownNameError: one of them is not known.
        ParameterError: one of them is given twice.
    """
    available = tuple(choices)
    if text.strip() == ALL:
        return available
    names = tuple(_split_names(text))
    for name in names:
        if name not in available:
            advice = suggest(name, available) if hint is None else hint(name)
            raise UnknownNameError(f"{option}: no {name!r}{advice}")
        if names.count(name) > 1:
            raise ParameterError(f"{option} names {name!r} twice: {text!r}; remove one")
    return names


class _Reader:
    """Reads the keys; a mistake is added to `problems`, and the key keeps its default."""

    def __init__(self, problems: Problems) -> None:
        self._problems = problems

    def read(self, tree: MappingNode, source: str) -> Bench:
        for key, position in tree.keys.items():
            if key not in KEYS:
                hint = suggest(key, KEYS)
                self._problems.add(position, f"unknown key {key!r}{hint}")
        values: dict[str, Any] = {"tasks": tuple(TASKS.names())}
        for key, item in tree.items.items():
            if key == "desktop":
                values.update(self._desktop(item))
                continue
            value = self._value(key, item)
            if value is not None:
                values[key] = value
        return Bench(source=source, **values)

    def _value(self, key: str, tree: ConfigNode) -> Any:
        """Return the value of one key; `None` for an unknown one, or one with a mistake in it."""
        if key == "agents":
            return self._names(key, tree, AGENTS)
        if key == "tasks":
            return self._tasks(key, tree)
        if key == "osworld_files":
            return self._text(key, tree)
        if key == "seeds":
            return self._list(key, tree, "[0, 1, 2]", self._seed)
        if key == "corruptions":
            return self._corruptions(tree)
        if key in CHOICES:
            return check(self._problems, CHOICES[key], key, tree)
        if key == "text_boxes":
            return check(self._problems, TEXT_BOXES, key, tree)
        if key in NUMBERS:
            return check(self._problems, NUMBERS[key], key, tree)
        return None

    def _text(self, key: str, tree: ConfigNode) -> str | None:
        if isinstance(tree, ScalarNode) and isinstance(tree.value, str):
            return tree.value
        return self._problems.add(tree.position, f"{key} must be a text, got {describe_node(tree)}")

    def _seed(self, key: str, tree: ConfigNode) -> Any:
        return check(self._problems, SEED, key, tree)

    def _desktop(self, tree: ConfigNode) -> dict[str, Any]:
        """Return the given ones of `provider` and `size`."""
        example = "write desktop: {provider: embedded, size: [1920, 1080]}"
        if not isinstance(tree, MappingNode):
            self._problems.add(
                tree.position, f"desktop must be a mapping, got {describe_node(tree)}; {example}"
            )
            return {}
        for key, position in tree.keys.items():
            if key not in DESKTOP_KEYS:
                hint = suggest(key, DESKTOP_KEYS)
                self._problems.add(position, f"desktop has no key {key!r}{hint}")
        values: dict[str, Any] = {}
        if "provider" in tree.items:
            values["provider"] = self._name("desktop.provider", tree.items["provider"], PROVIDERS)
        if "size" in tree.items:
            values["size"] = self._size(tree.items["size"], example)
        return {key: value for key, value in values.items() if value is not None}

    def _size(self, tree: ConfigNode, example: str) -> Size | None:
        if not isinstance(tree, SequenceNode) or len(tree.items) != 2:
            return self._problems.add(
                tree.position, f"desktop.size must be [width, height] in pixels; {example}"
            )
        width = check(self._problems, SIDE, "desktop.size[0]", tree.items[0])
        height = check(self._problems, SIDE, "desktop.size[1]", tree.items[1])
        if width is None or height is None:
            return None
        return height, width

    def _names(self, key: str, tree: ConfigNode, registry: AnyRegistry) -> tuple[str, ...] | None:
        names = tuple(registry.names())
        if isinstance(tree, ScalarNode) and tree.value == ALL:
            return names

        def read_name(item_key: str, item: ConfigNode) -> str | None:
            return self._name(item_key, item, registry)

        example = f"[{names[0]}]"
        return self._list(key, tree, example, read_name)

    def _tasks(self, key: str, tree: ConfigNode) -> tuple[str, ...] | None:
        """Return the tasks of a named set, of a folder of OSWorld's, or of a list."""
        if isinstance(tree, ScalarNode) and tree.value in task_sets.set_names():
            return task_sets.members(str(tree.value))
        if isinstance(tree, ScalarNode) and _is_folder(tree.value):
            try:
                return tuple(map(TASKS.find, _files_in(str(tree.value))))
            except HijackError as error:
                return self._problems.add(tree.position, f"{key}: {error}")
        return self._names(key, tree, TASKS)

    def _name(self, key: str, tree: ConfigNode, registry: AnyRegistry) -> str | None:
        """Return a name, after loading it if it is `file.py:Class` or `module:Class`."""
        text = tree.value if isinstance(tree, ScalarNode) else None
        choice = Parameter("choice", "", choices=tuple(registry.names()))
        if isinstance(text, str):
            try:
                if registry.is_reference(text):
                    return registry.find(text)
                registry.check_not_broken(text)
            except ConfigError as error:
                for problem in error.problems:
                    self._problems.add(tree.position, f"{key}: {problem}")
                return None
            except HijackError as error:
                return self._problems.add(tree.position, f"{key}: {error}")
        return check(self._problems, choice, key, tree)

    def _list(
        self, key: str, tree: ConfigNode, example: str, read_item: Callable[[str, ConfigNode], Any]
    ) -> tuple[Any, ...] | None:
        if not isinstance(tree, SequenceNode) or not tree.items:
            content = "an empty one" if isinstance(tree, SequenceNode) else describe_node(tree)
            return self._problems.add(
                tree.position, f"{key} must be a list, got {content}; write {key}: {example}"
            )
        values: list[Any] = []
        for index, item in enumerate(tree.items):
            value = read_item(f"{key}[{index}]", item)
            if value is not None and value in values:
                self._problems.add(item.position, f"{key} names {value!r} twice; remove one")
            values.append(value)
        return tuple(values)

    def _corruptions(self, tree: ConfigNode) -> Planners | None:
        """Return the planners of `all`, a named set, or a list.

        In a list, `clean` is the clean condition.
        """
        if isinstance(tree, ScalarNode) and tree.value in (ALL, *SETS):
            return all_planners(str(tree.value))
        if not isinstance(tree, SequenceNode):
            return self._build_planners(tree)
        corrupted = [item for item in tree.items if not _is_clean(item)]
        if len(corrupted) == len(tree.items):
            return self._build_planners(tree)
        if not corrupted:
            return {CLEAN: None}
        return {CLEAN: None, **self._build_planners(SequenceNode(tree.position, corrupted))}

    def _build_planners(self, tree: ConfigNode) -> Planners:
        return cast("Planners", Builder(self._problems).build(tree))


def _is_clean(tree: ConfigNode) -> bool:
    return isinstance(tree, ScalarNode) and tree.value == CLEAN
