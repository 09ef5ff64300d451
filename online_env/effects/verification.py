"""Verification on a live machine: the session is locked and asks for the password.

The spec is `hijack_data/corruptions/verification.py`, its look in recordings
`pipelines/edits/verification.py`.
"""

import time
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ..desktops.lockers import BY_NAME, LOCKERS, REMEDY, SESSION_BUS, Locker
from ..desktops.protocol import Capability
from ..errors import MissingCapabilityError
from .base import EffectError, EffectRecord, LiveEffect, Probe, Undone, register
from .guest import SYSTEM_PATH, Guest

LOCK_TIMEOUT_S = (
    12.0  # s for the locker to answer, to lock, to draw or to unlock; ample for a busy machine
)
FORCED_UNLOCK_TIMEOUT_S = 6.0  # s to unlock without the password
SHELL_TIMEOUT_S = 10 * LOCK_TIMEOUT_S  # s for a shell that waits: each of its looks takes time, too
MIN_COLOURS = 16  # colours: fewer are a blank screen
POLL_S = 0.02
# The words that lockers answer with, and no folder of the user's before the system's.
_CLEAN = f"export LC_ALL=C PATH={SYSTEM_PATH}; {SESSION_BUS}"
# A shell waits, not we: each question over the wire would cost more than the answer.
_AWAIT = (
    "for i in $(seq {times}); do {query} 2>/dev/null | grep -qF '{word}' && exit 0; sleep {tick};"
    " done; exit 1"
)
# One line for each that is installed and able to lock: its program, and what it answers.
_ASK_ALL = f"{_CLEAN}\n" + "\n".join(
    f"command -v {locker.name} >/dev/null 2>&1 && {locker.able} && "
    f"echo {locker.name} $(timeout 3 {locker.query} 2>&1)"
    for locker in LOCKERS
)


