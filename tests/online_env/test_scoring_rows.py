"""Rows that are scored: keys and places that are odd, what is selected, and how rows are written."""

import os
import signal
from collections import Counter

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.cli import main
from hijack_data.errors import HijackError, ParameterError
from hijack_data.types import Action
from online_env.results import records
from online_env.scoring import row_asker, run
from online_env.scoring.answers import read_answer
from online_env.scoring.cases import Selection, select_cases
from online_env.scoring.outlines import target_outline
from online_env.scoring.rules import Distance, ExpectedStep, compare, same_keys, unanswered

from support.reported import made

SIZE = (100, 100)


def expected_step(action, **more):
    return ExpectedStep(action=action, size=SIZE, **more)


# Keys


@pytest.mark.parametrize("code", ["pyautogui.press('')", "pyautogui.hotkey('')"])
def test_an_agent_that_presses_nothing_is_wrong_and_nothing_worse(code):
    """A model writes that at times; it must cost the step, not the process that asks it."""
    answer = read_answer("", [code], SIZE)
    verdict = compare(expected_step(Action("hotkey", keys=("ctrl", "s"))), answer.action)
    assert verdict.parts == {"type": True, "keys": False}
    assert verdict.reason == "keys: ('',)"


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (("",), ("ctrl",), False),
        (("",), ("",), True),
        (("ctrl", ""), ("ctrl",), True),
        (("ctrl", "ctrlright", "c"), ("ctrl", "c"), True),
        (("altright", "tab"), ("ALT", "TAB"), True),
        (("tab", "tab"), ("tab",), False),
        (("shift",), ("ctrl",), False),
        (("é",), ("É",), True),
    ],
)
def test_an_empty_name_is_no_key_and_a_key_pressed_twice_is_another_input(one, other, same):
    assert same_keys(one, other) is same
    assert same_keys(other, one) is same


def test_a_recorded_key_without_a_name_is_matched_by_no_key_at_all():
    """`hijack build` takes such a step, so scoring must not end over it."""
    nameless = expected_step(Action("hotkey", keys=("",)))
    assert compare(nameless, Action("hotkey", keys=("ctrl", "s"))).parts == {
        "type": True,
        "keys": False,
    }
    assert compare(nameless, Action("hotkey", keys=("",))).right


# Places


def test_a_point_without_a_place_to_be_in_is_never_near():
    drag = expected_step(Action("drag", 10, 10, 50, 50))
    verdict = compare(drag, Action("drag", 10, 10))
    assert verdict.parts == {"type": True, "place": True, "end": False}
    assert verdict.reason == "end: None"
    assert verdict.off == 0.0
    assert compare(drag, Action("drag", x2=50, y2=50)).off is None


def test_how_far_a_click_was_off_is_the_distance_of_the_points_of_the_picture():
    result = compare(
        expected_step(Action("click", 10, 20), scale=(0.5, 0.5)), Action("click", 13, 24)
    )
    assert result.off == 5.0
    assert compare(expected_step(Action("click", 0, 0)), Action("click", 1, 1)).off == 1.4


@pytest.mark.parametrize(
    ("text", "got", "right"),
    [
        ("10", (16, 28), True),  # 6 and 8 make 10
        ("10", (17, 28), False),
        ("10%", (16, 28), True),  # of 100 by 100 pixels
        ("9.9%", (16, 28), False),
    ],
)
def test_a_distance_is_measured_across_and_down_together(text, got, right):
    near = Distance.parse(text)
    assert (
        compare(expected_step(Action("click", 10, 20)), Action("click", *got), near).right is right
    )


def test_an_answer_without_an_action_lacks_every_part_that_the_step_has():
    click = Action("click", 1, 2, keys=("ctrl",))
    verdict = unanswered(expected_step(click), "no action: what it was")
    assert verdict.parts == {"type": False, "place": False, "keys": False}
    assert (verdict.reason, verdict.off, verdict.right) == ("no action: what it was", None, False)
    assert unanswered(expected_step(Action("wait")), "").parts == {"type": False}
    assert unanswered(expected_step(Action("scroll", 1, 1, amount=0)), "").parts == {"type": False}


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        ('{"target_polygon": [[0, 0], [1', "extra: is not JSON (Expecting ',' delimiter"),
        ("[" * 100_000 + '"target_polygon"', "extra: is not JSON (maximum recursion depth"),
        ('{"target_polygon": [[0, 0], [1, NaN], [2, 2]]}', "must be three points [x, y] or more"),
        ('{"target_polygon": [[0, 0], [1, 1e999], [2, 2]]}', "must be three points [x, y] or more"),
        (
            f'{{"target_polygon": [[0, 0], [1, 1{"0" * 400}], [2, 2]]}}',
            "must be three points [x, y] or more",
        ),
        ('{"target_polygon": [[0, 0], [1, true], [2, 2]]}', "must be three points [x, y] or more"),
        ('{"target_polygon": [[0, 0], [1, 1, 1], [2, 2]]}', "must be three points [x, y] or more"),
        ('{"target_polygon": [[0, 0], [1, 1]]}', "must be three points [x, y] or more"),
        ('{"target_polygon": {"x": 1}}', "must be three points [x, y] or more"),
    ],
)
def test_an_outline_that_is_none_is_an_error_of_the_row_and_no_crash(extra, said):
    """A row of which nothing can be asked is invalid; the agent is not to blame."""
    with pytest.raises(ParameterError) as error:
        target_outline(extra, (1.0, 1.0))
    assert said in str(error.value)
    assert len(str(error.value)) < 400


