"""What a recording keeps at its edges: hands that are not tidy, parts of pictures, odd folders."""

import itertools
import json

import numpy as np
import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)

from hijack_data.actions import parse_pyautogui
from hijack_data.errors import HijackError, ParameterError
from hijack_data.types import Action
from online_env import record_command as command
from online_env.errors import DesktopError
from online_env.maintenance import asset_recorder as assets
from online_env.record_command import RecordOptions
from online_env.recording.action_recognizer import ActionRecognizer
from online_env.recording.captured_picture import ClickTarget, Picture
from online_env.recording.trajectory import EpisodeRecording, RecordedView, prepare, save

SIZE = (1080, 1920)


def recognize(*events):
    """The actions that events become; a number among them lets time pass."""
    now = [0.0]
    values = []
    looks = itertools.count()
    actions = ActionRecognizer(
        lambda: next(looks), lambda _, code: values.append(code), lambda: now[0]
    )
    for event in events:
        if isinstance(event, dict):
            actions.event(event)
        else:
            now[0] += event
    actions.flush()
    return [parse_pyautogui(code, SIZE) for code in values]


def button(kind, x, y, name="left"):
    return {"type": kind, "x": x, "y": y, "button": name}


def click(x, y, name="left"):
    return button("down", x, y, name), button("up", x, y, name)


def key(kind, name):
    return {"type": kind, "key": name}


@pytest.mark.parametrize(
    ("off", "pause", "kinds"),
    [
        (5, 0.6, ["double_click"]),
        (6, 0.6, ["click", "click"]),
        (5, 0.61, ["click", "click"]),
        (-5, 0.0, ["double_click"]),
        (-6, 0.0, ["click", "click"]),
    ],
)
def test_how_near_and_how_soon_a_second_click_must_come(off, pause, kinds):
    assert [item.type for item in recognize(*click(30, 40), pause, *click(30, 40 + off))] == kinds


def test_a_click_after_a_drag_is_a_click_of_its_own():
    drag = (button("down", 30, 40), button("up", 90, 40))
    result = recognize(*drag, 0.1, *click(30, 40))
    assert [item.type for item in result] == ["drag", "click"]
    assert (result[0].x, result[0].x2) == (30, 90)


def test_what_only_the_left_button_has_a_name_for_is_never_taken_for_it():
    (twice,) = recognize(*click(7, 8, "right"), 0.1, *click(7, 8, "right"))
    (drag,) = recognize(button("down", 7, 8, "right"), button("up", 99, 8, "right"))
    assert not {twice.type, drag.type} & {"click", "double_click", "drag"}


def test_a_button_that_is_let_go_elsewhere_than_on_the_page_is_a_click():
    assert recognize(button("down", 7, 8)) == [Action("click", 7, 8)]
    assert recognize(button("up", 7, 8)) == []
    assert recognize(*click(7, 8), {"type": "type", "text": "a"}, button("up", 500, 8)) == [
        Action("click", 7, 8),
        Action("type", text="a"),
    ]


def test_modifiers_are_written_in_the_order_in_which_they_went_down():
    items = (key("key_down", "ctrl"), key("key_down", "shift"))
    (value,) = recognize(*items, key("key", "t"), key("key_up", "shift"), key("key_up", "ctrl"))
    assert value.keys == ("ctrl", "shift", "t")
    first, second = recognize(*items, key("key", "a"), key("key_up", "shift"), key("key", "b"))
    assert (first.keys, second.keys) == (("ctrl", "shift", "a"), ("ctrl", "b"))


def test_a_modifier_that_comes_between_two_clicks_parts_them():
    events = (*click(7, 8), key("key_down", "ctrl"), *click(7, 8), key("key_up", "ctrl"))
    result = recognize(*events)
    assert [(item.type, item.keys) for item in result] == [("click", None), ("click", ("ctrl",))]


def test_the_windows_key_opens_a_menu_only_if_it_was_pressed_alone():
    assert [item.keys for item in recognize(key("key_down", "win"), key("key_up", "win"))] == [
        ("win",)
    ]
    used_actions = (key("key_down", "win"), key("key", "d"), key("key_up", "win"))
    assert [item.keys for item in recognize(*used_actions)] == [("win", "d")]
    assert recognize(key("key_up", "win")) == [], "it went down before the page was opened"


def test_the_wheel_elsewhere_or_later_is_another_scroll():
    def turn(x, amount=1):
        return {"type": "scroll", "x": x, "y": 9, "amount": amount}

    assert [item.amount for item in recognize(turn(1), 2.0, turn(1, 2))] == [3]
    assert [item.amount for item in recognize(turn(1), 2.1, turn(1, 2))] == [1, 2]
    assert [item.amount for item in recognize(turn(1), turn(2, 2))] == [1, 2]


