"""The asset pack: what is read of it, what is refused, and how plans draw from it."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hijack_data as hj
from hijack_data import pack as pack_module
from hijack_data.drawing import raster
from hijack_data.errors import AssetError, HijackError, PlanError
from hijack_data.pack import SHIPPED, AssetPack, RecordedAction, find_asset, picture_kinds
from hijack_data.types import Action

from support.assets import make_pack, pixels


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_pack(tmp_path / "pack")


@pytest.fixture(autouse=True)
def nothing_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each test begins as a new process does."""
    monkeypatch.setattr(pack_module, "_asset_cache", {})
    monkeypatch.delenv("AGENTHIJACK_ASSETS", raising=False)


def test_what_an_entry_says(folder: Path) -> None:
    pack = AssetPack.load(folder)
    assert (len(pack.assets), pack.licence, pack.desktop) == (
        10,
        "made up for tests",
        {"date": "2026-01-01"},
    )
    menu = pack.get("menu")
    assert (menu.kind, menu.app, menu.size, menu.screen, menu.box) == (
        "menu",
        "chromium",
        (40, 60),
        (200, 320),
        (30, 40, 90, 80),
    )
    assert [(t.name, t.role, t.box) for t in menu.targets] == [
        ("Open", "menu-item", (2, 2, 58, 18))
    ]
    assert menu.recover == RecordedAction(Action("hotkey", keys=("esc",)))
    assert menu.opened_by == RecordedAction(Action("click", 10, -6), (0, -22, 50, -2))
    assert pack.get("lock-small").recover is None
    assert menu.pixels().shape == (40, 60, 4)
    assert np.array_equal(pack.get("lock-small").pixels(), pixels(1, 320, 200))


def test_choosing_pictures(folder: Path) -> None:
    pack = AssetPack.load(str(folder))
    names = {kind: [asset.id for asset in pack.pictures(kind)] for kind in picture_kinds()}
    assert names["window"] == ["gimp-90x70", "thunar-120x150", "thunar-60x50"]
    assert [asset.id for asset in pack.pictures("window", app="gimp")] == ["gimp-90x70"]
    assert [asset.id for asset in pack.pictures("lock_screen", screen=(400, 640))] == ["lock-large"]
    assert pack.pictures("lock_screen", app="x") == []
    with pytest.raises(AssetError, match="holds no picture 'nothing'"):
        pack.get("nothing")


def test_a_deed_moves_with_its_picture() -> None:
    recorded = RecordedAction(
        Action("drag", 1, 2, 3, 4, keys=("shift",), amount=2), (0, 1, 2, 3)
    ).translate(10, 20)
    assert recorded == RecordedAction(
        Action("drag", 11, 22, 13, 24, keys=("shift",), amount=2), (10, 21, 12, 23)
    )
    assert RecordedAction(Action("hotkey", keys=("esc",))).translate(5, 5) == RecordedAction(
        Action("hotkey", keys=("esc",))
    )


def test_the_digest_names_what_is_in_it_and_not_where(folder: Path, tmp_path: Path) -> None:
    digest = AssetPack.load(folder).digest
    shutil.copytree(folder, tmp_path / "copy")
    assert AssetPack.load(tmp_path / "copy").digest == digest
    target = {"name": "x", "role": "y", "box": [0, 0, 1, 1]}
    for change in (
        {"sha256": "0" * 64},
        {"targets": [target]},
        {"recover": {"type": "wait"}},
        {"app": "x"},
    ):
        index = json.loads((folder / "index.json").read_text())
        index["pictures"][0].update(change)
        (tmp_path / "copy" / "index.json").write_text(json.dumps(index))
        assert AssetPack.load(tmp_path / "copy").digest != digest