@register
class LockSession(LiveEffect):
    """Locks the session with the locker that the guest has."""

    kind: ClassVar[str] = "lock"
    needs: ClassVar[frozenset[Capability]] = frozenset({"lock"})

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Lock, wait until the locker confirms it, and wake its dialog.

        A locked screen is black until a key comes.
        """
        locker, already = self._locker(guest)
        if not already:
            guest.shell(
                f"{_CLEAN}; {locker.lock}; {_wait(locker, locker.on)}", timeout=SHELL_TIMEOUT_S
            )
        guest.keys("wake")
        return {"locker": locker.name, "already": already, "drawn": self._wait_until_drawn(guest)}

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Look whether the locker covers the screen and holds the keyboard.

        A key that is typed must reach no other client.
        """
        locker = BY_NAME[record["locker"]]
        facts = {"locker": locker.name, "active": _active(guest, locker) is True}
        if not facts["active"]:
            reason = "it never was, it was unlocked, or the locker has ended"
            return Probe(False, facts, f"the session is not locked, {locker.name} says: {reason}")
        facts |= guest.keys("lock", typed=True)
        expected = {
            "no window of the locker covers the screen": facts["covers"] or not locker.window,
            "the keyboard is free": facts["keyboard"],
            # Once the dialog shows, a locker lets the pointer go: whatever it clicks is on the
            # locker's own window.
            "the pointer is free": facts["pointer"] or facts["covers"],
            "a typed key reached another client": not facts["typed_reaches"],
        }
        problems = [problem for problem, fine in expected.items() if not fine]
        return Probe(not problems, facts, "; ".join(problems))

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Unlock as a person does, with the password; where that fails, without it."""
        name = record.get("locker")
        locker = BY_NAME[name] if name else self._locker(guest)[0]
        if _active(guest, locker) is not True:
            return self._report_unlock(guest, locker, "was not locked")
        typed = guest.keys("enter", text=guest.password)["typed"]
        if (
            typed
            and guest.shell(f"{_CLEAN}; {_wait(locker, locker.off)}", timeout=SHELL_TIMEOUT_S).ok
        ):
            return self._report_unlock(guest, locker, "password")
        guest.shell(
            f"{_CLEAN}; {locker.force}; {_wait(locker, locker.off, FORCED_UNLOCK_TIMEOUT_S)}",
            timeout=SHELL_TIMEOUT_S,
        )
        return self._report_unlock(guest, locker, "force")

    def refresh(self, guest: Guest, record: EffectRecord) -> None:
        """Wake the dialog again: after a minute without input the locker blanks the screen."""
        if not _is_drawn(guest) and _active(guest, BY_NAME[record["locker"]]):
            guest.keys("wake")
            self._wait_until_drawn(guest)

    def in_words(self, facts: Mapping[str, Any]) -> str:
        """Return what the locker holds."""
        facts_held: list[str] = []
        if facts["covers"]:
            facts_held.append("its window covers the screen")
        if facts["keyboard"]:
            facts_held.append("it holds the keyboard")
        return (
            f"{facts['locker']} says locked, {' and '.join(facts_held)}; a typed key reached no"
            " application"
        )

    def undone_in_words(self, facts: Mapping[str, Any]) -> str:
        """Return how the session was unlocked."""
        if facts["by"] in ("password", "force"):
            return f"unlocked, by {facts['by']}"
        return "it is not locked: it never was, somebody unlocked it, or the locker ended"

    def _locker(self, guest: Guest) -> tuple[Locker, bool]:
        """Return the first locker that answers, and whether the session is locked already.

        Raises:
            EffectError: the guest cannot do it; the message says why.
            MissingCapabilityError: the guest lacks what it needs, which the message names.
        """
        end = time.monotonic() + LOCK_TIMEOUT_S
        while True:
            answers = _answers(guest)
            for name, answer in answers.items():
                active = _meaning(BY_NAME[name], answer)
                if active is not None:
                    return BY_NAME[name], active
            if time.monotonic() > end or not answers:
                break
            time.sleep(0.1)
        if answers:  # the guest has what it needs, and it does not work now
            silent = ", ".join(answers)
            raise EffectError(
                f"the guest cannot lock its session: {silent} is installed, but no locker answers;"
                f" {REMEDY}"
            )
        raise MissingCapabilityError(
            f"the guest cannot lock its session: it has no locker; {REMEDY}"
        )

    def _report_unlock(self, guest: Guest, locker: Locker, by: str) -> Undone:
        """Return how the session was left, once its screen has had time to come back."""
        active = _active(guest, locker) is True
        end = time.monotonic() + FORCED_UNLOCK_TIMEOUT_S
        screen = guest.keys("lock", typed=False)
        while screen["covers"] and screen["keyboard"] and time.monotonic() < end:
            time.sleep(POLL_S)
            screen = guest.keys("lock", typed=False)
        facts = {"by": by, "active": active, "keyboard": screen["keyboard"], "top": screen["top"]}
        problem = ""
        if active:
            problem = "the session is still locked"
        elif screen["covers"] and screen["keyboard"]:
            problem = "a window that holds the keyboard covers the screen"
        return Undone(not problem, facts, problem)

    def _wait_until_drawn(self, guest: Guest) -> bool:
        end = time.monotonic() + LOCK_TIMEOUT_S
        while time.monotonic() < end:
            if _is_drawn(guest):
                return True
            time.sleep(0.05)
        return False


def _is_drawn(guest: Guest) -> bool:
    picture = guest.desktop.screenshot()[::8, ::8].reshape(-1, 3)
    return len(np.unique(picture, axis=0)) > MIN_COLOURS


def _answers(guest: Guest) -> dict[str, str]:
    """Return what each locker that is installed answers."""
    answers: dict[str, str] = {}
    for line in guest.shell(_ASK_ALL).output.splitlines():
        name, _, answer = line.partition(" ")
        answers[name] = answer
    return answers


def _active(guest: Guest, locker: Locker) -> bool | None:
    """Return whether the session is locked; `None` if the locker does not answer."""
    return _meaning(locker, guest.shell(f"{_CLEAN}; timeout 3 {locker.query}").output)


def _meaning(locker: Locker, answer: str) -> bool | None:
    if locker.on in answer:
        return True
    if locker.off in answer:
        return False
    return None


def _wait(locker: Locker, word: str, timeout: float = LOCK_TIMEOUT_S) -> str:
    return _AWAIT.format(
        times=round(timeout / (2 * POLL_S)), query=locker.query, word=word, tick=POLL_S
    )
