"""The nine buttons of the desktop page.

Each corrupts the desktop that is shown, or takes the corruption back.
"""

import threading
from dataclasses import dataclass, replace
from typing import Any

from hijack_data._apply import apply
from hijack_data.corruption import Corruption, corruption_names, make_corruption
from hijack_data.errors import HijackError
from hijack_data.plan import Plan
from hijack_data.types import UInt8Array

from ..desktops.protocol import Desktop
from ..effects import find
from ..effects.descriptions import undone_in_words
from ..errors import DesktopError
from .desktop_corruption import corrupt_desktop, refuse_twice, undo_recorded
from .ledger import Ledger


@dataclass(frozen=True)
class Button:
    """The state of one corruption, as the page shows it.

    Attributes:
        name: of the corruption.
        about: the first sentence of its documentation.
        on: whether it is on the desktop now.
        ok: whether its probe was true, or whether it could be taken back.
        message: what the probe saw, what taking it back did, or the error; empty before the first
            press.
    """

    name: str
    about: str
    on: bool = False
    ok: bool = True
    message: str = ""


class Buttons:
    """Corrupts one desktop on request and remembers what is on it.

    What changes the machine is applied to the machine and written into `ledger`, so that `hijack
    desktop corrupt --undo` finds it too. What changes only the picture is planned on the present
    screen and drawn into every frame. A click cannot be taken back, so its button never stays on.
    One press is carried out at a time.

    Args:
        desktop: the desktop that the page shows.
        ledger: what was applied to that desktop by hand.
        seed: of the first press; each later one has the next, so that pressing again draws anew.
    """

    def __init__(self, desktop: Desktop, ledger: Ledger, seed: int = 0) -> None:
        self._desktop = desktop
        self._ledger = ledger
        self._seed = seed
        self._lock = threading.Lock()
        self._plans: dict[str, Plan] = {}
        self._buttons = {name: Button(name, _about(name)) for name in corruption_names()}

    def all(self) -> list[Button]:
        """Return all buttons in the order of the paper, with what is on the desktop now."""
        return [self._button(name) for name in self._buttons]

    def _button(self, name: str) -> Button:
        applied = {entry["corruption"] for entry in self._ledger.entries()}
        is_on = name in applied or name in self._plans
        return replace(self._buttons[name], on=is_on)

    def press(self, name: str) -> Button:
        """Apply a corruption, or take it back if it is on the desktop.

        Args:
            name: of the corruption.

        Returns:
            The button after that.

        Raises:
            DesktopError: There is no button of that name.
        """
        if name not in self._buttons:
            raise DesktopError(f"no button {name!r}; there are: {', '.join(self._buttons)}")
        with self._lock:
            try:
                if self._button(name).on:
                    ok, message = self._take_back(name)
                else:
                    ok, message = self._corrupt(make_corruption(name))
            except HijackError as error:
                ok = False
                message = str(error)
            self._buttons[name] = replace(self._buttons[name], ok=ok, message=message)
        return self._button(name)

    def frame(self, screen: UInt8Array) -> tuple[UInt8Array, str]:
        """Return the picture that an agent sees of `screen`.

        Args:
            screen: uint8 RGB `[H, W, 3]`.

        Returns:
            The picture, and a text that differs if other plans were drawn.
        """
        pressed = list(self._plans.values())  # a press in another thread may add to them meanwhile
        plans = [plan for plan in pressed if plan.size == screen.shape[:2]]
        # Every plan was made for the whole screen, so what makes the picture smaller comes last.
        plans.sort(key=lambda plan: plan.out_size != plan.size)
        for plan in plans:
            screen = apply(plan, screen)
        return screen, " ".join(plan.digest() for plan in plans)

    def _corrupt(self, spec: Corruption) -> tuple[bool, str]:

        refuse_twice(self._desktop, spec, self._ledger, "this desktop")
        noted: list[dict[str, Any]] = []
        applied = corrupt_desktop(
            self._desktop,
            spec,
            seed=self._seed,
            note=lambda records: noted.append(self._ledger.add(spec.name, records)),
        )
        self._seed += 1
        lasting = [record for record in applied.records if find(record["effect"]).lasting]
        if not applied.records:
            self._plans[spec.name] = applied.plan
        elif not lasting:
            self._ledger.drop(noted[-1])
        return applied.ok, applied.saw

    def _take_back(self, name: str) -> tuple[bool, str]:

        if self._plans.pop(name, None) is not None:
            return True, "no longer drawn into the picture; the machine was never changed"
        is_all_undone = True
        messages: list[str] = []
        for _, kind, result in undo_recorded(self._desktop, name, self._ledger):
            is_all_undone = is_all_undone and result.ok
            messages.append(undone_in_words(kind, result.facts, result.problem))
        return is_all_undone, "; ".join(messages)


def _about(name: str) -> str:
    lines = (make_corruption(name).__doc__ or "").strip().splitlines()
    return lines[0] if lines else ""
