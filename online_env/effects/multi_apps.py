"""Multi apps on a live machine: another application next to the task's, both visible.

The spec is `hijack_data/corruptions/multi_apps.py`, its look in recordings
`pipelines/edits/multi_apps.py`.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, TypeAlias

from hijack_data.apps import normalize_app

from ..desktops.protocol import Capability
from ..errors import MissingCapabilityError
from .app_minimization import on_screen
from .apps import COMMANDS, FALLBACKS, Command
from .base import EffectError, EffectRecord, LiveEffect, Probe, Undone, register
from .descriptions import short
from .guest import Guest

LAUNCH_TIMEOUT_S = 60.0  # s for a window to appear (GIMP's first one takes long)
DRAW_TIMEOUT_S = 20.0  # s for the window to be drawn
CLOSE_TIMEOUT_S = 6.0  # s for the window to close
SIZE_TOLERANCE_PIXELS = (
    40  # pixels: a terminal grows by whole characters, a shadow is not part of a window
)
# `setsid`, so that a hanging launch can be ended with all its children; its process number is that
# of the session.
_START = 'setsid "$@" </dev/null >/dev/null 2>&1 & echo $!'
_END = """for s in TERM KILL; do pkill -$s -s "$1" || exit 0; for i in 1 2 3 4 5 6 7 8; do
pgrep -s "$1" >/dev/null || exit 0; sleep 0.05; done; done"""
_MAXIMISED = {"maximized_horz", "maximized_vert"}

_WindowData: TypeAlias = Mapping[str, Any]


@register
class LaunchApp(LiveEffect):
    """Starts another application, and tiles its window with the one in front.

    The first application that is installed and opens a window is used.
    """

    kind: ClassVar[str] = "launch_app"
    needs: ClassVar[frozenset[Capability]] = frozenset({"apps", "windows"})

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Start applications in turn until one shows a window, then place both windows."""
        before = guest.x("state")
        record: EffectRecord = {
            "attempts": [],
            "window": None,
            "beside": _in_front(before),
            "asked": {},
            "under": {},
            "active": before["active"],
        }
        is_tiled = bool(params.get("tile", True))
        for name, command in _choices(guest, _applications(params), before):
            if self._launch(guest, record, before, name, command, is_tiled=is_tiled):
                break
        return record

    def _launch(
        self,
        guest: Guest,
        record: EffectRecord,
        before: _WindowData,
        name: str,
        command: Command,
        *,
        is_tiled: bool,
    ) -> bool:
        """Start one application; return whether its window appeared and was drawn.

        Raises:
            EffectError: The guest cannot start programs now.
        """
        started = guest.shell(_START, *command.argv)
        session = started.output.strip()
        if not session.isdecimal():  # to end session 0 would end the shell's own
            problem = (started.error or started.output).strip()[-200:]
            raise EffectError(f"launch_app: {command.argv[0]} could not be started: {problem}")
        attempt: EffectRecord = {
            "app": name,
            "argv": list(command.argv),
            "session": int(session),
            "stand_in": command.stand_in,
        }
        record["attempts"].append(attempt)
        ids_before = [window["id"] for window in before["windows"]]
        classes = list(command.classes)
        window = guest.x("await_window", LAUNCH_TIMEOUT_S, before=ids_before, classes=classes)[
            "window"
        ]
        attempt |= {"came": window is not None, "drawn": False}
        if window is None:
            guest.shell(_END, session)
            return False
        frames = _halves(before["area"], record["beside"], window) if is_tiled else {}
        drawing = guest.x("drawn", DRAW_TIMEOUT_S, number=window["id"], frames=frames)
        attempt["drawn"] = drawing["drawn"]
        record["under"] = {**drawing["under"], **record["under"]}
        record |= {"window": window, "classes": classes, "session": int(session), "asked": frames}
        if attempt["drawn"]:
            return True
        self.undo(guest, record)
        # the window of a hanging program can be closed without its help
        guest.shell(_END, session)
        return False

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Look for a new window of the launched class, mapped and at the requested place."""
        facts: EffectRecord = {"attempts": record["attempts"], "asked": record["asked"]}
        if record["window"] is None:
            tried_apps = ", ".join(attempt["app"] for attempt in record["attempts"])
            return Probe(
                False, facts, f"no window came within {LAUNCH_TIMEOUT_S:g} s of: {tried_apps}"
            )
        windows = {str(window["id"]): window for window in guest.x("state")["windows"]}
        window = windows.get(str(record["window"]["id"]))
        facts["window"] = window
        if window is None:
            return Probe(False, facts, "the window of the other application is gone")
        problems = _problems(window, record)
        for number, frame in record["asked"].items():
            problems += _misplaced(windows.get(number), frame)
        return Probe(not problems, facts, "; ".join(problems))

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Close the window, end its application if it still runs, and restore the other window."""
        if not record.get("window"):
            return Undone(True, {"closed": False, "why": "nothing is known to have been launched"})
        number = record["window"]["id"]
        forced = bool(guest.x("close", CLOSE_TIMEOUT_S, ids=[number])["left"])
        if forced:
            guest.shell(_END, str(record["session"]))
        windows = {window["id"]: window for window in guest.x("state")["windows"]}
        self._put_back(guest, record, windows)
        guest.x("activate", number=record.get("active", 0))
        is_closed = number not in windows
        problem = "" if is_closed else "the window of the other application is still there"
        return Undone(is_closed, {"closed": is_closed, "forced": forced}, problem)

    def in_words(self, facts: Mapping[str, Any]) -> str:
        """Return which window appeared, and where it is."""
        attempt = facts["attempts"][-1]
        window = facts["window"]
        stand_in = f" ({attempt['stand_in']})" if attempt["stand_in"] else ""
        x1, y1, x2, y2 = window["frame"]
        area = f"x {x1}-{x2}, y {y1}-{y2}"
        return f"a new window, {short(window['title'])}, is drawn at {area}{stand_in}"

    def undone_in_words(self, facts: Mapping[str, Any]) -> str:
        """Return that the window is closed, or why there was none."""
        return "the window is closed" if facts["closed"] else facts["why"]

    def _put_back(self, guest: Guest, record: EffectRecord, windows: Mapping[int, Any]) -> None:
        """Restore the place of the window next to ours.

        A window that filled the screen first gets the place that it had before that.
        """
        beside: dict[str, Any] | None = record["beside"]
        if beside is None or beside["id"] not in windows:
            return
        number = beside["id"]
        was_full = "fullscreen" in beside["states"]
        was = record.get("under", {}).get(str(number)) or beside
        if set(was["states"]) >= _MAXIMISED:
            guest.x("maximise", number=number)
        elif not was_full or was is not beside:
            guest.x("place", frames={str(number): was["frame"]})
        if was_full and "fullscreen" not in windows[number]["states"]:
            guest.x("fill", number=number)