@pytest.mark.parametrize(
    "target",
    [
        {"target_box": [5, 5, 5, 9]},
        {"target_box": [200, 5, 220, 9]},
        {"extra": '{"target_polygon": [[1, 1], [1, 1], [9, 9], [5, 5]]}'},
        {"extra": '{"target_polygon": [[1, -9], [9, -9], [9, -1]]}'},
    ],
)
def test_a_target_that_no_answer_can_hit_is_an_error_of_the_row(target):
    action = dict.fromkeys(("x", "y", "x2", "y2", "text", "keys", "amount"))
    row = {"corruption": "clean", "width": 200, "height": 100, "reminder": None}
    row |= {"target_box": None, "extra": None, "action": {"type": "click", **action}}
    with pytest.raises(ParameterError, match="no point of the picture of 200x100 pixels"):
        row_asker.expected_step({**row, **target})
    row_asker.expected_step(row | {"extra": '{"target_polygon": [[1, 1], [9, 9], [9, 1], [1, 9]]}'})


@pytest.mark.parametrize("extra", ["", "{}", '["target_polygon"]', '{"about": "target_polygon"}'])
def test_a_row_without_an_outline_has_none(extra):
    assert target_outline(extra, (1.0, 1.0)) == ()


# Which rows


class Heads:
    """Two trajectories under three conditions; the second has no clean row."""

    def heads(self):
        for task, label in (
            ("t0", "clean"),
            ("t0", "marks"),
            ("t0", "resolution"),
            ("t1", "marks"),
            ("t1", "resolution"),
        ):
            yield (
                "train",
                {
                    "id": f"{task}/0000/{label}",
                    "trajectory_id": task,
                    "step": 0,
                    "corruption": label,
                    "seed": 7,
                    "action": {"type": "click"},
                    "reminder": None,
                    "changed_pixels": 5,
                },
            )


def test_corrupted_rows_without_a_clean_one_are_counted():
    result = select_cases(Heads(), "steps", Selection())
    assert Counter(case.corruption for case in result.cases) == {
        "clean": 1,
        "marks": 2,
        "resolution": 2,
    }
    assert (result.unpaired, result.unscored) == (2, 0)
    marks = select_cases(Heads(), "steps", Selection(corruptions=("marks",)))
    assert (marks.labels, marks.unpaired) == (("clean", "marks"), 1)
    first = select_cases(Heads(), "steps", Selection(limit=1))
    assert ({case.task for case in first.cases}, first.unpaired) == ({"t0"}, 0)
    assert [case.number for case in result.cases] == list(range(5))


@pytest.mark.parametrize(
    ("chosen", "said"),
    [
        (Selection(split="test"), "--split: no 'test' in the dataset; known: train (it has train)"),
        (
            Selection(corruptions=("mark",)),
            "--corruptions: no 'mark' in the dataset; did you mean 'marks'? (it has clean, marks,"
            " resolution)",
        ),
    ],
)
def test_what_a_dataset_does_not_have_is_named_with_what_it_has(chosen, said):
    with pytest.raises(ParameterError) as error:
        select_cases(Heads(), "steps", chosen)
    assert str(error.value) == said


@pytest.mark.parametrize("timeout", ["inf", "nan", "-inf"])
def test_a_time_limit_that_no_json_holds_is_refused_before_the_run(timeout, tmp_path, capsys):
    """It would be written into `run.json`, which nothing could read again."""
    words = ["score", str(tmp_path), "--agent", "fail", "-o", str(tmp_path / "run")]
    with pytest.raises(SystemExit) as ended:
        main([*words, f"--timeout={timeout}"])
    assert ended.value.code == 2
    output = capsys.readouterr().err
    assert "Invalid value for '--timeout'" in output
    assert not (tmp_path / "run").exists()


def test_ctrl_c_while_rows_are_written_appends_none_of_them_twice(tmp_path, monkeypatch):
    """A row that is there twice would damage the run, which could not be gone on with."""
    out = tmp_path / "run"
    values = [made("a", f"t{number}") for number in range(run.MAX_UNWRITTEN_ROWS + 5)]
    records.create(out, {}, [record["id"] for record in values]).release()
    monkeypatch.setattr(os, "fsync", lambda _: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        run._write(out, values, lambda _: None)
    monkeypatch.undo()
    stored_records = records.read(out)
    assert stored_records.damaged == []
    assert [record["id"] for record in stored_records.records] == [
        record["id"] for record in values[: run.MAX_UNWRITTEN_ROWS]
    ]


def test_rows_that_are_held_are_written_if_an_agent_ends_the_run(tmp_path):
    out = tmp_path / "run"
    values = [made("a", f"t{number}") for number in range(3)]
    records.create(out, {}, [record["id"] for record in values]).release()

    def answers():
        yield from values
        raise HijackError("the agent is gone")

    with pytest.raises(HijackError, match="the agent is gone"):
        run._write(out, answers(), lambda _: None)
    assert records.read(out).records == values
