"""The benchmark on a real desktop: oracle and do_nothing, clean and corrupted, and a run that is
stopped."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from xml.etree import ElementTree

import pytest

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("lxml", reason=needs.ONLINE)

from support.waiting import until

COMMAND = [sys.executable, "-m", "hijack_data.cli"]
SMALL = (
    "bench",
    "embedded_small",
    "--tasks",
    "rename_file",
    "--agent",
    "oracle,do_nothing",
    "--corruptions",
    "clean,resolution,app_minimization,verification",
)


def hijack(*words, timeout=400):
    return subprocess.run(
        [*COMMAND, *map(str, words)], capture_output=True, text=True, timeout=timeout, check=False
    )


def read(folder):
    return [json.loads(line) for line in (folder / "records.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def run(embedded_machine, tmp_path_factory):
    """A small run: its folder, and what the command printed."""
    folder = tmp_path_factory.mktemp("bench") / "run"
    signed = []
    if shutil.which("ssh-keygen"):
        key = folder.parent / "run.key"
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", key], check=True)
        signed = ["--sign", key]
    result = hijack(*SMALL, "--out", folder, *signed)
    assert result.returncode == 0, result.stdout + result.stderr
    return folder, result.stdout


def test_the_oracle_succeeds_clean_and_doing_nothing_never_does(run):
    folder, _ = run
    scores = {(r["agent"], r["corruption"]): r["score"] for r in read(folder)}
    assert len(scores) == 8
    assert scores["oracle", "clean"] == scores["oracle", "resolution"] == 1.0
    assert {
        scores["do_nothing", label]
        for label in ("clean", "resolution", "app_minimization", "verification")
    } == {0}


def test_every_record_proves_its_corruption(run):
    folder, _ = run
    expected = {"app_minimization": ("minimise", 3), "verification": ("lock", -1)}
    for record in read(folder):
        assert (record["status"], record["problem"]) == ("ok", ""), record
        values = [(e["record"]["effect"], e["step"]) for e in record["effects"]]
        kind = expected.get(record["corruption"])
        assert values == ([kind] if kind else []), record["id"]
        for effect in record["effects"]:
            assert effect["record"]["probes"][0]["ok"]
            assert effect["record"]["undone"][-1]["ok"]
        if record["corruption"] == "resolution":
            lines = (folder / "episodes" / record["id"] / "steps.jsonl").read_text().splitlines()
            steps = [json.loads(line) for line in lines]
            assert all(step["seen"] and step["plan"]["ops"] for step in steps)
            assert len(steps) == record["steps"] + 1


def test_an_oracle_behind_a_locked_screen_says_why_it_failed(run):
    folder, _ = run
    (record,) = [
        r for r in read(folder) if (r["agent"], r["corruption"]) == ("oracle", "verification")
    ]
    assert record["score"] == 0
    assert record["last_action"] == "FAIL"
    assert "came up within" in record["said"]


def test_both_agents_had_the_same_plans(run):
    folder, _ = run
    first = {}
    for record in read(folder):
        path = folder / "episodes" / record["id"] / "steps.jsonl"
        step = json.loads(path.read_text().splitlines()[0])
        first.setdefault(record["corruption"], set()).add(step["plan_digest"])
    assert all(len(digests) == 1 for digests in first.values()), first


def test_it_prints_a_line_for_each_and_the_table(run):
    folder, printed = run
    lines = printed.splitlines()
    assert re.match(r"8 episodes on \d+ desktops?, about ", lines[0])
    assert "recovery policy: none" in lines[0]
    first = "[1/8] oracle  rename_file  seed 0  clean  1.00  "  # ends first, or not
    assert any(line.startswith(first) for line in lines)
    assert printed.endswith(hijack("report", folder).stdout)
    rows = json.loads(hijack("report", folder, "--json").stdout)
    assert [row["success"] for row in rows][:2] == [1.0, 1.0]
    assert len(rows) == 8


def test_a_gate_that_fails_is_an_exit_code_and_a_failure(run):
    folder, _ = run
    path = folder.parent / "junit.xml"
    result = hijack("gate", folder, "--fail-under", "oracle:success=1", "--junit", path)
    assert result.returncode == 0, result.stderr
    root = ElementTree.parse(path).getroot()
    assert [root.get(key) for key in ("tests", "failures", "errors")] == ["9", "0", "0"]
    result = hijack("gate", folder, "--fail-under", "worst=0.5", "--junit", path)
    assert result.returncode == 1
    assert "gate failed: worst of do_nothing is 0.000, below 0.5" in result.stderr
    assert ElementTree.parse(path).getroot().get("failures") == "2"
    assert len(read(folder)) == 8
    assert not (folder / "sessions.jsonl").exists(), "a gate goes on with no run"


def test_it_is_whole_and_signed(run):
    folder, _ = run
    requests = ["--key", folder.parent / "run.key.pub"] if (folder / "seal.json").exists() else []
    result = hijack("verify", folder, *requests)
    assert result.returncode == 0, result.stdout
    assert "8 episodes" in result.stdout
    assert ("signed by SHA256:" in result.stdout) == bool(requests)
    refused = hijack("bench", "embedded_small", "--out", folder, "--resume")
    assert (refused.returncode, "is another run: " in refused.stderr) == (2, True)


def test_ctrl_c_keeps_what_is_done_and_leaves_no_desktop(embedded_machine, tmp_path):
    folder = tmp_path / "run"
    argv = [
        *COMMAND,
        "bench",
        "embedded_small",
        "--agent",
        "do_nothing",
        "--tasks",
        "write_note",
        "--out",
        str(folder),
    ]
    process = subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        value = folder / "records.jsonl"
        until(lambda: process.poll() is not None or (value.exists() and read(folder)), "a record")
        assert process.poll() is None, process.communicate()
        os.kill(process.pid, signal.SIGINT)
        _, error = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 130
    assert "episodes that ended are kept: hijack report" in error
    assert "Traceback" not in error
    count = len(read(folder))
    assert 1 <= count < 10
    assert json.loads(hijack("report", folder, "--json").stdout)[0]["n"] == 1
