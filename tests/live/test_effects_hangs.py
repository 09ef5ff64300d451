"""freeze and slow_link on a real desktop: conformance, sabotage, the timer, an early end."""

import contextlib

import pytest

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("lxml", reason=needs.ONLINE)

from hijack_data.corruption import make_corruption
from hijack_data.plan import Effect
from online_env.effects import conformance, perform
from online_env.effects.app_freeze import _list_processes
from online_env.effects.guest import Guest
from online_env.environment import CorruptedEnv, SmallTasks

from support.waiting import until as wait


def stopped(desktop):
    guest = Guest(desktop, "password", None)
    return [process.name for process in _list_processes(guest) if process.state == "T"]


@pytest.fixture(scope="module")
def desktop(embedded_machine):
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(apps=("editor",)) as desktop:
        yield desktop


@pytest.mark.parametrize(
    ("kind", "params"), [("freeze", {"lasts": {"seconds": 120}}), ("slow_link", {"rate": 128})]
)
def test_conformance_on_one_desktop(desktop, kind, params):
    """The last check has to have a desktop on which nothing was done: by then, this is one."""
    for result in conformance.run_live(kind, params, lambda: contextlib.nullcontext(desktop)):
        assert result.ok, f"{result.name}: {result.problem}"


def test_a_window_hangs_for_its_seconds_and_what_was_typed_arrives_late(desktop):
    desktop.run("pyautogui.click(960, 540)")
    applied = perform(Effect("freeze", {"lasts": {"seconds": 5}}), desktop)
    before = desktop.screenshot()
    desktop.run("pyautogui.write('late')")
    assert applied.probe().ok
    height = before.shape[0]
    assert (desktop.screenshot() == before)[: height // 2].all(), "it draws nothing"
    wait(lambda: not applied.holds(), 15)
    wait(lambda: not (desktop.screenshot() == before).all())
    probe = applied.probe()
    assert not probe.ok
    assert "not stopped" in probe.problem
    assert applied.undo().ok


def test_a_window_that_somebody_lets_go_on_is_noticed(desktop):
    applied = perform(Effect("freeze", {"lasts": {"seconds": 60}}), desktop)
    assert applied.probe().ok
    desktop.execute(["pkill", "-CONT", "mousepad"])
    assert "not stopped: mousepad" in applied.probe().problem
    assert applied.undo().ok


def test_limits_that_somebody_removes_are_noticed(desktop):
    applied = perform(Effect("slow_link", {"rate": 128}), desktop)
    assert applied.probe().ok
    desktop.network_root("tc qdisc del dev ah-slow root")
    assert "1 of our 2 token buckets are in force" in applied.probe().problem, "one way is open"
    desktop.network_root("tc qdisc del dev eth0 root")
    assert "the site answers in" in applied.probe().problem
    assert applied.undo().ok


def test_an_episode_that_ends_early_leaves_nothing_stopped(desktop):
    stage = SmallTasks(desktop)
    env = CorruptedEnv(stage, corruption=make_corruption("app_freeze", step=0, seconds=60))
    env.reset(seed=0)
    assert stopped(stage.desktop)
    env.abandon("a test")
    assert env.record["effects"][0]["record"]["undone"][0]["ok"]
    assert not stopped(stage.desktop)
