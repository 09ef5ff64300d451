"""Runs the shell blocks of a page as somebody who pastes them, one after the other, into a
terminal."""

import re
import shlex
import signal
import subprocess
from collections.abc import Iterable
from pathlib import Path

from .docs import ACTIVATE, Block, surroundings
from .pages import open_page

# Ends with Ctrl-C, and says its address before that.
SERVES = re.compile(r"hijack (desktop )?view\b")


class Terminal:
    """A shell in the root of a clone. Whether the environment is active is all that it
    remembers."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.active = folder, False

    def paste(self, blocks: Iterable[Block]) -> None:
        """Run the lines of some blocks; each must succeed."""
        for block in blocks:
            for line in block.lines:
                self._line(line, f"{block.name}: {line}")

    def _line(self, line: str, where: str) -> None:
        if line == ACTIVATE:
            assert (self.folder / ".venv" / "bin" / "activate").exists()
            self.active = True
        elif SERVES.match(line):
            self._look(line, where)
        else:
            result = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", line],
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                env=surroundings(self.active, self.folder),
                capture_output=True,
                text=True,
                timeout=900,
            )
            assert result.returncode == 0, f"{where}\n{result.stdout}\n{result.stderr}"

    def _look(self, line: str, where: str) -> None:
        """Serve a page, open it, then press Ctrl-C."""
        command = shlex.split(line)
        environment = surroundings(self.active, self.folder)
        with subprocess.Popen(
            ["env", *command],
            cwd=self.folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as process:
            try:
                assert process.stdout is not None
                message = next((output for output in process.stdout if "http://" in output), "")
                address = re.search(r"http://127\.0\.0\.1:\d+/\S*", message)
                assert address is not None, f"{where}: says no address"
                with open_page(address[0]) as page:
                    assert page.status == 200, where
                process.send_signal(signal.SIGINT)
                assert process.wait(120) == 0, where
            finally:
                process.kill()
