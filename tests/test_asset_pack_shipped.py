"""The asset pack that ships: every picture is what the index says, nothing is left over, and it
stays small."""

import hashlib
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hijack_data.pack import SHIPPED, AssetPack, picture_kinds
from hijack_data.types import ACTION_TYPES

LIMIT = 15_000_000
INDEX = json.loads((SHIPPED / "index.json").read_text(encoding="utf-8"))
ENTRIES = {entry["id"]: entry for entry in INDEX["pictures"]}
WHOLE = ("lock_screen", "desktop")
SCREENS = {(1920, 1080), (1366, 768), (1280, 720), (2560, 1440)}


def decoded(entry):
    with Image.open(SHIPPED / entry["file"]) as image:
        assert image.format == "WEBP"
        return np.asarray(image)


def test_the_head_says_what_it_is_and_where_it_comes_from():
    assert (INDEX["format"], INDEX["version"]) == ("agenthijack-assets", 1)
    assert "Apache-2.0" in INDEX["licence"]
    assert {"chromium", "xfwm4", "mate-screensaver"} <= INDEX["desktop"]["packages"].keys()


def test_the_folder_holds_the_pack_and_nothing_else():
    files = {path.name for path in SHIPPED.iterdir()}
    assert files == {"index.json", *(entry["file"] for entry in INDEX["pictures"])}
    assert sum(path.stat().st_size for path in SHIPPED.iterdir()) <= LIMIT
    assert len(ENTRIES) == len(INDEX["pictures"])


def test_the_wheel_takes_all_of_the_package():
    build = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["tool"][
        "hatch"
    ]["build"]
    assert "hijack_data" in build["targets"]["wheel"]["packages"]
    assert not {"exclude", "only-include"} & build["targets"]["wheel"].keys()
    assert "/hijack_data" in build["targets"]["sdist"]["include"]


@pytest.mark.parametrize("entry", ENTRIES.values(), ids=list(ENTRIES))
def test_a_picture_is_what_the_index_says_and_shows_something(entry):
    x1, y1, x2, y2 = entry["box"]
    width, height = entry["screen"]
    assert 0 <= x1 < x2 <= width
    assert 0 <= y1 < y2 <= height
    pixels = decoded(entry)
    assert pixels.shape[:2] == (y2 - y1, x2 - x1)
    assert hashlib.sha256(pixels.tobytes()).hexdigest() == entry["sha256"]
    assert entry["kind"] in picture_kinds()
    assert entry["made_by"]
    assert "\n" not in entry["made_by"]
    stride = 3 if max(pixels.shape) < 3000 else 30  # wallpapers are large
    colours = pixels[::stride, ::stride, :3] @ np.array([65536, 256, 1], np.uint32)
    assert len(np.unique(colours)) >= 8
    is_opaque_but_for_its_corners(entry, pixels)


def is_opaque_but_for_its_corners(entry, pixels):
    # what is between its letters, and their soft shadow, is not part of it
    if entry["kind"] == "icon":
        assert {0, 255} < set(np.unique(pixels[..., 3]))
        assert not pixels[[0, -1], :, 3].any()
        assert not pixels[:, [0, -1], 3].any()
    elif pixels.shape[2] == 4:
        pixel = pixels[..., 3]
        assert set(np.unique(pixel)) == {0, 255}
        assert (pixel == 0).sum() < 400
        assert (pixel[12:-12] == 255).all()
        assert not pixels[pixel == 0].any()


@pytest.mark.parametrize("entry", ENTRIES.values(), ids=list(ENTRIES))
def test_places_are_inside_their_picture(entry):
    x1, y1, x2, y2 = entry["box"]
    width, height = x2 - x1, y2 - y1
    recover = entry["recover"] or {}
    boxes = [target["box"] for target in entry["targets"]] + [
        recover[k] for k in ("target_box",) if k in recover
    ]
    for left, top, right, bottom in boxes:
        assert 0 <= left < right <= width
        assert 0 <= top < bottom <= height
    if "x" in recover:
        left, top, right, bottom = recover["target_box"]
        assert left <= recover["x"] < right
        assert top <= recover["y"] < bottom
    for action in (recover, entry.get("opened_by") or {}):
        assert not action or action["type"] in ACTION_TYPES


@pytest.mark.parametrize("kind", picture_kinds())
def test_every_kind_is_there_with_what_it_must_have(kind):
    matches = [entry for entry in ENTRIES.values() if entry["kind"] == kind]
    assert matches
    if kind in (*WHOLE, "menu", "dialog"):
        assert all(entry["recover"] for entry in matches)
        assert any(entry["targets"] for entry in matches)
    if kind in WHOLE:
        assert {tuple(entry["screen"]) for entry in matches} == SCREENS
        assert all(entry["box"] == [0, 0, *entry["screen"]] for entry in matches)


def test_windows_come_from_several_applications_in_several_sizes():
    windows = [entry for entry in ENTRIES.values() if entry["kind"] == "window"]
    sizes = {app: set() for app in {entry["app"] for entry in windows}}
    for entry in windows:
        x1, y1, x2, y2 = entry["box"]
        sizes[entry["app"]].add((x2 - x1, y2 - y1))
    assert {"geany", "mousepad", "thunar", "xfce4-terminal", "chromium"} <= sizes.keys()
    assert all(len(sizes[app]) >= 3 for app in ("geany", "mousepad", "thunar", "chromium"))


def test_the_panels_buttons_of_a_desktop_are_targets_and_one_brings_a_window_back():
    for entry in (e for e in ENTRIES.values() if e["kind"] == "desktop"):
        assert entry["recover"]["target_box"] in [target["box"] for target in entry["targets"]]


def test_the_loader_takes_all_of_it():
    pack = AssetPack.load(SHIPPED)
    assert {asset.id for asset in pack.assets} == ENTRIES.keys()
    assert pack.pictures("lock_screen", screen=(720, 1280))[0].pixels().shape == (720, 1280, 3)
