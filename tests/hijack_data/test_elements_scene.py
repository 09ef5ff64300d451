"""`scene_from`: which source wins, what a picture may be, and what the errors say."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from hijack_data import extras
from hijack_data.elements import Elements, elements_from, scene_from
from hijack_data.errors import (
    ElementsError,
    HijackError,
    ImageError,
    ImageTypeError,
    MissingDependencyError,
    UnknownNameError,
)

ROOT = Path(__file__).resolve().parents[2]
BASE = "https://accessibility.ubuntu.example.org/ns"
TREE = (
    f'<desktop-frame xmlns:st="{BASE}/state" xmlns:cp="{BASE}/component"><entry name="URL"'
    ' st:showing="true" st:visible="true" cp:screencoord="(-10, 5)" cp:size="(60,'
    ' 20)"/></desktop-frame>'
)
LABELS = [[1, 2, 30, 40], [5, 6, 7, 8]]


def picture() -> np.ndarray:
    image = np.full((90, 160, 3), 255, np.uint8)
    image[20:50, 30:90] = (10, 60, 200)
    return image


def test_the_tree_wins_then_labels_then_the_picture() -> None:
    tree = scene_from(picture(), tree=TREE, labels=LABELS)
    assert tree.size == (90, 160)
    assert tree.boxes.tolist() == [[0, 5, 50, 25]]
    assert scene_from(picture(), labels=LABELS).boxes.tolist() == LABELS
    pytest.importorskip("cv2", reason="needs the extra 'vision'")
    (box,) = scene_from(picture()).boxes.tolist()
    assert np.abs(np.subtract(box, [30, 20, 90, 50])).max() <= 2
    assert elements_from(picture(), TREE, LABELS).names == ("URL",)
    assert [elements_from(picture(), *a).source for a in ((TREE,), (None, LABELS), ())] == [
        "tree",
        "labels",
        "picture",
    ]


def test_none_is_a_source_too() -> None:
    assert scene_from(picture(), detect="none").boxes.shape == (0, 4)
    result = elements_from(picture(), detect="none")
    assert result.source == "none"
    assert len(result.notes) == 1


def test_empty_labels_and_trees_do_not_fall_through() -> None:
    assert not len(scene_from(picture(), labels=[]).boxes)
    with pytest.raises(ElementsError):
        scene_from(picture(), tree="", labels=LABELS)


def test_apps_and_target_are_passed_on() -> None:
    scene = scene_from(picture(), labels=LABELS, apps=["gimp", "vlc"], target=(40, 30))
    assert scene.apps == ("gimp", "vlc")
    assert scene.target == (32, 22, 48, 38)
    assert scene_from(picture(), labels=LABELS, apps="gimp").apps == ("gimp",)
    with pytest.raises(HijackError, match="target"):
        scene_from(picture(), labels=LABELS, target=(1, 2, 3))


def test_every_kind_of_picture_has_its_size() -> None:
    torch, jnp = pytest.importorskip("torch"), pytest.importorskip("jax.numpy")
    pixels = picture()
    kinds = [
        pixels,
        Image.fromarray(pixels),
        Image.fromarray(pixels).convert("RGBA"),
        Image.new("P", (160, 90)),
        torch.from_numpy(pixels).permute(2, 0, 1),
        jnp.asarray(pixels),
    ]
    for image in kinds:
        assert scene_from(image, labels=LABELS).size == (90, 160)


@pytest.mark.parametrize(
    ("image", "error"),
    [
        (None, ImageTypeError),
        ("screen.png", ImageTypeError),
        ([[1, 2, 3]], ImageTypeError),
        (np.zeros((90, 160, 3)), ImageTypeError),
        (np.zeros((90, 160), np.uint8), ImageError),
        (np.zeros((90, 160, 4), np.uint8), ImageError),
        (np.zeros((3, 90, 160), np.uint8), ImageError),
        (np.zeros((2, 90, 160, 3), np.uint8), ImageError),
        (np.zeros((0, 160, 3), np.uint8), ImageError),
        (Image.new("RGB", (0, 5)), ImageError),
    ],
)
@pytest.mark.parametrize("labels", [None, LABELS])
def test_what_is_not_a_picture_is_refused(image: Any, error: type[Exception], labels: Any) -> None:
    with pytest.raises(error):
        scene_from(image, labels=labels)


@pytest.mark.parametrize("tree", [None, TREE])
def test_an_unknown_detector_is_refused_with_a_suggestion(tree: str | None) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'picture'"):
        scene_from(picture(), tree=tree, detect="pictures")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("detect", "module", "extra"), [("picture", "cv2", "vision"), ("ocr", "rapidocr", "ocr")]
)
def test_a_missing_detector_names_three_ways_out(
    monkeypatch: pytest.MonkeyPatch, detect: Any, module: str, extra: str
) -> None:
    from hijack_data.elements import ocr

    ocr._engine.cache_clear()
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingDependencyError) as caught:
        scene_from(picture(), detect=detect)
    for way in (extras.remedy(extra), "tree= or labels=", "detect='none'"):
        assert way in str(caught.value)
    assert len(scene_from(picture(), labels=LABELS).boxes) == 2


def test_importing_loads_no_detector() -> None:
    code = (
        "import sys, hijack_data.elements; "
        "print([m for m in ('cv2', 'rapidocr', 'onnxruntime', 'torch', 'jax') if m in sys.modules])"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert ran.stdout == "[]\n"


def test_elements_fill_in_and_check() -> None:
    elements = Elements(
        np.array([[1, 2, 3, 4], [5, 6, 7, 8]]), roles=("link", "entry"), source="labels"
    )
    assert elements.names == ("", "")
    assert elements.boxes.dtype == np.int32
    assert len(Elements()) == 0
    with pytest.raises(ElementsError, match="1 names for 2 boxes"):
        Elements(elements.boxes, names=("x",))
    with pytest.raises(ElementsError, match="did you mean 'labels'"):
        Elements(source="label")  # type: ignore[arg-type]
    with pytest.raises(AttributeError):
        elements.names = ()  # type: ignore[misc]
