"""The replication: starts, runs and evaluations of every arm and seed, in processes."""

import json
import multiprocessing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import torch

import hijack_data as hj
from hijack_data.file_io import make_folder, read_versioned_json, replace_atomic, write_atomic
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner

from ...worker_processes import begin_worker
from ..errors import TrainError
from ..replay import ReplayBuffer, read_tensors
from ..rollouts import Rollout, RolloutRequest, play
from ..sampler import CorruptionSampler, Draw
from ..split import check_split
from ..trainer import Trainer, TrainSettings
from .arms import ARMS
from .cloning import CloningSettings, imitate_expert
from .env import ToyEnv
from .policy import ToyNetwork, ToyPolicy
from .settings import Replication, trainer_settings
from .tasks import task_names

Say: TypeAlias = Callable[[str], object]
START = "start"  # the arm that is not trained
FORMAT = "agenthijack-training-scores"
VERSION = 1
_PLAN = "replication.json"
_PLAN_FORMAT = "agenthijack-replication"
_START_FORMAT = "agenthijack-start"
_FIRST_START = 50_000  # tasks that the expert shows
_PARALLEL_EPISODES = 64  # episodes of an evaluation side by side


@dataclass(frozen=True)
class ToyJob:
    """One run: an arm with a seed; `START` only makes and scores the start."""

    replication: Replication
    arm: str
    seed: int
    folder: Path

    @property
    def scores(self) -> Path:
        """The file with its result."""
        return self.folder / f"{self.arm}-{self.seed}" / "scores.json"


def run_replication(
    replication: Replication, folder: Path, *, workers: int = 2, say: Say = lambda _: None
) -> list[dict[str, Any]]:
    """Carry out all missing runs; return the scores of every run.

    A folder that was interrupted is resumed: complete runs are kept, and an interrupted run
    continues from its checkpoint as if uninterrupted.

    Args:
        replication: what is compared.
        folder: of the results.
        workers: processes; each computes with one thread, so their number changes no result.
        say: called with a line on each finished run.

    Raises:
        LeakError: a task is both trained on and reported.
        TrainError: the folder holds another replication, or a run failed.
    """
    check_split(replication.training, replication.evaluation, source=replication.source)
    _check_folder(replication, folder)
    seeds = range(replication.seeds)
    starts = [ToyJob(replication, START, seed, folder) for seed in seeds]
    runs = [ToyJob(replication, arm, seed, folder) for seed in seeds for arm in replication.arms]
    for jobs in (starts, runs):
        _run_all([job for job in jobs if not job.scores.exists()], workers, say)
    return [_scores(job) for job in (*starts, *runs)]


def run_job(job: ToyJob) -> str:
    """Make a start, or train from one; score the policy and write the scores.

    Returns:
        A line of text about the result.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        network, log = _make_start(job) if job.arm == START else _train(job)
        rates = evaluate(ToyPolicy(network, temperature=0), job.replication, job.seed)
    finally:
        torch.set_num_threads(threads)
    data = {
        "format": FORMAT,
        "version": VERSION,
        "arm": job.arm,
        "seed": job.seed,
        "success": rates,
        **log,
    }
    write_atomic(job.scores, json.dumps(data, indent=1) + "\n")
    clean = rates[CLEAN]
    return f"{job.arm}, seed {job.seed}: {100 * clean:.1f} % of unseen tasks, clean"


def evaluate(policy: ToyPolicy, replication: Replication, seed: int) -> dict[str, float]:
    """Return the success of a policy on the evaluation's tasks by condition, each in 0..1."""
    envs = [ToyEnv(max_steps=replication.max_steps) for _ in range(_PARALLEL_EPISODES)]
    conditions: dict[str, Planner | None] = {CLEAN: None}
    conditions.update(replication.trained)
    conditions.update(replication.untrained)
    rates: dict[str, float] = {}
    for label, planner in conditions.items():
        requests = [
            RolloutRequest(
                step=draw,
                group=task,
                slot=0,
                seed=1000 * seed + draw,
                draw=Draw(label=label, planner=planner, key="evaluation"),
            )
            for draw in range(replication.draws)
            for task in replication.evaluation
        ]
        rollouts: list[Rollout] = []
        for first in range(0, len(requests), _PARALLEL_EPISODES):
            batch = requests[first : first + _PARALLEL_EPISODES]
            rollouts += play(envs, policy, batch, max_steps=replication.max_steps)
        rates[label] = sum(rollout.success for rollout in rollouts) / len(rollouts)
    return rates


