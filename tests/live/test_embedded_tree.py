"""The accessibility tree where applications tell it wrong: error pages, locked screens, windows
kept in reserve."""

import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)

from lxml import etree

from hijack_data.plan import Effect
from online_env.effects import perform

from support.waiting import until

ST = "{https://accessibility.ubuntu.example.org/ns/state}"
CP = "{https://accessibility.ubuntu.example.org/ns/component}"


@pytest.fixture
def browser(up, browser_machine):
    return up(size=(720, 1280), apps=("browser",))


def showing(desktop, tag):
    """The nodes with this tag that are on the screen."""
    tree = etree.fromstring(desktop.accessibility().encode())
    return [node for node in tree.iter(tag) if node.get(f"{ST}showing") == "true"]


def visit(desktop, address):
    desktop.run(
        f"pyautogui.hotkey('ctrl', 'l'); pyautogui.write({address!r}); pyautogui.press('enter')"
    )


def named(desktop, tag, part):
    """The first showing node whose name holds `part`, once it is there."""

    def found():
        return [node for node in showing(desktop, tag) if part in node.get("name")]

    return until(found, f"a {tag} {part!r}", pause=0.3)[0]


def press(desktop, node):
    x, y = (int(v) for v in node.get(f"{CP}screencoord").strip("()").split(","))
    desktop.client.input([{"type": "click", "x": x + 8, "y": y + 8}])


def test_an_error_page_is_told_and_the_page_before_it_is_not(browser):
    visit(browser, "http://search.test/")
    shop = named(browser, "link", "Shop")
    firewall = perform(Effect("firewall", {}), browser)
    press(browser, shop)
    named(browser, "frame", "Network error")
    assert [node.get("name") for node in showing(browser, "document-web")] == ["shop.test"]
    assert any(
        "ERR_" in (n.get("name") or "") or "DNS_" in (n.get("name") or "")
        for n in showing(browser, "static")
    )
    assert not [node for node in showing(browser, "link") if node.get("name") == "Shop"]
    assert firewall.undo().ok
    browser.run("pyautogui.press('f5')")
    named(browser, "document-web", "Alder & Pine")
    assert len(showing(browser, "document-web")) == 1


def test_windows_kept_in_reserve_do_not_show(browser):
    visit(browser, "http://search.test/")
    named(browser, "link", "Shop")
    frames = [node.get("name") for node in showing(browser, "frame")]
    assert [name for name in frames if name and name != "Desktop"] == ["Lumen Search - Chromium"]
    assert len([name for name in frames if not name]) <= 2, "more than the panel and its plug-in"


def test_a_locked_screen_shows_its_dialog_and_nothing_else(up):
    desktop = up(size=(720, 1280), apps=("editor",))
    locked = perform(Effect("lock", {}), desktop)
    assert locked.probe().ok
    field = named(desktop, "password-text", "")
    assert {node.get("name") for node in showing(desktop, "push-button")} >= {"Cancel", "Unlock"}
    assert not [node for node in showing(desktop, "menu") if node.get("name") == "File"], (
        "the editor shows"
    )
    x, y = (int(v) for v in field.get(f"{CP}screencoord").strip("()").split(","))
    assert 0 < x < 1280
    assert 0 < y < 720
    assert locked.undo().ok
    named(desktop, "menu", "File")
    assert not showing(desktop, "password-text")


@needs.needs_apps("soffice")
def test_office_content_is_where_it_is_drawn_also_before_the_first_click(up):
    desktop = up(size=(720, 1280), apps=("writer",))
    named(desktop, "toggle-button", "Bold")

    def buttons():
        kinds = ("push-button", "toggle-button", "document-text")
        values = [node for kind in kinds for node in showing(desktop, kind)]
        return {(n.get("name"), n.get(f"{CP}size")): n.get(f"{CP}screencoord") for n in values}

    before = buttons()
    desktop.run("pyautogui.click(640, 400)")  # LibreOffice then looks where its window is
    after = until(buttons, "the tree", pause=0.3)
    common = before.keys() & after.keys()
    assert len(common) > 20
    assert {key: before[key] for key in common} == {key: after[key] for key in common}
    assert [node.get("name") for node in showing(desktop, "menu")].count("File") == 1
