"""The results of a replication: gains with paired intervals, tables and a plot."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from scipy import stats

from hijack_data import extras
from hijack_data.errors import ParameterError
from hijack_data.plan import CLEAN

from .arms import ARMS, BASE, MAIN
from .experiment import START
from .settings import Replication

ScoreTable: TypeAlias = Sequence[Mapping[str, Any]]
LEVEL = 0.95
FORMAT = "agenthijack-training-summary"
VERSION = 1
GROUPS = ("visual", CLEAN, "heldout")


def paired_interval(differences: Sequence[float]) -> dict[str, Any]:
    """Return the mean of paired differences with its 95 % interval (Student's t over the seeds).

    Args:
        differences: one a seed, in percentage points; at least 2.

    Raises:
        ParameterError: there are fewer.
    """
    if len(differences) < 2:
        raise ParameterError(f"an interval needs at least 2 seeds, got {len(differences)}")
    values = np.asarray(differences, np.float64)
    mean = float(values.mean())
    low = high = mean
    if np.ptp(values) > 0:
        low, high = stats.ttest_1samp(values, 0.0).confidence_interval(LEVEL)
    return {
        "mean": mean,
        "ci_low": float(low),
        "ci_high": float(high),
        "per_seed": [float(value) for value in values],
    }


def summarise(replication: Replication, scores: ScoreTable) -> dict[str, Any]:
    """Return the summary as JSON data.

    `gain_visual`, `gain_clean` and `gain_heldout` are DA-GRPO's success minus GRPO's, in
    percentage points, on unseen tasks: under the corruptions that DA-GRPO trained with, clean, and
    under those that no run trained with. `arms` compares each arm with GRPO and with DA-GRPO, and
    `success` holds the mean success in percent.

    Args:
        replication: what was compared.
        scores: of every run.
    """
    parts = _condition_groups(replication)
    table = {
        (score["arm"], score["seed"]): _mean_percents(score["success"], parts) for score in scores
    }
    arms = [START, *replication.arms]
    seeds = range(replication.seeds)
    success = {
        arm: {
            name: float(np.mean([table[arm, seed][name] for seed in seeds]))
            for name in (*parts, *_conditions(parts))
        }
        for arm in arms
    }
    summary: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "seeds": replication.seeds,
        "tasks": {"training": len(replication.training), "unseen": len(replication.evaluation)},
        "rollouts": {score["arm"]: score["rollouts"] for score in scores},
        "success": success,
        "arms": {},
    }
    for arm in arms:
        for reference in (BASE, MAIN):
            if reference in arms and arm != reference:
                summary["arms"][f"{arm} - {reference}"] = {
                    name: paired_interval(
                        [table[arm, s][name] - table[reference, s][name] for s in seeds]
                    )
                    for name in parts
                }
    main = summary["arms"].get(f"{MAIN} - {BASE}")
    if main is not None:
        summary.update({f"gain_{name}": main[name] for name in GROUPS if name in main})
    return summary


def arms_table(summary: Mapping[str, Any]) -> str:
    """Return the table as Markdown."""
    success = summary["success"]
    names = [name for name in GROUPS if name in success[START]]
    heads = {"visual": "trained corruptions", CLEAN: "clean", "heldout": "untrained corruptions"}
    lines = [
        "| arm | " + " | ".join(f"{heads[name]} | minus GRPO" for name in names) + " |",
        "| --- |" + " ---: | ---: |" * len(names),
    ]
    for arm, rates in success.items():
        cells = [arm if arm not in ARMS else f"`{arm}`: {ARMS[arm].words}"]
        for name in names:
            gain = summary["arms"].get(f"{arm} - {BASE}", {}).get(name)
            cells += [f"{rates[name]:.1f} %", "" if gain is None else interval_text(gain)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def conditions_table(summary: Mapping[str, Any]) -> str:
    """Return the success under every corruption as Markdown."""
    success = summary["success"]
    names = [name for name in success[START] if name not in GROUPS or name == CLEAN]
    lines = ["| arm | " + " | ".join(names) + " |", "| --- |" + " ---: |" * len(names)]
    for arm, rates in success.items():
        cells = [f"{rates[name]:.1f}" for name in names]
        lines.append(f"| {arm} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def interval_text(gain: Mapping[str, Any]) -> str:
    """Return a gain with its interval, such as `+13.2 [9.3, 16.7]`."""
    return f"{gain['mean']:+.1f} [{gain['ci_low']:.1f}, {gain['ci_high']:.1f}]"


def plot(summary: Mapping[str, Any], path: Path) -> None:
    """Write the gains over GRPO with their intervals as an SVG; equal data give equal bytes."""
    purpose = "the plot"
    rc_context = extras.load("matplotlib", purpose, "train").rc_context
    figure_type = extras.load("matplotlib.figure", purpose, "train").Figure
    names = [name for name in GROUPS if name in summary["success"][START]]
    arms = [arm for arm in summary["success"] if f"{arm} - {BASE}" in summary["arms"]]
    with rc_context({"svg.hashsalt": "agenthijack", "svg.fonttype": "none"}):
        figure = figure_type(figsize=(7, 1.2 + 0.5 * len(arms)), layout="constrained")
        axes = figure.subplots()
        for offset, name in enumerate(names):
            gains = [summary["arms"][f"{arm} - {BASE}"][name] for arm in arms]
            means = [gain["mean"] for gain in gains]
            sides = [
                [gain["mean"] - gain["ci_low"] for gain in gains],
                [gain["ci_high"] - gain["mean"] for gain in gains],
            ]
            rows = [row + 0.2 * (offset - 1) for row in range(len(arms))]
            axes.errorbar(means, rows, xerr=sides, fmt="o", capsize=3, label=name)
        axes.axvline(0, color="grey", linewidth=0.8)
        axes.set_yticks(range(len(arms)), arms)
        axes.invert_yaxis()
        axes.set_xlabel("success minus GRPO's on unseen tasks, percentage points, 95 % intervals")
        axes.legend(loc="best", fontsize="small")
        figure.savefig(path, format="svg", metadata={"Date": None})


def _condition_groups(replication: Replication) -> dict[str, list[str]]:
    """Return the conditions of each group that is reported."""
    groups = {
        "visual": list(replication.trained),
        CLEAN: [CLEAN],
        "heldout": list(replication.untrained),
    }
    return {name: labels for name, labels in groups.items() if labels}


def _conditions(parts: Mapping[str, Sequence[str]]) -> list[str]:
    return [label for labels in parts.values() for label in labels if label != CLEAN]


def _mean_percents(
    rates: Mapping[str, float], parts: Mapping[str, Sequence[str]]
) -> dict[str, float]:
    """Return the success in percent of each group and each condition."""
    percents = {label: 100 * rate for label, rate in rates.items()}
    groups = {
        name: float(np.mean([percents[label] for label in labels]))
        for name, labels in parts.items()
    }
    return {**percents, **groups}
