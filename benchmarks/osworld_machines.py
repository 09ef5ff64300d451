"""Outcomes and times of episodes on machines behind HTTP, and the hours of 3,690 of them.

cd tests && ../.venv/bin/python -m support.osworld_machine   # a machine; it prints address and reset command
hijack bench osworld --vm ADDRESS --reset-command COMMAND --tasks FILES --out RUN
python benchmarks/osworld_machines.py RUN...
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from hijack_data.plan import CLEAN
from online_env.osworld.stage import LATE_FILES_S
from online_env.results.records import read

EPISODES = 3690
STEPS = 15


def episode_row(record: dict[str, Any]) -> tuple[float, float, float]:
    """Return seconds of set-up, of the rest without the wait, and the steps."""
    wait = 0.0 if record["infeasible"] else LATE_FILES_S
    return (
        record["setup_seconds"],
        record["seconds"] - record["setup_seconds"] - wait,
        record["steps"],
    )


def main(folders: Sequence[str]) -> None:
    """Print the table."""
    if not folders:
        print(
            "Not measured: name runs on a machine behind HTTP (see the first lines of the script)"
        )
        return
    records = [record for folder in folders for record in read(Path(folder)).records]
    scored = [record for record in records if record["status"] == "ok"]
    rows = [episode_row(record) for record in scored]
    setups = sorted(row[0] for row in rows)
    long = [(rest_seconds / steps) for _, rest_seconds, steps in rows if steps >= 4]
    short = [rest_seconds for _, rest_seconds, steps in rows if steps < 4]
    print(f"episodes {len(records)}, ok {len(scored)}, tasks {len({r['task'] for r in records})}")
    print(f"reset and set-up, s: {setups[0]:.1f} / {median(setups):.1f} / {setups[-1]:.1f}")
    if long:
        print(
            f"a step, of episodes of 4 and more, s: {min(long):.1f} / {median(long):.1f} / {max(long):.1f}"
        )
        episode = median(setups) + STEPS * median(long) + LATE_FILES_S
        print(
            f"{STEPS} steps: {episode:.0f} s; {EPISODES} episodes: {EPISODES * episode / 3600:.0f} h"
        )
    if short:
        print(f"all of a shorter episode but its set-up, s: {median(short):.1f}")
    print("condition: episodes, solved, with effects that were proved")
    for label in dict.fromkeys(record["corruption"] for record in scored):
        cell = [record for record in scored if record["corruption"] == label]
        solved = sum(record["score"] == 1 for record in cell)
        proved = sum(bool(record["effects"]) for record in cell)  # a failed probe is not "ok"
        print(f"{label}: {len(cell)}, {solved}, {proved}")
    for record in records:
        if record["status"] != "ok" or (record["corruption"] == CLEAN and record["score"] != 1):
            reason = record["problem"] or record["said"] or record["reason"]
            print(f"{record['task'][:8]} {record['corruption']} {record['status']}: {reason}")


if __name__ == "__main__":
    main(sys.argv[1:])
