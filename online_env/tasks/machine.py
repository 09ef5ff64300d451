"""The machine as a task's author uses it: files of the user's home, programs, stored site state."""

import fnmatch
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePosixPath
from typing import Any, cast

from ..desktops import commands
from ..desktops.protocol import Desktop
from ..embedded.sites.state import SITES, SiteState
from ..errors import DesktopError, DesktopTimeoutError, GuestError, MissingPackageError
from .hand import Hand
from .idle import wait_until_idle
from .task_apps import APPS, PAGE_ERROR, TaskApp, find_app

# One entry a file, folder or link that is not hidden: kind, mode and path; then the digests. A file
# that the user may not read, or that goes meanwhile, has none (and xargs ends with 123).
_LIST = r"""cd "$HOME" || exit 1
find . -mindepth 1 -name '.*' -prune -o -printf '%y %m %l\t%P\0'
printf '\0'
find . -mindepth 1 -name '.*' -prune -o -type f -print0 |
    xargs -0 -r sha256sum -z -- || [ $? = 123 ]"""

_PATHS_PER_COMMAND = 400  # a command may have 2 MiB of arguments


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """What a machine held at one time.

    Args:
        files: By path relative to the home folder: kind, mode, where a link leads, and digest, in
            one text. What is hidden, or in a hidden folder, is left out. What is no file, or
            cannot be read, has no digest.
        sites: The stored state of each local site.
    """

    files: Mapping[str, str]
    sites: Mapping[str, Mapping[str, Any]]


