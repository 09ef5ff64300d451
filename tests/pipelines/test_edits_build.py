"""Datasets with what happens to the machine: rows, labels, and that they can be trusted like any others."""

import hashlib
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

import hijack_data as hj
from hijack_data import corruption as registry
from hijack_data import pack as pack_module
from hijack_data.cli import hijack
from hijack_data.errors import AssetError
from hijack_data.pack import AssetPack
from pipelines import build, open_dataset, render, verify
from pipelines.columns import COLUMNS
from pipelines.errors import BuildError
from pipelines.readers import get_reader
from pipelines.stats import stats
from pipelines.stats_page import page

FIVE = ("multi_apps", "accidental_touch", "app_minimization", "network_error", "verification")
WAIT = {"type": "wait", "x": None, "y": None, "x2": None, "y2": None, "text": None, "keys": None, "amount": None}


@pytest.fixture
def browsing(recording: Any) -> Path:
    """Two recordings of five steps in a browser."""
    return with_apps(recording(trajectories=2, steps=5), ["chrome"])


def with_apps(folder: Path, apps: list[str], **more: Any) -> Path:
    rows = [json.loads(line) for line in (folder / "trajectories.jsonl").read_text().splitlines()]
    lines = [json.dumps({**row, "apps": apps, **{k: v(row) for k, v in more.items()}}) + "\n" for row in rows]
    (folder / "trajectories.jsonl").write_text("".join(lines))
    return folder


@pytest.fixture
def nine(small: Any) -> dict[str, Any]:
    """All nine, those of the picture as they fit the small screens."""
    return {name: small.get(name, None) or hj.get(name) for name in hj.names()}


def rows_by_label(folder: Path) -> dict[str, list[dict[str, Any]]]:
    found: dict[str, list[dict[str, Any]]] = {}
    for row in open_dataset(folder):
        found.setdefault(row["corruption"], []).append(row)
    return found


def test_all_nine(browsing: Path, nine: Any, assets: Path, tmp_path: Path) -> None:
    report = build(browsing, tmp_path / "out", corruptions=nine, seed=3, assets=assets)
    assert report.exit_code == 0
    assert dict(report.not_applicable) == {}
    visual = dict.fromkeys(("clean", "pop_ups", "resolution", "marks", "subtitle"), 10)
    assert dict(report.rows) == {**visual, **dict.fromkeys(FIVE, 2)}
    found = rows_by_label(tmp_path / "out")
    assert [row["id"] for label in FIVE for row in found[label][:1]] == [
        "t0/0000/multi_apps", "t0/0003/accidental_touch+touch", "t0/0003/app_minimization+minimise",
        "t0/0000/network_error", "t0/0000/verification",
    ]  # fmt: skip
    assert {(label, row["fidelity"], row["inserted"], row["reminder"] is not None) for label in FIVE
            for row in found[label]} == {
        ("multi_apps", "composited", False, False), ("accidental_touch", "composited", True, False),
        ("app_minimization", "recorded", True, False), ("network_error", "recorded", False, True),
        ("verification", "recorded", False, True),
    }  # fmt: skip
    for label, rows in found.items():
        for row in rows:
            assert (row["event"] is None) == (label not in FIVE)
            assert row["fidelity"] == "exact" or label in FIVE
            assert row["changed_pixels"] > 0 or label == "clean"
            assert hashlib.sha256(row["screenshot"].tobytes()).hexdigest() == row["image_sha256"]
    every = [row["id"] for rows in found.values() for row in rows]
    assert len(set(every)) == len(every)


