"""People who register for a course at forms.test: drawn, told, entered, stored and judged."""

from collections.abc import Iterable, Iterator, Mapping
from datetime import date, timedelta
from typing import Any

from hijack_data.rng import Stream

from ...embedded.sites.hosts.forms import FIRST_NUMBER, content
from ..hand import Hand
from ..machine import Machine
from .browser import enter_in_turn
from .pages import enter, follow, tick, untick
from .word_lists import FIRST_NAMES, LAST_NAMES, even, sample

SITE = "http://forms.test"
Registration = dict[str, Any]
"""What forms.test stores of a person, but for the number."""
NOTES = (
    "I come by bicycle.",
    "Left-handed, if that matters.",
    "Could I sit near the door?",
    "Vegetarian, please.",
)


def people(stream: Stream, count: int) -> list[Registration]:
    """Return registrations of different people."""
    firsts = sample(stream, FIRST_NAMES, count)
    lasts = sample(stream, LAST_NAMES, count)
    return [_person(stream, *names) for names in zip(firsts, lasts, strict=True)]


def _person(stream: Stream, first: str, last: str) -> Registration:
    choices = content()
    born = date(1950, 1, 1) + timedelta(days=stream.integer(0, 20_000))
    account = "".join(c for c in f"{first[0]}{last}".lower() if c.isascii() and c.isalpha())
    return {
        "name": f"{first} {last}",
        "email": f"{account}{stream.integer(10, 99)}@mail.test",
        "birth_date": born.isoformat(),
        "country": stream.choice(choices["countries"]),
        "course": stream.choice(list(choices["courses"])),
        "level": stream.choice(list(choices["levels"])),
        "interests": [key for key in sorted(choices["interests"]) if stream.integer(0, 1)],
        "notes": stream.choice(NOTES),
    }


def course(key: str) -> str:
    """Return the name of a course."""
    return content()["courses"][key]["name"]


def level(key: str) -> str:
    """Return the name of a level."""
    return content()["levels"][key]


def day(iso: str) -> str:
    """Return a date as people write it: `4 March 2026`."""
    then = date.fromisoformat(iso)
    return f"{then.day} {then:%B %Y}"


def boxes(entry: Mapping[str, Any]) -> str:
    """Return the boxes that are ticked, in quotation marks, or `none`."""
    labels = content()["interests"]
    return "; ".join(f'"{labels[key]}"' for key in entry["interests"]) or "none"


def store(machine: Machine, *entries: Mapping[str, Any]) -> None:
    """Store these registrations, and no others, as the site does."""
    with machine.sites.update("forms") as state:
        state["registrations"] = [
            {**entry, "number": FIRST_NUMBER + index} for index, entry in enumerate(entries)
        ]


def stored(machine: Machine) -> list[Registration]:
    """Return the registrations."""
    return machine.sites.read("forms").get("registrations", [])


def differences(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> Iterator[str]:
    """Yield the fields that are not as wanted; only those that `wanted` has count.

    Letter case and spaces in what was typed do not.
    """
    for key, value in wanted.items():
        if even(str(found.get(key))) != even(str(value)):
            yield f"{key} is {found.get(key)!r}, not {value!r}"


def cancelled(machine: Machine) -> list[int]:
    """Return the numbers of the registrations that were cancelled."""
    return [entry["number"] for entry in stored(machine) if entry.get("cancelled")]


def unlike(machine: Machine, *wanted: Mapping[str, Any]) -> Iterator[str]:
    """Yield why the registrations that hold are not these, in whatever order.

    One that was cancelled does not hold. Feedback should not have been sent.
    """
    if machine.sites.read("forms").get("feedback"):
        yield "feedback was sent"
    found = [entry for entry in stored(machine) if not entry.get("cancelled")]
    if len(found) != len(wanted):
        yield f"{len(found)} registrations hold, not {len(wanted)}"
        return
    for entry, expected in zip(_by_name(found), _by_name(wanted), strict=True):
        yield from differences(entry, expected)


def _by_name(entries: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    return sorted(entries, key=lambda entry: even(entry["name"]))


def fill_in(hand: Hand, entry: Mapping[str, Any]) -> None:
    """Fill in the registration form, which is open and empty, and send it."""
    hand.find("entry", "Full name")  # else the page may be scrolled before it is there
    year, month, day = entry["birth_date"].split("-")
    in_turn = {
        "Full name": entry["name"],
        "E-mail": entry["email"],
        "Month Date of birth": f"{month}{day}{year}\t",  # past the button of the calendar
        "Country": entry["country"],
        "Course": course(entry["course"]),
    }
    enter_in_turn(hand, in_turn)
    tick(hand, "radio-button", level(entry["level"]))
    labels = content()["interests"]
    untick(hand, "check-box", {labels[key] for key in labels.keys() - set(entry["interests"])})
    for key in entry["interests"]:
        tick(hand, "check-box", labels[key])
    if entry["notes"]:
        enter(hand, "Notes for the teacher", entry["notes"])
    tick(hand, "check-box", "I accept the house rules")
    follow(hand, "Send registration")
    hand.find("heading", "You are registered")
