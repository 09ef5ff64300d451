"""What goes wrong with embedded desktops: killed parts, killed controllers, hogs; and that nothing
is left behind."""

import json
import os
import resource
import signal
import subprocess
import sys
import time

import pytest

from online_env.embedded import handle
from online_env.embedded.runtime import network, registry
from online_env.errors import DesktopError

from support import needs
from support.processes import children, cmdline, comm, guest_server, parent, state, traced
from support.waiting import until as wait_until

CONTROLLER = """
import sys, time
from online_env.embedded.desktop import EmbeddedDesktop
desktop = EmbeddedDesktop.up(name=sys.argv[1], standby=True)
print(desktop.id, flush=True)
time.sleep(60)
"""


# The forks hold all that the controller held, and go on.
FORKING_CONTROLLER = """
import os, sys, time
from online_env.embedded.desktop import EmbeddedDesktop
desktop = EmbeddedDesktop.up(size=(600, 800), name=sys.argv[1], standby=True)
for _ in range(2):
    if os.fork() == 0:
        os.setsid()
        time.sleep(40)
        os._exit(0)
print(desktop.id, flush=True)
if sys.argv[2] == "close":
    start = time.monotonic()
    desktop.close()
    print(time.monotonic() - start, flush=True)
    os._exit(0)
time.sleep(60)
"""
END_S = 5.0


def remove_orphan(name):
    """Clear one orphan; others may belong to whoever else uses this machine."""
    orphans = [record for record in registry.orphans() if record["id"] == name]
    assert len(orphans) == 1
    registry.remove(orphans[0])
    assert name not in {record["id"] for record in registry.orphans()}


def processes(desktop, name):
    """Pids inside the desktop of processes with this name."""
    return desktop.execute(["pgrep", "-x", name]).output.split()


def test_cycles_leave_nothing(leaves_nothing, up):
    for number in range(3):
        desktop = up(size=(600, 800), name=f"{leaves_nothing}{number}")
        desktop.reset()
        desktop.close()
        desktop.close()


@pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_end_of_the_controller_ends_everything(leaves_nothing, ending):
    command = [sys.executable, "-c", CONTROLLER, f"{leaves_nothing}a"]
    controller = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    name = controller.stdout.readline().decode().strip()
    assert registry.state(registry.load(name)) == "ready"
    controller.send_signal(ending)
    controller.wait()
    controller.stdout.close()
    wait_until(lambda: not registry.folder(name).exists())


@pytest.mark.parametrize("ending", ["kill", "close"])
def test_a_fork_of_the_controller_does_not_keep_its_desktops(leaves_nothing, ending):
    command = [sys.executable, "-c", FORKING_CONTROLLER, f"{leaves_nothing}a", ending]
    controller = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    name = controller.stdout.readline().strip()
    assert registry.load(name)
    if ending == "close":
        assert float(controller.stdout.readline()) < END_S
        assert not registry.folder(name).exists()
    else:
        controller.kill()
    controller.wait()
    start = time.monotonic()
    wait_until(lambda: not list(registry.RUN.glob(f"{leaves_nothing}*")))
    assert time.monotonic() - start < END_S
    controller.stdout.close()


def test_a_killed_keeper_leaves_an_orphan_that_the_next_start_removes(leaves_nothing, up):
    result = handle.Handle(handle.make_order((600, 800), name=f"{leaves_nothing}a", detached=True))
    record = result.wait()
    result.release()
    os.kill(record["keeper"][0], signal.SIGKILL)
    os.waitpid(record["keeper"][0], 0)
    wait_until(lambda: not registry.alive(record["init"]))
    assert registry.state(registry.load(record["id"])) == "orphan"
    up(size=(600, 800), name=f"{leaves_nothing}b")
    assert registry.load(record["id"]) is None


def test_an_aimed_kill_of_the_keeper_is_told_and_reset_mends_it(leaves_nothing, up):
    desktop = up(size=(600, 800), name=f"{leaves_nothing}a")
    os.kill(desktop.record["keeper"][0], signal.SIGKILL)
    wait_until(lambda: not registry.alive(desktop.record["init"]))
    with pytest.raises(DesktopError, match=r"has ended: its keeper ended \(exit code -9\)"):
        desktop.execute(["true"])
    desktop.reset()
    assert desktop.execute(["true"]).ok
    wait_until(lambda: registry.load(f"{leaves_nothing}a") is None)


