"""Batches of pages: order, corruption, labels to ask for, and the network's pictures."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from PIL import Image

import hijack_data as hj

from .pages import Page

SHRINK = 2  # the network sees half the height and width of the screen
# All at the library's defaults (the paper's), but for restore=True, which keeps one shape, and
# fit="shrink": a subtitle of 48 pixels is one pixel too large for the pages.
CORRUPTIONS: Mapping[str, hj.plugin.Corruption] = {
    "pop_ups": hj.PopUps(),
    "marks": hj.Marks(),
    "subtitle": hj.Subtitle(fit="shrink"),
    "resolution": hj.Resolution(restore=True),
}
P_CLEAN = 0.25
# of the corruptions that are evaluated on; training uses the seeds of its runs
EVALUATION_SEED = 2026


@dataclass(frozen=True)
class Batch:
    """The input of the network, and the right answers.

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
    """Return the augmentation that draws one of these corruptions, or none; `None` for no names."""
    if not names:
        return None
    return hj.OneOf([CORRUPTIONS[name] for name in names], p_clean=P_CLEAN)


def order(pages: Sequence[Page], size: int, seed: int) -> Iterator[tuple[int, list[Page]]]:
    """Yield (epoch, `size` pages) for ever.

    The seed alone decides the order, and a page comes at most once an epoch.
    """
    for epoch in itertools.count():
        rng = np.random.default_rng((seed, epoch))
        turn = rng.permutation(len(pages)).tolist()
        for start in range(0, len(turn) - size + 1, size):
            batch = turn[start : start + size]
            yield epoch, [pages[index] for index in batch]


def batch_of(
    pages: Sequence[Page], augment: hj.plugin.Augmentation | None, *, seed: int, epoch: int = 0
) -> Batch:
    """Return a batch that asks for every control of which at least half still shows.

    Args:
        pages: the pages.
        augment: the augmentation that corrupts them, if any.
        seed: seed of its draws.
        epoch: epoch of its draws.
    """
    images = np.stack([page.image for page in pages])
    hidden: list[tuple[int, ...]] = [()] * len(pages)
    if augment is not None:
        result = augment(
            images,
            ids=[page.name for page in pages],
            boxes=[page.boxes for page in pages],
            seed=seed,
            epoch=epoch,
        )
        images = result.image
        hidden = [safety.covered for safety in result.safety]
    labels: list[str] = []
    numbers: list[int] = []
    boxes: list[np.ndarray] = []
    for number, page in enumerate(pages):
        for index in page.asked:
            if index not in hidden[number]:
                labels.append(page.labels[index])
                numbers.append(number)
                boxes.append(page.boxes[index])
    small = np.array(boxes, np.float32).reshape(-1, 4) / SHRINK
    of = torch.tensor(numbers, dtype=torch.int64)
    return Batch(shrunk(images), labels, of, torch.from_numpy(small))


def shrunk(images: np.ndarray) -> torch.Tensor:
    """Return means of 2x2 pixels of `[B, H, W, 3]`, uint8 `[B, 3, H / 2, W / 2]`."""
    small = [np.asarray(Image.fromarray(image).reduce(SHRINK)) for image in images]
    return torch.from_numpy(np.stack(small)).permute(0, 3, 1, 2)


def corrupted(page: Page, name: str | None) -> Batch:
    """Return a page under one corruption (`None`: clean), the same for every network."""
    augment = hj.OneOf([CORRUPTIONS[name]]) if name else None
    return batch_of([page], augment, seed=EVALUATION_SEED)
