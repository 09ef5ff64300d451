"""The guest server's door: token, sizes, errors; then commands, files and the rest of OSWorld's
routes."""

import concurrent.futures
import contextlib
import io
import json
import socket
import threading

import httpx
import numpy as np
import pytest
from PIL import Image

from support import needs

OSWORLD_GET = ("/screenshot", "/accessibility", "/terminal", "/platform", "/cursor_position")


def test_health(session):
    health = session.client.get("/ah/health").json()
    assert health["ready"] is True
    assert health["down"] == []
    assert health["uid"] == session.account.pw_uid


@pytest.mark.parametrize("path", [*OSWORLD_GET, "/ah/health", "/ah/frame", "/nothing"])
@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"X-Token": "wrong"},
        {"Authorization": "Bearer x"},
        {"Authorization": "Bearer wröng".encode("latin-1")},
    ],
)
def test_no_request_without_the_token(session, path, headers):
    answer = httpx.get(session.url + path, headers=headers)
    assert answer.status_code == 401
    assert "token" in answer.json()["message"]


def test_token_in_either_header(session):
    assert httpx.get(f"{session.url}/platform", headers={"X-Token": session.token}).text == "Linux"
    assert (
        httpx.get(
            f"{session.url}/platform", headers={"Authorization": f"bearer {session.token}"}
        ).text
        == "Linux"
    )


@pytest.mark.parametrize(
    ("method", "path", "status"), [("GET", "/nothing", 404), ("GET", "/execute", 405)]
)
def test_unknown_routes_answer_in_json(session, method, path, status):
    answer = session.client.request(method, path)
    assert answer.status_code == status
    assert answer.json()["status"] == "error"


@pytest.mark.parametrize(
    "body",
    [
        b"{",
        b"[1]",
        b"\xff\xfe",
        b"[" * 100_000,
        b'{"command": 3}',
        b'{"command": []}',
        b'{"command": ["a\\u0000b"]}',
        b'{"command": "ls", "shell": "yes"}',
        b'{"command": "ls", "shell": "false"}',
        b'{"command": ["ls"], "timeout": -1}',
        b'{"command": "\\"", "shell": false}',
        b'{"command": ["ls"], "timeout": ' + b"9" * 5000 + b"}",
    ],
)
def test_bad_bodies_are_refused(session, body):
    headers = {"Content-Type": "application/json"}
    answer = session.client.post("/execute", content=body, headers=headers)
    assert answer.status_code == 400, answer.text
    assert answer.json()["message"]


def test_oversized_body_is_refused_announced_or_not(session):
    def endless():
        for _ in range(80):
            yield b"x" * 2**20

    with socket.create_connection(("127.0.0.1", session.port), timeout=10) as announced:
        announced.sendall(
            b"POST /execute HTTP/1.1\r\nHost: x\r\nX-Token: %s\r\nContent-Length: %d\r\n\r\n{"
            % (session.token.encode(), 80 * 2**20)
        )
        assert announced.recv(4096).startswith(b"HTTP/1.1 413")
    with contextlib.suppress(httpx.TransportError):  # the server may close while we still send
        assert session.client.post("/execute", content=endless()).status_code == 413
    assert session.client.get("/ah/health").json()["ready"] is True


def test_execute_answers_as_osworld_does(session):
    assert session.execute(["sh", "-c", "echo out; echo err >&2; exit 3"]) == {
        "status": "success",
        "output": "out\n",
        "error": "err\n",
        "returncode": 3,
    }
    assert session.execute("cd ~ && pwd")["output"].strip() == str(session.home)
    split = session.client.post(
        "/setup/execute", json={"command": "echo 'a b'", "shell": False}
    ).json()
    assert split["output"] == "a b\n"
    texts = {"command": "echo $((1 + 1)); false || echo 3", "shell": "true"}  # as tasks have it
    assert session.client.post("/setup/execute", json=texts).json()["output"] == "2\n3\n"
    assert session.execute(["ls", "~/Desktop"])["output"] == "readme.txt\n"


def test_commands_run_as_the_user_in_the_session(session):
    assert session.execute(["id", "-u"])["output"].strip() == str(session.account.pw_uid)
    environment = dict(
        line.split("=", 1)
        for line in session.execute(["env"])["output"].splitlines()
        if "=" in line
    )
    assert environment["HOME"] == str(session.home)
    assert environment["DISPLAY"].startswith(":")
    assert "DBUS_SESSION_BUS_ADDRESS" in environment
    assert "VIRTUAL_ENV" not in environment
    assert session.token not in json.dumps(environment)


def test_missing_program_is_an_error(session):
    answer = session.client.post("/execute", json={"command": ["no-such-program"]})
    assert answer.status_code == 500
    assert answer.json()["status"] == "error"
    assert "no-such-program" in answer.json()["message"]


