"""The pictures of the site: each corruption on recorded screenshots, drawn by the library."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from PIL import Image

import hijack_data as hj
from hijack_data.composites import composite, is_bare
from hijack_data.errors import HijackError
from hijack_data.picture_io import load_image

ROOT = Path(__file__).resolve().parents[2]
RECORDED = ROOT / "examples" / "recordings" / "images"
SCREENS = ("notes-04", "rename-03", "multiply-03")
# The screen on which the page of a corruption shows it, and the seed that shows it well.
SHOWN_ON = {"accidental_touch": "rename-03"}
SEED = 3
SEEDS = (1, 2, 3)
WIDE, SMALL = 1280, 640
# What surrounds a screenshot that became smaller.
AROUND = (203, 209, 218)


@dataclass(frozen=True)
class Shot:
    """A recorded screenshot, uint8 RGB `[H, W, 3]`, and what is known of it."""

    name: str
    pixels: np.ndarray
    scene: hj.Scene


def shot(name: str) -> Shot:
    """Read a recorded screenshot, and find its elements."""
    pixels, _ = load_image(RECORDED / f"{name}.png")
    return Shot(name, pixels, hj.scene_from(pixels))


def screen_of(corruption: str) -> str:
    """The name of the screen on which a page shows a corruption."""
    return SHOWN_ON.get(corruption, SCREENS[0])


def corrupted(corruption: hj.plugin.Corruption, screen: Shot, seed: int) -> np.ndarray:
    """What an agent sees, on a canvas as large as the screen: uint8 RGB `[H, W, 3]`."""
    key = {"seed": seed, "sample": screen.name}
    plan = corruption.plan(screen.scene, **key)
    if is_bare(plan):
        plan = composite(plan, screen.pixels, screen.scene, **key).plan
    after = hj.apply(plan, screen.pixels)
    if after.shape == screen.pixels.shape:
        return after
    canvas = np.full_like(screen.pixels, AROUND)
    canvas[: after.shape[0], : after.shape[1]] = after
    return canvas


def save(pixels: np.ndarray, path: Path, width: int) -> None:
    """Write a picture as WebP, `width` pixels wide."""
    height = round(width * pixels.shape[0] / pixels.shape[1])
    picture = Image.fromarray(pixels).resize((width, height), Image.Resampling.LANCZOS)
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.save(path, "WEBP", quality=82, method=4)


def file_name(corruption: str, screen: str, level: int = 3, seed: int = SEED) -> str:
    """The file of a small corrupted picture, below the folder of the pictures."""
    return f"{corruption}/{screen}-level{level}-seed{seed}.webp"


def levels(corruption: str) -> range:
    """The severity levels of a corruption; one without levels is shown as level 3."""
    count = len(type(hj.make_corruption(corruption)).severities)
    return range(1, count + 1) if count else range(3, 4)


def wanted() -> Iterator[tuple[str, str, hj.plugin.Corruption, int, int]]:
    """Yield every corrupted picture of the site.

    Each is its file, the screen, the corruption, the seed and the width in pixels.
    """
    for name in hj.corruption_names()[:9]:
        plain = hj.make_corruption(name)
        yield f"{name}/after.webp", screen_of(name), plain, SEED, WIDE
        for screen, level, seed in product(SCREENS, levels(name), SEEDS):
            result = plain if level == 3 else type(plain).at(level)
            yield file_name(name, screen, level, seed), screen, result, seed, SMALL


def make(folder: Path) -> list[str]:
    """Make all pictures below a folder; returns those that cannot be shown, with the reason.

    A corruption that a screen cannot show leaves the screen out: the gallery says so.
    """
    screens = {name: shot(name) for name in SCREENS}
    for name, screen in screens.items():
        save(screen.pixels, folder / f"{name}.webp", WIDE)
        save(screen.pixels, folder / f"{name}-small.webp", SMALL)
    left_out: list[str] = []
    for file, screen, corruption, seed, width in wanted():
        try:
            pixels = corrupted(corruption, screens[screen], seed)
        except HijackError as error:
            left_out.append(f"{file}: {error}")
            continue
        save(pixels, folder / file, width)
    return left_out