@pytest.mark.parametrize("part", ["keeper", "init", "launcher", "ports", "internet"])
def test_a_stopped_part_outside_goes_on(embedded_desktop, part):
    """Somebody on the machine pressed Ctrl-Z, or froze the wrong process."""
    record = embedded_desktop.record
    keeper = record["keeper"][0]
    launcher = parent(record["init"][0])
    matches = [pid for pid in children(keeper) if pid != launcher]
    internet = [pid for pid in matches if b"online_env.embedded.sites" in cmdline(pid)]
    pids = {
        "keeper": [keeper],
        "init": record["init"][:1],
        "launcher": [launcher],
        "internet": internet,
        "ports": [pid for pid in matches if pid not in internet],
    }[part]
    assert len(pids) == 1
    os.kill(pids[0], signal.SIGSTOP)
    if part == "keeper":  # it alone has nobody above it; it is continued when the desktop ends
        wait_until(lambda: state(keeper) == "T")
        assert embedded_desktop.execute(["true"]).ok
        os.kill(keeper, signal.SIGCONT)
    wait_until(lambda: state(pids[0]) != "T")
    assert embedded_desktop.execute(["true"]).ok


@pytest.mark.parametrize(
    "name", ["Xvfb", "dbus-daemon", "xfwm4", "xfce4-panel", "xfdesktop", "desktop-server"]
)
def test_a_part_inside_that_the_user_stops_goes_on(embedded_desktop, name):
    embedded_desktop.execute(["pkill", "-STOP", "-x", name])
    assert embedded_desktop.execute(["true"]).ok
    assert embedded_desktop.screenshot().shape == (1080, 1920, 3)
    init = embedded_desktop.record["init"][0]
    pids = [pid for pid in children(init) if comm(pid) == name]
    assert pids
    wait_until(lambda: all(state(pid) != "T" for pid in pids))


def test_a_desktop_whose_keeper_is_stopped_ends_when_it_is_closed(leaves_nothing, up):
    desktop = up(size=(600, 800), name=f"{leaves_nothing}a")
    os.kill(desktop.record["keeper"][0], signal.SIGSTOP)
    start = time.monotonic()
    desktop.close()
    assert time.monotonic() - start < END_S


@needs.needs_memory(2)
def test_programs_inside_write_to_no_disk_of_the_machine(leaves_nothing, up):
    """A service that the bus starts inherits the bus' own standard error."""
    desktop = up(size=(600, 800), name=f"{leaves_nothing}a")
    service = "[D-BUS Service]\nName=org.loud\nExec=/bin/sh -c 'yes | head -c 300M >&2'\n"
    desktop.execute(["mkdir", "-p", "/home/user/.local/share/dbus-1/services"])
    service_path = "/home/user/.local/share/dbus-1/services/org.loud.service"
    desktop.write_file(service_path, service.encode())
    reload = "--dest=org.freedesktop.DBus / org.freedesktop.DBus.ReloadConfig"
    desktop.execute(f"dbus-send --session --print-reply {reload}")
    desktop.execute("dbus-send --session --dest=org.loud / a.b.C")
    logs = registry.folder(desktop.id) / "logs"
    loud = logs / "dbus-daemon.log"
    wait_until(lambda: b"left out" in loud.read_bytes()[:40])
    wait_until(lambda: not processes(desktop, "yes"))
    assert sum(path.stat().st_size for path in logs.iterdir()) <= 16 << 20
    links = "ls -l /proc/[0-9]*/fd 2>/dev/null"
    assert "/logs/" not in desktop.execute(links).output
    assert desktop.execute(["true"]).ok


def test_a_guest_server_without_descriptors_is_started_again(leaves_nothing, up):
    desktop = up(size=(600, 800), name=f"{leaves_nothing}a")
    server = guest_server(desktop.record)
    refused = desktop.execute("prlimit --pid $(pgrep -x desktop-server) --nofile=3")
    assert os.geteuid() != 0 or "not permitted" in refused.error
    resource.prlimit(server, resource.RLIMIT_NOFILE, (3, 3))  # what the user may not do
    start = time.monotonic()
    wait_until(lambda: not registry.alive((server, registry.process_start(server))))
    assert time.monotonic() - start < 60
    desktop.client.close()
    wait_until(lambda: desktop.execute(["true"]).ok)


def test_a_guest_server_that_hangs_ends_its_desktop(leaves_nothing, up):
    desktop = up(size=(600, 800), name=f"{leaves_nothing}a")
    server = guest_server(desktop.record)
    start = time.monotonic()
    with traced(server):
        wait_until(lambda: not registry.alive(desktop.record["init"]))
    assert time.monotonic() - start < 60
    with pytest.raises(DesktopError, match="accepts no connections any more"):
        desktop.execute(["true"])
    desktop.reset()
    assert desktop.execute(["true"]).ok


def test_bare_namespaces_are_found_as_orphans(embedded_machine, leaves_nothing):
    network.create(f"{leaves_nothing}bare")
    remove_orphan(f"{leaves_nothing}bare")


