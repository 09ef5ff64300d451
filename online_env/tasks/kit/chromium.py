"""Chromium's profile as it is stored: settings, bookmarks and history.

Chromium writes most of them some seconds after a change, and at once when it ends. What is read
here is therefore read only after Chromium was ended; that takes about 0.1 s.
"""

import json
import sqlite3
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, TypeAlias, cast

from ...errors import DesktopError
from ..idle import end_process
from ..machine import Machine

PROFILE = ".config/google-chrome"
PREFERENCES = f"{PROFILE}/Default/Preferences"
BOOKMARKS = f"{PROFILE}/Default/Bookmarks"
HISTORY = f"{PROFILE}/Default/History"
BLOCKED = 2
GIVEN_PAGES = 4  # of `session.restore_on_startup`: pages that are named
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
# Its lock names host and process; after a crash the process may be another program's.
_FIND_BROWSER = (
    f'pid=$(readlink "$HOME/{PROFILE}/SingletonLock"); pid=${{pid##*-}};'
    ' case "$(cat /proc/$pid/comm 2>/dev/null)" in chrom*) echo "$pid";; esac'
)
# It ends with its last window. SIGTERM alone would lose bookmarks of the last 2.5 s and visits of
# the last 10 s, so that comes only when these times are over.
_CLOSE_BROWSER = (
    "wmctrl -lp | while read -r window desk owner rest;"
    ' do [ "$owner" = "$pid" ] && wmctrl -ic "$window"; done'
)
_LINK_CLICKED = 0x30000000  # the visit begins and ends a chain of redirections

Bookmark: TypeAlias = "tuple[str, str | list[Bookmark]]"
"""A name with an address, or a folder's name with what is in it."""


def end_browser(machine: Machine) -> None:
    """End Chromium, if it runs with this profile, so that its files hold all that it knows.

    Its windows are closed. If it is still there 15 s later, when it has written all that it knew,
    it gets SIGTERM.

    Raises:
        DesktopError: It does not end then, either.
    """
    end_process(machine.desktop, _FIND_BROWSER, "Chromium", _CLOSE_BROWSER)


# Settings


def setting(machine: Machine, path: str) -> Any:
    """Return a setting such as `"browser.show_home_button"`; `None` if it was never set.

    Chromium is ended before, as by all functions here that read its profile.
    """
    value: Any = _json(machine, PREFERENCES)
    for key in path.split("."):
        if not isinstance(value, dict):
            return None
        value = cast("dict[str, Any]", value).get(key)
    return value


def change_setting(machine: Machine, path: str, value: Any) -> None:
    """Store a setting; Chromium is ended before."""
    preferences = _json(machine, PREFERENCES)
    *folders, last = path.split(".")
    node = preferences
    for key in folders:
        node = node.setdefault(key, {})
    node[last] = value
    machine.write(PREFERENCES, json.dumps(preferences))


def wrong_settings(machine: Machine, expected: Mapping[str, Any]) -> Iterator[str]:
    """Yield the settings that are not as wanted, by their paths."""
    for path, value in expected.items():
        actual = setting(machine, path)
        if actual != value:
            yield f"the setting {path} is {actual!r}, not {value!r}"


# Bookmarks


def bookmarks(machine: Machine) -> dict[str, list[Bookmark]]:
    """Return the bookmarks by root: `bookmark_bar`, `other` and `synced`."""
    stored = _json(machine, BOOKMARKS).get("roots", {})
    return {root: _entries(stored.get(root, {})) for root in _ROOTS}


def write_bookmarks(
    machine: Machine, bar: Sequence[Bookmark], **other_folders: Sequence[Bookmark]
) -> None:
    """Store bookmarks, while Chromium does not run.

    Args:
        machine: Where.
        bar: Those of the bookmarks bar.
        **other_folders: Those of other roots.
    """
    roots = {root: (bar if root == BAR else other_folders.get(root, ())) for root in _ROOTS}
    stored = {root: _node(_ROOTS[root], list(entries)) for root, entries in roots.items()}
    machine.write(BOOKMARKS, json.dumps({"roots": stored, "version": 1}))


