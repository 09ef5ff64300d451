"""`hijack check` for tasks: what is wrong with one is found, without a desktop."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.tasks import Task, checking

PAGE = Path(__file__).parents[2] / "docs" / "write_a_task.md"


class KeepList(Task):
    """A list is written; right as it stands."""

    name = "keep_list"
    apps = ()
    phrasings = ("Write {word} into {file}.", "Put {word} in {file}.", "{word} into {file}, please")

    def draw(self, stream):
        word = stream.choice(("tea", "milk", "rye", "oil"))
        return {"word": word, "file": f"list-{stream.integer(1, 99)}.txt"}

    def prepare(self, machine):
        machine.write(f"Documents/{self.values.file}", "bread\n")

    def problems(self, machine):
        path = f"Documents/{self.values.file}"
        yield from machine.unexpected_changes(path)
        if machine.text(path) != f"{self.values.word}\n":
            yield "it has other words"

    def oracle(self, hand):
        """Not played here."""

    def wrong_results(self):
        path, word = f"Documents/{self.values.file}", self.values.word
        return {
            "elsewhere": lambda m: m.write(self.values.file, f"{word}\n"),
            "half": lambda m: m.write(path, word[:2]),
            "too much": lambda m: m.write(path, f"{word}\nbread\n"),
        }

    def right_result(self, machine):
        machine.write(f"Documents/{self.values.file}", f"{self.values.word}\n")


class Careless(KeepList):
    def problems(self, machine):
        if machine.text(f"Documents/{self.values.file}") != f"{self.values.word}\n":
            yield "it has other words"


class Lenient(KeepList):
    def problems(self, machine):
        yield from machine.unexpected_changes(f"Documents/{self.values.file}")
        if (machine.text(f"Documents/{self.values.file}") or "") == "bread\n":
            yield "it is as it was"


class Stern(KeepList):
    def problems(self, machine):
        yield "never good enough"


class Idle(KeepList):
    def problems(self, machine):
        return iter(())


class Pairs(KeepList):
    """Two of its values go together, so a judge with one of another seed finds nothing."""

    def problems(self, machine):
        words = {self.variant(self.seed).values.file: self.values.word}
        yield from machine.unexpected_changes(f"Documents/{self.values.file}")
        if machine.text(f"Documents/{self.values.file}") != f"{words[self.values.file]}\n":
            yield "it has other words"


class Unknown(KeepList):
    phrasings = ("Write {words} into {file}.",)


class NotThere(KeepList):
    infeasible = "there is no such list"

    def problems(self, machine):
        return machine.unexpected_changes()


class Raises(KeepList):
    def problems(self, machine):
        machine.run("cat", "Documents/nothing")
        yield ""


def problem_text(task_class):
    return "; ".join(checking.problems(task_class(0)))


def test_a_sound_task_has_no_problems():
    assert problem_text(KeepList) == ""
    assert list(checking.shortcomings(KeepList(0))) == []
    assert list(checking.ignored_values(KeepList(0))) == []


@pytest.mark.parametrize(
    ("task_class", "words"),
    [
        (Careless, "the right result, and another file removed is judged 1, not 0"),
        (Lenient, "the wrong result 'half' is judged 1, not 0"),
        (Stern, "the right result is judged 0, not 1: never good enough"),
        (Idle, "doing nothing is judged 1, not 0"),
        (Unknown, "a phrasing uses {words}, which draw does not return"),
        (Raises, "it cannot be judged in a folder: DesktopError: .*cat Documents/nothing"),
    ],
)
def test_what_is_wrong_is_named(task_class, words):
    assert re.search(words, problem_text(task_class))


def test_an_infeasible_task_wants_fail_and_nothing_changed():
    assert problem_text(NotThere) == ""
    assert list(checking.ignored_values(NotThere(0))) == []


def test_values_of_two_seeds_that_do_not_go_together_give_no_hint():
    assert problem_text(Pairs) == ""
    assert list(checking.ignored_values(Pairs(0))) == []


def test_a_value_of_the_instruction_that_is_not_judged_is_a_hint():
    (hint,) = checking.ignored_values(Lenient(0))
    assert "names 'word', and another value would be judged the same" in hint


def test_the_command_checks_the_task_of_the_docs(tmp_path):
    code = re.search(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert code is not None
    (tmp_path / "my_task.py").write_text(code[1])
    command = [sys.executable, "-m", "hijack_data.cli", "check", "my_task.py", "--no-desktop"]
    process = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert process.returncode == 0, process.stdout + process.stderr
    assert "task rename_report" in process.stdout
    assert "ok   judgement" in process.stdout
