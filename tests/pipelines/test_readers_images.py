"""Folders of pictures: alone, with ImageFolder's metadata, with a JSON object beside each."""

import json
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import hijack_data as hj
from hijack_data.types import Action, Trajectory
from pipelines import build, open_dataset, verify
from pipelines.errors import SourceError
from pipelines.readers import Rejected, detect_format, get_reader


def read(path: Path) -> tuple[dict[str, Trajectory], list[Rejected]]:
    items = list(get_reader("images").read(path))
    return {i.id: i for i in items if isinstance(i, Trajectory)}, [
        i for i in items if isinstance(i, Rejected)
    ]


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    folder = tmp_path / "pictures"
    for name in ("a.png", "sub/a.png", "sub/b.JPG"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (320, 200), "navy").save(folder / name)
    return folder


def test_each_picture_is_a_trajectory_without_an_action(pictures: Path, tmp_path: Path) -> None:
    (pictures / "README.md").write_text("# mine")
    assert detect_format(pictures) == detect_format(pictures / "a.png") == "images"
    value, rejected = read(pictures)
    assert rejected == []
    assert list(value) == ["a.png", "sub/a.png", "sub/b.JPG"]
    assert all(t.steps[0].action == Action("other") for t in value.values())
    report = build(pictures, tmp_path / "out", corruptions={"half": hj.Resolution(scale=0.5)})
    assert (report.rows, report.exit_code) == ({"clean": 3, "half": 3}, 0)
    assert verify(tmp_path / "out").ok


def test_metadata_of_an_image_folder(pictures: Path, tmp_path: Path) -> None:
    lines: list[dict[str, Any]] = [
        {
            "file_name": "a.png",
            "instruction": "click it",
            "action": {"type": "click", "x": 5, "y": 6},
            "label": 3,
        },
        {
            "file_name": "sub/a.png",
            "target_box": [1, 2, 30, 40],
            "elements": [[1, 2, 30, 40]],
            "apps": ["chrome"],
        },
    ]
    (pictures / "metadata.jsonl").write_text("\n".join(map(json.dumps, lines)))
    assert detect_format(pictures) == "images"
    value, rejected = read(pictures)
    assert rejected == []
    first, second = value["a.png"], value["sub/a.png"]
    assert (first.instruction, first.steps[0].action) == ("click it", Action("click", 5, 6))
    assert json.loads(first.steps[0].extra) == {"label": 3}
    assert (second.apps, second.steps[0].target_box) == (("chrome",), (1, 2, 30, 40))
    assert value["sub/b.JPG"].steps[0].extra == ""
    build(pictures, tmp_path / "out", corruptions={})
    assert [row["extra"] for row in open_dataset(tmp_path / "out")] == ['{"label": 3}', None, None]


def test_metadata_lies_beside_its_pictures_as_well(pictures: Path) -> None:
    (pictures / "sub" / "metadata.jsonl").write_text('{"file_name": "b.JPG", "domain": "mobile"}')
    assert read(pictures)[0]["sub/b.JPG"].domain == "mobile"


def test_metadata_are_of_one_picture_and_in_one_place(pictures: Path) -> None:
    """A smaller copy would get the coordinates of the other picture."""
    (pictures / "a.json").write_text('{"instruction": "look"}')
    (pictures / "metadata.jsonl").write_text('{"file_name": "a.png", "instruction": "see"}')
    rejected = {r.file: r.reason for r in read(pictures)[1]}
    assert "in metadata.jsonl and in a.json" in rejected["a.png"]
    (pictures / "metadata.jsonl").unlink()
    Image.new("RGB", (32, 20), "navy").save(pictures / "a.jpg")
    rejected = {r.file: r.reason for r in read(pictures)[1]}
    assert sorted(rejected) == ["a.jpg", "a.png"]
    assert "a.json may describe a.jpg or a.png" in rejected["a.png"]


def test_a_json_object_beside_a_picture(pictures: Path) -> None:
    (pictures / "a.json").write_text('{"instruction": "look"}')
    assert detect_format(pictures) == "images"
    assert read(pictures)[0]["a.png"].instruction == "look"


@pytest.mark.parametrize(
    ("line", "where", "reason"),
    [
        ({"file_name": "none.png"}, "metadata.jsonl", "not in the source folder"),
        ({"file_name": "../x.png"}, "metadata.jsonl", "leaves the source"),
        ({}, "metadata.jsonl", "is missing"),
        ({"file_name": "metadata.jsonl"}, "metadata.jsonl", "not a picture"),
        ({"file_name": "a.png", "elemnts": []}, "a.png", "did you mean 'elements'"),
        ({"file_name": "a.png", "bbox": [1, 2, 3, 4]}, "a.png", "did you mean 'target_box'"),
        (
            {"file_name": "a.png", "action": {"type": "click", "x": 900, "y": 1}},
            "a.png",
            "outside the screenshot",
        ),
    ],
)
def test_what_is_wrong_with_metadata_is_said(
    line: Any, where: str, reason: str, pictures: Path
) -> None:
    (pictures / "metadata.jsonl").write_text(json.dumps(line))
    value, (rejected,) = read(pictures)
    assert rejected.file == where
    assert reason in str(rejected)
    assert len(value) == (2 if where == "a.png" else 3)


def test_pictures_beside_records_of_an_unknown_format_are_not_taken_unasked(
    pictures: Path, tmp_path: Path
) -> None:
    (pictures / "labels.json").write_text('[{"image": "a.png", "box": [1, 2, 3, 4]}]')
    with pytest.raises(SourceError, match=r"labels.json is of none.*--format images"):
        detect_format(pictures)
    assert build(pictures, tmp_path / "out", corruptions={}, format="images").total == 3


def test_a_picture_that_cannot_be_read_is_counted(pictures: Path, tmp_path: Path) -> None:
    (pictures / "bad.png").write_text("no picture")
    (pictures / "out.png").symlink_to(tmp_path / "elsewhere.png")
    value, rejected = read(pictures)
    assert len(value) == 3
    assert [r.file for r in rejected] == ["bad.png", "out.png"]


def test_the_platform_and_the_code_of_a_picture_count(pictures: Path) -> None:
    entries: dict[str, dict[str, Any]] = {
        "a": {"platform": "windows", "action_code": "pyautogui.rightClick(5, 6)"},
        "sub/a": {"action_code": "pyautogui.click(320, 6)"},
        "sub/b": {"action": {"type": "click", "x": 5, "y": 6}, "action_code": "WAIT"},
    }
    for name, record in entries.items():
        (pictures / f"{name}.json").write_text(json.dumps(record))
    value, rejected = read(pictures)
    (step,) = value["a.png"].steps
    assert (value["a.png"].platform, step.action) == ("windows", Action("right_click", 5, 6))
    assert [(r.file, r.field) for r in rejected] == [
        ("sub/a.png", "action_code"),
        ("sub/b.JPG", "action_code"),
    ]
    assert "outside the 320x200 screenshot" in rejected[0].reason
    assert "says wait, but action is click" in rejected[1].reason
