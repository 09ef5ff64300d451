"""Edits that paste something beside or at an element: second windows, and what a stray click opens."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.pack import AssetPack
from hijack_data.plan import Effect
from hijack_data.types import Action
from pipelines.edits import EDITS, NotApplicable

from support.assets import PackMaker, pixels
from support.frames import drawn, frame_of

LAUNCH = Effect("launch_app", {"app": "vscode", "then": ["chrome", "gimp", "thunar"], "tile": True})
ELEMENTS = [(5, 5, 45, 15), (280, 100, 310, 120), (5, 180, 45, 195)]


def window(pack: Path, effect: Effect = LAUNCH, **frame: Any) -> tuple[Any, np.ndarray, Any]:
    made = frame_of(pack, **frame)
    found = EDITS["launch_app"](made, effect)
    return found, drawn(made, found), made


def pasted(found: Any) -> tuple[str, tuple[int, int]]:
    (op,) = found.ops
    return op.sprite["id"], op.at[0]


def test_a_window_is_pasted_as_it_was_recorded(assets: Path) -> None:
    found, picture, _ = window(assets)
    name, (x, y) = pasted(found)
    assert name == "gimp-90x70"
    assert np.array_equal(picture[y : y + 70, x : x + 90], pixels(10, 90, 70))
    assert found.boxes == ((x, y, x + 90, y + 70),)
    assert (found.fidelity, found.deed, found.inserted, found.reminder) == ("composited", None, False, None)
    assert found.notes == ("a window of gimp was recorded, and none of vscode that fits",)
    assert "application" in found.event


@pytest.mark.parametrize(
    ("about", "expected"),
    [({"apps": ("GIMP",)}, "thunar"), ({"domain": "gimp"}, "thunar"), ({"apps": ("vlc",)}, "gimp")],
)
def test_an_application_of_the_recording_is_never_the_second(
    about: dict[str, Any], expected: str, assets: Path
) -> None:
    assert pasted(window(assets, **about)[0])[0].startswith(expected)
    with pytest.raises(NotApplicable, match="no window of an application that the recording does not use"):
        window(assets, apps=("gimp", "Thunar"))


def test_the_plan_says_which_application_comes_first(assets: Path) -> None:
    for app in ("gimp", "thunar"):
        found, _, _ = window(assets, Effect("launch_app", {"app": app, "then": ["gimp"], "tile": True}))
        assert pasted(found)[0].startswith(app)
        assert found.notes == ()


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_the_target_and_the_screen_are_left_whole(assets: Path, data: st.DataObject) -> None:
    """Whatever the elements are: the window lies on the screen and covers nothing of the target."""
    boxes = data.draw(st.lists(st.tuples(*(st.integers(0, 150) for _ in range(4))), max_size=8))
    boxes = [(x, y, x + w + 1, y + h + 1) for x, y, w, h in boxes]
    action = Action("click", data.draw(st.integers(0, 319)), data.draw(st.integers(0, 199)))
    try:
        found, _, frame = window(assets, boxes=boxes, action=action, seed=data.draw(st.integers(0, 50)))
    except NotApplicable:
        assume(False)
    x1, y1, x2, y2 = found.boxes[0]
    assert 0 <= x1 < x2 <= 320
    assert 6 <= y1 < y2 <= 190  # clear of panels
    plan = hj.Plan("x-v1", (200, 320), ops=found.ops)
    judged = hj.judge(plan, frame.image, hj.apply(plan, frame.image), target=frame.scene.target)
    whole = hj.judge(hj.Plan.clean((200, 320)), frame.image, frame.image, target=frame.scene.target)
    assert judged.target_visible == whole.target_visible


def test_it_stands_where_it_covers_the_fewest_elements(assets: Path) -> None:
    """The right half is full of buttons, the left is free: below the target there is room for the large window."""
    boxes = [(x, y, x + 18, y + 18) for x in range(160, 320, 20) for y in range(0, 200, 20)]
    for seed in range(6):
        found, _, _ = window(assets, Effect("launch_app", {"app": "thunar"}), boxes=boxes, seed=seed,
                             action=Action("click", 20, 12))  # fmt: skip
        name, (x, _) = pasted(found)
        assert (name, x + 120 <= 160) == ("thunar-120x150", True)


def test_seeds_choose_among_places_that_are_as_good(assets: Path) -> None:
    corners = {pasted(window(assets, seed=seed)[0])[1] for seed in range(20)}
    assert len(corners) > 3
    assert pasted(window(assets, seed=3)[0]) == pasted(window(assets, seed=3)[0])


@pytest.mark.parametrize(
    "action", [Action("type", text="x"), Action("hotkey", keys=("a",)), Action("scroll", amount=1)]
)
def test_what_the_new_window_would_take_is_left_alone(action: Action, assets: Path) -> None:
    with pytest.raises(NotApplicable, match="names no place on the screen"):
        window(assets, action=action)


def test_an_action_that_needs_no_place_goes_with_any(assets: Path) -> None:
    for kind in ("wait", "done", "fail"):
        assert window(assets, action=Action(kind))[0].ops


@pytest.mark.parametrize("size", [(52, 320), (200, 55), (48, 48)])
def test_screens_without_room(size: tuple[int, int], assets: Path) -> None:
    with pytest.raises(NotApplicable, match="no room beside the target"):
        window(assets, size=size, action=Action("click", size[1] // 2, size[0] // 2))


def touch(pack: Path, boxes: Any, without_app: bool = True, **frame: Any) -> tuple[Any, np.ndarray]:
    made = frame_of(pack, boxes=boxes, **frame)
    found = EDITS["touch"](made, Effect("touch", {"boxes": [list(box) for box in boxes], "without_app": without_app}))
    return found, drawn(made, found)


def only(kind: str, folder: Path, **more: Any) -> Path:
    """A pack with one menu or dialog of 60x40."""
    made = PackMaker(folder)
    about: dict[str, Any] = {"recover": {"type": "hotkey", "keys": ["esc"]}, **more}
    made.add("opened", kind, pixels(5, 60, 40), **{"screen": [320, 200], **about})
    return made.write()


CLICKED = {"type": "click", "x": 10, "y": -6, "target_box": [4, -12, 20, -2]}


@pytest.mark.parametrize(
    ("element", "opened_by", "corner"),
    [
        ((50, 60, 90, 70), None, (50, 70)),
        ((50, 60, 90, 70), CLICKED, (46, 72)),  # as far from what was clicked as it was
        ((2, 60, 20, 70), CLICKED, (0, 72)),
        ((290, 60, 310, 70), CLICKED, (260, 72)),
        ((50, 150, 90, 165), CLICKED, (46, 110)),  # no room below: it opens upwards
        ((50, 20, 90, 35), {"type": "click", "x": 1, "y": 2}, (50, 35)),
    ],
)
def test_a_menu_hangs_from_what_was_clicked(
    element: Any, opened_by: Any, corner: tuple[int, int], tmp_path: Path
) -> None:
    found, picture = touch(only("menu", tmp_path / "pack", opened_by=opened_by), [element])
    x, y = corner
    assert np.array_equal(picture[y : y + 40, x : x + 60], pixels(5, 60, 40))
    assert np.count_nonzero(picture.any(axis=2)) <= 60 * 40
    assert (found.fidelity, found.inserted, found.reminder) == ("composited", True, None)
    assert (found.deed.action, found.deed.target_box) == (Action("hotkey", keys=("esc",)), None)
    assert found.notes == (f"the element at {list(element)} was clicked",)
    assert "menu opened" in found.event


def test_a_dialog_comes_in_the_middle_with_its_button(tmp_path: Path) -> None:
    recover = {"type": "click", "x": 25, "y": 30, "target_box": [10, 25, 40, 35]}
    target = {"name": "Cancel", "role": "push-button", "box": [10, 25, 40, 35]}
    found, picture = touch(only("dialog", tmp_path / "pack", recover=recover, targets=[target]), ELEMENTS)
    assert np.array_equal(picture[80:120, 130:190], pixels(5, 60, 40))
    assert (found.deed.action, found.deed.target_box) == (Action("click", 155, 110), (140, 105, 170, 115))
    assert found.boxes == ((140, 105, 170, 115),)
    assert "dialog opened" in found.event


def test_the_first_element_that_is_not_the_target_is_clicked(assets: Path) -> None:
    """The one around the click is the target, and a large one is no button."""
    boxes = [(90, 40, 130, 60), (0, 0, 320, 90), ELEMENTS[1], ELEMENTS[0]]
    assert touch(assets, boxes)[0].notes == (f"the element at {list(ELEMENTS[1])} was clicked",)
    for few in ([], boxes[:2]):
        with pytest.raises(NotApplicable, match="no element but the target is known"):
            touch(assets, few)


def test_launchers_are_left_out_as_they_are_live(assets: Path) -> None:
    bars = [(0, 0, 20, 8), (10, 186, 60, 200)]
    assert touch(assets, [*bars, ELEMENTS[1]])[0].notes == (f"the element at {list(ELEMENTS[1])} was clicked",)
    assert touch(assets, [*bars, ELEMENTS[1]], without_app=False)[0].notes == (
        "the element at [0, 0, 20, 8] was clicked",
    )
    with pytest.raises(NotApplicable, match="no element but the target"):
        touch(assets, bars)


def test_a_menu_of_the_panel_hangs_from_the_panel(tmp_path: Path) -> None:
    """It opens upwards there, and from nothing else."""
    opened = {"type": "click", "x": 10, "y": 50, "target_box": [0, 42, 30, 54]}
    folder = only("menu", tmp_path / "pack", app="desktop", opened_by=opened)
    found, picture = touch(folder, [(40, 188, 70, 200)], without_app=False)
    assert np.array_equal(picture[146:186, 40:100], pixels(5, 60, 40))
    assert "menu opened" in found.event
    with pytest.raises(NotApplicable, match="nothing that a click opens was recorded"):
        touch(folder, [(40, 88, 70, 100)], without_app=False)


def test_without_a_target_any_element_will_do(assets: Path) -> None:
    found, _ = touch(assets, [(90, 40, 130, 60)], action=Action("type", text="x"))
    assert found.notes == ("the element at [90, 40, 130, 60] was clicked",)


@pytest.mark.parametrize(
    "about",
    [{"recover": None}, {"opened_by": {"type": "right_click", "x": 1, "y": 1}}, {"box": [0, 0, 600, 400]}],
)
def test_what_is_not_opened_by_a_click_is_not_used(about: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(NotApplicable, match="nothing that a click opens was recorded"):
        touch(only("menu", tmp_path / "pack", **about), ELEMENTS)


def test_menus_of_the_recordings_own_application_come_first(assets: Path, tmp_path: Path) -> None:
    made = PackMaker(tmp_path / "pack")
    for number, app in enumerate(("gimp", "thunar", "chromium")):
        made.add(app, "menu", pixels(number, 30, 30), app=app, recover={"type": "hotkey", "keys": ["esc"]})
    folder = made.write()
    names = {touch(folder, ELEMENTS, seed=k, apps=("Chrome",))[0].ops[0].sprite["id"] for k in range(9)}
    assert names == {"chromium"}
    assert len({touch(folder, ELEMENTS, seed=k)[0].ops[0].sprite["id"] for k in range(20)}) == 3
    assert len(AssetPack.load(assets).pictures("menu")) == 1
