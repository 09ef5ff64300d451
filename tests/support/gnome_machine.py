"""A machine with a GNOME session, as OSWorld's virtual machine has one, in namespaces of its own.

    python -m support.gnome_machine install   # once, as root on Debian 12: 172 packages, 1.5 minutes
    python -m support.gnome_machine up        # until Ctrl+C; prints the address of its guest server

It is this machine's file system with GNOME's packages in a layer over it, which nothing else of this machine sees.
systemd, logind, GDM (for the password of the lock screen), GNOME Shell on X11 and Xvfb run as on a computer of its own; the
account is `user` with the password `password`. Its guest server is ours without a token, so OSWorld's routes alone are open.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from online_env.desktops.http import HttpDesktop
from online_env.errors import DesktopError

LAYER = Path(os.environ.get("AGENTHIJACK_GNOME", "/var/lib/agenthijack/gnome"))
PACKAGES = (
    "systemd-sysv",
    "dbus-user-session",
    "libpam-systemd",
    "gdm3",
    "gnome-shell",
    "gnome-session",
    "gnome-settings-daemon",
    "gnome-terminal",
    "nautilus",
    "gedit",
    "gnome-shell-extension-desktop-icons-ng",
    "xvfb",
    "at-spi2-core",
    "libatk-adaptor",
    "python3-xlib",
    "wmctrl",
    "xdotool",
    "sudo",
    "iptables",
    "iproute2",
    "libgl1-mesa-dri",
    "dconf-cli",
)
XLIB = "python3-xlib==0.15"  # what the requirements of OSWorld's server name; it hides Debian's
REPO = Path(__file__).resolve().parents[2]
BOOT = Path(__file__).with_name("gnome_boot.sh")
TOOLS = "/usr/local/lib/desktop"
LINK = "ahgnome"
HOST, GUEST, SITES = "10.231.77.1", "10.231.77.2", "10.231.78.1"
ADDRESS = f"http://{GUEST}:5000"
DIES_WITH_US = ("setpriv", "--pdeathsig", "KILL")
BOOT_TIMEOUT_S = 120.0  # s
# GNOME Shell begins with its overview, which OSWorld's machine does not show.
READY = """
export DBUS_SESSION_BUS_ADDRESS=unix:path=/run/user/1000/bus
ask() {
    gdbus call --session --dest org.gnome.Shell --object-path /org/gnome/Shell \\
        --method org.freedesktop.DBus.Properties."$@"
}
overview() { ask Get org.gnome.Shell OverviewActive; }
until overview | grep -q true; do sleep 0.1; done
until overview | grep -q false && wmctrl -l | grep -q ' @!'; do
    ask Set org.gnome.Shell OverviewActive '<false>'
    sleep 0.5
done
"""


def lack() -> str:
    """Why there can be no such machine here, with the command that mends it; empty if there can."""
    if os.geteuid() != 0:
        return "a machine with GNOME needs root"
    if not (LAYER / "upper/usr/bin/gnome-shell").exists():
        command = f"PYTHONPATH=tests {sys.executable} -m support.gnome_machine install"
        return f"no GNOME in {LAYER}; {command}"
    return ""


def install() -> None:
    """Install GNOME's packages with apt, into the layer alone."""
    for name in ("upper", "work", "root"):
        (LAYER / name).mkdir(parents=True, exist_ok=True)
    script = """
        set -e
        mount --make-rprivate /
        mount -t overlay overlay -o lowerdir=/,upperdir=upper,workdir=work root
        mount -t proc proc root/proc
        mount --rbind /dev root/dev
        mount -t tmpfs tmpfs root/run
        mount -t tmpfs tmpfs root/tmp
        printf '#!/bin/sh\\nexit 101\\n' >root/usr/sbin/policy-rc.d
        chmod 755 root/usr/sbin/policy-rc.d
        exec chroot root env DEBIAN_FRONTEND=noninteractive apt-get install -qq --no-install-recommends "$@"
    """
    command = ["unshare", "--mount", "sh", "-c", script, "sh", *PACKAGES]
    subprocess.run(command, cwd=LAYER, check=True)
    pip = [os.path.realpath(sys.executable), "-m", "pip", "install", "--quiet", "--no-deps"]
    target = LAYER / "upper/usr/local/lib/python3.11/dist-packages"
    subprocess.run([*pip, "--upgrade", "--target", target, XLIB], check=True)


