"""What users bring, on a real desktop: an agent and a task of a file, a corruption of a file."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("lxml", reason=needs.ONLINE)

QUIET = Path(__file__).parents[1] / "ext_package" / "quiet.py"
TASK = """\
from online_env.tasks import Task

FILE = "/tmp/said"


class SayHello(Task):
    name = "say_hello"
    apps = ()
    phrasings = ("Press Escape.",)

    def prepare(self, machine):
        machine.write(FILE, "hello")

    def problems(self, machine):
        if not machine.exists(FILE):
            yield "it is gone"

    def oracle(self, hand):
        hand.press("escape")
"""
AGENT = """\
class Mine:
    def __init__(self):
        self.turn = 0

    def predict(self, instruction, obs):
        self.turn += 1
        return instruction, ["pyautogui.press('escape')" if self.turn == 1 else "DONE"]
"""


def test_an_agent_a_task_and_a_corruption_of_files(embedded_machine, tmp_path):
    (tmp_path / "agent.py").write_text(AGENT)
    (tmp_path / "task.py").write_text(TASK)
    command = [sys.executable, "-m", "hijack_data.cli", "--load", QUIET, "bench", "embedded_small"]
    options = ["--agent", f"{tmp_path}/agent.py:Mine", "--tasks", f"{tmp_path}/task.py:SayHello"]
    words = [*options, "--corruptions", "clean,quiet_hours", "--out", tmp_path / "run"]
    process = subprocess.run(
        [str(word) for word in [*command, *words]], capture_output=True, text=True, timeout=400
    )
    assert process.returncode == 0, process.stdout + process.stderr
    lines = (tmp_path / "run" / "records.jsonl").read_text().splitlines()
    records = {record["corruption"]: record for record in map(json.loads, lines)}
    clean, quiet = records["clean"], records["quiet_hours"]  # whichever ended first
    assert (clean["score"], quiet["score"]) == (1.0, 1.0)
    (effect,) = quiet["effects"]
    assert effect["record"]["probes"][0]["ok"]
    assert effect["record"]["undone"][-1]["ok"]
