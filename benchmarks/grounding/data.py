"""Batches of pages: their order, their corruption, the labels to ask for, the network's picture."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from PIL import Image

import hijack_data as hj

from .pages import Page

SHRINK = 2  # the network sees half the height and width of the screen
# All at the library's defaults (the paper's), but for restore=True, which keeps one shape, and fit="shrink": a subtitle
# of 48 pixels is one pixel too large for the pages.
CORRUPTIONS: Mapping[str, hj.Corruption] = {
    "pop_ups": hj.PopUps(),
    "marks": hj.Marks(),
    "subtitle": hj.Subtitle(fit="shrink"),
    "resolution": hj.Resolution(restore=True),
}
P_CLEAN = 0.25
EVALUATION_SEED = 2026  # of the corruptions that are evaluated on; training uses the seeds of its runs


@dataclass(frozen=True)
class Batch:
    """What the network is given, and what is right.

    Args:
        pictures: uint8 `[B, 3, h, w]`, shrunk.
        labels: `Q` labels to ask for.
        of: int64 `[Q]`, the picture of each label.
        boxes: float32 `[Q, 4]`, the controls meant, `xyxy` in the network's pixels.
    """

    pictures: torch.Tensor
    labels: list[str]
    of: torch.Tensor
    boxes: torch.Tensor


def augmentation(names: Sequence[str]) -> hj.OneOf | None:
    """Return the augmentation with these corruptions, one of them for each sample or none; `None` for no names."""
    return hj.OneOf([CORRUPTIONS[name] for name in names], p_clean=P_CLEAN) if names else None


def order(pages: Sequence[Page], size: int, seed: int) -> Iterator[tuple[int, list[Page]]]:
    """Give (epoch, `size` pages) for ever; the seed alone decides the order, and a page comes once an epoch at most."""
    epoch = 0
    while True:
        turn = np.random.default_rng((seed, epoch)).permutation(len(pages)).tolist()
        for at in range(0, len(turn) - size + 1, size):
            yield epoch, [pages[i] for i in turn[at : at + size]]
        epoch += 1


def batch_of(pages: Sequence[Page], augment: hj.Augmentation | None, *, seed: int, epoch: int = 0) -> Batch:
    """Corrupt the pages where there is an augmentation, and ask for every control that still shows by half."""
    images = np.stack([page.image for page in pages])
    hidden: list[tuple[int, ...]] = [()] * len(pages)
    if augment is not None:
        made = augment(
            images, ids=[page.name for page in pages], boxes=[page.boxes for page in pages], seed=seed, epoch=epoch
        )
        images, hidden = made.image, [safety.covered for safety in made.safety]
    asked = [(n, i) for n, page in enumerate(pages) for i in page.asked if i not in hidden[n]]
    boxes = np.array([pages[n].boxes[i] for n, i in asked], np.float32).reshape(-1, 4) / SHRINK
    return Batch(
        shrunk(images),
        [pages[n].labels[i] for n, i in asked],
        torch.tensor([n for n, _ in asked], dtype=torch.int64),
        torch.from_numpy(boxes),
    )


def shrunk(images: np.ndarray) -> torch.Tensor:
    """Return what the network sees of `[B, H, W, 3]`: means of 2x2 pixels, uint8 `[B, 3, H / 2, W / 2]`."""
    small = np.stack([np.asarray(Image.fromarray(image).reduce(SHRINK)) for image in images])
    return torch.from_numpy(small).permute(0, 3, 1, 2)


def corrupted(page: Page, name: str | None) -> Batch:
    """Return a page under one corruption (`None`: clean) as the evaluation has it: the same for every network."""
    return batch_of([page], hj.OneOf([CORRUPTIONS[name]]) if name else None, seed=EVALUATION_SEED)
