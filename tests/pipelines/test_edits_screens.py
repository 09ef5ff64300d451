"""Edits that fill the whole screen: lock screens, bare desktops, error pages."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.pack import AssetPack
from hijack_data.plan import Effect
from hijack_data.types import Action
from pipelines.edits import EDITS, NotApplicable

from support.assets import BACKGROUND, PackMaker, page, pixels
from support.frames import drawn, frame_of

SPARE = {"lock": "lock_screen", "minimise": "desktop", "firewall": "error_page"}


def edit(kind: str, pack: Path, **frame: Any) -> Any:
    result = frame_of(pack, **frame)
    value = EDITS[kind].apply(result, Effect(kind))
    return value, drawn(result, value)


def test_a_lock_screen_of_the_same_size_is_as_it_was_recorded(assets: Path) -> None:
    value, picture = edit("lock", assets)
    assert np.array_equal(picture, pixels(1, 320, 200))
    assert (value.fidelity, value.inserted, value.notes) == ("recorded", False, ())
    assert (value.response.action, value.response.target_box) == (Action("wait"), None)
    assert "locked" in value.event
    assert "wait" in value.reminder


@pytest.mark.parametrize("size", [(399, 639), (396, 638), (202, 322)])
def test_a_screen_of_nearly_the_same_shape_is_scaled_down(
    size: tuple[int, int], assets: Path
) -> None:
    value, picture = edit("lock", assets, size=size)
    scaled = hj.Plan("x-v1", (400, 640), ops=(hj.plugin.Resample(size),))
    assert np.array_equal(picture, hj.apply(scaled, pixels(2, 640, 400)))
    assert value.fidelity == "composited"
    assert value.notes == (f"lock-large was scaled from 640x400 to {size[1]}x{size[0]}",)


@pytest.mark.parametrize("size", [(401, 640), (400, 641), (190, 320), (200, 260), (1080, 1920)])
@pytest.mark.parametrize("kind", list(SPARE))
def test_nothing_is_scaled_up_or_out_of_shape(
    size: tuple[int, int], kind: str, assets: Path
) -> None:
    with pytest.raises(NotApplicable, match="was recorded on a screen of this size"):
        edit(kind, assets, size=size, apps=("chrome",))


def test_the_bare_desktop_is_left_by_a_click_on_the_panel(assets: Path) -> None:
    value, picture = edit("minimise", assets, apps=("chrome",))
    assert np.array_equal(picture, pixels(4, 320, 200))
    assert (value.fidelity, value.inserted, value.reminder) == ("recorded", True, None)
    assert (value.response.action, value.response.target_box) == (
        Action("click", 50, 190),
        (20, 180, 80, 200),
    )
    assert value.boxes == ((20, 180, 80, 200),)


def test_what_is_clicked_is_scaled_with_the_screen(assets: Path) -> None:
    value, _ = edit("minimise", assets, size=(100, 160), apps=("chrome",))
    assert value.fidelity == "composited"
    assert (value.response.action, value.response.target_box) == (
        Action("click", 25, 95),
        (10, 90, 40, 100),
    )
    assert value.boxes == ((10, 90, 40, 100),)


@pytest.fixture
def several(tmp_path: Path) -> Path:
    """A pack with desktops of two applications, and an error page that leaves a panel free."""
    pack_maker = PackMaker(tmp_path / "several")
    for number, app in enumerate(("thunar", "gimp", "chromium")):
        pack_maker.add(
            f"desktop-{app}",
            "desktop",
            pixels(30 + number, 320, 200),
            app=app,
            recover={"type": "click", "x": number, "y": 190},
        )
    pack_maker.add(
        "window",
        "error_page",
        pixels(40, 320, 180),
        app="chromium",
        screen=[320, 200],
        box=[0, 0, 320, 180],
        targets=[{"name": "Reload", "role": "button", "box": [10, 20, 30, 40]}],
    )
    pack_maker.add(
        "half",
        "error_page",
        pixels(41, 160, 180),
        app="chromium",
        screen=[320, 200],
        box=[160, 0, 320, 180],
    )
    return pack_maker.write()


@pytest.mark.parametrize(("apps", "domain"), [(("GIMP", "vlc"), ""), ((), "gimp")])
def test_only_windows_of_the_recording_are_brought_back(
    apps: tuple[str, ...], domain: str, several: Path
) -> None:
    """Which other one to bring back, nobody could learn from a screen that does not show it."""
    settings = {
        edit("minimise", several, apps=apps, domain=domain, seed=k)[0].response.action.x
        for k in range(8)
    }
    assert settings == {1}
    two = {
        edit("minimise", several, apps=("gimp", "Chromium"), seed=k)[0].response.action.x
        for k in range(30)
    }
    assert two == {1, 2}
    with pytest.raises(
        NotApplicable, match=r"a minimised window of what the recording uses \(vlc\)"
    ):
        edit("minimise", several, apps=("vlc",))
    with pytest.raises(
        NotApplicable, match=r"does not say whose window would be minimised; name .* --apps"
    ):
        edit("minimise", several, apps=())


def test_where_no_window_is_open_none_is_minimised(assets: Path) -> None:
    panel = [(0, 190, 20, 200), (30, 190, 60, 200)]
    with pytest.raises(NotApplicable, match="no window is open on this screen"):
        edit("minimise", assets, apps=("chrome",), boxes=panel)
    assert edit("minimise", assets, apps=("chrome",), boxes=[*panel, (50, 50, 90, 70)])[0].ops


def test_on_a_foreign_desktop_the_application_must_be_known_all_the_same(several: Path) -> None:
    """`allow_platform_mismatch` changes the desktop, not the rule about the application."""
    about: dict[str, Any] = {"platform": "windows", "allow_platform_mismatch": True}
    assert edit("minimise", several, apps=("Chromium",), **about)[0].response.action.type == "click"
    for apps, reason in (
        (("thunderbird",), r"what the recording uses \(thunderbird\)"),
        (("firefox",), r"what the recording uses \(firefox\)"),
        (("browser",), "browser may be any such program: name it in agenthijack.yaml"),
        ((), "does not say whose window would be minimised"),
    ):
        with pytest.raises(NotApplicable, match=reason):
            edit("minimise", several, apps=apps, **about)
    with pytest.raises(NotApplicable, match="is Chromium's, and the recording shows firefox"):
        edit("firewall", several, apps=("firefox",), **about)


def test_a_desktop_that_nothing_undoes_is_no_step(tmp_path: Path) -> None:
    pack_maker = PackMaker(tmp_path / "pack")
    pack_maker.add("bare", "desktop", pixels(1, 320, 200), app="editor")
    with pytest.raises(NotApplicable, match="nothing was recorded that undoes bare"):
        edit("minimise", pack_maker.write())


def test_an_error_page_stands_on_the_desktop_that_showed_it(several: Path) -> None:
    value, picture = edit("firewall", several, apps=("chrome",))
    assert np.array_equal(picture[:180], pixels(40, 320, 180))
    assert np.array_equal(picture[180:], pixels(32, 320, 200)[180:])
    assert (value.fidelity, value.notes) == ("composited", ("window stands on desktop-chromium",))
    assert value.response.action == Action("wait")
    assert "network" in value.reminder


def test_an_error_page_needs_a_browser(assets: Path) -> None:
    for about in (
        {"apps": ("Google Chrome",)},
        {"domain": "chrome"},
        {"apps": ("vlc", "browser")},
        {"domain": "web"},
    ):
        value, picture = edit("firewall", assets, **about)  # type: ignore[arg-type]
        assert np.array_equal(picture, pixels(3, 320, 200))
        assert (value.fidelity, value.boxes) == ("recorded", ((200, 100, 240, 120),))
    for about in ({}, {"apps": ("gimp",)}, {"domain": "Daily"}, {"apps": ("chrome_remote",)}):
        with pytest.raises(NotApplicable, match="names no browser"):
            edit("firewall", assets, **about)  # type: ignore[arg-type]
    with pytest.raises(NotApplicable, match="is Chromium's, and the recording shows firefox"):
        edit("firewall", assets, apps=("Mozilla Firefox",))
    with pytest.raises(
        NotApplicable, match=r"names no browser.*; name .* --apps.*agenthijack\.yaml"
    ):
        edit("firewall", assets, apps=())


@pytest.mark.parametrize("title", ["news.test", "Search"])
def test_the_panel_lists_no_window_but_the_one_with_the_error_page(
    title: str, tmp_path: Path
) -> None:
    """A button of another title is covered by the panel's own free part, to its right."""
    pack_maker = PackMaker(tmp_path / "pack")
    panel = pixels(30, 320, 200)
    buttons = [
        {"name": "Search - Chromium", "role": "toggle-button", "box": [100, 180, 190, 200]},
        {"name": "12:00", "role": "toggle-button", "box": [240, 180, 320, 200]},
    ]
    pack_maker.add("desktop", "desktop", panel, app="chromium", targets=buttons)
    pack_maker.add(
        "window",
        "error_page",
        pixels(40, 320, 180),
        app="chromium",
        screen=[320, 200],
        box=[0, 0, 320, 180],
        targets=[{"name": f"{title} - Network error", "role": "page-tab", "box": [0, 0, 9, 9]}],
    )
    _, picture = edit("firewall", pack_maker.write(), apps=("chrome",))
    if title == "news.test":  # 50 free pixels cover 90
        panel[180:, 100:150] = panel[180:, 190:240]
        panel[180:, 150:190] = panel[180:, 190:230]
    assert np.array_equal(picture[180:], panel[180:])
    assert np.array_equal(picture[:180], pixels(40, 320, 180))


