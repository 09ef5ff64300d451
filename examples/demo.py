"""The main job from nothing: corrupt screens, build a dataset, corrupt a live desktop.

python examples/demo.py --out demo
"""

import argparse
import subprocess
import sys
from pathlib import Path

import hijack_data as hj
from hijack_data.errors import MissingDependencyError
from hijack_data.files import encode_png, load_image, write_atomic
from hijack_data.gallery import contact_sheet

RECORDINGS = Path(__file__).parent / "recordings"
SCREENS = ("notes-04.png", "rename-04.png", "multiply-03.png")
VISUAL = ("pop_ups", "marks", "subtitle", "resolution")


def hijack(*words: object) -> None:
    """Run one command of the command line, showing it first."""
    print("$ hijack", *words, flush=True)
    done = subprocess.run([sys.executable, "-m", "hijack_data.cli", *map(str, words)], check=False)
    if done.returncode > 1:
        raise SystemExit(done.returncode)


def before_and_after(out: Path) -> None:
    """Write one picture with a before and an after of the four visual corruptions."""
    screen, _ = load_image(RECORDINGS / "images" / SCREENS[0])
    scene = hj.scene_from(screen)
    rows = [
        (name, screen, hj.apply(hj.get(name).plan(scene, seed=3, sample="demo"), screen))
        for name in VISUAL
    ]
    write_atomic(out, encode_png(contact_sheet(rows)))
    print(f"{out}: before and after")


def main() -> None:
    """Make everything under `--out`."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("demo"))
    out: Path = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    hijack(
        "apply",
        RECORDINGS / "images" / SCREENS[1],
        "pop_ups",
        "-o",
        out / "pop_ups.png",
        "--seed",
        3,
    )
    before_and_after(out / "before_after.png")
    hijack(
        "gallery", *(RECORDINGS / "images" / name for name in SCREENS), "-o", out / "gallery.html"
    )
    hijack("build", RECORDINGS, "--out", out / "dataset", "--seed", 7, "--resume")
    hijack("verify", out / "dataset")
    read_back(out / "dataset")
    failed = nine(out / "nine.png")
    print(
        f"\nLook at {out}/before_after.png, open {out}/gallery.html, or load {out}/dataset with"
        " datasets.load_dataset."
    )
    sys.exit(1 if failed else 0)


def nine(picture: Path) -> bool:
    """Corrupt a real desktop in all nine ways, and show each before and after, with the probe.

    Returns whether a probe was false; on a machine that cannot have a desktop it says so.
    """
    from online_env import EmbeddedDesktop
    from online_env.errors import DesktopError

    try:
        from online_env.showcase import sheet, show_nine

        desktop = EmbeddedDesktop.up()
    except MissingDependencyError as error:
        print(f"live desktop: not here ({error})")
        return False
    except DesktopError as error:
        print(f"live desktop: not here ({error}); `make desktop` adds it")
        return False
    shown = []
    print("\nOn a live desktop, what the probe of each corruption sees:", flush=True)
    with desktop:
        for one in show_nine(desktop):
            print(f"  {one.name:17} {'' if one.ok else 'PROBE FALSE: '}{one.saw}", flush=True)
            shown.append(one)
    write_atomic(picture, encode_png(sheet(shown)))
    print(f"{picture}: all nine, before and after")
    return not all(one.ok for one in shown)


def read_back(folder: Path) -> None:
    """Load the dataset as anybody would, with no code of ours, and print a row."""
    from datasets import load_dataset

    dataset = load_dataset(str(folder), split="train")
    row = dataset[1]
    print(
        f"load_dataset: {len(dataset)} rows; the second: {row['corruption']},"
        f" {row['action_code']!r}"
    )


if __name__ == "__main__":
    main()
