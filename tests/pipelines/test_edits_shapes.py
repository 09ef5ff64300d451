"""The five edits with the pack that ships, on screens of many sizes: laid out without scaling, or
refused with a way out."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.pack import SHIPPED, AssetPack
from hijack_data.plan import Effect, Paste
from hijack_data.rng import Stream
from pipelines.edits import EDITS, NotApplicable, screen_layout
from pipelines.edits.browser_pages import error_page

from support.frames import drawn, frame_of

PACK = AssetPack.load(SHIPPED)
NOBODY = frozenset[str]()
# Width and height: 4:3, 5:4, 16:10, 3:2, 16:9, 21:9, 32:9, upright, HiDPI, and what recordings
# really have.
SIZES = (
    (320, 480),
    (640, 360),
    (640, 480),
    (768, 1024),
    (768, 1366),
    (800, 600),
    (800, 1280),
    (1024, 768),
    (1080, 1920),
    (1152, 864),
    (1212, 758),
    (1276, 718),
    (1280, 720),
    (1280, 800),
    (1280, 1024),
    (1366, 768),
    (1400, 1050),
    (1440, 900),
    (1440, 2560),
    (1468, 956),
    (1600, 1200),
    (1680, 1050),
    (1919, 1079),
    (1920, 1080),
    (2160, 1440),
    (2256, 1504),
    (2560, 1080),
    (2880, 1800),
    (3440, 1440),
    (3840, 1080),
    (3840, 2160),
)
PARAMS: dict[str, dict[str, Any]] = {
    "lock": {},
    "minimise": {},
    "firewall": {},
    "launch_app": {"app": "vscode"},
    "touch": {"boxes": [[40, 160, 100, 180]], "without_app": True},
}
APPS = {"touch": ("mousepad",)}  # whose dialogs were recorded


def sources(ops: tuple[Any, ...]) -> list[np.ndarray]:
    """The recorded pictures, or the parts of them, that the operations paste."""
    assert all(isinstance(op, Paste) for op in ops), "something was scaled"
    items = []
    for op in ops:
        crop = op.sprite.get("crop") or (0, 0, 1 << 16, 1 << 16)
        items.append(PACK.get(op.sprite["id"]).pixels()[crop[1] : crop[3], crop[0] : crop[2]])
    return items


@pytest.mark.parametrize("kind", list(EDITS))
def test_every_edit_is_made_at_any_size_or_says_why_not(kind: str) -> None:
    refused = dict[tuple[int, int], str]()
    for width, height in SIZES:
        frame = frame_of(
            SHIPPED,
            size=(height, width),
            boxes=[(40, 160, 100, 180)],
            action=hj.Action("wait"),
            apps=APPS.get(kind, ("chrome",)),
        )
        frame = replace(frame, guess=True)  # nothing here is known to open a recorded menu
        try:
            result = EDITS[kind].apply(frame, Effect(kind, PARAMS[kind]))
        except NotApplicable as reason:
            refused[width, height] = str(reason)
            continue
        picture = drawn(frame, result)
        assert picture.shape == (height, width, 3)
        assert picture.any()
        inside = [
            0 <= x1 < x2 <= width and 0 <= y1 < y2 <= height for x1, y1, x2, y2 in result.boxes
        ]
        assert all(inside), (width, height, result.boxes)
        if result.response is not None and result.response.target_box is not None:
            assert result.response.target_box in result.boxes
    assert refused.keys() <= {(320, 480), (640, 360), (640, 480)}, refused
    for (width, height), reason in refused.items():
        assert re.search(
            rf"--sizes {width}x{height}|no room|this screen can hold|known to open", reason
        )


@pytest.mark.parametrize("size", [(759, 1213), (768, 1024), (1920, 1080), (1440, 3440)])
def test_a_lock_screen_is_a_cut_wallpaper_and_a_centred_dialog(size: tuple[int, int]) -> None:
    result = screen_layout.lock_screen(PACK, size, Stream(1, "t", "t"), NOBODY)
    assert result is not None
    wallpaper, dialog = sources(result.ops)
    (height, width), (h, w) = size, dialog.shape[:2]
    x, y = result.ops[1].at[0]
    assert (x, y) == ((width - w) // 2, (height - h) // 2)
    expected = wallpaper.copy()
    expected[y : y + h, x : x + w] = dialog
    value = hj.apply(hj.Plan("t-v1", size, ops=result.ops), np.zeros((*size, 3), np.uint8))
    assert np.array_equal(value, expected)


@pytest.mark.parametrize("size", [(759, 1213), (768, 1024), (1920, 1080), (1440, 3440)])
def test_a_panel_spans_the_width_and_keeps_its_ends(size: tuple[int, int]) -> None:
    height, width = size
    for asset in PACK.pictures("desktop", screen=(1080, 1920))[:4]:
        bar = screen_layout.panel(asset, size)
        assert bar is not None
        result = hj.apply(hj.Plan("t-v1", size, ops=bar.ops), np.full((*size, 3), 7, np.uint8))
        recorded, strip = asset.pixels()[-37:], result[-37:]
        assert (result[:-37] == 7).all()
        assert np.array_equal(strip[:, :500], recorded[:, :500])
        assert np.array_equal(strip[:, -115:], recorded[:, -115:])
        alike = {column.tobytes() for column in recorded.transpose(1, 0, 2)}
        assert all(column.tobytes() in alike for column in strip.transpose(1, 0, 2))
        clock = max(target.box for target in asset.targets if target.box[1] > 1000)
        assert bar.box(clock) == (clock[0] + width - 1920, clock[1] + height - 1080, width, height)


def test_icons_are_unscaled_and_stand_where_the_desktop_puts_them() -> None:
    """The places that real desktops of these sizes gave them; see `index.json`."""
    for size in ((720, 1280), (768, 1366), (1080, 1920), (1440, 2560)):
        asset = PACK.pictures("desktop", screen=size)[0]
        recorded = {target.box for target in asset.targets if target.role == "icon"}
        result = screen_layout.desktop(PACK, size, Stream(1, "t", "t"), NOBODY)
        assert result is not None
        assert recorded <= set(result.boxes)


def test_what_brings_a_window_back_moves_with_the_panel() -> None:
    result = screen_layout.desktop(PACK, (758, 1212), Stream(3, "t", "t"), NOBODY)
    assert result is not None
    assert result.asset.recover is not None
    recorded, mapped_action = result.asset.recover, result.mapped(result.asset.recover)
    assert mapped_action.target_box in result.boxes
    assert (mapped_action.action.x, mapped_action.action.y) == (
        recorded.action.x,
        recorded.action.y - 1080 + 758,
    )


@pytest.mark.parametrize("size", [(759, 1213), (1024, 768), (1440, 3440)])
def test_a_browser_keeps_its_buttons_at_the_edge_and_its_page_in_the_middle(
    size: tuple[int, int],
) -> None:
    width = size[1]
    names = set()
    for seed in range(6):
        result = error_page(PACK, size, Stream(seed, "t", "t"), NOBODY)
        assert result is not None
        page, page_height = result.asset, result.asset.size[1]
        names.add(page.look)
        value = hj.apply(hj.Plan("t-v1", size, ops=result.ops), np.full((*size, 3), 7, np.uint8))
        recorded = page.pixels()
        assert np.array_equal(value[:100, :270], recorded[:100, :270])
        assert np.array_equal(value[:100, -100:], recorded[:100, -100:])
        reload = next(target.box for target in page.targets if target.name == "Reload")
        assert reload in result.boxes
        address = next(target.box for target in page.targets if target.name.startswith("Address"))
        assert (
            address[0],
            address[1],
            address[2] + width - page_height,
            address[3],
        ) in result.boxes
        body = recorded[130:600, (page_height - 560) // 2 : (page_height + 560) // 2]
        left = (
            (width - page_height) // 2 + (page_height - 560) // 2
            if width < page_height
            else (width - 560) // 2
        )
        assert any(
            np.array_equal(value[130:600, x : x + 560], body) for x in (left - 1, left, left + 1)
        )
    assert names == {"golden", "dark"}
