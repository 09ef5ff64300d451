"""What the everyday faults cost an oracle that does not look, and one that does things again.

    python benchmarks/everyday_faults.py RUNS ...

RUNS are folders of `hijack bench embedded_small --corruptions everyday`. An episode counts if the
same agent played its task clean in the same run.
"""

import json
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import mean
from typing import Any

from common import machine, table

from hijack_data.plan import CLEAN
from hijack_data.runs.run_log import RECORDS

HEADER = ("agent", "corruption", "episodes", "hit", "solved", "solved clean", "steps", "seconds")


def main() -> None:
    """Print the table of the given runs."""
    if not sys.argv[1:]:
        print("Not measured: give folders of runs under the set everyday")
        return
    pairs: dict[tuple[str, str], list[tuple[Any, Any]]] = defaultdict(list)
    for folder in sys.argv[1:]:
        for agent, corruption, record, clean in paired(Path(folder)):
            pairs[agent, corruption].append((record, clean))
    rows = [row(*key, pairs[key]) for key in sorted(pairs)]
    print(f"{machine()}\n\n{table(HEADER, rows)}")
    print("\nSteps and seconds are means under the fault, and clean in brackets.")


def paired(folder: Path) -> Iterator[tuple[str, str, Any, Any]]:
    """Yield agent, corruption, and the records of an episode and of its clean one."""
    lines = (folder / RECORDS).read_text().splitlines()
    judged = [record for record in map(json.loads, lines) if record["status"] == "ok"]
    clean = {(r["agent"], r["task"]): r for r in judged if r["corruption"] == CLEAN}
    for record in judged:
        key = record["agent"], record["task"]
        if record["corruption"] != CLEAN and key in clean:
            yield record["agent"], record["corruption"], record, clean[key]


def row(agent: str, corruption: str, pairs: Sequence[tuple[Any, Any]]) -> list[str]:
    """Return the cells of one agent under one corruption."""
    records = [record for record, _ in pairs]
    clean = [partner for _, partner in pairs]
    return [
        agent,
        corruption,
        str(len(records)),
        str(sum(bool(record.get("inputs")) for record in records)),
        f"{mean(record['score'] for record in records):.2f}",
        f"{mean(record['score'] for record in clean):.2f}",
        *(
            f"{mean(r[key] for r in records):.0f} ({mean(r[key] for r in clean):.0f})"
            for key in ("steps", "seconds")
        ),
    ]


if __name__ == "__main__":
    main()
