"""`hijack demo`: the main tasks of the library, on recordings that come with the package."""

import importlib
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from .. import extras
from ..errors import HijackError, MissingDependencyError
from ..file_io import make_folder, write_atomic
from ..paths import example_recordings
from . import hijack
from .terminal import echo

SCREENS = ("notes-04.png", "rename-04.png", "multiply-03.png")
VISUAL = ("pop_ups", "marks", "subtitle", "resolution")


@click.command()
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path),
    default=Path("demo"),
    show_default=True,
    metavar="DIR",
    help="Where to write everything.",
)
@click.option(
    "--desktop/--no-desktop",
    default=True,
    help="Whether to corrupt a live desktop as well, where one can run.",
)
def demo(out: Path, desktop: bool) -> None:
    """Corrupt screens, build a dataset, corrupt a live desktop.

    Parts that need an extra that is not installed are left out, with the command that adds it.
    """
    screens = [example_recordings() / "images" / name for name in SCREENS]
    outputs = [out / "before_after.png", out / "gallery.html"]
    make_folder(out)
    with command_beside("gallery", *screens[:2], "-o", outputs[1]):
        run_command("apply", screens[1], "pop_ups", "-o", out / "pop_ups.png", "--seed", 3)
        before_and_after(screens[0], outputs[0])
        if dataset(out / "dataset"):
            outputs.append(out / "dataset")
    failed = desktop and corrupt_live_desktop(out / "nine.png")
    if desktop and (out / "nine.png").exists():
        outputs.append(out / "nine.png")
    names = [str(path) for path in outputs]
    echo(f"\nLook at {', '.join(names[:-1])} and {names[-1]}.")
    if failed:
        sys.exit(1)


def run_command(*words: object) -> None:
    """Print a `hijack` command, then run it.

    Raises:
        SystemExit: the command could not do anything; problems with some of its input do not end
            the demo.
    """
    texts = [str(word) for word in words]
    echo(f"$ hijack {' '.join(texts)}")
    try:
        code: object = hijack.main(args=texts, prog_name="hijack", standalone_mode=False)
    except SystemExit as end:
        code = end.code
    if code not in (None, 0, 1):
        raise SystemExit(code)


@contextmanager
def command_beside(*words: object) -> Generator[None]:
    """Run a `hijack` command in a process of its own during the body, then print what it said.

    Raises:
        SystemExit: as `run_command` does.
    """
    texts = [str(word) for word in words]
    program = [sys.executable, "-m", "hijack_data", *texts]
    with subprocess.Popen(program, stdout=subprocess.PIPE, encoding="utf-8") as process:
        try:
            yield
            output, _ = process.communicate()
        except BaseException:
            process.kill()
            raise
    echo(f"$ hijack {' '.join(texts)}\n{output.rstrip()}")
    if process.returncode not in (0, 1):
        raise SystemExit(process.returncode)


def before_and_after(picture: Path, out: Path) -> None:
    """Write one picture with a before and an after of the four visual corruptions."""
    from .._apply import apply
    from ..corruption import make_corruption
    from ..gallery import contact_sheet
    from ..picture_io import encode_png, load_image
    from .picture_plans import make_scene

    screen, _ = load_image(picture)
    rows: list[Any] = []
    for name in VISUAL:
        planner = make_corruption(name)
        scene, _ = make_scene(planner, screen, None)
        plan = planner.plan(scene, seed=3, sample="demo")
        rows.append((name, screen, apply(plan, screen)))
    write_atomic(out, encode_png(contact_sheet(rows)))
    echo(f"{out}: before and after")


def dataset(folder: Path) -> bool:
    """Build a dataset of one recording, verify it, and say how to load it.

    Returns:
        Whether the dataset could be built, which needs the extra `hf`.
    """
    try:
        extras.require("the dataset of the demo", "hf", ("pyarrow", "isal"))
    except MissingDependencyError as error:
        echo(f"dataset: left out ({error})")
        return False
    run_command(
        "build", example_recordings(), "--out", folder, "--seed", 7, "--limit", 1, "--resume"
    )
    run_command("verify", folder)
    echo(f"in Python, with the extra hf: datasets.load_dataset({str(folder)!r}, split='train')")
    return True


def corrupt_live_desktop(picture: Path) -> bool:
    """Corrupt a live desktop in all nine ways; show each before and after, with its probe.

    On a machine that cannot run a desktop it prints why.

    Returns:
        Whether a probe was false.
    """
    from ..picture_io import encode_png

    # These modules belong to another package of the distribution, on which this one does not
    # depend.
    try:
        showcase: Any = importlib.import_module("online_env.showcase")
        live: Any = importlib.import_module("online_env")
        desktop = live.EmbeddedDesktop.up()
    except MissingDependencyError as error:
        echo(f"live desktop: left out ({error})")
        return False
    except (HijackError, OSError) as error:
        echo(f"live desktop: not here ({error}); in a clone `make desktop` adds it")
        return False
    results: list[Any] = []
    echo("\nOn a live desktop, what the probe of each corruption sees:")
    with desktop:
        for result in showcase.show_nine(desktop):
            mark = "" if result.ok else "PROBE FALSE: "
            echo(f"  {result.name:17} {mark}{result.saw}")
            results.append(result)
    sheet: Any = showcase.sheet
    write_atomic(picture, encode_png(sheet(results)))
    echo(f"{picture}: all nine, before and after")
    return not all(result.ok for result in results)
