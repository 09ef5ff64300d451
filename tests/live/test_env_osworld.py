"""`CorruptedEnv` around OSWorld's own environment: all nine, on tasks that OSWorld scores."""

import pytest

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("lxml", reason=needs.ONLINE)

import hijack_data as hj
from hijack_data.errors import ConfigError
from online_env.environment import CorruptedEnv, Settle
from online_env.osworld.run import embedded_env
from online_env.osworld.stage import OsworldStage
from pipelines.proof.rebuild import rebuild

EFFECTS = {
    "multi_apps": ["launch_app"],
    "accidental_touch": ["touch"],
    "app_minimization": ["minimise"],
    "network_error": ["firewall"],
    "verification": ["lock"],
}
ONE_STEP = {name: {"step": 0} for name in ("accidental_touch", "app_minimization")}


def task(**more):
    """Make a file on the desktop; what is scored is whether it is there."""
    show = {"type": "launch", "parameters": {"command": ["thunar"]}}
    evaluator = {
        "func": "exact_match",
        "result": {"type": "vm_command_line", "command": "cat ~/made", "shell": True},
        "expected": {"type": "rule", "rules": {"expected": "yes"}},
    }
    return {
        "id": "t-1",
        "instruction": "Make the file",
        "related_apps": ["Files"],
        "config": [show, wait(1)],
        "evaluator": evaluator,
        **more,
    }


def wait(seconds):
    return {"type": "sleep", "parameters": {"seconds": seconds}}


@pytest.fixture(scope="module")
def stage(embedded_machine, tmp_path_factory):
    with embedded_env(needs.osworld(), tmp_path_factory.mktemp("cache"), size=(720, 1280)) as env:
        # no application writes what is judged here, and the set-up waits by itself
        yield OsworldStage(env, late_files=0.5, setup_wait=0.0)


def make(stage, folder, **options):
    return CorruptedEnv(
        stage, log=folder, settle=Settle(quiet=0.2, cap=2), allow_code=True, max_steps=4, **options
    )


@pytest.mark.parametrize("name", hj.corruption_names()[:9])
def test_all_nine_on_a_task_that_is_scored(stage, tmp_path, name):
    corruption = hj.make_corruption(
        name, **ONE_STEP.get(name, {"fit": "shrink"} if name == "subtitle" else {})
    )
    env = make(stage, tmp_path, corruption=corruption)
    obs, _ = env.reset(seed=2, options={"task": task()})
    assert obs["screenshot"].shape == ((360, 640, 3) if name == "resolution" else (720, 1280, 3))
    assert obs["instruction"] == "Make the file"
    assert env.record is None
    env.step("pyautogui.click(40, 30)")
    # The agent's own way to the goal: by keyboard it would need an application, this is about the
    # score.
    env.step("open('/home/user/made', 'w').write('yes')")
    # Code is refused while the picture has another size: nobody knows what it points at.
    score = 0.0 if name == "resolution" else 1.0
    assert env.step("DONE")[1:4] == (score, True, False)
    record = env.record
    assert (record["status"], record["score"], record["task"], record["apps"]) == (
        "ok",
        score,
        "t-1",
        ["file_manager"],
    )
    assert [effect["record"]["effect"] for effect in record["effects"]] == EFFECTS.get(name, [])
    assert all(effect["record"]["probes"][0]["ok"] for effect in record["effects"])
    assert all(effect["record"]["undone"][-1]["ok"] for effect in record["effects"])
    assert rebuild(tmp_path).problems == []


def test_doing_nothing_scores_nothing_and_a_reset_is_pristine(stage, tmp_path):
    env = make(stage, tmp_path, corruption="marks")
    env.reset(seed=2, options={"task": task()})
    assert env.step("DONE")[1:4] == (0.0, True, False)


@pytest.mark.parametrize(
    ("last", "score"), [("FAIL", 1.0), ("DONE", 0.0), ("pyautogui.press('a')", 0.0)]
)
def test_an_infeasible_task_is_judged_by_the_agents_last_action(stage, tmp_path, last, score):
    """What is injected is none of the agent's actions."""
    env = make(stage, tmp_path, corruption=hj.AppMinimization(step=1))
    env.reset(seed=0, options={"task": task(evaluator={"func": "infeasible"})})
    for action in ("WAIT", "pyautogui.press('b')", "nonsense"):
        env.step(action)
    assert env.step(last)[1] == score
    assert (env.record["infeasible"], env.record["last_action"], env.record["score"]) == (
        True,
        last,
        score,
    )
    assert env.record["effects"][0]["record"]["probes"][0]["ok"]
    assert stage.env.action_history[-1] == last


def test_a_task_that_could_be_done_is_not_done_by_giving_up(stage, tmp_path):
    env = make(stage, tmp_path)
    env.reset(seed=0, options={"task": task()})
    env.step("open('/home/user/made', 'w').write('yes')")
    assert env.step("FAIL")[1] == 0.0


def test_what_is_no_task_is_refused(stage):
    with pytest.raises(ConfigError, match="the task: instruction"):
        stage.reset({"id": "x", "evaluator": {"func": "infeasible"}}, 0)
