"""A careful hand on a desktop whose trees are written down."""

import numpy as np
import pytest

from online_env.errors import DesktopTimeoutError
from online_env.tasks import careful_hand

from support.trees import SPACE, Trees

PLACE = 'st:showing="true" st:visible="true" cp:screencoord="(100, 200)" cp:size="(80, 100)"'
PANEL = PLACE.replace("(100, 200)", "(0, 700)")
SHOWN = f'<frame name="song - VLC media player" {PLACE}/>'
HIDDEN = '<frame name=""/>'
BUTTON = f'<toggle-button name="VLC media player" {PLACE}/>'


def tree(window: str, button: str = BUTTON) -> str:
    return (
        f'<desktop-frame xmlns:st="{SPACE}/state" xmlns:cp="{SPACE}/component" name="main">'
        f'<application name="vlc">{window}<frame name=""/></application>'
        f'<application name="xfce4-panel"><frame name="" {PANEL}/>{button}</application>'
        "</desktop-frame>"
    )


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(careful_hand, "LOST_S", 0.0)


def test_a_window_that_does_not_say_it_is_minimised_is_restored_from_the_panel() -> None:
    desktop = Trees([tree(SHOWN), tree(HIDDEN), tree(SHOWN)])
    hand = careful_hand.CarefulHand(desktop, ["vlc"], timeout=5)
    hand.press("enter")
    hand.find("frame", "song - VLC media player")
    assert desktop.ran[1:] == ["pyautogui.click(140, 250)"]


def test_a_window_that_shows_is_never_minimised_by_its_button() -> None:
    desktop = Trees([tree(SHOWN)])
    hand = careful_hand.CarefulHand(desktop, ["vlc"], timeout=0.3)
    with pytest.raises(DesktopTimeoutError):
        hand.find("dialog")
    assert set(desktop.ran) == {"pyautogui.press('escape')"}


def test_a_window_without_a_button_cannot_be_restored() -> None:
    desktop = Trees([tree(HIDDEN, "")])
    hand = careful_hand.CarefulHand(desktop, ["vlc"], timeout=0.3)
    with pytest.raises(DesktopTimeoutError):
        hand.find("frame", "song - VLC media player")
    assert set(desktop.ran) == {"pyautogui.press('escape')"}


@pytest.mark.parametrize(("other", "closed"), [("xfce4-appfinder", False), ("galculator", True)])
def test_what_the_hand_may_have_opened_itself_is_not_in_its_way(other: str, closed: bool) -> None:
    with_window = f'<application name="{other}"><frame name="it" {PLACE}/></application>'
    result = tree(SHOWN)
    desktop = Trees(
        [result.replace("</desktop-frame>", f"{with_window}</desktop-frame>"), result, result]
    )
    hand = careful_hand.CarefulHand(desktop, ["vlc"], timeout=0.3)
    hand.press("ctrl", "a")
    assert ("pyautogui.hotkey('alt', 'f4')" in desktop.ran) == closed


@pytest.mark.parametrize(
    ("active", "first"),
    [
        ("untitled - Geany", "pyautogui.click(140, 650)"),
        ("tools.py - Geany", "pyautogui.press('escape')"),
    ],
)
def test_the_keyboard_returns_to_the_documents_window(active: str, first: str) -> None:
    windows = {"tools.py - Geany": 600, "untitled - Geany": 640}
    frames = [
        f'<frame name="{name}" {PLACE} st:active="{str(name == active).lower()}"/>'
        for name in windows
    ]
    buttons = [
        f'<toggle-button name="{name}" {PLACE.replace("200", str(top))}/>'
        for name, top in windows.items()
    ]
    result = tree("".join(frames), "".join(buttons)).replace('"vlc"', '"geany"')
    desktop = Trees([result, tree(SHOWN)])
    hand = careful_hand.CarefulHand(desktop, ["geany"], "geany /home/user/tools.py", timeout=0.3)
    with pytest.raises(DesktopTimeoutError):
        hand.find("dialog")
    assert desktop.ran[0] == first


def office(windows: str) -> str:
    return (
        f'<desktop-frame xmlns:st="{SPACE}/state" xmlns:cp="{SPACE}/component" name="main">'
        f'<application name="soffice">{windows}</application></desktop-frame>'
    )


