"""Rows that each corruption gives for people's recordings, with and without stated facts.

    python benchmarks/rows_by_source.py

A build that writes nothing is run three times: on the recordings alone, with `--allow-platform-mismatch` (Xfce may
be shown on other desktops), and with `--apps chrome` besides. The corruptions of the machine act
once a recording.
"""

import sys
from pathlib import Path

from common import SHARED, table

from hijack_data.corruption import corruption_names
from pipelines import build

TRAJECTORIES = SHARED.parent / "trajectories"
EXAMPLES = Path(__file__).resolve().parent.parent / "examples" / "recordings"
TOLD = {
    "recordings alone": {},
    "--allow-platform-mismatch": {"allow_platform_mismatch": True},
    "--allow-platform-mismatch --apps chrome": {"allow_platform_mismatch": True, "apps": "chrome"},
}


def rows_of(source: Path, told: dict) -> dict[str, int]:
    """Rows by corruption that a build of a source would give."""
    report = build(source, "unused", corruptions="all", dry_run=True, **told)
    return dict(report.rows)


def main() -> None:
    """Print the table."""
    sources = [EXAMPLES]
    if TRAJECTORIES.is_dir():
        sources += sorted(path for path in TRAJECTORIES.iterdir() if path.is_dir())
    else:
        print(f"Only our own recordings: {TRAJECTORIES} is not here.\n")
    columns = ["clean", *corruption_names()[:9]]
    rows = []
    for source in sources:
        for output, message in TOLD.items():
            print(f"{source.name}, {output} ...", file=sys.stderr, flush=True)
            if source == EXAMPLES and "apps" in message:
                continue  # they state their applications, which are others
            result = rows_of(source, message)
            name = "examples" if source == EXAMPLES else source.name
            rows.append([name, output, *(str(result.get(column, 0)) for column in columns)])
    print(table(["source", "told", *columns], rows))
    print(
        "\nBefore 2026-11-22 the five of the machine gave, on recordings alone: agentnet_raw 1, 1,"
        " 1, 0, 1;"
    )
    print(
        "agentnetbench 1, 3, 0, 0, 0; screenagent 0, 15, 0, 0, 0; webvoyager 0, 0, 0, 2, 0; none"
        " of the"
    )
    print("accidental touches among them could be true, since nobody knew the applications.")
    print(
        "\nBefore 2026-11-28 --allow-platform-mismatch gave, without a word on applications: agentnet_raw 1, 0, 1, 0,"
        " 1; agentnetbench 3, 1, 3, 1, 3;"
    )
    print(
        "screenagent 15, 0, 15, 0, 15; with --apps chrome accidental touches: agentnetbench 2,"
        " screenagent 10. What is missing now showed another application than the recording's, or a"
        " menu that may have hidden another one."
    )


if __name__ == "__main__":
    main()
