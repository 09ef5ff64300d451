"""Stages: what OSWorld's environment is told, and what is no task."""

import io

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.errors import ConfigError, ParameterTypeError, UnknownNameError
from online_env.environment import CorruptedEnv, SmallTasks
from online_env.errors import DesktopError, MissingCapabilityError
from online_env.osworld import stage as stage_module
from online_env.osworld.stage import OsworldStage
from online_env.osworld.tasks import OsworldTask

from support.live import AT_ONCE, TREE

TASK = {
    "id": "o-1",
    "instruction": "Do it",
    "related_apps": ["VS Code", "chrome"],
    "config": [],
    "evaluator": {"func": "infeasible"},
}


class Controller:
    def __init__(self):
        self.ran = []

    def get_screenshot(self):
        buffer = io.BytesIO()
        Image.fromarray(np.full((60, 80, 3), 7, np.uint8)).save(buffer, "PNG")
        return buffer.getvalue()

    def get_accessibility_tree(self):
        return TREE

    def get_file(self, path):
        return None

    def execute_python_command(self, command):
        self.ran.append(command)
        return {
            "status": "success",
            "output": 'agenthijack-result:[0, "", ""]\n',
            "error": "",
            "returncode": 0,
        }


class Env:
    """As `DesktopEnv` is: it notes by itself only what its own `step` does."""

    def __init__(self):
        self.controller, self.action_history, self.is_environment_used = Controller(), [], False
        self.reverts, self.closed = 0, 0

    def reset(self, task_config=None):
        self.reverts += self.is_environment_used
        self.is_environment_used = False
        self.action_history.clear()
        self.task = task_config

    def step(self, action, pause=2):
        assert pause == 0
        self.action_history.append(action)

    def evaluate(self):
        return float(self.action_history[-1:] == ["FAIL"])

    def close(self):
        self.closed += 1


@pytest.mark.parametrize("wrap", [dict, lambda task: OsworldTask("o-1", "os", task, None)])
def test_an_osworld_task_sets_the_scene(wrap):
    setting = OsworldStage(Env()).reset(wrap(TASK), 5)
    assert (setting.id, setting.instruction, setting.apps) == ("o-1", "Do it", ("vscode", "chrome"))
    assert setting.infeasible
    assert (
        not OsworldStage(Env()).reset({**TASK, "evaluator": {"func": "exact_match"}}, 0).infeasible
    )


@pytest.mark.parametrize(
    ("func", "waits"), [("infeasible", []), ("exact_match", [stage_module.LATE_FILES_S])]
)
def test_what_applications_write_late_is_waited_for(func, waits, monkeypatch):
    slept = []
    monkeypatch.setattr(stage_module.time, "sleep", slept.append)
    stage = OsworldStage(Env())
    stage.reset({**TASK, "evaluator": {"func": func}}, 0)
    stage.evaluate(["DONE"])
    assert slept == waits
    stage = OsworldStage(Env(), late_files=3)
    stage.reset({**TASK, "evaluator": {"func": func}}, 0)
    stage.evaluate(["DONE"])
    assert slept == waits + [3] * len(waits)


def test_no_proxy_is_set_up_on_a_machine_whose_network_is_cut():
    env = Env()
    stage = OsworldStage(env)
    stage.reset_around({**TASK, "proxy": True}, 0, lambda: None)
    assert env.task["proxy"] is False
    stage.reset({**TASK, "proxy": True}, 0)  # as a request for re-initialisation does
    assert env.task["proxy"] is True


@pytest.mark.parametrize("is_offline", [False, True])
def test_the_programs_of_a_setup_have_time_to_open_their_windows(is_offline, monkeypatch):
    """OSWorld's `launch` returns at once: the first picture would show a bare desktop."""
    events = []
    monkeypatch.setattr(stage_module.time, "sleep", events.append)
    launch = {"type": "launch", "parameters": {"command": ["google-chrome"]}}
    task = {**TASK, "config": [launch]}
    for stage in (OsworldStage(Env()), OsworldStage(Env(), setup_wait=60)):
        if is_offline:
            stage.reset_around(task, 0, lambda: events.append("offline"))
        else:
            stage.reset(task, 0)
        stage.reset(TASK, 0)  # nothing is started
    around = ["offline"] if is_offline else []
    assert events == [*around, stage_module.SETUP_WAIT_S, *around, 60]


