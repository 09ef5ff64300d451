"""What a build is asked for beside its corruptions: splits, a limit, a trial, another dataset's
place."""

import json
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
from hijack_data.types import Trajectory
from pipelines import build, open_dataset, verify
from pipelines.building.replacement import replacement_folder
from pipelines.building.splits import Splits, choose_splits
from pipelines.errors import BuildError, SourceError

from support.dataset_files import file_contents
from support.formats import png, write_json, write_lines, write_table

RECORDINGS = Path(__file__).resolve().parents[2] / "examples" / "recordings"
HALF = {"half": hj.Resolution(scale=0.5)}


def test_a_split_holds_whole_trajectories_whatever_the_order_and_the_workers(
    recording: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=12, steps=1)
    options: dict[str, Any] = {
        "corruptions": HALF,
        "splits": "train=0.5,test=0.5",
        "rows_per_shard": 4,
    }
    report = build(folder, tmp_path / "one", **options)
    build(folder, tmp_path / "two", **options, workers=2)
    assert file_contents(tmp_path / "one" / "data") == file_contents(tmp_path / "two" / "data")
    lines = (folder / "trajectories.jsonl").read_text().splitlines()
    (folder / "trajectories.jsonl").write_text("\n".join(reversed(lines)))
    build(folder, tmp_path / "three", **options, seed=9)
    first, third = (split_of(tmp_path / name) for name in ("one", "three"))
    assert first == third
    assert set(Counter(first.values())) == {"train", "test"}
    assert (len(first), report.total) == (12, 24)
    assert verify(tmp_path / "one").ok
    files = sorted(path.name for path in (tmp_path / "one" / "data").iterdir())
    trains = [name for name in files if name.startswith("train")]
    assert trains == [f"train-{n:05d}.parquet" for n in range(len(trains))]
    assert (
        f"| `test` | 0.5 | {Counter(first.values())['test']} |"
        in (tmp_path / "one" / "README.md").read_text()
    )


def split_of(out: Path) -> dict[str, str]:
    """The split of each trajectory; fails where one is in two."""
    pq = pytest.importorskip("pyarrow.parquet")
    entries: dict[str, str] = {}
    for file in (out / "data").iterdir():
        for name in pq.read_table(file, columns=["trajectory_id"])["trajectory_id"].to_pylist():
            assert (
                entries.setdefault(name, file.name.partition("-")[0]) == file.name.partition("-")[0]
            )
    return entries


