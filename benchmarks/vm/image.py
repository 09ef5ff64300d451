"""Builds the guest of `virtual_machine.py` from this machine's kernel and packages.

The disk holds the packages of `hijack desktop install` and all they depend on, as they are
installed here, with the golden home. It is kept in `~/.cache/agenthijack/vm` and built anew when a
package, the golden home or this file changes. Our own code comes on a second disk, made for each
run, so that the guest runs what the checkout holds.
"""

import contextlib
import fcntl
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from online import fetched

from hijack_data.errors import HijackError
from online_env.embedded import home, packages
from online_env.embedded.runtime import account
from online_env.embedded.runtime.hidden_folders import LAYERS

CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "agenthijack" / "vm"
REPOSITORY = Path(__file__).resolve().parents[2]
CODE = "opt/agenthijack/code"
SITE = "opt/agenthijack/site"
KERNEL = "linux-image-cloud-amd64"
MODULES = ("virtio_pci", "virtio_blk", "virtio_net")
# Whole trees that no package of the desktop needs, besides the files of packages that it does not
# need.
ROOTS = ("/usr", "/etc", "/var/lib", "/var/cache/fontconfig")
SKIPPED = frozenset(
    {
        "/usr/local",
        "/usr/src",
        "/usr/share/doc",
        "/usr/lib/jvm",
        "/usr/lib/node_modules",
        "/var/lib/apt",
        "/var/lib/dpkg",
        "/var/lib/docker",
        str(LAYERS),
    }
)
FOLDERS = (
    "proc",
    "sys",
    "dev",
    "run",
    "tmp",
    "root",
    "usr/local/lib",
    "var/log",
    "var/tmp",
    CODE,
    SITE,
)
# What the guest server imports; its own requirements come along.
DISTRIBUTIONS = (
    "uvicorn",
    "starlette",
    "python-multipart",
    "python-xlib",
    "mss",
    "jeepney",
    "isal",
    "numpy",
    "pillow",
)
FIRST = f"import sys; sys.path[:0] = ['/{CODE}', '/{SITE}']; import inside; inside.main()"
START = """#!/busybox sh
export PATH=/bin
/busybox mount -t proc none /proc
/busybox mount -t sysfs none /sys
/busybox mount -t devtmpfs none /dev
for name in {modules}; do /busybox insmod /$name.ko; done
until [ -b /dev/vda ] && [ -b /dev/vdb ]; do /busybox usleep 1000; done
/busybox ip link set lo up
/busybox ip address add 10.0.2.15/24 dev eth0
/busybox ip link set eth0 up
/busybox ip route add default via 10.0.2.2
/busybox mount -t ext4 -o noatime /dev/vda /disk
/busybox mount -t ext4 -o ro /dev/vdb /disk/{code}
for name in proc sys dev; do /busybox mount -o move /$name /disk/$name; done
exec /busybox switch_root /disk /usr/bin/python3 -I -c "{first}"
"""


class MissingPartError(HijackError):
    """Something that the guest needs and this machine lacks; the message says what mends it."""


@dataclass(frozen=True)
class Image:
    """The files of the guest; `code` is the disk of this run."""

    disk: Path
    kernel: Path
    initramfs: Path
    code: Path

    @property
    def size(self) -> int:
        """Bytes that they take, holes not counted."""
        return sum(
            path.stat().st_blocks * 512
            for path in (self.disk, self.kernel, self.initramfs, self.code)
        )


@contextlib.contextmanager
def prepared() -> Iterator[tuple[Image, Path]]:
    """Return the guest, built now (minutes) if it is missing, and a folder for this run.

    A missing part of the machine is a `MissingPartError`.

    Several runs may use the cache at once; one that builds waits until it is alone.
    """
    CACHE.mkdir(parents=True, exist_ok=True)
    CACHE.chmod(0o700)  # the image holds this machine's /etc
    with (CACHE / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        folder = _ensure_guest()
        fcntl.flock(lock, fcntl.LOCK_SH)
        with tempfile.TemporaryDirectory(prefix="run-", dir=CACHE) as run:
            code = Path(run, "code.img")
            _code_disk(code)
            yield (
                Image(folder / "disk.img", folder / "vmlinuz", folder / "initramfs", code),
                Path(run),
            )


def _ensure_guest() -> Path:
    home.ensure_layer()
    folder = CACHE / f"guest-{_digest()}"
    for path in (*CACHE.glob("guest-*"), *CACHE.glob("building-*"), *CACHE.glob("run-*")):
        if path != folder:  # of another version, or left by a run that was killed
            shutil.rmtree(path)
    if not folder.is_dir():
        print(
            f"building the guest in {CACHE}; this takes a few minutes, once",
            file=sys.stderr,
            flush=True,
        )
        fresh = Path(tempfile.mkdtemp(prefix="building-", dir=CACHE))
        try:
            _start_files(fresh)
            _disk(fresh)
            fresh.rename(folder)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)
    return folder


