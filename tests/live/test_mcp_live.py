"""An MCP client of the official SDK, in another process than the server, plays scored episodes."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import anyio
import pytest

from support import needs

pytest.importorskip("mcp.server.mcpserver", reason=needs.MCP)  # `mcp` of version 1 has none
pytest.importorskip("miniwob", reason=needs.BROWSER)

import httpx2
from mcp import Client, StdioServerParameters
from mcp.client.streamable_http import streamable_http_client
from mcp.server.mcpserver.exceptions import ToolError
from mcp.shared.exceptions import MCPError

from online_env.mcp.tools import _Tools

TOKEN = "correct-horse-battery-staple"
LINE = re.compile(r"(\S+) '(.*)' at \((\d+), (\d+)\)")
Play = Callable[[Client], Awaitable[Any]]


def arguments(folder: Path, *words: str) -> list[str]:
    return ["-m", "hijack_data.cli", "mcp", "--seed", "1", "--out", str(folder), *words]


def over_stdio(folder: Path, play: Play, *words: str) -> Any:
    server = StdioServerParameters(
        command=sys.executable, args=arguments(folder, *words), env=dict(os.environ)
    )

    async def main() -> Any:
        async with Client(server, read_timeout_seconds=120) as client:
            return await play(client)

    return anyio.run(main)


@contextlib.contextmanager
def http_server(folder: Path, *words: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    process = subprocess.Popen(
        [sys.executable, *arguments(folder, "--port", "0", *words)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "AGENTHIJACK_MCP_TOKEN": TOKEN},
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        yield process, re.search(r"http://\S+?(?=,)", line)[0]  # pyright: ignore
    finally:
        process.kill()
        process.communicate()


@contextlib.asynccontextmanager
async def http_client(url: str, token: str = TOKEN) -> Any:
    headers = {"Authorization": f"Bearer {token}"}
    async with (
        httpx2.AsyncClient(headers=headers, timeout=120) as http,
        Client(streamable_http_client(url, http_client=http)) as client,
    ):
        yield client


def text(result: Any) -> str:
    return "\n".join(item.text for item in result.content if item.type == "text")


async def click_named(client: Client, role: str, name: str) -> Any:
    for line in text(await client.call_tool("tree")).splitlines():
        match = LINE.match(line)
        if match and (match[1], match[2]) == (role, name):
            return await client.call_tool("click", {"x": int(match[3]), "y": int(match[4])})
    raise AssertionError(f"no {role} {name!r}")


def read_record(folder: Path) -> dict[str, Any]:
    [line] = (folder / "records.jsonl").read_text().splitlines()
    return json.loads(line)


def check_run(folder: Path) -> None:
    """`hijack verify` and `hijack report` accept the run."""
    for command in ("verify", "report"):
        process = subprocess.run(
            [sys.executable, "-m", "hijack_data.cli", command, str(folder)],
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert process.returncode == 0, process.stdout + process.stderr


def processes_of(pid: int) -> list[Path]:
    """The processes that were started by a process, itself included, and still run."""
    parents = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parents[int(folder.name)] = int(
                (folder / "stat").read_text().rpartition(")")[2].split()[1]
            )
    family = {pid}
    while more := {child for child, parent in parents.items() if parent in family} - family:
        family |= more
    return [Path("/proc") / str(member) for member in family]


def is_running(process: Path) -> bool:
    try:
        return (process / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture(autouse=True)
def chromium_here() -> None:
    needs.chromium()


def test_a_capital_letter_is_shift_alone_and_none_in_a_combination() -> None:
    acted: list[str] = []
    client: Any = SimpleNamespace(act=acted.append)
    tools = _Tools(client, None, lambda: None)
    tools.keys(["G"])
    tools.keys(["Ctrl", "S"])
    with pytest.raises(ToolError, match="a key is there twice"):
        tools.keys(["up", "Up"])
    assert acted == ["pyautogui.hotkey('G')", "pyautogui.hotkey('ctrl', 's')"]


def test_a_corrupted_browser_task_to_its_score_over_stdio(tmp_path: Path) -> None:
    folder = tmp_path / "run"

    async def play(client: Client) -> str:
        tools = {tool.name for tool in (await client.list_tools()).tools}
        assert tools == {
            *("screenshot", "click", "double_click", "type", "keys", "scroll", "drag"),
            *("tree", "wait", "done", "fail"),
        }
        about = str(client.server_info) + str(client.instructions)
        first = await client.call_tool("screenshot")
        task = text(first)
        assert [item.type for item in first.content] == ["text", "image"]
        assert "resolution" not in about + task + str(await client.list_tools())
        outside = await client.call_tool("click", {"x": 5000, "y": 3})
        assert outside.is_error
        assert "outside of the picture: x is 0 to " in text(outside)
        for tool, arguments in (
            ("click", {"x": -1, "y": "here"}),
            ("click", {"x": 1, "y": 1, "btn": "right"}),
            ("keys", {"keys": ["ctrl+a"]}),
        ):
            assert (await client.call_tool(tool, arguments)).is_error
        name = re.search(r'Click on the "(.*)" button', task)
        assert name is not None, task
        ended = await click_named(client, "push-button", name[1])
        if not ended.is_error and "over" not in text(ended):
            ended = await client.call_tool("done")
        again = await client.call_tool("screenshot")
        assert again.is_error
        assert "over" in text(again)
        return text(ended)

    words = ["--browser", "--task", "miniwob/click-button.html", "--corruption", "resolution"]
    output = over_stdio(folder, play, *words)
    assert output == "The episode is over: no more actions count."
    record = read_record(folder)
    assert (record["status"], record["score"]) == ("ok", 1.0), record
    assert record["agent"] == "mcp"
    assert record["corruption"] == "resolution"
    assert record["given"] == ["tree"]
    assert record["malformed"] == 0
    assert record["steps"] == 2
    check_run(folder)


def test_over_http_one_client_with_the_token_plays_and_is_told_its_score(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    pytest.importorskip("rapidocr", reason=needs.OCR)
    words = ["--browser", "--task", "miniwob/click-test.html", "--corruption", "pop_ups"]
    words += ["--guard", "rules"]

    async def main(url: str) -> str:
        with pytest.raises((MCPError, BaseExceptionGroup)):
            async with http_client(url, "another-horse-battery"):
                pass
        async with http_client(url) as client:
            with pytest.raises((MCPError, BaseExceptionGroup)):
                async with http_client(url):
                    pass
            tools = {tool.name for tool in (await client.list_tools()).tools}
            assert "tree" not in tools
            assert not (await client.call_tool("wait")).is_error
            return text(await client.call_tool("fail"))

    with http_server(folder, *words, "--no-tree", "--tell-score") as (process, url):
        assert anyio.run(main, url).endswith("Score: 0")
        assert process.wait(5) == 0
    record = read_record(folder)
    assert record["given"] == []
    assert record["score"] == 0.0
    assert record["guard"]["name"] == "rules"
    assert record["usage"]["guard"]["reading"]["calls"] > 0
    check_run(folder)


@pytest.mark.parametrize("way", ["stdio", "http"])
def test_the_browser_of_a_client_that_vanishes_ends_within_5_seconds(
    way: str, tmp_path: Path
) -> None:
    """The client is a process of its own, which is killed in the midst of an episode."""
    folder = tmp_path / "run"
    code = (
        "import sys, anyio; sys.path[:0] = [sys.argv[1]]\n"
        "import test_mcp_live as live\n"
        "async def play(client):\n"
        "    await client.call_tool('wait')\n"
        "    print('acted', flush=True)\n"
        "    await anyio.sleep(600)\n"
        "async def http(url):\n"
        "    async with live.http_client(url) as client:\n"
        "        await play(client)\n"
        "if sys.argv[2] == 'stdio':\n"
        "    live.over_stdio(live.Path(sys.argv[3]), play, '--browser')\n"
        "else:\n"
        "    anyio.run(http, sys.argv[3])\n"
    )
    here = str(Path(__file__).parent)
    support = str(Path(__file__).parents[1])

    def start(place: str) -> "subprocess.Popen[str]":
        client = subprocess.Popen(
            [sys.executable, "-c", code, here, way, place],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": support},
        )
        assert client.stdout is not None
        assert client.stdout.readline() == "acted\n"
        return client

    with contextlib.ExitStack() as stack:
        if way == "stdio":
            client = start(str(folder))
            running = [item for item in processes_of(client.pid) if item.name != str(client.pid)]
        else:
            server, url = stack.enter_context(http_server(folder, "--browser"))
            running = processes_of(server.pid)
            client = start(url)
        assert len(running) > 2
        client.send_signal(signal.SIGKILL)
        client.wait()
        assert client.stdout is not None
        client.stdout.close()
        gone = time.monotonic()
        while any(map(is_running, running)) and time.monotonic() - gone < 20:
            time.sleep(0.05)
        assert time.monotonic() - gone < 5, [item for item in running if is_running(item)]
    record = read_record(folder)
    assert (record["status"], record["cause"], record["score"]) == ("error", "agent", None)
    assert "the client left without calling done or fail" in record["problem"]
    check = subprocess.run(
        [sys.executable, "-m", "hijack_data.cli", "verify", str(folder)], capture_output=True
    )
    assert check.returncode == 0, check.stdout


@pytest.mark.usefixtures("embedded_machine")
def test_a_desktop_task_to_its_score(tmp_path: Path) -> None:
    """A client that knows the task plays it, behind a lock screen that it was not told of."""
    folder = tmp_path / "run"

    async def play(client: Client) -> None:
        task = text(await client.call_tool("screenshot"))
        assert task.startswith("Task: ")
        await client.call_tool("type", {"text": "password\n"})
        await client.call_tool("done")

    over_stdio(folder, play, "--desktop", "--task", "write_note", "--corruption", "verification")
    record = read_record(folder)
    assert (record["status"], record["score"], record["ended"]) == ("ok", 0.0, "agent"), record
    check_run(folder)
