import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hijack_data.types import Action, Trajectory
from pipelines.readers import detect_format, safe_files

from support.formats import TASK, osworld, png, write_json, write_lines
from support.recordings import read_source

FOLDER = f"pyautogui/screenshot/a-model/gimp/{TASK}"
RECORDS = f"{FOLDER}/traj.jsonl"
CLICK = "pyautogui.click(100, 50)"

read = partial(read_source, name="osworld")


def pictures(trajectory: Trajectory) -> list[bytes]:
    return [Path(step.image).read_bytes() for step in trajectory]


def lines(folder: Path) -> list[Any]:
    return [json.loads(line) for line in (folder / RECORDS).read_text().splitlines()]


def test_each_step_has_the_screen_before_its_action(tmp_path: Path) -> None:
    osworld(tmp_path, [CLICK, "pyautogui.write('a')", "DONE"])
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    # the initial screen, then those after actions 1 and 2
    assert pictures(trajectory) == [png(0), png(1), png(2)]
    assert [s.action.type for s in trajectory] == ["click", "type", "done"]
    assert [s.index for s in trajectory] == [1, 2, 3]
    assert (trajectory.id, trajectory.domain, trajectory.apps) == (FOLDER, "gimp", ("gimp",))
    assert trajectory.instruction == "make it brighter"


def test_the_first_step_is_rejected_without_an_initial_screen(tmp_path: Path) -> None:
    osworld(tmp_path, [CLICK, "pyautogui.write('a')", "DONE"], initial=False)
    (trajectory,), (rejected,) = read(tmp_path)
    assert (rejected.file, rejected.where, rejected.field) == (RECORDS, "line 1", "screenshot_file")
    assert "first action was not saved" in rejected.reason
    assert [s.index for s in trajectory] == [2, 3]
    assert pictures(trajectory) == [png(1), png(2)]  # made as those after actions 1 and 2


@pytest.mark.parametrize(
    "below", ["", "pyautogui", "pyautogui/screenshot/a-model", FOLDER, RECORDS]
)
def test_any_folder_above_is_a_source(below: str, tmp_path: Path) -> None:
    osworld(tmp_path)
    write_json(tmp_path / FOLDER / "task.json", {"instruction": "make it brighter"})
    assert detect_format(tmp_path / below) == "osworld"
    (trajectory,), rejected = read(tmp_path / below)
    assert (len(trajectory.steps), rejected) == (2, [])
    assert trajectory.id.endswith(TASK)
    assert trajectory.instruction == "make it brighter"


def test_several_actions_of_one_reply_share_its_number(tmp_path: Path) -> None:
    osworld(tmp_path, [CLICK, "pyautogui.press('enter')", "WAIT", "FAIL"])
    records = lines(tmp_path)
    records[1]["step_num"] = 1
    write_lines(tmp_path / RECORDS, records)
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert [(s.index, s.action.type) for s in trajectory] == [
        (1, "click"),
        (2, "hotkey"),
        (3, "wait"),
        (4, "fail"),
    ]
    assert pictures(trajectory) == [png(i) for i in range(4)]


@pytest.mark.parametrize(
    ("action", "expected", "code"),
    [
        (
            {"action_type": "CLICK", "parameters": {"x": 7, "y": 8, "button": "right"}},
            Action("right_click", 7, 8),
            '{"action_type": "CLICK", "parameters": {"x": 7, "y": 8, "button": "right"}}',
        ),
        (
            {"action_type": "TYPING", "text": "é"},
            Action("type", text="é"),
            '{"action_type": "TYPING", "text": "é"}',
        ),
        ({"action_type": "DONE"}, Action("done"), '{"action_type": "DONE"}'),
        (
            {
                "name": "computer",
                "input": {"action": "left_click", "coordinate": [1, 1]},
                "action_type": "tool_use",
                "command": CLICK,
                "raw_response": "...",
            },
            Action("click", 100, 50),
            CLICK,
        ),
        (
            {"action_space": "pyautogui", "action": CLICK, "call_id": "c"},
            Action("click", 100, 50),
            CLICK,
        ),
    ],
)
def test_actions_that_are_objects(action: Any, expected: Action, code: str, tmp_path: Path) -> None:
    osworld(tmp_path, [action])
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert trajectory.steps[0].action == expected
    assert trajectory.steps[0].action_code == code


