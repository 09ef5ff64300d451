"""The dataset card: README.md, which also tells `datasets.load_dataset` where the rows are."""

import json
import shlex
from collections.abc import Mapping
from typing import Any

import yaml

from hijack_data import extras
from hijack_data.errors import quantity

from ..dataset.columns import VISIBLE, Kind, stored_columns
from ..dataset.manifest import is_lazy
from ..dataset.opening import shard_split
from ..fidelity import FIDELITY_MEANINGS
from ..knowledge import RECORDINGS
from ..readers import get_reader
from .build_options import ROWS_PER_SHARD
from .loaded_files import LOADED
from .row_settings import ALLOW_PLATFORM_MISMATCH

CARD = "README.md"
CONFIG = "config.yaml"
REBUILD_FOLDER = "../built-again"
_POLICIES = {
    "keep": "Rows whose target is hidden are kept; `target_visible` says how much of it shows.",
    "avoid": (
        "A corruption is placed again until the whole target shows; where that fails there is no"
        " row."
    ),
    "drop": f"Rows of which less than {VISIBLE:g} of the target shows are dropped.",
    "recover": (
        "What can be undone comes with the step that undoes it. What lies over the screen and has"
        " nothing to close it is placed again until the whole target shows; where that fails there"
        " is no row."
    ),
}


def make_card(manifest: Mapping[str, Any], has_faults: bool = False) -> str:
    """Return the card of a dataset, which names no folder, so a moved dataset keeps it.

    Args:
        manifest: that of the dataset.
        has_faults: whether a corruption of the build is a fault of the input.
    """
    parameters = manifest["parameters"]
    assets = parameters.get("assets")
    return "\n".join(
        [
            *_front_matter(manifest),
            "# Computer-use trajectories with corrupted screens",
            "",
            (
                f"{manifest['rows']} rows from {manifest['source']['steps']} steps of"
                f" {manifest['source']['trajectories']} recorded trajectories (format"
                f" `{parameters['reader']}`), made by AgentHijack"
                f" {parameters['libraries']['agenthijack']}. Each row is one step: a screenshot and"
                " the action to take on it, in pixels of that screenshot."
            ),
            "",
            *_counts(manifest),
            *_reading(is_lazy(manifest)),
            *_how(manifest, has_faults),
            *_columns(is_lazy(manifest)),
            "## Licence",
            "",
            (
                "The screenshots and instructions come from the source recordings and stay under"
                " their licence and terms; check those before you share this dataset."
            ),
            *(
                []
                if assets is None
                else [f"Pictures of events come from an asset pack: {assets['licence']}"]
            ),
            "",
        ]
    )


def _front_matter(manifest: Mapping[str, Any]) -> list[str]:
    # No `configs`: datasets names its cache by them alone, so two datasets in folders of one name
    # would share it. Without them it finds data/train-*.parquet by itself and names the cache by
    # the files.
    lazy = is_lazy(manifest)
    splits = _split_sizes(manifest)
    data = {
        "pretty_name": "Computer-use trajectories with corrupted screens",
        "license": "other",
        "license_name": "as-source-recordings",
        "license_link": CARD,
        "task_categories": ["image-text-to-text"],
        "tags": ["computer-use", "gui-agents", "screenshots", "robustness", "agenthijack"],
        "size_categories": [_size_category(manifest["rows"])],
        "dataset_info": {
            "features": [_feature(name, kind) for name, (kind, _) in stored_columns(lazy).items()],
            "splits": splits,
            "download_size": sum(split["num_bytes"] for split in splits),
            "dataset_size": sum(split["num_bytes"] for split in splits),
        },
    }
    return ["---", *yaml.safe_dump(data, sort_keys=False).splitlines(), "---", ""]


def _size_category(rows: int) -> str:
    """Return the Hub's name for a number of rows."""
    end = 3
    while rows >= 10**end and end < 12:
        end += 1
    if end == 3:
        return "n<1K"
    return f"{_short(10 ** (end - 1))}<n<{_short(10**end)}"


def _short(number: int) -> str:
    thousands = 0
    while number >= 1000:
        number //= 1000
        thousands += 1
    return f"{number}{' KMBT'[thousands].strip()}"


