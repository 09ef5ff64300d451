"""The tasks of our seven sites in a browser alone: no desktop, no namespace, no root."""

import tempfile
import threading
from collections.abc import Callable, Iterable, Sequence
from ipaddress import IPv4Address
from pathlib import Path
from typing import Any

from hijack_data.errors import ParameterError
from hijack_data.types import Size

from ..embedded.sites.hosts_and_dates import HOSTS
from ..embedded.sites.state import SiteState
from ..environment.stage import Setting, SmallTasks, describe_task
from ..tasks.base import Task
from ..tasks.machine import Machine, Snapshot
from .desktop import BrowserDesktop
from .site import resolver_arguments


class LocalSites:
    """The seven sites, served to one browser on this machine.

    Args:
        state: What is done on the sites.
    """

    def __init__(self, state: SiteState) -> None:
        from ..embedded.sites.server import bind, web_server  # loads uvicorn

        bound = bind(IPv4Address("127.0.0.1"), 0, 0)
        bound.dns.close()  # the browser resolves names by its own rules
        self._socket = bound.http
        self._server = web_server(state)
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [self._socket]}, name="sites", daemon=True
        )
        self._thread.start()

    @property
    def arguments(self) -> tuple[str, ...]:
        """Return the arguments of the command line of a browser that reaches nothing else."""
        return resolver_arguments(HOSTS, self._socket.getsockname()[1])

    def close(self) -> None:
        """End the server."""
        self._server.should_exit = True
        self._thread.join()
        self._socket.close()


class SiteMachine(Machine):
    """A browser and the state of the sites, in the form that tasks use; it has no files."""

    def check_installed(self, apps: Iterable[str]) -> None:
        """Do nothing: the browser runs already."""

    def wait_until_idle(self, apps: Iterable[str]) -> None:
        """Do nothing: a site has stored what it was sent when the next page shows."""

    def open(self, app: str, *arguments: str) -> None:
        """Open an address in a fresh profile."""
        (url,) = arguments
        self.desktop.reset({"url": url})

    def snapshot(self) -> Snapshot:
        """Return what the sites have stored."""
        return Snapshot(files={}, sites=self._stored())

    def clear(self, apps: Iterable[str]) -> None:
        """Forget what the sites have stored."""
        self.sites.clear()


class SiteTasks(SmallTasks):
    """Tasks of the sites in a browser; make one by `open_site_tasks`.

    Args:
        desktop: The browser, which reaches `sites`.
        state: What is done on the sites.
        close_sites: Ends what `close` does not know.
        task: The task of a `reset` that names none.
    """

    def __init__(
        self,
        desktop: BrowserDesktop,
        state: SiteState,
        close_sites: Callable[[], object],
        task: str | Task,
    ) -> None:
        super().__init__(desktop, task)
        self._state = state
        self._close_sites = close_sites

    @property
    def sites(self) -> SiteState:
        """What is done on the sites."""
        return self._state

    def plan(self) -> Sequence[str]:
        """Return the plan in words without its windows: a page alone shows the title of none."""
        return tuple(step for step in super().plan() if not step.startswith("window "))

    @property
    def splits_setup(self) -> bool:
        """False: a page of no network is loaded again after the cut."""
        return False

    def _reset(self, task: Any, seed: int, cut_network: Callable[[], object] | None) -> Setting:
        chosen_task = self._find(task, seed)
        if not chosen_task.in_browser:
            raise ParameterError(
                f"{chosen_task.name} needs more than a browser; play it on a desktop"
            )
        self._task = None
        self._state.clear()
        if self._machine is None:
            self._machine = SiteMachine(self._desktop)
        self._machine.renew(self._state)
        chosen_task.setup(self._machine)
        self._task = chosen_task
        return describe_task(chosen_task)

    def close(self) -> None:
        """End the browser and the sites."""
        super().close()
        self._close_sites()


def open_site_tasks(size: Size, task: str | Task = "compare_products") -> SiteTasks:
    """Start the sites and a browser with their tasks; `close` of the result ends both.

    Args:
        size: `(height, width)` of the screen in pixels.
        task: The task of a `reset` that names none.
    """
    folder = tempfile.TemporaryDirectory(prefix="agenthijack-sites-")
    state = SiteState(Path(folder.name))
    sites = LocalSites(state)

    def close_sites() -> None:
        sites.close()
        folder.cleanup()

    try:
        desktop = BrowserDesktop.up(size, 1, sites.arguments)
    except BaseException:
        close_sites()
        raise
    return SiteTasks(desktop, state, close_sites, task)
