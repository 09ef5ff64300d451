"""A tiny asset pack of made-up pictures, for tests of what reads packs."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

SCREEN = (320, 200)
BACKGROUND = (32, 33, 36)


def pixels(number: int, width: int, height: int) -> np.ndarray:
    """A picture of coloured blocks, another for each number; none is of the kind that recordings
    are made of."""
    blocks = np.random.default_rng(1000 + number).integers(
        0, 256, (-(-height // 5), -(-width // 5), 3), dtype=np.uint8
    )
    return np.ascontiguousarray(blocks.repeat(5, axis=0).repeat(5, axis=1)[:height, :width])


def page(width: int, height: int, content: tuple[int, int] = (60, 40)) -> np.ndarray:
    """A plain page with something in the middle of its upper part."""
    out = np.full((height, width, 3), BACKGROUND, np.uint8)
    w, h = content
    out[10 : 10 + h, (width - w) // 2 : (width - w) // 2 + w] = pixels(7, w, h)
    return out


class PackMaker:
    """Writes pictures and, at the end, the index."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.entries: list[dict[str, Any]] = []
        folder.mkdir(parents=True, exist_ok=True)

    def add(self, name: str, kind: str, picture: np.ndarray, **more: Any) -> dict[str, Any]:
        """Add a picture, whole screen unless `screen` says otherwise."""
        Image.fromarray(picture).save(self.folder / f"{name}.webp", lossless=True, exact=True)
        height, width = picture.shape[:2]
        entry = {
            "id": name,
            "file": f"{name}.webp",
            "kind": kind,
            "app": "",
            "screen": [width, height],
            "box": [0, 0, width, height],
            "sha256": hashlib.sha256(picture.tobytes()).hexdigest(),
            "targets": [],
            "recover": None,
            "made_by": "a test",
            **more,
        }
        self.entries.append(entry)
        return entry

    def write(self) -> Path:
        """Write the index."""
        index = {
            "format": "agenthijack-assets",
            "version": 1,
            "desktop": {"date": "2026-01-01"},
            "licence": "made up for tests",
            "pictures": self.entries,
        }
        (self.folder / "index.json").write_text(json.dumps(index))
        return self.folder


def make_pack(folder: Path) -> Path:
    """A pack for screens of 320x200, with what each of the five corruptions needs."""
    pack_maker = PackMaker(folder)
    pack_maker.add("lock-small", "lock_screen", pixels(1, *SCREEN))
    pack_maker.add("lock-large", "lock_screen", pixels(2, 640, 400))
    pack_maker.add(
        "error",
        "error_page",
        pixels(3, *SCREEN),
        app="chromium",
        targets=[{"name": "Reload", "role": "button", "box": [200, 100, 240, 120]}],
    )
    pack_maker.add("view", "error_view", page(400, 260), app="chromium")
    button = {"name": "Editor", "role": "push-button", "box": [20, 180, 80, 200]}
    restore = {"type": "click", "x": 50, "y": 190, "target_box": button["box"]}
    pack_maker.add(
        "desktop", "desktop", pixels(4, *SCREEN), app="chromium", targets=[button], recover=restore
    )
    for number, (app, size) in enumerate(
        [("gimp", (90, 70)), ("thunar", (60, 50)), ("thunar", (120, 150))]
    ):
        entries = {"screen": list(SCREEN), "box": [10, 10, 10 + size[0], 10 + size[1]]}
        pack_maker.add(
            f"{app}-{size[0]}x{size[1]}", "window", pixels(10 + number, *size), app=app, **entries
        )
    corners = np.dstack([pixels(20, 60, 40), np.full((40, 60), 255, np.uint8)])
    corners[0, 0] = corners[0, -1] = 0
    pack_maker.add(
        "menu",
        "menu",
        corners,
        app="chromium",
        screen=list(SCREEN),
        box=[30, 40, 90, 80],
        targets=[{"name": "Open", "role": "menu-item", "box": [2, 2, 58, 18]}],
        recover={"type": "hotkey", "keys": ["esc"]},
        opened_by={"type": "click", "x": 10, "y": -6, "target_box": [0, -22, 50, -2]},
    )
    cancel = {"name": "Cancel", "role": "push-button", "box": [10, 30, 40, 45]}
    close = {"type": "click", "x": 25, "y": 37, "target_box": cancel["box"]}
    pack_maker.add(
        "dialog",
        "dialog",
        pixels(21, 100, 50),
        app="chromium",
        screen=list(SCREEN),
        box=[50, 50, 150, 100],
        targets=[cancel],
        recover=close,
        opened_by={"type": "click", "x": -20, "y": 25, "target_box": [-40, 15, 10, 35]},
    )
    return pack_maker.write()
