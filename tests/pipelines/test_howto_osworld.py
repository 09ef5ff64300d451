"""The how-to from OSWorld runs to training data: every command of it, in order, on a small result
folder.

The runs are made of our own recordings (real 1920x1080 screens), laid out as OSWorld lays out its
results.
"""

import json
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from hijack_data.cli import hijack
from pipelines import open_dataset

from support.docs import TESTED_IN, blocks_of, clone
from support.formats import write_json, write_lines
from support.pages import open_page

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "howto_osworld_runs.md"
IMAGES = ROOT / "examples" / "recordings"
STEPS = 5
# Task, the recording that it is made of, domain, applications, score. The second one is said to be
# about a browser, so that a lost network shows; no test looks at what the pictures mean.
RUNS = [
    ("5ced85fc-fa1a-4217-95fd-0fb530545ce2", "notes", "os", ["mousepad"], "1.0"),
    ("06fe7178-4491-4589-810f-2e2bc9502122", "rename", "chrome", ["chrome"], "1"),
    ("7688b85f-87a4-4e4a-b2f8-f3d6c3f29b82", "multiply", "os", ["galculator"], "0.0"),
]


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """`results/`: three runs with the first screen saved and pictures after the actions, and their
    tasks."""
    recorded: dict[str, list[dict[str, Any]]] = {}
    for line in (IMAGES / "trajectories.jsonl").read_text().splitlines():
        record = json.loads(line)
        recorded.setdefault(record["trajectory_id"], []).append(record)
    for task, name, domain, apps, score in RUNS:
        folder = tmp_path / "results" / "pyautogui" / "screenshot" / "my-model" / domain / task
        steps = recorded[name][:STEPS]
        screens = [
            "initial_state.png",
            *(f"step_{k}_20250801@101500.png" for k in range(1, STEPS + 1)),
        ]
        lines = [
            {
                "step_num": k,
                "action_timestamp": "20250801@101500",
                "action": step["action_code"],
                "reward": 0,
                "done": False,
                "info": {},
                "screenshot_file": screens[k],
            }
            for k, step in enumerate(steps, 1)
        ]
        write_lines(folder / "traj.jsonl", lines)
        for screen, step in zip(screens, recorded[name], strict=False):
            shutil.copy(IMAGES / step["image"], folder / screen)
        (folder / "result.txt").write_text(f"{score}\n")
        about = {"id": task, "instruction": steps[0]["instruction"], "related_apps": apps}
        write_json(tmp_path / "results" / "examples" / domain / f"{task}.json", about)
    return tmp_path / "results"


def run(language: str, code: str, folder: Path) -> str:
    """Run a block of the page, `hijack` lines one by one."""
    if language == "py":
        return shell([sys.executable, "-W", "error", "-c", code], folder)
    if not code.startswith("hijack"):
        return shell(["bash", "-euo", "pipefail", "-c", code], folder)
    output = ""
    for line in code.splitlines():
        words = line.split()[1:]
        if words[0] == "view":
            output += look(words, folder)
            continue
        result = CliRunner().invoke(hijack, words)
        assert result.exit_code == 0, f"{line}\n{result.output}\n{result.exception!r}"
        output += result.output
    return output


def look(words: list[str], folder: Path) -> str:
    """Serve a page, open it, then press Ctrl-C."""
    command = [sys.executable, "-m", "hijack_data.cli", *words]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            message = process.stdout.readline()
            result = re.search(r"http://127\.0\.0\.1:\d+/\S*", message)
            assert result is not None
            with open_page(result[0]) as page:
                assert page.status == 200
            process.send_signal(signal.SIGINT)
            assert process.wait(60) == 0
        finally:
            process.kill()
    return message


def shell(command: list[str], folder: Path) -> str:
    process = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert process.returncode == 0, process.stderr
    return process.stdout


def test_the_page_from_top_to_bottom(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("cv2", "datasets", "torch"):
        pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_HOME", str(tmp_path / "hf"))
    blocks = [(block.language, block.text) for block in blocks_of(PAGE) if block.kind == TESTED_IN]
    assert [language for language, _ in blocks] == ["sh", "sh", "sh", "sh", "sh", "py", "py"]
    clone(tmp_path)
    output = [run(language, code, tmp_path) for language, code in blocks]
    assert "http://127.0.0.1:" in output[2]

    rows = list(open_dataset(tmp_path / "corrupted"))
    assert len({row["trajectory_id"] for row in rows}) == 2  # not the run that failed
    assert {row["instruction"] for row in rows} == {
        "Write a short packing list in Mousepad and save it as notes.txt in the Documents folder.",
        "In the file manager, rename draft.txt in the Documents folder to report.txt.",
    }
    assert {row["corruption"] for row in rows} == {
        "clean",
        "pop_ups",
        "resolution",
        "marks",
        "subtitle",
        "multi_apps",
        "app_minimization",
        "network_error",
        "verification",
    }
    assert {row["fidelity"] for row in rows} == {"exact", "foreign"}
    assert sum(row["corruption"] == "clean" for row in rows) == 2 * STEPS
    assert all(row["target_visible"] in (None, 1.0) for row in rows)
    assert (tmp_path / "stats.html").is_file()
    assert "examples (chat, actions in ui_tars_1.5)" in output[4]
    assert "verification 2" in output[4]
    assert "torch.Size([3, 1080, 1920])" in output[5] or "torch.Size([3, 540, 960])" in output[5]


def test_the_names_in_the_page_are_those_of_the_reader(results: Path) -> None:
    """The layout that the page shows is the one that is tested."""
    task = RUNS[1][0]
    value, *_ = re.findall(r"```text\n(.*?)```", PAGE.read_text(), re.S)
    (folder,) = results.glob(f"pyautogui/*/*/*/{task}")
    run_line = value.splitlines()[0]
    assert (
        str(folder.relative_to(results.parent))
        .replace(task, "TASK_ID")
        .replace("my-model", "MODEL")
        in run_line
    )
    names = {re.sub(r"step_\d", "step_1", path.name) for path in folder.iterdir()}
    assert all(name in run_line for name in names)
    (about,) = results.glob(f"examples/*/{task}.json")
    assert str(about.relative_to(results.parent)).replace(task, "TASK_ID") in value
