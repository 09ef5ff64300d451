"""One line about every command, as data, so that `hijack --help` and completion import no command.

A test compares each line with the command's own docstring.
"""

SECTIONS = {
    "Corruptions": {
        "list": "List all corruptions: the paper's nine, plug-ins, the set everyday.",
        "show": "Show one corruption: its parameters, defaults, ranges and severity levels.",
        "demo": "Corrupt screens, build a dataset, corrupt a live desktop.",
        "apply": "Corrupt one picture, or all of a folder.",
        "gallery": "Make one self-contained HTML page of before/after pictures.",
        "new": "Write a file to begin with.",
        "check": (
            "Run the conformance suites on what a file holds: corruptions, live effects, agents,"
            " tasks."
        ),
        "doctor": "List what is installed, what is missing, and the commands that add it.",
    },
    "Datasets and training": {
        "inspect": "Show the content of recordings, and the result of a build, without building.",
        "build": "Build a Hugging Face dataset from recorded trajectories.",
        "verify": "Check every byte, picture, plan and label of a dataset, or of a run.",
        "stats": "Show the figures of a dataset: counts, visible targets, changed pixels.",
        "export": (
            "Export a dataset as chat rows, verl Parquet, WebDataset tar files or onlooker data."
        ),
        "view": "Look through a dataset, or the episodes of a run, in a browser.",
        "train": (
            "Train with corruptions (DA-GRPO) and without (GRPO), and compare them on unseen tasks."
        ),
    },
    "Live desktops and scores": {
        "desktop": "Real Linux desktops on this machine, without a virtual machine.",
        "browser": ("A corrupted Chromium for Playwright, browser-use and other DevTools clients."),
        "bench": "Run agents on a live desktop, clean and corrupted.",
        "serve": (
            "Serve desktops with the tasks of a benchmark to trainers, as an OpenEnv environment."
        ),
        "mcp": "Let any MCP client play one corrupted, scored episode.",
        "score": "Score agents on the rows of a dataset, clean and corrupted, without a desktop.",
        "search": "Find the corruptions under which an agent does worst, within a budget.",
        "mine": "Group the lost episodes of a run, and write a benchmark for each group.",
        "report": "Show the results of a run, such as: hijack report runs/small.",
        "compare": (
            "Compare a run case by case with an earlier one: hijack compare runs/new runs/old."
        ),
        "gate": "Exit with 1 if a score is too low: hijack gate RUNS --fail-under retention=0.8.",
        "certify": (
            "Certify how much of its clean success an agent keeps: hijack certify RUNS -o"
            " FILE.json."
        ),
        "leaderboard": "Rank the agents of all runs in a folder on one page.",
        "sign": "Sign a run for its recipients, after verifying it: hijack sign RUNS --key KEY.",
        "tasks": "List the tasks of the suite, which come with the library.",
        "osworld": "OSWorld's own environment and evaluators on our desktops.",
    },
}
SUMMARIES = {name: line for lines in SECTIONS.values() for name, line in lines.items()}
