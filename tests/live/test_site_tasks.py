"""Tasks of the suite in a browser alone, with the sites in this process."""

from collections.abc import Iterator
from contextlib import closing
from typing import Any

import gymnasium as gym
import pytest

import online_env  # noqa: F401  (registers the environment)
from hijack_data.elements.accessibility_nodes import nodes_from_tree
from hijack_data.errors import ParameterError
from online_env.agents.base import FAIL
from online_env.bench.providers import BROWSER, check_installed
from online_env.browser.site_tasks import SiteTasks, open_site_tasks
from online_env.tasks import TASKS, Hand
from online_env.tasks.hand import GiveUpError
from online_env.tasks.plan_words import read_plan

from support import needs

NAMES = sorted(name for name in TASKS.entries if TASKS.get(name).in_browser)
HEIGHT, WIDTH = SIZE = (720, 1280)


@pytest.fixture(scope="module")
def stage() -> Iterator[SiteTasks]:
    """A browser with the sites."""
    needs.chromium()
    with closing(open_site_tasks(SIZE)) as opened_stage:
        yield opened_stage


@pytest.mark.parametrize("name", NAMES)
def test_the_oracle_does_what_nobody_did_before(name: str, stage: SiteTasks) -> None:
    task = TASKS.get(name)(0)
    stage.reset(task, 0)
    machine, before = stage.machine, stage.machine.before
    assert stage.evaluate(["DONE"]).score == 0.0
    if task.infeasible:
        with pytest.raises(GiveUpError):
            task.oracle(Hand(stage.desktop))
        assert stage.evaluate([FAIL]).score == 1.0
    else:
        task.oracle(Hand(stage.desktop))
        assert stage.evaluate(["DONE"]).score == 1.0
    stage.reset(task, 0)
    assert stage.evaluate(["DONE"]).score == 0.0
    assert stage.machine is machine, "an agent that was given it keeps it"
    assert machine.before == before, "a reset forgets what the sites stored"


def test_a_plan_in_words_names_no_window(stage: SiteTasks) -> None:
    for name in NAMES:
        task = TASKS.get(name)(0)
        stage.reset(task, 0)
        assert len(stage.plan()) == len(task.plan()) - 1
        assert not any(step.verb == "window" for step in read_plan(stage.plan()))


def test_what_is_scrolled_out_of_sight_does_not_show(stage: SiteTasks) -> None:
    stage.reset("compare_products", 0)
    nodes = nodes_from_tree(stage.desktop.accessibility())
    for node in nodes:
        if node.visible and node.box is not None:
            assert node.box[0] < WIDTH
            assert node.box[1] < HEIGHT, node
    below = {node.name for node in nodes if node.box and node.box[1] > HEIGHT}
    assert "Pour-over coffee set" in below
    stage.desktop.run("pyautogui.scroll(-3)")
    after = nodes_from_tree(stage.desktop.accessibility())
    assert len(below & {node.name for node in after if node.visible}) > 10


def test_gymnasium_makes_it_under_a_corruption() -> None:
    needs.chromium()
    env = gym.make(
        "AgentHijack/Browser-v0", task="finish_draft", corruption="verification", size=SIZE
    )
    with closing(env):
        observation, _ = env.reset(seed=3)
        assert observation["screenshot"].shape == (*SIZE, 3)
        assert env.step("DONE")[1:3] == (0.0, True)
        record: Any = env.get_wrapper_attr("record")
        assert [effect["record"]["effect"] for effect in record["effects"]] == ["lock"]


def test_a_task_that_needs_more_is_refused_before_the_run(stage: SiteTasks) -> None:
    with pytest.raises(
        ParameterError, match=r"more than a browser: write_note; .*compare_products"
    ):
        check_installed(BROWSER, ["compare_products", "write_note"])
    with pytest.raises(ParameterError, match="write_note needs more than a browser"):
        stage.reset("write_note", 0)
