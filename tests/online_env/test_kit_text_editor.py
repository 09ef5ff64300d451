"""The judgement of a text file, and the titles of the editors' windows."""

import pytest

from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import text_editor
from online_env.tasks.machine import Machine

WANTED = "one\ntwo\n\nfour\n"


@pytest.fixture
def machine(tmp_path):
    return Machine(FolderDesktop(tmp_path))


@pytest.mark.parametrize("text", [WANTED, "one\ntwo\n\nfour", "one\r\ntwo\r\n\r\nfour\r\n"])
def test_line_ends_do_not_matter(machine, text):
    machine.write("a.txt", text)
    assert list(text_editor.text_problems(machine, "a.txt", WANTED)) == []


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("one\ntwo\n\nfour\n\n", "has 5 lines, not 4"),
        ("one\ntwo\nfour\n", "has 3 lines, not 4"),
        ("one\ntow\n\nfour\n", "line 2 of a.txt is 'tow', not 'two'"),
        ("one\ntwo\n\nfour \n", "line 4 of a.txt is 'four ', not 'four'"),
    ],
)
def test_what_differs_is_named(machine, text, problem):
    machine.write("a.txt", text)
    assert any(
        problem in text_problem
        for text_problem in text_editor.text_problems(machine, "a.txt", WANTED)
    )


def test_a_missing_file_is_a_problem(machine):
    items = list(text_editor.text_problems(machine, "a.txt", WANTED))
    assert items == ["there is no file a.txt"]


@pytest.mark.parametrize(
    ("title", "shown", "saved"),
    [
        ("~/Documents/a.txt - Mousepad", True, True),
        ("*~/Documents/a.txt - Mousepad", True, False),
        ("a.txt - /home/user/Documents - Geany (new instance)", True, True),
        ("*a.txt - /home/user/Documents - Geany (new instance)", True, False),
        ("~/Documents/aa.txt - Mousepad", False, False),
        ("Untitled 1 - Mousepad", False, False),
    ],
)
def test_titles_tell_which_file_is_shown_and_whether_it_is_saved(title, shown, saved):
    path = "Documents/a.txt"
    assert bool(text_editor.title(path).match(title)) == shown
    assert bool(text_editor.title(path, saved=True).match(title)) == saved


def test_only_the_first_line_that_differs_is_told_and_not_all_of_it(machine):
    machine.write("a.txt", "x" * 200 + "\ntoo\n\nfour\n")
    assert list(text_editor.text_problems(machine, "a.txt", WANTED)) == [
        f"line 1 of a.txt is {'x' * 80!r}, not 'one'"
    ]


def test_a_mark_of_the_byte_order_is_no_text_and_what_is_no_text_is_told(machine):
    machine.write("a.txt", b"\xef\xbb\xbfone\n")
    assert list(text_editor.text_problems(machine, "a.txt", "one\n")) == []
    machine.write("a.txt", b"on\xff\n")
    (problem,) = text_editor.text_problems(machine, "a.txt", "one\n")
    assert problem == "line 1 of a.txt is 'on\ufffd', not 'one'"
