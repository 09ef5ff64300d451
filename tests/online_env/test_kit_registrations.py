"""Registrations at forms.test: people who are drawn can register, and are judged field by field."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from hijack_data.rng import Stream
from online_env.embedded.sites.hosts import forms
from online_env.embedded.sites.state import SiteState
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import registrations
from online_env.tasks.machine import Machine


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(FolderDesktop(tmp_path), SiteState(tmp_path / "sites"))


@given(st.integers(0, 2**64 - 1))
def test_the_site_accepts_whoever_is_drawn(seed: int) -> None:
    people = registrations.people(Stream(seed, "test"), 3)
    assert len({entry["name"] for entry in people}) == 3
    for entry in people:
        assert forms._problems(entry, agreed=True) == {}
        assert entry["interests"] == sorted(entry["interests"])


def test_registrations_are_judged_in_whatever_order(machine: Machine) -> None:
    value, two = registrations.people(Stream(1, "test"), 2)
    registrations.store(machine, two, value)
    assert [entry["number"] for entry in registrations.read_registrations(machine)] == [1001, 1002]
    assert list(registrations.registration_problems(machine, value, two)) == []
    assert list(registrations.registration_problems(machine, value)) == [
        "2 registrations hold, not 1"
    ]
    registrations.store(machine, {**value, "notes": "other"}, two)
    (problem,) = registrations.registration_problems(machine, value, two)
    assert problem == f"notes is 'other', not {value['notes']!r}"


def test_how_somebody_types_does_not_count(machine: Machine) -> None:
    value, two = registrations.people(Stream(1, "test"), 2)
    typed = {key: value[key].upper() + " " for key in ("name", "email", "notes")}
    registrations.store(machine, {**value, **typed}, two)
    assert list(registrations.registration_problems(machine, value, two)) == []


def test_a_cancelled_registration_does_not_hold(machine: Machine) -> None:
    value, two = registrations.people(Stream(1, "test"), 2)
    registrations.store(machine, {**value, "cancelled": True}, two)
    assert registrations.cancelled_numbers(machine) == [1001]
    assert list(registrations.registration_problems(machine, two)) == []
    assert list(registrations.registration_problems(machine, value, two)) == [
        "1 registrations hold, not 2"
    ]


def test_feedback_is_more_than_a_registration(machine: Machine) -> None:
    with machine.sites.update("forms") as state:
        state["feedback"] = [{"course": "chess", "rating": "good", "comment": "", "quote": False}]
    assert list(registrations.registration_problems(machine)) == ["feedback was sent"]


def test_what_is_told_of_a_person() -> None:
    assert registrations.day("1990-05-07") == "7 May 1990"
    assert registrations.boxes({"interests": []}) == "none"
    assert registrations.boxes({"interests": ["carpool"]}) == '"I can share a car"'
