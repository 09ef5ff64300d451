"""What may go wrong around the guest server, each on a session of its own."""

import os
import subprocess
import sys

import httpx
import pytest
from Xlib import display

from online_env.desktops.http import HttpDesktop
from online_env.embedded.guest.display import SharedDisplay
from online_env.embedded.guest.tools import Tools
from online_env.errors import DesktopTimeoutError, GuestError

from support import needs


def start(*arguments, **more):
    return subprocess.run(
        [sys.executable, "-m", "online_env.embedded.guest", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        **more,
    )


def test_never_as_root_and_never_without_a_token(tmp_path):
    if os.geteuid() == 0:
        refused = start("--port", "0", "--osworld")
        assert refused.returncode == 2
        assert "--user" in refused.stderr
    refused = start("--port", "0", "--user", "nobody")
    assert refused.returncode == 2
    assert "--token-file" in refused.stderr
    empty = tmp_path / "token"
    empty.touch()
    assert "is empty" in start("--user", "nobody", "--token-file", str(empty)).stderr
    assert "nowhere" in start("--user", "nobody", "--token-file", str(tmp_path / "nowhere")).stderr
    (tmp_path / "good").write_text("t")
    assert (
        start("--user", "no-such-account", "--token-file", str(tmp_path / "good")).returncode == 2
    )


def test_taken_port_is_said(guest_session, tmp_path):
    import socket

    (tmp_path / "good").write_text("t")
    with socket.socket() as busy_socket:
        busy_socket.bind(("127.0.0.1", 0))
        busy_socket.listen()
        port = busy_socket.getsockname()[1]
        refused = start(
            "--port", str(port), "--user", "nobody", "--token-file", str(tmp_path / "good")
        )
    assert refused.returncode == 2
    assert f"can't listen on 127.0.0.1 port {port}" in refused.stderr


def test_killed_display_is_told(guest_session, eventually):
    with guest_session() as session:
        session.execute(["kill", "-9", session.xvfb_pid()])
        health = eventually(
            "bad health",
            lambda: (h := session.client.get("/ah/health").json())["ready"] is False and h,
        )
        assert health["down"] == ["display", "window_manager"]
        for method, path in (
            ("GET", "/screenshot"),
            ("GET", "/ah/frame"),
            ("GET", "/ah/windows"),
            ("POST", "/screen_size"),
            ("GET", "/cursor_position"),
            ("GET", "/accessibility"),
        ):
            answer = session.client.request(method, path)
            assert answer.status_code == 500, path
            assert "X server" in answer.json()["message"], (path, answer.text)
        event = {"type": "move", "x": 1, "y": 1}
        assert (
            "X server"
            in session.client.post("/ah/input", json={"events": [event]}).json()["message"]
        )
        with (
            HttpDesktop(session.url, session.token) as desktop,
            pytest.raises(GuestError, match="X server"),
        ):
            desktop.screenshot()
        assert session.execute(["echo", "alive"])["output"] == "alive\n"


@pytest.fixture
def bare_display():
    """The name of a display without any program."""
    needs.apps("Xvfb")
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", "1", "-screen", "0", "640x480x24"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert server.stdout is not None
    yield f":{server.stdout.readline().strip()}"
    server.terminate()
    server.wait(10)
    server.stdout.close()


def test_an_operation_ends_while_a_program_holds_the_x_server(bare_display):
    shared = SharedDisplay(bare_display)
    tools = Tools(bare_display, shared, limit=0.5)
    assert tools.run("xtool", "state", {})["size"] == [640, 480]
    holder = display.Display(bare_display)
    holder.grab_server()
    holder.sync()
    with pytest.raises(
        DesktopTimeoutError, match=r"xtool state did not end within 0\.5 s"
    ) as failed:
        tools.run("xtool", "state", {})
    assert "open (ewmh.py:" in str(failed.value)
    with pytest.raises(DesktopTimeoutError, match=r"within 0\.7 s: .* may hold the X server"):
        tools.run("xtool", "minimise", {"timeout": 0.2})
    holder.ungrab_server()
    holder.sync()
    assert tools.run("xtool", "state", {})["size"] == [640, 480]
    holder.close()
    with shared.use() as connection:
        connection.close()


def test_killed_session_bus_is_told(guest_session, eventually):
    with guest_session() as session:
        assert session.client.get("/accessibility").status_code == 200
        session.execute("kill -9 $(pgrep -x dbus-daemon)")
        health = eventually(
            "bad health",
            lambda: (h := session.client.get("/ah/health").json())["ready"] is False and h,
        )
        assert "bus" in health["down"]
        answer = session.client.get("/accessibility")
        assert answer.status_code == 500
        assert "accessibility bus" in answer.json()["message"]
        shot = session.client.get("/screenshot")
        assert shot.status_code == 200, shot.text


def test_osworld_mode_needs_no_token_for_osworlds_routes_only(guest_session):
    with guest_session("--osworld") as session:
        assert httpx.get(f"{session.url}/platform").text == "Linux"
        assert (
            httpx.post(f"{session.url}/execute", json={"command": ["id", "-u"]})
            .json()["output"]
            .strip()
            != "0"
        )
        assert httpx.get(f"{session.url}/ah/frame").status_code == 401
        with HttpDesktop(session.url) as desktop:
            assert not desktop.is_ours
            assert desktop.screenshot().shape == (session.screen[1], session.screen[0], 3)
            assert desktop.accessibility().startswith("<desktop-frame")


def test_full_disk_is_told_and_leaves_no_part(guest_session):
    with guest_session() as session:
        subprocess.run(
            [
                "nsenter",
                "-t",
                str(_first_child(session.process.pid)),
                "-m",
                "mount",
                "-t",
                "tmpfs",
                "-o",
                "size=1m,mode=777",
                "tmpfs",
                str(session.home / "Documents"),
            ],
            check=True,
        )
        upload = {
            "data": {"file_path": "~/Documents/big"},
            "files": {"file_data": b"x" * 4 * 2**20},
        }
        answer = session.client.post("/setup/upload", **upload)
        assert answer.status_code == 507, answer.text
        assert "No space" in answer.json()["message"]
        assert session.execute("ls -A ~/Documents")["output"] == ""


def test_fork_bomb_within_its_time(guest_session):
    with guest_session() as session:
        bomb = "ulimit -u 400; b() { b | b & }; b; sleep 3000"
        answer = session.client.post(
            "/execute", json={"command": ["bash", "-c", bomb], "timeout": 2}
        )
        assert answer.status_code in (200, 504, 500)
        assert session.client.get("/ah/health").status_code == 200


def _first_child(pid):
    with open(f"/proc/{pid}/task/{pid}/children") as file:
        return int(file.read().split()[0])
