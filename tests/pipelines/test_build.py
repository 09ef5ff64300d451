import errno
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data.picture_io import load_image
from pipelines import build, inspect_source, open_dataset, verify
from pipelines.building.dataset_card import _size_category
from pipelines.building.step_rows import RowSettings
from pipelines.dataset.columns import COLUMNS
from pipelines.errors import BuildError
from pipelines.readers import get_reader

from support.dataset_files import shard_hashes

NAMES = """
id trajectory_id step source domain instruction screenshot width height action action_code target_box corruption
severity seed params plan plan_digest fidelity event reminder inserted target_visible changed_pixels extra
image_sha256
""".split()  # noqa: SIM905


def quarantined(out: Path) -> list[dict[str, str]]:
    return [json.loads(line) for line in (out / "quarantine.jsonl").read_text().splitlines()]


@pytest.fixture
def offline(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    return tmp_path / "cache"


def load(out: Path, cache: Path) -> Any:
    datasets = pytest.importorskip("datasets")
    datasets.disable_progress_bars()
    return datasets.load_dataset(str(out), cache_dir=str(cache))


def test_rows_have_the_columns_of_the_contract(recording: Any, small: Any, tmp_path: Path) -> None:
    report = build(recording(), tmp_path / "out", corruptions=small, seed=3)
    rows = list(open_dataset(tmp_path / "out"))
    assert report.exit_code == 0
    assert dict(report.rows) == {
        "clean": 6,
        "pop_ups": 6,
        "resolution": 6,
        "marks": 6,
        "subtitle": 6,
    }
    assert len(rows) == len(open_dataset(tmp_path / "out")) == report.total == 30
    assert list(COLUMNS) == NAMES
    assert all(list(row) == NAMES for row in rows)
    assert [row["id"] for row in rows[:3]] == [
        "t0/0000/clean",
        "t0/0000/pop_ups",
        "t0/0000/resolution",
    ]
    assert len({row["id"] for row in rows}) == 30
    clean, marks = rows[0], rows[3]
    assert (clean["source"], clean["domain"], clean["instruction"]) == ("jsonl", "tests", "do t0")
    assert clean["action"] == {
        "type": "click",
        "x": 100,
        "y": 50,
        "x2": None,
        "y2": None,
        "text": None,
        "keys": None,
        "amount": None,
    }
    assert (clean["width"], clean["height"], clean["target_box"]) == (320, 200, [90, 40, 130, 60])
    assert (
        clean["severity"],
        clean["params"],
        clean["changed_pixels"],
        clean["target_visible"],
    ) == (None, "{}", 0, 1.0)
    assert (marks["seed"], marks["fidelity"], marks["severity"]) == (3, "exact", None)
    assert json.loads(marks["params"]) == small["marks"].params()
    assert json.loads(marks["plan"])["digest"] == marks["plan_digest"]
    assert all(row["changed_pixels"] > 0 for row in rows if row["corruption"] != "clean")


def test_load_dataset_reads_it_without_our_code(
    recording: Any, small: Any, tmp_path: Path, offline: Path
) -> None:
    folder = recording()
    build(folder, tmp_path / "out", corruptions=small, seed=2**64 - 1, rows_per_shard=15)
    dataset_rows = load(tmp_path / "out", offline)
    assert list(dataset_rows) == ["train"]
    features = dataset_rows["train"].features
    assert list(features) == NAMES
    assert type(features["screenshot"]).__name__ == "Image"
    assert {name: features[name].dtype for name in ("step", "seed", "target_visible")} == {
        "step": "int32",
        "seed": "uint64",
        "target_visible": "float64",
    }
    ours = list(open_dataset(tmp_path / "out"))
    assert len(dataset_rows["train"]) == len(ours) == 30
    for loaded_row, row in zip(dataset_rows["train"], ours, strict=True):
        assert np.array_equal(
            np.asarray(loaded_row.pop("screenshot")), np.asarray(row.pop("screenshot"))
        )
        assert loaded_row == row


def test_datasets_of_one_name_do_not_share_a_cache(
    recording: Any, small: Any, tmp_path: Path, offline: Path
) -> None:
    """A cache named by the card alone would give the rows of the first for both."""
    folder = recording()
    build(folder, tmp_path / "a" / "out", corruptions=small, seed=1)
    build(folder, tmp_path / "b" / "out", corruptions={}, seed=1)
    assert len(load(tmp_path / "a" / "out", offline)["train"]) > len(
        load(tmp_path / "b" / "out", offline)["train"]
    )


def test_pictures_are_those_of_a_fresh_plan(recording: Any, small: Any, tmp_path: Path) -> None:
    folder = recording()
    build(folder, tmp_path / "out", corruptions=small, seed=5)
    steps = {(t.id, s.index): s for t in get_reader("jsonl").read(folder) for s in t.steps}  # type: ignore[union-attr]
    for row in open_dataset(tmp_path / "out"):
        step = steps[row["trajectory_id"], row["step"]]
        image, _ = load_image(step.image)
        scene = hj.Scene(image.shape[:2], step.elements, target=step.target_box)
        plan = hj.Plan.clean(scene.size)
        if row["corruption"] != "clean":
            plan = small[row["corruption"]].plan(
                scene, seed=5, sample=row["trajectory_id"], step=row["step"]
            )
        expected = hj.apply(plan, image)
        stored = np.asarray(row["screenshot"])
        assert np.array_equal(stored, expected)
        assert row["image_sha256"] == hashlib.sha256(stored.tobytes()).hexdigest()
        assert hj.Plan.from_json(row["plan"]) == plan
        safety = hj.judge(plan, image, expected, target=step.target_box)
        assert (row["target_visible"], row["changed_pixels"]) == (
            safety.target_visible,
            safety.changed_pixels,
        )


def test_actions_follow_the_resolution(
    recording: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=1, steps=1)
    action = {
        "type": "drag",
        "x": 20,
        "y": 40,
        "x2": 300,
        "y2": 180,
        "keys": ["shift"],
        "amount": 2,
    }
    code = (
        "x = 20\npyautogui.moveTo(x, 40)\npyautogui.dragTo(x=300, y=180,"
        " button='left')\npyautogui.scroll(-3)"
    )
    changes = {
        "action": action,
        "action_code": code,
        "target_box": [10, 30, 30, 50],
        "image": "images/t0-0.png",
    }
    add_line(folder, good_line("t1", 0, **changes))
    build(
        folder,
        tmp_path / "out",
        corruptions={"half": hj.Resolution(scale=0.5), "3x": hj.Resolution(scale=3)},
    )
    rows = {row["id"]: row for row in open_dataset(tmp_path / "out")}
    half, triple = rows["t1/0000/half"], rows["t1/0000/3x"]
    assert (half["width"], half["height"], half["screenshot"].size) == (160, 100, (160, 100))
    assert [half["action"][k] for k in ("x", "y", "x2", "y2")] == [10, 20, 150, 90]
    assert [triple["action"][k] for k in ("x", "y", "x2", "y2")] == [61, 121, 901, 541]
    assert (half["action"]["keys"], half["action"]["amount"]) == (["shift"], 2.0)
    assert half["target_box"] == [5, 15, 15, 25]
    expected = (
        "x = 20\npyautogui.moveTo(10, 20)\npyautogui.dragTo(x=150, y=90,"
        " button='left')\npyautogui.scroll(-3)"
    )
    assert half["action_code"] == expected
    assert rows["t1/0000/clean"]["action_code"] == code
    assert rows["t0/0000/half"]["severity"] == 3


def test_code_that_cannot_be_mapped_is_put_on_record(
    recording: Any, add_line: Any, good_line: Any, small: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=1, steps=1)
    code = "x, y = pyautogui.position()\npyautogui.click(x, y)"
    add_line(folder, good_line("t1", 0, action_code=code, image="images/t0-0.png"))
    report = build(folder, tmp_path / "out", corruptions=small)
    assert (report.rejected, report.exit_code) == (1, 1)
    assert dict(report.rows) == {
        "clean": 2,
        "pop_ups": 2,
        "resolution": 1,
        "marks": 2,
        "subtitle": 2,
    }
    assert quarantined(tmp_path / "out")[0]["where"] == "t1, step 0, resolution"
    assert quarantined(tmp_path / "out")[0]["field"] == "action_code"


def test_the_same_input_gives_the_same_bytes(recording: Any, small: Any, tmp_path: Path) -> None:
    folder = recording(trajectories=3, steps=2)
    build(folder, tmp_path / "a", corruptions=small, seed=1, rows_per_shard=10)
    build(folder, tmp_path / "b", corruptions=small, seed=1, rows_per_shard=10)
    build(folder, tmp_path / "c", corruptions=small, seed=2, rows_per_shard=10)
    first = shard_hashes(tmp_path / "a")
    assert list(first) == ["train-00000.parquet", "train-00001.parquet", "train-00002.parquet"]
    assert shard_hashes(tmp_path / "b") == first
    assert not set(shard_hashes(tmp_path / "c").values()) & set(first.values())
    assert (tmp_path / "a" / "manifest.json").read_bytes() == (
        tmp_path / "b" / "manifest.json"
    ).read_bytes()


def test_workers_change_nothing(recording: Any, small: Any, add_line: Any, tmp_path: Path) -> None:
    folder = recording(trajectories=8, steps=1)
    (folder / "images" / "t3-0.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    add_line(folder, b"rubbish")
    image = (folder / "images" / "t2-0.png").read_bytes()
    # the header is whole: a worker finds out
    (folder / "images" / "t2-0.png").write_bytes(image[:-2000])
    reports = [
        build(
            folder,
            tmp_path / f"out{n}",
            corruptions=small,
            rows_per_shard=5,
            workers=n,
            strict=False,
        )
        for n in (1, 2)
    ]
    assert shard_hashes(tmp_path / "out1") == shard_hashes(tmp_path / "out2")
    for name in ("manifest.json", "quarantine.jsonl"):
        assert (tmp_path / "out1" / name).read_bytes() == (tmp_path / "out2" / name).read_bytes()
    assert [r.rejected for r in reports] == [3, 3]
    assert [q["field"] for q in quarantined(tmp_path / "out1")] == ["", "image", "image"]
    assert quarantined(tmp_path / "out1")[2]["file"] == "images/t2-0.png"
    assert sum(reports[0].rows.values()) == 30
    assert verify(tmp_path / "out2").ok


def test_planners_that_cannot_be_sent_to_workers(recording: Any, tmp_path: Path) -> None:
    planners = {
        "later": hj.Schedule(
            lambda epoch: hj.Marks(number=3, mark_size=5, avoid_elements=epoch == 0)
        )
    }
    with pytest.raises(BuildError, match="workers=1"):
        build(recording(), tmp_path / "out", corruptions=planners, workers=2)
    build(recording("again"), tmp_path / "out2", corruptions=planners)
    manifest = json.loads((tmp_path / "out2" / "manifest.json").read_text())
    # what the schedule gives for epoch 0 needs them
    assert manifest["parameters"]["elements"] == "picture"
    assert not (tmp_path / "out2" / "config.yaml").exists()


def test_without_dev_shm_there_are_no_workers_and_it_is_said(
    recording: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(*_: Any, **__: Any) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr("multiprocessing.synchronize.SemLock.__init__", read_only)
    planners = {"marks": hj.make_corruption("marks")}
    source = recording()
    with pytest.raises(BuildError, match=r"no worker processes here .*/dev/shm.*--workers 1"):
        build(source, tmp_path / "out", corruptions=planners, workers=2)
    assert build(source, tmp_path / "out", corruptions=planners, workers=1).total


def test_combinations(recording: Any, small: Any, tmp_path: Path) -> None:
    planners = {
        "both": hj.Sequence([small["marks"], small["resolution"]]),
        "mix": hj.OneOf([hj.Marks.at(1, mark_size=5), small["subtitle"]], p_clean=0.4),
    }
    report = build(recording(trajectories=4, steps=5), tmp_path / "out", corruptions=planners)
    rows = list(open_dataset(tmp_path / "out"))
    combined_rows = [row for row in rows if row["corruption"] == "both"]
    assert report.rows["both"] == len(combined_rows) == 20
    assert {json.loads(row["plan"])["corruption"] for row in combined_rows} == {
        "marks-v1+resolution-v2"
    }
    assert {row["width"] for row in combined_rows} == {160}
    left_clean = sum(report.not_applicable["mix"].values())
    assert 0 < left_clean < 20
    assert report.rows["mix"] == 20 - left_clean
    assert verify(tmp_path / "out").regenerated == 40 - left_clean


def test_severity_is_the_level_of_the_parameters(recording: Any, tmp_path: Path) -> None:
    planners = {f"m{n}": hj.Marks.at(n) for n in range(1, 6)} | {"own": hj.Marks(number=33)}
    build(recording(trajectories=1, steps=1), tmp_path / "out", corruptions=planners, clean=False)
    assert [row["severity"] for row in open_dataset(tmp_path / "out")] == [1, 2, 3, 4, 5, None]


def test_what_cannot_be_placed_is_counted_and_gives_no_row(recording: Any, tmp_path: Path) -> None:
    planners = {
        "wide": hj.Subtitle(subtitle_text="W" * 200),
        "none": hj.Marks(number=0),
        "same": hj.Resolution(scale=1.0),
    }
    report = build(recording(trajectories=1, steps=2), tmp_path / "out", corruptions=planners)
    assert dict(report.rows) == {"clean": 2, "wide": 0, "none": 0, "same": 0}
    assert (report.exit_code, report.rejected) == (0, 0)
    assert {
        label: sum(reasons.values()) for label, reasons in report.not_applicable.items()
    } == dict.fromkeys(planners, 2)
    (reason,) = report.not_applicable["wide"]
    assert "does not fit" in reason
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["counts"]["not_applicable"] == {
        k: dict(v) for k, v in sorted(report.not_applicable.items())
    }
    assert any("wide: not applicable to 2 steps" in line for line in report.lines())


def test_a_plan_that_changes_no_pixel_gives_no_row(recording: Any, tmp_path: Path) -> None:
    folder = recording(trajectories=1, steps=1)
    Image.new("RGB", (320, 200), "red").save(folder / "images" / "t0-0.png")
    report = build(folder, tmp_path / "out", corruptions={"red": hj.Marks(color="red")})
    assert report.rows["red"] == 0
    assert list(report.not_applicable["red"]) == ["no pixel differs from the clean picture"]


COVER = hj.PopUps(width=320, height=200, avoid_elements=False)


def test_label_policies(recording: Any, tmp_path: Path) -> None:
    folder = recording(trajectories=4, steps=5)
    marks = {"marks": hj.Marks(number=25, mark_size=12, mark_type="rectangle")}
    out = {policy: tmp_path / policy for policy in ("keep", "drop", "avoid")}
    reports = {
        policy: build(folder, out[policy], corruptions=marks, label_policy=policy) for policy in out
    }
    entries = {
        p: [r["target_visible"] for r in open_dataset(out[p]) if r["corruption"] == "marks"]
        for p in out
    }
    assert len(entries["keep"]) == 20
    assert min(entries["keep"]) < 0.5
    assert entries["drop"] == [share for share in entries["keep"] if share >= 0.5]
    assert reports["drop"].dropped["marks"] == 20 - len(entries["drop"]) > 0
    assert set(entries["avoid"]) == {1.0}
    assert len(entries["avoid"]) + reports["avoid"].dropped.get("marks", 0) == 20
    assert len(entries["avoid"]) > entries["keep"].count(1.0)


def test_a_point_is_a_target_too(
    recording: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=1, steps=1)
    point = {
        "action": {"type": "click", "x": 310, "y": 190},
        "target_box": None,
        "image": "images/t0-0.png",
    }
    add_line(folder, good_line("t1", 0, **point))
    add_line(folder, good_line("t2", 0, **{**point, "action": {"type": "wait"}}))
    build(folder, tmp_path / "out", corruptions={"cover": COVER})
    rows = {row["id"]: row for row in open_dataset(tmp_path / "out")}
    # the pop-up takes the lower right quarter
    assert rows["t0/0000/cover"]["target_visible"] == 1.0
    assert rows["t1/0000/cover"]["target_visible"] == 0.0
    assert rows["t1/0000/clean"]["target_visible"] == 1.0
    assert rows["t2/0000/cover"]["target_visible"] is None


def test_a_drag_shows_where_both_its_ends_do(
    recording: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=1, steps=1)
    for name, start, end in (
        ("t1", (20, 20), (310, 190)),
        ("t2", (310, 190), (20, 20)),
        ("t3", (20, 20), (90, 30)),
    ):
        drag = {"type": "drag", "x": start[0], "y": start[1], "x2": end[0], "y2": end[1]}
        add_line(folder, good_line(name, 0, action=drag, target_box=None, image="images/t0-0.png"))
    for policy, value in {"keep": [0.0, 0.0, 1.0], "drop": [1.0], "avoid": [1.0]}.items():
        build(
            folder,
            tmp_path / policy,
            corruptions={"cover": COVER},
            clean=False,
            label_policy=policy,
        )
        rows = [row for row in open_dataset(tmp_path / policy) if row["trajectory_id"] != "t0"]
        assert [row["target_visible"] for row in rows] == value


def test_elements_of_the_recording_come_before_the_detector(
    recording: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    pytest.importorskip("cv2")
    folder = recording(trajectories=1, steps=1)
    screen = Image.new("RGB", (320, 200), "white")
    screen.paste("black", (0, 0, 320, 90))
    screen.paste(
        Image.fromarray(np.random.default_rng(0).integers(0, 256, (12, 60, 3), dtype=np.uint8)),
        (40, 150),
    )
    screen.save(folder / "images" / "t0-0.png")
    add_line(folder, good_line("t1", 0, image="images/t0-0.png", elements=[]))
    planners = {"pop_ups": hj.PopUps(width=320, height=200)}
    build(folder, tmp_path / "out", corruptions=planners)
    value, result = (
        row for row in open_dataset(tmp_path / "out") if row["corruption"] == "pop_ups"
    )
    images = {row["id"]: np.asarray(row["screenshot"]) for row in open_dataset(tmp_path / "out")}
    clean = images["t0/0000/clean"]
    assert value["plan_digest"] != result["plan_digest"]
    # a recorded element
    assert np.array_equal(images["t0/0000/pop_ups"][10:30, 10:60], clean[10:30, 10:60])
    # one in the picture
    assert np.array_equal(images["t1/0000/pop_ups"][150:162, 40:100], clean[150:162, 40:100])
    assert (
        json.loads((tmp_path / "out" / "manifest.json").read_text())["parameters"]["elements"]
        == "picture"
    )


def test_planners_are_told_all_that_is_known(
    recording: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=1, steps=1)
    point = {"action": {"type": "click", "x": 8, "y": 9}, "target_box": None, "elements": None}
    add_line(folder, good_line("t1", 0, **point, apps=["vlc"], image="images/t0-0.png"))
    calls: list[tuple[hj.Scene, dict[str, Any]]] = []

    class Watcher(hj.plugin.Augmentation):
        def plan(self, scene: hj.Scene, **key: Any) -> hj.Plan:
            calls.append((scene, key))
            return hj.Plan.clean(scene.size)

    build(folder, tmp_path / "out", corruptions={"watch": Watcher()}, seed=6)
    assert calls == [
        (
            hj.Scene((200, 320), [(90, 40, 130, 60), (10, 10, 60, 30)], target=(90, 40, 130, 60)),  # type: ignore[arg-type]
            {"seed": 6, "sample": "t0", "step": 0},
        ),
        (
            hj.Scene((200, 320), apps=("vlc",), target=(0, 1, 16, 17)),
            {"seed": 6, "sample": "t1", "step": 0},
        ),
    ]


def test_the_fingerprint_covers_every_pixel_of_the_source(recording: Any, tmp_path: Path) -> None:
    folder = recording(trajectories=1, steps=2)
    names = set()
    for n, pixel in enumerate(("red", "blue")):
        image = Image.new("RGB", (320, 200))
        image.putpixel((7, 7), {"red": (255, 0, 0), "blue": (0, 0, 255)}[pixel])
        image.save(folder / "images" / "t0-1.png", compress_level=0)  # files of one size
        build(folder, tmp_path / f"out{n}", corruptions={}, label_policy="keep")
        names.add(
            json.loads((tmp_path / f"out{n}" / "manifest.json").read_text())["source"][
                "fingerprint"
            ]
        )
    assert len(names) == 2


def test_row_groups_stay_small(
    recording: Any, small: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipelines.building.parquet_writer.GROUP_ROWS", 4)
    build(recording(), tmp_path / "rows", corruptions=small)
    monkeypatch.setattr("pipelines.building.parquet_writer.GROUP_BYTES", 1)
    build(tmp_path / "source", tmp_path / "bytes", corruptions=small)
    groups = [
        pq.ParquetFile(tmp_path / name / "data" / "train-00000.parquet").num_row_groups
        for name in ("rows", "bytes")
    ]
    assert groups == [8, 30]


def test_the_card_says_how_to_build_it_again(recording: Any, small: Any, tmp_path: Path) -> None:
    build(recording(), tmp_path / "out", corruptions=small, seed=4)
    card = (tmp_path / "out" / "README.md").read_text()
    assert card.startswith("---\n")
    assert "hijack build source --out" in card
    assert "| `marks` | 6 | 0 | 0 |" in card
    assert all(f"| `{name}` |" in card for name in NAMES)
    assert "seed 4" in card
    assert "licence" in card


@pytest.mark.parametrize("output", ["materialised", "lazy"])
def test_the_hub_reads_the_card(
    output: str, recording: Any, small: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its metadata is what the Hub filters by, and its features are those of the files; `datasets`
    checks the numbers of rows."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    hub = pytest.importorskip("huggingface_hub")
    datasets = pytest.importorskip("datasets")
    out = tmp_path / "out"
    report = build(recording(), out, corruptions=small, output=output)
    data = hub.DatasetCard.load(out / "README.md").data
    assert isinstance(data, hub.DatasetCardData)
    assert (data.license, data.license_name, data.license_link) == (
        "other",
        "as-source-recordings",
        "README.md",
    )
    assert (data.size_categories, data.task_categories) == (["n<1K"], ["image-text-to-text"])
    assert "computer-use" in data.tags
    assert "configs" not in data.to_dict()  # datasets names its cache by them alone
    result = datasets.Features._from_yaml_list(data.dataset_info["features"])
    schema = pq.read_schema(out / "data" / "train-00000.parquet")
    assert result == datasets.Features.from_arrow_schema(schema)
    (split,) = data.dataset_info["splits"]
    size = (out / "data" / "train-00000.parquet").stat().st_size
    assert split == {"name": "train", "num_bytes": size, "num_examples": report.total}
    dataset_rows = datasets.load_dataset(str(out), split="train", cache_dir=str(tmp_path / "cache"))
    assert (len(dataset_rows), dataset_rows.features) == (report.total, result)


@pytest.mark.parametrize(
    ("rows", "name"),
    [
        (0, "n<1K"),
        (999, "n<1K"),
        (1000, "1K<n<10K"),
        (99_999, "10K<n<100K"),
        (10**6, "1M<n<10M"),
        (10**9, "1B<n<10B"),
    ],
)
def test_sizes_are_called_as_on_the_hub(rows: int, name: str) -> None:
    assert _size_category(rows) == name


def test_pictures_that_could_be_read_in_two_ways(
    recording: Any, small: Any, tmp_path: Path
) -> None:
    """Transparent pixels are read in their hidden colours, and said to be; of several frames none
    is chosen."""
    folder = recording(trajectories=1, steps=4)
    images = folder / "images"
    clear = Image.open(images / "t0-0.png").convert("RGBA")
    clear.save(images / "t0-1.png")  # an alpha channel that hides nothing
    clear.putpixel((3, 3), (255, 0, 0, 0))
    clear.save(images / "t0-2.png")
    frames = [Image.new("RGB", (320, 200), colour) for colour in ("red", "green", "blue")]
    frames[0].save(images / "t0-3.png", "GIF", save_all=True, append_images=frames[1:])
    note = "1 picture with transparent pixels"
    report = build(folder, tmp_path / "out", corruptions=small)
    assert [text for text in report.notes if note in text]
    assert (report.rejected, report.rows["clean"]) == (1, 3)
    assert "animated, 3 frames; save the one frame" in report.examples[0]
    dry_report = build(folder, tmp_path / "dry", corruptions=small, dry_run=True)
    assert [text for text in dry_report.notes if note in text]
    assert [text for text in inspect_source(folder, corruptions=small).notes if note in text]
    assert verify(tmp_path / "out", source=folder).ok


def test_the_real_recordings(shared_data: Path, tmp_path: Path) -> None:
    report = build(
        shared_data / "trajectories" / "agentnet_raw",
        tmp_path / "out",
        corruptions="marks,resolution",
    )
    assert dict(report.rows) == {"clean": 15, "marks": 15, "resolution": 15}
    half = next(
        row
        for row in open_dataset(tmp_path / "out")
        if row["id"] == "task_example_0/0000/resolution"
    )
    assert (half["width"], half["height"]) == (638, 359)
    assert (half["action"]["x"], half["action"]["y"]) == (620, 348)
    assert half["action_code"] == "pyautogui.click(x=620, y=348)"


def test_settings_know_how_many_rows_a_step_has() -> None:
    planners = (("a", hj.Marks()), ("b", hj.Marks()))
    assert (RowSettings(planners).variants, RowSettings(planners, clean=False).variants) == (3, 2)


@pytest.mark.parametrize(
    ("action", "target", "field"),
    [
        ({"type": "click", "x": 310, "y": 190}, None, "action"),
        ({"type": "drag", "x": 10, "y": 10, "x2": 310, "y2": 190}, None, "action"),
        ({"type": "wait"}, [300, 180, 320, 200], "target_box"),
    ],
)
def test_a_picture_that_is_replaced_while_the_build_runs_gets_no_wrong_label(
    action: Any,
    target: Any,
    field: str,
    recording: Any,
    add_line: Any,
    good_line: Any,
    tmp_path: Path,
) -> None:
    source = recording(trajectories=1, steps=1)
    with Image.open(source / "images" / "t0-0.png") as picture:
        picture.save(source / "images" / "u.png")
        smaller = picture.resize((160, 100))
    add_line(
        source,
        good_line("u", 0, image="images/u.png", action=action, action_code="", target_box=target),
    )

    def replace_picture(*_: Any) -> None:
        smaller.save(source / "images" / "u.png")

    report = build(source, tmp_path / "out", corruptions={}, progress=replace_picture)
    assert [row["trajectory_id"] for row in open_dataset(tmp_path / "out")] == ["t0"]
    (rejected,) = report.examples
    assert rejected.startswith(f"images/u.png: u, step 0: {field}: ")
    assert "160x100 screenshot" in rejected
    assert "build again" in rejected