ACTIVE = f'{PLACE} st:active="true" st:modal="true"'
SHEET = f'<frame name="a.xlsx - LibreOffice Calc" {PLACE}/>'
UNDER = '<frame name="a.xlsx - LibreOffice Calc"/>'  # a frame under a modal dialog says nothing
QUESTION = f'{UNDER}<alert name="Question" {ACTIVE}/>'
SAVE = f'{UNDER}<file-chooser name="Save" {ACTIVE}/>'
FIND = f'{SHEET}<dialog name="Find and Replace" {PLACE}/>'
EMPTY = f'<frame name="LibreOffice" {PLACE}/>'
ESCAPE = "pyautogui.press('escape')"


@pytest.mark.parametrize(
    ("seen", "ran"),
    [
        ([SHEET], [ESCAPE]),  # a menu, or a text being edited, is not in the tree
        ([QUESTION, SAVE, SAVE, SHEET], [ESCAPE] * 3),
        ([FIND, FIND, SHEET], ["pyautogui.click(140, 210)", ESCAPE]),  # it had not the keyboard
        ([f'<dialog name="Options" {PLACE}/>'] * 9, [ESCAPE]),  # it is all that the task has
        ([f'{SHEET}<alert name="in a page" {PLACE}/>'] * 9, [ESCAPE]),
    ],
)
def test_before_another_try_the_dialogs_of_the_last_one_are_left(
    seen: list[str], ran: list[str]
) -> None:
    desktop = Trees([office(windows) for windows in seen])
    careful_hand.CarefulHand(desktop, ["libreoffice_calc"], timeout=0.3).prepare_retry()
    assert desktop.ran == ran


UNDO = f'<push-button name="Undo" {PLACE} st:sensitive="true"/>'
DONE = f'<push-button name="Undo" {PLACE}/>'
TAKE_BACK = "pyautogui.hotkey('ctrl', 'z')"