def test_endless_command_and_all_it_started_are_killed(session):
    script = "sleep 4321 & setsid sleep 4321 & (trap '' TERM; sleep 4321) & wait"
    answer = session.client.post("/execute", json={"command": script, "shell": True, "timeout": 1})
    assert answer.status_code == 504
    assert "timed out after 1 seconds" in answer.json()["message"]
    assert session.execute("pgrep -f 'sleep 432[1]'")["output"] == ""


def test_background_child_does_not_hold_the_answer(session):
    answer = session.execute("sleep 4322 & echo started")
    assert answer["output"] == "started\n"
    assert session.execute("pgrep -f 'sleep 432[2]' | wc -l")["output"].strip() != "0"
    session.execute("pkill -f 'sleep 432[2]'")


def test_output_is_capped_and_not_text_is_read(session):
    answer = session.execute("head -c 9437184 /dev/zero | tr '\\0' x; printf '\\377\\376' >&2")
    assert len(answer["output"]) < 8.1 * 2**20
    assert answer["output"].endswith("[output cut: more than 8 MiB]")
    assert answer["error"] == "\ufffd\ufffd"
    assert answer["returncode"] == 0


def test_slow_commands_hold_up_nobody(session, eventually):
    """Sixty that sleep until they are killed, which is another request."""
    count = ["pgrep", "-c", "-f", "sleep 432[3]"]
    with concurrent.futures.ThreadPoolExecutor(60) as pool:
        slow = [pool.submit(session.execute, ["sleep", "4323"]) for _ in range(60)]
        try:
            eventually("all of them", lambda: session.execute(count)["output"].strip() == "60")
            assert session.client.get("/ah/health").status_code == 200
            assert not any(job.done() for job in slow)
        finally:
            session.execute("pkill -f 'sleep 432[3]'")
        assert {job.result()["returncode"] for job in slow} == {-15}


def test_run_python_and_bash(session):
    good = session.client.post(
        "/run_python", json={"code": "print('hi'); import pyautogui; print(pyautogui.size().width)"}
    )
    assert good.json()["status"] == "success"
    assert good.json()["output"].split() == ["hi", str(session.screen[0])]
    bad = session.client.post("/run_python", json={"code": "1/0"}).json()
    assert (bad["status"], bad["return_code"]) == ("error", 1)
    assert "ZeroDivisionError" in bad["error"]
    late = session.client.post("/run_python", json={"code": "while True: pass", "timeout": 0.5})
    assert late.status_code == 500
    assert late.json()["error"] == "TimeoutExpired"
    bash = session.client.post(
        "/run_bash_script", json={"script": "pwd; echo oops >&2; false", "working_dir": "~/Desktop"}
    )
    assert bash.json() == {
        "status": "error",
        "output": f"{session.home}/Desktop\noops\n",
        "error": "",
        "returncode": 1,
    }
    assert (
        session.client.post(
            "/run_bash_script", json={"script": "ls", "working_dir": "/nowhere"}
        ).status_code
        == 400
    )
    stuck = session.client.post("/run_bash_script", json={"script": "sleep 99", "timeout": 0.5})
    assert stuck.json()["returncode"] == -1


def test_upload_and_file_round_trip(session):
    data = np.random.default_rng(1).integers(0, 256, 3 * 2**20, dtype=np.uint8).tobytes()
    form = {"data": {"file_path": "~/Documents/new/ä b.bin"}, "files": {"file_data": ("x", data)}}
    answer = session.client.post("/setup/upload", **form)
    assert answer.text == f"File Uploaded: {len(data)} bytes"
    back = session.client.post("/file", data={"file_path": "$HOME/Documents/new/ä b.bin"})
    assert back.status_code == 200
    assert back.content == data
    assert session.execute(["stat", "-c", "%u %a", f"{session.home}/Documents/new/ä b.bin"])[
        "output"
    ].split() == [str(session.account.pw_uid), "644"]
    assert session.execute(["ls", "-A", f"{session.home}/Documents/new"])["output"] == "ä b.bin\n"


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("~/none", 404),
        ("/etc/shadow", 403),
        ("~/../token", 403),
        ("~/Desktop", 400),
        ("~/pipe", 400),
        ("", 400),
        ("~/link", 403),
    ],
)
def test_files_out_of_reach(session, path, status):
    session.execute("mkfifo ~/pipe; ln -s /etc/shadow ~/link")
    path = path.replace("~/../token", str(session.token_file))
    answer = session.client.post("/file", data={"file_path": path})
    assert answer.status_code == status, answer.text
    assert answer.json()["message"]


@pytest.mark.parametrize("path", ["/etc/planted", "/root/planted", "~/../planted"])
def test_upload_writes_nowhere_else(session, path):
    path = path.replace("~/..", str(session.folder))
    answer = session.client.post(
        "/setup/upload", data={"file_path": path}, files={"file_data": b"x"}
    )
    assert answer.status_code == 403
    assert not (session.folder / "planted").exists()


