"""`CorruptedEnv` on a desktop that is none: what fails is no zero, everything is put back, recovery
on request."""

import json
import re
from typing import ClassVar

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import hijack_data as hj
from hijack_data.errors import ParameterError, ParameterTypeError
from hijack_data.params import Every
from online_env.effects import Probe, Undone, register
from online_env.environment.stage import Setting
from online_env.errors import DesktopError, MissingCapabilityError

from support.episodes import CLICK, make, play
from support.live import SIZE, FakeDesktop, FakeStage, Mark, Marking

pytestmark = pytest.mark.usefixtures("no_waiting")


@pytest.mark.parametrize("step", [-1, 0, 2])
@pytest.mark.parametrize(
    "params",
    [
        {"sabotaged": True},
        {"raises": "effect", "says": "no room"},
        {"raises": "desktop", "says": "no answer"},
    ],
)
def test_a_corruption_that_is_not_there_makes_an_episode_invalid_never_a_zero(step, params):
    env, stage = make(corruption=Marking(step, **params))
    obs, info = env.reset(seed=0)
    assert obs["screenshot"].shape == (*SIZE, 3)
    assert info == {}
    for _ in range(max(step, 0)):
        assert env.record is None
        *_, truncated, info = env.step("WAIT")
        assert info == {}
    if step > 0:
        assert truncated
    record = env.record
    assert (record["status"], record["score"]) == ("invalid", None)
    assert "test_mark" in record["problem"]
    assert stage.desktop.calls[-1] == "undo"
    assert stage.history is None
    assert env.step(CLICK)[1:] == (0.0, False, True, {})


def test_a_desktop_that_dies_ends_the_episode_with_an_error():
    env, stage = make(corruption=Marking(0))
    env.reset(seed=0)
    stage.desktop.dead = True
    *_, terminated, truncated, info = env.step(CLICK)
    assert (terminated, truncated, info) == (False, True, {})
    record = env.record
    assert (record["status"], record["score"]) == ("error", None)
    assert "the desktop is gone" in record["problem"]
    assert record["effects"][0]["record"]["undone"] == [
        {"ok": False, "problem": "DesktopError: the desktop is gone"}
    ]


def test_a_desktop_that_does_not_start_is_raised_and_on_record():
    env, stage = make()
    stage.fails = DesktopError("no desktop starts")
    with pytest.raises(DesktopError, match="no desktop starts"):
        env.reset(seed=3, options={"task": "write"})
    assert (env.record["status"], env.record["task"], env.record["seed"]) == ("invalid", "write", 3)
    stage.fails = None
    env.reset(seed=3)
    assert env.record is None


def test_an_evaluator_that_fails_is_no_zero():
    env, stage = make()
    env.reset(seed=0)
    stage.fails = DesktopError("the file cannot be read")
    assert env.step("DONE")[1:] == (0.0, False, True, {})
    assert (env.record["status"], env.record["score"]) == ("error", None)


@pytest.mark.parametrize("score", [float("nan"), float("inf"), 7, -1.0, "1", None])
def test_what_is_no_score_is_an_error_that_is_on_record(score, tmp_path):
    env, stage = make(log=tmp_path)
    env.reset(seed=0)
    stage.score = score
    assert env.step("DONE")[1:] == (0.0, False, True, {})
    assert (env.record["status"], env.record["score"]) == ("error", None)
    assert "which is no score from 0 to 1" in env.record["problem"]
    (episode_path,) = tmp_path.glob("episodes/*/episode.json")
    assert json.loads(episode_path.read_bytes()) == env.record


def test_a_mean_that_is_rounded_is_a_score():
    env, stage = make()
    env.reset(seed=0)
    stage.score = np.float64(1 + 2**-52)
    assert env.step("DONE")[1:4] == (1.0, True, False)
    assert (env.record["status"], env.record["score"]) == ("ok", 1.0)


@pytest.mark.parametrize("usage", [{"cost": float("nan")}, {"tokens": np.int64(3)}, {1j: 2}])
def test_usage_that_cannot_be_written_is_refused_before_an_episode_is_lost(usage, tmp_path):
    env, _ = make(log=tmp_path)
    env.reset(seed=0)
    env.record_usage({"cost": 0.5})
    with pytest.raises(ParameterError, match="usage must be JSON data"):
        env.record_usage(usage)
    env.step("DONE")
    (episode_path,) = tmp_path.glob("episodes/*/episode.json")
    assert json.loads(episode_path.read_bytes())["usage"] == {"cost": 0.5}


