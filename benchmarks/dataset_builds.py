"""Datasets: speed of rebuilds, lazy rows and random access, bytes of a plan, and memory.

Times are CPU time of one process (this machine is shared), medians; `images/s` is one over it: per
core.
"""

import io
import json
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from common import SHARED, machine, table
from PIL import Image, ImageDraw

import hijack_data as hj
from hijack_data.drawing.text import load_font
from hijack_data.picture_io import decode_image, pixel_sha256
from hijack_data.types import Action, Step, Trajectory
from pipelines import build, open_dataset, render
from pipelines.building.parquet_writer import write_parquet
from pipelines.building.step_rows import RowCounts, RowSettings, make_rows
from pipelines.dataset.columns import BASE
from pipelines.dataset.image_codec import BaseImage, changed_rows, decode, encode
from pipelines.dataset.lazy_rows import draw_row

SIZES = ((1080, 1920), (1079, 1919))
NAMES = ("pop_ups", "resolution", "marks", "subtitle")
RUNS = 5


def main() -> None:
    """Print all tables."""
    pictures = sources()
    print(
        f"{len(pictures)} real screenshots of 1920x1080, PNG; CPU milliseconds a picture,"
        f" median.\n\n{machine()}\n"
    )
    print(
        "**Full rebuild**: decode, corrupt, encode, Parquet row; Pillow: decode, draw,"
        f" save.\n\n{rebuilds(pictures)}\n"
    )
    print(
        "**Partial re-encoding**: bands of rows that a corruption leaves alone are taken"
        f" over.\n\n{bands(pictures)}\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        print(
            "**Lazy rows**: drawing on access against loading the same"
            f" picture.\n\n{lazy_rows(pictures)}\n"
        )
        print(f"**Files and random access**.\n\n{files(Path(folder))}\n")
        print(
            "**Memory**: peak of all processes of a build with two"
            f" workers.\n\n{memory(Path(folder))}"
        )


def sources() -> list[bytes]:
    """The recorded screenshots of full-HD size, as files."""
    files = [file.read_bytes() for file in sorted(SHARED.glob("*.png"))]
    matches = [data for data in files if Image.open(io.BytesIO(data)).size[::-1] in SIZES]
    if not matches:
        sys.exit(f"the recorded screenshots are not here ({SHARED})")
    return matches


def cpu(work: Callable[[], object], runs: int = RUNS) -> float:
    """Median CPU milliseconds of a call, after one to warm up."""
    work()
    spent: list[float] = []
    for _ in range(runs):
        start = time.process_time()
        work()
        spent.append((time.process_time() - start) * 1e3)
    return statistics.median(spent)


def mean(values: Iterable[float]) -> float:
    """Mean."""
    return statistics.fmean(values)


def rebuilds(pictures: list[bytes]) -> str:
    """Ours and Pillow's path, for each corruption and for all four from one decoding."""
    rows = []
    totals = [0.0, 0.0]
    for name in NAMES:
        ours = cpu(lambda n=name: rebuild(pictures, [n])) / len(pictures)
        pillow_seconds = mean(cpu(lambda d=data, n=name: PILLOW[n](d), 1) for data in pictures)
        totals = [totals[0] + ours, totals[1] + pillow_seconds]
        rows.append(_rebuild_row(name, ours, pillow_seconds))
    together = cpu(lambda: rebuild(pictures, NAMES)) / len(pictures) / len(NAMES)
    rows.append(_rebuild_row("all four, decoded once", together, totals[1] / len(NAMES)))
    our_seconds, pillow = (
        mean(cpu(lambda d=data, f=f: f(d)) for data in pictures)
        for f in (lambda d: decode(d, "x"), _open)
    )
    note = (
        f"Decoding the source is {our_seconds:.1f} ms of ours and {pillow:.1f} ms of Pillow's, once in"
        " each line."
    )
    return (
        table(["corruption", "ours", "images/s", "Pillow", "images/s", "ratio"], rows)
        + f"\n\n{note}"
    )


