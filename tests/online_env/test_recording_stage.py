"""The recorder's view of a desktop, on one whose windows and tree are made up."""

import json
from dataclasses import dataclass, field

import numpy as np
import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)

from click import ClickException

from hijack_data.errors import ParameterError
from hijack_data.types import Action
from online_env import record_command as command
from online_env.desktops.protocol import RunResult
from online_env.errors import DesktopError, DesktopTimeoutError
from online_env.maintenance.scenes import UnrecordedScene, lock_screens, menus
from online_env.record_command import RecordOptions
from online_env.recording import stage as stages
from online_env.recording.captured_picture import ClickTarget
from online_env.recording.stage import RecordingStage, TopWindow, at_point, click, spot, write_code
from online_env.recording.trajectory import (
    EpisodeRecording,
    RecordedView,
    free_name,
    save,
    visible_boxes,
)

SIZE = (300, 400)
SPACE = "https://accessibility.ubuntu.example.org/ns"


def window(number, box, name="geany.Geany", client=0, free=False):
    """A window as `xlook` reports it."""
    return {"id": number, "client": client, "class": name, "box": list(box), "free": free}


def element(role, name, box, states="showing visible enabled"):
    """A node of the accessibility tree."""
    x1, y1, x2, y2 = box
    marks = " ".join(f'st:{state}="true"' for state in states.split())
    position = f'cp:screencoord="({x1}, {y1})" cp:size="({x2 - x1}, {y2 - y1})"'
    return f'<{role} name="{name}" {marks} {position}/>'


def tree(**apps):
    """A tree of applications, by name."""
    spaces = f'xmlns:st="{SPACE}/state" xmlns:cp="{SPACE}/component"'
    rows = "".join(
        f'<application name="{name}">{nodes}</application>' for name, nodes in apps.items()
    )
    return f"<desktop-frame {spaces}>{rows}</desktop-frame>"


@dataclass
class Desktop:
    """A desktop whose pictures come from a list; the last one stays."""

    windows: list = field(default_factory=list)
    holes: list = field(default_factory=list)
    xml: str = field(default_factory=tree)
    frames: list = field(default_factory=lambda: [np.zeros((*SIZE, 3), np.uint8)])
    broken: str = ""
    size = SIZE

    def screenshot(self):
        return self.frames.pop(0) if len(self.frames) > 1 else self.frames[0]

    def accessibility(self):
        return self.xml

    def execute(self, argv, timeout=60):
        if self.broken:
            return RunResult("error", "", self.broken, 1)
        answers = {
            "tops": {"tops": self.windows},
            "shaped": {"holes": self.holes},
            "gone": {"gone": True},
        }
        operation = next((word for word in argv if word in answers), "")
        return RunResult("success", json.dumps(answers.get(operation, {})), "", 0)


@pytest.fixture
def desktop(monkeypatch):
    monkeypatch.setattr(stages, "QUIET_S", 0.02)
    monkeypatch.setattr(stages, "POLL_S", 0.001)
    monkeypatch.setattr(stages, "REMAP_TIMEOUT_S", 0.01)
    return Desktop()


# Windows


def test_windows_off_the_screen_are_left_out(desktop):
    desktop.windows = [
        window(1, (0, 0, 400, 300)),
        window(2, (-50, 0, 0, 30)),
        window(3, (400, 0, 500, 9)),
    ]
    (only,) = RecordingStage(desktop).top_windows()
    assert (only.id, only.key, only.box) == (1, 1, (0, 0, 400, 300))
    desktop.windows = [window(1, (0, 0, 9, 9), client=77)]
    stage = RecordingStage(desktop)
    assert stage.top(77).key == stage.top(1).key == 77
    with pytest.raises(DesktopError, match="window 0x5 is not on the screen any more"):
        stage.top(5)
    desktop.broken = "no display"
    with pytest.raises(DesktopError, match="xlook tops failed in the guest: no display"):
        stage.top_windows()


def test_the_largest_new_window_is_waited_for(desktop):
    stage = RecordingStage(desktop)
    desktop.windows = [
        window(1, (0, 0, 400, 300)),
        window(2, (5, 5, 9, 9)),
        window(3, (5, 5, 90, 90)),
    ]
    assert stage.new({1}, lambda top: True, "menu").id == 3
    with pytest.raises(DesktopTimeoutError, match="no menu came within 0 s"):
        stage.new({1, 2, 3}, lambda top: True, "menu", timeout=0)