@pytest.mark.parametrize(
    ("action", "field", "reason"),
    [
        ("pyautogui.click(400, 50)", "action", "outside the 400x200"),
        ("pyautogui.click(100, -1)", "action", "outside the 400x200"),
        ("pyautogui.click(", "action", "line 1"),
        ("pyautogui.write('\\ud800')", "action", "surrogate"),
        ({"action_type": "JUMP"}, "action", "JUMP"),
        ({"action_type": "CLICK", "x": 1e400, "y": 1}, "action", "finite"),
        ({"action_type": "tool_use", "input": {"coordinate": [1, 1]}}, "action.command", "missing"),
        (None, "action", "must be code"),
        ([CLICK], "action", "must be code"),
    ],
)
def test_a_bad_action_is_counted_and_the_next_step_keeps_its_screen(
    action: Any, field: str, reason: str, tmp_path: Path
) -> None:
    osworld(tmp_path, [CLICK, action, "DONE"])
    (trajectory,), (rejected,) = read(tmp_path)
    assert (rejected.file, rejected.where, rejected.field) == (RECORDS, "line 2", field)
    assert reason in rejected.reason
    assert [s.index for s in trajectory] == [1, 3]
    assert pictures(trajectory) == [png(0), png(2)]


def test_a_line_that_says_error(tmp_path: Path) -> None:
    osworld(tmp_path)
    with (tmp_path / RECORDS).open("a") as file:
        file.write(json.dumps({"Error": "Time limit exceeded in gimp/x"}) + "\n")
    (trajectory,), (rejected,) = read(tmp_path)
    assert len(trajectory.steps) == 2
    assert (rejected.where, rejected.field) == ("line 3", "Error")
    assert "Time limit exceeded" in rejected.reason


def test_the_step_after_a_picture_that_is_missing(tmp_path: Path) -> None:
    osworld(tmp_path, [CLICK, CLICK, "DONE"])
    (tmp_path / FOLDER / lines(tmp_path)[0]["screenshot_file"]).unlink()
    (trajectory,), (rejected,) = read(tmp_path)
    assert [s.index for s in trajectory] == [1, 3]
    assert (rejected.where, rejected.field) == ("line 2", "screenshot_file")
    assert "not in the folder" in rejected.reason


@pytest.mark.parametrize(
    "name", ["../../../../../../secret.png", "/etc/hostname", "a\0b", 7, "x" * 5000]
)
def test_a_picture_outside_the_source(name: Any, tmp_path: Path) -> None:
    source = osworld(tmp_path / "source", [CLICK, CLICK, "DONE"])
    (tmp_path / "secret.png").write_bytes(png(0))
    records = lines(source)
    records[0]["screenshot_file"] = name
    write_lines(source / RECORDS, records)
    (trajectory,), (rejected,) = read(source)
    assert [s.index for s in trajectory] == [1, 3]
    assert (rejected.where, rejected.field) == ("line 2", "screenshot_file")


def test_the_picture_of_a_line_without_its_name(tmp_path: Path) -> None:
    osworld(tmp_path)
    records = [
        {k: v for k, v in record.items() if k != "screenshot_file"} for record in lines(tmp_path)
    ]
    write_lines(tmp_path / RECORDS, records)
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert pictures(trajectory) == [png(0), png(1)]


def test_a_run_that_was_cut_off_has_no_result_and_still_counts(tmp_path: Path) -> None:
    osworld(tmp_path)
    (tmp_path / FOLDER / "result.txt").unlink()
    (tmp_path / FOLDER / "runtime.log").unlink()
    assert len(read(tmp_path)[0][0].steps) == 2


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ("evaluation_examples/examples/gimp/" + TASK + ".json", "from afar"),
        (f"{FOLDER}/{TASK}.json", "from afar"),
        (f"{FOLDER}/task_config.json", "from afar"),
        ("examples/chrome/" + TASK + ".json", ""),
    ],
)
def test_where_the_instruction_may_be(place: str, expected: str, tmp_path: Path) -> None:
    osworld(tmp_path)
    (tmp_path / "examples" / "gimp" / f"{TASK}.json").unlink()
    write_json(tmp_path / place, {"instruction": "from afar"})
    (trajectory,), rejected = read(tmp_path)
    assert trajectory.instruction == expected
    assert [r.field for r in rejected] == ([] if expected else ["instruction"])
    assert len(trajectory.steps) == 2


