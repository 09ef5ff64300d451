"""Episodes that fail before or beside their agent, and what a person at a terminal sees of a run."""

import io
import re
import sys
from types import SimpleNamespace

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from rich.console import Console

from hijack_data import NetworkError
from online_env.agents.agent_thread import AgentThread
from online_env.agents.registry import AGENTS
from online_env.bench import episodes, models
from online_env.bench.config import Bench
from online_env.bench.jobs import Job
from online_env.bench.progress import ProgressDisplay
from online_env.environment import CorruptedEnv
from online_env.errors import AgentSetupError, MissingCapabilityError
from online_env.scoring import progress
from online_env.scoring.progress import ScoreDisplay

from support.live import AT_ONCE, FakeDesktop, FakeStage
from support.recorded import JOBS, Teller, no_machine

JOB = Job("mine", "write_note", "clean", 0)
BROKEN = """
class Broken:
    def __init__(self):
        raise OSError("no such weights")

    def predict(self, instruction, obs):
        return "", []
"""


def ended(status, **more):
    return {"status": status, "steps": 3, "seconds": 1.0, "reason": "", "problem": "", **more}


# Episodes


def test_an_agent_that_cannot_be_made_fails_its_episode_and_not_the_run(tmp_path):
    (tmp_path / "broken.py").write_text(BROKEN)
    name = AGENTS.find(f"{tmp_path}/broken.py:Broken")
    bench = Bench(agents=(name,), tasks=("write_note",), corruptions={"clean": None})
    stage = FakeStage()
    with episodes.LiveEpisodes(bench, tmp_path, stage) as play:
        record = play(Job(name, "write_note", "clean", 3), 1)
    assert record["problem"] == "the agent cannot be made: OSError: no such weights"
    assert (record["status"], record["cause"], record["score"]) == ("error", "agent", None)
    assert (record["task"], record["seed"], record["attempt"]) == ("write_note-3", 3, 1)
    assert record["id"].endswith("__a1")
    assert record["instruction"]
    assert "broken.py" in record["traceback"][-1]
    assert stage.resets == [], "no task is set up for it"


def test_a_run_is_refused_before_its_first_episode_if_the_desktop_lacks_what_it_needs(tmp_path):
    bench = Bench(
        agents=("do_nothing",),
        tasks=("write_note",),
        corruptions={"clean": None, "network_error": NetworkError()},
    )
    stage = FakeStage(FakeDesktop(capabilities=frozenset({"execute"})))
    with episodes.LiveEpisodes(bench, tmp_path, stage) as play:  # noqa: SIM117
        with pytest.raises(MissingCapabilityError, match="network_error needs firewall"):
            play(Job("do_nothing", "write_note", "clean", 0), 0)
    assert stage.resets == []


@pytest.mark.parametrize(("limit", "status", "steps"), [(0.0, "error", 1), (600.0, "ok", 5)])
def test_an_episode_that_takes_longer_than_its_limit_is_ended_after_the_answer(
    limit, status, steps
):
    env = CorruptedEnv(FakeStage(FakeDesktop(), score=1.0), settle=AT_ONCE, max_steps=9)
    with no_machine(), AgentThread(Teller) as agent:
        record = episodes._play_episode(env, agent, JOBS[0], 0, None, None, limit)
    assert (record["status"], record["steps"]) == (status, steps)
    if status == "error":
        assert record["problem"] == "the episode took longer than 0 s"
        assert (record["cause"], record["score"]) == ("agent", None)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"max_cost": 0.0}, "--max-cost"),
        ({"prompts": "prompts", "max_cost": 1.0}, "--prompts"),
        ({"replay": "runs/old"}, "--replay"),
    ],
)
def test_options_of_models_are_refused_where_no_agent_asks_one(options, named):
    model_options = models.ModelOptions(**options)
    with pytest.raises(AgentSetupError) as error:
        models.prepare(Bench(agents=("oracle", "random")), model_options, None)
    assert str(error.value) == f"{named} is for agents of files, and there is none"
    models.prepare(Bench(agents=("oracle", "random")), models.ModelOptions(), None)


# A terminal


@pytest.fixture
def screen(monkeypatch):
    """A terminal that keeps what was drawn on it."""
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    return Console(file=io.StringIO(), force_terminal=True, width=100)


def last_drawn(screen):
    """The last frame of the bar, as plain text."""
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.file.getvalue())
    (*_, line) = [line for line in re.split(r"[\r\n]+", text) if "/" in line and "━" in line]
    return " ".join(line.replace("━", "").replace("╸", "").replace("╺", "").split())


def test_a_bar_names_what_is_played_and_how_much_was_done(screen):
    with ProgressDisplay(
        [JOB] * 4, screen, finished=1, clock=iter(range(0, 900, 60)).__next__
    ) as bar:
        bar.begins(JOB, 2, 0)
        bar.ended(JOB, 2, ended("invalid"))
        bar.begins(JOB, 2, 1)
    assert last_drawn(screen).startswith("1/4 ")
    assert last_drawn(screen).endswith("mine write_note seed 0 clean (again)")


def test_a_bar_shows_the_rate_once_an_episode_has_ended(screen):
    with ProgressDisplay([JOB] * 3, screen, clock=iter(range(0, 900, 60)).__next__) as bar:
        bar.begins(JOB, 1, 0)
        bar.ended(JOB, 1, ended("ok", score=1.0))
    assert last_drawn(screen) == "1/3 60 an hour, 2 min left mine write_note seed 0 clean"


def test_a_bar_of_rows_names_the_agent_that_is_asked(screen):
    with ScoreDisplay(3, screen) as bar:
        bar.tick("first", {"status": "ok"})
        bar.tick("second", {"status": "ok"})
    assert last_drawn(screen).startswith("2/3 second")


def test_a_log_of_rows_says_now_and_then_how_long_it_will_take(monkeypatch):
    seconds = iter([100.0, 104.0, 110.0, 110.0, 114.0])
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=seconds.__next__))
    stream = io.StringIO()
    with ScoreDisplay(5, Console(file=stream, width=60)) as display:
        for _ in range(3):
            display.tick("mine", {"status": "ok"})
    # The first row comes too early for a line, the third too soon after the second.
    assert stream.getvalue() == "mine: 2/5 rows, 0.2 rows/s, 15 s left\n"