def test_load_dataset_finds_the_splits(
    recording: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    datasets = pytest.importorskip("datasets")
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    shares = {"train": 0.4, "validation": 0.3, "test": 0.3}
    build(recording(trajectories=12, steps=1), tmp_path / "out", corruptions=HALF, splits=shares)
    dataset_rows = datasets.load_dataset(str(tmp_path / "out"), cache_dir=str(tmp_path / "cache"))
    assert {name: len(part) for name, part in dataset_rows.items()} == {
        name: 2 * count for name, count in Counter(split_of(tmp_path / "out").values()).items()
    }
    assert set(dataset_rows) == set(shares)


def test_splits_in_a_configuration_make_the_same_dataset_again(
    recording: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=6, steps=1)
    build(folder, tmp_path / "one", corruptions=HALF, splits={"train": 0.5, "test": 0.5})
    build(folder, tmp_path / "two", config=tmp_path / "one" / "config.yaml")
    assert file_contents(tmp_path / "one" / "data") == file_contents(tmp_path / "two" / "data")
    with pytest.raises(BuildError, match="splits was"):
        build(folder, tmp_path / "one", corruptions=HALF, resume=True)


def test_shares_are_kept_and_the_order_of_their_names_means_nothing() -> None:
    splits = choose_splits("test=0.2,train=0.8")
    second = Splits({"train": 0.8, "test": 0.2})
    ids = [Trajectory(f"t{n}", "jsonl", "", ()) for n in range(2000)]
    assert [splits.of(name) for name in ids] == [second.of(name) for name in ids]
    assert 0.17 < sum(splits.of(name) == "test" for name in ids) / len(ids) < 0.23


def steps_in_rows(folder: Path, **fields: Callable[[int], Any]) -> Path:
    """Chat rows of 24 steps, each a trajectory of its own, as OS-Atlas publishes them."""
    folder.mkdir()
    (folder / "0.png").write_bytes(png())
    rows = [
        {
            "id": number,
            "messages": [
                {"role": "user", "content": "<image>go"},
                {"role": "assistant", "content": "pyautogui.click(5, 5)"},
            ],
            "images": ["0.png"],
            **{name: value(number) for name, value in fields.items()},
        }
        for number in range(24)
    ]
    write_lines(folder / "a.jsonl", rows)
    return folder


def test_rows_of_one_episode_are_in_one_split(tmp_path: Path) -> None:
    """Of chat rows nobody knows the episode, unless a field names it."""
    shares: dict[str, Any] = {"corruptions": HALF, "splits": {"train": 0.5, "test": 0.5}}
    unknown = steps_in_rows(tmp_path / "unknown")
    with pytest.raises(BuildError, match=r"chat row '0' may be one step.*--episode-key FIELD"):
        build(unknown, tmp_path / "none", **shares)
    assert not (tmp_path / "none").exists()
    assert build(unknown, tmp_path / "one", corruptions=HALF).rows["clean"] == 24
    named = {
        "stated": steps_in_rows(tmp_path / "stated", episode_id=lambda number: number // 3),
        "chosen": steps_in_rows(tmp_path / "chosen", trace=lambda number: f"e{number // 3}"),
    }
    for name, options in (("stated", {}), ("chosen", {"episode_key": "trace"})):
        out = tmp_path / f"out-{name}"
        build(named[name], out, **shares, **options)
        result = split_of(out)
        assert set(result.values()) == {"train", "test"}
        for number in range(24):
            assert result[str(number)] == result[str(3 * (number // 3))], number
        assert verify(out, source=named[name]).ok
        card = (out / "README.md").read_text()
        key = "`trace`" if options else "`trajectory_id` or `episode_id`"
        assert f"An episode is, by format: chat: the rows with the same {key}." in card
    report = build(named["stated"], tmp_path / "lost", corruptions=HALF, episode_key="trace")
    assert report.rejected == 24
    with pytest.raises(BuildError, match="says itself what its episodes are"):
        build(RECORDINGS, tmp_path / "plain", corruptions=HALF, episode_key="trace")


def test_boxes_on_one_picture_are_in_one_split(tmp_path: Path) -> None:
    """Of a table in JSON and of one in Parquet, where each row holds its own copy."""
    from PIL import Image

    json_folder, table = tmp_path / "json", tmp_path / "parquet"
    json_folder.mkdir()
    rows = []
    for number in range(24):
        picture = json_folder / f"{number // 3}.png"
        Image.new("RGB", (40, 40), (number // 3 * 9, 0, 0)).save(picture)
        box = [number, number, number + 5, number + 5]
        rows.append({"img_filename": picture.name, "bbox": box, "instruction": f"press {number}"})
    write_json(json_folder / "a.json", rows)
    copies = [
        {
            "image": {"bytes": (json_folder / row["img_filename"]).read_bytes(), "path": None},
            "bbox": row["bbox"],
            "instruction": row["instruction"],
        }
        for row in rows
    ]
    write_table(table / "a.parquet", copies)
    for source in (json_folder, table):
        out = tmp_path / f"out-{source.name}"
        options: dict[str, Any] = {"coordinates": "pixels", "boxes": "xyxy"}
        build(source, out, corruptions={}, splits={"train": 0.5, "test": 0.5}, **options)
        result = split_of(out)
        assert set(result.values()) == {"train", "test"}
        for number in range(24):
            assert result[f"a/{number:06d}"] == result[f"a/{3 * (number // 3):06d}"], number
        assert "the rows of one picture" in (out / "README.md").read_text()


def test_only_the_first_trajectories(recording: Any, add_line: Any, tmp_path: Path) -> None:
    folder = recording(trajectories=4)
    calls: list[tuple[int, int, str]] = []
    report = build(
        folder, tmp_path / "out", corruptions={}, limit=2, progress=lambda *call: calls.append(call)
    )
    assert (report.total, calls[-1]) == (6, (6, 6, "steps"))
    assert "first 2 trajectories" in (tmp_path / "out" / "README.md").read_text()
    with pytest.raises(BuildError, match="limit was 2, is None"):
        build(folder, tmp_path / "out", corruptions={}, resume=True)


def test_a_trial_counts_as_the_build_does_and_writes_nothing(
    recording: Any, add_line: Any, browsing: Path, assets: Path, nine: Any, tmp_path: Path
) -> None:
    add_line(browsing, b"rubbish")
    image = browsing / "images" / "t1-1.png"
    image.write_bytes(image.read_bytes()[:-1000])
    options: dict[str, Any] = {"corruptions": nine, "assets": assets, "label_policy": "drop"}
    dry_report = build(browsing, tmp_path / "out", **options, dry_run=True)
    assert not (tmp_path / "out").exists()
    value = build(browsing, tmp_path / "out", **options)
    for field in ("rows", "rejected", "not_applicable", "dropped", "examples"):
        assert getattr(dry_report, field) == getattr(value, field), field
    assert value.rejected == 2
    assert "nothing was written" in dry_report.lines()[0]
    with pytest.raises(SourceError):
        build(browsing, tmp_path / "x", **options, dry_run=True, strict=True)


def test_overwriting_replaces_a_dataset_once_the_new_one_is_whole(
    recording: Any, tmp_path: Path
) -> None:
    folder, out = recording(trajectories=3), tmp_path / "out"
    build(folder, out, corruptions=HALF, rows_per_shard=1)
    old = file_contents(out)
    with pytest.raises(BuildError, match=r"holds a dataset; .*--overwrite \(in Python"):
        build(folder, out, corruptions={})

    def fail(*_: Any) -> None:
        assert file_contents(out) == old
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build(folder, out, corruptions={}, overwrite=True, progress=fail)
    assert file_contents(out) == old
    build(folder, out, corruptions={}, overwrite=True)
    build(folder, tmp_path / "fresh", corruptions={}, overwrite=True)
    data, fresh = file_contents(out), file_contents(tmp_path / "fresh")
    assert {k: v for k, v in data.items() if k != "README.md"} == {
        k: v for k, v in fresh.items() if k != "README.md"
    }
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fresh", "out", "source"]


def test_a_new_dataset_that_was_killed_halfway_is_begun_anew(
    recording: Any, tmp_path: Path
) -> None:
    folder, out = recording(), tmp_path / "out"
    build(folder, out, corruptions=HALF)
    shutil.copytree(out, tmp_path / ".out.new")
    build(folder, out, corruptions={}, overwrite=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "source"]
    assert open_dataset(out)[0]["corruption"] == "clean"


@pytest.mark.parametrize("name", ["notes.txt", "data/mine.parquet"])
def test_overwriting_spares_what_is_not_ours(name: str, recording: Any, tmp_path: Path) -> None:
    folder, out = recording(), tmp_path / "out"
    build(folder, out, corruptions={})
    (out / name).write_text("mine")
    with pytest.raises(BuildError, match=f"no part of the dataset.*{name}"):
        build(folder, out, corruptions={}, overwrite=True)
    assert (out / name).read_text() == "mine"


def test_overwriting_wants_a_dataset_of_ours(recording: Any, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("x")
    with pytest.raises(BuildError, match="not a dataset of ours"):
        build(recording(), tmp_path / "out", overwrite=True)
    assert (tmp_path / "out" / "thesis.tex").exists()


def test_the_old_dataset_stays_where_renaming_fails(
    recording: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    build(recording(), out, corruptions={})
    old = file_contents(out)
    rename = Path.rename

    def refuse(self: Path, target: Path) -> Path:
        if self.name == ".out.new":
            raise OSError(5, "Input/output error")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", refuse)
    with (
        pytest.raises(BuildError, match="cannot be replaced"),
        replacement_folder(out, True) as fresh,
    ):
        fresh.mkdir()
    assert file_contents(out) == old


def test_a_failed_attempt_is_not_in_the_way_of_the_next(
    recording: Any, add_line: Any, tmp_path: Path
) -> None:
    folder, out = recording(), tmp_path / "out"
    add_line(folder, b"rubbish")
    with pytest.raises(SourceError):
        build(folder, out, corruptions={}, strict=True)
    assert not out.exists()
    out.mkdir()
    with pytest.raises(SourceError):
        build(folder, out, corruptions={}, strict=True)
    assert list(out.iterdir()) == []
    (folder / "images").rename(folder / "pictures")
    assert build(folder, out, corruptions={}).total == 0
    (folder / "pictures").rename(folder / "images")
    assert build(folder, out, corruptions={}).total == 6
    assert len((out / "quarantine.jsonl").read_text().splitlines()) == 1


def test_clean_rows_alone(recording: Any, tmp_path: Path) -> None:
    report = build(recording(), tmp_path / "out", corruptions="clean")
    assert report.rows == {"clean": 6}
    assert "--corruptions clean" in (tmp_path / "out" / "README.md").read_text()
    report = build(
        tmp_path / "source",
        tmp_path / "more",
        corruptions="clean,resolution",
        config={"corruptions": ["marks"], "clean": False},
    )
    assert report.rows == {"clean": 6, "resolution": 6}


def test_parameters_in_the_line(recording: Any, tmp_path: Path) -> None:
    line = "marks:number=3,mark_size=8,as=few,resolution:severity=2"
    build(recording(), tmp_path / "out", corruptions=line)
    rows = {row["corruption"]: row for row in open_dataset(tmp_path / "out")}
    assert list(rows) == ["clean", "few", "resolution"]
    assert json.loads(rows["few"]["params"])["number"] == 3
    assert rows["resolution"]["severity"] == 2


def test_the_card_names_the_format_that_the_build_was_told(recording: Any, tmp_path: Path) -> None:
    """Without it, its command would read a folder of several formats differently."""
    build(recording(trajectories=1, steps=1), tmp_path / "out", corruptions=HALF, format="jsonl")
    assert "--format jsonl --out" in (tmp_path / "out" / "README.md").read_text()
