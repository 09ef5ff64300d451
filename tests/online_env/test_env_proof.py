"""Who is to blame: an effect that is not there, that vanishes, or that breaks; and what each of
them scores.

An effect stays proved while the picture is taken. Before the agent's first action a failure is the
machine's. After it the same effect is tried on a fresh desktop: what holds there was prevented by
the agent, and scores 0.
"""

import json
from collections import Counter

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import hijack_data as hj
from online_env.bench.episodes import play as play_job
from online_env.bench.jobs import Job
from online_env.bench.runner import run_jobs
from online_env.effects import Probe, base
from online_env.effects.guest import Guest
from online_env.effects.network_error import Firewall
from online_env.errors import DesktopError
from online_env.results.records import create as create_run
from online_env.results.records import read
from online_env.results.scores import rows
from pipelines.proof.rebuild import rebuild

from support.episodes import CLICK, make, play
from support.live import FakeStage, Fence, Mark, Marking

pytestmark = pytest.mark.usefixtures("no_waiting")
HIDDEN = "on a fresh desktop it holds"
# When it is lifted; at a screenshot it was proved already, and nobody has seen it yet.
EARLY = {"before the probe": "probe", "between probe and observation": "screenshot"}


def lift(desktop):
    """What takes the effect away from now on, whenever something looks."""
    return lambda: desktop.state.discard("marked")


@pytest.mark.parametrize("when", EARLY)
@pytest.mark.parametrize("step", [-1, 0])
def test_what_is_gone_before_the_agent_acts_is_the_machines_failure(when, step):
    env, stage = make(corruption=Marking(step))
    stage.desktop.faulty = True
    stage.desktop.on[EARLY[when]] = lift(stage.desktop)
    env.reset(seed=0)
    assert (env.record["status"], env.record["score"]) == ("invalid", None)
    assert HIDDEN not in env.record["problem"]


@pytest.mark.parametrize("when", EARLY)
@pytest.mark.parametrize(
    ("action", "faulty", "status"),
    [
        (CLICK, False, "error"),
        (CLICK, True, "invalid"),
        ("WAIT", False, "invalid"),
        ("nonsense", False, "invalid"),
    ],
)
def test_what_is_gone_later_is_the_agents_doing_unless_a_fresh_desktop_shows_the_same(
    when, action, faulty, status
):
    env, stage = make(corruption=Marking(1))
    env.reset(seed=4, options={"task": "write"})
    stage.desktop.faulty = faulty
    stage.desktop.on[EARLY[when]] = lift(stage.desktop)
    assert env.step(action)[1:] == (0.0, False, True, {})
    assert (env.record["status"], env.record["score"]) == (status, None)
    assert "nothing is marked" in env.record["problem"]
    assert (HIDDEN in env.record["problem"]) == (status == "error")
    assert ("before the agent saw it" in env.record["problem"]) == (when != "before the probe")
    expected_writes = [("write", 4)] * (2 if action == CLICK else 1)
    assert stage.resets == expected_writes, "the control has the same task"
    assert stage.desktop.state == set()
    applied = 1 if when == "before the probe" else 2  # what was gone is applied once more
    assert len(env.record["effects"]) == applied, "the control is no part of the episode"
    (row,) = rows([env.record])
    assert (row["n"], row["success"]) == ((1, 0.0) if status == "error" else (0, None))


@pytest.mark.parametrize("step", [-1, 0, 1])
def test_what_comes_late_once_is_covered_by_applying_the_effect_again(step):
    """Such as a dialog that opens after the windows were minimised."""
    env, stage = make(corruption=Marking(step))
    lifted: list[bool] = []

    def lift_once():
        if "marked" in stage.desktop.state and not lifted:
            lifted.append(True)
            stage.desktop.state.clear()

    if step == 1:
        env.reset(seed=0)
    stage.desktop.faulty = True
    stage.desktop.on["screenshot"] = lift_once
    if step == 1:
        env.step(CLICK)
    else:
        env.reset(seed=0)
    assert "marked" in stage.desktop.state
    env.step("DONE")
    assert env.record["status"] == "ok"
    first, second = (effect["record"] for effect in env.record["effects"])
    assert [probe["ok"] for probe in first["probes"]] == [True, False]
    assert first["undone"]
    assert [probe["ok"] for probe in second["probes"]] == [True, True]


@pytest.mark.parametrize("answers", [True, False])
@pytest.mark.parametrize("step", [-1, 0])
def test_a_run_whose_effect_was_applied_once_more_verifies(step, answers, tmp_path):
    """`hijack verify` found an effect that was not due."""
    stage = FakeStage()
    stage.desktop.effects = {"lock": Mark()}
    stage.desktop.faulty = True
    env, _ = make(stage, corruption=hj.Verification(step=step), log=tmp_path)

    def fail_once():
        if stage.desktop.calls.count("probe") == 2:  # the one after the picture
            stage.desktop.state.clear()
            if not answers:
                raise DesktopError("no answer")

    stage.desktop.on["probe"] = fail_once
    play(env, "DONE")
    assert (env.record["status"], len(env.record["effects"])) == ("ok", 2)
    assert rebuild(tmp_path).problems == []
    path = next(tmp_path.glob("episodes/*/episode.json"))
    record = json.loads(path.read_text())
    record["effects"][0]["record"]["probes"][-1]["ok"] = True
    path.write_text(json.dumps(record))
    problems = " ".join(rebuild(tmp_path).problems)
    assert "effects are not what was due: lock at step" in problems, "nothing was gone"


