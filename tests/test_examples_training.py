"""The training examples run, and bring the target into the model's own pixels."""

import importlib
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


@pytest.fixture
def vlm(monkeypatch):
    return imported(monkeypatch, "tiny_vlm")


@pytest.fixture
def qwen(monkeypatch):
    pytest.importorskip("torchvision")
    pytest.importorskip(
        "transformers",
        reason="needs the extra [dev]: the model and its processor are transformers' own",
    )
    monkeypatch.delitem(sys.modules, "tiny_vlm", raising=False)
    return imported(monkeypatch, "tiny_qwen")


def imported(monkeypatch, name):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    monkeypatch.delitem(sys.modules, name, raising=False)
    return importlib.import_module(name)


def run(script, *options):
    command = [sys.executable, "-W", "error", str(EXAMPLES / script), *options]
    process = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert process.returncode == 0, process.stderr
    return process.stdout


def test_torch_example():
    pytest.importorskip("torchvision")
    pytest.importorskip(
        "transformers", reason="needs the extra [dev]: the model is transformers' own"
    )
    out = run("train_torch.py", "--epochs", "2")
    first, second = (float(v) for v in re.findall(r": ([\d.]+) nats", out))
    assert second < first < 5  # all of the 101 tokens alike would be 4.6


def test_grain_example():
    pytest.importorskip("jax")
    pytest.importorskip("grain.python")
    out = run("train_grain.py", "--epochs", "2")
    assert "compiled 1 time" in out


def test_patches_are_in_qwens_order(vlm):
    height, width = 56, 84
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    centres = vlm.in_order(np.stack([x + 0.5, y + 0.5])).mean(axis=-1)
    assert centres.shape == (24, 2)
    assert centres[:5].tolist() == [[7, 7], [21, 7], [7, 21], [21, 21], [35, 7]]
    assert centres[12].tolist() == [7, 35]


def test_the_target_lands_where_the_model_sees_it(vlm):
    """The brightest patch of a screen with one white button is the one at the mapped point,
    corrupted or not."""
    processor = vlm.Processor(max_pixels=256 * 28 * 28)
    screen = np.zeros((1080, 1920, 3), np.uint8)
    button = (1400, 300, 1480, 360)
    screen[300:360, 1400:1480] = 255
    for spec in (hj.Resolution(scale=0.5), hj.Resolution(scale=0.77), hj.Subtitle(color="#202020")):
        plan = spec.plan(hj.Scene(size=(1080, 1920)), seed=1)
        image = hj.apply(plan, screen)
        patches, centres = processor(image)
        x1, y1, x2, y2 = plan.coords.boxes_to_observation([button])[0].tolist()
        point = processor.to_model(((x1 + x2) / 2, (y1 + y2) / 2), image.shape[:2])
        height, width = processor.coords(image.shape[:2]).observation
        brightest = centres[patches.mean(axis=1).argmax()] * (width, height)
        assert np.abs(brightest - point).max() <= vlm.PATCH
        assert (
            button[0]
            <= plan.coords.to_screen(processor.coords(image.shape[:2]).to_screen(point))[0]
            < button[2]
        )


def test_transformers_gives_the_same_patches(vlm):
    pytest.importorskip(
        "transformers", reason="transformers is not installed: the NumPy layout is used"
    )
    processor = vlm.Processor()
    image = np.asarray(Image.open(vlm.samples()[0]["path"]).convert("RGB"))
    processed = processor(image)[0]
    processor.theirs = None
    assert np.abs(processed - processor(image)[0]).max() < 0.03


def sample(vlm, n, plan=None):
    torch = pytest.importorskip("torch")
    row = vlm.samples()[n]
    image = np.asarray(Image.open(row["path"]).convert("RGB"))
    if plan is not None:
        image = hj.apply(plan, image)
        row["target"] = plan.coords.boxes_to_observation([row["target"]])[0].tolist()
    return {**row, "image": torch.from_numpy(image.copy()).permute(2, 0, 1)}, image.shape[:2]


def test_the_answer_leads_back_to_the_target_on_the_screen(vlm, qwen):
    """What the labels say, read as the model's answer, is a click inside the target, whatever the
    screen's size."""
    spec = hj.Resolution(scale=0.5)
    for n in range(3):
        box = vlm.samples()[n]["target"]
        for plan in (None, spec.plan(hj.Scene(size=(1080, 1920)), seed=1)):
            row, size = sample(vlm, n, plan)
            batch = qwen.Collate()([row])
            output = qwen.decode([t for t in batch["labels"][0].tolist() if t != qwen.IGNORED])
            grid = batch["image_grid_thw"][0].tolist()
            x, y = qwen.read_answer(output)
            assert 0 <= x < grid[2] * vlm.PATCH
            assert 0 <= y < grid[1] * vlm.PATCH
            calls = vlm.Processor().coords(size)
            assert calls.observation == (grid[1] * vlm.PATCH, grid[2] * vlm.PATCH)
            x, y = (
                calls.to_screen((x, y))
                if plan is None
                else plan.coords.to_screen(calls.to_screen((x, y)))
            )
            assert box[0] <= x < box[2]
            assert box[1] <= y < box[3]


def test_a_batch_of_different_sizes_is_what_the_model_takes(vlm, qwen):
    small = hj.Resolution(scale=0.2).plan(hj.Scene(size=(1080, 1920)), seed=1)
    rows = [sample(vlm, 0, small)[0], sample(vlm, 1)[0]]
    batch = qwen.Collate()(rows)
    pieces = (batch["input_ids"] == qwen.IMAGE).sum(1)
    assert (pieces == batch["image_grid_thw"].prod(1) // vlm.MERGE**2).all()
    assert pieces[0] < pieces[1]
    assert (batch["attention_mask"][0] == 0).any(), "the shorter row is padded"
    assert batch["attention_mask"][1].all()
    assert (batch["labels"][batch["attention_mask"] == 0] == qwen.IGNORED).all()
    for n, row in enumerate(rows):
        assert row["instruction"] in qwen.decode(batch["input_ids"][n].tolist())
        assert qwen.decode(batch["labels"][n].tolist()) == qwen.answer(qwen.Collate().point(row))
    model = qwen.build()
    loss = model(**batch).loss
    loss.backward()
    assert 3 < loss.item() < 7
    assert model.model.visual.patch_embed.proj.weight.grad.abs().sum() > 0, (
        "the picture is looked at"
    )


def test_characters_are_tokens(qwen):
    assert qwen.decode(qwen.encode("Open (the) menu ~")) == "Open (the) menu ~"
    assert qwen.decode(qwen.encode("Zo\u00eb")) == "Zo?"
    assert qwen.read_answer("so (12,345).") == (12, 345)
    assert qwen.read_answer("(12,") is None
