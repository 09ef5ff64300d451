"""`hijack check` for agents: what it finds wrong, and how it says so."""

import re
import textwrap

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from click.testing import CliRunner

from hijack_data.cli import hijack
from hijack_data.loading import run_file
from online_env.agents import checking

HEAD = """\
import itertools, os, random, sys, time

class Right:
    def __init__(self):
        self.step = 0

    def reset(self):
        self.step = 0

    def predict(self, instruction, obs):
        self.step += 1
        height, width = obs["screenshot"].shape[:2]
        return "a word", [f"pyautogui.click({width - 1}, {height - 1})"] * self.step
"""
# What is wrong with each class, by the check that must fail and a part of its message.
WRONG = {
    "made": (
        """
        def __init__(self):
            raise OSError("no weights")
        """,
        "OSError: no weights",
    ),
    "answer": (
        """
        def predict(self, instruction, obs):
            return ["DONE"]
        """,
        "predict must return (text, [actions])",
    ),
    "steps": (
        """
        def predict(self, instruction, obs):
            self.step += 1
            return "", ["WAIT", "DONE"][self.step - 1:self.step] if self.step < 3 else None
        """,
        "predict must return",
    ),
    "repeats": (
        """
        def reset(self):
            pass
        """,
        "it keeps something in the object",
    ),
    "sizes": (
        """
        def predict(self, instruction, obs):
            return "", ["pyautogui.click(1000, 600)"]
        """,
        "(1000, 600) is outside a picture of 360x800",
    ),
    "instructions": (
        """
        def predict(self, instruction, obs):
            return "", [f"pyautogui.write('{instruction.split()[0]}')"]
        """,
        "IndexError",
    ),
    "batch": (
        """
        def predict_batch(self, instructions, observations):
            return [("", ["DONE"]) for _ in instructions]
        """,
        "predict_batch gives ['DONE']",
    ),
    "onlooker": (
        """
        def check(self, picture):
            return False
        """,
        "check must return a text or None, got False",
    ),
}


def write(folder, *bodies):
    classes = [
        f"class Case{number}(Right):\n{textwrap.indent(textwrap.dedent(body), '    ')}"
        for number, body in enumerate(bodies)
    ]
    path = folder / "my_agent.py"
    path.write_text("\n\n".join([HEAD, *classes]))
    return path


@pytest.mark.parametrize("name", WRONG)
def test_what_each_check_finds(name, tmp_path):
    body, message = WRONG[name]
    path = write(tmp_path, body)
    entries = {result.check: result for result in checking.check(f"{path}:Case0", 60)}
    assert message in entries[name].problem
    assert not entries[name].ok


def test_a_right_agent_passes_all_of_them(tmp_path):
    path = write(tmp_path)
    items = list(checking.check(f"{path}:Right", 60))
    assert [result.problem for result in items] == [""] * len(WRONG)
    assert {result.check for result in items} == set(WRONG)


def test_an_agent_that_samples_says_so(tmp_path):
    body = """
    deterministic = False
    def predict(self, instruction, obs):
        return "", [f"pyautogui.click({random.randrange(30)}, 2)"]
    """
    items = list(checking.check(f"{write(tmp_path, body)}:Case0", 60))
    assert all(result.ok for result in items)
    assert any("does not repeat" in note for result in items for note in result.notes)


@pytest.mark.parametrize(
    ("body", "timeout", "problem"),
    [
        ("time.sleep(100)", 6, "no answer within 6 s"),
        ("os._exit(4)", 60, r"died \(exit code 4\)"),
        ("os.kill(os.getpid(), 9)", 60, r"died \(SIGKILL\)"),
        ("sys.exit(0)", 60, "SystemExit"),
    ],
)
def test_an_agent_that_hangs_or_dies_gets_a_verdict(body, timeout, problem, tmp_path):
    path = write(tmp_path, f"def predict(self, instruction, obs):\n    {body}\n")
    items = list(checking.check(f"{path}:Case0", timeout))
    assert items[0].ok
    assert re.search(problem, items[1].problem)


def run(*words):
    return CliRunner().invoke(hijack, ["check", *map(str, words)])


def test_the_command_finds_the_agents_of_a_file(tmp_path):
    bad = "def check(self, picture):\n    return 1\n"
    path = write(tmp_path, bad)
    assert [name.rpartition(":")[2] for name in checking.agents_in_file(run_file(path))] == [
        "Right",
        "Case0",
    ]
    result = run(path)
    assert result.exit_code == 1
    assert "my_agent.py:Right" in result.output
    assert result.output.count("FAIL") == 1
    assert "1 checks failed" in result.output


@pytest.mark.parametrize("name", ["do_nothing", "random", "fail", "scripted"])
def test_our_agents_pass(name, tmp_path, monkeypatch):
    script = tmp_path / "moves.yaml"
    script.write_text("- pyautogui.click(3, 4)\n- WAIT\n")
    monkeypatch.setenv("AGENTHIJACK_SCRIPT", str(script))
    assert [result.problem for result in checking.check(name, 60)] == [""] * len(WRONG)


def test_the_command_takes_a_name_and_a_class(tmp_path):
    assert run(f"{write(tmp_path)}:Right").exit_code == 0
    privileged = run("oracle")
    assert privileged.exit_code == 0
    assert "not checked" in privileged.output
    assert "did you mean 'random'" in str(run("rando").exception)


def test_a_file_with_nothing_to_check(tmp_path):
    file = tmp_path / "nothing.py"
    file.write_text("x = 1\n")
    problem = str(run(file).exception)
    assert "registers nothing, and has no class with predict" in problem
