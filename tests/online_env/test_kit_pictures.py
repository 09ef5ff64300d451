"""Pictures of tasks, and their judgement."""

import pytest
from PIL import Image, ImageChops, ImageDraw

from hijack_data.rng import Stream
from online_env.errors import DesktopTimeoutError
from online_env.tasks import hand as hand_module
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.hand import Hand
from online_env.tasks.kit import gimp
from online_env.tasks.machine import Machine

from support.trees import Trees, node, tree

HUGE = gimp.encode(Image.new("1", (16_000, 12_000)))  # more than Pillow opens


@pytest.fixture
def machine(tmp_path):
    return Machine(FolderDesktop(tmp_path))


@pytest.fixture
def drawing():
    return gimp.drawing(Stream(3, "test"), 200, 160)


def test_a_drawing_is_its_streams_own(drawing):
    assert gimp.difference(drawing, gimp.drawing(Stream(3, "test"), 200, 160)) == 0
    assert gimp.difference(drawing, gimp.drawing(Stream(4, "test"), 200, 160)) > 10


def test_the_same_picture_in_another_mode_is_right(machine, drawing):
    machine.write("a.png", gimp.encode(drawing.convert("RGBA")))
    assert list(gimp.picture_problems(machine, "a.png", drawing)) == []


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda p: gimp.encode(p, "BMP"), "is a BMP file, not PNG"),
        (lambda p: gimp.encode(p.crop((0, 0, 199, 160))), "(199, 160) pixels"),
        (lambda p: gimp.encode(p.rotate(180)), "looks different"),
        (lambda p: gimp.encode(p)[:200], "there is no picture a.png"),
        (lambda p: HUGE, "there is no picture a.png"),
        (lambda p: b"no picture", "there is no picture a.png"),
    ],
)
def test_what_differs_is_named(machine, drawing, change, problem):
    machine.write("a.png", change(drawing))
    items = list(gimp.picture_problems(machine, "a.png", drawing))
    assert len(items) == 1
    assert problem in items[0]


def test_a_missing_picture_is_a_problem(machine, drawing):
    items = list(gimp.picture_problems(machine, "a.png", drawing))
    assert items == ["there is no picture a.png"]


def test_the_quality_of_a_jpeg_file_is_read(machine, drawing):
    machine.write("a.jpg", gimp.encode(drawing, "JPEG", 61))
    picture = gimp.read_picture(machine, "a.jpg")
    assert picture is not None
    assert [quality for quality in range(55, 70) if gimp.has_quality(picture, quality)] == [61]


def test_a_picture_that_is_no_jpeg_has_no_quality(drawing):
    assert not gimp.has_quality(drawing, 75)


def test_grey_has_no_colours(drawing):
    assert gimp.colorfulness(drawing.convert("L")) == 0
    assert gimp.colorfulness(drawing) > 50


def least(picture):
    red, green, blue = picture.split()
    return ImageChops.darker(ImageChops.darker(red, green), blue)


@pytest.mark.parametrize("way", [lambda p: p.convert("L"), lambda p: p.split()[1], least])
def test_every_way_to_weigh_colours_gives_shades_of_grey(machine, drawing, way):
    machine.write("a.png", gimp.encode(way(drawing)))
    assert list(gimp.grey_problems(machine, "a.png", drawing)) == []


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda p: p, "a.png has colours"),
        (lambda p: ImageChops.invert(p.convert("L")), "looks different"),
        (lambda p: p.convert("1"), "looks different"),
        (lambda p: p.convert("L").reduce(2), "(100, 80) pixels"),
        (lambda p: p.convert("L").rotate(180), "looks different"),
    ],
)
def test_what_is_no_grey_version_is_named(machine, drawing, change, problem):
    machine.write("a.png", gimp.encode(change(drawing)))
    assert any(
        problem in grey_problem for grey_problem in gimp.grey_problems(machine, "a.png", drawing)
    )


def test_no_picture_is_no_grey_version(machine, drawing):
    items = list(gimp.grey_problems(machine, "a.png", drawing))
    assert items == ["there is no picture a.png"]


def test_a_dab_of_the_brush_is_seen(machine, drawing):
    spotted = drawing.copy()
    ImageDraw.Draw(spotted).ellipse((40, 40, 60, 60), "black")
    machine.write("a.png", gimp.encode(spotted))
    assert list(gimp.picture_problems(machine, "a.png", drawing)) != []


@pytest.mark.parametrize(("opacity", "is_right"), [(255, True), (0, False), (200, False)])
def test_what_cannot_be_seen_is_not_the_picture(machine, drawing, opacity, is_right):
    faint = drawing.convert("RGBA")
    faint.putalpha(opacity)
    machine.write("a.png", gimp.encode(faint))
    assert (list(gimp.picture_problems(machine, "a.png", drawing)) == []) == is_right
    grey = drawing.convert("LA")
    grey.putalpha(opacity)
    machine.write("b.png", gimp.encode(grey))
    assert (list(gimp.grey_problems(machine, "b.png", drawing)) == []) == is_right


@pytest.mark.parametrize("mode", ["I;16", "P", "LA", "1"])
def test_a_picture_of_an_unusual_mode_is_compared_all_the_same(machine, mode):
    black = Image.new("L", (8, 8))
    white = Image.new("RGB", (8, 8), "white")
    machine.write("a.png", gimp.encode(black.convert(mode)))
    items = list(gimp.picture_problems(machine, "a.png", white))
    assert items == ["a.png looks different: colours are off by 255.0 of 255"]
    assert list(gimp.grey_problems(machine, "a.png", white)) == items


# The dialog for the size of the canvas

DIALOG = node("dialog", "Set Image Canvas Size", size=(400, 400))
FIELDS = [
    node("spin-button", text=text, at=(100, 200 + 30 * row), size=(60, 20))
    for row, text in enumerate(["780", "460", "0", "0"])
]
CHAIN = node("push-button", at=(160, 200), size=(10, 50))


def test_the_canvas_is_set_field_by_field(monkeypatch):
    monkeypatch.setattr(hand_module, "PAUSE", 0.001)
    button = node("push-button", "Resize", "sensitive", at=(300, 500))
    result, without_dialog = (
        tree("gimp", DIALOG, *FIELDS, CHAIN, button),
        tree("gimp", node("frame", "a")),
    )
    desktop = Trees(
        [*[result] * 13, without_dialog]
    )  # three actions for each field, and the button
    gimp.set_canvas(Hand(desktop, 1), 580, 321, -200, 0)
    assert desktop.ran[:12:3] == [
        f"pyautogui.doubleClick(130, {210 + 30 * row})" for row in range(4)
    ]
    assert desktop.ran[2:12:3] == [
        f"pyautogui.write('{number}\\t')" for number in (580, 321, -200, 0)
    ]
    assert desktop.ran[12:] == ["pyautogui.click(340, 550)"]


@pytest.mark.parametrize("parts", [[DIALOG], [DIALOG, *FIELDS], [DIALOG, *FIELDS[:3], CHAIN]])
def test_a_canvas_dialog_that_does_not_show_its_parts_is_told(monkeypatch, parts):
    monkeypatch.setattr(hand_module, "PAUSE", 0.001)
    hand = Hand(Trees([tree("gimp", *parts)]), 0.05)
    with pytest.raises(DesktopTimeoutError, match="no dialog Set Image Canvas Size at rest"):
        gimp.set_canvas(hand, 580, 321, -200, 0)
