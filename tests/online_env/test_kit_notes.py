"""Short text files, judged line by line."""

from pathlib import Path

import pytest

from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import notes
from online_env.tasks.machine import Machine


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(FolderDesktop(tmp_path))


@pytest.mark.parametrize(
    "text", ["12 h 25 min\nTea\n", "  12 h  25 min.\r\n\r\nTEA", '"12 h 25 min"\ntea\n\n']
)
def test_what_does_not_matter_is_forgiven(machine: Machine, text: str) -> None:
    machine.write("note.txt", text)
    assert list(notes.unlike(machine, "note.txt", ["12 h 25 min", "Tea"])) == []


@pytest.mark.parametrize(
    "text", ["12 h 25 min", "Tea\n12 h 25 min", "12 h 25 min\nTea\nCoffee", "12 h 25 min Tea", ""]
)
def test_what_matters_is_not(machine: Machine, text: str) -> None:
    machine.write("note.txt", text)
    (problem,) = notes.unlike(machine, "note.txt", ["12 h 25 min", "Tea"])
    assert repr(text) in problem


def test_order_counts_unless_it_does_not(machine: Machine) -> None:
    machine.write("note.txt", "b\na\nb\n")
    assert list(notes.unlike(machine, "note.txt", ["a", "b", "b"], in_any_order=True)) == []
    assert list(notes.unlike(machine, "note.txt", ["a", "b"], in_any_order=True)) != []
    assert list(notes.unlike(machine, "note.txt", ["a", "b", "b"])) != []


def test_a_list_in_any_order_may_have_marks(machine: Machine) -> None:
    machine.write("note.txt", "- B 2\n2. a\n\n  * c\n")
    assert list(notes.unlike(machine, "note.txt", ["a", "B 2", "c"], in_any_order=True)) == []
    assert list(notes.unlike(machine, "note.txt", ["B 2", "a", "c"])) != []


@pytest.mark.parametrize(
    ("text", "is_wrong"),
    [("ls -A\n", False), (" `ls  -A`", False), ("ls -a", True), ("ls -A.", True)],
)
def test_a_verbatim_line_has_its_capitals_and_no_full_stop(
    machine: Machine, text: str, is_wrong: bool
) -> None:
    machine.write("note.txt", text)
    assert bool(list(notes.unlike(machine, "note.txt", ["ls -A"], verbatim=True))) == is_wrong


def test_a_file_that_is_not_there_is_named(machine: Machine) -> None:
    assert list(notes.unlike(machine, "x/note.txt", [])) == ["there is no file x/note.txt"]
