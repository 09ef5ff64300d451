"""Several effects in one episode, on a desktop that is none: their order, and what is undone when."""

import json
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data import plugin
from hijack_data.corruption import CORRUPTIONS
from hijack_data.errors import ParameterError
from hijack_data.plan import Effect, Plan
from hijack_data.planner import Planner
from hijack_data.types import Scene
from online_env.effects import LiveEffect, Probe, Undone, register
from online_env.errors import DesktopError
from pipelines.proof.rebuild import rebuild

from support.episodes import CLICK, make, play

pytestmark = pytest.mark.usefixtures("no_waiting")


@register
class Layer(LiveEffect):
    """Puts a name on the desktop; what it does, it notes among the desktop's calls."""

    kind: ClassVar[str] = "test_layer"

    def apply(self, guest, params):
        guest.desktop.calls.append(f"apply {params['name']}")
        if params.get("breaks"):
            raise DesktopError("it broke off")
        guest.desktop.state.add(params["name"])
        return {"name": params["name"], "stays": params.get("stays", 0), "tries": 0}

    def probe(self, guest, record):
        is_there = record["name"] in guest.desktop.state
        return Probe(is_there, {}, "" if is_there else f"no {record['name']} is there")

    def undo(self, guest, record):
        name = record.get("name", "whatever is there")
        guest.desktop.calls.append(f"undo {name}")
        if not record:
            guest.desktop.state.clear()
            return Undone(True)
        record["tries"] += 1
        if record["tries"] <= record["stays"]:
            return Undone(False, {}, f"{name} stays")
        guest.desktop.state.discard(name)
        return Undone(True)

    def refresh(self, guest, record):
        guest.desktop.calls.append(f"refresh {record['name']}")


@register
class Knock(Layer):
    """As `Layer`, but an event: there is nothing left of it, and nothing to undo."""

    kind: ClassVar[str] = "test_knock"
    lasting: ClassVar[bool] = False

    def undo(self, guest, record):
        guest.desktop.calls.append("undo a knock")
        guest.desktop.state.discard(record.get("name"))
        return Undone(True)


@dataclass(frozen=True)
class Layers(Planner):
    """Effects by the step at which they are due."""

    due: dict[int, tuple[Effect, ...]]
    needs_elements: ClassVar[bool] = False

    def plan(
        self,
        scene: Scene,
        *,
        seed: int,
        sample: object = 0,
        step: int | None = None,
        epoch: int = 0,
    ) -> Plan:
        effects = self.due.get(0 if step is None else step, ())
        return Plan("layers-v1", scene.size, {}, (), effects)


def layer(name: str, kind: str = "test_layer", **params: Any) -> Effect:
    return Effect(kind, {"name": name, **params})


def noted(stage: Any, word: str) -> list[str]:
    """Return what the effects noted that begins with a word."""
    return [call for call in stage.desktop.calls if call.startswith(f"{word} ")]


def test_effects_are_undone_the_latest_first() -> None:
    due = {0: (layer("a"), layer("b")), 1: (layer("c"),)}
    env, stage = make(corruption=Layers(due))
    play(env, CLICK, "DONE")
    assert noted(stage, "apply") == ["apply a", "apply b", "apply c"]
    assert noted(stage, "undo") == ["undo c", "undo b", "undo a"]
    assert (env.record["status"], stage.desktop.state) == ("ok", set())
    assert [effect["step"] for effect in env.record["effects"]] == [0, 0, 1]


def test_what_was_repaired_is_neither_refreshed_nor_undone_again() -> None:
    env, stage = make(corruption=Layers({0: (layer("a"), layer("b"))}), recovery="repair")
    play(env, "WAIT", "REQUEST_REINIT", "WAIT", "DONE")
    assert noted(stage, "undo") == ["undo b", "undo a"]
    assert noted(stage, "refresh") == ["refresh a", "refresh b"]  # before the second observation
    assert env.record["recovery"]["repaired"] == 1


