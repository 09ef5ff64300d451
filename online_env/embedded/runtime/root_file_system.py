"""The file system of one desktop: system folders, and over them a layer in memory.

    upper  tmpfs, limited in size, gone with the desktop
    lower  /usr, /etc, /var, /opt of an image, or else the machine's own; for the home the golden
           home (home.py)

Nothing else of the machine is there, and nothing of ours: what the desktop needs written is made in
the upper folders before they are laid over the machine's, and what it must not see is covered there
(hidden_folders.py). No Python of ours is shown either: the guest server has loaded all it needs
before it comes in (guest_spawner.py).
"""

import os
import shutil
import stat
from collections.abc import Iterator
from pathlib import Path

from . import account, kernel, session
from .desktop_config import DesktopConfig, SetupError
from .identity import Identity
from .network import WEB_ADDRESS

ROOT = Path("/")
SYSTEM_FOLDERS = ("bin", "sbin", "lib", "lib32", "lib64", "libx32", "usr", "etc", "var", "opt")
EMPTY_FOLDERS = ("boot", "media", "mnt", "srv")
DEVICES = ("null", "zero", "full", "random", "urandom", "tty")
DEVICE_LINKS = {
    "fd": "/proc/self/fd",
    "stdin": "fd/0",
    "stdout": "fd/1",
    "stderr": "fd/2",
    "ptmx": "pts/ptmx",
}
READ_ONLY_PROC = ("sys", "sysrq-trigger", "irq", "bus")
CHROMIUM = Path("usr/lib/chromium")
LOCAL_BIN = Path(session.TOOLS.lstrip("/"))
GUEST_FILES = Path(__file__).resolve().parents[1] / "guest"
# Files that replace the machine's own.
CHANGED_FILES = (
    Path("etc/passwd"),
    Path("etc/group"),
    Path("etc/shadow"),
    Path("etc/hostname"),
    Path("etc/hosts"),
    Path("etc/resolv.conf"),
    Path("etc/machine-id"),
)
SUDO_RULES = Path("etc/sudoers.d")
MACHINE_ID = "6a7d1e0c5b8f4c2e9d3a0f1b2c4d5e6f"
QUIET = kernel.MS_NOSUID | kernel.MS_NODEV


def enter_root(order: DesktopConfig, identity: Identity, folder: Path) -> None:
    """Build the desktop's file system on `folder` and make it the root.

    It needs a mount namespace of its own. A mount that fails is a `SetupError`.
    """
    kernel.mount("none", "/", flags=kernel.MS_REC | kernel.MS_PRIVATE)
    options = f"size={order.storage},nr_inodes=500k,mode=755"
    kernel.mount("tmpfs", str(folder), "tmpfs", kernel.MS_NODEV, options)
    os.chdir(folder)  # so that lists of mounts name no folder of the machine's
    for name in ("root", "low", "up", "work"):
        Path(name).mkdir()
    fill_upper(Path("up"), order, identity)
    root = folder / "root"
    _system(root, order, identity)
    _home(root, order, identity)
    _system_mounts(root, order, identity)
    _runtime(root, identity)
    _pivot(root)


def shown_folders(system: str = "/") -> list[Path]:
    """Return the folders that a desktop is laid over, below the root `system`."""
    paths = [Path(system, name) for name in SYSTEM_FOLDERS]
    return [path for path in paths if path.is_dir() and not path.is_symlink()]


def fill_upper(upper: Path, order: DesktopConfig, identity: Identity) -> None:
    """Write what lies over the system folders into `upper`, as it is to look from `/` on."""
    system = Path(order.system)
    for path in shown_folders(order.system):
        _same_folder(upper / path.name, path)
    for name in CHANGED_FILES:
        _copy(system / name, upper / name)
    if (system / SUDO_RULES).is_dir():
        _same_folder(upper / SUDO_RULES, system / SUDO_RULES)
    _merge(Path(order.layer, "system"), upper, system)
    account.write_account(upper, order.osworld, shadowed=not order.rootless)
    etc = upper / "etc"
    (etc / "resolv.conf").write_text(f"nameserver {WEB_ADDRESS}\n", encoding="ascii")
    (etc / "machine-id").write_text(f"{MACHINE_ID}\n", encoding="ascii")
    install_guest_files(upper, system)
    name_browser(upper, system)
    # Nothing of the machine's is in an image.
    for path in () if order.image else order.hidden:
        hide(Path(path), upper)
    for path in (upper, *upper.rglob("*")):
        status = path.lstat()
        identity.chown(path, status.st_uid, status.st_gid)