def _problems(window: _WindowData, record: EffectRecord) -> list[str]:
    """Return the problems of the launched window, except for its place."""
    problems: list[str] = []
    if not window["mapped"]:
        problems.append("the window is not mapped")
    if not record["attempts"][-1]["drawn"]:
        problems.append("its application does not draw it, it hangs")
    if not any(name in window["class"].lower() for name in record["classes"]):
        problems.append(f"the window is of class {window['class']!r}, not of {record['classes']}")
    return problems


def _applications(params: Mapping[str, Any]) -> list[str]:
    names = [params.get("app"), *params.get("then", ())]
    if not all(isinstance(name, str) for name in names):
        raise EffectError(f"launch_app: app and then must name applications, got {names!r:.200}")
    return [normalize_app(name) for name in names]


def _choices(guest: Guest, names: Sequence[str], before: _WindowData) -> list[tuple[str, Command]]:
    """Return the commands to try, in order: the first installed one of each application.

    Raises:
        MissingCapabilityError: the guest lacks what it needs, which the message names.
    """
    commands_by_name = {name: COMMANDS.get(name, (Command((name,), (name,)),)) for name in names}
    commands = [
        command for group in (*commands_by_name.values(), *FALLBACKS.values()) for command in group
    ]
    programs = guest.installed("setsid", *(command.argv[0] for command in commands))
    preferred: list[tuple[str, Command]] = []
    for name in names:
        installed = [command for command in commands_by_name[name] if command.argv[0] in programs]
        if installed:
            preferred.append((name, installed[0]))
    choices = preferred or _fallbacks(programs, before)
    if not choices:
        raise MissingCapabilityError(
            f"none of these applications is installed in the guest: {', '.join(names)}"
        )
    if "setsid" not in programs:
        raise MissingCapabilityError(
            "the guest has no setsid (apt-get install util-linux), which starts applications"
        )
    return choices


def _fallbacks(programs: set[str], before: _WindowData) -> list[tuple[str, Command]]:
    """Return the fallbacks that are installed and have no open window."""
    open_now = " ".join(window["class"].lower() for window in before["windows"])
    choices: list[tuple[str, Command]] = []
    for name, (command,) in FALLBACKS.items():
        if command.argv[0] in programs and name not in open_now:
            choices.append((name, command))
    return choices


def _halves(
    area: Sequence[int], beside: _WindowData | None, new: _WindowData
) -> dict[str, list[int]]:
    """Return the places of two windows: the formerly active one left, the new one right."""
    x1, y1, x2, y2 = area
    middle = (x1 + x2) // 2
    places: dict[str, list[int]] = {}
    if beside:
        places[str(beside["id"])] = [x1, y1, middle, y2]
    places[str(new["id"])] = [middle, y1, x2, y2]
    return places


def _in_front(state: _WindowData) -> dict[str, Any] | None:
    """Return the window in front: the active one, otherwise the topmost."""
    windows = [window for window in on_screen(state) if window["type"] == "normal"]
    windows.sort(key=lambda window: window["id"] == state["active"])
    return windows[-1] if windows else None


def _misplaced(window: _WindowData | None, requested: Sequence[int]) -> list[str]:
    """Return what is wrong with the place of a window.

    It may be larger than requested if it cannot be as small.
    """
    if window is None:
        return ["the window beside it is gone"]
    frame = window["frame"]
    excess = [_excess(window, requested, side) for side in (0, 1)]
    slack = [SIZE_TOLERANCE_PIXELS + extra for extra in (*excess, *excess)]
    if all(
        abs(have - want) <= room for have, want, room in zip(frame, requested, slack, strict=True)
    ):
        return []
    return [f"{window['title']!r} is at {frame}, not at {list(requested)}"]


def _excess(window: _WindowData, requested: Sequence[int], side: int) -> int:
    """Return by how many pixels a window must exceed the requested size; side 0 is its width."""
    frame = window["frame"]
    box = window["box"]
    margin = (frame[side + 2] - frame[side]) - (box[side + 2] - box[side])
    length = requested[side + 2] - requested[side]
    return max(0, window["least"][side] + margin - length)
