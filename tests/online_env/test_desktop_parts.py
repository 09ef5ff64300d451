"""What a desktop is made of on the machine: network, processes, limits, golden homes."""

import contextlib
import itertools
import os
import socket
import subprocess
import threading
import time
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("Xlib", reason=needs.ONLINE)

from Xlib import xauth

from online_env.embedded import doctor, home
from online_env.embedded.runtime import (
    guest_spawner,
    health,
    init,
    internet,
    kernel,
    limits,
    logs,
    network,
    registry,
)
from online_env.embedded.runtime.desktop_config import DesktopConfig, SetupError
from online_env.embedded.runtime.logs import BoundedLogs

from support.waiting import until


@pytest.fixture(autouse=True)
def run(tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "RUN", tmp_path / "run")
    (tmp_path / "run/d1/logs").mkdir(parents=True)
    return tmp_path / "run"


def order(**more):
    return DesktopConfig(name="d1", screen=(8, 4), layer="", search_path=(), python="", **more)


# The network and the local internet


@pytest.fixture
def ip(tmp_path, monkeypatch):
    """An `ip` that writes down what it is asked, and fails where `broken` is in it."""
    message = tmp_path / "told"
    program = tmp_path / "ip"
    program.write_text(
        f'#!/bin/sh\nread -r all\n(printf "%s\\n" "$*" "$all"; cat) >> {message}\n'
        'case "$*$all" in *broken*) echo "RTNETLINK: no" >&2; exit 2;; esac\n'
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    return message


def test_a_desktop_gets_a_cable_to_its_internet_and_to_nothing_else(ip):
    network.create("d1")
    assert ip.read_text().splitlines() == [
        "-batch -",
        "netns add ah-d1",
        "netns add ah-d1.web",
        "-n ah-d1 -batch -",
        "link set lo up",
        "link add eth0 type veth peer name web0 netns ah-d1.web",
        "addr add 10.77.0.2/24 dev eth0",
        "link set eth0 up",
        "route add default via 10.77.0.1",
        "-n ah-d1.web -batch -",
        "link set lo up",
        "addr add 10.77.0.1/24 dev web0",
        "link set web0 up",
        "route add unreachable default",
    ]


def test_a_network_that_is_refused_is_told_in_the_words_of_ip(ip, tmp_path):
    with pytest.raises(SetupError) as error:
        network.create("broken")
    assert str(error.value) == f"`{tmp_path}/ip -batch -` failed (2): RTNETLINK: no"


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("echo '{\"http\": 80}'; cat", None),
        ("echo '{}'", "the local internet does not serve; the end of sites.log: (empty)"),
        ("echo no port >&2", "the local internet does not serve; the end of sites.log: no port"),
        ("exec sleep 60", "the local internet does not serve; the end of sites.log: (empty)"),
    ],
)
def test_a_local_internet_that_does_not_serve_is_told(tmp_path, monkeypatch, script, message):
    monkeypatch.setattr(internet.Internet, "_enter", lambda self, keeper: None)
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\n{script}\n")
    python.chmod(0o755)
    patience = 0.1 if "sleep" in script else 60.0
    desktop_config = DesktopConfig(
        name="d1", screen=(8, 4), layer="", search_path=(), python=str(python), time_out=patience
    )
    logs = BoundedLogs(os.open(registry.folder("d1") / "logs", os.O_RDONLY))
    sites = internet.Internet(desktop_config, "d1", logs)

    def start():
        while not sites.serves:
            sites.look_after(bool(logs.wait(1.0, (sites.reports,))))

    try:
        if message is None:
            start()
            return
        with pytest.raises(SetupError) as error:
            start()
        assert str(error.value) == message
    finally:
        sites.close()
        logs.close()
    assert sites._process.returncode is not None


# Processes


def test_clients_of_both_kinds_find_the_password_of_the_display(tmp_path):
    """python-xlib looks for the name of this host, libX11 for any."""
    path = tmp_path / "authority"
    path.write_bytes(init._authority_entries())
    entries = xauth.Xauthority(str(path)).entries
    assert [entry[0] for entry in entries] == [256, 65535]
    assert entries[0][1:4] == (os.uname().nodename.encode(), b"0", b"MIT-MAGIC-COOKIE-1")
    assert entries[1][1:3] == (b"", b"")
    assert len({entry[4] for entry in entries}) == 1
    assert len(entries[0][4]) == 16
    assert init._authority_entries() != path.read_bytes()


