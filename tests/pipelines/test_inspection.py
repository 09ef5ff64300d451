"""`hijack inspect`: what a source holds, and what a build would give, without building."""

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import hijack_data as hj
from hijack_data.cli import hijack
from pipelines import build, inspect_source
from pipelines.errors import BuildError, SourceError
from pipelines.inspection import UNKNOWN, coordinate_space
from pipelines.readers import names

from support.events import with_apps
from support.formats import FORMATS, png, write_lines


def test_what_a_source_holds(
    recording: Any, add_line: Any, good_line: Any, small: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=4, steps=3)
    add_line(folder, b"rubbish")
    add_line(
        folder,
        good_line("new", 0, image="images/t0-0.png", action={"type": "wait"}, apps=["chrome"]),
    )
    (folder / "notes.json").write_text("{}")
    result = inspect_source(folder, corruptions=small, sample=2)
    assert result.formats == {"jsonl": [5, 13]}
    assert (result.trajectories, result.steps) == (5, 13)
    assert (result.sizes, result.actions) == ({"320x200": 13}, {"click": 12, "wait": 1})
    assert (result.apps, result.screens) == ({UNKNOWN: 4, "chrome": 1}, {"desktop": 5})
    assert (result.rejected, result.unread) == ({"(record)": 1}, ["notes.json"])
    assert result.coordinates == {"jsonl": "pixels of the image, origin top-left"}
    assert result.looked_at == (2, 6)
    assert result.outlook is not None
    assert set(result.outlook.rows.values()) == {6}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["source"]


def test_the_outlook_is_that_of_the_build(
    browsing: Path, nine: Any, assets: Path, tmp_path: Path
) -> None:
    result = inspect_source(browsing, corruptions=nine, assets=assets, sample=9)
    report = build(browsing, tmp_path / "out", corruptions=nine, assets=assets)
    assert result.outlook is not None
    assert (result.outlook.rows, result.outlook.not_applicable) == (
        report.rows,
        report.not_applicable,
    )


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"apps": "chrome"},
        {"apps": "chrome", "platform": "linux-xfce"},
        {"platform": "windows"},
        {"platform": "windows", "allow_platform_mismatch": True},
    ],
)
def test_the_outlook_follows_what_the_user_states(
    options: dict[str, Any], recording: Any, nine: Any, assets: Path, tmp_path: Path
) -> None:
    source = with_apps(recording(trajectories=1, steps=2), [], platform=lambda row: None)
    result = inspect_source(source, corruptions=nine, assets=assets, **options)
    report = build(source, tmp_path / "out", corruptions=nine, assets=assets, **options)
    assert result.outlook is not None
    assert (result.outlook.rows, result.outlook.not_applicable) == (
        report.rows,
        report.not_applicable,
    )
    assert result.apps == {options.get("apps", UNKNOWN): 1}
    assert result.platforms == {options.get("platform", UNKNOWN): 1}


def test_the_outlook_follows_the_stated_coordinates_and_boxes(tmp_path: Path) -> None:
    chat = tmp_path / "chat"
    chat.mkdir()
    write_lines(chat / "a.jsonl", [_fractions()])
    (chat / "0.png").write_bytes(png())
    assert inspect_source(chat, corruptions="resolution").rejected
    for space, readable in (("fractions", 1), ("pixels", 0)):
        result = inspect_source(chat, corruptions="resolution", coordinates=space)
        report = build(chat, tmp_path / space, corruptions="resolution", coordinates=space)
        assert result.steps == report.rows["clean"] == readable
    with pytest.raises(BuildError, match="boxes 'xywh'"):
        inspect_source(chat, boxes="xywh")
    with pytest.raises(BuildError, match="did you mean 'fractions'"):
        inspect_source(chat, coordinates="fraction")


def _fractions() -> dict[str, Any]:
    """A chat row whose click is in fractions of the picture, which the row does not state."""
    question = {"role": "user", "content": "<image>go"}
    reply = {"role": "assistant", "content": "pyautogui.click(x=0.25, y=0.25)"}
    return {"messages": [question, reply], "images": ["0.png"]}


