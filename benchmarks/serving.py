"""Desktops behind `hijack serve`: what the server adds to a reset and a step, and what it leaks.

`hijack desktop install` and the extra `serve` are needed. By default the same episodes are played in
this process and through a server, in turn, with 1, 2 and 4 sessions. `--soak MINUTES` lets the hostile
clients of tests/online_env/test_serving_soak.py act for so long on real desktops, and reads the
server's own metrics before and after.
"""

import argparse
import contextlib
import os
import re
import secrets
import signal
import statistics
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from common import machine, table

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from support import hostile_clients

HIJACK = (sys.executable, "-m", "hijack_data.cli", "serve", "embedded")
SIZE = "1280x720"
TASK = "write_note"
TOKEN_VARIABLE = "AGENTHIJACK_SERVE_TOKEN"
START = 180.0  # seconds that a server may take to start
SETTLED = 5  # minutes until the soak is measured from: by then everything was loaded once


@dataclass
class Timings:
    """Seconds of resets and steps, and how long it took altogether."""

    resets: list[float] = field(default_factory=list[float])
    steps: list[float] = field(default_factory=list[float])
    whole: float = 0.0

    def add(self, other: "Timings") -> None:
        """Add those of another round."""
        self.resets += other.resets
        self.steps += other.steps
        self.whole += other.whole


class InProcess:
    """Environments in this process."""

    def __init__(self, count: int) -> None:
        from online_env.bench.providers import embedded
        from online_env.environment import CorruptedEnv, SmallTasks

        self._stack = contextlib.ExitStack()
        width, height = map(int, SIZE.split("x"))
        self._envs: list[Any] = []
        for _ in range(count):
            desktop = self._stack.enter_context(embedded((height, width)))
            self._envs.append(CorruptedEnv(SmallTasks(desktop, TASK), max_steps=60))

    def reset(self, number: int, seed: int) -> None:
        """Begin an episode."""
        self._envs[number].reset(seed=seed)

    def step(self, number: int, code: str) -> None:
        """Take an action."""
        self._envs[number].step(code)

    def end(self, number: int) -> None:
        """End the episode; the next reset would do that, but not through a server."""
        self._envs[number].step("DONE")

    def close(self) -> None:
        """End the desktops."""
        self._stack.close()


