"""The embedded desktop in figures: start, reset, memory, pictures, input, tree; run it as root.

Then `--parallel` desktops are driven at once, and `--cycles` rounds of up, reset, down are looked through for what they
leave behind. `--only sizes,install --parallel 0 --cycles 0` runs parts alone. `virtual_machine.py` has one beside it.
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

from online_env.desktops.embedded import network, packages, registry
from online_env.desktops.embedded.desktop import EmbeddedDesktop

APPS = ("browser", "editor", "files", "terminal")
UNICODE = "Grüße, naïve café, Ω≈ç√∫, 数学と日本語, Привет мир, <tags> & 'quotes' \"double\" \\ ~"


def timed(work: Callable[[], object]) -> float:
    """Seconds that `work` takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def row(name: str, seconds: Sequence[float], goal: str = "") -> list[str]:
    """A line of the table, in the unit that suits it."""
    unit, factor = ("s", 1) if min(seconds) >= 0.5 else ("ms", 1000)
    numbers = (min(seconds), statistics.median(seconds), max(seconds))
    return [name, " / ".join(f"{number * factor:.3g}" for number in numbers) + f" {unit}", str(len(seconds)), goal]


def memory(desktop: EmbeddedDesktop) -> float:
    """Proportional set size of all processes of a desktop, its keeper and its web sites included, in MiB."""
    total = 0
    waiting = [desktop.record["keeper"][0]]
    while waiting:
        pid = waiting.pop()
        try:
            lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
            waiting += [int(n) for n in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
        except OSError:
            continue
        total += sum(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return total / 1024


def starts(runs: int) -> list[list[str]]:
    """Up and down, with nothing and with the browser open."""
    rows: list[list[str]] = []
    for name, apps, goal in (("up", (), "<= 1.5 s"), ("up, browser open", ("browser",), "")):
        ups, downs = [], []
        for _ in range(runs):
            made: list[EmbeddedDesktop] = []
            ups.append(timed(lambda apps=apps, made=made: made.append(EmbeddedDesktop.up(apps=apps))))
            downs.append(timed(made[0].close))
        rows += [row(name, ups, goal), row("down", downs)] if not apps else [row(name, ups, goal)]
    return rows


def resets(runs: int) -> list[list[str]]:
    """Reset with the browser ready, cold and with a standby."""
    rows: list[list[str]] = []
    for name, standby, goal in (("reset, cold", False, "<= 1.7 s"), ("reset, standby", True, "<= 0.2 s")):
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
    """Memory of one desktop, idle and with applications."""
    rows: list[list[str]] = []
    for name, apps in (("desktop", ()), ("with browser", ("browser",)), ("with four apps", APPS)):
        with EmbeddedDesktop.up(apps=apps) as desktop:
            time.sleep(3)
            rows.append([f"memory (PSS), {name}", f"{memory(desktop):.0f} MiB", "1", ""])
    return rows


def actions(runs: int) -> list[list[str]]:
    """What a step costs, with four applications open."""
    with EmbeddedDesktop.up(apps=APPS) as desktop:
        time.sleep(3)
        secret = Path(desktop.record["token_file"]).read_text()
        with httpx.Client(base_url=desktop.record["guest"], headers={"X-Token": secret}, trust_env=False) as client:
            works: list[tuple[str, Callable[[], object], str]] = [
                ("screenshot, RGB", desktop.screenshot, "<= 3 ms"),
                ("screenshot, PNG over HTTP", lambda: client.get("/screenshot"), "<= 20 ms"),
                ("click", lambda: desktop.client.input([{"type": "click", "x": 960, "y": 540}]), "<= 3 ms"),
                ("accessibility tree, four apps open", desktop.accessibility, "<= 250 ms"),
                ("command (`true`)", lambda: desktop.execute(["true"]), ""),
                ("pyautogui code", lambda: desktop.run("pyautogui.moveTo(100, 200)"), ""),
            ]
            rows = [row(name, [timed(work) for _ in range(runs)][2:], goal) for name, work, goal in works]
        shell = desktop.execute
        shell("wmctrl -a Mousepad; sleep 0.5")
        text = (UNICODE * 2)[:74]
        rows.append(
            row("type 74 Unicode characters", [timed(lambda: desktop.client.input([{"type": "type", "text": text}]))])
        )
    return rows


def parallel(count: int, seconds: float = 20) -> list[list[str]]:
    """Steps a second of `count` desktops together; a step is a click, a picture and a look at the windows."""
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
    each = statistics.mean(memory(desktop) for desktop in desktops)
    for desktop in desktops:
        desktop.close()
    return [
        [f"{count} desktops, steps/s together", f"{sum(steps) / seconds:.0f}", "1", ""],
        [f"{count} desktops, memory each (PSS)", f"{each:.0f} MiB", "1", ""],
    ]


def fetched(names: Sequence[str], folder: Path) -> dict[str, int]:
    """Sizes in bytes of the archives that apt would fetch for `names` on a machine with nothing on it.

    `folder` is an empty folder.
    """
    (folder / "partial").mkdir(exist_ok=True)
    (folder / "status").touch()
    command = ["apt-get", "-o", f"Dir::State::status={folder / 'status'}", "-o", f"Dir::Cache::archives={folder}"]
    command += ["--print-uris", "-qq", "-y", "--no-install-recommends", "install", *names]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    words = [line.split() for line in done.stdout.splitlines() if line.startswith("'")]
    return {file.partition("_")[0]: int(size) for _, file, size, *_ in words}


def on_disk(names: Sequence[str]) -> int:
    """Bytes that packages take when they are installed, as they say themselves."""
    command = ["apt-cache", "show", "--no-all-versions", *names]
    shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    return 1024 * sum(int(line.split()[1]) for line in shown if line.startswith("Installed-Size:"))


def installs() -> list[list[str]]:
    """What each profile adds to a bare Debian (its required packages, as in a container); nothing is installed."""
    command = ["dpkg-query", "-W", "-f=${Package} ${Priority}\n"]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    base = ["apt", *(line.split()[0] for line in listed if line.endswith(" required"))]
    rows: list[list[str]] = []
    with tempfile.TemporaryDirectory() as empty:
        known = set(fetched(base, Path(empty)))
        for name in ("core", "web", "office", "media", packages.ALL):
            profiles = [name] if name in ("core", packages.ALL) else ["core", name]
            wanted = fetched([*base, *packages.packages(profiles)], Path(empty))
            new = sorted(set(wanted) - known)
            size = f"{sum(wanted[one] for one in new) / 1e6:.0f} MB to fetch, {on_disk(new) / 1e6:.0f} MB on disk"
            rows.append([f"profile {' + '.join(profiles)}: {len(new)} packages", size, "1", ""])
    return rows


def traces(name: str) -> list[str]:
    """What is left of desktops whose name starts with `name`."""
    paths = [
        *network.NETNS.glob(f"ah-{name}*"),
        *registry.RUN.glob(f"{name}*"),
        *Path("/sys/fs/cgroup").glob(f"*/*{name}*"),
    ]
    lines = [line for line in Path("/proc/self/mounts").read_text().splitlines() if name in line]
    listed = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True).stdout.splitlines()
    return [*map(str, paths), *lines, *(line for line in listed if f'"{name}' in line)]


def programs() -> int:
    """Processes on this machine, but for those of the kernel, which have no command line."""
    count = 0
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            count += bool(path.read_bytes())
    return count


def cycles(count: int) -> list[list[str]]:
    """Rounds of up, reset, down; what they leave."""
    name, start = "bench-cycle", time.perf_counter()
    processes = programs()
    for _ in range(count):
        desktop = EmbeddedDesktop.up(name=name)
        desktop.reset()
        desktop.close()
    took = time.perf_counter() - start
    left = traces(name)
    more = programs() - processes
    found = json.dumps(left) if left else "nothing"
    return [[f"{count} cycles of up, reset, down", f"{took:.0f} s", str(count), ""],
            ["left behind by them", f"{found}; processes on the machine: {more:+d}", "1", "nothing"]]  # fmt: skip


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--cycles", type=int, default=50, help="rounds of up, reset, down")
    parser.add_argument("--parallel", type=int, default=4, help="desktops at once")
    parser.add_argument("--only", default="starts,resets,sizes,actions,install", help="parts, with commas between")
    options = parser.parse_args()
    parts: dict[str, Callable[[], list[list[str]]]] = {
        "starts": lambda: starts(options.runs),
        "resets": lambda: resets(options.runs),
        "sizes": sizes,
        "actions": lambda: actions(options.runs * 3 + 2),
        "install": installs,
    }
    chosen = options.only.split(",")
    if unknown := set(chosen) - set(parts) - {"none"}:
        parser.error(f"--only: {', '.join(sorted(unknown))} is none of {', '.join(parts)}")
    rows = [line for name in chosen if name in parts for line in parts[name]()]
    rows += parallel(options.parallel) if options.parallel else []
    rows += cycles(options.cycles) if options.cycles else []
    print(machine(), end="\n\n")
    print(table(["what", "min / median / max", "runs", "goal"], rows))


if __name__ == "__main__":
    main()