def test_which_pack_is_the_default(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(pack_module, "SHIPPED", folder)
    assert AssetPack.load().folder == folder
    monkeypatch.setenv("AGENTHIJACK_ASSETS", str(tmp_path / "none"))
    with pytest.raises(
        AssetError, match=r"none: no asset pack there.*hijack desktop record.*AGENTHIJACK_ASSETS"
    ):
        AssetPack.load()
    assert AssetPack.load(folder).folder == folder


def plan_of(
    recipe: dict[str, Any], *at: tuple[int, int], size: tuple[int, int] = (100, 150)
) -> hj.Plan:
    return hj.Plan("test-v1", size, ops=(hj.plugin.Paste(recipe, at),))


def test_a_plan_pastes_the_recorded_pixels(folder: Path) -> None:
    pack = AssetPack.load(folder)
    picture = pixels(99, 150, 100)
    out = hj.apply(plan_of(pack.get("dialog").recipe(), (30, 20)), picture)
    assert np.array_equal(out[20:70, 30:130], pixels(21, 100, 50))
    assert np.array_equal(out[:20], picture[:20])
    part = hj.apply(plan_of(pack.get("dialog").recipe((5, 10, 25, 40)), (0, 0), (60, 60)), picture)
    for x, y in ((0, 0), (60, 60)):
        assert np.array_equal(part[y : y + 30, x : x + 20], pixels(21, 100, 50)[10:40, 5:25])
    shaped = hj.apply(plan_of(pack.get("menu").recipe(), (10, 10)), picture)
    expected = picture.copy()
    expected[10:50, 10:70] = pixels(20, 60, 40)
    expected[10, [10, 69]] = picture[10, [10, 69]]  # the corners are not part of it
    assert np.array_equal(shaped, expected)


def test_a_plan_is_replayed_from_its_json_in_a_new_process(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture = pixels(98, 150, 100)
    asset = AssetPack.load(folder).get("dialog")
    plan = plan_of(asset.recipe(), (3, 4))
    assert plan.ops[0].fingerprint == asset.sha256[:16]  # type: ignore[union-attr]
    expected, text = hj.apply(plan, picture), plan.to_json()
    assert json.loads(text)["ops"][0]["sprite"] == {
        "draw": "asset",
        "id": "dialog",
        "sha256": asset.sha256[:16],
    }
    pack_module._asset_cache.clear()
    monkeypatch.setenv("AGENTHIJACK_ASSETS", str(folder))
    monkeypatch.setattr("hijack_data.drawing.raster._cache", raster._Cache(2**20))
    assert np.array_equal(hj.apply(hj.Plan.from_json(text), picture), expected)


def test_plans_whose_pack_is_not_there(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asset = AssetPack.load(folder).get("gimp-90x70")
    pack_module._asset_cache.clear()
    monkeypatch.setattr("hijack_data.drawing.raster._cache", raster._Cache(2**20))
    monkeypatch.setattr(pack_module, "SHIPPED", tmp_path / "none")
    recipes = {"no asset pack there": asset.recipe()}
    with pytest.raises(PlanError, match="no asset pack there"):
        hj.apply(plan_of(recipes["no asset pack there"], (0, 0)), pixels(1, 150, 100))
    monkeypatch.setattr(pack_module, "SHIPPED", folder)
    for recipe, reason in (
        (
            {**asset.recipe(), "sha256": "0" * 16},
            "holds another picture of that name; set AGENTHIJACK_ASSETS",
        ),
        ({**asset.recipe(), "id": "other"}, "does not hold it; set AGENTHIJACK_ASSETS"),
        ({**asset.recipe(), "id": ["x"]}, "cannot be drawn"),
        ({"draw": "asset"}, "cannot be drawn"),
        (asset.recipe((0, 0, 91, 10)), "leaves gimp-90x70, 90x70"),
        (asset.recipe((5, 5, 5, 9)), "leaves"),
        ({**asset.recipe(), "crop": [0, 0, 1.5, 2]}, "cannot be drawn"),
    ):
        with pytest.raises(PlanError, match=reason):
            hj.apply(plan_of(recipe, (0, 0)), pixels(1, 150, 100))


def test_any_pack_that_was_loaded_is_looked_in(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(pack_module, "SHIPPED", tmp_path / "none")
    asset = AssetPack.load(folder).get("view")
    assert find_asset("view", asset.sha256[:16]) == asset


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda file: file.unlink(), "cannot be read"),
        (lambda file: file.write_bytes(file.read_bytes()[:60]), "cannot be read"),
        (lambda file: file.write_bytes(b"no picture"), "cannot be read"),
        (lambda file: shutil.copy(file.with_name("lock-large.webp"), file), "is not the picture"),
        (lambda file: shutil.copy(file.with_name("error.webp"), file), "is not the picture"),
    ],
)
def test_files_that_are_not_what_the_index_says(
    spoil: Callable[[Path], object], reason: str, folder: Path
) -> None:
    asset = AssetPack.load(folder).get("lock-small")
    spoil(asset.path)
    with pytest.raises(AssetError, match=rf"lock-small\.webp: {reason}"):
        asset.pixels()


def change(key: str, value: Any) -> Callable[[dict[str, Any]], object]:
    return lambda index: index["pictures"][0].update({key: value})


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda index: index.update(format="x"), "not the index of an asset pack"),
        (lambda index: index.update(version=2), "newer than this library reads"),
        (lambda index: index.update(version="1"), "is not a version"),
        (lambda index: index.pop("pictures"), "damaged.*pictures"),
        (lambda index: index.update(pictures=[3]), "damaged"),
        (
            lambda index: index["pictures"].append(index["pictures"][0]),
            "two pictures are named 'lock-small'",
        ),
        (change("file", "../other.webp"), "not a plain name"),
        (change("file", ".."), "not a plain name"),
        (change("kind", "windoww"), "not one of window, menu"),
        (change("screen", [1, 2, 3]), "must be 2 integers"),
        (change("screen", [1, True]), "must be 2 integers"),
        (change("box", [0, 0, 0, 5]), "is empty"),
        (change("box", [0, 0, 10**30, 5]), "must be 4 integers"),
        (change("sha256", "00"), "sha256 is not one"),
        (change("targets", [{"name": "x"}]), "damaged"),
        (change("recover", {"type": "jump"}), "type 'jump' is not known"),
        (change("recover", {"type": "click", "x": 1}), "damaged"),
        (change("recover", 3), "damaged"),
    ],
)
def test_indexes_that_are_refused(
    spoil: Callable[[dict[str, Any]], object], reason: str, folder: Path
) -> None:
    index = json.loads((folder / "index.json").read_text())
    spoil(index)
    (folder / "index.json").write_text(json.dumps(index))
    with pytest.raises(AssetError, match=rf"index\.json.*{reason}"):
        AssetPack.load(folder)