def test_upload_without_its_fields(session):
    assert session.client.post("/setup/upload", data={"file_path": "~/x"}).status_code == 400
    assert session.client.post("/setup/upload", content=b"nonsense").status_code == 400
    assert session.client.post("/file").status_code == 400


def test_sizes_and_places(session):
    width, height = session.screen
    assert session.client.post("/screen_size").json() == {"width": width, "height": height}
    session.input({"type": "move", "x": 321, "y": 123})
    assert session.client.get("/cursor_position").json() == [321, 123]
    assert session.client.post("/desktop_path").json() == {
        "desktop_path": str(session.home / "Desktop")
    }
    panel = session.client.post("/window_size", data={"app_class_name": "xfce4-panel"}).json()
    assert panel["width"] == width
    assert (
        session.client.post("/window_size", data={"app_class_name": "nothing"}).status_code == 404
    )


def test_list_directory(session):
    session.execute(
        "mkdir -p ~/tree/inner && touch ~/tree/a ~/tree/inner/b && ln -sfn / ~/tree/loop"
    )
    tree = session.client.post("/list_directory", json={"path": str(session.home / "tree")}).json()[
        "directory_tree"
    ]
    assert (tree["type"], tree["name"]) == ("directory", "tree")
    children = {child["name"]: child for child in tree["children"]}
    assert children["a"] == {"type": "file", "name": "a"}
    assert children["inner"]["children"] == [{"type": "file", "name": "b"}]
    assert children["loop"]["children"] == []
    assert session.client.post("/list_directory", json={"path": "/etc/hostname"}).status_code == 400


def test_wallpaper(session, eventually):
    picture = io.BytesIO()
    Image.new("RGB", (64, 64), (10, 200, 30)).save(picture, "PNG")
    session.client.post(
        "/setup/upload", data={"file_path": "~/w.png"}, files={"file_data": picture.getvalue()}
    )
    answer = session.client.post("/setup/change_wallpaper", json={"path": "~/w.png"})
    assert answer.status_code == 200, answer.text
    assert session.client.post("/wallpaper").content == picture.getvalue()
    assert (
        session.client.post("/setup/change_wallpaper", json={"path": "~/none.png"}).status_code
        == 404
    )

    def green() -> bool:
        image = Image.open(io.BytesIO(session.client.get("/screenshot").content))
        return image.getpixel((session.screen[0] // 2, session.screen[1] // 2)) == (10, 200, 30)

    eventually("the new wallpaper on the screen", green)


def test_download_file(session):
    from http.server import BaseHTTPRequestHandler, HTTPServer

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200 if self.path == "/good" else 404)
            self.end_headers()
            self.wfile.write(b"content")

        def log_message(self, *_):
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = f"http://127.0.0.1:{server.server_port}"
        good = session.client.post(
            "/setup/download_file", json={"url": f"{url}/good", "path": "~/got/it.txt"}
        )
        bad = session.client.post(
            "/setup/download_file", json={"url": f"{url}/bad", "path": "~/got/no.txt"}
        )
        server.shutdown()
    assert good.status_code == 200
    assert session.execute("cat ~/got/it.txt; ls -A ~/got")["output"] == "contentit.txt\n"
    assert bad.status_code == 500
    local = session.client.post(
        "/setup/download_file", json={"url": "file:///etc/passwd", "path": "~/p"}
    )
    assert local.status_code == 400


def test_execute_with_verification(session):
    passed = session.client.post(
        "/setup/execute_with_verification",
        json={
            "command": "(sleep 0.5; touch ~/done) &",
            "shell": True,
            "max_wait_time": 5,
            "check_interval": 0.1,
            "verification": {"command_success": "test -e ~/done"},
        },
    )
    assert passed.json()["verification"] == "passed"
    failed = session.client.post(
        "/execute_with_verification",
        json={
            "command": ["true"],
            "verification": {"window_exists": "nothing like it"},
            "max_wait_time": 0.3,
            "check_interval": 0.1,
        },
    )
    assert failed.status_code == 500
    assert failed.json()["status"] == "verification_failed"


def test_recording(session):
    assert session.client.post("/end_recording").status_code == 400
    needs.apps("ffmpeg")
    started = session.client.post("/start_recording")
    assert started.status_code == 200, started.text
    assert session.client.post("/start_recording").status_code == 400
    session.input(
        {"type": "move", "x": 10, "y": 10}, {"type": "move", "x": 600, "y": 400, "duration": 0.5}
    )
    video = session.client.post("/end_recording")
    assert video.status_code == 200
    assert video.content[4:8] == b"ftyp"
    assert session.client.post("/end_recording").status_code == 400
