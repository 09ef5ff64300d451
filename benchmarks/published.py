"""The runs of agents without a model that docs/results publishes: plays them, and writes reports.

    python benchmarks/published.py NAME [RUNS]

plays what is missing of a run on the embedded desktop, then writes report.json and success.svg into
docs/results/NAME, the records of the episodes, without pictures, into docs/results/NAME/run, and
the tables into an about.md that has places for them. So a run can be spread over days and machines:
RUNS, by default runs/NAME, begins with the records that are there. Those of OSWorld's tasks stay in
RUNS, since they hold its instructions, and those of MiniWoB++, since they name the user's copies of
its pages. With --report-only N nothing is played, and the first N
seeds are reported. Rates are for two cores.

    reference_agents    24 tasks, six agents, three seeds: 4,320 episodes, about ten hours
    all_tasks           the 122 tasks with a plan in words, pixel: 1,220 episodes, about three hours
    ablation_intensity  10 tasks, 13 conditions, pixel: 130 episodes, about 40 minutes
    ablation_content    10 tasks, 12 conditions, pixel: 120 episodes
    ablation_location   10 tasks, 10 conditions, pixel: 100 episodes
    everyday            24 tasks, clean and under the five faults of the set everyday, three
                        agents, three seeds: 1,296 episodes, about four hours
    everyday_guarded    the same for pixel with the guard rules: 432 episodes, two hours
    everyday_levels     3 longer tasks, three of the faults at five severities, three seeds: 144 episodes
    ablation_modules    10 tasks, 10 conditions, pixel and its onlookers: 400 episodes, about an hour
    miniwob             40 tasks of MiniWoB++, oracle, random and dom_agent.py under all but
                        resolution, whose pastes are nodes of the page: 3,240 episodes
    miniwob_pixel       the same for pixel and the 17 of them that have a plan: 459 episodes
    osworld             10 tasks of OSWorld (--osworld TASKS) that an oracle of ours does in windows,
                        two agents: 200 episodes, about 40 minutes
"""

import argparse
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from subprocess import CalledProcessError

import published_table
from common import hijack
from matplotlib import rc_context
from matplotlib.figure import Figure

from hijack_data.corruption import corruption_names
from online_env import tasks
from online_env.browser.miniwob_plans import PLANS
from online_env.osworld.solutions import SOLUTIONS
from online_env.osworld.tasks import load
from online_env.report.build import read_report
from online_env.report.model import RunReport
from online_env.results import reading

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs" / "results"
AGENTS = "oracle,recovering,do_nothing,random,pixel,pixel_onlooker"
OSWORLD = "osworld"
EVERYDAY = ("embedded_core", "--corruptions", "everyday")
# The three quickest with more than twelve actions, so that a fault at step 12 hits them, too.
LONGER = "copy_folder,tick_items,delete_bookmarks"
LEVELS = "clean,missed_input,slipped_pointer,app_freeze"
ALL_TASKS = "all_tasks"
MINIWOB = "miniwob"
MINIWOB_PIXEL = "miniwob_pixel"
UNPUBLISHED = (OSWORLD, MINIWOB, MINIWOB_PIXEL)  # whose records stay where they are
DOM_AGENT = "benchmarks/dom_agent.py:DomAgent"
LABELS = ("clean", *corruption_names()[:9])
PAGES = (
    *("miniwob", "--layer", "dom", "--seeds", "3"),
    *("--corruptions", ",".join(name for name in LABELS if name != "resolution")),
)
PLAYED = {
    "reference_agents": ("embedded_core", "--agent", AGENTS, "--seeds", "3"),
    ALL_TASKS: ("embedded", "--agent", "pixel"),
    "ablation_intensity": ("ablations/intensity", "--agent", "pixel"),
    "ablation_content": ("ablations/content", "--agent", "pixel"),
    "ablation_location": ("ablations/location", "--agent", "pixel"),
    "ablation_modules": ("ablations/modules",),
    MINIWOB: (*PAGES, "--agent", f"oracle,random,{DOM_AGENT}"),
    MINIWOB_PIXEL: (
        *(*PAGES, "--agent", "pixel"),
        *("--tasks", ",".join(f"miniwob/{page}.html" for page in PLANS)),
    ),
    "everyday": (*EVERYDAY, "--seeds", "3", "--agent", "oracle,recovering,pixel"),
    "everyday_guarded": (*EVERYDAY, "--seeds", "3", "--agent", "pixel", "--guard", "rules"),
    "everyday_levels": (
        *("embedded_core", "--tasks", LONGER, "--corruptions", LEVELS),
        *("--severities", "1-5", "--agent", "oracle", "--seeds", "3"),
    ),
    OSWORLD: ("embedded_small", "--agent", "oracle,do_nothing"),
}
RECORDED = ("run.json", "records.jsonl", "sessions.jsonl")  # what `hijack bench --resume` reads
LEAST_DARK = 0.45  # from this success on, a cell is dark enough for white numbers


