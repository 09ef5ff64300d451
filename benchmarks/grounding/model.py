"""The network: a small residual net over the picture, and the label as a bag of letters."""

import itertools
import zlib
from collections.abc import Sequence

import torch
from torch import nn
from torch.nn import functional as F

CELL = 8  # pixels of the network's picture in a cell of its map
BUCKETS = 2048
WIDTH = 64


def letters(label: str) -> list[int]:
    """Return the hashed runs of one to three letters of a label, word by word."""
    hashes: list[int] = []
    for word in label.lower().split():
        marked = f"^{word}$"
        for length in (1, 2, 3):
            for start in range(len(marked) - length + 1):
                run = marked[start : start + length]
                hashes.append(zlib.crc32(run.encode()) % BUCKETS)
    return hashes or [0]


class Residual(nn.Module):
    """Two convolutions, the first of them dilated, added to their input."""

    def __init__(self, width: int, dilation: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(width, width, 3, padding=dilation, dilation=dilation, bias=False),
            nn.BatchNorm2d(width),
            nn.ReLU(inplace=True),
            nn.Conv2d(width, width, 1, bias=False),
            nn.BatchNorm2d(width),
        )

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the input plus the block's output, `[B, width, H, W]`."""
        return F.relu(x + self.body(x))


class Grounder(nn.Module):
    """Scores every cell of a picture for every label."""

    def __init__(self, width: int = WIDTH, dilations: Sequence[int] = (1, 2, 1, 4, 1, 2)) -> None:
        super().__init__()
        self.picture = nn.Sequential(
            nn.PixelUnshuffle(4),
            nn.Conv2d(48, 32, 3, padding=1, bias=False),
            nn.BatchNorm2d(32),
            nn.ReLU(inplace=True),
            nn.Conv2d(32, width, 3, padding=1, stride=2, bias=False),
            nn.BatchNorm2d(width),
            nn.ReLU(inplace=True),
            *(Residual(width, dilation) for dilation in dilations),
            nn.Conv2d(width, WIDTH, 1),
        )
        self.label = nn.EmbeddingBag(BUCKETS, WIDTH, mode="mean")
        self.query = nn.Sequential(nn.Linear(WIDTH, WIDTH), nn.ReLU(), nn.Linear(WIDTH, WIDTH))

    def forward(
        self, pictures: torch.Tensor, labels: Sequence[str], of: torch.Tensor
    ) -> torch.Tensor:
        """Return the scores of the cells.

        Args:
            pictures: uint8 `[B, 3, H, W]`.
            labels: `Q` labels.
            of: int64 `[Q]`, the picture of each label, rising.

        Returns:
            float32 `[Q, H / 8, W / 8]`.
        """
        query = self._query(labels)
        pixels = pictures.float().contiguous(memory_format=torch.channels_last)
        calls = self.picture((pixels - 128) / 64).float()
        scores: list[torch.Tensor] = []
        with torch.autocast("cpu", enabled=False):
            for number in range(len(pictures)):
                requests = query[of == number].float()
                scores.append(torch.tensordot(requests, calls[number], 1))
        return torch.cat(scores)

    def _query(self, labels: Sequence[str]) -> torch.Tensor:
        """Return the embeddings of the labels, `[Q, WIDTH]`."""
        bags = [letters(label) for label in labels]
        starts = torch.tensor([0, *map(len, bags)]).cumsum(0)[:-1]
        runs = torch.tensor(list(itertools.chain(*bags)), dtype=torch.int64)
        return self.query(self.label(runs, starts))


def inside(boxes: torch.Tensor, size: tuple[int, int]) -> torch.Tensor:
    """Return which cells have their middle in a box, bool `[Q, h, w]`.

    Args:
        boxes: float32 `[Q, 4]`, `xyxy` in the network's pixels.
        size: (h, w), the cells of the map.
    """
    x1, y1, x2, y2 = boxes.split(1, dim=1)
    y = _middles(size[0])
    x = _middles(size[1])
    across = (x >= x1) & (x < x2)
    down = (y >= y1) & (y < y2)
    return down[:, :, None] & across[:, None, :]


def _middles(count: int) -> torch.Tensor:
    return torch.arange(count) * CELL + CELL / 2


def loss_of(scores: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
    """Return the mean over labels of minus the log probability of the right cells."""
    flat = scores.flatten(1)
    wrong = ~right.flatten(1)
    hit = flat.masked_fill(wrong, -torch.inf)
    losses = flat.logsumexp(1) - hit.logsumexp(1)
    return losses.mean()


def clicks(scores: torch.Tensor) -> torch.Tensor:
    """Return the middle of the best cell of each label, `[Q, 2]` (x, y) in the network's pixels."""
    best = scores.flatten(1).argmax(1)
    width = scores.shape[2]
    cells = torch.stack([best % width, best // width], 1)
    return cells * CELL + CELL / 2
