"""Tasks without a desktop: their variants, the tree that oracles read, and what they say when
something is missing."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from hijack_data.errors import UnknownNameError
from online_env import tasks
from online_env.desktops import commands
from online_env.desktops.protocol import RunResult
from online_env.embedded.sites.hosts import forms
from online_env.embedded.sites.state import SiteState
from online_env.errors import DesktopError, DesktopTimeoutError
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.hand import Hand
from online_env.tasks.kit import shop
from online_env.tasks.tree_nodes import read_tree

SEEDS = st.integers(0, 2**64 - 1)
SPACE = "https://accessibility.ubuntu.example.org/ns"
TREE = f"""<desktop-frame xmlns:st="{SPACE}/state" xmlns:cp="{SPACE}/component" name="main">
<application name="Thunar"><frame name="x &amp; y" st:showing="true" st:visible="true" cp:screencoord="(10, 20)" cp:size="(30, 41)">
<label name="hidden" st:visible="true" cp:screencoord="(1, 2)" cp:size="(3, 4)">t</label>
<entry name="" st:showing="true" st:visible="true" st:focused="true" st:busy="false" cp:screencoord="(-5, 0)" cp:size="(9, 9)"/>
<icon name="flat" st:showing="true" st:visible="true" cp:screencoord="(0, 0)" cp:size="(0, 5)"/><!-- note --></frame></application>
</desktop-frame>"""


@dataclass
class Picture:
    """A desktop that shows one tree and never changes; it counts what is done to it."""

    tree: str
    result: RunResult = field(default_factory=lambda: RunResult("success", returncode=0))
    ran: list[str] = field(default_factory=list)

    def accessibility(self) -> str:
        return self.tree

    def run(self, code: str) -> RunResult:
        self.ran.append(code)
        return self.result


def test_names_and_get() -> None:
    assert {"write_note", "rename_file", "register_course"} <= set(tasks.names())
    assert tasks.get("write_note", 3) == tasks.get("write_note").variant(3)
    assert tasks.get("rename_file").id == "rename_file-0"
    with pytest.raises(UnknownNameError, match="did you mean 'rename_file'"):
        tasks.get("rename_fil")


@given(SEEDS)
def test_what_is_to_be_written_can_be_typed_and_saved(seed: int) -> None:
    task = tasks.get("write_note", seed)
    lines = task.values.text.split("\n")
    assert len(set(lines)) == len(lines) in (2, 3)
    assert all(line == line.strip() and line.isprintable() for line in lines)
    assert re.fullmatch(r"[a-z]+-\d\d\.txt", task.values.file)
    assert task.values.text in task.instruction
    assert task.values.file in task.instruction


def test_some_texts_need_more_than_a_keyboard_has() -> None:
    texts = [tasks.get("write_note", seed).values.text for seed in range(20)]
    assert any("<" in t for t in texts)
    assert any(ord(c) > 0x370 for t in texts for c in t)


@given(SEEDS)
def test_the_file_to_rename_is_there_and_its_new_name_is_free(seed: int) -> None:
    task = tasks.get("rename_file", seed)
    values = task.values
    assert values.old == values.names[0]
    assert values.new not in values.names
    assert len(set(values.names)) == 4
    assert values.old in task.instruction
    assert f'"{values.new}"' in task.instruction


@given(SEEDS)
def test_the_site_accepts_what_is_to_be_registered(seed: int) -> None:
    expected = tasks.get("register_course", seed).values.wanted
    posted = {key: value if isinstance(value, list) else [value] for key, value in expected.items()}
    assert forms._registration(posted) == expected
    assert forms._problems(expected, agreed=True) == {}


@pytest.mark.parametrize("seed", range(5))
def test_the_instruction_says_all_that_is_to_be_registered(seed: int) -> None:
    task, choices = tasks.get("register_course", seed), forms.content()
    expected, text = task.values.wanted, task.instruction
    assert all(expected[key] in text for key in ("name", "email", "country", "notes"))
    assert choices["courses"][expected["course"]]["name"] in text
    assert choices["levels"][expected["level"]] in text
    for key, label in choices["interests"].items():
        assert (label in text) == (key in expected["interests"])
    assert expected["birth_date"][:4] in text


def test_a_cart_that_something_was_in_for_a_while_is_as_before(tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    machine = tasks.Machine(FolderDesktop(tmp_path / "home"), SiteState(tmp_path / "sites"))
    machine.remember()
    shop.fill(machine, {"mug": 1})
    assert list(machine.unexpected_site_changes()) == ["shop.test was used to change something"]
    assert list(machine.unexpected_site_changes(but=["shop"])) == []
    shop.fill(machine, {})
    assert list(machine.unexpected_site_changes()) == []


def test_the_form_needs_the_local_internet() -> None:
    machine = tasks.Machine(Picture(TREE), None)
    with pytest.raises(DesktopError, match="needs the local internet"):
        _ = machine.sites


@dataclass
class Answers:
    """A desktop whose commands give these results, one after the other."""

    results: list[RunResult]

    def execute(self, argv: list[str], timeout: float = 60) -> RunResult:
        return self.results.pop(0)


YES, NO = (RunResult("success", returncode=code) for code in (0, 1))
HOME = RunResult("success", "/home/user", returncode=0)
BUSY = RunResult("error", "", "Command timed out after 60 seconds")


def test_programs_have_ended_only_where_the_desktop_says_so() -> None:
    desktop = Answers([YES, NO, NO])
    commands.end(cast(Any, desktop), "one", "other")
    assert desktop.results == []


@pytest.mark.parametrize(
    ("result", "problem"),
    [
        (RunResult("error", "", "'pkill' does not start"), "'pkill -TERM -x one' did not run"),
        (BUSY, "did not run on the desktop: Command timed out"),
        (RunResult("success", "", "out of memory", 3), "cannot end program 'one': .*of memory"),
    ],
)
def test_a_desktop_that_cannot_end_programs_says_why(result: RunResult, problem: str) -> None:
    with pytest.raises(DesktopError, match=problem):
        commands.end(cast(Any, Answers([result])), "one")


@pytest.mark.parametrize(
    "ask",
    [
        lambda machine: machine.read("note.txt"),
        lambda machine: machine.text("note.txt"),
        lambda machine: machine.exists("note.txt"),
        lambda machine: machine.names("Documents"),
        lambda machine: machine.check_installed(["mousepad"]),
    ],
)
def test_a_desktop_that_cannot_tell_does_not_say_that_there_is_nothing(
    ask: Callable[[tasks.Machine], object],
) -> None:
    """Otherwise a task that was done would be judged as one that was not."""
    machine = tasks.Machine(cast(Any, Answers([HOME, BUSY])))
    assert machine.home == "/home/user"
    with pytest.raises(DesktopError, match="did not run on the desktop: Command timed out"):
        ask(machine)


def test_nodes_of_a_tree() -> None:
    tree = read_tree(TREE)
    assert [(n.app, n.role, n.name, n.box) for n in tree] == [
        ("Thunar", "application", "Thunar", None),
        ("Thunar", "frame", "x & y", (10, 20, 40, 61)),
        ("Thunar", "label", "hidden", None),
        ("Thunar", "entry", "", (-5, 0, 4, 9)),
        ("Thunar", "icon", "flat", None),
    ]
    assert tree[1].centre == (25, 40)
    assert tree[2].text == "t"
    assert tree[3].states == {"showing", "visible", "focused"}
    with pytest.raises(DesktopError, match="'hidden' of 'Thunar' does not show"):
        _ = tree[2].centre


@pytest.mark.parametrize(
    "text",
    ["", "<a>", "plain", "<a b='1' b='2'/>", "<a>\0</a>", '<a xmlns:p="u"><q:b/></a>', "\ud800"],
)
def test_what_is_no_tree_is_reported(text: str) -> None:
    with pytest.raises(DesktopError, match=r"cannot be read: .* is not well-formed XML"):
        read_tree(text)


def test_a_tree_with_entities_is_refused() -> None:
    bomb = '<!DOCTYPE a [<!ENTITY e SYSTEM "file:///etc/passwd">]><a><b name="x">&e;</b></a>'
    with pytest.raises(DesktopError, match="has a DOCTYPE, which is refused"):
        read_tree(bomb)


def test_the_hand_finds_by_role_name_application_and_state() -> None:
    hand = Hand(Picture(TREE), timeout=0)
    assert hand.find("frame", "x & y").role == "frame"
    assert hand.find(("text", "entry"), app="thunar", state="focused").role == "entry"
    for roles, name, app, state in (
        ("frame", "x", "", ""),
        ("label", "hidden", "", ""),
        ("frame", None, "gimp", ""),
        ("frame", None, "", "focused"),
    ):
        with pytest.raises(
            DesktopTimeoutError, match=f"{roles}.*within 0 s.*applications: Thunar.*frame 'x & y'"
        ):
            hand.find(roles, name, app=app, state=state)


def test_the_hand_scrolls_only_for_what_is_not_in_sight() -> None:
    picture = Picture(TREE)
    Hand(picture, timeout=0).find("entry", scroll=True)
    assert picture.ran == []
    with pytest.raises(DesktopTimeoutError):
        Hand(picture, timeout=0.15).find("link", scroll=True)
    assert picture.ran
    assert set(picture.ran) == {"pyautogui.scroll(-2)"}


def test_what_was_scrolled_is_clicked_only_where_it_stops() -> None:
    @dataclass
    class Sliding(Picture):
        places: list[int] = field(default_factory=lambda: [-99, 40, 30, 20, 20, 20])

        def accessibility(self) -> str:
            y = self.places.pop(0)
            return self.tree.replace("(10, 20)", f"(10, {y})") if y > 0 else "<desktop-frame/>"

    picture = Sliding(TREE)
    assert Hand(picture).find("frame", scroll=True).box == (10, 20, 40, 61)
    assert picture.ran == ["pyautogui.scroll(-2)"]
    assert picture.places == [20]


def test_the_hand_types_any_text_and_reports_what_fails() -> None:
    picture = Picture(TREE)
    hand = Hand(picture)
    hand.click(hand.find("frame"))
    hand.type('it\'s "<é>"\n')
    hand.press("ctrl", "s")
    assert picture.ran == [
        "pyautogui.click(25, 40)",
        "pyautogui.write('it\\'s \"<é>\"\\n')",
        "pyautogui.hotkey('ctrl', 's')",
    ]
    picture.result = RunResult("error", error="no display", returncode=1)
    with pytest.raises(DesktopError, match="no display"):
        hand.press("a")


def test_a_verdict_is_passed_only_at_its_best() -> None:
    assert tasks.Verdict(1.0, "done").passed
    assert not tasks.Verdict(0.99, "nearly").passed
