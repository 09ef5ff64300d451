"""`python -O` and `-OO` take assertions and docstrings away: the library works and checks as
ever."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
# The checks of these are assertions by design; they have to see to it that none is left out.
CHECKING = {"hijack_data/conformance.py", "online_env/effects/conformance.py"}
LIBRARY = [
    file.relative_to(ROOT).as_posix()
    for package in ("hijack_data", "pipelines", "online_env")
    for file in sorted((ROOT / package).rglob("*.py"))
]

END_TO_END = '''
import hashlib, json, sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

import hijack_data as hj
from hijack_data.plugin import Corruption, Draft, Paste, Resample, register
from hijack_data.config import load_config
from hijack_data.file_io import write_atomic
from hijack_data.picture_io import encode_png, load_image
from hijack_data.kernels.cpu import jit

SIZE = (540, 1100)
y, x = np.mgrid[: SIZE[0], : SIZE[1]]
screen = np.stack([x % 256, y % 256, (x + y) % 256], -1).astype(np.uint8)
scene = hj.Scene(SIZE, boxes=[[10, 10, 60, 40]], apps=("chrome",), target=(300, 200))
found = {}

for compiled in (False, True):
    if compiled:
        jit.start()
    for name in hj.corruption_names()[:9]:
        plan = hj.Plan.from_json(hj.make_corruption(name).plan(scene, seed=1, sample="a").to_json())
        out = hj.apply(plan, screen)
        found[f"{name} {compiled}"] = [plan.digest(), hashlib.sha256(out.tobytes()).hexdigest()]

config = load_config({"corruptions": ["marks", {"sequence": ["subtitle", "resolution"]}]})
found["config"] = [p.plan(scene, seed=1).digest() for p in config.corruptions.values()]

folder = Path(sys.argv[1])
write_atomic(folder / "screen.png", encode_png(screen))
found["file"] = bool((load_image(folder / "screen.png")[0] == screen).all())


@register
@dataclass(frozen=True)
class Dot(Corruption):
    """One dot."""

    name: ClassVar[str] = "dot"
    category: ClassVar[str] = "visual_disruptor"
    scope: ClassVar[str] = "observation"

    def make_plan(self, scene, stream, step):
        return Draft()


found["plug-in"] = hj.make_corruption("dot").plan(scene, seed=1).digest()


def refused(work):
    try:
        work()
    except hj.HijackError as error:
        return type(error).__name__
    return "accepted"


drifted = hj.Plan("x-v1", SIZE, ops=(Paste({"draw": "mark", "shape": "star", "size": 5, "color": "red"},
                                              ((1, 1),), "0" * 16),))
found["refused"] = [
    refused(lambda: hj.Plan.from_json('{"format":"agenthijack-plan","version":1,"x":NaN}')),
    refused(lambda: hj.Marks(number=-1)),
    refused(lambda: hj.Subtitle(font_path="nothing")),
    refused(lambda: hj.apply(drifted, screen)),
    refused(lambda: hj.apply(plan, screen[:5])),
    refused(lambda: Resample((2**20, 2**20))),
    refused(lambda: load_config({"corruptions": ["mrks"]})),
    refused(lambda: hj.Scene((5, 5), boxes=[[5, 5, 1, 1]])),
]
print(json.dumps(found, sort_keys=True))
'''

UNDOCUMENTED = """
from dataclasses import dataclass
from typing import ClassVar
import hijack_data as hj
from hijack_data.plugin import Corruption, Draft, register

@dataclass(frozen=True)
class Bare(Corruption):
    name: ClassVar[str] = "bare"
    category: ClassVar[str] = "visual_disruptor"
    scope: ClassVar[str] = "observation"
    def make_plan(self, scene, stream, step):
        return Draft()

try:
    register(Bare)
except hj.HijackError as error:
    print(error)
else:
    print("registered")
"""


def python(flags: list[str], *words: object) -> str:
    command = [sys.executable, *flags, *map(str, words)]
    process = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=600)
    assert process.returncode == 0, process.stderr
    return process.stdout


@pytest.fixture(scope="module")
def script(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("optimised") / "end_to_end.py"
    path.write_text(END_TO_END)
    return path


@pytest.fixture(scope="module")
def usual(script) -> dict:
    return json.loads(python([], script, script.parent))


@pytest.mark.parametrize("flag", ["-O", "-OO"])
def test_all_nine_are_planned_applied_and_checked_the_same(flag, script, usual):
    assert json.loads(python([flag], script, script.parent)) == usual
    assert "accepted" not in usual["refused"]


@pytest.mark.parametrize("flag", ["-O", "-OO"])
def test_the_command_line_works(flag, script, usual):
    picture, out = script.parent / "screen.png", script.parent / "out.png"
    words = ["-m", "hijack_data.cli", "apply", picture, "marks", "-o", out, "--seed", 1, "--json"]
    assert json.loads(python([flag], *words)) == json.loads(python([], *words))
    assert "pop_ups" in python([flag], "-m", "hijack_data.cli", "list")


@pytest.mark.parametrize("flag", ["-O", "-OO"])
def test_a_dataset_is_built_and_verified(flag, tmp_path):
    pytest.importorskip("pyarrow")
    pytest.importorskip("isal")
    words = ["-m", "hijack_data.cli", "build", "examples/recordings", "--out", tmp_path / "d"]
    words += ["--limit", 1, "--corruptions", "accidental_touch,multi_apps", "--json"]
    result = json.loads(python([flag], *words))
    assert result["rows_by_corruption"]["clean"] == 8
    python([flag], "-m", "hijack_data.cli", "verify", tmp_path / "d")


@pytest.mark.parametrize(
    ("flags", "message"),
    [([], "it has no docstring"), (["-O"], "it has no docstring"), (["-OO"], "registered")],
)
def test_a_plug_in_needs_a_docstring_where_python_keeps_them(flags, message):
    assert message in python(flags, "-c", UNDOCUMENTED)


def asserted(file: str) -> list[str]:
    tree = ast.parse((ROOT / file).read_text())
    lines = [node.lineno for node in ast.walk(tree) if isinstance(node, ast.Assert)]
    return [f"{file}:{line}" for line in lines]


def test_the_library_checks_nothing_by_assertion():
    assert len(LIBRARY) > 200
    assert [
        location for file in LIBRARY if file not in CHECKING for location in asserted(file)
    ] == []