def hide(path: Path, upper: Path) -> None:
    """Let nothing be found at `path`, whether it is there by now or comes later."""
    if len(path.parts) < 3 or path.parts[1] not in SYSTEM_FOLDERS:
        return  # a whole system folder cannot go, and all else is out of sight
    for number in range(2, len(path.parts)):
        above = Path(*path.parts[:number])
        if not above.is_dir():
            path = above
            break
        shown_path = upper.joinpath(*above.parts[1:])
        _same_folder(shown_path, above)
        if not shown_path.is_dir():
            return  # what is above it is covered
    cover = upper.joinpath(*path.parts[1:])
    if cover.is_dir():
        shutil.rmtree(cover)
    cover.unlink(missing_ok=True)
    os.mknod(cover, stat.S_IFCHR, 0)  # to an overlay, it says that what is below has been removed


def _same_folder(target: Path, original: Path) -> None:
    """Make `target` a folder with the owner and the mode of `original`, if it is not there yet."""
    if target.exists():
        return
    if not target.parent.exists():
        _same_folder(target.parent, original.parent)
    target.mkdir()
    if not original.is_dir():
        return
    status = original.stat()
    if os.geteuid() == 0 and _is_mapped(status):
        os.chown(target, status.st_uid, status.st_gid)
    target.chmod(stat.S_IMODE(status.st_mode))


def _is_mapped(status: os.stat_result) -> bool:
    """Whether this process may give a file to that owner; without root there is one owner only."""
    text = Path("/proc/self/uid_map").read_text(encoding="ascii").split()
    return int(text[2]) > max(status.st_uid, status.st_gid)


def _copy(source: Path, target: Path) -> None:
    is_readable = os.access(source, os.R_OK)
    target.write_bytes(source.read_bytes() if is_readable else b"")
    if source.exists():
        status = source.stat()
        target.chmod(stat.S_IMODE(status.st_mode))
        if _is_mapped(status):
            os.chown(target, status.st_uid, status.st_gid)


def _merge(source: Path, upper: Path, system: Path) -> None:
    """Copy a tree into `upper`, with new folders as the system's of that name are."""
    for path in sorted(source.rglob("*")):
        name = path.relative_to(source)
        if path.is_dir():
            _same_folder(upper / name, system / name)
        else:
            shutil.copyfile(path, upper / name)


def install_guest_files(upper: Path, system: Path = ROOT) -> None:
    """Copy the commands (`bin`) and the pyautogui module (`shim`) that the user's programs see."""
    _same_folder(upper / LOCAL_BIN, system / LOCAL_BIN)
    for name in ("bin", "shim"):
        target = upper / LOCAL_BIN / name
        for path, copy in _guest_files(name, target):
            if path.is_dir():
                copy.mkdir(exist_ok=True)
            else:
                copy.write_bytes(path.read_bytes())
            is_program = path.is_dir() or name == "bin"
            copy.chmod(0o755 if is_program else 0o644)


def _guest_files(name: str, target: Path) -> Iterator[tuple[Path, Path]]:
    source = GUEST_FILES / name
    yield source, target
    for path in sorted(source.rglob("*")):
        if "__pycache__" not in path.parts:
            yield path, target / path.relative_to(source)


def name_browser(upper: Path, system: Path = ROOT) -> None:
    """Give Chromium a second name, `chrome`.

    OSWorld's tasks end it with `pkill chrome`, which goes by the file. If the system has none, the
    command that starts it goes: whoever looks for a browser finds that there is none.
    """
    source = system / CHROMIUM
    if not (source / "chromium").exists():
        (upper / LOCAL_BIN / "bin" / "google-chrome").unlink(missing_ok=True)
        return
    target = upper / LOCAL_BIN / "chrome"
    target.mkdir()
    target.chmod(0o755)
    for path in source.iterdir():
        if path.name != "chromium":
            (target / path.name).symlink_to(f"/{CHROMIUM}/{path.name}")
    (target / "chrome").touch()  # the program itself is shown there


def _system(root: Path, order: DesktopConfig, identity: Identity) -> None:
    kernel.bind(str(root), str(root))  # a mount of its own, to become the root
    lower = shown_folders(order.system)
    for name in SYSTEM_FOLDERS:
        path = Path(order.system, name)
        if path in lower:
            (root / name).mkdir()
            _overlay(path, name, root / name, order, identity)
        elif path.is_symlink():
            (root / name).symlink_to(path.readlink())
            identity.chown(root / name, 0)
    for name in EMPTY_FOLDERS:
        _own_folder(root / name, identity)
    if not order.rootless:
        _own_folder(root / "root", identity, 0o700)
    identity.chown(root, 0)
    browser = root / LOCAL_BIN / "chrome/chrome"
    if browser.exists():
        kernel.bind(str(root / CHROMIUM / "chromium"), str(browser))


