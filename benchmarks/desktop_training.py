"""Training on the real desktop: makes docs/results/desktop_training.md.

    python benchmarks/desktop_training.py [--seeds N] [--desktops N] [--out DIR]

Three ways to train the agent of `desktop_agent.py` on the suite's training tasks, each adding one
thing to the one before: `clean` imitates recordings of clean desktops, `augmented` imitates a
dataset that `hijack build` made from them (all nine corruptions, `--label-policy recover`), and
`da_grpo` goes on from there by playing on desktops that are disturbed. Then `hijack bench` scores
each on held-out tasks, clean and under all nine. Takes hours on two cores; whatever was finished is
kept in DIR, and the same command goes on from there.
"""

import argparse
import contextlib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import mean
from subprocess import CalledProcessError
from typing import Any

import gymnasium
import numpy as np
import torch
import yaml
from common import hijack, table
from desktop_agent import GO_ON, NUMBERS, SKILLS, ChoiceNetwork, ChoicePolicy, SkilledHands, small

import hijack_data as hj
from hijack_data import corruption_names
from hijack_data.types import UInt8Array
from online_env import CorruptedEnv, EmbeddedDesktop
from online_env.environment import SmallTasks
from online_env.results import records
from pipelines import open_dataset
from pipelines.train.replay import ReplayBuffer
from pipelines.train.sampler import CorruptionSampler
from pipelines.train.split import check_split
from pipelines.train.toy.results import interval_text, paired_interval
from pipelines.train.trainer import Trainer, TrainSettings

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "results" / "desktop_training.md"
BEGIN, END = "<!-- made by benchmarks/desktop_training.py -->", "<!-- end -->"
RECORDED = (
    "choose_icons",
    "convert_line_ends",
    "pack_folder",
    "set_permissions",
    "find_mention",
    "count_errors",
    "rename_file",
    "insert_line",
    "trash_and_restore",
    "fix_setting",
    "set_font_size",
    "set_wallpaper",
    "archive_sender",
    "save_page",
    "remove_expensive",
    "buy_cheapest_rated",
    "change_quantities",
    "answer_invitation",
    "write_article",
    "forward_mail",
)
PLAYED = (*RECORDED[:12:2], *RECORDED[12:16])  # by the rollouts: short ones
HELD_OUT = ("mark_found_unread", "set_workspaces")
# The paper trains with the visual disruptors only.
TRAINED = tuple(
    name for name in corruption_names() if hj.make_corruption(name).category == "visual_disruptor"
)
REMEDIES = {
    "verification": "unlock",
    "app_minimization": "restore",
    "multi_apps": "switch",
    "accidental_touch": "escape",
    "network_error": "reload",
}
ARMS = ("clean", "augmented", "da_grpo")
EPOCHS, ROLLOUTS = 2, 4
MAX_STEPS = 12  # of a rollout
MAX_SCORED = 25  # of an episode that is scored
LEARNING_RATE = 1e-3
CURIOUS = 0.2  # what an imitation leaves to skills that were not shown


