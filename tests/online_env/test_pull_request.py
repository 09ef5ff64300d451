"""The action for pull requests, its steps run one after the other as a runner does; its badge."""

import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

pytest.importorskip("scipy", reason="needs the extra [online]")

from online_env.report import ReportError, build_report, formats
from online_env.report.document import ReportDocument
from online_env.report.gate import ReleaseGate
from online_env.results.reading import read

from support.reported import read_run, run_of, scored

ACTION = Path(__file__).resolve().parents[2] / ".github/actions/robustness/action.yml"
# These need pip, and GitHub.
NOT_HERE = ("Install", "Comment")
SHELL = ("bash", "--noprofile", "--norc", "-eo", "pipefail", "-c")


def run_action(repository, **given):
    """Run the steps until one fails: the outputs, the step that failed, and what was printed."""
    action = yaml.safe_load(ACTION.read_text())
    values = {f"inputs.{name}": about.get("default") for name, about in action["inputs"].items()}
    values |= {f"inputs.{name.replace('_', '-')}": value for name, value in given.items()}
    printed = ""
    output, summary = repository / ".output", repository / ".summary"
    for step in action["runs"]["steps"]:
        if step["name"] in NOT_HERE or (step["name"] == "Play" and not values["inputs.command"]):
            continue
        output.write_text("")
        env = {
            **os.environ,
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "GITHUB_OUTPUT": str(output),
            "GITHUB_STEP_SUMMARY": str(summary),
        }
        for name, text in step["env"].items():
            env[name] = re.sub(r"\$\{\{ (\S+) \}\}", lambda found: values[found[1]], text)
        process = subprocess.run(
            [*SHELL, step["run"]],
            cwd=repository,
            env=env,
            capture_output=True,
            text=True,
            check=False,
        )
        printed += process.stdout + process.stderr
        for line in output.read_text().splitlines():
            name, _, value = line.partition("=")
            values[f"steps.{step['id']}.outputs.{name}"] = value
        if process.returncode:
            return values, step["name"], printed
    return values, "", printed


@pytest.fixture
def repository(tmp_path):
    """A repository with the base branch's run, and one of the pull request to be played."""
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    clean = scored("mine", "clean", [1.0] * 12)
    run_of(tmp_path / "base", [*clean, *scored("mine", "marks", [1.0] * 12)])
    run_of(tmp_path / "played", [*clean, *scored("mine", "marks", [1.0] * 4 + [0.0] * 8)])
    return tmp_path


def test_a_loss_fails_and_is_told_beside_the_base_branch(repository):
    outputs, failed, printed = run_action(
        repository,
        run="runs/head",
        command='mkdir -p runs && cp -r played "$RUN"; exit 1',
        base_run="base",
        fail_under="retention_low=0.8\nsuccess=0.9\n",
    )
    assert failed == "Verdict", printed
    assert outputs["steps.judge.outputs.passed"] == "false"
    comment = (repository / "robustness/comment.md").read_text()
    assert comment == (repository / ".summary").read_text()
    assert comment.startswith("<!-- agenthijack robustness -->\n")
    row = next(line for line in comment.splitlines() if line.startswith("| mine | marks | 12 |"))
    assert (
        "| 100.0 | 33.3 | -66.7 | \\[-87.7, -29.9\\] | 0.016 |" in row
    )  # Newcombe, McNemar with Holm
    assert "gate failed: retention_low of mine is 0.1" in comment
    assert "gate passed: success.clean of mine is 1.000" in comment
    suites = ElementTree.parse(repository / "robustness/junit.xml").getroot()
    assert suites.get("failures") == "1"
    badge = ElementTree.parse(repository / "robustness/badge.svg").getroot()
    assert badge.get("aria-label").startswith("robustness: keeps 33.3 % [")


def test_without_a_base_run_the_report_is_told_and_gates_may_pass(repository):
    outputs, failed, printed = run_action(
        repository, run="base", base_run="not/there", fail_under="retention=1", output="out"
    )
    assert (failed, outputs["steps.judge.outputs.passed"]) == ("", "true"), printed
    comment = (repository / "out/comment.md").read_text()
    assert "There is no run of the base branch" in comment
    assert "| mine | marks | 12 | 100.0 |" in comment


def test_a_command_that_is_refused_or_a_wrong_gate_ends_the_action(repository):
    _, failed, printed = run_action(repository, run="runs/x", command="hijack bench nothing")
    assert failed == "Play", printed
    _, failed, printed = run_action(repository, run="base", fail_under="retentoin=1")
    assert (failed, "did you mean" in (repository / "robustness/gates.txt").read_text()) == (
        "Judge",
        True,
    ), printed


def test_a_gate_on_the_bound_judges_the_number_of_the_report(repository):
    run = read(repository / "played")
    report = build_report(run)
    cell, (row,) = report.cell("mine", "marks"), report.summaries
    texts = [
        f"retention_low={row.retention_low - 1e-6}",
        f"retention_low.marks={cell.retention_low + 1e-6}",
    ]
    verdicts = ReleaseGate.read(texts, None, ["mine"], ["clean", "marks"]).verdicts(run)
    assert [verdict.value for verdict in verdicts] == [row.retention_low, cell.retention_low]
    assert [verdict.passed for verdict in verdicts] == [True, False]


def test_a_badge_is_of_one_agent_with_a_retention(tmp_path):
    def write(*agents, labels=("clean", "marks")):
        records = [r for agent in agents for label in labels for r in scored(agent, label, [1.0])]
        report = build_report(read_run(tmp_path / "_".join([*agents, *labels]), records))
        return formats.write(ReportDocument(report=report), "badge")

    with pytest.raises(ReportError, match="of one agent, and the run has a, b"):
        write("a", "b")
    with pytest.raises(ReportError, match="play it clean and corrupted"):
        write("a", labels=["clean"])
    # yardsticks are left out beside an agent
    assert "keeps 100.0 %" in write("oracle", "do_nothing", "a")
