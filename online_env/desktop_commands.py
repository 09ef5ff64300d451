"""`hijack desktop`: install, start, watch and end embedded desktops.

Exit codes: 0 done, 1 finished but something is missing or failed, 2 bad usage; of `run --shell`,
the command's own.
"""

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import click

from hijack_data.cli.options import WholeSummaries
from hijack_data.cli.terminal import echo

from .corrupting.corrupt_command import corrupt
from .corrupting.ledger import Ledger
from .desktops.protocol import RunResult
from .embedded.image.image_commands import image as image_commands
from .errors import DesktopError
from .privilege import as_root
from .record_command import parse_size, record_desktop

SIZE_HELP = "Screen as WIDTHxHEIGHT in pixels."


@click.group(cls=WholeSummaries)
def desktop() -> None:
    """Real Linux desktops on this machine, without a virtual machine."""


desktop.add_command(corrupt)
desktop.add_command(image_commands)
desktop.add_command(record_desktop)


@desktop.command()
@click.option(
    "--profile",
    "profiles",
    multiple=True,
    default=("web",),
    show_default=True,
    metavar="NAME",
    help="core, web, office, media or all; may be given more than once.",
)
@click.option("--host", is_flag=True, help="Install Debian packages on this machine.")
@click.option(
    "--image",
    metavar="IMAGE",
    help="Take this image: its file, its URL, or the name of one that is here.",
)
@click.option("--mirror", metavar="URL", help="Build an image from this Debian archive.")
@click.option("--security", metavar="URL", help="With --mirror: the archive of security updates.")
def install(
    profiles: tuple[str, ...],
    host: bool,
    image: str | None,
    mirror: str | None,
    security: str | None,
) -> None:
    """Prepare this machine for desktops. Run again at any time.

    Root on Debian 12 gets the apt packages of the profiles. Everywhere else an image of the desktop
    is taken or built, and desktops start from it; nothing is installed on the machine.
    """
    from .embedded import home, packages
    from .embedded.image import cache, sources
    from .embedded.image import image_setup as images
    from .embedded.runtime import registry

    packages.packages(profiles)
    _check_sources(host, image or mirror)
    if host or (not image and not mirror and images.prefers_packages()):
        _install_packages(profiles)
        cache.make_default(cache.HOST)
        ready = f"profiles core, {', '.join(profiles)}"
    else:
        archives = sources.from_mirror(mirror, security) if mirror else None
        name = images.ensure_image(profiles, image, archives, lambda text: echo(text, err=True))
        cache.make_default(name)
        ready = f"desktops start from the image {name}"
    home.ensure_layer()
    if not registry.records():
        home.remove_old_layers()
    echo(f"ready: {ready}; start a desktop with: hijack desktop up")


def _check_sources(host: bool, other_source: str | None) -> None:
    """Check that an installation has one source.

    Raises:
        UsageError: It is to be made of the machine's packages and of something else.
    """
    if host and other_source:
        raise click.UsageError("--host takes this machine's packages: without --image and --mirror")


def _install_packages(profiles: tuple[str, ...]) -> None:
    from .embedded import packages

    lacking = packages.missing(packages.packages(profiles))
    if lacking:
        suffix = "" if os.geteuid() == 0 else " through sudo"
        echo(f"installing {len(lacking)} packages with apt-get{suffix}: {' '.join(lacking)}")
    packages.install(lacking)


@desktop.command()
@click.option(
    "--profile",
    "profiles",
    multiple=True,
    default=("web",),
    show_default=True,
    metavar="NAME",
    help="The profiles that must be there.",
)
@click.option("--image", metavar="NAME", help="Look at what a desktop from this image needs.")
@click.option("--json", "as_json", is_flag=True, help="Print a JSON list.")
def doctor(profiles: tuple[str, ...], image: str | None, as_json: bool) -> None:
    """List what is there, what is missing, and the command that repairs it."""
    from .embedded import doctor as examiner
    from .embedded import packages

    packages.packages(profiles)
    checks = examiner.diagnose(profiles, image)
    if as_json:
        echo(json.dumps([vars(check) for check in checks], indent=1))
    else:
        for check in checks:
            _print_check(check)
    failed = any(check.required and not check.ok for check in checks)
    sys.exit(1 if failed else 0)


def _print_check(check: Any) -> None:
    mark = "FAIL" if check.required else "none"
    if check.ok:
        mark = "ok  "
    echo(f"{mark}  {check.name}: {check.detail}")
    if not check.ok and check.fix:
        echo(f"      mend it with: {check.fix}")


@desktop.command()
@click.option("--size", default="1920x1080", show_default=True, metavar="WxH", help=SIZE_HELP)
@click.option("--name", metavar="ID", help="Its id; the next free of d1, d2 ... if not given.")
@click.option(
    "--app",
    "apps",
    multiple=True,
    metavar="NAME",
    help="Open this before it is ready (browser, editor, files, terminal ...).",
)
@click.option(
    "--osworld", is_flag=True, help="OSWorld's routes without a token, sudo without a password."
)
@click.option(
    "--image",
    metavar="NAME",
    help="Start from this image, or `host`.  [default: $AGENTHIJACK_IMAGE, or the installed one]",
)
@click.option("--json", "as_json", is_flag=True, help="Print the record as JSON.")
def up(
    size: str,
    name: str | None,
    apps: tuple[str, ...],
    osworld: bool,
    image: str | None,
    as_json: bool,
) -> None:
    """Start a desktop; it runs until `hijack desktop down`."""
    from .embedded.handle import Handle, make_order
    from .embedded.runtime.rootless import LACKING

    start = time.monotonic()
    order = make_order(parse_size(size), name, apps, osworld=osworld, detached=True, image=image)
    handle = Handle(order)
    record = handle.wait()
    handle.release()
    if as_json:
        echo(json.dumps(record))
        return
    echo(f"desktop {record['id']} is up ({time.monotonic() - start:.1f} s)")
    echo(f"  guest server  {record['guest']} (token: {record['token_file']})")
    echo(f"  watch it      hijack desktop view {record['id']}")
    echo(f"  end it        hijack desktop down {record['id']}")
    if record["rootless"]:
        echo(f"  not as root:  {LACKING}")


