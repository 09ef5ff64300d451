"""Train one network, and count its hits."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from . import data, model
from .pages import Page


@dataclass(frozen=True)
class Settings:
    """Settings of all runs.

    Args:
        steps: steps of the optimiser.
        batch: pages a step.
        rate: highest learning rate; it rises and falls once.
        decay: weight decay.
    """

    steps: int = 1200
    batch: int = 4
    rate: float = 4e-3
    decay: float = 0.02


def train(
    pages: Sequence[Page], names: Sequence[str], seed: int, settings: Settings
) -> tuple[model.Grounder, list[float]]:
    """Return a trained network and the loss of every step.

    The seed decides the first weights and the order of the pages, whatever the corruptions are.

    Args:
        pages: the pages of the training split.
        names: the corruptions that are trained with.
        seed: of the weights, the order and the corruptions.
        settings: settings of all runs.
    """
    torch.manual_seed(seed)
    net = model.Grounder().to(memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(net.parameters(), lr=settings.rate, weight_decay=settings.decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, settings.rate, total_steps=settings.steps, pct_start=0.2
    )
    augment = data.augmentation(names)
    turns = data.order(pages, settings.batch, seed)
    losses: list[float] = []
    for epoch, page_batch in itertools.islice(turns, settings.steps):
        batch = data.batch_of(page_batch, augment, seed=seed, epoch=epoch)
        losses.append(step(net, batch, optimiser))
        schedule.step()
    return net.eval(), losses


def step(net: model.Grounder, batch: data.Batch, optimiser: torch.optim.Optimizer) -> float:
    """Take one step and return the loss."""
    scores = score(net, batch)
    height, width = scores.shape[1:]
    right = model.inside(batch.boxes, (height, width))
    holds = right.flatten(1).any(1)  # a control smaller than a cell may hold no middle of one
    loss = model.loss_of(scores[holds], right[holds])
    optimiser.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
    optimiser.step()
    return loss.item()


def score(net: model.Grounder, batch: data.Batch) -> torch.Tensor:
    """Return the network's scores of a batch, float32; convolutions run in bfloat16."""
    with torch.autocast("cpu", torch.bfloat16):
        return net(batch.pictures, batch.labels, batch.of)


@torch.inference_mode()
def evaluate(net: model.Grounder, pages: Sequence[Page], name: str | None) -> np.ndarray:
    """Return the numbers of controls asked for and hit on each page, int64 `[pages, 2]`."""
    counts = np.zeros((len(pages), 2), np.int64)
    for row, page in zip(counts, pages, strict=True):
        batch = data.corrupted(page, name)
        x, y = model.clicks(score(net, batch)).T
        x1, y1, x2, y2 = batch.boxes.T
        across = (x >= x1) & (x < x2)
        down = (y >= y1) & (y < y2)
        hits = (across & down).sum()
        row[:] = len(batch.labels), int(hits)
    return counts
