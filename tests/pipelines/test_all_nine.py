"""All nine at their defaults, from every format that can be read: real screens, and real recordings
where there are.

What each format gives and lacks is pinned, with the reason; so is where the labels lie, on the
pixels of the rows.
"""

import json
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from PIL import Image

import hijack_data as hj
from hijack_data.actions import parse_pyautogui
from hijack_data.cli import hijack
from pipelines import build, open_dataset, render, verify
from pipelines.building.build_report import BuildReport
from pipelines.dataset.stats import stats
from pipelines.exports import export
from pipelines.readers import names

from support.formats import FORMATS, SETS, TABLES, Shots, parquet, write_table
from support.labels import (
    check_beside,
    check_inserted,
    check_inside,
    check_replaced,
    check_scaled,
    ends,
    pixels,
)
from support.rows import assert_same_rows, load

pytest.importorskip("cv2", reason="which elements are found decides what happens to them")

PICTURE = ("pop_ups", "resolution", "marks", "subtitle")
MACHINE = ("multi_apps", "accidental_touch", "app_minimization", "network_error", "verification")
INSERTED = ("accidental_touch", "app_minimization")
REPLACED = ("network_error", "verification")

# One session in a browser, in order: a search, its result, a book, a review.
SESSION = [
    f"screenshots/{name}.png"
    for name in (
        "014_OpenCUA_s_df0fd37049f470c2_3",
        "015_OpenCUA_s_df0fd37049f470c2_4",
        "017_OpenCUA_s_df0fd37049f470c2_7",
        "018_OpenCUA_s_df0fd37049f470c2_9",
    )
]
CLICKS = ((15, 11), (21, 11), (28, 16))
PIXELS = "screenshot"
STEPS = 4  # the corruptions that insert a step do so at the fourth

NEVER = "the recording ends before the step at which it acts"
NO_BROWSER = (
    "the recording names no browser among its applications: a missing network would not show"
)
PAGE = "the pictures show a web page, not the screen around it"
PHONE = "the pictures show a phone, not the screen of a desktop"
NO_ROOM = "no room beside the target"
NO_PLACE = "the action names no place on the screen that a second window could leave free"

NO_WINDOW = "no desktop was recorded with a minimised window of what the recording uses (gimp)"
MAYBE_OPEN = (
    "a menu may be open on this screen: the action before it was a click, and the recording holds"
    " no elements"
)
# The pack's desktop is shown where that is asked for; these screens are of a Mac.
UNKNOWN: dict[str, Any] = {"allow_platform_mismatch": True, "platform": "macos"}
FOREIGN: dict[str, Any] = {**UNKNOWN, "apps": "gimp"}
BROWSING: dict[str, Any] = {**UNKNOWN, "apps": "chrome"}

Reasons = dict[str, dict[str, int]]


@dataclass(frozen=True)
class Case:
    """A source, and what is expected of it.

    Args:
        reader: the format that it is found to be of.
        make: makes it in an empty folder; the first argument is the folder of real data.
        steps: how many steps it has.
        shown: rows of what acts on the machine, by fidelity.
        lacks: what gave no row, by reason.
        points: where the clicks are, in order, if that is known from elsewhere.
        options: what the build is told. Most pictures are of a desktop unlike the pack's.
    """

    reader: str
    make: Callable[[Path, Path], Path]
    steps: int
    shown: dict[str, dict[str, int]]
    lacks: Reasons = field(default_factory=dict)
    points: tuple[tuple[int, int], ...] | None = None
    options: dict[str, Any] = field(default_factory=lambda: FOREIGN)


def session(data: Path) -> Shots:
    return Shots(
        lambda number: (data / SESSION[min(number, STEPS - 1)]).read_bytes(), (1280, 720), CLICKS
    )


POINTS = tuple(session(Path()).pixels)
WHOLE = {label: {"foreign": 1} for label in ("multi_apps", "verification")}
ONLINE = {**WHOLE, "app_minimization": {"foreign": 1}, "network_error": {"foreign": 1}}


