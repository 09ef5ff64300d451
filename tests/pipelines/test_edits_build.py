"""Datasets with what happens to the machine: which rows there are, and what each of them
teaches."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data.pack import AssetPack
from pipelines import build, open_dataset
from pipelines.errors import BuildError

from support.events import COMBINED, FIVE, with_apps

WAIT = {
    "type": "wait",
    "x": None,
    "y": None,
    "x2": None,
    "y2": None,
    "text": None,
    "keys": None,
    "amount": None,
}


def rows_by_label(folder: Path) -> dict[str, list[dict[str, Any]]]:
    entries: dict[str, list[dict[str, Any]]] = {}
    for row in open_dataset(folder):
        entries.setdefault(row["corruption"], []).append(row)
    return entries


def test_all_nine(browsing: Path, nine: Any, assets: Path, tmp_path: Path) -> None:
    report = build(browsing, tmp_path / "out", corruptions=nine, seed=3, assets=assets)
    assert report.exit_code == 0
    assert dict(report.not_applicable) == {}
    visual = dict.fromkeys(("clean", "pop_ups", "resolution", "marks", "subtitle"), 10)
    assert dict(report.rows) == {**visual, **dict.fromkeys(FIVE, 2)}
    result = rows_by_label(tmp_path / "out")
    assert [row["id"] for label in FIVE for row in result[label][:1]] == [
        "t0/0000/multi_apps",
        "t0/0003/accidental_touch+touch",
        "t0/0003/app_minimization+minimise",
        "t0/0000/network_error",
        "t0/0000/verification",
    ]
    assert {
        (label, row["fidelity"], row["inserted"], row["reminder"] is not None)
        for label in FIVE
        for row in result[label]
    } == {
        ("multi_apps", "composited", False, False),
        ("accidental_touch", "composited", True, False),
        ("app_minimization", "recorded", True, False),
        ("network_error", "recorded", False, True),
        ("verification", "recorded", False, True),
    }
    for label, rows in result.items():
        for row in rows:
            assert (row["event"] is None) == (label not in FIVE)
            assert row["fidelity"] == "exact" or label in FIVE
            assert row["changed_pixels"] > 0 or label == "clean"
            assert hashlib.sha256(row["screenshot"].tobytes()).hexdigest() == row["image_sha256"]
    ids = [row["id"] for rows in result.values() for row in rows]
    assert len(set(ids)) == len(ids)


@pytest.mark.parametrize(
    ("actions", "rows"),
    [
        ([{"type": "mouse_down", "x": 100, "y": 50}, {"type": "move", "x": 110, "y": 50}], 0),
        ([{"type": "key_down", "keys": ["shift"]}, {"type": "wait"}], 0),
        ([{"type": "key_down", "keys": ["shift"]}, {"type": "key_up", "keys": ["shift"]}], 2),
    ],
)
def test_nothing_is_undone_while_a_button_or_a_key_is_held(
    actions: list[dict[str, Any]], rows: int, recording: Any, assets: Path, tmp_path: Path
) -> None:
    def action(row: dict[str, Any]) -> dict[str, Any]:
        return dict(enumerate(actions)).get(row["step"], row["action"])

    def code(row: dict[str, Any]) -> str:
        return "" if row["step"] < 2 else row["action_code"]

    source = with_apps(
        recording(trajectories=1, steps=4), ["chrome"], action=action, action_code=code
    )
    labels = "accidental_touch:step=2,app_minimization:step=2"
    report = build(source, tmp_path / "out", corruptions=labels, assets=assets)
    made = report.rows["accidental_touch"] + report.rows["app_minimization"]
    assert (made, "holds a button or a key" in str(report.not_applicable)) == (rows, not rows)


def test_what_each_row_teaches(browsing: Path, assets: Path, tmp_path: Path) -> None:
    build(browsing, tmp_path / "out", corruptions=",".join(FIVE), assets=assets)
    entries = {label: rows[0] for label, rows in rows_by_label(tmp_path / "out").items()}
    pack = AssetPack.load(assets)
    for label, name in (
        ("network_error", "error"),
        ("verification", "lock-small"),
        ("app_minimization", "desktop"),
    ):
        assert np.array_equal(np.asarray(entries[label]["screenshot"]), pack.get(name).pixels())
    for label in ("network_error", "verification"):
        row = entries[label]
        assert (row["action"], row["action_code"], row["target_box"], row["target_visible"]) == (
            WAIT,
            "WAIT",
            None,
            None,
        )
    back = entries["app_minimization"]
    assert (back["step"], back["action"]["type"], back["action"]["x"], back["action"]["y"]) == (
        3,
        "click",
        50,
        190,
    )
    assert (back["action_code"], back["target_box"]) == (
        "pyautogui.click(50, 190)",
        [20, 180, 80, 200],
    )
    assert back["target_visible"] == 1.0
    beside, clean = entries["multi_apps"], entries["clean"]
    for name in ("action", "action_code", "target_box", "target_visible", "step"):
        assert beside[name] == clean[name]
    assert beside["target_visible"] == 1.0
    changed_rows = (
        (np.asarray(beside["screenshot"]) != np.asarray(clean["screenshot"])).any(axis=2).sum()
    )
    assert beside["changed_pixels"] == changed_rows <= 120 * 150


def test_the_button_of_a_dialog_is_visible_although_it_was_pasted(
    browsing: Path, tmp_path: Path, assets: Path
) -> None:
    """`keep`, `avoid` and `drop` agree: what an event shows does not hide its own target."""
    entries = {}
    for policy in ("keep", "avoid", "drop", "recover"):
        report = build(
            browsing,
            tmp_path / policy,
            corruptions="accidental_touch,verification",
            assets=assets,
            label_policy=policy,
            seed=1,
        )
        assert dict(report.dropped) == {}
        rows = rows_by_label(tmp_path / policy)["accidental_touch"]
        entries[policy] = [
            (row["action_code"], row["target_box"], row["target_visible"]) for row in rows
        ]
    assert entries["keep"] == entries["avoid"] == entries["drop"] == entries["recover"]
    dialogs = [entry for entry in entries["keep"] if entry[1]]
    assert all(entry[2] == 1.0 for entry in dialogs)


def test_effects_together_with_pictures(browsing: Path, assets: Path, tmp_path: Path) -> None:
    report = build(browsing, tmp_path / "out", corruptions=COMBINED, assets=assets)
    result = rows_by_label(tmp_path / "out")
    names = {
        label: [row["id"].partition("/")[2] for row in rows if row["trajectory_id"] == "t0"]
        for label, rows in result.items()
    }
    assert names["locked"] == [f"000{k}/locked" for k in range(5)]
    assert names["half"] == [
        "0000/half",
        "0001/half+minimise",
        "0001/half",
        "0002/half",
        "0003/half",
        "0004/half",
    ]
    assert names["dots"] == [
        "0000/dots",
        "0001/dots+touch",
        "0001/dots",
        "0002/dots+touch",
        "0002/dots",
        "0003/dots",
        "0004/dots",
    ]
    assert names["both"] == ["0002/both+touch", "0002/both+minimise", "0002/both"]
    assert names["late"] == ["0002/late"]
    assert "clash" not in names
    assert list(report.not_applicable["clash"]) == [
        "two effects change this screen, and what both leave was never recorded"
    ]
    assert {row["fidelity"] for row in result["mix"]} == {"exact", "recorded"}
    locked = result["locked"]
    # a subtitle lies over it
    assert [row["fidelity"] for row in locked[:2]] == ["composited", "exact"]
    assert locked[0]["action_code"] == "WAIT"
    assert locked[1]["action_code"] == "pyautogui.click(101, 50)"
    # The subtitle is drawn over the lock screen, as it would be on a live one.
    plan = hj.Plan.from_json(locked[0]["plan"])
    assert [type(op).__name__ for op in plan.ops] == ["Paste", "Paste"]
    assert plan.ops[0].sprite["draw"] == "asset"  # type: ignore[union-attr]
    words = hj.Plan("x-v1", (200, 320), ops=plan.ops[1:])
    assert np.array_equal(
        np.asarray(locked[0]["screenshot"]),
        hj.apply(words, AssetPack.load(assets).get("lock-small").pixels()),
    )


def test_the_same_effect_twice_at_one_step_is_refused(
    browsing: Path, assets: Path, tmp_path: Path
) -> None:
    """Its two inserted rows had one id, so that `hijack verify` refused the dataset."""
    twice = {"twice": hj.Sequence([hj.AppMinimization(step=1)] * 2)}
    with pytest.raises(BuildError, match=r"twice: .* plans 'minimise' twice at one step"):
        build(browsing, tmp_path / "out", corruptions=twice, assets=assets)


def test_what_is_done_follows_the_resolution(browsing: Path, assets: Path, tmp_path: Path) -> None:
    build(browsing, tmp_path / "out", corruptions={"half": COMBINED["half"]}, assets=assets)
    row = next(row for row in open_dataset(tmp_path / "out") if row["inserted"])
    assert (row["width"], row["height"], row["target_box"]) == (160, 100, [10, 90, 40, 100])
    assert (row["action"]["x"], row["action"]["y"], row["action_code"]) == (
        25,
        95,
        "pyautogui.click(25, 95)",
    )
    assert row["target_visible"] == 1.0


def test_pictures_over_an_event_avoid_its_target(
    browsing: Path, assets: Path, tmp_path: Path
) -> None:
    planner = hj.Sequence([hj.AppMinimization(step=1), hj.Marks(number=40, mark_size=12)])
    entries = {}
    for policy in ("keep", "avoid", "drop", "recover"):
        report = build(
            browsing,
            tmp_path / policy,
            corruptions={"dots": planner},
            assets=assets,
            label_policy=policy,
            clean=False,
            seed=5,
        )
        rows = [row for row in open_dataset(tmp_path / policy) if row["inserted"]]
        entries[policy] = [row["target_visible"] for row in rows]
        assert len(rows) + (report.dropped.get("dots", 0) > 0) >= 1
    assert min(entries["keep"]) < 1
    assert set(entries["avoid"]) | set(entries["recover"]) <= {1.0}
    assert entries["avoid"] == entries["recover"]
    assert all(share >= 0.5 for share in entries["drop"])


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        (0, [1]),
        (2, [4]),
        ((0, 4), [1, 8]),
        (hj.plugin.Every(2), [4, 8]),
        (-1, [1]),
        ((-1, 1), [1, 2]),
    ],
)
def test_steps_are_counted_from_0_whatever_their_numbers(
    step: Any, expected: list[int], recording: Any, assets: Path, tmp_path: Path
) -> None:
    """The recording leaves step 3 out and begins at 1; the third step that was read is step 2."""
    numbers = [1, 2, 4, 7, 8]
    folder = with_apps(
        recording(trajectories=1, steps=5), ["chrome"], step=lambda row: numbers[row["step"]]
    )
    kind = hj.Verification if not isinstance(step, hj.plugin.Every) else hj.AppMinimization
    build(folder, tmp_path / "out", corruptions={"x": kind(step=step)}, assets=assets)
    assert [row["step"] for row in rows_by_label(tmp_path / "out")["x"]] == expected


def test_recordings_that_end_too_soon_are_counted(
    recording: Any, assets: Path, tmp_path: Path
) -> None:
    report = build(
        recording(trajectories=2, steps=3),
        tmp_path / "out",
        assets=assets,
        corruptions="accidental_touch,app_minimization,verification",
    )
    assert dict(report.rows) == {
        "clean": 6,
        "accidental_touch": 0,
        "app_minimization": 0,
        "verification": 2,
    }
    ended = {"the recording ends before the step at which it acts": 2}
    assert report.not_applicable == {"accidental_touch": ended, "app_minimization": ended}


def test_where_an_event_would_not_be_true_there_is_no_row(
    recording: Any, add_line: Any, good_line: Any, assets: Path, tmp_path: Path
) -> None:
    folder = recording(trajectories=1, steps=1)
    Image.new("RGB", (300, 150), "white").save(folder / "images" / "other.png")
    add_line(folder, good_line("t1", 0, image="images/other.png", elements=None))
    report = build(folder, tmp_path / "out", assets=assets, corruptions=",".join(FIVE))
    reasons = {label: set(value) for label, value in report.not_applicable.items()}
    assert {"the recording ends before the step at which it acts"} == reasons["app_minimization"]
    assert reasons["network_error"] == {
        "the recording names no browser among its applications: a missing network would not show; "
        "name the applications that show with --apps, or by trajectory in agenthijack.yaml"
    }
    assert reasons["verification"] == {
        "no lock screen was recorded on a screen of this size, and what was recorded cannot be laid"
        " out on it; `hijack desktop record --assets DIR --only lock_screen --sizes NxN`"
        " records one"
    }
    assert report.rows["verification"] == 1


def test_elements_are_looked_for_where_none_are_recorded(
    recording: Any, assets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = with_apps(
        recording(trajectories=1, steps=4),
        ["chrome"],
        elements=lambda row: None,
        action=lambda row: {"type": "type", "text": "x"},
        action_code=lambda row: "",
    )
    looked: list[Any] = []

    def found(image: np.ndarray, **known: Any) -> hj.Scene:
        looked.append(image)
        return hj.Scene(image.shape[:2], [(200, 100, 250, 120)], **known)  # type: ignore[arg-type]

    monkeypatch.setattr("pipelines.building.step_rows.scene_from", found)
    report = build(folder, tmp_path / "out", assets=assets, corruptions="accidental_touch")
    assert report.rows["accidental_touch"] == 1
    (row,) = rows_by_label(tmp_path / "out")["accidental_touch"]
    assert json.loads(row["plan"])["notes"] == ["the element at [200, 100, 250, 120] was clicked"]
    assert len(looked) == 1  # only where it acts
