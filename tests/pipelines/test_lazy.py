"""A lazy dataset is, after decoding, the materialised one."""

import hashlib
import io
import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import hijack_data as hj
from hijack_data.cli import hijack
from hijack_data.labels.dataset_rows import params_json
from pipelines import build, open_dataset, render, verify
from pipelines.dataset.columns import BASE
from pipelines.dataset.lazy_rows import row_plan, stored_plan
from pipelines.errors import DatasetError

from support.rows import assert_same_rows, load
from support.tampering import renew

PLANNERS: dict[str, Any] = {
    "marks": hj.Marks(number=4, mark_size=8),
    "half": hj.Resolution(),
    "words": hj.Subtitle(subtitle_text="hello", font_size=12, padding=5),
    "free": hj.PopUps(width=150, height=90),  # depends on the elements
    "both": hj.Sequence([hj.Marks(number=3, mark_size=6), hj.Resolution()]),
    "mix": hj.OneOf([hj.Marks(number=2, mark_size=9), hj.Resolution(scale=2.0)], p_clean=0.2),
}


def pair(source: Path, folder: Path, **options: Any) -> tuple[Path, Path]:
    """Build both kinds of one source."""
    for output in ("materialised", "lazy"):
        build(
            source,
            folder / output,
            output=output,
            **{"corruptions": PLANNERS, "seed": 11, **options},
        )
    return folder / "materialised", folder / "lazy"


@pytest.mark.parametrize("label_policy", ["keep", "avoid", "drop", "recover"])
@pytest.mark.parametrize("clean", [True, False])
def test_both_kinds_are_equal_row_by_row(
    label_policy: str, clean: bool, recording: Any, tmp_path: Path
) -> None:
    whole_folder, lazy = pair(recording(steps=4), tmp_path, label_policy=label_policy, clean=clean)
    count = assert_same_rows(open_dataset(whole_folder), open_dataset(lazy))
    assert count == len(open_dataset(lazy)) > 30
    assert [verify(folder).problems for folder in (whole_folder, lazy)] == [[], []]
    assert verify(lazy).regenerated == count - 8 * clean


def test_rows_by_number_are_those_in_order(recording: Any, tmp_path: Path) -> None:
    for folder in pair(recording(trajectories=5, steps=3), tmp_path, rows_per_shard=30):
        rows = open_dataset(folder)
        assert len(list((folder / "data").iterdir())) > 2
        assert assert_same_rows([rows[i] for i in range(len(rows))], rows) == len(rows)
        assert rows[-1]["id"] == rows[len(rows) - 1]["id"]
        for index in (len(rows), -len(rows) - 1):
            with pytest.raises(IndexError, match=str(index)):
                rows[index]


def test_the_real_recordings(shared_data: Path, tmp_path: Path) -> None:
    source = shared_data / "trajectories" / "agentnet_raw"
    whole_folder, lazy = pair(source, tmp_path, corruptions="pop_ups,resolution,marks,subtitle")
    assert assert_same_rows(open_dataset(whole_folder), open_dataset(lazy)) == 75
    sizes = [
        sum(file.stat().st_size for file in (folder / "data").iterdir())
        for folder in (whole_folder, lazy)
    ]
    assert sizes[1] < sizes[0] / 3


def test_each_picture_is_stored_once(
    recording: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "pipelines.building.parquet_writer.GROUP_ROWS", 3
    )  # a group must not end inside a step
    _, lazy = pair(recording(), tmp_path)
    (file,) = (lazy / "data").iterdir()
    parquet_file = pq.ParquetFile(file, read_dictionary=[f"{BASE}.bytes"])
    assert parquet_file.num_row_groups == 6
    pictures: list[bytes] = []
    for group in range(parquet_file.num_row_groups):
        column = parquet_file.read_row_group(group).column(BASE).combine_chunks().field("bytes")
        pictures += column.dictionary.to_pylist()
    assert len(pictures) == len(set(pictures)) == 6


