"""Drawing marks, a subtitle and a pop-up in place, against one hot memcpy in the same run."""

import itertools

import jax.numpy as jnp
import numpy as np
import torch
from common import cell, machine, ratio, screenshot, table, times

import hijack_data as hj

SCENE = hj.Scene(size=(1080, 1920))


def main() -> None:
    """Print the table."""
    torch.set_num_threads(1)
    image, value = screenshot()
    target = image.copy()
    planar = torch.from_numpy(image.copy()).permute(2, 0, 1).contiguous()
    last = torch.from_numpy(image.copy()).permute(2, 0, 1)
    device = jnp.asarray(image)
    rows = []
    for name in ("marks", "subtitle", "pop_ups"):
        spec = hj.make_corruption(name)
        plan = spec.plan(SCENE, seed=7, sample="bench")
        fresh = itertools.count()
        planning = times(lambda s=spec, f=fresh: s.plan(SCENE, seed=7, sample=next(f)), 21)
        works = {
            "memcpy": lambda: np.copyto(target, image),
            "NumPy": lambda p=plan: hj.apply(p, image, inplace=True),
            "torch, channels first": lambda p=plan: hj.apply(p, planar, inplace=True),
            "torch, channels last": lambda p=plan: hj.apply(p, last, inplace=True),
            "JAX (new array)": lambda p=plan: hj.apply(p, device).block_until_ready(),
        }
        # One after the other, so that the memcpy is hot, as the claim says; in turn, each would
        # evict the others.
        entries = {who: times(work) for who, work in works.items()}
        base = entries.pop("memcpy")
        for backend, values in entries.items():
            rows.append(
                [name, backend, cell(values), cell(base), ratio(values, base), cell(planning)]
            )
    print(
        f"1080p uint8, one thread, {value}; milliseconds, min / median / max of 41.\n\n{machine()}\n"
    )
    print(
        table(["corruption", "backend", "draw", "memcpy", "draw / memcpy", "planning, apart"], rows)
    )


if __name__ == "__main__":
    main()
