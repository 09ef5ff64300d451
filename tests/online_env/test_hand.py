"""The hand of an oracle, on a desktop whose trees are written down: what it does, in what order."""

import re
from collections.abc import Callable

import pytest

from online_env.desktops.protocol import RunResult
from online_env.errors import DesktopError, DesktopTimeoutError
from online_env.tasks import hand as module
from online_env.tasks.hand import GiveUpError, Hand, fits
from online_env.tasks.tree_nodes import read_tree

from support.trees import Trees, node, tree

MIDDLE = "140, 250"  # of a node at its usual place
CLICK = f"pyautogui.click({MIDDLE})"
SELECT = "pyautogui.hotkey('ctrl', 'a')"
EMPTY = tree("Thunar", node("frame", "files"))


def thunar_tree(*parts: str) -> str:
    return tree("Thunar", *parts)


def hand_on(*trees: str, timeout: float = 1.0) -> tuple[Hand, list[str]]:
    """Return a hand, and the code that it runs."""
    desktop = Trees(list(trees))
    return Hand(desktop, timeout), desktop.ran  # type: ignore[arg-type]


@pytest.fixture(autouse=True)
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PAUSE", 0.001)


@pytest.mark.parametrize(
    ("act", "code"),
    [
        (lambda hand, here, result: hand.click(here), CLICK),
        (lambda hand, here, result: hand.double_click(here), f"pyautogui.doubleClick({MIDDLE})"),
        (lambda hand, here, result: hand.right_click(here), f"pyautogui.rightClick({MIDDLE})"),
        (
            lambda hand, here, result: hand.add_click(here),
            f"pyautogui.keyDown('ctrl'); {CLICK}; pyautogui.keyUp('ctrl')",
        ),
        (
            lambda hand, here, result: hand.drag(here, result),
            f"pyautogui.moveTo({MIDDLE}); pyautogui.dragTo(5, 7, duration=0.5)",
        ),
    ],
)
def test_each_way_to_point_is_one_action(act, code) -> None:
    hand, ran = hand_on(thunar_tree(node("icon", "a"), node("icon", "b", at=(0, 2), size=(10, 10))))
    here, result = hand.find("icon", "a"), hand.find("icon", "b")
    act(hand, here, result)
    assert ran == [code]


def test_a_window_is_given_the_keyboard_at_its_top_unless_it_has_it() -> None:
    hand, ran = hand_on(thunar_tree(node("frame", "a"), node("frame", "b", "active")))
    hand.activate(hand.find("frame", "b"))
    assert ran == []
    hand.activate(hand.find("frame", "a"))
    assert ran == ["pyautogui.click(140, 210)"]


def test_a_button_is_pressed_once_it_can_be() -> None:
    off, on = node("push-button", "Save"), node("button", "Save", "sensitive")
    hand, ran = hand_on(thunar_tree(off, on))
    hand.button("Save", "thunar")
    assert ran == [CLICK]
    hand, ran = hand_on(thunar_tree(off), timeout=0)
    with pytest.raises(DesktopTimeoutError, match="sensitive button or push-button Save of thunar"):
        hand.button("Save", "thunar")
    assert ran == []


def test_a_menu_is_gone_through_from_item_to_item() -> None:
    bar, item = node("menu", "File"), node("check-menu-item", "Hidden", at=(0, 0))
    hand, ran = hand_on(thunar_tree(bar), thunar_tree(bar, item))
    hand.menu("File", re.compile("Hid"))
    assert ran == [CLICK, "pyautogui.click(40, 50)"]
    hand, ran = hand_on(thunar_tree(bar, node("icon", "x")), thunar_tree(bar, item))
    hand.context_menu(hand.find("icon", "x"), "Hidden", app="thunar")
    assert ran == [f"pyautogui.rightClick({MIDDLE})", "pyautogui.click(40, 50)"]


def test_a_field_is_filled_once_it_has_the_focus() -> None:
    result, focused = node("entry", "Name"), node("entry", "Name", "focused")
    hand, ran = hand_on(thunar_tree(result), thunar_tree(focused))
    hand.fill("Name", "Zoë")
    assert ran == [CLICK, SELECT, "pyautogui.write('Zoë')"]
    hand, ran = hand_on(thunar_tree(result), timeout=0)
    with pytest.raises(DesktopTimeoutError, match="focused entry or text Name of any application"):
        hand.fill("Name", "Zoë")
    assert ran == [CLICK]  # nothing was typed into another field


def test_a_file_is_chosen_by_its_path_and_the_dialog_is_gone_then() -> None:
    dialog = node("file-chooser", "Open")
    ready = thunar_tree(dialog, node("push-button", "Open", "sensitive"))
    hand, ran = hand_on(ready, ready, ready, ready, EMPTY)
    hand.choose_file("Documents/a.txt", "Open", "thunar")
    assert ran == [
        "pyautogui.hotkey('alt', 'n')",
        SELECT,
        "pyautogui.write('/home/user/Documents/a.txt')",
        "pyautogui.hotkey('enter')",
    ]
    not_ready = thunar_tree(dialog, node("push-button", "Open"))
    hand, ran = hand_on(not_ready, timeout=0)
    with pytest.raises(DesktopTimeoutError, match="sensitive button or push-button Open"):
        hand.choose_file("/tmp/a.txt", "Open", "thunar")
    assert ran[-1] == "pyautogui.write('/tmp/a.txt')"  # its key would open the search