def _code_disk(target: Path) -> None:
    """Make a disk with our packages and the guest's first process."""
    with tempfile.TemporaryDirectory(dir=CACHE, prefix="run-") as name:
        folder = Path(name)
        leave = shutil.ignore_patterns("__pycache__")
        for package in ("hijack_data", "online_env"):
            shutil.copytree(REPOSITORY / package, folder / package, ignore=leave)
        shutil.copy(Path(__file__).with_name("inside.py"), folder)
        _run("/usr/bin/python3", "-m", "compileall", "-q", "-s", folder, "-p", f"/{CODE}", folder)
        _file_system(folder, target, "128M")


def _digest() -> str:
    query = ["dpkg-query", "-W", *packages.packages([packages.ALL])]
    listed = subprocess.run(query, capture_output=True, text=True, check=False).stdout
    versions = [f"{item.name} {item.version}" for item in _distributions()]
    text = "\n".join(
        [listed, *versions, home.layer_path().name, Path(__file__).read_text(encoding="utf-8")]
    )
    return hashlib.blake2b(text.encode(), digest_size=6).hexdigest()


def _run(*command: str | Path, folder: Path | None = None) -> str:
    try:
        process = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise MissingPartError(
            f"{command[0]} is not on this machine: the guest is built on Debian, with apt"
        ) from None
    if process.returncode:
        result = " ".join(map(str, command[:4]))
        raise MissingPartError(
            f"`{result} ...` failed: {process.stderr.strip()[-400:]}; try `apt-get update` first"
        )
    return process.stdout


def _start_files(folder: Path) -> None:
    """Return Debian's kernel, and an initramfs that finds the disks and the network."""
    depends = re.search(r"Depends: (linux-image-\S+)", _run("apt-cache", "depends", KERNEL))
    if depends is None:
        raise MissingPartError(
            f"apt knows no package {KERNEL}; `apt-get update` fetches the lists (Debian, amd64)"
        )
    with tempfile.TemporaryDirectory(dir=folder) as name:
        place = Path(name)
        _run(
            "apt-get",
            "-o",
            "APT::Sandbox::User=root",
            "download",
            depends[1],
            "busybox-static",
            folder=place,
        )
        for archive in place.glob("*.deb"):
            _run("dpkg", "-x", archive, place / "files")
        shutil.copy(next(place.glob("files/boot/vmlinuz-*")), folder / "vmlinuz")
        modules = list(_with_depends(MODULES, {path.stem: path for path in place.rglob("*.ko")}))
        start = START.format(
            modules=" ".join(path.stem for path in modules), code=CODE, first=FIRST
        )
        parts = [(f"{path.stem}.ko", 0o100644, path.read_bytes()) for path in modules]
        parts += [(name, 0o40755, b"") for name in ("proc", "sys", "dev", "disk")]
        parts += [
            ("init", 0o100755, start.encode()),
            ("busybox", 0o100755, (place / "files/bin/busybox").read_bytes()),
        ]
        archive = b"".join(
            _cpio(*part) for part in (*parts, ("dev/console", 0o20600, b""), ("TRAILER!!!", 0, b""))
        )
        (folder / "initramfs").write_bytes(archive)


def _with_depends(names: Iterable[str], known: dict[str, Path]) -> Iterator[Path]:
    """Kernel modules in the order to load them; what is not a file is built in."""
    result: set[str] = set()

    def visit(name: str) -> Iterator[Path]:
        path = known.get(name) or known.get(name.replace("_", "-"))
        if path is None or name in result:
            return
        result.add(name)
        value = re.search(rb"\0depends=([^\0]*)\0", path.read_bytes())
        for needed in value[1].decode().split(",") if value else ():
            yield from visit(needed)
        yield path

    for name in names:
        yield from visit(name)


def _cpio(name: str, mode: int, data: bytes) -> bytes:
    """Return one entry of an initramfs ("newc", the kernel's buffer-format.rst).

    A device is the console (5, 1).
    """
    device = (5, 1) if mode & 0o170000 == 0o20000 else (0, 0)
    fields = (0, mode, 0, 0, 1, 0, len(data), 0, 0, *device, len(name) + 1, 0)
    head = b"070701" + b"".join(b"%08x" % field for field in fields) + name.encode() + b"\0"
    return head + bytes(-len(head) % 4) + data + bytes(-len(data) % 4)


