"""Train the same tiny click model in JAX with a Grain loader, without TensorFlow.

Run it with `python examples/train_grain.py`. The one line that corrupts is `.map(hg.Corrupt(...))`.
It runs on the host, in the loader's threads, so that the device only sees finished batches of one
shape and nothing is compiled twice.
"""

import argparse
from typing import Any

import grain.python as grain
import jax
import jax.numpy as jnp
import numpy as np
from PIL import Image
from tiny_vlm import Processor, samples

import hijack_data as hj
import hijack_data.grain as hg

PROCESSOR = Processor()


def decode(row: dict[str, Any]) -> dict[str, Any]:
    """Read the screenshot of a sample."""
    return {**row, "image": np.asarray(Image.open(row["path"]).convert("RGB"))}


def process(row: dict[str, Any]) -> dict[str, np.ndarray]:
    """Turn a sample into the model's input, with the point in 0..1 of the model's picture."""
    size = row["image"].shape[:2]
    patches, centres = PROCESSOR(row["image"])
    x1, y1, x2, y2 = row["target"]
    middle = ((x1 + x2) / 2, (y1 + y2) / 2)
    height, width = PROCESSOR.coords(size).observation
    point = np.array(PROCESSOR.to_model(middle, size), np.float32)
    return {"patches": patches, "centres": centres, "point": point / (width, height)}


def loader(epochs: int, seed: int = 7) -> grain.IterDataset:
    """Decode, corrupt, process and batch, shuffled anew in each epoch."""
    rows = samples()
    resolution = hj.Resolution(scale=0.5, restore=True)
    corrupt = hj.OneOf([hj.PopUps(), hj.Marks(), hj.Subtitle(), resolution], p_clean=0.2)
    dataset = grain.MapDataset.source(rows).shuffle(seed=seed).repeat(epochs)
    dataset = dataset.map_with_index(lambda i, row: {**row, "epoch": i // len(rows)})
    dataset = dataset.map(decode)
    dataset = dataset.map(hg.Corrupt(corrupt, seed=seed, label_policy="avoid"))
    dataset = dataset.map(process)
    stream = dataset.to_iter_dataset(grain.ReadOptions(num_threads=2))
    return stream.batch(4, drop_remainder=True)


def loss_of(params: dict[str, Any], batch: dict[str, Any]) -> Any:
    """Return the mean distance of the predicted points.

    Every patch is scored; the mean of their centres under the softmax is the click.
    """
    calls = jnp.concatenate([batch["patches"], batch["centres"]], axis=-1)
    hidden = jax.nn.gelu(calls @ params["in"])
    weights = jax.nn.softmax(hidden @ params["out"], axis=1)
    point = (weights * batch["centres"]).sum(axis=1)
    return jnp.abs(point - batch["point"]).mean()


@jax.jit
def step(params: dict[str, Any], batch: dict[str, Any]) -> tuple[Any, Any]:
    """Return new parameters after one step of gradient descent, and the loss."""
    loss, slope = jax.value_and_grad(loss_of)(params, batch)
    return jax.tree.map(lambda p, g: p - 0.05 * g, params, slope), loss


def main() -> None:
    """Train and print the loss, and how often the step was compiled."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--epochs", type=int, default=3)
    options = parser.parse_args()
    key = jax.random.key(0)
    params = {
        "in": 0.02 * jax.random.normal(key, (1178, 32)),
        "out": 0.02 * jax.random.normal(key, (32, 1)),
    }
    losses = []
    for batch in loader(options.epochs):
        arrays = {name: jnp.asarray(value, jnp.float32) for name, value in batch.items()}
        params, loss = step(params, arrays)
        losses.append(float(loss))
    half = len(losses) // 2
    first = np.mean(losses[:half])
    second = np.mean(losses[half:])
    print(f"{len(losses)} steps: mean distance {first:.4f}, then {second:.4f}")
    print(f"compiled {step._cache_size()} time")


if __name__ == "__main__":
    main()