def test_an_effect_that_stays_when_it_is_repaired_is_undone_at_the_end() -> None:
    env, stage = make(corruption=Layers({0: (layer("a", stays=1),)}), recovery="repair")
    play(env, "REQUEST_REINIT", "DONE")
    assert env.record["recovery"]["repaired"] == 0
    assert noted(stage, "undo") == ["undo a", "undo a"]
    undone = env.record["effects"][0]["record"]["undone"]
    assert [(entry["ok"], entry["problem"]) for entry in undone] == [(False, "a stays"), (True, "")]
    assert stage.desktop.state == set()


def test_an_effect_that_cannot_be_undone_keeps_no_other_from_it() -> None:
    env, stage = make(corruption=Layers({0: (layer("a"), layer("b", stays=9))}))
    play(env, "DONE")
    assert stage.desktop.state == {"b"}
    assert env.record["status"] == "ok"  # the agent was judged before
    first, second = (effect["record"]["undone"] for effect in env.record["effects"])
    assert (first[-1]["ok"], second[-1]["problem"]) == (True, "b stays")


def test_the_record_says_which_effects_the_agent_left_in_place() -> None:
    due = {0: (layer("a"), layer("b"), layer("c", "test_knock"))}
    env, stage = make(corruption=Layers(due))
    env.reset(seed=0)
    stage.desktop.state.discard("b")  # as an agent may close a window
    env.step("DONE")
    assert [effect.get("held_at_end") for effect in env.record["effects"]] == [True, False, None]
    env, _ = make(corruption=Layers(due), recovery="repair")
    play(env, "REQUEST_REINIT", "DONE")  # the policy ended them, not the agent
    assert not any("held_at_end" in effect for effect in env.record["effects"])


def test_an_event_is_over_once_it_was_proved() -> None:
    env, stage = make(corruption=Layers({0: (layer("a", "test_knock"),)}), recovery="repair")
    env.reset(seed=0)
    stage.desktop.state.clear()  # as whatever the click opened may be closed
    env.step("REQUEST_REINIT")
    env.step("DONE")
    assert env.record["status"] == "ok"
    assert env.record["recovery"] == {
        "policy": "repair",
        "requests": 1,
        "false_alarms": 0,
        "repaired": 0,  # nobody can take a click back
        "free": 1,
    }


def test_an_effect_that_breaks_off_is_put_back_without_its_record() -> None:
    env, stage = make(corruption=Layers({0: (layer("a"), layer("b", breaks=True), layer("c"))}))
    env.reset(seed=0)
    assert env.record["status"] == "invalid"
    assert env.record["problem"] == "test_layer at step 0: DesktopError: it broke off"
    assert noted(stage, "apply") == ["apply a", "apply b"]  # and no further
    assert noted(stage, "undo") == ["undo a", "undo whatever is there"]
    assert stage.desktop.state == set()


def test_on_a_fresh_desktop_the_effect_is_tried_and_put_back(monkeypatch) -> None:
    due = {0: (layer("a"),), 1: (layer("b"),)}
    env, stage = make(corruption=Layers(due))
    env.reset(seed=0)
    applied = Layer.apply

    def hindered(self, guest, params):
        """The agent's code keeps `b` off this desktop, until that is reset."""
        record = applied(self, guest, params)
        if len(stage.resets) == 1 and params["name"] == "b":
            guest.desktop.state.discard("b")
        return record

    monkeypatch.setattr(Layer, "apply", hindered)
    env.step(CLICK)
    record = env.record
    assert (record["status"], record["cause"]) == ("error", "agent")
    assert record["problem"] == (
        "test_layer at step 1: no b is there; on a fresh desktop it holds, so this is what the "
        "agent's actions led to"
    )
    assert noted(stage, "undo") == ["undo b", "undo a", "undo b"]
    assert stage.resets == [(None, 0)] * 2
    assert stage.desktop.state == set()
    # What was tried there is no part of the episode.
    assert [effect["step"] for effect in record["effects"]] == [0, 1]


