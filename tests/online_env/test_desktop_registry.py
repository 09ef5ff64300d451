"""The list of a machine's desktops, and the processes behind them: real files, real processes."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from hijack_data.errors import HijackError
from online_env.embedded import desktop_supply, handle
from online_env.embedded.handle import Handle
from online_env.embedded.runtime import hidden_folders, registry
from online_env.embedded.runtime.desktop_config import DesktopConfig, SetupError
from online_env.errors import DesktopError, DesktopTimeoutError

from support.registries import own_registry
from support.waiting import until

ME = (os.getpid(), registry.process_start(os.getpid()))


@pytest.fixture(autouse=True)
def run(tmp_path, monkeypatch):
    """A registry of the test's own, on a machine without control groups and namespaces."""
    return own_registry(tmp_path, monkeypatch)


@pytest.fixture
def sleeper():
    """Starts processes that end when they are asked to, or only when they are killed."""
    started = []

    def start(stubborn=False):
        code = "import signal, time; signal.signal(15, signal.SIG_IGN); print(flush=True); time.sleep(60)"
        command = (
            [sys.executable, "-ISc", code] if stubborn else ["sh", "-c", "echo; exec sleep 60"]
        )
        process = subprocess.Popen(command, stdout=subprocess.PIPE)
        started.append(process)
        process.stdout.readline()
        return process, [process.pid, registry.process_start(process.pid)]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def claim(name=None, keeper=ME, controller=None):
    return registry.claim(name, keeper, controller, {})


# Names and places


def test_names_and_places_that_are_free_again_are_given_again(run):
    first, second, third = (claim() for _ in range(3))
    assert [record["id"] for record in (first, second, third)] == ["d1", "d2", "d3"]
    assert [record["slot"] for record in (first, second, third)] == [0, 1, 2]
    registry.clear(second)
    assert (claim("mine")["slot"], claim()["id"]) == (1, "d2")
    assert [record["id"] for record in registry.records()] == ["d1", "d3", "mine", "d2"]


def test_a_name_is_taken_also_where_its_record_is_lost(run):
    claim("mine")
    with pytest.raises(SetupError) as error:
        claim("mine")
    assert str(error.value) == (
        "a desktop 'mine' is there already; end it with: hijack desktop down mine"
    )
    (run / "lost").mkdir()
    with pytest.raises(SetupError, match="a desktop 'lost' is there already"):
        claim("lost")
    (run / "d1").mkdir()
    assert claim()["id"] == "d2"


@pytest.mark.parametrize("name", [None, "mine"])
def test_when_all_places_are_taken_it_is_said(monkeypatch, name):
    monkeypatch.setattr(registry, "SLOTS", 3)
    for _ in range(3):
        claim()
    with pytest.raises(SetupError) as error:
        claim(name)
    assert str(error.value) == "all 3 places for desktops are taken; see: hijack desktop list"


def test_a_folder_that_somebody_laid_out_beforehand_is_not_used(run, tmp_path):
    """In /tmp anybody could; and a link would lead the records to wherever it wants."""
    (tmp_path / "elsewhere").mkdir()
    run.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(SetupError, match=rf"{run} belongs to somebody else; remove it as root"):
        claim()
    assert list((tmp_path / "elsewhere").iterdir()) == []
    run.unlink()
    claim()
    if os.geteuid() == 0:
        os.chown(run, 12345, 12345)
        with pytest.raises(SetupError, match="belongs to somebody else"):
            claim()


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "[]",
        "5",
        "null",
        "{}",
        '{"id": "d1"}',
        '{"created": 1, "slot": 0, "state": "ready"}',
    ],
)
def test_a_record_that_is_damaged_is_a_desktop_that_is_broken(run, content):
    claim("whole")
    registry.folder("hurt").mkdir()
    (registry.folder("hurt") / registry.RECORD).write_text(content)
    entries = {record["id"]: registry.state(record) for record in registry.records()}
    assert entries == {"hurt": "orphan", "whole": "starting"}
    assert registry.load("hurt") is None
    assert [record["id"] for record in registry.orphans()] == ["hurt"]
    assert claim()["slot"] == 1
    registry.remove(registry.records()[0])
    assert not registry.folder("hurt").exists()


def test_a_desktop_is_an_orphan_once_its_keeper_or_its_controller_has_ended(sleeper):
    process, who = sleeper()
    claim("kept", keeper=who)
    claim("used", controller=tuple(who))
    claim("free")
    registry.save({**registry.load("free"), "state": "ready"})
    assert [orphan["id"] for orphan in registry.running()] == ["kept", "used", "free"]
    process.kill()
    until(lambda: not registry.alive(who), "a process that is dead, and not reaped")
    assert [orphan["id"] for orphan in registry.running()] == ["free"]
    assert [orphan["id"] for orphan in registry.orphans()] == ["kept", "used"]
    assert registry.state(registry.load("free")) == "ready"
    # Another process with the same number is another process.
    assert not registry.alive([os.getpid(), ME[1] + 1])
    assert not registry.alive([os.getpid(), 0])


