"""The options of a build: one class that Python, the command line and configurations fill."""

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeAlias, TypedDict, TypeVar, cast, get_type_hints

from hijack_data.config import load_config
from hijack_data.paths import PathLike
from hijack_data.planner import Planner

from ..errors import BuildError
from .inline_corruptions import parse
from .selection import ALL, VISUAL

ConfigLike: TypeAlias = str | os.PathLike[str] | Mapping[str, Any]
Progress: TypeAlias = Callable[[int, int, str], object]
F = TypeVar("F", bound=Callable[..., Any])

ROWS_PER_SHARD = 500
# The options that a configuration may set, with the values for when neither it nor the caller does.
DEFAULTS: Mapping[str, Any] = {
    "corruptions": VISUAL,
    "seed": 0,
    "clean": True,
    "label_policy": "keep",
    "output": "materialised",
    "splits": None,
}


@dataclass(frozen=True, kw_only=True)
class BuildOptions:
    """All options of a build, each with its type, its default and its meaning.

    `None` stands for an option that was not given. `corruptions`, `seed`, `clean`,
    `label_policy`, `output` and `splits` are then taken from `config`, or else from `DEFAULTS`.

    Args:
        corruptions: planners by label, text such as `"marks:number=10,severity=4,subtitle"` (see
            `inline_corruptions`), `"clean"` for the clean rows, `"all"`, or `"all-visual"` (the
            default): those that act only on the picture. `UnknownNameError` for an unknown name,
            `BuildError` for a corruption that cannot be built.
        seed: 0 to 2**64 - 1; 0 by default. `ParameterError` for another one.
        format: name of the reader for all files; by default the reader of each file is detected.
        coordinates: the space of the coordinates if the recording does not name it: `pixels`,
            `fractions` (0..1), `thousand` (0..1000) or `resized` (pixels of the smart-resized
            picture). `BuildError` for another word.
        boxes: the form of the boxes if the recording does not show it: `xywh` or `xyxy`.
            `BuildError` for another word.
        episode_key: the field of a row that names its episode, for `splits`, if the rows of the
            source are single steps of longer recordings. `BuildError` if no format of the source
            has such rows.
        config: a configuration with `corruptions`, `seed`, `clean`, `label_policy`, `output` and
            `splits`; options given here override it. `ConfigError` for a mistake in it.
        clean: whether to write the uncorrupted rows too; true by default.
        label_policy: the treatment of a sample whose target is hidden: `keep` (the default),
            `avoid`, `drop` or `recover`. `BuildError` for another word.
        output: `materialised` (the default) stores every picture; `lazy` stores the screenshot of
            a step once and draws the corrupted ones on access. `BuildError` for another word.
        assets: folder of recorded pictures for corruptions that act on the machine; by default
            `AGENTHIJACK_ASSETS`, otherwise the folder in the package. `AssetError` if it is
            needed and missing.
        apps: applications on the screen of the trajectories whose source names none, such as
            `"chrome,vscode"`. A file in the source can list them by trajectory, see
            `pipelines.knowledge`.
        platform: the machine of the trajectories whose source does not name it: `linux-xfce`,
            `linux`, `windows`, `macos`, `android`, `ios` or `web`.
        allow_platform_mismatch: show the desktop of the recorded pictures (Xfce) in recordings of
            another or an unknown platform, too; the `fidelity` of such rows is `foreign`.
        strict: stop with `SourceError` at the first input that cannot be read.
        rows_per_shard: the most rows in a file, which holds at least one trajectory; at least 1.
        workers: number of processes, at least 1. With more than one, call `build` from under
            `if __name__ == "__main__":`.
        engine: `local` (this process, or `workers` processes of this machine) or `ray` (`workers`
            CPUs of a Ray cluster). `UnknownNameError` for another one.
        ray_address: the cluster, `"auto"` for the one of this machine; by default `RAY_ADDRESS`,
            otherwise a cluster is started here.
        resume: continue a build that was stopped, or repair a dataset with damaged files.
            `DatasetError` if the build used a file of corruptions that is not loaded, see
            `hijack_data.loading`.
        overwrite: replace the AgentHijack dataset in `out` once the new one is complete; see
            `replacement`. `BuildError` together with `resume`.
        limit: read only the first N trajectories; at least 1.
        splits: shares such as `{"train": 0.9, "test": 0.1}` or `"train=0.9,test=0.1"` of `train`,
            `validation` and `test`. The id of a trajectory alone decides its split, so all of
            its rows are in one. `BuildError` and `ParameterError` for other names and sums.
        dry_run: write nothing, and report what would be written. The pictures are drawn, so this
            takes nearly as long.
        progress: called with the steps done, the steps in all, and a text. With it, the records of
            a large source are read twice.
    """

    corruptions: Mapping[str, Planner] | str | None = None
    seed: int | None = None
    format: str | None = None
    coordinates: str | None = None
    boxes: str | None = None
    episode_key: str | None = None
    config: ConfigLike | None = None
    clean: bool | None = None
    label_policy: str | None = None
    output: str | None = None
    assets: PathLike | None = None
    apps: Sequence[str] | str | None = None
    platform: str | None = None
    allow_platform_mismatch: bool = False
    strict: bool = False
    rows_per_shard: int = ROWS_PER_SHARD
    workers: int = 1
    engine: str = "local"
    ray_address: str | None = None
    resume: bool = False
    overwrite: bool = False
    limit: int | None = None
    splits: str | Mapping[str, float] | None = None
    dry_run: bool = False
    progress: Progress | None = None

    def check(self) -> None:
        """Check the options that can be checked on their own.

        Raises:
            BuildError: a count is below 1, or both `resume` and `overwrite` are set.
        """
        _check_count("rows_per_shard", self.rows_per_shard)
        _check_count("workers", self.workers)
        if self.limit is not None:
            _check_count("limit", self.limit)
        if self.resume and self.overwrite:
            raise BuildError(
                "resume and overwrite exclude each other: one continues a build, the other starts"
                " a new one"
            )

    def resolved(self) -> "BuildOptions":
        """Return the options, completed from the configuration and the defaults.

        Raises:
            BuildError: the corruptions name the clean rows, but `clean` is false.
            ConfigError: a mistake in the configuration.
        """
        configured = _config_values(self.config)
        names_clean = self._names_clean()
        values = {name: configured.get(name, default) for name, default in DEFAULTS.items()}
        for name in DEFAULTS:
            value = getattr(self, name)
            if value is not None:
                values[name] = value
        if names_clean:
            values["clean"] = True
        return replace(self, **values)

    def _names_clean(self) -> bool:
        text = self.corruptions
        if not isinstance(text, str) or text.strip() in (ALL, VISUAL):
            return False
        names_clean = parse(text).clean
        if names_clean and self.clean is False:
            raise BuildError(
                "corruptions name 'clean', and --no-clean (in Python: clean=False) leaves those"
                " rows out"
            )
        return names_clean


