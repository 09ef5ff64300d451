"""Elements found in the picture itself: on drawn screens whose elements are known, and on real
screenshots."""

import hashlib
import json
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw, ImageFont

from hijack_data.elements import boxes_from_picture
from hijack_data.elements.detector import MAX_PARTS

cv2 = pytest.importorskip("cv2", reason="needs the extra 'vision'")

ROOT = Path(__file__).resolve().parents[2]
FONT = ROOT / "hijack_data" / "fonts" / "DejaVuSans.ttf"
INK = {
    "white": ((250, 250, 250), (20, 20, 20), (225, 225, 225)),
    "dark": ((30, 30, 30), (230, 230, 230), (55, 55, 55)),
}


def screen(theme: str = "white", size: tuple[int, int] = (1920, 1080)) -> Image.Image:
    return Image.new("RGB", size, INK[theme][0])


def write(
    image: Image.Image, place: tuple[int, int], text: str, theme: str = "white", size: int = 16
) -> list[int]:
    draw = ImageDraw.Draw(image)
    font = ImageFont.truetype(str(FONT), size, layout_engine=ImageFont.Layout.BASIC)
    draw.text(place, text, fill=INK[theme][1], font=font)
    return [int(v) for v in draw.textbbox(place, text, font=font)]


def covering(boxes: np.ndarray, wanted: list[int], slack: int) -> bool:
    """Whether one box covers `wanted` and reaches over it by at most `slack` pixels a side."""
    gap = np.array(wanted) - boxes
    grown = np.concatenate([gap[:, :2], -gap[:, 2:]], 1)
    return bool(((grown >= -2) & (grown <= slack)).all(1).any())


@pytest.mark.parametrize("theme", ["white", "dark"])
def test_lines_of_text_are_found_one_by_one(theme: str) -> None:
    image = screen(theme)
    lines = [
        write(image, (100, 100 + 40 * i), f"Line {i}: open the file menu", theme) for i in range(10)
    ]
    result = boxes_from_picture(np.asarray(image))
    assert len(result) == 10
    assert all(covering(result.boxes, line, 4) for line in lines)
    assert set(result.roles) == {"thing"}
    assert result.source == "picture"


@pytest.mark.parametrize("theme", ["white", "dark"])
def test_a_button_and_an_input_count_once_each(theme: str) -> None:
    image = screen(theme)
    draw = ImageDraw.Draw(image)
    draw.rounded_rectangle((300, 200, 459, 239), 6, fill=INK[theme][2])
    write(image, (340, 210), "Save as", theme)
    draw.rectangle((300, 300, 1299, 339), outline=INK[theme][1])
    write(image, (312, 310), "Search the web", theme)
    result = boxes_from_picture(np.asarray(image))
    assert len(result) == 2
    assert covering(result.boxes, [300, 200, 460, 240], 3)
    assert covering(result.boxes, [300, 300, 1300, 340], 3)
    assert result.roles == ("control", "control")


def test_icons_in_a_window_are_found_and_the_window_is_not() -> None:
    image = screen()
    draw = ImageDraw.Draw(image)
    draw.rounded_rectangle((100, 100, 1500, 900), 40, outline=(90, 90, 90))
    draw.line((100, 150, 1500, 150), fill=(90, 90, 90))
    icons = [[200 + 150 * i, 300, 264 + 150 * i, 364] for i in range(8)]
    for x1, y1, x2, y2 in icons:
        draw.rounded_rectangle((x1, y1, x2 - 1, y2 - 1), 8, fill=(40, 90, 200))
        draw.ellipse((x1 + 16, y1 + 16, x2 - 16, y2 - 16), fill=(250, 220, 60))
    result = boxes_from_picture(np.asarray(image))
    assert len(result) == 8
    assert all(covering(result.boxes, icon, 4) for icon in icons)


def test_what_lies_in_a_picture_is_not_counted_again() -> None:
    image = screen()
    draw = ImageDraw.Draw(image)
    draw.rectangle((400, 400, 489, 489), outline=(20, 20, 20))
    draw.ellipse((430, 430, 460, 460), fill=(200, 40, 40))
    result = boxes_from_picture(np.asarray(image))
    assert len(result) == 1
    assert covering(result.boxes, [400, 400, 490, 490], 3)


