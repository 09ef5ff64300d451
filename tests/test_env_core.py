"""`CorruptedEnv` on a desktop that is none: the order of events, validity, recovery, spaces, what is refused."""

import gc
import json
import os
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import gymnasium

import hijack_data as hj
from hijack_data.errors import HijackError, ParameterError, ParameterTypeError, UnknownNameError
from hijack_data.params import Every
from online_env.desktops.protocol import RunResult
from online_env.env import CorruptedEnv, Settle
from online_env.env.log import slug_of
from online_env.errors import DesktopError, GuestError, MissingCapabilityError

from support.live import AT_ONCE, SIZE, FakeDesktop, FakeStage, Marking
from support.walker import found

CLICK = "pyautogui.click(10, 20)"


def make(stage=None, **options):
    stage = stage or FakeStage()
    return CorruptedEnv(stage, settle=AT_ONCE, **options), stage


def play(env, *actions, seed=0, **options):
    """An episode of these actions; returns what each step gave."""
    env.reset(seed=seed, options=options)
    return [env.step(action) for action in actions]


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch):
    monkeypatch.setattr("online_env.env.episode.WAIT", 0.0)


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
    assert (record["status"], record["score"], record["reason"], record["steps"]) == ("ok", 0.5, "as wanted", 2)
    assert (record["task"], record["sample"], record["task_seed"], record["seed"]) == ("do-7", "do-7", 7, 7)
    assert (record["corruption"], record["params"], record["effects"]) == ("clean", {}, [])
    assert record["id"] == "do-7__clean__s7__agent"
    assert stage.desktop.ran == [f"\n{CLICK}"]
    assert json.loads(json.dumps(record)) == record


def test_the_step_limit_truncates_and_still_evaluates():
    env, _ = make(max_steps=2)
    one, two = play(env, "WAIT", "WAIT")
    assert (one[1:4], two[1:4]) == ((0.0, False, False), (1.0, False, True))
    assert env.record["status"] == "ok"


def test_after_the_end_nothing_happens_any_more():
    env, stage = make()
    *_, last = play(env, "DONE")
    again = env.step(CLICK)
    assert again[1:] == (0.0, False, True, {})
    assert np.array_equal(again[0]["screenshot"], last[0]["screenshot"])
    assert again[0]["screenshot"] is not last[0]["screenshot"]
    assert stage.desktop.ran == []


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


@pytest.mark.parametrize("action", ["import os", "I click it", "", 5, None, "pyautogui.click(unknown, 2)"])
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
    # before the first observation; then look, and look again where something was done
    assert [c for c in stage.desktop.calls if c != "screenshot"] == ["apply", "probe", "refresh"]
    stage.desktop.calls.clear()
    env.step(CLICK)
    assert [c for c in stage.desktop.calls if c != "screenshot"] == ["run", "refresh", "apply", "probe"]
    run, screen = stage.desktop.calls.index("run"), stage.desktop.calls.index("screenshot")
    assert run < screen < stage.desktop.calls.index("apply")
    assert stage.desktop.calls[-1] == "screenshot"
    stage.desktop.calls.clear()
    env.step("DONE")
    # Judged as the agent left it, then put back, the last first.
    assert stage.state_at_evaluation == {"marked"}
    assert [c for c in stage.desktop.calls if c in ("run", "apply", "undo")] == ["undo", "undo"]
    assert stage.desktop.state == set()
    assert [event["step"] for event in env.record["effects"]] == [-1, 1]


def test_the_tree_is_read_only_for_corruptions_that_place_things():
    for corruption, wanted in ((None, False), ("subtitle", False), (hj.PopUps(width=400, height=250), True)):
        env, stage = make(FakeStage(FakeDesktop((720, 1280))), corruption=corruption)
        env.reset(seed=0)
        assert ("tree" in stage.desktop.calls) == wanted
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


