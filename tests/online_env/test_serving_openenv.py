"""The server as OpenEnv's own client and tools see it, on desktops that are none."""

import base64
import io
import json
import socket
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("prometheus_client", reason=needs.SERVE)
pytest.importorskip("openenv", reason=needs.SERVE)

from click.testing import CliRunner
from openenv.core.generic_client import GenericEnvClient

from online_env.serving import openenv_env
from online_env.serving.serve_command import serve

from support.episodes import CLICK
from support.serving import Desktops, server, until

TOKEN = "correct-horse-battery-staple"
HEADERS = {"Authorization": f"Bearer {TOKEN}"}
pytestmark = pytest.mark.filterwarnings("ignore")


def client(url, **options):
    return GenericEnvClient(base_url=url, **options).sync()


def get(url, data=None, **headers):
    """Status, headers and text of an HTTP answer."""
    body = None if data is None else json.dumps(data).encode()
    headers = {"Content-Type": "application/json", **headers}
    request = urllib.request.Request(url, body, headers)
    try:
        with urllib.request.urlopen(request, timeout=30) as answer:
            return answer.status, answer.headers, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.headers, error.read().decode()


def test_the_official_client_plays_an_episode():
    desktops = Desktops()
    with server(desktops) as (url, service), client(url) as env:
        result = env.reset(seed=3, task="write_note", corruption="marks", episode_id="mine")
        observation = result.observation
        assert (result.reward, result.done, observation["instruction"]) == (
            None,
            False,
            "Open the file",
        )
        picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(observation["screenshot"]))))
        assert picture.shape == (observation["height"], observation["width"], 3) == (360, 640, 3)
        clean = desktops.stages[0].desktop.screenshot()
        assert (picture != clean).any()  # it is what the agent sees
        state = env.state()
        assert (state["episode_id"], state["task"], state["seed"]) == ("mine", "write_note", 3)
        assert (state["corruption"], state["record"]) == ("marks", None)
        message = json.dumps({key: observation[key] for key in observation if key != "screenshot"})
        assert "marks" not in message  # the agent is not told
        structured = {"action_type": "CLICK", "x": 10, "y": 20}
        result = env.step({"action": structured, "dialect": "computer_13"})
        assert (result.reward, result.done) == (0.0, False)
        result = env.step({"action": "DONE"})
        assert (result.reward, result.done) == (1.0, True)
        assert env.state()["record"]["status"] == "ok"
        assert env.step({"action": CLICK}).done
    until(lambda: service.pool.counts().free == 0)


@pytest.mark.parametrize(
    ("message", "code"),
    [
        ('{"type": "step", "data": {"actoin": "WAIT"}}', "VALIDATION_ERROR"),
        ('{"type": "step", "data": {"action": 5}}', "VALIDATION_ERROR"),
        ('{"type": "step", "data": {"action": "WAIT", "dialect": "klingon"}}', "EXECUTION_ERROR"),
        ('{"type": "step", "data"', "INVALID_JSON"),
        ('{"type": "fly"}', "UNKNOWN_TYPE"),
        ('{"type": "reset", "data": {"taks": "write_note"}}', "EXECUTION_ERROR"),
        ('{"type": "reset", "data": {"task": "write_nots"}}', "EXECUTION_ERROR"),
        ('{"type": "reset", "data": {"corruption": "../x.py:X"}}', "EXECUTION_ERROR"),
        ('{"type": "reset", "data": {"split": "training", "index": 99}}', "EXECUTION_ERROR"),
        (
            '{"type": "reset", "data": {"task": "write_note", "split": "training", "index": 1}}',
            "EXECUTION_ERROR",
        ),
    ],
)
def test_a_malformed_message_leaves_the_episode_as_it_is(message, code):
    from websockets.sync.client import connect

    with server() as (url, _), connect(url.replace("http", "ws") + "/ws", proxy=None) as wire:

        def ask(text):
            wire.send(text)
            return json.loads(wire.recv(30))

        assert ask('{"type": "reset", "data": {"corruption": "clean"}}')["type"] == "observation"
        answer = ask(message)
        assert (answer["type"], answer["data"]["code"]) == ("error", code)
        answer = ask('{"type": "step", "data": {"action": "DONE"}}')
        assert (answer["data"]["reward"], answer["data"]["done"]) == (1.0, True)


def test_a_client_that_vanishes_frees_its_desktop():
    from websockets.sync.client import connect

    with server() as (url, service):
        wire = connect(url.replace("http", "ws") + "/ws", proxy=None)
        wire.send('{"type": "reset", "data": {}}')
        wire.recv(30)
        assert service.pool.counts().lent == 1
        wire.socket.shutdown(socket.SHUT_RDWR)  # as when its process is killed
        until(lambda: service.pool.counts().free == 1)


