"""`CorruptedEnv` on a desktop that is none: what an agent can reach tells it nothing of the
corruption."""

import gc
import os
import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import gymnasium

import hijack_data as hj
from online_env.environment import CorruptedEnv, core

from support.episodes import CLICK, make, play
from support.live import AT_ONCE, FakeStage, Marking
from support.walker import found

pytestmark = pytest.mark.usefixtures("no_waiting")


def test_observations_belong_to_the_agent():
    env, _ = make()
    env.render_mode = "rgb_array"
    obs, _ = env.reset(seed=0)
    obs["screenshot"][:] = 0
    assert env.render().any()
    later = env.step("WAIT")[0]["screenshot"]
    assert later.any()
    assert not np.shares_memory(later, obs["screenshot"])


SECRETS = ("sesame", "marking", "test_mark", "marked")
# gymnasium's wrappers refuse to give the generator of what they wrap.
WRAPPERS = ("TimeLimit", "RecordEpisodeStatistics", "OrderEnforcing", "PassiveEnvChecker")
REFUSED = {f"gymnasium.wrappers.common.{wrapper}._np_random" for wrapper in WRAPPERS}


def test_an_agent_that_walks_all_it_is_given_finds_nothing(tmp_path):
    secret = hj.Subtitle(subtitle_text="sesame", font_size=12)
    for corruption, words in ((secret, ("sesame", "subtitle")), (Marking(0), SECRETS)):
        gymnasium.register(
            "Walked-v0", entry_point=lambda **kw: CorruptedEnv(FakeStage(), settle=AT_ONCE, **kw)
        )
        env = gymnasium.make(
            "Walked-v0", corruption=corruption, log=tmp_path / "sesame", agent="marked"
        )
        gymnasium.registry.pop("Walked-v0")
        wrapped = gymnasium.wrappers.TimeLimit(gymnasium.wrappers.RecordEpisodeStatistics(env), 50)
        given = wrapped.reset(seed=0, options={"corruption": corruption, "label": "sesame"})
        for action in (CLICK, "nonsense", "REQUEST_REINIT"):
            given = (*given, wrapped.step(action))
            assert wrapped.unwrapped.record is None
            assert found(words, given, wrapped, dict(os.environ), raising=REFUSED) == set()
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
    for place in (
        hidden,
        [{"a": ({word},)}],
        lambda: word,
        (lambda x=word: x),
        type("Sesame", (), {}),
        env,
    ):
        env.note = word
        assert found(["sesame"], place) == {"sesame"}


def test_the_walker_names_what_it_could_not_look_into():
    class Shut:
        @property
        def door(self):
            raise RuntimeError("ses" + "ame")

    name = f"{__name__}.{Shut.__qualname__}.door"
    with pytest.raises(AssertionError, match=re.escape(f"as they raise: ['{name}']")):
        found(["sesame"], [Shut()])
    assert found(["sesame"], [Shut()], raising={name}) == {"sesame"}, "what was raised can be read"


def test_an_environment_that_is_dropped_is_forgotten():
    env, _ = make()
    before = len(core._runners)
    del env
    gc.collect()
    assert len(core._runners) == before - 1


def test_the_path_of_the_log_is_not_for_others(tmp_path: Path):
    env, _ = make(log=tmp_path)
    play(env, "DONE")
    assert (tmp_path / "episodes").stat().st_mode & 0o077 == 0