def _rebuild_row(name: str, ours: float, theirs: float) -> list[str]:
    return [
        name,
        f"{ours:.1f}",
        f"{1e3 / ours:.0f}",
        f"{theirs:.0f}",
        f"{1e3 / theirs:.1f}",
        f"{theirs / ours:.1f}x",
    ]


def rebuild(pictures: Iterable[bytes], names: Iterable[str]) -> None:
    """What a worker does with some steps, from the bytes of the sources to those of a shard."""
    settings = RowSettings(
        tuple((name, hj.make_corruption(name)) for name in names), seed=1, clean=False
    )
    steps = [
        (Step(k, "x.png", Action("click", 700, 500), "pyautogui.click(700, 500)"), d)
        for k, d in enumerate(pictures)
    ]
    trajectory = Trajectory("t", "jsonl", "do it", tuple(step for step, _ in steps))
    rows = chain.from_iterable(
        make_rows(trajectory, step, data, "x.png", settings, RowCounts()) for step, data in steps
    )
    with tempfile.TemporaryDirectory(
        dir="/dev/shm" if os.path.isdir("/dev/shm") else None
    ) as folder:
        write_parquet(Path(folder) / "x.parquet", rows)


def bands(pictures: list[bytes]) -> str:
    """Encoding and hashing a corrupted picture whole, and only where it was changed."""
    rows = []
    for name in ("subtitle", "pop_ups", "marks"):
        values = [_band_times(decode_image(data, "x")[0], name) for data in pictures]
        whole_seconds, part, hash_whole, hash_part, work = (
            mean(column) for column in zip(*values, strict=True)
        )
        cells = [f"{v:.2f}" for v in (whole_seconds, part, hash_whole, hash_part, work)]
        rows.append([name, *cells, f"{1e3 / (part + hash_part + work):.0f}"])
    images = [decode_image(data, "x")[0] for data in pictures]
    ours = sum(len(encode(image)) for image in images)
    plain = sum(len(_pillow_png(Image.fromarray(image), 6)) for image in images)
    fast = sum(len(_pillow_png(Image.fromarray(image), 1)) for image in images)
    head = [
        "corruption",
        "encode whole",
        "partly",
        "SHA-256 whole",
        "partly",
        "copy, draw, count changes",
        "images/s partly",
    ]
    return (
        table(head, rows)
        + f"\n\nBytes: ours {ours / 1e6:.2f} MB, Pillow at level 1 {fast / 1e6:.2f}, "
        f"at its default (6) {plain / 1e6:.2f}; the sources {sum(map(len, pictures)) / 1e6:.2f}."
    )


def _band_times(image: np.ndarray, name: str) -> tuple[float, ...]:
    from hijack_data.safety import changed_pixels

    plan = hj.make_corruption(name).plan(hj.Scene(image.shape[:2]), seed=1, sample="x", step=0)
    picture = hj.apply(plan, image)
    rows = changed_rows(plan) or ()
    base = BaseImage(image)
    assert base.encode_variant(picture, rows) == encode(picture)
    assert base.hash_variant(picture, rows) == pixel_sha256(picture)
    return (
        cpu(lambda: encode(picture)),
        cpu(lambda: base.encode_variant(picture, rows)),
        cpu(lambda: pixel_sha256(picture)),
        cpu(lambda: base.hash_variant(picture, rows)),
        cpu(lambda: changed_pixels(image, hj.apply(plan, image), plan)),
    )


def lazy_rows(pictures: list[bytes]) -> str:
    """Decoding the base and drawing on it, against decoding alone."""
    rows = []
    spent: dict[str, list[list[float]]] = {}
    for data in pictures:
        for name, row, stored in _rows(data):
            times = [
                cpu(lambda s=stored: Image.open(io.BytesIO(s)).load()),
                cpu(lambda s=stored: decode(s, "x")),
                cpu(lambda r=row: draw_row(r)),
            ]
            spent.setdefault(name, []).append(times)
    for name, times in spent.items():
        pillow, plain, drawn_seconds = (mean(column) for column in zip(*times, strict=True))
        more = [
            f"{100 * (drawn_seconds / plain - 1):+.1f} %",
            f"{100 * (drawn_seconds / pillow - 1):+.1f} %",
        ]
        rows.append([name, f"{pillow:.2f}", f"{plain:.2f}", f"{drawn_seconds:.2f}", *more])
    return table(
        ["row", "picture by Pillow", "picture by ours", "lazy row", "over ours", "over Pillow"],
        rows,
    )


