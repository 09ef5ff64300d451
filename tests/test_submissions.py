"""A submission to the leaderboard is merged if its run is signed, whole, and has its own report."""

import importlib.util
import json
import math
import shutil
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("isal", reason="needs the extra [hf]")
pytest.importorskip("scipy", reason="needs the extra [online]")

from click.testing import CliRunner

from hijack_data.cli import hijack

from support.recorded import record_run

SCRIPT = Path(__file__).parents[1] / "submissions" / "check.py"


def check(submission):
    spec = importlib.util.spec_from_file_location("check", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return "\n".join(module.find_problems(submission))


@pytest.fixture(scope="module")
def signed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("submitted") / "mine"
    record_run(folder / "run")
    key = folder.parent / "key"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", key], check=True)
    shutil.copy(f"{key}.pub", folder / "key.pub")
    for words in (
        ["sign", folder / "run", "--key", key],
        ["report", folder / "run", "-o", folder / "report.json"],
    ):
        result = CliRunner().invoke(hijack, [str(word) for word in words])
        assert result.exit_code == 0, result.output
    return folder


@pytest.fixture
def submission(signed, tmp_path):
    return Path(shutil.copytree(signed, tmp_path / "mine"))


def test_a_signed_run_with_its_report_can_be_merged(submission):
    assert check(submission) == ""


def test_a_score_that_was_edited_is_found_twice(submission):
    path = submission / "run" / "records.jsonl"
    text = path.read_text()
    score = '"score": 1.0' if '"score": 1.0' in text else '"score": 0.0'
    path.write_text(text.replace(score, '"score": 0.25', 1))
    result = check(submission)
    assert "report.json is not the report of run/" in result
    assert "hijack verify ends with 1" in result


def test_a_report_that_claims_more_is_found(submission):
    path = submission / "report.json"
    data = json.loads(path.read_text())
    data["summaries"][0]["clean"] = 0.123
    path.write_text(json.dumps(data))
    assert check(submission).startswith("report.json is not the report of run/")


def test_a_report_of_a_machine_that_rounds_otherwise_can_be_merged(submission):
    """Intervals of two processors differ in the last digit; anything more is another report."""
    path = submission / "report.json"
    data = json.loads(path.read_text())
    cell = data["cells"][0]
    cell["ci_low"] = math.nextafter(cell["ci_low"], 1)
    path.write_text(json.dumps(data))
    assert check(submission) == ""
    cell["ci_low"] += 1e-6
    path.write_text(json.dumps(data))
    assert check(submission).startswith("report.json is not the report of run/")


def test_a_signature_of_another_key_and_a_missing_file_are_found(submission):
    second = submission.parent / "other"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", second], check=True)
    shutil.copy(f"{second}.pub", submission / "key.pub")
    assert "hijack verify ends with" in check(submission)
    (submission / "key.pub").unlink()
    assert check(submission) == "lacks key.pub; see submissions/README.md"
