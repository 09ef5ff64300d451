"""Severity levels: the share of real screens that is covered, and of targets that still show.

    python benchmarks/levels.py

Each recorded screen gets seeded plans of every level; targets are elements that the detector finds.
Changed is the share of pixels that differ from the clean screen, visible the mean share of the
target that shows, hidden the share of samples whose target shows less than half, placed the share
of screens that can hold the corruption.
"""

import statistics
import sys

import numpy as np
from common import SHARED, table
from PIL import Image

import hijack_data as hj
from hijack_data.corruption import find_corruption
from hijack_data.safety import judge

NAMES = ("pop_ups", "marks", "subtitle", "resolution")
DRAWS = 3
SCREENS = 16
TARGETS = 6


def screens() -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Desktop-sized recordings and the elements that the detector finds on them."""
    items = []
    for path in sorted(SHARED.glob("*")):
        image = np.array(Image.open(path).convert("RGB"))
        if image.shape[0] >= 700 and image.shape[1] >= 1200 and len(items) < SCREENS:
            items.append((path.name, image, hj.scene_from(image).boxes))
    return items


def measured(name: str, level: int, rows: list) -> dict[str, float]:
    """Means over screens, targets and draws."""
    spec = find_corruption(name).at(level)
    covered = []
    visible = []
    hidden = []
    placed = 0
    tries = 0
    for key, image, boxes in rows:
        rng = np.random.default_rng(len(boxes))
        for t in rng.permutation(len(boxes))[:TARGETS].tolist():
            scene = hj.Scene(image.shape[:2], boxes, target=tuple(boxes[t].tolist()))
            for draw in range(DRAWS):
                tries += 1
                try:
                    plan = spec.plan(scene, seed=1, sample=f"{key}-{t}-{draw}")
                except hj.HijackError:
                    continue
                after = hj.apply(plan, image)
                safety = judge(plan, image, after, target=scene.target)
                placed += bool(plan.ops)
                covered.append(safety.changed_pixels / (plan.out_size[0] * plan.out_size[1]))
                visible.append(safety.target_visible)
                hidden.append(safety.target_visible < 0.5)
    mean = statistics.fmean
    return {
        "covered": mean(covered),
        "visible": mean(visible),
        "hidden": mean(hidden),
        "placed": placed / tries,
    }


def main() -> None:
    """Print the table."""
    rows = screens()
    lines = []
    for name in NAMES:
        for level in range(1, 6):
            values = find_corruption(name).severities[level - 1]
            m = measured(name, level, rows)
            setting = ", ".join(f"{k}={v}" for k, v in values.items()) or "the paper's default"
            lines.append(
                [
                    name,
                    str(level),
                    setting,
                    *(f"{m[k]:.1%}" for k in ("covered", "visible", "hidden", "placed")),
                ]
            )
            print("|", " | ".join(lines[-1]), "|", file=sys.stderr, flush=True)
    count = sum(len(b) for _, _, b in rows)
    print(
        f"{len(rows)} recorded screens, {count} detected elements, {TARGETS} targets a screen,"
        f" {DRAWS} draws each.\n"
    )
    print(
        table(
            ["corruption", "level", "set", "changed", "target visible", "target hidden", "placed"],
            lines,
        )
    )


if __name__ == "__main__":
    main()
