"""The command `hijack view`: it serves until Ctrl-C, and is refused what it cannot show."""

import http.client
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pipelines import build


def command(*words: object) -> subprocess.Popen[str]:
    line = [sys.executable, "-m", "hijack_data.cli", "view", *map(str, words)]
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("harmed", [False, True])
def test_the_command_serves_until_ctrl_c(
    recording: Any, small: Any, tmp_path: Path, harmed: bool
) -> None:
    build(recording(), tmp_path / "out", corruptions={"marks": small["marks"]}, rows_per_shard=6)
    if harmed:
        os.truncate(min((tmp_path / "out" / "data").iterdir()), 100)
    process = command(tmp_path / "out")
    assert process.stdout is not None
    line = process.stdout.readline()
    result = re.search(r"(\d+) rows \(.*\) at http://127\.0\.0\.1:(\d+)/\?token=(\S+)", line)
    assert result is not None
    assert int(result[1]) == (6 if harmed else 12)
    link = http.client.HTTPConnection("127.0.0.1", int(result[2]), timeout=30)
    cookie = {"Cookie": f"hijack-view-{result[2]}={result[3]}"}
    link.request("GET", "/api/about", headers=cookie)
    assert json.loads(link.getresponse().read())["rows"] == int(result[1])
    link.close()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert (out, process.returncode) == ("the page has ended\n", int(harmed))
    assert ("data/train-00000.parquet" in err) == harmed
    assert "Traceback" not in err


def test_the_command_refuses_what_it_cannot_show(tmp_path: Path) -> None:
    process = command(tmp_path)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert err.startswith(f"hijack: error: {tmp_path}: not a dataset of ours")


def test_the_library_stays_light() -> None:
    code = (
        "import sys, pipelines.viewer.view_command; sys.exit('pyarrow' in sys.modules or 'torch' in"
        " sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
