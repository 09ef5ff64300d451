"""What a guest server answers to requests that need no screen, over real HTTP on loopback."""

import asyncio
import json
import os
import socket
import time
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)

from online_env.embedded.guest import commands, request_checks
from online_env.embedded.runtime.registry import process_start

from support.guests import TOKEN, at_home, guest_client, httpx, said
from support.processes import children, cmdline
from support.waiting import until


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("home")
    with at_home(folder):
        yield folder


@pytest.fixture(scope="module")
def guest(home):
    with guest_client() as client:
        yield client


@pytest.fixture(scope="module")
def osworld(home):
    """A client without a token, of a server as OSWorld has it."""
    with guest_client(None, osworld=True) as client:
        yield client


@pytest.fixture
def stranger(guest):
    """A client of the same server that sends no token of itself."""
    with httpx.Client(base_url=guest.base_url, verify=False, trust_env=False) as client:
        yield client


# The door


NEEDED = "a token is needed: send it as `Authorization: Bearer <token>` or as `X-Token`"


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"X-Token": TOKEN}, 200),
        ({"Authorization": f"BEARER  {TOKEN}"}, 200),
        # The scheme of another program's credentials does not hide our own header.
        ({"Authorization": "Basic YTpi", "X-Token": TOKEN}, 200),
        ({"Authorization": "Bearer old", "X-Token": TOKEN}, 401),
        ({"Authorization": f"Basic {TOKEN}"}, 401),
        ({"X-Token": f"{TOKEN}!"}, 401),
        ({"X-Token": ""}, 401),
    ],
)
def test_the_token_opens_the_door_and_nothing_like_it(stranger, headers, status):
    answer = stranger.get("/platform", headers=headers)
    assert answer.status_code == status
    if status == 401:
        assert said(answer) == (401, NEEDED)
        assert answer.headers["www-authenticate"] == "Bearer"


@pytest.mark.parametrize("token", ["", "None", "x"])
def test_without_a_token_of_its_own_a_server_keeps_our_routes_closed(osworld, token):
    assert osworld.get("/platform").text == "Linux"
    for path in ("/ah/health", "/ah/nothing", "/%61h/health"):
        assert osworld.get(path, headers={"X-Token": token}).status_code == 401
    assert said(osworld.get("/nothing")) == (404, "Not Found")


def raw(guest, head, body):
    """The answer to a request that says of its size what `head` says."""
    with socket.create_connection((guest.base_url.host, guest.base_url.port), 60) as link:
        lines = (f"POST /execute HTTP/1.1\r\nHost: x\r\nX-Token: {TOKEN}", *head, "\r\n")
        link.sendall("\r\n".join(lines).encode() + body)
        return b"".join(iter(lambda: link.recv(65536), b""))


def test_a_body_over_the_limit_is_refused_and_the_connection_closed(guest, monkeypatch):
    monkeypatch.setattr(request_checks, "BODY_LIMIT", 1000)
    fits = json.dumps({"command": ["true"]}).ljust(1000).encode()
    kind = {"Content-Type": "application/json"}
    assert guest.post("/execute", content=fits, headers=kind).status_code == 200
    announced = raw(guest, ["Content-Length: 1001"], b"")
    endless = raw(guest, ["Transfer-Encoding: chunked"], b"3e9\r\n" + fits + b" \r\n")
    for answer in (announced, endless):
        head, _, body = answer.partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 413 ")
        assert b"\r\nconnection: close" in head.lower()
        assert json.loads(body)["message"] == "the body is larger than 1000 bytes"


