"""Tests with `@pytest.mark.robust`: play the agent that a test returns, and judge the run."""

import inspect
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import NoReturn

import pytest

from hijack_data.errors import HijackError, ParameterError, suggest

from ..report.build import build_report
from ..report.conclusions import conclude
from ..report.gate import RETENTION_LOW, ReleaseGate
from ..results import reading, scores
from ..tasks import find_family
from .config import Bench, load_bench, override
from .providers import EMBEDDED

MAX_OUTPUT_CHARS = 4000  # of a benchmark that failed
PLAYED = (0, 1)  # exit codes of a benchmark that came to its end


@dataclass(frozen=True, kw_only=True)
class RobustMark:
    """The arguments of `@pytest.mark.robust`.

    Attributes:
        suite: the configuration of the benchmark, such as `embedded_small`.
        retention: what the lower end of the 95 % interval of the retention must reach, 0 to 1.
        gates: further scores that must be reached, as in `hijack gate --fail-under`.
        tasks: tasks instead of the suite's: names separated by commas, or a set.
        conditions: conditions instead of the suite's: labels separated by commas, or `all`.
        seeds: seeds 0 to `seeds` - 1, instead of the suite's.
        machines: addresses or providers of machines of the user, for tasks of OSWorld.
        desktops: how many desktops play side by side.
        options: further options of `hijack bench`.
    """

    suite: str
    retention: float | None = None
    gates: Sequence[str] = ()
    tasks: str | None = None
    conditions: str | None = None
    seeds: int | None = None
    machines: Sequence[str] = ()
    desktops: int | None = None
    options: Sequence[str] = ()

    @property
    def fail_under(self) -> list[str]:
        """The gates, as `--fail-under` takes them."""
        bound = [] if self.retention is None else [f"{RETENTION_LOW}={self.retention}"]
        return [*bound, *self.gates]

    def command(self, agent: str, folder: Path) -> list[str]:
        """Return the command that plays an agent."""
        options = {
            "--tasks": self.tasks,
            "--corruptions": self.conditions,
            "--seeds": self.seeds,
            "--desktops": self.desktops,
        }
        words = [f"{name}={value}" for name, value in options.items() if value is not None]
        words += [f"--vm={machine}" for machine in self.machines]
        bench = [sys.executable, "-m", "hijack_data.cli", "bench", self.suite]
        return [*bench, f"--agent={agent}", f"--out={folder}", *words, *self.options]


def run_robust_test(item: pytest.Function, mark: pytest.Mark) -> None:
    """Call a test, play the agent that it returns, and judge the run."""
    try:
        options = read_mark(mark)
        lacking = _check(options)
    except HijackError as error:
        _fail(f"@pytest.mark.robust: {error}")
    if lacking:
        stop = pytest.fail if item.config.getoption("--robust-required") else pytest.skip
        stop(f"no desktop can run here: {lacking}")
    returned = _call(item)
    try:
        agent = agent_reference(returned)
    except HijackError as error:
        _fail(str(error))
    folder = _run_folder(item)
    _play(options.command(agent, folder))
    _judge(item, reading.read(folder), options)


def _check(options: RobustMark) -> str:
    """Check suite and gates before anything is played.

    Returns:
        Why no desktop can run here; empty if one can.

    Raises:
        HijackError: there is no such suite, task or condition, or a gate is wrong.
    """
    benchmark = override(load_bench(options.suite), None, options.tasks, options.conditions)
    ReleaseGate.read(options.fail_under, None, ["the agent"], list(benchmark.planners))
    return "" if options.machines else lack_of_desktop(benchmark)