@pytest.mark.parametrize("victim", ["Xvfb", "dbus-daemon"])
def test_death_of_display_or_bus_is_told_and_reset_mends_it(up, victim):
    desktop = up()
    assert victim == "dbus-daemon" or len(processes(desktop, "Xvfb")) == 1
    init = desktop.record["init"][0]
    pids = [p for p in children(init) if comm(p) == victim]
    os.kill(pids[0], signal.SIGKILL)
    wait_until(lambda: not registry.alive(desktop.record["init"]))
    with pytest.raises(DesktopError, match=rf"has ended: {victim} ended \(signal 9\)"):
        desktop.execute(["true"])
    desktop.reset()
    assert desktop.execute(["true"]).ok


@pytest.mark.parametrize("victim", ["xfwm4", "xfce4-panel", "xfdesktop"])
def test_parts_of_the_shell_come_back(embedded_desktop, victim):
    before = processes(embedded_desktop, victim)
    embedded_desktop.execute(["pkill", "-KILL", "-x", victim])
    wait_until(lambda: len(now := processes(embedded_desktop, victim)) == 1 and now != before)


def test_guest_server_comes_back(up):
    desktop = up()
    os.kill(guest_server(desktop.record), signal.SIGKILL)

    def answers():
        try:
            return desktop.execute(["true"]).ok
        except DesktopError:
            return False

    wait_until(answers)


def test_rm_rf_home_hurts_this_desktop_only(up):
    first = up()
    first.execute("rm -rf ~ 2>/dev/null; rm -rf ~/.* 2>/dev/null")
    second = up()
    assert second.execute("test -e ~/.bashrc").ok
    assert first.screenshot().shape == (1080, 1920, 3)


@needs.needs_memory(4)
def test_full_disk_is_the_desktops_own(up):
    desktop = up()
    result = desktop.execute(
        "head -c 3G /dev/zero > ~/big; ls -l ~/big | cut -d' ' -f5; rm ~/big; echo hi > ~/small &&"
        " cat ~/small"
    )
    assert int(result.output.split()[0]) <= 2 << 30
    assert result.output.split()[1] == "hi"


def test_fork_bomb_is_contained(up):
    desktop = up()
    code = (
        "import os\n"
        "made, (wait, go) = 0, os.pipe()\n"
        "try:\n"
        "    while made < 20000:\n"
        "        if os.fork() == 0:\n"
        "            os.close(go); os.read(wait, 1); os._exit(0)\n"
        "        made += 1\n"
        "except OSError:\n"
        "    print(made)\n"
    )
    result = desktop.execute(["/usr/bin/python3", "-c", code])
    assert 100 < int(result.output) < 10000
    assert subprocess.run(["true"], check=False).returncode == 0
    wait_until(lambda: desktop.execute(["true"]).ok)


def test_memory_hog_gets_an_error(up):
    desktop = up()
    result = desktop.execute(["/usr/bin/python3", "-c", "x = b'x' * (6 << 30)"])
    assert result.returncode == 1
    assert "MemoryError" in result.error


SHORT_CONTROLLER = """
import sys
from online_env.embedded.desktop import EmbeddedDesktop
with EmbeddedDesktop.up(size=(600, 800)) as desktop:
    print(desktop.id, flush=True)
    sys.stdin.read()
"""


def test_two_controllers_at_once(embedded_machine):
    command = [sys.executable, "-c", SHORT_CONTROLLER]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    processes = [subprocess.Popen(command, **pipes) for _ in range(2)]
    names = {item.stdout.readline().strip() for item in processes}
    for item in processes:
        item.communicate(timeout=120)
    assert len(names) == 2
    assert "" not in names


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (
            (
                "from online_env.embedded.runtime import session; "
                "session.display_server = lambda *_: ('Xvfb', '-nonsense')"
            ),
            r"(?s)Xvfb ended; the end of Xvfb\.log: .*nonsense",
        ),
        (
            "from online_env.embedded.guest import preload; preload.LATER = ('no_such_module',)",
            r"(?s)the end of spawner\.log: .*No module named 'no_such_module'",
        ),
    ],
)
def test_failure_to_start_names_the_log(embedded_machine, leaves_nothing, monkeypatch, spoil, told):
    broken = handle._KEEPER.replace("from online", f"{spoil}; from online")
    monkeypatch.setattr(handle, "_KEEPER", broken)
    with pytest.raises(DesktopError, match=told):
        handle.Handle(handle.make_order(name=f"{leaves_nothing}a")).wait()


def test_record_is_plain_json(embedded_desktop):
    text = (registry.folder(embedded_desktop.id) / registry.RECORD).read_text()
    assert json.loads(text)["id"] == embedded_desktop.id
    assert (registry.folder(embedded_desktop.id).stat().st_mode & 0o777) == 0o700
