"""Any environment shaped like OSWorld's as a Desktop: here one whose guest is this machine's
Python."""

import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.picture_io import encode_png
from online_env.desktops.capability_survey import survey
from online_env.desktops.osworld import CAP_NOTE, CHUNK_BYTES, MAX_OUTPUT_BYTES, OsworldDesktop
from online_env.desktops.protocol import Desktop, RunResult
from online_env.errors import DesktopTimeoutError, GuestError, MissingCapabilityError


class Controller:
    """Runs code with this Python, as OSWorld's server runs it in the guest: by `python -c`, one
    argument."""

    options: tuple[str, ...] = ("-I",)
    home: Path | None = None

    def __init__(self, picture: Any) -> None:
        self.picture = picture

    def get_screenshot(self) -> Any:
        return self.picture

    def get_file(self, path: str) -> bytes | None:
        return Path(path).read_bytes()

    def execute_python_command(self, command: str) -> dict[str, Any]:
        code = f"import time; {command}"
        process = subprocess.run(
            [sys.executable, *self.options, "-c", code],
            capture_output=True,
            text=True,
            check=False,
            cwd=self.home,
        )
        status = "success" if process.returncode == 0 else "error"
        return {
            "status": status,
            "output": process.stdout,
            "error": process.stderr,
            "returncode": process.returncode,
        }


class Env:
    def __init__(self, picture: Any = b"") -> None:
        self.controller = Controller(picture)
        self.action_history: list[Any] = []
        self.tasks: list[Any] = []
        self.closed = 0

    def reset(self, task_config: Any = None) -> None:
        self.tasks.append(task_config)

    def step(self, action: Any, pause: float = 2) -> None:
        self.action_history.append(action)

    def evaluate(self) -> int:
        return 1

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def env(noise: np.ndarray) -> Env:
    return Env(encode_png(noise))


@pytest.fixture
def desktop(env: Env) -> OsworldDesktop:
    return OsworldDesktop(env)


def test_it_is_a_desktop(desktop: OsworldDesktop, env: Env, noise: np.ndarray) -> None:
    assert isinstance(desktop, Desktop)
    assert desktop.size == (216, 384)
    np.testing.assert_array_equal(desktop.screenshot(), noise)
    desktop.reset({"id": "t"})
    desktop.reset()
    assert env.tasks == [{"id": "t"}, None]
    assert desktop.evaluate() == 1.0
    desktop.close()
    desktop.close()
    assert env.closed == 2


def test_what_it_does_is_no_action_of_the_agent(
    desktop: OsworldDesktop, env: Env, tmp_path: Path
) -> None:
    assert desktop.run("print(6 * 7)").output == "42\n"
    desktop.execute("true")
    desktop.write_file(str(tmp_path / "f"), b"x")
    assert desktop.action_history == env.action_history == []
    env.step("FAIL")
    assert desktop.action_history == ["FAIL"]


def test_commands(desktop: OsworldDesktop) -> None:
    odd = """a "b" 'c' {d} \\n $HOME é"""
    assert desktop.execute(["printf", "%s", odd]).output == odd
    shell = desktop.execute("echo out; echo err >&2; exit 3")
    assert (shell.output, shell.error, shell.returncode, shell.ok) == ("out\n", "err\n", 3, False)
    absent = desktop.execute(["no-such-program"])
    assert (absent.status, absent.returncode) == ("error", None)
    late = desktop.execute(["sleep", "5"], timeout=0.2)
    assert (late.status, late.returncode, late.error) == (
        "error",
        None,
        "Command timed out after 0.2 seconds",
    )
    long = desktop.execute(["head", "-c", str(MAX_OUTPUT_BYTES + 1), "/dev/zero"]).output
    assert (len(long), long.endswith(CAP_NOTE)) == (MAX_OUTPUT_BYTES + len(CAP_NOTE), True)