def in_order(entries: Iterable[Bookmark]) -> list[Bookmark]:
    """Return bookmarks sorted by name, in folders, too.

    Spaces in names do not count, and `http://a.test` is `http://a.test/`.
    """
    ordered: list[Bookmark] = []
    for title, value in entries:
        name = " ".join(title.split())
        if isinstance(value, list):
            ordered.append((name, in_order(value)))
        else:
            ordered.append((name, value.rstrip("/")))
    return sorted(ordered, key=str)


def wrong_bookmarks(machine: Machine, bar: Sequence[Bookmark]) -> Iterator[str]:
    """Yield why the bookmarks are not these, all in the bar, in whatever order."""
    actual = [in_order(entries) for entries in bookmarks(machine).values()]
    if actual != [in_order(bar), [], []]:
        yield f"the bookmarks are {actual}"


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
    now_s = int(machine.run("date", "+%s")) + _EPOCH
    with tempfile.TemporaryDirectory(prefix="agenthijack-history-") as folder:
        path = Path(folder, "History")
        with closing(sqlite3.connect(path)) as base:
            base.executescript(_SCHEMA)
            for number, (url, title) in enumerate(pages, 1):
                visit_time = (now_s - 900 * (len(pages) - number + 1)) * 1_000_000
                base.execute(
                    "INSERT INTO urls (url, title, visit_count, last_visit_time) VALUES (?,?,1,?)",
                    (url, title, visit_time),
                )
                base.execute(
                    "INSERT INTO visits (url, visit_time, transition) VALUES (?,?,?)",
                    (number, visit_time, _LINK_CLICKED),
                )
            base.commit()
        machine.write(HISTORY, path.read_bytes())


def _rows(machine: Machine, path: str, query: str) -> list[tuple[Any, ...]]:
    """Return the rows of a query of a copy of a database; none if there is no such file yet.

    Raises:
        DesktopError: The file is no database, or lacks the tables.
    """
    data = _profile_file(machine, path)
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


def _profile_file(machine: Machine, path: str) -> bytes | None:
    end_browser(machine)
    return machine.read(path)


def _json(machine: Machine, path: str) -> dict[str, Any]:
    """Return the JSON object in a file of the profile; empty if there is no such file yet.

    Raises:
        DesktopError: The file holds something else.
    """
    data = _profile_file(machine, path)
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
    """Return the permissions of sites by pattern: 1 allows, 2 blocks.

    Args:
        machine: Where.
        kind: Such as `images`, `javascript`, `popups`, `cookies`.
    """
    entries = setting(machine, f"profile.content_settings.exceptions.{kind}") or {}
    return {pattern: entry.get("setting") for pattern, entry in entries.items()}


def blocked_kinds(machine: Machine) -> set[str]:
    """Return all that is blocked, for a site or for all sites, such as `images`."""
    exceptions = setting(machine, "profile.content_settings.exceptions") or {}
    general = setting(machine, "profile.default_content_setting_values") or {}
    kinds = {kind for kind, rule in general.items() if rule == BLOCKED}
    for kind, rules in exceptions.items():  # some entries are no rules but notes of Chromium's own
        if isinstance(rules, dict):
            entries = cast("dict[str, dict[str, Any]]", rules).values()
            if any(entry.get("setting") == BLOCKED for entry in entries):
                kinds.add(kind)
    return kinds


def block(machine: Machine, kind: str, *hosts: str) -> None:
    """Store that something of these sites, and no others, is blocked; Chromium must not run."""
    exceptions = {f"{host},*": {"setting": BLOCKED} for host in hosts}
    change_setting(machine, f"profile.content_settings.exceptions.{kind}", exceptions)
