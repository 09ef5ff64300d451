"""Training-time augmentation: ours beside the peers, in batches, a DataLoader and JAX.

    python benchmarks/augment.py [--peers FOLDER]

The peers live in an environment of their own, made on first use (`make_peers`, a minute or two) in
`--peers`, by default `~/.cache/agenthijack/peers`. One thread, 1080p uint8, milliseconds. Each
process also times a memcpy of the same picture, and where two works are compared they take turns.
The peers run again with two threads.
"""

import argparse
import itertools
import json
import os
import subprocess
import sys
import tempfile
import venv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import torch
import torchvision
from common import SHARED, cell, interleaved, machine, screenshot, table, times
from PIL import Image
from torch.utils.data import DataLoader, Dataset
from torchvision.transforms import v2

import hijack_data as hj
import hijack_data.transforms as tr
from hijack_data.jax_plans import Packer, apply_arrays
from hijack_data.kernels import jax_ops as jax_kernels
from hijack_data.safety import judge

HERE = Path(__file__).parent
FONT = HERE.parent / "hijack_data" / "fonts" / "DejaVuSansMono-Bold.ttf"
PACKAGES = (
    "numpy",
    "pillow",
    "opencv-python-headless",
    "albumentations",
    "augly",
    "kornia",
    "imgaug",
)
SCENE = hj.Scene(size=(1080, 1920))
SPECS = {
    "marks": hj.Marks(),
    "subtitle": hj.Subtitle(),
    "pop_up": hj.PopUps(),
    "resolution": hj.Resolution(),
}
OVERLAYS = [hj.PopUps(), hj.Marks(), hj.Subtitle()]
BATCH = 16


def ratio(values: Sequence[float], base: Sequence[float]) -> str:
    """Fastest over fastest: other programs on a shared machine only ever add time."""
    return f"{min(values) / min(base):.2f}x"


def make_peers(folder: Path) -> Path:
    """Make the peers' environment unless it is there, and return its Python."""
    python = folder / "bin" / "python"
    if not python.exists():
        print(f"installing the peers into {folder} ...", file=sys.stderr)
        venv.create(folder, with_pip=True)
        subprocess.run(
            [python, "-m", "pip", "install", "--quiet", *PACKAGES], check=True, stdout=sys.stderr
        )
    return python


def peer_rows(python: Path, image: np.ndarray, ours: dict[str, float]) -> list[list[str]]:
    """Run the peers with one thread and with two, and return table rows."""
    with tempfile.TemporaryDirectory() as folder:
        np.save(f"{folder}/image.npy", image)
        value, two = (_peers(python, f"{folder}/image.npy", threads) for threads in (1, 2))
    rows = []
    for name, peer in value.items():
        if "error" in peer:
            rows.append([name, "", "does not import", peer["error"], "", "", ""])
        for work, result in peer["works"].items():
            label = f"{name} {peer['version']}"
            if "error" in result:
                rows.append([label, work, "fails", result["error"], "", "", ""])
                continue
            against = f"{min(result['times']) / ours[work.split(' ')[0]]:.1f}x"
            pair = cell(two[name]["works"][work]["times"])
            rows.append(
                [
                    label,
                    work,
                    cell(result["times"]),
                    ratio(result["times"], result["memcpy"]),
                    against,
                    pair,
                    "",
                ]
            )
    return rows


def _peers(python: Path, picture: str, threads: int) -> dict[str, Any]:
    env = {**os.environ, "OMP_NUM_THREADS": str(threads)}
    command = [python, HERE / "peers.py", picture, FONT, str(threads)]
    return json.loads(
        subprocess.run(command, capture_output=True, text=True, check=True, env=env).stdout
    )


def our_rows(image: np.ndarray) -> tuple[list[list[str]], dict[str, float]]:
    """Plan and apply to a new picture, each time with a new id."""
    rows = []
    best = {}
    target = image.copy()
    planar = torch.from_numpy(image.copy()).permute(2, 0, 1).contiguous()
    half = v2.Resize((540, 960), v2.InterpolationMode.BICUBIC, antialias=True)
    for name, spec in SPECS.items():
        fresh = itertools.count()

        def new(s: Any = spec, f: Any = fresh) -> Any:
            return hj.apply(s.plan(SCENE, seed=1, sample=next(f)), image)

        def inside(s: Any = spec, f: Any = fresh) -> Any:
            return hj.apply(s.plan(SCENE, seed=1, sample=next(f)), target, inplace=True)

        works: dict[str, Callable[[], object]] = {
            "memcpy": lambda: np.copyto(target, image),
            "new picture": new,
        }
        works.update({"in place": inside} if name != "resolution" else {})
        result = interleaved(works, 21)
        base, best[name] = result.pop("memcpy"), min(result["new picture"])
        planning = times(lambda s=spec, f=fresh: s.plan(SCENE, seed=1, sample=next(f)), 31)
        rows += [
            [f"ours, {how}", name, cell(t), ratio(t, base), "", "", cell(planning)]
            for how, t in result.items()
        ]
    resize = interleaved(
        {"memcpy": lambda: np.copyto(target, image), "v2": lambda: half(planar)}, 15
    )
    against = f"{min(resize['v2']) / best['resolution']:.1f}x"
    torch.set_num_threads(2)
    pair = cell(times(lambda: half(planar), 15))
    torch.set_num_threads(1)
    beside = [cell(resize["v2"]), ratio(resize["v2"], resize["memcpy"]), against, pair, ""]
    return [*rows, [f"torchvision {torchvision.__version__}", "resolution", *beside]], best


