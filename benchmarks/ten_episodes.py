"""The ten episodes with pictures that docs/results shows: plays them, and writes them to one page.

    python benchmarks/ten_episodes.py [RUNS]

`pixel` plays one task on the embedded desktop, clean and under each corruption, into RUNS (by
default runs/ten_episodes; a run that is there goes on). Some five minutes on two cores.
"""

import sys
from pathlib import Path

from common import hijack

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "results" / "ten_episodes_viewer.html"
PLAYED = ("embedded", "--agent", "pixel", "--tasks", "buy_cheapest_rated", "--seeds", "1")


def main() -> None:
    """Play, check and export."""
    runs = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "runs" / "ten_episodes"
    resume = ("--resume",) if runs.exists() else ()
    hijack("bench", *PLAYED, "--out", runs, *resume)
    hijack("verify", runs)
    hijack("view", runs, "--export", PAGE, "--small")


if __name__ == "__main__":
    main()
