"""Filling OSWorld's cache, from a file server on loopback that can be told to misbehave."""

import fcntl
import json
import threading
import uuid
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from support import needs

pytest.importorskip("httpx", reason=needs.ONLINE)

from click.testing import CliRunner

from hijack_data.cli import hijack
from hijack_data.errors import ConfigError, HijackError
from online_env.osworld import prefetch as module
from online_env.osworld.cache_files import HISTORY_URL, CacheFile, list_cache_files
from online_env.osworld.prefetch import check, prefetch, read_manifest
from online_env.osworld.tasks import OsworldTask, load

BODY = bytes(range(256)) * 2000


class Server(ThreadingHTTPServer):
    """`/<n>` answers `files[n]`; `cut` bytes after which the next answers end; `errors` are the
    next statuses."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.files = {"/a": BODY, "/b": b"bee", "/empty": b""}
        self.etags = {"/a": '"1"', "/b": '"1"'}
        self.cut: list[int] = []
        self.errors: list[int] = []
        self.requests: list[tuple[str, str]] = []
        threading.Thread(target=self.serve_forever, args=(0.01,), daemon=True).start()

    def url(self, path: str) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}{path}"


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        server, path = self.server, self.path.partition("?")[0]
        wants = self.headers.get("Range", "")
        server.requests.append((path, wants))
        if path == "/moved":
            self.send_response(302)
            self.send_header("Location", "/a")
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        if server.errors or path not in server.files:
            self.send_error(server.errors.pop(0) if server.errors else 404)
            return
        data, etag = server.files[path], server.etags.get(path, "")
        start = int(wants[6:-1]) if wants and self.headers.get("If-Range") == etag else 0
        if start >= len(data) > 0:
            self.send_response(416)
            self.send_header("Content-Range", f"bytes */{len(data)}")
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        self.send_response(206 if start else 200)
        self.send_header("Content-Length", str(len(data) - start))
        if start:
            self.send_header("Content-Range", f"bytes {start}-{len(data) - 1}/{len(data)}")
        if etag:
            self.send_header("ETag", etag)
        self.end_headers()
        end = start + server.cut.pop(0) if server.cut else len(data)
        self.wfile.write(data[start:end])

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def server() -> Iterator[Server]:
    result = Server()
    yield result
    result.shutdown()
    result.server_close()


class Waits(list[float]):
    def __call__(self, seconds: float) -> None:
        self.append(seconds)


def test_files_come_once_and_are_recorded(server: Server, tmp_path: Path) -> None:
    files = [
        CacheFile(server.url("/a"), "t1/x"),
        CacheFile(server.url("/a"), "t2/y"),
        CacheFile(server.url("/empty"), "t1/e"),
    ]
    message: list[tuple[int, int, str]] = []
    report = prefetch(files, tmp_path / "cache", tell=lambda *row: message.append(row))
    assert (report.fetched, report.failed, report.bytes) == (
        ["t1/e", "t1/x", "t2/y"],
        {},
        2 * len(BODY),
    )
    assert message == [(1, 3, "t1/e"), (2, 3, "t1/x"), (3, 3, "t2/y")]
    assert [path for path, _ in server.requests] == ["/empty", "/a"]
    assert (tmp_path / "cache/t1/x").read_bytes() == (tmp_path / "cache/t2/y").read_bytes() == BODY
    assert (tmp_path / "cache/t1/x").stat().st_ino != (tmp_path / "cache/t2/y").stat().st_ino
    assert not (tmp_path / "cache" / module.PARTS_FOLDER).exists()
    again = prefetch(files, tmp_path / "cache")
    assert (again.fetched, again.kept) == ([], ["t1/e", "t1/x", "t2/y"])
    assert len(server.requests) == 2
    assert check(tmp_path / "cache") == {}


def test_a_cut_transfer_goes_on_where_it_stopped(server: Server, tmp_path: Path) -> None:
    server.cut = [100_000, 50_000]
    waits = Waits()
    report = prefetch([CacheFile(server.url("/a"), "t/a")], tmp_path, sleep=waits)
    assert report.failed == {}
    assert [wants for _, wants in server.requests] == ["", "bytes=100000-", "bytes=150000-"]
    assert waits == [1, 2]
    assert (tmp_path / "t/a").read_bytes() == BODY


def test_a_later_run_goes_on_too_and_nothing_half_is_visible(
    server: Server, tmp_path: Path
) -> None:
    server.cut = [1000] * module.MAX_TRIES
    report = prefetch(
        [CacheFile(server.url("/a"), "t/a"), CacheFile(server.url("/b"), "t/b")],
        tmp_path,
        sleep=Waits(),
    )
    assert list(report.failed) == ["t/a"]
    assert f"({module.MAX_TRIES} tries)" in report.failed["t/a"]
    assert report.fetched == ["t/b"]
    assert not (tmp_path / "t/a").exists()
    server.requests.clear()
    assert prefetch([CacheFile(server.url("/a"), "t/a")], tmp_path).fetched == ["t/a"]
    assert server.requests == [("/a", f"bytes={1000 * module.MAX_TRIES}-")]
    assert (tmp_path / "t/a").read_bytes() == BODY


@pytest.mark.parametrize("etag", ['"2"', 'W/"1"', ""])
def test_a_file_that_changed_meanwhile_starts_over(
    server: Server, tmp_path: Path, etag: str
) -> None:
    server.cut = [1000] * module.MAX_TRIES
    prefetch([CacheFile(server.url("/a"), "t/a")], tmp_path, sleep=Waits())
    server.files["/a"] = BODY[::-1]
    server.etags["/a"] = etag
    prefetch([CacheFile(server.url("/a"), "t/a")], tmp_path)
    assert (tmp_path / "t/a").read_bytes() == BODY[::-1]


def test_a_complete_part_is_used_and_one_that_is_too_long_is_not(
    server: Server, tmp_path: Path
) -> None:
    for length, extra in ((len(BODY), b""), (len(BODY), b"more")):
        cache = tmp_path / f"cache{len(extra)}"
        server.cut = [1000] * module.MAX_TRIES
        prefetch([CacheFile(server.url("/a"), "t/a")], cache, sleep=Waits())
        part = next(path for path in (cache / module.PARTS_FOLDER).iterdir() if not path.suffix)
        part.write_bytes(BODY[:length] + extra)
        assert prefetch([CacheFile(server.url("/a"), "t/a")], cache, sleep=Waits()).fetched == [
            "t/a"
        ]
        assert (cache / "t/a").read_bytes() == BODY


def test_passing_errors_are_tried_again_and_lasting_ones_are_not(
    server: Server, tmp_path: Path
) -> None:
    server.errors = [503, 429]
    waits = Waits()
    files = [
        CacheFile(server.url("/b"), "t/b"),
        CacheFile(server.url("/gone"), "t/c"),
        CacheFile(server.url("/moved"), "t/d"),
    ]
    report = prefetch(files, tmp_path, sleep=waits)
    assert waits == [1, 2]
    assert report.fetched == ["t/b", "t/d"]
    assert report.failed == {"t/c": f"{server.url('/gone')}: the server answers 404"}
    server.errors = [500] * 50
    assert (
        "500"
        in prefetch([CacheFile(server.url("/a"), "t/a")], tmp_path, sleep=Waits()).failed["t/a"]
    )
    assert len(server.errors) == 50 - module.MAX_TRIES


def test_a_dead_server_is_a_failure_not_a_crash(server: Server, tmp_path: Path) -> None:
    url = server.url("/a")
    server.shutdown()
    server.server_close()
    waits = Waits()
    report = prefetch([CacheFile(url, "t/a")], tmp_path, sleep=waits)
    assert set(report.failed) == {"t/a"}
    assert waits == list(module.RETRY_PAUSES_S)


def test_check_finds_what_changed_and_a_run_mends_what_is_gone(
    server: Server, tmp_path: Path
) -> None:
    files = [CacheFile(server.url("/a"), "t/a"), CacheFile(server.url("/b"), "t/b")]
    prefetch(files, tmp_path)
    (tmp_path / "t/b").write_bytes(b"bug")
    (tmp_path / "t/a").unlink()
    wrong = check(tmp_path)
    assert wrong["t/a"] == "missing"
    assert wrong["t/b"].startswith("SHA-256 is ")
    assert prefetch(files, tmp_path).fetched == ["t/a"]
    moved_files = [CacheFile(server.url("/a"), "t/b")]  # another address now
    assert prefetch(moved_files, tmp_path).fetched == ["t/b"]
    assert (tmp_path / "t/b").read_bytes() == BODY


@pytest.mark.parametrize("text", ["{", "[]", '{"a": 1}', '{"a": {"url": "x"}}'])
def test_a_damaged_manifest_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / module.MANIFEST).write_text(text)
    with pytest.raises(ConfigError, match=r"manifest\.json: damaged"):
        read_manifest(tmp_path)


def test_two_at_once_and_a_bad_folder_are_refused(tmp_path: Path) -> None:
    with (tmp_path / module.LOCK).open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        with pytest.raises(HijackError, match="another `hijack osworld prefetch`"):
            prefetch([], tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(HijackError, match="cannot be written"):
        prefetch([], tmp_path / "file")


def task(evaluator: dict[str, Any] | None = None, config: Any = (), id_: str = "t") -> OsworldTask:
    return OsworldTask(
        id_, "os", {"evaluator": evaluator or {"func": "f"}, "config": list(config)}, Path("t.json")
    )


def test_names_are_those_that_osworld_looks_for() -> None:
    download = {
        "type": "download",
        "parameters": {"files": [{"url": "http://h/a b?x", "path": "/home/user/D.txt"}]},
    }
    cloud = {"type": "cloud_file", "path": "http://h/g", "dest": "gold.txt"}
    multi = {
        "type": "cloud_file",
        "multi": True,
        "path": ["http://h/1", "http://h/2"],
        "dest": ["one", "two"],
    }
    evaluator = {
        "func": ["f", "g"],
        "result": [{"type": "vm_file"}, None],
        "expected": [cloud, multi],
    }
    named = f"t/{uuid.uuid5(uuid.NAMESPACE_URL, 'http://h/a b?x')}_D.txt"
    cache_files = list_cache_files(
        task(
            {**evaluator, "postconfig": [download]}, [download, {"type": "sleep", "parameters": {}}]
        )
    )
    assert cache_files == [
        CacheFile("http://h/a b?x", named),
        CacheFile("http://h/g", "t/gold.txt"),
        CacheFile("http://h/1", "t/one"),
        CacheFile("http://h/2", "t/two"),
    ]
    history = {"type": "update_browse_history", "parameters": {}}
    assert list_cache_files(task(config=[history])) == [
        CacheFile(HISTORY_URL, "t/history_new.sqlite")
    ]


@pytest.mark.parametrize(
    ("cloud", "message"),
    [
        ({"path": "file:///etc/passwd", "dest": "x"}, "must start with http"),
        ({"path": 7, "dest": "x"}, "must start with http"),
        (
            {"path": "http://h/x", "dest": "../../x"},
            r"evaluator\.expected: the file's name must stay",
        ),
        ({"path": "http://h/x", "dest": "/etc/x"}, "must stay"),
        ({"path": "http://h/x", "dest": None}, "must stay"),
        ({"path": ["http://h/x"], "dest": ["a", "b"], "multi": True}, "must start"),
    ],
)
def test_bad_addresses_and_names_are_refused(cloud: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        list_cache_files(task({"func": "f", "expected": {"type": "cloud_file", **cloud}}))
    with pytest.raises(ConfigError, match="name of a folder"):
        list_cache_files(task(id_="../t"))


def test_every_task_of_both_revisions_says_what_it_wants(shared_data: Path) -> None:
    for folder, tasks_with_files in (("osworld_verified", 1), ("osworld_fork", 1)):
        tasks = load(shared_data / "tasks" / folder)
        files = {task.id: list_cache_files(task) for task in tasks}
        assert sum(bool(f) for f in files.values()) > 200 * tasks_with_files
        groups = json.loads((shared_data / "tasks" / "feasibility.json").read_text())
        no_files = {
            id_ for name in ("A0_local", "I0_infeasible_nofiles") for _, id_ in groups[name]
        }
        assert [id_ for id_ in sorted(no_files) if files[id_]] == [
            "44ee5668-ecd5-4366-a6ce-c1c9b8d4e938"
        ]


def test_the_command(server: Server, tmp_path: Path) -> None:
    name = "11111111-1111-4111-8111-111111111111"
    body = {
        "id": name,
        "instruction": "x",
        "config": [],
        "evaluator": {
            "func": "f",
            "expected": {"type": "cloud_file", "path": server.url("/b"), "dest": "b"},
        },
    }
    source = tmp_path / "set/examples/os"
    source.mkdir(parents=True)
    (source / f"{name}.json").write_text(json.dumps(body))
    arguments = ["osworld", "prefetch", str(tmp_path / "set"), "--out", str(tmp_path / "cache")]
    listed = CliRunner().invoke(hijack, [*arguments, "--dry-run", "--json"], standalone_mode=False)
    assert json.loads(listed.output) == [{"path": f"{name}/b", "url": server.url("/b")}]
    assert server.requests == []
    result = CliRunner().invoke(hijack, arguments, standalone_mode=False)
    assert (result.return_value, result.output.splitlines()[-1]) == (
        0,
        "1 fetched (0.0 MB), 0 were there, 0 failed",
    )
    assert (tmp_path / "cache" / name / "b").read_bytes() == b"bee"
    assert (
        CliRunner().invoke(hijack, [*arguments, "--verify"], standalone_mode=False).return_value
        == 0
    )
    (tmp_path / "cache" / name / "b").write_bytes(b"boo")
    assert (
        CliRunner().invoke(hijack, [*arguments, "--verify"], standalone_mode=False).return_value
        == 1
    )
    (tmp_path / "cache" / name / "b").unlink()
    del server.files["/b"]
    failed = CliRunner().invoke(hijack, arguments, standalone_mode=False)
    assert failed.return_value == 1
    assert "the server answers 404" in failed.output
