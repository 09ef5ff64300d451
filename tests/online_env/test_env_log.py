"""The log of an episode, and settling: what is written when, and what a screen that never rests
costs."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import hijack_data as hj
from hijack_data.errors import HijackError, ParameterError
from hijack_data.picture_io import load_image
from online_env.environment import CorruptedEnv, Settle
from online_env.environment.settle import wait_until_settled

from support.live import AT_ONCE, SIZE, FakeDesktop, FakeStage, Marking

FOLDER = "episodes/do-0__marks__s0__tester"


def lines(folder: Path):
    return [json.loads(line) for line in (folder / "steps.jsonl").read_text().splitlines()]


def make(tmp_path, corruption=None, **options):
    return CorruptedEnv(
        FakeStage(), corruption=corruption, settle=AT_ONCE, log=tmp_path, agent="tester", **options
    )


def test_each_line_holds_an_observation_and_the_action_taken_on_it(tmp_path):
    env = make(tmp_path, hj.Marks(number=3, mark_size=6))
    first, _ = env.reset(seed=0)
    second = env.step("```\npyautogui.click(5, 6)\n```")[0]
    assert len(lines(tmp_path / FOLDER)) == 1, "a line is written when its action was taken"
    env.step("import os")
    assert not (tmp_path / FOLDER / "episode.json").exists()
    last = env.step("DONE")[0]
    folder, rows = tmp_path / FOLDER, lines(tmp_path / FOLDER)
    assert [row["step"] for row in rows] == [0, 1, 2, 3]
    assert [row["raw"] for row in rows] == [
        "```\npyautogui.click(5, 6)\n```",
        "import os",
        "DONE",
        None,
    ]
    assert [row["code"] for row in rows] == ["pyautogui.click(5, 6)", None, "DONE", None]
    assert [bool(row["error"]) for row in rows] == [False, True, False, False]
    assert rows[0]["result"] == {"status": "success", "output": "", "error": "", "returncode": 0}
    for row, obs in zip(rows, (first, second, None, last), strict=True):
        clean, calls = (load_image(folder / row[key])[0] for key in ("image", "seen"))
        plan = hj.Plan.from_data(row["plan"])
        assert plan.digest() == row["plan_digest"]
        assert np.array_equal(hj.apply(plan, clean), calls)
        assert hashlib.sha256(calls.tobytes()).hexdigest() == row["seen_sha256"]
        if obs is not None:
            assert np.array_equal(obs["screenshot"], calls)
    assert json.loads((folder / "episode.json").read_text()) == env.record
    assert sorted(path.name for path in folder.iterdir()) == [
        "episode.json",
        "frames",
        "steps.jsonl",
    ]


def test_a_clean_screen_is_stored_once(tmp_path):
    env = make(tmp_path)
    env.reset(seed=0)
    env.step("DONE")
    folder = tmp_path / "episodes/do-0__clean__s0__tester"
    assert [row["seen"] for row in lines(folder)] == [None, None]
    assert sorted(path.name for path in (folder / "frames").iterdir()) == ["0000.png", "0001.png"]


def test_events_stand_before_the_observation_that_shows_them(tmp_path):
    env = make(tmp_path, Marking(-1, 1), max_steps=2)
    env.reset(seed=0)
    env.step("WAIT")
    env.step("WAIT")
    rows = lines(tmp_path / "episodes/do-0__marking__s0__tester")
    assert [[event["step"] for event in row["events"]] for row in rows] == [[-1], [1], []]
    assert rows[0]["events"][0]["record"]["probes"][0]["ok"] is True


def test_an_episode_that_fails_keeps_what_it_has(tmp_path):
    env = make(tmp_path, Marking(1, sabotaged=True))
    env.reset(seed=0)
    env.step("pyautogui.click(5, 6)")
    folder = tmp_path / "episodes/do-0__marking__s0__tester"
    assert [row["raw"] for row in lines(folder)] == ["pyautogui.click(5, 6)", None]
    assert json.loads((folder / "episode.json").read_text())["status"] == "invalid"


def test_attempts_are_counted_and_never_written_over(tmp_path):
    env = make(tmp_path)
    for attempt in range(3):
        env.reset(seed=0)
        env.step("DONE")
        assert env.record["attempt"] == attempt
    assert env.record["id"].endswith("__a2")
    env.reset(seed=0, options={"attempt": 7})
    env.step("DONE")
    assert (tmp_path / "episodes" / env.record["id"] / "episode.json").exists()
    with pytest.raises(ParameterError, match="holds an episode already"):
        env.reset(seed=0, options={"attempt": 7})


def test_what_a_broken_episode_left_is_removed(tmp_path):
    frames_folder = tmp_path / "episodes/do-0__clean__s0__tester/frames"
    frames_folder.mkdir(parents=True)
    (frames_folder / "0009.png").write_bytes(b"old")
    env = make(tmp_path)
    env.reset(seed=0, options={"attempt": 0})
    env.step("DONE")
    assert not (frames_folder / "0009.png").exists()


def test_a_log_that_cannot_be_written_says_so_and_everything_is_put_back(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(HijackError, match="cannot be written"):
        make(tmp_path / "file").reset(seed=0)
    env = make(tmp_path, Marking(0))
    env.reset(seed=0)
    frames = tmp_path / "episodes/do-0__marking__s0__tester/frames"
    for path in frames.iterdir():
        path.unlink()
    frames.rmdir()
    with pytest.raises(HijackError, match="cannot be written"):
        env.step("WAIT")
    assert env.record["status"] == "error"


def test_what_an_agent_writes_is_kept_whatever_it_is(tmp_path):
    env = make(tmp_path, max_steps=3)
    env.reset(seed=0)
    for text in ("\ud800 half", "名前 \0", "pyautogui.write('é')"):
        env.step(text)
    rows = lines(tmp_path / "episodes/do-0__clean__s0__tester")
    assert [row["raw"] for row in rows][:3] == ["\ud800 half", "名前 \0", "pyautogui.write('é')"]


class Restless(FakeDesktop):
    """Changes for `frames` looks; the tree belongs to the frame before it."""

    def __init__(self, frames):
        super().__init__()
        self.left = frames

    def screenshot(self):
        self.left -= 1
        picture = super().screenshot()
        picture[0, 0] = max(self.left, 0) % 251
        return picture


def test_a_screen_counts_as_settled_when_nothing_changes():
    rule = Settle(quiet=0.05, cap=5, look=0.005)
    desktop = Restless(10)
    result = wait_until_settled(desktop, rule, False)
    assert result.in_time
    assert result.tree is None
    assert desktop.left <= 0
    assert np.array_equal(result.frame, desktop.screenshot())


def test_the_tree_is_not_older_than_the_picture():
    desktop = Restless(20)
    result = wait_until_settled(desktop, Settle(quiet=0.02, cap=5, look=0.005), True)
    last = len(desktop.calls) - 1 - desktop.calls[::-1].index("tree")
    assert result.in_time
    assert desktop.calls[last:].count("screenshot") >= 1
    assert "<push-button" in result.tree
    call_index = [i for i, call in enumerate(desktop.calls) if call == "screenshot"][19]
    assert last > call_index, "a tree of a screen that changed since is read again"


@pytest.mark.parametrize("with_tree", [False, True])
def test_a_screen_that_never_rests_is_taken_as_it_is(with_tree):
    desktop = Restless(10**9)
    result = wait_until_settled(desktop, Settle(quiet=0.3, cap=0.1, look=0.01), with_tree)
    assert not result.in_time
    assert (result.tree is not None) == with_tree
    if with_tree:
        assert desktop.calls[-2:] == ["tree", "screenshot"]


def test_without_a_cap_it_looks_once():
    desktop = FakeDesktop()
    wait_until_settled(desktop, AT_ONCE, False)
    assert desktop.calls == ["screenshot"]
    assert desktop.screenshot().shape == (*SIZE, 3)