def _home(root: Path, order: DesktopConfig, identity: Identity) -> None:
    _own_folder(root / "home", identity)
    home = root / account.HOME.lstrip("/")
    home.mkdir()
    Path("up/home").mkdir()
    identity.chown("up/home", account.UID)
    _overlay(Path(order.layer, "home"), "home", home, order, identity)


def _overlay(
    source: Path, name: str, target: Path, order: DesktopConfig, identity: Identity
) -> None:
    """Lay `up/name` over the folder `source`.

    Raises:
        SetupError: The file system does not allow it.
    """
    lower = Path("low", name)
    (Path("work") / name).mkdir()
    try:
        if identity.base:
            lower.mkdir()
            tree = kernel.open_mapped_tree(str(source), identity.namespace)
            kernel.attach_tree(tree, str(lower))
        else:
            lower.symlink_to(source)
        options = f"lowerdir={lower},upperdir=up/{name},workdir=work/{name}"
        if order.rootless:
            options += ",userxattr"
        kernel.mount("overlay", str(target), "overlay", kernel.MS_NODEV, options)
    except OSError as error:
        raise SetupError(
            f"cannot lay the desktop's files over {source}: {error}; see `hijack desktop doctor`"
        ) from None


def _own_folder(path: Path, identity: Identity, mode: int = 0o755, uid: int = 0) -> None:
    path.mkdir()
    path.chmod(mode)
    identity.chown(path, uid)


def _system_mounts(root: Path, order: DesktopConfig, identity: Identity) -> None:
    none = kernel.MS_NOEXEC | QUIET
    owner = identity.owner()
    _memory_folder(root / "run", QUIET, f"size={64 << 20},mode=755{owner}")
    _memory_folder(root / "tmp", QUIET, f"size={order.storage // 2},mode=1777{owner}")
    _memory_folder(root / "dev", kernel.MS_NOSUID, f"size={1 << 20},mode=755{owner}")
    for name in ("proc", "sys"):
        (root / name).mkdir()
    kernel.mount("proc", str(root / "proc"), "proc", none)
    for name in READ_ONLY_PROC:
        path = root / "proc" / name
        if path.exists():
            kernel.bind(str(path), str(path), read_only=True)
    kernel.mount("sysfs", str(root / "sys"), "sysfs", none | kernel.MS_RDONLY)
    _devices(root / "dev", none, order, identity)


def _memory_folder(path: Path, flags: int, options: str) -> None:
    path.mkdir()
    kernel.mount("tmpfs", str(path), "tmpfs", flags, options)


def _devices(dev: Path, none: int, order: DesktopConfig, identity: Identity) -> None:
    for name in DEVICES:
        device = dev / name
        if order.rootless:
            device.touch()
            kernel.bind(f"/dev/{name}", str(device))
        else:
            number = os.stat(f"/dev/{name}").st_rdev
            os.mknod(device, stat.S_IFCHR | 0o666, number)
            device.chmod(0o666)
            identity.chown(device, 0)
    for name, target in DEVICE_LINKS.items():
        (dev / name).symlink_to(target)
        identity.chown(dev / name, 0)
    for name in ("pts", "shm"):
        (dev / name).mkdir()
    group = "" if order.rootless else f",gid={identity.base + 5}"
    flags = kernel.MS_NOSUID | kernel.MS_NOEXEC
    options = f"newinstance,ptmxmode=0666,mode=0620{group}"
    kernel.mount("devpts", str(dev / "pts"), "devpts", flags, options)
    size = f"size=512m,mode=1777{identity.owner()}"
    kernel.mount("shm", str(dev / "shm"), "tmpfs", none, size)


def _runtime(root: Path, identity: Identity) -> None:
    """The folders of a session."""
    for name in ("tmp/.X11-unix", "tmp/.ICE-unix"):
        _own_folder(root / name, identity, 0o1777)
    _own_folder(root / "run/user", identity)
    _own_folder(root / f"run/user/{account.UID}", identity, 0o700, account.UID)
    _own_folder(root / session.SCREEN_FOLDER.lstrip("/"), identity)


def _pivot(root: Path) -> None:
    os.chdir(root)
    try:
        kernel.pivot_root()
    except OSError as error:
        raise SetupError(f"cannot make the desktop's files the root: {error}") from None
    kernel.unmount(".")
    os.chdir("/")
