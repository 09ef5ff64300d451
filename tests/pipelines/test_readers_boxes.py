"""x, y, width, height or two corners: decided for a table, never for a row."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hijack_data.smart_resize import smart_resize
from hijack_data.types import Trajectory
from pipelines import build
from pipelines.dataset.manifest import read_manifest
from pipelines.readers import Rejected, get_reader
from pipelines.readers.box_forms import box_in, detect_form
from pipelines.readers.fields import FieldError
from pipelines.readers.reader_options import ReaderOptions, with_choices

from support.formats import png, write_table

SIZES = [(200, 400), (1080, 1920)]
# Boxes as two corners: a row can only be that where x1 + x2 is beyond the picture.
PLAIN, FAR, CORNER = (40, 30, 200, 60), (300, 100, 390, 190), (0, 0, 10, 10)


def write(file: Path, boxes: list[Any], order: str, scale: str = "pixels") -> None:
    """A table of boxes, given as corners in a 400x200 picture, written in an order and a space."""
    rows = []
    for x1, y1, x2, y2 in boxes:
        numbers = [x1, y1, x2 - x1, y2 - y1] if order == "xywh" else [x1, y1, x2, y2]
        sides = (400, 200, 400, 200) if scale == "fractions" else (1, 1, 1, 1)
        bbox = [float(n) / side for n, side in zip(numbers, sides, strict=True)]
        picture = {"bytes": png(0), "path": None}
        rows.append({"image": picture, "instruction": "the button", "bbox": bbox})
    write_table(file, rows)


def read(path: Path, **choices: str) -> tuple[list[Any], list[Rejected]]:
    items = list(with_choices(get_reader("parquet"), ReaderOptions(**choices)).read(path))
    steps = [i.steps[0] for i in items if isinstance(i, Trajectory)]
    for step in steps:
        x1, y1, x2, y2 = step.target_box
        assert (step.action.x, step.action.y) == ((x1 + x2) // 2, (y1 + y2) // 2)
    return [s.target_box for s in steps], [i for i in items if isinstance(i, Rejected)]


@pytest.mark.parametrize("order", ["xywh", "xyxy"])
@pytest.mark.parametrize("scale", ["pixels", "fractions"])
def test_one_row_decides_for_all(order: str, scale: str, tmp_path: Path) -> None:
    boxes = [PLAIN, CORNER, FAR, PLAIN]  # only FAR can be nothing else, in either order
    write(tmp_path / "a.parquet", boxes, order, scale)
    assert read(tmp_path) == (boxes, [])


def test_where_no_row_decides_the_user_does(tmp_path: Path) -> None:
    write(tmp_path / "source" / "a.parquet", [PLAIN], "xywh")
    value, (rejected,) = read(tmp_path / "source")
    assert not value
    assert (rejected.where, rejected.field) == ("", "bbox")
    assert "--boxes" in rejected.reason
    assert read(tmp_path / "source", boxes="xywh") == ([PLAIN], [])
    build(tmp_path / "source", tmp_path / "out", boxes="xywh")
    assert read_manifest(tmp_path / "out")["parameters"]["boxes"] == "xywh"


def test_rows_that_disagree_refuse_the_table(tmp_path: Path) -> None:
    write(tmp_path / "a.parquet", [FAR, PLAIN], "xyxy")
    only = [380.0, 5.0, 10.0, 10.0]
    picture = {"bytes": png(0), "path": None}
    rows = [
        {"image": picture, "instruction": "a", "bbox": [float(n) for n in FAR]},
        {"image": picture, "instruction": "b", "bbox": only},
    ]
    write_table(tmp_path / "a.parquet", rows)
    value, (rejected,) = read(tmp_path)
    assert not value
    assert "disagree" in rejected.reason
    assert read(tmp_path, boxes="xywh")[0] == [(380, 5, 390, 15)]


def test_a_broken_row_says_nothing(tmp_path: Path) -> None:
    write(tmp_path / "a.parquet", [FAR, (10, 10, 900, 20), PLAIN], "xyxy")
    value, (rejected,) = read(tmp_path)
    assert value == [FAR, PLAIN]
    assert (rejected.where, "leaves the 400x200" in rejected.reason) == ("row 1", True)


@pytest.mark.parametrize("size", SIZES)
@given(data=st.data())
def test_boxes_mean_the_same_in_every_form(size: Any, data: Any) -> None:
    height, width = size
    x1, y1 = data.draw(st.integers(0, width - 1)), data.draw(st.integers(0, height - 1))
    x2, y2 = data.draw(st.integers(x1 + 1, width)), data.draw(st.integers(y1 + 1, height))
    sides = {
        "pixels": (1, 1),
        "fractions": (width, height),
        "thousand": (width / 1000, height / 1000),
    }
    for space, (across, down) in sides.items():
        for order, (c, d) in {"xyxy": (x2, y2), "xywh": (x2 - x1, y2 - y1)}.items():
            numbers = [x1 / across, y1 / down, c / across, d / down]
            if space == "pixels" or max(numbers) > 1 or space == "fractions":
                assert box_in((space, order), numbers, size, "bbox") == (x1, y1, x2, y2)


@pytest.mark.parametrize(
    "bad", [[1, 2, 3], [1, 2, 3, float("nan")], [1, 2, 3, True], "1,2,3,4", None]
)
def test_what_is_no_box(bad: Any) -> None:
    with pytest.raises(FieldError):
        box_in(("pixels", "xyxy"), bad, (200, 400), "bbox")
    assert detect_form([bad, [300, 100, 390, 190]], lambda _: (200, 400), ReaderOptions()) == (
        "pixels",
        "xyxy",
    )


def test_boxes_of_the_resized_picture_are_scaled() -> None:
    size = (2160, 3840)
    height, width = smart_resize(*size)
    assert (height, width) != size
    box = box_in(("resized", "xyxy"), [width / 4, height / 4, width, height], size, "bbox")
    assert box == (960, 540, 3840, 2160)


@pytest.mark.parametrize("order", ["xyxy", "xywh"])
def test_fractions_are_no_thousandths(order: str) -> None:
    """On a picture of four thousand pixels they would be a box of a few in its corner."""
    with pytest.raises(FieldError, match="in another space"):
        box_in(("thousand", order), [0.3, 0.3, 0.9, 0.9], (2160, 3840), "bbox")


def test_pictures_are_looked_at_only_as_far_as_it_matters() -> None:
    requests: list[int] = []

    def size(index: int) -> Any:
        requests.append(index)
        return (200, 400)

    boxes = [list(PLAIN), list(FAR), *[list(PLAIN)] * 100]
    assert detect_form(boxes, size, ReaderOptions()) == ("pixels", "xyxy")
    assert requests == [0, 1]
