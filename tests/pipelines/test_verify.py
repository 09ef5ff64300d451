from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import hijack_data as hj
from pipelines import build, open_dataset, verify
from pipelines.errors import DatasetError

from support.tampering import renew


@pytest.fixture
def dataset(recording: Any, small: Any, tmp_path: Path) -> Path:
    build(recording(), tmp_path / "out", corruptions=small, rows_per_shard=15)
    return tmp_path / "out"


def edit(
    dataset: Path, change: Callable[[list[dict[str, Any]]], object], *, honest: bool = False
) -> None:
    """Change the rows of the first file; an `honest` edit makes the manifest fit, but for what it
    counts."""
    file = dataset / "data" / "train-00000.parquet"
    table = pq.read_table(file)
    rows = table.to_pylist()
    change(rows)
    pq.write_table(type(table).from_pylist(rows, schema=table.schema), file)
    if honest:
        renew(dataset)


def test_a_sound_dataset(dataset: Path) -> None:
    report = verify(dataset)
    assert (report.problems, report.rows, report.shards, report.regenerated) == ([], 30, 2, 24)
    assert (report.ok, report.exit_code) == (True, 0)
    assert report.lines() == [f"{dataset}: 30 rows in 2 files, 24 made again: all is well"]


@pytest.mark.parametrize("where", [0.0, 0.2, 0.5, 0.8, 0.999])
def test_a_flipped_byte(dataset: Path, where: float) -> None:
    file = dataset / "data" / "train-00001.parquet"
    data = bytearray(file.read_bytes())
    data[min(int(len(data) * where), len(data) - 1)] ^= 0xFF
    file.write_bytes(data)
    report = verify(dataset)
    assert report.exit_code == 1
    assert any("train-00001.parquet" in p and "SHA-256" in p for p in report.problems)
    assert not any("train-00000" in p for p in report.problems)


def test_a_file_that_is_missing_and_one_too_many(dataset: Path) -> None:
    (dataset / "data" / "train-00000.parquet").rename(dataset / "data" / "train-00007.parquet")
    problems = verify(dataset).problems
    assert "data/train-00000.parquet: missing" in problems
    assert "data/train-00007.parquet: not in the manifest" in problems


def test_a_row_that_is_missing(dataset: Path) -> None:
    edit(dataset, lambda rows: rows.pop(), honest=True)
    assert any("says 15 rows, 14 were read" in p for p in verify(dataset).problems)


def other_plan(rows: list[dict[str, Any]]) -> None:
    plan = hj.Plan.from_json(rows[3]["plan"])
    moved_plan = hj.Plan(
        plan.corruption, plan.size, plan.params, (hj.plugin.Paste(plan.ops[0].sprite, ((1, 1),)),)
    )  # type: ignore[union-attr]
    rows[3].update(plan=moved_plan.to_json(), plan_digest=moved_plan.digest())


def edited_plan(rows: list[dict[str, Any]]) -> None:
    rows[3]["plan"] = rows[3]["plan"].replace('"size":8', '"size":9')


def plan_of_another_size(rows: list[dict[str, Any]]) -> None:
    plan = hj.Plan(**{**vars(hj.Plan.from_json(rows[3]["plan"])), "size": (5, 5)})
    rows[3].update(plan=plan.to_json(), plan_digest=plan.digest())


def other_picture(rows: list[dict[str, Any]]) -> None:
    rows[3]["screenshot"] = rows[4]["screenshot"]


def other_picture_with_its_hash(rows: list[dict[str, Any]]) -> None:
    rows[3].update({key: rows[4][key] for key in ("screenshot", "image_sha256")})


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (edited_plan, "does not match its digest"),
        (other_plan, "another picture of the clean row"),
        (plan_of_another_size, "a picture of another size"),
        (other_picture, "image_sha256"),
        (other_picture_with_its_hash, "another picture of the clean row"),
        (lambda rows: rows[3].update(plan_digest="0" * 64), "plan_digest"),
        (lambda rows: rows[3].update(params="{}"), "params are not those"),
        (lambda rows: rows[3].update(width=1), "the row says otherwise"),
        (lambda rows: rows[3].update(fidelity="recorded"), "contradict"),
        (lambda rows: rows[3].update(event="it rained"), "contradict"),
        (lambda rows: rows[3].update(inserted=True), "contradict"),
        (lambda rows: rows[3].update(screenshot={"bytes": b"", "path": None}), "empty"),
        (lambda rows: rows[3].update(screenshot={"bytes": None, "path": None}), "empty"),
    ],
)
def test_a_row_that_was_changed_is_found_even_with_a_new_hash(
    dataset: Path, change: Callable[[list[dict[str, Any]]], object], reason: str
) -> None:
    edit(dataset, change, honest=True)
    (problem,) = verify(dataset).problems
    assert "row t0/0000/marks" in problem
    assert reason in problem


def test_only_the_first_problems_are_shown(dataset: Path) -> None:
    edit(dataset, lambda rows: [row.update(plan_digest="") for row in rows])
    (dataset / "data" / "train-00001.parquet").unlink()
    report = verify(dataset)
    assert len(report.problems) == 17
    report.problems.extend(["more"] * 10)
    assert report.lines()[-1] == "  and 7 more"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "not a dataset"),
        ("{", "is not JSON"),
        ("[]", "not the manifest"),
        ('{"format": "other"}', "not the manifest"),
        ('{"format": "agenthijack-dataset", "version": 99}', "newer"),
        ('{"format": "agenthijack-dataset", "version": 1}', "damaged"),
    ],
)
def test_folders_without_a_sound_manifest(content: str | None, reason: str, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / "manifest.json").write_text(content)
    for function in (verify, open_dataset):
        with pytest.raises(DatasetError, match=reason):
            function(tmp_path)


def test_reading_a_damaged_dataset_says_which_row(dataset: Path) -> None:
    edit(dataset, lambda rows: rows[1]["screenshot"].update(bytes=b"no picture"))
    with pytest.raises(DatasetError, match="row t0/0000/pop_ups"):
        list(open_dataset(dataset))
    (dataset / "data" / "train-00000.parquet").write_bytes(b"PAR1")
    with pytest.raises(DatasetError, match=r"train-00000\.parquet: cannot be read"):
        list(open_dataset(dataset))