def make_case(reader: str, maker: Callable[..., Path], **expected: Any) -> Case:
    """A recording that is made of the session's screens."""
    lacks: Reasons = {
        "accidental_touch": {MAYBE_OPEN: 1},
        "app_minimization": {NO_WINDOW: 1},
        "network_error": {NO_BROWSER: 1},
    }
    if "shown" in expected:
        lacks = {"accidental_touch": {MAYBE_OPEN: 1}}
    about = {"steps": STEPS, "shown": WHOLE, "lacks": lacks, "points": POINTS, **expected}
    return Case(reader, lambda data, folder: maker(folder, shots=session(data)), **about)


def first_steps(data: Path, folder: Path) -> Path:
    """The first steps of real recordings; of ScreenAgent's sessions (a folder each) the first
    two."""
    shutil.copytree(data, folder, dirs_exist_ok=True)
    for file in sorted(folder.glob("*.json*")):
        record = json.loads(file.read_text())
        listed = "traj" if "traj" in record else "steps"
        file.write_text(json.dumps({**record, listed: record[listed][:STEPS]}))
    for recording_folder in [
        path for path in sorted(folder.iterdir()) if (path / "images").is_dir()
    ][2:]:
        shutil.rmtree(recording_folder)
    for recording_folder in folder.glob("*/images"):
        for file in sorted(recording_folder.parent.glob("*.json"))[STEPS:]:
            file.unlink()
    return folder


def real(reader: str, name: str, **expected: Any) -> Case:
    return Case(
        reader, lambda data, folder: first_steps(data / "trajectories" / name, folder), **expected
    )


CASES = {
    **{
        name: make_case(name, FORMATS[name])
        for name in (
            "anthropic",
            "chat",
            "cua",
            "jsonl",
            "openai",
            "osworld",
            "ui_tars",
            "ui_tars_1.5",
        )
    },
    "gui_odyssey": make_case(
        "gui_odyssey",
        FORMATS["gui_odyssey"],
        shown={},
        options=UNKNOWN,
        lacks={label: {PHONE: 1} for label in MACHINE},
    ),
    "android_control": make_case(
        "android_control",
        FORMATS["android_control"],
        shown={},
        lacks={**{label: {PHONE: 1} for label in MACHINE}, "network_error": {NO_BROWSER: 1}},
    ),
    "grounding": make_case(
        "grounding",
        SETS["grounding"],
        points=(*POINTS, (1216, 360)),
        shown={"multi_apps": {"foreign": 4}, "verification": {"foreign": 4}},
        lacks={
            "accidental_touch": {NEVER: 4},
            "app_minimization": {NEVER: 4},
            "network_error": {NO_BROWSER: 4},
        },
    ),
    "parquet": make_case("parquet", FORMATS["parquet"], shown=ONLINE, options=UNKNOWN),
    "runs": make_case("runs", FORMATS["runs"], shown=ONLINE, options=UNKNOWN),
    "chat_code": make_case("parquet", TABLES["chat_code"]),
    "chat_calls": make_case("parquet", TABLES["chat_calls"]),
    "boxes": make_case(
        "parquet",
        TABLES["boxes"],
        steps=3,
        shown={"multi_apps": {"foreign": 3}, "verification": {"foreign": 3}},
        lacks={
            "accidental_touch": {NEVER: 3},
            "app_minimization": {NEVER: 3},
            "network_error": {NO_BROWSER: 3},
        },
    ),
    "agentnet_raw": real(
        "agentnet",
        "agentnet_raw",
        steps=4,
        shown=ONLINE,
        options=BROWSING,
        lacks={"accidental_touch": {MAYBE_OPEN: 1}},
        points=((1241, 697), (1185, 380)),
    ),
    "agentnetbench": real(
        "agentnet",
        "agentnetbench",
        steps=12,
        options=BROWSING,
        shown={
            "multi_apps": {"foreign": 3},
            "app_minimization": {"foreign": 2},
            "network_error": {"foreign": 3},
            "verification": {"foreign": 3},
        },
        lacks={
            "accidental_touch": {MAYBE_OPEN: 3},
            "app_minimization": {
                f"{NO_WINDOW.replace('gimp', 'browser')}; browser may be any such program: name it"
                " in agenthijack.yaml": 1
            },
        },
        points=(
            (849, 715),
            (411, 478),
            (198, 487),
            (259, 185),
            (1207, 871),
            (1256, 448),
            (441, 469),
            (1206, 685),
        ),
    ),
    "screenagent": real(
        "screenagent",
        "screenagent",
        steps=8,
        options=BROWSING,
        shown={label: {"foreign": 2} for label in MACHINE if label != "accidental_touch"},
        lacks={"accidental_touch": {MAYBE_OPEN: 2}},
        points=((487, 193), (368, 319)),
    ),
    "webvoyager": Case(
        "webvoyager",
        lambda data, folder: shutil.copytree(
            data / "trajectories" / "webvoyager", folder, dirs_exist_ok=True
        ),
        steps=9,
        shown={"network_error": {"composited": 2}},
        lacks={
            "multi_apps": {PAGE: 2},
            "accidental_touch": {PAGE: 1, NEVER: 1},
            "app_minimization": {PAGE: 1, NEVER: 1},
            "verification": {PAGE: 2},
        },
        options=UNKNOWN,
    ),
}


