"""OSWorld's `DesktopEnv` in a process with a Python of its own, driven by JSON lines."""

import base64
import contextlib
import json
import os
import select
import signal
import subprocess
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import HijackWarning

from ..errors import DesktopTimeoutError
from .errors import EvaluatorError, OsworldError, TaskRefusedError

BRIDGE = Path(__file__).resolve().parent / "bridge"
# The bridge is loaded by its path, under a name of its own, so that the process can import nothing
# else from this folder.
_LOADER = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location(
    "agenthijack_bridge", sys.argv[1] + "/__init__.py", submodule_search_locations=[sys.argv[1]])
sys.modules[spec.name] = package = importlib.util.module_from_spec(spec)
spec.loader.exec_module(package)
from agenthijack_bridge.worker import main
main()
"""
TIMEOUTS_S = {
    "start": 120.0,  # with a machine that runs; OSWorld's own providers get START_MACHINE_S
    "check": 60.0,
    "check_provider": 60.0,
    "release": 180.0,
    "reset": 900.0,
    "step": 300.0,
    "evaluate": 600.0,
    "controller": 200.0,
}
# A provider may first download its machine's image, about 12 to 20 GB.
START_MACHINE_S = 3 * 3600.0
PROXIES = "PROXY_CONFIG_FILE"  # names the JSON file of OSWorld's proxies
LOG_TAIL_BYTES = 2000


@dataclass(frozen=True)
class Address:
    """Where a guest listens, the token of its server (empty: none), and whether it is pristine."""

    host: str
    port: int = 5000
    chromium_port: int = 9222
    vnc_port: int = 8006
    vlc_port: int = 8080
    token: str = ""
    used: bool = False


@dataclass(frozen=True)
class OSWorldSettings:
    """How `DesktopEnv` is made.

    Args:
        cache: OSWorld's folder of files.
        screen: (width, height) in pixels, as in OSWorld.
        tree: Whether observations have the accessibility tree.
        password: The password of the guest's user.
        provider: One of OSWorld's own providers, which starts, reverts and ends the machine; empty
            if the machine runs already.
        options: More arguments of `DesktopEnv`.
        folder: The working directory, where OSWorld's providers keep images and the list of their
            machines; `cache` by default.
    """

    cache: Path
    screen: tuple[int, int] = (1920, 1080)
    tree: bool = False
    password: str = "password"
    provider: str = ""
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    folder: Path | None = None


class Controller:
    """The part of OSWorld's `PythonController` that a `Desktop` needs."""

    def __init__(self, env: "OsworldEnv") -> None:
        self._env = env

    def get_screenshot(self) -> bytes | None:
        """Return the screen as PNG."""
        return self._env.call("controller", "get_screenshot", [])

    def get_accessibility_tree(self) -> str | None:
        """Return the accessibility tree in OSWorld's dialect."""
        return self._env.call("controller", "get_accessibility_tree", [])

    def get_file(self, file_path: str) -> bytes | None:
        """Return a file of the guest, or `None` if it cannot be read (after 15 s)."""
        return self._env.call("controller", "get_file", [file_path])

    def execute_python_command(self, command: str) -> dict[str, Any] | None:
        """Run Python in the guest, with pyautogui imported."""
        return self._env.call("controller", "execute_python_command", [command])