def _rows(data: bytes) -> Iterable[tuple[str, dict[str, Any], bytes]]:
    settings = RowSettings(
        tuple((name, hj.make_corruption(name, **_plain(name))) for name in NAMES), seed=1, lazy=True
    )
    step = Step(0, "x.png", Action("click", 700, 500), "")
    for row in make_rows(
        Trajectory("t", "jsonl", "do it", (step,)), step, data, "x.png", settings, RowCounts()
    ):
        yield row["corruption"], row, row[BASE]["bytes"]


def _plain(name: str) -> dict[str, Any]:
    return {"avoid_elements": False} if name == "pop_ups" else {}


def files(folder: Path) -> str:
    """Sizes of both kinds, what a plan costs, and the time of a row by number."""
    source = folder / "source"
    _record(source, [file.read_bytes() for file in sorted(SHARED.glob("*.png"))][:48])
    rows = []
    for output in ("materialised", "lazy"):
        out = folder / output
        build(source, out, output=output, seed=7)
        shard = out / "data" / "train-00000.parquet"
        cost = _column_bytes(shard)
        dataset = open_dataset(out)
        numbers = random.Random(0)
        access = cpu(lambda d=dataset, n=numbers: d.reader[n.randrange(len(d))], 30)
        plan = cost["plan"] + cost["seed"]
        size = f"{shard.stat().st_size / 1e6:.1f} MB"
        rows.append(
            [
                output,
                str(len(dataset)),
                size,
                f"{plan:.0f}",
                f"{cost['plan_digest']:.0f}",
                f"{access:.1f}",
            ]
        )
    through = _through_datasets(folder)
    derived = folder / "derived"
    build(source, derived, output="lazy", seed=7, corruptions="resolution,marks,subtitle")
    cost = _column_bytes(derived / "data" / "train-00000.parquet")
    note = (
        "Without `pop_ups`, whose plans depend on the detected elements and are stored whole,"
        f" every plan can be derived: `plan` and `seed` take {cost['plan'] + cost['seed']:.0f}"
        f" bytes a row, `plan_digest` {cost['plan_digest']:.0f}."
    )
    head = [
        "output",
        "rows",
        "file",
        "plan + seed, bytes a row",
        "plan_digest",
        "row by number, not decoded, ms",
    ]
    return table(head, rows) + "\n\n" + note + "\n\n" + through


def _through_datasets(folder: Path) -> str:
    """A row by `load_dataset`: the picture as stored, and drawn by `render`."""
    import datasets

    datasets.disable_progress_bars()
    spent = []
    for output in ("materialised", "lazy"):
        rows = datasets.load_dataset(
            str(folder / output), split="train", cache_dir=str(folder / "cache")
        )
        rows, numbers = rows.with_transform(render), range(1, len(rows), 7)
        spent.append(
            cpu(lambda r=rows, n=numbers: [r[i]["screenshot"].load() for i in n], 3) / len(numbers)
        )
    return (
        f"By `load_dataset`: a materialised row {spent[0]:.1f} ms, a lazy one with `render`"
        f" {spent[1]:.1f} ms."
    )


def _column_bytes(file: Path) -> dict[str, float]:
    meta = pq.ParquetFile(file).metadata
    columns = [
        meta.row_group(g).column(c)
        for g in range(meta.num_row_groups)
        for c in range(meta.num_columns)
    ]
    cost = dict.fromkeys((c.path_in_schema for c in columns), 0.0)
    for column in columns:
        cost[column.path_in_schema] += column.total_compressed_size / meta.num_rows
    return cost


