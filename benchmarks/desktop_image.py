"""Images of the desktop in figures: size, building, import, and a desktop from one beside the host's.

`--image NAME` is measured (any that is there, if not given). `--build PROFILE` builds that profile
once more into a folder of its own, from packages that were fetched before; `--parts` chooses.
"""

import argparse
import os
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from common import machine, table
from online import memory

from online_env.embedded import packages
from online_env.embedded.desktop import EmbeddedDesktop
from online_env.embedded.image import archive, build, cache, sources

PARTS = ("sizes", "file", "desktop", "shared")
KINDS = (cache.HOST, "image")


def format_times(seconds: list[float]) -> str:
    """Return the least, the median and the greatest of some seconds."""
    numbers = (min(seconds), statistics.median(seconds), max(seconds))
    return " / ".join(f"{number:.2f}" for number in numbers)


def timed(work: Callable[[], object]) -> float:
    """Return the seconds that `work` takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def sizes() -> None:
    """Print what each profile would fetch."""
    archives = tuple(sources.from_machine())
    rows: list[list[str]] = []
    for profile in packages.PROFILES:
        recipe = build.Recipe(build.normal_profiles([profile]), archives)
        choice = build.choose(recipe).all
        size = sum(package.size for package in choice)
        rows.append([", ".join(recipe.profiles), str(len(choice)), f"{size / 1e6:.0f} MB"])
    print(table(["profiles of an image", "packages", "to fetch"], rows))


def building(profile: str) -> None:
    """Build an image in a folder of its own, with the packages that the cache has."""
    images_folder = cache.images_folder()
    with tempfile.TemporaryDirectory(prefix="images-", dir=images_folder.parent) as folder:
        os.environ[cache.VARIABLE] = folder
        scratch_folder = cache.ensure_images_folder()
        for path in (images_folder / "packages").glob("*.deb"):
            os.link(path, scratch_folder / "packages" / path.name)
        recipe = build.Recipe(build.normal_profiles([profile]), tuple(sources.from_machine()))
        start = time.perf_counter()
        _, value = build.build(recipe, "again", print)
        seconds = time.perf_counter() - start
        os.environ[cache.VARIABLE] = str(images_folder)
        outcome = value.id in cache.images()
    print(f"{profile}: {seconds:.0f} s, {value.summary}, id {value.id}, known before: {outcome}")


def as_file(name: str) -> None:
    """Time export, import and verify, and a desktop from the imported file."""
    result = cache.resolve(name)
    images_folder = cache.images_folder()
    rows: list[list[str]] = []
    with tempfile.TemporaryDirectory(prefix="images-", dir=images_folder.parent) as folder:
        file = Path(folder, "image.tar.zst")
        rows.append(["export", f"{timed(lambda: archive.write(result, file)):.1f} s"])
        rows.append(["the file", f"{file.stat().st_size / 1e6:.0f} MB"])
        os.environ[cache.VARIABLE] = str(Path(folder, "images"))
        start = time.perf_counter()
        cache.import_file(file, "copy", print)
        rows.append(["import", f"{time.perf_counter() - start:.1f} s"])
        with EmbeddedDesktop.up(image="copy") as desktop:
            desktop.screenshot()
            seconds = time.perf_counter() - start
        rows.append(["from the file to the first screenshot", f"{seconds:.1f} s"])
        copied = cache.resolve("copy")
        rows.append(["verify", f"{timed(lambda: cache.verify(copied)):.1f} s"])
        used_bytes = sum(path.lstat().st_blocks for path in copied.rglob("*")) * 512
        rows.append(["on disk", f"{used_bytes / 1e6:.0f} MB"])
        os.environ[cache.VARIABLE] = str(images_folder)
        shutil.rmtree(Path(folder, "images"))
    print(table([f"image {name}", "measured"], rows))


def measured(image: str) -> dict[str, float]:
    """Measure a desktop once: up, cold reset, tree, memory."""
    entries: dict[str, float] = {}
    start = time.perf_counter()
    with EmbeddedDesktop.up(image=image, apps=("editor",)) as desktop:
        entries["up, editor open, s"] = time.perf_counter() - start
        entries["reset, cold, s"] = timed(desktop.reset)
        desktop.accessibility()
        entries["tree, s"] = min(timed(desktop.accessibility) for _ in range(5))
        entries["screenshot, s"] = min(timed(desktop.screenshot) for _ in range(5))
        time.sleep(2)
        entries["memory (PSS), MiB"] = memory(desktop)
        entries["of it not files' pages, MiB"] = memory(desktop, "Pss_Anon")
    return entries


def beside(name: str, runs: int) -> None:
    """Measure desktops from the image and from the machine's packages, in turn."""
    for kind in KINDS:
        measured(name if kind == "image" else kind)  # warm the page cache
    entries: dict[str, list[dict[str, float]]] = {kind: [] for kind in KINDS}
    for _ in range(runs):
        for kind in KINDS:
            entries[kind].append(measured(name if kind == "image" else kind))
    rows: list[list[str]] = []
    for item in entries["image"][0]:
        host, image = ([result[item] for result in entries[kind]] for kind in KINDS)
        ratio = statistics.median(image) / statistics.median(host)
        digits = [f"{statistics.median(values):.3g}" for values in (host, image)]
        rows.append([item, *digits, f"{ratio:.2f}"])
    print(table([f"median of {runs}", "host-based", "from the image", "ratio"], rows))


def shared(name: str, numbers: list[int]) -> None:
    """Measure what desktops side by side take each: those of one kind share the system's files."""
    rows: list[list[str]] = []
    for number in numbers:
        row = [str(number)]
        for kind in KINDS:
            anonymous, total_memory = side_by_side(name if kind == "image" else kind, number)
            row += [f"{anonymous:.0f}", f"{total_memory - anonymous:.0f}", f"{total_memory:.0f}"]
        rows.append([*row, f"{float(row[6]) / float(row[3]):.2f}"])
    print("Memory (PSS) of each, MiB: its own, its share of files' pages, both.\n")
    columns = [f"{kind}: {part}" for kind in ("host", "image") for part in ("own", "files", "both")]
    print(table(["desktops", *columns, "ratio"], rows))


def side_by_side(image: str, number: int) -> tuple[float, float]:
    """Return the mean anonymous memory, and the mean of all memory, of so many desktops, in MiB."""
    desktops = [EmbeddedDesktop.up(image=image, apps=("editor",)) for _ in range(number)]
    try:
        time.sleep(2)
        anonymous = statistics.mean(memory(desktop, "Pss_Anon") for desktop in desktops)
        return anonymous, statistics.mean(memory(desktop) for desktop in desktops)
    finally:
        for desktop in desktops:
            desktop.close()


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--image", default="")
    parser.add_argument("--build", help="build this profile, too")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--numbers", default="1,2,4")
    parser.add_argument("--parts", default=",".join(PARTS))
    options = parser.parse_args()
    parts = options.parts.split(",")
    print(machine())
    if options.build:
        building(options.build)
    name = options.image or next(iter(cache.names()), "")
    if "sizes" in parts:
        sizes()
    if "file" in parts:
        as_file(name)
    if "desktop" in parts:
        beside(name, options.runs)
    if "shared" in parts:
        shared(name, [int(number) for number in options.numbers.split(",")])


if __name__ == "__main__":
    main()
