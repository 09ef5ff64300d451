"""Coordinates are never silently wrong: fractions are no pixels, and what is not said is refused or
chosen."""

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from hijack_data.actions.dialects.qwen import tool_call_text
from hijack_data.cli import hijack
from hijack_data.types import Action
from pipelines import build, open_dataset
from pipelines.choices import COORDINATES
from pipelines.dataset.manifest import read_manifest
from pipelines.errors import BuildError
from pipelines.readers import Rejected, get_reader
from pipelines.readers.fields import FieldError
from pipelines.readers.reader_options import ReaderOptions, with_choices
from pipelines.readers.recorded_actions import read_recorded

from support.formats import png, screenagent, write_json, write_lines

SIZE = (200, 400)
SAID = {
    "pyautogui": "pyautogui.click({}, {})",
    "ui_tars": "Action: click(start_box='({},{})')",
    "qwen3_vl": (
        tool_call_text("computer_use", {"action": "left_click", "coordinate": ["{}", "{}"]})
        .replace('"{}"', "{}")
        .replace("{", "{{")
        .replace("}", "}}")
        .replace("{{}}", "{}")
    ),
}
# The same point, (100, 50), in each space; what a model sees of 200x400 is 196x392.
POINTS = {
    "pixels": (100, 50),
    "fractions": (0.25, 0.25),
    "thousand": (250, 250),
    "resized": (98, 49),
}


@pytest.mark.parametrize("dialect", sorted(SAID))
@pytest.mark.parametrize("space", COORDINATES)
def test_a_choice_reads_every_text_in_every_space(dialect: str, space: str) -> None:
    recorded = read_recorded(SAID[dialect].format(*POINTS[space]), dialect, SIZE, "f", space, None)
    assert recorded.action == Action("click", 100, 50)
    assert (recorded.dialect == "pyautogui") == (
        dialect == "pyautogui" or space in ("pixels", "fractions")
    )
    if recorded.dialect == "pyautogui":
        assert recorded.code == "pyautogui.click(100, 50)"


@pytest.mark.parametrize("dialect", sorted(SAID))
@pytest.mark.parametrize("point", [(0.25, 0.25), (0.0, 0.5), (1, 0.001)])
@pytest.mark.parametrize("default", ["pixels", "thousand", "resized", None])
def test_fractions_are_never_a_corner(dialect: str, point: Any, default: str | None) -> None:
    with pytest.raises(FieldError, match=r"fits .*fractions.*--coordinates"):
        read_recorded(SAID[dialect].format(*point), dialect, SIZE, "f", None, default)


@pytest.mark.parametrize(
    ("space", "point"),
    [
        ("pixels", (400, 5)),
        ("pixels", (5, 200)),
        ("pixels", (-1, 5)),
        ("fractions", (1.2, 0.5)),
        ("thousand", (1100, 5)),
        ("resized", (5, 300)),
        ("fractions", (250, 100)),
    ],
)
@pytest.mark.parametrize("dialect", sorted(SAID))
def test_points_out_of_the_space_are_refused(dialect: str, space: str, point: Any) -> None:
    with pytest.raises(FieldError):
        read_recorded(SAID[dialect].format(*point), dialect, SIZE, "f", space, None)


def test_what_points_nowhere_needs_no_choice() -> None:
    recorded = read_recorded("Action: type(content='a')", "ui_tars", SIZE, "f", None, None)
    assert recorded.action == Action("type", text="a")
    with pytest.raises(FieldError, match=r"nothing says .*pixels or thousand or resized"):
        read_recorded(SAID["ui_tars"].format(100, 50), "ui_tars", SIZE, "f", None, None)


@pytest.mark.parametrize("point", [(0.3271, 0.2694), (0.5, 1), (0.0, 0.1)])
@pytest.mark.parametrize("names", ["xy", ("x2", "y2")])
def test_our_own_format_refuses_fractions(
    recording: Any, point: Any, names: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=1, steps=1)
    file = folder / "trajectories.jsonl"
    line = json.loads(file.read_text())
    line["action"].update(dict(zip(names, point, strict=True)))
    file.write_text(json.dumps(line) + "\n")
    (value,) = get_reader("jsonl").read(folder)
    assert isinstance(value, Rejected)
    assert value.field == f"action.{names[0]}"
    assert "fractions" in value.reason


def test_screenagent_refuses_fractions(tmp_path: Path) -> None:
    screenagent(tmp_path)
    file = tmp_path / "s1" / "2023-12-20_19-31-30.json"
    record = json.loads(file.read_text())
    record["actions"][0]["mouse_position"] = {"width": 0.25, "height": 0.25}
    write_json(file, record)
    rejected = [
        item for item in get_reader("screenagent").read(tmp_path) if isinstance(item, Rejected)
    ]
    assert ["fractions" in item.reason for item in rejected] == [True]


def test_choices_are_checked() -> None:
    with pytest.raises(BuildError, match="did you mean 'fractions'"):
        ReaderOptions(coordinates="fraction")
    with pytest.raises(BuildError, match="xywh"):
        ReaderOptions(boxes="coco")
    with pytest.raises(BuildError, match="format 'runs' says itself"):
        with_choices(get_reader("runs"), ReaderOptions(coordinates="pixels"))
    assert with_choices(get_reader("runs"), ReaderOptions()) is get_reader("runs")


def test_a_format_that_says_itself_refuses_the_choice(recording: Any, tmp_path: Path) -> None:
    with pytest.raises(BuildError, match="jsonl"):
        build(recording(), tmp_path / "out", coordinates="fractions")
    assert not (tmp_path / "out").exists()


def test_the_command_takes_the_choice_and_resume_knows_it(tmp_path: Path) -> None:
    messages = [
        {"role": "user", "content": "<image>go"},
        {"role": "assistant", "content": "pyautogui.click(x=0.25, y=0.25)"},
    ]
    (tmp_path / "source").mkdir()
    (tmp_path / "source" / "0.png").write_bytes(png())
    write_lines(tmp_path / "source" / "a.jsonl", [{"messages": messages, "images": ["0.png"]}])
    out = tmp_path / "out"
    command = ["build", str(tmp_path / "source"), "--out", str(out), "--corruptions", "resolution"]
    output = CliRunner().invoke(hijack, [*command, "--coordinates", "fractions"])
    assert output.exit_code == 0, output.output
    assert read_manifest(out)["parameters"]["coordinates"] == "fractions"
    row = next(row for row in open_dataset(out) if row["corruption"] == "clean")
    assert (row["action"]["x"], row["action"]["y"]) == (100, 50)
    again = CliRunner().invoke(hijack, [*command, "--coordinates", "fractions", "--resume"])
    assert again.exit_code == 0, again.output
    with pytest.raises(BuildError, match="coordinates"):
        build(tmp_path / "source", out, corruptions="resolution", coordinates="pixels", resume=True)
    unsaid = CliRunner().invoke(hijack, [*command[:3], str(tmp_path / "other")])
    assert unsaid.exit_code == 1
    assert "--coordinates" in unsaid.output
