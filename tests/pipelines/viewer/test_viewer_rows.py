"""`hijack view` shows the rows of a dataset: all columns, pictures, pictures before, events."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

from pipelines import build, open_dataset
from pipelines.errors import DatasetError
from pipelines.viewer import json_answers
from pipelines.viewer.opening import open_source
from pipelines.viewer.picture_cache import Pictures

from support.viewing import edit, read


def test_a_row_is_shown_whole(dataset: Path) -> None:
    source = open_source(dataset)
    for number, row in enumerate(open_dataset(dataset)):
        detail = json_answers.row(source, {"row": str(number)})["detail"]
        entries = dict(detail["fields"]["Columns"])
        assert {*entries} | {"plan", "screenshot"} == {*row} | {
            name for name in entries if name.endswith("screenshot")
        }
        assert entries["plan_digest"] == row["plan_digest"]
        assert detail["size"] == row["screenshot"].size
        assert json.loads(detail["plan"]) == json.loads(row["plan"])
        assert detail["points"] == [(row["action"]["x"], row["action"]["y"])]
        assert list(detail["box"]) == row["target_box"]
        assert bool(detail["no_before"]) == (row["corruption"] == "clean")


def test_pictures_are_those_of_the_rows(dataset: Path) -> None:
    source = open_source(dataset)
    rows = list(open_dataset(dataset))
    clean = {
        (row["trajectory_id"], row["step"]): row for row in rows if row["corruption"] == "clean"
    }
    pictures = Pictures(source)
    for number, row in enumerate(rows):
        assert np.array_equal(read(pictures.get("picture", number)), np.array(row["screenshot"]))
        before = clean[row["trajectory_id"], row["step"]]["screenshot"]
        if row["corruption"] != "clean":
            assert np.array_equal(read(pictures.get("before", number)), np.array(before))
        thumb = Image.open(io.BytesIO(pictures.get("thumb", number)))
        assert (thumb.format, thumb.size) == ("JPEG", row["screenshot"].size)


def test_kept_pictures_are_bounded(dataset: Path) -> None:
    pictures = Pictures(open_source(dataset), budget=60_000)
    first = pictures.get("picture", 0)
    assert pictures.get("picture", 0) is first
    for number in range(30):
        pictures.get("picture", number)
        sizes = [len(data) for data, _ in pictures.cache.items.values()]
        assert pictures.cache.used == sum(sizes) <= 60_000
    assert pictures.get("picture", 0) is not first


def test_large_pictures_have_small_thumbnails(tmp_path: Path, recording: Any) -> None:
    source = recording(trajectories=1, steps=1)
    Image.new("RGB", (1600, 900), "navy").save(source / "images" / "t0-0.png")
    build(source, tmp_path / "out", corruptions={}, seed=1)
    thumb = Image.open(io.BytesIO(Pictures(open_source(tmp_path / "out")).get("thumb", 0)))
    assert thumb.size == (480, 270)


def test_without_clean_rows_only_a_lazy_dataset_has_a_picture_before(
    recording: Any, small: Any, tmp_path: Path
) -> None:
    marks = {"marks": small["marks"]}
    for output in ("materialised", "lazy"):
        build(
            recording(output),
            tmp_path / f"{output}-out",
            corruptions=marks,
            output=output,
            clean=False,
        )
        source = open_source(tmp_path / f"{output}-out")
        missing = json_answers.row(source, {"row": "0"})["detail"]["no_before"]
        if output == "lazy":
            assert missing == ""
            assert source.picture(0, True).shape == (200, 320, 3)
        else:
            assert "--no-clean" in missing
            with pytest.raises(DatasetError, match="--no-clean"):
                source.picture(0, True)


def test_columns_of_events_are_shown_when_they_are_there(dataset: Path) -> None:
    first, second = sorted((dataset / "data").iterdir())
    edit(
        first,
        inserted=lambda old: [k == 3 for k in range(len(old))],
        event=lambda old: ["the window was minimised" if k == 3 else None for k in range(len(old))],
        reminder=lambda old: ["restore it" if k == 3 else None for k in range(len(old))],
    )
    table = pq.read_table(second)
    pq.write_table(
        table.drop_columns(
            [n for n in ("inserted", "event", "reminder") if n in table.column_names]
        ),
        second,
    )
    source = open_source(dataset)
    assert source.problems == []
    assert json_answers.rows(source, {"inserted": "yes"})["rows"][0]["chips"]["inserted"] == "yes"
    assert json_answers.rows(source, {})["filters"]["inserted"]["values"] == [
        ["no", 14],
        ["yes", 1],
    ]
    row = json_answers.row(source, {"row": "3"})
    notes = dict(row["detail"]["notes"])
    assert (notes["Event"], notes["Reminder"]) == ("the window was minimised", "restore it")
    assert "Inserted" in notes
    assert "+marks" in [name for _, name in row["same_step"]]
