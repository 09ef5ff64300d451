"""OSWorld's tasks under all nine corruptions on a machine that is reached by HTTP alone."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from support import needs

HIJACK = [sys.executable, "-m", "hijack_data.cli"]
EFFECTS = {"multi_apps", "accidental_touch", "app_minimization", "network_error", "verification"}
AGENT = """
class WaitsThenFails:
    def reset(self):
        self.steps = 0

    def predict(self, instruction, obs):
        self.steps += 1
        return "", ["FAIL" if self.steps > 4 else "WAIT"]
"""
TASK = {
    "id": "t-editor",
    "instruction": "Do what cannot be done.",
    "related_apps": ["os"],
    "config": [{"type": "launch", "parameters": {"command": ["mousepad"]}}],
    "evaluator": {"func": "infeasible"},
}


@pytest.fixture
def machine(embedded_machine: None):
    """The address of a machine in another process, and the command that resets it."""
    needs.root("OSWorld's mode")
    process = subprocess.Popen(
        [sys.executable, "-m", "support.osworld_machine", "1280x720"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[1],
    )
    assert process.stdout is not None
    yield process.stdout.readline().strip(), process.stdout.readline().strip()
    process.communicate()


def test_one_task_under_all_nine(machine: tuple[str, str], tmp_path: Path) -> None:
    needs.osworld_at_default()
    address, reset = machine
    task = tmp_path / "tasks" / "examples" / "os" / "t-editor.json"
    task.parent.mkdir(parents=True)
    task.write_text(json.dumps(TASK))
    agent = tmp_path / "agent.py"
    agent.write_text(AGENT)
    config = tmp_path / "bench.yaml"
    config.write_text("desktop: {provider: osworld, size: [1280, 720]}\nmax_steps: 15\n")
    run = tmp_path / "run"
    words = [config, "--vm", address, "--reset-command", reset, "--tasks", tmp_path / "tasks"]
    process = subprocess.run(
        [*HIJACK, "bench", *words, "--agent", f"{agent}:WaitsThenFails", "--out", run],
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert process.returncode == 0, f"{process.stdout[-3000:]}\n{process.stderr[-2000:]}"
    records = [json.loads(line) for line in (run / "records.jsonl").read_text().splitlines()]
    ended = {record["corruption"]: record for record in records}  # the last attempt counts
    assert len(ended) == 10
    assert {(r["status"], r["score"]) for r in ended.values()} == {("ok", 1.0)}
    assert {label for label, record in ended.items() if record["effects"]} == EFFECTS
    for label in EFFECTS:
        probes = ended[label]["effects"][0]["record"]["probes"]
        assert probes
        assert all(probe["ok"] for probe in probes), label
    assert {r["desktop"]["machine"] for r in ended.values()} == {address}
    verified = subprocess.run(
        [*HIJACK, "verify", run], capture_output=True, text=True, timeout=300, check=False
    )
    assert verified.returncode == 0, verified.stdout[-3000:]
