"""The parts of the embedded desktop that need no root and no desktop."""

import asyncio
import ipaddress
import json
import os
import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from hijack_data.errors import ParameterError, UnknownNameError
from online_env.desktop_commands import desktop
from online_env.embedded import default_pictures, desktop_supply, doctor, home, packages
from online_env.embedded.guest import commands, recorder, routes_files
from online_env.embedded.image import sources
from online_env.embedded.runtime import (
    account,
    identity,
    internet,
    network,
    registry,
    root_file_system,
    session,
)
from online_env.embedded.runtime.desktop_config import DesktopConfig, SetupError
from online_env.embedded.runtime.logs import BoundedLogs
from online_env.errors import GuestError
from online_env.record_command import parse_size

from support import needs
from support.registries import own_registry

names = st.text(min_size=0, max_size=30)


@given(st.integers(0, registry.SLOTS - 1), st.integers(0, registry.SLOTS - 1))
def test_every_slot_has_an_address_and_users_of_its_own(slot, other):
    address = ipaddress.ip_address(network.address(slot))
    assert address.is_loopback
    bases = [(identity._FIRST + number) * identity.RANGE for number in (slot, other)]
    assert 2**30 < bases[0] < 2**32 - 2 * identity.RANGE
    if slot != other:
        assert address != ipaddress.ip_address(network.address(other))
        assert abs(bases[0] - bases[1]) >= identity.RANGE


@given(names)
def test_a_name_is_safe_or_refused(name):
    match = registry._NAME.fullmatch(name)
    if match:
        assert set(name) <= set("abcdefghijklmnopqrstuvwxyz0123456789-")
        assert 1 <= len(name) <= 20
        assert not name.startswith("-")
    else:
        with pytest.raises(SetupError, match="must be 1 to 20"):
            registry.claim(name, (1, 1), None, {})


def test_a_desktop_whose_internet_ends_again_and_again_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "RUN", tmp_path)
    monkeypatch.setattr(internet.Internet, "_enter", lambda *_: None)
    (tmp_path / "d1/logs").mkdir(parents=True)
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho no module of ours >&2\n")
    python.chmod(0o755)
    order = DesktopConfig(
        name="d1", screen=(640, 480), layer="", search_path=(), python=str(python)
    )
    logs = BoundedLogs(os.open(tmp_path / "d1/logs", os.O_RDONLY))
    sites = internet.Internet(order, "d1", logs)
    for _ in range(internet.MAX_RESTARTS):
        sites._process.wait()
        sites.serves = True  # as it was before it ended
        sites.look_after(False)
    sites._process.wait()
    sites.serves = True
    with pytest.raises(SetupError, match=r"internet ended 6 times; .*\s*no module of ours"):
        sites.look_after(False)
    sites.close()


class Flaky(BaseHTTPRequestHandler):
    """Cuts its first answer off, talks rubbish then, and at last gives what was asked for."""

    asked = 0

    def do_GET(self):
        type(self).asked += 1
        answers = {1: b"HTTP/1.0 200 OK\r\nContent-Length: 4\r\n\r\nfu", 2: b"rubbish\r\n\r\n"}
        full = b"HTTP/1.0 200 OK\r\nContent-Length: 4\r\n\r\nfull"
        self.wfile.write(answers.get(self.asked, full))
        self.close_connection = True

    def log_message(self, *_):
        pass


@pytest.fixture
def flaky(monkeypatch):
    """The address of a server that answers at the third time."""
    monkeypatch.setattr(sources.time, "sleep", lambda seconds: None)
    monkeypatch.setattr(Flaky, "asked", 0)
    with ThreadingHTTPServer(("127.0.0.1", 0), Flaky) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/file"
        server.shutdown()


def test_what_is_cut_off_or_rubbish_is_fetched_again(flaky, tmp_path):
    assert sources.fetch(flaky) == b"full"
    Flaky.asked = 0
    assert routes_files._download(flaky, str(tmp_path / "file")) == 4
    assert (tmp_path / "file").read_bytes() == b"full"