@register
class Numbers(Mark):
    """Gives a number of NumPy's in one place."""

    kind: ClassVar[str] = "test_numbers"

    def apply(self, guest, params):
        position = params["where"]
        return super().apply(guest, params) | {"where": position, **self.fact(position == "apply")}

    def probe(self, guest, record):
        return Probe(True, self.fact(record["where"] == "probe"))

    def undo(self, guest, record):
        super().undo(guest, record)
        return Undone(True, self.fact(record.get("where") == "undo"))

    def fact(self, is_odd):
        return {"pixels": np.int64(5) if is_odd else 5}


@pytest.mark.parametrize("where", ["apply", "probe", "undo"])
def test_an_effect_whose_facts_cannot_be_written_does_not_count_as_proved(where, tmp_path):
    env, stage = make(corruption=Marking(0, kind="test_numbers", where=where), log=tmp_path)
    env.reset(seed=0)
    env.step("DONE")
    if where == "undo":
        problem = env.record["effects"][0]["record"]["undone"][-1]["problem"]
    else:
        assert (env.record["status"], env.record["score"]) == ("invalid", None)
        problem = env.record["problem"]
    assert re.search("(record|facts) .*'test_numbers' must be JSON data", problem)
    assert "marked" not in stage.desktop.state
    (episode_path,) = tmp_path.glob("episodes/*/episode.json")
    assert json.loads(episode_path.read_bytes()) == env.record


@pytest.mark.parametrize("stop", [KeyboardInterrupt(), RuntimeError("a bug")])
def test_everything_is_put_back_whatever_happens(stop):
    env, stage = make(corruption=Marking(0))
    env.reset(seed=0)
    stage.desktop.run = lambda code: (_ for _ in ()).throw(stop)
    with pytest.raises(type(stop)):
        env.step(CLICK)
    assert stage.desktop.state == set()
    assert env.record["status"] == "error"


@pytest.mark.parametrize("how", ["close", "reset", "abandon"])
def test_an_episode_that_is_broken_off_is_put_back_and_on_record(how, tmp_path):
    env, stage = make(corruption=Marking(0), log=tmp_path)
    env.reset(seed=0)
    assert stage.desktop.state == {"marked"}
    calls = {
        "close": env.close,
        "reset": lambda: env.reset(seed=1),
        "abandon": lambda: env.abandon("the agent raised"),
    }
    calls[how]()
    first = json.loads(
        (tmp_path / "episodes" / "do-0__marking__s0__agent" / "episode.json").read_text()
    )
    assert first["status"] == "error"
    assert stage.desktop.calls.count("undo") == 1
    if how == "close":
        assert stage.desktop.closed
    env.close()
    env.close()


@pytest.mark.parametrize(("policy", "helped"), [("none", 0), ("repair", 1), ("reset", 1)])
def test_recovery_is_only_on_request(policy, helped):
    env, stage = make(corruption=Marking(0, 2), recovery=policy, max_steps=9)
    env.reset(seed=5, options={"task": "write"})
    env.step("REQUEST_REINIT")
    assert stage.desktop.state == (set() if helped else {"marked"})
    assert len(stage.resets) == (2 if policy == "reset" else 1)
    assert set(stage.resets) == {("write", 5)}
    env.step("WAIT")
    assert stage.desktop.state == {"marked"}, "what is due later still comes"
    env.step("DONE")
    assert env.record["recovery"] == {
        "policy": policy,
        "requests": 1,
        "false_alarms": 0,
        "repaired": helped,
        "free": helped,
    }
    assert stage.desktop.state == set()


@pytest.mark.parametrize("policy", ["none", "repair", "reset"])
def test_a_request_without_need_is_a_false_alarm(policy):
    env, _ = make(corruption=Marking(2), recovery=policy, max_steps=9)
    play(env, "REQUEST_REINIT", "WAIT", "REQUEST_REINIT", "REQUEST_REINIT", "DONE")
    alarms = 1 if policy == "none" else 2
    helped = int(policy != "none")
    assert env.record["recovery"] == {
        "policy": policy,
        "requests": 3,
        "false_alarms": alarms,
        "repaired": helped,
        "free": helped,
    }


@pytest.mark.parametrize(("policy", "free"), [("none", 0), ("repair", 1), ("reset", 1)])
def test_a_re_initialisation_before_the_first_action_costs_no_step(policy, free):
    env, _ = make(corruption=Marking(0), recovery=policy, max_steps=3)
    env.reset(seed=0)
    actions = ["REQUEST_REINIT", "WAIT", "REQUEST_REINIT", "WAIT", "WAIT"]
    ends = [env.step(action)[3] for action in actions[: 3 + free]]
    assert ends == [False] * (2 + free) + [True]
    record = env.record
    assert (record["steps"], record["ended"], record["recovery"]["free"]) == (3, "max_steps", free)


