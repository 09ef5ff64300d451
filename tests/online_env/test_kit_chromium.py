"""Chromium's profile, read and written in a folder."""

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from online_env.errors import DesktopError
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import chromium
from online_env.tasks.machine import Machine

BAR = [("Recipes", [("Tea", "http://wiki.test/wiki/Tea")]), ("News", "http://news.test/")]


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(FolderDesktop(tmp_path))


def test_a_setting_is_kept_beside_others(machine: Machine) -> None:
    machine.write(chromium.PREFERENCES, json.dumps({"a": {"b": 1, "c": 2}}))
    chromium.change_setting(machine, "a.b", [3])
    chromium.change_setting(machine, "d.e.f", True)
    assert [chromium.setting(machine, path) for path in ("a.b", "a.c", "d.e.f")] == [[3], 2, True]
    assert [chromium.setting(machine, path) for path in ("a.x", "a.b.c", "y")] == [None] * 3


def test_wrong_settings_are_named_with_what_they_are(machine: Machine) -> None:
    chromium.change_setting(machine, "a.b", 1)
    assert list(chromium.wrong_settings(machine, {"a.b": 1})) == []
    items = list(chromium.wrong_settings(machine, {"a.b": 2, "a.c": 3}))
    assert items == ["the setting a.b is 1, not 2", "the setting a.c is None, not 3"]


def test_bookmarks_are_read_as_they_were_written(machine: Machine) -> None:
    assert chromium.bookmarks(machine) == {"bookmark_bar": [], "other": [], "synced": []}
    chromium.write_bookmarks(machine, BAR, other=[("Chess", "http://wiki.test/wiki/Chess")])
    result = chromium.bookmarks(machine)
    assert result["bookmark_bar"] == BAR
    assert result["other"] == [("Chess", "http://wiki.test/wiki/Chess")]


def test_bookmarks_are_judged_in_whatever_order(machine: Machine) -> None:
    chromium.write_bookmarks(machine, BAR[::-1])
    assert list(chromium.wrong_bookmarks(machine, BAR)) == []
    chromium.write_bookmarks(machine, [BAR[0], (" News", "http://news.test")])
    assert list(chromium.wrong_bookmarks(machine, BAR)) == []
    assert list(chromium.wrong_bookmarks(machine, BAR[:1])) != []
    chromium.write_bookmarks(machine, BAR, other=[("Chess", "http://wiki.test/wiki/Chess")])
    assert list(chromium.wrong_bookmarks(machine, BAR)) != []


def test_a_history_holds_its_pages_with_rising_times(machine: Machine, tmp_path: Path) -> None:
    assert chromium.history(machine) == set()
    chromium.write_history(machine, [("http://a.test/", "A"), ("http://b.test/x", "Ö")])
    assert chromium.history(machine) == {"http://a.test/", "http://b.test/x"}
    with closing(sqlite3.connect(tmp_path / chromium.HISTORY)) as base:
        rows = base.execute("SELECT u.title, v.visit_time FROM urls u JOIN visits v ON v.url=u.id")
        (first, early), (second, late) = rows.fetchall()
    assert (first, second) == ("A", "Ö")
    assert late - early == 900_000_000


def test_exceptions_of_sites(machine: Machine) -> None:
    assert chromium.exceptions(machine, "images") == {}
    chromium.block(machine, "images", "a.test", "b.test")
    assert chromium.exceptions(machine, "images") == {"a.test,*": 2, "b.test,*": 2}
    assert chromium.exceptions(machine, "javascript") == {}


@pytest.mark.parametrize(
    ("path", "read"),
    [
        (chromium.PREFERENCES, lambda m: chromium.setting(m, "a")),
        (chromium.HISTORY, chromium.history),
    ],
)
def test_a_damaged_file_is_an_error_and_no_empty_one(machine: Machine, path, read) -> None:
    machine.write(path, "neither JSON nor a base" * 100)
    with pytest.raises(DesktopError, match=path):
        read(machine)


def test_pages_within_pages_are_no_part_of_the_history(machine: Machine, tmp_path: Path) -> None:
    chromium.write_history(machine, [("http://a.test/", "A"), ("http://ads.test/frame", "")])
    with closing(sqlite3.connect(tmp_path / chromium.HISTORY)) as base:
        base.execute("UPDATE urls SET hidden = 1 WHERE url LIKE '%frame'")
        base.commit()
    assert chromium.history(machine) == {"http://a.test/"}


@pytest.mark.parametrize("root", ["other", "synced"])
def test_a_bookmark_outside_the_bar_is_wrong(machine: Machine, root: str) -> None:
    chromium.write_bookmarks(machine, BAR, **{root: [("Chess", "http://wiki.test/wiki/Chess")]})
    (problem,) = chromium.wrong_bookmarks(machine, BAR)
    assert problem.count("Chess") == 2


def test_the_order_within_folders_does_not_count_and_the_folder_does(machine: Machine) -> None:
    value, two, three = ((name, f"http://{name}.test/") for name in ("one", "two", "three"))
    expected: list[chromium.Bookmark] = [("Work", [value, ("Old", [two, three])])]
    chromium.write_bookmarks(machine, [("Work", [("Old", [three, two]), value])])
    assert list(chromium.wrong_bookmarks(machine, expected)) == []
    chromium.write_bookmarks(machine, [("Work", [value, two, ("Old", [three])])])
    assert len(list(chromium.wrong_bookmarks(machine, expected))) == 1
    chromium.write_bookmarks(machine, [("Work", [value, value, ("Old", [two, three])])])
    assert len(list(chromium.wrong_bookmarks(machine, expected))) == 1


def test_all_that_is_blocked_is_named_whatever_notes_chromium_keeps(machine: Machine) -> None:
    assert chromium.blocked_kinds(machine) == set()
    general = "profile.default_content_setting_values"
    exceptions = "profile.content_settings.exceptions"
    chromium.block(machine, "images", "a.test")
    chromium.change_setting(machine, f"{general}.sound", chromium.BLOCKED)
    chromium.change_setting(machine, f"{general}.popups", 1)
    chromium.change_setting(machine, f"{exceptions}.has_migrated_local_network_access", True)
    chromium.change_setting(
        machine, f"{exceptions}.site_engagement", {"http://a.test:80,*": {"setting": {"x": 2}}}
    )
    assert chromium.blocked_kinds(machine) == {"images", "sound"}
