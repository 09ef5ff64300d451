"""DA-GRPO beside GRPO on the toy desktop: makes docs/results/da_grpo.md and its plot.

    python benchmarks/da_grpo.py [ARMS] [--seeds N]       # such as grpo,da_grpo, or all

Minutes for the two arms of the configuration. Runs are kept in runs/toy: an
interrupted one goes on, and more arms are added to it.
"""

import argparse
import dataclasses
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from common import machine

from pipelines.train.toy import results
from pipelines.train.toy.arms import ARMS, BASE, MAIN
from pipelines.train.toy.experiment import run_replication
from pipelines.train.toy.settings import load_replication
from pipelines.train.train_command import PLOT, SUMMARY, TABLE

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "runs" / "toy"
PAGE = ROOT / "docs" / "results" / "da_grpo.md"
# The page has a block for the two arms alone, with many seeds, and one for all arms.
TWO = "<!-- made by benchmarks/da_grpo.py -->"
ALL = "<!-- made by benchmarks/da_grpo.py all -->"
END = "<!-- end -->"
DEFAULT = (BASE, MAIN)
WORDS = {
    "visual": "under the corruptions that it trained with",
    "clean": "on clean screens",
    "heldout": "under the four corruptions that no run trained with",
}


def main() -> None:
    """Run what is missing, and write the page anew."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("arms", nargs="?", help="all, or some of " + ",".join(ARMS))
    parser.add_argument("--seeds", type=int, help="another number than the configuration's")
    options = parser.parse_args()
    arms = options.arms
    replication = load_replication(ROOT / "configs" / "train" / "toy.yaml")
    if arms:
        names = list(ARMS) if arms == "all" else arms.split(",")
        if unknown := set(names) - set(ARMS):
            parser.error(f"no such arms: {', '.join(sorted(unknown))}; there are {', '.join(ARMS)}")
        replication = dataclasses.replace(replication, arms=tuple(names))
    if options.seeds:
        replication = dataclasses.replace(replication, seeds=options.seeds)
    before = time.monotonic()
    scores = run_replication(replication, FOLDER, say=print)
    minutes = (time.monotonic() - before) / 60
    summary = results.summarise(replication, scores)
    tables = f"{results.arms_table(summary)}\n\n{results.conditions_table(summary)}"
    (FOLDER / SUMMARY).write_text(json.dumps(summary, indent=1) + "\n")
    (FOLDER / TABLE).write_text(tables + "\n")
    results.plot(summary, FOLDER / PLOT)
    print(f"{minutes:.1f} minutes of this call, on {machine()}")
    is_whole = len(replication.arms) > len(DEFAULT)
    picture = PAGE.with_name(f"{PAGE.stem}_arms.svg" if is_whole else f"{PAGE.stem}.svg")
    results.plot(summary, picture)
    begin = ALL if is_whole else TWO
    head, _, remainder = PAGE.read_text().partition(begin)
    _, _, tail = remainder.partition(END)
    text = f"{begin}\n\n{sentences(summary)}\n\n{tables}\n\n![Gains]({picture.name})\n\n{END}"
    PAGE.write_text(head + text + tail)


def sentences(summary: Mapping[str, Any]) -> str:
    """Return the three gains in words."""
    lines = [f"DA-GRPO minus GRPO, {summary['seeds']} seeds, in percentage points:", ""]
    for name, words in WORDS.items():
        gain = summary[f"gain_{name}"]
        better = sum(item > 0 for item in gain["per_seed"])
        text = results.interval_text(gain)
        lines.append(f"* {words}: {text}, above 0 in {better} of {summary['seeds']} seeds")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