class Machine:
    """A desktop and the state of its local sites.

    Paths are relative to the user's home folder; absolute ones are taken as they are.

    Args:
        desktop: The desktop.
        sites: The state of its local internet, `None` if it has none.
    """

    def __init__(self, desktop: Desktop, sites: SiteState | None = None) -> None:
        self.desktop = desktop
        self._offline = False
        self._sites = sites
        self._at_first: Snapshot | None = None
        self._before: Snapshot | None = None

    def renew(self, sites: SiteState | None, *, offline: bool = False) -> None:
        """Begin anew after the desktop was reset, which gives its local internet another state.

        An agent that was given the machine keeps it across a re-initialisation.

        Args:
            sites: The state of its local internet, `None` if it has none.
            offline: Whether its network was cut before the task is set up: then the browser is
                expected to show its error page instead of the task's page.
        """
        self._offline = offline
        self._sites = sites
        self._at_first = None
        self._before = None

    @property
    def sites(self) -> SiteState:
        """The state of the local sites.

        Raises:
            DesktopError: The desktop has no local internet.
        """
        if self._sites is None:
            raise DesktopError(
                "the task needs the local internet of an embedded desktop, and its state folder"
            )
        return self._sites

    @cached_property
    def home(self) -> str:
        """The home folder of the desktop's user."""
        return commands.home(self.desktop)

    def path(self, path: str = "") -> str:
        """Return the absolute path."""
        return str(PurePosixPath(self.home, path))

    # Files

    def write(self, path: str, content: str | bytes) -> None:
        """Write a file; its folders are made."""
        full_path = self.path(path)
        data = content.encode() if isinstance(content, str) else content
        try:
            self.desktop.write_file(full_path, data)
        except GuestError:  # most guests make folders, and a command for each file takes long
            self.run("mkdir", "-p", str(PurePosixPath(full_path).parent))
            self.desktop.write_file(full_path, data)

    def read(self, path: str) -> bytes | None:
        """Return the content of a file, or `None` if there is none.

        Raises:
            DesktopError: The desktop cannot tell whether the file is there.
            GuestError: The file cannot be read.
        """
        full_path = self.path(path)
        if not commands.ran(self.desktop, "test", "-f", full_path).ok:
            return None
        try:
            return self.desktop.read_file(full_path)
        except GuestError as error:
            if error.status == 404:  # removed in between
                return None
            raise

    def text(self, path: str) -> str | None:
        """Return a text file without a byte order mark, `None` if there is none.

        Line ends become line feeds; bytes that are not UTF-8 become U+FFFD.
        """
        data = self.read(path)
        if data is None:
            return None
        text = data.decode("utf-8-sig", "replace")
        return text.replace("\r\n", "\n")

    def exists(self, path: str) -> bool:
        """Return whether there is a file, folder or link.

        Raises:
            DesktopError: The desktop cannot tell.
        """
        full_path = self.path(path)
        return commands.ran(self.desktop, "test", "-e", full_path, "-o", "-L", full_path).ok

    def names(self, folder: str) -> set[str] | None:
        """Return the names in a folder, hidden ones as well, or `None` if there is none.

        Raises:
            DesktopError: The desktop cannot tell.
        """
        command = ["find", self.path(folder), "-mindepth", "1", "-maxdepth", "1"]
        result = commands.ran(self.desktop, *command, "-printf", r"%f\0")
        if not result.ok:
            return None
        return {name for name in result.output.split("\0") if name}

    # Programs

    def run(self, *argv: str) -> str:
        """Return the output of a command, in the home folder, that must succeed.

        Raises:
            DesktopError: It failed.
        """
        within = ("env", "-C", self.home)
        return commands.command(self.desktop, *within, *argv)

    def open(self, app: str, *arguments: str) -> None:
        """Start an application and wait until its window is there.

        Args:
            app: A name of `task_apps.APPS`.
            *arguments: Files (paths from the root) or addresses to open.
        """
        task_app = find_app(app)
        try:
            self._start(task_app, arguments)
        except DesktopTimeoutError:
            # Chromium now and then shows a window whose page never reaches the tree.
            commands.end(self.desktop, *task_app.processes)
            self._start(task_app, arguments)

    def _start(self, task_app: TaskApp, arguments: Sequence[str]) -> None:
        commands.launch(self.desktop, *task_app.argv, *arguments)
        hand = Hand(self.desktop, timeout=task_app.timeout)
        for role in task_app.ready:
            hand.find(role, app=task_app.tree)
        if any(argument.startswith("http://") for argument in arguments):
            # The window is there before its page.
            if self._offline:
                hand.find("static", PAGE_ERROR, app=task_app.tree)
            else:
                hand.find("link", app=task_app.tree)

    def command_line(self, app: str, *arguments: str) -> str:
        """Return what a person types to start an application."""
        return shlex.join([*find_app(app).argv, *arguments])

    def wait_until_idle(self, apps: Iterable[str]) -> None:
        """Wait until applications have nothing left to do, such as a file to save; at most 20 s.

        Args:
            apps: Names of `task_apps.APPS`; others are not looked at.
        """
        processes = [name for app in apps if app in APPS for name in APPS[app].processes]
        if processes:
            wait_until_idle(self.desktop, processes)

    def check_installed(self, apps: Iterable[str]) -> None:
        """Check that applications are there; names that are not in the table are not checked.

        Raises:
            MissingPackageError: One is not; the message names the profile to install.
        """
        for name in apps:
            task_app = APPS.get(name)
            if task_app is None:
                continue
            if not commands.ran(self.desktop, "sh", "-c", f"command -v {task_app.argv[0]}").ok:
                raise MissingPackageError(
                    f"{task_app.argv[0]} is not on the desktop, and the task uses it: "
                    f"hijack desktop install --profile {task_app.profile}"
                )

    # What changed

    @property
    def before(self) -> Snapshot:
        """What the machine held when the task was prepared.

        Raises:
            DesktopError: `remember` was not called.
        """
        if self._before is None:
            raise DesktopError("nothing was noted of the machine: call task.setup first")
        return self._before

    def begin(self) -> None:
        """Note what the machine holds before a task is prepared, for `clear`."""
        self._at_first = self.snapshot()

    def remember(self) -> None:
        """Note what the machine holds once a task is prepared."""
        self._before = self.snapshot()

    def snapshot(self) -> Snapshot:
        """Return what the machine holds now.

        Raises:
            DesktopError: The home folder cannot be listed.
        """
        result = self.desktop.execute(["sh", "-c", _LIST])
        if not result.ok:
            raise DesktopError(f"the home folder cannot be listed: {result.error.strip()[-300:]}")
        listed, _, digests = result.output.partition("\0\0")
        files: dict[str, str] = {}
        for entry in listed.split("\0"):
            look, _, path = entry.partition("\t")
            if path:
                files[path] = look
        for entry in digests.strip("\0").split("\0"):
            digest, _, path = entry.partition("  ./")
            if path in files:
                files[path] += f" {digest}"
        return Snapshot(files=files, sites=self._stored())

    def unexpected_changes(self, *but: str) -> Iterator[str]:
        """Yield what was added, removed or changed in the home folder and should not have been.

        Hidden files are not looked at. Folders that had to be made for what is allowed are fine.

        Args:
            *but: Paths that may differ, or patterns; `*` stands for `/`, too.
        """
        was = self.before.files
        after = self.snapshot().files
        for path in sorted({*was, *after}):
            if was.get(path) == after.get(path) or _is_allowed(path, but):
                continue
            if path not in after:
                yield f"{path} is gone"
            elif path in was:
                yield f"{path} was changed"
            else:
                yield f"{path} was added"

    def unexpected_site_changes(self, but: Iterable[str] = ()) -> Iterator[str]:
        """Yield the local sites whose stored state differs from before, but for some.

        Whether a mail was read does not count, nor a cart that is empty again.
        """
        was = self.before.sites
        after = self._stored()
        for site in SITES:
            if site not in but and _without_empty_values(was.get(site)) != _without_empty_values(
                after.get(site)
            ):
                yield f"{site}.test was used to change something"

    def _stored(self) -> dict[str, dict[str, Any]]:
        if self._sites is None:
            return {}
        return {site: self._sites.read(site) for site in SITES}

    def clear(self, apps: Iterable[str]) -> None:
        """End applications, forget what the sites stored, remove what was added to the home.

        Without `begin` no file is removed.
        """
        for app in apps:
            if app in APPS:
                commands.end(self.desktop, *APPS[app].processes)
        if self._sites is not None:
            self._sites.clear()
        if self._at_first is None:
            return
        new_paths = self.snapshot().files.keys() - self._at_first.files.keys()
        top_paths = sorted(path for path in new_paths if path.rpartition("/")[0] not in new_paths)
        for start in range(0, len(top_paths), _PATHS_PER_COMMAND):
            self.run("rm", "-rf", "--", *top_paths[start : start + _PATHS_PER_COMMAND])


def _without_empty_values(stored: Any) -> Any:
    """Return stored state without what is empty or false, and which mails were read."""
    if isinstance(stored, list):
        return [_without_empty_values(value) for value in cast("list[Any]", stored)]
    if not isinstance(stored, dict):
        return stored
    state = cast("dict[str, Any]", stored)
    cleaned = {key: _without_empty_values(value) for key, value in state.items() if key != "read"}
    return {key: value for key, value in cleaned.items() if value}


def _is_allowed(path: str, patterns: Iterable[str]) -> bool:
    """Return whether a path is allowed to differ, or is a folder above what is."""
    for pattern in patterns:
        if path == pattern or fnmatch.fnmatchcase(path, pattern):  # `[` is no pattern in a name
            return True
        if pattern.startswith(f"{path}/"):
            return True
    return False
