"""The parts for embedded desktops that this machine has and lacks, and how to add the latter."""

import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from hijack_data import extras

from .. import extra
from ..errors import MissingPackageError
from ..privilege import as_root
from . import home, packages
from .handle import INSTEAD, LINUX, PACKAGES
from .image import image_checks as images
from .runtime import limits, registry, rootless

# Does in a few milliseconds what a desktop needs of the kernel, in a process of its own, and leaves
# nothing.
_PROBE = """
import sys, tempfile, os
sys.path.insert(0, sys.argv[1])
from online_env.embedded.runtime import identity, kernel as k, rootless
rootless.check_rights()
identity.make(0, False, ())
k.unshare(k.CLONE_NEWNS | k.CLONE_NEWUTS | k.CLONE_NEWIPC | k.CLONE_NEWPID | k.CLONE_NEWNET)
k.mount("none", "/", flags=k.MS_REC | k.MS_PRIVATE)
place = sys.argv[2]
k.mount("tmpfs", place, "tmpfs", 0, "size=1m")
for name in ("up", "work", "root"):
    os.mkdir(f"{place}/{name}")
options = f"lowerdir=/,upperdir={place}/up,workdir={place}/work"
k.mount("overlay", f"{place}/root", "overlay", 0, options)
"""
# The same without root.
_ROOTLESS_PROBE = """
import sys, os
sys.path.insert(0, sys.argv[1])
from online_env.embedded.runtime import identity, kernel as k, rootless
rootless.enter()
identity.make(0, True, ())
k.unshare(k.CLONE_NEWUTS | k.CLONE_NEWIPC | k.CLONE_NEWPID)
place = sys.argv[2]
k.mount("tmpfs", place, "tmpfs", 0, "size=1m")
for name in ("up", "work", "usr"):
    os.mkdir(f"{place}/{name}")
options = f"lowerdir=/usr,upperdir={place}/up,workdir={place}/work,userxattr"
k.mount("overlay", f"{place}/usr", "overlay", 0, options)
"""
_PROBE_TIMEOUT_S = 20.0  # s for a probe
_REFUSED = "online_env.embedded.runtime.desktop_config.SetupError: "
# Whether users inside can have numbers of their own on the machine.
_SHIFT_PROBE = """
import sys
sys.path.insert(0, sys.argv[1])
from online_env.embedded.runtime import identity, root_file_system
folders = [*map(str, root_file_system.shown_folders()), *sys.argv[2:]]
sys.exit(not identity.make(0, False, folders).base)
"""


@dataclass(frozen=True)
class Finding:
    """One finding.

    Attributes:
        name: the name of the part that was examined.
        ok: whether it is as it should be.
        detail: the result.
        fix: the command that mends it; empty if there is none.
        required: whether no desktop starts without it.
    """

    name: str
    ok: bool
    detail: str
    fix: str = ""
    required: bool = True


def diagnose(profiles: Iterable[str] = ("web",), image: str | None = None) -> list[Finding]:
    """Return all findings.

    Args:
        profiles: the packages of others are not `required`.
        image: of the desktop (see `EmbeddedDesktop.up`); with one, the machine's packages do not
            matter and are not listed.
    """
    required_profiles = {"core", *profiles}
    required_profiles |= set(packages.PROFILES) if packages.ALL in required_profiles else set()
    with_image = images.is_asked_for(image)
    if platform.system() != LINUX:
        return [_system(with_image)]
    checks = [_system(with_image), _root()]
    if not with_image:
        checks += [_packages(name, name in required_profiles) for name in packages.PROFILES]
    checks += [Finding(*finding) for finding in images.findings(image)]
    return [*checks, _modules(), _kernel(), _users(), _layer(), _limits(), _orphans()]


def _system(with_image: bool) -> Finding:
    name = f"{platform.system()} {platform.release()}"
    if platform.system() != LINUX:
        return Finding("system", False, name, INSTEAD)
    fix = "hijack desktop install"
    return Finding("system", with_image or bool(shutil.which("apt-get")), name, fix)


def _root() -> Finding:
    if os.geteuid() == 0:
        return Finding("root", True, "you are root")
    return Finding("root", False, rootless.LACKING, as_root("desktop", "..."), required=False)


