"""A full disk, a folder that may not be written to and Ctrl-C end a build cleanly, and it can be
resumed."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
import pipelines.building.step_rows
from pipelines import build, verify

from support.dataset_files import file_contents

ROOT = Path(__file__).resolve().parents[2]
CONFIG = "corruptions:\n  - marks: {number: 4, mark_size: 8}\n  - resolution: {scale: 0.5}\n"
COMMAND = [sys.executable, "-m", "hijack_data.cli", "build"]
LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
from hijack_data.cli import main
main(sys.argv[2:])
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "config.yaml"
    path.write_text(CONFIG)
    return path


@pytest.fixture
def whole(recording: Any, config: Path, tmp_path: Path) -> tuple[Path, dict[str, bytes]]:
    """A source, and the data that an undisturbed build makes of it."""
    source = recording(trajectories=8, steps=4)
    build(source, tmp_path / "whole", config=config)
    return source, file_contents(tmp_path / "whole" / "data")


def temporary_files(out: Path) -> set[str]:
    """Temporary files that were left behind."""
    return {file.name for file in out.rglob("*") if file.name.endswith(".tmp")}


def resumed(source: Path, out: Path, config: Path) -> dict[str, bytes]:
    build(source, out, config=config, resume=True)
    assert verify(out).ok
    return file_contents(out / "data")


def test_files_that_may_not_grow(whole: Any, config: Path, tmp_path: Path) -> None:
    """RLIMIT_FSIZE makes the write fail that a full disk would fail."""
    source, data = whole
    out = tmp_path / "out"
    arguments = ["build", str(source), "--out", str(out), "--config", str(config)]
    limit = str(len(data["train-00000.parquet"]) // 2)
    process = subprocess.run(
        [sys.executable, "-c", LIMITED, limit, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 3
    assert "train-00000.parquet: cannot be written" in process.stderr
    assert "Traceback" not in process.stderr
    assert not out.exists()  # a failed attempt is not in the way of the next
    assert resumed(source, out, config) == data


@pytest.fixture
def small_disk(whole: Any, tmp_path: Path) -> Iterator[Path]:
    """A disk that holds half of the dataset."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if os.geteuid() != 0 or shutil.which("mount") is None:
        pytest.skip("only root can mount a small disk")
    size = f"size={sum(map(len, whole[1].values())) // 2}"
    process = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", size, "tmpfs", folder], capture_output=True, check=False
    )
    if process.returncode:
        pytest.skip(f"a small disk cannot be mounted here: {process.stderr.decode().strip()}")
    yield folder
    subprocess.run(["umount", folder], check=True)


def test_a_disk_that_is_full(small_disk: Path, whole: Any, config: Path) -> None:
    source, data = whole
    out = small_disk / "out"
    command = [*COMMAND, str(source), "--out", str(out), "--config", str(config)]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert process.returncode == 3
    assert "No space left on device" in process.stderr
    assert "Traceback" not in process.stderr
    assert temporary_files(out) == set()
    assert file_contents(out / "data").items() <= data.items()
    subprocess.run(["mount", "-o", "remount,size=50m", small_disk], check=True)
    assert resumed(source, out, config) == data


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """A folder that other users can enter, which pytest's own are not."""
    folder = Path(tempfile.mkdtemp(prefix="agenthijack-"))
    folder.chmod(0o755)
    yield folder
    shutil.rmtree(folder)


UNPRIVILEGED = """
import os, sys
from hijack_data.cli import main
from pipelines import build
source, config, fine, locked = sys.argv[1:]
build(source, fine, config=config)  # imports all that root alone may read
if os.geteuid() == 0:
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
main(["build", source, "--out", locked, "--config", config])
"""


@pytest.mark.parametrize("name", ["locked", "locked/new"])
def test_a_folder_that_may_not_be_written_to(
    name: str, whole: Any, config: Path, open_folder: Path
) -> None:
    shutil.copytree(whole[0], open_folder / "source")
    shutil.copy(config, open_folder / "config.yaml")
    (open_folder / "locked").mkdir(mode=0o555)
    paths = [str(open_folder / part) for part in ("source", "config.yaml", "fine", name)]
    command = [sys.executable, "-c", UNPRIVILEGED, *paths]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert process.returncode == 2, process.stderr
    assert f"{open_folder / name}" in process.stderr
    assert "Permission denied" in process.stderr
    assert "Traceback" not in process.stderr
    assert list((open_folder / "locked").iterdir()) == []


@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c(workers: int, whole: Any, config: Path, tmp_path: Path) -> None:
    source, _ = whole
    options: dict[str, Any] = {"config": config, "rows_per_shard": 1}
    build(source, tmp_path / "cut", **options)
    out = tmp_path / "out"
    script = (
        "import sys\nfrom pipelines import dataset_commands\n"
        "from pipelines.building.build_options import BuildOptions\n"
        "BuildOptions.__init__.__kwdefaults__['rows_per_shard'] = 1\n"
        "if __name__ == '__main__':\n    dataset_commands.build(sys.argv[1:])\n"
    )
    (tmp_path / "run.py").write_text(script)
    command = [
        sys.executable,
        str(tmp_path / "run.py"),
        str(source),
        "--out",
        str(out),
        "--config",
        str(config),
    ]
    process = subprocess.Popen(
        [*command, "--workers", str(workers)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    while (
        process.poll() is None
        and not list(out.glob(".build/[0-9]*.json"))
        and time.monotonic() < deadline
    ):
        time.sleep(0.002)
    os.killpg(process.pid, signal.SIGINT)  # a terminal tells all processes
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "the same command with --resume goes on" in errors
    assert "Traceback" not in errors
    assert temporary_files(out) == set()
    assert 1 <= len(list((out / "data").iterdir())) < 8
    report = build(source, out, **options, resume=True)
    assert report.kept >= 1
    assert file_contents(out / "data") == file_contents(tmp_path / "cut" / "data")


def test_several_corruptions_of_one_screenshot_decode_it_once(
    recording: Any, small: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, calls = pipelines.building.step_rows.decode, []

    def counted(data: bytes, name: str) -> Any:
        calls.append(name)
        return real(data, name)

    monkeypatch.setattr(pipelines.building.step_rows, "decode", counted)
    for output in ("materialised", "lazy"):
        calls.clear()
        planners = {**small, "more": hj.Marks(number=2), "most": hj.Marks(number=3)}
        report = build(
            recording(output), tmp_path / f"out-{output}", corruptions=planners, output=output
        )
        assert report.total == 6 * 7
        assert len(calls) == len(set(calls)) == 6


def test_what_rows_of_a_step_share_is_compressed_once(
    recording: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    """A subtitle leaves most bands of the picture alone: only those that it touches are compressed
    again."""
    import pipelines.dataset.image_codec

    real, bands = pipelines.dataset.image_codec._band, []

    def counted(image: Any, k: int) -> Any:
        bands.append(k)
        return real(image, k)

    monkeypatch.setattr(pipelines.dataset.image_codec, "_band", counted)
    words = {"words": hj.Subtitle(subtitle_text="hello", font_size=12, padding=5)}
    build(recording(trajectories=1, steps=1), tmp_path / "out", corruptions=words)
    assert bands[:9] == list(range(9))
    assert 1 <= len(bands[9:]) <= 3
    assert verify(tmp_path / "out").regenerated == 1
