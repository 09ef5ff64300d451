"""Tiny images of the desktop: a few files in the place of a system."""

from pathlib import Path

from online_env.embedded.image import build, cache, file_entries
from online_env.embedded.image.manifest import Manifest, Pin

RECIPE = build.Recipe(("core",), ())
CHOICE = build.Choice((), (), "signature")
PYTHON = (Pin("h11", "0.16.0", "0" * 64),)


def fill(folder: Path, text: str = "hello") -> Manifest:
    """Make an image in the empty `folder`: files, a program, a link, a folder that is closed."""
    root = folder / cache.ROOT
    (root / "usr/bin").mkdir(parents=True)
    (root / "bin").symlink_to("usr/bin")
    program = root / "usr/bin/sudo"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o4755)
    (root / "etc").mkdir()
    (root / "etc/words").write_text(text)
    (root / "etc/a name with spaces\nand a line").write_text("x")
    (root / "closed").mkdir(mode=0o500)
    (folder / cache.GUEST).mkdir()
    file_entries.set_times(folder, 0.0)
    return build.describe(folder, RECIPE, CHOICE, PYTHON)


def publish(text: str = "hello", name: str = "tiny") -> Path:
    """An image in the cache of the environment; returns its folder."""
    with cache.cache_lock(print) as folder, cache.build_folder(folder) as fresh:
        result = fill(fresh, text)
        value = cache.publish(fresh, result)
        cache.write_name(folder, name, result.id)
    return value
