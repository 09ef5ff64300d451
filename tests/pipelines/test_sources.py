"""Sources as people have them: mixed folders, several at once, caches of the Hub, and what must not
be opened."""

import gzip
import json
import os
import re
import shutil
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.file_io import write_atomic
from hijack_data.picture_io import encode_png
from pipelines import build, open_dataset, verify
from pipelines.errors import BuildError, SourceError
from pipelines.readers import Rejected, survey
from pipelines.sources import Sources, public_name

from support.dataset_files import shard_hashes
from support.formats import FORMATS
from support.recordings import separate_rejected

HALF = {"half": hj.Resolution(scale=0.5)}


def read(*paths: Path) -> tuple[list[Any], list[Rejected]]:
    return separate_rejected(read.item for read in Sources.open(list(paths)).read())


@pytest.fixture
def mixed(tmp_path: Path) -> Path:
    """Every format in a folder of its own, below one folder."""
    folder = tmp_path / "mixed"
    for name, make in FORMATS.items():
        (folder / name).mkdir(parents=True)
        make(folder / name)
    return folder


@pytest.mark.parametrize("name", ["trajectories.jsonl.gz", "steps.ndjson", "labels.tsv", "all.tgz"])
def test_pictures_are_not_read_alone_beside_records_that_are_not_read(
    tmp_path: Path, name: str
) -> None:
    write_atomic(tmp_path / "a.png", encode_png(np.zeros((9, 16, 3), np.uint8)))
    (tmp_path / name).write_bytes(b"\x1f\x8b")
    with pytest.raises(SourceError, match=rf"{name} is of none.*or take the pictures alone"):
        survey(tmp_path)
    assert list(survey(tmp_path, "images").parts) == ["images"]


def test_a_mixed_folder_is_read_by_all_its_readers(mixed: Path, tmp_path: Path) -> None:
    trajectories, rejected = read(mixed)
    assert rejected == []
    assert sorted(t.source for t in trajectories) == sorted(FORMATS)
    assert all(len(t.steps) == 2 for t in trajectories)
    assert Sources.open(mixed).unread == []
    report = build(mixed, tmp_path / "out", corruptions=HALF)
    assert dict(report.rows) == {"clean": 2 * len(FORMATS), "half": 2 * len(FORMATS)}
    assert (report.rejected, report.notes) == (0, ())
    assert verify(tmp_path / "out").ok


def test_a_mixed_folder_gives_the_same_bytes_wherever_it_lies_and_however_it_is_built(
    mixed: Path, tmp_path: Path
) -> None:
    build(mixed, tmp_path / "one", corruptions=HALF, rows_per_shard=6)
    build(mixed, tmp_path / "two", corruptions=HALF, rows_per_shard=6, workers=2)
    moved_folder = tmp_path / "elsewhere" / "other"
    moved_folder.parent.mkdir()
    mixed.rename(moved_folder)
    build(moved_folder, tmp_path / "three", corruptions=HALF, rows_per_shard=6)
    (tmp_path / "three" / "data" / "train-00001.parquet").unlink()
    report = build(
        moved_folder, tmp_path / "three", corruptions=HALF, rows_per_shard=6, resume=True
    )
    assert report.kept == report.shards - 1
    assert (
        shard_hashes(tmp_path / "one")
        == shard_hashes(tmp_path / "two")
        == shard_hashes(tmp_path / "three")
    )


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_a_format_is_read_alike_whether_it_was_found_or_named(name: str, tmp_path: Path) -> None:
    (tmp_path / "source").mkdir()
    FORMATS[name](tmp_path / "source")
    value, named = (Sources.open(tmp_path / "source", options).read() for options in (None, name))
    assert [read.item for read in value] == [read.item for read in named]


def test_record_files_that_no_reader_takes_are_named(recording: Any, tmp_path: Path) -> None:
    folder = recording()
    (folder / "notes.json").write_text('{"foo": 1}')
    (folder / "deep").mkdir()
    (folder / "deep" / "table.csv").write_text("a,b\n")
    (folder / "README.md").write_text("# hello")
    report = build(folder, tmp_path / "out", corruptions={})
    assert report.exit_code == 0
    (note,) = report.notes
    assert "notes.json, deep/table.csv (1 .json, 1 .csv)" in note


