"""Grounding sets in their published layouts: one click a row, its box, and the other boxes of the
picture."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hijack_data.types import Action
from pipelines import build, open_dataset
from pipelines.errors import SourceError
from pipelines.readers import detect_format

from support.formats import grounding, png, write_json, write_lines
from support.recordings import read_source

CORNERS = [(40, 30, 200, 60), (300, 100, 390, 190), (0, 0, 10, 10)]


def xywh(box: Any) -> list[int]:
    return [box[0], box[1], box[2] - box[0], box[3] - box[1]]


def fractions(box: Any) -> list[float]:
    return [n / side for n, side in zip(box, (400, 200, 400, 200), strict=True)]


def screenspot(name: str, box: Any, text: str) -> dict[str, Any]:
    about = {"data_type": "icon", "data_source": "gitlab"}
    return {"img_filename": name, "bbox": xywh(box), "instruction": text, **about}


def screenspot_pro(name: str, box: Any, text: str) -> dict[str, Any]:
    about = {
        "img_size": [400, 200],
        "platform": "windows",
        "application": "excel",
        "ui_type": "text",
    }
    return {"img_filename": name, "bbox": list(box), "instruction": text, **about}


def osworld_g(name: str, box: Any, text: str) -> dict[str, Any]:
    about = {"box_type": "bbox", "image_size": [400, 200], "GUI_types": ["Icon"]}
    return {"image_path": name, "box_coordinates": xywh(box), "instruction": text, **about}


def ui_vision(name: str, box: Any, text: str) -> dict[str, Any]:
    about = {"image_size": [400, 200], "platform": "GIMP"}
    return {"image_path": name, "bbox": list(box), "prompt_to_evaluate": text, **about}


def groundcua(name: str, box: Any, text: str) -> dict[str, Any]:
    return {"image_path": name, "bbox": list(box), "text": text, "category": "Button", "id": "x"}


def os_atlas(name: str, box: Any, text: str) -> dict[str, Any]:
    return {"img_filename": name, "bbox": fractions(box), "instruction": text}


LAYOUTS = [screenspot, screenspot_pro, osworld_g, ui_vision, groundcua, os_atlas]


def make(folder: Path, rows: list[Any], suffix: str = "json") -> Path:
    for number in range(3):
        (folder / "images").mkdir(parents=True, exist_ok=True)
        (folder / "images" / f"{number}.png").write_bytes(png(number))
    (write_json if suffix == "json" else write_lines)(folder / f"set.{suffix}", rows)
    return folder


read = partial(read_source, name="grounding")


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("suffix", ["json", "jsonl"])
# one row tells nothing by itself, the second that it is beyond a width
@pytest.mark.parametrize("count", [1, 3])
def test_published_layouts(layout: Any, suffix: str, count: int, tmp_path: Path) -> None:
    rows = [layout(f"{i}.png", box, f"text {i}") for i, box in enumerate(CORNERS[:count])]
    make(tmp_path, rows, suffix)
    assert detect_format(tmp_path) == detect_format(tmp_path / f"set.{suffix}") == "grounding"
    value, rejected = read(tmp_path)
    assert not rejected
    assert [t.steps[0].target_box for t in value] == CORNERS[:count]
    middles = [((x1 + x2) // 2, (y1 + y2) // 2) for x1, y1, x2, y2 in CORNERS[:count]]
    assert [t.steps[0].action for t in value] == [Action("click", *middle) for middle in middles]
    assert [t.instruction for t in value] == [f"text {i}" for i in range(count)]
    assert [Path(t.steps[0].image).name for t in value] == [f"{i}.png" for i in range(count)]


def test_what_a_set_says_of_the_screen_is_kept(tmp_path: Path) -> None:
    makers = {
        screenspot: ("web page", ()),
        screenspot_pro: ("windows", ("excel",)),
        ui_vision: ("", ("GIMP",)),
    }
    for number, (maker, (domain, apps)) in enumerate(makers.items()):
        folder = make(tmp_path / str(number), [maker("0.png", CORNERS[1], "a")])
        (trajectory,), _ = read(folder)
        assert (trajectory.domain, trajectory.apps) == (domain, apps)


def test_boxes_of_one_picture_are_its_elements(tmp_path: Path) -> None:
    make(tmp_path, [groundcua("0.png", box, "a") for box in CORNERS])
    value, _ = read(tmp_path)
    assert [t.steps[0].elements for t in value] == [tuple(CORNERS)] * 3


def test_a_size_that_is_not_the_pictures_is_refused_where_pixels_count(tmp_path: Path) -> None:
    size = {"width": 800, "height": 400}
    box = (10, 20, 30, 40)
    (rejected,) = read(make(tmp_path / "a", [{**screenspot("0.png", box, "a"), **size}]))[1]
    assert "state 800x400, but the picture is 400x200" in rejected.reason
    assert not read(make(tmp_path / "b", [{**os_atlas("0.png", box, "a"), **size}]))[1]


def test_elements_of_os_atlas(tmp_path: Path) -> None:
    parts = [{"instruction": f"text {i}", "bbox": fractions(box)} for i, box in enumerate(CORNERS)]
    make(tmp_path, [{"img_filename": "0.png", "url": "x", "elements": parts}])
    value, rejected = read(tmp_path)
    assert not rejected
    assert [(t.id, t.steps[0].target_box) for t in value] == [
        (f"set/000000-{i}", box) for i, box in enumerate(CORNERS)
    ]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"bbox": [1, 2, 3]}, "four numbers"),
        ({"bbox": [300, 100, 900, 190]}, "leaves the 400x200"),
        ({"bbox": None}, "missing"),
        ({"instruction": ""}, "empty"),
        ({"img_filename": "no.png"}, "not in the source"),
        ({"img_filename": "../../x.png"}, "leaves"),
        ({"img_size": [800, 400]}, "the picture is 400x200"),
    ],
)
def test_a_bad_row_never_loses_the_rest(change: Any, reason: str, tmp_path: Path) -> None:
    rows = [screenspot_pro("0.png", box, "a") for box in CORNERS]
    rows[0].update(change)
    value, (rejected,) = read(make(tmp_path, rows))
    assert [t.steps[0].target_box for t in value] == CORNERS[1:]
    assert rejected.where == "row 0"
    assert reason in rejected.reason


@pytest.mark.parametrize("kind", ["polygon", "refusal"])
def test_what_osworld_g_has_beside_boxes(kind: str, tmp_path: Path) -> None:
    rows = [
        {
            **osworld_g("0.png", CORNERS[1], "a"),
            "box_type": kind,
            "box_coordinates": [1, 2, 3, 4, 5, 6],
        },
        osworld_g("1.png", CORNERS[1], "b"),
    ]
    value, (rejected,) = read(make(tmp_path, rows))
    assert [t.instruction for t in value] == ["b"]
    assert kind in rejected.reason


def test_a_set_that_is_not_known_needs_a_choice_where_nothing_decides(tmp_path: Path) -> None:
    rows = [{"image_path": "0.png", "bbox": list(CORNERS[0]), "instruction": "a"}]
    value, (rejected,) = read(make(tmp_path, rows))
    assert not value
    assert "--boxes" in rejected.reason
    assert (
        read(tmp_path, boxes="xyxy", coordinates="pixels")[0][0].steps[0].target_box == CORNERS[0]
    )
    thousand = [{"image_path": "0.png", "bbox": [100, 150, 500, 300], "instruction": "a"}]
    write_json(tmp_path / "set.json", thousand)
    assert (
        read(tmp_path, boxes="xyxy", coordinates="thousand")[0][0].steps[0].target_box == CORNERS[0]
    )


def test_the_sample_of_every_reader(tmp_path: Path) -> None:
    grounding(tmp_path)
    value, rejected = read(tmp_path)
    assert not rejected
    assert value[0].steps[0].action == Action("click", 100, 50)
    assert json.loads((tmp_path / "annotations" / "gimp_linux.json").read_text())


# The sets that are asked for by name


def published(folder: Path, table: str, pictures: str, rows: list[Any]) -> Path:
    for number in range(3):
        path = folder / pictures / f"{number}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(png(number))
    write_json(folder / table, rows)
    return folder


def screenspot_v2_folder(folder: Path, **change: Any) -> Path:
    rows = [screenspot(f"{i}.png", box, f"text {i}") for i, box in enumerate(CORNERS)]
    rows[0].update(change)
    return published(folder, "screenspot_desktop_v2.json", "screenspotv2_image", rows)


def screenspot_pro_folder(folder: Path, **change: Any) -> Path:
    rows = [screenspot_pro(f"excel/{i}.png", box, f"text {i}") for i, box in enumerate(CORNERS)]
    rows[0].update(change)
    return published(folder, "annotations/excel_windows.json", "images/excel", rows)


def osworld_g_folder(folder: Path, **change: Any) -> Path:
    rows = [osworld_g(f"{i}.png", box, f"text {i}") for i, box in enumerate(CORNERS)]
    rows[0].update(change)
    return published(folder, "OSWorld-G.json", "images", rows)


PUBLISHED = {
    "screenspot_v2": screenspot_v2_folder,
    "screenspot_pro": screenspot_pro_folder,
    "osworld_g": osworld_g_folder,
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_set_by_name_is_read_as_grounding_reads_it(name: str, tmp_path: Path) -> None:
    folder = PUBLISHED[name](tmp_path)
    value, rejected = read_source(folder, name)
    assert not rejected
    assert [t.steps[0].target_box for t in value] == CORNERS
    assert {t.source for t in value} == {name}
    assert detect_format(folder) == "grounding"
    remaining, _ = read(folder)
    assert [(t.id, t.instruction, t.steps[0].action, t.domain, t.apps) for t in value] == [
        (t.id, t.instruction, t.steps[0].action, t.domain, t.apps) for t in remaining
    ]


@pytest.mark.parametrize("name", PUBLISHED)
def test_another_layout_is_an_error_that_says_the_right_one(name: str, tmp_path: Path) -> None:
    make(tmp_path, [os_atlas("0.png", CORNERS[0], "a")])
    with pytest.raises(SourceError, match=f"is not laid out as {name}: .*images?"):
        read_source(tmp_path, name)


@pytest.mark.parametrize(
    ("name", "change", "reason"),
    [
        ("screenspot_v2", {"bbox": [300, 100, 150, 90]}, "leaves the 400x200"),
        ("screenspot_v2", {"img_filename": "9.png"}, "not in the source"),
        ("screenspot_v2", {"instruction": None}, "missing"),
        ("screenspot_pro", {"bbox": [200, 60, 40, 30]}, "ends before it starts"),
        ("screenspot_pro", {"img_size": [800, 400]}, "the picture is 400x200"),
        ("screenspot_pro", {"img_size": None}, "the picture is 400x200"),
        ("osworld_g", {"box_type": "circle"}, "none of bbox, polygon, refusal"),
        ("osworld_g", {"box_type": None}, "missing"),
        ("osworld_g", {"box_type": "polygon", "box_coordinates": [1, 2, 3, 4]}, "three corners"),
        ("osworld_g", {"box_type": "polygon", "box_coordinates": [1, 2, 3, 4, 5]}, "three corners"),
        ("osworld_g", {"box_type": "polygon", "box_coordinates": [1, 2, 3, 4, 5, "6"]}, "number"),
        ("osworld_g", {"box_type": "polygon", "box_coordinates": [0, 9, 50, 9, 20, 9]}, "empty"),
        ("osworld_g", {"box_type": "polygon", "box_coordinates": [0, 0, 900, 0, 0, 9]}, "leaves"),
    ],
)
def test_a_bad_row_of_a_set_is_named(name: str, change: Any, reason: str, tmp_path: Path) -> None:
    value, (rejected,) = read_source(PUBLISHED[name](tmp_path, **change), name)
    assert [t.steps[0].target_box for t in value] == CORNERS[1:]
    assert rejected.where == "row 0"
    assert reason in rejected.reason


def test_polygons_and_refusals_of_osworld_g(tmp_path: Path) -> None:
    # An L: the middle of the box around it is outside.
    corners = [100, 20, 120, 20, 120, 160, 300, 160, 300, 180, 100, 180]
    rows = [
        osworld_g("0.png", CORNERS[0], "a")
        | {"box_type": "polygon", "box_coordinates": corners, "id": "A-0"},
        osworld_g("1.png", CORNERS[0], "b")
        | {"box_type": "refusal", "box_coordinates": [-1, -1, -1, -1]},
    ]
    folder = published(tmp_path, "OSWorld-G_refined.json", "images", rows)
    (first, second), rejected = read_source(folder, "osworld_g")
    assert not rejected
    assert first.steps[0].target_box == (100, 20, 300, 180)
    assert first.steps[0].action == Action("click", 110, 100)
    extra = json.loads(first.steps[0].extra)
    assert extra["id"] == "A-0"
    assert extra["target_polygon"][:2] == [[100, 20], [120, 20]]
    assert second.steps[0].action == Action("fail")
    assert second.steps[0].target_box is None
    assert not second.steps[0].elements


def test_a_set_can_be_built(tmp_path: Path) -> None:
    osworld_g_folder(tmp_path / "source", box_type="refusal", box_coordinates=[-1, -1, -1, -1])
    report = build(
        tmp_path / "source",
        tmp_path / "dataset",
        corruptions="resolution:scale=0.5",
        format="osworld_g",
    )
    assert report.rejected == 0
    rows = {row["id"]: row for row in open_dataset(tmp_path / "dataset")}
    assert rows["OSWorld-G/000000/0000/clean"]["action"]["type"] == "fail"
    assert rows["OSWorld-G/000001/0000/resolution"]["target_box"] == [150, 50, 195, 95]
    assert {row["source"] for row in rows.values()} == {"osworld_g"}