def test_what_does_not_go_is_named() -> None:
    hand, _ = hand_on(thunar_tree(node("dialog", "Question")), timeout=0)
    with pytest.raises(DesktopTimeoutError) as caught:
        hand.wait_until_gone(("alert", "dialog"), re.compile("Quest"), app="thunar")
    assert str(caught.value) == "alert or dialog Quest of thunar still shows after 0 s"
    hand.wait_until_gone("dialog", "Question", app="gimp")  # another application's is none


def test_what_does_not_come_is_named_with_what_is_there() -> None:
    many = [node("label", f"label {number:02}") for number in range(40)]
    hand, _ = hand_on(thunar_tree(*many, node("label", "label 00")), timeout=0)
    with pytest.raises(DesktopTimeoutError) as caught:
        hand.find("push-button", "Save", app="thunar", state="focused")
    start, _, listed = str(caught.value).partition(": label ")
    assert start == (
        "no focused push-button Save of thunar came up within 0 s; applications: Thunar; "
        "40 named elements show"
    )
    assert f"label {listed}".split(", ") == [f"label 'label {number:02}'" for number in range(30)]
    empty, _ = hand_on('<desktop-frame name="main"/>', timeout=0)
    with pytest.raises(DesktopTimeoutError, match=r"applications: none; 0 named elements show: $"):
        empty.find("frame")


NODES = read_tree(
    thunar_tree(
        node("push-button", "Save As...", "focused"),
        '<push-button name="Save"/>',  # it does not show
        node("link", "save"),
    )
)


@pytest.mark.parametrize(
    ("given", "names"),
    [
        ({"roles": "push-button"}, ["Save As..."]),
        ({"roles": ("link", "push-button")}, ["Save As...", "save"]),
        ({"roles": "push-button", "name": "Save"}, []),
        ({"roles": "push-button", "name": re.compile("Save")}, ["Save As..."]),
        ({"roles": "push-button", "name": re.compile("As")}, []),  # names begin with a pattern
        ({"roles": "link", "name": "Save"}, []),  # letter case counts
        ({"roles": "link", "app": "THUN"}, ["save"]),
        ({"roles": "link", "app": "gimp"}, []),
        ({"roles": "push-button", "state": "focused"}, ["Save As..."]),
        ({"roles": "link", "state": "focused"}, []),
    ],
)
def test_a_node_is_told_by_role_name_application_and_state(given, names) -> None:
    assert [item.name for item in NODES if fits(**given)(item)] == names


def test_a_failure_of_the_code_is_told_with_the_end_of_what_it_said() -> None:
    desktop = Trees([EMPTY], result=RunResult("error", error="x" * 400 + "no display\n"))
    with pytest.raises(DesktopError) as caught:
        Hand(desktop).press("a")  # type: ignore[arg-type]
    assert str(caught.value) == (
        f"pyautogui code failed on the desktop: \"pyautogui.hotkey('a')\": {'x' * 290}no display"
    )


def test_whoever_gives_up_says_why() -> None:
    hand, _ = hand_on(EMPTY)
    with pytest.raises(GiveUpError, match=r"^there is no such button$"):
        hand.give_up("there is no such button")


@pytest.mark.parametrize(
    ("path", "whole"), [("a/b", "/home/user/a/b"), ("/tmp/x", "/tmp/x"), ("", "/home/user")]
)
def test_paths_begin_at_the_home_folder(path: str, whole: str) -> None:
    hand, _ = hand_on(EMPTY)
    assert hand.path(path) == whole


def test_between_two_looks_in_vain_the_hand_waits_longer_and_longer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waited: list[float] = []
    monkeypatch.setattr(module, "PAUSE", 0.1)
    monkeypatch.setattr(module.time, "sleep", waited.append)
    monkeypatch.setattr(module.time, "monotonic", lambda: sum(waited))
    hand, ran = hand_on(EMPTY, timeout=3)
    with pytest.raises(DesktopTimeoutError):
        hand.find("link")
    assert [round(pause, 3) for pause in waited[:6]] == [0.1, 0.15, 0.225, 0.338, 0.5, 0.5]
    waited.clear()
    with pytest.raises(DesktopTimeoutError):
        hand.find("link", scroll=True)  # what slides is looked at often
    assert set(waited) == {0.1}
    assert len(ran) == len(waited)


def test_what_is_at_rest_is_the_first_that_is_seen_twice() -> None:
    hand, _ = hand_on(EMPTY)
    calls = iter([None, 1, None, 2, 3, 3, 4])
    assert hand.wait_until_stable("number", lambda: next(calls)) == 3
    assert next(calls) == 4


@pytest.mark.parametrize("read", [lambda: None, object])
def test_what_does_not_come_to_rest_is_told(read: Callable[[], object]) -> None:
    hand, _ = hand_on(EMPTY, timeout=0.01)
    with pytest.raises(DesktopTimeoutError, match=r"^no menu at rest within 0\.01 s$"):
        hand.wait_until_stable("menu", read)
