"""Pages in Chromium, on a desktop whose trees are written down."""

from dataclasses import dataclass, field

import pytest

from online_env.desktops.protocol import RunResult
from online_env.errors import DesktopTimeoutError
from online_env.tasks.hand import Hand
from online_env.tasks.kit import browser, pages

SPACE = "https://accessibility.ubuntu.example.org/ns"


def tree(*nodes: str) -> str:
    return (
        f'<desktop-frame xmlns:st="{SPACE}/state" xmlns:cp="{SPACE}/component" name="main">'
        f'<application name="Google Chrome">{"".join(nodes)}</application></desktop-frame>'
    )


def node(role: str, name: str, *states: str, box: str = '"(100, 200)" cp:size="(80, 100)"') -> str:
    flags = " ".join(f'st:{state}="true"' for state in ("showing", "visible", *states))
    return f'<{role} name="{name}" {flags} cp:screencoord={box}/>'


@dataclass
class Pages:
    """A desktop that shows the next tree after each action, and the last one from then on."""

    trees: list[str]
    ran: list[str] = field(default_factory=list)

    def accessibility(self) -> str:
        return self.trees[min(len(self.ran), len(self.trees) - 1)]

    def run(self, code: str) -> RunResult:
        self.ran.append(code)
        return RunResult("success", returncode=0)


def test_an_item_of_a_menu_is_clicked_by_its_place() -> None:
    button, menu = node("push-button", "More actions for News"), node("menu", "", "focused")
    desktop = Pages([tree(button), tree(menu)])
    pages.pick(Hand(desktop, 5), "More actions for News", 1)
    assert desktop.ran == ["pyautogui.click(140, 250)", "pyautogui.click(140, 262)"]


def test_what_is_ticked_is_not_clicked() -> None:
    ticked, empty = node("check-box", "Yes", "checked"), node("check-box", "Yes")
    result = Pages([tree(ticked)])
    pages.tick(Hand(result, 1), "check-box", "Yes")
    assert result.ran == []
    new = Pages([tree(empty), tree(ticked)])
    pages.tick(Hand(new, 1), "check-box", "Yes")
    assert new.ran == ["pyautogui.click(140, 250)"]
    dead = Pages([tree(empty)])
    with pytest.raises(DesktopTimeoutError, match="checked check-box Yes"):
        pages.tick(Hand(dead, 0), "check-box", "Yes")


def test_what_was_ticked_by_accident_is_cleared_and_nothing_else() -> None:
    second = node("check-box", "Other", "checked")
    ticked, empty = node("check-box", "Yes", "checked"), node("check-box", "Yes")
    off = node("check-box", "No")
    desktop = Pages([tree(second, ticked, off), tree(second, empty, off)])
    pages.untick(Hand(desktop, 1), "check-box", {"Yes", "No"})
    assert desktop.ran == ["pyautogui.click(140, 250)"]
    dead = Pages([tree(ticked)])
    with pytest.raises(DesktopTimeoutError, match="checked check-box Yes"):
        pages.untick(Hand(dead, 0), "check-box", {"Yes"})


def test_a_visit_waits_for_the_page() -> None:
    bar, frame = (
        node("entry", "Address and search bar"),
        node("frame", "Tea - Openfolio - Chromium"),
    )
    page = node("document-web", "Tea - Openfolio")
    desktop = Pages([tree(bar, node("frame", "Other"))] * 2 + [tree(bar, frame, page)])
    pages.visit(Hand(desktop, 1), "http://wiki.test/wiki/Tea", "Tea - Open")
    assert desktop.ran[0] == "pyautogui.hotkey('ctrl', 'l')"
    assert "press('delete')" in desktop.ran[1]
    with pytest.raises(DesktopTimeoutError, match="Tide"):
        pages.visit(Hand(desktop, 0), "http://wiki.test/wiki/Tide", "Tide")


def test_fields_are_entered_with_the_tab_key_between_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(browser, "_TABBING", 0.0)
    name, result = node("entry", "Name", "focused"), node("entry", "Name")
    country = node("combo-box", "Country", "focused")
    values = {"Name": "Zoë", "Country": "Norway"}
    first = ["pyautogui.click(140, 250)", "pyautogui.hotkey('ctrl', 'a')"]
    typed = [r"pyautogui.write('Zoë\t')", r"pyautogui.write('Norway\t')"]
    desktop = Pages([tree(result), tree(name), tree(name), tree(country)])
    browser.enter_in_turn(Hand(desktop, 1), values)
    assert desktop.ran == [*first, *typed]
    # The focus went elsewhere: the next field is clicked, a list by its label.
    away = tree(node("combo-box", "Country"), node("static", "Country"))
    desktop = Pages([tree(result), tree(name), tree(name), away, tree(country)])
    browser.enter_in_turn(Hand(desktop, 1), values)
    assert desktop.ran == [*first, typed[0], "pyautogui.click(140, 250)", typed[1]]
