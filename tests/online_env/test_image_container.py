"""An image for container engines: what is in it, and process 1 of such a container, part by part."""

import hashlib
import io
import json
import os
import select
import socket
import subprocess
import sys
import tarfile
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from online_env.desktops.capability_survey import is_container, lacks
from online_env.desktops.container import ContainerResetter
from online_env.desktops.protocol import RunResult
from online_env.embedded.container import entry, pristine
from online_env.embedded.container.control import Control
from online_env.embedded.image import cache, container
from online_env.errors import DesktopError, DesktopImageError, GuestError

from support import images

# Loads process 1 from the code of a container, with the other packages of this environment.
LOAD = (
    "import sys; sys.path[:0] = sys.argv[1:]; from online_env.embedded.container import entry;"
    " entry._load(); print({m.__file__ for n, m in sys.modules.items() if n.startswith('online_')})"
)


@pytest.fixture
def image(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "images"))
    return images.publish()


@pytest.fixture
def packed(image, tmp_path):
    path = tmp_path / "desktop.tar"
    assert container.write(image, path) == "agenthijack-desktop:core"
    return path


def layers(path):
    """The layers of an image for containers."""
    with tarfile.open(path) as tar:
        (about,) = json.load(tar.extractfile("manifest.json"))
        return [
            tarfile.open(fileobj=io.BytesIO(tar.extractfile(name).read()))
            for name in about["Layers"]
        ]


def test_engines_find_what_they_check(packed):
    with tarfile.open(packed) as tar:
        (about,) = json.load(tar.extractfile("manifest.json"))
        config = tar.extractfile(about["Config"]).read()
        assert about["RepoTags"] == ["agenthijack-desktop:core"]
        assert about["Config"] == f"{hashlib.sha256(config).hexdigest()}.json"
        digests = [
            f"sha256:{hashlib.sha256(tar.extractfile(name).read()).hexdigest()}"
            for name in about["Layers"]
        ]
    data = json.loads(config)
    assert data["rootfs"]["diff_ids"] == digests
    assert set(data["config"]["ExposedPorts"]) == {"5000/tcp", "5001/tcp"}
    assert "TOKEN" not in config.decode()


def test_the_layers_are_the_system_and_what_a_desktop_needs(packed):
    system, desktop = layers(packed)
    sudo = system.getmember("usr/bin/sudo")
    assert (sudo.mode, sudo.uid) == (0o4755, 0)
    names = set(desktop.getnames())
    server = "usr/local/lib/desktop-server"
    assert desktop.getmember(server).mode == 0o700
    assert f"{server}/code/online_env/embedded/container/entry.py" in names
    assert f"{server}/layer/home/Desktop" in names
    assert "user:x:47077" in desktop.extractfile("etc/passwd").read().decode()
    assert not names & {"etc/hosts", "etc/resolv.conf", "etc/hostname"}
    # nothing that tells how agents are judged
    for part in ("tasks", "bench", "scoring", "agents"):
        assert not [name for name in names if f"online_env/{part}" in name], part


