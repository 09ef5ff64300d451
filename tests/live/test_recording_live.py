"""Recording on a real desktop: pictures with what undoes them, oracles, people, the command."""

import contextlib
import io
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from support import needs

pytest.importorskip("httpx", reason=needs.ONLINE)
pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)

import httpx

from hijack_data.pack import AssetPack
from online_env.errors import DesktopError
from online_env.maintenance.asset_recorder import record_assets
from online_env.maintenance.scenes import UnrecordedScene, desktops, lock_screens, menus
from online_env.maintenance.scenes.apps import APPS, put_files
from online_env.recording.stage import RecordingStage


@pytest.fixture(scope="module")
def stage(embedded_desktop):
    """A desktop with our documents, left by each test as it was."""
    recording_stage = RecordingStage(embedded_desktop)
    put_files(recording_stage)
    return recording_stage


@contextlib.contextmanager
def open_window(stage, name, box):
    """An application's window, closed afterwards."""
    top = next(app for app in APPS if app.name == name).open(stage)
    try:
        yield stage.place(top, box)
    finally:
        stage.close(top)


def test_a_lock_screen_recorded_small(embedded_machine, tmp_path):
    output = []
    assert record_assets(tmp_path, ["lock_screen"], [(600, 800)], output.append) == []
    (asset,) = AssetPack.load(tmp_path).assets
    assert (asset.kind, asset.screen, asset.box) == ("lock_screen", (600, 800), (0, 0, 800, 600))
    assert {target.name for target in asset.targets} == {
        "Password",
        "Unlock",
        "Cancel",
        "Leave Message",
    }
    entry = next(target.box for target in asset.targets if target.name == "Password")
    assert asset.recover.target_box == entry
    assert asset.recover.action.text == "password\n"
    inside = asset.pixels()[entry[1] + 4 : entry[3] - 4, entry[0] + 40 : entry[2] - 40]
    assert (inside == inside[0, 0]).all()  # an empty field
    assert "1 pictures" in output[-1]


def test_a_way_out_that_does_not_work_is_not_recorded(stage, monkeypatch):
    monkeypatch.setattr(lock_screens, "PASSWORD", "wrong")
    (value,) = lock_screens.record(stage)
    assert isinstance(value, UnrecordedScene)
    assert "does not unlock" in value.reason
    monkeypatch.setattr(menus, "CANCEL_NAMES", ())
    monkeypatch.setattr(menus, "ESCAPE", {"type": "hotkey", "keys": ["shift"]})
    before = {top.key for top in stage.top_windows()}
    (value,) = menus._record_clicks(stage, "desktop", None, [(menus.Click("Applications"),)])
    assert "neither its button nor Escape" in value.reason
    stage.run("pyautogui.press('esc')")
    stage.settled()
    assert {top.key for top in stage.top_windows()} == before


def test_a_menu_is_cut_to_its_window_and_escape_closes_it(stage):
    with open_window(stage, "mousepad", menus.CLICKED_WINDOW_BOX) as top:
        (value,) = menus._record_clicks(stage, "mousepad", top, [(menus.Click("File", "menu"),)])
    assert (value.kind, value.app, value.recover) == ("menu", "mousepad", menus.ESCAPE)
    assert {"Open...", "Close Tab"} <= {target.name for target in value.targets}
    x1, y1, x2, y2 = value.box
    assert value.pixels.shape == (y2 - y1, x2 - x1, 3)
    assert y1 <= value.opened_by["y"] + 40
    assert value.opened_by["target_box"][3] <= y1 + 2  # the menu hangs below what was clicked
    assert all(
        x1 <= t.box[0] and t.box[2] <= x2 and y1 <= t.box[1] and t.box[3] <= y2
        for t in value.targets
    )


def test_a_covered_window_is_not_recorded(stage):
    places = (100, 60, 800, 560), (400, 200, 1100, 700)
    with (
        open_window(stage, "mousepad", places[0]) as below,
        open_window(stage, "thunar", places[1]) as above,
    ):
        with pytest.raises(DesktopError, match="covers"):
            stage.cut("window", "mousepad", below, "for a test")
        result = stage.cut("window", "thunar", above, "for a test")
    assert result.pixels.shape[2] == 4  # round corners
    assert result.pixels[0, 0].tolist() == [0, 0, 0, 0]
    assert all(x >= 400 and y >= 200 for x, y, _, _ in (target.box for target in result.targets))


