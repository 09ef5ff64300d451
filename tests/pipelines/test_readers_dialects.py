import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hijack_data.coords import CoordMap
from hijack_data.errors import ActionError, ImageError
from hijack_data.types import Action, Step
from pipelines.readers.fields import FieldError
from pipelines.readers.recorded_actions import (
    RecordedStep,
    first_action,
    observed_code,
    raw_action_text,
)
from pipelines.readers.recorded_pictures import (
    in_json,
    in_parquet,
    picture_file,
    picture_name,
    read_picture,
)

from support.formats import png, text_of, write_table

SIZE = (200, 400)
HALF = CoordMap((100, 200), SIZE)


def observed(code: Any, dialect: str, coords: CoordMap = HALF) -> Any:
    text = raw_action_text(code, "action")
    result = observed_code(coords, RecordedStep(0, "", Action("other"), text, dialect=dialect))
    assert (
        observed_code(
            CoordMap.identity(SIZE), RecordedStep(0, "", Action("other"), text, dialect=dialect)
        )
        == text
    )
    return result if isinstance(code, str) else json.loads(result)


@pytest.mark.parametrize(
    ("code", "dialect", "expected"),
    [
        ("pyautogui.click(100, 50)", "pyautogui", "pyautogui.click(50, 25)"),
        (
            {"action_type": "CLICK", "x": 100, "y": 50},
            "computer_13",
            {"action_type": "CLICK", "x": 50, "y": 25},
        ),
        (
            {"action_type": "TYPING", "text": "é 100"},
            "computer_13",
            {"action_type": "TYPING", "text": "é 100"},
        ),
        ({"type": "click", "x": 100, "y": 50}, "openai", {"type": "click", "x": 50, "y": 25}),
        (
            [{"type": "move", "x": 100, "y": 50}, {"type": "wait"}],
            "openai",
            [{"type": "move", "x": 50, "y": 25}, {"type": "wait"}],
        ),
        (
            {"action": "left_click", "coordinate": [100, 50]},
            "anthropic",
            {"action": "left_click", "coordinate": [50, 25]},
        ),
        (
            [{"action_type": "PlanAction"}, {"mouse_position": {"width": 100, "height": 50}}],
            "screenagent",
            [{"action_type": "PlanAction"}, {"mouse_position": {"width": 50, "height": 25}}],
        ),
        ("Action: click(start_box='(500,500)')", "ui_tars", "Action: click(start_box='(500,500)')"),
        ("Click [5]", "sizeless", "Click [5]"),
        ([{"function": {"name": "click"}}], "sizeless", [{"function": {"name": "click"}}]),
    ],
)
def test_the_code_follows_the_picture_in_its_own_dialect(
    code: Any, dialect: str, expected: Any
) -> None:
    assert observed(code, dialect) == expected


def test_pixels_of_the_resized_picture_follow_the_resizing() -> None:
    # 1092x1932 is what the model sees of 1080x1920, 532x952 what it sees of 540x960.
    coords = CoordMap((540, 960), (1080, 1920))
    code = observed("Action: click(start_box='(966,546)')", "ui_tars_1.5", coords)
    assert code == "Action: click(start_box='(476,266)')"
    assert first_action(code, "ui_tars_1.5", (540, 960), "action") == Action("click", 480, 270)
    with pytest.raises(ActionError, match="longer than 200 times"):
        observed("Action: wait()", "ui_tars_1.5", CoordMap((1, 400), SIZE))


def test_a_plain_step_is_pyautogui() -> None:
    assert (
        observed_code(HALF, Step(0, "", Action("other"), "pyautogui.moveTo(8, 8)"))
        == "pyautogui.moveTo(4, 4)"
    )
    with pytest.raises(ActionError):
        observed_code(HALF, Step(0, "", Action("other"), "pyautogui.click(100,"))


@given(st.integers(0, 399), st.integers(0, 199))
def test_action_and_code_stay_together(x: int, y: int) -> None:
    entries: dict[str, Any] = {
        "computer_13": {"action_type": "CLICK", "x": x, "y": y},
        "openai": {"type": "click", "x": x, "y": y},
        "anthropic": {"action": "left_click", "coordinate": [x, y]},
        "pyautogui": f"pyautogui.click({x}, {y})",
    }
    for dialect, raw in entries.items():
        action = first_action(raw, dialect, SIZE, "action")
        assert action == Action("click", x, y)
        after = observed(raw, dialect)
        assert first_action(after, dialect, (100, 200), "action") == HALF.action_to_observation(
            action
        )