def test_the_code_in_it_is_all_that_is_needed(packed, tmp_path):
    layers(packed)[1].extractall(tmp_path / "layer", filter="data")
    code = tmp_path / "layer/usr/local/lib/desktop-server/code"
    matches = [path for path in sys.path if path.endswith("-packages")]
    process = subprocess.run(
        [sys.executable, "-I", "-S", "-c", LOAD, str(code), *matches],
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    assert all(path.startswith(str(code)) for path in eval(process.stdout))


def test_the_same_image_is_the_same_file(packed, image, tmp_path):
    container.write(image, tmp_path / "again.tar")
    assert (tmp_path / "again.tar").read_bytes() == packed.read_bytes()


def test_a_changed_image_is_refused(image, tmp_path):
    (image / "root/etc/words").write_text("HELLO")
    with pytest.raises(DesktopImageError, match="etc/words: is not as the image's manifest says"):
        container.write(image, tmp_path / "desktop.tar")
    assert not (tmp_path / "desktop.tar").exists()


def test_elsewhere_than_in_a_container_it_ends_nothing(capsys):
    """It ends all processes that it sees: those of the machine, were it not process 1."""
    assert entry.main([]) == 2
    assert "must be process 1" in capsys.readouterr().err


@pytest.fixture
def control():
    def look(_, descriptors):
        return set(select.select(descriptors, [], [], 0.1)[0])

    result = Control(0, "secret")
    thread = threading.Thread(target=result.wait, args=(look,), daemon=True)
    thread.start()
    yield result, f"http://127.0.0.1:{result._server.server_port}", thread
    with socket.socket() as anything:
        result._server.asked = anything  # so that it waits no more
        thread.join(10)
    result._server.server_close()


def test_a_reset_is_answered_when_it_is_done(control):
    value, url, thread = control
    items = []

    def ask():
        try:
            ContainerResetter(url, "secret")()
        except DesktopError as error:
            items.append(str(error))

    asking = threading.Thread(target=ask)
    asking.start()
    thread.join(10)
    time.sleep(0.1)
    assert asking.is_alive()  # not before the session is there
    value.answer({"error": "changed /usr"})
    asking.join(10)
    assert items == ["changed /usr"]


def test_who_has_no_token_resets_nothing(control):
    _, url, thread = control
    for token in ("wrong", ""):
        with pytest.raises(GuestError, match="401"):
            ContainerResetter(url, token)()
    assert thread.is_alive()


def test_a_container_that_is_gone_is_named():
    with pytest.raises(GuestError, match=r"127.0.0.1:9/reset: no reset .*does the container run"):
        ContainerResetter("127.0.0.1:9", "x")()


@pytest.fixture
def answering():
    """Servers that give one answer, and what each was asked."""
    servers = []

    def make(status, headers, body):
        requests = []

        class Answer(BaseHTTPRequestHandler):
            def do_POST(self):
                requests.append((self.path, self.headers.get("X-Token")))
                self.send_response(status)
                for name, value in headers.items():
                    self.send_header(name, value)
                self.end_headers()
                self.wfile.write(body)

            do_GET = do_POST

            def log_message(self, *_):
                pass

        servers.append(ThreadingHTTPServer(("127.0.0.1", 0), Answer))
        threading.Thread(target=servers[-1].serve_forever).start()
        return f"http://127.0.0.1:{servers[-1].server_port}", requests

    yield make
    for server in servers:
        server.shutdown()
        server.server_close()


def test_the_token_of_a_container_goes_to_the_container_alone(answering, monkeypatch):
    proxy, by_proxy = answering(200, {}, b"{}")
    elsewhere, at_other = answering(200, {}, b"{}")
    value, requests = answering(302, {"Location": f"{elsewhere}/reset"}, b"")
    monkeypatch.setenv("http_proxy", proxy)
    monkeypatch.setenv("no_proxy", "")
    with pytest.raises(GuestError, match="302"):
        ContainerResetter(value, "secret")()
    assert requests == [("/reset", "secret")]
    assert (by_proxy, at_other) == ([], [])


def test_an_encrypted_address_stays_encrypted(answering):
    value, requests = answering(200, {}, b"{}")
    with pytest.raises(GuestError, match=r"https://.*no reset"):
        ContainerResetter(value.replace("http:", "https:"), "secret")()
    assert requests == []


@pytest.mark.parametrize(
    "url", ["ftp://box:5001", "http://", "", "box:port", "http://[::1", "box:5001/desktop"]
)
def test_what_is_no_address_of_a_container_is_refused(url):
    with pytest.raises(GuestError, match="is not the address of a container"):
        ContainerResetter(url, "secret")


def test_an_address_of_six_groups_keeps_its_brackets():
    with socket.create_server(("::1", 0), family=socket.AF_INET6) as listener:
        url = f"http://[::1]:{listener.getsockname()[1]}"
    with pytest.raises(GuestError, match=r"\[::1\]:\d+/reset: no reset .*[Rr]efused"):
        ContainerResetter(url, "secret")()


def test_a_failure_in_words_of_its_own_is_passed_on(answering):
    url, _ = answering(500, {}, b"something else than JSON")
    with pytest.raises(DesktopError, match="something else than JSON"):
        ContainerResetter(url, "secret")()


def test_what_root_has_changed_is_found(tmp_path):
    (tmp_path / "usr/share").mkdir(parents=True)
    (tmp_path / "usr/share/old").write_text("x")
    time.sleep(0.02)
    since = time.time_ns()
    assert list(pristine._changed_paths(str(tmp_path), frozenset(), since)) == []
    time.sleep(0.02)
    os.utime(tmp_path / "usr/share/old", (1, 1))  # no times that a program sets hide it
    items = list(pristine._changed_paths(str(tmp_path), frozenset(), since))
    assert items == [str(tmp_path / "usr/share/old")]
    (tmp_path / "usr/share/old").unlink()
    items = list(pristine._changed_paths(str(tmp_path), frozenset(), since))
    assert items == [str(tmp_path / "usr/share")]


def test_what_the_engine_mounts_is_not_looked_at(tmp_path):
    mounts = tmp_path / "mountinfo"
    mounts.write_text("1 2 0:3 / / rw - overlay x y\n3 1 8:1 /h /etc/a\\040b rw - ext4 x y\n")
    assert pristine.mount_points(mounts) == {"/", "/etc/a b"}
    (tmp_path / "hosts").touch()
    assert list(
        pristine._changed_paths(str(tmp_path), frozenset({str(tmp_path / "hosts")}), 0)
    ) == [str(mounts)]


def test_a_link_in_the_place_of_a_folder_is_not_followed(tmp_path):
    folder = tmp_path / "kept"
    folder.mkdir()
    (folder / "file").touch()
    (tmp_path / "tmp").symlink_to(folder)
    pristine._empty(tmp_path / "tmp")
    assert (folder / "file").exists()
    assert not (tmp_path / "tmp").is_symlink()
    pristine._empty(folder)
    assert list(Path(folder).iterdir()) == []


def test_the_flag_that_grants_it_is_named_in_a_container():
    class Guest:
        capabilities = frozenset({"files"})
        is_container = True

    assert lacks(Guest(), ["firewall"]).endswith("start its container with --cap-add NET_ADMIN")
    assert "container" not in lacks(Guest(), ["lock"])
    Guest.is_container = False
    why = lacks(Guest(), ["firewall", "lock"])
    assert why.startswith("which this desktop lacks (available: files); for firewall, sudo must")
    assert "for lock, one of these lockers must run" in why
    for code in (0, 1):
        run_result = RunResult("success", returncode=code)
        assert is_container(lambda argv, time, run_result=run_result: run_result) is (code == 0)
