"""Which desktop `hijack desktop view` shows: the registry is real, the desktops are records."""

import contextlib
import os

import pytest
from click.testing import CliRunner

from support import needs
from support.registries import own_registry

pytest.importorskip("httpx", reason=needs.ONLINE)

from online_env import desktop_commands
from online_env.embedded import view
from online_env.embedded.desktop import EmbeddedDesktop
from online_env.embedded.runtime import registry

ME = (os.getpid(), registry.process_start(os.getpid()))


@pytest.fixture
def desktops(tmp_path, monkeypatch):
    """Puts records of desktops into a registry of its own."""
    own_registry(tmp_path, monkeypatch)

    def put(name, *, held=False, state="ready"):
        more = {"screen": [1920, 1080], "token": "", "guest": "http://127.0.0.1:9"}
        record = registry.claim(name, ME, ME if held else None, more)
        registry.save({**record, "state": state})

    return put


@pytest.fixture
def opened_pages(monkeypatch):
    """What the page was opened for, and whether it leaves the desktop running."""
    items = []

    class Present:
        def __init__(self, record):
            self.record = record
            self.id = record["id"]

    def serve(record, port, say, *, lasting, buttons):
        items.append((record["id"], lasting))

    def up(name=None, **_):
        return contextlib.nullcontext(Present({"id": name}))

    monkeypatch.setattr(view, "serve", serve)
    monkeypatch.setattr(EmbeddedDesktop, "up", up)
    monkeypatch.setattr(
        EmbeddedDesktop, "attach", lambda name: contextlib.nullcontext(Present(registry.load(name)))
    )
    return items


def viewed(*words):
    return (
        CliRunner()
        .invoke(desktop_commands.desktop, ["view", *words], catch_exceptions=False)
        .output
    )


OWN = f"view-{os.getpid()}"


def test_one_of_its_own_where_none_runs(desktops, opened_pages):
    assert viewed() == "no desktop runs: starting one\n"
    assert opened_pages == [(OWN, False)]


def test_the_one_that_was_started_by_hand_beside_a_benchmark(desktops, opened_pages):
    desktops("d1", held=True)
    desktops("mine")
    desktops("d2", held=True)
    assert viewed() == ""
    assert opened_pages == [("mine", True)]


def test_one_of_its_own_beside_a_benchmark(desktops, opened_pages):
    """Neither an error, nor a page with a mouse in the middle of somebody's episode."""
    desktops("d1", held=True)
    assert viewed() == "starting one beside d1 (hijack desktop view NAME shows one of those)\n"
    desktops("d2", held=True)
    assert "beside d1, d2 (" in viewed()
    assert opened_pages == [(OWN, False)] * 2


def test_one_of_its_own_beside_several_and_beside_one_that_is_not_ready(desktops, opened_pages):
    desktops("a", state="starting")
    viewed()
    desktops("b")
    desktops("c")
    viewed()
    assert opened_pages == [(OWN, False)] * 2


def test_a_name_is_a_name(desktops, opened_pages):
    desktops("d1", held=True)
    desktops("mine")
    assert viewed("d1") == ""
    assert opened_pages == [("d1", True)]
