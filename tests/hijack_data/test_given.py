"""What records say that their agent was given."""

import pytest

from hijack_data.runs.given import given_of, given_to, given_words


@pytest.mark.parametrize(
    ("record", "given"),
    [
        ({"version": 3, "agent": "x", "given": []}, ()),
        ({"version": 3, "agent": "x", "given": ["plan", "task"]}, ("task", "plan")),
        ({"version": 3, "agent": "pixel", "given": None}, None),
        ({"version": 3, "agent": "pixel"}, None),
        ({"version": 2, "agent": "pixel"}, ("plan",)),
        ({"agent": "recovering"}, ("task",)),
        ({"version": 2, "agent": "random"}, ()),
        ({"version": 2, "agent": "mine.py:Mine"}, None),
        ({"version": 3, "agent": "x", "given": "plan"}, None),
    ],
)
def test_a_record_tells_or_does_not(record, given):
    assert given_of(record) == given


def test_what_nobody_knows_is_left_out():
    records = [{"version": 3, "given": given} for given in ([], None, ["plan"], ["plan"])]
    assert given_to(records) == {(), ("plan",)}


def test_words():
    assert given_words(("task", "plan")) == "the task and the machine and the task's plan in words"
    assert (given_words(()), given_words(None)) == ("nothing more", "not recorded")
    assert given_words(("process",)) == "the runner's process (--in-process)"
