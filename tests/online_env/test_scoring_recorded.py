"""Recorded actions, scored as the answers of an agent: on the screens they are from all are right.

That holds for every type of action, on clean rows and under every corruption; and for the public
grounding sets.
"""

import hashlib
import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("pyarrow", reason="needs the extra [hf]")

from hijack_data.actions import write_pyautogui
from hijack_data.errors import HijackError
from hijack_data.types import Action
from online_env.bench.config import Bench, override
from online_env.results import records
from online_env.scoring.run import ScoreRun, ScoreSettings
from pipelines import build, open_dataset

from support.formats import png, write_json
from support.scoring import write_agents

RECORDINGS = Path(__file__).resolve().parents[2] / "examples" / "recordings"


def play_rows(folder, agent, out):
    settings = ScoreSettings(dataset=folder, agents=override(Bench(), agent=agent).agents)
    run = ScoreRun(settings)
    with run.begin(out, resume=False):
        run.play(out, run.remaining_cases(out), lambda *_: None, lambda _: None)
    return run, records.read(out).records


def code_of(row):
    """Return the action of a row as an agent writes it; a word for one that is no code."""
    fields = {**row["action"], "keys": tuple(row["action"]["keys"] or ()) or None}
    return write_pyautogui(Action(**fields))


def echo(folder, tmp_path):
    """Write the agent that knows the rows of a dataset."""
    agents = write_agents(tmp_path)
    entries = {}
    for row in open_dataset(folder):
        try:
            code = code_of(row)
        except HijackError:
            continue
        picture = np.asarray(row["screenshot"]).tobytes()
        entries[hashlib.sha256(picture).hexdigest() + row["instruction"]] = code
    (tmp_path / "recorded.json").write_text(json.dumps(entries))
    return f"{agents}:Echo"


def wrong(found):
    return {(r["row"], r["reason"], r["problem"]) for r in found if r["score"] != 1}


def test_the_example_recordings_under_all_corruptions(tmp_path):
    folder = tmp_path / "dataset"
    build(RECORDINGS, folder, corruptions="all", seed=7, output="lazy")
    run, value = play_rows(folder, echo(folder, tmp_path), tmp_path / "run")
    assert wrong(value) == set()
    assert len(run.cases.labels) >= 7
    assert {record["wanted"] for record in value} >= {"click", "type", "hotkey", "wait"}


@pytest.mark.parametrize("name", ["agentnetbench", "agentnet_raw", "screenagent"])
def test_real_recordings(name, shared_data, tmp_path):
    folder = tmp_path / "dataset"
    source = shared_data / "trajectories" / name
    build(source, folder, corruptions="resolution:scale=0.5", output="lazy", limit=2)
    _, value = play_rows(folder, echo(folder, tmp_path), tmp_path / "run")
    assert wrong(value) == set()
    assert Counter(record["corruption"] for record in value)["resolution"] > 1


GROUNDING = [
    {"box_type": "bbox", "box_coordinates": [40, 30, 160, 30], "instruction": "click 100,40"},
    {
        "box_type": "polygon",
        "box_coordinates": [100, 20, 120, 20, 120, 160, 300, 160, 300, 180, 100, 180],
        "instruction": "click 88,100",  # 110, 100 of 400x200: in the upright of the L
    },
    {
        "box_type": "polygon",
        "box_coordinates": [100, 20, 120, 20, 120, 160, 300, 160, 300, 180, 100, 180],
        "instruction": "click 160,100",  # 200, 100: in the box around it, not in the L
    },
    {"box_type": "refusal", "box_coordinates": [-1, -1, -1, -1], "instruction": "click 1,1"},
]


def test_a_grounding_set_with_polygons_and_refusals(tmp_path):
    source = tmp_path / "source"
    (source / "images").mkdir(parents=True)
    (source / "images" / "0.png").write_bytes(png(0))
    about = {"image_path": "0.png", "image_size": [400, 200], "GUI_types": []}
    write_json(source / "OSWorld-G.json", [about | row for row in GROUNDING])
    folder = tmp_path / "dataset"
    corruptions = "resolution:scale=0.5"
    build(source, folder, corruptions=corruptions, format="osworld_g")
    agents = write_agents(tmp_path)
    _, value = play_rows(folder, f"{agents}:Knows,fail", tmp_path / "run")
    scores = {(record["agent"], record["row"]): record["score"] for record in value}
    for label in ("clean", "resolution"):
        rows = [f"OSWorld-G/00000{number}/0000/{label}" for number in range(4)]
        assert [scores[f"{agents}:Knows", row] for row in rows] == [1, 1, 0, 0], label
        assert [scores["fail", row] for row in rows] == [0, 0, 0, 1], label
