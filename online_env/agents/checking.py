"""Try an agent in a separate process, so that even an agent that hangs or dies gets a verdict."""

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any

from hijack_data.conformance.base import Result
from hijack_data.loading import LoadedFile

from . import conformance
from .base import Privileged
from .registry import AGENTS

LIMIT = 120.0  # s for all calls of one check


def agents_of(file: LoadedFile) -> list[str]:
    """Return the names of the agents in a loaded file: registered ones, and its own classes."""
    named = list(file.names.get("agent", ()))
    known = [AGENTS.get(name) for name in named]
    module = vars(sys.modules[file.module])
    for title, value in module.items():
        is_own = isinstance(value, type) and value.__module__ == file.module
        if is_own and callable(getattr(value, "predict", None)) and value not in known:
            named.append(AGENTS.find(f"{file.path}:{title}"))
    return named


def check(name: str, limit: float = LIMIT) -> Iterator[Result | str]:
    """Yield the outcome of each check of an agent, or the reason why it is not checked.

    Args:
        name: of an agent, or `package.module:Class`, or `path/to/file.py:Class`.
        limit: seconds for each check.
    """
    maker = AGENTS.get(AGENTS.find(name))
    if isinstance(maker, type) and issubclass(maker, Privileged):
        yield "it is given a task and a machine (prepare), so it is not a contestant"
        return
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_try, args=(theirs, name, list(sys.path)), daemon=False)
    process.start()
    theirs.close()
    try:
        yield from _results(ours, process, limit)
    finally:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid or 0, signal.SIGKILL)
        process.kill()
        process.join()


def _results(connection: Any, process: Any, limit: float) -> Iterator[Result]:
    left = conformance.names_of_checks()
    while left:
        late = not connection.poll(limit)
        try:
            result: Result | None = None if late else connection.recv()
        except EOFError:
            process.join(1)
            problem = f"the process of the agent died (exit code {process.exitcode})"
            yield Result(left[0], conformance.about(left[0]), problem)
            return
        if late:
            problem = f"no answer within {limit:g} s: it hangs, or is too slow (--timeout)"
            yield Result(left[0], conformance.about(left[0]), problem)
            return
        if result is None:
            return
        left.remove(result.check)
        yield result


def _try(connection: Any, name: str, path: Sequence[str]) -> None:
    """Run the checks in this process, whose standard output is a file that is then examined."""
    os.setsid()
    sys.path[:] = path
    with tempfile.TemporaryFile() as output:
        os.dup2(output.fileno(), 1)

        def printed() -> int:
            sys.stdout.flush()
            return os.fstat(output.fileno()).st_size

        for result in conformance.run_checks(name, printed):
            connection.send(result)
        connection.send(None)
    os._exit(0)  # threads of an agent may still run
