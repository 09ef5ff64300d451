"""What the nine corruptions do to agents without a model: makes docs/results/reference_agents.

    python benchmarks/reference_agents.py [RUNS]

Plays the 24 tasks of `embedded_core` on the embedded desktop, clean and under all nine, with five
agents and three seeds: 3,600 episodes, seven to eight hours on two cores. RUNS, by default
runs/reference, is kept: what was broken off goes on, and what is there is only reported again.
With --report-only N nothing is played, and the first N seeds are reported.
"""

import argparse
from contextlib import suppress
from pathlib import Path
from subprocess import CalledProcessError

from common import hijack
from matplotlib import rc_context
from matplotlib.figure import Figure

from online_env.report.build import read_report
from online_env.report.model import RunReport

ROOT = Path(__file__).resolve().parents[1]
RESULT = ROOT / "docs" / "results" / "reference_agents"
AGENTS = "oracle,recovering,do_nothing,random,pixel"
PLAYED = ("embedded_core", "--agent", AGENTS, "--corruptions", "all", "--seeds", 3)
LEAST_DARK = 0.45  # from this success on, a cell is dark enough for white numbers


def main() -> None:
    """Play what is missing, and write report and figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="?", type=Path, default=ROOT / "runs" / "reference")
    parser.add_argument("--report-only", type=int, metavar="N")
    options = parser.parse_args()
    runs: Path = options.runs
    written = RESULT / "report.json"
    written.unlink(missing_ok=True)
    RESULT.mkdir(parents=True, exist_ok=True)
    chosen = ["--seeds", options.report_only] if options.report_only else []
    # Both end with 1 if an episode could not be played or is missing; the report says so, too.
    if not chosen:
        going_on = ["--resume"] if runs.exists() else []
        with suppress(CalledProcessError):
            hijack("bench", *PLAYED, "--out", runs, *going_on)
    with suppress(CalledProcessError):
        hijack("report", runs, *chosen, "--out", written)
    draw(read_report(written), RESULT / "success.svg")


def draw(report: RunReport, path: Path) -> None:
    """Write the success of each agent under each condition as an SVG."""
    found = [[report.cell(agent, label) for label in report.labels] for agent in report.agents]
    shares = [[0.0 if cell is None else cell.success or 0.0 for cell in row] for row in found]
    with rc_context({"svg.hashsalt": "agenthijack", "svg.fonttype": "none"}):
        figure = Figure(figsize=(9, 1.5 + 0.42 * len(report.agents)), layout="constrained")
        axes = figure.subplots()
        axes.imshow(shares, cmap="Blues", vmin=0, vmax=1.15, aspect="auto")
        axes.set_xticks(range(len(report.labels)), report.labels, rotation=30, ha="right")
        axes.set_yticks(range(len(report.agents)), report.agents)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        for row, values in enumerate(shares):
            for column, share in enumerate(values):
                colour = "white" if share >= LEAST_DARK else "black"
                text = "–" if found[row][column] is None else f"{100 * share:.0f}"
                axes.text(column, row, text, ha="center", va="center", color=colour)
        axes.set_title("Tasks solved, in per cent", loc="left", fontsize="medium")
        figure.savefig(path, format="svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