def test_a_file_that_can_be_made_readable_is_named_with_the_way(
    recording: Any, tmp_path: Path
) -> None:
    """An archive is never taken for what lies in it."""
    folder = recording()
    with tarfile.open(folder / "data.tar", "w") as archive:
        archive.add(folder / "trajectories.jsonl", "trajectories.jsonl")
    (folder / "more.jsonl.gz").write_bytes(
        gzip.compress((folder / "trajectories.jsonl").read_bytes())
    )
    (folder / "array.jsonl").write_text('[{"a": 1}]')
    report = build(folder, tmp_path / "out", corruptions={})
    assert (report.rejected, report.total) == (0, 6)
    notes = "\n".join(report.notes)
    assert "data.tar: an archive, unpack it first: tar -xf data.tar" in notes
    assert "more.jsonl.gz: an archive, unpack it first: gunzip -k more.jsonl.gz" in notes
    assert "array.jsonl: holds a JSON array, not an object a line" in notes
    for name, way in (
        ("data.tar", "tar -xf data.tar"),
        ("trajectories.json", "the plain format is trajectories.jsonl"),
    ):
        alone = tmp_path / name.replace(".", "-")
        alone.mkdir()
        if name.endswith(".tar"):
            shutil.copy(folder / name, alone)
        else:
            (alone / name).write_text("[]")
        with pytest.raises(SourceError, match=re.escape(way)):
            build(alone, tmp_path / "none", corruptions={})


def test_a_broken_file_among_its_kind_is_rejected_with_a_reason(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    FORMATS["screenagent"](source)
    record = next(source.rglob("*.json"))
    (record.parent / "zz.json").write_text('{"session_id": "half')
    trajectories, rejected = read(source)
    assert len(trajectories) == 1
    assert [Path(r.file).name for r in rejected] == ["zz.json"]
    assert "not JSON" in rejected[0].reason


def test_a_file_of_two_formats_is_an_error_that_names_them(tmp_path: Path) -> None:
    (tmp_path / "any.jsonl").write_text('{"trajectory_id": "a", "step": 0, "traj": []}')
    with pytest.raises(
        SourceError, match=r"agentnet or jsonl; say which: --format agentnet \(in Python: format="
    ):
        survey(tmp_path)


def test_an_unknown_format_is_refused_with_the_way_out(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "episode.pkl.gz").write_bytes(b"x")
    (tmp_path / "a.json").write_text('{"foo": 1}')
    (tmp_path / "b.png").write_bytes(b"x")
    with pytest.raises(SourceError) as caught:
        survey(tmp_path)
    for part in (
        "a.json is of none",
        "sub/episode.pkl.gz: a pickle",
        "docs/input_format.md",
        "--format images",
    ):
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("record", "what"),
    [
        ({"id": "1", "instruction": "a", "config": [], "evaluator": {}}, "a task of OSWorld"),
        ({"uid": "u", "image_id": "i", "pred": "x", "prompt": "p"}, "predictions for GUIAct"),
        ({"annotation_id": "a", "confirmed_task": "t", "website": "w"}, "Multimodal-Mind2Web"),
    ],
)
def test_what_is_published_beside_recordings_is_refused_by_its_name(
    record: Any, what: str, tmp_path: Path
) -> None:
    (tmp_path / "a.json").write_text(json.dumps([record]))
    with pytest.raises(SourceError, match=what) as caught:
        survey(tmp_path)
    assert str(caught.value).startswith("a.json: is ")


def test_a_trace_of_playwright_is_refused_with_its_pictures(tmp_path: Path) -> None:
    # the first line of a trace of Playwright 1.65
    head = '{"version":10,"type":"context-options","origin":"library","browserName":"chromium","options":{},"wallTime":1}'
    (tmp_path / "trace.trace").write_text(head + '\n{"type":"before","callId":"call@7"}\n')
    (tmp_path / "screencast").mkdir()
    write_atomic(tmp_path / "screencast/a.png", encode_png(np.zeros((9, 16, 3), np.uint8)))
    with pytest.raises(SourceError, match=r"a trace of Playwright.*page\.screenshot\(\)"):
        survey(tmp_path)


def test_several_sources(recording: Any, tmp_path: Path) -> None:
    result, two = recording("one"), recording("two")
    report = build([result, two], tmp_path / "out", corruptions={})
    rows = list(open_dataset(tmp_path / "out"))
    assert [row["trajectory_id"] for row in rows[::3]] == ["t0", "t1", "two/t0", "two/t1"]
    assert "2 trajectories have an id" in report.notes[0]
    assert len({row["id"] for row in rows}) == len(rows) == 12
    assert verify(tmp_path / "out").ok
    again = build([result, two], tmp_path / "out", corruptions={}, resume=True)
    assert again.kept == again.shards == 2
    with pytest.raises(SourceError, match="given twice"):
        build([result, result], tmp_path / "x")
    with pytest.raises(BuildError, match="lies in the source"):
        build([result, two], two / "out")