def test_what_each_row_teaches(browsing: Path, assets: Path, tmp_path: Path) -> None:
    build(browsing, tmp_path / "out", corruptions=",".join(FIVE), assets=assets)
    found = {label: rows[0] for label, rows in rows_by_label(tmp_path / "out").items()}
    pack = AssetPack.load(assets)
    for label, name in (("network_error", "error"), ("verification", "lock-small"), ("app_minimization", "desktop")):
        assert np.array_equal(np.asarray(found[label]["screenshot"]), pack.get(name).pixels())
    for label in ("network_error", "verification"):
        row = found[label]
        assert (row["action"], row["action_code"], row["target_box"], row["target_visible"]) == (
            WAIT,
            "WAIT",
            None,
            None,
        )
    back = found["app_minimization"]
    assert (back["step"], back["action"]["type"], back["action"]["x"], back["action"]["y"]) == (3, "click", 50, 190)
    assert (back["action_code"], back["target_box"]) == ("pyautogui.click(50, 190)", [20, 180, 80, 200])
    assert back["target_visible"] == 1.0
    beside, clean = found["multi_apps"], found["clean"]
    for name in ("action", "action_code", "target_box", "target_visible", "step"):
        assert beside[name] == clean[name]
    assert beside["target_visible"] == 1.0
    changed = (np.asarray(beside["screenshot"]) != np.asarray(clean["screenshot"])).any(axis=2).sum()
    assert beside["changed_pixels"] == changed <= 120 * 150


def test_the_button_of_a_dialog_is_visible_although_it_was_pasted(browsing: Path, tmp_path: Path, assets: Path) -> None:
    """`keep`, `avoid` and `drop` agree: what an event shows does not hide its own target."""
    seen = {}
    for policy in ("keep", "avoid", "drop", "recover"):
        report = build(browsing, tmp_path / policy, corruptions="accidental_touch,verification", assets=assets,
                       label_policy=policy, seed=1)  # fmt: skip
        assert dict(report.dropped) == {}
        rows = rows_by_label(tmp_path / policy)["accidental_touch"]
        seen[policy] = [(row["action_code"], row["target_box"], row["target_visible"]) for row in rows]
    assert seen["keep"] == seen["avoid"] == seen["drop"] == seen["recover"]
    dialogs = [entry for entry in seen["keep"] if entry[1]]
    assert all(entry[2] == 1.0 for entry in dialogs)


COMBINED: dict[str, Any] = {
    "locked": hj.Sequence([hj.Subtitle(subtitle_text="hello", font_size=12, padding=5), hj.Verification()]),
    "half": hj.Sequence([hj.Resolution(), hj.AppMinimization(step=1)]),
    "dots": hj.Sequence([hj.AccidentalTouch(step=(1, 2)), hj.Marks(number=4, mark_size=8)]),
    "mix": hj.OneOf([hj.Verification(step=hj.Every(1)), hj.Marks(number=3, mark_size=6)]),
    "both": hj.Sequence([hj.AccidentalTouch(step=2), hj.AppMinimization(step=2), hj.Verification(step=2)]),
    "late": hj.Schedule(lambda epoch: hj.MultiApps(step=2)),
    "clash": hj.Sequence([hj.Verification(), hj.NetworkError()]),
}


def test_effects_together_with_pictures(browsing: Path, assets: Path, tmp_path: Path) -> None:
    report = build(browsing, tmp_path / "out", corruptions=COMBINED, assets=assets)
    found = rows_by_label(tmp_path / "out")
    names = {label: [row["id"].partition("/")[2] for row in rows if row["trajectory_id"] == "t0"]
             for label, rows in found.items()}  # fmt: skip
    assert names["locked"] == [f"000{k}/locked" for k in range(5)]
    assert names["half"] == ["0000/half", "0001/half+minimise", "0001/half", "0002/half", "0003/half", "0004/half"]
    assert names["dots"] == ["0000/dots", "0001/dots+touch", "0001/dots", "0002/dots+touch", "0002/dots", "0003/dots",
                             "0004/dots"]  # fmt: skip
    assert names["both"] == ["0002/both+touch", "0002/both+minimise", "0002/both"]
    assert names["late"] == ["0002/late"]
    assert "clash" not in names
    assert list(report.not_applicable["clash"]) == [
        "two effects change this screen, and what both leave was never recorded"
    ]
    assert {row["fidelity"] for row in found["mix"]} == {"exact", "recorded"}
    locked = found["locked"]
    assert [row["fidelity"] for row in locked[:2]] == ["recorded", "exact"]
    assert locked[0]["action_code"] == "WAIT"
    assert locked[1]["action_code"] == "pyautogui.click(101, 50)"
    # The subtitle is drawn over the lock screen, as it would be on a live one.
    plan = hj.Plan.from_json(locked[0]["plan"])
    assert [type(op).__name__ for op in plan.ops] == ["Paste", "Paste"]
    assert plan.ops[0].sprite["draw"] == "asset"  # type: ignore[union-attr]
    words = hj.Plan("x-v1", (200, 320), ops=plan.ops[1:])
    assert np.array_equal(np.asarray(locked[0]["screenshot"]),
                          hj.apply(words, AssetPack.load(assets).get("lock-small").pixels()))  # fmt: skip


