"""Real desktops for the tests; each test that needs one skips where this machine cannot have it.

What else a test may need, and the words that say so, is in `support.needs`.
"""

import contextlib
import itertools
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from online_env.embedded.runtime import network, registry

from support import needs

_count = itertools.count()


@pytest.fixture(scope="session")
def embedded_machine() -> None:
    """Skips where embedded desktops cannot run."""
    needs.desktop()


@pytest.fixture(scope="session")
def browser_machine(embedded_machine: None) -> None:
    """Skips where there is no Chromium, which desktops have from the machine."""
    needs.apps("chromium")


@pytest.fixture
def up(embedded_machine: None) -> Iterator[Callable[..., Any]]:
    """`EmbeddedDesktop.up`, whose desktops are closed after the test."""
    from online_env.embedded.desktop import EmbeddedDesktop

    items: list[EmbeddedDesktop] = []

    def start(**options: Any) -> EmbeddedDesktop:
        items.append(EmbeddedDesktop.up(**options))
        return items[-1]

    yield start
    for desktop in items:
        desktop.close()


@pytest.fixture(scope="module")
def embedded_desktop(embedded_machine: None) -> Iterator[Any]:
    """One desktop for a whole module, for tests that leave it as they find it."""
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up() as desktop:
        yield desktop


def _traces(prefix: str) -> dict[str, set[str]]:
    """What on this machine belongs to desktops whose name starts with `prefix`, by kind; others may
    run beside them."""
    entries = {
        "mounts": {
            line for line in Path("/proc/self/mounts").read_text().splitlines() if prefix in line
        }
    }
    entries["namespaces"] = {p.name for p in network.NETNS.glob(f"ah-{prefix}*")}
    entries["folders"] = {p.name for p in registry.RUN.glob(f"{prefix}*")}
    entries["groups"] = {str(p) for p in Path("/sys/fs/cgroup").glob(f"**/agenthijack-{prefix}*")}
    entries["processes"] = {
        text for text in _command_lines() if f'"{prefix}' in text or f"/{prefix}" in text
    }
    return entries


def _command_lines() -> Iterator[str]:
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            yield path.read_bytes().replace(b"\0", b" ").decode("utf-8", "replace")


@pytest.fixture
def leaves_nothing(embedded_machine: None) -> Iterator[str]:
    """Gives a prefix for names of desktops; fails where the test leaves anything of them behind."""
    prefix = f"t{os.getpid()}x{next(_count)}-"
    yield prefix
    deadline = time.monotonic() + 60
    while any(_traces(prefix).values()) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert _traces(prefix) == {kind: set() for kind in _traces(prefix)}