@pytest.mark.parametrize(
    ("seen", "times"),
    [
        ([f"{SHEET}{UNDO}"] * 4 + [f"{SHEET}{DONE}"], 3),
        ([f"{SHEET}{DONE}"], 0),
        ([f"{SHEET}{UNDO}"], 60),  # it never ends
        ([f"{SHEET}{SHEET}{UNDO}"], 0),  # which of the two would take it back?
    ],
)
def test_before_another_try_what_was_done_in_the_document_is_taken_back(
    seen: list[str], times: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(careful_hand, "PAUSE", 0.0)
    desktop = Trees([office(windows) for windows in seen])
    careful_hand.CarefulHand(desktop, ["libreoffice_calc"], timeout=0.3).prepare_retry()
    assert desktop.ran == [ESCAPE, *[TAKE_BACK] * times]


def two_windows(front: str) -> str:
    """Return a tree with a browser and an editor, of which one has the keyboard."""
    result = "".join(
        f'<application name="{app}">'
        f'<frame name="{title}" {PLACE} {"st:active" if front == app else "st:enabled"}="true"/>'
        "</application>"
        for app, title in (("Google Chrome", "Inbox"), ("mousepad", "Untitled"))
    )
    places = {"Inbox": (300, 1062), "Untitled": (500, 1062)}
    buttons = "".join(
        f'<toggle-button name="{title}" {PLACE.replace("(100, 200)", str(box))}/>'
        for title, box in places.items()
    )
    return (
        f'<desktop-frame xmlns:st="{SPACE}/state" xmlns:cp="{SPACE}/component" name="main">'
        f'{result}<application name="xfce4-panel">{buttons}</application></desktop-frame>'
    )


def test_before_another_try_every_window_gets_an_escape_and_the_first_one_the_keyboard() -> None:
    browser, editor = two_windows("Google Chrome"), two_windows("mousepad")
    desktop = Trees([browser, editor])
    hand = careful_hand.CarefulHand(desktop, ["chrome", "mousepad"], timeout=0.3)
    hand.type("a")
    desktop.trees = [editor, editor, browser, browser, editor]
    desktop.ran.clear()
    hand.prepare_retry()
    assert desktop.ran == [ESCAPE, "pyautogui.click(340, 1112)", ESCAPE]
    desktop.trees = [editor]
    desktop.ran.clear()
    hand.prepare_retry()
    assert desktop.ran == [
        ESCAPE,
        "pyautogui.click(340, 1112)",
        ESCAPE,
        "pyautogui.click(340, 1112)",
    ]


@pytest.mark.parametrize(
    ("app", "ran"), [("soffice", ["pyautogui.press('f6')", ESCAPE]), ("geany", [ESCAPE])]
)
def test_a_tool_of_libreoffice_does_not_keep_the_keyboard(app: str, ran: list[str]) -> None:
    tool = f'<push-button name="Text Box" {PLACE} st:focused="true"/>'
    desktop = Trees([office(f"{SHEET}{tool}").replace('"soffice"', f'"{app}"')])
    careful_hand.CarefulHand(desktop, ["libreoffice_calc", "geany"], timeout=0.3).recover()
    assert desktop.ran == ran


FOLDER = f'<frame name="Downloads - Thunar" {PLACE}/>'
QUESTION_DELETE = f'{FOLDER}<dialog name="Attention" {ACTIVE}/>'
DELETE = f'<push-button name="Delete" {PLACE.replace("(100, 200)", "(300, 300)")}/>'


@pytest.mark.parametrize(
    ("question", "ran"),
    [
        (QUESTION_DELETE + DELETE, [ESCAPE, TAKE_BACK, "pyautogui.click(340, 350)"]),
        (QUESTION_DELETE, [ESCAPE, TAKE_BACK]),  # nobody knows what it asks
    ],
)
def test_what_is_taken_back_may_be_deleted_and_nothing_else_is_agreed_to(
    question: str, ran: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(careful_hand, "PAUSE", 0.0)
    items = [f"{FOLDER}{UNDO}", f"{FOLDER}{UNDO}", question, f"{FOLDER}{DONE}"]
    desktop = Trees([office(windows).replace("soffice", "thunar") for windows in items])
    careful_hand.CarefulHand(desktop, ["thunar"], timeout=0.3).prepare_retry()
    assert desktop.ran == ran


TO, ADDRESS = "(300, 300)", "(500, 500)"


def fields(to: str, focused: str = "To", role: str = "entry") -> str:
    """Return a tree with two fields, of which one has the keyboard."""
    result = "".join(
        f'<{role} name="{name}" {PLACE.replace("(100, 200)", box)}'
        f' st:{"focused" if name == focused else "enabled"}="true">{text}</{role}>'
        for name, box, text in (("To", TO, to), ("Address", ADDRESS, "shop.test"))
    )
    return office(SHEET + result)


INTO_TO = "pyautogui.click(340, 350)"


@pytest.mark.parametrize(
    ("then", "typed", "again"),
    [
        (fields("jun@mail.test"), "jun@mail.test", []),
        (fields("jun@mail.test, Jun"), "jun@mail.test", []),  # it was completed
        (fields("desk@mail.testjun@mail.test"), "jun@mail.test", [""]),
        (fields("jun@mail.testjun@mail.test"), "jun@mail.test", [""]),  # it was typed twice
        (fields("desk@mail.testjun@mail.test", role="combo-box"), "jun@mail.test", [""]),
        (fields(""), "jun@mail.test", []),  # what it holds is not in the tree
        (fields("", "Address"), "jun@mail.test", [INTO_TO, ""]),
        (fields("a", "Address"), "jun@mail.test", [INTO_TO, ""]),
        (fields("jun@mail.test", "Address"), "jun@mail.test", []),
        (fields("a", "Address"), "jun@mail.test\n", []),  # the field was left
        (fields("a", role="label"), "jun@mail.test", []),
        (office(SHEET), "jun@mail.test", []),
    ],
)
def test_a_field_that_got_something_else_is_filled_again(
    then: str, typed: str, again: list[str]
) -> None:
    role = "combo-box" if "combo-box" in then else "entry"
    desktop = Trees([fields("a", role=role), then])
    careful_hand.CarefulHand(desktop, ["libreoffice_calc"], timeout=0.3).replace(typed)
    filled = ["pyautogui.hotkey('ctrl', 'a')", f"pyautogui.write({typed!r})"]
    assert desktop.ran == filled + [code for part in again for code in ([part] if part else filled)]


def unnamed(windows: str) -> str:
    return windows.replace('name="To"', 'name=""').replace('name="Address"', 'name=""')


@pytest.mark.parametrize(
    ("then", "again"),
    [
        (fields("jun@mail.test"), False),
        (fields("a"), True),
        (fields("a").replace(TO, "(310, 300)"), False),  # it moved: which is it?
    ],
)
def test_of_fields_without_a_name_it_is_the_one_in_the_same_place(then: str, again: bool) -> None:
    desktop = Trees([unnamed(fields("", "To")), unnamed(then)])
    careful_hand.CarefulHand(desktop, ["libreoffice_calc"], timeout=0.3).replace("jun@mail.test")
    assert len(desktop.ran) == (4 if again else 2)
    assert not any("click" in code for code in desktop.ran)


def test_the_dialogs_of_a_helper_belong_to_the_application() -> None:
    dialog = f'<file-chooser name="Save" {PLACE}/>'
    helper = f'<application name="xdg-desktop-portal-gtk">{dialog}</application>'
    window = f'<application name="Chromium"><frame name="News" {PLACE}/></application>{helper}'
    text = (
        f'<desktop-frame xmlns:st="{SPACE}/state" xmlns:cp="{SPACE}/component" name="main">'
        f"{window}</desktop-frame>"
    )
    for apps, is_closed in ((["chrome"], False), (["thunar"], True)):
        desktop = Trees([text])
        careful_hand.CarefulHand(desktop, apps, timeout=0.3).type("x")
        assert ("pyautogui.hotkey('alt', 'f4')" in desktop.ran) == is_closed


@pytest.mark.parametrize("focused", ["", "Sheet"])
def test_without_a_focused_field_a_text_is_typed_once(focused: str) -> None:
    desktop = Trees([fields("a", focused)])
    careful_hand.CarefulHand(desktop, ["libreoffice_calc"], timeout=0.3).replace("b")
    assert len(desktop.ran) == 2


@pytest.mark.parametrize(("before", "again"), [(SHEET, True), (EMPTY, False)])
def test_a_document_that_was_closed_is_opened_again(before: str, again: bool) -> None:
    desktop = Trees([office(before), office(EMPTY)])
    hand = careful_hand.CarefulHand(
        desktop, ["libreoffice_calc"], "soffice /home/user/a.xlsx", timeout=0.3
    )
    hand.press("tab")
    hand.recover()
    assert ("pyautogui.write('soffice /home/user/a.xlsx')" in desktop.ran) == again


def test_what_was_begun_in_a_closed_document_is_begun_anew() -> None:
    desktop = Trees([office(SHEET), office(EMPTY)])
    hand = careful_hand.CarefulHand(
        desktop, ["libreoffice_calc"], "soffice /home/user/a.xlsx", timeout=0.3
    )
    hand.press("tab")
    with pytest.raises(DesktopTimeoutError, match="the document was closed; it is open again"):
        hand.find("dialog")


MINIMISED = '<frame name="song - VLC media player" st:iconified="true"/>'
WINDOWS_BUTTON = BUTTON.replace("VLC media player", "song - VLC media player")


def test_a_menu_that_a_disturbance_closed_is_not_clicked_on() -> None:
    with_window = tree(f'{SHOWN}<menu-item name="Quit" {PLACE}/>')
    hidden = tree(f'{MINIMISED}<menu-item name="Quit" {PLACE}/>', WINDOWS_BUTTON)
    desktop = Trees([with_window])
    hand = careful_hand.CarefulHand(desktop, ["vlc"], timeout=0.3)
    item = hand.find("menu-item", "Quit")
    desktop.trees = [hidden, tree(SHOWN)]
    with pytest.raises(DesktopTimeoutError, match="the menu with 'Quit' was closed"):
        hand.click(item)
    assert desktop.ran == ["pyautogui.click(140, 250)"]  # the button of the panel, and no more


def test_another_node_is_clicked_on_after_a_disturbance() -> None:
    desktop = Trees([tree(f'{SHOWN}<push-button name="Play" {PLACE}/>')])
    hand = careful_hand.CarefulHand(desktop, ["vlc"], timeout=0.3)
    button = hand.find("push-button", "Play")
    desktop.trees = [tree(MINIMISED, WINDOWS_BUTTON), tree(SHOWN)]
    hand.click(button)
    assert desktop.ran == ["pyautogui.click(140, 250)"] * 2


@pytest.mark.parametrize(("hidden", "moves"), [(True, ["pyautogui.moveTo(140, 250)"]), (False, [])])
def test_the_wheel_turns_over_the_window_that_was_restored(
    hidden: bool, moves: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        careful_hand, "LOST_S", 5.0
    )  # nothing is looked for before the page was scrolled
    expected = tree(f'{SHOWN}<link name="below" {PLACE}/>')
    first = tree(MINIMISED, WINDOWS_BUTTON) if hidden else tree(SHOWN)
    actions = 3 if hidden else 1  # the panel, the key and the pointer; or the key alone
    desktop = Trees([first, *[tree(SHOWN)] * actions, expected])
    hand = careful_hand.CarefulHand(desktop, ["vlc"], timeout=2)
    hand.press("home")
    hand.find("link", "below", scroll=True)
    scrolled = desktop.ran.index("pyautogui.scroll(-2)")
    assert desktop.ran[scrolled - len(moves) : scrolled] == moves


def test_the_wheel_turns_over_the_window_that_a_foreign_one_had_made_smaller(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(careful_hand, "LOST_S", 5.0)
    foreign = tree(SHOWN).replace(
        "</desktop-frame>",
        f'<application name="geany"><frame name="untitled" {PLACE}/></application></desktop-frame>',
    )
    expected = tree(f'{SHOWN}<link name="below" {PLACE}/>')
    desktop = Trees([foreign, *[tree(SHOWN)] * 4, expected])
    hand = careful_hand.CarefulHand(desktop, ["vlc"], timeout=2)
    hand.press("home")
    hand.find("link", "below", scroll=True)
    assert "pyautogui.hotkey('alt', 'f4')" in desktop.ran
    scrolled = desktop.ran.index("pyautogui.scroll(-2)")
    assert desktop.ran[scrolled - 1] == "pyautogui.moveTo(140, 250)"


@pytest.mark.parametrize(("later", "starts"), [(SHOWN, 0), ("", 1)])
def test_a_program_is_started_again_only_if_its_window_stays_away(later: str, starts: int) -> None:
    nothing = tree("").replace('<frame name=""/></application>', "</application>", 1)
    looks = [nothing, tree(later) if later else nothing]

    class Busy(Trees):
        def accessibility(self) -> str:
            return looks.pop(0) if len(looks) > 1 else looks[0]

    desktop = Busy([])
    hand = careful_hand.CarefulHand(desktop, ["vlc"], "vlc /home/user/song.ogg", timeout=0.1)
    hand.recover()
    assert desktop.ran.count("pyautogui.hotkey('alt', 'f2')") == starts


def test_a_click_that_got_lost_is_done_again_and_one_that_arrived_is_not() -> None:
    without_menu = office(SHEET)
    with_window = office(SHEET + f'<menu-item name="Save" {PLACE}/>')
    click = "pyautogui.click(140, 250)"
    for trees, ran in (
        ([without_menu, without_menu, with_window], [click, click]),
        ([without_menu, with_window], [click]),
    ):
        desktop = Trees(trees)
        hand = careful_hand.CarefulHand(desktop, ["libreoffice_calc"], timeout=5)
        hand.run(click)
        hand.find("menu-item", "Save")
        assert desktop.ran == ran


def test_a_click_beside_its_target_is_done_again_once_an_escape_brought_back_what_was_there() -> (
    None
):
    without_menu = office(SHEET)
    second = office(SHEET + f'<menu-item name="Print" {PLACE}/>')
    with_window = office(SHEET + f'<menu-item name="Save" {PLACE}/>')
    desktop = Trees([without_menu, second, without_menu, with_window])
    hand = careful_hand.CarefulHand(desktop, ["libreoffice_calc"], timeout=5)
    hand.run("pyautogui.click(140, 250)")
    hand.find("menu-item", "Save")
    click = "pyautogui.click(140, 250)"
    assert desktop.ran == [click, "pyautogui.press('escape')", click]


@pytest.mark.parametrize(("shows", "times"), [(True, 1), (False, 2)])
def test_a_text_that_does_not_show_is_typed_again(
    shows: bool, times: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(careful_hand, "TYPED_S", 0.0)
    desktop = Trees([office(SHEET)])
    if not shows:  # but for the cursor
        blank, cursor = np.zeros((2, 100, 100, 3), np.uint8)
        cursor[40:60, 50:52] = 255
        pictures = iter([blank, cursor])
        monkeypatch.setattr(desktop, "screenshot", lambda: next(pictures))
    careful_hand.CarefulHand(desktop, ["libreoffice_calc"]).type("a text")
    assert desktop.ran == ["pyautogui.write('a text')"] * times


def test_a_page_has_time_to_load_before_an_escape_would_stop_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hand = careful_hand.CarefulHand(Trees([tree(SHOWN)]), ["vlc"], timeout=3)
    escapes: list[bool] = []

    def recover(_: object, escape: bool) -> bool:
        escapes.append(escape)
        return False

    monkeypatch.setattr(hand, "recover", recover)
    for _ in range(2):  # each thing that is waited for has that time
        escapes.clear()
        with pytest.raises(DesktopTimeoutError):
            hand.find("link", "below")
        assert escapes[:4] == [False, False, True, True]
