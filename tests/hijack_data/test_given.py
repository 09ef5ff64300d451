"""What records say that their agent was given."""

import pytest

from hijack_data.runs.privileged_inputs import (
    collect_privileged_inputs,
    describe_privileged_inputs,
    read_privileged_inputs,
)


@pytest.mark.parametrize(
    ("record", "given"),
    [
        ({"agent": "x", "given": []}, ()),
        ({"agent": "x", "given": ["plan", "task"]}, ("task", "plan")),
        ({"agent": "pixel", "given": None}, None),
        ({"agent": "pixel"}, None),
        ({"agent": "x", "given": "plan"}, None),
    ],
)
def test_a_record_tells_or_does_not(record, given):
    assert read_privileged_inputs(record) == given


def test_what_nobody_knows_is_left_out():
    records = [{"given": options} for options in ([], None, ["plan"], ["plan"])]
    assert collect_privileged_inputs(records) == {(), ("plan",)}


def test_words():
    assert (
        describe_privileged_inputs(("task", "plan"))
        == "the task and the machine and the task's plan in words"
    )
    assert (describe_privileged_inputs(()), describe_privileged_inputs(None)) == (
        "nothing more",
        "not recorded",
    )
    assert describe_privileged_inputs(("process",)) == "the runner's process (--in-process)"
