"""Task files with odd addresses and names, servers that misbehave, and what is needed of all that."""

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from support import needs

pytest.importorskip("httpx", reason=needs.ONLINE)

from click.testing import CliRunner

from hijack_data.cli import hijack
from hijack_data.errors import ConfigError
from online_env.osworld import task_needs, task_table
from online_env.osworld.cache_files import CacheFile, list_cache_files
from online_env.osworld.prefetch import MANIFEST, PARTS_FOLDER, prefetch, read_manifest
from online_env.osworld.task_needs import TaskNeeds, list_all_needs, list_needs, summary
from online_env.osworld.tasks import load

BODY = b"0123456789" * 100


def write_task(folder: Path, name: str, domain: str = "os", **more: Any) -> Path:
    """Write a task of OSWorld, which needs nothing but what `more` says."""
    config = {
        "id": name,
        "instruction": f"Do {name}.",
        "config": [],
        "evaluator": {"func": "exact_match"},
        **more,
    }
    path = folder / "examples" / domain / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(config))
    return path


def download(*files: Any) -> list[dict[str, Any]]:
    return [{"type": "download", "parameters": {"files": list(files)}}]


def launch(*words: str) -> list[dict[str, Any]]:
    return [{"type": "launch", "parameters": {"command": list(words)}}]


# Task files


@pytest.mark.parametrize("files", [5, None, "x", {"url": "http://h/x"}, ["x"], [None]])
def test_files_of_a_download_that_are_no_list_of_objects_are_named(
    tmp_path: Path, files: Any
) -> None:
    path = write_task(tmp_path, "a1", config=[{"type": "download", "parameters": {"files": files}}])
    with pytest.raises(ConfigError) as caught:
        load(tmp_path)
    assert caught.value.problems == (
        f"{path}: config[0].parameters.files: must be a list of objects with `url` and `path`,"
        f" got {files!r}",
    )


def test_a_download_of_nothing_wants_nothing(tmp_path: Path) -> None:
    write_task(tmp_path, "a1", config=[{"type": "download", "parameters": {}}, *download()])
    (task,) = load(tmp_path)
    assert list_cache_files(task) == []


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"path": "/x"}, "the address must start with http:// or https://, got None"),
        (
            {"url": "http://h/\ud83d", "path": "/x"},
            r"the address must start with http:// or https://, got 'http://h/\ud83d'",
        ),
        ({"url": "http://h/x"}, "the file's name must stay in the task's folder, got None"),
        (
            {"url": "http://h/x", "path": "/\ud83d"},
            r"the file's name must stay in the task's folder, got"
            r" '2df3d3ee-bb3c-57e3-9b08-8a8d9bd7b5a1_\ud83d'",
        ),
    ],
)
def test_a_download_that_cannot_be_had_names_its_field(
    tmp_path: Path, entry: dict[str, Any], said: str
) -> None:
    path = write_task(tmp_path, "a1", config=download({"url": "http://h/y", "path": "/y"}, entry))
    (task,) = load(tmp_path)
    with pytest.raises(ConfigError) as caught:
        list_cache_files(task)
    (problem,) = caught.value.problems
    start = f"{path}: config[0].parameters.files[1]: "
    assert problem.startswith(start)
    assert problem.rpartition("_")[2] == f"{start}{said}".rpartition("_")[2]


def test_a_name_may_have_as_many_bytes_as_a_folder_takes(tmp_path: Path) -> None:
    def task_with(name: str) -> Any:
        cloud = {"type": "cloud_file", "path": "http://h/x", "dest": name}
        write_task(tmp_path, "a1", evaluator={"func": "f", "expected": cloud})
        (task,) = load(tmp_path)
        return task

    longest = "é" * 127 + "x"
    assert list_cache_files(task_with(longest)) == [CacheFile("http://h/x", f"a1/{longest}")]
    with pytest.raises(ConfigError, match=r"evaluator\.expected: the file's name must stay"):
        list_cache_files(task_with(f"{longest}x"))


