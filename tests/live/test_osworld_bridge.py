"""OSWorld's own DesktopEnv, in its own Python, against a guest of a few lines on loopback."""

import contextlib
import email.parser
import email.policy
import json
import signal
import subprocess
import sys
import threading
import urllib.parse
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from hijack_data.picture_io import encode_png
from online_env.errors import DesktopTimeoutError
from online_env.osworld import env as env_module
from online_env.osworld import venv
from online_env.osworld.env import Address, OsworldEnv, OSWorldSettings
from online_env.osworld.errors import EvaluatorError, OsworldError, TaskRefusedError

from support import needs


class Guest(ThreadingHTTPServer):
    """Files live in a folder; commands are answered from a table; every request is noted."""

    daemon_threads = True

    def __init__(self, folder: Path, picture: bytes) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.folder, self.picture = folder, picture
        self.seen: list[tuple[str, str]] = []
        self.commands: list[Any] = []
        self.answers: dict[str, str] = {}
        self.status = 200
        threading.Thread(target=self.serve_forever, args=(0.01,), daemon=True).start()

    def address(self, **more: Any) -> Address:
        return Address("127.0.0.1", self.server_address[1], **more)


class Handler(BaseHTTPRequestHandler):
    server: Guest

    def do_GET(self) -> None:
        self.note()
        if self.path == "/screenshot":
            self.reply(self.server.picture, "image/png")
        elif self.path == "/accessibility":
            self.reply_json({"AT": "<desktop-frame/>"})
        else:
            self.reply_json({"output": "43 132", "status": "success"})

    def do_POST(self) -> None:
        self.note()
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        if self.path == "/file":
            name = urllib.parse.parse_qs(body.decode())["file_path"][0]
            self.send_file(self.server.folder / Path(name).name)
        elif self.path == "/setup/upload":
            head = f"Content-Type: {self.headers['Content-Type']}\r\n\r\n".encode()
            form = email.parser.BytesParser(policy=email.policy.default).parsebytes(head + body)
            parts = {
                part.get_param("name", header="content-disposition"): part
                for part in form.iter_parts()
            }
            target = self.server.folder / Path(parts["file_path"].get_content().strip()).name
            target.write_bytes(parts["file_data"].get_payload(decode=True))
            self.reply_json("ok")
        else:
            command = json.loads(body or b"{}").get("command")
            self.server.commands.append(command)
            text = command if isinstance(command, str) else " ".join(command or [])
            answers = [answer for key, answer in self.server.answers.items() if key in text]
            output = answers[0] if answers else ""
            self.reply_json({"status": "success", "output": output, "error": "", "returncode": 0})

    def note(self) -> None:
        self.server.seen.append((self.path, self.headers.get("Authorization", "")))

    def send_file(self, path: Path) -> None:
        (
            self.reply(path.read_bytes(), "application/octet-stream")
            if path.is_file()
            else self.send_error(404)
        )

    def reply_json(self, value: Any) -> None:
        self.reply(json.dumps(value).encode(), "application/json")

    def reply(self, data: bytes, kind: str) -> None:
        self.send_response(self.server.status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture(scope="module")
def python() -> Path:
    return venv.find_python(needs.osworld())


@pytest.fixture
def guest(tmp_path: Path, noise: Any) -> Iterator[Guest]:
    folder = tmp_path / "guest"
    folder.mkdir()
    server = Guest(folder, encode_png(noise))
    server.answers = {"platform": "Linux\n", "vlcrc": "/home/user/.config/vlc/vlcrc\n"}
    yield server
    server.shutdown()
    server.server_close()


@pytest.fixture
def env(python: Path, guest: Guest, tmp_path: Path) -> Iterator[OsworldEnv]:
    osworld_env = OsworldEnv(
        python, guest.address, OSWorldSettings(tmp_path / "cache", tree=True), tmp_path / "log"
    )
    yield osworld_env
    osworld_env.close()


def task(
    func: Any, result: Any = None, expected: Any = None, config: Any = (), **more: Any
) -> dict[str, Any]:
    evaluator: dict[str, Any] = {"func": func, **more}
    evaluator |= {"result": result} if result else {}
    evaluator |= {"expected": {"type": "rule", "rules": expected}} if expected else {}
    return {"id": "t-1", "instruction": "do it", "config": list(config), "evaluator": evaluator}


EXISTS = task(
    "exact_match",
    {"type": "vm_command_line", "command": "ls x", "shell": True},
    {"expected": "yes\n"},
)
VLC = task("check_qt_bgcone", {"type": "vlc_config", "dest": "vlcrc"}, {"expected_qt_bgcone": 0})


def test_reset_step_and_evaluate(env: OsworldEnv, guest: Guest) -> None:
    observation = env.reset(EXISTS)
    assert observation["screenshot"] == guest.picture
    assert (observation["accessibility_tree"], observation["instruction"]) == (
        "<desktop-frame/>",
        "do it",
    )
    assert env.evaluate() == 0
    _, reward, value, info = env.step("pyautogui.press('a')", pause=0)
    assert (reward, value, info) == (0, False, {})
    assert guest.commands[-1][2].endswith("pyautogui.press('a')")
    guest.answers["ls x"] = "yes\n"
    assert env.evaluate() == 1
    assert env.action_history == ["pyautogui.press('a')"]


def test_infeasible_wants_fail_as_the_last_action(env: OsworldEnv) -> None:
    env.reset(task("infeasible"))
    assert env.evaluate() == 0
    assert env.step("FAIL", pause=0)[2] is True
    assert env.evaluate() == 1
    env.step("DONE", pause=0)
    assert env.evaluate() == 0


def test_an_evaluator_that_raises_is_no_zero(
    env: OsworldEnv, guest: Guest, monkeypatch: pytest.MonkeyPatch
) -> None:
    guest.answers["platform"] = "Plan 9\n"
    env.reset(VLC)
    with pytest.raises(EvaluatorError, match="Unsupported operating system") as caught:
        env.evaluate()
    assert caught.value.kind == "Exception"
    guest.answers["platform"] = "Linux\n"
    (guest.folder / "vlcrc").write_text("qt-bgcone=0\n")
    assert env.evaluate() == 1  # the process lives on


def test_missing_packages_are_refused_before_the_reset(env: OsworldEnv, guest: Guest) -> None:
    if "pandas" not in env.about["absent"]:
        needs.skip(
            "OSWorld's environment lacks no package", f"{needs.HIJACK} osworld setup --tier tiny"
        )
    before = len(guest.seen)
    wants = task(
        "compare_table", {"type": "vm_file", "path": "/a.xlsx", "dest": "a.xlsx"}, {"x": 1}
    )
    with pytest.raises(TaskRefusedError, match="openpyxl"):
        env.reset(wants)
    opens = [{"type": "chrome_open_tabs", "parameters": {"urls_to_open": []}}]
    with pytest.raises(
        TaskRefusedError, match="setup chrome_open_tabs needs the package 'playwright'"
    ):
        env.reset(task("exact_match", EXISTS["evaluator"]["result"], {"expected": ""}, opens))
    with pytest.raises(TaskRefusedError, match="no metric no_such_metric"):
        env.reset(task("no_such_metric", {"type": "no_such"}, {"x": 1}))
    assert len(guest.seen) == before


def test_functions_that_the_wheel_lacks_are_there(env: OsworldEnv, guest: Guest) -> None:
    added = {
        "check_play_and_exit",
        "check_structure_sim_with_threshold",
        "get_chrome_appearance_mode_ui",
    }
    assert set(env.about["added"]) == added
    (guest.folder / "vlcrc").write_text("#play-and-exit=0\nplay-and-exit=1\n")
    env.reset(
        task(
            "check_play_and_exit",
            {"type": "vlc_config", "dest": "vlcrc"},
            {"expected_play_and_exit": 0},
        )
    )
    assert env.evaluate() == 0
    (guest.folder / "vlcrc").write_text("# play-and-exit=1\nplay-and-exit=0\n")
    assert env.evaluate() == 1
    (guest.folder / "Preferences").write_text('{"browser": {"theme": {"color_scheme2": 1}}}')
    env.reset(task("exact_match", {"type": "chrome_appearance_mode_ui"}, {"expected": "light"}))
    assert env.evaluate() == 1


def test_every_reset_but_the_first_asks_for_a_fresh_guest(
    python: Path, tmp_path: Path, guest: Guest, noise: Any
) -> None:
    second = Guest(guest.folder, encode_png(noise[:100]))
    turn = iter([guest, second, guest])
    env = OsworldEnv(
        python, lambda: next(turn).address(), OSWorldSettings(tmp_path / "cache"), tmp_path / "log"
    )
    try:
        assert guest.seen == []
        env.reset(EXISTS)  # neither step nor config: OSWorld itself would not revert after it
        assert guest.seen
        assert second.seen == []
        assert env.reset(EXISTS)["screenshot"] == second.picture
        assert env.reset(EXISTS)["screenshot"] == guest.picture
        with pytest.raises(StopIteration):
            env.reset(EXISTS)
        with pytest.raises(OsworldError, match="ended"):
            env.evaluate()
    finally:
        env.close()
        second.shutdown()
        second.server_close()


def test_the_token_goes_to_the_guest_only(
    python: Path, tmp_path: Path, guest: Guest, noise: Any
) -> None:
    second = Guest(guest.folder, b"")
    url = f"http://127.0.0.1:{second.server_address[1]}/hello.txt"
    download = [
        {
            "type": "download",
            "parameters": {"files": [{"url": url, "path": "/home/user/hello.txt"}]},
        }
    ]
    env = OsworldEnv(
        python,
        lambda: guest.address(token="s3"),
        OSWorldSettings(tmp_path / "cache"),
        tmp_path / "log",
    )
    try:
        env.reset({**EXISTS, "config": download})
        assert {token for _, token in guest.seen} == {"Bearer s3"}
        assert second.seen == [("/hello.txt", "")]
        assert (guest.folder / "hello.txt").is_file()
        assert "s3" not in Path(f"/proc/{env._process.pid}/cmdline").read_text()
    finally:
        env.close()
        second.shutdown()
        second.server_close()


def test_a_call_that_takes_too_long_ends_the_process(
    env: OsworldEnv, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(env_module.TIMEOUTS_S, "reset", 0.5)
    with pytest.raises(DesktopTimeoutError, match="reset took over"):
        env.reset({**EXISTS, "config": [{"type": "sleep", "parameters": {"seconds": 60}}]})
    assert env._process.poll() is not None
    env.close()


def test_a_killed_process_is_named_and_leaves_no_child(env: OsworldEnv) -> None:
    env._process.kill()
    env._process.wait()
    with pytest.raises(OsworldError, match="exit code -9"):
        env.check(EXISTS)


def test_a_broken_interpreter_says_so(tmp_path: Path) -> None:
    with pytest.raises(OsworldError, match="exit code 1"):
        OsworldEnv(
            Path("/usr/bin/false"),
            lambda: Address("127.0.0.1"),
            OSWorldSettings(tmp_path / "c"),
            tmp_path / "log",
        )


# In the place of OSWorld's own package.
PACKAGE = """
import time
class metrics: pass
class getters: pass
class SetupController: pass
class Controller:
    http_server = "http://127.0.0.1:5000"
    def get_screenshot(self): return b"screen"
class DesktopEnv:
    def __init__(self, **_): self.controller = Controller()
    def evaluate(self):
        time.sleep(0.6)
        return 0.25
"""
# An interpreter that finds it: it is called as `python -I -c CODE FOLDER`.
INTERPRETER = """#!{python}
import sys
sys.path.insert(0, {place!r})
code, sys.argv = sys.argv[3], ["-c", sys.argv[4]]
exec(code)
"""


class Stopped(Exception):
    """What a limit of somebody else's raises in the middle of a call."""


def test_the_answer_of_a_call_that_was_interrupted_is_not_taken_for_the_next_ones(
    tmp_path: Path,
) -> None:
    pytest.importorskip("requests", reason=needs.HF)
    (tmp_path / "desktop_env").mkdir()
    (tmp_path / "desktop_env/desktop_env.py").write_text(PACKAGE)
    python = tmp_path / "python"
    python.write_text(INTERPRETER.format(python=sys.executable, place=str(tmp_path)))
    python.chmod(0o755)

    def stop(*_: object) -> None:
        raise Stopped

    settings = OSWorldSettings(tmp_path / "cache")
    with contextlib.closing(
        OsworldEnv(python, lambda: Address("127.0.0.1"), settings, tmp_path / "log")
    ) as env:
        before = signal.signal(signal.SIGALRM, stop)
        try:
            signal.setitimer(signal.ITIMER_REAL, 0.2)
            with pytest.raises(Stopped):
                env.evaluate()
        finally:
            signal.signal(signal.SIGALRM, before)
        assert env.controller.get_screenshot() == b"screen"
        assert env.evaluate() == 0.25


def test_an_interpreter_that_is_gone_says_how_to_make_it_again(tmp_path: Path) -> None:
    with pytest.raises(OsworldError, match=r"no/python does not start .*hijack osworld setup"):
        OsworldEnv(
            tmp_path / "no/python",
            lambda: Address("127.0.0.1"),
            OSWorldSettings(tmp_path / "c"),
            tmp_path / "log",
        )


def test_stubs_are_gone_after_the_import(python: Path) -> None:
    code = f"""
import sys
sys.path.insert(0, {str(env_module.BRIDGE.parent)!r})
from bridge import stubs
with stubs.standing_in(("no_such_package_a", "json")) as missing:
    from no_such_package_a.deep import Thing
    import no_such_package_a
assert missing == {{"no_such_package_a"}}, missing
for use in (lambda: Thing(), lambda: no_such_package_a.load(), lambda: Thing.make()):
    try:
        try:
            use()
        except Exception:
            raise SystemExit("a metric would have made this a 0")
    except stubs.MissingDependency as error:
        assert "no_such_package_a" in str(error)
try:
    import no_such_package_a
except ImportError:
    print("gone")
"""
    process = subprocess.run([python, "-c", code], capture_output=True, text=True, check=False)
    assert (process.stdout, process.stderr) == ("gone\n", "")