def test_files_in_the_guests_home_do_not_break_commands(
    desktop: OsworldDesktop, env: Env, tmp_path: Path
) -> None:
    for name in ("json", "signal", "subprocess", "tempfile", "random"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(3)")
    env.controller.home, env.controller.options = tmp_path, ()  # as OSWorld's server runs code
    assert not desktop.run("import json; print(json)").ok, (
        "the agent's own code has what the agent left"
    )
    assert desktop.execute(["pwd"]).output.strip() == str(tmp_path)
    desktop.write_file(str(tmp_path / "made"), b"x")
    assert desktop.read_file(str(tmp_path / "made")) == b"x"


@settings(max_examples=8, deadline=None)
@given(data=st.binary(max_size=300))
def test_files_go_there_and_back(data: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    desktop = OsworldDesktop(Env())
    path = str(tmp_path_factory.mktemp("files") / 'it\'s "one" {file}')
    desktop.write_file(path, b"what was there before, and longer than anything" * 10)
    desktop.write_file(path, data)
    assert desktop.read_file(path) == data


def test_a_large_file_goes_in_pieces(desktop: OsworldDesktop, tmp_path: Path) -> None:
    data = np.random.default_rng(0).bytes(2 * CHUNK_BYTES + 1)
    desktop.write_file(str(tmp_path / "f"), data)
    assert desktop.read_file(str(tmp_path / "f")) == data


def test_a_piece_that_is_sent_again_is_written_once(
    desktop: OsworldDesktop, env: Env, tmp_path: Path
) -> None:
    """OSWorld's client repeats a command whose answer was lost."""
    once = env.controller.execute_python_command

    def twice(command: str) -> dict[str, Any]:
        once(command)
        return once(command)

    env.controller.execute_python_command = twice  # type: ignore[method-assign]
    data = np.random.default_rng(0).bytes(2 * CHUNK_BYTES + 1)
    desktop.write_file(str(tmp_path / "f"), data)
    assert (tmp_path / "f").read_bytes() == data


def test_files_that_cant_be_had_are_errors(desktop: OsworldDesktop, tmp_path: Path) -> None:
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(GuestError, match="no file that") as caught:
            desktop.read_file(str(path))
        assert caught.value.status == 404
    with pytest.raises(GuestError, match="can't be written"):
        desktop.write_file(str(tmp_path / "no" / "f"), b"x")


@pytest.mark.parametrize("picture", [None, b"", b"no picture", b"\x89PNG\r\n\x1a\n" + b"\0" * 50])
def test_no_screenshot_is_an_error(picture: Any) -> None:
    with pytest.raises(GuestError, match="screenshot"):
        OsworldDesktop(Env(picture)).screenshot()


def test_a_guest_that_does_not_answer_is_an_error(env: Env) -> None:
    env.controller.execute_python_command = lambda command: None  # type: ignore[method-assign, assignment, return-value]
    with pytest.raises(GuestError, match="no answer"):
        OsworldDesktop(env).run("1")


def test_capabilities_come_from_what_is_there(env: Env, monkeypatch: pytest.MonkeyPatch) -> None:
    requests: list[Any] = []

    def execute(self: OsworldDesktop, argv: list[str], timeout: float) -> RunResult:
        requests.append(argv)
        return RunResult("success", "lock\nnonsense\nfirewall\n", "", 0)

    monkeypatch.setattr(OsworldDesktop, "execute", execute)
    desktop = OsworldDesktop(env, password="it's a secret")
    assert desktop.capabilities == desktop.capabilities == {"apps", "files", "lock", "firewall"}
    assert [argv[-1] for argv in requests] == ["it's a secret"], "the guest is asked once"
    with pytest.raises(MissingCapabilityError, match="get_accessibility_tree"):
        desktop.accessibility()
    env.controller.get_accessibility_tree = lambda: "<desktop-frame/>"  # type: ignore[attr-defined]
    full = OsworldDesktop(env, capabilities=("windows",))
    assert full.capabilities == {"apps", "files", "accessibility", "firewall", "lock", "windows"}
    assert full.accessibility() == "<desktop-frame/>"
    env.controller.get_accessibility_tree = lambda: None  # type: ignore[attr-defined]
    with pytest.raises(GuestError, match="NoneType"):
        full.accessibility()


SUDO = """#!/bin/sh
case "$1" in
  -n) exit 1;;
  -S) read -r given; [ "$given" = "pa'ss \\$word" ] || exit 1;;
esac
echo as root: "$@" >> "$0.log"
"""


@pytest.mark.parametrize(
    ("password", "allowed"), [("pa'ss $word", True), ("wrong", False), (None, False)]
)
def test_the_firewall_is_ours_only_with_the_password(
    tmp_path: Path, password: str | None, allowed: bool
) -> None:
    """A guest whose user is nobody in particular and whose sudo asks."""
    for name, text in (("sudo", SUDO), ("id", "#!/bin/sh\necho 1000\n")):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)

    def execute(argv: Any, timeout: float) -> RunResult:
        environment = {"PATH": f"{tmp_path}:/usr/bin:/bin"}
        process = subprocess.run(argv, capture_output=True, text=True, check=False, env=environment)
        return RunResult("success", process.stdout, process.stderr, process.returncode)

    assert ("firewall" in survey(execute, password)) is allowed


def test_a_guest_that_is_too_busy_to_tell_what_it_has_is_asked_again(
    env: Env, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("online_env.desktops.capability_survey.TIMEOUT", 0.1)
    answers = [RunResult("error", "", "Command timed out"), RunResult("success", "lock", "", 0)]

    def execute(self: OsworldDesktop, argv: list[str], timeout: float) -> RunResult:
        answer = answers.pop(0)
        time.sleep(0.0 if answer.ok else timeout)
        return answer

    monkeypatch.setattr(OsworldDesktop, "execute", execute)
    desktop = OsworldDesktop(env)
    with pytest.raises(DesktopTimeoutError, match="did not tell within"):
        _ = desktop.capabilities
    assert "lock" in desktop.capabilities


def test_a_locker_that_hangs_costs_one_wait(tmp_path: Path) -> None:
    hangs = tmp_path / "mate-screensaver-command"
    hangs.write_text(f"#!/bin/sh\necho asked >> {tmp_path}/log\nexec sleep 60\n")
    hangs.chmod(0o755)

    def execute(argv: Any, timeout: float) -> RunResult:
        environment = {"PATH": f"{tmp_path}:/usr/bin:/bin"}
        process = subprocess.run(argv, capture_output=True, text=True, check=False, env=environment)
        return RunResult("success", process.stdout, process.stderr, process.returncode)

    assert "lock" not in survey(execute, None)
    assert (tmp_path / "log").read_text() == "asked\n"


def test_what_is_not_shaped_like_osworld_is_refused() -> None:
    with pytest.raises(MissingCapabilityError, match="no reset, step, evaluate, get_screenshot"):
        OsworldDesktop(SimpleNamespace(action_history=[]))  # type: ignore[arg-type]
