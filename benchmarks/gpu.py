"""On a GPU: a mixed batch against a clone, resizing against torchvision, bytes against the CPU.

    python benchmarks/gpu.py

Without a GPU it says so and measures nothing. Times on the device are between two events on its
stream; it is made to sleep first, so that the host, whose own time stands beside, is done before
the device begins.
"""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from common import cell, machine, screenshot, table, times
from torchvision.transforms import v2

import hijack_data as hj

BATCH = 64
SLEEP = 100_000_000  # cycles, some 50 ms
SCENE = hj.Scene(size=(1080, 1920))
OVERLAYS = [hj.PopUps(), hj.Marks(), hj.Subtitle()]
MIXES = {
    "pop_ups, marks, subtitle": OVERLAYS,
    "the same and resolution": [*OVERLAYS, hj.Resolution()],
    "the same, size restored": [*OVERLAYS, hj.Resolution(restore=True)],
}


def device_times(work: Callable[[], object], runs: int = 15) -> tuple[list[float], list[float]]:
    """Run `work` and return its milliseconds on the device and on the host."""
    on_device: list[float] = []
    on_host: list[float] = []
    for run in range(runs + 3):
        start, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        torch.cuda.synchronize()
        torch.cuda._sleep(SLEEP)
        start.record()
        host = times(work, 1, warmup=0)
        end.record()
        torch.cuda.synchronize()
        if run >= 3:
            on_device.append(start.elapsed_time(end))
            on_host += host
    return on_device, on_host


def ratio(values: list[float], base: list[float]) -> str:
    """Fastest over fastest."""
    return f"{min(values) / min(base):.2f}x"


def wrong_bytes(out: Any, expected: Any) -> int:
    """How many bytes of a batch on the device differ from the CPU's."""
    return sum(int((a.cpu() != b).sum()) for a, b in zip(out, expected, strict=True))


def batch_rows(image: np.ndarray) -> list[list[str]]:
    """A batch with a random corruption each, out of place, new plans each time."""
    rows = []
    here = torch.from_numpy(np.stack([image] * BATCH)).permute(0, 3, 1, 2)
    for layout, batch in {
        "channels first": here.contiguous().cuda(),
        "channels last": here.cuda(),
    }.items():
        clone, _ = device_times(batch.clone)
        for mix, options in MIXES.items():
            aug = hj.OneOf(options)
            fresh = itertools.count()

            def plans(aug: hj.OneOf = aug, fresh: Any = fresh) -> list[hj.Plan]:
                number = next(fresh)
                return [aug.plan(SCENE, seed=1, sample=f"{number}-{i}") for i in range(BATCH)]

            ready = [plans() for _ in range(20)]
            turn = itertools.cycle(ready)
            device, host = device_times(lambda turn=turn, batch=batch: hj.apply(next(turn), batch))
            wrong = wrong_bytes(hj.apply(ready[0], batch), hj.apply(ready[0], batch.cpu()))
            planning = times(plans, 5)
            prepared = itertools.cycle(
                [hj.prepare(batch_plans).pin_memory() for batch_plans in ready]
            )
            _, prepared_host = device_times(
                lambda turn=prepared, batch=batch: hj.apply(next(turn), batch)
            )
            row = [
                mix,
                layout,
                cell(clone),
                cell(device),
                ratio(device, clone),
                cell(host),
                cell(prepared_host),
                cell(planning),
                str(wrong),
            ]
            rows.append(row)
    return rows


def resize_rows(image: np.ndarray) -> list[list[str]]:
    """Resizing a batch of 16, ours and torchvision's antialiased bicubic."""
    rows, batch = (
        [],
        torch.from_numpy(np.stack([image] * 16)).permute(0, 3, 1, 2).contiguous().cuda(),
    )
    for scale in (0.25, 0.5, 0.75, 2.0):
        plan = hj.Resolution(scale=scale).plan(SCENE, seed=1, sample=0)
        expected = hj.apply(plan, image)
        theirs = v2.Resize(plan.out_size, v2.InterpolationMode.BICUBIC, antialias=True)
        base, _ = device_times(lambda theirs=theirs: theirs(batch))
        for who, work in {
            "torchvision": theirs,
            "ours": lambda b, plan=plan: hj.apply(plan, b),
        }.items():
            device, host = device_times(lambda work=work: work(batch))
            wrong = int((work(batch)[0].permute(1, 2, 0).cpu().numpy() != expected).sum())
            rows.append(
                [f"{scale:g}", who, cell(device), ratio(device, base), cell(host), str(wrong)]
            )
    return rows


def main() -> None:
    """Print the tables."""
    if not torch.cuda.is_available():
        print("Not measured: this machine has no GPU.")
        return
    image, value = screenshot()
    print(
        f"{torch.cuda.get_device_name()}; 1080p uint8, {value}; milliseconds, min / median /"
        f" max.\n\n{machine()}\n"
    )
    print(
        f"A batch of {BATCH}, a random corruption each, out of place; new sprites are drawn and"
        " sent in that time.\n"
    )
    head = [
        "mix",
        "layout",
        "clone",
        "on the device",
        "/ clone",
        "on the host",
        "on the host, prepared",
        "planning, apart",
        "bytes unlike the CPU's",
    ]
    print(table(head, batch_rows(image)))
    print("\nResizing a batch of 16.\n")
    print(
        table(
            [
                "scale",
                "who",
                "on the device",
                "/ torchvision",
                "on the host",
                "bytes unlike Pillow's",
            ],
            resize_rows(image),
        )
    )


if __name__ == "__main__":
    main()
