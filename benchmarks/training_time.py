"""Training with corruptions: rollouts a second, and what corrupting them takes of a step.

`hijack desktop install` and the extra `train` are needed. The toy's replication is timed whole; a
trainer of the toy, and rollouts on real desktops with 1, 2 and 4 sessions, have a clock around the
sampler, the replay buffer, and the planning and drawing of corruptions.
"""

import argparse
import contextlib
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import torch
from common import hijack, machine, seconds, table

import hijack_data as hj
import online_env.environment.observer as live
from hijack_data.rng import Stream
from online_env import CorruptedEnv, EmbeddedDesktop
from online_env.environment import SmallTasks
from online_env.environment.script import Script
from pipelines.train.replay import ReplayBuffer
from pipelines.train.rollouts import PolicyAnswer, RolloutRequest, play
from pipelines.train.sampler import CorruptionSampler
from pipelines.train.toy.env import ToyEnv
from pipelines.train.toy.experiment import ToyJob, make_trainer
from pipelines.train.toy.policy import ToyNetwork
from pipelines.train.toy.settings import load_replication

ROOT = Path(__file__).resolve().parents[1]
TOY = ROOT / "configs" / "train" / "toy.yaml"
TASK = "write_note"
SIZE = (1080, 1920)
# What belongs to corrupting: the place that has the function, its name, and the part it counts as.
PARTS: tuple[tuple[Any, str, str], ...] = (
    (CorruptionSampler, "draw", "sampler"),
    (ReplayBuffer, "add", "replay"),
    (ReplayBuffer, "fill", "replay"),
    (ToyEnv, "_plan", "corruption"),
    (hj, "apply", "corruption"),
    (Script, "plan", "corruption"),
    (live, "apply", "corruption"),
)
NAMES = ("sampler", "replay", "corruption")


@contextlib.contextmanager
def clock() -> Iterator[dict[str, float]]:
    """Count the seconds of each part, over all threads."""
    spent: defaultdict[str, float] = defaultdict(float)
    lock = threading.Lock()

    def timed(function: Callable[..., Any], part: str) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            start = time.perf_counter()
            try:
                return function(*arguments, **options)
            finally:
                with lock:
                    spent[part] += time.perf_counter() - start

        return call

    with contextlib.ExitStack() as stack:
        for part_index, name, part in PARTS:
            double = timed(getattr(part_index, name), part)
            stack.enter_context(mock.patch.object(part_index, name, double))
        yield spent


class Pointing:
    """A policy without a network: it moves the pointer. The time is the environment's alone."""

    def act(self, observations: Sequence[Any], streams: Sequence[Stream]) -> list[PolicyAnswer]:
        """Answer each observation."""
        codes = [
            f"pyautogui.moveTo({stream.integer(100, 900)}, {stream.integer(100, 600)})"
            for stream in streams
        ]
        return [
            PolicyAnswer(action=code, tokens=(0,), logprobs=(0.0,), is_well_formed=True)
            for code in codes
        ]

    def log_probs(self, turns: Sequence[Any]) -> tuple[torch.Tensor, torch.Tensor]:
        """Nothing is trained."""
        raise NotImplementedError

    def network(self) -> torch.nn.Module:
        """Nothing is trained."""
        raise NotImplementedError


def replication() -> str:
    """Time the command of the README, with its four seeds and two arms."""
    with tempfile.TemporaryDirectory() as folder:
        took = seconds(lambda: hijack("train", TOY, "--out", Path(folder) / "toy"))
    setting = load_replication(TOY)
    groups = len(setting.training) * setting.epochs
    count = len(setting.arms) * setting.seeds * groups * setting.rollouts
    return (
        f"`hijack train configs/train/toy.yaml`: {took / 60:.1f} minutes for {count:,} rollouts of"
        f" {setting.seeds} seeds and {len(setting.arms)} arms, four starts and all evaluations"
        f" ({count / took:.0f} rollouts a second in two processes)."
    )


def toy(steps: int) -> list[str]:
    """Return the row of a trainer of the toy, from an untrained network, on one thread."""
    torch.set_num_threads(1)
    job = ToyJob(load_replication(TOY), "da_grpo", 0, Path())
    trainer = make_trainer(job, ToyNetwork(), None)
    trainer.step()  # everything is loaded by it
    with clock() as spent:
        total_seconds = seconds(lambda: [trainer.step() for _ in range(steps)])
    count = steps * job.replication.batch * job.replication.rollouts
    return row("toy, with gradients", 1, count, total_seconds, spent)


def desktops(sessions: int, rounds: int, steps: int) -> list[str]:
    """Return the row of rollouts on real desktops."""
    planner = hj.OneOf([hj.make_corruption(name) for name in hj.corruption_names()[:9]])
    sampler = CorruptionSampler(planner, seed=0)
    with contextlib.ExitStack() as stack:
        envs = [
            CorruptedEnv(
                SmallTasks(stack.enter_context(EmbeddedDesktop.up(size=SIZE)), TASK),
                max_steps=steps + 1,
            )
            for _ in range(sessions)
        ]

        def one(step: int) -> None:
            requests = [
                RolloutRequest(
                    step=step,
                    group=TASK,
                    slot=slot,
                    seed=step,
                    draw=sampler.draw(step=step, group=TASK, slot=slot),
                )
                for slot in range(sessions)
            ]
            rollouts = play(envs, Pointing(), requests, max_steps=steps, threads=sessions)
            for rollout in rollouts:
                if rollout.status != "ok":
                    print(f"{rollout.request.draw.label}: {rollout.problem}")

        one(0)
        with clock() as spent:
            total_seconds = seconds(lambda: [one(step) for step in range(1, rounds + 1)])
    return row("real desktop, 10 steps", sessions, rounds * sessions, total_seconds, spent)


def row(
    name: str, sessions: int, rollouts: int, whole: float, spent: dict[str, float]
) -> list[str]:
    """Return a row; shares are of the time of all sessions."""
    shares = [100 * spent[part] / (whole * sessions) for part in NAMES]
    return [
        name,
        str(sessions),
        f"{rollouts / whole:.2f}",
        *(f"{share:.2f} %" for share in shares),
        f"{sum(shares):.2f} %",
    ]


def main() -> None:
    """Measure, and print the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9, help="rollouts of each session")
    options = parser.parse_args()
    rows = [toy(30)]
    rows += [desktops(sessions, options.rounds, 10) for sessions in (1, 2, 4)]
    head = ("", "sessions", "rollouts / s", *NAMES, "together (goal <= 2 %)")
    print(f"## Training with corruptions\n\n`python benchmarks/training_time.py`\n\n{machine()}\n")
    print(replication())
    print(f"\n{table(head, rows)}")


if __name__ == "__main__":
    main()
