"""Small pictures of the first screen of each task, for docs/suite.md, from a run with frames.

Such as: hijack bench embedded --agent oracle --corruptions clean --out runs/oracle
python -m online_env.maintenance.suite_pictures runs/oracle docs/images/suite
"""

import sys
from pathlib import Path

from PIL import Image

from ..results import records
from ..results.scores import task_name

SIZE = (800, 450)
QUALITY = 45


def main() -> None:
    """Write one WebP a task."""
    run, out = map(Path, sys.argv[1:3])
    out.mkdir(parents=True, exist_ok=True)
    for record in records.read(run).records:
        if record["status"] != "ok":
            continue
        name = task_name(record["task"], record["task_seed"])
        frame = run / "episodes" / record["id"] / "frames" / "0000.png"
        with Image.open(frame) as screen:
            small = screen.convert("RGB").resize(SIZE, Image.Resampling.LANCZOS)
        small.save(out / f"{name}.webp", quality=QUALITY, method=6)
        print(name)


if __name__ == "__main__":
    main()
