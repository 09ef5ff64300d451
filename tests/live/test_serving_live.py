"""`hijack serve` with real desktops, driven by OpenEnv's own client."""

import base64
import contextlib
import io
import os
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("prometheus_client", reason=needs.SERVE)
pytest.importorskip("openenv", reason=needs.SERVE)

from openenv.core.generic_client import GenericEnvClient

from support.serving import until

TOKEN = "correct-horse-battery-staple"
START = 180  # seconds
KEEPER = "runtime.keeper"
WRITTEN = "~/Documents/{name}"
pytestmark = [pytest.mark.usefixtures("embedded_machine"), pytest.mark.filterwarnings("ignore")]


@contextlib.contextmanager
def serving(*words):
    """`hijack serve`; yields its process and address. Nothing may be left of it at the end."""
    command = [sys.executable, "-m", "hijack_data.cli", "serve", "embedded", "--port", "0"]
    command += ["--tasks", "write_note", "--size", "1280x720", "--desktops", "1", *words]
    environment = {**os.environ, "AGENTHIJACK_SERVE_TOKEN": TOKEN}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    timer = threading.Timer(START, process.kill)
    timer.start()
    try:
        line = process.stdout.readline()
        timer.cancel()
        yield process, re.search(r"http://\S+?(?=,)", line)[0]
        below = keepers(process.pid)
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0
        assert process.stdout.read() == "the server has ended\n"
        until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in below))
    finally:
        timer.cancel()
        process.kill()
        process.wait()
        process.stdout.close()


def client(url):
    headers = {"Authorization": f"Bearer {TOKEN}"}
    return GenericEnvClient(base_url=url, message_timeout_s=300, headers=headers).sync()


def keepers(pid):
    """The keepers of the desktops that a process started."""
    items = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            words = (folder / "cmdline").read_bytes()
            if parent == pid and KEEPER.encode() in words:
                items.append(int(folder.name))
    return items


def free(url):
    """How many desktops a server has to lend."""
    headers = {"Authorization": f"Bearer {TOKEN}"}
    request = urllib.request.Request(f"{url}/metrics", headers=headers)
    with urllib.request.urlopen(request, timeout=30) as answer:
        text = answer.read().decode()
    return float(re.search(r'hijack_desktops\{state="free"\} (\S+)', text)[1])


def picture(observation):
    data = base64.b64decode(observation["screenshot"])
    return np.asarray(Image.open(io.BytesIO(data)))


def written(instruction):
    """The actions that do `write_note`: its window is open, the text is in the instruction."""
    name = re.search(r"[a-z]+-\d\d\.txt", instruction)[0]
    text = instruction.partition("\n\n")[2]
    return [
        "pyautogui.click(600, 350)",
        f"pyautogui.write({text!r})",
        "pyautogui.hotkey('ctrl', 's')",
        "WAIT",
        "pyautogui.hotkey('alt', 'n')",
        "pyautogui.hotkey('ctrl', 'a')",
        f"pyautogui.write({WRITTEN.format(name=name)!r})",
        "WAIT",
        "pyautogui.press('enter')",
        "WAIT",
        "DONE",
    ]


def test_two_sessions_play_side_by_side_and_are_scored():
    with serving("--desktops", "2") as (process, url):
        pid = process.pid
        environment = Path(f"/proc/{keepers(pid)[0]}/environ").read_bytes()
        assert TOKEN.encode() not in environment
        results = {}
        both = threading.Barrier(2, timeout=300)

        def session(corruption, solves):
            with client(url) as env:
                result = env.reset(seed=3, corruption=corruption)
                first = result.observation
                both.wait()
                assert free(url) == 0
                actions = written(first["instruction"]) if solves else ["DONE"]
                for action in actions:
                    result = env.step({"action": action})
                results[corruption] = first, result, env.state()

        threads = [
            threading.Thread(target=session, args=pair)
            for pair in (("clean", True), ("subtitle", False))
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        (clean, won, state), (subtitled, lost, second) = results["clean"], results["subtitle"]
        assert clean["instruction"] == subtitled["instruction"]
        assert picture(clean).shape == (720, 1280, 3)
        assert (picture(clean) != picture(subtitled)).any()
        assert (won.reward, won.done) == (1.0, True), state["record"]["reason"]
        assert (lost.reward, lost.done) == (0.0, True)
        assert [item["record"]["status"] for item in (state, second)] == ["ok", "ok"]
        assert free(url) == 2


def test_one_desktop_meets_what_clients_and_machines_do():
    """A malformed action, unknown names, a vanishing client, a silent one, and a dead desktop."""
    with serving("--lease", "20", "--wait", "120") as (process, url):
        with client(url) as env:
            with pytest.raises(RuntimeError, match="did you mean 'write_note'"):
                env.reset(task="write_nots")
            with pytest.raises(RuntimeError, match="did you mean 'marks'"):
                env.reset(corruption="mark")
            env.reset(seed=1, corruption="clean")
            with pytest.raises(RuntimeError, match="VALIDATION_ERROR"):
                env.step({"actoin": "WAIT"})
            assert env.step({"action": "import os; os.remove('x')"}).done is False
            assert env.step({"action": "DONE"}).reward == 0.0
            assert env.state()["record"]["malformed"] == 1

        vanishing = subprocess.Popen(
            [sys.executable, "-c", VANISHING, url, TOKEN], stdout=subprocess.PIPE, text=True
        )
        assert vanishing.stdout.readline() == "begun\n"
        assert free(url) == 0
        vanishing.kill()
        vanishing.wait()
        vanishing.stdout.close()
        until(lambda: free(url) == 1, 30)

        with client(url) as silent, client(url) as second:
            silent.reset(corruption="clean")
            start = time.monotonic()
            assert second.reset(corruption="clean").done is False
            assert 10 < time.monotonic() - start < 100
            with pytest.raises(RuntimeError, match=r"the client said nothing for .*--lease 20"):
                silent.step({"action": "WAIT"})

            for pid in keepers(process.pid):
                os.kill(pid, signal.SIGKILL)
            with pytest.raises(RuntimeError, match="the desktop ended in mid-episode"):
                second.step({"action": "pyautogui.click(300, 300)"})
            assert second.state()["record"]["status"] in ("invalid", "error")
            assert second.reset(corruption="clean").done is False
            assert second.step({"action": "DONE"}).done


# Says so after a reset, and does nothing more.
VANISHING = """
import sys, time
from openenv.core.generic_client import GenericEnvClient

headers = {"Authorization": f"Bearer {sys.argv[2]}"}
env = GenericEnvClient(base_url=sys.argv[1], message_timeout_s=300, headers=headers).sync()
env.reset(corruption="clean")
print("begun", flush=True)
time.sleep(600)
"""
