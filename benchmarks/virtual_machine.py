"""A virtual machine beside the embedded desktop: start, reset, memory, pictures, input, tree.

It needs root.

The guest is ours, not OSWorld's Ubuntu image; `ABOUT` says what is in it. It is built once
(minutes) and kept in `~/.cache/agenthijack/vm`. `--guest URL` measures another guest with OSWorld's
protocol instead. Where KVM is not to be had, QEMU translates each instruction, and only what does
not depend on the processor is measured.
"""

import argparse
import os
import re
import shutil
import signal
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import httpx
from common import machine, table
from online import APPS, memory, row, timed
from vm.image import MissingPartError, prepared
from vm.qemu import CPUS, MEMORY, Machine

from online_env.desktops.http import HttpDesktop
from online_env.embedded import packages
from online_env.embedded.desktop import EmbeddedDesktop

TOOLS = {
    "qemu-system-x86_64": "apt-get install --no-install-recommends qemu-system-x86",
    "qemu-img": "apt-get install --no-install-recommends qemu-utils",
    "mkfs.ext4": "apt-get install e2fsprogs",
    "setpriv": "apt-get install util-linux",
}
SETTLING = 3  # s, before memory is looked at
ABOUT = """QEMU guest with {cpus} processors and {memory} MiB, and the embedded desktop, in one run; 1920x1080;
min / median / max of {runs} (actions: three times as many); load before it {load}.

The guest is ours, not OSWorld's Ubuntu image: Debian's kernel, the embedded desktop's packages, Xfce session and guest
server, and nothing else (no boot loader, no systemd), so it is smaller and starts faster than a usual one. OSWorld's
Docker provider starts its machine anew for each reset (row "up"), its others go back to a snapshot (row "reset").
"""
EMULATED = """**Without KVM**: {why}. QEMU translated every instruction instead. Times that then say nothing are left
out; the memory is what the guest itself uses (QEMU needs some more); `loadvm` is QEMU's work before the guest goes on,
so a lower bound of a reset.
"""
MARK = "/home/user/written-after-the-snapshot"
Seconds = dict[str, list[float]]


def actions(desktop: HttpDesktop, token: str, runs: int) -> Seconds:
    """What a step costs over HTTP, on either desktop."""
    with httpx.Client(base_url=desktop.url, headers={"X-Token": token}, trust_env=False) as client:
        works: dict[str, Callable[[], object]] = {
            "screenshot, PNG over HTTP": lambda: client.get("/screenshot").raise_for_status(),
            "click": lambda: desktop.input([{"type": "click", "x": 960, "y": 540}]),
            "accessibility tree, four apps open": desktop.accessibility,
            "command (`true`)": lambda: desktop.execute(["true"]),
        }
        return {name: [timed(work) for _ in range(runs + 2)][2:] for name, work in works.items()}


def embedded(runs: int, acts: int) -> tuple[Seconds, dict[str, float]]:
    """The embedded desktop: seconds, and memory in MiB."""
    seconds: Seconds = {"up": [], "reset, browser open": []}
    sizes: dict[str, float] = {}
    for _ in range(runs):
        items: list[EmbeddedDesktop] = []
        seconds["up"].append(
            timed(
                lambda items=items: (
                    items.append(EmbeddedDesktop.up()),
                    items[0].client.screenshot(),
                )
            )
        )
        time.sleep(SETTLING)
        sizes["desktop"] = memory(items[0])
        items[0].close()
    with EmbeddedDesktop.up(apps=("browser",)) as desktop:
        time.sleep(SETTLING)
        sizes["with browser"] = memory(desktop)
        for _ in range(runs):
            work = timed(lambda: (desktop.reset(), desktop.client.screenshot()))
            seconds["reset, browser open"].append(work)
    with EmbeddedDesktop.up(apps=APPS) as desktop:
        time.sleep(SETTLING)
        seconds |= actions(desktop.client, Path(desktop.record["token_file"]).read_text(), acts)
    return seconds, sizes


def pss(pid: int) -> tuple[float, float]:
    """Proportional set size of a QEMU process, and of the guest's memory in it, in MiB."""
    whole = ram = 0
    is_ram = False
    for line in Path(f"/proc/{pid}/smaps").read_text().splitlines():
        if span := re.match(r"([0-9a-f]+)-([0-9a-f]+) ", line):
            is_ram = int(span[2], 16) - int(span[1], 16) >= MEMORY << 20
        elif line.startswith("Pss:"):
            whole += int(line.split()[1])
            ram += int(line.split()[1]) * is_ram
    return whole / 1024, ram / 1024


def reset(one: Machine) -> tuple[float, float]:
    """Return the seconds of `loadvm`, and until a screenshot, for a reset that undoes a change."""
    one.desktop.write_file(MARK, b"")
    start = time.perf_counter()
    loaded = one.load()
    took = time.perf_counter() - start
    if one.desktop.execute(["test", "-e", MARK]).returncode != 1:
        raise SystemExit(
            "the snapshot was loaded, but a file that was written after it is still there"
        )
    return loaded, took


