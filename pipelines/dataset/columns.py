"""The columns of a dataset: one table for the Arrow schema, the Hugging Face features and the card.

Kinds are Arrow's names of scalars, `"image"`, `"image file"` (that `datasets` does not decode by
itself), a list of one kind, or a dictionary of kinds.
"""

import json
from collections.abc import Mapping
from functools import cache
from typing import Any, TypeAlias

from hijack_data import extras

Kind = str | list[Any] | dict[str, Any]
# A row of a dataset: its values by column.
Row: TypeAlias = dict[str, Any]

IMAGES = ("image", "image file")
# A target of which less than this share is visible counts as hidden.
VISIBLE = 0.5
ACTION: dict[str, Kind] = {
    "type": "string",
    "x": "int32",
    "y": "int32",
    "x2": "int32",
    "y2": "int32",
    "text": "string",
    "keys": ["string"],
    "amount": "float64",
}
COLUMNS: dict[str, tuple[Kind, str]] = {
    "id": (
        "string",
        "`trajectory_id/step/corruption`, with `+effect` or `+fault` for an inserted step; unique",
    ),
    "trajectory_id": ("string", "the recording that the step is from"),
    "step": (
        "int32",
        "step in the recording, as it numbers them; an inserted one stands before that step, or"
        " after it where its action got lost",
    ),
    "source": ("string", "format of the recording"),
    "domain": ("string", "what the recording says about its domain, or empty"),
    "instruction": ("string", "what the agent was asked to do"),
    "screenshot": ("image", "the screen before the action, corrupted as `corruption` says"),
    "width": ("int32", "width of `screenshot` in pixels"),
    "height": ("int32", "height of `screenshot` in pixels"),
    "action": (
        ACTION,
        "the recorded action, or the one that the event calls for, in pixels of `screenshot`",
    ),
    "action_code": ("string", "the same as code, in pixels of `screenshot`, or empty"),
    "target_box": (
        ["int32"],
        "box (x1, y1, x2, y2) that the action aims at, in pixels of `screenshot`, or null",
    ),
    "corruption": ("string", "`clean`, or the label of the corruption"),
    "severity": (
        "int32",
        "1 (mild) to 5 (harsh) where the parameters are those of a level, or null",
    ),
    "seed": ("uint64", "seed of the build"),
    "params": ("string", "parameters of the corruption, JSON"),
    "plan": ("string", "what was done to the clean screenshot, JSON: `hijack_data.Plan.from_json`"),
    "plan_digest": ("string", "SHA-256 that names the plan"),
    "fidelity": (
        "string",
        "how true the row is to a live desktop: `exact`, `recorded`, `composited` or `foreign`",
    ),
    "event": ("string", "what happened to the machine, one sentence, or null"),
    "reminder": ("string", "what an onlooker should say, or null"),
    "inserted": ("bool", "whether the event added this step to the recording"),
    "target_visible": (
        "float64",
        "share of the target that still shows, 0..1, or null without a target",
    ),
    "changed_pixels": (
        "int64",
        "pixels that differ from the clean screenshot; all of them when the size changed",
    ),
    "extra": (
        "string",
        "what else the recording says about the step, JSON as it was recorded, or null",
    ),
    "image_sha256": ("string", "SHA-256 of the decoded RGB bytes of `screenshot`"),
}
# The column of a lazy dataset that replaces `screenshot`.
BASE = "base_screenshot"
BASE_COLUMN: tuple[Kind, str] = (
    "image file",
    "the picture that `plan` is applied to, stored once a step",
)
# Pictures are compressed already; for values shared by the rows of a corruption, zstd works better
# than a dictionary.
PICTURES = ("screenshot.bytes", f"{BASE}.bytes")
REPEATED = ("plan", "params")


def pyarrow() -> Any:
    """Return the module `pyarrow`, with `pyarrow.parquet` loaded.

    Raises:
        MissingDependencyError: pyarrow is not installed.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet
    except ImportError:
        error = extras.missing("datasets need pyarrow", "hf")
        raise error from None
    return pa


def stored_columns(lazy: bool = False) -> dict[str, tuple[Kind, str]]:
    """Return the columns as stored in the files."""
    if not lazy:
        return COLUMNS
    return {
        BASE if name == "screenshot" else name: BASE_COLUMN if name == "screenshot" else column
        for name, column in COLUMNS.items()
    }


@cache
def schema(lazy: bool = False) -> Any:
    """Return the Arrow schema, whose metadata lets `datasets.load_dataset` decode the pictures."""
    return arrow_schema({name: kind for name, (kind, _) in stored_columns(lazy).items()})


def arrow_schema(kinds: Mapping[str, Kind]) -> Any:
    """Return the Arrow schema of columns, with their features for `datasets`."""
    pa = pyarrow()
    features = {name: _feature(kind) for name, kind in kinds.items()}
    metadata = {"huggingface": json.dumps({"info": {"features": features}})}
    return pa.schema([(name, _arrow(kind)) for name, kind in kinds.items()], metadata=metadata)


def parquet_paths(lazy: bool = False) -> list[str]:
    """Return the Parquet paths of all columns."""
    names: list[str] = []
    for name, (kind, _) in stored_columns(lazy).items():
        parts = {"path": "string", "bytes": "binary"} if kind in IMAGES else kind
        inner = parts.items() if isinstance(parts, dict) else [("", parts)]
        for key, part in inner:
            path = f"{name}.{key}" if key else name
            names.append(f"{path}.list.element" if isinstance(part, list) else path)
    return names


def _feature(kind: Kind) -> dict[str, Any]:
    if isinstance(kind, dict):
        return {key: _feature(part) for key, part in kind.items()}
    if isinstance(kind, list):
        # the form that every version of datasets since 2 reads
        return {"feature": _feature(kind[0]), "_type": "Sequence"}
    if kind in IMAGES:
        return {"_type": "Image"} if kind == "image" else {"_type": "Image", "decode": False}
    return {"dtype": kind, "_type": "Value"}


def _arrow(kind: Kind) -> Any:
    pa = pyarrow()
    if isinstance(kind, dict):
        return pa.struct([(key, _arrow(part)) for key, part in kind.items()])
    if isinstance(kind, list):
        return pa.list_(_arrow(kind[0]))
    if kind in IMAGES:
        return pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    return pa.type_for_alias(kind)
