"""`hijack desktop image`: build, keep and check images of the desktop."""

import json
import sys
from pathlib import Path

import click

from hijack_data.cli.options import WholeSummaries
from hijack_data.cli.terminal import echo

FILE = click.Path(dir_okay=False, path_type=Path)


@click.group(cls=WholeSummaries)
def image() -> None:
    """Images of the desktop: Debian 12 with its packages, for any Linux."""


@image.command()
@click.option(
    "--profile",
    "profiles",
    multiple=True,
    default=("web",),
    show_default=True,
    metavar="NAME",
    help="core, web, office, media or all; may be given more than once.",
)
@click.option("--name", metavar="NAME", help="What to call it; by its profiles, if not given.")
@click.option("-o", "--out", type=FILE, help="Export it to this file, too (.tar.zst).")
@click.option(
    "--mirror", metavar="URL", help="URL of a Debian archive.  [default: apt's configuration here]"
)
@click.option(
    "--security", metavar="URL", help="With --mirror: URL of the archive of security updates."
)
@click.option("--keyring", type=FILE, help="With --mirror: the keys of that archive.")
@click.option("--unsigned", is_flag=True, help="Take archives whose signature cannot be checked.")
@click.option("--like", type=FILE, help="Take exactly the packages of this manifest.")
@click.option("--json", "as_json", is_flag=True, help="Print the manifest as JSON.")
def build(
    profiles: tuple[str, ...],
    name: str | None,
    out: Path | None,
    mirror: str | None,
    security: str | None,
    keyring: Path | None,
    unsigned: bool,
    like: Path | None,
    as_json: bool,
) -> None:
    """Build an image from Debian's packages; nothing is installed on this machine."""
    from . import archive, cache, manifest, sources
    from . import build as builder

    if mirror is None:
        archives = sources.from_machine()
    else:
        archives = sources.from_mirror(mirror, security, keyring)
    pinned = None if like is None else manifest.read(like)
    recipe = builder.Recipe(
        profiles=pinned.profiles if pinned else builder.normal_profiles(profiles),
        sources=tuple(archives),
        unsigned=unsigned,
        pinned=pinned,
    )
    image_name, entry = builder.build(recipe, name, _say)
    if out is not None:
        archive.write(cache.images_folder() / entry.id, out)
        _say(f"exported to {out} ({out.stat().st_size / 1e6:.0f} MB)")
    if as_json:
        echo(entry.to_json(), nl=False)
        return
    echo(f"start a desktop from it with: hijack desktop up --image {image_name}")


@image.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print a JSON list.")
def list_command(as_json: bool) -> None:
    """List the images of this machine."""
    from . import cache

    names = cache.names()
    rows = [
        {
            "id": entry.id,
            "names": [name for name, target in names.items() if target == key],
            "suite": entry.suite,
            "architecture": entry.architecture,
            "profiles": entry.profiles,
            "size": entry.size,
            "packages": len(entry.packages),
        }
        for key, entry in cache.images().items()
    ]
    if as_json:
        echo(json.dumps(rows, indent=1))
        return
    for key, entry in cache.images().items():
        aliases = ", ".join(name for name, target in names.items() if target == key) or "-"
        echo(f"{aliases:16} {key}  {entry.summary}")
    if not rows:
        echo(f"no images in {cache.images_folder()}; make one with: hijack desktop image build")


@image.command("import")
@click.argument("file", type=FILE)
@click.option("--name", metavar="NAME", help="What to call it; by its profiles, if not given.")
def import_command(file: Path, name: str | None) -> None:
    """Read an image from FILE, and check every file in it."""
    from . import cache

    image_name, entry = cache.import_file(file, name, _say)
    echo(f"image {image_name} ({entry.id}): {entry.summary}")


@image.command()
@click.argument("name")
@click.argument("file", type=FILE)
def export(name: str, file: Path) -> None:
    """Write image NAME to FILE (.tar.zst), for `import` on another machine."""
    from . import archive, cache

    archive.write(cache.resolve(name), file)
    echo(f"{file} ({file.stat().st_size / 1e6:.0f} MB)")


@image.command()
@click.argument("name")
@click.argument("file", type=FILE)
def container(name: str, file: Path) -> None:
    """Write image NAME to FILE (.tar) for `docker load` or `podman load`.

    A container of it is a desktop.
    """
    from . import cache
    from . import container as containers

    tag = containers.write(cache.resolve(name), file)
    echo(f"{file} ({file.stat().st_size / 1e6:.0f} MB): docker load -i {file}, then run {tag}")


@image.command()
@click.argument("name")
def verify(name: str) -> None:
    """Compare every file of image NAME with its manifest; exit code 1 if one differs."""
    from . import cache

    folder = cache.resolve(name)
    lines = cache.verify(folder)
    for line in lines:
        echo(line)
    if lines:
        echo(f"{len(lines)} files differ; remove the image, and build or import it again", err=True)
        sys.exit(1)
    echo(f"{folder.name}: every file is as its manifest says")


@image.command()
@click.argument("name")
def remove(name: str) -> None:
    """Remove image NAME from this machine."""
    from . import cache

    echo(f"image {cache.remove(name, _say)} is gone")


def _say(text: str) -> None:
    echo(text, err=True)
