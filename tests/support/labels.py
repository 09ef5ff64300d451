"""Where the labels of a corrupted row must lie, judged by its pixels and by the clean row of the
same step."""

from typing import Any

import numpy as np

import hijack_data as hj
from hijack_data.pack import AssetPack
from hijack_data.plan import Paste

EFFECTS = {"accidental_touch": "touch", "app_minimization": "minimise"}


def check_inside(row: dict[str, Any]) -> None:
    """Points lie in the picture, and where a box is given, the point lies in it."""
    action, box = row["action"], row["target_box"]
    for x, y in ends(action):
        assert 0 <= x < row["width"]
        assert 0 <= y < row["height"]
    if box is not None:
        assert 0 <= box[0] <= action["x"] < box[2] <= row["width"]
        assert 0 <= box[1] <= action["y"] < box[3] <= row["height"]
    assert (row["target_visible"] is None) == (box is None and action["x"] is None)
    assert row["event"] is None or row["target_visible"] in (None, 1.0)


def check_scaled(row: dict[str, Any], clean: dict[str, Any]) -> None:
    """The same action, in pixels of what is shown now."""
    scale = 0.5 if row["corruption"] == "resolution" else 1
    assert (row["width"], row["height"]) == (
        round(clean["width"] * scale),
        round(clean["height"] * scale),
    )
    for name in ("x", "y", "x2", "y2"):
        now, then = row["action"][name], clean["action"][name]
        assert (now is None) == (then is None)
        assert then is None or abs(now - then * scale) <= 0.5
    fields = ("type", "text", "keys", "amount")
    assert [row["action"][name] for name in fields] == [clean["action"][name] for name in fields]
    assert (row["target_box"] is None) == (clean["target_box"] is None)
    if clean["target_box"] is not None:
        assert (
            np.abs(np.array(row["target_box"]) - np.array(clean["target_box"]) * scale).max() <= 0.5
        )
    if scale == 1:
        assert row["action_code"] == clean["action_code"]


def check_beside(row: dict[str, Any], clean: dict[str, Any]) -> None:
    """The recorded action stands, and all that it passes looks as it did."""
    for name in ("action", "action_code", "target_box", "width", "height"):
        assert row[name] == clean[name]
    if not ends(row["action"]):  # a wait, or a plan that does nothing on the screen
        return
    places = np.array(ends(row["action"]))
    (left, top), (right, bottom) = np.maximum(places.min(0) - 8, 0), places.max(0) + 8
    boxes = [(left, top, right, bottom), *([row["target_box"]] if row["target_box"] else [])]
    for x1, y1, x2, y2 in boxes:
        assert np.array_equal(pixels(row)[y1:y2, x1:x2], pixels(clean)[y1:y2, x1:x2])


def check_inserted(row: dict[str, Any], clean: dict[str, Any]) -> None:
    """The action is the one that was seen to undo what is shown, at its place in the picture."""
    assert (
        row["id"]
        == f"{clean['id'].removesuffix('clean')}{row['corruption']}+{EFFECTS[row['corruption']]}"
    )
    assert (row["width"], row["height"], row["reminder"]) == (clean["width"], clean["height"], None)
    paste = [op for op in hj.Plan.from_json(row["plan"]).ops if isinstance(op, Paste)][-1]
    asset = AssetPack.load().get(paste.sprite["id"])
    assert asset.recover is not None
    action, box = asset.recover.action, asset.recover.target_box
    assert (row["action"]["type"], row["action"]["keys"]) == (
        action.type,
        list(action.keys) if action.keys else None,
    )
    assert (row["target_box"] is None) == (box is None)
    if box is None:
        return
    if "crop" in paste.sprite:  # a desktop that was laid out: its panel's parts lie elsewhere
        x, y = row["target_box"][0] - box[0], row["target_box"][1] - box[1]
        is_whole = False
    else:
        (x, y), is_whole = paste.at[0], asset.size == asset.screen
    scale = row["width"] / asset.screen[1] if is_whole else 1
    expected = (np.array(box) + np.array([x, y, x, y])) * scale
    assert np.abs(np.array(row["target_box"]) - expected).max() <= 0.5
    assert action.x is not None
    assert abs(row["action"]["x"] - (action.x + x) * scale) <= 0.5
    if scale == 1:
        x1, y1, x2, y2 = box
        left, top, right, bottom = row["target_box"]
        assert np.array_equal(pixels(row)[top:bottom, left:right], asset.pixels()[y1:y2, x1:x2, :3])


def check_replaced(row: dict[str, Any], clean: dict[str, Any]) -> None:
    """There is nothing to click: wait, and say why."""
    assert (row["action"]["type"], row["action_code"], row["target_box"]) == ("wait", "WAIT", None)
    assert ends(row["action"]) == []
    assert "wait until" in row["reminder"]
    assert (row["width"], row["height"], row["step"]) == (
        clean["width"],
        clean["height"],
        clean["step"],
    )
    assert row["changed_pixels"] > 0.1 * row["width"] * row["height"]


def ends(action: dict[str, Any]) -> list[tuple[int, int]]:
    points = ((action["x"], action["y"]), (action["x2"], action["y2"]))
    return [(x, y) for x, y in points if x is not None and y is not None]


def pixels(row: dict[str, Any]) -> np.ndarray:
    return np.asarray(row["screenshot"])
