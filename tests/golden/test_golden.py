"""Golden hashes: plans and pictures must not change from one version of the library to the next.

`AGENTHIJACK_UPDATE_GOLDEN=1 pytest tests/golden` writes them anew; do that only together with a new
version of the corruption that changed (`version`), and say so in the changelog. Text depends on
FreeType's rasteriser: where another FreeType is installed, drawings that hold text are skipped.
"""

import hashlib
import importlib.util
import json
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import features

import hijack_data as hj
from hijack_data.backends import convert, to_numpy
from hijack_data.choices import BACKENDS
from hijack_data.conformance import picture, scene

GOLDEN = Path(__file__).with_name("golden.json")
UPDATE = os.environ.get("AGENTHIJACK_UPDATE_GOLDEN") == "1"
SIZE = (720, 1280)

CASES = {
    **{name: (name, {}) for name in hj.corruption_names()[:9]},
    "pop_ups-top": ("pop_ups", {"attack_position": "top", "small_factor": 2, "edge_thickness": 5}),
    "pop_ups-random": (
        "pop_ups",
        {"random_position": True, "avoid_elements": False, "size": "uniform"},
    ),
    "resolution-0.75": ("resolution", {"scale": 0.75}),
    "resolution-up": ("resolution", {"scale": 1.3}),
    "resolution-restore": ("resolution", {"scale": 0.25, "restore": True}),
    "marks-circle": (
        "marks",
        {"mark_type": "circle", "color": "#1080f0", "mark_size": 33, "avoid_elements": True},
    ),
    "marks-rectangle": ("marks", {"mark_type": "rectangle", "color": "green", "number": 7}),
    "subtitle-top": (
        "subtitle",
        {"position": "top", "color": "yellow", "edge_width": 5, "padding": 3},
    ),
    "subtitle-center": (
        "subtitle",
        {"position": "center", "subtitle_text": "naïve £5", "font_path": "DejaVuSans"},
    ),
    "subtitle-no-edge": ("subtitle", {"edge_width": 0, "color": "#30c0ff", "padding": 9}),
}


def make_plan(case: str) -> tuple[hj.Plan, np.ndarray]:
    name, values = CASES[case]
    return hj.make_corruption(name, **values).plan(
        scene(SIZE), seed=20260, sample="golden"
    ), picture(SIZE)


def sha(image) -> str:
    return hashlib.sha256(np.ascontiguousarray(to_numpy(image))).hexdigest()


@pytest.fixture(scope="session")
def golden() -> dict:
    if UPDATE:
        rows = {}
        for case in CASES:
            plan, image = make_plan(case)
            rows[case] = {"digest": plan.digest(), "picture": sha(hj.apply(plan, image))}
        text = json.dumps({"freetype": features.version("freetype2"), "cases": rows}, indent=1)
        GOLDEN.write_text(text + "\n")
    return json.loads(GOLDEN.read_text())


def skip_other_freetype(golden, case):
    here = features.version("freetype2")
    if case.startswith(("pop_ups", "subtitle")) and here != golden["freetype"]:
        pytest.skip(f"the golden text was drawn by FreeType {golden['freetype']}, here is {here}")


@pytest.mark.parametrize("case", CASES)
def test_plan_is_the_golden_one(golden, case):
    skip_other_freetype(golden, case)
    assert make_plan(case)[0].digest() == golden["cases"][case]["digest"]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("case", CASES)
def test_picture_is_the_golden_one(golden, case, backend):
    skip_other_freetype(golden, case)
    if backend != "numpy" and importlib.util.find_spec(backend) is None:
        pytest.skip(f"{backend} is not installed")
    plan, image = make_plan(case)
    assert sha(hj.apply(plan, convert(image, backend))) == golden["cases"][case]["picture"]
