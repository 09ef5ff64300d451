"""Rows of a dataset for exports: each row, and the PNG of its screenshot."""

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from hijack_data.actions.input_faults import InputFault
from hijack_data.actions.recorded_actions import holds_several
from hijack_data.labels.action_formats import own_action
from hijack_data.plan import Plan

from ..dataset.image_codec import encode
from ..dataset.lazy_rows import picture_bytes
from ..dataset.opening import shard_pictures, shard_rows
from ..readers.runs import Runs
from .example import Row


def stored_rows(file: Path, lazy: bool) -> Iterator[tuple[Row, Callable[[], bytes]]]:
    """Yield rows, each with a function that returns the PNG of its screenshot."""
    if not lazy:
        for row in shard_rows(file):
            data = picture_bytes(row.pop("screenshot"))
            yield row, lambda data=data: data
        return
    for row, picture in shard_pictures(file):
        row.pop("screenshot")
        yield row, lambda picture=picture: encode(picture)


def holds_several_actions(row: Mapping[str, Any]) -> bool:
    """Return whether the reply of a row holds more actions than the row's own."""
    return holds_several(row["action_code"], own_action(row["action"]))


def row_faults(row: Row) -> tuple[InputFault, ...]:
    """Return the faults of the input in the plan of a row.

    Raises:
        PlanError: the plan is damaged.
    """
    text = str(row["plan"])
    # Most rows have none, and reading a plan takes long.
    return Plan.from_json(text).inputs if '"inputs"' in text else ()


def recorded_faults(row: Row) -> tuple[InputFault, ...]:
    """Return the faults that hit the action of a row when it was recorded: those of a run.

    Raises:
        ParameterError: the column `extra` is damaged.
    """
    if row["source"] != Runs.name or not row["extra"]:
        return ()
    entry = json.loads(row["extra"]).get("input", {})
    return tuple(InputFault.from_data(fault) for fault in entry.get("faults", ()))
