"""The settings of a build, which decide its rows, and their form in the manifest."""

import os
from collections.abc import Mapping
from typing import Any, cast

import yaml

from hijack_data import extras
from hijack_data.choices import LABEL_POLICIES, LAZY, OUTPUTS
from hijack_data.config import load_config
from hijack_data.errors import suggest
from hijack_data.pack import VARIABLE
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner
from hijack_data.rng import Stream

from ..dataset.manifest import libraries
from ..errors import BuildError, DatasetError
from ..readers.base import reader_source
from ..sources import Sources
from .build_options import BuildOptions
from .loaded_files import LOADED, loaded_file_entries
from .planner_identity import PLANNERS, planner_digests
from .selection import config_text, needs_boxes, select
from .splits import Splits
from .step_rows import RowSettings

ALLOW_PLATFORM_MISMATCH = "allow_platform_mismatch"


def make_settings(options: BuildOptions) -> tuple[RowSettings, tuple[str, ...]]:
    """Return the settings computed from options, and notes for the user.

    The asset pack is opened only if a corruption acts on the machine.

    Args:
        options: as `BuildOptions.resolved` returns them.

    Raises:
        BuildError: the policy or output is unknown, a corruption cannot be built, or there would be
            no rows.
    """
    planners = select(cast("Mapping[str, Planner] | str", options.corruptions))
    _check_word("label_policy", options.label_policy, LABEL_POLICIES)
    _check_word("output", options.output, OUTPUTS)
    seed = cast(int, options.seed)
    Stream(seed, "build")  # checks the seed
    if not planners and not options.clean:
        raise BuildError(
            "nothing to build: no corruption and no clean rows; leave out --no-clean (in Python:"
            " clean=False)"
        )
    uses_boxes = any(needs_boxes(planner) for planner in planners.values())
    detect = uses_boxes and has_detector()
    settings = RowSettings(
        planners=tuple(planners.items()),
        seed=int(seed),
        clean=bool(options.clean),
        label_policy=str(options.label_policy),
        detect=detect,
        lazy=options.output == LAZY,
        assets=_asset_folder(options),
        allow_platform_mismatch=bool(options.allow_platform_mismatch),
    )
    _ = settings.pack  # raises for a missing pack before anything is written
    if uses_boxes and not detect:
        return settings, (_no_detector(),)
    return settings, ()


def has_detector() -> bool:
    """Return whether elements can be detected in pictures in this environment."""
    try:
        import cv2
    except ImportError:
        return False
    return bool(cv2.__version__)


def manifest_parameters(
    settings: RowSettings, options: BuildOptions, sources: Sources, splits: Splits
) -> dict[str, Any]:
    """Return everything that decides the bytes of a dataset, as JSON data for the manifest.

    Options that were not given have no key.
    """
    planners = dict(settings.planners)
    parameters: dict[str, Any] = {"reader": ", ".join(sources.formats)}
    parameters |= sources.choices.to_data()
    parameters |= {
        "corruptions": config_text(planners, {}) or list(planners),
        "seed": settings.seed,
        "clean": settings.clean,
        "label_policy": settings.label_policy,
        "output": output_mode(settings),
        "elements": "picture" if settings.detect else "recorded",
        "rows_per_shard": options.rows_per_shard,
        "libraries": libraries(settings.detect),
        "assets": pack_identity(settings),
    }
    file_entries = loaded_file_entries(planners.values())
    if file_entries:
        parameters[LOADED] = file_entries
    digests = planner_digests(planners)
    if digests:
        parameters[PLANNERS] = digests
    if settings.allow_platform_mismatch:
        parameters[ALLOW_PLATFORM_MISMATCH] = True
    parameters |= splits.parameters()
    parameters |= sources.knowledge_parameters()
    if options.limit is not None:
        parameters["limit"] = options.limit
    if options.format is not None:
        parameters["format"] = options.format
        parameters |= reader_source(options.format)
    return parameters


def pack_identity(settings: RowSettings) -> dict[str, str] | None:
    """Return the digest and the licence of the asset pack, or `None` if none is used."""
    pack = settings.pack
    if pack is None:
        return None
    return {"sha256": pack.digest, "licence": pack.licence}


def build_config(settings: RowSettings, splits: Splits) -> str | None:
    """Return the configuration (YAML) of the same build, or `None` if no file can hold it."""
    options = splits.parameters()
    options["seed"] = settings.seed
    options["clean"] = settings.clean
    options["label_policy"] = settings.label_policy
    options["output"] = output_mode(settings)
    return config_text(dict(settings.planners), options)


def output_mode(settings: RowSettings) -> str:
    """Return how pictures are stored, one of `OUTPUTS`."""
    return LAZY if settings.lazy else OUTPUTS[0]


def in_order(rows: Mapping[str, int], settings: RowSettings) -> dict[str, int]:
    """Return numbers of rows by label, sorted in the order of the build."""
    labels = [label for label, _ in settings.planners]
    if settings.clean:
        labels.insert(0, CLEAN)
    return {label: rows.get(label, 0) for label in labels}


def settings_from(parameters: Mapping[str, Any], dataset: str) -> RowSettings | None:
    """Return the settings of a build from the `parameters` of its manifest.

    Args:
        parameters: those of the manifest.
        dataset: its name, for messages.

    Returns:
        The settings, or `None` if no configuration file can hold the corruptions: the manifest
        then has their labels only.

    Raises:
        DatasetError: the parameters are not those of any build.
    """
    try:
        return _settings_from(parameters)
    except (KeyError, TypeError, ValueError, yaml.YAMLError) as error:
        raise DatasetError(f"{dataset}: manifest.json: parameters are damaged ({error})") from None


def _settings_from(parameters: Mapping[str, Any]) -> RowSettings | None:
    text = parameters.get("corruptions")
    config = yaml.safe_load(text) if isinstance(text, str) else None
    planners = load_config(config).corruptions if config else {}
    if text and not planners:
        return None
    return RowSettings(
        planners=tuple(planners.items()),
        seed=int(parameters["seed"]),
        clean=bool(parameters["clean"]),
        label_policy=parameters["label_policy"],
        detect=parameters["elements"] == "picture",
        lazy=parameters["output"] == LAZY,
        allow_platform_mismatch=bool(parameters.get(ALLOW_PLATFORM_MISMATCH, False)),
    )


def _check_word(name: str, word: object, words: tuple[str, ...]) -> None:
    if word not in words:
        raise BuildError(f"{name} {word!r} is not known{suggest(word, words)}")


def _asset_folder(options: BuildOptions) -> str | None:
    """Return the folder as an absolute path, since workers may not share our environment."""
    folder = options.assets or os.environ.get(VARIABLE)
    return os.path.abspath(folder) if folder else None


def _no_detector() -> str:
    remedy = extras.remedy("vision")
    return f"elements are those of the recording only: opencv is not installed ({remedy})"