def _disk(folder: Path) -> None:
    """A root file system with the desktop's packages."""
    with tempfile.TemporaryDirectory(dir=folder) as name:
        root = Path(name)
        root.chmod(0o755)
        _copy(_system_files(), root)
        for path in (
            Path("/") / name for name in ("bin", "sbin", "lib", "lib32", "lib64", "libx32")
        ):
            if path.is_symlink():
                (root / path.name).symlink_to(path.readlink())
        for name in FOLDERS:
            (root / name).mkdir(parents=True, exist_ok=True)
        layer = home.layer_path()
        shutil.copytree(layer / "system", root, dirs_exist_ok=True)
        (root / "home").mkdir()
        _run("cp", "-a", layer / "home", root / account.HOME.lstrip("/"))
        _install_distributions(root / SITE)
        _file_system(root, folder / "disk.img", "12G")


def _system_files() -> Iterator[str]:
    """Return the paths below `ROOTS` without those that belong to other packages alone."""
    query = ["dpkg-query", "-W", "-f=${Package} ${Priority}\n"]
    listed = _run(*query).splitlines()
    with tempfile.TemporaryDirectory() as empty:
        base = ["apt", *(line.split()[0] for line in listed if line.endswith(" required"))]
        expected = set(fetched([*base, *packages.packages([packages.ALL])], Path(empty)))
    ours = set[str]()
    remaining = set[str]()
    for path in Path("/var/lib/dpkg/info").glob("*.list"):
        names = path.read_text(encoding="utf-8").splitlines()
        # /bin is a link to /usr/bin, and packages name either.
        whole = (
            f"/usr{name}" if name.startswith(("/bin/", "/sbin/", "/lib")) else name
            for name in names
        )
        (ours if path.stem.split(":")[0] in expected else remaining).update(whole)
    left_out = (remaining - ours) | SKIPPED
    for top in ROOTS:
        yield from (str(path) for path in reversed(Path(top).parents[:-1]))
        for folder, folders, files in os.walk(top):
            folders[:] = [name for name in folders if f"{folder}/{name}" not in left_out]
            links = [name for name in folders if os.path.islink(f"{folder}/{name}")]
            yield folder
            yield from (
                f"{folder}/{name}"
                for name in (*files, *links)
                if f"{folder}/{name}" not in left_out
            )


def _copy(paths: Iterable[str], root: Path) -> None:
    with tempfile.NamedTemporaryFile() as listed:
        listed.write(b"".join(os.fsencode(path.lstrip("/")) + b"\0" for path in paths))
        listed.flush()
        read = ["tar", "-C", "/", "--no-recursion", "--null", "-T", listed.name, "-cf", "-"]
        with subprocess.Popen(read, stdout=subprocess.PIPE) as source:
            subprocess.run(["tar", "-C", root, "-xpf", "-"], stdin=source.stdout, check=True)
    if source.returncode:
        raise MissingPartError(
            f"copying this machine's packages failed: tar ended with {source.returncode}"
        )


def _distributions() -> list[metadata.Distribution]:
    """The Python packages of the guest server and what they require."""
    entries: dict[str, metadata.Distribution] = {}
    waiting: list[str] = list(DISTRIBUTIONS)
    while waiting:
        name = waiting.pop()
        try:
            result = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            if name in DISTRIBUTIONS:
                raise MissingPartError(
                    f"the Python package {name} is missing: pip install agenthijack[online]"
                ) from None
            continue  # for other versions of Python or other systems
        if result.name not in entries:
            entries[result.name] = result
            needs = [line for line in result.requires or () if "extra ==" not in line]
            waiting += [match[0] for line in needs if (match := re.match(r"[\w.-]+", line))]
    return sorted(entries.values(), key=lambda result: result.name)


def _install_distributions(target: Path) -> None:
    for item in _distributions():
        for file in item.files or ():
            if ".." not in file.parts and file.suffix != ".pyc":
                copy = target / file
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(str(file.locate()), copy)
    _run("/usr/bin/python3", "-m", "compileall", "-q", "-s", target, "-p", f"/{SITE}", target)


def _file_system(folder: Path, target: Path, size: str) -> None:
    options = "lazy_itable_init=0,lazy_journal_init=0,root_owner=0:0"
    _run("mkfs.ext4", "-q", "-m", "0", "-E", options, "-d", folder, target, size)
