"""Parts of the recorder that need no desktop: places, the pack's files, trajectories' files."""

import contextlib
import json

import numpy as np
import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)

from hijack_data.errors import HijackError, UnknownNameError
from hijack_data.pack import FORMAT, VERSION, AssetPack, picture_kinds
from hijack_data.types import Action
from online_env import record_command as command
from online_env.errors import DesktopError
from online_env.maintenance import wallpapers
from online_env.maintenance.asset_pack import AssetPackWriter
from online_env.maintenance.asset_recorder import LARGE, SCENES, SIZES, record_assets
from online_env.maintenance.desktop_looks import GOLDEN, LOOKS
from online_env.maintenance.scenes import parts
from online_env.recording import stage as stages
from online_env.recording.captured_picture import ClickTarget, Picture
from online_env.recording.trajectory import (
    EpisodeRecording,
    RecordedView,
    find_target,
    save,
    saved_at_end,
)

SCREEN = (600, 800)


def picture(kind="menu", box=(100, 50, 160, 90), value=7, **more):
    pixels = np.full((box[3] - box[1], box[2] - box[0], 3), value, np.uint8)
    return Picture(kind, "geany", box, pixels, "made up", **more)


def test_places_are_told_in_pixels_of_the_picture():
    recover = {"type": "click", "x": 110, "y": 60, "target_box": [105, 55, 120, 70]}
    entry = picture(
        targets=[ClickTarget("OK", "push-button", (105, 55, 200, 70))],
        recover=recover,
        opened_by={"type": "right_click", "x": 99, "y": 49},
    ).entry()
    assert entry["box"] == [100, 50, 160, 90]
    assert entry["targets"] == [{"name": "OK", "role": "push-button", "box": [5, 5, 60, 20]}]
    assert entry["recover"] == {"type": "click", "x": 10, "y": 10, "target_box": [5, 5, 20, 20]}
    assert entry["opened_by"] == {"type": "right_click", "x": -1, "y": -1}
    assert picture(recover={"type": "hotkey", "keys": ["esc"]}).entry()["recover"] == {
        "type": "hotkey",
        "keys": ["esc"],
    }


def test_a_pack_is_read_back_pixel_by_pixel(tmp_path):
    pack = AssetPackWriter(tmp_path, {"menu"}, [SCREEN])
    odd = np.random.default_rng(0).integers(0, 256, (40, 60, 4), np.uint8)
    odd[..., 3] = np.where(odd[..., 3] > 99, 255, 0)
    assert pack.add(picture(), SCREEN)["id"] == "menu-geany-60x40-1"
    assert (
        pack.add(Picture("window", "", (0, 0, 60, 40), odd, "made up"), SCREEN)["file"]
        == "window-60x40-1.webp"
    )
    assert pack.add(picture(), SCREEN) is None
    assert pack.add(picture(value=8), SCREEN)["id"] == "menu-geany-60x40-2"
    assert not list(tmp_path.iterdir())
    total = pack.finish({"date": "today"})
    assert total == sum(path.stat().st_size for path in tmp_path.iterdir())
    read = AssetPack.load(tmp_path)
    assert [asset.screen for asset in read.assets] == [SCREEN] * 3
    assert (read.get("menu-geany-60x40-2").pixels() == 8).all()
    assert np.array_equal(read.get("window-60x40-1").pixels(), odd)


def test_only_what_is_recorded_anew_is_replaced(tmp_path):
    first = AssetPackWriter(tmp_path, {"menu", "dialog"}, [SCREEN, (720, 1280)])
    for size in (SCREEN, (720, 1280)):
        first.add(picture(value=size[0] % 251), size)
        first.add(picture("dialog", value=size[0] % 251), size)
    first.finish({})
    again = AssetPackWriter(tmp_path, {"menu"}, [SCREEN])
    assert again.add(picture(box=(0, 0, 9, 9)), SCREEN)["id"] == "menu-geany-9x9-1"
    again.finish({})
    index = json.loads((tmp_path / "index.json").read_text())
    assert [(e["kind"], e["screen"][1], e["box"][2] - e["box"][0]) for e in index["pictures"]] == [
        ("dialog", 600, 60),
        ("dialog", 720, 60),
        ("menu", 720, 60),
        ("menu", 600, 9),
    ]
    assert {p.name for p in tmp_path.glob("*.webp")} == {e["file"] for e in index["pictures"]}


