"""A real third-party package with one thing of each kind, really installed.

It is found through its entry points, and used from the command line like ours. Its desktop is made
of paper, so nothing here needs a real one; `live/test_doors_live.py` uses one.
"""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.installing import install

PACKAGE = Path(__file__).parent / "ext_package"
PICTURES = Path(__file__).parents[1] / "examples" / "recordings" / "images"
KINDS = {
    "corruptions": ("dead_pixels", "quiet_hours"),
    "effects": ("quiet",),
    "edits": ("quiet",),
    "readers": ("clicks_csv",),
    "exports": ("lines",),
    "engines": ("backwards",),
    "providers": ("paper",),
    "tasks": ("press_ok",),
    "agents": ("presser",),
}
BENCH = """\
desktop: {provider: paper, size: [640, 480]}
agents: [presser, do_nothing]
tasks: [press_ok]
corruptions: [clean, quiet_hours]
"""


AGENT = """\
class Mine:
    def predict(self, instruction, obs):
        if (obs["screenshot"] == (0, 60, 0)).all(axis=-1).any():
            return "It is dark: pressed.", ["DONE"]
        return instruction, ["pyautogui.click(70, 70)"]
"""
TASK = """\
from paper import PressOk

class Mine(PressOk):
    name = "press_mine"
"""
READER = """\
from clicks import ClicksCsv

class Mine(ClicksCsv):
    name = "mine_csv"
"""
WRITER = """\
class Mine:
    def __init__(self, folder):
        self.file = open(folder / "mine.txt", "w")

    def shard(self, index, examples):
        self.file.writelines(f"{example.answer}\\n" for example in examples)

    def finish(self):
        self.file.close()
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    return install(PACKAGE, tmp_path_factory)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A source in the format of the package's reader."""
    folder = tmp_path_factory.mktemp("recording")
    for name in ("notes-00.png", "notes-01.png"):
        (folder / name).write_bytes((PICTURES / name).read_bytes())
    lines = "notes-00.png,100,200,open it\nnotes-01.png,300,220,open it\n"
    (folder / "one.clicks.csv").write_text(lines)
    return folder


@pytest.fixture(scope="module")
def dataset(installed, recording, tmp_path_factory):
    """Built with the reader, the engine, both corruptions and the edit of the package."""
    out = tmp_path_factory.mktemp("dataset") / "out"
    options = ("--corruptions", "quiet_hours,dead_pixels", "--engine", "backwards", "--json")
    report = json.loads(hijack(installed, "build", recording, "--out", out, *options))
    assert report["rows_by_corruption"] == {"clean": 2, "quiet_hours": 1, "dead_pixels": 2}
    return out


def hijack(env, *words, code=0):
    command = [sys.executable, "-m", "hijack_data.cli", *map(str, words)]
    process = subprocess.run(command, capture_output=True, text=True, env=env)
    assert process.returncode == code, process.stdout + process.stderr
    return process.stdout if code == 0 else process.stderr


def test_the_plugins_are_listed_after_the_nine(installed):
    rows = json.loads(hijack(installed, "list", "--json"))
    assert [r["name"] for r in rows][9:11] == ["dead_pixels", "quiet_hours"]
    data = json.loads(hijack(installed, "show", "dead_pixels", "--json"))
    assert data["parameters"][1]["default"] == 3


def test_doctor_lists_each_kind(installed):
    out = " ".join(hijack({**installed, "COLUMNS": "300"}, "doctor").split())
    for kinds, names in KINDS.items():
        for name in names:
            assert f"ok {kinds} {name} hijack-dead-pixels 0.0.1 {name}" in out


def test_the_plugin_corrupts_a_picture(installed, tmp_path, noise):
    from hijack_data.file_io import write_atomic
    from hijack_data.picture_io import encode_png

    write_atomic(tmp_path / "in.png", encode_png(noise))
    words = ("apply", tmp_path / "in.png", "dead_pixels", "-o", tmp_path / "o.png", "--json")
    assert json.loads(hijack(installed, *words))["corruption"] == "dead_pixels-v1"
    assert (tmp_path / "o.png").read_bytes() != (tmp_path / "in.png").read_bytes()