def one_batch(aug: hj.OneOf, number: int, pictures: Any, copy: Callable[[], object]) -> list[float]:
    """Milliseconds to copy a batch, plan for it, apply the plans and judge the labels."""
    keys = [f"{number}-{i}" for i in range(BATCH)]
    out = []
    (copied,) = times(copy, 1, warmup=1)
    plans: list[hj.Plan] = []
    (planning_times,) = times(
        lambda: plans.extend(aug.plan(SCENE, seed=1, sample=key) for key in keys), 1, warmup=0
    )
    (applied,) = times(lambda: out.append(hj.apply(plans, pictures)), 1, warmup=0)
    pairs = list(zip(plans, pictures, out[0], strict=True))
    (judged,) = times(lambda: [judge(p, a, b, target=(9, 9)) for p, a, b in pairs], 1, warmup=0)
    return [copied, planning_times, applied, judged]


def batch_rows(image: np.ndarray) -> list[list[str]]:
    """Batches of 16, a random corruption each, out of place, against a plain copy."""
    batch = np.stack([image] * BATCH)
    kinds = {
        "NumPy": (batch, batch.copy),
        "torch, channels first": (
            (first := torch.from_numpy(batch).permute(0, 3, 1, 2).contiguous()),
            first.clone,
        ),
        "torch, channels last": ((last := torch.from_numpy(batch).permute(0, 3, 1, 2)), last.clone),
    }
    rows = []
    for mix, options in {
        "pop_ups, marks, subtitle": OVERLAYS,
        "the same and resolution": [*OVERLAYS, hj.Resolution()],
    }.items():
        aug = hj.OneOf(options)
        fresh = itertools.count()
        for kind, (pictures, copy) in kinds.items():
            values = [one_batch(aug, next(fresh), pictures, copy) for _ in range(9)]
            base, plan, apply, safety = ([row[i] for row in values] for i in range(4))
            totals = [a + j for a, j in zip(apply, safety, strict=True)]
            rows.append(
                [
                    mix,
                    kind,
                    cell(base),
                    cell(plan),
                    cell(apply),
                    ratio(apply, base),
                    cell(safety),
                    ratio(totals, base),
                ]
            )
    return rows


class Screens(Dataset):
    """Recorded screens, decoded on each access."""

    def __init__(self, transform: Any) -> None:
        paths = sorted(SHARED.glob("*.png")) or sorted(
            (HERE.parent / "examples" / "recordings").rglob("*.png")
        )
        self.paths = paths[:12]
        self.transform = transform

    def __len__(self) -> int:
        return 24

    def __getitem__(self, i: int) -> Any:
        image = v2.functional.pil_to_tensor(
            Image.open(self.paths[i % len(self.paths)]).convert("RGB")
        )
        return self.transform({"image": image, "id": i, "target": (50, 50)})["image"].shape


def same(sample: Any) -> Any:
    """No augmentation."""
    return sample


def loader_rows() -> list[list[str]]:
    """A DataLoader that decodes PNG screens, with and without a random corruption."""
    options = [
        tr.PopUps(avoid_elements=True),
        tr.Marks(),
        hj.Subtitle(fit="shrink"),
        tr.Resolution(scale=0.5),
    ]
    rows = []
    for workers in (0, 1):
        loaders = {
            name: DataLoader(
                Screens(transform),
                batch_size=4,
                num_workers=workers,
                collate_fn=list,
                persistent_workers=workers > 0,
            )
            for name, transform in {
                "decode only": same,
                "decode and corrupt": tr.OneOf(options, seed=1),
            }.items()
        }
        result = interleaved(
            {name: lambda x=loader: list(x) for name, loader in loaders.items()}, 5
        )
        base = result["decode only"]
        rows += [
            [str(workers), name, cell([t / 24 for t in values]), ratio(values, base)]
            for name, values in result.items()
        ]
    return rows


def jax_rows(image: np.ndarray) -> list[list[str]]:
    """Overlays and resizing on a JAX array, a new plan each time, against a copy on the device."""
    device = jnp.asarray(image)
    rows = []
    copy = jax.jit(lambda x: x + jnp.uint8(0) if x.ndim == 0 else jnp.copy(x))
    for name, spec in SPECS.items():
        fresh = itertools.count()
        plans = [spec.plan(SCENE, seed=1, sample=next(fresh)) for _ in range(60)]
        for plan in plans:
            hj.apply(plan, device)
        before = jax_kernels.compilations()
        turn = itertools.cycle(plans)
        result = interleaved(
            {
                "copy": lambda: copy(device).block_until_ready(),
                "apply": lambda t=turn: hj.apply(next(t), device).block_until_ready(),
            },
            21,
        )
        compiled = jax_kernels.compilations() - before
        rows.append(
            [
                name,
                cell(result["apply"]),
                cell(result["copy"]),
                ratio(result["apply"], result["copy"]),
                str(compiled),
            ]
        )
    return rows