def test_the_topmost_window_is_at_a_point():
    tops = [
        TopWindow(1, 0, "a", (0, 0, 100, 100), False),
        TopWindow(2, 0, "b", (50, 50, 200, 200), False),
    ]
    assert [
        at_point(tops, point) and at_point(tops, point).id for point in ((60, 60), (10, 10))
    ] == [2, 1]
    assert at_point(tops, (200, 200)) is None
    assert spot((100, 50, 300, 150), (0.5, 0.25)) == (200, 75)


# Pictures


def test_a_picture_waits_until_the_screen_has_settled(desktop):
    still = np.full((*SIZE, 3), 9, np.uint8)
    moving = [np.full((*SIZE, 3), level, np.uint8) for level in range(5)]
    desktop.frames = [*moving, still]
    assert (RecordingStage(desktop).settled() == 9).all()
    blinking = still.copy()
    blinking[:10, :10] = 0  # a text cursor
    desktop.frames = [still, blinking] * 3 + [still]
    assert RecordingStage(desktop).settled(timeout=5).shape == (*SIZE, 3)
    desktop.frames = [np.full((*SIZE, 3), level % 250, np.uint8) for level in range(9000)]
    with pytest.raises(DesktopTimeoutError, match=r"did not settle within 0\.1 s"):
        RecordingStage(desktop).settled(timeout=0.1)


def test_a_window_is_cut_out_with_its_own_targets(desktop):
    desktop.frames = [np.full((*SIZE, 3), 50, np.uint8)]
    desktop.windows = [
        window(1, (0, 0, 400, 300), "xfdesktop"),
        window(2, (100, 100, 200, 200), client=22),
    ]
    ok = element("push-button", "OK", (110, 110, 150, 130))
    outside = element("push-button", "Far", (10, 10, 50, 30))
    desktop.xml = tree(geany=ok + ok, xfdesktop=outside)
    stage = RecordingStage(desktop)
    picture = stage.cut("window", "geany", stage.top(2), "made up")
    assert picture.pixels.shape == (100, 100, 3)
    assert [target.name for target in picture.targets] == ["OK"]
    assert [target.name for target in stage.launcher_targets()] == ["Far"]
    desktop.holes = [[0, 0, 4], [1, 0, 2]]  # a round corner
    shaped = stage.cut("window", "geany", stage.top(2), "made up").pixels
    assert shaped.shape == (100, 100, 4)
    assert (shaped[..., 3] == 0).sum() == 6


def test_a_window_below_another_is_not_cut_out(desktop):
    desktop.windows = [window(1, (0, 0, 90, 90)), window(2, (50, 50, 99, 99), "thunar")]
    stage = RecordingStage(desktop)
    bottom = stage.top(1)
    with pytest.raises(DesktopError, match=r"thunar at \[50, 50, 99, 99\] covers geany.Geany at"):
        stage.cut("window", "geany", bottom, "made up")
    desktop.windows = []
    with pytest.raises(DesktopError, match="went away before its picture was taken"):
        stage.cut("window", "geany", bottom, "made up")


def test_actions_of_the_pack_are_clicks_in_the_middle():
    target = ClickTarget("OK", "push-button", (10, 20, 30, 41))
    action = click("right_click", target)
    assert action == {"type": "right_click", "x": 20, "y": 30, "target_box": [10, 20, 30, 41]}
    assert write_code(action) == "pyautogui.rightClick(20, 30)"
    assert "esc" in write_code(menus.ESCAPE)


def test_a_failure_of_the_desktop_loses_one_scene_only():
    def pictures():
        yield "one"
        raise DesktopError("the menu is stuck")

    assert list(UnrecordedScene.instead("menus", pictures())) == [
        "one",
        UnrecordedScene("menus", "the menu is stuck"),
    ]


# Scenes


@pytest.mark.parametrize(
    ("roles", "free", "kind"),
    [
        (("menu-item",), True, "menu"),
        ((), True, "menu"),
        (("push-button", "menu-item"), True, "menu"),
        (("push-button",), True, "dialog"),
        (("menu-item",), False, "dialog"),
    ],
)
def test_what_opened_is_a_menu_or_a_dialog(roles, free, kind):
    targets = [ClickTarget("x", role, (0, 0, 1, 1)) for role in roles]
    assert menus._kind(TopWindow(1, 0, "a", (0, 0, 9, 9), free), targets) == kind