def test_a_recording_that_does_not_begin_is_told_at_once(tmp_path, monkeypatch):
    """Not when it is over, and everything that was to be seen has passed."""
    monkeypatch.setattr(recorder, "FFMPEG_TIMEOUT_S", 0.5)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    ffmpeg = tmp_path / "ffmpeg"
    ffmpeg.write_text("#!/bin/sh\necho waiting for the screen >&2\nexec sleep 60\n")
    ffmpeg.chmod(0o755)
    result = recorder.Recorder(":0", commands.Runner(str(tmp_path)))
    with pytest.raises(GuestError, match=r"did not begin to write within 0\.5 s: waiting for"):
        asyncio.run(result.start((640, 480)))
    with pytest.raises(GuestError, match="No recording in progress"):
        asyncio.run(result.stop())


def test_a_network_is_never_that_of_another_desktops_internet(tmp_path, monkeypatch):
    monkeypatch.setattr(network, "NETNS", tmp_path)
    for name in ("my", "my-web"):
        for namespace in (network.desktop_namespace(name), network.web_namespace(name)):
            (tmp_path / namespace).touch(exist_ok=False)
    assert network.leftovers({"my", "my-web"}) == []
    assert network.leftovers({"my-web"}) == ["my"]
    network.remove("my")
    assert {path.name for path in tmp_path.iterdir()} == {
        network.desktop_namespace("my-web"),
        network.web_namespace("my-web"),
    }


@given(names, st.integers(1, 99_999))
def test_the_desktops_of_one_order_have_names_that_are_allowed(name, number):
    if not registry._NAME.fullmatch(name):
        name = "a-name-of-18-chars" + "-x"
    result = desktop_supply.numbered_name(name, number)
    assert registry._NAME.fullmatch(result)
    assert result == name if number == 1 else result.endswith(f"-{number}")
    assert desktop_supply.numbered_name(None, number) is None


@given(
    st.integers(200, 8192),
    st.integers(200, 8192),
    st.lists(st.sampled_from(sorted(session.APPS))),
    st.booleans(),
    st.none() | st.tuples(st.integers(1), st.integers(1)),
)
def test_an_order_survives_json(width, height, apps, osworld, controller):
    order = DesktopConfig(
        name=None,
        screen=(width, height),
        layer="/l",
        search_path=("a", "b"),
        python="/p",
        hidden=("k",),
        apps=tuple(apps),
        osworld=osworld,
        controller=controller,
    )
    assert DesktopConfig.from_json(order.to_json()) == order


def test_process_start_tells_processes_apart():
    me = registry.process_start(os.getpid())
    assert me > 0
    assert registry.alive((os.getpid(), me))
    assert not registry.alive((os.getpid(), me - 1))
    assert registry.process_start(2**22 + 5) == 0
    assert not registry.alive(None)


def test_records_come_back_and_broken_ones_are_told(tmp_path, monkeypatch):
    folder = own_registry(tmp_path, monkeypatch)
    keeper = (os.getpid(), registry.process_start(os.getpid()))
    first = registry.claim(None, keeper, None, {"screen": [800, 600]})
    second = registry.claim(None, keeper, (1 << 22, 7), {})
    assert (first["id"], second["id"]) == ("d1", "d2")
    assert first["slot"] != second["slot"]
    assert registry.load("d1") == first
    (folder / "broken").mkdir()
    (folder / "broken" / registry.RECORD).write_text("{")
    states = {record["id"]: registry.state(record) for record in registry.records()}
    # the controller of d2 is gone
    assert states == {"d1": "starting", "d2": "orphan", "broken": "orphan"}
    with pytest.raises(SetupError, match="there already"):
        registry.claim("broken", keeper, None, {})


def test_profiles_hold_each_other():
    core = packages.packages(["core"])
    assert packages.packages([]) == core
    assert set(core) < set(packages.packages(["web"])) < set(packages.packages(["all"]))
    assert len(set(packages.packages(["all"]))) == len(packages.packages(["all"]))
    with pytest.raises(UnknownNameError, match="did you mean 'office'"):
        packages.packages(["offce"])


def test_missing_names_only_what_is_missing():
    if needs.absent(["dpkg-query"]):
        needs.skip("no dpkg on this machine", "run it on Debian or Ubuntu")
    assert packages.missing(["dpkg", "agenthijack-no-such-package"]) == [
        "agenthijack-no-such-package"
    ]


