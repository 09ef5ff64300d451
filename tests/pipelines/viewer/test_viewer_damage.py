"""`hijack view` names what is broken in a dataset, and shows the rest."""

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from hijack_data.errors import HijackError
from pipelines import build, open_dataset
from pipelines.errors import DatasetError
from pipelines.viewer import json_answers
from pipelines.viewer.opening import open_source
from pipelines.viewer.picture_cache import Pictures

from support.viewing import edit


def test_a_damaged_file_is_named_and_the_others_are_shown(dataset: Path) -> None:
    first = min((dataset / "data").iterdir())
    first.write_bytes(b"rubbish" * 100)
    source = open_source(dataset)
    assert [p.partition(":")[0] for p in source.problems] == ["data/train-00000.parquet"]
    assert "15 rows are left out" in source.problems[0]
    assert [row["row"] for row in json_answers.rows(source, {})["rows"]] == list(range(15, 30))
    assert json_answers.row(source, {"row": "15"})["id"] == open_dataset(dataset).reader[15]["id"]
    with pytest.raises(HijackError, match="there is no row '3'"):
        json_answers.row(source, {"row": "3"})


@pytest.mark.parametrize("harm", ["missing", "column", "short", "outside"])
def test_other_harm_to_a_file_is_named(dataset: Path, tmp_path: Path, harm: str) -> None:
    file = min((dataset / "data").iterdir())
    if harm == "missing":
        file.unlink()
    elif harm == "outside":
        file.rename(tmp_path / "elsewhere.parquet")
        file.symlink_to(tmp_path / "elsewhere.parquet")
    else:
        table = pq.read_table(file)
        pq.write_table(
            table.drop_columns(["trajectory_id"]) if harm == "column" else table.slice(0, 9), file
        )
    source = open_source(dataset)
    words = {
        "missing": "is not in",
        "column": "no column trajectory_id",
        "short": "holds 9 rows",
        "outside": "leaves",
    }
    assert len(source.problems) == 1
    assert words[harm] in source.problems[0]
    assert len(source.index) == (24 if harm == "short" else 15)


def test_a_row_that_cannot_be_drawn_says_why_and_the_others_are_there(
    recording: Any, small: Any, tmp_path: Path
) -> None:
    build(recording(), tmp_path / "out", corruptions={"marks": small["marks"]}, output="lazy")
    file = next((tmp_path / "out" / "data").iterdir())
    edit(
        file,
        plan_digest=lambda old: [("0" * 64 if k == 1 else digest) for k, digest in enumerate(old)],
    )
    source = open_source(tmp_path / "out")
    with pytest.raises(DatasetError, match="gives another plan"):
        Pictures(source).get("thumb", 1)
    detail = json_answers.row(source, {"row": "1"})["detail"]
    assert "gives another plan" in detail["problem"]
    assert dict(detail["fields"]["Columns"])["corruption"] == "marks"
    assert Pictures(source).get("thumb", 3)


def test_a_damaged_picture_is_a_message(dataset: Path) -> None:
    file = min((dataset / "data").iterdir())
    column = next(name for name in pq.read_schema(file).names if name.endswith("screenshot"))
    edit(file, **{column: lambda old: [{"bytes": b"\x89PNG no", "path": None}, *old[1:]]})
    source = open_source(dataset)
    with pytest.raises(DatasetError, match="row t0/0000/clean: its picture is damaged"):
        source.picture(0, False)
    assert json_answers.row(source, {"row": "0"})["detail"]["fields"]["Columns"]


def test_rows_of_other_columns_are_messages(dataset: Path) -> None:
    first, second = sorted((dataset / "data").iterdir())
    picture = next(name for name in pq.read_schema(first).names if name.endswith("screenshot"))
    edit(first, width=lambda old: [None, *old[1:]], action=lambda old: ["click"] * len(old))
    table = pq.read_table(second)
    pq.write_table(table.drop_columns([picture]), second)
    source = open_source(dataset)
    for row in (0, 1):
        assert (
            "another kind of value"
            in json_answers.row(source, {"row": str(row)})["detail"]["problem"]
        )
    with pytest.raises(DatasetError, match="row 15: a column is missing"):
        source.picture(15, False)
    edit(first, step=lambda old: [None, *old[1:]])
    assert (
        open_source(dataset)
        .problems[0]
        .startswith("data/train-00000.parquet: its 15 rows are left out")
    )


def test_what_is_no_dataset_is_refused(tmp_path: Path, dataset: Path) -> None:
    for path in (tmp_path / "nowhere", "a\0b"):
        with pytest.raises(DatasetError, match="no such folder"):
            open_source(path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetError, match="not a dataset of ours"):
        open_source(tmp_path / "empty")
    manifest = json.loads((dataset / "manifest.json").read_text())
    for shards in ([{"rows": 3}], [{"file": "x", "rows": "many"}], ["x"]):
        (dataset / "manifest.json").write_text(json.dumps({**manifest, "shards": shards}))
        with pytest.raises(DatasetError, match="damaged"):
            open_source(dataset)
