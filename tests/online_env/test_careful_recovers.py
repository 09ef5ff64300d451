"""A careful hand puts right what got in its way, on a desktop whose trees are written down."""

import pytest

from hijack_data.actions.agent_actions import REINIT
from online_env.errors import DesktopTimeoutError
from online_env.tasks import careful_hand
from online_env.tasks.careful_hand import CarefulHand

from support.trees import SPACE, Trees, node

WINDOW = ("thunar", node("frame", "files - Thunar"))
NOTHING = ("xfdesktop", node("frame", "Desktop"))
F5, ESCAPE = "pyautogui.press('f5')", "pyautogui.press('escape')"


def screen(*applications: tuple[str, str]) -> str:
    """Return the tree of applications, each with its name and its nodes."""
    result = "".join(
        f'<application name="{name}">{nodes}</application>' for name, nodes in applications
    )
    spaces = f'xmlns:st="{SPACE}/state" xmlns:cp="{SPACE}/component"'
    return f"<desktop-frame {spaces}>{result}</desktop-frame>"


def hand_on(
    *trees: str, apps: tuple[str, ...] = ("thunar",), start: str = "", password: str = "it's"
) -> tuple[CarefulHand, list[str]]:
    """Return a hand, and the code that it runs."""
    desktop = Trees(list(trees))
    hand = CarefulHand(desktop, apps, start, password, timeout=0.3)  # type: ignore[arg-type]
    return hand, desktop.ran


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(careful_hand, "LOST_S", 0.0)
    monkeypatch.setattr(careful_hand, "PAUSE", 0.01)


def test_a_locked_screen_is_unlocked_with_the_password_before_anything_is_done() -> None:
    locked = screen(WINDOW, ("mate-screensaver", node("frame", "")))
    hand, ran = hand_on(locked, locked, screen(WINDOW))
    hand.press("ctrl", "s")
    assert ran == [
        "pyautogui.press('shift')",  # the screen is black until then
        'pyautogui.write("it\'s\\n")',
        "pyautogui.hotkey('ctrl', 's')",
    ]


def test_a_locker_that_does_not_show_locks_nothing() -> None:
    hand, ran = hand_on(screen(WINDOW, ("mate-screensaver", '<frame name=""/>')))
    hand.press("a")
    assert ran == ["pyautogui.hotkey('a')"]


def test_help_is_asked_for_once_where_the_network_is_gone() -> None:
    page = ("Google Chrome", node("frame", "x - Chrome") + node("static", "ERR_NAME_NOT_RESOLVED"))
    hand, ran = hand_on(screen(page), apps=("chrome",))
    hand.recover()
    hand.recover()
    assert ran == [REINIT, F5, F5]
    second = ("Google Chrome", node("frame", "x - Chrome") + node("static", "About ERR_NAME_X"))
    hand, ran = hand_on(screen(second), apps=("chrome",))
    hand.recover()
    assert ran == [ESCAPE]  # a text of a page that is there


def test_help_is_asked_for_on_the_first_screen() -> None:
    page = node("frame", "x - Chrome") + node("static", "ERR_NAME_NOT_RESOLVED")
    offline = screen(("Google Chrome", page))
    mended = screen(("Google Chrome", node("frame", "x - Chrome")))
    hand, ran = hand_on(offline, mended, apps=("chrome",))
    hand.check_first_screen()
    hand.check_first_screen()
    assert ran == [REINIT]  # the page is there again
    hand, ran = hand_on(offline, apps=("chrome",))
    hand.check_first_screen()
    assert ran == [REINIT, F5]


def test_an_application_that_is_gone_is_started_as_a_person_would() -> None:
    finder = ("xfce4-appfinder", node("frame", "Application Finder"))
    requests = screen(NOTHING, finder)
    hand, ran = hand_on(
        screen(NOTHING), requests, requests, screen(WINDOW), start="thunar '/home/a b'"
    )
    assert hand.recover() is False  # no document was lost
    assert ran == [
        "pyautogui.hotkey('alt', 'f2')",
        "pyautogui.write(\"thunar '/home/a b'\")",
        "pyautogui.press('enter')",
    ]


def test_what_cannot_be_started_is_not() -> None:
    hand, ran = hand_on(screen(NOTHING))
    assert hand.recover() is False
    assert ran == [ESCAPE]


def panel(*names: str) -> tuple[str, str]:
    places = enumerate(names)
    return (
        "xfce4-panel",
        "".join(node("toggle-button", name, at=(100 * n, 700)) for n, name in places),
    )


def test_a_minimised_window_is_restored_and_its_dialog_gets_the_keyboard() -> None:
    dialog = node("dialog", "Create New Folder", at=(200, 300))
    hidden = '<frame name="files - Thunar" st:iconified="true"/>'
    before = screen(("thunar", hidden), panel("other", "files - Thunar"))
    after = screen(("thunar", node("frame", "files - Thunar", "active") + dialog))
    hand, ran = hand_on(before, after, after)
    hand.type("new")
    assert ran == [
        "pyautogui.click(140, 750)",
        "pyautogui.click(240, 310)",
        "pyautogui.write('new')",
    ]


def test_a_minimised_window_without_a_button_stays() -> None:
    hidden = '<frame name="files - Thunar" st:iconified="true"/>'
    hand, ran = hand_on(screen(("thunar", hidden), panel("other")))
    hand.type("new")
    assert ran == ["pyautogui.write('new')"]


def test_a_foreign_window_gets_the_keyboard_and_is_closed() -> None:
    foreign = ("galculator", node("frame", "Calculator"))
    two_windows = screen(WINDOW, foreign)
    hand, ran = hand_on(two_windows, two_windows, screen(WINDOW))
    hand.press("a")
    assert ran == [
        "pyautogui.click(140, 210)",
        "pyautogui.hotkey('alt', 'f4')",
        "pyautogui.hotkey('a')",
    ]
    hand, ran = hand_on(two_windows, apps=())  # nothing is known of what belongs to the task
    hand.press("a")
    assert ran == ["pyautogui.hotkey('a')"]


def test_what_is_in_sight_at_last_ends_the_search() -> None:
    result = screen(("thunar", node("frame", "files - Thunar") + node("icon", "a.txt")))
    hand, ran = hand_on(screen(WINDOW), result)
    assert hand.find("icon", "a.txt").centre == (140, 250)
    assert ran == [ESCAPE]  # what might have been open is closed
    hand, ran = hand_on(screen(WINDOW))
    with pytest.raises(DesktopTimeoutError, match=r"no icon b\.txt of any application came up"):
        hand.find("icon", "b.txt")
