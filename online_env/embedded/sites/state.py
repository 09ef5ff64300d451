"""The stored state of the sites: JSON files in one folder, which task validators read.

One file a site (`forms.json`, `mail.json`, `shop.json`, `wiki.json`), absent as long as nothing was
done there. Every write goes to a new file that replaces the old one, so a reader never sees half of
it, and a lock keeps two writers apart, also from different processes: a task may put things in
place while the server runs.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn, cast

from hijack_data.locking import Lock, lock

SITES = ("forms", "mail", "shop", "wiki")
MAX_BYTES = 4 * 2**20


class StorageFullError(Exception):
    """A site that would keep more than `MAX_BYTES`; the server answers 507."""


class SiteState:
    """The state folder. It is made if it is not there; an empty one is the pristine state.

    A folder that cannot be made is a `DesktopError`.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        except OSError as error:
            problem = f"cannot be made: {error.strerror}; give another --state folder"
            _refuse(self.folder, problem, error)

    def path(self, site: str) -> Path:
        """Return the file of one of `SITES`.

        Another name is a `DesktopError`.
        """
        if site not in SITES:
            _refuse(self.folder, f"holds no site {site!r}; known: {', '.join(SITES)}")
        return self.folder / f"{site}.json"

    def read(self, site: str) -> dict[str, Any]:
        """Return the stored state of `site`; empty if nothing was done there.

        A file that cannot be read, or is damaged, or a folder that is gone is a `DesktopError`.
        """
        path = self.path(site)
        try:
            value = json.loads(path.read_bytes())
        except FileNotFoundError:
            # The folder of a desktop goes with it: that nothing was done would be a guess.
            if not self.folder.is_dir():
                _refuse(path, "is gone with its folder; has the desktop ended?")
            return {}
        except OSError as error:
            _refuse(path, f"cannot be read: {error.strerror}", error)
        except (ValueError, RecursionError) as error:
            _refuse(path, f"is not JSON ({error}); start again with a new state folder", error)
        if not isinstance(value, dict):
            kind = type(value).__name__
            _refuse(path, f"holds a {kind}, not an object; start again with a new state folder")
        return cast("dict[str, Any]", value)

    @contextmanager
    def update(self, site: str) -> Iterator[dict[str, Any]]:
        """Change the stored state: the yielded dict is written if the block ends without an error.

        A file that cannot be written is a `DesktopError`.

        Raises:
            StorageFullError: It would be more than `MAX_BYTES`.
        """
        path = self.path(site)
        with self._lock():
            value = self.read(site)
            yield value
            data = json.dumps(value, ensure_ascii=False, indent=1).encode()
            if len(data) > MAX_BYTES:
                raise StorageFullError(
                    f"{site} would hold {len(data)} bytes, the limit is {MAX_BYTES}"
                )
            self._replace(path, data)

    def clear(self) -> None:
        """Forget what was done on all sites; errors are those of `update`."""
        for site in SITES:
            with self.update(site) as state:
                state.clear()

    def _replace(self, path: Path, data: bytes) -> None:
        draft = path.with_suffix(".json.new")
        try:
            draft.write_bytes(data)
            draft.replace(path)
        except OSError as error:
            draft.unlink(missing_ok=True)
            _refuse(path, f"cannot be written: {error.strerror}", error)

    def _lock(self) -> Lock:
        try:
            return lock(self.folder / ".lock", wait=True, mode=0o600)
        except OSError as error:
            _refuse(self.folder, f"cannot be locked: {error.strerror}", error)


def _refuse(path: Path, problem: str, cause: BaseException | None = None) -> NoReturn:
    from online_env.errors import DesktopError  # loads NumPy

    raise DesktopError(f"site state {path} {problem}") from cause