@pytest.mark.parametrize("group_bytes", [1, 2**30])
def test_groups_close_at_both_limits(
    group_bytes: int, recording: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.setattr("pipelines.building.parquet_writer.GROUP_BYTES", group_bytes)
    _, lazy = pair(recording(), tmp_path)
    (file,) = (lazy / "data").iterdir()
    assert pq.ParquetFile(file).num_row_groups == (6 if group_bytes == 1 else 2)


def stored(lazy: Path) -> list[dict[str, Any]]:
    return [
        row for file in sorted((lazy / "data").iterdir()) for row in pq.read_table(file).to_pylist()
    ]


def test_plans_are_stored_only_where_they_do_not_follow(recording: Any, tmp_path: Path) -> None:
    _, lazy = pair(recording(), tmp_path)
    kinds = {(row["corruption"], json.loads(row["plan"])["format"]) for row in stored(lazy)}
    recipe, plan = "agenthijack-recipe", "agenthijack-plan"
    assert kinds == {
        ("clean", recipe),
        ("marks", recipe),
        ("half", recipe),
        ("words", recipe),
        ("mix", recipe),
        ("free", plan),
        ("both", plan),
    }


def test_a_row_that_can_be_derived_costs_64_bytes(recording: Any, tmp_path: Path) -> None:
    """What `plan` and `seed` take in the file, page headers included."""
    planners = {name: PLANNERS[name] for name in ("marks", "half", "words")}
    _, lazy = pair(recording(steps=12), tmp_path, corruptions=planners)
    (file,) = (lazy / "data").iterdir()
    meta = pq.ParquetFile(file).metadata
    columns = [
        meta.row_group(g).column(c)
        for g in range(meta.num_row_groups)
        for c in range(meta.num_columns)
    ]
    cost = sum(c.total_compressed_size for c in columns if c.path_in_schema in ("plan", "seed"))
    assert cost / meta.num_rows <= 64


def test_load_dataset_and_one_line(
    recording: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole_folder, lazy = pair(recording(), tmp_path)
    raw = load(lazy, tmp_path / "cache", monkeypatch)
    assert type(raw.features[BASE]).__name__ == "Image"
    assert "screenshot" not in raw.features  # a clean picture must not pass for a corrupted one
    ready = raw.with_transform(render)
    assert assert_same_rows(
        open_dataset(whole_folder), [ready[i] for i in range(len(ready))]
    ) == len(ready)
    batch = ready[3:9]
    assert [picture.tobytes() for picture in batch["screenshot"]] == [
        row["screenshot"].tobytes() for row in list(open_dataset(whole_folder))[3:9]
    ]
    assert ready["corruption"][:3] == ["clean", "marks", "half"]
    # the line does no harm
    same = load(whole_folder, tmp_path / "cache", monkeypatch).with_transform(render)
    assert same[4]["screenshot"].tobytes() == ready[4]["screenshot"].tobytes()
    with pytest.raises(DatasetError, match=r"needs the column\(s\).*plan"):
        raw.select_columns([BASE, "id"]).with_transform(render)[0]


def test_streaming(recording: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    whole_folder, lazy = pair(recording(), tmp_path)
    stream = datasets.load_dataset(str(lazy), split="train", streaming=True).map(
        render, remove_columns=[BASE]
    )
    for first_row, right in zip(open_dataset(whole_folder), stream, strict=True):
        assert first_row["screenshot"].tobytes() == right["screenshot"].tobytes()
        assert first_row["plan"] == right["plan"]


def test_an_empty_batch_and_single_rows(recording: Any, tmp_path: Path) -> None:
    _, lazy = pair(recording(), tmp_path)
    rows = stored(lazy)
    names = list(rows[0])
    assert render({name: [] for name in names}) == {name: [] for name in names}
    decoded = Image.open(io.BytesIO(rows[1][BASE]["bytes"]))  # cast to Image() it comes decoded
    for item in (render(rows[1]), render({**rows[1], BASE: decoded})):
        assert hashlib.sha256(item["screenshot"].tobytes()).hexdigest() == rows[1]["image_sha256"]


def edit(lazy: Path, change: Any) -> None:
    """Change the rows of the file, and put its new hash into the manifest."""
    (file,) = (lazy / "data").iterdir()
    table = pq.read_table(file)
    rows = table.to_pylist()
    change(rows)
    pq.write_table(pa.Table.from_pylist(rows, schema=table.schema), file)
    renew(lazy)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda rows: rows[1].update(seed=12), "another plan here"),
        (
            lambda rows: rows[1].update(
                params=rows[1]["params"].replace('"number":4', '"number":5')
            ),
            "another plan",
        ),
        (lambda rows: rows[1].update(params="{"), "cannot be made from its recipe"),
        (lambda rows: rows[1].update(params='{"numbr":1}'), "cannot be made from its recipe"),
        (
            lambda rows: rows[1].update(plan=rows[1]["plan"].replace("-v1", "-v9")),
            "at version 1 here, not 9",
        ),
        (
            lambda rows: rows[1].update(plan=rows[1]["plan"].replace('"version":1', '"version":2')),
            "upgrade",
        ),
        (lambda rows: rows[1].update(plan=""), "not JSON"),
        (
            lambda rows: rows[1].update(plan=rows[0]["plan"], plan_digest=rows[0]["plan_digest"]),
            "do not make",
        ),
        (lambda rows: rows[0].update({BASE: rows[9][BASE]}), "do not make the picture"),
        (lambda rows: rows[1].update({BASE: rows[9][BASE]}), "do not make the picture"),
        (lambda rows: rows[1].update({BASE: {"bytes": b"rubbish", "path": None}}), "not a PNG"),
        (lambda rows: rows[1].update({BASE: {"bytes": None, "path": None}}), "empty"),
        (lambda rows: rows[1].update(image_sha256="0" * 64), "do not make the picture"),
        (lambda rows: rows[1].update(width=5), "the row says otherwise"),
        (lambda rows: rows[4].update(params="{}"), "params are not those"),
    ],
)
def test_verify_finds_what_was_changed(
    change: Any, reason: str, recording: Any, tmp_path: Path
) -> None:
    _, lazy = pair(recording(), tmp_path)
    edit(lazy, change)
    (problem,) = verify(lazy).problems
    assert "row t0/0000/" in problem
    assert reason in problem


