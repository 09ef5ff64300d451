"""Root's rights over the network of an embedded desktop, for scripts that run on the machine.

Root inside has none of them, on purpose. Without root, the caller's are those of the keeper's user
namespace, which it may enter because it owns it. The programs are the machine's, or those of the
desktop's image.
"""

import os
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..desktops.protocol import RunResult
from ..errors import DesktopError
from .runtime import kernel, network

SCRIPT_TIMEOUT_S = 60.0
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


def run(record: Mapping[str, Any], script: str) -> RunResult:
    """Run a shell script in the desktop's network.

    Args:
        record: of the desktop.
        script: for `sh`.

    Raises:
        DesktopError: The desktop is gone, or the script does not end.
    """
    try:
        process = subprocess.run(
            ["/bin/sh", "-c", script],
            capture_output=True,
            text=True,
            timeout=SCRIPT_TIMEOUT_S,
            check=False,
            cwd="/",
            env={"PATH": PATH, "LC_ALL": "C"},
            preexec_fn=lambda: _enter(record),
        )
    except subprocess.TimeoutExpired:
        raise DesktopError(f"`{script[:200]}` did not end within {SCRIPT_TIMEOUT_S:g} s") from None
    except (OSError, subprocess.SubprocessError) as error:
        raise DesktopError(
            f"the network of desktop {record['id']!r} cannot be entered ({error}); is it gone?"
        ) from None
    return RunResult("success", process.stdout, process.stderr, process.returncode)


def _enter(record: Mapping[str, Any]) -> None:
    """Enter the network, and the image if there is one, with this process alone."""
    if record["rootless"]:
        keeper = record["keeper"][0]
        kernel.join_namespace(f"/proc/{keeper}/ns/user", kernel.CLONE_NEWUSER)
        kernel.join_namespace(f"/proc/{keeper}/ns/mnt", kernel.CLONE_NEWNS)
    kernel.join_namespace(str(network.NETNS / record["netns"]), kernel.CLONE_NEWNET)
    root = record["system"]
    if root == "/":
        return
    kernel.unshare(kernel.CLONE_NEWNS)
    kernel.mount("none", "/", flags=kernel.MS_REC | kernel.MS_PRIVATE)
    for name in ("proc", "dev"):
        kernel.mount(f"/{name}", f"{root}/{name}", flags=kernel.MS_BIND | kernel.MS_REC)
    kernel.mount("tmpfs", f"{root}/run", "tmpfs", 0, "size=1m,mode=755")
    os.chroot(Path(root))
    os.chdir("/")
