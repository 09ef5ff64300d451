"""Lines of text read from the picture."""

import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

from hijack_data.elements import boxes_from_ocr, ocr
from hijack_data.errors import ImageError, MissingDependencyError

pytest.importorskip("rapidocr", reason="needs the extra 'ocr'")

ROOT = Path(__file__).resolve().parents[2]
FONT = ROOT / "hijack_data" / "fonts" / "DejaVuSans.ttf"
SCREEN = ROOT / "examples" / "recordings" / "images" / "rename-03.png"


def page() -> tuple[np.ndarray, dict[str, tuple[float, float, float, float]]]:
    image = Image.new("RGB", (420, 150), (245, 245, 245))
    draw = ImageDraw.Draw(image)
    font = ImageFont.truetype(str(FONT), 22)
    lines = {"Settings": (20, 15), "Network": (250, 90)}
    for text, box in lines.items():
        draw.text(box, text, fill=(20, 20, 120), font=font)
    return np.asarray(image), {
        text: draw.textbbox(box, text, font=font) for text, box in lines.items()
    }


def test_lines_have_their_place_and_text() -> None:
    image, lines = page()
    result = boxes_from_ocr(image)
    assert sorted(result.names) == sorted(lines)
    assert set(result.roles) == {"text"}
    assert result.source == "ocr"
    assert result.boxes.dtype == np.int32
    for name, box in zip(result.names, result.boxes.tolist(), strict=True):
        assert np.abs(np.subtract(box, lines[name])).max() <= 10


def test_colours_are_read_in_the_right_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """RapidOCR expects blue, green, red."""
    calls: list[np.ndarray] = []
    monkeypatch.setattr(ocr, "_engine", lambda process: lambda image: calls.append(image))
    image = np.zeros((20, 30, 3), np.uint8)
    image[..., 0] = 200
    boxes_from_ocr(image)
    assert calls[0][0, 0].tolist() == [0, 0, 200]


def test_the_engine_is_loaded_once_and_says_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    image, _ = page()
    level = logging.getLogger().level
    boxes_from_ocr(image)
    before = ocr._engine.cache_info()
    boxes_from_ocr(image)
    after = ocr._engine.cache_info()
    assert (after.hits, after.misses) == (before.hits + 1, before.misses)
    assert capfd.readouterr() == ("", "")
    assert logging.getLogger().level == level


@pytest.mark.parametrize("size", [(1, 1), (7, 300), (300, 7), (20, 5000), (5000, 20), (8, 1900)])
def test_no_text_gives_no_box_and_a_note(size: tuple[int, int]) -> None:
    result = boxes_from_ocr(np.full((*size, 3), 255, np.uint8))
    assert result.boxes.shape == (0, 4)
    assert result.notes == ("no text was found in the picture",)


def test_a_batch_is_refused() -> None:
    with pytest.raises(ImageError, match="one picture at a time"):
        boxes_from_ocr(np.zeros((2, 40, 40, 3), np.uint8))


@pytest.mark.parametrize("module", ["rapidocr", "onnxruntime"])
def test_without_rapidocr(monkeypatch: pytest.MonkeyPatch, module: str) -> None:
    ocr._engine.cache_clear()
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingDependencyError, match=r"pip install .*\[ocr\]'"):
        boxes_from_ocr(page()[0])


@pytest.fixture
def engines(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bool], Any]]:
    """Loads the models, with or without OpenVINO."""
    pytest.importorskip("openvino", reason="needs the extra 'openvino'")

    def load(has: bool) -> Any:
        monkeypatch.setattr(ocr, "has_openvino", lambda: has)
        ocr._engine.cache_clear()
        return ocr._engine(os.getpid())

    yield load
    ocr._engine.cache_clear()


def test_openvino_finds_the_lines_that_onnx_runtime_finds(engines: Callable[[bool], Any]) -> None:
    screen = np.asarray(Image.open(SCREEN).convert("RGB"))[:600, 600:1400]
    engines(True)
    result = boxes_from_ocr(screen)
    engines(False)
    second = boxes_from_ocr(screen)
    assert len(result.names) > 10
    assert result.names == second.names
    assert result.boxes.tolist() == second.boxes.tolist()


def test_openvino_computes_in_float32_on_every_processor(engines: Callable[[bool], Any]) -> None:
    openvino = pytest.importorskip("openvino")
    finder = engines(True).text_det.session
    compiled = finder.session.get_compiled_model()
    assert compiled.get_property("INFERENCE_PRECISION_HINT") == openvino.Type.f32
    assert compiled.get_property("INFERENCE_NUM_THREADS") == ocr.threads()


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc")
def test_openvino_keeps_nothing_of_each_size_of_a_picture(engines: Callable[[bool], Any]) -> None:
    """Left to itself it keeps 4 MB of each, and a run reads thousands of parts of screens."""
    request = engines(True).text_det.session.session

    def read(sizes: Iterable[tuple[int, int]]) -> int:
        for height, width in sizes:
            request.infer([np.zeros((1, 3, height, width), np.float32)])
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    odd_sizes = [(height, width) for height in (96, 160, 224) for width in range(96, 608, 32)]
    before = read([(256, 640), odd_sizes[0]])
    assert read(odd_sizes) - before < 60e6
