"""Run a command on folders of pictures: find the pictures, and write one result for each."""

import json
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click

from ..errors import HijackError, ImageError, quantity
from ..picture_io import FORMATS
from ..plan import Plan
from ..types import UInt8Array
from .terminal import echo

SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".gif", ".tif", ".tiff")
# Takes `(path, out, sample)`, corrupts that picture with that sample id, and returns plan, result
# and notes.
Corrupt = Callable[[str, str, str], tuple[Plan, UInt8Array, tuple[str, ...]]]


def find_pictures(paths: Iterable[str]) -> list[str]:
    """Return the given files, and the pictures below each given folder.

    Raises:
        ImageError: a folder holds no picture.
    """
    pictures: list[str] = []
    for path in paths:
        folder = Path(path)
        if folder.is_dir():
            pictures += [str(file) for file in list_pictures(folder)]
        else:
            pictures.append(path)
    return pictures


def list_pictures(folder: Path) -> list[Path]:
    """Return the pictures below a folder, in the order of their names.

    Raises:
        ImageError: the folder holds no picture.
    """
    candidates = [path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES]
    pictures = sorted(path for path in candidates if path.is_file())
    if not pictures:
        raise ImageError(f"{folder}: holds no picture ({'/'.join(FORMATS)})")
    return pictures


def apply_to_folder(folder: Path, out: Path, corrupt: Corrupt, as_json: bool) -> None:
    """Corrupt every picture below a folder, each into a PNG of the same name below `out`.

    The path of a picture inside the folder is its sample id, so each picture gets its own plan. A
    picture that cannot be read or corrupted is reported, and makes the exit code 1.

    Raises:
        UsageError: `out` lies in the folder.
        HijackError: `out` cannot be written to.
    """
    if out.resolve().is_relative_to(folder.resolve()):
        raise click.UsageError(f"-o {out}: lies in {folder}; choose a folder outside it")
    names = _output_names([file.relative_to(folder) for file in list_pictures(folder)])
    results: list[dict[str, Any]] = []
    problems: list[str] = []
    for name, target in names.items():
        source = folder / name
        output_path = out / target
        try:
            output_path.parent.mkdir(parents=True, exist_ok=True)
            plan, result, notes = corrupt(str(source), str(output_path), name.as_posix())
        except OSError as error:
            raise HijackError(f"{out}: cannot be written to ({error.strerror or error})") from None
        except HijackError as error:
            text = str(error).removeprefix(f"{source}: ")
            problems.append(f"{name.as_posix()}: {text}")
            continue
        height, width = result.shape[:2]
        row = {
            "file": target.as_posix(),
            "corruption": plan.corruption,
            "size": [width, height],
            "digest": plan.digest(),
            "notes": list(notes),
        }
        results.append(row)
    _report(out, results, problems, as_json)


def _output_names(names: list[Path]) -> dict[Path, Path]:
    """Return the `.png` name of each result; if it is taken, the old suffix stays before `.png`."""
    counts = Counter(name.with_suffix(".png") for name in names)
    targets = {name: name for name in names if name.suffix == ".png"}
    used_names = set(targets)
    for name in names:
        if name in targets:
            continue
        target = name.with_suffix(".png")
        if counts[target] > 1:
            target = name.with_name(f"{name.name}.png")
        while target in used_names:
            target = target.with_name(f"{target.name}.png")
        targets[name] = target
        used_names.add(target)
    return {name: targets[name] for name in names}


def _report(out: Path, results: list[dict[str, Any]], problems: list[str], as_json: bool) -> None:
    if as_json:
        echo(json.dumps({"out": str(out), "pictures": results, "problems": problems}))
    else:
        echo(f"{out}: {quantity(len(results), 'picture')}")
        notes = Counter[str]()
        for row in results:
            notes.update(row["notes"])
        for note, count in notes.items():
            repeated = f" ({count} pictures)" if count > 1 else ""
            echo(f"  note: {note}{repeated}")
    for problem in problems:
        echo(f"  problem: {problem}", err=True)
    if problems:
        raise SystemExit(1)