class BuildKeywords(TypedDict, total=False):
    """The options of `BuildOptions` as keywords, for type checkers and editors."""

    corruptions: Mapping[str, Planner] | str | None
    seed: int | None
    format: str | None
    coordinates: str | None
    boxes: str | None
    episode_key: str | None
    config: ConfigLike | None
    clean: bool | None
    label_policy: str | None
    output: str | None
    assets: PathLike | None
    apps: Sequence[str] | str | None
    platform: str | None
    allow_platform_mismatch: bool
    strict: bool
    rows_per_shard: int
    workers: int
    engine: str
    ray_address: str | None
    resume: bool
    overwrite: bool
    limit: int | None
    splits: str | Mapping[str, float] | None
    dry_run: bool
    progress: Progress | None


def with_options(function: F) -> F:
    """Decorator: show every option of a build in the signature of a function, for `help`.

    The function takes the options as `**overrides`.
    """
    signature = inspect.signature(function)
    hints = get_type_hints(BuildOptions)
    parameters = [
        parameter
        for parameter in signature.parameters.values()
        if parameter.kind is not inspect.Parameter.VAR_KEYWORD
    ]
    for option in fields(BuildOptions):
        kind = inspect.Parameter.KEYWORD_ONLY
        hint = hints[option.name]
        parameter = inspect.Parameter(option.name, kind, default=option.default, annotation=hint)
        parameters.append(parameter)
    cast("Any", function).__signature__ = signature.replace(parameters=parameters)
    return function


def _config_values(config: ConfigLike | None) -> dict[str, Any]:
    """Return the options that a configuration sets."""
    if config is None:
        return {}
    loaded_config = load_config(cast("Any", config))
    return {**loaded_config.options, "corruptions": loaded_config.corruptions}


def _check_count(name: str, value: object) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or value < 1:
        raise BuildError(f"{name} must be an integer of at least 1, got {value!r}")