def test_account_replaces_an_old_entry(tmp_path):
    etc = tmp_path / "etc"
    (etc / "sudoers.d").mkdir(parents=True)
    for name in ("passwd", "shadow", "group"):
        (etc / name).write_text(
            "root:x:0:0::/root:/bin/sh\nuser:x:1000:1000::/home/other:/bin/sh\nuser2:x:1::::\n"
        )
    account.write_account(tmp_path, passwordless_sudo=False)
    rows = (etc / "passwd").read_text().splitlines()
    assert [row.split(":")[0] for row in rows] == ["root", "user2", "user"]
    assert rows[-1].split(":")[2:6] == [str(account.UID), str(account.UID), "User", "/home/user"]
    assert "NOPASSWD" not in (etc / "sudoers.d/user").read_text()
    account.write_account(tmp_path, passwordless_sudo=True)
    assert "NOPASSWD" in (etc / "sudoers.d/user").read_text()
    assert len((etc / "passwd").read_text().splitlines()) == 3


def test_pictures_are_the_same_every_time():
    first, second = default_pictures.wallpaper(), default_pictures.wallpaper()
    assert first.size == (1920, 1080)
    assert first.tobytes() == second.tobytes()
    locked = default_pictures.lock_picture(first)
    assert np.asarray(locked).mean() < 0.7 * np.asarray(first).mean()
    assert default_pictures.face().size == (192, 192)


def test_without_chromium_no_command_starts_it(tmp_path, monkeypatch):
    """Else an application that must come beside the task's is waited for in vain, and nothing is in
    its place."""
    root_file_system.install_guest_files(tmp_path)
    commands = tmp_path / root_file_system.LOCAL_BIN / "bin"
    remaining = {"python", "python3", "show-desktop", "xdg-open"}
    assert {path.name for path in commands.iterdir()} == {"google-chrome", *remaining}
    monkeypatch.setattr(root_file_system, "CHROMIUM", Path("usr/lib/no-such-browser"))
    root_file_system.name_browser(tmp_path)
    assert {path.name for path in commands.iterdir()} == remaining


def test_golden_home_parses():
    from xml.etree import ElementTree

    files = sorted((home.SOURCES / "home").rglob("*"))
    channels = [path for path in files if path.suffix == ".xml"]
    assert len(channels) >= 6
    for path in channels:
        assert ElementTree.parse(path).getroot().get("name") == path.stem
    json.loads((home.SOURCES / "home/.config/google-chrome/Default/Preferences").read_text())


def test_layer_is_named_after_what_it_is_made_of(tmp_path, monkeypatch):
    before = home.layer_path()
    assert before == home.layer_path()
    extra = home.SOURCES / "home" / ".profile"
    monkeypatch.setattr(home, "_sources", lambda: iter([extra]))
    assert home.layer_path() != before


def test_doctor_says_how_to_mend(monkeypatch):
    monkeypatch.setattr(packages, "missing", lambda names: ["xvfb"] if "xvfb" in names else [])
    monkeypatch.setattr(doctor, "_kernel", lambda: doctor.Finding("namespaces", True, "fine"))
    entries = {check.name: check for check in doctor.diagnose(["web"])}
    assert not entries["packages core"].ok
    assert entries["packages core"].fix == "hijack desktop install --profile core"
    assert "xvfb" in entries["packages core"].detail
    assert entries["packages web"].ok
    assert not entries["packages media"].required
    result = CliRunner().invoke(desktop, ["doctor"])
    assert result.exit_code == 1
    assert "mend it with: hijack desktop install --profile core" in result.output


def test_doctor_json(monkeypatch):
    items = [doctor.Finding("a", False, "b", "c", required=False)]
    monkeypatch.setattr(doctor, "diagnose", lambda profiles, image: items)
    result = CliRunner().invoke(desktop, ["doctor", "--json"])
    assert result.exit_code == 0
    assert json.loads(result.output) == [
        {"name": "a", "ok": False, "detail": "b", "fix": "c", "required": False}
    ]


@given(st.text(max_size=24))
def test_any_size_text_is_parsed_or_refused(text):
    if re.fullmatch(r"[0-9]+[xX][0-9]+", text):
        height, width = parse_size(text)
        assert [width, height] == [int(part) for part in text.lower().split("x")]
    else:
        with pytest.raises(ParameterError, match="WIDTHxHEIGHT"):
            parse_size(text)


def test_size_is_width_first():
    assert parse_size("1920x1080") == (1080, 1920)
