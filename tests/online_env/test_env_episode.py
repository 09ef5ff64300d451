"""`CorruptedEnv` on a desktop that is none: what an episode consists of, in which order, and how it
ends."""

import json

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import hijack_data as hj
from hijack_data.errors import ParameterError
from online_env.desktops.protocol import RunResult
from online_env.errors import GuestError

from support.episodes import CLICK, make, play
from support.live import SIZE, FakeDesktop, FakeStage, Marking

pytestmark = pytest.mark.usefixtures("no_waiting")


def test_an_episode_ends_with_the_score_as_its_reward():
    env, stage = make(FakeStage(score=0.5))
    obs, info = env.reset(seed=7)
    assert info == {}
    assert obs["instruction"] == "Open the file"
    assert obs["screenshot"].shape == (*SIZE, 3)
    assert env.record is None
    (_, r1, t1, c1, i1), (_, r2, t2, c2, i2) = env.step(CLICK), env.step("DONE")
    assert [(r1, t1, c1, i1), (r2, t2, c2, i2)] == [(0.0, False, False, {}), (0.5, True, False, {})]
    record = env.record
    assert (record["status"], record["score"], record["reason"], record["steps"]) == (
        "ok",
        0.5,
        "as wanted",
        2,
    )
    assert (record["task"], record["sample"], record["task_seed"], record["seed"]) == (
        "do-7",
        "do-7",
        7,
        7,
    )
    assert (record["corruption"], record["params"], record["effects"]) == ("clean", {}, [])
    assert record["id"] == "do-7__clean__s7__agent"
    assert stage.desktop.ran == [f"\n{CLICK}"]
    assert json.loads(json.dumps(record)) == record


def test_the_step_limit_truncates_and_still_evaluates():
    env, _ = make(max_steps=2)
    value, two = play(env, "WAIT", "WAIT")
    assert (value[1:4], two[1:4]) == ((0.0, False, False), (1.0, False, True))
    assert env.record["status"] == "ok"


def test_after_the_end_nothing_happens_any_more():
    env, stage = make()
    *_, last = play(env, "DONE")
    again = env.step(CLICK)
    assert again[1:] == (0.0, False, True, {})
    assert np.array_equal(again[0]["screenshot"], last[0]["screenshot"])
    assert again[0]["screenshot"] is not last[0]["screenshot"]
    assert stage.desktop.ran == []


class OnElements(Marking):
    """Acts where there are so many elements, and nowhere else."""

    needs_elements = True

    def plan(self, scene, **given):
        if len(scene.boxes) < self.given["least"]:
            return hj.Plan.clean(scene.size)
        if self.given.get("refuses") and len(scene.boxes) > 2:
            raise ParameterError("too many elements")
        return super().plan(scene, **given)


@pytest.mark.parametrize("refuses", [False, True])
def test_a_corruption_that_acts_on_elements_alone_finds_them(refuses):
    env, stage = make(corruption=OnElements(1, least=2, refuses=refuses), max_steps=4)
    env.reset(seed=0)
    assert stage.desktop.state == set()
    env.step("WAIT")
    assert stage.desktop.state == {"marked"}
    assert env.step("DONE")[1:4] == (1.0, True, False)
    assert [effect["step"] for effect in env.record["effects"]] == [1]


def test_elements_are_not_looked_for_where_nothing_is_due():
    env, stage = make(corruption=OnElements(3, least=2), max_steps=3)
    play(env, "WAIT", "WAIT", "DONE")
    assert stage.desktop.calls.count("tree") == 1  # of the last observation


def test_a_task_is_judged_by_the_agents_own_actions():
    env, stage = make(corruption=Marking(0, 1, 2), max_steps=5)
    play(env, CLICK, "import os", "REQUEST_REINIT", "FAIL")
    assert stage.history == (CLICK, "import os", "REQUEST_REINIT", "FAIL")
    assert env.record["last_action"] == "FAIL"


