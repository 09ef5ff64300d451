"""The numbers of a scoring run beside the success: parts of steps, reminders, words of summaries."""

import io
from dataclasses import replace

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from rich.console import Console

from online_env.report.build import build_report
from online_env.report.notes import unscored_note
from online_env.report.parts_table import parts_table
from online_env.results.parts import part_rows
from online_env.results.reading import Run
from online_env.scoring.onlookers import is_reminder, overlap
from online_env.scoring.progress import ScoreDisplay

from support.reported import made

# Parts


def step(task, label="clean", agent="a", **more):
    return made(agent, task, label, question="steps", malformed=0, **more)


def test_a_part_counts_the_steps_that_have_it_and_a_failure_counts_as_a_wrong_type():
    result = part_rows(
        [
            step("t0", parts={"type": True, "place": True}, target_visible=0.49),
            step("t1", parts={"type": True, "keys": False}, target_visible=0.5),
            step("t2", parts={"type": False, "place": False}, target_visible=0),
            step("t3", score=None, cause="agent"),
            step("t4", status="invalid", score=None, cause="machine", parts={"type": True}),
            {**step("t5", parts={"type": True}), "malformed": 1},
        ]
    )
    assert result == [
        {
            "agent": "a",
            "corruption": "clean",
            "n": 5,
            "type": 3 / 5,
            "place": 1 / 2,
            "end": None,
            "text": None,
            "keys": 0.0,
            "direction": None,
            "malformed": 1 / 5,
            "hidden": 2,
        }
    ]


def reminder(task, label, needed, given):
    return made("a", task, label, question="reminders", needed=needed, given=given)


def test_precision_and_recall_are_over_all_corruptions_and_their_mean_is_f1():
    result = part_rows(
        [
            reminder("t0", "lock", needed=True, given=True),
            reminder("t1", "lock", needed=True, given=True),
            reminder("t2", "lock", needed=True, given=False),
            reminder("t0", "clean", needed=False, given=True),
            reminder("t1", "clean", needed=False, given=False),
            reminder("t2", "clean", needed=False, given=False),
            reminder("t3", "clean", needed=False, given=False),
        ]
    )
    by_label = {row["corruption"]: row for row in result}
    total = by_label["all"]
    assert (total["n"], total["precision"], total["recall"]) == (7, 2 / 3, 2 / 3)
    harmonic = 2 / (1 / total["precision"] + 1 / total["recall"])
    assert total["f1"] == pytest.approx(harmonic)
    assert total["false_alarms"] == 1 / 4
    lock = by_label["lock"]
    assert (lock["precision"], lock["recall"], lock["false_alarms"]) == (1.0, 2 / 3, None)
    clean = by_label["clean"]
    assert (clean["precision"], clean["recall"], clean["f1"]) == (0.0, None, 0.0)


def printed_lines(records, **config):
    """The lines of the table that a scoring run has below the report."""
    stream = io.StringIO()
    run = Run(folder=None, config={"kind": "score", **config}, records=records)
    table = parts_table(run)
    if table is not None:
        Console(file=stream, width=120).print(table)
    return [" ".join(line.split()) for line in stream.getvalue().splitlines()]


def test_the_table_of_parts_has_the_order_of_the_configuration_and_names_as_they_are():
    records = [
        step("t0", "x", agent="[b]", parts={"type": False}),
        step("t0", "clean", agent="[b]", parts={"type": True}),
        step("t0", "clean", agent="a", parts={"type": True}),
    ]
    config = {"agents": ["a", "[b]"], "corruptions": ["clean", "x"], "question": "steps"}
    assert printed_lines(records, **config) == [
        "right, in percent",
        "corruption n type malformed hidden",
        "a",
        "clean 1 100.0 0.0 0",
        "[b]",
        "clean 1 100.0 0.0 0",
        "x 1 0.0 0.0 0",
    ]


def test_every_form_says_what_of_the_dataset_is_not_scored(tmp_path):
    """It stood below the table of the terminal alone."""
    records = [step(task, label) for task in ("t0", "t1") for label in ("clean", "marks")]
    config = {"kind": "score", "question": "steps", "unscored": 2, "unchanged": 3}
    run = Run(folder=tmp_path, config=config, records=records)
    notes = build_report(run).notes
    assert "Not scored: 2 rows with an action of no known type." in notes
    assert "Not scored: 3 corrupted rows with the clean picture." in notes
    assert not list(unscored_note(replace(run, config={**config, "unscored": 0, "unchanged": 0})))


def test_a_row_that_failed_is_a_line_while_the_run_goes_on():
    stream = io.StringIO()
    failed = {"status": "error", "row": "t0/0000/clean", "problem": "the agent:\n  [red]no"}
    with ScoreDisplay(2, Console(file=stream, width=40)) as display:
        display.tick("a", {"status": "ok"})
        display.tick("a", failed)
        display.notice("a: its rows are asked one by one")
    assert stream.getvalue().splitlines() == [
        "error: t0/0000/clean: the agent: [red]no",
        "note: a: its rows are asked one by one",
    ]


# Onlookers


@pytest.mark.parametrize(
    ("text", "is_one"),
    [
        ("REMINDER :  none.", False),
        ("`None`", False),
        ("none of it", True),
        ("Reminder: reminder", True),
        ("\n", False),
        ("0", True),
    ],
)
def test_the_word_none_is_no_reminder_however_it_is_written(text, is_one):
    assert is_reminder(text) is is_one


@pytest.mark.parametrize(
    ("answer", "reference", "share"),
    [
        ("an apple, a pear", "the apple: the pear", 1.0),
        ("apple apple apple", "apple", 0.5),  # a word counts as often as it is there
        ("theatre", "the atre", 0.0),  # articles are whole words
        ("apple", "", 0.0),
        ("the", "a", 1.0),
        ("ÄPFEL essen", "äpfel", 2 / 3),
    ],
)
def test_the_overlap_counts_words_as_often_as_both_have_them(answer, reference, share):
    assert overlap(answer, reference) == pytest.approx(share)
    assert overlap(reference, answer) == pytest.approx(share)
