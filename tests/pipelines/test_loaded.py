"""Datasets with corruptions of a file: recorded by hash, asked for by verify and --resume."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
from hijack_data import corruption as registry
from hijack_data import loading
from pipelines import build, verify
from pipelines.building.loaded_files import loaded_file_entries
from pipelines.errors import BuildError, DatasetError

from support.plugins import write

ROOT = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-m", "hijack_data.cli"]


def run(*words: Any, code: int = 0) -> str:
    """Run the command; what it says on standard error."""
    env = {key: value for key, value in os.environ.items() if key != loading.VARIABLE}
    command = [*COMMAND, *map(str, words)]
    process = subprocess.run(
        command, capture_output=True, text=True, cwd=ROOT, env=env, timeout=300
    )
    assert process.returncode == code, (process.returncode, process.stdout, process.stderr)
    assert "Traceback" not in process.stderr
    return process.stderr


def shards(folder: Path) -> dict[str, bytes]:
    """The files of rows of a dataset."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.parquet")}


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Forget what is loaded: now, and after the test."""
    registry.corruption_names()
    entries_before = dict(registry.CORRUPTIONS.entries)

    def forget() -> None:
        monkeypatch.setenv(loading.VARIABLE, "")
        monkeypatch.setattr(registry.CORRUPTIONS, "entries", dict(entries_before))
        monkeypatch.setattr(loading, "_files", {})
        monkeypatch.setattr(loading, "_listed", set())

    forget()
    return forget


@pytest.mark.parametrize("how", ["--materialised", "--lazy"])
def test_the_command_asks_for_the_file(recording: Any, tmp_path: Path, how: str) -> None:
    source, out, file = recording(), tmp_path / "out", write(tmp_path, "mine")
    sha256 = loading.hashlib.sha256(file.read_bytes()).hexdigest()
    make = ("build", source, "--out", out, "--corruptions", "bar", how)
    run("--load", file, *make)
    manifest = json.loads((out / "manifest.json").read_text())
    recorded = [{"file": "mine.py", "sha256": sha256, "corruptions": ["bar"]}]
    assert manifest["parameters"]["loaded"] == recorded
    card = (out / "README.md").read_text()
    assert "hijack --load mine.py build " in card
    assert f"`mine.py` has the SHA-256 `{sha256}`" in card
    assert "hijack --load mine.py verify ." in card

    (tmp_path / "other").mkdir()
    second = write(tmp_path / "other", "mine", code="x = 5")
    renamed = tmp_path / "other" / "renamed.py"
    renamed.write_bytes(file.read_bytes())
    for words in (("verify", out), (*make, "--resume")):
        output = run(*words, code=2)
        assert f"built with mine.py, SHA-256 {sha256} (bar)" in output
        assert "load that file: hijack --load mine.py" in output
        output = run("--load", second, *words, code=2)
        assert f"{second} is another file, SHA-256 " in output
        assert "hijack --load mine.py" in output
        run("--load", file, *words)
    run("--load", renamed, "verify", out)


def test_an_unfinished_build_asks_for_the_file(recording: Any, tmp_path: Path) -> None:
    source, out, file = recording(), tmp_path / "out", write(tmp_path, "mine")
    make = ("build", source, "--out", out, "--corruptions", "bar")
    run("--load", file, *make)
    manifest = json.loads((out / "manifest.json").read_text())
    (out / "manifest.json").unlink()
    (out / ".build").mkdir()
    (out / ".build" / "parameters.json").write_text(json.dumps(manifest["parameters"]))
    assert "load that file: hijack --load mine.py" in run(*make, "--resume", code=2)
    run("--load", file, *make, "--resume")
    assert json.loads((out / "manifest.json").read_text()) == manifest


def test_files_in_use_are_recorded(recording: Any, tmp_path: Path, fresh: Any, small: Any) -> None:
    loading.load_file(write(tmp_path, "one", name='name: ClassVar[str] = "one"'))
    loading.load_file(write(tmp_path, "two", name='name: ClassVar[str] = "two"'))
    source = recording()
    entries: dict[str, Any] = {
        "none": small["marks"],
        "one": hj.OneOf([hj.Sequence([small["marks"], hj.make_corruption("one")])]),
        "two": hj.Schedule(lambda epoch: hj.make_corruption("two")),
    }
    for name, planner in entries.items():
        build(source, tmp_path / name, corruptions={"x": planner})
        recorded = json.loads((tmp_path / name / "manifest.json").read_text())["parameters"]
        named = [entry["file"] for entry in recorded.get("loaded", [])]
        assert named == ([] if name == "none" else [f"{name}.py"])
        assert ("loaded" in recorded) == bool(named)
    fresh()
    assert verify(tmp_path / "none").ok
    with pytest.raises(DatasetError, match=r"was built with one\.py"):
        verify(tmp_path / "one")


def test_a_module_of_the_same_bytes_will_do(
    recording: Any, tmp_path: Path, fresh: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who imports the file as a module needs not load it, too."""
    file = write(tmp_path, "a_module_of_mine")
    loading.load_file(file)
    build(recording(), tmp_path / "out", corruptions="bar", output="lazy")
    fresh()
    with pytest.raises(DatasetError, match="hijack --load"):
        verify(tmp_path / "out")
    monkeypatch.syspath_prepend(tmp_path)
    loading.importlib.import_module("a_module_of_mine")
    assert verify(tmp_path / "out").ok


