"""Readers say what their pictures show, or leave it to the domain; what happens to the machine
follows."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hijack_data.errors import ParameterError
from hijack_data.types import Trajectory
from pipelines import build
from pipelines.readers import RecordedTrajectory, base, get_reader, register
from pipelines.readers.recording_facts import stated_screen

from support.formats import FORMATS, SETS

PAGE = "the pictures show a web page, not the screen around it"
PHONE = "the pictures show a phone, not the screen of a desktop"


def test_formats_that_show_pages_or_phones_say_so(tmp_path: Path) -> None:
    entries = {}
    formats = {**FORMATS, **SETS}
    for name in formats:
        first, *_ = get_reader(name).read(formats[name](tmp_path / name))
        assert isinstance(first, Trajectory)
        entries[name] = stated_screen(first)
    desktops = ("agentnet", "grounding", "osworld", "runs", "screenagent")
    pages = dict.fromkeys(("browser_use", "guiact", "webvoyager"), "web page")
    phones = dict.fromkeys(("aitz", "android_control", "gui_odyssey"), "phone")
    remaining = {**dict.fromkeys(desktops, "desktop"), **pages, **phones}
    assert entries == {**dict.fromkeys(formats), **remaining}


@pytest.mark.parametrize(
    ("domain", "expected"),
    [
        ("", None),
        ("chrome", None),
        ("web", None),
        ("desktop", "desktop"),
        ("Windows 11", "desktop"),
        ("iOS 17.1", "phone"),
        ("web page", "web page"),
        ("Web-Page", "web page"),
        ("mobile", "phone"),
        ("Android", "phone"),
        ("iOS", "phone"),
        ("windows", "desktop"),
    ],
)
def test_the_domain_says_it_where_the_reader_does_not(domain: str, expected: str | None) -> None:
    assert stated_screen(Trajectory("t", "webvoyager", "", (), domain)) == expected
    assert stated_screen(RecordedTrajectory("t", "x", "", (), domain)) == expected
    for output in ("desktop", "web page", "phone"):
        assert stated_screen(RecordedTrajectory("t", "x", "", (), domain, screen=output)) == output  # type: ignore[arg-type]


@pytest.mark.parametrize("screen", ["webpage", "", 3, ["phone"]])
def test_another_word_is_refused(screen: Any) -> None:
    with pytest.raises(
        ParameterError,
        match=r"trajectory 't': unknown screen .*; (did you mean '|known: desktop, )",
    ):
        RecordedTrajectory("t", "x", "", (), screen=screen)


@pytest.mark.parametrize(
    ("screen", "reason", "workers"),
    [("web page", PAGE, 1), ("phone", PHONE, 2), ("desktop", None, 1), (None, None, 1)],
)
def test_a_reader_from_elsewhere_says_it_too(
    screen: Any,
    reason: str | None,
    workers: int,
    recording: Any,
    assets: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its workers know it as little as those of a cluster would: what it says comes with each
    trajectory."""
    monkeypatch.setattr(base.READERS, "entries", dict(base.READERS.entries))

    @register
    class Odd:
        name = "odd"

        def detect(self, path: Path) -> bool:
            return False

        def read(self, path: Path) -> Iterator[Any]:
            for item in get_reader("jsonl").read(path):
                assert isinstance(item, Trajectory)
                yield RecordedTrajectory(
                    item.id, self.name, item.instruction, item.steps, screen=screen
                )

    options: dict[str, Any] = {
        "corruptions": "verification",
        "format": "odd",
        "assets": assets,
        "workers": workers,
        "platform": "linux-xfce",
    }
    report = build(recording(), tmp_path / "out", **options)
    assert report.not_applicable == ({"verification": {reason: 2}} if reason else {})
    assert report.rows["verification"] == (0 if reason else 2)


def test_a_build_that_was_stopped_notices_another_screen(recording: Any) -> None:
    from pipelines.building.shards import records_hash

    item, *_ = get_reader("jsonl").read(recording())
    assert isinstance(item, Trajectory)
    entries = {name: getattr(item, name) for name in ("id", "source", "instruction", "steps")}
    hashes = [
        records_hash([RecordedTrajectory(**entries, screen=s)], Path())
        for s in (None, "phone", "web page")
    ]  # type: ignore[arg-type]
    assert len(set(hashes)) == 3