def read_mark(mark: pytest.Mark) -> RobustMark:
    """Return the arguments of a mark.

    Raises:
        ParameterError: an argument is unknown or missing, or there is nothing to judge by.
    """
    names = [entry.name for entry in fields(RobustMark)]
    if mark.args:
        raise ParameterError("write arguments by name, suite='embedded_small'")
    for name in mark.kwargs:
        if name not in names:
            raise ParameterError(f"no argument {name!r}{suggest(name, names)}")
    if "suite" not in mark.kwargs:
        raise ParameterError("name a suite, such as suite='embedded_small'")
    options = RobustMark(**mark.kwargs)
    for name in ("gates", "machines", "options"):
        if isinstance(getattr(options, name), str):
            raise ParameterError(f"{name} is a list of texts")
    if not options.fail_under:
        raise ParameterError("say what is required, retention=0.8 or gates=['success=0.5']")
    return replace(options, suite=str(options.suite))


def agent_reference(agent: object) -> str:
    """Return how `hijack bench` names an agent that a test returned: a name, or a class.

    Raises:
        ParameterError: it is neither, or a class that another process cannot import.
    """
    if isinstance(agent, str) and agent:
        return agent
    if not isinstance(agent, type):
        raise ParameterError(
            f"a test with @pytest.mark.robust returns an agent's name or class, not {agent!r:.80}"
        )
    if agent.__qualname__ != agent.__name__:
        raise ParameterError(
            f"{agent.__qualname__} is defined inside something: agents run in processes of their"
            " own, so move the class to the top of its module"
        )
    return f"{inspect.getfile(agent)}:{agent.__name__}"


def lack_of_desktop(benchmark: Bench) -> str:
    """Return why the desktops of a benchmark cannot run here; empty if they can, or may."""
    if benchmark.provider != EMBEDDED or find_family(benchmark.tasks) is not None:
        return ""
    from ..embedded import doctor

    findings = doctor.diagnose(("core",))
    return next(
        (
            f"{finding.name}: {finding.detail}; {finding.fix}"
            for finding in findings
            if finding.required and not finding.ok
        ),
        "",
    )


def _call(item: pytest.Function) -> object:
    """Return what a test returns."""
    parameters = inspect.signature(item.obj).parameters
    return item.obj(**{name: item.funcargs[name] for name in parameters})


def _run_folder(item: pytest.Function) -> Path:
    """Return a new folder for the run of a test."""
    name = re.sub(r"[^\w.-]+", "_", item.name)
    runs = item.config.getoption("--robust-runs")
    if runs is None:
        return Path(str(item.funcargs["tmp_path"])) / "run"
    folder = Path(runs).absolute() / name
    number = 1
    while folder.exists():
        number += 1
        folder = folder.with_name(f"{name}-{number}")
    return folder


def _play(command: Sequence[str]) -> None:
    """Run a benchmark in a process of its own."""
    process = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    if process.returncode not in PLAYED:
        output = process.stdout[-MAX_OUTPUT_CHARS:]
        _fail(f"the benchmark ended with exit code {process.returncode}:\n{output}")


def _judge(item: pytest.Function, run: reading.Run, options: RobustMark) -> None:
    """Fail unless every planned episode counts and all gates are passed."""
    look = f"the run: hijack view {run.folder}"
    uncounted = [record for record in run.last_attempts if not scores.counts(record)]
    if run.missing or run.damaged or uncounted:
        problems = [f"{record['id']}: {record.get('problem')}" for record in uncounted[:3]]
        count = run.missing + len(run.damaged) + len(uncounted)
        _fail("\n".join([f"{count} episodes are missing, damaged or invalid", *problems, look]))
    agents = list(dict.fromkeys(record["agent"] for record in run.records))
    labels = list(dict.fromkeys(record["corruption"] for record in run.records))
    verdicts = ReleaseGate.read(options.fail_under, None, agents, labels).verdicts(run)
    conclusion = "\n".join(conclude(build_report(run)))
    lines = [conclusion, *(str(verdict) for verdict in verdicts), look]
    item.user_properties.append(("robustness", conclusion))
    if not all(verdict.passed for verdict in verdicts):
        _fail("\n".join(lines))
    item.add_report_section("call", "robustness", "\n".join(lines))


def _fail(reason: str) -> NoReturn:
    pytest.fail(reason, pytrace=False)
