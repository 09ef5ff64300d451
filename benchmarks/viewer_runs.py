"""How long `hijack view RUNS` takes to open runs of 3,690 and of 33,210 episodes.

A small run is really played (on a desktop that shows pictures), and its episodes are then written
again and again under other names, with their pictures linked and their hashes made anew. Chromium
is needed. `--keep FOLDER` keeps the runs.
"""

import argparse
import itertools
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from common import machine, spread, table
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from hijack_data.runs.run_log import FORMAT, VERSION, episode_slug, sha256_hex  # noqa: E402

from support.chromium import Browser, chromium  # noqa: E402
from support.viewed_runs import PLANNERS, Cast, play_run  # noqa: E402

LABELS = (
    "clean",
    "pop_ups",
    "resolution",
    "marks",
    "subtitle",
    "multi_apps",
    "accidental_touch",
    "app_minimization",
    "network_error",
    "verification",
)
TASKS = 41
AGENTS = ("oracle", "pixel", "gpt-9")
SIZES = {3690: 3, 33210: 27}  # seeds
ROUNDS = 5
LISTED = "document.querySelectorAll('#list li').length > 5"
SHOWN = (
    "!document.getElementById('episode').hidden && !document.querySelector('.frame.loading')"
    " && document.querySelector('.after').naturalWidth > 0"
)


@dataclass(frozen=True)
class Template:
    """An episode that was played: its record, its lines and its pictures."""

    record: Mapping[str, Any]
    lines: list[dict[str, Any]]
    pictures: list[Path]


def templates(folder: Path) -> dict[str, Template]:
    """Play one task under each label that needs no machine, with pictures of a real desktop."""
    shots = sorted((ROOT / "examples" / "recordings" / "images").glob("notes-*.png"))
    screens = [np.array(Image.open(path).convert("RGB")) for path in shots]
    cast = Cast(agents=("gpt-9",), tasks=("write_note",), labels=tuple(PLANNERS), screens=screens)
    run = play_run(folder, cast)
    entries: dict[str, Template] = {}
    for home in sorted((run / "episodes").iterdir()):
        record = json.loads((home / "episode.json").read_bytes())
        lines = [json.loads(line) for line in (home / "steps.jsonl").read_bytes().splitlines()]
        entries[record["corruption"]] = Template(
            record, lines, sorted((home / "frames").glob("*.png"))
        )
    return entries


def write_run(folder: Path, made: Mapping[str, Template], seeds: int) -> Path:
    """Write a run of all agents, tasks, labels and seeds."""
    folder.mkdir()
    cases = list(itertools.product(AGENTS, range(TASKS), LABELS, range(seeds)))
    ids = [
        episode_slug(f"task_{task:02}", label, seed, agent, 0) for agent, task, label, seed in cases
    ]
    head = {
        "format": FORMAT,
        "version": VERSION,
        "config": {"agents": AGENTS, "corruptions": LABELS, "seeds": list(range(seeds))},
        "episodes": ids,
        "versions": {},
        "created": 0.0,
    }
    content = json.dumps(head, indent=1).encode()
    (folder / "run.json").write_bytes(content)
    before = content
    draws = np.random.default_rng(7).random(len(cases))
    with (folder / "records.jsonl").open("wb") as journal:
        for name, case, draw in zip(ids, cases, draws, strict=True):
            record = episode(folder, name, case, float(draw), made)
            digest = sha256_hex((folder / "episodes" / name / "episode.json").read_bytes())
            links = {"previous": sha256_hex(before), "episode_sha256": digest}
            before = json.dumps({**record, **links}).encode()
            journal.write(before + b"\n")
    return folder


def episode(
    folder: Path,
    name: str,
    case: tuple[str, int, str, int],
    draw: float,
    made: Mapping[str, Template],
) -> dict[str, Any]:
    """Write one episode: that of a template under another name."""
    agent, task, label, seed = case
    template = made.get(label) or made["app_minimization"]
    home = folder / "episodes" / name
    (home / "frames").mkdir(parents=True)
    for picture in template.pictures:
        (home / "frames" / picture.name).hardlink_to(picture)
    last = sha256_hex(name.encode())
    content = b""
    for line in template.lines:
        text = json.dumps(line | {"previous": last}).encode()
        content += text + b"\n"
        last = sha256_hex(text)
    (home / "steps.jsonl").write_bytes(content)
    solved = draw < (0.9 if label == "clean" else 0.5)
    record = {
        **template.record,
        "id": name,
        "agent": agent,
        "task": f"task_{task:02}",
        "sample": f"task_{task:02}",
        "instruction": f"Do task {task}: write a packing list, and save it in Documents",
        "corruption": label,
        "seed": seed,
        "task_seed": seed,
        "score": 1.0 if solved else 0.0,
        "reason": "as wanted" if solved else "the file is not there",
        "chain": last,
    }
    (home / "episode.json").write_text(json.dumps(record))
    return record


