"""Is the augmentation worth using? A small network learns to click, with it and without.

    python benchmarks/proof.py [--seeds 5] [--held-out subtitle marks] [--jobs 2]

Chromium renders the pages once. A run trains for the same steps on the same pages in the same order
from the same weights, whatever it corrupts them with. Of four corruptions one is held out: it is
evaluated on, never trained with. What is done is kept beside the pages, so a second call only
prints. See docs/proof.md.
"""

import argparse
import os
import statistics
from pathlib import Path
from typing import Any

from common import machine, table
from grounding import data, pages, train
from grounding.runs import CONDITIONS, Run, all_runs, counts, perform
from grounding.score import accuracy

PAGES = (
    Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "agenthijack" / "grounding"
)
SEEDED = (800, 100)  # seeded pages to train on and to evaluate on
SPLITS = {"new": "new pages", "site": "sites never seen"}


def main() -> None:
    """Render, train, evaluate and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=train.Settings.steps)
    parser.add_argument(
        "--held-out", nargs="+", choices=tuple(data.CORRUPTIONS), default=["subtitle", "marks"]
    )
    parser.add_argument(
        "--jobs", type=int, default=2, help="networks that train at once, a thread each"
    )
    parser.add_argument("--pages", type=Path, default=PAGES, help="folder for pages and results")
    options = parser.parse_args()
    pages.render(options.pages, *SEEDED)
    settings = train.Settings(steps=options.steps)
    results = perform(
        options.pages, all_runs(options.held_out, options.seeds), settings, options.jobs
    )
    print("\n\n".join(report(results, options.held_out, settings, pages.load(options.pages))))


def report(
    results: dict[Run, dict[str, Any]],
    held_out: list[str],
    settings: train.Settings,
    some: list[pages.Page],
) -> list[str]:
    """Return the paragraphs of the report, with one table for each held-out corruption."""
    return [
        setup(results, settings, some),
        machine(),
        *(f"{heading(name)}\n\n{main_table(results, name)}" for name in held_out),
    ]


def setup(
    results: dict[Run, dict[str, Any]], settings: train.Settings, some: list[pages.Page]
) -> str:
    """Return what was trained and how it was measured."""
    of = {split: [page for page in some if page.split == split] for split in ("train", *SPLITS)}
    many = {
        split: f"{len(p)} pages, {sum(len(q.asked) for q in p)} labels" for split, p in of.items()
    }
    guess = {split: statistics.fmean(1 / len(page.boxes) for page in of[split]) for split in SPLITS}
    spent = [
        [r["seconds"] for run, r in results.items() if bool(run.names) == augmented]
        for augmented in (False, True)
    ]
    without, augmented = (statistics.median(seconds) for seconds in spent)
    seeds = len({run.seed for run in results})
    return (
        f"Share of clicks inside the control that a label names, {seeds} training seeds. Trained on"
        f" {many['train']}, {settings.steps} steps of {settings.batch} pages; evaluated on"
        f" {many['new']} (new pages) and {many['site']} (sites never seen), where a click on any"
        f" control hits {guess['new']:.1%} and {guess['site']:.1%}. Controls of which a corruption"
        f" leaves less than half are not counted, for either. Training a network took {without:.0f}"
        f" s without augmentation and {augmented:.0f} s with it (medians, one thread). Intervals:"
        " 95 %, bootstrap over training seeds and pages; differences are paired."
    )


def heading(held_out: str) -> str:
    """Return the sentence above a table."""
    names = ", ".join(Run(held_out, 0).names)
    return (
        f"Augmentation: one of {names} for each sample, p_clean={data.P_CLEAN}; **{held_out} is"
        " never trained with**."
    )


def main_table(results: dict[Run, dict[str, Any]], held_out: str) -> str:
    """Return the table of one choice of corruptions beside no augmentation."""
    rows = []
    for split, split_folder in SPLITS.items():
        for condition in CONDITIONS:
            without, augmented = (
                counts(results, name, split, condition) for name in (None, held_out)
            )
            result = f"**{condition}, held out**" if condition == held_out else condition
            gain = accuracy(augmented, without)
            points = f"{100 * gain.value:+.1f} ({100 * gain.low:+.1f} to {100 * gain.high:+.1f})"
            rows.append(
                [split_folder, result, str(accuracy(without)), str(accuracy(augmented)), points]
            )
    return table(
        ["evaluated on", "corruption", "no augmentation", "augmented", "difference in points"], rows
    )


if __name__ == "__main__":
    main()