@pytest.mark.parametrize(
    ("kind", "body", "status", "message"),
    [
        ("text/plain", b"{}", 415, "application/json, got 'text/plain'"),
        (None, b"{}", 415, "application/json, got 'no type'"),
        ("application/jsonp", b"{}", 415, "got 'application/jsonp'"),
        ("application/json", b"[]", 400, "the body must be a JSON object, got list"),
        ("application/json", b"null", 400, "the body must be a JSON object, got NoneType"),
        ("application/json", b"{", 400, "the body is not JSON: Expecting property name"),
        # An empty body is an empty object, of whatever type; so the first field is missing.
        ("text/plain", b"", 400, "command must be a string or a list of strings, got None"),
        ("application/json", b" \n", 400, "command must be a string or a list"),
        ("Application/JSON ; charset=utf-8", b'{"command": []}', 400, "command is empty"),
        ("application/vnd.api+json", b'{"command": ""}', 400, "command is empty"),
    ],
)
def test_what_a_body_may_be(guest, kind, body, status, message):
    headers = {} if kind is None else {"Content-Type": kind}
    result = said(guest.post("/execute", content=body, headers=headers))
    assert (result[0], message in result[1]) == (status, True), result


@pytest.mark.parametrize(
    ("path", "body", "message"),
    [
        ("/execute", {"timeout": True}, "timeout must be a number from 0 to 600, got True"),
        ("/execute", {"timeout": "5"}, "timeout must be a number from 0 to 600, got '5'"),
        ("/execute", {"timeout": 600.5}, "timeout must be a number from 0 to 600, got 600.5"),
        ("/execute", {"shell": 1}, "shell must be true or false, got 1"),
        ("/execute", {"shell": "True"}, "shell must be true or false, got 'True'"),
        ("/execute", {"command": ["a", 1]}, "command must be a string or a list of strings, got"),
        ("/run_python", {"code": ""}, "code must be a text that is not empty, got ''"),
        ("/run_bash_script", {}, "script must be a text that is not empty, got None"),
        ("/ah/tool", {"tool": "xtool"}, "fields must be an object, got None"),
        ("/ah/tool", {"fields": {}, "tool": "x", "operation": "y"}, "no operation 'y' of 'x'"),
        ("/ah/input", {}, 'events is required: {"events": [{"type": "click"'),
        ("/list_directory", {"path": 3}, "a path must be a text without zero bytes, got 3"),
        ("/list_directory", {"path": "a\0b"}, r"a path must be a text without zero bytes, got 'a"),
    ],
)
def test_a_field_with_a_wrong_value_is_named(guest, path, body, message):
    fields = {"command": ["true"], **body} if path == "/execute" else body
    status, value = said(guest.post(path, json=fields))
    assert (status, message in value) == (400, True), value


# Commands


def output(guest, **fields):
    return guest.post("/execute", json=fields).json()["output"]


def test_a_tilde_at_the_start_of_an_argument_is_the_home_folder(guest, home):
    """As in OSWorld's server, which looks at the words of a split text, too."""
    assert output(guest, command=["echo", "~/a b", "x~/y", "~"]) == f"{home}/a b x~/y ~\n"
    assert output(guest, command="echo '~/a b' x~/y ~") == f"{home}/a b x~/y ~\n"
    assert output(guest, command="echo ~/a", shell=True) == f"{home}/a\n"
    launched = guest.post("/setup/launch", json={"command": "touch ~/launched"})
    assert launched.text == f"touch {home}/launched launched successfully"
    until((home / "launched").exists)


def test_commands_find_our_wrappers_and_nothing_of_the_server(guest):
    lines = output(guest, command=["env", "-0"]).split("\0")
    entries = dict(line.split("=", 1) for line in lines if line)
    assert entries["PATH"].split(":")[0] == commands.TOOLS
    assert not {"PYTHONPATH", "VIRTUAL_ENV"} & set(entries)


def test_a_command_that_is_given_up_ends_with_all_that_it_started(home):
    family = []

    async def scenario():
        runner = commands.Runner()
        job = asyncio.create_task(runner.run(["sh", "-c", "sleep 4325 & sleep 4325"]))
        while len(family) < 3:
            await asyncio.sleep(0.01)
            shells = [pid for pid in children(os.getpid()) if b"4325" in cmdline(pid)]
            family[:] = [item for pid in shells for item in (pid, *children(pid))]
        job.cancel()
        with pytest.raises(asyncio.CancelledError):
            await job

    asyncio.run(scenario())
    until(lambda: not any(process_start(pid) for pid in family), "their end")