def jit_rows(image: np.ndarray) -> list[list[str]]:
    """A batch inside a jitted program, the plans as arguments, against a copy."""
    batch = jnp.stack([jnp.asarray(image)] * BATCH)
    rows = []
    copy = jax.jit(jnp.copy)
    for mix, options in {
        "pop_ups, marks, subtitle": OVERLAYS,
        "the same and resolution": [*OVERLAYS, hj.Resolution(restore=True)],
    }.items():
        aug = hj.OneOf(options)
        packer = Packer(SCENE.size)
        program = jax.jit(lambda plans, images: apply_arrays(plans, images))
        for n in range(8):  # so that the buckets are as large as they get
            packer.pack([aug.plan(SCENE, seed=1, sample=f"{n}-{i}") for i in range(BATCH)])
        packed = [
            packer.pack([aug.plan(SCENE, seed=1, sample=f"{n}-{i}") for i in range(BATCH)])
            for n in range(8)
        ]
        turn = itertools.cycle(packed)
        works = {
            "copy": lambda: copy(batch).block_until_ready(),
            "jit": lambda p=program, t=turn: p(next(t), batch).block_until_ready(),
        }
        result = interleaved(works, 9)
        rows.append(
            [mix, cell(result["jit"]), cell(result["copy"]), ratio(result["jit"], result["copy"])]
        )
    return rows


def compile_counts() -> tuple[int, int]:
    """Programs compiled for 100 and for 1000 random batches of small pictures."""
    size = (216, 384)
    counts = []
    words = {"window_string": "go", "prefix_string": "", "suffix_string": ""}
    options = [
        hj.PopUps(width=200, height=120, size="uniform", **words),
        *(hj.Marks(number=n, mark_size=5) for n in (5, 20)),
        hj.Resolution(restore=True),
    ]
    aug, packer, images = (
        hj.OneOf(options, p_clean=0.1),
        Packer(size),
        jnp.zeros((4, *size, 3), jnp.uint8),
    )
    program = jax.jit(lambda plans, images: apply_arrays(plans, images))
    for n in range(1000):
        text = hj.Subtitle(subtitle_text=f"sample {n * 7919}", font_size=8 + n % 9, fit="shrink")
        plans = [
            (text if (n + i) % 5 == 0 else aug).plan(hj.Scene(size), seed=1, sample=f"{n}-{i}")
            for i in range(4)
        ]
        program(packer.pack(plans), images)
        if n in (99, 999):
            counts.append(program._cache_size())
    return counts[0], counts[1]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--peers", type=Path, default=Path.home() / ".cache" / "agenthijack" / "peers"
    )
    python = make_peers(parser.parse_args().peers)
    torch.set_num_threads(1)
    image, value = screenshot()
    print(f"1080p uint8, one thread, {value}; milliseconds, min / median / max; ratios of minima.")
    print(f"GPU: not measured.\n\n{machine()}\n")
    ours, best = our_rows(image)
    head = [
        "who",
        "work",
        "time",
        "against memcpy",
        "peer / ours",
        "with two threads",
        "planning, apart",
    ]
    print(
        "One picture, a new draw each time; ours includes planning and drawing the sprite, and has"
        " one thread. OpenCV's letters are strokes, not a font's; its bicubic resize, and so that"
        " of Albumentations, does not smooth what it drops: another picture than that of Pillow,"
        " torchvision and ours.\n"
    )
    print(table(head, [*ours, *peer_rows(python, image, best)]))
    print(
        f"\nA batch of {BATCH}, a random corruption each, out of place; apply includes drawing new"
        " pop-ups.\n"
    )
    head = [
        "mix",
        "kind",
        "plain copy",
        "plan",
        "apply",
        "apply / copy",
        "label safety",
        "with safety / copy",
    ]
    print(table(head, batch_rows(image)))
    print("\nDataLoader over recorded PNG screens, milliseconds a sample.\n")
    print(table(["workers", "what", "a sample", "against decode only"], loader_rows()))
    print("\nJAX on the CPU, `hj.apply`, against a jitted copy; compilations after 60 plans.\n")
    print(table(["corruption", "apply", "copy", "ratio", "new compilations"], jax_rows(image)))
    print(
        f"\nJAX on the CPU, a batch of {BATCH} inside a jitted program, plans as arguments (packing"
        " apart).\n"
    )
    print(table(["mix", "program", "copy", "ratio"], jit_rows(image)))
    early, late = compile_counts()
    print(f"\nPrograms compiled after 100 random batches: {early}; after 1000: {late}.")


if __name__ == "__main__":
    main()
