"""Lazy rows: the picture before its corruption, and the plan, which is drawn on access.

If the plan can be recomputed from the columns of the row (parameters, seed, trajectory, step,
size), the column `plan` holds a recipe: some 50 bytes of JSON that every row of the corruption
shares. Otherwise it holds the plan itself. If the key of the random draws is not the trajectory id,
the recipe contains that key. Either way, the column `plan_digest` identifies the plan: if another
version of the library would make a different plan, reading the row is an error, never a different
picture.
"""

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, cast

import numpy as np
from PIL import Image

from hijack_data import apply
from hijack_data.compose import Augmentation
from hijack_data.corruption import Corruption, find_corruption
from hijack_data.errors import HijackError, ImageError, UnknownNameError
from hijack_data.plan import CLEAN, Plan
from hijack_data.planner import Planner
from hijack_data.rng import Branch
from hijack_data.types import Scene, Size, UInt8Array

from ..errors import DatasetError
from .columns import BASE, Row
from .image_codec import decode

FORMAT = "agenthijack-recipe"
VERSION = 1


def stored_plan(
    plan: Plan, row: Mapping[str, Any], sample: str | None = None, planner: Planner | None = None
) -> str:
    """Return the value of the column `plan` of a lazy row.

    Args:
        plan: the plan of the row.
        row: its `params`, `seed`, `trajectory_id` and `step`, and the whole `plan`.
        sample: the key of the random draws, if that is not the trajectory.
        planner: the planner that made the plan.
    """
    trajectory = row["trajectory_id"]
    key = trajectory if sample is None else sample
    path = _path(planner, row, key)
    recipe = _recipe(plan.corruption, None if key == trajectory else key, path)
    try:
        derived = _plan_from_recipe(recipe, row, plan.size)
    # A plan of several corruptions, or of a plug-in's planner: no recipe can express it.
    except HijackError:
        return row["plan"]
    return recipe if derived == plan else row["plan"]


def row_plan(row: Mapping[str, Any], size: Size) -> Plan:
    """Return the plan of a row.

    Args:
        row: the row as stored.
        size: (height, width) of its picture before the corruption.

    Raises:
        DatasetError: the recipe cannot be used here, or gives a different plan than in the build.
        PlanError: the stored plan is damaged.
    """
    text = cast("str", row["plan"])
    if not _is_recipe(text):
        return Plan.from_json(text)
    try:
        plan = _plan_from_recipe(text, row, size)
    except (HijackError, ValueError, KeyError, TypeError) as error:
        reason = f"its plan cannot be made from its recipe {text!r} ({error})"
        if isinstance(error, UnknownNameError):
            reason += "; hijack --load FILE.py, if manifest.json names a file"
        raise DatasetError(f"row {row['id']}: {reason}") from None
    digest = plan.digest()
    if digest != row["plan_digest"]:
        built_digest = str(row["plan_digest"])[:12]
        raise DatasetError(
            f"row {row['id']}: its recipe gives another plan here ({digest[:12]}) than where"
            f" it was built ({built_digest}); install the version that"
            " manifest.json names, or build again"
        )
    return plan


def draw_row(row: Mapping[str, Any], base: UInt8Array | None = None) -> tuple[UInt8Array, Plan]:
    """Return the picture of a lazy row, uint8 RGB `[H, W, 3]`, and its plan.

    Args:
        row: as it is stored.
        base: the picture before the corruption, if already decoded; it is not modified.
    """
    image = decode_column(row, BASE) if base is None else base
    plan = row_plan(row, image.shape[:2])
    if not plan.ops:
        return image, plan
    in_place = base is None and plan.out_size == plan.size
    picture = cast("UInt8Array", apply(plan, image, inplace=in_place))
    return picture, plan


