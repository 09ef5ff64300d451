"""Kill a benchmark at random instants, go on each time, and count what was lost: nothing may be.

`hijack desktop install` is needed. A run over a tiny configuration is broken off with SIGKILL again
and again: the runner, a process that plays episodes, the keeper of a desktop, its first process, or
another program inside. One of the agents forks a process that holds all that its parent held, and
outlives it. A runner that was killed is started again with `--resume`. Whenever a run reaches its
end, and after the last kill, every planned episode must be there exactly once, `hijack verify` must
find nothing, and no process, run folder, namespace, mount or control group may be left; then the
next run begins. The instants follow from `--seed`.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from common import machine, table

from online_env.bench.estimates import format_duration
from online_env.embedded.runtime import limits, network, registry
from online_env.results import records
from online_env.results.scores import latest

HIJACK = (sys.executable, "-m", "hijack_data.cli")
CONFIG = """
agents: [oracle, {agent}]
tasks: [count_errors, find_mention, find_big_folder]
corruptions: [clean, marks, app_minimization]
seeds: [0]
max_steps: 20
retries: 10
"""
FORKING_AGENT = """
import os, time

class Forking:
    '''An agent with a helper process, as `multiprocessing` makes one.'''

    def __init__(self):
        agent = os.getpid()
        if os.fork() == 0:
            while os.getppid() == agent:
                time.sleep(0.2)
            time.sleep(5)
            os._exit(0)

    def predict(self, instruction, obs):
        return "nothing to do", ["DONE"]
"""
TARGETS = ("runner", "worker", "keeper", "init", "program")
PATIENCE = 120.0
GIVEN_UP = 2  # exit code of a run whose desktops do not start
WORKER = "multiprocessing.spawn"
KEEPER = "runtime.keeper"


@dataclass
class Outcome:
    """What happened.

    Args:
        kills: By what was killed.
        resumes: How often a run was gone on with.
        given_up: How often a run had ended with an error, since a desktop did not start.
        ended: Runs that came to their end.
        episodes: Their planned episodes.
        repeated: Attempts that were lost to a kill and played again.
        problems: What was lost, counted twice, or left over, in words.
        slowest_end: Seconds after which the desktops of a killed runner had ended, at most.
    """

    kills: Counter[str] = field(default_factory=Counter[str])
    resumes: int = 0
    given_up: int = 0
    ended: int = 0
    episodes: int = 0
    repeated: int = 0
    problems: list[str] = field(default_factory=list[str])
    slowest_end: float = 0.0


def tree(root: int) -> dict[int, str]:
    """Return the command lines of a process and of all below it."""
    parents: dict[int, int] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            number = parent_of(int(folder.name))
            if number is not None:
                parents[int(folder.name)] = number
    names = {root}
    grown = True
    while grown:
        below = {pid for pid, parent in parents.items() if parent in names} - names
        grown = bool(below)
        names |= below
    return {pid: command_of(pid) for pid in names}


def parent_of(pid: int) -> int | None:
    """Return the parent of a process; `None` if it has ended."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return None
    return int(text.rpartition(")")[2].split()[1])


def command_of(pid: int) -> str:
    """Return the command line of a process; empty if it has ended."""
    try:
        return (
            Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        )
    except OSError:
        return ""


def candidates(root: int) -> Mapping[str, list[int]]:
    """Return the processes of a runner by kind, in the order of their numbers."""
    below = tree(root)
    keepers = [pid for pid, command in below.items() if KEEPER in command]
    oldest = [pid for pid in keepers if parent_of(pid) not in keepers]
    inside = {pid for keeper in oldest for pid in tree(keeper)} - set(oldest)
    first = [record["init"][0] for record in registry.records() if "init" in record]
    workers = [pid for pid, command in below.items() if WORKER in command and pid not in inside]
    return {
        "runner": [root],
        "worker": sorted(workers),
        "keeper": sorted(oldest),
        "init": sorted(inside.intersection(first)),
        "program": sorted(inside),
    }


