"""Bring a desktop to rest: wait for programs that work, end those that have not written yet."""

import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from online_env.desktops.protocol import RunResult
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.idle import end_process, wait_until_idle

WRITES_LATE = "trap 'echo written > late; exit' TERM; touch begun; while :; do sleep 0.05; done"


class Here(FolderDesktop):
    """This machine as a desktop, for programs that the test has started itself."""

    capabilities = frozenset({"files", "accessibility"})

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        process = subprocess.run(argv, capture_output=True, text=True, timeout=timeout)
        return RunResult("success", process.stdout, process.stderr, process.returncode)


def test_a_program_that_works_is_waited_for_and_not_for_ever(tmp_path: Path) -> None:
    desktop = Here(tmp_path)
    with subprocess.Popen(["yes"], stdout=subprocess.DEVNULL) as program:
        assert not wait_until_idle(desktop, ["yes"], max_wait=0.5)
        threading.Timer(1.0, program.kill).start()
        assert wait_until_idle(desktop, ["yes"])
        assert program.poll() is not None


@pytest.mark.parametrize("is_stopped", [False, True])
def test_a_program_that_writes_when_it_ends_is_ended(tmp_path: Path, is_stopped: bool) -> None:
    with subprocess.Popen(["sh", "-c", WRITES_LATE], cwd=tmp_path) as program:
        while not (tmp_path / "begun").exists():
            time.sleep(0.01)
        if is_stopped:
            program.send_signal(signal.SIGSTOP)
        end_process(Here(tmp_path), f"echo {program.pid}", "the program")
        assert (tmp_path / "late").read_text() == "written\n"


def test_a_program_that_ends_when_it_is_asked_gets_no_signal(tmp_path: Path) -> None:
    ask = f"touch {tmp_path}/asked"
    script = "trap 'touch signalled' TERM; until [ -e asked ]; do sleep 0.05; done; sleep 0.3"
    with subprocess.Popen(["sh", "-c", script], cwd=tmp_path) as program:
        end_process(Here(tmp_path), f"echo {program.pid}", "the program", close=ask)
        assert program.wait() == 0
    assert not (tmp_path / "signalled").exists()


def test_where_nothing_runs_nothing_is_ended(tmp_path: Path) -> None:
    end_process(Here(tmp_path), "true", "the program")
    assert wait_until_idle(FolderDesktop(tmp_path), ["yes"])