@dataclass(frozen=True)
class Built:
    """A source that was built both ways."""

    case: Case
    report: BuildReport
    whole: Path
    lazy: Path

    def about(self) -> list[dict[str, Any]]:
        """The rows without their pictures."""
        names = [
            name
            for name in pq.read_schema(self.whole / "data" / "train-00000.parquet").names
            if name != PIXELS
        ]
        return pq.read_table(self.whole / "data", columns=names).to_pylist()


@pytest.fixture(scope="module", params=list(CASES))
def built_case(
    request: Any, shared_data: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Built]:
    case, folder = CASES[request.param], tmp_path_factory.mktemp(request.param)
    (folder / "source").mkdir()
    source = case.make(shared_data, folder / "source")
    report = build(source, folder / "whole", corruptions="all", seed=1, **case.options)
    lazy = build(source, folder / "lazy", corruptions="all", seed=1, output="lazy", **case.options)
    assert (lazy.rows, lazy.not_applicable) == (report.rows, report.not_applicable)
    yield Built(case, report, folder / "whole", folder / "lazy")
    shutil.rmtree(folder)


def test_every_format_has_a_case() -> None:
    # Of `images`, which says nothing but the picture, see test_readers_images; of the sets that are
    # asked for by name, test_readers_grounding. The others show pages, phones and desktops as some
    # format above does.
    apart = {"images", "screenspot_v2", "screenspot_pro", "osworld_g"}
    apart |= {"aitz", "atif", "browser_use", "guiact", "lerobot"}
    assert {case.reader for case in CASES.values()} == set(names()) - apart
    assert set(PICTURE + MACHINE) == set(hj.corruption_names())


def test_each_corruption_has_rows_or_a_reason(built_case: Built) -> None:
    case, report = built_case.case, built_case.report
    manifest = json.loads((built_case.whole / "manifest.json").read_text())
    assert manifest["parameters"]["reader"] == case.reader
    assert manifest["source"]["steps"] == case.steps
    assert (
        report.rejected,
        (built_case.whole / "quarantine.jsonl").read_text(),
        report.dropped,
    ) == (0, "", {})
    assert report.not_applicable == case.lacks
    entries: dict[str, Counter[str]] = {}
    for row in built_case.about():
        entries.setdefault(row["corruption"], Counter())[row["fidelity"]] += 1
    assert entries == {
        **{label: {"exact": case.steps} for label in ("clean", *PICTURE)},
        **case.shown,
    }
    assert all(label in case.shown or case.lacks[label] for label in MACHINE)


