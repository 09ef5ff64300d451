"""The training rows for verl, one per task. Needs pyarrow, not verl."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hijack_data.errors import ParameterError
from hijack_data.file_io import make_folder, replace_atomic

from ...dataset.columns import Kind, arrow_schema, pyarrow
from ..split import check_split

LOOP = "agenthijack"  # the name in configs/train/verl_agent.yaml
_KINDS: dict[str, Kind] = {
    "data_source": "string",
    "agent_name": "string",
    "prompt": [{"role": "string", "content": "string"}],
    "ability": "string",
    "reward_model": {"style": "string", "ground_truth": "string"},
    "extra_info": {"index": "int64", "task": "string", "corruption": "string"},
}


def write_rows(
    path: Path,
    tasks: Iterable[str],
    answer_form: str,
    *,
    evaluation: Iterable[str] = (),
    osworld_split: str = "osworld",
) -> int:
    """Write a Parquet file with a row for each training task; returns their number.

    Args:
        path: the file (verl: `data.train_files`).
        tasks: names of training tasks.
        answer_form: the system message, such as the form of an action.
        evaluation: names of the tasks that are reported.
        osworld_split: as in `check_split`.

    Raises:
        LeakError: a task is held out or reported.
        ParameterError: there are no tasks.
    """
    names = list(dict.fromkeys(tasks))
    check_split(names, evaluation, source=str(path), osworld_split=osworld_split)
    return _write(path, names, answer_form, "")


def write_evaluation_rows(
    path: Path, tasks: Iterable[str], answer_form: str, *, corruption: str = "clean"
) -> int:
    """Write a Parquet file for `data.val_files`; every rollout meets the same corruption.

    Args:
        path: the file.
        tasks: names of the tasks.
        answer_form: the system message, as in training.
        corruption: `clean`, or the name of one with its default parameters.

    Raises:
        ParameterError: there are no tasks.
    """
    return _write(path, list(dict.fromkeys(tasks)), answer_form, corruption)


def _write(path: Path, names: list[str], answer_form: str, corruption: str) -> int:
    if not names:
        raise ParameterError(f"{path}: there are no tasks")
    rows: list[dict[str, Any]] = []
    for index, name in enumerate(names):
        about = {"index": index, "task": name, "corruption": corruption}
        rows.append(
            {
                "data_source": "agenthijack",
                "agent_name": LOOP,
                "prompt": [{"role": "system", "content": answer_form}],
                "ability": "computer_use",
                "reward_model": {"style": "rule", "ground_truth": ""},
                "extra_info": about,
            }
        )
    pa = pyarrow()
    table = pa.Table.from_pylist(rows, schema=arrow_schema(_KINDS))
    make_folder(path.parent, path)
    replace_atomic(path, lambda temporary_path: pa.parquet.write_table(table, temporary_path))
    return len(rows)
