"""Files in and out of a guest, over real HTTP on loopback."""

import json
import os
import stat

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)

from online_env.embedded.guest import user_files as guest_files

from support.guests import at_home, guest_client, said
from support.loopback import served


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("home")
    with at_home(folder):
        yield folder


@pytest.fixture(scope="module")
def guest(home):
    with guest_client() as client:
        yield client


def upload(guest, path, data=b"new"):
    return guest.post("/setup/upload", data={"file_path": str(path)}, files={"file_data": data})


def test_an_upload_keeps_the_mode_of_a_file_and_goes_where_a_link_leads(guest, home):
    secret = home / "keys/secret"
    secret.parent.mkdir()
    secret.write_bytes(b"old")
    secret.chmod(0o600)
    link = home / "link"
    link.symlink_to("keys/secret")
    assert upload(guest, "~/link").text == "File Uploaded: 3 bytes"
    assert link.is_symlink()
    assert secret.read_bytes() == b"new"
    assert stat.S_IMODE(secret.stat().st_mode) == 0o600
    assert upload(guest, "$HOME/keys/deep/er/empty", b"").text == "File Uploaded: 0 bytes"
    value = home / "keys/deep/er/empty"
    assert stat.S_IMODE(value.stat().st_mode) == 0o644
    assert [path.name for path in value.parent.iterdir()] == ["empty"]


def test_an_upload_cannot_take_the_place_of_a_folder_or_lie_below_a_file(guest, home):
    folder = home / "a-folder"
    folder.mkdir()
    (home / "a-file").touch()
    assert said(upload(guest, folder)) == (400, f"{folder} is a folder, not a file")
    below = home / "a-file/below"
    status, message = said(upload(guest, below))
    assert (status, message) in [(404, f"File not found: {below}"), (500, f"{below}: File exists")]
    assert list(folder.iterdir()) == []


def test_a_file_comes_with_its_size_its_kind_and_a_plain_name(guest, home):
    path = home / 'ü "x".html'
    path.write_bytes(b"<p>" * 700_000)  # more than one piece
    answer = guest.post("/file", data={"file_path": str(path)})
    assert answer.content == path.read_bytes()
    assert answer.headers["content-length"] == "2100000"
    assert answer.headers["content-type"].startswith("text/html")
    assert answer.headers["content-disposition"] == "attachment; filename=\"? 'x'.html\""
    os.mkfifo(home / "pipe")
    answer = guest.post("/file", data={"file_path": "~/pipe"})
    assert said(answer) == (400, f"{home}/pipe is not a regular file")


def listed(guest, path):
    return guest.post("/list_directory", json={"path": str(path)}).json()["directory_tree"]


def test_a_folder_with_names_that_are_no_text_is_listed(guest, home):
    folder = home / "latin"
    folder.mkdir()
    (folder / os.fsdecode(b"caf\xe9.txt")).touch()
    (folder / "plain.txt").touch()
    names = {child["name"] for child in listed(guest, folder)["children"]}
    assert names == {os.fsdecode(b"caf\xe9.txt"), "plain.txt"}


def test_a_request_that_names_such_a_file_gets_its_answer(guest):
    def post(route, **fields):
        kind = {"Content-Type": "application/json"}
        return guest.post(route, content=json.dumps(fields).encode(), headers=kind)

    answer = post("/setup/open_file", path="/\udce9")
    assert said(answer) == (404, "Application/file not found: /\udce9")
    script = post("/run_bash_script", script="ls", working_dir="/\udce9")
    expected = "Working directory does not exist: /\udce9"
    assert (script.status_code, script.json()["output"]) == (400, expected)
    launched = post("/setup/launch", command=["true", "\udce9"])
    assert launched.text == "true \ufffd launched successfully"


def test_a_listing_ends_at_links_at_depths_and_at_a_number_of_entries(guest, home, monkeypatch):
    top = home / "listed"
    (top / "one/two/three").mkdir(parents=True)
    (top / "one/up").symlink_to("..")
    (top / "one/dangling").symlink_to("nowhere")
    two = {"type": "directory", "name": "two", "children": []}
    three = {"type": "directory", "name": "three", "children": []}
    up = {"type": "directory", "name": "up", "children": []}
    dangling = {"type": "file", "name": "dangling"}

    def one():
        (value,) = listed(guest, top)["children"]
        return {**value, "children": sorted(value["children"], key=lambda child: child["name"])}

    tree_nodes = [dangling, {**two, "children": [three]}, up]
    assert one() == {"type": "directory", "name": "one", "children": tree_nodes}
    monkeypatch.setattr(guest_files, "MAX_DEPTH", 1)
    assert one()["children"] == [dangling, {**two, "truncated": True}, up]
    monkeypatch.setattr(guest_files, "MAX_ENTRIES", 1)
    assert one() == {"type": "directory", "name": "one", "children": [], "truncated": True}
    wrong = guest.post("/list_directory", json={"path": "/etc/hostname"})
    assert said(wrong) == (400, "The provided path is not a directory")


def test_a_download_that_cannot_be_had_is_told_after_three_tries(guest, home):
    with served(_Refusing()) as url:
        answer = guest.post("/setup/download_file", json={"url": f"{url}/x", "path": "~/got"})
    expected = f"Failed to download {url}/x. No retries left. Error: HTTP Error 418: I'm a Teapot"
    assert said(answer) == (500, expected)
    assert _Refusing.asked == 3
    assert not (home / "got").exists()
    answer = guest.post("/setup/download_file", json={"url": "file:///etc/hosts", "path": "~/got"})
    assert said(answer) == (
        400,
        "a download needs an http or https address, got 'file:///etc/hosts'",
    )


class _Refusing:
    asked = 0

    async def __call__(self, scope, receive, send):
        type(self).asked += 1
        await send({"type": "http.response.start", "status": 418, "headers": []})
        await send({"type": "http.response.body", "body": b""})


def test_the_desktop_folder_is_there_or_is_missed(guest, home):
    assert said(guest.post("/desktop_path")) == (404, f"there is no folder {home}/Desktop")
    (home / "Desktop").mkdir()
    assert guest.post("/desktop_path").json() == {"desktop_path": f"{home}/Desktop"}
