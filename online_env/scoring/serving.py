"""What a worker runs: it answers the rows that it is given, until its parent is gone."""

import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..agents.apart import AgentError
from .asking import Asker, Asking
from .cases import Case, open_feed


def serve(connection: Any, folder: Path, asking: Asking, path: Sequence[str]) -> None:
    """Answer shares of rows; see `workers`.

    Args:
        connection: to the parent.
        folder: the dataset.
        asking: how rows are put to the agent.
        path: where modules are found, as in the parent.
    """
    os.setsid()  # so that the parent can end this process with all that the agent starts
    os.dup2(2, 1)  # an agent may print; standard output belongs to the command
    sys.path[:] = path
    threading.Thread(target=_end_with_parent, daemon=True).start()
    feed = open_feed(folder, asking.question)
    try:
        asker = Asker(asking, feed)
    except AgentError as error:
        connection.send(("failed", "\n".join([str(error), *error.where[-1:]])))
        return
    connection.send(("ready", None))
    while True:
        try:
            cases, single = connection.recv()
        except EOFError:
            return
        _answer(connection, asker, cases, single)


def _answer(connection: Any, asker: Asker, cases: Sequence[Case], single: bool) -> None:
    size = 1 if single else asker.batch
    for start in range(0, len(cases), size):
        part = cases[start : start + size]
        if len(part) == 1:
            record = asker.one(part[0], lambda: connection.send(("asks", 1)))
            connection.send(("records", [record]))
            continue
        count = len(part)
        try:
            records = asker.several(part, lambda count=count: connection.send(("asks", count)))
        except AgentError as error:
            connection.send(("batch failed", str(error)[:300]))
        else:
            connection.send(("records", records))


def _end_with_parent() -> None:
    # Even if the parent was killed with SIGKILL; the agent may have started processes, too.
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os.killpg(os.getpgid(0), signal.SIGKILL)