def main() -> None:
    """Play what is missing, and write report and figure."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("name", choices=PLAYED)
    parser.add_argument("runs", nargs="?", type=Path)
    parser.add_argument("--report-only", type=int, metavar="N")
    parser.add_argument("--osworld", type=Path, metavar="TASKS")
    parser.add_argument("--desktops", type=int)
    options = parser.parse_args()
    name: str = options.name
    if name == OSWORLD and options.osworld is None and not options.report_only:
        parser.error("osworld needs --osworld TASKS, the folder of OSWorld's tasks")
    runs: Path = options.runs or ROOT / "runs" / name
    result = RESULTS / name
    if not runs.exists():
        copy_records(result / "run", runs)
    if not options.report_only:
        words = [*PLAYED[name]]
        if name == OSWORLD and options.osworld:
            words += ["--tasks", ",".join(in_windows(options.osworld))]
        if name == ALL_TASKS:
            words += ["--tasks", ",".join(tasks_with_plans())]
        if options.desktops:
            words += ["--desktops", str(options.desktops)]
        play(words, runs)
    result.mkdir(parents=True, exist_ok=True)
    if name not in UNPUBLISHED:
        copy_records(runs, result / "run")
    report_path = result / "report.json"
    report_path.unlink(missing_ok=True)
    seed_options = ["--seeds", options.report_only] if options.report_only else []
    with suppress(CalledProcessError):
        hijack("report", runs, *seed_options, "--out", report_path)
    draw(read_report(report_path), result / "success.svg")
    page = result / "about.md"
    if name in published_table.TABLES and page.exists():
        run = reading.read(runs)
        if options.report_only:
            run = reading.with_first_seeds(run, options.report_only)
        published_table.rewrite(page, name, run)


def copy_records(source: Path, target: Path) -> None:
    """Copy what is known of a run, without its pictures."""
    if source.resolve() == target.resolve():
        return
    for name in RECORDED:
        if (source / name).exists():
            target.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / name, target / name)


def play(words: Sequence[str], runs: Path) -> None:
    """Begin a run or go on with it.

    The command ends with 1 if an episode could not be played; the report says so, too.
    """
    going_on = ["--resume"] if runs.exists() else []
    with suppress(CalledProcessError):
        hijack("bench", *words, "--out", runs, *going_on)


def tasks_with_plans() -> list[str]:
    """Return the tasks of the suite that have a plan in words, without which `pixel` ends."""
    return [task for task in tasks.names() if tasks.get(task).has_plan]


def in_windows(folder: Path) -> list[str]:
    """Return the files of OSWorld's tasks that a script of ours solves through windows."""
    solved = {task for task, solution in SOLUTIONS.items() if solution.how == "windows"}
    return [str(task.path) for task in load(folder) if task.id in solved]


def draw(report: RunReport, path: Path) -> None:
    """Write the success of each agent under each condition as an SVG."""
    result = [[report.cell(agent, label) for label in report.labels] for agent in report.agents]
    shares = [[0.0 if cell is None else cell.success or 0.0 for cell in row] for row in result]
    with rc_context({"svg.hashsalt": "agenthijack", "svg.fonttype": "none"}):
        figure = Figure(figsize=(9, 1.5 + 0.42 * len(report.agents)), layout="constrained")
        axes = figure.subplots()
        axes.imshow(shares, cmap="Blues", vmin=0, vmax=1.15, aspect="auto")
        axes.set_xticks(range(len(report.labels)), report.labels, rotation=30, ha="right")
        names = [agent.rpartition(":")[2] for agent in report.agents]
        axes.set_yticks(range(len(names)), names)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        for row, values in enumerate(shares):
            for column, share in enumerate(values):
                colour = "white" if share >= LEAST_DARK else "black"
                text = "–" if result[row][column] is None else f"{100 * share:.0f}"
                axes.text(column, row, text, ha="center", va="center", color=colour)
        axes.set_title("Tasks solved, in percent", loc="left", fontsize="medium")
        figure.savefig(path, format="svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