def in_child(act):
    """What `act` returns in a fork of this process, as words; it may keep descriptor 1."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.dup2(writer, 1)
        os.write(1, " ".join(map(str, act())).encode())
        os._exit(0)
    os.close(writer)
    with open(reader, encoding="ascii") as file:
        text = file.read()
    os.waitpid(child, 0)
    return text.split()


@pytest.mark.parametrize("kept", [{0, 1, 2}, {1, 7}, {0, 1, 2, 3, 9}])
def test_a_guest_server_starts_with_the_descriptors_it_was_given_only(kept):
    def left():
        for number in range(12):
            os.dup2(1, number)
        guest_spawner.close_others(set(kept))
        names = os.listdir("/proc/self/fd")
        return [name for name in names if os.path.exists(f"/proc/self/fd/{name}")]

    assert set(map(int, in_child(left))) == kept


def test_a_process_that_is_renamed_shows_nothing_of_its_command():
    def shown():
        kernel.set_process_name("a-name-of-20-letters")
        line = Path("/proc/self/cmdline").read_bytes().strip(b"\0").decode()
        return line, Path("/proc/self/comm").read_text()

    assert in_child(shown) == ["a-name-of-20-letters", "a-name-of-20-le"]


def test_another_kind_of_machine_is_named(monkeypatch):
    monkeypatch.setattr(kernel.os, "uname", lambda: type("Uname", (), {"machine": "riscv64"}))
    with pytest.raises(OSError) as error:
        kernel.pivot_root()
    assert str(error.value) == "no embedded desktops on riscv64: only on x86_64 and aarch64"


@pytest.fixture
def first_process(run):
    folder = os.open(run / "d1/logs", os.O_RDONLY)
    first = init.Init(order(time_out=0.05), run / "d1", "token", None, None, folder)
    yield first
    first.logs.close()


def test_what_does_not_come_in_time_is_told_with_the_end_of_its_log(first_process, run):
    reader, writer = os.pipe()
    with pytest.raises(SetupError, match=r"in vain for Xvfb to answer; the end of .* \(empty\)$"):
        first_process._read(reader, "Xvfb", "Xvfb to answer")
    os.write(first_process.logs.writer("Xvfb"), b"x" * 900 + b" \x1b[2Jno screens\x07 found\n")
    with pytest.raises(SetupError) as error:
        first_process._read(reader, "Xvfb", "Xvfb to answer")
    end = ("x" * 900 + " ?[2Jno screens? found\n")[-800:].strip()
    assert str(error.value).endswith(f"for Xvfb to answer; the end of Xvfb.log: {end}")
    os.write(writer, b"part ")
    os.write(writer, b"of it\n")
    first_process.deadline = time.monotonic() + 60
    assert first_process._read(reader, "Xvfb", "") == "part of it\n"
    for descriptor in (reader, writer):
        os.close(descriptor)


def test_a_log_keeps_the_end_of_what_never_ends(run):
    """A program inside writes to a pipe, whatever it writes; the machine keeps 16 MiB at most."""
    bounded_logs = BoundedLogs(os.open(run / "d1/logs", os.O_RDONLY))
    loud = subprocess.Popen(
        ["sh", "-c", "yes 'a line' | head -n 5000000; echo the last"],
        stdout=bounded_logs.writer("loud"),
    )
    file = run / "d1/logs/loud.log"
    sizes = []
    while loud.poll() is None:
        bounded_logs.wait(0.1)
        sizes.append(file.stat().st_size)
    assert bounded_logs.tail("loud").endswith("a line\nthe last")
    assert 0 < max(sizes) <= logs.MAX_LOG_BYTES
    assert file.read_text().endswith("a line\nthe last\n")
    assert file.read_bytes().startswith(logs.NOTE)
    for number in range(logs.MAX_LOGS - 1):
        bounded_logs.writer(str(number))
    with pytest.raises(OSError, match="no room for the log of more"):
        bounded_logs.writer("more")
    assert logs.MAX_LOGS * logs.MAX_LOG_BYTES <= 16 << 20
    assert bounded_logs.wait(0.0) == set()
    bounded_logs.close()


def test_a_guest_server_that_does_not_answer_is_noticed(tmp_path, monkeypatch):
    """It was stopped, or has no descriptors left; a machine that slept is no reason."""
    door = tmp_path / "door"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(door))
        listener.listen(8)
        clock = itertools.count(100.0, 4.0)
        monkeypatch.setattr(health.time, "monotonic", lambda: next(clock))
        answering = health.GuestHealth(str(door))
        for _ in range(12):
            assert not answering.is_stuck()
            with contextlib.suppress(BlockingIOError):
                listener.setblocking(False)
                caller, _ = listener.accept()
                assert caller.recv(4096).startswith(b"GET /ah/health")
                caller.send(b"HTTP/1.1 401\r\n\r\n")
                caller.close()
        stuck = health.GuestHealth(str(door))
        looks = [stuck.is_stuck() for _ in range(15)]
        assert looks.index(True) * 4 <= 60
        # A machine that nobody looks after for 8 s at a time knows nothing.
        slept = health.GuestHealth(str(door))
        for _ in range(30):
            next(clock)
            assert not slept.is_stuck()
        for item in (answering, stuck, slept):
            item.close()
    health_check = health.GuestHealth(str(tmp_path / "nothing"))
    assert any(health_check.is_stuck() for _ in range(15))
    health_check.close()


def test_a_program_that_ends_again_and_again_is_given_up(first_process, monkeypatch):
    monkeypatch.setattr(init.time, "sleep", lambda seconds: None)
    started = []
    monkeypatch.setattr(first_process, "start", lambda name, argv: started.append(argv))
    first_process.commands["xfwm4"] = ("xfwm4",)
    for _ in range(init.MAX_RESTARTS):
        first_process.running[5] = "xfwm4"
        first_process._handle_exit(5, 9)
    assert started == [("xfwm4",)] * init.MAX_RESTARTS
    first_process.running[5] = "xfwm4"
    with pytest.raises(SetupError, match=r"^xfwm4 ended 9 times within 60 s \(signal 9\); the end"):
        first_process._handle_exit(5, 9)
    first_process.deaths["xfwm4"] = [time.monotonic() - init.RESTART_WINDOW_S - 1] * 20
    first_process.running[5] = "xfwm4"
    first_process._handle_exit(5, 256)  # what was long ago does not count
    first_process._handle_exit(77, 0)  # a grandchild
    first_process.running[6] = "Xvfb"
    with pytest.raises(SetupError, match=r"^Xvfb ended \(exit code 1\), and with it the desktop"):
        first_process._handle_exit(6, 256)


# What the doctor finds


def test_the_doctor_says_what_nothing_limits(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "GROUPS", tmp_path)
    nothing = doctor._limits()
    assert (nothing.ok, nothing.required) == (False, False)
    assert nothing.detail == "nothing limits the processes and the memory of a desktop as a whole"
    (tmp_path / "cgroup.controllers").write_text("cpu pids\n")
    assert doctor._limits().detail == (
        "control groups limit the processes of a desktop;"
        " nothing limits the memory of a desktop as a whole"
    )
    (tmp_path / "cgroup.controllers").write_text("memory pids\n")
    assert doctor._limits().ok
    assert doctor._limits().detail == (
        "control groups limit the processes and the memory of a desktop"
    )


def test_a_probe_that_hangs_is_a_finding(monkeypatch):
    monkeypatch.setattr(doctor, "_PROBE_TIMEOUT_S", 0.05)
    for name in ("_PROBE", "_ROOTLESS_PROBE", "_SHIFT_PROBE"):
        monkeypatch.setattr(doctor, name, "import time; time.sleep(60)")
    monkeypatch.setattr(doctor.os, "geteuid", lambda: 0)
    for item in (doctor._kernel(), doctor._users()):
        assert (item.ok, item.detail) == (False, "the probe did not end within 0.05 s")


def test_old_golden_homes_go_and_the_present_one_stays(tmp_path):
    present = home.layer_path(tmp_path)
    for name in (present.name, "layer-0123", "building-x", "images"):
        (tmp_path / name / "home").mkdir(parents=True)
    assert home.ensure_layer(tmp_path) == present
    home.remove_old_layers(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {present.name, "images", "run"}


def test_groups_that_are_busy_are_left_after_a_while(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "GROUPS", tmp_path)
    monkeypatch.setattr(limits, "EXIT_TIMEOUT_S", 0.1)
    (tmp_path / "cgroup.controllers").write_text("memory pids\n")
    busy = tmp_path / "agenthijack-d1"
    (busy / "inner").mkdir(parents=True)
    limits.leave_groups("d1")
    assert busy.exists()
    threading.Timer(0.05, (busy / "inner").rmdir).start()
    monkeypatch.setattr(limits, "EXIT_TIMEOUT_S", 60.0)
    limits.leave_groups("d1")
    until(lambda: not busy.exists())
