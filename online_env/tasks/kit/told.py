"""Parts of plans in words that several tasks have."""

from collections.abc import Mapping
from typing import Any

from ..plan_words import quoted
from . import registrations


def visit(address: str, heading: str) -> list[str]:
    """Tell how to open a page in the browser that shows, and what to see then."""
    return [
        "press ctrl+l",
        f"type {quoted(address)}",
        "press delete",  # what the browser completed
        "press enter",
        f"wait for {quoted(heading)}",
    ]


def take_note(path: str, text: str) -> list[str]:
    """Tell how to write a text file with the editor; the path is relative to the home folder."""
    return [
        "press alt+f2",
        "wait",
        f"type {quoted('mousepad')}",
        "press enter",
        'window "Mousepad"',
        f"type {quoted(text)}",
        "press ctrl+s",
        f"wait for {quoted('Cancel')}",
        "press ctrl+a",
        f"type {quoted(f'/home/user/{path}')}",
        "press enter",
        f"wait for {quoted(path.rpartition('/')[2])}",
    ]


def register(entry: Mapping[str, Any]) -> list[str]:
    """Tell how to fill in the registration form, which is open and empty, and to send it."""
    year, month, day = entry["birth_date"].split("-")
    boxes = [registrations.content()["interests"][key] for key in entry["interests"]]
    notes = entry["notes"]
    return [
        'click "Full name"',
        f"type {quoted(entry['name'])}",
        "press tab",
        f"type {quoted(entry['email'])}",
        "press tab",
        f"type {quoted(month + day + year)}",
        'click "Country"',
        f"type {quoted(entry['country'])}",
        'click "Course"',
        f"type {quoted(registrations.course(entry['course']))}",
        f"click {quoted(registrations.level(entry['level']))}",
        *(f"click {quoted(box)}" for box in boxes),
        *(['click "Notes for the teacher"', f"type {quoted(notes)}"] if notes else ()),
        'scroll down to "Send registration"',
        'click "I accept the house rules"',
        'click "Send registration"',
        'wait for "You are registered"',
    ]