def test_a_resumed_build_refuses_a_changed_file(recording: Any, tmp_path: Path, fresh: Any) -> None:
    source, out = recording(), tmp_path / "out"
    loading.load_file(write(tmp_path))
    build(source, out, corruptions="bar")
    fresh()
    loading.load_file(write(tmp_path, code="x = 5"))
    with pytest.raises(DatasetError, match=r"bar\.py is another file"):
        build(source, out, corruptions="bar", resume=True)
    fresh()
    loading.load_file(write(tmp_path))
    with pytest.raises(BuildError, match="corruptions was"):
        build(source, out, corruptions="marks", resume=True)


def test_a_corruption_that_raises_is_named_and_the_others_are_built(
    recording: Any, tmp_path: Path, fresh: Any, small: Any
) -> None:
    loading.load_file(write(tmp_path, code="1 // 0"))
    result = build(
        recording(),
        tmp_path / "out",
        corruptions={"x": hj.make_corruption("bar"), "m": small["marks"]},
    )
    assert dict(result.rows) == {"clean": 6, "x": 0, "m": 6}
    ((reason, count),) = result.not_applicable["x"].items()
    assert reason.startswith("bar-vN: make_plan raised ZeroDivisionError")
    assert count == 6


def test_a_damaged_record_is_told(recording: Any, tmp_path: Path, fresh: Any) -> None:
    loading.load_file(write(tmp_path))
    build(recording(), tmp_path / "out", corruptions="bar")
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    for damage in (5, [5], [{}], {"file": "x"}):
        manifest["parameters"]["loaded"] = damage
        (tmp_path / "out" / "manifest.json").write_text(json.dumps(manifest))
        with pytest.raises(DatasetError, match="'loaded' is damaged"):
            verify(tmp_path / "out")


def test_workers_make_the_same_bytes(recording: Any, tmp_path: Path, fresh: Any) -> None:
    loading.load_file(write(tmp_path))
    source = recording(trajectories=4, steps=2)
    shared = {"corruptions": "bar,marks", "rows_per_shard": 1, "output": "lazy"}
    build(source, tmp_path / "one", **shared)
    build(source, tmp_path / "two", workers=2, **shared)
    assert len(shards(tmp_path / "one")) == 4
    assert shards(tmp_path / "one") == shards(tmp_path / "two")


RAY = """
import os, sys, warnings
warnings.simplefilter("ignore")
import ray
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, object_store_memory=80 * 2**20)
from hijack_data.loading import load_file
load_file(sys.argv[1])  # the cluster's processes were started before: they lack the variable
from pipelines import build
shared = {"corruptions": "bar", "rows_per_shard": 1}
report = build(sys.argv[2], sys.argv[3], workers=2, engine="ray", **shared)
print(dict(report.rows))
"""


def test_a_cluster_that_is_there_knows_it(recording: Any, tmp_path: Path, fresh: Any) -> None:
    pytest.importorskip("ray", reason="Ray is not installed: pip install 'agenthijack[ray]'")
    file, source = write(tmp_path), recording(trajectories=3, steps=2)
    command = [sys.executable, "-c", RAY, str(file), str(source), str(tmp_path / "ray")]
    process = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300)
    assert process.stdout.strip().endswith("{'clean': 6, 'bar': 6}"), process.stderr
    loading.load_file(file)
    build(source, tmp_path / "local", corruptions="bar", rows_per_shard=1)
    assert len(shards(tmp_path / "local")) == 3
    assert shards(tmp_path / "ray") == shards(tmp_path / "local")


def test_a_composite_of_a_file_inside_another_is_recorded(tmp_path: Path, fresh: Any) -> None:
    composite = "class Both(hj.Sequence):\n    pass"
    both = loading.load_reference(f"{write(tmp_path, 'mine', top=composite)}:Both")
    planner = hj.OneOf([both([hj.Marks(), hj.Subtitle()]), hj.PopUps()])
    [entry] = loaded_file_entries([planner])
    assert entry["file"] == "mine.py"
