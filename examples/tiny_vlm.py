"""Helpers of the training examples: the recordings as samples, and a Qwen2.5-VL image processor.

The processor is the one of `transformers`, built without a download, if that is installed;
otherwise the same layout in NumPy. Either way a screen becomes `[patches, 1176]` in the model's
order, and `to_model` maps points of the given picture to pixels of the picture that the model sees.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from hijack_data.coords import CoordMap

RECORDINGS = Path(__file__).parent / "recordings"
PATCH = 14  # pixels along each side of a patch
MERGE = 2  # patches along each side of a token
MEAN = np.array([0.48145466, 0.4578275, 0.40821073], np.float32)  # CLIP's, which Qwen2.5-VL uses
STD = np.array([0.26862954, 0.26130258, 0.27577711], np.float32)


def samples(folder: Path = RECORDINGS) -> list[dict[str, Any]]:
    """Return the recorded steps that click on something, as samples without their pictures."""
    items: list[dict[str, Any]] = []
    for line in (folder / "trajectories.jsonl").read_text().splitlines():
        row = json.loads(line)
        if "target_box" in row:
            sample = {
                "id": row["id"],
                "path": str(folder / row["image"]),
                "instruction": row["instruction"],
                "target": row["target_box"],
                "elements": row["elements"],
            }
            items.append(sample)
    return items


class Processor:
    """Turns pictures into patches.

    Args:
        max_pixels: pixels of the model's picture at most; Qwen2.5-VL's own default is 1280*28*28.
    """

    def __init__(self, max_pixels: int = 128 * 28 * 28) -> None:
        self.max_pixels = max_pixels
        try:
            from transformers import Qwen2VLImageProcessor
        except ImportError:
            self.theirs = None
        else:
            limits = {"shortest_edge": 56 * 56, "longest_edge": max_pixels}
            self.theirs = Qwen2VLImageProcessor(size=limits, do_convert_rgb=False)

    def coords(self, size: tuple[int, int]) -> CoordMap:
        """Return the map from the model's picture (observation) to a picture of `size` (screen)."""
        return CoordMap.model(size, max_pixels=self.max_pixels)

    def to_model(self, point: tuple[float, float], size: tuple[int, int]) -> tuple[int, int]:
        """Map a point of a picture of `size` to the pixels that the model sees."""
        return self.coords(size).to_observation(point)

    def __call__(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the patches of a picture, and their centres.

        Args:
            image: uint8 `[H, W, 3]`.

        Returns:
            float32 `[n, 1176]`, and float32 `[n, 2]` (x, y) in 0..1.
        """
        height, width = self.coords(image.shape[:2]).observation
        if self.theirs is not None:
            patches = self._by_transformers(image, (height // PATCH, width // PATCH))
        else:
            patches = _by_numpy(image, (width, height))
        y, x = np.mgrid[0:height, 0:width].astype(np.float32)
        places = np.stack([(x + 0.5) / width, (y + 0.5) / height])
        return patches, in_order(places).mean(axis=-1)

    def _by_transformers(self, image: np.ndarray, grid: tuple[int, int]) -> np.ndarray:
        pictures = [np.array(image)]
        result = self.theirs(
            images=pictures, return_tensors="np", input_data_format="channels_last"
        )
        _, *theirs = result["image_grid_thw"][0]
        if tuple(theirs) != grid:
            raise ValueError(f"the processor makes {theirs} patches, and not {grid}")
        return np.asarray(result["pixel_values"], np.float32)


def _by_numpy(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return the patches of a picture resized to (width, height), as the processor makes them."""
    resized = Image.fromarray(image).resize(size, Image.Resampling.BICUBIC)
    light = np.asarray(resized, np.float32) / 255
    planes = ((light - MEAN) / STD).transpose(2, 0, 1)
    patches = in_order(planes)
    two_frames = np.repeat(patches[:, :, None], 2, axis=2)  # of a picture that does not move
    return two_frames.reshape(len(patches), -1)


def in_order(planes: np.ndarray) -> np.ndarray:
    """Cut `[c, H, W]` into `[n, c, 196]` patches in Qwen's order, token by token."""
    channels, height, width = planes.shape
    rows = height // PATCH // MERGE
    columns = width // PATCH // MERGE
    cut = planes.reshape(channels, rows, MERGE, PATCH, columns, MERGE, PATCH)
    ordered = cut.transpose(1, 4, 2, 5, 0, 3, 6)
    return ordered.reshape(rows * columns * MERGE * MERGE, channels, PATCH * PATCH)
