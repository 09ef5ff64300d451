"""The network: a small residual net over the picture, and the label as a bag of letters."""

import zlib
from collections.abc import Sequence

import torch
from torch import nn
from torch.nn import functional as F

CELL = 8  # pixels of the network's picture a cell of its map
BUCKETS, WIDTH = 2048, 64


def letters(label: str) -> list[int]:
    """Return the hashed runs of one to three letters of a label, word by word."""
    words = [f"^{word}$" for word in label.lower().split()]
    runs = [word[i : i + n] for word in words for n in (1, 2, 3) for i in range(len(word) - n + 1)]
    return [zlib.crc32(run.encode()) % BUCKETS for run in runs] or [0]


class Residual(nn.Module):
    """Two convolutions, the first of them dilated, added to what came in."""

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
        """Add the block's output: same shape in and out."""
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

    def forward(self, pictures: torch.Tensor, labels: Sequence[str], of: torch.Tensor) -> torch.Tensor:
        """Return the scores of the cells.

        Args:
            pictures: uint8 `[B, 3, H, W]`.
            labels: `Q` labels.
            of: int64 `[Q]`, which picture each label is asked of, rising.

        Returns: float32 `[Q, H / 8, W / 8]`.
        """
        bags = [letters(label) for label in labels]
        starts = torch.tensor([0, *map(len, bags)]).cumsum(0)[:-1]
        runs = torch.tensor([run for bag in bags for run in bag], dtype=torch.int64)
        query = self.query(self.label(runs, starts))
        light = (pictures.float().contiguous(memory_format=torch.channels_last) - 128) / 64
        seen = self.picture(light).float()
        with torch.autocast("cpu", enabled=False):
            each = [torch.tensordot(query[of == n].float(), seen[n], 1) for n in range(len(pictures))]
        return torch.cat(each)


def inside(boxes: torch.Tensor, size: tuple[int, int]) -> torch.Tensor:
    """Return which cells have their middle in a box, bool `[Q, h, w]`; `boxes` `[Q, 4]` are in the network's pixels."""
    y, x = (torch.arange(n) * CELL + CELL / 2 for n in size)
    across = (x >= boxes[:, 0:1]) & (x < boxes[:, 2:3])
    down = (y >= boxes[:, 1:2]) & (y < boxes[:, 3:4])
    return down[:, :, None] & across[:, None, :]


def loss_of(scores: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
    """Minus the log of the probability that falls on the right cells, the mean over labels."""
    flat = scores.flatten(1)
    hit = flat.masked_fill(~right.flatten(1), -torch.inf)
    return (flat.logsumexp(1) - hit.logsumexp(1)).mean()


def clicks(scores: torch.Tensor) -> torch.Tensor:
    """Return the middle of the best cell of each label, `[Q, 2]` (x, y) in the network's pixels."""
    best = scores.flatten(1).argmax(1)
    width = scores.shape[2]
    return torch.stack([best % width, best // width], 1) * CELL + CELL / 2
