"""The embedded desktop in figures: start, reset, memory, pictures, input, tree; run it as root.

Then `--parallel` desktops are driven at once, and `--cycles` rounds of up, reset, down are looked
through for what they leave behind. `--only sizes,install --parallel 0 --cycles 0` runs parts alone.
"""

import argparse
import json
import statistics
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import httpx
from common import machine, table

from online_env.embedded import packages
from online_env.embedded.desktop import EmbeddedDesktop
from online_env.embedded.runtime import network, registry

APPS = ("browser", "editor", "files", "terminal")
UNICODE = "Grüße, naïve café, Ω≈ç√∫, 数学と日本語, Привет мир, <tags> & 'quotes' \"double\" \\ ~"


def timed(work: Callable[[], object]) -> float:
    """Return the seconds that `work` takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def row(name: str, seconds: Sequence[float], goal: str = "") -> list[str]:
    """Return a line of the table, in seconds or milliseconds."""
    unit = "s"
    factor = 1
    if min(seconds) < 0.5:
        unit = "ms"
        factor = 1000
    numbers = (min(seconds), statistics.median(seconds), max(seconds))
    result = " / ".join(f"{number * factor:.3g}" for number in numbers)
    return [name, f"{result} {unit}", str(len(seconds)), goal]


def memory(desktop: EmbeddedDesktop, field: str = "Pss") -> float:
    """Return what a desktop with its keeper and sites takes, in MiB.

    `Pss` shares the pages of files among all that use them, other desktops of the machine included;
    `Pss_Anon` leaves files out.
    """
    total = 0
    waiting = [desktop.record["keeper"][0]]
    while waiting:
        pid = waiting.pop()
        process = Path(f"/proc/{pid}")
        try:
            lines = (process / "smaps_rollup").read_text().splitlines()
            children = (process / f"task/{pid}/children").read_text()
        except OSError:
            continue
        waiting += map(int, children.split())
        total += sum(int(line.split()[1]) for line in lines if line.startswith(f"{field}:"))
    return total / 1024


def starts(runs: int) -> list[list[str]]:
    """Time up and down, with nothing and with the browser open."""
    rows: list[list[str]] = []
    for name, apps, goal in (("up", (), "<= 1.5 s"), ("up, browser open", ("browser",), "")):
        ups: list[float] = []
        downs: list[float] = []
        for _ in range(runs):
            start = time.perf_counter()
            desktop = EmbeddedDesktop.up(apps=apps)
            ups.append(time.perf_counter() - start)
            downs.append(timed(desktop.close))
        rows.append(row(name, ups, goal))
        if not apps:
            rows.append(row("down", downs))
    return rows


def resets(runs: int) -> list[list[str]]:
    """Time a reset until the browser is ready, cold and with a standby."""
    rows: list[list[str]] = []
    for name, standby, goal in (
        ("reset, cold", False, "<= 1.7 s"),
        ("reset, standby", True, "<= 0.2 s"),
    ):
        with EmbeddedDesktop.up(apps=("browser",), standby=standby) as desktop:
            seconds = []
            for _ in range(runs):
                if standby:
                    desktop.wait_for_standby()
                    time.sleep(1)
                seconds.append(timed(desktop.reset))
        rows.append(row(f"{name}, browser ready", seconds, goal))
    return rows


def sizes() -> list[list[str]]:
    """Measure the memory of one desktop, idle and with applications."""
    rows: list[list[str]] = []
    for name, apps in (("desktop", ()), ("with browser", ("browser",)), ("with four apps", APPS)):
        with EmbeddedDesktop.up(apps=apps) as desktop:
            time.sleep(3)
            rows.append([f"memory (PSS), {name}", f"{memory(desktop):.0f} MiB", "1", ""])
    return rows


def actions(runs: int) -> list[list[str]]:
    """Time the parts of a step, with four applications open."""
    with EmbeddedDesktop.up(apps=APPS) as desktop:
        time.sleep(3)
        headers = {"X-Token": Path(desktop.record["token_file"]).read_text()}
        guest = desktop.record["guest"]
        click = [{"type": "click", "x": 960, "y": 540}]
        with httpx.Client(base_url=guest, headers=headers, trust_env=False) as client:
            works: list[tuple[str, Callable[[], object], str]] = [
                ("screenshot, RGB", desktop.screenshot, "<= 3 ms"),
                ("screenshot, PNG over HTTP", lambda: client.get("/screenshot"), "<= 20 ms"),
                ("click", lambda: desktop.client.input(click), "<= 3 ms"),
                ("accessibility tree, four apps open", desktop.accessibility, "<= 250 ms"),
                ("command (`true`)", lambda: desktop.execute(["true"]), ""),
                ("pyautogui code", lambda: desktop.run("pyautogui.moveTo(100, 200)"), ""),
            ]
            rows: list[list[str]] = []
            for name, work, goal in works:
                seconds = [timed(work) for _ in range(runs)]
                rows.append(row(name, seconds[2:], goal))
        desktop.execute("wmctrl -a Mousepad; sleep 0.5")
        typing = [{"type": "type", "text": (UNICODE * 2)[:74]}]
        seconds = [timed(lambda: desktop.client.input(typing))]
        rows.append(row("type 74 Unicode characters", seconds))
    return rows


def parallel(count: int, seconds: float = 20) -> list[list[str]]:
    """Count the steps a second of `count` desktops together.

    A step is a click, a screenshot and a list of the windows.
    """
    desktops = [EmbeddedDesktop.up(apps=("editor",)) for _ in range(count)]
    steps = [0] * count
    end = time.monotonic() + seconds

    def drive(index: int) -> None:
        desktop = desktops[index]
        while time.monotonic() < end:
            desktop.client.input([{"type": "click", "x": 400 + steps[index] % 99, "y": 500}])
            desktop.screenshot()
            desktop.client.windows()
            steps[index] += 1

    threads = [threading.Thread(target=drive, args=(index,)) for index in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    result = statistics.mean(memory(desktop) for desktop in desktops)
    for desktop in desktops:
        desktop.close()
    return [
        [f"{count} desktops, steps/s together", f"{sum(steps) / seconds:.0f}", "1", ""],
        [f"{count} desktops, memory each (PSS)", f"{result:.0f} MiB", "1", ""],
    ]


def fetched(names: Sequence[str], folder: Path) -> dict[str, int]:
    """Return the sizes in bytes of the archives that apt would fetch on an empty machine.

    Args:
        names: the packages to install.
        folder: an empty folder.
    """
    (folder / "partial").mkdir(exist_ok=True)
    (folder / "status").touch()
    command = ["apt-get", "-o", f"Dir::State::status={folder / 'status'}"]
    command += ["-o", f"Dir::Cache::archives={folder}"]
    command += ["--print-uris", "-qq", "-y", "--no-install-recommends", "install", *names]
    sizes: dict[str, int] = {}
    for line in lines_of(*command):
        if line.startswith("'"):
            _, file, size, *_ = line.split()
            package, _, _ = file.partition("_")
            sizes[package] = int(size)
    return sizes


def on_disk(names: Sequence[str]) -> int:
    """Return the bytes that installed packages take, by their own records."""
    result = lines_of("apt-cache", "show", "--no-all-versions", *names)
    sizes = [int(line.split()[1]) for line in result if line.startswith("Installed-Size:")]
    return 1024 * sum(sizes)


def lines_of(*command: str) -> list[str]:
    """Return the output lines of a command that must succeed."""
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    return process.stdout.splitlines()


def installs() -> list[list[str]]:
    """Measure what each profile adds to a bare Debian, whose packages are the required ones.

    Nothing is installed.
    """
    listed = lines_of("dpkg-query", "-W", "-f=${Package} ${Priority}\n")
    base = ["apt", *(line.split()[0] for line in listed if line.endswith(" required"))]
    rows: list[list[str]] = []
    with tempfile.TemporaryDirectory() as empty:
        names = set(fetched(base, Path(empty)))
        for name in ("core", "web", "office", "media", packages.ALL):
            profiles = [name] if name in ("core", packages.ALL) else ["core", name]
            expected = fetched([*base, *packages.packages(profiles)], Path(empty))
            new = sorted(set(expected) - names)
            to_fetch = sum(expected[item] for item in new) / 1e6
            size = f"{to_fetch:.0f} MB to fetch, {on_disk(new) / 1e6:.0f} MB on disk"
            rows.append([f"profile {' + '.join(profiles)}: {len(new)} packages", size, "1", ""])
    return rows


def traces(name: str) -> list[str]:
    """Return the traces of desktops whose name starts with `name`."""
    paths = [
        *network.NETNS.glob(f"ah-{name}*"),
        *registry.RUN.glob(f"{name}*"),
        *Path("/sys/fs/cgroup").glob(f"*/*{name}*"),
    ]
    mounts = Path("/proc/self/mounts").read_text().splitlines()
    values = [str(path) for path in paths]
    values += [line for line in mounts if name in line]
    values += [line for line in lines_of("ps", "-eo", "args") if f'"{name}' in line]
    return values


def programs() -> int:
    """Count the processes of this machine without the kernel's, which have no command line."""
    count = 0
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            count += bool(path.read_bytes())
    return count


