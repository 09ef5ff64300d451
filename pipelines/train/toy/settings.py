"""The configuration of a replication: a YAML file whose mistakes are all reported at once."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

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
)
from hijack_data.config.yaml_reader import read_yaml
from hijack_data.config_files import read_config
from hijack_data.errors import UnknownNameError, suggest
from hijack_data.params import Parameter, parameters
from hijack_data.planner import Planner

from ..replay import CAPACITY, REPLAY_TRIGGERS
from ..trainer import TrainSettings
from .arms import ARMS
from .tasks import toy_task

ENVIRONMENTS = ("toy",)
_TRAINER_NAMES = (
    "epochs",
    "rollouts",
    "batch",
    "max_steps",
    "learning_rate",
    "clip_low",
    "clip_high",
    "format_weight",
)
_TRAINER_PARAMETERS = parameters(TrainSettings)
_NUMBERS = {
    "seeds": Parameter("int", "Pairs of runs", low=2, high=1000),
    **{name: _TRAINER_PARAMETERS[name][0] for name in _TRAINER_NAMES},
    "replay_capacity": CAPACITY,
    "replay_when": Parameter("choice", "When a success is put in", choices=REPLAY_TRIGGERS),
    "draws": Parameter("int", "Draws of each corruption for a task", low=1, high=100),
    "start_tasks": Parameter("int", "Tasks that the expert shows", low=1, high=100_000),
    "start_epochs": Parameter("int", "How often the start sees each", low=1, high=10_000),
}
_SETS = {"training": "toy/training", "evaluation": "toy/held_out"}
_KEYS = ("environment", "training", "evaluation", "arms", "trained", "untrained", *_NUMBERS)


@dataclass(frozen=True, kw_only=True)
class Replication:
    """What is compared, and how; see docs/train.md for each key.

    Args:
        training: names of the training tasks.
        evaluation: names of the tasks that are reported.
        trained: corruptions by label that DA-GRPO trains with.
        untrained: corruptions by label that no run is trained with.
        arms: names in `arms.ARMS`; `grpo` is what the others are compared with.
        seeds: pairs of runs; each has its own start.
        epochs: how often each task is trained on.
        rollouts: rollouts a group.
        batch: groups a step.
        max_steps: answers until a rollout is cut off.
        learning_rate: of AdamW.
        clip_low: how far the ratio may fall.
        clip_high: how far the ratio may rise.
        format_weight: the penalty of an answer in the wrong form.
        replay_capacity: stored successes a task.
        replay_when: `zero` or `failed`, see `ReplayBuffer`.
        draws: evaluation episodes for each task and corruption.
        start_tasks: tasks that the expert shows for the start.
        start_epochs: how often the start sees each.
        source: the file, for messages.
    """

    training: tuple[str, ...]
    evaluation: tuple[str, ...]
    trained: Mapping[str, Planner]
    untrained: Mapping[str, Planner] = field(default_factory=dict[str, Planner])
    arms: tuple[str, ...] = ("grpo", "da_grpo")
    seeds: int = 4
    epochs: int = 15
    rollouts: int = 4
    batch: int = 4
    max_steps: int = 6
    learning_rate: float = 5e-4
    clip_low: float = 0.2
    clip_high: float = 0.3
    format_weight: float = 1.0
    replay_capacity: int = 4
    replay_when: str = "zero"
    draws: int = 1
    start_tasks: int = 1500
    start_epochs: int = 6
    source: str = ""

    def to_data(self) -> dict[str, Any]:
        """Return it as JSON data, every parameter of every corruption written out."""
        data = {key: value for key, value in vars(self).items() if key not in _PLANNERS}
        for key in _PLANNERS:
            planners: Mapping[str, Planner] = getattr(self, key)
            data[key] = {label: planner.to_config() for label, planner in planners.items()}
        return data


_PLANNERS = ("trained", "untrained")


def load_replication(path_or_name: str | os.PathLike[str]) -> Replication:
    """Read a configuration from a path, or by the bare name of a packaged one (`"toy"`).

    Raises:
        ConfigError: the configuration has mistakes; the message lists all of them, each as
            `file:line:column: message`.
    """
    problems = Problems()
    name, data = read_config(path_or_name)
    tree = read_yaml(data, name, problems)
    if not isinstance(tree, MappingNode):
        problem = "the file is empty" if tree is None else f"got {describe_node(tree)}"
        problems.stop(Position(name, 1, 1), f"a training configuration is a mapping, {problem}")
    replication = _Reader(problems).read(tree, name)
    problems.check()
    return replication


class _Reader:
    """Reads the keys; mistakes go into `problems`."""

    def __init__(self, problems: Problems) -> None:
        self._problems = problems

    def read(self, tree: MappingNode, source: str) -> Replication:
        values: dict[str, Any] = {"source": source}
        for key, position in tree.keys.items():
            if key not in _KEYS:
                self._problems.add(position, f"unknown key {key!r}{suggest(key, _KEYS)}")
        for key in ("environment", "training", "evaluation", "trained"):
            if key not in tree.items:
                start = Position(source, 1, 1)
                self._problems.add(start, f"{key} is missing; see docs/train.md")
        for key, item in tree.items.items():
            if key in _NUMBERS:
                values[key] = check(self._problems, _NUMBERS[key], key, item)
            elif key in _PLANNERS:
                values[key] = Builder(self._problems).build(item)
            elif key == "arms":
                values[key] = self._arms(item)
            elif key in ("training", "evaluation"):
                values[key] = self._tasks(key, item)
            elif key == "environment":
                self._environment(item)
        for label in values.get("untrained", {}):
            if label in values.get("trained", {}):
                self._problems.add(
                    tree.items["untrained"].position,
                    f"untrained: {label!r} is in trained, too, so runs are trained with it; take it"
                    " out, or label it, such as as: other",
                )
        self._problems.check()
        return Replication(**values)

    def _environment(self, item: ConfigNode) -> None:
        value = item.value if isinstance(item, ScalarNode) else None
        if value not in ENVIRONMENTS:
            advice = "others are trained on from Python, see docs/train.md"
            self._problems.add(
                item.position, f"environment: no {value!r}{suggest(value, ENVIRONMENTS)} ({advice})"
            )

    def _arms(self, item: ConfigNode) -> tuple[str, ...]:
        names: list[str] = []
        for node in item.items if isinstance(item, SequenceNode) else [item]:
            value = node.value if isinstance(node, ScalarNode) else None
            if value in ARMS and value not in names:
                names.append(str(value))
                continue
            problem = f"arms: no {value!r}{suggest(value, ARMS)}"
            if value in names:
                problem = f"arms: {value!r} is there twice; remove one"
            self._problems.add(node.position, problem)
        if isinstance(item, SequenceNode) and not item.items:
            self._problems.add(item.position, f"arms is empty; known: {', '.join(ARMS)}")
        return tuple(names)

    def _tasks(self, key: str, item: ConfigNode) -> tuple[str, ...]:
        """Return the tasks of a list, of which each may also be the name of a set."""
        from ..split import members

        names: list[str] = []
        for node in item.items if isinstance(item, SequenceNode) else [item]:
            value = node.value if isinstance(node, ScalarNode) else None
            if not isinstance(value, str):
                self._problems.add(node.position, f"{key} holds names, got {describe_node(node)}")
                continue
            try:
                names += members(value)
            except UnknownNameError as error:
                self._problems.add(node.position, f"{key}: {error}")
        if not names and isinstance(item, SequenceNode) and not item.items:
            self._problems.add(item.position, f"{key} is empty; name a set, such as {_SETS[key]}")
        return tuple(dict.fromkeys(names))


def check_tasks(replication: Replication) -> None:
    """Check that all tasks are the toy desktop's, before anything is played.

    Raises:
        UnknownNameError: one is not.
    """
    for name in (*replication.training, *replication.evaluation):
        try:
            toy_task(name)
        except UnknownNameError as error:
            raise UnknownNameError(f"{replication.source}: {error}") from None


def trainer_settings(replication: Replication) -> dict[str, Any]:
    """Return what `TrainSettings` takes of a replication."""
    names = ("epochs", "rollouts", "batch", "max_steps", "learning_rate", "clip_low", "clip_high")
    return {name: getattr(replication, name) for name in names}


def check_arm(name: str) -> None:
    """Check the name of an arm.

    Raises:
        UnknownNameError: there is no such arm.
    """
    if name not in ARMS:
        raise UnknownNameError(f"no arm {name!r}{suggest(name, ARMS)}")