@pytest.mark.parametrize("kind", ["lock", "minimise", "touch", "launch_app"])
def test_pictures_of_a_page_show_nothing_of_the_screen(kind: str, assets: Path) -> None:
    frame = frame_of(assets, screen="web page", boxes=[(10, 10, 20, 20)])
    with pytest.raises(NotApplicable, match="a web page, not the screen"):
        EDITS[kind].apply(frame, Effect(kind, {"boxes": [[10, 10, 20, 20]], "app": "gimp"}))


@pytest.mark.parametrize(
    "size", [(260, 400), (200, 320), (260, 70), (60, 400), (330, 400), (400, 520), (300, 320)]
)
def test_a_page_is_cut_or_continued_by_its_own_background(
    size: tuple[int, int], assets: Path
) -> None:
    """A page of that size with the same content in its middle is what comes out, pixel by pixel."""
    value, picture = edit("firewall", assets, size=size, screen="web page")
    assert np.array_equal(picture, page(size[1], size[0]))
    assert (value.fidelity, value.response.action) == ("composited", Action("wait"))


@pytest.mark.parametrize("size", [(40, 400), (260, 58)])
def test_content_is_never_cut_off(size: tuple[int, int], assets: Path) -> None:
    with pytest.raises(
        NotApplicable, match="no error page was recorded that a page of this size can show"
    ):
        edit("firewall", assets, size=size, screen="web page")


