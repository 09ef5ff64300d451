"""`text_boxes`: pop-ups keep lines of text free, which OCR finds on the live screen."""

import numpy as np
import pytest
from PIL import Image, ImageDraw

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("rapidocr", reason="needs the extra [ocr]")
pytest.importorskip("onnxruntime", reason="needs the extra [ocr]")

import hijack_data as hj
from hijack_data.drawing.text import load_font
from hijack_data.elements import Elements
from hijack_data.errors import ConfigError, MissingDependencyError
from hijack_data.types import as_boxes
from online_env.bench.config import load_bench
from online_env.environment import EvalSettings

from support.episodes import make
from support.live import SIZE, FakeStage

LINE = (20, 150, 620, 215)  # the text is somewhere in here
POP_UP = hj.PopUps(width=600, height=300, prefix_string="", suffix_string="")


class WrittenStage(FakeStage):
    """A stage whose screen has two buttons in its tree, and a line of text that is in no tree."""

    def __init__(self):
        super().__init__()
        image = Image.new("RGB", SIZE[::-1], "white")
        font = load_font("DejaVuSans", 44)
        ImageDraw.Draw(image).text((30, 155), "Quarterly report 2026", "black", font)
        self.desktop.screenshot = lambda: np.asarray(image)


def first_plan(corruption, text_boxes):
    env, _ = make(WrittenStage(), corruption=corruption, reveal=True, text_boxes=text_boxes)
    _, info = env.reset(seed=0)
    return info["agenthijack"]["plan"]


def test_a_pop_up_keeps_the_line_free():
    def rows(plan):
        (paste,) = plan["ops"]
        ((_, y),) = paste["at"]
        return y, y + paste["sprite"]["size"][1]

    top, bottom = rows(first_plan(POP_UP, False))
    assert top < LINE[3] - 10
    assert bottom > LINE[1] + 10, "without OCR the text is no obstacle"
    top, bottom = rows(first_plan(POP_UP, True))
    assert bottom <= LINE[1] + 20 or top >= LINE[3] - 20


def test_a_touch_chooses_among_the_elements_of_the_tree():
    def plan(text_boxes):
        return first_plan(hj.AccidentalTouch(step=0), text_boxes)

    assert plan(True) == plan(False)


def test_a_screen_that_did_not_change_is_read_once(monkeypatch):
    reads = []

    def read(picture):
        reads.append(picture)
        return Elements(as_boxes([LINE]), (), (), "ocr")

    monkeypatch.setattr("online_env.environment.observer.boxes_from_ocr", read)
    env, stage = make(WrittenStage(), corruption=POP_UP, text_boxes=True, reveal=True)
    env.reset(seed=0)
    env.step("WAIT")
    assert len(reads) == 1
    stage.desktop.screenshot = lambda: np.zeros((*SIZE, 3), np.uint8)
    env.step("WAIT")
    assert len(reads) == 2


def test_the_key_of_a_benchmark(tmp_path, monkeypatch):
    file = tmp_path / "bench.yaml"
    file.write_text("text_boxes: true\ntasks: small\n")
    assert load_bench(str(file)).to_data()["text_boxes"] is True
    file.write_text("tasks: small\n")
    assert "text_boxes" not in load_bench(str(file)).to_data()
    file.write_text("text_boxes: sometimes\n")
    with pytest.raises(ConfigError, match="text_boxes must be true or false"):
        load_bench(str(file))
    monkeypatch.setattr("hijack_data.extras.lacking", lambda modules: ["rapidocr"])
    with pytest.raises(MissingDependencyError, match=r"text_boxes needs rapidocr: .*\[ocr\]"):
        EvalSettings(text_boxes=True)