def test_what_is_done_follows_the_resolution(browsing: Path, assets: Path, tmp_path: Path) -> None:
    build(browsing, tmp_path / "out", corruptions={"half": COMBINED["half"]}, assets=assets)
    row = next(row for row in open_dataset(tmp_path / "out") if row["inserted"])
    assert (row["width"], row["height"], row["target_box"]) == (160, 100, [10, 90, 40, 100])
    assert (row["action"]["x"], row["action"]["y"], row["action_code"]) == (25, 95, "pyautogui.click(25, 95)")
    assert row["target_visible"] == 1.0


def test_pictures_over_an_event_avoid_its_target(browsing: Path, assets: Path, tmp_path: Path) -> None:
    planner = hj.Sequence([hj.AppMinimization(step=1), hj.Marks(number=40, mark_size=12)])
    seen = {}
    for policy in ("keep", "avoid", "drop", "recover"):
        report = build(browsing, tmp_path / policy, corruptions={"dots": planner}, assets=assets, label_policy=policy,
                       clean=False, seed=5)  # fmt: skip
        rows = [row for row in open_dataset(tmp_path / policy) if row["inserted"]]
        seen[policy] = [row["target_visible"] for row in rows]
        assert len(rows) + (report.dropped.get("dots", 0) > 0) >= 1
    assert min(seen["keep"]) < 1
    assert set(seen["avoid"]) | set(seen["recover"]) <= {1.0}
    assert seen["avoid"] == seen["recover"]
    assert all(share >= 0.5 for share in seen["drop"])


@pytest.mark.parametrize(
    ("step", "expected"),
    [(0, [1]), (2, [4]), ((0, 4), [1, 8]), (hj.Every(2), [4, 8]), (-1, [1]), ((-1, 1), [1, 2])],
)
def test_steps_are_counted_from_0_whatever_their_numbers(
    step: Any, expected: list[int], recording: Any, assets: Path, tmp_path: Path
) -> None:
    """The recording leaves step 3 out and begins at 1; the third step that was read is step 2."""
    numbers = [1, 2, 4, 7, 8]
    folder = with_apps(recording(trajectories=1, steps=5), ["chrome"], step=lambda row: numbers[row["step"]])
    kind = hj.Verification if not isinstance(step, hj.Every) else hj.AppMinimization
    build(folder, tmp_path / "out", corruptions={"x": kind(step=step)}, assets=assets)
    assert [row["step"] for row in rows_by_label(tmp_path / "out")["x"]] == expected


def test_recordings_that_end_too_soon_are_counted(recording: Any, assets: Path, tmp_path: Path) -> None:
    report = build(recording(trajectories=2, steps=3), tmp_path / "out", assets=assets,
                   corruptions="accidental_touch,app_minimization,verification")  # fmt: skip
    assert dict(report.rows) == {"clean": 6, "accidental_touch": 0, "app_minimization": 0, "verification": 2}
    ended = {"the recording ends before the step at which it acts": 2}
    assert report.not_applicable == {"accidental_touch": ended, "app_minimization": ended}