@pytest.mark.parametrize("text", ["{", "[]", "3", b"\xff\xfe\x00", "[" * 100_000])
def test_an_index_that_is_no_json_object(text: str | bytes, folder: Path) -> None:
    (folder / "index.json").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(HijackError, match="index"):
        AssetPack.load(folder)


def test_the_shipped_pack_is_whole() -> None:
    """Every picture is what the index says, and small enough to ship."""
    pack = AssetPack.load(SHIPPED)
    assert {asset.kind for asset in pack.assets} == set(picture_kinds())
    for asset in pack.assets:
        height, width = asset.pixels().shape[:2]
        boxes = [target.box for target in asset.targets]
        assert all(
            0 <= x1 <= x2 <= width and 0 <= y1 <= y2 <= height for x1, y1, x2, y2 in boxes
        ), asset.id
        if asset.kind in ("menu", "dialog", "desktop"):
            assert asset.recover is not None, asset.id
    assert sum(file.stat().st_size for file in SHIPPED.iterdir()) <= 15e6


def test_a_corruption_of_somebody_else_brings_its_kind_of_picture(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index = json.loads((folder / "index.json").read_text())
    index["pictures"][0]["kind"] = "volume_bar"
    (folder / "index.json").write_text(json.dumps(index))
    with pytest.raises(AssetError, match="'volume_bar' is not one of window"):
        AssetPack.load(folder)
    monkeypatch.setattr(hj.AppMinimization, "pictures", ("desktop", "volume_bar"))
    assert len(AssetPack.load(folder).pictures("volume_bar")) == 1
