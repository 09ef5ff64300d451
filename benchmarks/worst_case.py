"""The worst cases that searches found, and how much of each loss was luck.

    python benchmarks/worst_case.py SEARCH ...

SEARCH is a folder of `hijack search`.
"""

import json
import sys
from pathlib import Path
from typing import Any

from common import machine, table

from hijack_data.corruption import make_corruption

HEADER = ("agent", "corruption", "found", "confirmed", "shrinkage")


def main() -> None:
    """Print the table of the given searches."""
    if not sys.argv[1:]:
        print("Not measured: give folders of hijack search")
        return
    rows: list[list[str]] = []
    for folder in map(Path, sys.argv[1:]):
        worst = json.loads((folder / "worst.json").read_bytes())
        trials = json.loads((folder / "trials.json").read_bytes())
        agent = f"{Path(worst['agent']).name}, {len(trials)} tried"
        rows += [[agent, *row(plan)] for plan in worst["plans"]]
    print(f"{machine()}\n\n{table(HEADER, rows)}")
    print("\nPoints of score lost, with the number of cases in brackets.")


def row(plan: Any) -> list[str]:
    """Return the cells of one corruption."""
    ((name, settings),) = plan["corruption"].items()
    parts = settings["parts"] if name == "sequence" else [{name: settings}]
    named = [pair for part in parts for pair in part.items()]
    first_loss, confirmed = (100 * plan[key]["loss"] for key in ("found", "confirmed"))
    return [
        "; ".join(short(*pair) for pair in named),
        f"{first_loss:.0f} ({plan['found']['n']})",
        f"{confirmed:.0f} ({plan['confirmed']['n']})",
        f"{first_loss - confirmed:.0f}",
    ]


def short(name: str, values: dict[str, Any]) -> str:
    """Return a corruption with the settings that are not its defaults."""
    default = make_corruption(name).params()
    changes = [f"{key} {values[key]}" for key in default if values[key] != default[key]]
    return f"{name} ({', '.join(changes)})" if changes else name


if __name__ == "__main__":
    main()