def test_a_sample_of_each_format_and_source(tmp_path: Path) -> None:
    for folder, name in (("a/one", "osworld"), ("a/two", "webvoyager"), ("b", "osworld")):
        (tmp_path / folder).mkdir(parents=True)
        FORMATS[name](tmp_path / folder)
    result = inspect_source([tmp_path / "a", tmp_path / "b"], corruptions="resolution", sample=1)
    assert result.formats == {"osworld": [2, 4], "webvoyager": [1, 2]}
    assert result.looked_at == (3, 6)
    assert inspect_source(tmp_path / "b", sample=0).outlook is None


def test_facts_are_those_of_the_build_over_all_rows(
    recording: Any, add_line: Any, good_line: Any, assets: Path, tmp_path: Path
) -> None:
    """A domain that names a platform is one, and the outlook has a sample of each kind of screen,
    though they come last."""
    source = with_apps(recording(trajectories=4, steps=1), ["Google Chrome"])
    for name, domain in (("p", "android"), ("w", "web page"), ("x", "shop")):
        more = {"domain": domain, "platform": None, "apps": ["chrome"]}
        add_line(source, good_line(name, 0, image="images/t0-0.png", **more))
    options: dict[str, Any] = {"corruptions": "verification", "assets": assets}
    result = inspect_source(source, sample=1, **options)
    assert result.platforms == {"linux-xfce": 4, "android": 1, "web": 1, UNKNOWN: 1}
    assert result.screens == {"desktop": 4, "phone": 1, "web page": 1, UNKNOWN: 1}
    assert result.apps == {"chrome": 7}
    assert result.looked_at == (4, 4)
    assert result.outlook is not None
    report = build(source, tmp_path / "out", **options)
    assert result.outlook.not_applicable == report.not_applicable
    assert len(report.not_applicable["verification"]) == 3


@pytest.mark.parametrize("name", names())
def test_every_reader_says_what_its_coordinates_are(name: str) -> None:
    assert coordinate_space(name) not in ("", UNKNOWN)


def test_pictures_inside_records_have_a_size_too(tmp_path: Path) -> None:
    for name in ("anthropic", "parquet"):
        (tmp_path / name).mkdir()
        FORMATS[name](tmp_path / name)
    assert inspect_source(tmp_path, sample=0).sizes == {"400x200": 4}


def test_the_command(recording: Any, add_line: Any) -> None:
    folder = recording()
    run = CliRunner()
    result = run.invoke(hijack, ["inspect", str(folder), "--corruptions", "resolution"])
    assert result.exit_code == 0
    for part in (
        "2 trajectories, 6 steps",
        "jsonl",
        "320x200 (6)",
        "What a build would give (all of them)",
        "resolution",
    ):
        assert part in result.output
    add_line(folder, b"[rubbish")
    result = run.invoke(hijack, ["inspect", str(folder), "--corruptions", "resolution"])
    assert result.exit_code == 1
    assert "1 input cannot be read" in result.output
    result = run.invoke(hijack, ["inspect", str(folder), "--corruptions", "resolution", "--json"])
    data = json.loads(result.output)
    assert data["outlook"]["rows"] == {"clean": 6, "resolution": 6}
    assert data["formats"]["jsonl"]["steps"] == 6


def test_the_command_takes_what_a_build_takes(recording: Any, assets: Path) -> None:
    source = with_apps(recording(trajectories=1, steps=1), [], platform=lambda row: None)
    command = ["inspect", str(source), "--corruptions", "verification", "--assets", str(assets)]
    options = ["--apps", "chrome", "--platform", "windows", "--allow-platform-mismatch", "--json"]
    result = CliRunner().invoke(hijack, [*command, *options])
    assert result.exit_code == 0, result.output
    data = json.loads(result.output)
    assert (data["apps"], data["platforms"]) == ({"chrome": 1}, {"windows": 1})
    assert data["outlook"]["rows"]["verification"] == 1
    for option in (["--coordinates", "fractions"], ["--boxes", "xywh"]):
        result = CliRunner().invoke(hijack, [*command, *option])
        assert result.exit_code == 1
        assert "leave the choice out" in str(result.exception)


def test_there_is_nothing_to_inspect(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="is empty"):
        inspect_source(tmp_path)
    assert hj.HijackError in SourceError.__mro__
