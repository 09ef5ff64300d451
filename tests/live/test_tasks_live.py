"""Tasks on a real desktop: doing nothing fails, the oracle passes, and nothing is left."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

import hijack_data
from online_env import tasks
from online_env.embedded.sites import SiteState
from online_env.errors import MissingPackageError
from online_env.tasks import task_sets
from online_env.tasks.task_apps import APPS


@pytest.fixture(scope="module")
def desktop_and_sites(embedded_machine: None) -> Iterator[tuple[Any, SiteState]]:
    """A desktop and the state of its sites, shared: every task cleans up after itself."""
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up() as desktop:
        yield desktop, SiteState(desktop.record["sites"])


@pytest.mark.parametrize("name", task_sets.members("sample"))
def test_the_oracle_does_what_nobody_did_before(
    desktop_and_sites: tuple[Any, SiteState], request: pytest.FixtureRequest, name: str
) -> None:
    if name == "register_course":
        request.getfixturevalue("browser_machine")
    if name == "set_snapshots":
        needs.apps("vlc")
    task = tasks.get(name, 1)
    machine = tasks.Machine(*desktop_and_sites)
    at_first = machine.snapshot().files.keys()
    task.setup(machine)
    untouched = task.validate(machine)
    assert untouched.score == 0.0
    assert untouched.reason
    task.oracle(tasks.Hand(machine.desktop))
    verdict = task.validate(machine)
    assert verdict.score == 1.0, verdict.reason
    assert task.validate(machine, "FAIL").score == 0.0
    task.teardown(machine)
    assert machine.snapshot().files.keys() == at_first
    assert task.validate(machine).score == 0.0
    task.teardown(machine)


def test_an_application_that_is_missing_is_named_before_anything_is_done(
    desktop_and_sites: tuple[Any, SiteState], monkeypatch: pytest.MonkeyPatch
) -> None:
    absent = dataclasses.replace(APPS["gimp"], argv=("no-such-program",))
    monkeypatch.setitem(APPS, "gimp", absent)
    machine = tasks.Machine(*desktop_and_sites)
    with pytest.raises(MissingPackageError, match="hijack desktop install --profile media"):
        machine.check_installed(["thunar", "gimp"])


def test_a_snapshot_tells_what_was_added_changed_and_removed(
    desktop_and_sites: tuple[Any, SiteState],
) -> None:
    machine = tasks.Machine(*desktop_and_sites)
    machine.begin()
    for name in ("kept", "changed", "removed", "moded"):
        machine.write(f"Documents/a b/{name}.txt", name)
    machine.remember()
    assert list(machine.unexpected_changes()) == []
    machine.write("Documents/a b/changed.txt", "other")
    machine.run("rm", "Documents/a b/removed.txt")
    machine.run("chmod", "600", "Documents/a b/moded.txt")
    machine.write("Music/new/ünïcode\nline.txt", "")
    machine.write(".hidden/file", "not looked at")
    assert list(machine.unexpected_changes()) == [
        "Documents/a b/changed.txt was changed",
        "Documents/a b/moded.txt was changed",
        "Documents/a b/removed.txt is gone",
        "Music/new was added",
        "Music/new/ünïcode\nline.txt was added",
    ]
    assert list(machine.unexpected_changes("Documents/*", "Music/new/ünïcode\nline.txt")) == []
    machine.clear([])
    assert not machine.exists("Music/new")
    assert not machine.exists("Documents/a b")


@pytest.mark.parametrize(
    "corruption", ["accidental_touch", "app_minimization", "multi_apps", "verification"]
)
def test_a_careful_user_does_the_task_all_the_same(embedded_machine: None, corruption: str) -> None:
    from online_env import CorruptedEnv, EmbeddedDesktop, SmallTasks
    from online_env.agents.registry import make
    from online_env.bench.episodes import play
    from online_env.bench.jobs import Job

    with EmbeddedDesktop.up() as desktop:
        stage = SmallTasks(desktop)

        def show(agent: Any, _: Any) -> None:
            agent.prepare(stage.task, stage.machine)

        env = CorruptedEnv(stage, max_steps=60)
        job = Job("recovering", "write_note", corruption, 1)
        record = play(
            env, make("recovering"), job, 0, hijack_data.make_corruption(corruption), show
        )
    assert (record["status"], record["score"]) == ("ok", 1.0), record
    assert record["effects"]


def test_the_desktop_reaches_the_sites_by_name_and_nothing_else(
    desktop_and_sites: tuple[Any, SiteState],
) -> None:
    desktop, _ = desktop_and_sites
    code = (
        "import socket, urllib.request as r\n"
        "print(r.urlopen('http://search.test/generate_204', timeout=5).status)\n"
        "print(socket.gethostbyname('shop.test'))\n"
        "try: print(socket.gethostbyname('example.com'))\n"
        "except socket.gaierror: print('unknown')\n"
    )
    assert desktop.execute(["/usr/bin/python3", "-c", code]).output.split() == [
        "204",
        "10.77.0.1",
        "unknown",
    ]
