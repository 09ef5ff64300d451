"""The parts that keep a desktop apart, one by one; `test_redteam` tries them together."""

import os
import socket
import stat
import struct
from pathlib import Path
from types import SimpleNamespace

import pytest

from hijack_data.extras import DISTRIBUTION
from online_env.embedded.desktop_supply import DesktopSupply
from online_env.embedded.runtime import forward, hidden_folders, limits, root_file_system, seccomp
from online_env.embedded.runtime.desktop_config import DesktopConfig
from online_env.embedded.runtime.identity import Identity

ORDER = DesktopConfig(
    name=None,
    screen=(800, 600),
    layer="/layer",
    search_path=(),
    python="/python",
    memory=3 << 20,
    storage=1 << 20,
    processes=7,
)


@pytest.fixture
def groups(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "GROUPS", tmp_path)
    return tmp_path


def settings(folder):
    """What was written into a control group."""
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_control_groups_of_version_2(groups):
    (groups / "cgroup.controllers").write_text("cpu memory pids")
    assert limits.join_groups("x", ORDER) == ["processes", "memory"]
    me = str(os.getpid())
    assert settings(groups / "agenthijack-x") == {
        "pids.max": "7",
        "memory.max": str(4 << 20),
        "cgroup.procs": me,
    }


def test_control_groups_of_version_1(groups):
    for kind in ("pids", "memory"):
        (groups / kind).mkdir()
        (groups / kind / "tasks").touch()
    assert limits.join_groups("x", ORDER) == ["processes", "memory"]
    me = str(os.getpid())
    assert settings(groups / "pids/agenthijack-x") == {"pids.max": "7", "cgroup.procs": me}
    of_memory = {"memory.limit_in_bytes": str(4 << 20), "cgroup.procs": me}
    assert settings(groups / "memory/agenthijack-x") == of_memory


def test_a_limit_that_cannot_be_set_is_told(groups, capsys):
    (groups / "cgroup.controllers").write_text("memory pids")
    (groups / "agenthijack-x").mkdir()
    (groups / "agenthijack-x/memory.max").mkdir()  # cannot be written
    assert limits.join_groups("x", ORDER) == ["processes"]
    assert "no limit for the desktop's memory" in capsys.readouterr().err


def test_without_control_groups_nothing_is_said_to_be_limited(groups):
    assert limits.join_groups("x", ORDER) == []


def paths_of(monkeypatch, place, prefix="/usr"):
    """What is hidden where our packages lie in `place`."""
    spec = SimpleNamespace(submodule_search_locations=[])
    monkeypatch.setattr(
        hidden_folders.importlib.util,
        "find_spec",
        lambda name: (
            SimpleNamespace(submodule_search_locations=[f"{place}/{name}"]) if name else spec
        ),
    )
    monkeypatch.setattr(hidden_folders.sys, "prefix", prefix)
    monkeypatch.setattr(hidden_folders.sys, "base_prefix", "/usr")
    return set(hidden_folders.hidden())


def test_packages_of_a_wheel_are_hidden_and_their_neighbours_are_not(monkeypatch):
    folder = "/usr/local/lib/python3/dist-packages"
    record, command = Path(folder, "x.dist-info/RECORD"), Path(folder, "../bin/hijack")
    files_of = [
        SimpleNamespace(parts=("x.dist-info", "RECORD"), locate=lambda: record),
        SimpleNamespace(parts=("..", "bin", "hijack"), locate=lambda: command),
    ]
    simple_namespace = SimpleNamespace(files=files_of)
    monkeypatch.setattr(
        hidden_folders.importlib.metadata, "distribution", {DISTRIBUTION: simple_namespace}.get
    )
    hidden = paths_of(monkeypatch, folder)
    assert {f"{folder}/{name}" for name in hidden_folders.PACKAGES} <= hidden
    assert {f"{folder}/x.dist-info", "/usr/local/lib/python3/bin/hijack"} <= hidden
    assert folder not in hidden


def test_a_clone_and_an_environment_are_hidden_whole(monkeypatch, tmp_path):
    (tmp_path / "pyproject.toml").touch()
    hidden = paths_of(monkeypatch, tmp_path, prefix="/opt/environment")
    assert {str(tmp_path), "/opt/environment"} <= hidden