@pytest.mark.parametrize("policy", ["none", "repair"])
def test_what_the_agent_lifts_once_it_has_seen_it_is_its_good_right(policy):
    env, stage = make(corruption=Marking(0), recovery=policy)
    env.reset(seed=0)
    stage.desktop.state.clear()
    assert env.step("DONE")[1] == 1.0
    assert (env.record["status"], len(stage.resets)) == ("ok", 1)
    assert [probe["ok"] for probe in env.record["effects"][0]["record"]["probes"]] == [True, True]


def test_what_no_agent_can_lift_is_proved_again_at_the_end():
    env, stage = make(corruption=Marking(0, kind="test_fence"))
    play(env, CLICK, "DONE")
    assert env.record["status"] == "ok"
    assert [probe["ok"] for probe in env.record["effects"][0]["record"]["probes"]] == [True, True]
    env.reset(seed=0)
    env.step(CLICK)
    stage.desktop.state.clear()
    stage.history = None
    assert env.step("DONE")[1:] == (0.0, False, True, {})
    assert (env.record["status"], stage.history) == ("invalid", None)
    assert "no agent can lift, was gone at the end" in env.record["problem"]


def test_what_was_repaired_on_request_is_not_looked_for_at_the_end():
    env, _ = make(corruption=Marking(0, kind="test_fence"), recovery="repair")
    play(env, "REQUEST_REINIT", "DONE")
    assert env.record["status"] == "ok"


def test_of_effects_that_come_at_once_a_later_one_may_hide_an_earlier_one(monkeypatch):
    class Covering(Fence):
        """Covers what was marked."""

        def apply(self, guest, params):
            guest.desktop.state.discard("marked")
            return {}

        def probe(self, guest, record):
            return Probe("marked" not in guest.desktop.state, {}, "not covered")

        def can_be_lifted(self, guest):
            return True

    monkeypatch.setitem(base.EFFECTS.entries, "test_fence", Covering())
    env, _ = make(corruption=hj.Sequence([Marking(0), Marking(0, kind="test_fence")]))
    play(env, "DONE")
    assert env.record["status"] == "ok"
    assert all(
        probe["ok"] for effect in env.record["effects"] for probe in effect["record"]["probes"]
    )


def test_only_rules_on_this_machine_are_out_of_an_agents_reach(tmp_path):
    class Ours:
        namespace = tmp_path

    assert not Firewall().can_be_lifted(Guest(Ours(), "", None))
    assert Firewall().can_be_lifted(Guest(object(), "", None))
    assert Mark().can_be_lifted(Guest(object(), "", None))


# What breaks is an episode with a status and a reason, never the end of a run.


class Clicker:
    """An agent that clicks once."""

    def reset(self):
        self.answers = [CLICK, "DONE"]

    def predict(self, instruction, obs):
        return "", [self.answers.pop(0)]


def fail(how):
    def run():
        raise how

    return run


BREAKS = [KeyError("bug"), DesktopError("not answered"), OSError("no route"), RecursionError()]


# An effect, perhaps a plug-in, may raise anything; a desktop a `DesktopError`.
FAULTS = [
    *((where, how) for where in ("apply", "probe", "refresh", "undo") for how in BREAKS),
    *((where, BREAKS[1]) for where in ("screenshot", "run")),
]


@pytest.mark.parametrize(("where", "how"), FAULTS)
@pytest.mark.parametrize("step", [0, 1])
def test_whatever_breaks_ends_one_episode_and_never_the_run(tmp_path, how, where, step):
    env, stage = make(corruption=Marking(step))
    stage.desktop.faulty = True
    stage.desktop.on[where] = fail(how)
    jobs = [Job("a", "write_note", "marking", 0), Job("a", "write_note", "marking", 1)]
    create_run(tmp_path / "run", {})
    counts = Counter()

    def episode(job, attempt):
        counts[job] += 1
        return play_job(env, Clicker(), job, attempt, Marking(step))

    run_jobs(jobs, tmp_path / "run", 0, episode, Silent())
    records = read(tmp_path / "run").records
    assert [record["seed"] for record in records] == [0, 1]
    for record in records:
        assert (record["status"] == "ok") == (where == "undo"), record
        assert record["problem"] or where == "undo"


class Silent:
    def begins(self, job, number, attempt): ...

    def ended(self, job, number, record): ...


@pytest.mark.parametrize("how", BREAKS, ids=lambda how: type(how).__name__)
def test_an_evaluator_that_what_the_agent_left_breaks_is_an_error(how):
    env, stage = make()
    env.reset(seed=0)
    stage.fails = how
    assert env.step("DONE")[1:] == (0.0, False, True, {})
    assert env.record["status"] == "error"
    assert type(how).__name__ in env.record["problem"]


@pytest.mark.parametrize(("action", "counted"), [(CLICK, 1), ("WAIT", 0)])
def test_a_desktop_that_ends_counts_against_an_agent_that_had_it_in_its_hands(action, counted):
    env, stage = make()
    env.reset(seed=0)
    env.step(action)
    stage.desktop.dead = True
    env.step("DONE")
    assert env.record["status"] == ("error" if counted else "invalid")
    (row,) = rows([env.record | {"attempt": 1}])  # it is run again once before it counts
    assert (row["n"], row["success"]) == ((1, 0.0) if counted else (0, None))


def test_what_each_status_scores():
    base = {"agent": "a", "task": "t", "corruption": "c", "task_seed": 0}
    items = [
        {"status": "ok", "score": 1.0},
        {"status": "error", "score": None},
        {"status": "invalid", "score": None},
    ]
    (row,) = rows([{**base, "seed": seed, **value} for seed, value in enumerate(items)])
    assert (row["n"], row["success"], row["errors"], row["invalid"]) == (2, 0.5, 1, 1)
