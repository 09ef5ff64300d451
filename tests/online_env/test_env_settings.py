"""`CorruptedEnv` on a desktop that is none: spaces, seeds, labels, registration, and what is
refused."""

import json
import subprocess
import sys
from dataclasses import fields

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import gymnasium

import hijack_data as hj
import online_env
from hijack_data.errors import HijackError, ParameterError, ParameterTypeError, UnknownNameError
from online_env.environment import CorruptedEnv, EvalSettings, Settle
from online_env.environment.log import episode_slug
from online_env.environment.settings import EvalOptions

from support.episodes import make, play
from support.live import AT_ONCE, SIZE, FakeStage

pytestmark = pytest.mark.usefixtures("no_waiting")


def test_the_space_follows_the_corruption():
    env, _ = make()
    for corruption, size in (
        ("resolution", (180, 320)),
        (None, SIZE),
        (hj.Resolution(scale=0.5, restore=True), SIZE),
    ):
        obs, _ = env.reset(seed=0, options={"corruption": corruption})
        assert obs["screenshot"].shape == (*size, 3)
        assert obs in env.observation_space
        assert env.action_space.size == size
    assert CorruptedEnv(FakeStage(), corruption="resolution").observation_space[
        "screenshot"
    ].shape == (180, 320, 3)


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
        ({"label": ""}, ParameterTypeError, "label must be a non-empty string"),
        (
            {"corruption": hj.Marks(), "label": "clean"},
            ParameterError,
            "another condition than marks",
        ),
        ({"corruption": None, "label": "marks"}, ParameterError, "another condition than clean"),
        ({"corruption": "marks", "label": "pop_ups"}, ParameterError, "choose another label"),
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
        ({"max_steps": 0}, "at least 1"),
        ({"max_steps": True}, "at least 1"),
        ({"recovery": "repiar"}, "'repair'"),
        ({"render_mode": "human"}, "rgb_array"),
        ({"corruption": "sub"}, "unknown corruption"),
    ):
        with pytest.raises(HijackError, match=words):
            CorruptedEnv(FakeStage(), **wrong)
    with pytest.raises(ParameterError, match="quiet"):
        Settle(quiet=-1)
    with pytest.raises(HijackError, match="call reset first"):
        CorruptedEnv(FakeStage()).step("WAIT")


def test_settings_are_given_together_or_by_keyword():
    shared = EvalSettings(settle=AT_ONCE, max_steps=1, agent="mine", recovery="repair")
    for env, expected in (
        (CorruptedEnv(FakeStage(), settings=shared), (1, "mine", "repair")),
        (CorruptedEnv(FakeStage(), settings=shared, agent="other"), (1, "other", "repair")),
        (CorruptedEnv(FakeStage(), settle=AT_ONCE, max_steps=1), (1, "agent", "none")),
    ):
        play(env, "WAIT")
        record = env.record
        assert (record["max_steps"], record["agent"], record["recovery"]["policy"]) == expected
    assert {field.name for field in fields(EvalSettings)} == set(EvalOptions.__annotations__)
    with pytest.raises(TypeError, match="max_step"):
        CorruptedEnv(FakeStage(), max_step=3)
    with pytest.raises(TypeError):
        EvalSettings(3)  # keywords only


def test_labels_name_what_happens():
    env, _ = make()
    cases = [
        (None, {}, "clean", {}),
        ("clean", {}, "clean", {}),
        (hj.Marks(number=2), {}, "marks", hj.Marks(number=2).params()),
        (hj.Marks(number=2), {"label": "marks@1"}, "marks@1", hj.Marks(number=2).params()),
        (
            hj.Sequence([hj.Marks(), hj.Resolution()]),
            {},
            "marks+resolution",
            {"marks-v1": hj.Marks().params(), "resolution-v2": hj.Resolution().params()},
        ),
    ]
    for corruption, more, label, params in cases:
        play(env, "DONE", corruption=corruption, **more)
        assert (env.record["corruption"], env.record["params"]) == (
            label,
            json.loads(json.dumps(params)),
        )
    assert episode_slug("a b/ü", "marks@1", 3, "m:7", 2) == "a_b___marks_1__s3__m_7__a2"
    assert len({episode_slug("x" * n, "clean", 0, "a", 0) for n in (300, 301)}) == 2
    assert len(episode_slug("x" * 300, "clean", 0, "a", 0)) == 200


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


def test_registration_and_a_cheap_import():
    code = (
        "import sys, online_env; print('CorruptedEnv' in dir(online_env));"
        " from online_env import Desktop, EmbeddedDesktop, HttpDesktop;"
        " print('gymnasium' in sys.modules)"
    )
    printed = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert printed.split() == ["True", "False"]
    for name in online_env._HOMES:
        assert getattr(online_env, name).__name__ == name
        assert f"`{name}`" in online_env.__doc__
    online_env.register_envs()
    online_env.register_envs()
    spec = gymnasium.spec("AgentHijack/Embedded-v0")
    assert spec.nondeterministic
    with pytest.raises(AttributeError, match="no attribute 'CorruptEnv'"):
        online_env.CorruptEnv  # noqa: B018