def test_stats_counts_the_same(built_case: Built) -> None:
    data = stats(built_case.whole).to_data()
    counts = Counter(row["corruption"] for row in built_case.about())
    assert {label: value["rows"] for label, value in data["corruptions"].items()} == dict(
        built_case.report.rows
    )
    assert +Counter(built_case.report.rows) == counts
    assert data["rows"] == counts.total() == len(open_dataset(built_case.lazy))
    assert (data["not_applicable"], data["dropped"], data["rejected"]) == (
        built_case.case.lacks,
        {},
        {},
    )
    for label, value in data["corruptions"].items():
        assert value["inserted"] == (value["rows"] if label in INSERTED else 0)
        assert value["reminders"] == (value["rows"] if label in REPLACED else 0)
    output = CliRunner().invoke(hijack, ["stats", str(built_case.lazy), "--json"])
    assert output.exit_code == 0, output.output
    result = json.loads(output.output)
    assert (result["corruptions"], result["not_applicable"]) == (
        data["corruptions"],
        data["not_applicable"],
    )


def test_labels_lie_where_they_must(built_case: Built) -> None:
    clean: dict[str, Any] = {}
    clicks: list[tuple[int, int]] = []
    for row in open_dataset(built_case.whole):
        check_inside(row)
        if row["corruption"] == "clean":
            clean = row
            clicks += (
                [(row["action"]["x"], row["action"]["y"])]
                if row["action"]["type"] == "click"
                else []
            )
        elif row["corruption"] in PICTURE:
            check_scaled(row, clean)
        elif row["corruption"] == "multi_apps":
            check_beside(row, clean)
        elif row["inserted"]:
            check_inserted(row, clean)
        else:
            check_replaced(row, clean)
    if built_case.case.points is not None:
        assert tuple(clicks) == built_case.case.points


def test_lazy_and_materialised_are_equal_and_verified(built_case: Built) -> None:
    total = sum(built_case.report.rows.values())
    assert assert_same_rows(open_dataset(built_case.whole), open_dataset(built_case.lazy)) == total
    for folder in (built_case.whole, built_case.lazy):
        result = verify(folder)
        assert (result.problems, result.notes, result.rows) == ([], [], total)
        assert result.regenerated == total - built_case.case.steps