def test_a_toolbar_is_not_one_control() -> None:
    image = screen()
    ImageDraw.Draw(image).rectangle((200, 200, 899, 239), fill=(225, 225, 225))
    words = [write(image, (220 + 110 * i, 210), f"Menu{i}") for i in range(6)]
    result = boxes_from_picture(np.asarray(image))
    assert len(result) == 6
    assert all(covering(result.boxes, word, 4) for word in words)


@pytest.mark.parametrize(
    "size", [(1, 1), (1, 700), (700, 1), (2, 2), (5, 9), (720, 1280), (1080, 1920)]
)
@pytest.mark.parametrize("colour", [0, 130, 255])
def test_one_colour_has_no_element(size: tuple[int, int], colour: int) -> None:
    result = boxes_from_picture(np.full((*size, 3), colour, np.uint8))
    assert result.boxes.shape == (0, 4)
    assert result.notes == ("nothing that looks like an element was found in the picture",)


def test_noise_and_fine_patterns_end_soon(noise: np.ndarray) -> None:
    boxes_from_picture(noise)
    dots = np.zeros((2160, 2300, 3), np.uint8)
    for y in range(0, 2160, 36):
        for x in range(0, 2300, 36):
            dots[y : y + 14, x : x + 14] = 255
    start = time.process_time()
    result = boxes_from_picture(dots)
    assert time.process_time() - start < 3
    assert 0 < len(result) <= MAX_PARTS
    assert result.notes[0].startswith(f"kept the {MAX_PARTS} largest of 3")


def test_a_huge_picture_is_scaled_back() -> None:
    image = np.full((10000, 10000, 3), 255, np.uint8)
    image[4000:4200, 6000:6240] = (30, 60, 200)
    image[9800:9990, 9700:9950] = (30, 60, 200)
    result = boxes_from_picture(image)
    assert len(result) == 2
    assert covering(result.boxes, [6000, 4000, 6240, 4200], 30)
    assert covering(result.boxes, [9700, 9800, 9950, 9990], 30)


def test_torch_jax_pil_and_numpy_agree() -> None:
    torch, jnp = pytest.importorskip("torch"), pytest.importorskip("jax.numpy")
    image = screen(size=(640, 360))
    write(image, (50, 60), "Accessories")
    pixels = np.array(image)
    expected = boxes_from_picture(pixels).boxes
    assert len(expected) == 1
    tensor = torch.from_numpy(pixels).permute(2, 0, 1)
    for second in (
        image,
        image.convert("RGBA"),
        tensor,
        tensor.contiguous(),
        jnp.asarray(pixels),
        pixels[:, ::-1][:, ::-1],
    ):
        assert np.array_equal(boxes_from_picture(second).boxes, expected)
    assert np.array_equal(pixels, np.asarray(image))


REAL = [
    "022_OpenCUA_OH23HT37NP.png",
    "165_ScaleCUA_1360x768_cnn.png",
    "169_ScaleCUA_finder.png",
    "180_ShowUI_0730d43001da36204b8cb9495b61308.png",
    "183_OmniParser_excel.png",
    "089_cua_01_home_view.png",
    "208_terminal_overview.png",
    "190_computer_use_ootb_booking.png",
]


@pytest.mark.parametrize("name", REAL)
def test_real_screens_have_many_small_elements_and_no_giant(shared_data: Path, name: str) -> None:
    with Image.open(shared_data / "screenshots" / name) as file:
        image = file.convert("RGB")
    result = boxes_from_picture(image)
    sides = result.boxes[:, 2:] - result.boxes[:, :2]
    share = sides.prod(1) / (image.width * image.height)
    assert 30 <= len(result) <= 400
    assert (sides > 0).all()
    assert share.max() < 0.15
    assert np.median(share) < 0.005
    assert share.sum() < 0.4