def test_other_looks_stay_where_one_is_recorded_anew(tmp_path):
    first = AssetPackWriter(tmp_path, {"menu"}, [SCREEN], ["golden", "dark"])
    first.add(picture(value=1), SCREEN)
    first.add(picture(value=2), SCREEN, "dark")
    first.finish({})
    again = AssetPackWriter(tmp_path, {"menu"}, [SCREEN], ["dark"])
    assert [entry.get("look") for entry in again.entries] == [None]
    again.add(picture(value=3), SCREEN, "dark")
    again.finish({})
    read = AssetPack.load(tmp_path)
    assert {asset.look: int(asset.pixels()[0, 0, 0]) for asset in read.assets} == {
        "golden": 1,
        "dark": 3,
    }


def test_a_look_that_does_not_exist_is_told_before_anything_starts(tmp_path):
    with pytest.raises(UnknownNameError, match="did you mean 'dark'"):
        record_assets(tmp_path / "new", ["desktop"], looks=["darkk"])
    assert not (tmp_path / "new").exists()
    assert {look.wallpaper for look in LOOKS} <= set(wallpapers.NAMES)


def test_what_was_drawn_over_two_backgrounds_is_known_without_them():
    alpha = np.array([[0, 64, 128, 255]], np.float64) / 255
    colour = np.array([200, 100, 0])
    values = [
        (alpha[..., None] * colour + (1 - alpha[..., None]) * level).round().astype(np.uint8)
        for level in (0, 255)
    ]
    result = parts.matte(*values)
    assert np.abs(result[..., 3] - alpha * 255).max() <= 1
    assert np.abs(result[0, 1:, :3].astype(int) - colour).max() <= 3
    assert not result[0, 0].any()


def test_a_folder_that_is_no_pack_is_left_alone(tmp_path):
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(HijackError, match="no asset pack"):
        AssetPackWriter(tmp_path, {"menu"}, [SCREEN])
    (tmp_path / "index.json").write_text('{"format": "something else", "version": 1}')
    with pytest.raises(HijackError, match="something else"):
        AssetPackWriter(tmp_path, {"menu"}, [SCREEN])
    (tmp_path / "index.json").write_text("[1")
    with pytest.raises(HijackError, match="cannot be read"):
        AssetPackWriter(tmp_path, {"menu"}, [SCREEN])


@pytest.mark.parametrize("name", ["holiday.webp", "photo-800x600-1.webp", "menu-geany.webp"])
def test_pictures_of_somebody_elses_are_never_removed(name, tmp_path):
    (tmp_path / name).write_bytes(b"the only one")
    with pytest.raises(HijackError, match=rf"holds '{name}', but no index.json: it is no asset"):
        AssetPackWriter(tmp_path, {"menu"}, [SCREEN])
    (tmp_path / name).unlink()
    pack = AssetPackWriter(tmp_path, {"menu"}, [SCREEN])
    pack.add(picture(), SCREEN)
    pack.finish({})
    (tmp_path / name).write_bytes(b"the only one")
    AssetPackWriter(tmp_path, {"menu"}, [SCREEN]).finish({})
    assert {path.name for path in tmp_path.iterdir()} == {name, "index.json"}


def test_what_a_recording_left_that_broke_off_is_removed(tmp_path):
    (tmp_path / "window-60x40-1.webp").write_bytes(b"half")
    pack = AssetPackWriter(tmp_path, {"menu"}, [SCREEN])
    pack.add(picture(), SCREEN)
    pack.finish({})
    assert {path.name for path in tmp_path.iterdir()} == {"menu-geany-60x40-1.webp", "index.json"}


@pytest.mark.parametrize("entry", [{}, {"screen": 5}, {"screen": [1, 2], "kind": "menu"}])
def test_an_index_that_lacks_something_is_refused(entry, tmp_path):
    about = {"format": FORMAT, "version": VERSION, "pictures": [entry]}
    (tmp_path / "index.json").write_text(json.dumps(about))
    with pytest.raises(HijackError, match="cannot be read"):
        AssetPackWriter(tmp_path, {"menu"}, [SCREEN])


def test_a_kind_that_does_not_exist_is_told_before_anything_starts(tmp_path):
    with pytest.raises(UnknownNameError, match="did you mean 'lock_screen'"):
        record_assets(tmp_path / "new", ["lock_screens"])
    assert not (tmp_path / "new").exists()
    assert SIZES[0] == (1080, 1920)
    once = ("menu", "icon", "wallpaper")
    assert all(
        record_scene(SIZES[-1], GOLDEN)
        for _, kinds, record_scene in SCENES
        if not kinds.intersection(once)
    )
    assert all(
        record_scene(SIZES[0], GOLDEN) != record_scene(LARGE, GOLDEN)
        for _, _, record_scene in SCENES
    )
    assert frozenset().union(*(kinds for _, kinds, _ in SCENES)) == frozenset(picture_kinds())