def test_a_spare_that_shows_too_much_is_not_used(monkeypatch, tmp_path):
    monkeypatch.setattr(hidden_folders, "_hidden_by_caller", {})
    closed_files = []
    spare = SimpleNamespace(
        wait=dict,
        ended=lambda: None,
        order=SimpleNamespace(hidden=hidden_folders.hidden()),
        close=lambda: closed_files.append(True),
    )
    supply = DesktopSupply(ORDER)
    assert supply._fit(spare) is spare
    hidden_folders.hide(tmp_path / "run")
    assert supply._fit(spare) is None
    assert closed_files == [True]


def test_what_is_hidden_is_marked_as_removed(tmp_path):
    missing = Path("/var/lib/no-such-folder-of-ours/deep/below")
    root_file_system.hide(Path("/var/lib/dpkg"), tmp_path)
    root_file_system.hide(missing, tmp_path)
    root_file_system.hide(Path("/var/lib/dpkg/info"), tmp_path)  # what is above it is gone
    for folder in ("var/lib/dpkg", "var/lib/no-such-folder-of-ours"):
        result = (tmp_path / folder).lstat()
        assert stat.S_ISCHR(result.st_mode)
        assert result.st_rdev == 0
    # a whole system folder, and what is out of sight
    for folder in ("/usr", "/root/x", "/", "/tmp/x/y"):
        root_file_system.hide(Path(folder), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["var"]


def test_only_a_connection_that_its_owner_holds_is_let_in():
    owners = forward.Owners()
    with forward.listen("127.0.0.1") as listener:
        address = listener.getsockname()
        client = socket.create_connection(address)
        line, _ = listener.accept()
        assert owners.allow(line)
        owners._allowed = {1 << 31}
        assert not owners.allow(line)
        owners._allowed = {0, os.geteuid()}
        client.close()
        assert not owners.allow(line)  # the kernel says root's of what nobody holds any more
        line.close()
        with socket.socket(socket.AF_INET6) as second:  # as an IPv4 address within IPv6
            second.connect((f"::ffff:{address[0]}", address[1]))
            line, _ = listener.accept()
            assert owners.allow(line)
            line.close()


def run(program, architecture, number, argument=0):
    """What a filter answers to a system call: the kernel's own rules, in a few lines."""
    data = struct.pack("iIQ6Q", number, architecture, 0, argument, 0, 0, 0, 0, 0)
    steps = list(struct.iter_unpack("HBBI", program))
    at = accumulator = 0
    while True:
        code, if_true, if_false, operand = steps[at]
        at += 1
        if code == seccomp._RETURN:
            return operand
        if code == seccomp._LOAD:
            accumulator = struct.unpack_from("I", data, operand)[0]
        else:
            holds = accumulator == operand if code == seccomp._EQUAL else accumulator >= operand
            at += if_true if holds else if_false


@pytest.mark.parametrize("machine", sorted(seccomp._CALLS))
def test_the_filter_refuses_what_it_names_and_nothing_else(machine):
    program = seccomp.program(machine)
    architecture, socket_call, calls = seccomp._CALLS[machine]
    for number in range(500):
        answer = run(program, architecture, number, socket.AF_UNIX)
        assert (answer == seccomp._ALLOW) == (number not in calls.values()), number
    for family in range(50):
        answer = run(program, architecture, socket_call, family)
        assert (answer == seccomp._ALLOW) == (family not in seccomp._FAMILIES.values()), family
    assert run(program, 0x40000003, 20) != seccomp._ALLOW  # 32-bit code
    assert run(program, architecture, seccomp._X32 + 20) != seccomp._ALLOW


def test_without_root_nothing_is_given_away(tmp_path):
    (tmp_path / "x").touch()
    Identity(-1, 0, True).chown(tmp_path / "x", 5)
    assert (tmp_path / "x").stat().st_uid == os.geteuid()
    assert Identity(-1, 0, True).owner() == ""
    assert Identity(-1, 65536, False).owner(3) == ",uid=65539,gid=65539"
