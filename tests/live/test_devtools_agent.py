"""An agent of a user that acts in the corrupted Chromium by DevTools, in `hijack bench`."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("miniwob", reason=needs.BROWSER)
pytest.importorskip("websocket", reason=needs.WEBSOCKET)

AGENT = """\
import json
import urllib.request

import websocket


class Mine:
    uses_devtools = True

    def connect(self, address):
        with urllib.request.urlopen(f"{address}/json/list") as answer:
            pages = json.load(answer)
        [self.page] = [page for page in pages if "miniwob.test" in page["url"]]
        self.turn = 0

    def predict(self, instruction, obs):
        self.turn += 1
        if self.turn == 1:
            return "I look.", []
        socket = websocket.create_connection(
            self.page["webSocketDebuggerUrl"], suppress_origin=True
        )
        code = "document.getElementById('subbtn').click()"
        call = {"id": 1, "method": "Runtime.evaluate", "params": {"expression": code}}
        socket.send(json.dumps(call))
        socket.recv()
        socket.close()
        return "I pressed it.", ["DONE"]
"""


@pytest.fixture(autouse=True)
def chromium_here() -> None:
    needs.chromium()


def bench(folder: Path, agents: str, corruptions: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "hijack_data.cli", "bench", "miniwob_small"]
    command += ["--tasks", "miniwob/click-test.html", "--desktops", "1", "--out", str(folder)]
    command += ["--agent", agents, "--corruptions", corruptions]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_it_gets_the_address_and_the_record_says_so(tmp_path: Path) -> None:
    agent = tmp_path / "mine.py"
    agent.write_text(AGENT)
    result = bench(tmp_path / "run", f"{agent}:Mine,do_nothing", "app_minimization")
    assert result.returncode == 0, result.stdout + result.stderr
    lines = (tmp_path / "run" / "records.jsonl").read_text().splitlines()
    records = {(item["agent"], item["corruption"]): item for item in map(json.loads, lines)}
    assert len(records) == 2
    for (name, _), record in records.items():
        assert record["status"] == "ok", record["problem"]
        is_theirs = name != "do_nothing"
        assert record["given"] == (["devtools"] if is_theirs else [])
        assert record["score"] == float(is_theirs)
        assert len(record["effects"]) == 1
        assert record["malformed"] == 0
    verify = subprocess.run(
        [sys.executable, "-m", "hijack_data.cli", "verify", str(tmp_path / "run")],
        capture_output=True,
        text=True,
    )
    assert verify.returncode == 0, verify.stdout + verify.stderr


def test_a_corruption_of_pictures_that_it_would_not_see_is_refused(tmp_path: Path) -> None:
    agent = tmp_path / "mine.py"
    agent.write_text(AGENT)
    result = bench(tmp_path / "run", f"{agent}:Mine", "pop_ups")
    assert result.returncode == 2
    assert "pop_ups is in the pictures that the runner gives" in result.stderr