def test_an_effect_lasts_as_long_as_it_says(monkeypatch) -> None:
    due = {0: (layer("a", lasts={"steps": 2}), layer("b", lasts={"seconds": 60}))}
    env, stage = make(corruption=Layers(due))
    env.reset(seed=0)
    env.step("WAIT")
    assert stage.desktop.state == {"a", "b"}  # observations 0 and 1 show both
    env.step("WAIT")
    assert stage.desktop.state == {"b"}
    monkeypatch.setattr("online_env.effects.base.time.time", lambda: 2e10)
    env.step("WAIT")
    assert (stage.desktop.state, noted(stage, "undo")) == (set(), ["undo a", "undo b"])
    env.step("DONE")
    assert noted(stage, "undo") == ["undo a", "undo b"]  # each once


@pytest.mark.parametrize(("action", "status"), [("WAIT", "invalid"), (CLICK, "error")])
def test_an_effect_that_lasts_longer_than_planned_is_not_scored(action, status) -> None:
    due = {0: (layer("a", lasts={"steps": 1}, stays=1),)}
    env, stage = make(corruption=Layers(due))
    play(env, action, "DONE")
    assert (env.record["status"], env.record["score"]) == (status, None)
    assert "test_layer of step 0 is over, and cannot be undone: a stays" in env.record["problem"]
    assert (stage.desktop.state, noted(stage, "undo")) == (set(), ["undo a", "undo a"])


def test_an_effect_begins_at_its_second_and_the_log_shows_when(monkeypatch, tmp_path) -> None:
    clock = SimpleNamespace(monotonic=lambda: clock.now, now=0.0)
    monkeypatch.setattr("online_env.environment.live_effects.time", clock)
    monkeypatch.setattr(CORRUPTIONS, "entries", dict(CORRUPTIONS.entries))

    @plugin.register
    @dataclass(frozen=True)
    class LateLayer(plugin.Corruption):
        """A layer at step 2, and one that comes after 20 s and is gone after an observation."""

        name: ClassVar[str] = "late_layer"
        category: ClassVar[Any] = "environment_error"
        scope: ClassVar[Any] = "state"
        effects: ClassVar[tuple[str, ...]] = ("test_layer",)

        def make_plan(self, scene: Scene, stream: plugin.Stream, step: int) -> plugin.Draft:
            late = layer("late", begins={"seconds": 20}, lasts={"steps": 1})
            effects = {0: (late,), 2: (layer("b"),)}
            return plugin.Draft(effects=effects.get(step, ()))

    env, stage = make(corruption=LateLayer(), log=tmp_path)
    env.reset(seed=0)
    env.step("WAIT")
    assert stage.desktop.state == set()
    clock.now = 20.0
    env.step("WAIT")
    assert stage.desktop.state == {"late", "b"}
    env.step("WAIT")
    assert stage.desktop.state == {"b"}
    env.step("DONE")
    assert [effect["step"] for effect in env.record["effects"]] == [2, 2]
    assert noted(stage, "apply") == ["apply late", "apply b"]
    assert rebuild(tmp_path).problems == []
    path = next(tmp_path.glob("episodes/*/episode.json"))
    record = json.loads(path.read_text())
    record["effects"][0]["step"] = 0
    path.write_text(json.dumps(record))
    problems = " ".join(rebuild(tmp_path).problems)
    assert "effects are not what was due" in problems, "it cannot begin with its own step"


@pytest.mark.parametrize(
    ("step", "times", "words"),
    [
        (5, {"lasts": {"step": 3}}, r'lasts of an effect is {"steps": 1 to 10000}'),
        (5, {"begins": {"steps": 3}}, r'begins of an effect is {"seconds": more than 0'),
        (5, {"begins": {"seconds": 0}}, r'begins of an effect is {"seconds": more than 0'),
        (-1, {"begins": {"seconds": 9}}, "begins at a second is planned at step 0 or later"),
    ],
)
def test_wrong_times_are_refused_before_the_episode(step, times, words) -> None:
    env, stage = make(corruption=Layers({step: (layer("a", **times),)}))
    with pytest.raises(ParameterError, match=f"layers: test_layer: .*{words}"):
        env.reset(seed=0)
    assert (env.record, noted(stage, "apply")) == (None, [])