def test_a_desktop_and_the_button_that_brings_the_window_back(stage, monkeypatch):
    monkeypatch.setattr(desktops, "OPEN", (("thunar", "mousepad"),))
    (value,) = desktops.record(stage)
    buttons = {target.name: target.box for target in value.targets}
    button_name = next(name for name in buttons if "Mousepad" in name)
    assert tuple(value.recover["target_box"]) == buttons[button_name]
    assert any("Thunar" in name for name in buttons)
    assert value.app == "mousepad"


def test_an_oracle_is_recorded_and_built(embedded_machine, tmp_path, capsys):
    from online_env.record_command import RecordOptions, run
    from pipelines import build, open_dataset

    notes = tmp_path / "notes"
    options = RecordOptions(output=notes, task="write_note", seed=3, size=(768, 1024))
    assert run(options) == 0
    assert capsys.readouterr().out.startswith("write_note-3: ")
    report = build(tmp_path / "notes", tmp_path / "built", corruptions="marks", seed=1)
    assert report.rejected == 0
    rows = [row for row in open_dataset(tmp_path / "built") if row["corruption"] == "clean"]
    kinds = [row["action"]["type"] for row in rows]
    assert kinds[0] == "click"
    assert kinds[-1] == "done"
    assert {"type", "hotkey"} <= set(kinds)
    x1, y1, x2, y2 = rows[0]["target_box"]
    assert x1 <= rows[0]["action"]["x"] < x2
    assert y1 <= rows[0]["action"]["y"] < y2
    pictures = [np.asarray(row["screenshot"]) for row in rows]
    assert {picture.shape for picture in pictures} == {(768, 1024, 3)}
    typed = kinds.index("type")
    # the text came after its picture
    assert (pictures[typed] != pictures[typed + 1]).any(axis=2).sum() > 200


def test_a_person_is_recorded(stage):
    import threading

    from online_env.recording.person_recorder import PersonViewer
    from online_env.recording.trajectory import EpisodeRecording

    episode = EpisodeRecording("person", "Write hello.", ())
    window = open_window(stage, "mousepad", (300, 200, 1000, 700))
    with window, PersonViewer(stage.desktop, episode, say=lambda text: None) as viewer:
        thread = threading.Thread(target=viewer.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        page = f"http://127.0.0.1:{viewer.server_address[1]}"
        with httpx.Client(
            base_url=page, headers={"X-Token": viewer.token}, trust_env=False, timeout=30
        ) as client:
            spot = {"x": 650, "y": 520, "button": "left"}
            for events in (
                [{"type": "down", **spot}, {"type": "up", **spot}],
                [{"type": "type", "text": "h"}],
                [{"type": "type", "text": "é"}, {"type": "key_down", "key": "enter"}],
            ):
                assert client.post("/input", json={"events": events}).json()["played"] == 1
            assert client.post("/input", json={"events": [{"type": "dance"}]}).status_code == 400
            assert client.post("/input", content=b"{").status_code == 400
            result = client.get("/frame")
        viewer.finish()
        viewer.shutdown()
        thread.join()
        stage.run(
            "pyautogui.hotkey('ctrl', 'z'); pyautogui.hotkey('ctrl', 'z'); pyautogui.hotkey('ctrl',"
            " 'z')"
        )
    assert [code for _, _, code in episode.steps] == [
        "pyautogui.click(650, 520)",
        "pyautogui.write('hé')",
        "pyautogui.press('enter')",
        "DONE",
    ]
    before, after = episode.steps[1][0].frame, episode.steps[2][0].frame
    assert (before != after).any()
    assert any(b[0] <= 650 < b[2] and b[1] <= 520 < b[3] for b in episode.steps[0][0].boxes)
    assert Image.open(io.BytesIO(result.content)).size == (1920, 1080)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--task", "write_note"], "-o is missing"),
        (["--only", "menu"], "--only does not go"),
        (["--assets", "x", "--task", "write_note"], "--task does not go"),
        (["--person", "-o", "x"], "needs either --task"),
        (["--task", "write_not", "-o", "x"], "did you mean 'write_note'"),
        (["--assets", "x", "--sizes", "big"], "WIDTHxHEIGHT"),
    ],
)
def test_options_that_do_not_go_together_are_told(arguments, words, embedded_machine, tmp_path):
    command = [sys.executable, "-m", "hijack_data.cli", "desktop", "record", *arguments]
    process = subprocess.run(
        command, capture_output=True, text=True, timeout=60, check=False, cwd=tmp_path
    )
    assert (process.returncode, words in process.stderr) == (2, True), process.stderr
    assert not list(tmp_path.iterdir())
