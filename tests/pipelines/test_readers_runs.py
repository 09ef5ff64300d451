"""Reading runs of the live benchmark: clean screens, the agent's actions on them, and what is left
out."""

import json
from collections import Counter
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("pyarrow", reason="needs the extra [hf]")

import hijack_data as hj
from hijack_data.types import Action
from online_env.environment import CorruptedEnv
from pipelines import build, open_dataset, verify
from pipelines.readers import Rejected, detect_format, get_reader

from support.live import AT_ONCE, SIZE, FakeDesktop, FakeStage, Marking

VISUAL = {
    "pop_ups": hj.PopUps(width=420, height=260),
    "resolution": hj.Resolution(scale=0.5),
    "marks": hj.Marks(number=3, mark_size=8),
    "subtitle": hj.Subtitle(subtitle_text="hello", font_size=12),
}
SCREEN = (720, 1280)


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch):
    monkeypatch.setattr("online_env.environment.episode.WAIT_S", 0.0)


def play_episode(
    folder: Path,
    corruption=None,
    actions=("pyautogui.click(10, 20)", "WAIT", "DONE"),
    size=SIZE,
    **options,
):
    """One episode under `folder`; returns its record."""
    env = CorruptedEnv(
        FakeStage(FakeDesktop(size)), corruption=corruption, settle=AT_ONCE, log=folder, max_steps=6
    )
    env.reset(seed=3, options=options)
    for action in actions:
        env.step(action)
    env.abandon("the test is over")
    return env.record


def read(folder: Path):
    items = list(get_reader("runs").read(folder))
    rejected = [item for item in items if isinstance(item, Rejected)]
    return [item for item in items if not isinstance(item, Rejected)], [
        str(item) for item in rejected
    ]


def test_steps_are_clean_screens_with_the_actions_on_the_screen(tmp_path):
    actions = (
        "pyautogui.click(10, 20)",
        "```\npyautogui.write('a')\n```",
        "REQUEST_REINIT",
        "DONE",
    )
    record = play_episode(tmp_path, VISUAL["resolution"], actions)
    assert detect_format(tmp_path) == "runs"
    (trajectory,), rejected = read(tmp_path)
    assert rejected == []
    assert (trajectory.id, trajectory.sample, trajectory.instruction) == (
        record["id"],
        "do-3",
        "Open the file",
    )
    assert (trajectory.apps, trajectory.source) == (("files",), "runs")
    assert [step.index for step in trajectory] == [0, 1, 2, 3]
    assert [step.action for step in trajectory] == [
        Action("click", 20, 40),
        Action("type", text="a"),
        Action("other"),
        Action("done"),
    ]
    assert [step.action_code for step in trajectory] == [
        "pyautogui.click(20, 40)",
        "pyautogui.write('a')",
        "REQUEST_REINIT",
        "DONE",
    ]
    assert [Path(step.image).name for step in trajectory] == [f"{k:04d}.png" for k in range(4)]


def test_elements_are_those_that_the_plan_was_given(tmp_path):
    play_episode(tmp_path, VISUAL["pop_ups"], size=SCREEN)
    (trajectory,), _ = read(tmp_path)
    assert {step.elements for step in trajectory} == {((10, 20, 110, 50), (300, 200, 380, 240))}


@pytest.mark.parametrize("where", ["", "episodes", "episodes/{id}", "episodes/{id}/steps.jsonl"])
def test_a_run_an_episode_and_its_file_can_be_read(tmp_path, where):
    record = play_episode(tmp_path)
    (trajectory,), _ = read(tmp_path / where.format(**record))
    assert len(tuple(trajectory)) == 3
    if where != "episodes":
        assert detect_format(tmp_path / where.format(**record)) == "runs"


def test_what_is_no_sample_is_left_out_with_the_reason(tmp_path):
    play_episode(tmp_path, "subtitle", ("nonsense", "DONE"), size=SCREEN)
    play_episode(tmp_path, Marking(0, sabotaged=True))
    play_episode(tmp_path, None, ("WAIT",))
    broken = tmp_path / "episodes" / "broken"
    broken.mkdir()
    (broken / "steps.jsonl").write_text("{}\n")
    value, rejected = read(tmp_path)
    assert [trajectory.id for trajectory in value] == ["do-3__subtitle__s3__agent"]
    text = "\n".join(rejected)
    for words in (
        "the action was refused",
        "the episode is invalid",
        "nothing is marked",
        "the episode is error: the test is over",
        "the episode was broken off",
    ):
        assert words in text
    assert len(rejected) == 4


def test_what_a_guard_did_is_no_action_of_the_agent(tmp_path):
    record = play_episode(tmp_path, None, ("WAIT", "pyautogui.click(5, 5)", "WAIT", "DONE"))
    interventions = [
        {"step": 0, "kind": "k", "actions": []},  # a reminder
        {"step": 1, "kind": "k", "actions": ["pyautogui.click(5, 5)", "WAIT"]},
    ]
    path = tmp_path / "episodes" / record["id"] / "episode.json"
    path.write_text(json.dumps({**record, "guard": {"interventions": interventions}}))
    (trajectory,), rejected = read(tmp_path)
    assert [step.index for step in trajectory] == [0, 3]
    assert ["that of a guard, not of the agent" in reason for reason in rejected] == [True] * 2


def test_screens_after_an_effect_are_not_clean(tmp_path):
    play_episode(tmp_path, Marking(1), ("WAIT", "WAIT", "DONE"))
    (trajectory,), (reason,) = read(tmp_path)
    assert [step.index for step in trajectory] == [0]
    assert "after test_mark show what it did" in reason
    play_episode(tmp_path / "other", Marking(-1), ("WAIT", "DONE"))
    assert read(tmp_path / "other")[0] == []


def test_a_damaged_log_is_reported_with_line_and_field(tmp_path):
    record = play_episode(tmp_path)
    path = tmp_path / "episodes" / record["id"] / "steps.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    rows[0]["image"] = "../../secret.png"
    rows[1]["code"] = "pyautogui.click(9999, 20)"
    path.write_text("".join(json.dumps(row) + "\n" for row in rows) + "not json\n")
    (trajectory,), rejected = read(tmp_path)
    assert [step.index for step in trajectory] == [2]
    assert ["line 1" in r or "line 2" in r or "line 5" in r for r in rejected] == [True] * 3
    assert "leaves the source folder" in rejected[0]
    assert "outside" in rejected[1]


def test_a_dataset_of_a_run_is_what_the_agents_saw(tmp_path):
    """Offline = live: the same seed gives the same plans and the same bytes."""
    for label, corruption in VISUAL.items():
        play_episode(tmp_path / "run", corruption, size=SCREEN, label=label)
    live = {}
    for path in (tmp_path / "run").glob("episodes/*/steps.jsonl"):
        for line in map(json.loads, path.read_text().splitlines()):
            live[path.parent.name, line["step"]] = line["plan_digest"], line["seen_sha256"]
    report = build(tmp_path / "run", tmp_path / "data", corruptions=VISUAL, seed=3)
    assert report.exit_code == 0
    counts = Counter()
    for row in open_dataset(tmp_path / "data"):
        if f"__{row['corruption']}__" in row["trajectory_id"]:
            assert (row["plan_digest"], row["image_sha256"]) == live[
                row["trajectory_id"], row["step"]
            ]
            counts[row["corruption"]] += 1
    assert counts == dict.fromkeys(VISUAL, 3)
    assert verify(tmp_path / "data").ok