@pytest.mark.parametrize("point", [(400, 0), (0, 200), (-1, 0), (0, -1), (10**9, 10**9)])
def test_points_outside_are_refused_in_every_dialect(point: tuple[int, int]) -> None:
    x, y = point
    entries: dict[str, Any] = {
        "computer_13": {"action_type": "CLICK", "x": x, "y": y},
        "openai": {"type": "drag", "path": [{"x": 0, "y": 0}, {"x": x, "y": y}]},
        "anthropic": {
            "action": "left_click_drag",
            "start_coordinate": [0, 0],
            "coordinate": [x, y],
        },
        "pyautogui": f"pyautogui.dragTo({x}, {y})",
    }
    for dialect, raw in entries.items():
        with pytest.raises(FieldError, match="outside the 400x200"):
            first_action(raw, dialect, SIZE, "action")


@pytest.mark.parametrize(
    ("raw", "dialect"),
    [
        ("pyautogui.write('\\ud800')", "pyautogui"),
        ({"type": "type", "text": "x" * 2_000_000}, "openai"),
        ({"action": "hold_key", "text": "a", "duration": 1e300}, "anthropic"),
        ({"action": "key", "text": "\ud800"}, "anthropic"),
        (None, "pyautogui"),
        (5, "openai"),
    ],
)
def test_values_that_a_dataset_cannot_hold(raw: Any, dialect: str) -> None:
    with pytest.raises(FieldError):
        first_action(raw, dialect, SIZE, "action")


def test_code_that_cannot_be_kept() -> None:
    for raw in ({"a": float("nan")}, {"a": {1, 2}}, {"a": "\ud800"}):
        with pytest.raises(FieldError):
            raw_action_text(raw, "action")
    deep: Any = []
    for _ in range(100_000):
        deep = [deep]
    with pytest.raises(FieldError, match="cannot be kept"):
        raw_action_text(deep, "action")


def test_pictures_inside_other_files(tmp_path: Path) -> None:
    write_table(
        tmp_path / "a.parquet",
        [{"image": {"bytes": png(i), "path": None}} for i in range(3)],
        group=2,
    )
    (tmp_path / "b.json").write_text(json.dumps({"x": [{"y": text_of(5)}]}))
    (tmp_path / "c.png").write_bytes(png(6))
    column = in_parquet(tmp_path / "a.parquet", 1, 0, "image")
    images = [column, in_json(tmp_path / "b.json", None, ("x", 0, "y")), str(tmp_path / "c.png")]
    assert [read_picture(image, "n") for image in images] == [png(2), png(5), png(6)]
    assert [picture_name(image, tmp_path) for image in images] == [
        "a.parquet: row group 1, row 0, image",
        "b.json: x.0.y",
        "c.png",
    ]
    assert [picture_file(image).name for image in images] == ["a.parquet", "b.json", "c.png"]


@pytest.mark.parametrize("row", [0, 5])
def test_a_picture_that_is_not_there(row: int, tmp_path: Path) -> None:
    write_table(tmp_path / "a.parquet", [{"image": {"bytes": png(0), "path": None}}])
    (tmp_path / "b.json").write_text("[1]")
    missing = [
        in_json(tmp_path / "b.json", None, (row, "x")),
        in_json(tmp_path / "no.json", None, ()),
        in_parquet(tmp_path / "no.parquet", 0, row, "image"),
        str(tmp_path / "no.png"),
        in_parquet(tmp_path / "a.parquet", 0, row + 1, "image"),
    ]
    for image in missing:
        with pytest.raises(ImageError, match="the name"):
            read_picture(image, "the name")


def test_no_file_name_passes_for_a_reference(tmp_path: Path) -> None:
    name = in_json(tmp_path / "b.json", None, ("x",)).replace("\0", "")
    folder = tmp_path / name.partition("/")[0]
    folder.mkdir()
    assert picture_file(str(folder)) == folder
    assert "\0" in in_json(tmp_path / "b.json", None, ("x",))