def test_check_passes_on_its_file(installed):
    env = {k: v for k, v in installed.items() if k != "PYTHONPATH"}
    assert "FAIL" not in hijack(env, "check", PACKAGE / "dead_pixels.py")


def test_its_reader_takes_part_in_detection(installed, dataset):
    manifest = json.loads((dataset / "manifest.json").read_text())
    assert manifest["parameters"]["reader"] == "clicks_csv"


def test_its_corruption_of_the_machine_is_in_the_dataset(installed, dataset):
    pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    (file,) = (dataset / "data").glob("*.parquet")
    rows = pq.read_table(file).to_pylist()
    (row,) = (row for row in rows if row["corruption"] == "quiet_hours")
    assert row["event"] == "Notifications were turned off for 8 hours."
    assert row["reminder"] == "Notifications are off: look for messages yourself."
    assert row["fidelity"] == "composited"
    assert "1 problem" not in hijack(installed, "verify", dataset)


def test_the_onlooker_has_its_reminder(installed, dataset, tmp_path):
    hijack(installed, "export", dataset, "--to", "onlooker", "--out", tmp_path / "out")
    episode_path = b"".join(path.read_bytes() for path in (tmp_path / "out").rglob("*.parquet"))
    assert episode_path
    report = json.loads((tmp_path / "out" / "export.json").read_text())
    assert report["reminders"] == {"quiet_hours": 1}


def test_its_export_format(installed, dataset, tmp_path):
    hijack(installed, "export", dataset, "--to", "lines", "--out", tmp_path / "out")
    lines = (tmp_path / "out" / "lines.txt").read_text().splitlines()
    assert lines[0] == "00000-000000 pyautogui.click(100, 200)"
    assert len(lines) == 5


def test_its_agent_solves_its_task_on_its_desktop_under_its_corruption(installed, tmp_path):
    pytest.importorskip("gymnasium", reason="needs the extra [online]")
    (tmp_path / "b.yaml").write_text(BENCH)
    hijack(installed, "bench", tmp_path / "b.yaml", "--out", tmp_path / "run")
    lines = (tmp_path / "run" / "records.jsonl").read_text().splitlines()
    records = {(r["agent"], r["corruption"]): r for r in map(json.loads, lines)}
    assert {key: record["score"] for key, record in records.items()} == {
        ("presser", "clean"): 1.0,
        ("presser", "quiet_hours"): 1.0,
        ("do_nothing", "clean"): 0.0,
        ("do_nothing", "quiet_hours"): 0.0,
    }
    (effect,) = records["presser", "quiet_hours"]["effects"]
    assert effect["record"]["probes"][0]["facts"] == {"hours": 8}
    assert effect["record"]["undone"][-1]["ok"]
    head = json.loads((tmp_path / "run" / "run.json").read_text())
    assert set(head["config"]["code"]) == {"presser", "press_ok", "paper"}


def test_its_effect_has_sentences_of_its_own(installed):
    code = (
        "from online_env.effects.descriptions import in_words, undone_in_words\n"
        "assert in_words('quiet', {'hours': 8}) == 'notifications are off for 8 hours'\n"
        "assert undone_in_words('quiet', {}) == 'notifications are on again'\n"
    )
    root = Path(__file__).parents[1]
    env = {**installed, "PYTHONPATH": f"{root}:{installed['PYTHONPATH']}"}
    subprocess.run([sys.executable, "-c", code], env=env, check=True)


# Files of a user's own, by their path


