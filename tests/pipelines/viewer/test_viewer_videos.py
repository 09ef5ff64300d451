"""`hijack view --video`: episodes as MP4 files."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hijack_data.cli import main
from hijack_data.errors import MissingDependencyError, ParameterError
from pipelines.viewer.opening import open_source
from pipelines.viewer.runs import RunSource
from pipelines.viewer.runs.video import FRAMES_PER_SECOND, write_videos

from support.runlog import make_run

CLEAN = "write_note__clean__s0__oracle"
OTHER = "write_note__app_minimization__s0__oracle"


def source_of(folder: Path) -> RunSource:
    source = open_source(folder)
    assert isinstance(source, RunSource)
    return source


def test_a_video_shows_what_the_agent_saw(tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="needs the extra [video]")
    run = make_run(tmp_path / "run")
    for k in range(3):  # odd sides, and pictures that differ
        pixels = np.full((199, 321, 3), (80 * k, 40, 200 - 80 * k), np.uint8)
        Image.fromarray(pixels).save(run / "episodes" / CLEAN / "frames" / f"{k:04d}.png")
    videos = write_videos(source_of(run), [CLEAN], tmp_path / "one.mp4")
    assert (videos.files, videos.problems) == ((tmp_path / "one.mp4",), ())
    with av.open(str(tmp_path / "one.mp4")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 3 * FRAMES_PER_SECOND
    assert frames[0].shape == (200, 322, 3)
    for k in range(3):
        middle = frames[k * FRAMES_PER_SECOND][100, 160].astype(int)
        assert abs(middle - (80 * k, 40, 200 - 80 * k)).max() < 8


def test_an_episode_that_lost_a_picture_is_named_and_the_others_are_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("av", reason="needs the extra [video]")
    run = make_run(tmp_path / "run")
    (run / "episodes" / OTHER / "frames" / "0001.seen.png").unlink()
    with pytest.raises(SystemExit) as ended:
        main(["view", str(run), "--video", str(tmp_path / "videos")])
    assert ended.value.code == 1
    assert "0001.seen.png" in capsys.readouterr().err
    assert [file.name for file in (tmp_path / "videos").iterdir()] == [f"{CLEAN}.mp4"]


def test_what_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("av", reason="needs the extra [video]")
    source = source_of(make_run(tmp_path / "run"))
    with pytest.raises(ParameterError, match="2 episodes match"):
        write_videos(source, [], tmp_path / "one.mp4")
    with pytest.raises(ParameterError, match="no episode matches --episode x; ids look like"):
        write_videos(source, ["x"], tmp_path / "videos")
    assert not (tmp_path / "videos").exists()
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingDependencyError, match=r"--video needs av: pip install .*\[video\]"):
        write_videos(source, [], tmp_path / "videos")