def test_where_an_event_would_not_be_true_there_is_no_row(
    recording: Any, add_line: Any, good_line: Any, assets: Path, tmp_path: Path
) -> None:
    folder = recording(trajectories=1, steps=1)
    Image.new("RGB", (300, 150), "white").save(folder / "images" / "other.png")
    add_line(folder, good_line("t1", 0, image="images/other.png", elements=None))
    report = build(folder, tmp_path / "out", assets=assets, corruptions=",".join(FIVE))
    reasons = {label: set(found) for label, found in report.not_applicable.items()}
    assert {"the recording ends before the step at which it acts"} == reasons["app_minimization"]
    assert reasons["network_error"] == {
        "the recording names no browser among its applications: a missing network would not show"
    }
    assert reasons["verification"] == {
        "no lock screen was recorded on a screen of this size, or on a larger one of its shape"
    }
    assert report.rows["verification"] == 1


def test_elements_are_looked_for_where_none_are_recorded(
    recording: Any, assets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = with_apps(recording(trajectories=1, steps=4), [], elements=lambda row: None)
    looked: list[Any] = []

    def found(image: np.ndarray, **known: Any) -> hj.Scene:
        looked.append(image)
        return hj.Scene(image.shape[:2], [(200, 100, 230, 120)], **known)  # type: ignore[arg-type]

    monkeypatch.setattr("pipelines.rows.scene_from", found)
    report = build(folder, tmp_path / "out", assets=assets, corruptions="accidental_touch")
    assert report.rows["accidental_touch"] == 1
    (row,) = rows_by_label(tmp_path / "out")["accidental_touch"]
    assert json.loads(row["plan"])["notes"] == ["the element at [200, 100, 230, 120] was clicked"]
    assert len(looked) == 1  # only where it acts


@pytest.mark.parametrize("clean", [True, False])
def test_both_kinds_are_equal_row_by_row(clean: bool, browsing: Path, nine: Any, assets: Path, tmp_path: Path) -> None:
    planners = {**nine, **{label: COMBINED[label] for label in ("locked", "half", "dots", "mix", "both")}}
    for output in ("materialised", "lazy"):
        build(browsing, tmp_path / output, corruptions=planners, seed=11, output=output, assets=assets, clean=clean)
    count = 0
    for left, right in zip(open_dataset(tmp_path / "materialised"), open_dataset(tmp_path / "lazy"), strict=True):
        assert list(left) == list(right) == list(COLUMNS)
        assert left.pop("screenshot").tobytes() == right.pop("screenshot").tobytes()
        assert left == right
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
    loaded = datasets.load_dataset(str(tmp_path / "out"), split="train", cache_dir=str(tmp_path / "cache"))
    assert {name: loaded.features[name].dtype for name in ("event", "reminder", "inserted")} == {
        "event": "string", "reminder": "string", "inserted": "bool",
    }  # fmt: skip
    ours = list(open_dataset(tmp_path / "out"))
    for theirs, row in zip(loaded.with_transform(render), ours, strict=True):
        assert (theirs["event"], theirs["inserted"], theirs["action"]) == (row["event"], row["inserted"], row["action"])
        assert theirs["screenshot"].tobytes() == row["screenshot"].tobytes()


def hashes(folder: Path) -> dict[str, str]:
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in sorted((folder / "data").iterdir())}


def test_a_resumed_build_ends_in_the_same_bytes(browsing: Path, nine: Any, assets: Path, tmp_path: Path) -> None:
    options: dict[str, Any] = {"corruptions": nine, "assets": assets, "rows_per_shard": 45}
    build(browsing, tmp_path / "out", **options)
    before = hashes(tmp_path / "out")
    assert len(before) == 2
    (tmp_path / "out" / "data" / "train-00001.parquet").unlink()
    (tmp_path / "out" / "manifest.json").unlink()
    (tmp_path / "out" / ".build").mkdir()
    build(browsing, tmp_path / "two", **options, workers=2)
    assert hashes(tmp_path / "two") == before
    (tmp_path / "two" / "data" / "train-00001.parquet").unlink()
    assert build(browsing, tmp_path / "two", **options, resume=True).kept == 1
    assert hashes(tmp_path / "two") == before


