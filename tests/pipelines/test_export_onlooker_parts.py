"""What is drawn for an onlooker, and the sentences that are made for it."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hijack_data.types import ACTION_TYPES
from pipelines.dataset.columns import ACTION
from pipelines.exports.onlooker.messages import MAX_QUOTED_CHARS, describe_action, summary_messages
from pipelines.exports.onlooker.sampling import KINDS, WITH_REMINDER, OnlookerSampler
from pipelines.exports.onlooker.screen_change import TOLERANCE, ScreenChange, measure

frames = st.lists(
    st.tuples(st.integers(0, 3), st.sampled_from(["clean", "marks", "touch", "lock"])),
    unique=True,
    max_size=12,
)


@given(st.lists(frames, max_size=5), st.integers(0, 40), st.integers(0, 2**64 - 1))
def test_what_is_drawn(trajectories: list[list[tuple[int, str]]], tenths: int, seed: int) -> None:
    """Everything with a reminder, nothing twice, and as many others as are owed so far or are
    there."""
    rows = [
        {
            "trajectory_id": f"t{name}",
            "step": step,
            "corruption": label,
            "event": "it happened" if label in ("touch", "lock") else None,
            "reminder": "wait" if label == "lock" else None,
            "changed_pixels": 0 if label == "clean" else 7,
        }
        for name, steps in enumerate(trajectories)
        for step, label in sorted(steps)
    ]
    chooser = OnlookerSampler(seed, tenths / 10)
    result = chooser.choose_rows(rows)
    assert result == OnlookerSampler(seed, tenths / 10).choose_rows(rows)
    needed = {number for number, row in enumerate(rows) if row["reminder"]}
    assert {number for number, kind in result.items() if kind == WITH_REMINDER} == needed
    assert {kind for number, kind in result.items() if number not in needed} <= set(KINDS)
    owed = Counter[int]()
    expected = 0
    for name, steps in enumerate(trajectories):  # in tenths, so that nothing is lost by rounding
        expected += tenths * sum(label == "lock" for _, label in steps)
        owed[name] = min(expected // 10, sum(label != "lock" for _, label in steps))
        expected -= 10 * owed[name]
    taken_counts = Counter(
        int(rows[number]["trajectory_id"][1:]) for number in result if number not in needed
    )
    assert taken_counts == Counter({name: count for name, count in owed.items() if count})
    assert chooser.short == expected // 10


def test_each_kind_is_drawn_as_often() -> None:
    """Many frames of one kind don't crowd out the others, and the clean screen of the same step is
    among them."""
    rows = [
        {
            "trajectory_id": f"t{k // 10}",
            "step": 0,
            "corruption": label,
            "event": event,
            "reminder": reminder,
            "changed_pixels": changed,
        }
        for k in range(0, 4000, 10)
        for label, event, reminder, changed in [
            ("lock", "x", "wait", 9),
            ("clean", None, None, 0),
            ("touch", "y", None, 9),
            *[("marks", None, None, 9)] * 7,
            *[("missed_input", None, None, 0)] * 7,  # their pictures are those of clean rows
        ]
    ]
    chosen = OnlookerSampler(1, 1).choose_rows(rows)
    counts = Counter(chosen.values())
    assert counts[WITH_REMINDER] == 400
    assert set(counts) == {WITH_REMINDER, "same_step", "picture", "event"}
    assert all(100 < counts[kind] < 167 for kind in ("same_step", "picture", "event"))
    assert not any(rows[number]["corruption"] == "missed_input" for number in chosen)


def test_words_for_every_action() -> None:
    empty: dict[str, Any] = dict.fromkeys(ACTION)
    entries = {kind: describe_action({**empty, "type": kind}, "") for kind in ACTION_TYPES}
    assert len(set(entries.values())) == len(ACTION_TYPES)
    full = {**empty, "x": 1, "y": 2, "x2": 3, "y2": 4, "text": 'a "b"\n', "keys": ["ctrl", "s"]}
    says = lambda kind, **more: describe_action(  # noqa: E731
        {**full, "type": kind, **more}, ""
    )
    assert says("right_click", keys=["shift"]) == "right-clicked at (1, 2) while holding shift"
    assert says("drag", keys=None) == "dragged from (1, 2) to (3, 4)"
    assert says("drag", keys=None, x=None) == "dragged to (3, 4)"
    assert says("move", keys=None) == "moved the pointer to (1, 2)"
    assert [says("scroll", keys=None, amount=amount) for amount in (-2, 2, None)] == [
        "scrolled down at (1, 2)",
        "scrolled up at (1, 2)",
        "scrolled at (1, 2)",
    ]
    assert says("type", keys=None) == r'typed "a \"b\"\n"'
    assert (says("hotkey"), says("key_up", keys=["alt"])) == ("pressed ctrl+s", "let go of alt")
    long = says("type", keys=None, text="x" * 999)
    assert long == f'typed "{"x" * MAX_QUOTED_CHARS}..."'
    assert [
        message["content"].count("<image>")
        for message in summary_messages("<image>", "<image>", "<image>")
    ] == [2, 0]


def screen(*boxes: tuple[int, int, int, int], value: int = 200) -> np.ndarray:
    picture = np.full((90, 90, 3), 100, np.uint8)
    for x1, y1, x2, y2 in boxes:
        picture[y1:y2, x1:x2, 1] = value
    return picture


@pytest.mark.parametrize(
    ("boxes", "text"),
    [
        ([], "No change of the screen was measured."),
        ([(0, 0, 9, 1)], "Less than 1 % of the screen changed, mostly in the upper left."),
        ([(60, 60, 90, 90)], "About 11 % of the screen changed, mostly in the lower right."),
        ([(30, 30, 60, 60)], "About 11 % of the screen changed, mostly in the middle."),
        ([(60, 30, 90, 60)], "About 11 % of the screen changed, mostly in the middle right."),
        ([(0, 60, 90, 90)], "About 33 % of the screen changed, mostly in the lower third."),
        ([(0, 0, 30, 90)], "About 33 % of the screen changed, mostly in the left third."),
        ([(0, 0, 90, 90)], "About 100 % of the screen changed, in several places."),
        (
            [(0, 0, 30, 30), (60, 60, 90, 90)],
            "About 22 % of the screen changed, in several places.",
        ),
    ],
)
def test_words_for_a_change(boxes: list[tuple[int, int, int, int]], text: str) -> None:
    assert measure(screen(), screen(*boxes)).text() == text
    assert measure(screen(*boxes), screen()).text() == text


def test_a_change_is_more_than_noise_and_may_be_of_the_size() -> None:
    screen_box = (0, 0, 90, 90)
    assert measure(screen(), screen(screen_box, value=100 + TOLERANCE)) == ScreenChange(
        0.0, measure(screen(), screen()).location
    )
    assert measure(screen(), screen(screen_box, value=101 + TOLERANCE)).share == 1
    assert measure(screen(), screen(screen_box, value=99 - TOLERANCE)).share == 1
    assert measure(screen(), screen()[:50]).text() == "The size of the screen changed."