def test_datasets_loads_it(
    built_case: Built, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole_rows = load(built_case.whole, tmp_path / "cache", monkeypatch)
    lazy = load(built_case.lazy, tmp_path / "cache", monkeypatch).with_transform(render)
    assert whole_rows["id"] == lazy["id"] == [row["id"] for row in built_case.about()]
    assert Counter(whole_rows["corruption"]) == +Counter(built_case.report.rows)
    last = len(whole_rows) - 1
    assert np.array_equal(pixels(whole_rows[last]), pixels(lazy[last]))
    assert whole_rows[last]["action"] == lazy[last]["action"]


def test_chat_rows_say_the_labels(built_case: Built, tmp_path: Path) -> None:
    report = export(built_case.whole, tmp_path / "out", to="chat")
    lines = (tmp_path / "out" / "train.jsonl").read_text().splitlines()
    assert report.total == len(lines)
    rows = {row["id"]: row for row in built_case.about()}
    assert report.total + report.hidden.total() + report.unsaid.total() == len(rows)  # type: ignore[union-attr]
    kinds = {reason.partition(":")[0] for reason in report.unsaid}  # type: ignore[union-attr]
    assert kinds <= ({"other", "scroll"} if built_case.case.reader == "webvoyager" else {"other"})
    for line in map(json.loads, lines):
        row = rows[line["id"]]
        output, action = (
            parse_pyautogui(line["messages"][1]["content"], (row["height"], row["width"])),
            row["action"],
        )
        assert (output.type, output.x, output.y, output.x2, output.y2) == tuple(
            action[k] for k in ("type", "x", "y", "x2", "y2")
        )
        with Image.open(tmp_path / "out" / line["images"][0]) as picture:
            assert picture.size == (row["width"], row["height"])


# What a recording says of itself, and what its actions are.

OF_PHONES: Reasons = {**{label: {PHONE: 3} for label in MACHINE}, "network_error": {NO_BROWSER: 3}}
OF_PAGES: Reasons = {label: {PAGE: 3} for label in MACHINE if label != "network_error"}
OF_DESKTOPS: Reasons = {
    "accidental_touch": {MAYBE_OPEN: 3},
    "app_minimization": {NO_WINDOW: 3},
    "network_error": {NO_BROWSER: 3},
}


@pytest.mark.parametrize(
    ("maker", "more", "lacks"),
    [
        ("boxes", {"data_source": "ios"}, OF_PHONES),
        ("boxes", {"data_source": "shop"}, OF_PAGES),
        ("boxes", {"data_source": "windows"}, OF_DESKTOPS),
        ("chat_calls", {"metadata": '{"platform": "mobile", "others": {}}'}, OF_PHONES),
        ("chat_calls", {"metadata": {"platform": "web"}}, OF_PAGES),
        ("chat_calls", {"metadata": {"platform": "desktop"}}, OF_DESKTOPS),
        ("chat_calls", {"metadata": "{"}, OF_DESKTOPS),
    ],
)
def test_phones_and_pages_are_no_desktops(
    maker: str, more: dict[str, Any], lacks: Reasons, shared_data: Path, tmp_path: Path
) -> None:
    """A window of a desktop is never pasted on a phone, nor on a page that has no screen around
    it."""
    (file,) = TABLES[maker](tmp_path / "source", shots=session(shared_data)).glob("*.parquet")
    rows = [{**row, **more} for row in pq.read_table(file).to_pylist()]
    write_table(file, rows if maker == "boxes" else [{**rows[0], "id": name} for name in "abc"])
    options: dict[str, Any] = {
        "corruptions": ",".join(MACHINE),
        "clean": False,
        "output": "lazy",
        **FOREIGN,
    }
    report = build(tmp_path / "source", tmp_path / "out", **options)
    short = INSERTED if maker == "boxes" else ()
    assert report.not_applicable == {**lacks, **{label: {NEVER: 3} for label in short}}
    assert {label for label, count in report.rows.items() if count} == set(
        MACHINE
    ) - lacks.keys() - set(short)


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("pyautogui.dragTo(900, 300)", ""),
        ("pyautogui.moveTo(620, 100); pyautogui.dragTo(60, 150)", ""),
        ("pyautogui.moveTo(100, 600); pyautogui.dragTo(1200, 60)", NO_ROOM),
        ("WAIT", ""),
        *[
            (f"pyautogui.{name}()", NO_PLACE)
            for name in ("click", "rightClick", "doubleClick", "mouseDown", "mouseUp")
        ],
    ],
)
def test_a_window_takes_no_part_of_an_action(
    code: str, reason: str, shared_data: Path, tmp_path: Path
) -> None:
    """Both ends of a drag and what is between stay as they were; a click that names no place goes
    to the pointer."""
    picture = {"bytes": session(shared_data).picture(0), "path": None}
    row = {"task_id": "t", "instruction": "do it", "actions": [code], "screenshots": [picture]}
    write_table(tmp_path / "source" / "a.parquet", [row])
    report = build(tmp_path / "source", tmp_path / "out", corruptions="multi_apps", **FOREIGN)
    assert report.not_applicable == ({"multi_apps": {reason: 1}} if reason else {})
    clean, *remaining = open_dataset(tmp_path / "out")
    assert len(remaining) == (not reason)
    for row in remaining:
        if ends(row["action"]):
            check_beside(row, clean)


def test_a_table_is_built_alike_by_one_worker_and_by_two(shared_data: Path, tmp_path: Path) -> None:
    """Pictures inside a table are read by whoever makes the shard."""
    folder = parquet(tmp_path / "source", shots=session(shared_data))
    (file,) = (folder / "data").iterdir()
    (row,) = pq.read_table(file).to_pylist()
    write_table(file, [{**row, "task_id": name} for name in "ab"])
    files = []
    for workers in (1, 2):
        out = tmp_path / f"out{workers}"
        options: dict[str, Any] = {
            "workers": workers,
            "rows_per_shard": 25,
            "output": "lazy",
            **UNKNOWN,
        }
        build(folder, out, corruptions=",".join(MACHINE), **options)
        files.append({path.name: path.read_bytes() for path in (out / "data").iterdir()})
    assert len(files[0]) == 2
    assert files[0] == files[1]