def test_without_the_token_nobody_gets_in():
    with server(token=TOKEN) as (url, _):
        with pytest.raises(ConnectionError, match="HTTP 401"):
            client(url).reset()
        with pytest.raises(ConnectionError, match="HTTP 401"):
            client(url, headers={"Authorization": "Bearer wrong"}).reset()
        for path in ("/metrics", "/schema", "/docs", "/agenthijack/splits"):
            status, _, text = get(url + path)
            assert (status, "Authorization: Bearer TOKEN" in text) == (401, True)
        assert get(f"{url}/health")[0] == 200
        assert get(f"{url}/metrics", **HEADERS)[0] == 200
        with client(url, headers=HEADERS) as env:
            assert env.reset().done is False


def test_a_web_page_does_not_get_in_without_a_token():
    with server() as (url, _):
        assert get(f"{url}/schema", Origin="http://page.test")[0] == 403
        assert get(f"{url}/schema", Host="rebound.test")[0] == 403
        assert get(f"{url}/schema", Host="localhost:80")[0] == 200
        assert get(f"{url}/schema", Host="[::1]:80")[0] == 200
        for host in ("[::1", "127.0.0.1.page.test", ""):
            assert get(f"{url}/schema", Host=host)[0] == 403


def test_too_many_sessions_and_too_many_that_wait():
    with server(sessions=2, line=0) as (url, _), client(url) as first, client(url) as second:
        first.reset()
        with pytest.raises(RuntimeError, match=r"the server is busy.*retry_after=\d+"):
            second.reset()
        with client(url) as third, pytest.raises(RuntimeError, match="CAPACITY_REACHED"):
            third.reset()
        status, headers, text = get(f"{url}/reset", {})
        assert (status, int(headers["Retry-After"]) >= 1) == (503, True)
        assert "the server is busy" in text
        first.step({"action": "DONE"})
        assert second.reset().done is False


def test_a_dead_desktop_is_a_clear_error_and_the_session_goes_on():
    desktops = Desktops()
    with server(desktops) as (url, _), client(url) as env:
        env.reset()
        desktops.stages[0].desktop.dead = True
        with pytest.raises(RuntimeError, match=r"the desktop ended in mid-episode.*EXECUTION_ERR"):
            env.step({"action": CLICK})
        assert env.reset().done is False


def test_health_and_metrics_tell_what_the_desktops_do():
    desktops = Desktops()
    with server(desktops, 2) as (url, service), client(url) as env:
        env.reset()
        _, _, text = get(f"{url}/health")
        assert json.loads(text) == {
            "status": "healthy",
            "desktops": {"free": 1, "lent": 1, "starting": 0},
            "waiting": 0,
        }
        _, headers, text = get(f"{url}/metrics")
        assert headers["Content-Type"].startswith("text/plain; version=0.0.4")
        assert 'hijack_desktops{state="lent"} 1.0' in text
        assert "process_resident_memory_bytes" in text
        service.pool.close()
        assert get(f"{url}/health")[0] == 503


def test_the_task_api_lists_what_is_served():
    with server() as (url, _), client(url) as env:
        assert json.loads(get(f"{url}/agenthijack/splits")[2]) == [
            {"name": "training", "type": "train"}
        ]
        data = json.loads(get(f"{url}/agenthijack/tasks", {"split": "training"})[2])
        assert [task["id"] for task in data["tasks"]] == ["write_note", "rename_file"]
        status, _, text = get(f"{url}/agenthijack/tasks", {"split": "held_out"})
        assert (status, "no split 'held_out' is served" in text) == (400, True)
        env.reset(split="training", index=1)
        assert env.state()["task"] == "rename_file"


def test_openenv_validates_the_server_and_the_package():
    """Its own command, in this process: another one takes seconds to import it."""
    from openenv.cli.__main__ import app
    from typer.testing import CliRunner as TyperRunner

    folder = Path(openenv_env.__file__).parent
    with server() as (url, _):
        for words in (["--url", url, "--timeout", "60"], [str(folder), "--level", "static"]):
            result = TyperRunner().invoke(app, ["validate", *words])
            assert (result.exit_code, "Verdict: PASS" in result.output) == (0, True), result.output


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--host", "0.0.0.0", "--tasks", "write_note"], "which needs a token"),
        (["--tasks", "held_out"], "--evaluation serves them for scoring"),
        (["--tasks", "write_nots"], "no 'write_nots'; did you mean"),
        (["--corruptions", "mark"], "did you mean 'marks'"),
        (["--size", "big"], "--size must be WIDTHxHEIGHT"),
        (["--token-file", "/nowhere/token"], "No such file"),
        (["--host", "192.0.2.1", "--tasks", "write_note"], "token"),
    ],
)
def test_what_cannot_be_served_is_said_before_a_desktop_starts(words, problem):
    result = CliRunner().invoke(serve, ["embedded_small", *words])
    assert problem in str(result.exception or result.output)


def test_a_dry_run_lists_the_tasks():
    result = CliRunner().invoke(serve, ["embedded_small", "--dry-run"])
    assert result.exit_code == 0, result.output
    assert result.output.split() == [
        "compare_ferries",
        "compare_products",
        "finish_draft",
        "register_from_mail",
        "replace_word",
    ]