@pytest.mark.parametrize("spot", [(130, 0), (5, 0), (40, 99)])
def test_a_page_whose_edge_is_not_plain_is_not_continued(
    spot: tuple[int, int], tmp_path: Path
) -> None:
    pack_maker = PackMaker(tmp_path / "pack")
    picture = page(100, 140)
    picture[spot] = 200
    pack_maker.add("view", "error_view", picture)
    with pytest.raises(NotApplicable):
        edit("firewall", pack_maker.write(), size=(140, 120), screen="web page")
    assert tuple(picture[-1, 0]) == BACKGROUND


def test_the_page_of_the_nearest_width_is_taken(tmp_path: Path) -> None:
    pack_maker = PackMaker(tmp_path / "pack")
    for width in (200, 300, 400):
        pack_maker.add(f"view-{width}", "error_view", page(width, 150, (60, 20 + width // 10)))
    value, picture = edit("firewall", pack_maker.write(), size=(150, 290), screen="web page")
    assert np.array_equal(picture, page(290, 150, (60, 50)))
    assert value.notes == ("view-300 was cut or continued to the size of the page",)


@pytest.mark.parametrize(("kind", "spare"), SPARE.items())
def test_a_pack_without_such_pictures(kind: str, spare: str, tmp_path: Path) -> None:
    pack_maker = PackMaker(tmp_path / "pack")
    pack_maker.add("x", "window", pixels(1, 20, 20))
    folder = pack_maker.write()
    assert not AssetPack.load(folder).pictures(spare)
    with pytest.raises(NotApplicable):
        edit(kind, folder, apps=("chrome",))
