"""A small run as `hijack bench` leaves it, played on a desktop that is none."""

import contextlib
from pathlib import Path
from typing import Any, ClassVar

import pytest
import yaml

import hijack_data as hj
from hijack_data.config import dump
from online_env.bench import runner
from online_env.bench.episodes import play
from online_env.bench.jobs import Job
from online_env.effects import base
from online_env.environment import CorruptedEnv
from online_env.results import records

from .live import AT_ONCE, FakeDesktop, FakeStage, Mark

PLANNERS = {
    "clean": None,
    "marks": hj.Marks(number=3, mark_size=8, avoid_elements=True),
    "app_minimization": hj.AppMinimization(step=1),
    "resolution": hj.Resolution(scale=0.5),
}
AGENT, SEED = "teller", 7
ANSWERS = (
    ("first I click", ["```python\npyautogui.click(10, 20)\n```"]),
    ("then what is no action", ["import os"]),
    ("and help", ["REQUEST_REINIT", "WAIT"]),
    ("that is all", ["DONE"]),
)


class Minimise(Mark):
    """What `AppMinimization` does to a desktop that is none."""

    kind: ClassVar[str] = "minimise"


class Teller:
    """Says and does what it was told, again and again."""

    def reset(self) -> None:
        self.left = list(ANSWERS)

    def predict(self, instruction: str, obs: Any) -> tuple[str, list[str]]:
        return self.left.pop(0)


class Silent:
    """Nobody to be told."""

    def begins(self, *_: object) -> None:
        pass

    def ended(self, *_: object) -> None:
        pass


def config(**changes: Any) -> dict[str, Any]:
    """The configuration of the run, as `Bench.to_data` gives it."""
    named = {label: planner for label, planner in PLANNERS.items() if planner is not None}
    entries = yaml.safe_load(dump(named))["corruptions"]
    return {
        "source": "small.yaml",
        "desktop": {"provider": "none", "size": [640, 360]},
        "agents": [AGENT],
        "tasks": ["do"],
        "corruptions": ["clean", *entries],
        "seeds": [SEED],
        "max_steps": 9,
        "recovery": "none",
        "retries": 1,
        **changes,
    }


class Straw(Job):
    """A job whose task is the stage's."""

    @property
    def key(self) -> tuple[str, str, str, int]:
        return self.agent, f"{self.task}-{self.seed}", self.corruption, self.seed


JOBS = [Straw(AGENT, "do", label, SEED) for label in PLANNERS]
IDS = [job.id for job in JOBS]


class Episodes:
    """Plays a job on a stage; `scores` says what each label gets."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.played = folder, []
        self.scores = dict.fromkeys(PLANNERS, 1.0) | {"marks": 0.0}

    def __call__(self, job: Job, attempt: int) -> dict[str, Any]:
        self.played.append((job.corruption, attempt))
        stage = FakeStage(FakeDesktop(), score=self.scores[job.corruption])
        env = CorruptedEnv(stage, settle=AT_ONCE, max_steps=9, log=self.folder, agent=job.agent)
        return play(env, Teller(), job, attempt, PLANNERS[job.corruption])


@contextlib.contextmanager
def no_machine():
    """Effects that do nothing, and no waiting, while a run is played."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(base.EFFECTS.entries, "minimise", Minimise())
        patch.setattr("online_env.environment.episode.WAIT_S", 0.0)
        yield


def record_run(folder: Path) -> Path:
    """Play all jobs; returns the folder of the run."""
    with no_machine(), records.create(folder, config(), IDS):
        runner.run_jobs(JOBS, folder, 1, Episodes(folder), Silent())
    return folder