def cycles(count: int) -> list[list[str]]:
    """Time rounds of up, reset and down, and list what they leave behind."""
    name = "bench-cycle"
    start = time.perf_counter()
    processes = programs()
    for _ in range(count):
        desktop = EmbeddedDesktop.up(name=name)
        desktop.reset()
        desktop.close()
    took = time.perf_counter() - start
    leftovers = traces(name)
    more = programs() - processes
    outcome = json.dumps(leftovers) if leftovers else "nothing"
    return [
        [f"{count} cycles of up, reset, down", f"{took:.0f} s", str(count), ""],
        ["left behind by them", f"{outcome}; processes on the machine: {more:+d}", "1", "nothing"],
    ]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--cycles", type=int, default=50, help="rounds of up, reset, down")
    parser.add_argument("--parallel", type=int, default=4, help="desktops at once")
    parser.add_argument(
        "--only", default="starts,resets,sizes,actions,install", help="parts, with commas between"
    )
    options = parser.parse_args()
    parts: dict[str, Callable[[], list[list[str]]]] = {
        "starts": lambda: starts(options.runs),
        "resets": lambda: resets(options.runs),
        "sizes": sizes,
        "actions": lambda: actions(options.runs * 3 + 2),
        "install": installs,
    }
    part_names = options.only.split(",")
    unknown = set(part_names) - set(parts) - {"none"}
    if unknown:
        parser.error(f"--only: {', '.join(sorted(unknown))} is none of {', '.join(parts)}")
    rows: list[list[str]] = []
    for name in part_names:
        if name in parts:
            rows += parts[name]()
    if options.parallel:
        rows += parallel(options.parallel)
    if options.cycles:
        rows += cycles(options.cycles)
    print(machine(), end="\n\n")
    print(table(["what", "min / median / max", "runs", "goal"], rows))


if __name__ == "__main__":
    main()
