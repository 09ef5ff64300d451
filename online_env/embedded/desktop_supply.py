"""A supply of pristine desktops.

There is the present one, and with `standby` one that is ready before it is needed.
"""

import atexit
import os
from dataclasses import replace
from typing import Any

from ..errors import DesktopError
from .handle import Handle
from .runtime import hidden_folders, registry
from .runtime.desktop_config import DesktopConfig


class DesktopSupply:
    """Builds desktops to one order, one after the other; at most two are up at a time.

    Args:
        order: what each desktop is like; the second and later ones get `-2`, `-3` ... after its
            name.
        standby: start the next desktop as soon as the present one is handed out.
    """

    def __init__(self, order: DesktopConfig, standby: bool = False) -> None:
        self._order = order
        self._standby = standby
        self._present: Handle | None = None
        self._spare: Handle | None = None
        self._leaving: list[Handle] = []
        self._made = 0
        self._owner = os.getpid()
        atexit.register(self.close)

    def next(self) -> dict[str, Any]:
        """End the present desktop and return the record of a pristine one.

        At once if one stands by. If it cannot be built, that is a `DesktopError`; the next call
        tries again.
        """
        if self._present is not None:
            self._present.close(wait=False)
            self._leaving.append(self._present)
            self._present = None
        spare = self._spare
        self._spare = None
        self._present = self._fit(spare) or self._start()
        record = self._present.wait()
        self._collect(wait=False)
        if self._standby:
            self._spare = self._start()
        return record

    def ready(self) -> bool:
        """Wait for the standby desktop; returns whether there is one."""
        return self._spare is not None and bool(self._spare.wait())

    def ended(self) -> str | None:
        """Return why the present desktop has ended by itself, or `None`."""
        return "it was closed" if self._present is None else self._present.ended()

    def close(self) -> None:
        """End all desktops and wait until nothing is left of them."""
        atexit.unregister(self.close)
        if os.getpid() != self._owner:
            return  # a fork of the controller: the desktops are not its to end
        handles = [h for h in (self._present, self._spare) if h is not None]
        self._present = self._spare = None
        for handle in handles:
            handle.close(wait=False)
        self._leaving += handles
        self._collect(wait=True)

    def _fit(self, spare: Handle | None) -> Handle | None:
        """The spare, unless it failed to start, has died while it stood by, or shows too much."""
        if spare is None:
            return None
        try:
            spare.wait()
        except DesktopError:
            return None
        # One that stands by since before a folder was to be hidden would show it.
        if spare.ended() is None and set(hidden_folders.hidden()) <= set(spare.order.hidden):
            return spare
        spare.close()
        return None

    def _start(self) -> Handle:
        self._made += 1
        name = numbered_name(self._order.name, self._made)
        return Handle(replace(self._order, name=name, hidden=hidden_folders.hidden()))

    def _collect(self, wait: bool) -> None:
        for handle in list(self._leaving):
            if wait or handle.has_ended():
                handle.close()
                self._leaving.remove(handle)


def numbered_name(name: str | None, number: int) -> str | None:
    """Return the name of the desktop with this number, the first being 1, of those of one order."""
    if name is None or number == 1:
        return name
    end = f"-{number}"
    return f"{name[: registry.MAX_NAME_LENGTH - len(end)]}{end}"
