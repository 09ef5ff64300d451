"""The time that each profile of the embedded desktop takes to install on a bare Debian.

It needs root and debootstrap.

The bare Debian (`minbase`) is made in a folder that goes away again, with this machine's package
sources; nothing is installed on the machine itself. Fetching depends on the network, so it is timed
apart.
"""

import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import machine, table
from online import on_disk

from online_env.embedded.packages import APT_OPTIONS, PROFILES

# Packages find /proc, start no service, and ask nothing; all of it is gone with this namespace.
INSIDE = (
    "unshare",
    "--mount",
    "--pid",
    "--fork",
    "sh",
    "-c",
    'mount -t proc proc "$0/proc" && exec chroot "$0" env DEBIAN_FRONTEND=noninteractive "$@"',
)
NO_SERVICES = "#!/bin/sh\nexit 101\n"  # what policy-rc.d says to forbid it


def main() -> None:
    """Print the table, or why there is none."""
    if os.geteuid() != 0 or shutil.which("debootstrap") is None:
        print("Not measured: needs root and debootstrap (apt-get install debootstrap).")
        return
    with tempfile.TemporaryDirectory(dir="/var/tmp") as folder:
        root = Path(folder)
        rows = [
            ["bare Debian (debootstrap --variant=minbase)", "", f"{timed(bare, root):.0f} s", ""]
        ]
        for name, expected in PROFILES.items():
            rows.append(profile(root, name, expected))
    print(machine(), end="\n\n")
    print(table(["what", "to fetch", "to unpack and set up", "on disk, as the packages say"], rows))


def timed(work, *arguments) -> float:
    """Seconds that a call takes."""
    start = time.perf_counter()
    work(*arguments)
    return time.perf_counter() - start


def bare(root: Path) -> None:
    """Make a Debian of the machine's own release in `root`, with its package sources."""
    release = platform.freedesktop_os_release()["VERSION_CODENAME"]
    sites = run(
        "apt-get",
        "indextargets",
        "--format",
        "$(SITE)",
        "Created-By: Packages",
        f"Codename: {release}",
    )
    run("debootstrap", "--variant=minbase", release, str(root), sites.split()[0])
    for folder in ("etc/apt", "usr/share/keyrings"):
        shutil.copytree(Path("/", folder), root / folder, dirs_exist_ok=True)
    policy = root / "usr/sbin/policy-rc.d"
    policy.write_text(NO_SERVICES)
    policy.chmod(0o755)
    run(*INSIDE, str(root), "apt-get", "update")


def profile(root: Path, name: str, wanted: tuple[str, ...]) -> list[str]:
    """Fetch and install what a profile adds to those before it."""
    before = installed(root)
    command = (*INSIDE, str(root), "apt-get", "install", *APT_OPTIONS)
    fetch = timed(run, *command, "--download-only", *wanted)
    setup = timed(run, *command, "--no-download", *wanted)
    new = sorted(installed(root) - before)
    size = f"{on_disk(new) / 1e6:.0f} MB"
    return [
        f"profile {name}, after those above: {len(new)} packages",
        f"{fetch:.0f} s",
        f"{setup:.0f} s",
        size,
    ]


def installed(root: Path) -> set[str]:
    """The packages of a root."""
    return set(run("dpkg-query", "--root", str(root), "-W", "-f=${Package}\n").split())


def run(*command: str) -> str:
    """What a command prints; ends the benchmark with what it complained about where it fails."""
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    if process.returncode:
        sys.exit(f"{command[0]} failed:\n{(process.stderr or process.stdout)[-2000:]}")
    return process.stdout


if __name__ == "__main__":
    main()
