"""`hijack score` for onlookers: reminders of datasets and exports, and summaries."""

import hashlib
import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("pyarrow", reason="needs the extra [hf]")

from hijack_data.errors import ParameterError
from online_env.bench.config import Bench, override
from online_env.results import records
from online_env.results.parts import part_rows
from online_env.scoring.cases import choose_question
from online_env.scoring.run import ScoreRun, ScoreSettings
from pipelines import build, open_dataset
from pipelines.exports import export

from support.scoring import write_agents

RECORDINGS = Path(__file__).resolve().parents[2] / "examples" / "recordings"


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A dataset with three locked screens, and its export."""
    folder = tmp_path_factory.mktemp("onlookers")
    build(RECORDINGS, folder / "dataset", corruptions="verification,subtitle", output="lazy")
    export(folder / "dataset", folder / "export", to="onlooker")
    return folder / "dataset", folder / "export"


@pytest.fixture(scope="module")
def agents(tmp_path_factory, folders):
    path = write_agents(tmp_path_factory.mktemp("agents"))
    needed = [
        hashlib.sha256(np.asarray(row["screenshot"]).tobytes()).hexdigest()
        for row in open_dataset(folders[0])
        if row["reminder"] is not None
    ]
    (path.parent / "needed.json").write_text(json.dumps(needed))
    return path


def play_rows(folder, agent, out, ask=None):
    settings = ScoreSettings(
        dataset=folder,
        agents=override(Bench(), agent=agent).agents,
        question=choose_question(folder, ask),
    )
    run = ScoreRun(settings)
    with run.begin(out, resume=False):
        run.play(out, run.remaining_cases(out), lambda *_: None, lambda _: None)
    return records.read(out)


def over_all(run):
    (row,) = (row for row in part_rows(run.records) if row["corruption"] == "all")
    return row


@pytest.mark.parametrize(
    ("agent", "precision", "recall", "false_alarms"),
    [("Informed", 1, 1, 0), ("Always", 0.5, 1, 1), ("Never", None, 0, 0)],
)
def test_reminders_of_an_export(agent, precision, recall, false_alarms, folders, agents, tmp_path):
    run = play_rows(folders[1], f"{agents}:{agent}", tmp_path / "run")
    row = over_all(run)
    assert row["n"] == 6
    assert row["precision"] == precision
    assert (row["recall"], row["false_alarms"]) == (recall, false_alarms)
    assert run.missing == 0


def test_reminders_of_a_dataset_ask_about_every_row(folders, agents, tmp_path):
    run = play_rows(folders[0], f"{agents}:Informed", tmp_path / "run", ask="reminders")
    counts = Counter((r["corruption"], r["needed"], r["given"]) for r in run.records)
    assert counts[("verification", True, True)] == 3
    assert {key for key in counts if key[1]} == {("verification", True, True)}
    assert {record["score"] for record in run.records} == {1}
    assert over_all(run)["n"] == len(run.records) == len(open_dataset(folders[0]))


def test_an_onlooker_that_fails_has_missed_the_reminder(folders, agents, tmp_path):
    run = play_rows(folders[1], f"{agents}:WrongOnlooker", tmp_path / "run")
    assert {record["problem"] for record in run.records} == {
        "the agent: check must return a text or None, got 3"
    }
    row = over_all(run)
    assert (row["recall"], row["precision"], row["false_alarms"]) == (0, None, 0)


def test_summaries(folders, agents, tmp_path):
    run = play_rows(folders[1], f"{agents}:Always", tmp_path / "run", ask="summaries")
    assert run.records
    for record in run.records:
        assert 0 < record["score"] < 1
        assert record["said"].startswith("The agent pyautogui.")
        assert record["wanted"].startswith("The agent ")


def test_an_export_for_something_else(folders, tmp_path):
    export(folders[0], tmp_path / "chat", to="chat")
    with pytest.raises(ParameterError, match="is an export for 'chat'"):
        choose_question(tmp_path / "chat", None)
    with pytest.raises(ParameterError, match="holds no steps"):
        choose_question(folders[1], "steps")
