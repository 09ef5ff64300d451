"""OSWorld 2.0's tasks: read without running them, listed, planned, and refused."""

import json

import pytest

from hijack_data.cli import main
from hijack_data.errors import ConfigError
from online_env.osworld import task_table, tasks, version_2

PLAIN = """
raise SystemExit("a task's file is never run")
from desktop_env.task_base import BaseTask
TASK_ID = "001"

class Helper:
    id = "no task"

class Task001(BaseTask):
    id = TASK_ID
    instruction = ("First. " f"Then {TASK_ID}.").strip()
    related_apps = ["thunderbird"]
    proxy = False

    def setup(self, setup_controller, use_proxy=False): ...
    def evaluate(self, env): return 0.5
"""
WHOLE = """
import os
from desktop_env import task_base
from desktop_env.controllers.website import HOST_SUFFIX
from desktop_env.evaluators import metrics
from desktop_env.file_source import asset

class Task069(task_base.MultiPhaseTask):
    id = "069"
    instruction: str = "Open https://mailhub." + HOST_SUFFIX + f"/{os.getpid()} now."
    user_simulator = {"type": "llm", "model": "m", "instruction": instruction}
    volume_size = 100
    proxy = True

    def setup(self, setup_controller, use_proxy=False):
        setup_controller.execute(["sudo", "apt-get", "install", "-y", "kicad"])
        self.token = os.environ["GITLAB_URL"], asset("task_069/a.pdf")

    def evaluate(self, env):
        return metrics.compare_text_with_llm("a", "b")
"""


@pytest.fixture
def folder(tmp_path):
    home = tmp_path / "evaluation_examples" / "task_class"
    home.mkdir(parents=True)
    (home / "task_001.py").write_text(PLAIN)
    (home / "task_069.py").write_text(WHOLE)
    return tmp_path


def run(capsys, *words):
    with pytest.raises(SystemExit) as ended:
        main(["osworld", *map(str, words)])
    output = capsys.readouterr()
    return ended.value.code or 0, output.out, output.err


def test_what_a_file_says_is_read_without_running_it(folder):
    plain, whole_task = version_2.load(folder).tasks
    assert (plain.id, plain.instruction, plain.apps) == (
        "001",
        "First. Then 001.",
        ("thunderbird",),
    )
    assert set(plain.needs) == {"runner"}
    assert whole_task.instruction == "Open https://mailhub.{...}/{...} now."
    assert set(whole_task.needs) == set(version_2.NEEDS)
    assert (whole_task.needs["user"], whole_task.needs["judge"]) == ("llm", "compare_text_with_llm")
    assert whole_task.needs["disk"] == "volume_size 100"


def test_tasks_are_listed_and_planned(folder, tmp_path, capsys):
    code, out, _ = run(capsys, "needs", folder)
    assert code == 0
    assert "2 tasks, 0 can be played here" in out
    assert "   1  gitlab " in out
    data = json.loads(run(capsys, "needs", folder, "--json")[1])
    assert data["tasks"][1]["can_be_met"] is False
    code, out, _ = run(capsys, "tasks", folder, "--out", tmp_path / "rows.jsonl", "--clean")
    assert code == 0
    assert "20 rows, 2 tasks" in out
    assert "none of them can be played" in out
    rows = [json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines()]
    assert rows[0]["id"] == "001/clean"
    assert {row["can_be_played"] for row in rows} == {False}
    with pytest.raises(ConfigError, match=r"tasks of OSWorld 2\.0"):
        task_table.read(tmp_path / "rows.jsonl")


def test_no_command_plays_them(folder, tmp_path, capsys):
    for words in (
        ["check", folder, "--out", tmp_path / "results.json"],
        ["prefetch", folder, "--out", tmp_path / "cache"],
        ["needs", folder, "--working"],
    ):
        code, _, error = run(capsys, *words)
        assert code == 2, words
        assert "tasks of OSWorld 2.0" in error


def test_a_checkout_with_both_versions_has_the_tasks_that_can_be_played(folder):
    home = folder / "evaluation_examples"
    task = {"id": "a", "instruction": "Do it.", "evaluator": {"func": "infeasible"}}
    (home / "examples" / "os").mkdir(parents=True)
    (home / "examples" / "os" / "a.json").write_text(json.dumps(task))
    assert len(tasks.load(home)) == 1
    assert not tasks.is_version_2(home)


def test_all_mistakes_at_once(folder):
    home = folder / "evaluation_examples" / "task_class"
    (home / "task_002.py").write_text("class Task002(BaseTask:")
    (home / "task_003.py").write_text("X = 1")
    (home / "task_004.py").write_text(PLAIN)
    (home / "task_005.py").write_text(
        "A = B\nB = A\nclass T(BaseTask):\n  id = A\n  instruction = f'{X}'"
    )
    (home / "task_006.py").write_text("class T(BaseTask):\n  id = f'{X}'\n  instruction = 'a'")
    with pytest.raises(ConfigError) as caught:
        version_2.load(folder)
    problems = [problem.removeprefix(f"{home}/") for problem in caught.value.problems]
    assert problems[0].startswith("task_002.py: cannot be parsed as Python")
    assert problems[1:] == [
        "task_003.py: no class with the base BaseTask or MultiPhaseTask",
        f"task_004.py: id: '001' is also that of {home}/task_001.py",
        "task_005.py: T.id: is not a text",
        "task_006.py: T.id: is known only if the file is run",
    ]
    with pytest.raises(ConfigError, match="are gated data"):
        version_2.load(home / "none")
