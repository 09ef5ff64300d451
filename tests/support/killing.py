"""Builds in processes of their own, which are killed with SIGKILL at a chosen instant.

The processes are forked from a server that has loaded everything, so that a build takes a tenth of
a second. (Its only threads are those of OpenBLAS and jemalloc, which both outlive a fork.)
"""

import json
import mmap
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

PATIENCE = 60.0


class Killer:
    """Talks to the server. `options` are those of `build`; `number` counts the files that are put
    in place."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process

    def at_rename(
        self, source: Path, out: Path, options: dict[str, Any], number: int, before: bool
    ) -> bool:
        """Build until right before or after the `number`-th rename; return whether it came to
        that."""
        return self._ask(source, out, options, number=number, before=before)["killed"]

    def at_step(
        self, source: Path, out: Path, options: dict[str, Any], step: int, delay: float
    ) -> bool:
        """Build until `delay` seconds after `step` steps are done; return whether it was killed
        before the end."""
        return self._ask(source, out, options, step=step, delay=delay)["killed"]

    def renames(self, source: Path, out: Path, options: dict[str, Any]) -> list[str]:
        """Build undisturbed, and return the names of the files in the order in which they are put
        in place."""
        return self._ask(source, out, options)["names"]

    def _ask(self, source: Path, out: Path, options: dict[str, Any], **how: Any) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(
            json.dumps([str(source), str(out), options, how]), file=self._process.stdin, flush=True
        )
        answer = json.loads(self._process.stdout.readline())
        assert answer["status"] in (0, -signal.SIGKILL), answer
        return {"killed": answer["status"] != 0, **answer}


@contextmanager
def killer() -> Iterator[Killer]:
    """Start the server."""
    command = [sys.executable, __file__]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=environment) as process:
        yield Killer(process)
        assert process.stdin is not None
        process.stdin.close()


def _serve() -> None:
    with tempfile.TemporaryDirectory() as folder:
        _warm_up(Path(folder))
    for line in sys.stdin:
        source, out, options, how = json.loads(line)
        shared = mmap.mmap(-1, 1 << 16)  # number of steps, then the names of the files
        pid = os.fork()
        if not pid:
            _build(source, out, options, how, shared)
            os._exit(0)
        if "step" in how:
            _kill_later(pid, shared, how["step"], how["delay"])
        _, status = os.waitpid(pid, 0)
        names = shared[8:].rstrip(b"\0").decode().split()
        print(json.dumps({"status": os.waitstatus_to_exitcode(status), "names": names}), flush=True)


def _warm_up(folder: Path) -> None:
    """Build something of the size of the tests' pictures, so that all is loaded, compiled kernels
    too."""
    import numpy as np
    from PIL import Image

    (folder / "source").mkdir()
    Image.fromarray(np.zeros((200, 320, 3), np.uint8)).save(folder / "source" / "0.png")
    line = {
        "trajectory_id": "t",
        "step": 0,
        "instruction": "x",
        "image": "0.png",
        "action": {"type": "wait"},
    }
    (folder / "source" / "trajectories.jsonl").write_text(json.dumps(line))
    corruptions = {"marks": ["marks", {"number": 1, "mark_size": 8}], "half": ["resolution", {}]}
    _build(
        str(folder / "source"),
        str(folder / "out"),
        {"corruptions": corruptions},
        {},
        mmap.mmap(-1, 1 << 16),
    )


def _kill_later(pid: int, shared: mmap.mmap, step: int, delay: float) -> None:
    deadline = time.monotonic() + PATIENCE
    while int.from_bytes(shared[:8], "big") < step and time.monotonic() < deadline:
        time.sleep(0.0005)
        if os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
            return
    time.sleep(delay)
    os.kill(pid, signal.SIGKILL)


def _build(
    source: str, out: str, options: dict[str, Any], how: dict[str, Any], shared: mmap.mmap
) -> None:
    import hijack_data as hj
    from pipelines import build

    replace, names = Path.replace, list[str]()

    def counted(self: Path, target: Path) -> Path:
        is_target = len(names) == how.get("number")
        names.append(target.name)
        text = " ".join(names).encode()
        shared[8 : 8 + len(text)] = text
        if is_target and how["before"]:
            os.kill(os.getpid(), signal.SIGKILL)
        result = replace(self, target)
        if is_target:
            os.kill(os.getpid(), signal.SIGKILL)
        return result

    def progress(done: int, *_: object) -> None:
        shared[:8] = done.to_bytes(8, "big")

    planners = {
        label: hj.make_corruption(name, **parameters)
        for label, (name, parameters) in options.pop("corruptions").items()
    }
    with patch.object(Path, "replace", counted):
        assert build(source, out, corruptions=planners, **options, progress=progress).total


if __name__ == "__main__":
    _serve()