class Killer:
    """Breaks runs off.

    Args:
        folder: Where the runs go.
        desktops: Desktops side by side.
        seed: Decides instants and victims.
        longest: Seconds until a kill, at most.
    """

    def __init__(self, folder: Path, desktops: int, seed: int, longest: float) -> None:
        self._folder = folder
        self._desktops = desktops
        self._draws = random.Random(seed)
        self._config = folder / "tiny.yaml"
        agent = folder / "forking.py"
        agent.write_text(FORKING_AGENT)
        self._config.write_text(CONFIG.format(agent=f"{agent.resolve()}:Forking"))
        self._longest = longest
        self._known_desktops: dict[str, list[int]] = {}
        self.outcome = Outcome()
        self._known: set[int] = set()

    def play(self, kills: int) -> None:
        """Kill so many times, and bring the last run to its end."""
        while sum(self.outcome.kills.values()) < kills:
            self._one_run(kills)
        if not self.outcome.ended:
            self._one_run(kills)

    def _one_run(self, kills: int) -> None:
        """Begin a run, kill until it ends or all kills are done, and check it."""
        out = self._folder / f"run{self.outcome.ended}"
        words: tuple[str, ...] = ()
        while True:
            before = sum(self.outcome.kills.values())
            code = self._session(out, words, kills)
            # Three kills in a row that hit starts of one desktop end a run with an error; it is
            # gone on with like one whose runner was killed.
            given_up = code == GIVEN_UP and sum(self.outcome.kills.values()) > before
            if code is not None and not given_up:
                break
            words = ("--resume",)
            self.outcome.resumes += 1
            self.outcome.given_up += given_up
        self._check(out, code)

    def _session(self, out: Path, words: tuple[str, ...], kills: int) -> int | None:
        """Play until the run ends, or its runner is killed; return its exit code or `None`."""
        command = [*HIJACK, "bench", str(self._config), "--out", str(out)]
        log = (self._folder / "log.txt").open("ab")
        process = subprocess.Popen(
            [*command, "--desktops", str(self._desktops), *words],
            stdout=log,
            stderr=subprocess.STDOUT,
        )
        log.close()
        while sum(self.outcome.kills.values()) < kills:
            kind = self._draws.choice(TARGETS)
            # One runner in two is killed while it begins, the others while episodes are played.
            awaited = kind if kind != "runner" else self._draws.choice(("runner", "keeper"))
            delay = self._draws.uniform(0, self._longest)
            while process.poll() is None and not candidates(process.pid)[awaited]:
                time.sleep(0.2)
            try:
                return process.wait(delay)
            except subprocess.TimeoutExpired:
                if self._kill(process, kind) and kind == "runner":
                    process.wait()
                    self._wait_until_gone()
                    return None
        return process.wait()

    def _kill(self, process: "subprocess.Popen[bytes]", kind: str) -> bool:
        """Kill a process of a run; return whether there was one."""
        alive = candidates(process.pid)
        for pids in alive.values():
            self._known.update(pids)
        below = {pid for pids in alive.values() for pid in pids}
        for record in registry.records():
            if record.get("keeper", [0])[0] in below:
                self._known_desktops[record["id"]] = record["keeper"]
        if not alive[kind]:
            return False
        victim = self._draws.choice(alive[kind])
        name = command_of(victim)[-70:].strip()
        try:
            os.kill(victim, signal.SIGKILL)
        except ProcessLookupError:
            return False
        self.outcome.kills[kind] += 1
        print(f"  kill {sum(self.outcome.kills.values())}: {kind} {victim} ({name})", flush=True)
        return True

    def _wait_until_gone(self) -> None:
        """Wait until all that belonged to a killed runner has ended."""
        start = time.monotonic()
        living_processes = set(self._alive())
        while living_processes and time.monotonic() < start + PATIENCE:
            if any(KEEPER in command_of(pid) for pid in living_processes):
                self.outcome.slowest_end = max(self.outcome.slowest_end, time.monotonic() - start)
            time.sleep(0.1)
            living_processes = set(self._alive())
        if living_processes:
            names = ", ".join(f"{pid} {command_of(pid)[:60]}" for pid in sorted(living_processes))
            self.outcome.problems.append(f"still there after a kill: {names}")
        self._known.clear()

    def _alive(self) -> Iterator[int]:
        for pid in self._known:
            try:
                state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
            except OSError:
                continue
            if state != "Z":
                yield pid

    def _check_desktops(self) -> None:
        """Note what is left of the desktops of the runs."""
        present = {record["id"]: record.get("keeper") for record in registry.records()}
        leftovers = [
            name for name, keeper in self._known_desktops.items() if present.get(name) == keeper
        ]
        leftover_parts = {*network.leftovers(set(present)), *limits.leftovers(set(present))}
        leftovers += sorted(leftover_parts.intersection(self._known_desktops))
        if leftovers:
            self.outcome.problems.append(f"left of desktops: {', '.join(leftovers)}")
        self._known_desktops.clear()

    def _check(self, out: Path, code: int) -> None:
        """Note what is wrong with a run that has ended."""
        self._wait_until_gone()
        self._check_desktops()
        run = records.read(out)
        counts = Counter(record["id"] for record in run.records)
        cases = latest(run.records)
        outcome = self.outcome
        outcome.ended += 1
        outcome.episodes += run.planned
        outcome.repeated += len(run.records) - len(cases)
        if code != 0:
            outcome.problems.append(f"{out}: exit code {code}")
        twice = [name for name, number in counts.items() if number > 1]
        if twice:
            outcome.problems.append(f"{out}: counted twice: {', '.join(twice)}")
        if run.missing or len(cases) != run.planned:
            outcome.problems.append(f"{out}: {len(cases)} of {run.planned} episodes")
        outcome.problems += [
            f"{out}: {record['id']}: {record['status']}: {record['problem']}"
            for record in cases.values()
            if record["status"] != "ok"
        ]
        verified = subprocess.run(
            [*HIJACK, "verify", str(out)], capture_output=True, text=True, check=False
        )
        if verified.returncode:
            outcome.problems.append(f"{out}: hijack verify: {verified.stdout[-600:]}")


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--kills", type=int, default=100)
    options.add_argument("--desktops", type=int, default=2)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument(
        "--longest", type=float, default=25.0, help="seconds until a kill, at most"
    )
    options.add_argument("--keep", type=Path, help="folder for the runs; else they are removed")
    args = options.parse_args()
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        folder = args.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        killer = Killer(folder, args.desktops, args.seed, args.longest)
        killer.play(args.kills)
    outcome = killer.outcome
    rows = [[f"kill -9 of a {kind}", str(outcome.kills[kind])] for kind in TARGETS]
    rows += [
        ["times gone on with", str(outcome.resumes)],
        ["of them after a desktop that did not start", str(outcome.given_up)],
        ["runs that came to their end", str(outcome.ended)],
        ["episodes planned in them", str(outcome.episodes)],
        ["attempts lost with their process, and played again", str(outcome.repeated)],
        ["lost, counted twice, left over or not verified", str(len(outcome.problems))],
        ["s after which the desktops of a killed runner had ended", f"{outcome.slowest_end:.1f}"],
    ]
    print(f"\n{machine()}\n")
    kill_count = sum(outcome.kills.values())
    took = format_duration(time.monotonic() - start)
    print(f"{kill_count} kills on {args.desktops} desktops, seed {args.seed}, {took}\n")
    print(table(["what", "number"], rows))
    for problem in outcome.problems:
        print(json.dumps(problem))
    raise SystemExit(1 if outcome.problems else 0)


if __name__ == "__main__":
    main()