def render(batch: dict[str, Any]) -> dict[str, Any]:
    """Draw the screenshots of lazy rows, on access.

    Use it as `load_dataset(DIR, split="train").with_transform(pipelines.render)`.

    Args:
        batch: columns as lists, as `datasets` passes them, or one row. Rows with a `screenshot` are
            returned unchanged.

    Returns:
        The same rows with `screenshot` (PIL images, mode RGB) instead of `base_screenshot`, and
        with the whole `plan`.

    Raises:
        DatasetError: columns that it needs are missing, or a plan differs from that of the build.
    """
    if BASE not in batch:
        return batch
    missing = [name for name in RENDER_COLUMNS if name not in batch]
    if missing:
        raise DatasetError(
            f"render needs the column(s) {', '.join(missing)}; select columns after it, not before"
        )
    if isinstance(batch["id"], str):
        return _render_row(batch)
    columns = cast("Mapping[str, Sequence[Any]]", batch)
    rendered: list[Row] = []
    for values in zip(*columns.values(), strict=True):
        row = dict(zip(columns, values, strict=True))
        rendered.append(_render_row(row))
    if not rendered:
        return batch
    return {name: [row[name] for row in rendered] for name in rendered[0]}


RENDER_COLUMNS = ("id", "trajectory_id", "step", "seed", "params", "plan", "plan_digest")


def materialised_row(row: Mapping[str, Any], screenshot: Any, plan: Plan) -> Row:
    """Return a lazy row as a materialised one, with `screenshot`."""
    columns: Row = {}
    for name, value in row.items():
        columns["screenshot" if name == BASE else name] = value
    columns["screenshot"] = screenshot
    columns["plan"] = plan.to_json()
    return columns


def picture_bytes(stored: Mapping[str, Any]) -> bytes:
    """Return the bytes of a picture from its Parquet value, `{"bytes", "path"}`."""
    data = cast("bytes | None", stored["bytes"])
    return data or b""


def decode_column(row: Mapping[str, Any], column: str) -> UInt8Array:
    """Decode a stored picture of a row to uint8 RGB `[H, W, 3]`.

    Raises:
        DatasetError: the picture is damaged.
    """
    try:
        return decode(picture_bytes(row[column]), column)
    except ImageError as error:
        raise DatasetError(f"row {row['id']}: its picture is damaged ({error})") from None


def _render_row(row: Mapping[str, Any]) -> Row:
    base: object = row[BASE]
    pixels = None
    if isinstance(base, Image.Image):  # decoded by `datasets`
        pixels = np.asarray(base.convert("RGB"))
    picture, plan = draw_row(row, pixels)
    return materialised_row(row, Image.fromarray(picture), plan)


def _path(planner: Planner | None, row: Mapping[str, Any], sample: str) -> tuple[str, ...]:
    """Return the path through combinators to the corruption that planned for a row."""
    key: int | str = sample
    while isinstance(planner, Augmentation):
        choice = planner.choose(seed=int(row["seed"]), sample=key, step=int(row["step"]))
        if choice is None:
            break
        planner, key = choice
    return key.path if isinstance(key, Branch) else ()


def _recipe(corruption: str, sample: str | None = None, path: tuple[str, ...] = ()) -> str:
    data: dict[str, Any] = {"corruption": corruption}
    if sample is not None:
        data["sample"] = sample
    if path:
        data["path"] = list(path)
    data["format"] = FORMAT
    data["version"] = VERSION
    return json.dumps(data, separators=(",", ":"))


def _is_recipe(text: str) -> bool:
    # in the JSON of a whole plan, such quotes would be escaped
    return f'"format":"{FORMAT}"' in text[-60:]


def _plan_from_recipe(recipe: str, row: Mapping[str, Any], size: Size) -> Plan:
    corruption, sample, path = _read_recipe(recipe)
    if corruption == CLEAN:
        return Plan.clean(size)
    spec = _spec(corruption, cast("str", row["params"]))
    key: str = row["trajectory_id"] if sample is None else sample
    if path:
        key = Branch(key, path)
    seed = int(row["seed"])
    step = int(row["step"])
    return spec.plan(Scene(size), seed=seed, sample=key, step=step)


@lru_cache(maxsize=256)
def _read_recipe(recipe: str) -> tuple[str, str | None, tuple[str, ...]]:
    # returns the corruption, the key of the draws (if any), and the path through combinators
    data = json.loads(recipe)
    version = data["version"]
    if version != VERSION:
        raise DatasetError(
            f"recipe of version {version!r}; this library reads {VERSION}: upgrade agenthijack"
        )
    path: list[str] = data.get("path", [])
    return str(data["corruption"]), data.get("sample"), tuple(path)


@lru_cache(maxsize=256)
def _spec(corruption: str, params: str) -> Corruption:
    return find_corruption(corruption)(**json.loads(params))