def test_text_with_quotes_and_lines_is_written_as_it_was_typed():
    text = 'it\'s "so"\\\n{x}\t'
    assert recognize(*({"type": "type", "text": letter} for letter in text)) == [
        Action("type", text=text)
    ]


# Pictures


def test_a_part_of_a_picture_is_cut_to_it_and_keeps_what_lies_wholly_inside():
    pixels = np.arange(40 * 60 * 4, dtype=np.uint8).reshape(40, 60, 4)
    targets = [
        ClickTarget("inside", "push-button", (110, 60, 120, 70)),
        ClickTarget("edge", "push-button", (105, 55, 130, 80)),
        ClickTarget("across", "push-button", (100, 60, 120, 70)),
    ]
    window_picture = Picture("window", "geany", (100, 50, 160, 90), pixels, "made", targets)
    part = window_picture.part("panel", (105, 55, 130, 999), made_by="cut")
    assert (part.kind, part.app, part.box, part.made_by) == (
        "panel",
        "geany",
        (105, 55, 130, 90),
        "cut",
    )
    assert np.array_equal(part.pixels, pixels[5:40, 5:30, :3])
    assert [target.name for target in part.targets] == ["inside", "edge"]
    pixels[:] = 0
    assert part.pixels.any(), "it has its own pixels"


def test_a_desktop_that_fails_loses_the_rest_of_its_scene_only(monkeypatch, tmp_path):
    class Desktop:
        @classmethod
        def up(cls, **options):
            raise DesktopError(f"no desktop of {options['size'][1]}x{options['size'][0]}")

    monkeypatch.setattr(assets, "EmbeddedDesktop", Desktop)
    output = []
    missing_assets = assets.record_assets(
        tmp_path, ["icon", "menu"], [(720, 1280), SIZE], output.append
    )
    assert [(item.name, item.reason) for item in missing_assets] == [
        ("the rest of menus", "no desktop of 1920x1080"),
        ("the rest of parts", "no desktop of 1920x1080"),
    ]
    assert output[0] == (
        "NOT recorded at 1920x1080, golden: the rest of menus: no desktop of 1920x1080"
    )
    assert output[-1].startswith("0 pictures, 0.0 MB in ")
    assert json.loads((tmp_path / "index.json").read_text())["pictures"] == []


# Folders and options


@pytest.mark.parametrize("line", ["[]", "5", '"x"', "{}", '{"trajectory_id": 5', "null"])
def test_a_line_that_is_no_step_keeps_others_from_being_lost(tmp_path, line):
    (tmp_path / "trajectories.jsonl").write_text(f"{line}\n")
    with pytest.raises(HijackError, match=f"^cannot add a trajectory to {tmp_path}: "):
        prepare(tmp_path)
    assert (tmp_path / "trajectories.jsonl").read_text() == f"{line}\n"


def test_a_file_in_the_place_of_the_folder_is_told(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(HijackError, match="cannot add a trajectory to"):
        prepare(tmp_path / "file")


def test_a_step_is_written_with_what_it_was_aimed_at(tmp_path):
    view = RecordedView(np.zeros((30, 40, 3), np.uint8), ((0, 0, 9, 9),))
    episode = EpisodeRecording("note", "Schreib „Ü“", ("mousepad",))
    episode.add(view, Action("click", 3, 4), "pyautogui.click(3, 4)")
    episode.add(view, Action("hotkey", keys=("ctrl", "s")), "pyautogui.hotkey('ctrl', 's')")
    (tmp_path / "trajectories.jsonl").write_text('{"trajectory_id": "note"}\n\n')
    assert save(episode, tmp_path) == "note-2"
    text = (tmp_path / "trajectories.jsonl").read_text(encoding="utf-8")
    old, first, second = map(json.loads, text.splitlines())
    assert old == {"trajectory_id": "note"}
    assert "„Ü“" in text
    assert first == {
        "id": "note-2-00",
        "trajectory_id": "note-2",
        "step": 0,
        "instruction": "Schreib „Ü“",
        "domain": "embedded",
        "apps": ["mousepad"],
        "platform": first["platform"],
        "image": "images/note-2-00.png",
        "action": {"type": "click", "x": 3, "y": 4},
        "action_code": "pyautogui.click(3, 4)",
        "elements": [[0, 0, 9, 9]],
        "target_box": [0, 0, 9, 9],
    }
    assert second["action"] == {"type": "hotkey", "keys": ["ctrl", "s"]}
    assert "target_box" not in second


def test_a_video_needs_a_file_in_a_folder_that_exists(tmp_path):
    for output in (tmp_path, tmp_path / "none/video.mp4"):
        with pytest.raises(ParameterError) as error:
            command.run(RecordOptions(output=output))
        assert str(error.value) == f"-o {output}: the video is a file, in a folder that exists"


def test_words_of_an_option_are_parted_by_commas():
    assert command._split_names(" menu, ,icon,") == ["menu", "icon"]
    assert command._split_names(None) == command._split_names(" , ") == []