def test_a_build_is_not_resumed_with_another_pack(browsing: Path, assets: Path, tmp_path: Path) -> None:
    build(browsing, tmp_path / "out", corruptions="verification", assets=assets)
    other = changed_pack(assets, tmp_path / "other")
    with pytest.raises(BuildError, match=r"assets was .*, is"):
        build(browsing, tmp_path / "out", corruptions="verification", assets=other, resume=True)
    shutil.copytree(assets, tmp_path / "same")
    again = build(browsing, tmp_path / "out", corruptions="verification", assets=tmp_path / "same", resume=True)
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
        from hijack_data import raster

        monkeypatch.setattr(pack_module, "_known", {})
        monkeypatch.setattr(raster, "_cache", raster._Cache(2**24))
        monkeypatch.setenv("AGENTHIJACK_ASSETS", str(folder))

    return use


@pytest.mark.parametrize("output", ["materialised", "lazy"])
def test_verify_says_when_the_pack_differs(
    output: str, browsing: Path, assets: Path, fresh: Any, tmp_path: Path
) -> None:
    build(browsing, tmp_path / "out", corruptions="verification,app_minimization", assets=assets, output=output)
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["parameters"]["assets"] == {
        "sha256": AssetPack.load(assets).digest, "licence": "made up for tests",
    }  # fmt: skip
    fresh(assets)
    assert (verify(tmp_path / "out").notes, verify(tmp_path / "out").ok) == ([], True)
    fresh(changed_pack(assets, tmp_path / "unused", "view"))  # no row shows it
    found = verify(tmp_path / "out")
    assert found.ok
    assert "is not the one of the build" in found.notes[0]
    assert "note: the asset pack here" in "\n".join(found.lines())
    fresh(changed_pack(assets, tmp_path / "used"))
    problems = verify(tmp_path / "out").problems
    assert [problem.split(": ")[1] for problem in problems] == ["row t0/0000/verification", "row t1/0000/verification"]
    assert all("holds another picture of that name; set AGENTHIJACK_ASSETS" in problem for problem in problems)
    fresh(tmp_path / "none")
    assert len(verify(tmp_path / "out").problems) == 4
    assert "no asset pack there" in verify(tmp_path / "out").notes[0]


def test_builds_of_pictures_alone_need_no_pack(recording: Any, small: Any, fresh: Any, tmp_path: Path) -> None:
    fresh(tmp_path / "none")
    build(recording(), tmp_path / "out", corruptions=small)
    assert json.loads((tmp_path / "out" / "manifest.json").read_text())["parameters"]["assets"] is None
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
    assert hashes(tmp_path / "one") == hashes(tmp_path / "two")


def test_what_people_are_told(browsing: Path, nine: Any, assets: Path, tmp_path: Path) -> None:
    build(browsing, tmp_path / "out", corruptions=nine, assets=assets)
    card = (tmp_path / "out" / "README.md").read_text()
    for text in ("* `exact`:", "* `composited`:", "* `recorded`:", "`reminder`", "made up for tests",
                 AssetPack.load(assets).digest[:16]):  # fmt: skip
        assert text in card
    found = stats(tmp_path / "out")
    data = found.to_data()["corruptions"]
    assert data["verification"]["fidelity"] == {"recorded": 2}
    assert data["verification"]["reminders"] == 2
    assert data["app_minimization"]["inserted"] == 2
    assert sum(data["accidental_touch"]["event"].values()) == 2
    assert data["marks"]["event"] == {}
    lines = "\n".join(found.lines())
    assert "verification: 2 row(s): The session was locked" in lines
    assert "verification: 2 row(s) with a reminder" in lines
    assert "app_minimization: 2 step(s) inserted" in lines
    text = page(tmp_path / "out", found)
    assert "recorded: The session was locked; the screen asks for the password. Action: WAIT" in text


