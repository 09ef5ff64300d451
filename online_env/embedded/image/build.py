"""Building an image: Debian's packages, unpacked and configured in a tree of their own.

The essential packages are unpacked here; then dpkg, which is among them, installs itself and all
others in the chroot, as debootstrap does in its second stage.
"""

import io
import lzma
import os
import shutil
import tarfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from ...errors import DesktopImageError
from .. import packages
from . import cache, debian, file_entries, guest_packages, manifest, sources, unprivileged_chroot
from .cache import Report
from .manifest import Manifest, Pin

# Translations and manuals, which no desktop needs; copyright files stay.
EXCLUDED = (
    "/usr/share/man/*",
    "/usr/share/info/*",
    "/usr/share/locale/*",
    "/usr/share/doc/*",
    "/usr/share/gtk-doc/*",
    "/usr/share/help/*",
    "/usr/share/lintian/*",
    "/usr/lib/chromium/locales/*",
)
INCLUDED = (
    "/usr/share/doc/*/copyright",
    "/usr/share/locale/locale.alias",
    "/usr/lib/chromium/locales/en-US*",
)
# The first of alternatives in which Debian's installer prefers the second.
PREFERRED = ("usr-is-merged",)
MERGED = ("bin", "sbin", "lib", "lib64")
FIRST = ("base-passwd", "base-files", "dpkg", "libc6", "perl-base", "mawk", "debconf")
# What programs leave behind that differs from build to build, or is of no use in an image.
LEFT = (
    "var/log",
    "var/cache/ldconfig",
    "var/cache/debconf",
    "var/cache/apt",
    "var/lib/apt/lists",
    "var/lib/systemd",
    "usr/lib/udev/hwdb.bin",
    "usr/sbin/policy-rc.d",
    "etc/dpkg/dpkg.cfg.d/image",
    "etc/machine-id",
    "var/lib/dbus/machine-id",
)
LEFT_FILES = ("etc/*-", "var/lib/dpkg/*-old", "var/lib/dpkg/lock*", "var/lib/dpkg/triggers/Lock")
_DAYS = str(file_entries.EPOCH // 86400)
_AR = b"!<arch>\n"
_AR_HEADER = 60
# Without this a program that is installed would start its services.
_NO_SERVICES = "#!/bin/sh\nexit 101\n"


@dataclass(frozen=True)
class Recipe:
    """What to build.

    Attributes:
        profiles: of packages; `core` is always among them.
        sources: the archives.
        unsigned: take archives whose signature cannot be checked.
        pinned: the packages of a manifest; without it, the newest.
        packages: packages that replace those of the profiles.
    """

    profiles: tuple[str, ...]
    sources: tuple[sources.AptSource, ...]
    unsigned: bool = False
    pinned: Manifest | None = None
    packages: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Choice:
    """The packages of an image.

    Attributes:
        base: what every Debian has.
        all: all of them, those included.
        trust: how they are known to be Debian's.
    """

    base: tuple[debian.Package, ...]
    all: tuple[debian.Package, ...]
    trust: str


def architecture() -> str:
    """Debian's name of this machine's architecture.

    Raises:
        DesktopImageError: There are no images for it.
    """
    machine = os.uname().machine
    if machine not in debian.ARCHITECTURES:
        supported = " and ".join(debian.ARCHITECTURES)
        raise DesktopImageError(f"no images on {machine}: only on {supported}")
    return debian.ARCHITECTURES[machine]


def normal_profiles(profiles: Iterable[str]) -> tuple[str, ...]:
    """The profiles that are meant, `core` first, each once; errors as in `packages.packages`."""
    names = ("core", *profiles)
    packages.packages(names)
    if packages.ALL in names:
        return tuple(packages.PROFILES)
    return tuple(name for name in packages.PROFILES if name in names)


def choose(recipe: Recipe) -> Choice:
    """Read the archives and choose the packages.

    Raises:
        DesktopImageError: An archive cannot be read, or lacks something.
    """
    index, trust = sources.read(recipe.sources, architecture(), recipe.unsigned)
    names = recipe.packages or (*packages.packages(recipe.profiles), *guest_packages.DEBIAN)
    unknown = [name for name in names if name not in index.best]
    if unknown:
        raise DesktopImageError(f"the archives have no package {', '.join(unknown)}")
    preferred = [name for name in PREFERRED if name in index.best]
    base = index.closure([*preferred, *index.base()])
    everything = index.closure([*(package.name for package in base), *names])
    if recipe.pinned is not None:
        _check_pins(everything, recipe.pinned)
    return Choice(tuple(base), tuple(everything), trust)


def _check_pins(packages: Sequence[debian.Package], pinned: Manifest) -> None:
    pins = {part.name: part for part in pinned.packages}
    present = {package.name: package for package in packages}
    lines = [
        f"{name} {pins[name].version if name in pins else '(not there)'}"
        for name in sorted({*pins, *present})
        if name not in pins or name not in present or present[name].sha256 != pins[name].sha256
    ]
    if lines:
        raise DesktopImageError(
            f"the archives do not have the {len(lines)} versions that the manifest pins:"
            f" {', '.join(lines[:5])}; give --mirror a snapshot of that time"
        )


def build(recipe: Recipe, name: str | None, report: Report) -> tuple[str, Manifest]:
    """Build an image into the cache.

    Args:
        recipe: what to build.
        name: what to call it; by its profiles, if not given.
        report: called with a line of text at each step.

    Returns:
        Its name, and its manifest.

    Raises:
        DesktopImageError: An archive cannot be used, namespaces are refused, or dpkg fails.
        StorageError: The disk is full.
    """
    image_name = cache.check_name(name or cache.default_name(recipe.profiles))
    began = time.monotonic()

    def say(text: str) -> None:
        report(f"{time.monotonic() - began:6.1f} s  {text}")

    with cache.cache_lock(report) as folder:
        choice = choose(recipe)
        size = 5.0 * sum(package.size for package in choice.all)
        cache.check_room(folder, size)
        paths = sources.fetch_packages(choice.all, folder / "packages", say)
        with cache.build_folder(folder) as fresh:
            log = folder / "build.log"
            log.unlink(missing_ok=True)
            python = _fill(fresh, choice, paths, log, say)
            image = describe(fresh, recipe, choice, python)
            cache.publish(fresh, image)
        cache.write_name(folder, image_name, image.id)
        say(f"image {image_name} ({image.id}): {image.summary}")
    return image_name, image


def _fill(fresh: Path, choice: Choice, paths: dict[str, Path], log: Path, say: Report) -> list[Pin]:
    began = time.time() - 1
    root = fresh / cache.ROOT
    _prepare(root, choice, paths)
    say(f"{len(choice.base)} base packages unpacked")
    python = fresh / cache.GUEST
    parts = guest_packages.install(python)
    _install(root, choice, paths, log, say)
    _clean(root)
    file_entries.set_times(root, began)
    # They remember the times of folders, so they come after those are settled.
    commands = _last_commands(root)
    unprivileged_chroot.run(
        root,
        commands,
        log,
        writable={"guest": python},
        environment={"SOURCE_DATE_EPOCH": str(file_entries.EPOCH)},
    )
    _clean(root)
    file_entries.set_times(fresh, began)
    say("configured")
    return parts


def _last_commands(root: Path) -> list[list[str]]:
    guest_folder = "/run/guest"
    compiled = ["python3", "-m", "compileall", "-q", "-j", "1"]
    commands = [
        [*compiled, "--invalidation-mode", "unchecked-hash", guest_folder],
        ["python3", "-I", "-S", "-B", "-c", guest_packages.PROOF],
    ]
    if (root / "usr/bin/fc-cache").exists():
        commands.append(["fc-cache", "--force", "--system-only"])
    return commands


def _prepare(root: Path, choice: Choice, paths: dict[str, Path]) -> None:
    for name in MERGED:
        if name == "lib64" and architecture() != "amd64":
            continue
        (root / "usr" / name).mkdir(parents=True)
        (root / name).symlink_to(f"usr/{name}")
    root.chmod(0o755)
    for package in choice.base:
        unpack(paths[package.name], root)
    for name in ("proc", "dev", "tmp", "run", "sys"):
        (root / name).mkdir(exist_ok=True)
    rules = ["force-unsafe-io"]
    rules += [f"path-exclude={pattern}" for pattern in EXCLUDED]
    rules += [f"path-include={pattern}" for pattern in INCLUDED]
    _write(root / "etc/dpkg/dpkg.cfg.d/image", "\n".join(rules) + "\n")
    _write(root / "usr/sbin/policy-rc.d", _NO_SERVICES, 0o755)
    for name in ("status", "available"):
        _write(root / "var/lib/dpkg" / name, "")
    for name in ("passwd", "group"):
        shutil.copyfile(root / f"usr/share/base-passwd/{name}.master", root / "etc" / name)


def _write(path: Path, text: str, mode: int = 0o644) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    path.chmod(mode)


def _install(root: Path, choice: Choice, paths: dict[str, Path], log: Path, say: Report) -> None:
    base = [package.name for package in choice.base]
    first = [name for name in FIRST if name in base]
    later = [name for name in base if name not in first]
    extra = [package.name for package in choice.all if package.name not in base]
    force = ["dpkg", "--force-depends"]
    mounts = {"packages": next(iter(paths.values())).parent}

    def files(names: Iterable[str]) -> list[str]:
        return [f"/run/packages/{paths[name].name}" for name in names]

    configure = [*force, "--configure", "--pending"]
    commands = [["ldconfig"], [*force, "--install", *files(first)]]
    if later:
        commands.append([*force, "--force-overwrite", "--unpack", *files(later)])
    unprivileged_chroot.run(root, [*commands, configure], log, mounts)
    say("base packages configured")
    if extra:
        unprivileged_chroot.run(root, [[*force, "--unpack", *files(extra)]], log, mounts)
        say(f"{len(extra)} more packages unpacked")
    unprivileged_chroot.run(root, [["dpkg", "--configure", "--pending"]], log, mounts)


def unpack(path: Path, root: Path) -> None:
    """Unpack the files of a package, those excepted that no desktop needs.

    Args:
        path: the package (deb(5)).
        root: where they go.

    Raises:
        DesktopImageError: It is no package.
    """
    try:
        data = _data(path.read_bytes())
        with tarfile.open(fileobj=io.BytesIO(data)) as archive:
            # Python 3.11.2 has no argument for it, and ignores this.
            archive.extraction_filter = _as_it_is
            members = [member for member in archive if is_wanted(member.name)]
            for member in members:
                member.uid, member.gid = os.geteuid(), os.getegid()
                member.uname = member.gname = ""
            archive.extractall(root, members)
    except (tarfile.TarError, lzma.LZMAError, ValueError) as error:
        raise DesktopImageError(f"{path}: is no Debian package ({error})") from None


def _as_it_is(member: tarfile.TarInfo, path: str) -> tarfile.TarInfo:
    """Return the filter for packages: their checksums were compared, and they may hold any file."""
    return member


def is_wanted(name: str) -> bool:
    """Return whether a file of a package goes into an image, as dpkg's `path-exclude` decides."""
    path = f"/{name.removeprefix('./').strip('/')}"
    if any(fnmatch(path, pattern) for pattern in INCLUDED):
        return True
    return not any(fnmatch(path, pattern) for pattern in EXCLUDED)


def _data(package: bytes) -> bytes:
    """Return the member `data.tar` of a package, which is an `ar` archive.

    Raises:
        ValueError: The package is no such archive, or has no `data.tar`.
    """
    if package[: len(_AR)] != _AR:
        raise ValueError("it does not begin as one")
    at = len(_AR)
    while at + _AR_HEADER <= len(package):
        name = package[at : at + 16].decode("ascii", "replace").strip()
        size = int(package[at + 48 : at + 58])
        at += _AR_HEADER
        if name.startswith("data.tar"):
            return package[at : at + size]
        at += size + size % 2
    raise ValueError("it has no data.tar")


def _clean(root: Path) -> None:
    """Remove what differs from build to build."""
    for name in LEFT:
        path = root / name
        if path.is_dir() and not path.is_symlink():
            file_entries.remove(path)
            path.mkdir()
        else:
            path.unlink(missing_ok=True)
    for pattern in LEFT_FILES:
        for path in root.glob(pattern):
            path.unlink()
    (root / "var/cache/apt/archives/partial").mkdir(parents=True, exist_ok=True)
    _forget_days(root / "etc/shadow")


def _forget_days(path: Path) -> None:
    """Set when passwords were changed, days since 1970, to the image's time."""
    if not path.is_file():
        return
    mode = path.stat().st_mode
    rows = [line.split(":") for line in path.read_text(encoding="utf-8").splitlines()]
    for row in rows:
        row[2] = _DAYS
    path.write_text("".join(":".join(row) + "\n" for row in rows), encoding="utf-8")
    path.chmod(mode & 0o7777)


def describe(fresh: Path, recipe: Recipe, choice: Choice, python: Sequence[Pin]) -> Manifest:
    """Write the manifest of the image in `fresh`, and the list of its files, beside them.

    Raises:
        DesktopImageError: A file is a device, a socket or a pipe.
    """
    entries = [file_entries.read_entry(path, fresh) for path in file_entries.walk(fresh)]
    listed = file_entries.listing(entries)
    (fresh / manifest.FILES).write_text(listed, encoding="utf-8")
    image = Manifest(
        suite=sources.SUITE,
        architecture=architecture(),
        profiles=recipe.profiles,
        trust=choice.trust,
        packages=tuple(Pin(p.name, p.version, p.sha256) for p in choice.all),
        python=tuple(python),
        files=len(entries),
        size=sum(entry.size for entry in entries),
        files_sha256=file_entries.digest(fresh / manifest.FILES),
    )
    (fresh / manifest.NAME).write_text(image.to_json(), encoding="utf-8")
    return image