def _packages(profile: str, required: bool) -> Finding:
    names = packages.PROFILES[profile]
    try:
        lacking = packages.missing(names)
    except MissingPackageError as error:
        return Finding(f"packages {profile}", False, str(error), required=required)
    detail = (
        f"{len(lacking)} of {len(names)} are missing: {' '.join(lacking)}"
        if lacking
        else f"{len(names)} installed"
    )
    return Finding(
        f"packages {profile}",
        not lacking,
        detail,
        f"hijack desktop install --profile {profile}",
        required,
    )


def _modules() -> Finding:
    lacking = extras.lacking(extra.DESKTOP)
    detail = f"{len(extra.DESKTOP)} Python modules installed"
    if lacking:
        detail = f"missing: {' '.join(lacking)}"
    return Finding("python", not lacking, detail, extras.remedy(extra.EXTRA))


def _kernel() -> Finding:
    folder = Path(tempfile.mkdtemp(prefix="agenthijack-probe-"))
    try:
        probe = _probed(_PROBE if os.geteuid() == 0 else _ROOTLESS_PROBE, str(folder))
    except subprocess.TimeoutExpired:
        return Finding("namespaces", False, _too_slow())
    finally:
        folder.rmdir()
    if probe.returncode == 0:
        return Finding("namespaces", True, "namespaces and overlay mounts work")
    reason = (probe.stderr.strip().splitlines() or ["the probe said nothing"])[-1]
    reason = reason.removeprefix(_REFUSED)
    way = rootless.way_out(reason)
    return Finding("namespaces", False, reason.removesuffix(f"; {way}"), way)


def _probed(code: str, *words: str) -> "subprocess.CompletedProcess[str]":
    """Run a probe in a process of its own.

    Raises:
        TimeoutExpired: It did not end in time.
    """
    return subprocess.run(
        [sys.executable, "-I", "-S", "-c", code, str(PACKAGES), *words],
        capture_output=True,
        text=True,
        timeout=_PROBE_TIMEOUT_S,
        check=False,
    )


def _too_slow() -> str:
    return f"the probe did not end within {_PROBE_TIMEOUT_S:g} s"


def _layer() -> Finding:
    path = home.layer_path()
    detail = (
        str(path) if path.is_dir() else "the golden home is not made yet (or is of another version)"
    )
    return Finding("golden home", path.is_dir(), detail, "hijack desktop install")


def _limits() -> Finding:
    writable = {
        group.resource: os.access(group.folder.parent, os.W_OK) for group in limits.groups("x")
    }
    enforced = [resource for resource in limits.RESOURCES if writable.get(resource)]
    lacking = [resource for resource in limits.RESOURCES if not writable.get(resource)]
    parts = (
        [f"control groups limit the {' and the '.join(enforced)} of a desktop"] if enforced else []
    )
    parts += [f"nothing limits the {' and the '.join(lacking)} of a desktop as a whole"] * bool(
        lacking
    )
    return Finding("limits", not lacking, "; ".join(parts), required=False)


def _users() -> Finding:
    name = "users inside"
    if os.geteuid() != 0:
        return Finding(name, True, "the desktop's user is you, without rights outside")
    layer = home.layer_path()
    folders = [str(layer / "home")] if layer.is_dir() else []
    try:
        probe = _probed(_SHIFT_PROBE, *folders)
    except subprocess.TimeoutExpired:
        return Finding(name, False, _too_slow(), required=False)
    if probe.returncode == 0:
        return Finding(name, True, "have numbers that nobody has on this machine")
    detail = (
        "root inside has no rights outside, but its number: the kernel or a file system cannot map"
    )
    return Finding(
        name, False, detail, "use Linux 5.19 or newer with /usr on ext4, xfs or btrfs", False
    )


def _orphans() -> Finding:
    orphan_ids = [record["id"] for record in registry.orphans()]
    detail = f"left over: {', '.join(orphan_ids)}" if orphan_ids else "nothing left over"
    return Finding(
        "leftovers", not orphan_ids, detail, "hijack desktop list --sweep", required=False
    )
