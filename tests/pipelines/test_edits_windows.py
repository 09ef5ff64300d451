"""Edits that paste something beside or at an element: second windows, and what a stray click
opens."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.plan import Effect
from hijack_data.types import Action
from pipelines.edits import EDITS, NotApplicable
from pipelines.edits.open_menus import menu_state

from support.assets import PackMaker, pixels
from support.frames import drawn, frame_of

LAUNCH = Effect("launch_app", {"app": "vscode", "then": ["chrome", "gimp", "thunar"], "tile": True})
ELEMENTS = [(5, 15, 45, 25), (280, 100, 310, 120), (5, 165, 45, 180)]
BUTTON = (230, 100, 280, 120)  # of the size that opens what `assets` has


def window(pack: Path, effect: Effect = LAUNCH, **frame: Any) -> tuple[Any, np.ndarray, Any]:
    result = frame_of(pack, **frame)
    value = EDITS["launch_app"].apply(result, effect)
    return value, drawn(result, value), result


def pasted(found: Any) -> tuple[str, tuple[int, int]]:
    (op,) = found.ops
    return op.sprite["id"], op.at[0]


def test_a_window_is_pasted_as_it_was_recorded(assets: Path) -> None:
    value, picture, _ = window(assets)
    name, (x, y) = pasted(value)
    assert name == "gimp-90x70"
    assert np.array_equal(picture[y : y + 70, x : x + 90], pixels(10, 90, 70))
    assert value.boxes == ((x, y, x + 90, y + 70),)
    assert (value.fidelity, value.response, value.inserted, value.reminder) == (
        "composited",
        None,
        False,
        None,
    )
    assert value.notes == ("a window of gimp was recorded, and none of vscode that fits",)
    assert "application" in value.event


@pytest.mark.parametrize(
    ("about", "expected"),
    [
        ({"apps": ("GIMP",)}, "thunar"),
        ({"domain": "gimp"}, "thunar"),
        ({"apps": ("vlc",)}, "gimp"),
        ({"apps": ("file_manager",)}, "gimp"),
    ],
)
def test_an_application_of_the_recording_is_never_the_second(
    about: dict[str, Any], expected: str, assets: Path
) -> None:
    assert pasted(window(assets, **about)[0])[0].startswith(expected)
    with pytest.raises(
        NotApplicable, match="no window of an application that the recording does not use"
    ):
        window(assets, apps=("gimp", "Thunar"))


def test_browsers_are_one_family(tmp_path: Path) -> None:
    pack_maker = PackMaker(tmp_path / "pack")
    pack_maker.add("browser", "window", pixels(1, 60, 50), app="chromium", screen=[320, 200])
    folder = pack_maker.write()
    for app in ("Google Chrome", "firefox", "safari", "browser", "chromium"):
        with pytest.raises(
            NotApplicable, match="no window of an application that the recording does not use"
        ):
            window(folder, apps=(app,))
    assert pasted(window(folder, apps=("gimp",))[0])[0] == "browser"


def test_without_known_applications_none_is_another(assets: Path, tmp_path: Path) -> None:
    with pytest.raises(NotApplicable, match=r"does not say which applications it uses.*--apps"):
        window(assets, apps=())
    with pytest.raises(NotApplicable, match=r"does not say which applications it uses.*--apps"):
        window(assets, apps=(), platform="windows", allow_platform_mismatch=True)


@pytest.mark.parametrize(
    ("instruction", "is_named"),
    [
        ("使用GIMP剪裁图像", True),
        ("Open the GNU Image Manipulation Program", True),
        ("Cut the picture", False),
        ("Read about gimping", False),
    ],
)
def test_a_program_that_the_instruction_names_is_not_the_second(
    instruction: str, is_named: bool, tmp_path: Path
) -> None:
    """An instruction never proves what shows, and may say that a program is not another one."""
    pack_maker = PackMaker(tmp_path / "pack")
    pack_maker.add("picture", "window", pixels(1, 60, 50), app="gimp", screen=[320, 200])
    effect = Effect("launch_app", {"app": "gimp", "tile": True})
    frame = frame_of(pack_maker.write(), apps=("chrome",), instruction=instruction)
    if is_named:
        with pytest.raises(NotApplicable, match="no window of an application"):
            EDITS["launch_app"].apply(frame, effect)
    else:
        assert EDITS["launch_app"].apply(frame, effect).ops


def test_the_plan_says_which_application_comes_first(assets: Path) -> None:
    for app in ("gimp", "thunar"):
        value, _, _ = window(
            assets, Effect("launch_app", {"app": app, "then": ["gimp"], "tile": True})
        )
        assert pasted(value)[0].startswith(app)
        assert value.notes == ()


@settings(
    max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.data())
def test_the_target_and_the_screen_are_left_whole(assets: Path, data: st.DataObject) -> None:
    """Whatever the elements are: the window lies on the screen and covers nothing of the target."""
    boxes = data.draw(st.lists(st.tuples(*(st.integers(0, 150) for _ in range(4))), max_size=8))
    boxes = [(x, y, x + w + 1, y + h + 1) for x, y, w, h in boxes]
    action = Action("click", data.draw(st.integers(0, 319)), data.draw(st.integers(0, 199)))
    try:
        value, _, frame = window(
            assets, boxes=boxes, action=action, seed=data.draw(st.integers(0, 50))
        )
    except NotApplicable:
        assume(False)
    x1, y1, x2, y2 = value.boxes[0]
    assert 0 <= x1 < x2 <= 320
    assert 6 <= y1 < y2 <= 190  # clear of panels
    plan = hj.Plan("x-v1", (200, 320), ops=value.ops)
    judged = hj.judge(plan, frame.image, hj.apply(plan, frame.image), target=frame.scene.target)
    safety = hj.judge(
        hj.Plan.clean((200, 320)), frame.image, frame.image, target=frame.scene.target
    )
    assert judged.target_visible == safety.target_visible


def test_it_stands_where_it_covers_the_fewest_elements(assets: Path) -> None:
    """The right half is full of buttons, the left is free: below the target there is room for the
    large window."""
    boxes = [(x, y, x + 18, y + 18) for x in range(160, 320, 20) for y in range(0, 200, 20)]
    for seed in range(6):
        value, _, _ = window(
            assets,
            Effect("launch_app", {"app": "thunar"}),
            boxes=boxes,
            seed=seed,
            action=Action("click", 20, 12),
        )
        name, (x, _) = pasted(value)
        assert (name, x + 120 <= 160) == ("thunar-120x150", True)


def test_seeds_choose_among_places_that_are_as_good(assets: Path) -> None:
    corners = {pasted(window(assets, seed=seed)[0])[1] for seed in range(20)}
    assert len(corners) > 3
    assert pasted(window(assets, seed=3)[0]) == pasted(window(assets, seed=3)[0])


TYPED = "pyautogui.write('x')\npyautogui.click(100, 50)"


@pytest.mark.parametrize(
    ("action", "code", "reason"),
    [
        (Action("type", 100, 50, text="x"), "", "begins with keys"),
        (Action("hotkey", 100, 50, keys=("a",)), "", "begins with keys"),
        (Action("other", 100, 50), TYPED, "begins with keys"),
        (Action("scroll", amount=1), "", "names no place on the screen"),
    ],
)
def test_what_the_new_window_would_take_is_left_alone(
    action: Action, code: str, reason: str, assets: Path
) -> None:
    frame = frame_of(assets, action=action)
    frame = replace(frame, step=replace(frame.step, action_code=code))
    with pytest.raises(NotApplicable, match=reason):
        EDITS["launch_app"].apply(frame, LAUNCH)


def test_a_click_with_held_keys_is_no_typing(assets: Path) -> None:
    assert window(assets, action=Action("click", 100, 50, keys=("ctrl",)))[0].ops


def test_an_action_that_needs_no_place_goes_with_any(assets: Path) -> None:
    for kind in ("wait", "done", "fail"):
        assert window(assets, action=Action(kind))[0].ops


@pytest.mark.parametrize("size", [(52, 320), (200, 55), (48, 48)])
def test_screens_without_room(size: tuple[int, int], assets: Path) -> None:
    with pytest.raises(NotApplicable, match="no room beside the target"):
        window(assets, size=size, action=Action("click", size[1] // 2, size[0] // 2))


def touch(pack: Path, boxes: Any, without_app: bool = True, **frame: Any) -> tuple[Any, np.ndarray]:
    result = frame_of(pack, boxes=boxes, **frame)
    value = EDITS["touch"].apply(
        result, Effect("touch", {"boxes": [list(box) for box in boxes], "without_app": without_app})
    )
    return value, drawn(result, value)


def only(kind: str, folder: Path, **more: Any) -> Path:
    """A pack with one menu or dialog of 60x40, of the application of `frame_of`."""
    pack_maker = PackMaker(folder)
    about: dict[str, Any] = {
        "app": "editor",
        "recover": {"type": "hotkey", "keys": ["esc"]},
        "opened_by": clicked((0, 0, 40, 10)),
        **more,
    }
    pack_maker.add("opened", kind, pixels(5, 60, 40), **{"screen": [320, 200], **about})
    return pack_maker.write()


def clicked(element: Any, x: int = 0, gap: int = 0) -> dict[str, Any]:
    """A click on an element of this size, `gap` pixels above the menu and `x` to the right of its
    left side."""
    width, height = element[2] - element[0], element[3] - element[1]
    box = [x, -gap - height, x + width, -gap]
    return {"type": "click", "x": x + 1, "y": -gap - 1, "target_box": box}


@pytest.mark.parametrize(
    ("element", "x", "gap", "corner"),
    [
        ((50, 60, 90, 70), 0, 0, (50, 70)),
        ((50, 60, 90, 70), 4, 2, (46, 72)),  # as far from what was clicked as it was
        ((50, 60, 90, 70), 0, 5, (50, 75)),  # a bubble leaves a gap
        ((2, 60, 20, 70), 4, 2, (0, 72)),
        ((290, 60, 310, 70), 4, 2, (260, 72)),
        ((50, 150, 90, 165), 4, 2, (46, 110)),  # no room below: it opens upwards
    ],
)
def test_a_menu_hangs_from_what_was_clicked(
    element: Any, x: int, gap: int, corner: tuple[int, int], tmp_path: Path
) -> None:
    folder = only("menu", tmp_path / "pack", opened_by=clicked(element, x, gap))
    value, picture = touch(folder, [element])
    x, y = corner
    assert np.array_equal(picture[y : y + 40, x : x + 60], pixels(5, 60, 40))
    picture[y : y + 40, x : x + 60] = 0
    assert {tuple(point) for point in np.argwhere(picture.any(axis=2)).tolist()} <= {
        (element[1], element[0])
    }
    assert (value.fidelity, value.inserted, value.reminder) == ("composited", True, None)
    assert (value.response.action, value.response.target_box) == (
        Action("hotkey", keys=("esc",)),
        None,
    )
    assert value.notes == (f"the element at {list(element)} was clicked",)
    assert "menu opened" in value.event


def test_a_dialog_comes_in_the_middle_with_its_button(tmp_path: Path) -> None:
    recover = {"type": "click", "x": 25, "y": 30, "target_box": [10, 25, 40, 35]}
    target = {"name": "Cancel", "role": "push-button", "box": [10, 25, 40, 35]}
    opened_by = {"type": "click", "x": -20, "y": 5, "target_box": [-30, 0, 10, 10]}
    folder = only(
        "dialog", tmp_path / "pack", recover=recover, targets=[target], opened_by=opened_by
    )
    value, picture = touch(folder, ELEMENTS)
    assert np.array_equal(picture[80:120, 130:190], pixels(5, 60, 40))
    assert (value.response.action, value.response.target_box) == (
        Action("click", 155, 110),
        (140, 105, 170, 115),
    )
    assert value.boxes == ((140, 105, 170, 115),)
    assert "dialog opened" in value.event


def test_the_first_element_that_is_not_the_target_is_clicked(assets: Path) -> None:
    """The one around the click is the target, and a large one is no button."""
    boxes = [(90, 40, 130, 60), (0, 0, 320, 90), BUTTON, ELEMENTS[0]]
    assert touch(assets, boxes, apps=("chrome",))[0].notes == (
        f"the element at {list(BUTTON)} was clicked",
    )
    for few in ([], boxes[:2]):
        with pytest.raises(NotApplicable, match="no element but the target is known"):
            touch(assets, few, apps=("chrome",))


def test_launchers_are_left_out_as_they_are_live(assets: Path) -> None:
    bars, chrome = [(0, 0, 50, 8), (10, 182, 60, 200)], {"apps": ("chrome",)}
    assert touch(assets, [*bars, BUTTON], **chrome)[0].notes == (
        f"the element at {list(BUTTON)} was clicked",
    )
    value = touch(assets, [bars[1], BUTTON], without_app=False, **chrome)[0]
    # the launcher opens no menu
    assert value.notes == (f"the element at {list(BUTTON)} was clicked",)
    with pytest.raises(NotApplicable, match="no element but the target"):
        touch(assets, bars, **chrome)


def test_a_menu_of_the_panel_hangs_from_the_panel(tmp_path: Path) -> None:
    """It opens upwards there, from nothing else, and whatever the applications are: that screen has
    it always."""
    click = {"type": "click", "x": 10, "y": 50, "target_box": [0, 42, 30, 54]}
    folder = only("menu", tmp_path / "pack", app="desktop", opened_by=click)
    for apps in ((), ("gimp", "vlc"), ("editor",)):
        value, picture = touch(folder, [(40, 188, 73, 200)], without_app=False, apps=apps)
        assert np.array_equal(picture[146:186, 40:100], pixels(5, 60, 40))
        assert "menu opened" in value.event
    with pytest.raises(NotApplicable, match="no element of this screen is known to open"):
        touch(folder, [(40, 88, 70, 100)], without_app=False)
    with pytest.raises(NotApplicable, match="names no application whose menus could open"):
        touch(
            folder,
            [(40, 188, 73, 200)],
            without_app=False,
            apps=(),
            platform="linux",
            allow_platform_mismatch=True,
        )


def test_without_a_target_any_element_will_do(assets: Path) -> None:
    value, _ = touch(assets, [(90, 40, 140, 60)], action=Action("type", text="x"), apps=("chrome",))
    assert value.notes == ("the element at [90, 40, 140, 60] was clicked",)


@pytest.mark.parametrize(
    "about",
    [
        {"recover": None},
        {"opened_by": {**clicked((0, 0, 40, 10)), "type": "right_click"}},
        {"opened_by": None},  # by more than a click
        {"opened_by": {"type": "click", "x": 1, "y": 2}},
        {"opened_by": clicked((0, 0, 44, 10))},  # by something else
        {"box": [0, 0, 600, 400]},
        {"targets": [{"name": "harbour-walk.txt", "role": "menu-item", "box": [0, 0, 9, 9]}]},
        {"made_by": "editor: click on Bookmark this tab"},
        {"app": "thunar"},
        {"app": "desktop"},
    ],
)
def test_what_such_a_click_does_not_open_is_not_used(about: dict[str, Any], tmp_path: Path) -> None:
    assert touch(only("menu", tmp_path / "fine"), ELEMENTS)[0].ops
    with pytest.raises(
        NotApplicable, match=r"no element of this screen is known to open .* of editor"
    ):
        touch(only("menu", tmp_path / "pack", **about), ELEMENTS)


def test_menus_are_of_the_recordings_own_application(tmp_path: Path) -> None:
    pack_maker = PackMaker(tmp_path / "pack")
    for number, app in enumerate(("gimp", "thunar", "chromium")):
        pack_maker.add(
            app,
            "menu",
            pixels(number, 30, 30),
            app=app,
            recover={"type": "hotkey", "keys": ["esc"]},
            opened_by=clicked((0, 0, 40, 10)),
        )
    folder = pack_maker.write()
    names = {
        touch(folder, ELEMENTS, seed=k, apps=("Chrome",))[0].ops[0].sprite["id"] for k in range(9)
    }
    assert names == {"chromium"}
    for apps, reason in (
        ((), "names no application whose menus could open; .*--apps"),
        (("gimp", "thunar"), "which one this step shows is not recorded"),
        (("firefox",), "was recorded of firefox"),
    ):
        with pytest.raises(NotApplicable, match=reason):
            touch(folder, ELEMENTS, apps=apps)
    about: dict[str, Any] = {"platform": "windows", "allow_platform_mismatch": True}
    with pytest.raises(NotApplicable, match="was recorded of firefox"):
        touch(folder, [(280, 5, 318, 15), (2, 5, 42, 15)], apps=("firefox",), **about)
    result = touch(folder, [(280, 5, 318, 15), (2, 5, 42, 15)], apps=("chrome",), **about)
    assert result[0].ops[0].sprite["id"] == "chromium"
    assert result[0].ops[0].at == ((2, 15),)


def test_what_is_greyed_out_is_not_clicked(tmp_path: Path) -> None:
    """As behind a dialog, whose window lists them all the same."""
    folder = only("menu", tmp_path / "pack")
    result = frame_of(folder, boxes=ELEMENTS[:1])
    result.image[...] = 200
    result.image[16:18, 6:40] = 140
    with pytest.raises(NotApplicable, match="no element but the target"):
        EDITS["touch"].apply(
            result, Effect("touch", {"boxes": [list(ELEMENTS[0])], "without_app": True})
        )
    result.image[16:18, 6:40] = 60
    assert (
        EDITS["touch"]
        .apply(result, Effect("touch", {"boxes": [list(ELEMENTS[0])], "without_app": True}))
        .ops
    )


MENU = [(100, 60, 200, 80), (100, 80, 200, 100), (100, 110, 200, 130)]  # a separator above the last
ROWS = [(150, 60, 300, 75), (150, 76, 300, 91)]
CLICK, TYPED = Action("click", 1, 1), Action("type", text="x")


@pytest.mark.parametrize(
    ("boxes", "before", "action", "state"),
    [
        ([*MENU, *ROWS], (CLICK,), TYPED, "open"),  # items over the rows of a list
        ([*MENU, (90, 50, 310, 190)], (), TYPED, "open"),  # over a large area
        (MENU, (CLICK,), TYPED, "closed"),  # the column of a side bar lies over nothing
        ([*MENU[:2], *ROWS], (CLICK,), TYPED, "closed"),
        ([*MENU, (120, 62, 140, 78)], (CLICK,), TYPED, "closed"),  # a button in a row
        (ROWS, (Action("right_click", 1, 1),), TYPED, "open"),
        (ROWS, (CLICK,), Action("hotkey", keys=("esc",)), "open"),
        ((), (), TYPED, "closed"),
        ((), (CLICK,), TYPED, "not known"),
        ((), (CLICK, Action("wait")), TYPED, "not known"),
        ((), (Action("other"),), TYPED, "not known"),
        ((), (CLICK, TYPED), CLICK, "closed"),
        ((), (Action("double_click", 1, 1),), CLICK, "closed"),
        ((), (Action("hotkey", keys=("ctrl", "a")),), CLICK, "closed"),
        ((), (Action("hotkey", keys=("alt", "f")),), CLICK, "not known"),
    ],
)
def test_whether_a_menu_is_open(
    boxes: Any, before: Any, action: Action, state: str, assets: Path
) -> None:
    assert menu_state(frame_of(assets, boxes=boxes, before=before, action=action)) == state


def test_no_menu_opens_over_a_menu(tmp_path: Path) -> None:
    folder, at = only("menu", tmp_path / "pack"), {"action": TYPED}
    for boxes, before, reason in (
        ([*ELEMENTS, *MENU, *ROWS], (CLICK,), "a menu is open on this screen already"),
        (ELEMENTS, (Action("right_click", 1, 1),), "a menu is open on this screen already"),
    ):
        with pytest.raises(NotApplicable, match=reason):
            touch(folder, boxes, before=before, **at)
    with pytest.raises(NotApplicable, match=r"a menu may be open.*the recording holds no elements"):
        touch(folder, ELEMENTS, before=(CLICK,), recorded=False, **at)
    assert touch(folder, ELEMENTS, before=(TYPED,), recorded=False, **at)[0].ops
    with pytest.raises(NotApplicable, match="a menu may be open on this screen"):
        touch(
            folder,
            [(2, 5, 42, 15)],
            before=(CLICK,),
            recorded=False,
            platform="macos",
            allow_platform_mismatch=True,
            **at,
        )
