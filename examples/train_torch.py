"""Train a tiny Qwen2.5-VL to click, on corrupted screens from a torch DataLoader.

Run it with `python examples/train_torch.py`.

The one line that corrupts is `tr.OneOf(...)`. Everything else is an ordinary input pipeline:
decode, corrupt, the image processor of Qwen2.5-VL, train. Targets follow the pixels, and `to_model`
brings them into the model's own pixels.
"""

import argparse
from typing import Any

import numpy as np
import torch
from PIL import Image
from tiny_qwen import Collate, build
from tiny_vlm import samples
from torch.utils.data import DataLoader, Dataset
from torchvision.transforms.v2.functional import pil_to_tensor

import hijack_data.transforms as tr


class Screens(Dataset):
    """Recorded screens: each item is a sample with its picture `[3, H, W]`."""

    def __init__(self, transform: Any) -> None:
        self.rows, self.transform = samples(), transform

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: int) -> dict[str, Any]:
        row = self.rows[index]
        return self.transform(
            {**row, "image": pil_to_tensor(Image.open(row["path"]).convert("RGB"))}
        )


def main() -> None:
    """Train and print the loss of every epoch."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--epochs", type=int, default=3)
    parser.add_argument("--workers", type=int, default=0)
    options = parser.parse_args()
    torch.manual_seed(0)
    augment = tr.OneOf(
        [tr.PopUps(), tr.Marks(), tr.Subtitle(), tr.Resolution(scale=0.5)],
        seed=7,
        p_clean=0.2,
        label_policy="avoid",
        labels={"path": "leave"},  # of a file, in which numbers may stand
    )
    # Screens of a batch may differ in size: the processor takes a list of them.
    loader = DataLoader(
        Screens(augment),
        batch_size=4,
        shuffle=True,
        num_workers=options.workers,
        collate_fn=Collate(),
    )
    model = build()
    optimiser = torch.optim.AdamW(model.parameters(), lr=5e-3)
    for epoch in range(options.epochs):
        augment.set_epoch(epoch)
        losses = []
        for batch in loader:
            loss = model(**batch).loss
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            losses.append(loss.item())
        print(f"epoch {epoch}: {np.mean(losses):.4f} nats a token of the answer", flush=True)


if __name__ == "__main__":
    main()