def test_what_is_not_window_is_no_part_of_its_picture():
    part = np.full((4, 6, 3), 50, np.uint8)
    assert stages._shaped(part, [], (0, 0, 6, 4), (0, 0, 6, 4)).shape == (4, 6, 3)
    cut = stages._shaped(
        part[1:, 2:], [[0, 0, 6], [1, 0, 3], [3, 5, 6]], (-2, -1, 4, 3), (0, 0, 4, 3)
    )
    assert cut[..., 3].tolist() == [[0, 255, 255, 255], [255] * 4, [255, 255, 255, 0]]
    assert not cut[cut[..., 3] == 0].any()


def test_the_target_is_the_smallest_element_that_was_hit():
    boxes = ((0, 0, 100, 100), (10, 10, 20, 20), (12, 12, 90, 90))
    assert find_target(Action("click", 15, 15), boxes) == (10, 10, 20, 20)
    assert find_target(Action("click", 20, 20), boxes) == (12, 12, 90, 90)
    assert find_target(Action("click", 100, 100), boxes) is None
    assert find_target(Action("type", text="a"), boxes) is None


def test_trajectories_are_added_to_one_folder_and_can_be_read(tmp_path):
    from pipelines.readers import get_reader

    frame = np.random.default_rng(0).integers(0, 256, (60, 80, 3), np.uint8)
    for _ in range(2):
        episode = EpisodeRecording("note-0", "Write it down.", ("mousepad",))
        episode.add(
            RecordedView(frame, ((1, 2, 30, 40),)), Action("click", 5, 6), "pyautogui.click(5, 6)"
        )
        episode.add(RecordedView(frame, ()), Action("done"), "DONE")
        save(episode, tmp_path)
    items = list(get_reader("jsonl").read(tmp_path))
    assert [t.id for t in items] == ["note-0", "note-0-2"]
    assert items[0].apps == ("mousepad",)
    steps = list(items[1].steps)
    assert steps[0].target_box == (1, 2, 30, 40)
    assert [step.action for step in steps] == [Action("click", 5, 6), Action("done")]
    (tmp_path / "trajectories.jsonl").write_text("no json\n")
    with pytest.raises(HijackError, match="cannot add a trajectory"):
        save(episode, tmp_path)


def test_a_text_may_hold_what_some_take_for_the_end_of_a_line(tmp_path):
    from pipelines.readers import get_reader

    frame = np.zeros((60, 80, 3), np.uint8)
    instruction = "Write\u2028this\x85down"
    for _ in range(3):
        episode = EpisodeRecording("note-0", instruction, ("mousepad",))
        episode.add(RecordedView(frame, ()), Action("done"), "DONE")
        save(episode, tmp_path)
    items = list(get_reader("jsonl").read(tmp_path))
    assert [t.instruction for t in items] == [instruction] * 3


def test_what_a_person_did_is_kept_where_the_desktop_ends_before_them(tmp_path):
    output = []
    episode = EpisodeRecording("person", "Write it down.", ())

    def act():
        with saved_at_end(episode, tmp_path, output.append):
            frame = np.zeros((60, 80, 3), np.uint8)
            episode.add(RecordedView(frame, ()), Action("click", 5, 6), "pyautogui.click(5, 6)")
            raise DesktopError("the desktop has ended")

    with pytest.raises(DesktopError, match="has ended"):
        act()
    (line,) = (tmp_path / "trajectories.jsonl").read_text().splitlines()
    assert json.loads(line)["trajectory_id"] == "person"
    assert output == [f"person: 1 steps in {tmp_path}"]
    with saved_at_end(EpisodeRecording("nothing", "", ()), tmp_path / "empty", output.append):
        pass
    assert len(output) == 1


@pytest.mark.parametrize("options", [{"person": True, "instruction": "x"}, {"task": "write_note"}])
def test_a_folder_that_takes_no_trajectory_is_told_before_anybody_acts(
    options, tmp_path, monkeypatch
):
    (tmp_path / "trajectories.jsonl").write_text("no json\n")
    monkeypatch.setattr(command, "_desktop", lambda _: contextlib.nullcontext(None))
    with pytest.raises(HijackError, match="cannot add a trajectory"):
        command.run(command.RecordOptions(output=tmp_path, **options))
