"""Replaces the machine's Python by the image's in the spawner of guest servers.

The process takes the image for its root, in which it alone sees our packages and those of the guest
server, and executes the image's own Python. So the Python of the machine, its version and its C
library do not matter to what runs inside; and no desktop shows that code.
"""

import os
import socket
import sys
from importlib.machinery import PathFinder
from pathlib import Path
from typing import NoReturn

from . import kernel
from .desktop_config import DesktopConfig
from .identity import Identity

PYTHON = "/usr/bin/python3"
PACKAGES = ("hijack_data", "online_env")
# Below the root of the image, while the guest server loads.
SEARCH_PATH = ("/run/code", "/run/guest", "/usr/lib/python3/dist-packages")
_CODE = (
    f"import sys; sys.path[:0] = {list(SEARCH_PATH)};"
    " from online_env.embedded.runtime.guest_spawner import resume; resume(*map(int, sys.argv[1:]))"
)
_HERE = Path(__file__).resolve().parents[3]


def become(order: DesktopConfig, identity: Identity, line: socket.socket) -> NoReturn:
    """Go on as `guest_spawner.resume` in the image's Python.

    Args:
        order: of the desktop.
        identity: of the desktop's processes.
        line: to process 1.

    Raises:
        OSError: A mount is refused, or the image's Python does not start.
    """
    kernel.unshare(kernel.CLONE_NEWNS)
    kernel.mount("none", "/", flags=kernel.MS_REC | kernel.MS_PRIVATE)
    _take_root(Path(order.system), Path(order.image, "guest"))
    text = os.memfd_create("order", 0)
    os.write(text, order.to_json().encode())
    os.lseek(text, 0, os.SEEK_SET)
    inherited = (text, line.fileno(), identity.namespace)
    for descriptor in inherited:
        os.set_inheritable(descriptor, True)
    numbers = (*inherited, identity.base, int(identity.rootless))
    argv = [PYTHON, "-I", "-S", "-B", "-c", _CODE, *map(str, numbers)]
    # No threads of BLAS: they would not survive a fork.
    os.execve(PYTHON, argv, {"LANG": "C.UTF-8", "OPENBLAS_NUM_THREADS": "1"})


def _take_root(root: Path, guest: Path) -> None:
    kernel.mount(str(root), str(root), flags=kernel.MS_BIND)
    for name in ("proc", "dev"):
        flags = kernel.MS_BIND | kernel.MS_REC
        kernel.mount(f"/{name}", str(root / name), flags=flags)
    kernel.mount("tmpfs", str(root / "run"), "tmpfs", 0, "size=1m,mode=755")
    mounts = {f"code/{name}": _HERE / name for name in PACKAGES}
    for name, path in {**mounts, "guest": guest}.items():
        target = root / "run" / name
        target.mkdir(parents=True)
        kernel.bind(str(path), str(target), read_only=True)
    os.chdir(root)
    kernel.pivot_root()
    kernel.unmount(".")
    os.chdir("/")


def forget_modules() -> None:
    """Import nothing from files any more: inside, they are the agent's to write."""
    sys.meta_path[:] = [finder for finder in sys.meta_path if finder is not PathFinder]
    sys.path.clear()
    sys.path_importer_cache.clear()
