"""`hijack desktop` without a desktop: exit codes, installing through sudo, and pages that are
closed."""

import os
import shlex
import socket
import struct
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from support import needs

pytest.importorskip("httpx", reason=needs.ONLINE)

from online_env import desktop_commands, privilege
from online_env.desktops.protocol import RunResult
from online_env.embedded import home, packages, running
from online_env.embedded.runtime import registry
from online_env.embedded.view import Viewer
from online_env.errors import DesktopError, RootRequiredError, UnknownDesktopError


class Answers:
    """A desktop that gives one answer."""

    def __init__(self, answer):
        self.answer = answer

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def execute(self, code):
        return self.answer

    run = execute


@pytest.mark.parametrize(
    ("returncode", "status", "shell", "code"),
    [
        (0, "success", True, 0),
        (3, "success", True, 3),
        (-9, "success", True, 137),
        (None, "error", True, 1),
        (3, "success", False, 1),
        (0, "success", False, 0),
    ],
)
def test_the_exit_code_of_a_command_is_passed_on(returncode, status, shell, code, monkeypatch):
    answer = RunResult(status, "out\n", "", returncode)
    monkeypatch.setattr(running, "attach", lambda name: Answers(answer))
    result = CliRunner().invoke(
        desktop_commands.desktop, ["run", "x", *(["--shell"] if shell else [])]
    )
    assert (result.exit_code, result.output) == (code, "out\n")


def test_which_desktop_is_asked_in_words_of_a_shell(monkeypatch):
    states = {"a": "ready", "b": "ready", "left": "orphan"}
    monkeypatch.setattr(registry, "state", lambda record: states[record["id"]])
    monkeypatch.setattr(registry, "records", lambda: [{"id": "left"}])
    assert not registry.running()
    assert running.choose("left")["id"] == "left"
    none = r"^say which desktop; there are: none \(hijack desktop up starts one\)"
    with pytest.raises(UnknownDesktopError, match=none):
        running.choose(None)
    monkeypatch.setattr(registry, "records", lambda: [{"id": "left"}, {"id": "a"}])
    assert running.choose(None)["id"] == "a"
    monkeypatch.setattr(registry, "records", lambda: [{"id": "a"}, {"id": "b"}])
    with pytest.raises(UnknownDesktopError, match=r"^say which desktop; there are: a, b"):
        running.choose(None)
    with pytest.raises(UnknownDesktopError, match="'c' is not one of them; there are: a, b"):
        running.choose("c")
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(UnknownDesktopError, match=r"; those of root: sudo /.* desktop list$"):
        running.choose(None)


def test_the_command_for_root_names_the_program_by_its_path(monkeypatch, tmp_path):
    """Sudo does not look into a virtual environment."""
    (tmp_path / "with space").mkdir()
    python = tmp_path / "with space" / "python"
    monkeypatch.setattr(sys, "executable", str(python))
    words = shlex.split(privilege.as_root("desktop", "up"))
    assert words == ["sudo", str(python), "-m", "hijack_data", "desktop", "up"]
    python.with_name("hijack").touch()
    words = shlex.split(privilege.as_root("desktop", "up"))
    assert words == ["sudo", str(python.with_name("hijack")), "desktop", "up"]


@pytest.fixture
def installing(monkeypatch, tmp_path):
    """Notes the commands that would be run, as a user with one package missing; the exit code can
    be set."""
    ran = SimpleNamespace(commands=[], code=0)

    def run(command, check):
        ran.commands.append(command)
        return SimpleNamespace(returncode=ran.code)

    monkeypatch.setattr(packages.subprocess, "run", run)
    monkeypatch.setattr(packages, "missing", lambda names: ["xvfb"])
    monkeypatch.setattr(home, "ensure_layer", lambda: None)
    monkeypatch.setattr(home, "remove_old_layers", lambda: None)
    monkeypatch.setattr(privilege.shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setenv("AGENTHIJACK_IMAGES", str(tmp_path / "images"))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    return ran


def test_installing_asks_sudo_for_what_needs_root_and_for_nothing_else(installing, monkeypatch):
    result = CliRunner().invoke(
        desktop_commands.desktop, ["install", "--host"], catch_exceptions=False
    )
    assert result.exit_code == 0
    assert "installing 1 packages with apt-get through sudo: xvfb" in result.output
    assert [command[:4] for command in installing.commands] == [
        ["/usr/bin/sudo", "env", "DEBIAN_FRONTEND=noninteractive", "apt-get"]
    ] * 2
    assert installing.commands[1][-1] == "xvfb"
    installing.commands.clear()
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    CliRunner().invoke(desktop_commands.desktop, ["install"], catch_exceptions=False)
    assert installing.commands[0] == ["env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "update"]


def test_installing_says_the_command_where_sudo_cannot(installing, monkeypatch):
    line = "apt-get update && apt-get install -y --no-install-recommends xvfb"
    installing.code = 1
    with pytest.raises(
        DesktopError, match=f"`apt-get update` failed with exit code 1.* As root: {line}"
    ):
        packages.install(["xvfb"])
    monkeypatch.setattr(privilege.shutil, "which", lambda name: None)
    with pytest.raises(RootRequiredError, match=f"no sudo here; run as root: sh -c '{line}'"):
        packages.install(["xvfb"])
    assert len(installing.commands) == 1
    packages.install([])
    assert len(installing.commands) == 1


@pytest.fixture
def page(tmp_path):
    """The page of a desktop that is none, served."""
    (tmp_path / "token").write_text("secret")
    record = {"id": "d1", "screen": [80, 60], "guest": "http://127.0.0.1:9", "door": "/nowhere"}
    with Viewer({**record, "token_file": str(tmp_path / "token")}) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def ask(page):
    """Ask for a frame; returns the connection."""
    link = socket.create_connection(page.server_address, timeout=60)
    head = f"GET /frame HTTP/1.1\r\nHost: 127.0.0.1:1\r\nX-Token: {page.token}\r\n\r\n"
    link.sendall(head.encode())
    return link


@pytest.mark.parametrize(
    ("error", "told"),
    [(None, False), (ConnectionResetError("gone"), False), (ZeroDivisionError("a bug"), True)],
)
def test_a_page_that_is_closed_is_not_told_of(page, monkeypatch, capfd, error, told):
    """Whoever closes the tab hangs up in the middle of a picture; a mistake of ours is told all the
    same."""
    stream_closed, answered = threading.Event(), threading.Event()

    def frame(seen):
        assert stream_closed.wait(60)
        if error is not None:
            raise error
        return "1", bytes(64 << 20)

    shutdown = page.shutdown_request

    def done(request):
        shutdown(request)
        answered.set()

    monkeypatch.setattr(page, "frame", frame)
    monkeypatch.setattr(page, "shutdown_request", done)
    link = ask(page)
    # hangs up at once
    link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    link.close()
    stream_closed.set()
    assert answered.wait(60)
    assert ("Traceback" in capfd.readouterr().err) is told
    assert Path(page.record["token_file"]).exists()