def _split_sizes(manifest: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the rows and the bytes of each split that has files."""
    sizes: dict[str, dict[str, Any]] = {}
    for shard in manifest["shards"]:
        name = shard_split(shard)
        size = sizes.setdefault(name, {"name": name, "num_bytes": 0, "num_examples": 0})
        size["num_bytes"] += shard["bytes"]
        size["num_examples"] += shard["rows"]
    return list(sizes.values())


def _feature(name: str, kind: Kind) -> dict[str, Any]:
    """Return a column as the Hub writes features in YAML."""
    if isinstance(kind, dict):
        return {"name": name, "struct": [_feature(key, part) for key, part in kind.items()]}
    if isinstance(kind, list):
        return {"name": name, "sequence": kind[0]}
    if kind == "image file":
        return {"name": name, "dtype": {"image": {"decode": False}}}
    return {"name": name, "dtype": kind}


def _counts(manifest: Mapping[str, Any]) -> list[str]:
    counts = manifest["counts"]
    unfit = {label: sum(reasons.values()) for label, reasons in counts["not_applicable"].items()}
    rows = [
        f"| `{label}` | {count} | {unfit.get(label, 0)} | {counts['dropped'].get(label, 0)} |"
        for label, count in counts["rows"].items()
    ]
    rejected = sum(counts["rejected"].values())
    return [
        "| corruption | rows | not applicable | dropped |",
        "|---|---:|---:|---:|",
        *rows,
        "",
        *_splits(manifest),
        (
            f"{quantity(rejected, 'input')} could not be read: see `quarantine.jsonl`."
            if rejected
            else "Every input was read."
        ),
        "",
    ]


def _splits(manifest: Mapping[str, Any]) -> list[str]:
    """Return how the trajectories were split, and the number of rows of each split."""
    parameters = manifest["parameters"]
    lines = (
        [f"Only the first {parameters['limit']} trajectories were read.", ""]
        if "limit" in parameters
        else []
    )
    if "splits" not in parameters:
        return lines
    counts_by_split: dict[str, list[int]] = {name: [0, 0, 0] for name in parameters["splits"]}
    for shard in manifest["shards"]:
        split = shard_split(shard)
        totals = (shard["trajectories"], shard["steps"], shard["rows"])
        counts_by_split[split] = [
            a + b for a, b in zip(counts_by_split[split], totals, strict=True)
        ]
    return [
        *lines,
        (
            "Split by a hash of the episode: all rows of an episode are in one split, whatever the"
            f" seed. {_episodes(parameters)}"
        ),
        "",
        "| split | share | trajectories | steps | rows |",
        "|---|---:|---:|---:|---:|",
        *(
            f"| `{name}` | {parameters['splits'][name]:g} | {' | '.join(map(str, numbers))} |"
            for name, numbers in counts_by_split.items()
        ),
        "",
    ]


def _episodes(parameters: Mapping[str, Any]) -> str:
    """Return what counts as an episode in each format."""
    key = parameters.get("episode_key")
    rules: dict[str, list[str]] = {}
    for name in parameters["reader"].split(", "):
        reader = get_reader(parameters.get("format", name))
        rule = str(getattr(reader, "episodes", "a recorded trajectory"))
        if key is not None and "episode_key" in getattr(reader, "takes", ()):
            rule = f"the rows with the same `{key}`"
        rules.setdefault(rule, []).append(name)
    parts = [f"{', '.join(names)}: {rule}" for rule, names in rules.items()]
    return f"An episode is, by format: {'; '.join(parts)}."


def _reading(lazy: bool) -> list[str]:
    if not lazy:
        return []
    return [
        (
            "The screenshot of each step is stored once, as it was recorded; the corrupted ones"
            f" are drawn on access ({extras.remedy_anywhere('hf')}):"
        ),
        "",
        "```python",
        "from datasets import load_dataset",
        "from pipelines import render",
        "",
        'rows = load_dataset(FOLDER, split="train").with_transform(render)',
        "```",
        "",
    ]


def _how(manifest: Mapping[str, Any], has_faults: bool) -> list[str]:
    parameters = manifest["parameters"]
    boxes = (
        "those of the recording or, where it has none, found in the picture (OpenCV)"
        if parameters["elements"] == "picture"
        else "those of the recording, if any"
    )
    lines = [
        "## How it was made",
        "",
        (
            f"Every corruption was planned with seed {parameters['seed']} and applied to the"
            " screenshot; clean rows hold the screenshot as it was recorded. Draws depend on seed,"
            " corruption, trajectory (or the task that it shares with others) and step alone; plans"
            f" also on what the step shows. Boxes of interactive elements are {boxes}."
            f" {_POLICIES[parameters['label_policy']]}"
        ),
        "",
        *_fidelity(parameters.get("assets"), has_faults),
        "",
    ]
    if not parameters["corruptions"]:
        return [
            *lines,
            "It holds the clean rows alone: `hijack build --corruptions clean` makes it again.",
            "",
        ]
    if manifest["config"] is None:
        return [
            *lines,
            "It was built with `pipelines.build` from Python; a configuration file cannot hold it.",
            "",
        ]
    # Commands are for this folder, which is in the way of a build into it and holds the
    # configuration.
    files = parameters.get(LOADED, ())
    hijack = ["hijack", *(word for entry in files for word in ("--load", entry["file"]))]
    again = ["--out", REBUILD_FOLDER, "--config", CONFIG]
    options = [*_limit(parameters), *_stated_options(parameters)]
    command = [*hijack, "build", *manifest["source"]["paths"], *options, *again]
    check = shlex.join([*hijack, "verify", "."])
    return [
        *lines,
        (
            "To build it again, in this folder (source fingerprint "
            f"`{manifest['source']['fingerprint'][:16]}`, libraries as below):"
        ),
        "",
        "```",
        shlex.join(command),
        "```",
        "",
        *_cut(parameters["rows_per_shard"]),
        *(f"`{entry['file']}` has the SHA-256 `{entry['sha256']}`.\n" for entry in files),
        f"`{CONFIG}`:",
        "",
        "```yaml",
        *manifest["config"].splitlines(),
        "```",
        "",
        f"Libraries: {json.dumps(parameters['libraries'])}. `{check}` checks every row.",
        "",
    ]


def _limit(parameters: Mapping[str, Any]) -> list[str]:
    return ["--limit", str(parameters["limit"])] if "limit" in parameters else []


def _stated_options(parameters: Mapping[str, Any]) -> list[str]:
    """Return the options that describe the recordings of a build."""
    recordings = parameters.get(RECORDINGS, {})
    reader = ["--format", parameters["format"]] if "format" in parameters else []
    apps = ["--apps", ",".join(recordings["apps"])] if recordings.get("apps") else []
    platform = ["--platform", recordings["platform"]] if recordings.get("platform") else []
    spaces = [
        word
        for name in ("coordinates", "boxes", "episode_key")
        if name in parameters
        for word in (f"--{name.replace('_', '-')}", parameters[name])
    ]
    return [
        *reader,
        *apps,
        *platform,
        *spaces,
        *(["--allow-platform-mismatch"] if parameters.get(ALLOW_PLATFORM_MISMATCH) else []),
    ]


def _fidelity(assets: Mapping[str, str] | None, has_faults: bool) -> list[str]:
    if assets is None and not has_faults:
        return [f"`fidelity` is `exact`: {FIDELITY_MEANINGS['exact']}"]
    lines = [
        "`fidelity` says how true a row is:",
        "",
        *(f"* `{name}`: {text}" for name, text in FIDELITY_MEANINGS.items()),
        "",
        (
            "`event` says what happened to the machine, `reminder` what an onlooker should say,"
            " `inserted` that the event added the step."
        ),
    ]
    if assets is not None:
        lines[-1] += f" The pictures of events are those of asset pack `{assets['sha256'][:16]}`."
    if has_faults:
        lines[-1] += (
            " After a fault of the input the picture is one of the recording; a clock, a cursor and"
            " what shows under the pointer may differ from a moment later."
        )
    return lines


def _cut(rows_per_shard: int) -> list[str]:
    if rows_per_shard == ROWS_PER_SHARD:
        return []
    return [
        (
            f"The files were cut at {rows_per_shard} rows: `rows_per_shard={rows_per_shard}` in"
            " `pipelines.build`."
        ),
        "",
    ]


def _columns(lazy: bool) -> list[str]:
    rows = [
        f"| `{name}` | {_kind(kind)} | {text} |"
        for name, (kind, text) in stored_columns(lazy).items()
    ]
    return ["## Columns", "", "| column | type | what |", "|---|---|---|", *rows, ""]


def _kind(kind: Any) -> str:
    if isinstance(kind, dict):
        return "{" + ", ".join(f"{key}: {_kind(part)}" for key, part in kind.items()) + "}"
    return f"list of {kind[0]}" if isinstance(kind, list) else kind
