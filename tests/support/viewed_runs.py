"""Runs for the page of runs: really played by `CorruptedEnv`, on a desktop that shows pictures."""

import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import yaml

import hijack_data as hj
from hijack_data.config import dump
from hijack_data.runs.run_log import episode_slug
from online_env.bench import runner
from online_env.bench.episodes import play
from online_env.environment import CorruptedEnv
from online_env.environment.stage import Setting
from online_env.results import records

from .live import AT_ONCE, FakeDesktop, FakeStage
from .recorded import Silent, Straw, no_machine

HOSTILE = "I look <img src=x onerror=alert(1)> </script><script>alert(2)</script>"
ANSWERS = (
    ("The title bar shows the note is open. I click into the text.", ["pyautogui.click(101, 50)"]),
    (
        HOSTILE,
        ["pyautogui.moveTo(20, 30)\npyautogui.dragTo(200, 120)", "pyautogui.scroll(-5, 60, 90)"],
    ),
    ("", ["pyautogui.doubleClick(60, 40)\npyautogui.write('Hello <b>you</b>')"]),
    ("This is not Python.", ["pyautogui.click("]),
    ("Everything is written.", ["DONE"]),
)
PLANNERS = {
    "clean": None,
    "marks": hj.Marks(number=12, mark_size=14),
    "subtitle": hj.Subtitle(),
    "resolution": hj.Resolution(scale=0.5),
    "app_minimization": hj.AppMinimization(step=1),
}
INSTRUCTIONS = {
    "write_note": "Write a short packing list into a new note and save it in Documents",
    "rename_file": "Rename the file draft.txt to final.txt",
}


@dataclass(frozen=True, kw_only=True)
class Cast:
    """What is played: every agent plays every task under every label.

    `shared_model` is the agent whose requests are logged, with an onlooker.
    """

    agents: tuple[str, ...] = ("pixel", "gpt-9")
    tasks: tuple[str, ...] = ("write_note", "rename_file")
    labels: tuple[str, ...] = ("clean", "marks", "app_minimization")
    screens: Sequence[np.ndarray] = ()
    shared_model: str = "gpt-9"

    @property
    def jobs(self) -> list[Straw]:
        cases = itertools.product(self.agents, self.tasks, self.labels)
        return [Straw(agent, task, label, 7) for agent, task, label in cases]


class Screens(FakeDesktop):
    """Shows one picture after the other, one more each time that something was run."""

    def __init__(self, pictures: Sequence[np.ndarray]) -> None:
        super().__init__(size=pictures[0].shape[:2])
        self.pictures = pictures

    def screenshot(self) -> np.ndarray:
        picture = self.pictures[len(self.ran) % len(self.pictures)]
        return picture // 3 if self.state else picture


class Room(FakeStage):
    """Tasks with instructions of their own."""

    def reset(self, task: Any, seed: int) -> Setting:
        result = super().reset(task, seed)
        words = INSTRUCTIONS.get(str(task), f"Do what {task} says")
        return Setting(result.id, words, result.apps, result.infeasible, result.seed)


class Speaker:
    """Says and does the same again and again, and counts tokens that nobody used.

    For the records it is an agent of the library: a user's would note that it ran in-process.
    """

    __module__ = "online_env.agents.scripted"

    def __init__(self, name: str) -> None:
        self.name = name
        self.left: list[Any] = []
        self.turns = 0

    def reset(self) -> None:
        self.left = list(ANSWERS)
        self.turns = 0

    def predict(self, instruction: str, obs: Any) -> tuple[str, list[str]]:
        self.turns += 1
        if self.name == "gpt-9" and self.turns == 3 and "final" in instruction:
            raise RuntimeError("the endpoint is gone")
        return self.left.pop(0)

    @property
    def usage(self) -> dict[str, Any]:
        steps = [_used(1200 + 300 * k, 40 + 7 * k) for k in range(self.turns)]
        totals = {key: sum(step[key] for step in steps) for key in _used(0, 0)}
        return {**totals, "steps": steps} if self.name == "gpt-9" else {}


def _used(read: int, written: int) -> dict[str, Any]:
    return {
        "requests": 2,
        "retries": 0,
        "input_tokens": read,
        "output_tokens": written,
        "usd": round(read * 2e-6, 6),
        "seconds": 1.25,
    }


class Theatre:
    """Plays a job; clean succeeds, marks fail, the rest in part."""

    scores: ClassVar[dict[str, float]] = {"clean": 1.0, "marks": 0.0}

    def __init__(self, folder: Path, cast: Cast) -> None:
        self.folder, self.cast = folder, cast

    def __call__(self, job: Straw, attempt: int) -> dict[str, Any]:
        pictures = self.cast.screens or plain_screens()
        stage = Room(Screens(pictures), score=self.scores.get(job.corruption, 0.5))
        env = CorruptedEnv(stage, settle=AT_ONCE, max_steps=9, log=self.folder, agent=job.agent)
        record = play(env, Speaker(job.agent), job, attempt, PLANNERS[job.corruption])
        if job.agent == self.cast.shared_model:
            _log_requests(self.folder, str(record["id"]), int(record["steps"]))
        return record


def plain_screens() -> list[np.ndarray]:
    """Three pictures, 320 wide and 200 high, each of another grey."""
    return [np.full((200, 320, 3), 110 + 40 * k, np.uint8) for k in range(3)]


def play_run(folder: Path, cast: Cast | None = None) -> Path:
    """Play all that is cast; returns the folder of the run."""
    cast = cast or Cast()
    named = {label: PLANNERS[label] for label in cast.labels if PLANNERS[label] is not None}
    config = {
        "source": "small.yaml",
        "agents": list(cast.agents),
        "tasks": list(cast.tasks),
        "corruptions": ["clean", *yaml.safe_load(dump(named))["corruptions"]],
        "seeds": [7],
        "max_steps": 9,
        "recovery": "none",
        "retries": 0,
    }
    ids = [job.id for job in cast.jobs]
    with no_machine(), records.create(folder, config, ids):
        runner.run_jobs(cast.jobs, folder, 1, Theatre(folder, cast), Silent())
    return folder


def episode_id(task: str, label: str, agent: str) -> str:
    """The id of an episode that `play_run` plays."""
    return episode_slug(f"{task}-7", label, 7, agent, 0)


def _log_requests(folder: Path, name: str, turns: int) -> None:
    """Write what an onlooker was asked, as `online_env.agents.chat` does."""
    (folder / "requests").mkdir(exist_ok=True)
    lines = [
        _request(0, "check", {"choices": [{"message": {"content": "Reminder: a window is gone."}}]})
    ]
    for turn in range(1, turns):
        text = f"d_{turn}: the pointer moved, and <i>nothing</i> was saved."
        lines.append(_request(turn, "summarise", {"content": [{"type": "text", "text": text}]}))
        lines.append(_request(turn, "act", {"content": [{"type": "text", "text": "secret"}]}))
    path = folder / "requests" / f"{name}.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))


def _request(turn: int, role: str, response: Any) -> dict[str, Any]:
    return {
        "step": turn,
        "role": role,
        "sha256": "0" * 64,
        "request": {},
        "response": response,
        "seconds": 0.5,
        "tries": 1,
    }