def test_a_recording_may_name_the_key_of_its_draws(browsing: Path, assets: Path, tmp_path: Path, small: Any) -> None:
    """Two runs of one task get the same plans, and lazy rows still hold a recipe."""
    from dataclasses import replace

    from pipelines.rows import Settings, Tally, rows_of

    planners = (("marks", small["marks"]), ("touch", hj.AccidentalTouch(step=0)))
    made = []
    items = list(get_reader("jsonl").read(browsing))
    for name, sample in (("run-a", "task"), ("run-b", "task"), ("task", None), ("other", None)):
        trajectory = replace(items[0], id=name, sample=sample)  # type: ignore[type-var]
        step = trajectory.steps[0]  # type: ignore[union-attr]
        settings = Settings(planners, lazy=True, clean=False, assets=str(assets))
        rows = rows_of(trajectory, step, Path(step.image).read_bytes(), "x", settings, Tally())  # type: ignore[arg-type]
        made.append(list(rows))
    digests = [[row["plan_digest"] for row in rows] for rows in made]
    assert digests[0] == digests[1] == digests[2] != digests[3]
    recipe = json.loads(made[0][0]["plan"])
    assert recipe == {"corruption": "marks-v1", "format": "agenthijack-recipe", "sample": "task", "version": 1}
    assert render({**made[0][0]})["plan"] == render({**made[2][0]})["plan"]


def test_plug_ins_whose_look_is_not_known_are_refused(
    browsing: Path, assets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "_registry", dict(registry._registry))

    @hj.register
    @dataclass(frozen=True)
    class Muted(hj.Corruption):
        """Turns the sound off."""

        name: ClassVar[str] = "muted"
        category: ClassVar[Any] = "environment_error"
        scope: ClassVar[Any] = "state"

        def make_plan(self, scene: hj.Scene, stream: hj.Stream, step: int) -> hj.Draft:
            return hj.Draft(effects=(hj.Effect("mute"),))

    for asked in ("all", "muted", {"x": hj.OneOf([hj.Sequence([Muted()])])}):
        with pytest.raises(BuildError, match=r"muted does mute to the machine.*leave it out: pop_ups,.*,verification$"):
            build(browsing, tmp_path / "out", corruptions=asked, assets=assets)  # type: ignore[arg-type]

    class Hidden:
        needs_elements = False

        def plan(self, scene: hj.Scene, **key: Any) -> hj.Plan:
            return Muted().plan(scene, **key)

    with pytest.raises(
        BuildError, match="x: muted-v1 gave a plan with effects, from a planner that is not one of ours"
    ):
        build(browsing, tmp_path / "out", corruptions={"x": Hidden()}, assets=assets)  # type: ignore[dict-item]


def test_plug_ins_with_a_known_effect_are_built(
    browsing: Path, assets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "_registry", dict(registry._registry))

    @hj.register
    @dataclass(frozen=True)
    class Locked(hj.Corruption):
        """Locks the session at every step."""

        name: ClassVar[str] = "locked_out"
        category: ClassVar[Any] = "environment_error"
        scope: ClassVar[Any] = "state"

        def make_plan(self, scene: hj.Scene, stream: hj.Stream, step: int) -> hj.Draft:
            return hj.Draft(effects=(hj.Effect("lock"),))

    report = build(browsing, tmp_path / "out", corruptions="locked_out", assets=assets)
    assert dict(report.rows) == {"clean": 10, "locked_out": 10}


def test_the_command(browsing: Path, assets: Path, tmp_path: Path) -> None:
    command = ["build", str(browsing), "--label-policy", "recover", "--corruptions"]
    run = CliRunner().invoke(
        hijack, [*command, ",".join(FIVE), "--assets", str(assets), "--out", str(tmp_path / "out")]
    )
    assert run.exit_code == 0, run.output
    assert "verification: 2" in run.output
    none = str(tmp_path / "none")
    run = CliRunner().invoke(hijack, [*command, "all", "--assets", none, "--out", str(tmp_path / "x")])
    assert isinstance(run.exception, AssetError)
    assert not (tmp_path / "x").exists()