def test_what_is_rejected_is_named_with_its_source(
    recording: Any, add_line: Any, tmp_path: Path
) -> None:
    result, two = recording("a/same"), recording("b/same")
    add_line(two, b"rubbish")
    trajectories, (rejected,) = read(result, two)
    assert rejected.file == "b/same/trajectories.jsonl"
    assert [t.id for t in trajectories] == ["t0", "t1", "b/same/t0", "b/same/t1"]


def test_two_files_of_the_plain_format_below_each_other(recording: Any, tmp_path: Path) -> None:
    folder = recording()
    shutil.copytree(folder, tmp_path / "copy")
    shutil.move(tmp_path / "copy", folder / "more")
    trajectories, rejected = read(folder)
    assert rejected == []
    assert [t.id for t in trajectories] == ["t0", "t1", "more/t0", "more/t1"]
    assert Path(trajectories[2].steps[0].image).is_relative_to(folder / "more")


@pytest.fixture
def unreadable_folder(recording: Any, tmp_path: Path) -> Path:
    """A recording beside what must not be opened: reading any of it never ends, or leads
    outside."""
    folder = recording()
    for name in (
        "a.jsonl",
        "traj.jsonl",
        "steps.jsonl",
        "a.json",
        "a.parquet",
        "interact_messages.json",
    ):
        (folder / name).parent.mkdir(exist_ok=True)
        os.mkfifo(folder / name)
    (folder / "zero.jsonl").symlink_to("/dev/zero")
    (folder / "out.jsonl").symlink_to(tmp_path / "secret.jsonl")
    (folder / "loop.jsonl").symlink_to("loop.jsonl")
    (tmp_path / "secret.jsonl").write_text("{}")
    return folder


def test_only_regular_files_inside_the_source_are_opened(
    unreadable_folder: Path, tmp_path: Path
) -> None:
    trajectories, rejected = read(unreadable_folder)
    assert len(trajectories) == 2
    reasons = {r.file: r.reason for r in rejected}
    assert len(reasons) == len(rejected) == 9
    assert "leaves the source" in reasons["zero.jsonl"]
    assert "leaves the source" in reasons["out.jsonl"]
    assert "cannot be opened" in reasons["loop.jsonl"]
    assert sum("not a regular file" in reason for reason in reasons.values()) == 6
    (unreadable_folder / "trajectories.jsonl").unlink()
    with pytest.raises(SourceError, match="not a recording of a known format"):
        survey(unreadable_folder)


@pytest.fixture
def snapshot(recording: Any, tmp_path: Path) -> Path:
    """A recording as `snapshot_download()` leaves it in the cache: links into `blobs`."""
    plain = recording()
    repository = tmp_path / "hub" / "datasets--me--clicks"
    folder = repository / "snapshots" / "abc123"
    (repository / "blobs").mkdir(parents=True)
    for number, file in enumerate(sorted(f for f in plain.rglob("*") if f.is_file())):
        link = folder / file.relative_to(plain)
        link.parent.mkdir(parents=True, exist_ok=True)
        file.rename(repository / "blobs" / str(number))
        link.symlink_to(os.path.relpath(repository / "blobs" / str(number), link.parent))
    return folder


def test_links_of_a_snapshot_are_followed_into_its_own_blobs(
    snapshot: Path, tmp_path: Path
) -> None:
    for source in (snapshot, snapshot.parents[1], snapshot / "trajectories.jsonl"):
        trajectories, rejected = read(source)
        assert (len(trajectories), rejected) == (2, [])
    assert build(snapshot, tmp_path / "out", corruptions={}).total == 6


def test_links_of_a_snapshot_to_anywhere_else_are_refused(snapshot: Path, tmp_path: Path) -> None:
    second = snapshot.parents[2] / "datasets--me--other" / "blobs"
    second.mkdir(parents=True)
    picture = snapshot / "images" / "t0-0.png"
    shutil.copy(picture, second / "0")
    picture.unlink()
    picture.symlink_to(second / "0")
    trajectories, (rejected,) = read(snapshot)
    assert "leaves the source" in rejected.reason
    assert [len(t.steps) for t in trajectories] == [2, 3]