@pytest.mark.parametrize("step", [-1, 0, 2])
@pytest.mark.parametrize(
    "params", [{"sabotaged": True}, {"raises": "effect", "says": "no room"}, {"raises": "desktop", "says": "no answer"}]
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
    assert record["effects"][0]["record"]["undone"] == [{"ok": False, "problem": "DesktopError: the desktop is gone"}]


def test_a_desktop_that_does_not_start_is_raised_and_on_record():
    env, stage = make()
    stage.fails = DesktopError("no desktop starts")
    with pytest.raises(DesktopError, match="no desktop starts"):
        env.reset(seed=3, options={"task": "write"})
    assert (env.record["status"], env.record["task"], env.record["seed"]) == ("error", "write", 3)
    stage.fails = None
    env.reset(seed=3)
    assert env.record is None


def test_an_evaluator_that_fails_is_no_zero():
    env, stage = make()
    env.reset(seed=0)
    stage.fails = DesktopError("the file cannot be read")
    assert env.step("DONE")[1:] == (0.0, False, True, {})
    assert (env.record["status"], env.record["score"]) == ("error", None)


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
    calls = {"close": env.close, "reset": lambda: env.reset(seed=1), "abandon": lambda: env.abandon("the agent raised")}
    calls[how]()
    first = json.loads((tmp_path / "episodes" / "do-0__marking__s0__agent" / "episode.json").read_text())
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
    assert env.record["recovery"] == {"policy": policy, "requests": 1, "false_alarms": 0, "repaired": helped}
    assert stage.desktop.state == set()


@pytest.mark.parametrize("policy", ["none", "repair", "reset"])
def test_a_request_without_need_is_a_false_alarm(policy):
    env, _ = make(corruption=Marking(2), recovery=policy, max_steps=9)
    play(env, "REQUEST_REINIT", "WAIT", "REQUEST_REINIT", "REQUEST_REINIT", "DONE")
    alarms = 1 if policy == "none" else 2
    helped = int(policy != "none")
    assert env.record["recovery"] == {
        "policy": policy, "requests": 3, "false_alarms": alarms, "repaired": helped,
    }  # fmt: skip


def test_what_the_desktop_lacks_is_refused_before_anything_is_done():
    env, stage = make(FakeStage(FakeDesktop(capabilities=frozenset({"apps"}))))
    with pytest.raises(MissingCapabilityError, match="network_error needs firewall, which this desktop has not"):
        env.reset(seed=0, options={"corruption": "network_error"})
    both = hj.Sequence([hj.NetworkError(), hj.AppMinimization(step=Every(3))])
    with pytest.raises(MissingCapabilityError, match="needs firewall, windows"):
        env.reset(seed=0, options={"corruption": both})
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


def test_the_space_follows_the_corruption():
    env, _ = make()
    for corruption, size in (("resolution", (180, 320)), (None, SIZE), (hj.Resolution(scale=0.5, restore=True), SIZE)):
        obs, _ = env.reset(seed=0, options={"corruption": corruption})
        assert obs["screenshot"].shape == (*size, 3)
        assert obs in env.observation_space
        assert env.action_space.size == size
    assert CorruptedEnv(FakeStage(), corruption="resolution").observation_space["screenshot"].shape == (180, 320, 3)


def test_pictures_of_several_sizes_in_one_episode_are_refused():
    env, _ = make(corruption=hj.OneOf([hj.Resolution(scale=0.5), hj.Resolution(scale=0.25)]))
    with pytest.raises(ParameterError, match=r"2 sizes .*restore=True"):
        env.reset(seed=0)


def test_samples_are_actions():
    env, _ = make(corruption=hj.Resolution(scale=0.5), max_steps=40)
    env.action_space.seed(1)
    actions = [env.action_space.sample() for _ in range(30)]
    assert all(action in env.action_space for action in actions)
    assert {"WAIT"} < set(actions)
    play(env, *actions, "DONE")
    assert env.record["malformed"] == 0


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"corruption": "subtitel"}, UnknownNameError, "did you mean 'subtitle'"),
        ({"corruption": hj.Subtitle}, ParameterTypeError, "a name or an object"),
        ({"corruption": 5}, ParameterTypeError, "got 5"),
        ({"corrupton": "subtitle"}, UnknownNameError, "did you mean 'corruption'"),
        ({"corruption": hj.Subtitle(font_size=400)}, ParameterError, "does not fit"),
        ({"label": ""}, ParameterTypeError, "label must be a text"),
        ({"attempt": -1}, ParameterTypeError, "attempt must be an integer"),
    ],
)
def test_mistakes_are_refused_with_the_fix(options, error, words):
    env, stage = make()
    with pytest.raises(error, match=words):
        env.reset(seed=0, options=options)
    assert stage.desktop.ran == []


@pytest.mark.parametrize("seed", [-1, 2**64, 1.5, True, "x"])
def test_wrong_seeds_are_refused(seed):
    env, stage = make()
    with pytest.raises(HijackError, match="seed must be"):
        env.reset(seed=seed)
    assert stage.resets == []


def test_wrong_settings_are_refused():
    for wrong, words in (
        ({"max_steps": 0}, "at least 1"), ({"max_steps": True}, "at least 1"), ({"recovery": "repiar"}, "'repair'"),
        ({"render_mode": "human"}, "rgb_array"), ({"corruption": "sub"}, "unknown corruption"),
    ):  # fmt: skip
        with pytest.raises(HijackError, match=words):
            CorruptedEnv(FakeStage(), **wrong)
    with pytest.raises(ParameterError, match="quiet"):
        Settle(quiet=-1)
    with pytest.raises(HijackError, match="call reset first"):
        CorruptedEnv(FakeStage()).step("WAIT")