class ThroughServer:
    """OpenEnv's client and a server that this starts."""

    def __init__(self, count: int, desktops: int, *words: str, token: str = "") -> None:
        from openenv.core.generic_client import GenericEnvClient

        command = [*HIJACK, "--tasks", TASK, "--desktops", str(desktops), "--size", SIZE]
        command += ["--max-steps", "60", "--port", "0", *words]
        self.token = token
        environment = {**os.environ, TOKEN_VARIABLE: token} if token else None
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        self.url = _address(self.process)
        self._new = GenericEnvClient
        self._clients = [self._client() for _ in range(count)]

    def _client(self) -> Any:
        return self._new(base_url=self.url, message_timeout_s=300).sync()

    def reset(self, number: int, seed: int | None) -> None:
        """Begin a clean episode."""
        self._clients[number].reset(seed=seed, corruption="clean")

    def step(self, number: int, code: str) -> Any:
        """Take an action."""
        return self._clients[number].step({"action": code})

    def end(self, number: int) -> None:
        """End the episode."""
        self.step(number, "DONE")

    def metrics(self) -> dict[str, float]:
        """Return the server's metrics; those with labels under `name{labels}`."""
        headers = {"Authorization": f"Bearer {self.token}"} if self.token else {}
        request = urllib.request.Request(f"{self.url}/metrics", headers=headers)
        with urllib.request.urlopen(request, timeout=30) as answer:
            lines = answer.read().decode().splitlines()
        pairs = (line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
        return {name: float(value) for name, value in pairs}

    def close(self) -> None:
        """End the sessions and the server."""
        for client in self._clients:
            client.close()
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(120)


def _address(process: "subprocess.Popen[str]") -> str:
    """Wait for the line of a server that says where it is."""
    timer = threading.Timer(START, process.kill)
    timer.start()
    result = re.search(r"http://\S+?(?=,)", process.stdout.readline() if process.stdout else "")
    timer.cancel()
    if result is None:
        sys.exit("the server did not start")
    return result[0]


def together(count: int, work: Callable[[int], None]) -> float:
    """Run `work` in as many threads; return the seconds until all are done."""
    start = time.monotonic()
    with ThreadPoolExecutor(count) as threads:
        list(threads.map(work, range(count)))
    return time.monotonic() - start


def played(place: InProcess | ThroughServer, count: int, episodes: int, steps: int) -> Timings:
    """Play episodes in all sessions at once."""
    timings = Timings()

    def session(number: int) -> None:
        for seed in range(episodes):
            start = time.monotonic()
            place.reset(number, seed)
            timings.resets.append(time.monotonic() - start)
            for step in range(steps):
                start = time.monotonic()
                place.step(number, f"pyautogui.moveTo({300 + 40 * step}, {200 + 20 * step})")
                timings.steps.append(time.monotonic() - start)
            place.end(number)

    timings.whole = together(count, session)
    return timings


def percentile(values: Sequence[float], share: float) -> float:
    """Return a percentile, the nearest value that was measured."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


@contextlib.contextmanager
def closing(place: Any) -> Generator[Any]:
    """Close it at the end."""
    try:
        yield place
    finally:
        place.close()


def compare(rounds: int, episodes: int, steps: int) -> str:
    """Return the table of both ways, with 1, 2 and 4 sessions."""
    rows: list[list[str]] = []
    ratios: list[str] = []
    for count in (1, 2, 4):
        here, timings = Timings(), Timings()
        with closing(InProcess(count)) as inside, closing(ThroughServer(count, count)) as outside:
            for folder in (inside, outside):
                played(folder, count, 1, 2)  # not counted: everything is loaded by it
            for _ in range(rounds):
                here.add(played(inside, count, episodes, steps))
                timings.add(played(outside, count, episodes, steps))
        for name, value in (("in the process", here), ("through the server", timings)):
            rows.append(_row(name, count, value))
        medians = [statistics.median(value.steps) * 1e3 for value in (here, timings)]
        plural = "s" if count > 1 else ""
        ratios.append(
            f"With {count} session{plural}, the median step through the server takes"
            f" {medians[1] / medians[0]:.2f} times as long."
        )
    head = ("", "sessions", "resets / s", "reset p50", "step p50", "step p99", "steps")
    return f"{table(head, rows)}\n\n{' '.join(ratios)}"


def _row(name: str, count: int, found: Timings) -> list[str]:
    return [
        name,
        str(count),
        f"{count / statistics.mean(found.resets):.2f}",
        f"{statistics.median(found.resets):.2f} s",
        f"{statistics.median(found.steps) * 1e3:.0f} ms",
        f"{percentile(found.steps, 0.99) * 1e3:.0f} ms",
        str(len(found.steps)),
    ]


def soak(minutes: float, sessions: int, desktops: int) -> str:
    """Let hostile clients act for a while; return what the server held before and after."""
    words = ("--sessions", str(2 * sessions), "--line", str(sessions), "--wait", "280")
    token = secrets.token_hex(16)
    with closing(ThroughServer(0, desktops, *words, token=token)) as server:
        samples = [held(server)]
        start = time.monotonic()
        with ThreadPoolExecutor(1) as thread:
            future = thread.submit(hostile_clients.soak, server.url, token, sessions, minutes * 60)
            while not future.done():
                wait([future], min(60.0, minutes * 20))
                samples.append(held(server))
                print(samples[-1], file=sys.stderr, flush=True)
        problems = [problem for client in future.result() for problem in client.problems]
        seconds = time.monotonic() - start
    if problems:
        sys.exit(f"clients met {len(problems)} problems, the first: {problems[0]}")
    after = samples[-1]
    base = samples[min(SETTLED, len(samples) - 1)]
    names = ("minutes", "episodes", "steps", "memory", "descriptors", "threads", "keepers")
    rows = [
        [name, _shown(name, samples[0]), _shown(name, base), _shown(name, after)] for name in names
    ]
    return (
        f"{sessions} hostile clients on {desktops} desktops, corruptions drawn by the server:\n\n"
        f"{table(('', 'at the start', 'once loaded', 'at the end'), rows)}\n\n"
        f"{after['steps'] / seconds:.2f} steps a second; problems: {int(after['problems'])}."
    )


def held(place: ThroughServer) -> dict[str, float]:
    """Return what a server holds."""
    metrics = place.metrics()
    pid = place.process.pid
    episodes = {name: value for name, value in metrics.items() if "hijack_episodes_total" in name}
    return {
        "minutes": (time.time() - metrics["process_start_time_seconds"]) / 60,
        "episodes": sum(episodes.values()) + metrics["hijack_episodes_broken_off_total"],
        "steps": metrics["hijack_steps_total"],
        "memory": metrics["process_resident_memory_bytes"] / 2**20,
        "descriptors": metrics["process_open_fds"],
        "threads": len(os.listdir(f"/proc/{pid}/task")),
        "keepers": _children(pid),
        "problems": sum(value for name, value in episodes.items() if 'status="ok"' not in name),
    }


def _children(pid: int) -> int:
    """Return how many processes a process has started itself: the keepers of its desktops."""
    result = 0
    for task in os.listdir(f"/proc/{pid}/task"):
        with contextlib.suppress(OSError), open(f"/proc/{pid}/task/{task}/children") as stream:
            result += len(stream.read().split())
    return result


def _shown(name: str, sample: dict[str, float]) -> str:
    unit = " MiB" if name == "memory" else ""
    return f"{sample[name]:.0f}{unit}"


def main() -> None:
    """Measure, and print the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--episodes", type=int, default=3)
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--soak", type=float, default=0.0, metavar="MINUTES")
    parser.add_argument("--sessions", type=int, default=4)
    parser.add_argument("--desktops", type=int, default=2)
    options = parser.parse_args()
    if options.soak:
        print(soak(options.soak, options.sessions, options.desktops))
        return
    print(machine())
    print()
    print(compare(options.rounds, options.episodes, options.steps))
    print()
    print(soak(5.0, options.sessions, options.desktops))


if __name__ == "__main__":
    main()
