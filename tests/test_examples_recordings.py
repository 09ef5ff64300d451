"""The shipped recordings keep the plain input format, and their bytes."""

import ast
import hashlib
import itertools
import json
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hijack_data.types import ACTION_TYPES

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
FOLDER = EXAMPLES / "recordings"
SHA256 = "61e720053bd10829943e8cfde1ad9a841a4010be5ac148c86bd47e4901a2edf7"
WIDTH, HEIGHT = 1920, 1080
POINTING = {"click": "click", "double_click": "doubleClick", "right_click": "rightClick"}
ROWS = [
    json.loads(line)
    for line in (FOLDER / "trajectories.jsonl").read_text(encoding="utf-8").splitlines()
]


@pytest.fixture(scope="module")
def pictures() -> dict[str, np.ndarray]:
    """Every screenshot by row id, decoded: uint8 [H, W, 3]."""
    entries = {}
    for row in ROWS:
        with Image.open(FOLDER / row["image"]) as image:
            assert (image.format, image.mode, image.size) == ("PNG", "RGB", (WIDTH, HEIGHT)), row[
                "image"
            ]
            entries[row["id"]] = np.asarray(image)
    return entries


def _inside(box: list[int]) -> bool:
    x1, y1, x2, y2 = box
    return all(type(v) is int for v in box) and 0 <= x1 < x2 <= WIDTH and 0 <= y1 < y2 <= HEIGHT


def test_rows_have_the_fields_of_the_format():
    required = {
        "id",
        "trajectory_id",
        "step",
        "instruction",
        "domain",
        "platform",
        "image",
        "action",
        "action_code",
        "elements",
    }
    for row in ROWS:
        assert set(row) - {"target_box"} == required, row["id"]
        assert row["action"]["type"] in ACTION_TYPES
        assert set(row["action"]) <= {"type", "x", "y", "x2", "y2", "text", "keys", "amount"}
        assert all(
            row[key].strip()
            for key in ("id", "trajectory_id", "instruction", "domain", "action_code")
        )
    assert len({row["id"] for row in ROWS}) == len(ROWS)


def test_trajectories_are_complete():
    steps = defaultdict(list)
    for row in ROWS:
        steps[row["trajectory_id"]].append(row)
    assert len(steps) == 3
    for name, rows in steps.items():
        assert [row["step"] for row in rows] == list(range(len(rows))), name
        assert 5 <= len(rows) <= 9, name
        assert len({(row["instruction"], row["domain"]) for row in rows}) == 1, name
        assert [row["action"]["type"] == "done" for row in rows] == [False] * (len(rows) - 1) + [
            True
        ], name
        assert (rows[-1]["action"], rows[-1]["action_code"]) == ({"type": "done"}, "DONE"), name


def test_the_recordings_are_those_that_were_made():
    """Datasets and documentation are built of them: a change of one byte is a new recording."""
    digest = hashlib.sha256((FOLDER / "trajectories.jsonl").read_bytes())
    for path in sorted((FOLDER / "images").iterdir()):
        digest.update(path.read_bytes())
    assert digest.hexdigest() == SHA256


def test_images_are_those_of_the_rows_and_the_folder_is_small():
    assert {f"images/{path.name}" for path in (FOLDER / "images").iterdir()} == {
        row["image"] for row in ROWS
    }
    assert len({row["image"] for row in ROWS}) == len(ROWS)
    assert {path.name for path in FOLDER.iterdir()} == {"README.md", "images", "trajectories.jsonl"}
    assert sum(path.stat().st_size for path in FOLDER.rglob("*") if path.is_file()) <= 4 * 2**20


def test_boxes_are_on_the_screen():
    for row in ROWS:
        boxes = row["elements"]
        assert len(boxes) >= 5, row["id"]
        assert all(_inside(box) for box in boxes), row["id"]
        assert len({tuple(box) for box in boxes}) == len(boxes), row["id"]


def test_points_are_in_their_target_which_is_an_element(pictures: dict[str, np.ndarray]):
    for row in ROWS:
        action = row["action"]
        assert (action["type"] in POINTING) == ("target_box" in row) == ("x" in action), row["id"]
        if "target_box" not in row:
            continue
        x1, y1, x2, y2 = row["target_box"]
        assert row["target_box"] in row["elements"], row["id"]
        assert x1 <= action["x"] < x2, row["id"]
        assert y1 <= action["y"] < y2, row["id"]
        assert len(np.unique(pictures[row["id"]][y1:y2, x1:x2].reshape(-1, 3), axis=0)) > 4, (
            "nothing is drawn there"
        )


def test_code_says_the_same_as_the_action():
    for row in ROWS:
        action = row["action"]
        if action["type"] == "done":
            continue
        call = ast.parse(row["action_code"], mode="eval").body
        assert isinstance(call, ast.Call)
        arguments = [ast.literal_eval(argument) for argument in call.args]
        expected = {
            "type": ("pyautogui.write", [action.get("text")]),
            "hotkey": ("pyautogui.hotkey", action.get("keys")),
        }.get(action["type"]) or (
            f"pyautogui.{POINTING[action['type']]}",
            [action["x"], action["y"]],
        )
        assert (ast.unparse(call.func), arguments) == expected, row["id"]


def test_every_action_shows_on_the_next_screenshot(pictures: dict[str, np.ndarray]):
    # without the panel, whose clock changes by itself
    desk = (slice(0, HEIGHT - 48), slice(0, WIDTH))
    for row, following in itertools.pairwise(ROWS):
        if row["trajectory_id"] == following["trajectory_id"]:
            changed_mask = (
                (pictures[row["id"]][desk] != pictures[following["id"]][desk]).any(axis=2).sum()
            )
            assert changed_mask > 50, row["id"]


def test_readme_says_how_it_was_made():
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert f"{len(ROWS)} steps" in text
    assert "hijack desktop record --task write_note -o DIR" in text
    for word in ("Apache-2.0", "mousepad 0.", "thunar 4.", "galculator 2."):
        assert word in text
