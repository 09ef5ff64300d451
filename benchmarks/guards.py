"""What a guard gains and costs: the same episodes without and with it, on live desktops.

    python benchmarks/guards.py [OUT] [--agent pixel] [--guard rules] [--tasks A,B] [--corruptions A,B]

Both runs are kept in OUT, by default runs/guards, and are continued if they are there. Prints a row for each corruption: mean
score without and with the guard, mean steps, and what the guard did. In clean episodes each of its
interventions is a false alarm.
"""

import argparse
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from online_env.results import records

CONFIG = """\
desktop: {{provider: embedded, size: [1920, 1080]}}
agents: [{agent}]
tasks: [{tasks}]
corruptions: [{corruptions}]
seeds: [0]
max_steps: {steps}
"""


def run(folder: Path, config: Path, guard: str) -> list[dict[str, Any]]:
    """Run a benchmark, or continue it; return its records."""
    words = [str(config), "--out", str(folder), "--desktops", "1"]
    words += ["--guard", guard] if guard else []
    words += ["--resume"] if folder.exists() else []
    subprocess.run([sys.executable, "-m", "hijack_data.cli", "bench", *words], check=False)
    return records.read(folder).last_attempts


def row(label: str, without: Sequence[dict[str, Any]], guarded: Sequence[dict[str, Any]]) -> str:
    """Return the line of one corruption."""
    each_act = [
        intervention for record in guarded for intervention in record["guard"]["interventions"]
    ]
    acts = [
        intervention["kind"] if intervention["actions"] else f"{intervention['kind']} (reminder)"
        for intervention in each_act
    ]
    counts = ", ".join(f"{acts.count(kind)} {kind}" for kind in dict.fromkeys(acts)) or "nothing"
    cells = [
        "/".join(
            f"{record['score']:g}" if record["score"] is not None else record["status"]
            for record in part
        )
        for part in (without, guarded)
    ]
    steps = [f"{fmean(record['steps'] for record in part):.1f}" for part in (without, guarded)]
    return f"| `{label}` | {cells[0]} | {cells[1]} | {steps[0]} | {steps[1]} | {counts} |"


def main() -> None:
    """Run both, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, nargs="?", default=Path("runs/guards"))
    parser.add_argument("--agent", default="pixel")
    parser.add_argument("--guard", default="rules")
    parser.add_argument("--tasks", default="write_note,rename_file")
    parser.add_argument("--corruptions", default="clean,app_minimization,verification,app_freeze")
    parser.add_argument("--max-steps", type=int, default=20)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    config = options.out / "bench.yaml"
    values = {key: getattr(options, key) for key in ("agent", "tasks", "corruptions")}
    config.write_text(CONFIG.format(**values, steps=options.max_steps))
    runs = [
        run(options.out / name, config, guard)
        for name, guard in (("without", ""), ("guarded", options.guard))
    ]
    print("| corruption | without | guarded | steps | steps, guarded | the guard did |")
    print("|---|---|---|---|---|---|")
    for label in options.corruptions.split(","):
        print(row(label, *[[r for r in records if r["corruption"] == label] for records in runs]))


if __name__ == "__main__":
    main()
