"""`hijack view` shows a run of `hijack score`: each answer on the picture of its row."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.errors import HijackError
from online_env.scoring.cases import RowPlans
from online_env.scoring.run import ScoreRun, ScoreSettings
from pipelines import build, open_dataset
from pipelines.viewer.opening import open_source
from pipelines.viewer.runs import RunSource
from pipelines.viewer.runs.export import export_page

from support.edited_runs import read_lines, write_lines
from support.viewing import read


@pytest.fixture(scope="module")
def scored(tmp_path_factory: pytest.TempPathFactory, pictures: Any) -> Path:
    """A dataset `rows` of two steps, clean and with marks, and the run that scored it."""
    home = tmp_path_factory.mktemp("scored")
    planners = {"marks": hj.Marks(number=4, mark_size=10)}
    build(pictures(home / "source", 1, 2), home / "rows", corruptions=planners, output="lazy")
    run = ScoreRun(ScoreSettings(dataset=home / "rows", agents=("random",)))
    with run.begin(home / "run", False):
        remaining = run.remaining_cases(home / "run")
        run.play(home / "run", remaining, lambda *_: None, lambda *_: None)
    return home


def open_run(folder: Path) -> RunSource:
    source = open_source(folder)
    assert isinstance(source, RunSource)
    return source


def test_a_row_that_was_corrupted_while_it_was_read_is_no_row_of_another_dataset(
    scored: Path, tmp_path: Path
) -> None:
    plans = RowPlans(planners={"clean": None, "worst": hj.Marks(number=2, mark_size=9)})
    run = ScoreRun(ScoreSettings(dataset=scored / "rows", agents=("fail",), plans=plans))
    with run.begin(tmp_path / "run", False):
        remaining = run.remaining_cases(tmp_path / "run")
        run.play(tmp_path / "run", remaining, lambda *_: None, lambda *_: None)
    source = open_run(tmp_path / "run")
    lost = {
        entry.corruption: source.episode(n)["steps"][0]["lost"]
        for n, entry in enumerate(source.entries)
    }
    assert lost["clean"] == ""
    assert "was corrupted while it was read" in lost["worst"]


def test_every_answer_is_an_episode_of_one_step(scored: Path) -> None:
    source = open_run(scored / "run")
    rows = open_dataset(scored / "rows")
    assert source.problems == []
    assert len(source.entries) == len(rows)
    assert source.about()["scored"]
    records = read_lines(scored / "run" / "records.jsonl")
    for number, record in enumerate(records):
        row = next(row for row in rows if row["id"] == record["row"])
        data = source.episode(number)
        (step,) = data["steps"]
        assert (data["problems"], step["lost"]) == ([], "")
        assert step["code"] == record["last_action"]
        assert step["target"] == (list(row["target_box"]) if row["target_box"] else None)
        assert step["corrupted"] == (record["corruption"] == "marks")
        assert np.array_equal(read(source.picture(number, 0, False)), np.array(row["screenshot"]))
        if step["corrupted"]:
            assert not np.array_equal(
                source.pixels(number, 0, True), source.pixels(number, 0, False)
            )
    page, small = (export_page(source, [0, 1], small=small) for small in (False, True))
    assert records[0]["id"] in page
    assert records[0]["id"] in small
    assert len(small) <= len(page)


def test_a_dataset_that_is_gone_or_another_is_said(scored: Path, tmp_path: Path) -> None:
    shutil.copytree(scored / "run", tmp_path / "run")
    head = json.loads((tmp_path / "run" / "run.json").read_text())
    head["config"]["source"] = "/nowhere/rows"
    (tmp_path / "run" / "run.json").write_text(json.dumps(head))
    source = open_run(tmp_path / "run")
    assert any("'/nowhere/rows' that was scored is not there" in text for text in source.problems)
    data = source.episode(0)
    assert "is not there" in data["problems"][0]
    assert (len(data["steps"]), dict(data["fields"])["status"]) == (1, "ok")
    with pytest.raises(HijackError, match="is not there"):
        source.picture(0, 0, False)
    shutil.copytree(scored / "rows", tmp_path / "rows")  # beside the run it is found again
    assert open_run(tmp_path / "run").episode(0)["steps"][0]["lost"] == ""
    records = read_lines(tmp_path / "run" / "records.jsonl")
    records[0]["image_sha256"] = "0" * 64
    records[1]["row"] = "nobody"
    write_lines(tmp_path / "run" / "records.jsonl", records)
    second = open_run(tmp_path / "run")
    with pytest.raises(HijackError, match="not the picture that the agent was shown"):
        second.picture(0, 0, False)
    with pytest.raises(HijackError, match="has no row 'nobody'"):
        second.picture(1, 0, False)