def test_a_broken_task_file_is_named(tmp_path: Path) -> None:
    osworld(tmp_path)
    (tmp_path / "examples" / "gimp" / f"{TASK}.json").write_bytes(b"{\xff")
    (trajectory,), rejected = read(tmp_path)
    assert [r.field for r in rejected] == ["instruction", "instruction"]
    assert f"examples/gimp/{TASK}.json" in rejected[0].reason
    assert trajectory.instruction == ""


def test_a_first_line_may_name_the_initial_screen(tmp_path: Path) -> None:
    osworld(tmp_path, initial=False)
    (tmp_path / FOLDER / "start.png").write_bytes(png(9))
    write_lines(
        tmp_path / RECORDS,
        [{"instruction": "by hand", "initial_state": "start.png"}, *lines(tmp_path)],
    )
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert trajectory.instruction == "by hand"
    assert [s.index for s in trajectory] == [1, 2]
    assert pictures(trajectory)[0] == png(9)


REPLY = "I will click.\n```python\nimport pyautogui\npyautogui.click(1, 1)\n```"


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (
            REPLY + "import pyautogui\npyautogui.click(100, 50)",
            "import pyautogui\npyautogui.click(100, 50)",
        ),
        ("```python\npyautogui.click(1, 1)\n```pyautogui.click(100, 50)", CLICK),
        ("Thought: pyautogui.click(1, 1) is wrong\npyautogui.click(100, 50)", CLICK),
        ("Thought: done\nAction: finished()DONE", "DONE"),
        ("```DONE```WAIT", "WAIT"),
    ],
)
def test_the_authors_write_the_reply_before_the_action(
    text: str, code: str, tmp_path: Path
) -> None:
    osworld(tmp_path, [text])
    write_lines(tmp_path / RECORDS, [{**lines(tmp_path)[0], "summary": "None"}])
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert trajectory.steps[0].action_code == code
    if code.endswith(")"):
        assert trajectory.steps[0].action == Action("click", 100, 50)


def test_an_authors_line_without_an_action(tmp_path: Path) -> None:
    osworld(tmp_path, ["I do not know"])
    write_lines(tmp_path / RECORDS, [{**lines(tmp_path)[0], "summary": "None"}])
    trajectories, rejected = read(tmp_path)
    assert not trajectories
    assert [(r.where, r.field) for r in rejected] == [("line 1", "action")]


def test_pictures_of_the_authors_corrupted_runs_are_not_taken_for_clean_ones(
    tmp_path: Path,
) -> None:
    osworld(tmp_path, initial=False)
    for file in (tmp_path / FOLDER).glob("*.png"):
        file.rename(file.with_name(file.name.split("_2025")[0] + "_agent_observe.png"))
    trajectories, rejected = read(tmp_path)
    assert not trajectories
    assert [r.where for r in rejected] == ["line 1", "line 2"]
    assert all("own corruption" in r.reason for r in rejected)


def test_bad_lines_and_empty_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(safe_files, "MAX_RECORD_BYTES", 3000)
    osworld(tmp_path)
    good = (tmp_path / RECORDS).read_bytes()
    (tmp_path / RECORDS).write_bytes(b"\xff\n" + good + b'{"a": "' + b"x" * 5000 + b'"}\n[]\n')
    empty = tmp_path / "other" / "traj.jsonl"
    empty.parent.mkdir()
    empty.write_bytes(b"\n\n")
    (trajectory,), rejected = read(tmp_path)
    assert len(trajectory.steps) == 2
    assert [(r.file, r.where) for r in rejected] == [
        ("other/traj.jsonl", ""),
        (RECORDS, "line 1"),
        (RECORDS, "line 4"),
        (RECORDS, "line 5"),
    ]
    assert [r.reason.split()[-1] for r in rejected[:1]] == ["step"]
    assert "UTF-8" in rejected[1].reason
    assert "longer than" in rejected[2].reason
