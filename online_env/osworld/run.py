"""OSWorld's environment on the embedded desktop."""

import contextlib
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..desktops.http import HttpDesktop
from ..embedded import handle
from ..embedded.desktop_supply import DesktopSupply
from ..embedded.runtime import network
from . import history, venv
from .env import Address, OsworldEnv, OSWorldSettings
from .selftest import Groups, Results, SelfTestRow, run_all
from .task_needs import PackageCheck
from .tasks import TaskSet

LOG = "osworld.log"


def read_address(record: Mapping[str, Any]) -> Address:
    """Return where the guest server of an embedded desktop listens, with its token.

    Args:
        record: The desktop's record in the registry.
    """
    ports = record["ports"]
    return Address(
        record["address"],
        int(record["guest"].rpartition(":")[2]),
        chromium_port=ports["chromium"],
        vlc_port=ports["vlc"],
        token=Path(record["token_file"]).read_text(encoding="ascii").strip(),
    )


class EmbeddedEnv(OsworldEnv):
    """OSWorld's environment on an embedded desktop of this machine."""

    def __init__(
        self, python: Path, supply: DesktopSupply, settings: OSWorldSettings, log: Path
    ) -> None:
        self._record: Mapping[str, Any] = {}
        self._client: HttpDesktop | None = None
        self._supply = supply
        super().__init__(python, self._next, settings, log)

    @property
    def namespace(self) -> Path:
        """The network namespace of the present desktop, for a firewall rule from outside."""
        return network.NETNS / self._record["netns"]

    @property
    def client(self) -> HttpDesktop:
        """A client of the present guest server, which needs no Python of the guest's user."""
        if self._client is None:
            address = read_address(self._record)
            source = self._record["source"]
            self._client = HttpDesktop(self._record["guest"], address.token, source=source)
        return self._client

    def close(self) -> None:
        """End the process; the desktop is not touched."""
        self._forget_client()
        super().close()

    def _next(self) -> Address:
        self._forget_client()
        self._record = self._supply.next()
        return read_address(self._record)

    def _forget_client(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None


@contextlib.contextmanager
def embedded_env(
    folder: Path = venv.DEFAULT,
    cache: Path = Path("cache"),
    *,
    size: tuple[int, int] = (1080, 1920),
    tree: bool = False,
    standby: bool = True,
) -> Iterator[EmbeddedEnv]:
    """Yield OSWorld's `DesktopEnv` on an embedded desktop; every reset gets a pristine one.

    Args:
        folder: OSWorld's Python environment (`hijack osworld setup`).
        cache: OSWorld's file cache (`hijack osworld prefetch`); its log goes there too.
        size: `(height, width)` of the screen in pixels.
        tree: Whether observations have the accessibility tree.
        standby: Whether the next desktop is kept ready while one is used.

    Raises:
        OsworldError: The Python environment is not there.
        DesktopError: No desktop starts.
    """
    order = handle.make_order(size, osworld=True)  # says first what a desktop lacks
    python = venv.find_python(folder)
    cache.mkdir(parents=True, exist_ok=True)
    supply = DesktopSupply(order, standby=standby)
    height, width = size
    try:
        settings = OSWorldSettings(cache, (width, height), tree)
        with contextlib.closing(EmbeddedEnv(python, supply, settings, cache / LOG)) as env:
            yield env
    finally:
        supply.close()


@contextlib.contextmanager
def checker(folder: Path = venv.DEFAULT) -> Iterator[PackageCheck | None]:
    """Yield `OsworldEnv.check`, which needs no desktop; `None` if there is no environment.

    Args:
        folder: OSWorld's Python environment (`hijack osworld setup`).
    """
    if venv.installed_tier(folder) is None:
        yield None
        return
    with tempfile.TemporaryDirectory() as scratch:
        settings = OSWorldSettings(Path(scratch, "cache"))
        env = OsworldEnv(venv.find_python(folder), None, settings, Path(scratch, LOG))
        with contextlib.closing(env):
            yield env.check


def run_selftest(
    tasks: TaskSet,
    groups: Groups,
    folder: Path,
    cache: Path,
    tell: Callable[[SelfTestRow, Results], object] = lambda *_: None,
) -> Results:
    """Run the self-test of `tasks` on an embedded desktop."""
    # No standby: a desktop that starts meanwhile slows a task down.
    with embedded_env(folder, cache, standby=False) as env:
        history.provide(env, tasks, cache)
        about = {**env.about, "tier": venv.installed_tier(folder), "desktop_env": venv.PACKAGE}
        return run_all(env, tasks, groups, about, tell)
