"""Resizing 1080p: ours against torch's uint8 antialiased bicubic and Pillow, bytes compared."""

import numpy as np
import torch
from common import cell, interleaved, machine, ratio, screenshot, table
from PIL import Image
from torch.nn.functional import interpolate

import hijack_data as hj

SCALES = (0.25, 0.5, 0.75, 2.0)
HEADER = ("scale", "who", "time", "against torch, same layout", "bytes that differ from Pillow")


def peers(image: np.ndarray, size: tuple[int, int]) -> dict:
    """Return the works to compare; each returns its picture as [h, w, 3] or [3, h, w]."""
    plan = hj.Plan("bench-v1", image.shape[:2], ops=(hj.plugin.Resample(size),))
    picture = Image.fromarray(image)
    last = torch.from_numpy(image.copy()).permute(2, 0, 1)
    planar = last.contiguous()
    options = {"size": size, "mode": "bicubic", "antialias": True}
    return {
        "torch interpolate, channels last": lambda: interpolate(last[None], **options)[0],
        "torch interpolate, channels first": lambda: interpolate(planar[None], **options)[0],
        "Pillow (picture in memory)": lambda: picture.resize(size[::-1], Image.Resampling.BICUBIC),
        "ours, NumPy": lambda: hj.apply(plan, image),
        "ours, torch channels last": lambda: hj.apply(plan, last),
        "ours, torch channels first": lambda: hj.apply(plan, planar),
    }


def as_array(out) -> np.ndarray:
    """Return any result as [h, w, 3]."""
    if isinstance(out, torch.Tensor):
        return out.permute(1, 2, 0).numpy()
    return np.asarray(out)


def compared(image: np.ndarray, scale: float) -> list[list[str]]:
    """Return the lines of one scale."""
    size = (int(1080 * scale), int(1920 * scale))
    works = peers(image, size)
    picture = Image.fromarray(image)
    exact = np.asarray(picture.resize(size[::-1], Image.Resampling.BICUBIC))
    result = interleaved(works, 15)
    rows: list[list[str]] = []
    for name, values in result.items():
        layout = "first" if "first" in name else "last"
        base = result[f"torch interpolate, channels {layout}"]
        differs = as_array(works[name]()) != exact
        wrong = str(int(differs.sum()))
        rows.append([f"{scale:g}", name, cell(values), ratio(values, base), wrong])
    return rows


def main() -> None:
    """Print the table."""
    torch.set_num_threads(1)
    image, value = screenshot()
    rows: list[list[str]] = []
    for scale in SCALES:
        rows += compared(image, scale)
    print(f"1080p uint8, one thread, {value}; milliseconds, min / median / max of 15.\n")
    print(f"{machine()}\n")
    print(table(HEADER, rows))


if __name__ == "__main__":
    main()
