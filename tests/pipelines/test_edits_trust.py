"""Datasets with what happens to the machine can be trusted like any others: both kinds, resumed,
verified, repeated."""

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data import pack as pack_module
from hijack_data.pack import AssetPack
from pipelines import build, open_dataset, render, verify
from pipelines.building.step_rows import RowCounts, RowSettings, make_rows
from pipelines.dataset.columns import COLUMNS
from pipelines.errors import BuildError
from pipelines.readers import get_reader

from support.dataset_files import shard_hashes
from support.events import COMBINED, FIVE


@pytest.mark.parametrize("clean", [True, False])
def test_both_kinds_are_equal_row_by_row(
    clean: bool, browsing: Path, nine: Any, assets: Path, tmp_path: Path
) -> None:
    planners = {
        **nine,
        **{label: COMBINED[label] for label in ("locked", "half", "dots", "mix", "both")},
    }
    for output in ("materialised", "lazy"):
        build(
            browsing,
            tmp_path / output,
            corruptions=planners,
            seed=11,
            output=output,
            assets=assets,
            clean=clean,
        )
    count = 0
    for first_row, right in zip(
        open_dataset(tmp_path / "materialised"), open_dataset(tmp_path / "lazy"), strict=True
    ):
        assert list(first_row) == list(right) == list(COLUMNS)
        assert first_row.pop("screenshot").tobytes() == right.pop("screenshot").tobytes()
        assert first_row == right
        count += 1
    reports = [verify(tmp_path / output) for output in ("materialised", "lazy")]
    assert [report.problems for report in reports] == [[], []]
    assert reports[1].regenerated == count - 10 * clean
    assert reports[0].regenerated == (count - 10 if clean else 0)