def test_a_file_that_two_getters_want_is_fetched_once(tmp_path: Path) -> None:
    cloud = {"type": "cloud_file", "path": "http://h/x", "dest": "x"}
    write_task(tmp_path, "a1", evaluator={"func": "f", "result": cloud, "expected": {"of": cloud}})
    write_task(tmp_path, "a2", evaluator={"func": ["f", "g"], "result": [cloud, None]})
    with pytest.raises(ConfigError, match=r"evaluator\.expected\[0\]: must be an object"):
        load(tmp_path)
    write_task(
        tmp_path,
        "a1",
        evaluator={"func": "f", "result": cloud, "expected": {"type": "rule", "of": cloud}},
    )
    assert [list_cache_files(task) for task in load(tmp_path)] == [
        [CacheFile("http://h/x", "a1/x")],
        [CacheFile("http://h/x", "a2/x")],
    ]


# Servers


class Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        if self.path.startswith("/to/"):
            self.send_response(302)
            self.send_header("Location", self.path.removeprefix("/to/"))
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        begun = "Range" in self.headers and self.path != "/whole"
        self.send_response(206 if begun else 200)
        self.send_header("Content-Length", str(len(BODY)))
        self.send_header("ETag", '"1"')
        if begun and self.path == "/shifted":
            self.send_header("Content-Range", f"bytes 7-{len(BODY) - 1}/{len(BODY)}")
        self.end_headers()
        self.wfile.write(BODY if "Range" in self.headers else BODY[:100])

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def url() -> Iterator[str]:
    """A server that cuts off each file after 100 bytes, and cannot go on properly."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()


def fetched(cache: Path, *addresses: str) -> dict[str, str]:
    """The failures of fetching some addresses as `t/0`, `t/1`, ..."""
    files = [CacheFile(address, f"t/{number}") for number, address in enumerate(addresses)]
    return prefetch(files, cache, sleep=lambda _: None).failed


@pytest.mark.parametrize(("place", "begins"), [("/shifted", "7"), ("/unsaid", "?")])
def test_a_server_that_goes_on_at_another_place_is_not_believed(
    url: str, tmp_path: Path, place: str, begins: str
) -> None:
    assert fetched(tmp_path, f"{url}{place}") == {
        "t/0": f"{url}{place}: the server sent from byte {begins} where 100 was asked for (5 tries)"
    }
    assert not (tmp_path / "t").exists()


def test_a_server_that_starts_over_gives_the_file_once(url: str, tmp_path: Path) -> None:
    assert fetched(tmp_path, f"{url}/whole") == {}
    assert (tmp_path / "t/0").read_bytes() == BODY
    assert read_manifest(tmp_path)["t/0"]["size"] == len(BODY)
    assert not (tmp_path / PARTS_FOLDER).exists()


def test_the_other_files_come_although_an_address_cannot_be_used(url: str, tmp_path: Path) -> None:
    label = "a" * 64
    odd = [
        f"{url}/to//to/",
        f"{url}/to/http://{label}.test/",
        f"http://{label}.test/",
        "http://[x]/",
        f"{url}/to/ftp://127.0.0.1/x",
    ]
    failed = fetched(tmp_path, *odd, f"{url}/whole")
    assert list(failed) == [f"t/{number}" for number in range(len(odd))]
    for number, address in enumerate(odd):
        assert failed[f"t/{number}"].startswith(f"{address}: ")
    assert (tmp_path / "t" / str(len(odd))).read_bytes() == BODY
    assert list(json.loads((tmp_path / MANIFEST).read_text())) == [f"t/{len(odd)}"]


# What tasks need


@pytest.mark.parametrize(
    ("instruction", "web"),
    [
        ("Go to http://[your-host]/ then", None),
        ("Go to http://[::1]:80/x and https://B.test/x", "::1, b.test"),
        ("Go to http://127.0.0.1:80 or http://LOCALHOST/x", None),
        ("See https://b.test/a, https://b.test/c and https://a.test", "a.test, b.test"),
    ],
)
def test_hosts_are_those_that_an_address_can_have(
    tmp_path: Path, instruction: str, web: str | None
) -> None:
    write_task(tmp_path, "a1", instruction=instruction)
    (task,) = load(tmp_path)
    assert list_needs(task).get("web") == web


def many(tmp_path: Path) -> Path:
    """A set in which each kind of need is there."""
    file = {"url": "https://a.test/x", "path": "/x"}
    write_task(tmp_path, "a-nothing")
    write_task(tmp_path, "b-nothing", evaluator={"func": "infeasible"})
    write_task(tmp_path, "c-files", config=download(file))
    write_task(tmp_path, "d-files-web", config=[*download(file), *launch("x", "http://b.test")])
    write_task(tmp_path, "e-gnome", "apps", config=launch("nautilus"))
    write_task(tmp_path, "f-account", config=[{"type": "login", "parameters": {}}])
    return tmp_path


def test_a_summary_has_what_can_be_met_first_then_the_need_that_decides(tmp_path: Path) -> None:
    all_needs = list_all_needs(load(many(tmp_path)))
    assert [(item.id, item.kinds, item.can_be_met) for item in all_needs] == [
        ("e-gnome", ("program", "gnome"), False),
        ("a-nothing", (), True),
        ("b-nothing", (), True),
        ("c-files", ("files",), True),
        ("d-files-web", ("files", "web"), False),
        ("f-account", ("account",), False),
    ]
    tested = TaskNeeds("g", "os", True, {"web": "b.test"}, "works")
    fetch = "hijack osworld prefetch TASKS --out CACHE, on a connected machine"
    assert summary([*all_needs, tested, TaskNeeds("h", "os", True, {}, "works")]) == [
        ("self-test: works", 2, ""),
        ("nothing", 2, "hijack osworld check TASKS"),
        ("files", 1, fetch),
        ("program", 1, "none: no profile installs the program"),
        ("web", 1, "none: the desktop has no internet"),
        ("account", 1, "none: the account is somebody's"),
    ]
    lacking = list_all_needs(load(tmp_path), lambda config: ["no pandas"] * (config["id"] < "d"))
    advice = f"{fetch} and hijack osworld setup --tier mid"
    assert ("files + packages", 1, advice) in summary(lacking)
    assert summary([]) == []


def needs_command(source: Path, *words: str) -> Any:
    nowhere = ["--venv", str(source / "none")]
    return CliRunner().invoke(hijack, ["osworld", "needs", str(source), *nowhere, *words])


def test_the_files_of_tasks_that_work_are_listed_as_bench_takes_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tasks = load(many(tmp_path))
    status = {"a-nothing": "works", "c-files": "fails", "e-gnome": "works"}
    rows = [{"id": name, "status": how} for name, how in status.items()]
    record = tmp_path / "selftest.json"
    record.write_text(json.dumps({"revision": str(tasks.revision), "tasks": rows}))
    monkeypatch.setattr(task_needs, "TESTED", record)
    result = needs_command(tmp_path, "--working")
    examples = tmp_path / "examples"
    assert result.output == f"{examples}/apps/e-gnome.json,{examples}/os/a-nothing.json\n"
    write_task(tmp_path, "c-files")
    assert needs_command(tmp_path, "--working").output == "\n", "another revision, nothing tested"
    out = tmp_path / "tasks.jsonl"
    task_table.write(tasks, out)
    refused = needs_command(out, "--working")
    assert str(refused.exception) == (
        f"--working: {out} is a table; hijack bench plays tasks by the files in OSWorld's folder,"
        " so name that"
    )


def test_needs_are_the_same_of_a_folder_and_of_its_table(tmp_path: Path) -> None:
    tasks = load(many(tmp_path))
    out = tmp_path / "tasks.jsonl"
    task_table.write(tasks, out)
    of_folder = json.loads(needs_command(tmp_path, "--json").output)
    assert json.loads(needs_command(out, "--json").output) == of_folder
    assert of_folder["revision"] == str(tasks.revision)
    assert of_folder["tasks"][4] == {
        "id": "d-files-web",
        "domain": "os",
        "feasible": True,
        "needs": {"files": "1 to fetch", "web": "b.test"},
        "tested": "",
        "can_be_met": False,
    }