def make_trainer(job: ToyJob, network: ToyNetwork, folder: Path | None) -> Trainer:
    """Return the trainer of a run."""
    replication, arm = job.replication, ARMS[job.arm]
    options = list(replication.trained.values())
    planner = hj.OneOf(options, p_clean=arm.p_clean) if arm.corrupted else None
    settings = TrainSettings(
        **trainer_settings(replication),
        format_weight=replication.format_weight * arm.format_share,
        seed=job.seed,
    )
    replay = ReplayBuffer(
        replication.replay_capacity,
        when=replication.replay_when,
        slot=arm.replay_slot,
        seed=job.seed,
    )
    count = replication.batch * replication.rollouts
    return Trainer(
        ToyPolicy(network),
        [ToyEnv(max_steps=replication.max_steps) for _ in range(count)],
        tasks=replication.training,
        sampler=CorruptionSampler(planner, per=arm.per, seed=job.seed),
        settings=settings,
        replay=replay if arm.replay else None,
        folder=folder,
    )


def _make_start(job: ToyJob) -> tuple[ToyNetwork, dict[str, Any]]:
    """Make the start of a seed, and keep it for the runs."""
    replication = job.replication
    settings = CloningSettings(tasks=replication.start_tasks, epochs=replication.start_epochs)
    names = task_names(_FIRST_START, settings.tasks)
    network = imitate_expert(names, job.seed, settings)
    data = {"format": _START_FORMAT, "version": VERSION, "policy": network.state_dict()}
    path = _start_path(job)
    make_folder(path.parent, path)
    replace_atomic(path, lambda temporary_path: torch.save(data, temporary_path))
    return network, {"rollouts": 0}


def _train(job: ToyJob) -> tuple[ToyNetwork, dict[str, Any]]:
    network = ToyNetwork()
    start = read_tensors(_start_path(job), _START_FORMAT, VERSION, "the start of a seed")
    network.load_state_dict(start["policy"])
    trainer = make_trainer(job, network, job.scores.parent)
    trainer.resume()
    trainer.run()
    steps = _lines(job.scores.parent / "steps.jsonl")
    log = {
        "rollouts": sum(1 for _ in _lines(job.scores.parent / "rollouts.jsonl")),
        "curve": _curve(list(steps), trainer.steps_per_epoch),
    }
    return network, log


def _curve(steps: Sequence[Mapping[str, Any]], steps_per_epoch: int) -> list[float]:
    """Return the success of the rollouts of each epoch."""
    chunks = [
        steps[first : first + steps_per_epoch] for first in range(0, len(steps), steps_per_epoch)
    ]
    return [sum(step["success"] for step in epoch) / len(epoch) for epoch in chunks]


def _lines(path: Path) -> Iterable[dict[str, Any]]:
    with path.open(encoding="utf-8") as stream:
        for line in stream:
            yield json.loads(line)


def _start_path(job: ToyJob) -> Path:
    return job.folder / f"{START}-{job.seed}" / "policy.pt"


def _scores(job: ToyJob) -> dict[str, Any]:
    return read_versioned_json(
        job.scores,
        format=FORMAT,
        version=VERSION,
        description="the scores of a run",
        error=TrainError,
    )


def _check_folder(replication: Replication, folder: Path) -> None:
    """Write the replication into the folder, or compare it with the one stored there.

    Raises:
        TrainError: the folder holds another replication.
    """
    data = json.loads(json.dumps(replication.to_data()))
    identity = {key: value for key, value in data.items() if key not in ("source", "arms", "seeds")}
    path = folder / _PLAN
    if path.exists():
        stored = read_versioned_json(
            path,
            format=_PLAN_FORMAT,
            version=VERSION,
            description="the plan of a replication",
            error=TrainError,
        )
        stored_identity = stored.get("replication", {})
        differs = sorted(key for key in identity if stored_identity.get(key) != identity[key])
        if differs:
            raise TrainError(
                f"{folder}: holds a replication with other {', '.join(differs)}; give another --out"
            )
        return
    make_folder(folder)
    plan = {"format": _PLAN_FORMAT, "version": VERSION, "replication": identity}
    write_atomic(path, json.dumps(plan, indent=1) + "\n")


def _run_all(jobs: Sequence[ToyJob], workers: int, say: Say) -> None:
    """Run jobs in processes; one that fails ends the replication with its own error."""
    if workers < 2 or len(jobs) < 2:
        for job in jobs:
            say(run_job(job))
        return
    context = multiprocessing.get_context("spawn")
    with context.Pool(min(workers, len(jobs)), begin_worker) as pool:
        for line in pool.imap_unordered(run_job, jobs):
            say(line)