@contextmanager
def viewing(run: Path) -> Iterator[tuple["subprocess.Popen[str]", str, float]]:
    """Start `hijack view`; yields it, its address, and the seconds until it was printed."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "hijack_data.cli", "view", str(run)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        result = re.search(r"http://\S+", process.stdout.readline())
        assert result is not None
        yield process, result[0], time.perf_counter() - start
    finally:
        process.kill()
        process.wait()


def cpu_seconds(process: "subprocess.Popen[str]") -> float:
    """Return the processor time that a process has taken: another's work does not count."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def until(browser: Browser, work: str, done: str) -> float:
    """Run something in the page; return the seconds until a condition holds."""
    start = time.perf_counter()
    browser.js(work)
    browser.until(done)
    return time.perf_counter() - start


def measure(run: Path, browser: Browser) -> dict[str, list[float]]:
    """Return the seconds of each thing, once a round."""
    entries: dict[str, list[float]] = {}
    for turn in range(ROUNDS):
        with viewing(run) as (process, url, started):
            start = time.perf_counter()
            browser.open(url, 1440, 900)
            browser.until(LISTED)
            page = time.perf_counter() - start
            processor_seconds = cpu_seconds(process)
            rows = browser.js("document.querySelectorAll('#list li').length")
            assert rows < 100, f"{rows} rows stand in the page: the list is not windowed"
            label = LABELS[1 + turn]
            search = until(
                browser,
                f"location.hash = '#q=packing&corruption={label}'",
                f"document.getElementById('count').textContent.includes(' of ') && {LISTED} &&"
                f" [...document.querySelectorAll('#list .label')].every(e => e.textContent === '{label}')",
            )
            name = episode_slug("task_20", label, turn % 3, "pixel", 0)
            result = until(browser, f"location.hash = '#episode={name}&step=2'", SHOWN)
            browser.js("document.querySelector('.after').removeAttribute('src')")
            step = until(browser, f"location.hash = '#episode={name}&step=3'", SHOWN)
        for value, seconds in {
            "hijack view: address printed": started,
            "page: list drawn": page,
            "together: opening": started + page,
            "processor time of hijack view for that": processor_seconds,
            "filter and search": search,
            "episode, with its picture": result,
            "next step, with its picture": step,
        }.items():
            entries.setdefault(value, []).append(seconds)
    return entries


def limits(run: Path) -> dict[str, list[float]]:
    """Return what no viewer in Python could save: its start, and parsing the journal."""
    entries: dict[str, list[float]] = {
        "limit: python -c 'import numpy, PIL'": [],
        "limit: JSON": [],
    }
    for _ in range(ROUNDS):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", "import numpy, PIL.Image"], check=True)
        entries["limit: python -c 'import numpy, PIL'"].append(time.perf_counter() - start)
        start = time.perf_counter()
        with (run / "records.jsonl").open("rb") as journal:
            for line in journal:
                json.loads(line)
        entries["limit: JSON"].append(time.perf_counter() - start)
    return entries


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as temporary:
        home = arguments.keep or Path(temporary)
        home.mkdir(parents=True, exist_ok=True)
        result = templates(home / "templates") if not (home / "templates").exists() else None
        results: dict[int, dict[str, list[float]]] = {}
        with chromium(Path(temporary) / "profile") as browser:
            for size, seeds in SIZES.items():
                run = home / f"run-{size}"
                if result is not None:
                    write_run(run, result, seeds)
                results[size] = {**measure(run, browser), **limits(run)}
                megabytes = (run / "records.jsonl").stat().st_size / 2**20
                print(f"{size} episodes, journal of {megabytes:.1f} MB", file=sys.stderr)
    print(f"{machine()}\n")
    rows = [[item, *(spread(results[size][item], 2) for size in SIZES)] for item in results[3690]]
    processor_seconds = {
        n: min(value["processor time of hijack view for that"]) for n, value in results.items()
    }
    parsing = {n: min(value["limit: JSON"]) for n, value in results.items()}
    rows.append(
        [
            "processor time, to that of JSON",
            *(f"{processor_seconds[n] / parsing[n]:.2f}x" for n in SIZES),
        ]
    )
    print(
        table(["seconds, min / median / max of 5", *(f"{size:,} episodes" for size in SIZES)], rows)
    )


if __name__ == "__main__":
    main()