def test_a_users_agent_and_task(installed, tmp_path):
    """Mixed with other names; the run keeps their hashes, and goes on with the same files alone."""
    pytest.importorskip("gymnasium", reason="needs the extra [online]")
    (tmp_path / "b.yaml").write_text(BENCH.replace("[presser, do_nothing]", "[do_nothing]"))
    agent, task = tmp_path / "my_agent.py", tmp_path / "my_task.py"
    agent.write_text(AGENT)
    task.write_text(TASK)
    words = ("bench", tmp_path / "b.yaml", "--out", tmp_path / "run", "--corruptions", "clean")
    words = (*words, "--agent", f"{agent}:Mine,paper:Presser", "--tasks", f"{task}:Mine,press_ok")
    hijack(installed, *words)
    lines = (tmp_path / "run" / "records.jsonl").read_text().splitlines()
    scores = {(r["agent"], r["task"]): r["score"] for r in map(json.loads, lines)}
    names = (f"{agent}:Mine", "paper:Presser")
    assert scores == {(name, t): 1.0 for name in names for t in ("press_mine-0", "press_ok-0")}
    code = json.loads((tmp_path / "run" / "run.json").read_text())["config"]["code"]
    assert code[f"{agent}:Mine"]["path"] == str(agent.resolve())
    assert code[f"{agent}:Mine"]["sha256"] == hashlib.sha256(AGENT.encode()).hexdigest()
    assert code["press_mine"]["path"] == str(task.resolve())
    hijack(installed, *words, "--resume")
    agent.write_text(AGENT + "# changed\n")
    output = hijack(installed, *words, "--resume", code=2)
    assert f"is another run: code.{agent}:Mine.sha256 was " in output


def test_a_configuration_may_name_them(installed, tmp_path):
    (tmp_path / "my_agent.py").write_text(AGENT)
    config = tmp_path / "b.yaml"
    named = f"[oracle, {tmp_path}/my_agent.py:Mine, {tmp_path}/my_agent.py:Mind]"
    config.write_text(f"agents: {named}\ntasks: [press_ok]\ncorruptions: [clean]\n")
    output = hijack(installed, "bench", config, "--dry-run", code=2)
    assert "b.yaml:1:" in output
    assert "agents[2]: " in output
    assert "has no 'Mind'; did you mean 'Mine'?" in output
    config.write_text(config.read_text().replace(f", {tmp_path}/my_agent.py:Mind", ""))
    listed = hijack(installed, "bench", config, "--dry-run")
    assert "my_agent.py:Mine  press_ok  seed 0  clean" in listed


def test_a_task_with_a_name_of_ours_is_refused(installed, tmp_path):
    (tmp_path / "my_task.py").write_text(TASK.replace("press_mine", "write_note"))
    words = ("--dry-run", "--tasks", f"{tmp_path}/my_task.py:Mine")
    output = hijack(installed, "bench", "embedded_small", *words, code=2)
    assert (
        f"cannot register Mine of {(tmp_path / 'my_task.py').resolve()}: 'write_note' is" in output
    )
    assert "taken by online_env.tasks.suite.editor.write_note" in output


def test_a_users_reader_and_writer(installed, recording, tmp_path):
    (tmp_path / "my_reader.py").write_text(READER)
    (tmp_path / "my_export.py").write_text(WRITER)
    out = tmp_path / "out"
    words = ("build", recording, "--out", out, "--corruptions", "clean")
    words = (*words, "--format", f"{tmp_path}/my_reader.py:Mine")
    hijack(installed, *words)
    parameters = json.loads((out / "manifest.json").read_text())["parameters"]
    assert parameters["reader"] == "mine_csv"
    assert parameters["format_sha256"] == hashlib.sha256(READER.encode()).hexdigest()
    value = tmp_path / "made"
    hijack(installed, "export", out, "--to", f"{tmp_path}/my_export.py:Mine", "--out", value)
    lines = (value / "mine.txt").read_text().splitlines()
    assert lines == ["pyautogui.click(100, 200)", "pyautogui.click(300, 220)"]


def test_a_file_with_all_of_a_corruption_of_the_machine(recording, tmp_path):
    """Not installed: loaded."""
    env = {key: value for key, value in os.environ.items() if key != "AGENTHIJACK_LOAD"}
    load = ("--load", PACKAGE / "quiet.py")
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    (pictures / "a.png").write_bytes((recording / "notes-00.png").read_bytes())
    words = ("--out", tmp_path / "out", "--corruptions", "quiet_hours", "--json", "--workers", "2")
    report = json.loads(hijack(env, *load, "build", pictures, *words))
    assert report["rows_by_corruption"]["quiet_hours"] == 1
    words = ("bench", "embedded_small", "--dry-run", "--corruptions", "clean,quiet_hours")
    assert "quiet_hours" in hijack(env, *load, *words)
    assert "FAIL" not in hijack(env, "check", PACKAGE / "quiet.py", "--no-desktop")