@pytest.mark.parametrize(
    ("last", "score"), [("FAIL", 1.0), ("WAIT", 0.0), ("pyautogui.press('a')", 0.0)]
)
def test_the_environment_hears_of_the_agents_actions_and_of_nothing_else(last, score):
    env = Env()
    outer = CorruptedEnv(OsworldStage(env), settle=AT_ONCE, max_steps=3)
    outer.reset(seed=0, options={"task": TASK})
    for action in ("pyautogui.press('x')", "no action", last):
        reward = outer.step(action)[1]
    assert reward == score
    assert env.action_history == ["pyautogui.press('x')", "no action", last]
    assert next(code for code in env.controller.ran if "press" in code) == "\npyautogui.press('x')"
    outer.close()
    outer.close()
    assert env.closed == 1


def test_the_reason_of_a_score_says_that_the_tasks_setup_failed():
    """OSWorld only logs that, and scores the task all the same."""
    env = Env()
    stage = OsworldStage(env)
    failed = ["ERROR Failed to launch application.", "ERROR No window."]
    env.warnings = ["WARNING slow", "ERROR Attempt 1: Failed to connect, retrying. Error: x"]
    env.warnings += failed
    stage.reset(TASK, 0)
    env.warnings = []
    assert stage.evaluate(["FAIL"]).reason == (
        "OSWorld's evaluator; the task's setup logged 2 errors, the first:"
        " ERROR Failed to launch application."
    )
    stage.reset(TASK, 0)
    assert stage.evaluate(["FAIL"]).reason == "OSWorld's evaluator"


def test_a_guest_that_died_before_it_was_judged_is_no_zero():
    class Dies(Env):
        def evaluate(self):
            self.controller.get_screenshot = lambda: None
            return 0.0

    outer = CorruptedEnv(OsworldStage(Dies()), settle=AT_ONCE)
    outer.reset(seed=0, options={"task": TASK})
    assert outer.step("DONE")[1:4] == (0.0, False, True)
    assert (outer.record["status"], outer.record["score"]) == ("error", None)
    assert "the guest gave no screenshot" in outer.record["problem"]


def test_a_machine_that_was_used_is_reverted():
    env = Env()
    stage = OsworldStage(env)
    for reverts in (0, 1, 2):
        stage.reset(TASK, 0)
        assert env.reverts == reverts


def test_the_network_is_cut_between_the_revert_and_the_setup():
    env, states = Env(), []
    stage = OsworldStage(env)
    stage.reset(TASK, 0)
    assert stage.choose(TASK, 0) == stage.reset_around(
        TASK, 0, lambda: states.append((env.reverts, env.task))
    )
    assert states == [(1, None)], "reverted, and nothing set up"
    assert (env.reverts, env.task["id"]) == (1, "o-1"), "set up on the machine as it was left"
    stage.reset(TASK, 0)
    assert env.reverts == 2


def test_a_machine_whose_setup_broke_off_is_reverted():
    class Breaks(Env):
        def reset(self, task_config=None):
            super().reset(task_config)
            if task_config["config"]:
                raise RuntimeError("Setup step 1 failed")

    env = Breaks()
    stage = OsworldStage(env)
    with pytest.raises(RuntimeError, match="step 1 failed"):
        stage.reset({**TASK, "config": [{"type": "open", "parameters": {}}]}, 0)
    assert env.reverts == 0
    stage.reset(TASK, 0)
    assert env.reverts == 1


@pytest.mark.parametrize(
    ("task", "words"),
    [({"id": "x"}, "instruction"), (None, "must hold an object"), ("o-1", "must hold an object")],
)
def test_what_is_no_osworld_task_is_refused(task, words):
    with pytest.raises(ConfigError, match=words):
        OsworldStage(Env()).reset(task, 0)
    with pytest.raises(MissingCapabilityError, match="not shaped like OSWorld"):
        OsworldStage(object())


class Desktop:
    def reset(self):
        raise DesktopError("reached")


def test_small_tasks_are_named_or_given():
    stage = SmallTasks(Desktop())
    with pytest.raises(DesktopError, match="call reset first"):
        stage.evaluate(())
    with pytest.raises(UnknownNameError, match="did you mean 'write_note'"):
        stage.reset("write_nte", 0)
    for wrong in (5, {"id": "x"}, SmallTasks):
        with pytest.raises(ParameterTypeError, match="add_bookmark, "):
            stage.reset(wrong, 0)
    with pytest.raises(DesktopError, match="reached"):
        stage.reset(None, 0)
