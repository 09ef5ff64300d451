"""`hijack check` for a task that raises: the check says what and where, and goes on."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from hijack_data.conformance.base import Result
from online_env.embedded.desktop import EmbeddedDesktop
from online_env.errors import DesktopError, MissingPackageError
from online_env.tasks import TASKS, checking
from online_env.tasks.folder_desktop import FolderDesktop

TASK = """\
from online_env.tasks import Task

class WriteWord(Task):
    name = "{name}"
    apps = ()
    phrasings = ("Write {{word}}.", "Please write {{word}}.", "{{word}} is to be written.")

    def draw(self, stream):
        return {{"word": stream.choice(("tea", "milk", "rye", "oil"))}}

    def problems(self, machine):
        yield from machine.unexpected_changes("word.txt")
        if machine.text("word.txt") != self.values.word:
            yield "it has other words"

    def oracle(self, hand):
        hand._desktop.write_file(hand.path("word.txt"), self.values.word.encode())

    def wrong_results(self):
        return {{n: lambda m, n=n: m.write("word.txt", n) for n in ("a", "b", "c")}}

    def right_result(self, machine):
        machine.write("word.txt", self.values.word)
"""


def outcomes(folder: Path, old: str = "", new: str = "", with_desktop: bool = False) -> list[Any]:
    """Return the outcomes of the checks of a task in which a piece of text is another one."""
    name = f"write_word_{len(TASKS.names())}"
    text = TASK.format(name=name)
    assert old in text
    file = folder / name / "my_task.py"
    file.parent.mkdir()
    file.write_text(text.replace(old, new, 1) if old else text)
    TASKS.find(f"{file}:WriteWord")
    return list(checking.check(name, with_desktop))


@pytest.fixture(autouse=True)
def one_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checking, "SEEDS", 1)


def judgement(folder: Path, old: str, new: str) -> Result:
    judged, left_out = outcomes(folder, old, new)
    assert left_out.endswith("(--no-desktop)")
    return judged


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        (
            'self.values.word:\n            yield "it',
            'self.values.wort:\n            yield "it',
            "seed 0: AttributeError: 'types.SimpleNamespace' object has no attribute 'wort' "
            "(my_task.py, line 13)",
        ),
        (
            'machine.write("word.txt", self.values.word)',
            "machine.write(1 / 0, 1)",
            "seed 0: ZeroDivisionError: division by zero (my_task.py, line 23)",
        ),
        (
            'return {"word"',
            'raise KeyError(7)\n        return {"word"',
            "seed 0: KeyError: 7 (my_task.py, line 9)",
        ),
        (
            '"Write {word}."',
            '"Write {wrod}."',
            "seed 0: a phrasing uses {wrod}, which draw does not return",
        ),
        ('"Write {word}."', '"Write {}."', "seed 0: a phrasing uses {}, which draw does not"),
        (
            '"Write {word}."',
            '"Write {word."',
            "seed 0: the phrasing 'Write {word.': expected '}' before end of string (a brace",
        ),
        ('"Write {word}."', '"Please write {word}."', "seed 0: two phrasings are the same"),
        ("{word}.", "{word:d}.", "another seed: ValueError: Unknown format code 'd'"),
    ],
)
def test_a_mistake_in_a_task_is_told_with_its_line(
    tmp_path: Path, old: str, new: str, problem: str
) -> None:
    assert judgement(tmp_path, old, new).problem.startswith(problem)


def test_what_a_task_of_the_suite_should_have_is_noted(tmp_path: Path) -> None:
    fewer = "phrasings = ('Write {{{word}}}.',)\n    apps = ('emacs',)\n    _before ="
    judged = judgement(tmp_path, "phrasings =", fewer)
    assert judged.ok, "braces of the text are written twice"
    assert judged.notes == (
        "it has 1 phrasings, not 3",
        "application 'emacs' is not in the table of tasks/task_apps.py",
    )


# On a desktop


class Played(FolderDesktop):
    """A folder that is handed out as an embedded desktop, and told when it is no longer needed."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder / "home")
        (folder / "home").mkdir()
        self.record = {"sites": str(folder / "sites")}
        self.is_closed = False

    def __enter__(self) -> "Played":
        return self

    def reset(self, task: Any = None) -> None:
        """Be as at first."""
        shutil.rmtree(self._home)
        self._home.mkdir()

    def __exit__(self, *_: object) -> None:
        self.is_closed = True


@pytest.fixture
def desktop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Played:
    result = Played(tmp_path)
    monkeypatch.setattr(EmbeddedDesktop, "up", lambda: result)
    monkeypatch.setattr(checking, "SEEDS", 0)  # what is judged in a folder is tried above
    return result


def live_outcomes(folder: Path, old: str, new: str) -> list[Any]:
    """Return the outcomes of the checks on a desktop."""
    return outcomes(folder, old, new, with_desktop=True)[1:]


def test_a_sound_task_passes_on_a_desktop(tmp_path: Path, desktop: Played) -> None:
    value = live_outcomes(tmp_path, "", "")
    assert [(result.check, result.problem) for result in value] == [
        ("do_nothing", ""),
        ("oracle", ""),
        ("teardown", ""),
    ]
    assert desktop.is_closed
    assert list((tmp_path / "home").iterdir()) == []


@pytest.mark.parametrize(
    ("statement", "problem"),
    [
        ('machine.run("cat", "nothing")', "DesktopError: "),
        ("1 / 0", "ZeroDivisionError: division by zero (my_task.py, line 9)"),
    ],
)
def test_a_task_that_cannot_be_prepared_there_fails_and_is_not_left_out(
    tmp_path: Path, desktop: Played, statement: str, problem: str
) -> None:
    # In the folder of the first check, `initial_app` is never called.
    opens = f"def initial_app(self, machine):\n        {statement}\n\n    def draw"
    (result,) = live_outcomes(tmp_path, "def draw", opens)
    assert result.check == "setup"
    assert result.problem.startswith(problem)
    assert desktop.is_closed


def test_an_oracle_that_raises_or_does_another_thing_fails(tmp_path: Path, desktop: Played) -> None:
    value = live_outcomes(tmp_path, "hand._desktop.write_file", "hand.nothing")
    assert [result.check for result in value] == ["do_nothing", "oracle", "teardown"]
    problem = "AttributeError: 'Hand' object has no attribute 'nothing' (my_task.py, line 17)"
    assert value[1].problem == problem
    value = live_outcomes(tmp_path, "self.values.word.encode()", 'b"coffee"')
    assert value[1].problem == "it has other words"


@pytest.mark.parametrize("error", [MissingPackageError, DesktopError])
def test_without_a_desktop_the_rest_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: type[DesktopError]
) -> None:
    def refuse() -> None:
        raise error("Xvfb is missing")

    monkeypatch.setattr(EmbeddedDesktop, "up", refuse)
    assert live_outcomes(tmp_path, "", "") == [
        "oracle, doing nothing and teardown: no desktop on this machine: Xvfb is missing"
    ]


def test_without_an_application_the_rest_is_left_out(tmp_path: Path, desktop: Played) -> None:
    # The name of a program that the folder's commands do not find.
    change = "def setup(self, machine):\n        machine.check_installed(['vlc'])\n\n    def draw"
    desktop.execute = lambda argv, timeout=60: FolderDesktop.execute(  # type: ignore[method-assign]
        desktop, ["false"] if "command -v" in argv[-1] else argv, timeout
    )
    (text,) = live_outcomes(tmp_path, "def draw", change)
    assert text == (
        "oracle, doing nothing and teardown: vlc is not on the desktop, and the task uses it: "
        "hijack desktop install --profile media"
    )
