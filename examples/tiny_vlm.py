"""What both training examples share: the recordings as samples, and a Qwen2.5-VL image processor.

The processor is the one of `transformers`, built here without a download, where that is installed; else the same
layout in NumPy. Either way a screen becomes `[patches, 1176]` in the model's order, and `to_model` maps points of the
picture that was given to pixels of the picture that the model sees.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from hijack_data.coords import CoordMap

RECORDINGS = Path(__file__).parent / "recordings"
PATCH, MERGE = 14, 2  # pixels a patch, patches merged into one token along each side
MEAN = np.array([0.48145466, 0.4578275, 0.40821073], np.float32)  # CLIP's, which Qwen2.5-VL uses
STD = np.array([0.26862954, 0.26130258, 0.27577711], np.float32)


def samples(folder: Path = RECORDINGS) -> list[dict[str, Any]]:
    """Return the recorded steps that click on something, as samples without their pictures."""
    rows = [json.loads(line) for line in (folder / "trajectories.jsonl").read_text().splitlines()]
    return [
        {
            "id": row["id"],
            "path": str(folder / row["image"]),
            "instruction": row["instruction"],
            "target": row["target_box"],
            "elements": row["elements"],
        }
        for row in rows
        if "target_box" in row
    ]


class Processor:
    """Turns pictures into patches of at most `max_pixels` pixels; Qwen2.5-VL's own default is 1280 * 28 * 28."""

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
        """Return `[n, 1176]` float32 patches and the centres `[n, 2]` (x, y) of them in 0..1, for `[H, W, 3]` uint8."""
        height, width = self.coords(image.shape[:2]).observation
        if self.theirs is not None:
            out = self.theirs(images=[np.array(image)], return_tensors="np", input_data_format="channels_last")
            patches = np.asarray(out["pixel_values"], np.float32)
            assert tuple(out["image_grid_thw"][0][1:]) == (height // PATCH, width // PATCH)
        else:
            small = np.asarray(Image.fromarray(image).resize((width, height), Image.Resampling.BICUBIC), np.float32)
            patches = in_order(((small / 255 - MEAN) / STD).transpose(2, 0, 1))
            patches = np.repeat(patches[:, :, None], 2, axis=2).reshape(len(patches), -1)  # two frames of a still
        y, x = np.mgrid[0:height, 0:width].astype(np.float32)
        centres = in_order(np.stack([(x + 0.5) / width, (y + 0.5) / height])).mean(axis=-1)
        return patches, centres


def in_order(planes: np.ndarray) -> np.ndarray:
    """Cut `[c, H, W]` into `[n, c, 196]` patches in Qwen's order: the four of a merged token follow each other."""
    c, height, width = planes.shape
    h, w = height // PATCH // MERGE, width // PATCH // MERGE
    cut = planes.reshape(c, h, MERGE, PATCH, w, MERGE, PATCH).transpose(1, 4, 2, 5, 0, 3, 6)
    return cut.reshape(h * w * MERGE * MERGE, c, PATCH * PATCH)