# Elements of two screenshots, measured by hand: x1, y1, x2, y2.
KNOWN = {
    "180_ShowUI_0730d43001da36204b8cb9495b61308.png": {
        "address bar": (155, 62, 1744, 99),
        "search box": (496, 440, 1425, 498),
        "add shortcut": (930, 540, 990, 600),
        "Customize Chrome": (1695, 963, 1900, 1002),
        "Gmail": (1660, 144, 1702, 158),
        "taskbar search": (661, 1033, 933, 1070),
        "apps": (1867, 140, 1890, 161),
        "folder": (1112, 1036, 1142, 1065),
    },
    "183_OmniParser_excel.png": {
        "search": (786, 10, 1151, 39),
        "Home": (66, 56, 106, 72),
        "Wrap Text": (577, 95, 648, 112),
        "font": (192, 93, 308, 112),
        "Share": (1717, 53, 1787, 72),
        "column J": (628, 243, 640, 256),
        "Ready": (12, 1015, 43, 1028),
        "start": (484, 1044, 509, 1068),
    },
}


@pytest.mark.parametrize("name", sorted(KNOWN))
def test_known_elements_of_real_screens_are_covered(shared_data: Path, name: str) -> None:
    with Image.open(shared_data / "screenshots" / name) as file:
        result = boxes_from_picture(file.convert("RGB"))
    for value, (x1, y1, x2, y2) in KNOWN[name].items():
        overlap = np.minimum(result.boxes[:, 2:], (x2, y2)) - np.maximum(
            result.boxes[:, :2], (x1, y1)
        )
        common = np.maximum(overlap, 0).prod(1)
        union = (result.boxes[:, 2:] - result.boxes[:, :2]).prod(1) + (x2 - x1) * (y2 - y1) - common
        assert (common / union).max() > 0.45, f"{value}: best IoU {(common / union).max():.2f}"


# How many elements, and a hash of them. The plans of stored datasets depend on every box and on
# their order, so these change only with the pictures. The recordings are ours, and may be made
# anew; the screens are not.
RECORDED = {
    "multiply-00.png": (11, "7161dacb7fe36a49"),
    "multiply-06.png": (41, "f850b1abf76373d8"),
    "notes-03.png": (45, "e787d75c31618f57"),
    "rename-02.png": (43, "0bdc3d8bc8ca9391"),
}
SCREENS = {
    "180_ShowUI_0730d43001da36204b8cb9495b61308.png": (42, "03e79339b1e07c67"),
    "183_OmniParser_excel.png": (205, "7df237a891e9e139"),
    "169_ScaleCUA_finder.png": (98, "a63e174ea76fa485"),
}


def pinned(file: Path) -> tuple[int, str]:
    with Image.open(file) as image:
        result = boxes_from_picture(image.convert("RGB"))
    output = json.dumps([result.boxes.tolist(), result.roles])
    return len(result), hashlib.sha256(output.encode()).hexdigest()[:16]


@pytest.mark.parametrize("name", sorted(RECORDED))
def test_elements_of_our_recordings_stay_as_they_are(name: str) -> None:
    assert pinned(ROOT / "examples" / "recordings" / "images" / name) == RECORDED[name]


@pytest.mark.parametrize("name", sorted(SCREENS))
def test_elements_of_real_screens_stay_as_they_are(shared_data: Path, name: str) -> None:
    assert pinned(shared_data / "screenshots" / name) == SCREENS[name]


def test_the_number_of_threads_changes_nothing(shared_data: Path) -> None:
    with Image.open(shared_data / "screenshots" / REAL[0]) as file:
        image = np.asarray(file.convert("RGB"))
    before = cv2.getNumThreads()
    results = []
    try:
        for threads in (1, 2, 5):
            cv2.setNumThreads(threads)
            result = boxes_from_picture(image)
            results.append((result.boxes.tolist(), result.roles))
            assert cv2.getNumThreads() == threads
    finally:
        cv2.setNumThreads(before)
    assert results[0] == results[1] == results[2]


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 90), st.integers(1, 90), st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_boxes_lie_in_any_picture_and_are_sorted(
    height: int, width: int, seed: int, grain: int
) -> None:
    cells = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    image = np.kron(cells, np.ones((grain, grain, 1), np.uint8))[:300, :300]
    result = boxes_from_picture(image)
    x1, y1, x2, y2 = result.boxes.T
    assert (
        (x1 >= 0)
        & (y1 >= 0)
        & (x2 <= image.shape[1])
        & (y2 <= image.shape[0])
        & (x1 < x2)
        & (y1 < y2)
    ).all()
    places = [(b[1], b[0]) for b in result.boxes.tolist()]
    assert places == sorted(places)
    assert set(result.roles) <= {"control", "thing"}