def test_verify_finds_a_row_that_was_moved_to_another_step(recording: Any, tmp_path: Path) -> None:
    _, lazy = pair(recording(), tmp_path)
    edit(lazy, lambda rows: rows[1].update(step=5))
    problems = verify(lazy).problems
    assert any(
        "row t0/0000/marks: its recipe gives another plan here" in problem for problem in problems
    )
    assert any("row t0/0000/marks: is missing" in problem for problem in problems)


def test_reading_a_stale_row_is_an_error(recording: Any, tmp_path: Path) -> None:
    _, lazy = pair(recording(), tmp_path)
    edit(lazy, lambda rows: rows[1].update(seed=12))
    with pytest.raises(DatasetError, match=r"row t0/0000/marks.*manifest.json names"):
        list(open_dataset(lazy))
    with pytest.raises(DatasetError, match="t0/0000/marks"):
        open_dataset(lazy)[1]


def test_a_resumed_lazy_build_ends_in_the_same_bytes(recording: Any, tmp_path: Path) -> None:
    source = recording(trajectories=4)
    options: dict[str, Any] = {"corruptions": PLANNERS, "output": "lazy", "rows_per_shard": 21}
    build(source, tmp_path / "out", **options)
    before = {file.name: file.read_bytes() for file in (tmp_path / "out" / "data").iterdir()}
    (tmp_path / "out" / "data" / "train-00001.parquet").unlink()
    report = build(source, tmp_path / "out", **options, resume=True)
    assert (report.kept, report.shards) == (3, 4)
    build(source, tmp_path / "two", **options, workers=2)
    for folder in ("out", "two"):
        assert {
            file.name: file.read_bytes() for file in (tmp_path / folder / "data").iterdir()
        } == before
    with pytest.raises(hj.HijackError, match="output was lazy, is materialised"):
        build(source, tmp_path / "out", **{**options, "output": None}, resume=True)


def test_the_configuration_and_the_card_of_a_lazy_build(recording: Any, tmp_path: Path) -> None:
    config = {"corruptions": [{"marks": {"number": 4}}], "output": "lazy"}
    build(recording(), tmp_path / "out", config=config)
    build(tmp_path / "source", tmp_path / "again", config=tmp_path / "out" / "config.yaml")
    names = [
        pq.read_schema(tmp_path / name / "data" / "train-00000.parquet").names
        for name in ("out", "again")
    ]
    assert names[0] == names[1]
    assert BASE in names[0]
    card = (tmp_path / "out" / "README.md").read_text()
    assert "with_transform(render)" in card
    assert f"| `{BASE}` | image file |" in card


@given(
    st.sampled_from(
        [
            hj.Marks(number=7),
            hj.Marks.at(5, mark_size=3),
            hj.Resolution(scale=0.7),
            hj.Subtitle.at(1),
        ]
    ),
    st.integers(0, 2**64 - 1),
    st.text(min_size=1, max_size=8),
    st.integers(0, 2**31 - 1),
)
def test_recipes_give_back_the_plan(
    spec: hj.plugin.Corruption, seed: int, sample: str, step: int
) -> None:
    plan = spec.plan(hj.Scene((600, 800)), seed=seed, sample=sample, step=step)
    row = {
        "id": "x",
        "params": params_json(plan),
        "seed": seed,
        "trajectory_id": sample,
        "step": step,
        "plan": plan.to_json(),
    }
    recipe = stored_plan(plan, row)
    assert len(recipe) < 80
    assert row_plan({**row, "plan": recipe, "plan_digest": plan.digest()}, plan.size) == plan
    second = stored_plan(plan, {**row, "seed": seed ^ 1})
    assert hj.Plan.from_json(second) == plan if second != recipe else not hasattr(spec, "number")


def test_the_command(recording: Any, config: Path, tmp_path: Path) -> None:
    for options, lazy in ((["--lazy"], True), (["--materialised"], False), ([], True)):
        out = tmp_path / "-".join(["out", *options])
        run = CliRunner().invoke(
            hijack,
            [
                "build",
                str(recording(out.name[3:] or "s")),
                "--out",
                str(out),
                *options,
                "--config",
                str(config),
            ],
        )
        assert run.exit_code == 0, run.output
        assert (BASE in pq.read_schema(out / "data" / "train-00000.parquet").names) is lazy


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A configuration that asks for a lazy dataset; the command line wins over it."""
    (tmp_path / "c.yaml").write_text("corruptions:\n  - marks: {number: 4}\noutput: lazy\n")
    return tmp_path / "c.yaml"
