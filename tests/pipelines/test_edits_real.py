"""All nine on real recordings, with the pack that ships."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.pack import AssetPack
from pipelines import build, open_dataset, verify

RECORDINGS = Path(__file__).resolve().parents[2] / "examples" / "recordings"
FIVE = "multi_apps,accidental_touch,app_minimization,network_error,verification"
# At the fourth step, where it acts by default, two of our recordings show an open menu.
OURS = {
    **{name: hj.make_corruption(name) for name in FIVE.split(",")},
    "accidental_touch": hj.AccidentalTouch(step=2),
}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Our own recordings under the five, both kinds."""
    folder = tmp_path_factory.mktemp("real")
    for output in ("lazy", "materialised"):
        report = build(RECORDINGS, folder / output, corruptions=OURS, seed=2, output=output)
    assert dict(report.rows) == {
        "clean": 23,
        "multi_apps": 3,
        "accidental_touch": 2,
        "app_minimization": 2,
        "network_error": 0,
        "verification": 3,
    }
    return folder


def test_our_recordings(dataset: Path) -> None:
    pictures = 0
    for first_row, right in zip(
        open_dataset(dataset / "materialised"), open_dataset(dataset / "lazy"), strict=True
    ):
        if first_row["corruption"] != "clean":
            assert np.array_equal(
                np.asarray(first_row["screenshot"]), np.asarray(right["screenshot"])
            )
            pictures += 1
        del first_row["screenshot"], right["screenshot"]
        assert first_row == right
    assert pictures == 10
    for output in ("materialised", "lazy"):
        report = verify(dataset / output)
        assert (report.problems, report.notes, report.regenerated) == ([], [], 10)


def test_what_is_recorded_is_a_picture_of_the_pack(dataset: Path) -> None:
    entries = {asset.id: asset for asset in AssetPack.load().assets}
    rows = [row for row in open_dataset(dataset / "materialised") if row["fidelity"] == "recorded"]
    assert {row["corruption"] for row in rows} == {"app_minimization", "verification"}
    for row in rows:
        (op,) = json.loads(row["plan"])["ops"]
        asset = entries[op["sprite"]["id"]]
        assert np.array_equal(np.asarray(row["screenshot"]), asset.pixels())
        if row["inserted"]:
            assert asset.recover is not None
            assert (row["action"]["x"], row["action"]["y"]) == asset.recover.action.point
            assert tuple(row["target_box"]) == asset.recover.target_box


def test_targets_show_and_windows_keep_clear_of_them(dataset: Path) -> None:
    for row in open_dataset(dataset / "materialised"):
        if row["event"]:
            assert row["target_visible"] in (None, 1.0)
        if row["corruption"] == "multi_apps":
            (op,) = hj.Plan.from_json(row["plan"]).ops
            asset = AssetPack.load().get(op.sprite["id"])  # type: ignore[union-attr]
            (x, y), (h, w) = op.at[0], asset.size  # type: ignore[union-attr]
            assert 0 <= x <= 1920 - w
            assert 32 <= y <= 1026 - h
            assert asset.app not in row["domain"]


def test_where_a_menu_is_open_no_other_opens(tmp_path: Path) -> None:
    """At the fourth step of two recordings the agent has a menu open; the calculator's were not
    recorded."""
    report = build(
        RECORDINGS, tmp_path / "out", corruptions="accidental_touch,app_minimization", output="lazy"
    )
    assert report.not_applicable == {
        "accidental_touch": {
            "a menu is open on this screen already, which a click would close": 2,
            "no element of this screen is known to open a menu or dialog that was recorded of galculator": (
                1
            ),
        },
        "app_minimization": {
            "no desktop was recorded with a minimised window of what the recording uses (galculator)": (
                1
            )
        },
    }


@pytest.mark.parametrize(
    ("source", "rows", "reasons"),
    [
        (
            "webvoyager",
            {"network_error": 2},
            {"multi_apps": "a web page, not the screen", "verification": "a web page"},
        ),
        (
            "agentnet_raw",
            {},
            {"network_error": "names no browser", "verification": "does not say which desktop"},
        ),
        (
            "agentnetbench",
            {},
            {"network_error": "shows macos", "multi_apps": "does not say which desktop"},
        ),
        ("screenagent", {}, {"network_error": "names no browser", "multi_apps": "shows linux"}),
    ],
)
def test_real_recordings(
    source: str, rows: dict[str, int], reasons: dict[str, str], shared_data: Path, tmp_path: Path
) -> None:
    """What each kind of recording gives, and why it does not give the rest."""
    pytest.importorskip("cv2")
    report = build(
        shared_data / "trajectories" / source,
        tmp_path / "out",
        corruptions=FIVE,
        clean=False,
        output="lazy",
    )
    assert report.rejected == 0
    assert {label: count for label, count in report.rows.items() if count} == rows
    for label, reason in reasons.items():
        assert reason in "; ".join(report.not_applicable[label]), label
    items = list(open_dataset(tmp_path / "out"))
    assert len(items) == report.total
    assert all(row["target_visible"] in (None, 1.0) for row in items)
    assert verify(tmp_path / "out").regenerated == len(items)


def test_real_recordings_of_a_foreign_desktop(shared_data: Path, tmp_path: Path) -> None:
    """Asked for, and with the application named, they are made, and each says what it is."""
    pytest.importorskip("cv2")
    source, out = shared_data / "trajectories" / "agentnet_raw", tmp_path / "out"
    build(
        source,
        out,
        corruptions=FIVE,
        clean=False,
        output="lazy",
        allow_platform_mismatch=True,
        apps="chrome",
    )
    entries = {row["corruption"]: row["fidelity"] for row in open_dataset(out)}
    assert set(entries.values()) == {"foreign"}
    assert entries.keys() == set(FIVE.split(",")) - {
        "accidental_touch"
    }  # no menu of a browser there


def test_osworld_in_a_browser(tmp_path: Path) -> None:
    """A result folder whose task is Chrome's, with one of our own screens: the first of them has no
    page any more."""
    from support.formats import osworld, write_json

    folder = osworld(tmp_path / "results")
    screen = next((RECORDINGS / "images").glob("*.png")).read_bytes()
    for picture in folder.rglob("*.png"):
        picture.write_bytes(screen)
    about: dict[str, Any] = {"id": "x", "instruction": "find it", "related_apps": ["chrome"]}
    (task,) = (folder / "examples" / "gimp").iterdir()
    write_json(task, about)
    report = build(
        folder,
        tmp_path / "out",
        corruptions="network_error",
        clean=False,
        allow_platform_mismatch=True,
    )
    assert dict(report.rows) == {"network_error": 1}
    (row,) = open_dataset(tmp_path / "out")
    assert (row["fidelity"], row["action_code"], row["step"]) == ("foreign", "WAIT", 1)
    ids = {op["sprite"]["id"] for op in json.loads(row["plan"])["ops"]}
    pack = AssetPack.load()
    (window,) = (pack.get(name) for name in ids if name.startswith("error_page"))
    (below,) = (pack.get(name) for name in ids if name.startswith("panel"))
    x1, y1, x2, y2 = window.box
    picture = np.array(row["screenshot"])
    assert np.array_equal(picture[y1:y2, x1:x2], window.pixels()[..., :3])
    differs = (picture[y2:] != below.pixels()).any(axis=2)
    assert differs.sum() < 12  # the tip of the pointer is left out