class OsworldEnv:
    """An environment with the interface of `DesktopEnv`.

    It has `reset`, `step`, `evaluate`, `close`, `controller` and `action_history`.

    Args:
        python: The interpreter of OSWorld's environment (`venv.find_python`).
        fresh: Returns the address of a pristine guest; called once now and once for every reset
            but the first (for the first, too, if the address says that the guest was used).
            `None` if a provider of OSWorld's makes the guest, or if there is none, to check tasks.
        settings: How the environment is made.
        log: The file for what OSWorld logs and prints.

    Raises:
        OsworldError: The process does not start.
    """

    def __init__(
        self,
        python: Path,
        fresh: Callable[[], Address] | None,
        settings: OSWorldSettings,
        log: Path,
    ) -> None:
        self._fresh = fresh
        self._owns_machine = bool(settings.provider)
        self.cache = settings.cache
        self._log = log
        self.warnings: list[str] = []
        self.action_history: list[Any] = []
        self.controller = Controller(self)
        self.instruction: str | None = None
        environment = dict(os.environ)
        for name in ("PYTHONPATH", "PYTHONHOME"):
            environment.pop(name, None)
        if PROXIES in environment:
            environment[PROXIES] = os.path.abspath(environment[PROXIES])
        folder = settings.folder or settings.cache
        for path in (settings.cache, folder):
            path.mkdir(parents=True, exist_ok=True)
        try:
            with log.open("ab") as errors:
                self._process: subprocess.Popen[bytes] = subprocess.Popen(
                    [str(python), "-I", "-c", _LOADER, str(BRIDGE)],
                    env=environment,
                    cwd=folder,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=errors,
                    start_new_session=True,
                )
        except OSError as error:
            raise OsworldError(
                f"OSWorld's Python {python} does not start ({error}); make it again with: hijack"
                " osworld setup"
            ) from None
        self._buffer = b""
        self._calls = 0
        try:
            start = {
                "address": None if fresh is None else asdict(fresh()),
                "provider": settings.provider,
                "options": dict(settings.options),
                "cache": str(settings.cache.resolve()),
                "screen": settings.screen,
                "tree": settings.tree,
                "password": settings.password,
            }
            self.about: dict[str, Any] = self.call("start", start)
        except BaseException:
            self.close()
            raise

    def check(self, task: Mapping[str, Any]) -> list[str]:
        """Return why a task cannot be evaluated here; nothing if it can. No desktop is touched."""
        return self.call("check", dict(task))

    def check_provider(self, name: str) -> str:
        """Return why one of OSWorld's own providers can't be used here; empty if it can."""
        return self.call("check_provider", name)

    def reset(
        self, task_config: Mapping[str, Any] | None = None, *, keep: bool = False, **_: Any
    ) -> dict[str, Any]:
        """Set up a task on a pristine desktop.

        Args:
            task_config: The task; `None` sets nothing up.
            keep: Do not replace the desktop: it is pristine but for what was done to it on purpose.

        Returns:
            OSWorld's observation; `screenshot` is PNG bytes.

        Raises:
            TaskRefusedError: The task could not be evaluated afterwards.
            EvaluatorError: OSWorld's setup raised.
        """
        config = None if task_config is None else dict(task_config)
        if config is not None:
            reasons = self.check(config)
            if reasons:
                raise TaskRefusedError(str(config.get("id")), reasons)
        self.action_history.clear()
        observation: dict[str, Any] = self.call("reset", config, keep)
        self.instruction = observation.get("instruction")
        return observation

    def step(
        self, action: Any, pause: float = 2.0
    ) -> tuple[dict[str, Any], float, bool, dict[str, Any]]:
        """Take one action of the agent, then sleep for `pause` seconds.

        Args:
            action: pyautogui code, `WAIT`, `DONE` or `FAIL`.
            pause: Seconds.

        Returns:
            Observation, reward, done and info, as OSWorld's.
        """
        self.action_history.append(action)
        observation, reward, done, info = self.call("step", action, pause)
        return observation, reward, done, info

    def evaluate(self) -> float:
        """Return OSWorld's score, 0 to 1.

        Raises:
            EvaluatorError: The evaluator raised; that is not a score of 0.
        """
        return self.call("evaluate")

    def close(self) -> None:
        """End the process; a machine that OSWorld's provider started is ended, others are not."""
        wait_s = 2.0
        if self._owns_machine:
            self._owns_machine = False
            wait_s = TIMEOUTS_S["release"]  # the process ends its machine when its input is closed
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        try:
            self._process.wait(wait_s)
        except subprocess.TimeoutExpired:
            if wait_s == TIMEOUTS_S["release"]:
                warnings.warn(
                    f"OSWorld's process did not end its machine within {wait_s:.0f} s and was"
                    " killed: look whether the machine still runs",
                    HijackWarning,
                    stacklevel=2,
                )
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def call(self, name: str, *arguments: Any) -> Any:
        """Call the worker; what OSWorld logged as a warning meanwhile is in `warnings`.

        Raises:
            EvaluatorError: OSWorld's code raised.
        """
        self._calls += 1
        number = self._calls
        self._send({"call": name, "number": number, "arguments": arguments})
        limit = TIMEOUTS_S[name]
        if name == "start" and self._owns_machine:
            limit = START_MACHINE_S
        deadline = time.monotonic() + limit
        while True:
            answer = self._receive(name, deadline, limit)
            if answer.get("ask") == "revert":
                self._send({"answer": self._pristine()})
                continue
            if answer["number"] != number:
                continue  # of a call that was interrupted (Ctrl-C) before its answer came
            self.warnings = list(answer.get("log", ()))
            if "error" in answer:
                problem = f"{answer['kind']}: {answer['error']} (at {answer['place']})"
                message = f"OSWorld's {name} raised {problem}"
                raise EvaluatorError(message, answer["kind"], self.warnings)
            return _bytes(answer.get("value"))

    def _pristine(self) -> dict[str, Any]:
        try:
            if self._fresh is None:
                raise OsworldError("OSWorld asked for another desktop, and there is none")
            return asdict(self._fresh())
        except BaseException:
            self.close()  # the process waits for an answer that will not come
            raise

    def _send(self, message: dict[str, Any]) -> None:
        try:
            stream = cast(Any, self._process.stdin)
            stream.write(json.dumps(message).encode() + b"\n")
            stream.flush()
        except (OSError, ValueError):
            raise self._ended() from None

    def _receive(self, name: str, deadline: float, limit: float) -> dict[str, Any]:
        stream = cast(Any, self._process.stdout)
        while b"\n" not in self._buffer:
            seconds_left = deadline - time.monotonic()
            if seconds_left <= 0 or not select.select([stream], [], [], seconds_left)[0]:
                self.close()
                raise DesktopTimeoutError(
                    f"OSWorld's {name} took over {limit:.0f} s; see {self._log}"
                )
            block = os.read(stream.fileno(), 1 << 20)
            if not block:
                raise self._ended()
            self._buffer += block
        line, _, self._buffer = self._buffer.partition(b"\n")
        return json.loads(line)

    def _ended(self) -> OsworldError:
        self.close()
        text = self._log.read_bytes()[-LOG_TAIL_BYTES:].decode("utf-8", "replace")
        tail = " | ".join(text.strip().splitlines()[-3:])
        code = self._process.returncode
        return OsworldError(f"OSWorld's process ended with exit code {code}; {self._log}: {tail}")


def _bytes(value: Any) -> Any:
    if isinstance(value, dict):
        items = cast("dict[str, Any]", value)
        if items.keys() == {"base64"}:
            return base64.b64decode(items["base64"])
        return {key: _bytes(item) for key, item in items.items()}
    if isinstance(value, list):
        return [_bytes(item) for item in cast("list[Any]", value)]
    return value
