"""Chromium's profile as it is stored: settings, bookmarks and history.

Chromium writes most of them some seconds after a change (`LAG`), and at once when it is closed. A
lock beside the profile tells whether it runs; where none is, nothing is waited for.
"""

import json
import sqlite3
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, TypeAlias, cast

from ...errors import DesktopError
from ..machine import Machine

PROFILE = ".config/google-chrome"
PREFERENCES = f"{PROFILE}/Default/Preferences"
BOOKMARKS = f"{PROFILE}/Default/Bookmarks"
HISTORY = f"{PROFILE}/Default/History"
BLOCKED = 2
GIVEN_PAGES = 4  # of `session.restore_on_startup`: pages that are named
LAG = 15.0  # s; settings were written 10 s after the change
BAR = "bookmark_bar"
_ROOTS = {BAR: "Bookmarks bar", "other": "Other bookmarks", "synced": "Mobile bookmarks"}
_EPOCH = 11_644_473_600  # s from 1601, when Chromium's clock begins, to 1970
_SCHEMA = """
CREATE TABLE meta(key LONGVARCHAR NOT NULL UNIQUE PRIMARY KEY, value LONGVARCHAR);
CREATE TABLE urls(id INTEGER PRIMARY KEY AUTOINCREMENT, url LONGVARCHAR, title LONGVARCHAR,
 visit_count INTEGER DEFAULT 0 NOT NULL, typed_count INTEGER DEFAULT 0 NOT NULL,
 last_visit_time INTEGER NOT NULL, hidden INTEGER DEFAULT 0 NOT NULL);
CREATE TABLE visits(id INTEGER PRIMARY KEY AUTOINCREMENT, url INTEGER NOT NULL,
 visit_time INTEGER NOT NULL, from_visit INTEGER, external_referrer_url TEXT,
 transition INTEGER DEFAULT 0 NOT NULL, segment_id INTEGER,
 visit_duration INTEGER DEFAULT 0 NOT NULL,
 incremented_omnibox_typed_score BOOLEAN DEFAULT FALSE NOT NULL, opener_visit INTEGER,
 originator_cache_guid TEXT, originator_visit_id INTEGER, originator_from_visit INTEGER,
 originator_opener_visit INTEGER, is_known_to_sync BOOLEAN DEFAULT FALSE NOT NULL,
 consider_for_ntp_most_visited BOOLEAN DEFAULT FALSE NOT NULL,
 visited_link_id INTEGER DEFAULT 0 NOT NULL, app_id TEXT);
INSERT INTO meta VALUES ('version', '70'), ('last_compatible_version', '16');
"""
_LINK_CLICKED = 0x30000000  # the visit begins and ends a chain of redirections

Bookmark: TypeAlias = "tuple[str, str | list[Bookmark]]"
"""A name with an address, or a folder's name with what is in it."""


def settled(machine: Machine, passes: Callable[[], bool]) -> bool:
    """Return whether a test passes, if need be once Chromium has written what was changed."""
    deadline = time.monotonic() + LAG
    while not passes():
        if not machine.exists(f"{PROFILE}/SingletonLock") or time.monotonic() > deadline:
            return passes()
        time.sleep(0.5)
    return True


# Settings


def setting(machine: Machine, path: str) -> Any:
    """Return a setting such as `"browser.show_home_button"`; `None` if it was never set."""
    value: Any = _json(machine, PREFERENCES)
    for key in path.split("."):
        if not isinstance(value, dict):
            return None
        value = cast("dict[str, Any]", value).get(key)
    return value


def change_setting(machine: Machine, path: str, value: Any) -> None:
    """Store a setting, while Chromium does not run."""
    whole = _json(machine, PREFERENCES)
    *folders, last = path.split(".")
    place = whole
    for key in folders:
        place = place.setdefault(key, {})
    place[last] = value
    machine.write(PREFERENCES, json.dumps(whole))


def wrong_settings(machine: Machine, wanted: Mapping[str, Any]) -> Iterator[str]:
    """Yield the settings that are not as wanted, by their paths; Chromium gets time to write."""

    def differing() -> list[str]:
        return [path for path, value in wanted.items() if setting(machine, path) != value]

    settled(machine, lambda: not differing())
    for path in differing():
        yield f"the setting {path} is {setting(machine, path)!r}, not {wanted[path]!r}"


# Bookmarks


def bookmarks(machine: Machine) -> dict[str, list[Bookmark]]:
    """Return the bookmarks by root: `bookmark_bar`, `other` and `synced`."""
    stored = _json(machine, BOOKMARKS).get("roots", {})
    return {root: _entries(stored.get(root, {})) for root in _ROOTS}