class GnomeMachine:
    """The machine; `start` begins a pristine one in the place of the last."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._sites: subprocess.Popen[bytes] | None = None
        self._work = LAYER / "run"
        self._groups = LAYER / "groups"

    def start(self, task: object = None) -> str:
        """Boot it and wait until its session can be used; returns the address of its server.

        Raises:
            DesktopError: There is no session in time.
        """
        self.stop()
        for folder in (self._work, self._groups):
            folder.mkdir(exist_ok=True)
        words = [str(BOOT), LAYER, self._work, REPO, sys.executable, TOOLS]
        # A control group of its own, made where nothing else sees its file system.
        enter = """
            mount --make-rprivate /
            mount -t cgroup2 cgroup2 "$1"
            mkdir -p "$1/agenthijack-gnome"
            echo $$ >"$1/agenthijack-gnome/cgroup.procs"
            shift
            exec unshare --mount --pid --net --uts --ipc --cgroup --fork --kill-child sh "$@"
        """
        self._process = subprocess.Popen(
            [*DIES_WITH_US, "unshare", "--mount", "sh", "-ec", enter, "sh", self._groups, *words],
            start_new_session=True,
        )
        self._connect(self._process.pid)
        self._wait()
        return ADDRESS

    def stop(self) -> None:
        """End it, with everything in it."""
        for process in (self._process, self._sites):
            if process is not None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        self._process = self._sites = None
        # The kernel ends the network a moment after its processes.
        subprocess.run(["ip", "link", "delete", LINK], stderr=subprocess.DEVNULL, check=False)

    def _connect(self, pid: int) -> None:
        """Give it a network with the local internet behind it."""
        end = time.monotonic() + 10
        init = ""
        while not init:
            if time.monotonic() > end or self._process is None or self._process.poll() is not None:
                raise DesktopError("the machine with GNOME did not start: see the messages above")
            time.sleep(0.02)
            with contextlib.suppress(OSError):
                command = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
                if command[1:3] == [b"--mount", b"--pid"]:  # the second unshare, whose child it is
                    children = Path(f"/proc/{pid}/task/{pid}/children")
                    init = children.read_text(encoding="ascii").strip()
        inside = ("nsenter", f"--net=/proc/{init}/ns/net", "ip")
        for command in (
            ("ip", "link", "add", LINK, "type", "veth", "peer", "name", "eth0", "netns", init),
            ("ip", "addr", "add", f"{HOST}/30", "dev", LINK),
            ("ip", "addr", "add", f"{SITES}/32", "dev", LINK),
            ("ip", "link", "set", LINK, "up"),
            (*inside, "addr", "add", f"{GUEST}/30", "dev", "eth0"),
            (*inside, "link", "set", "eth0", "up"),
            (*inside, "route", "add", "default", "via", HOST),
        ):
            subprocess.run(command, check=True)
        state = self._work.with_name("sites")
        shutil.rmtree(state, ignore_errors=True)
        state.mkdir()
        command = [*DIES_WITH_US, sys.executable, "-m", "online_env.embedded.sites"]
        self._sites = subprocess.Popen(
            [*command, "--address", SITES, "--state", str(state)],
            cwd=REPO,
            start_new_session=True,
            stdout=subprocess.DEVNULL,
        )

    def _wait(self) -> None:
        end = time.monotonic() + BOOT_TIMEOUT_S
        while time.monotonic() < end:
            with contextlib.suppress(DesktopError), HttpDesktop(ADDRESS, timeout=5) as desktop:
                if desktop.execute(READY, BOOT_TIMEOUT_S).ok:
                    return
            time.sleep(0.3)
        raise DesktopError(f"no GNOME session within {BOOT_TIMEOUT_S:g} s")


@contextlib.contextmanager
def gnome(size: tuple[int, int] = (1080, 1920)) -> Iterator[Any]:
    """A desktop on such a machine, which resets by a new machine; a provider of benchmarks."""
    del size  # of OSWorld's machine
    machine = GnomeMachine()
    try:
        with HttpDesktop(machine.start(), resetter=machine.start) as desktop:
            yield desktop
    finally:
        machine.stop()


def main() -> None:
    """The command."""
    if sys.argv[1:] == ["install"]:
        install()
    elif sys.argv[1:] == ["up"]:
        with gnome() as desktop, contextlib.suppress(KeyboardInterrupt):
            print(desktop.url, flush=True)
            signal.pause()
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