@pytest.mark.parametrize("fenced", [CLICK, f"Thought.\n```python\n{CLICK}\n```"])
def test_actions_are_mapped_back_to_the_screen(fenced):
    env, stage = make(corruption=hj.Resolution(scale=0.5))
    obs, _ = env.reset(seed=0)
    assert obs["screenshot"].shape == (SIZE[0] // 2, SIZE[1] // 2, 3)
    env.step(fenced)
    (ran,) = stage.desktop.ran
    assert ran == "\npyautogui.click(20, 40)"
    env.step("DONE")
    assert stage.history[0] == "pyautogui.click(20, 40)"


@pytest.mark.parametrize(
    "action", ["import os", "I click it", "", 5, None, "pyautogui.click(unknown, 2)"]
)
def test_what_is_no_action_is_not_run_and_counts(action):
    env, stage = make(corruption=hj.Resolution(scale=0.5), max_steps=3)
    env.reset(seed=0)
    assert env.step(action)[1:] == (0.0, False, False, {})
    assert stage.desktop.ran == []
    env.step("DONE")
    assert env.record["malformed"] == 1


def test_a_corruption_comes_though_the_agent_talks_nonsense():
    env, stage = make(corruption=Marking(1))
    play(env, "nonsense")
    assert stage.desktop.state == {"marked"}


def test_any_code_runs_in_the_guest_where_that_is_allowed():
    env, stage = make(allow_code=True)
    play(env, "import os\nos.listdir()")
    assert stage.desktop.ran == ["\nimport os\nos.listdir()"]


def test_code_that_fails_or_never_ends_is_the_agents_own_fault():
    stage = FakeStage()
    stage.desktop.answer = RunResult("error", "", "Boom", 1)
    env, _ = make(stage)
    play(env, CLICK)
    stage.desktop.run = lambda code: (_ for _ in ()).throw(GuestError("not answered within 30 s"))
    _, _, terminated, truncated, _ = env.step(CLICK)
    assert (terminated, truncated, env.record) == (False, False, None)


def test_the_order_of_events():
    env, stage = make(corruption=hj.Sequence([Marking(-1, 1), hj.Marks(number=1, mark_size=4)]))
    env.reset(seed=0)
    # before the first observation; then look, look again where something was done, and prove it
    # once more
    assert [c for c in stage.desktop.calls if c != "screenshot"] == [
        "apply",
        "probe",
        "refresh",
        "probe",
    ]
    assert stage.desktop.calls[-2:] == ["screenshot", "probe"]
    stage.desktop.calls.clear()
    env.step(CLICK)
    assert [c for c in stage.desktop.calls if c != "screenshot"] == [
        "run",
        "refresh",
        "apply",
        "probe",
        "probe",
    ]
    run, screen = stage.desktop.calls.index("run"), stage.desktop.calls.index("screenshot")
    assert run < screen < stage.desktop.calls.index("apply")
    assert stage.desktop.calls[-3:] == ["probe", "screenshot", "probe"], (
        "the picture is between two probes"
    )
    stage.desktop.calls.clear()
    env.step("DONE")
    # Judged as the agent left it, then put back, the last first.
    assert stage.state_at_evaluation == {"marked"}
    assert [c for c in stage.desktop.calls if c in ("run", "apply", "undo")] == ["undo", "undo"]
    assert stage.desktop.state == set()
    assert [event["step"] for event in env.record["effects"]] == [-1, 1]


def test_the_tree_is_read_only_for_corruptions_that_place_things():
    for corruption, expected in (
        (None, False),
        ("subtitle", False),
        (hj.PopUps(width=400, height=250), True),
    ):
        env, stage = make(FakeStage(FakeDesktop((720, 1280))), corruption=corruption)
        env.reset(seed=0)
        assert ("tree" in stage.desktop.calls) == expected
    env, stage = make(corruption=hj.AccidentalTouch(step=9))
    play(env, CLICK)
    assert "tree" not in stage.desktop.calls


def test_effects_come_at_each_step_that_is_asked_for_but_not_after_the_last_action():
    env, _ = make(corruption=Marking(*range(-1, 9)), max_steps=3)
    play(env, "WAIT", "WAIT", "WAIT")
    assert [effect["step"] for effect in env.record["effects"]] == [-1, 0, 1, 2]
    env, _ = make(corruption=Marking(0, 1), max_steps=9)
    play(env, "DONE")
    assert [effect["step"] for effect in env.record["effects"]] == [0]


def test_effects_draw_by_seed_task_and_step():
    draws = []
    for seed, agent in ((1, "a"), (1, "b"), (2, "a")):
        env, _ = make(corruption=Marking(0, 1), agent=agent)
        play(env, "WAIT", "DONE", seed=seed)
        draws.append([effect["record"]["did"]["draw"] for effect in env.record["effects"]])
    assert draws[0] == draws[1] != draws[2]
    assert draws[0][0] != draws[0][1]
