"""The benchmark over tasks of OSWorld: its own setup and evaluator, our runner and corruptions."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from support import needs

HIJACK = [sys.executable, "-m", "hijack_data.cli"]
READ = {"type": "vm_command_line", "shell": True}
YES = {"type": "rule", "rules": {"expected": "yes\n"}}


def write_task(folder: Path, name: str, **more: Any) -> Path:
    path = folder / "os" / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    content = {"id": name, "instruction": "x", "related_apps": ["os"], "config": [], **more}
    path.write_text(json.dumps(content))
    return path


def judged_by(command: str) -> dict[str, Any]:
    return {"func": "exact_match", "result": {**READ, "command": command}, "expected": YES}


@pytest.fixture(scope="module")
def records(embedded_machine: None, tmp_path_factory: pytest.TempPathFactory):
    needs.osworld_at_default()
    folder = tmp_path_factory.mktemp("osworld")
    agent = folder / "ends.py"
    agent.write_text(
        "class Ends:\n"
        "    def reset(self):\n        pass\n"
        "    def predict(self, instruction, obs):\n"
        "        return '', ['FAIL' if 'impossible' in instruction else 'DONE']\n"
    )
    write_task(
        folder, "t-infeasible", instruction="the impossible", evaluator={"func": "infeasible"}
    )
    write_task(folder, "t-unsolved", evaluator=judged_by("echo no"))
    write_task(
        folder,
        "t-solved",
        evaluator=judged_by("test -e /tmp/made && echo yes"),
        config=[{"type": "execute", "parameters": {"command": "touch /tmp/made", "shell": "true"}}],
    )
    write_task(
        folder,
        "t-broken",
        evaluator=judged_by("echo yes"),
        config=[{"type": "launch", "parameters": {"command": ["/no/such/program"]}}],
    )
    run = folder / "run"
    words = ["embedded_small", "--tasks", folder, "--agent", f"{agent}:Ends"]
    words += ["--corruptions", "clean,network_error", "--desktops", 2]
    process = subprocess.run(
        [*HIJACK, "bench", *map(str, words), "--out", str(run)],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert (run / "records.jsonl").exists(), process.stderr[-2000:]
    lines = (run / "records.jsonl").read_text().splitlines()
    return [json.loads(line) for line in lines]


def of(records: list[dict[str, Any]], task: str) -> list[dict[str, Any]]:
    return [record for record in records if record["task"] == task]


@pytest.mark.parametrize(
    ("task", "score"), [("t-infeasible", 1.0), ("t-unsolved", 0.0), ("t-solved", 1.0)]
)
def test_osworlds_evaluator_judges_each_condition(records, task, score) -> None:
    entries = {record["corruption"]: record for record in of(records, task)}
    assert set(entries) == {"clean", "network_error"}
    assert {record["status"] for record in entries.values()} == {"ok"}
    assert {record["score"] for record in entries.values()} == {score}
    assert entries["network_error"]["effects"][0]["record"]["probes"][0]["ok"] is True


def test_a_setup_that_fails_is_invalid_and_no_zero(records) -> None:
    result = of(records, "t-broken")
    assert {record["status"] for record in result} == {"invalid"}
    assert {record["score"] for record in result} == {None}
    assert all("OSWorld's setup of t-broken failed" in record["problem"] for record in result)
