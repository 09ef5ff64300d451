"""`CorruptedEnv` on a desktop that is none: what is an agent's, what is not, and gymnasium's idioms."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import gymnasium

import hijack_data as hj

from support.episodes import make, play

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


def test_info_is_empty_unless_it_is_asked_for(tmp_path):
    secret = hj.Subtitle(subtitle_text="sesame", font_size=12)
    env, _ = make(corruption=secret, log=tmp_path)
    (obs, info), later = env.reset(seed=3), env.step("DONE")
    assert (info, later[-1]) == ({}, {})
    assert "sesame" not in str(obs["instruction"])

    env, _ = make(corruption=secret, reveal=True)
    agenthijack = env.reset(seed=3)[1]["agenthijack"]
    assert (
        agenthijack["corruption"],
        agenthijack["seed"],
        agenthijack["step"],
        agenthijack["record"],
    ) == ("subtitle", 3, 0, None)
    assert "sesame" in json.dumps(agenthijack["plan"])
    agenthijack = env.step("DONE")[-1]["agenthijack"]
    assert agenthijack["record"] == env.record


DRAWS = """
import sys
import gymnasium
from support.episodes import make
env = gymnasium.wrappers.StickyAction(make()[0], 0.5)
env.unwrapped.reset(seed=0)
print([float(x) for x in env.unwrapped.np_random.random(4)])
"""


def test_equal_seeds_give_equal_draws_in_every_process():
    expected, _ = gymnasium.utils.seeding.np_random(0)
    command = [sys.executable, "-c", DRAWS]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    printed = {
        subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True
        ).stdout.strip()
        for _ in range(2)
    }
    assert printed == {str([float(x) for x in expected.random(4)])}


NAMES = {
    "gymnasium first": "import gymnasium, online_env",
    "gymnasium last": "import online_env, gymnasium",
    "the idiom": "import gymnasium, online_env; gymnasium.register_envs(online_env)",
    "by module": "import gymnasium; NAME = 'online_env:' + NAME",
}


@pytest.mark.parametrize("how", NAMES)
def test_gymnasium_finds_the_environment(how):
    code = (
        f"NAME = 'AgentHijack/Embedded-v0'; {NAMES[how]};"
        " from gymnasium.envs.registration import _find_spec;"  # what `gymnasium.make` calls
        " print(_find_spec(NAME).entry_point, _find_spec(NAME).nondeterministic)"
    )
    process = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert process.stdout.split() == ["online_env.environment.registration:make_embedded", "True"]


def test_the_path_of_the_log_is_not_for_others(tmp_path: Path):
    env, _ = make(log=tmp_path)
    play(env, "DONE")
    assert (tmp_path / "episodes").stat().st_mode & 0o077 == 0