def main() -> None:
    """Do what is missing, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--desktops", type=int, default=ROLLOUTS)
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "desktop")
    args = parser.parse_args()
    check_split(RECORDED, HELD_OUT)
    out: Path = args.out
    out.mkdir(parents=True, exist_ok=True)
    collect(out, args.desktops)
    screens = screens_of(out)
    for seed in range(args.seeds):
        for arm, (pictures, labels) in screens.items():
            if not policy_file(out, arm, seed).exists():
                keep(cloned(pictures, labels, seed), out, arm, seed)
        if not policy_file(out, "da_grpo", seed).exists():
            keep(trained(out, seed), out, "da_grpo", seed)
    evaluate(out, args.seeds, args.desktops)
    write_page(out, args.seeds)


def bench(config: object, run: Path, *options: object) -> None:
    """Play a run, or what is left of it."""
    hijack("bench", config, "-o", run, *(["--resume"] if run.exists() else []), *options)


def collect(out: Path, desktops: int) -> None:
    """Record the training tasks on clean desktops, and build the dataset with corruptions."""
    if not (out / "rows").exists():
        options = ["--tasks", ",".join(RECORDED), "--corruptions", "clean"]
        bench("embedded", out / "recorded", "--agent", "oracle", "--desktops", desktops, *options)
        labels = ["--corruptions", "all", "--label-policy", "recover"]
        hijack("build", out / "recorded", "-o", out / "rows", *labels)


def screens_of(out: Path) -> dict[str, tuple[UInt8Array, torch.Tensor]]:
    """Return what each arm imitates: screens, uint8 `[N, 90, 160, 3]`, and what is right there."""
    pictures: list[UInt8Array] = []
    labels: list[int] = []
    clean: list[int] = []
    for number, row in enumerate(open_dataset(out / "rows")):
        name = row["corruption"]
        pictures.append(small(np.asarray(row["screenshot"])))
        labels.append(NUMBERS[REMEDIES[name]] if name in REMEDIES and row["event"] else GO_ON)
        if name == "clean":
            clean.append(number)
    everything, right = np.stack(pictures), torch.tensor(labels)
    return {"clean": (everything[clean], right[clean]), "augmented": (everything, right)}


def cloned(pictures: UInt8Array, labels: torch.Tensor, seed: int) -> ChoiceNetwork:
    """Return a network that imitates and stays curious; rare skills are shown more often."""
    torch.manual_seed(seed)
    network = ChoiceNetwork()
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-3)
    counts = torch.bincount(labels, minlength=len(SKILLS)).float()
    weights = counts.rsqrt()[labels]
    screens = torch.from_numpy(pictures)
    for _ in range(150):
        indices = torch.multinomial(weights, 64, replacement=True)
        loss = torch.nn.functional.cross_entropy(
            network(screens[indices]), labels[indices], label_smoothing=CURIOUS
        )
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return network


class SkillEnv(gymnasium.Env[dict[str, Any], str]):
    """A disturbed desktop on which an action is the name of a skill."""

    def __init__(self, desktop: EmbeddedDesktop) -> None:
        self._stage = SmallTasks(desktop)
        self._env = CorruptedEnv(self._stage, max_steps=MAX_STEPS)
        self._hands = SkilledHands()
        self._screenshot: UInt8Array = np.zeros((1, 1, 3), np.uint8)

    @property
    def record(self) -> Mapping[str, Any] | None:
        """How the episode was judged."""
        return self._env.record

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode."""
        self._hands.reset()
        calls, info = self._env.reset(seed=seed, options=options)
        self._hands.prepare(self._stage.task, self._stage.machine)
        return self._seen(calls), info

    def step(self, action: str) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Carry out a skill."""
        code = self._hands.act(action, self._screenshot)
        observations, *further_values = self._env.step(code)
        return self._seen(observations), *further_values

    def truncate(self) -> None:
        """Have the episode judged as it stands."""
        self._env.truncate()

    def close(self) -> None:
        """End the desktop."""
        self._hands.reset()
        self._env.close()

    def _seen(self, seen: dict[str, Any]) -> dict[str, Any]:
        self._screenshot = seen["screenshot"]
        return {**seen, "screenshot": small(self._screenshot)}


@contextlib.contextmanager
def environments(count: int) -> Iterator[list[SkillEnv]]:
    """Start desktops, and end them."""
    with contextlib.ExitStack() as stack:
        yield [
            stack.enter_context(contextlib.closing(SkillEnv(EmbeddedDesktop.up())))
            for _ in range(count)
        ]


def trained(out: Path, seed: int) -> ChoiceNetwork:
    """Return what DA-GRPO makes of the network that imitates the augmented recordings."""
    network = ChoiceNetwork()
    network.load_state_dict(torch.load(policy_file(out, "augmented", seed), weights_only=True))
    planner = hj.OneOf([hj.make_corruption(name) for name in TRAINED])
    settings = TrainSettings(
        epochs=EPOCHS,
        rollouts=ROLLOUTS,
        batch=1,
        max_steps=MAX_STEPS,
        learning_rate=LEARNING_RATE,
        seed=seed,
        save_every=1,
    )
    with environments(ROLLOUTS) as desktops:
        trainer = Trainer(
            ChoicePolicy(network),
            desktops,
            tasks=PLAYED,
            sampler=CorruptionSampler(planner, seed=seed),
            settings=settings,
            replay=ReplayBuffer(seed=seed),
            folder=out / f"da_grpo-{seed}",
            threads=ROLLOUTS,
            report=print,
        )
        trainer.resume()
        while trainer.step_number < trainer.steps:
            report = trainer.step()
            trainer.save()
            print(f"seed {seed}, step {report.step + 1} of {trainer.steps}: {report.success:.2f}")
    return network


def policy_file(out: Path, arm: str, seed: int) -> Path:
    """Return where the weights of a policy are."""
    return out / f"{arm}_{seed}.pt"


def keep(network: ChoiceNetwork, out: Path, arm: str, seed: int) -> None:
    """Write the weights of a policy."""
    torch.save(network.state_dict(), policy_file(out, arm, seed))


def evaluate(out: Path, seeds: int, desktops: int) -> None:
    """Score every policy on the held-out tasks."""
    agents = (out / "agents.py").resolve()
    lines = ["import sys", f"sys.path.insert(0, {str(Path(__file__).parent)!r})"]
    lines += ["from desktop_agent import Learned"]
    expected: list[str] = []
    for arm in ARMS:
        for seed in range(seeds):
            lines.append(f"class {arm}_{seed}(Learned):")
            lines.append(f"    policy = {str(policy_file(out, arm, seed).resolve())!r}")
            expected.append(f"{agents}:{arm}_{seed}")
    agents.write_text("\n".join(lines) + "\n")
    setting = {
        "desktop": {"provider": "embedded", "size": [1920, 1080]},
        "agents": expected,
        "tasks": list(HELD_OUT),
        "corruptions": "all",
        "seeds": [0],
        "max_steps": MAX_SCORED,
    }
    config = out / "scored.yaml"
    config.write_text(yaml.safe_dump(setting))
    run = out / "scored"
    try:
        # In this process: the agents' hands ask the task, which agents in their own do not get.
        bench(config, run, "--desktops", desktops, "--in-process")
    except CalledProcessError:  # an episode may have failed, which counts; none may be missing
        if len(records.read(run).records) < len(expected) * len(HELD_OUT) * (
            1 + len(corruption_names())
        ):
            raise


def successes(out: Path) -> dict[tuple[str, int], dict[str, list[float]]]:
    """Return the scores of each arm and seed by corruption, of the cases that all have played."""
    scores: dict[tuple[str, str], dict[tuple[str, int], float]] = defaultdict(dict)
    for record in records.read(out / "scored").records:
        if record["status"] != "invalid":
            arm, _, seed = record["agent"].rpartition(":")[2].rpartition("_")
            case = record["corruption"], record["task"]
            scores[case][arm, int(seed)] = record["score"] or 0.0
    everybody = {policy for policies in scores.values() for policy in policies}
    result: dict[tuple[str, int], dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for (corruption, _), policies in scores.items():
        if policies.keys() == everybody:
            for policy, score in policies.items():
                result[policy][corruption].append(score)
    return result


def write_page(out: Path, seeds: int) -> None:
    """Replace the part of the page that is made."""
    result = successes(out)
    columns = ("clean", *corruption_names())

    def success(arm: str, seed: int, labels: Sequence[str]) -> float:
        return 100 * mean(score for label in labels for score in result[arm, seed][label])

    groups = {
        "clean": ["clean"],
        "trained corruptions": list(TRAINED),
        "other corruptions": [name for name in corruption_names() if name not in TRAINED],
    }
    rows: list[list[str]] = []
    for arm in ARMS:
        row = [f"`{arm}`"]
        for labels in groups.values():
            values = [success(arm, seed, labels) for seed in range(seeds)]
            row.append(f"{mean(values):.1f} %")
            base = [success("clean", seed, labels) for seed in range(seeds)]
            gain = paired_interval(
                [value - second for value, second in zip(values, base, strict=True)]
            )
            row.append("" if arm == "clean" else interval_text(gain))
        rows.append(row)
    header = ["arm"]
    for name in groups:
        header += [name, "minus `clean`"]
    by_label = [
        [
            f"`{arm}`",
            *[f"{mean(success(arm, s, [name]) for s in range(seeds)):.0f}" for name in columns],
        ]
        for arm in ARMS
    ]
    count = sum(len(scores) for value in result.values() for scores in value.values())
    episodes = (
        f"{count} episodes of `hijack bench` on {len(HELD_OUT)} held-out tasks, {seeds} seeds."
    )
    parts = [BEGIN, episodes, table(header, rows), table(["arm", *columns], by_label), END]
    text = (
        PAGE.read_text() if PAGE.exists() else f"# Training on the real desktop\n\n{BEGIN}{END}\n"
    )
    head, _, remainder = text.partition(BEGIN)
    _, _, tail = remainder.partition(END)
    PAGE.write_text(head + "\n\n".join(parts) + tail)


if __name__ == "__main__":
    main()
