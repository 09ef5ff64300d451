"""Pages in the real browser: addresses, links, fields, lists, boxes."""

import re
from typing import Any

import pytest

from online_env.tasks import Hand, Machine
from online_env.tasks.kit import browser
from online_env.tasks.task_apps import APPS

REGISTER = "http://forms.test/register"


@pytest.fixture
def machine(browser_machine: None, embedded_desktop: Any) -> Machine:
    """A desktop with the browser on a page with links."""
    result = Machine(embedded_desktop)
    result.open("chrome", "http://forms.test/")
    return result


@pytest.fixture
def hand(machine: Machine) -> Hand:
    return Hand(machine.desktop)


def test_a_form_is_filled_wherever_the_browser_was_before(hand: Hand) -> None:
    assert any(node.role == "link" for node in browser.page(hand))  # no blank window
    browser.begin(hand, REGISTER, "Course registration")
    for _ in range(2):  # what is filled in already is replaced
        browser.enter(hand, "Full name", "Zoë")
        browser.select(hand, "Country", "Norway")
        browser.tick(hand, browser.starting("Some"))
        browser.begin(hand, REGISTER, "Course registration")
    entries = {(node.role, node.name): node for node in browser.page(hand)}
    assert entries["entry", "Full name"].text == "Zoë"
    assert "checked" in entries["radio-button", "Some experience"].states
    assert ("entry", browser.BAR) not in entries
    assert browser.shows_text(hand, "push-button", "Send registration")
    assert not browser.shows_text(hand, "push-button", "Withdraw registration")
    assert browser.shows_text(hand, "entry", "Full name")  # it is at the top again
    browser.push(hand, "Send registration", "Course registration")
    hand.find("static", re.compile("Please correct"))
    browser.follow(hand, "House rules", re.compile("House rules"))


def test_the_dialog_to_save_a_page_is_in_the_tree(machine: Machine, hand: Hand) -> None:
    hand.press("ctrl", "s")
    hand.choose_file("Music/courses.html", "Save", APPS["chrome"].helper)
    hand.wait("the file", lambda _: machine.text("Music/courses.html") is not None)


@pytest.mark.parametrize(
    ("name", "fits"),
    [("Oda 1 + 1 = 2", True), ("Oda 1 + 1 = 2 and more", True), ("Oda 1 1 = 2", False)],
)
def test_a_name_that_begins_with_some_parts(name: str, fits: bool) -> None:
    assert bool(browser.starting("Oda", "1 + 1").match(name)) is fits
