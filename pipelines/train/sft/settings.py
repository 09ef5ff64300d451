"""The configuration of supervised fine-tuning; mistakes are reported all at once."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

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
from hijack_data.params import Parameter

from ..split import OSWORLD_SPLITS, members

METHOD = "sft"
_VALUES = {
    "epochs": Parameter("int", "How often each row is seen", low=1, high=10_000),
    "batch": Parameter("int", "Rows at a time on each GPU", low=1, high=4096),
    "accumulation": Parameter("int", "Batches a step of the optimiser", low=1, high=4096),
    "learning_rate": Parameter("float", "Of AdamW", low=1e-12, high=1),
    "max_pixels": Parameter("int", "Most pixels of a picture as the model sees it", low=1024),
    "seed": Parameter("int", "Of the order of the rows", low=0, high=2**32 - 1),
    "osworld_split": Parameter("choice", "Whose held-out tasks", choices=OSWORLD_SPLITS),
}
_TEXTS = ("method", "model")
_NAMES = ("data", "evaluation")
_KEYS = (*_TEXTS, *_NAMES, *_VALUES, "trl")


@dataclass(frozen=True, kw_only=True)
class SftSettings:
    """What is trained on what; see docs/train.md for each key.

    Args:
        model: of the Hugging Face hub, or a folder.
        data: folders of `hijack export --to chat` or `--to onlooker`.
        evaluation: names of the tasks that are reported, which must not be trained on.
        osworld_split: whose tasks of OSWorld are held out, as in `check_split`.
        epochs: how often each row is seen.
        batch: rows at a time on each GPU.
        accumulation: batches a step of the optimiser.
        learning_rate: of AdamW.
        max_pixels: the most pixels of a picture as the model sees it; `None` keeps the model's own.
        seed: of the order of the rows.
        trl: further fields of TRL's `SFTConfig`.
        source: the file, for messages.
    """

    model: str
    data: tuple[str, ...] = ()
    evaluation: tuple[str, ...] = ()
    osworld_split: str = "osworld"
    epochs: int = 1
    batch: int = 1
    accumulation: int = 16
    learning_rate: float = 1e-5
    max_pixels: int | None = None
    seed: int = 0
    trl: Mapping[str, Any] = field(default_factory=dict[str, Any])
    source: str = ""

    @property
    def folders(self) -> list[Path]:
        """The folders of the data."""
        return [Path(name).expanduser() for name in self.data]


def read_method(path_or_name: str | os.PathLike[str]) -> str | None:
    """Return the `method` of a training configuration, `None` for one without.

    Raises:
        ConfigError: there is no such file, or it is no YAML.
    """
    problems = Problems()
    name, data = read_config(path_or_name)
    tree = read_yaml(data, name, problems)
    problems.check()
    node = tree.items.get("method") if isinstance(tree, MappingNode) else None
    if node is None:
        return None
    value = node.value if isinstance(node, ScalarNode) else None
    if value != METHOD:
        problems.stop(node.position, f"method: no {value!r}{suggest(value, (METHOD,))}")
    return METHOD


def load_sft(path_or_name: str | os.PathLike[str]) -> SftSettings:
    """Read a configuration from a path, or by the bare name of a packaged one (`"sft"`).

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
    values: dict[str, Any] = {"source": name}
    for key, position in tree.keys.items():
        if key not in _KEYS:
            problems.add(position, f"unknown key {key!r}{suggest(key, _KEYS)}")
    if "model" not in tree.items:
        problems.add(Position(name, 1, 1), "model is missing; see docs/train.md")
    for key, item in tree.items.items():
        if key in _VALUES:
            values[key] = check(problems, _VALUES[key], key, item)
        elif key in _NAMES:
            values[key] = _names(key, item, problems)
        elif key == "model":
            values[key] = _text(key, item, problems)
        elif key == "trl":
            values[key] = _plain(item)
    if not isinstance(values.get("trl", {}), dict):
        problems.add(tree.items["trl"].position, "trl: fields of SFTConfig, as a mapping")
    problems.check()
    return SftSettings(**values)


def _text(key: str, item: ConfigNode, problems: Problems) -> str:
    value = item.value if isinstance(item, ScalarNode) else None
    if not isinstance(value, str) or not value:
        problems.add(item.position, f"{key} is a text, got {describe_node(item)}")
    return str(value)


def _names(key: str, item: ConfigNode, problems: Problems) -> tuple[str, ...]:
    names: list[str] = []
    for node in item.items if isinstance(item, SequenceNode) else [item]:
        name = _text(key, node, problems)
        if key == "data":
            names.append(name)
            continue
        try:
            names += members(name)
        except UnknownNameError as error:
            problems.add(node.position, f"{key}: {error}")
    return tuple(dict.fromkeys(names))


def _plain(item: ConfigNode) -> Any:
    if isinstance(item, MappingNode):
        return {key: _plain(value) for key, value in item.items.items()}
    if isinstance(item, SequenceNode):
        return [_plain(value) for value in item.items]
    return item.value if isinstance(item, ScalarNode) else None