def test_a_missing_menu_is_named_with_what_is_there(desktop, monkeypatch):
    monkeypatch.setattr(menus, "OPEN_TIMEOUT_S", 0)
    desktop.windows = [window(1, (0, 0, 400, 300))]
    desktop.xml = tree(geany=element("menu", "File", (10, 10, 40, 20)))
    stage = RecordingStage(desktop)
    top = stage.top(1)
    result = menus._aim(stage, menus.Click("File", "menu"), top)
    assert (result["type"], result["x"], result["y"]) == ("click", 25, 15)
    assert menus._aim(stage, menus.Click(at=(0.5, 0.1)), None) == {
        "type": "click",
        "x": 200,
        "y": 30,
    }
    with pytest.raises(DesktopError, match="there is no menu 'Edit'; there are: menu 'File'"):
        menus._aim(stage, menus.Click("Edit", "menu"), top)


def test_the_password_field_is_the_area_of_one_colour():
    frame = np.zeros((*SIZE, 3), np.uint8)
    dialog = (50, 50, 350, 250)
    x, y = spot(dialog, lock_screens.ENTRY[1])
    frame[y - 12 : y + 12, x - 80 : x + 80] = 255
    entry = lock_screens._entry(frame, dialog)
    assert entry.box == (x - 81, y - 13, x + 81, y + 13)
    with pytest.raises(DesktopError, match="no field for a password"):
        lock_screens._entry(
            frame[:, :, :] * 0 + np.arange(400, dtype=np.uint8)[None, :, None], dialog
        )


# Trajectories


def test_only_elements_that_show_are_boxes(desktop):
    desktop.windows = [
        window(1, (0, 0, 400, 300), "geany.Geany"),
        window(2, (200, 0, 400, 300), "xfdesktop.x"),
    ]
    rows = [
        element("push-button", "seen", (10, 10, 30, 30)),
        element("push-button", "twice", (10, 10, 30, 30)),
        element("push-button", "minimised", (250, 10, 270, 30)),
        element("push-button", "disabled", (40, 10, 60, 30), "showing visible"),
        element("label", "no button", (70, 10, 90, 30)),
        element("entry", "half", (-10, 50, 10, 60)),
    ]
    desktop.xml = tree(geany="".join(rows))
    boxes = visible_boxes(RecordingStage(desktop), desktop.xml)
    assert boxes == ((10, 10, 30, 30), (0, 50, 10, 60))


def test_trajectories_of_one_name_are_numbered(tmp_path):
    view = RecordedView(np.zeros((4, 6, 3), np.uint8), ((0, 0, 4, 4), (1, 1, 3, 3)))
    names = []
    for _ in range(3):
        recording = EpisodeRecording("note", "Write", ("mousepad",))
        recording.add(view, Action("click", 2, 2), "pyautogui.click(2, 2)")
        recording.add(view, Action("done"), "DONE")
        names.append(save(recording, tmp_path))
    assert names == ["note", "note-2", "note-3"]
    assert free_name(tmp_path, "other") == "other"
    rows = [json.loads(line) for line in (tmp_path / "trajectories.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows] == [0, 1] * 3
    assert rows[0]["target_box"] == [1, 1, 3, 3]
    assert "target_box" not in rows[1]
    assert all((tmp_path / row["image"]).is_file() for row in rows)


# The command's options


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"assets": "pack", "task": "write_note"}, "--task does not go with the rest: --assets"),
        ({"assets": "pack", "name": "d1"}, "NAME does not go with the rest"),
        ({"only": "menu"}, "--only does not go with the rest: it is for --assets"),
        ({"instruction": "Do it"}, "--instruction does not go with the rest: it is for --person"),
        ({"task": "write_note", "seconds": 3.0}, "--seconds does not go .* it is for videos"),
        ({"task": "write_note"}, "-o is missing"),
        ({"person": True, "output": "out"}, "needs either --task NAME or --instruction TEXT"),
    ],
)
def test_options_that_do_not_go_together_are_refused(options, words):
    with pytest.raises((ParameterError, ClickException), match=words):
        command.run(RecordOptions(**options))