def test_labels_name_what_happens():
    env, _ = make()
    cases = [
        (None, {}, "clean", {}),
        ("clean", {}, "clean", {}),
        (hj.Marks(number=2), {}, "marks", hj.Marks(number=2).params()),
        (hj.Marks(number=2), {"label": "marks@1"}, "marks@1", hj.Marks(number=2).params()),
        (hj.Sequence([hj.Marks(), hj.Resolution()]), {}, "marks+resolution",
         {"marks-v1": hj.Marks().params(), "resolution-v1": hj.Resolution().params()}),
    ]  # fmt: skip
    for corruption, more, label, params in cases:
        play(env, "DONE", corruption=corruption, **more)
        assert (env.record["corruption"], env.record["params"]) == (label, json.loads(json.dumps(params)))
    assert slug_of("a b/ü", "marks@1", 3, "m:7", 2) == "a_b___marks_1__s3__m_7__a2"
    assert len({slug_of("x" * n, "clean", 0, "a", 0) for n in (300, 301)}) == 2
    assert len(slug_of("x" * 300, "clean", 0, "a", 0)) == 200


def test_the_screen_may_not_change_its_size():
    env, stage = make()
    env.reset(seed=0)
    stage.desktop.size = (100, 100)
    env.step(CLICK)
    assert "100x100 now" in env.record["problem"]


def test_observations_belong_to_the_agent():
    env, _ = make()
    env.render_mode = "rgb_array"
    obs, _ = env.reset(seed=0)
    obs["screenshot"][:] = 0
    assert env.render().any()
    later = env.step("WAIT")[0]["screenshot"]
    assert later.any()
    assert not np.shares_memory(later, obs["screenshot"])


def test_a_seed_is_drawn_where_none_is_given():
    env, stage = make()
    env.reset(seed=4)
    env.reset()
    env.reset()
    env.reset(seed=4)
    env.reset()
    env.reset(seed=np.int64(4))
    env.abandon("enough")
    assert env.record["seed"] == 4
    seeds = [seed for _, seed in stage.resets]
    assert seeds[0] == seeds[3] == 4
    assert seeds[1] == seeds[4] != seeds[2]


SECRETS = ("sesame", "marking", "test_mark", "marked")


def test_an_agent_that_walks_all_it_is_given_finds_nothing(tmp_path):
    secret = hj.Subtitle(subtitle_text="sesame", font_size=12)
    for corruption, words in ((secret, ("sesame", "subtitle")), (Marking(0), SECRETS)):
        gymnasium.register("Walked-v0", entry_point=lambda **kw: CorruptedEnv(FakeStage(), settle=AT_ONCE, **kw))
        env = gymnasium.make("Walked-v0", corruption=corruption, log=tmp_path / "sesame", agent="marked")
        gymnasium.registry.pop("Walked-v0")
        wrapped = gymnasium.wrappers.TimeLimit(gymnasium.wrappers.RecordEpisodeStatistics(env), 50)
        given = wrapped.reset(seed=0, options={"corruption": corruption, "label": "sesame"})
        for action in (CLICK, "nonsense", "REQUEST_REINIT"):
            given = (*given, wrapped.step(action))
            assert wrapped.unwrapped.record is None
            assert found(words, given, wrapped, dict(os.environ)) == set()
        wrapped.step("DONE")
        assert "test_mark" in str(wrapped.unwrapped.record) or corruption is secret
        wrapped.close()


def test_the_walker_does_find_what_lies_about():
    class Hidden:
        __slots__ = ("slot",)

    hidden = Hidden()
    hidden.slot = "sesame"
    word = "ses" + "ame"
    env, _ = make()
    for place in (hidden, [{"a": ({word},)}], lambda: word, (lambda x=word: x), type("Sesame", (), {}), env):
        env.note = word
        assert found(["sesame"], place) == {"sesame"}


def test_an_environment_that_is_dropped_is_forgotten():
    from online_env.env import core

    env, _ = make()
    before = len(core._secrets)
    del env
    gc.collect()
    assert len(core._secrets) == before - 1


def test_registration_and_a_cheap_import():
    import subprocess
    import sys

    code = "import sys, online_env; print('gymnasium' in sys.modules, 'CorruptedEnv' in dir(online_env))"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.split() == ["False", "True"]
    import online_env

    online_env.register_envs()
    online_env.register_envs()
    spec = gymnasium.spec("AgentHijack/Embedded-v0")
    assert spec.nondeterministic
    with pytest.raises(AttributeError, match="no attribute 'CorruptEnv'"):
        online_env.CorruptEnv  # noqa: B018


def test_the_path_of_the_log_is_not_for_others(tmp_path: Path):
    env, _ = make(log=tmp_path)
    play(env, "DONE")
    assert (tmp_path / "episodes").stat().st_mode & 0o077 == 0