def test_blobs_beside_a_folder_that_is_no_cache_are_not_followed(snapshot: Path) -> None:
    repository = snapshot.parents[1]
    plain = repository.rename(repository.with_name("my_clicks"))
    with pytest.raises(SourceError, match="leaves the source"):
        survey(plain / "snapshots" / "abc123")


def test_names_that_are_not_utf8(
    recording: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    folder = recording()
    odd = os.fsencode(folder) + b"/\xff\xfe"
    try:
        Path(os.fsdecode(odd + b".json")).write_text("{}")
        os.mkdir(odd)
        Path(os.fsdecode(odd + b"/b.json")).write_text("{}")
    except OSError:
        pytest.skip("this file system takes UTF-8 only")
    report = build(folder, tmp_path / "out", corruptions={})
    assert (report.total, report.rejected) == (6, 2)
    assert all("not UTF-8" in example for example in report.examples)
    assert (
        json.loads((tmp_path / "out" / "quarantine.jsonl").read_text().splitlines()[0])["file"]
        == "\\xff\\xfe"
    )
    named = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xfe"))
    with pytest.raises(BuildError, match="not UTF-8"):
        build(folder, named)
    folder.rename(named)
    with pytest.raises(SourceError, match="not UTF-8"):
        build(named, tmp_path / "other")


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("data/a", "data/a"),
        ("/home/me/data", "data"),
        ("../data", "data"),
        ("a/../b", "b"),
        ("a/", "a"),
    ],
)
def test_a_dataset_names_its_source_without_the_machine(given: str, expected: str) -> None:
    assert public_name(given) == expected


def test_no_absolute_path_is_published(recording: Any, add_line: Any, tmp_path: Path) -> None:
    folder = recording("secret_place")
    add_line(folder, b"rubbish")
    build(folder, tmp_path / "out", corruptions=HALF)
    for name in ("manifest.json", "quarantine.jsonl", "config.yaml"):
        assert str(tmp_path) not in (tmp_path / "out" / name).read_text()
    assert f"hijack build {folder}" not in (tmp_path / "out" / "README.md").read_text()
    assert json.loads((tmp_path / "out" / "manifest.json").read_text())["source"]["paths"] == [
        "secret_place"
    ]


def test_the_real_folders_are_read_whole(shared_data: Path) -> None:
    trajectories, rejected = read(shared_data / "trajectories")
    assert rejected == []
    steps = {
        name: sum(len(t.steps) for t in trajectories if t.source == name)
        for name in {t.source for t in trajectories}
    }
    assert steps == {"agentnet": 46, "screenagent": 119, "webvoyager": 9}


def test_a_dataset_that_was_built_is_no_source(recording: Any, tmp_path: Path) -> None:
    out = tmp_path / "built"
    source = recording(trajectories=1, steps=1)
    build(source, out, corruptions=HALF, seed=1)
    for sources in ([out], [source, out]):
        with pytest.raises(SourceError, match="built: is a dataset that hijack build wrote"):
            build(sources, tmp_path / "again", corruptions=HALF, seed=1)
    assert not (tmp_path / "again").exists()


@pytest.mark.parametrize("state", ["newer", "cut off", "unfinished"])
def test_a_dataset_that_cannot_be_read_is_no_source(
    recording: Any, tmp_path: Path, state: str
) -> None:
    out = tmp_path / "built"
    build(recording(trajectories=1, steps=1), out, corruptions=HALF, seed=1)
    manifest = out / "manifest.json"
    text = manifest.read_text()
    if state == "newer":
        manifest.write_text(text.replace('"version": 1', '"version": 9', 1))
    if state == "cut off":
        manifest.write_text(text[: len(text) // 2])
    if state == "unfinished":
        manifest.unlink()
        (out / ".build").mkdir()
        (out / ".build" / "parameters.json").write_text("{}")
    with pytest.raises(SourceError, match="built: is a dataset that hijack build wrote"):
        build(out, tmp_path / "again", corruptions=HALF, seed=1)


def test_a_manifest_of_another_program_is_no_dataset_of_ours(
    recording: Any, tmp_path: Path
) -> None:
    source = recording(trajectories=1, steps=1)
    (source / "manifest.json").write_text('{"format": "of another program"}')
    assert build(source, tmp_path / "other", corruptions=HALF, seed=1).rows == {
        "clean": 1,
        "half": 1,
    }