def guest(runs: int, acts: int, kvm: bool) -> tuple[Seconds, dict[str, float], float]:
    """Return the seconds of the virtual machine, its memory and its size on disk in MiB.

    Without `kvm`, only what still means something: seconds of QEMU's own work, and the memory that
    the guest itself uses.
    """
    seconds: Seconds = {"up": []}
    with prepared() as (image, folder):
        for _ in range(runs - 1 if kvm else 0):
            with Machine(image, folder, kvm) as result:
                seconds["up"].append(result.wait())
        with Machine(image, folder, kvm) as result:
            seconds["up"].append(result.wait())
            sizes = session(result, seconds, runs, acts, kvm)
        return seconds, sizes, image.size / 2**20


def session(one: Machine, seconds: Seconds, runs: int, acts: int, kvm: bool) -> dict[str, float]:
    """What is measured on one machine: adds to `seconds`, returns memory in MiB."""
    time.sleep(SETTLING)
    sizes = {"desktop": pss(one.pid)[not kvm]}
    one.open("browser")
    time.sleep(SETTLING)
    sizes["with browser"] = pss(one.pid)[not kvm]
    seconds["snapshot made (`savevm`)"] = [timed(one.save)]
    resets = [reset(one) for _ in range(runs)]
    seconds["snapshot loaded (`loadvm`)"], seconds["reset, browser open"] = map(
        list, zip(*resets, strict=True)
    )
    if kvm:
        for name in APPS[1:]:
            one.open(name)
        time.sleep(SETTLING)
        seconds |= actions(one.desktop, one.token, acts)
    return sizes


def compare(runs: int, acts: int, kvm: bool) -> list[list[str]]:
    """Rows: what, the guest, the embedded desktop, and the ratio of the medians."""
    value, sizes, disk = guest(runs, acts, kvm)
    here, own_sizes = embedded(runs, acts)
    rows: list[list[str]] = []
    for name in dict.fromkeys((*value, *here)):
        slow = not kvm and name in here
        values = [] if slow else value.get(name, [])
        result = here.get(name, [])
        ratio = (
            f"{statistics.median(values) / statistics.median(result):.3g}x"
            if values and result
            else ""
        )
        cells = [
            "needs KVM" if slow else row("", values)[1] if values else "",
            row("", result)[1] if result else "",
        ]
        rows.append([name, *cells, ratio])
    for name, size in sizes.items():
        own_size = own_sizes[name]
        rows.append(
            [
                f"memory (PSS), {name}",
                f"{size:.0f} MiB",
                f"{own_size:.0f} MiB",
                f"{size / own_size:.3g}x",
            ]
        )
    return [*rows, ["image on disk", f"{disk:.0f} MiB", "none", ""]]


def foreign(url: str, runs: int) -> list[list[str]]:
    """What a step costs on a guest with OSWorld's protocol at `url`."""
    with HttpDesktop(url) as desktop:
        works: dict[str, Callable[[], object]] = {
            "screenshot": desktop.screenshot,
            "accessibility tree": desktop.accessibility,
            "command (`true`)": lambda: desktop.execute(["true"]),
            "pyautogui code": lambda: desktop.run("pyautogui.moveTo(100, 200)"),
        }
        return [row(name, [timed(work) for _ in range(runs)])[:3] for name, work in works.items()]


def missing() -> list[str]:
    """What keeps the guest from being measured, with the command that mends it."""
    lacks = [
        f"{tool} is not installed: {line}"
        for tool, line in TOOLS.items()
        if shutil.which(tool) is None
    ]
    if absent := packages.missing(packages.packages([packages.ALL])):
        lacks.append(
            f"{len(absent)} packages of the desktop are not installed:"
            f" {packages.install_line(absent)}"
        )
    return lacks if os.geteuid() == 0 else ["this needs root: run it with sudo", *lacks]


def no_kvm() -> str | None:
    """Why QEMU cannot use the real processor for a usual kernel, or `None`."""
    if not os.access("/dev/kvm", os.R_OK | os.W_OK):
        return (
            "there is no /dev/kvm (`modprobe kvm_amd` or `kvm_intel`; in a virtual machine, nested"
            " virtualization)"
        )
    flags = re.search(r"^flags.*$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    if flags is None or not re.search(r" (vmx|svm)\b", flags[0]):
        kind = ", ".join(path.name for path in Path("/sys/module").glob("kvm_*")) or "kvm"
        return (
            f"/dev/kvm is there, but the processor shows neither vmx nor svm: this KVM ({kind})"
            " interprets a usual kernel instruction by instruction and stops at the first that it"
            " does not know; use a machine with virtualization in hardware"
        )
    return None


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--guest", help="address of an OSWorld guest to measure instead")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what was started is ended
    print(machine(), end="\n\n")
    if options.guest:
        print(table(["what", "min / median / max", "runs"], foreign(options.guest, options.runs)))
        return
    if lacks := missing():
        print(
            "The virtual machine was not measured.\n\n" + "\n".join(f"* {line}" for line in lacks)
        )
        return
    why = no_kvm()
    load = " ".join(f"{value:.1f}" for value in os.getloadavg())
    try:
        rows = compare(options.runs, options.runs * 3, kvm=why is None)
    except MissingPartError as error:
        print(f"The virtual machine was not measured: {error}")
        return
    print(ABOUT.format(cpus=CPUS, memory=MEMORY, runs=options.runs, load=load))
    if why:
        print(EMULATED.format(why=why))
    print(table(["what", "virtual machine", "embedded", "ratio"], rows))


if __name__ == "__main__":
    main()