def test_load_dataset_reads_events(
    browsing: Path, assets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    datasets.disable_progress_bars()
    build(browsing, tmp_path / "out", corruptions=",".join(FIVE), assets=assets, output="lazy")
    dataset_rows = datasets.load_dataset(
        str(tmp_path / "out"), split="train", cache_dir=str(tmp_path / "cache")
    )
    assert {
        name: dataset_rows.features[name].dtype for name in ("event", "reminder", "inserted")
    } == {"event": "string", "reminder": "string", "inserted": "bool"}
    ours = list(open_dataset(tmp_path / "out"))
    for loaded_row, row in zip(dataset_rows.with_transform(render), ours, strict=True):
        assert (loaded_row["event"], loaded_row["inserted"], loaded_row["action"]) == (
            row["event"],
            row["inserted"],
            row["action"],
        )
        assert loaded_row["screenshot"].tobytes() == row["screenshot"].tobytes()


def test_a_resumed_build_ends_in_the_same_bytes(
    browsing: Path, nine: Any, assets: Path, tmp_path: Path
) -> None:
    options: dict[str, Any] = {"corruptions": nine, "assets": assets, "rows_per_shard": 45}
    build(browsing, tmp_path / "out", **options)
    before = shard_hashes(tmp_path / "out")
    assert len(before) == 2
    (tmp_path / "out" / "data" / "train-00001.parquet").unlink()
    (tmp_path / "out" / "manifest.json").unlink()
    (tmp_path / "out" / ".build").mkdir()
    build(browsing, tmp_path / "two", **options, workers=2)
    assert shard_hashes(tmp_path / "two") == before
    (tmp_path / "two" / "data" / "train-00001.parquet").unlink()
    assert build(browsing, tmp_path / "two", **options, resume=True).kept == 1
    assert shard_hashes(tmp_path / "two") == before


def test_a_build_is_not_resumed_with_another_pack(
    browsing: Path, assets: Path, tmp_path: Path
) -> None:
    build(browsing, tmp_path / "out", corruptions="verification", assets=assets)
    second = changed_pack(assets, tmp_path / "other")
    with pytest.raises(BuildError, match=r"assets was .*, is"):
        build(browsing, tmp_path / "out", corruptions="verification", assets=second, resume=True)
    shutil.copytree(assets, tmp_path / "same")
    again = build(
        browsing,
        tmp_path / "out",
        corruptions="verification",
        assets=tmp_path / "same",
        resume=True,
    )
    assert again.kept == 1


def changed_pack(assets: Path, folder: Path, name: str = "lock-small") -> Path:
    """The pack with another picture in the place of one."""
    shutil.copytree(assets, folder)
    picture = np.full((200, 320, 3), 77, np.uint8)
    Image.fromarray(picture).save(folder / f"{name}.webp", lossless=True)
    index = json.loads((folder / "index.json").read_text())
    entry = next(entry for entry in index["pictures"] if entry["id"] == name)
    entry["sha256"] = hashlib.sha256(picture.tobytes()).hexdigest()
    (folder / "index.json").write_text(json.dumps(index))
    return folder


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Forget loaded packs and drawn sprites, and use this pack, as a new process would."""

    def use(folder: Path) -> None:
        from hijack_data.drawing import raster

        monkeypatch.setattr(pack_module, "_asset_cache", {})
        monkeypatch.setattr(raster, "_cache", raster._Cache(2**24))
        monkeypatch.setenv("AGENTHIJACK_ASSETS", str(folder))

    return use


@pytest.mark.parametrize("output", ["materialised", "lazy"])
def test_verify_says_when_the_pack_differs(
    output: str, browsing: Path, assets: Path, fresh: Any, tmp_path: Path
) -> None:
    build(
        browsing,
        tmp_path / "out",
        corruptions="verification,app_minimization",
        assets=assets,
        output=output,
    )
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["parameters"]["assets"] == {
        "sha256": AssetPack.load(assets).digest,
        "licence": "made up for tests",
    }
    fresh(assets)
    assert (verify(tmp_path / "out").notes, verify(tmp_path / "out").ok) == ([], True)
    fresh(changed_pack(assets, tmp_path / "unused", "view"))  # no row shows it
    result = verify(tmp_path / "out")
    assert result.ok
    assert "is not the one of the build" in result.notes[0]
    assert "note: the asset pack here" in "\n".join(result.lines())
    fresh(changed_pack(assets, tmp_path / "used"))
    problems = verify(tmp_path / "out").problems
    assert [problem.split(": ")[1] for problem in problems] == [
        "row t0/0000/verification",
        "row t1/0000/verification",
    ]
    assert all(
        "holds another picture of that name; set AGENTHIJACK_ASSETS" in problem
        for problem in problems
    )
    fresh(tmp_path / "none")
    assert len(verify(tmp_path / "out").problems) == 4
    assert "no asset pack there" in verify(tmp_path / "out").notes[0]


def test_builds_of_pictures_alone_need_no_pack(
    recording: Any, small: Any, fresh: Any, tmp_path: Path
) -> None:
    fresh(tmp_path / "none")
    build(recording(), tmp_path / "out", corruptions=small)
    assert (
        json.loads((tmp_path / "out" / "manifest.json").read_text())["parameters"]["assets"] is None
    )
    assert verify(tmp_path / "out").notes == []
    card = (tmp_path / "out" / "README.md").read_text()
    assert "`fidelity` is `exact`" in card
    assert "composited" not in card.partition("## Columns")[0]


def test_the_pack_of_the_environment_is_used_by_workers(
    browsing: Path, assets: Path, fresh: Any, tmp_path: Path
) -> None:
    fresh(assets)
    options = {"corruptions": "verification", "rows_per_shard": 10}
    build(browsing, tmp_path / "two", **options, workers=2)  # type: ignore[arg-type]
    build(browsing, tmp_path / "one", **options)  # type: ignore[arg-type]
    assert shard_hashes(tmp_path / "one") == shard_hashes(tmp_path / "two")


def test_a_recording_may_name_the_key_of_its_draws(
    browsing: Path, assets: Path, tmp_path: Path, small: Any
) -> None:
    """Two runs of one task get the same plans, and lazy rows still hold a recipe."""
    planners = (("marks", small["marks"]), ("touch", hj.AccidentalTouch(step=0)))
    values = []
    items = list(get_reader("jsonl").read(browsing))
    for name, sample in (("run-a", "task"), ("run-b", "task"), ("task", None), ("other", None)):
        trajectory = replace(items[0], id=name, sample=sample)  # type: ignore[type-var]
        step = trajectory.steps[0]  # type: ignore[union-attr]
        settings = RowSettings(planners, lazy=True, clean=False, assets=str(assets))
        rows = make_rows(
            trajectory, step, Path(step.image).read_bytes(), "x", settings, RowCounts()
        )  # type: ignore[arg-type]
        values.append(list(rows))
    digests = [[row["plan_digest"] for row in rows] for rows in values]
    assert digests[0] == digests[1] == digests[2] != digests[3]
    recipe = json.loads(values[0][0]["plan"])
    assert recipe == {
        "corruption": "marks-v1",
        "format": "agenthijack-recipe",
        "sample": "task",
        "version": 1,
    }
    assert render({**values[0][0]})["plan"] == render({**values[2][0]})["plan"]