def test_a_record_is_never_half_written():
    record = claim("mine")

    with pytest.raises(TypeError):
        registry.save({**record, "state": object()})
    assert registry.load("mine") == record


# The end of a desktop


@pytest.mark.parametrize("stubborn", [False, True])
def test_a_keeper_is_asked_to_end_and_killed_if_it_does_not(sleeper, stubborn):
    keeper, who = sleeper(stubborn)
    _, inside = sleeper(stubborn=True)
    record = claim("mine", keeper=who)
    registry.save({**record, "init": inside})
    registry.remove(registry.load("mine"), timeout=0.1)
    keeper.wait()
    assert keeper.returncode == -(signal.SIGKILL if stubborn else signal.SIGTERM)
    assert not registry.alive(inside)
    assert registry.records() == []


def test_a_process_that_cannot_be_ended_keeps_its_desktop_on_the_list(monkeypatch):
    record = claim("mine", keeper=ME)
    monkeypatch.setattr(registry.os, "kill", lambda pid, number: None)
    with pytest.raises(SetupError) as error:
        registry.remove(record, timeout=0.01)
    assert str(error.value) == (
        f"process {list(ME)} of desktop 'mine' does not end; is it stuck on a disk?"
    )
    assert registry.load("mine") is not None


def test_what_is_left_of_a_network_is_removed(tmp_path):
    (tmp_path / "netns").mkdir()
    for name in ("ah-d1", "ah-d1.web", "ah-d2", "other"):
        (tmp_path / "netns" / name).touch()
    if os.geteuid() == 0:
        assert [orphan["id"] for orphan in registry.orphans()] == ["d1", "d2"]
    registry.withdraw({"id": "d2"})
    claim("d1")
    registry.withdraw(registry.load("d1"))
    assert [path.name for path in (tmp_path / "netns").iterdir()] == ["other"]
    assert registry.records() == []


def test_what_dead_desktops_left_is_removed_at_the_next_start(run, tmp_path, sleeper):
    """But nothing of one that lives, is starting, ends by itself, or cannot be seen from here."""
    (tmp_path / "cgroup").mkdir()
    (tmp_path / "cgroup/cgroup.controllers").write_text("pids")
    keeper, who = sleeper()
    owner, owner_who = sleeper()
    for name in ("dead", "live", "ending", "rebooted"):
        dies = name in ("dead", "ending")
        claim(name, who if name == "dead" else ME, tuple(owner_who) if dies else None)
        (tmp_path / "cgroup" / f"agenthijack-{name}").mkdir()
    claim("elsewhere", keeper=who)
    registry.save({**registry.load("elsewhere"), "pids": "pid:[1]"})
    registry.save({**registry.load("rebooted"), "boot": "another"})
    (run / "unknown").mkdir()
    (run / ".half").mkdir()
    (tmp_path / "cgroup/agenthijack-lost").mkdir()
    for process in (keeper, owner):
        process.kill()
        process.wait()
    assert registry.state(registry.load("elsewhere")) == "elsewhere"
    claim("new")
    assert sorted(path.name for path in run.iterdir()) == [
        ".lock",
        "elsewhere",
        "ending",
        "live",
        "new",
        "unknown",
    ]
    groups = sorted(path.name for path in (tmp_path / "cgroup").glob("agenthijack-*"))
    if os.geteuid() == 0:
        assert groups == ["agenthijack-ending", "agenthijack-live"]
    with pytest.raises(SetupError, match="belongs to another container"):
        registry.remove(registry.load("elsewhere"))
    assert [orphan["id"] for orphan in registry.orphans()] == ["unknown", "ending"]


def test_what_was_left_under_a_name_that_is_taken_again_stays(sleeper):
    _, who = sleeper()
    record = claim("mine", keeper=who)
    registry.withdraw(record)
    claim("mine")
    registry.withdraw(record)
    assert registry.load("mine")["keeper"] == list(ME)


def test_a_list_that_a_stopped_process_has_locked_is_an_error(monkeypatch):
    monkeypatch.setattr(registry, "LOCK_TIMEOUT_S", 0.2)
    claim("mine")
    with registry.locked():
        if os.fork() == 0:
            time.sleep(30)  # it holds nothing
            os._exit(0)
        with pytest.raises(SetupError, match=rf"is locked by process {os.getpid()} on .*CONT"):
            claim("other")
    claim("other")


# The controller's hold on a keeper


ORDER = DesktopConfig(name="d1", screen=(640, 480), layer="", search_path=(), python="")
READY = {"id": "d1", "init": list(ME)}


@pytest.fixture
def keeper(monkeypatch):
    """Makes handles on keepers that are small programs; they end after the test."""
    items = []

    def start(code, **options):
        program = f"import json, os, sys, time\norder = json.loads(sys.argv[2])\n{code}"
        monkeypatch.setattr(handle, "_KEEPER", program)
        items.append(Handle(replace(ORDER, **options)))
        return items[-1]

    yield start
    for item in items:
        item.close()


def say(kind, value):
    return f"print(json.dumps({{{kind!r}: {value!r}}}), flush=True)\n"