class TwoPartStage(FakeStage):
    """A stage that says in which order things happen to its desktop."""

    splits_setup = True

    def choose(self, task, seed):
        return Setting("do-0", "Open the file", ("files",))

    def reset_around(self, task, seed, cut_network):
        self.desktop.calls.append("revert")
        self.desktop.reset()
        cut_network()
        self.desktop.calls.append("set up")
        if self.fails:
            raise self.fails
        return self.choose(task, seed)

    def reset(self, task, seed):
        return self.reset_around(task, seed, lambda: None)


@register
class Outage(Mark):
    """An error of the environment."""

    kind: ClassVar[str] = "test_outage"
    before_setup: ClassVar[bool] = True


@pytest.mark.parametrize("order", ["before_setup", "after_setup"])
@pytest.mark.parametrize("whole", [False, True])
def test_an_error_of_the_environment_comes_before_the_task_is_set_up(order, whole):
    stage = FakeStage() if whole else TwoPartStage()
    env, _ = make(stage, corruption=Marking(-1, kind="test_outage"), environment_errors=order)
    env.reset(seed=0)
    calls = [
        call for call in stage.desktop.calls if call == "apply" or "re" in call or "up" in call
    ]
    first = order == "before_setup" and not whole
    if first:
        assert calls[:3] == ["revert", "apply", "set up"]
    elif not whole:
        assert calls[:3] == ["revert", "set up", "apply"]
    env.step("DONE")
    assert env.record["environment_errors"] == ("before_setup" if first else "after_setup")
    assert env.record["status"] == "ok"
    env.reset(seed=0, options={"corruption": None})
    env.step("DONE")
    assert env.record["environment_errors"] is None


def test_a_set_up_that_the_cut_breaks_is_the_machine_s_failure():
    stage = TwoPartStage()
    stage.fails = DesktopError("no page")
    env, _ = make(stage, corruption=Marking(-1, kind="test_outage"))
    with pytest.raises(DesktopError, match="no page"):
        env.reset(seed=0)
    assert (env.record["status"], env.record["environment_errors"]) == ("invalid", "before_setup")
    assert stage.desktop.state == set()


class Later(hj.Planner):
    """A planner of somebody else: what its part would do, one step later."""

    def __init__(self, part):
        self.part = part

    @property
    def parts(self):
        return (self.part,)

    def plan(self, scene, *, step=None, **key):
        return self.part.plan(scene, step=(step or 0) - 1, **key)


def test_a_planner_of_somebody_else_disturbs_an_episode():
    env, stage = make(corruption=Later(Marking(1)), max_steps=9)
    play(env, "WAIT", "WAIT", "WAIT", "DONE")
    assert stage.desktop.calls.count("apply") == 1
    (effect,) = env.record["effects"]
    assert (effect["step"], env.record["corruption"]) == (2, "later")


def test_what_only_looks_like_a_planner_is_refused():
    class Lookalike:
        def plan(self, scene, **key):
            return hj.Plan.clean(scene.size)

    with pytest.raises(ParameterTypeError, match=r"Lookalike must inherit from hijack_data\.Plan"):
        make(corruption=Lookalike())


def test_what_the_desktop_lacks_is_refused_before_anything_is_done():
    env, stage = make(FakeStage(FakeDesktop(capabilities=frozenset({"apps"}))))
    with pytest.raises(
        MissingCapabilityError, match="network_error needs firewall, which this desktop lacks"
    ):
        env.reset(seed=0, options={"corruption": "network_error"})
    sequence = hj.Sequence([hj.NetworkError(), hj.AppMinimization(step=Every(3))])
    with pytest.raises(MissingCapabilityError, match="needs firewall, windows"):
        env.reset(seed=0, options={"corruption": sequence})
    assert "apply" not in stage.desktop.calls
    env.reset(seed=0, options={"corruption": hj.AppMinimization(step=99)})  # not within the episode


def test_a_tool_that_is_missing_is_the_callers_to_know_at_first_and_invalid_later():
    for step in (-1, 0):
        env, _ = make(corruption=Marking(step, raises="missing", says="no nft"))
        with pytest.raises(MissingCapabilityError, match="no nft"):
            env.reset(seed=0)
    env, _ = make(corruption=Marking(1, raises="missing", says="no nft"))
    play(env, "WAIT")
    assert (env.record["status"], env.record["problem"]) == ("invalid", "no nft")


def test_the_screen_may_not_change_its_size():
    env, stage = make()
    env.reset(seed=0)
    stage.desktop.size = (100, 100)
    env.step(CLICK)
    assert "100x100 now" in env.record["problem"]