@desktop.command()
@click.argument("name", required=False)
@click.option(
    "-o",
    "--out",
    "output",
    type=click.Path(dir_okay=False, writable=True, path_type=Path),
    default="desktop.png",
    show_default=True,
    metavar="OUT.png",
    help="Where the PNG goes.",
)
def shot(name: str | None, output: Path) -> None:
    """Save a screenshot of desktop NAME (the only one, if not given)."""
    from PIL import Image

    from .embedded.running import attach

    with attach(name) as present:
        picture = Image.fromarray(present.screenshot())
    picture.save(output, "PNG")
    echo(f"{output} {picture.width}x{picture.height}")


@desktop.command()
@click.argument("code")
@click.option("--on", "name", metavar="ID", help="The desktop's id; the only one, if not given.")
@click.option("--shell", is_flag=True, help="CODE is a shell command; its exit code is ours.")
def run(code: str, name: str | None, shell: bool) -> None:
    """Run pyautogui CODE on a desktop, such as 'pyautogui.click(100, 200)'."""
    from .embedded.running import attach

    with attach(name) as present:
        result = present.execute(code) if shell else present.run(code)
    echo(result.output, nl=False)
    echo(result.error, nl=False, err=True)
    sys.exit(_code(result) if shell else int(not result.ok))


@desktop.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print a JSON list.")
@click.option("--sweep", is_flag=True, help="First remove what killed processes have left.")
def list_command(as_json: bool, sweep: bool) -> None:
    """List the desktops of this machine, orphans included."""
    from .embedded.runtime import registry

    if sweep:
        _end(registry.orphans(), quiet=as_json)
    rows = [{**record, "state": registry.state(record)} for record in registry.records()]
    listed = {record["id"] for record in rows}
    orphans = [record for record in registry.orphans() if record["id"] not in listed]
    rows += [{**record, "state": "orphan"} for record in orphans]
    if as_json:
        echo(json.dumps(rows, indent=1))
        return
    for record in rows:
        # The clock may have been set since.
        age = f"{max(0.0, time.time() - record['created']):.0f} s" if record["created"] else "?"
        width, height = record.get("screen", (0, 0))
        echo(
            f"{record['id']:12} {record['state']:9} {width}x{height}  up {age} "
            f" {record.get('guest', '')}"
        )
    if not rows:
        hint = ""
        if os.geteuid() != 0:
            hint = f" (those of root: {as_root('desktop', 'list')})"
        echo(f"no desktops{hint}; start one with: hijack desktop up")


@desktop.command()
@click.argument("name", required=False)
@click.option("--all", "everything", is_flag=True, help="End all desktops.")
def down(name: str | None, everything: bool) -> None:
    """End desktop NAME (the only one, if not given) and remove all of it."""
    from .embedded.running import choose
    from .embedded.runtime import registry

    if everything:
        records = registry.records()
        records += [orphan for orphan in registry.orphans() if registry.load(orphan["id"]) is None]
    else:
        records = [choose(name)]
    _end(records)


def _end(records: list[dict[str, Any]], quiet: bool = False) -> None:
    from .embedded.runtime import registry
    from .embedded.runtime.desktop_config import SetupError

    for record in {record["id"]: record for record in records}.values():
        try:
            registry.remove(record)
        except SetupError as error:
            raise DesktopError(str(error)) from None
        if not quiet:
            echo(f"desktop {record['id']} is gone")


@desktop.command()
@click.argument("name", required=False)
@click.option(
    "--port", default=0, metavar="N", help="Port on the loopback interface; any free one if 0."
)
def view(name: str | None, port: int) -> None:
    """Show desktop NAME live in a browser, with mouse and keyboard; ends with Ctrl-C.

    Nine buttons corrupt the desktop and undo that. Without NAME it is the one that `hijack desktop
    up` started; if there is none, or more than one, another is started that ends with this command.
    Desktops of a running benchmark are shown by their name only.
    """
    from .corrupting.page_buttons import Buttons
    from .embedded.running import attach, left_running
    from .embedded.runtime.registry import folder
    from .embedded.view import serve

    running = left_running() if name is None else []
    lasting = name is not None or len(running) == 1
    with attach(name or running[0]["id"]) if lasting else _start_viewed_desktop() as present:
        buttons = Buttons(present, Ledger(folder(present.id)))
        serve(present.record, port, echo, lasting=lasting, buttons=buttons)


def _code(result: RunResult) -> int:
    """Return a command's exit code: its own, 128 and the signal's number, or 1."""
    if result.ok:
        return 0
    code = result.returncode or 1
    return code if code > 0 else 128 - code


def _start_viewed_desktop() -> Any:
    """Start a desktop for a page; its name says so, and no other desktop gets it again."""
    from .embedded.desktop import EmbeddedDesktop
    from .embedded.runtime import registry

    running = ", ".join(record["id"] for record in registry.running())
    message = f"starting one beside {running} (hijack desktop view NAME shows one of those)"
    echo(message if running else "no desktop runs: starting one")
    return EmbeddedDesktop.up(name=f"view-{os.getpid()}")