def memory(folder: Path) -> str:
    """Peak memory of builds of 1,000 and 10,000 rows."""
    rows = []
    for steps in (200, 2000):
        source = folder / f"small-{steps}"
        _record(source, [encode(_blocks(number)) for number in range(steps)], step=20)
        for output in ("materialised", "lazy"):
            peak = _peak(source, folder / f"out-{steps}-{output}", output)
            rows.append([output, str(steps * 5), f"{peak / 2**20:.0f} MiB"])
    return table(["output", "rows", "peak"], rows)


def _blocks(number: int) -> np.ndarray:
    blocks = np.random.default_rng(number).integers(0, 256, (20, 32, 3), dtype=np.uint8)
    return blocks.repeat(18, axis=0).repeat(20, axis=1)


def _record(folder: Path, pictures: list[bytes], step: int = 6) -> None:
    (folder / "images").mkdir(parents=True)
    lines = []
    for number, data in enumerate(pictures):
        (folder / "images" / f"{number}.png").write_bytes(data)
        action = {"type": "click", "x": 100, "y": 50}
        settings = {
            "trajectory_id": f"t{number // step}",
            "step": number % step,
            "image": f"images/{number}.png",
        }
        lines.append(json.dumps({**settings, "instruction": "do it", "action": action}) + "\n")
    (folder / "trajectories.jsonl").write_text("".join(lines))


BUILD = """
import sys
import hijack_data as hj
from pipelines import build
if __name__ == "__main__":
    planners = {"marks": hj.Marks(number=9, mark_size=8), "half": hj.Resolution(),
                "words": hj.Subtitle(subtitle_text="hello", font_size=12), "some": hj.Marks(number=3, mark_size=8)}
    build(sys.argv[1], sys.argv[2], output=sys.argv[3], corruptions=planners, rows_per_shard=250, workers=2)
"""


def _peak(source: Path, out: Path, output: str) -> int:
    script = out.parent / "peak.py"
    script.write_text(BUILD)
    process = subprocess.Popen([sys.executable, str(script), str(source), str(out), output])
    peak = 0
    while process.poll() is None:
        peak = max(peak, sum(_resident(pid) for pid in _family(process.pid)))
        time.sleep(0.02)
    if process.returncode:
        sys.exit("the build failed")
    return peak


def _family(pid: int) -> list[int]:
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    return [pid, *(second for child in children for second in _family(int(child)))]


def _resident(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError):
        return 0


def _pillow_png(image: Image.Image, level: int) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, "PNG", compress_level=level)
    return buffer.getvalue()


def _open(data: bytes) -> Image.Image:
    return Image.open(io.BytesIO(data)).convert("RGB")


def _marks(data: bytes) -> bytes:
    image = _open(data)
    numbers = random.Random(0)
    pen = ImageDraw.Draw(image)
    for _ in range(50):
        x = numbers.randrange(image.width - 40)
        y = numbers.randrange(image.height - 40)
        pen.ellipse((x, y, x + 40, y + 40), fill="red")
    return _pillow_png(image, 6)


def _subtitle(data: bytes) -> bytes:
    image = _open(data)
    pen = ImageDraw.Draw(image)
    pen.rectangle((300, 920, 1600, 1040), fill="black")
    pen.text(
        (340, 950),
        "A line of text that runs along the lower edge",
        fill="white",
        font=load_font("DejaVuSans", 40),
    )
    return _pillow_png(image, 6)


def _pop_up(data: bytes) -> bytes:
    image = _open(data)
    pen = ImageDraw.Draw(image)
    pen.rectangle((500, 300, 1400, 800), fill="white", outline="gray")
    for line in range(6):
        pen.text(
            (540, 340 + 50 * line),
            "Some words inside of a window",
            fill="black",
            font=load_font("DejaVuSans", 32),
        )
    return _pillow_png(image, 6)


def _half(data: bytes) -> bytes:
    image = _open(data)
    return _pillow_png(
        image.resize((image.width // 2, image.height // 2), Image.Resampling.BICUBIC), 6
    )


PILLOW: dict[str, Callable[[bytes], bytes]] = {
    "pop_ups": _pop_up,
    "resolution": _half,
    "marks": _marks,
    "subtitle": _subtitle,
}

if __name__ == "__main__":
    main()