def test_a_desktop_is_ready_when_its_keeper_says_so_in_whatever_pieces(keeper):
    text = json.dumps({"ready": READY}) + "\n" + json.dumps({"ended": "the display ended"}) + "\n"
    code = "".join(f"os.write(1, {text[n : n + 9].encode()!r})\n" for n in range(0, len(text), 9))
    result = keeper(code + "time.sleep(60)")
    assert result.wait() == READY
    assert result.wait() is result.record
    assert until(result.ended) == "the display ended"
    assert not result.has_ended(), "its keeper clears up"
    result.close()
    assert result.has_ended()
    assert result.ended() == "the display ended"


@pytest.mark.parametrize(
    ("code", "error", "message"),
    [
        (say("error", "no X"), DesktopError, "the desktop did not start: no X"),
        (
            say("ended", "it fell over"),
            DesktopError,
            "the desktop did not start: {'ended': 'it fell over'}",
        ),
        (
            "sys.exit(3)",
            DesktopError,
            "the desktop did not start: {'ended': 'its keeper ended (exit code 3) and said nothing'}",
        ),
        ("time.sleep(60)", DesktopTimeoutError, "the desktop's keeper said nothing within 0 s"),
    ],
)
def test_a_desktop_that_does_not_start_says_why_and_leaves_no_keeper(keeper, code, error, message):
    result = keeper(code, time_out=-15.0 if "sleep" in code else 60.0)
    with pytest.raises(error) as caught:
        result.wait()
    assert str(caught.value) == message
    assert isinstance(caught.value, HijackError)
    assert result.has_ended()


def test_a_keeper_that_dies_is_the_end_of_its_desktop(keeper):
    result = keeper(say("ready", READY) + "time.sleep(60)")
    result.wait()
    assert result.ended() is None
    os.kill(result._keeper.pid, signal.SIGKILL)
    assert until(result.ended) == "its keeper ended (exit code -9) and said nothing"


def test_a_keeper_lives_as_long_as_it_is_held(keeper):
    begun = time.monotonic()
    value = keeper("time.sleep(60)")
    value.close(wait=False)
    until(value.has_ended)
    stubborn = keeper(
        "import signal\nsignal.signal(15, signal.SIG_IGN)\nsys.stdout.write('{}\\n')\nsys.stdout.flush()\ntime.sleep(60)"
    )
    until(stubborn.ended)
    stubborn.close()
    assert stubborn._keeper.returncode == -signal.SIGKILL
    released = keeper(say("ready", READY))
    released.wait()
    released.release()
    assert released.ended() is not None
    assert time.monotonic() - begun < 50


# A supply of desktops


NUMBERED = (
    "me = [os.getpid(), int(open('/proc/self/stat').read().rpartition(')')[2].split()[19])]\n"
)
SERVING = NUMBERED + (
    "print(json.dumps({'ready': {'id': order['name'], 'init': me}}), flush=True)\ntime.sleep(60)"
)


@pytest.fixture
def supply(monkeypatch):
    monkeypatch.setattr(
        handle, "_KEEPER", f"import json, os, sys, time\norder = json.loads(sys.argv[2])\n{SERVING}"
    )
    items = []

    def start(standby=False):
        items.append(desktop_supply.DesktopSupply(ORDER, standby))
        return items[-1]

    yield start
    for item in items:
        item.close()


def test_each_desktop_of_a_supply_takes_the_place_of_the_one_before(supply):
    result = supply()
    assert result.ended() == "it was closed"
    first, second = result.next(), result.next()
    assert (first["id"], second["id"]) == ("d1", "d1-2")
    until(lambda: not registry.alive(first["init"]))
    assert registry.alive(second["init"])
    assert result.ended() is None
    assert not result.ready(), "nothing stands by"
    result.close()
    assert not registry.alive(second["init"])


def test_a_spare_is_handed_out_unless_it_has_died_or_shows_too_much(supply, monkeypatch, tmp_path):
    result = supply(standby=True)
    result.next()
    assert result.ready()
    assert [result.next()["id"], result.ready()] == ["d1-2", True]
    spare = result._spare.record
    os.kill(spare["init"][0], signal.SIGKILL)
    until(lambda: not registry.alive(spare["init"]))
    assert (spare["id"], result.next()["id"]) == ("d1-3", "d1-4")
    assert result.ready()
    monkeypatch.setattr(hidden_folders, "_hidden_by_caller", {})
    hidden_folders.hide(tmp_path / "records of a run")
    last = result.next()
    assert last["id"] == "d1-6", "d1-5 was started before the folder was hidden"
    result.close()
    assert not registry.alive(last["init"])


def test_a_supply_that_cannot_build_tries_again_at_the_next_call(supply, monkeypatch):
    result = supply()
    keeper = handle._KEEPER
    monkeypatch.setattr(handle, "_KEEPER", "import sys; sys.exit(1)")
    with pytest.raises(DesktopError, match="did not start"):
        result.next()
    monkeypatch.setattr(handle, "_KEEPER", keeper)
    assert result.next()["id"] == "d1-2"
