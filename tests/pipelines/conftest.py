"""Small recordings in our plain format, made by the tests themselves."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj

from support.assets import make_pack
from support.events import with_apps

WIDTH, HEIGHT = 320, 200
Recording = Callable[..., Path]


def picture(number: int, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """A picture of coloured blocks, another for each number."""
    blocks = np.random.default_rng(number).integers(
        0, 256, (height // 10, width // 10, 3), dtype=np.uint8
    )
    return blocks.repeat(10, axis=0).repeat(10, axis=1)


def line(trajectory: str, step: int, **changes: Any) -> dict[str, Any]:
    """One line of a recording: a click at (100 + step, 50) on a known box.

    Another action has no code, unless it is given.
    """
    record = {
        "trajectory_id": trajectory,
        "step": step,
        "instruction": f"do {trajectory}",
        "image": f"images/{trajectory}-{step}.png",
        "action": {"type": "click", "x": 100 + step, "y": 50},
        "action_code": "" if "action" in changes else f"pyautogui.click({100 + step}, 50)",
        "target_box": [90, 40, 130, 60],
        "elements": [[90, 40, 130, 60], [10, 10, 60, 30]],
        "domain": "tests",
        "platform": "linux-xfce",
    }
    return {**record, **changes}


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    """Make a recording: `recording("name", trajectories=2, steps=3)` returns its folder."""

    def make(name: str = "source", trajectories: int = 2, steps: int = 3) -> Path:
        return record(tmp_path / name, trajectories, steps)

    return make


def record(folder: Path, trajectories: int = 2, steps: int = 3) -> Path:
    """Make a recording in a folder."""
    (folder / "images").mkdir(parents=True)
    rows = [line(f"t{t}", s) for t in range(trajectories) for s in range(steps)]
    for number, row in enumerate(rows):
        Image.fromarray(picture(number)).save(folder / row["image"])
    (folder / "trajectories.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    return folder


@pytest.fixture(scope="session")
def pictures() -> Callable[[Path], Path]:
    """Make the recording of `recording` in a folder that several tests share."""
    return record


@pytest.fixture
def add_line() -> Callable[[Path, Any], None]:
    """Append a record (or raw bytes) to a recording."""

    def add(folder: Path, record: Any) -> None:
        data = record if isinstance(record, bytes) else json.dumps(record).encode()
        with (folder / "trajectories.jsonl").open("ab") as file:
            file.write(data + b"\n")

    return add


@pytest.fixture
def good_line() -> Callable[..., dict[str, Any]]:
    """Make one line; see `line`."""
    return line


@pytest.fixture(scope="session")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tiny asset pack."""
    return make_pack(tmp_path_factory.mktemp("assets") / "pack")


@pytest.fixture
def small() -> dict[str, Any]:
    """Corruptions that fit the small pictures."""
    return {
        "pop_ups": hj.PopUps(width=150, height=90, avoid_elements=False),
        "resolution": hj.Resolution(scale=0.5),
        "marks": hj.Marks(number=4, mark_size=8),
        "subtitle": hj.Subtitle(subtitle_text="hello", font_size=12, padding=5),
    }


@pytest.fixture
def browsing(recording: Any) -> Path:
    """Two recordings of five steps in a browser."""
    return with_apps(recording(trajectories=2, steps=5), ["chrome"])


@pytest.fixture
def nine(small: Any) -> dict[str, Any]:
    """All nine, those of the picture as they fit the small screens."""
    return {
        name: small.get(name, None) or hj.make_corruption(name) for name in hj.corruption_names()
    }
