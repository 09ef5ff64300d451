"""Routes that run commands and scripts, start applications and act on windows."""

import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

from anyio import sleep
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from hijack_data.surrogates import without_halves

from ...errors import DesktopError, DesktopTimeoutError, GuestError
from .commands import COMMAND_TIMEOUT_S, CommandResult, parse_command
from .machine import GuestMachine
from .request_checks import JsonAnswer
from .request_fields import flag, number, read_json_body, text
from .user_files import expand
from .windows import Window

CODE_TIMEOUT = 60.0
SCRIPT_TIMEOUT = 100.0
OPEN_TIMEOUT = 60.0
VERIFY_TIMEOUT = 5.0
POLL_S = 0.05
SPLASH_S = 3.0  # s that a new window stays before it counts


class RunRoutes:
    """Routes that run something."""

    def __init__(self, machine: GuestMachine) -> None:
        self._machine = machine

    def routes(self) -> list[Route]:
        """Return the routes."""
        table = {
            "/execute": self.execute,
            "/setup/execute": self.execute,
            "/execute_with_verification": self.execute_with_verification,
            "/setup/execute_with_verification": self.execute_with_verification,
            "/setup/launch": self.launch,
            "/setup/open_file": self.open_file,
            "/setup/activate_window": self.activate_window,
            "/setup/close_window": self.close_window,
            "/run_python": self.run_python,
            "/run_bash_script": self.run_bash_script,
            "/ah/tool": self.tool,
        }
        return [Route(path, endpoint, methods=["POST"]) for path, endpoint in table.items()]

    async def execute(self, request: Request) -> Response:
        """Run a command to its end."""
        body = await read_json_body(request)
        return JSONResponse(_success(await self._execute(body)))

    async def _execute(self, body: dict[str, Any]) -> CommandResult:
        argv = parse_command(body.get("command"), flag(body, "shell"))
        return await self._machine.runner.run(argv, number(body, "timeout", COMMAND_TIMEOUT_S))

    async def execute_with_verification(self, request: Request) -> Response:
        """Run a command, then wait until a window is there or another command succeeds.

        Raises:
            GuestError: What is to be verified is not an object.
        """
        body = await read_json_body(request)
        verification = body.get("verification") or {}
        if not isinstance(verification, dict):
            raise GuestError(f"verification must be an object, got {verification!r:.200}", 400)
        verification = cast("dict[str, Any]", verification)
        timeout = number(body, "max_wait_time", 10.0)
        pause = number(body, "check_interval", 1.0, 0.01)
        outcome = _success(await self._execute(body))
        if not verification:
            return JSONResponse(outcome)
        start = time.monotonic()
        verified = await self._verify(verification)
        while not verified and time.monotonic() - start < timeout:
            await sleep(pause)
            verified = await self._verify(verification)
        waited = {
            "verification": "passed" if verified else "failed",
            "wait_time": time.monotonic() - start,
        }
        if verified:
            return JSONResponse(outcome | waited)
        return JSONResponse(outcome | {"status": "verification_failed"} | waited, 500)

    async def _verify(self, verification: dict[str, Any]) -> bool:
        if "window_exists" in verification:
            window = await self._find(str(verification["window_exists"]), False, False)
            if window is None:
                return False
        if "command_success" not in verification:
            return True
        try:
            argv = parse_command(verification["command_success"], shell=True)
            outcome = await self._machine.runner.run(argv, VERIFY_TIMEOUT)
            return outcome.returncode == 0
        except DesktopError:
            return False

    async def tool(self, request: Request) -> Response:
        """Carry out one operation of effects in this process: `{"tool", "operation", "fields"}`.

        Raises:
            GuestError: The fields are not an object.
        """
        body = await read_json_body(request)
        fields = body.get("fields")
        if not isinstance(fields, dict):
            raise GuestError(f"fields must be an object, got {fields!r:.200}", 400)
        tool = text(body, "tool")
        operation = text(body, "operation")
        arguments = cast("dict[str, Any]", fields)
        result = await run_in_threadpool(self._machine.tools.run, tool, operation, arguments)
        return JSONResponse(result)

    async def launch(self, request: Request) -> Response:
        """Start a program and leave it running."""
        body = await read_json_body(request)
        shell = flag(body, "shell")
        argv = parse_command(body.get("command"), shell)
        await self._machine.runner.launch(argv)
        started = without_halves(" ".join(argv[2:] if shell else argv))
        return PlainTextResponse(f"{started} launched successfully")

    async def open_file(self, request: Request) -> Response:
        """Open a file with its application and wait for the window; a program's name starts it.

        Raises:
            GuestError: There is no such file or program, or no window appears.
        """
        body = await read_json_body(request)
        path = expand(body.get("path"))
        timeout = number(body, "timeout", OPEN_TIMEOUT)
        argv = [path]
        if Path(path).exists():
            argv = ["xdg-open", path]
        elif not shutil.which(path, path=self._machine.runner.environment["PATH"]):
            raise GuestError(f"Application/file not found: {path}", 404)
        windows = await run_in_threadpool(self._machine.windows.all)
        before = {window.id for window in windows}
        await self._machine.runner.launch(argv)
        window = await self._await_window(before, Path(path), timeout)
        if window is None:
            raise GuestError(
                f"Failed to find window for {Path(path).name} within {timeout:g} seconds.", 500
            )
        await run_in_threadpool(self._machine.windows.activate, window.id)
        return PlainTextResponse("File opened and window activated successfully")

    async def _await_window(self, before: set[int], path: Path, timeout: float) -> Window | None:
        """Return a window that names the file, or a new one that has stayed a while.

        An application may show another window first.
        """
        deadline = time.monotonic() + timeout
        fresh_since: float | None = None
        while time.monotonic() < deadline:
            windows = await run_in_threadpool(self._machine.windows.all)
            mapped = [window for window in windows if window.mapped and window.type != "desktop"]
            matches = [window for window in mapped if path.stem in window.title]
            if matches:
                return matches[-1]
            fresh = [window for window in mapped if _is_fresh(window, before)]
            if not fresh:
                fresh_since = None
            elif fresh_since is None:
                fresh_since = time.monotonic()
            elif time.monotonic() - fresh_since > SPLASH_S:
                return fresh[-1]
            await sleep(POLL_S)
        return None

    async def activate_window(self, request: Request) -> Response:
        """Bring a window to the front."""
        return await self._act(
            request, self._machine.windows.activate, "Window activated successfully"
        )

    async def close_window(self, request: Request) -> Response:
        """Ask a window to close."""
        return await self._act(request, self._machine.windows.close, "Window closed successfully.")

    async def _act(self, request: Request, act: Callable[[int], None], message: str) -> Response:
        body = await read_json_body(request)
        name, strict, by_class = (
            text(body, "window_name"),
            flag(body, "strict"),
            flag(body, "by_class"),
        )
        window = await self._find(name, strict, by_class)
        if window is None:
            # No error: OSWorld's server calls wmctrl and does not look at what it says, and tasks
            # rely on that.
            kind = "class" if by_class else "title"
            return PlainTextResponse(
                f"There is no window whose {kind} fits {name!r:.200}; nothing was done"
            )
        await run_in_threadpool(act, window.id)
        return PlainTextResponse(message)

    async def _find(self, name: str, strict: bool, by_class: bool) -> Window | None:
        return await run_in_threadpool(
            self._machine.windows.find, name, strict=strict, by_class=by_class
        )

    async def run_python(self, request: Request) -> Response:
        """Run Python code in the desktop's Python, with our pyautogui."""
        body = await read_json_body(request)
        code = text(body, "code")
        try:
            outcome = await self._script("python3", code, number(body, "timeout", CODE_TIMEOUT))
        except DesktopTimeoutError as error:
            answer = {"message": f"Execution timeout: {error}", "error": "TimeoutExpired"}
            return JSONResponse(
                {"status": "error", "need_more": False, "output": None} | answer, 500
            )
        failed = outcome.returncode != 0
        complaint = outcome.error or (
            f"Process exited with code {outcome.returncode}" if failed else ""
        )
        return JSONResponse(
            {
                "status": "error" if failed else "success",
                "need_more": False,
                "output": outcome.output,
                "message": "\n".join(part for part in (outcome.output, complaint) if part),
                "error": complaint,
                "return_code": outcome.returncode,
            }
        )

    async def run_bash_script(self, request: Request) -> Response:
        """Run a bash script; its errors are part of its output."""
        body = await read_json_body(request)
        script = text(body, "script")
        timeout = number(body, "timeout", SCRIPT_TIMEOUT)
        folder = expand(body["working_dir"]) if body.get("working_dir") else None
        if folder and not Path(folder).is_dir():
            return _script_error(f"Working directory does not exist: {folder}", 400)
        try:
            outcome = await self._script("bash", script, timeout, folder, merge=True)
        except DesktopTimeoutError:
            return _script_error(f"Script execution timed out after {timeout:g} seconds", 500)
        status = "error" if outcome.returncode else "success"
        return JSONResponse(
            {
                "status": status,
                "output": outcome.output,
                "error": "",
                "returncode": outcome.returncode,
            }
        )

    async def _script(
        self,
        program: str,
        content: str,
        timeout: float,
        folder: str | None = None,
        merge: bool = False,
    ) -> CommandResult:
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", errors="surrogateescape") as file:
            file.write(content)
            file.flush()
            return await self._machine.runner.run([program, file.name], timeout, folder, merge)


def _is_fresh(window: Window, before: set[int]) -> bool:
    return window.id not in before and window.type in ("normal", "dialog")


def _success(outcome: CommandResult) -> dict[str, Any]:
    return {
        "status": "success",
        "output": outcome.output,
        "error": outcome.error,
        "returncode": outcome.returncode,
    }


def _script_error(output: str, status: int) -> Response:
    return JsonAnswer({"status": "error", "output": output, "error": "", "returncode": -1}, status)