def test_what_takes_too_long_says_how_long_it_may_take(guest):
    slow = {"timeout": 0.1}
    assert said(guest.post("/execute", json={"command": ["sleep", "9"], **slow})) == (
        504,
        "Command ['sleep', '9'] timed out after 0.1 seconds; it was killed with all it started",
    )
    script = guest.post("/run_bash_script", json={"script": "sleep 9", **slow})
    assert (script.status_code, script.json()) == (
        500,
        {
            "status": "error",
            "output": "Script execution timed out after 0.1 seconds",
            "error": "",
            "returncode": -1,
        },
    )
    python = guest.post("/run_python", json={"code": "import time; time.sleep(9)", **slow})
    assert (python.status_code, python.json()["output"]) == (500, None)
    assert python.json()["message"].startswith("Execution timeout: Command ['python3', '")


def test_python_that_fails_without_a_word_says_its_exit_code(guest):
    answer = guest.post("/run_python", json={"code": "print('ü'); raise SystemExit(3)"})
    assert (answer.status_code, answer.json()) == (
        200,
        {
            "status": "error",
            "need_more": False,
            "output": "ü\n",
            "message": "ü\n\nProcess exited with code 3",
            "error": "Process exited with code 3",
            "return_code": 3,
        },
    )


def test_scripts_are_not_left_behind(guest, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    script_path = (
        guest.post("/run_bash_script", json={"script": "echo $0"}).json()["output"].strip()
    )
    assert Path(script_path).parent == tmp_path
    assert list(tmp_path.iterdir()) == []


def test_a_verification_is_tried_until_its_time_is_over(guest, home):
    def verified(**fields):
        return guest.post("/execute_with_verification", json={"command": ["true"], **fields})

    assert verified().json()["status"] == "success"
    assert "verification" not in verified().json()
    counting = {"command_success": "echo >> ~/tries; test $(wc -l < ~/tries) -ge 3"}
    passed = verified(verification=counting, check_interval=0.01)
    assert (passed.status_code, passed.json()["verification"]) == (200, "passed")
    assert (home / "tries").read_text() == "\n\n\n"
    failed = verified(
        verification={"command_success": "exit 1"}, check_interval=0.01, max_wait_time=0.05
    )
    assert failed.status_code == 500
    assert failed.json()["status"] == "verification_failed"
    assert 0.05 <= failed.json()["wait_time"] < 60


@pytest.mark.parametrize("wanted", ["window_exists", ["command_success"], 5])
def test_a_verification_that_is_none_does_not_pass(guest, home, wanted):
    answer = guest.post(
        "/execute_with_verification", json={"command": "touch ~/done", "verification": wanted}
    )
    assert said(answer) == (400, f"verification must be an object, got {wanted!r}")
    assert not (home / "done").exists(), "the command ran before the request was looked at"


def test_an_application_that_is_neither_file_nor_program_is_told(guest):
    answer = guest.post("/setup/open_file", json={"path": "~/none.txt"})
    assert said(answer) == (404, f"Application/file not found: {Path.home()}/none.txt")


# A session of which nothing answers


def test_without_a_session_the_server_says_what_is_down(guest):
    assert guest.get("/ah/health").json() == {
        "ready": False,
        "down": ["display", "bus", "window_manager"],
        "display": "",
        "pid": os.getpid(),
        "uid": os.getuid(),
    }
    began = time.monotonic()
    for path in ("/screenshot", "/cursor_position", "/accessibility", "/ah/windows"):
        assert guest.get(path).status_code == 500, path
    status, message = said(guest.get("/cursor_position"))
    assert (status, "does not answer" in message) == (500, True)
    assert time.monotonic() - began < 20