def write_bookmarks(machine: Machine, bar: Sequence[Bookmark], **other: Sequence[Bookmark]) -> None:
    """Store bookmarks, while Chromium does not run.

    Args:
        machine: Where.
        bar: Those of the bookmarks bar.
        **other: Those of other roots.
    """
    roots = {root: (bar if root == BAR else other.get(root, ())) for root in _ROOTS}
    stored = {root: _node(_ROOTS[root], list(entries)) for root, entries in roots.items()}
    machine.write(BOOKMARKS, json.dumps({"roots": stored, "version": 1}))


def in_order(entries: Iterable[Bookmark]) -> list[Bookmark]:
    """Return bookmarks sorted by name, in folders, too.

    Spaces in names do not count, and `http://a.test` is `http://a.test/`.
    """
    found: list[Bookmark] = []
    for written, value in entries:
        name = " ".join(written.split())
        if isinstance(value, list):
            found.append((name, in_order(value)))
        else:
            found.append((name, value.rstrip("/")))
    return sorted(found, key=str)


def wrong_bookmarks(machine: Machine, bar: Sequence[Bookmark]) -> Iterator[str]:
    """Yield why the bookmarks are not these, all in the bar, in whatever order."""

    def found() -> list[list[Bookmark]]:
        return [in_order(entries) for entries in bookmarks(machine).values()]

    wanted = [in_order(bar), [], []]
    if not settled(machine, lambda: found() == wanted):
        yield f"the bookmarks are {found()}"


def _entries(folder: Mapping[str, Any]) -> list[Bookmark]:
    return [
        (child["name"], child["url"] if "url" in child else _entries(child))
        for child in folder.get("children", ())
    ]


def _node(name: str, value: "str | list[Bookmark]") -> dict[str, Any]:
    if isinstance(value, str):
        return {"type": "url", "name": name, "url": value}
    return {"type": "folder", "name": name, "children": [_node(*entry) for entry in value]}


# History


def history(machine: Machine) -> set[str]:
    """Return the addresses of the history."""
    return {url for (url,) in _rows(machine, HISTORY, "SELECT url FROM urls WHERE NOT hidden")}


def write_history(machine: Machine, pages: Sequence[tuple[str, str]]) -> None:
    """Store a history, while Chromium does not run.

    Args:
        machine: Where.
        pages: Addresses and titles; the last one was visited a quarter of an hour ago, each other
            one a quarter of an hour before the next.
    """
    now = int(machine.run("date", "+%s")) + _EPOCH
    with tempfile.TemporaryDirectory(prefix="agenthijack-history-") as folder:
        path = Path(folder, "History")
        with closing(sqlite3.connect(path)) as base:
            base.executescript(_SCHEMA)
            for number, (url, title) in enumerate(pages, 1):
                then = (now - 900 * (len(pages) - number + 1)) * 1_000_000
                base.execute(
                    "INSERT INTO urls (url, title, visit_count, last_visit_time) VALUES (?,?,1,?)",
                    (url, title, then),
                )
                base.execute(
                    "INSERT INTO visits (url, visit_time, transition) VALUES (?,?,?)",
                    (number, then, _LINK_CLICKED),
                )
            base.commit()
        machine.write(HISTORY, path.read_bytes())


def _rows(machine: Machine, path: str, query: str) -> list[tuple[Any, ...]]:
    """Return the rows of a query of a copy; none if there is no such file yet."""
    data = machine.read(path)
    if not data:
        return []
    with tempfile.TemporaryDirectory(prefix="agenthijack-sqlite-") as folder:
        copy = Path(folder, "copy")
        copy.write_bytes(data)
        try:
            with closing(sqlite3.connect(copy)) as base:
                return base.execute(query).fetchall()
        except sqlite3.Error as error:
            raise DesktopError(f"{path} cannot be read: {error}") from None


def _json(machine: Machine, path: str) -> dict[str, Any]:
    data = machine.read(path)
    if data is None:
        return {}
    try:
        value = json.loads(data)
    except ValueError as error:
        raise DesktopError(f"{path} is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise DesktopError(f"{path} holds {type(value).__name__} and no object")
    return cast("dict[str, Any]", value)


# Exceptions for sites


def exceptions(machine: Machine, kind: str) -> dict[str, int]:
    """Return what was decided for sites, by their patterns: 1 is to allow, 2 is to block.

    Args:
        machine: Where.
        kind: Such as `images`, `javascript`, `popups`, `cookies`.
    """
    found = setting(machine, f"profile.content_settings.exceptions.{kind}") or {}
    return {pattern: entry.get("setting") for pattern, entry in found.items()}


def block(machine: Machine, kind: str, *hosts: str) -> None:
    """Store that something of these sites, and no others, is blocked; Chromium must not run."""
    kept = {f"{host},*": {"setting": BLOCKED} for host in hosts}
    change_setting(machine, f"profile.content_settings.exceptions.{kind}", kept)
