"""Guests that answer OSWorld's routes without a screen, and a provider of OSWorld's with a script.

Both fail where a test says so. `DesktopEnv` is OSWorld's own, in a copy whose provider `docker` is
the scripted one and whose waits are short.
"""

import http.server
import io
import json
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image

from online_env.osworld import venv

SIZE = (320, 240)  # width and height of the screen in pixels
PROVIDER = """
import json, os, urllib.request

class DockerProvider:
    def __init__(self, region):
        self.region = region

    def _script(self, event):
        path = os.environ["SCRIPTED_PROVIDER"]
        with open(f"{path}.log", "a") as log:
            log.write(event + "\\n")
        with open(path) as file:
            script = json.load(file)
        if event in script["fails"]:
            raise RuntimeError(f"{event} failed as in the script")
        return script

    def start_emulator(self, path_to_vm, headless, os_type=None):
        self._script("start")

    def get_ip_address(self, path_to_vm):
        host, port = self._script("address")["guest"].split(":")
        return f"{host}:{port}:9222:8006:8080"

    def save_state(self, path_to_vm, snapshot_name):
        raise NotImplementedError

    def revert_to_snapshot(self, path_to_vm, snapshot_name):
        script = self._script("revert")
        if "snapshot" not in script["lacks"]:  # without it vmrun fails, and nobody looks
            urllib.request.urlopen(f"http://{script['guest']}/revert", b"", 5).read()

    def stop_emulator(self, path_to_vm, region=None):
        self._script("stop")
"""
MANAGER = """
class DockerVMManager:
    def get_vm_path(self, **_):
        return "scripted"
"""


# Of pyautogui, the table of keys, as it is on X11.
PYAUTOGUI = """
import sys, types
sys.modules["pyautogui"] = types.SimpleNamespace(
    platformModule=types.SimpleNamespace(keyboardMapping={",": 59, "<": 94}))
"""


class FakeGuest:
    """A guest of OSWorld's without a screen; what it would write to /var/tmp goes to a folder."""

    def __init__(self, folder: Path, dies_at: int | None = None, host: str = "127.0.0.1") -> None:
        guest = self
        folder.mkdir()
        self.loses_answers = False  # to all that is posted
        self.screenshots = 0
        picture = io.BytesIO()
        Image.new("RGB", SIZE, "navy").save(picture, "PNG")

        class Routes(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if self.path == "/screenshot":
                    guest.screenshots += 1
                    if dies_at is not None and guest.screenshots >= dies_at:
                        guest.die()
                    self._answer(picture.getvalue(), "image/png")
                elif self.path == "/platform":
                    self._answer(b"Linux")
                elif self.path == "/terminal":
                    self._answer(b"{}")
                else:
                    self.send_error(404)

            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
                if self.path == "/revert":
                    shutil.rmtree(folder)
                    folder.mkdir()
                    self._answer(b"{}")
                elif self.path == "/execute":
                    command = json.loads(body)["command"]
                    code = str(command[-1]).replace("/var/tmp", str(folder))
                    process = subprocess.run(
                        [sys.executable, "-c", PYAUTOGUI + code],
                        capture_output=True,
                        text=True,
                        check=False,
                    )
                    if guest.loses_answers:
                        return  # without an answer, the connection is closed
                    answer = {
                        "status": "success",
                        "output": process.stdout,
                        "error": process.stderr,
                    }
                    fields = {**answer, "returncode": process.returncode}
                    self._answer(json.dumps(fields).encode(), "application/json")
                elif not guest.loses_answers:
                    self.send_error(404)

            def _answer(self, body: bytes, kind: str = "text/plain") -> None:
                self.send_response(200)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_: Any) -> None:
                """Write nothing."""

        self._server = http.server.ThreadingHTTPServer((host, 0), Routes)
        self.address = f"{host}:{self._server.server_port}"
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    def die(self) -> None:
        """Answer nobody any more."""

        def end() -> None:
            self._server.shutdown()
            self._server.server_close()

        threading.Thread(target=end, daemon=True).start()


@contextmanager
def fake_guests(folder: Path, *dies_at: int | None) -> Iterator[list[FakeGuest]]:
    """Guests with hosts of their own, one for each number of the screenshot at which it dies."""
    guests = [
        FakeGuest(folder / f"guest{n}", at, f"127.0.0.{n + 1}") for n, at in enumerate(dies_at)
    ]
    try:
        yield guests
    finally:
        for guest in guests:
            guest.die()


def scripted_venv(real: Path, folder: Path) -> Path:
    """OSWorld's environment, with the scripted provider for docker and short waits."""
    subprocess.run(
        [sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True, timeout=60
    )
    (packages,) = folder.glob("lib/python*/site-packages")
    (real_packages,) = real.glob("lib/python*/site-packages")
    (packages / "real.pth").write_text(f"{real_packages}\n")
    shutil.copytree(real_packages / "desktop_env", packages / "desktop_env")
    shutil.copy(real / venv.STAMP, folder)
    provider = packages / "desktop_env" / "providers" / "docker"
    (provider / "provider.py").write_text(PROVIDER)
    (provider / "manager.py").write_text(MANAGER)
    for name, old, new in (
        ("desktop_env.py", "time.sleep(5)", "time.sleep(0.05)"),
        ("controllers/python.py", "retry_interval = 5", "retry_interval = 0.05"),
        ("controllers/setup.py", "MAX_RETRIES = 20", "MAX_RETRIES = 1"),
        ("controllers/setup.py", "time.sleep(5)", "time.sleep(0.05)"),
    ):
        path = packages / "desktop_env" / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))
    return folder
