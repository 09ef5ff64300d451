"""What an onlooker learns from: reminders in balance, summaries that say no more than is known,
recovery steps."""

import io
import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from PIL import Image

import hijack_data as hj
from hijack_data.cli import hijack
from hijack_data.errors import ParameterError, ParameterTypeError
from pipelines import build, open_dataset
from pipelines.errors import BuildError, DatasetError
from pipelines.exports import export
from pipelines.exports.onlooker.messages import NOT_THE_AGENT
from pipelines.exports.onlooker.sampling import WITH_REMINDER
from pipelines.exports.onlooker.screen_change import TOLERANCE
from pipelines.exports.onlooker.step_frames import RowFrame, frames_by_step

from support.dataset_files import file_contents

TABLES = ("reminders", "summaries", "recovery")
ROOT = Path(__file__).resolve().parents[2]
PLANNERS: dict[str, Any] = {
    "marks": hj.Marks(number=4, mark_size=8),
    "half": hj.Resolution(scale=0.5),
    "touch": hj.AccidentalTouch(),
    "minimise": hj.AppMinimization(),
    "network": hj.NetworkError(),
    "lock": hj.Verification(),
}


@pytest.fixture
def source(recording: Any) -> Path:
    return in_browser(recording(trajectories=3, steps=5))


def in_browser(folder: Path, **more: Any) -> Path:
    """Say that a browser was used; `more` gives columns by functions of the record."""
    file = folder / "trajectories.jsonl"
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    lines = [
        {**row, "apps": ["chrome"], **{name: make(row) for name, make in more.items()}}
        for row in rows
    ]
    file.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return folder


def build_and_export(
    source: Path, assets: Path, out: Path, corruptions: Any = None, **options: Any
) -> Path:
    build(
        source,
        out,
        corruptions=corruptions or PLANNERS,
        assets=assets,
        rows_per_shard=60,
        seed=3,
        **options,
    )
    return out


@pytest.fixture
def dataset(source: Path, assets: Path, tmp_path: Path) -> Path:
    return build_and_export(source, assets, tmp_path / "set")


def table(folder: Path, name: str) -> list[dict[str, Any]]:
    files = sorted((folder / name).glob("*.parquet"))
    return [row for file in files for row in pq.ParquetFile(file).read().to_pylist()]


def by_id(dataset: Path) -> dict[str, dict[str, Any]]:
    return {row["id"]: row for row in open_dataset(dataset)}


def same(stored: dict[str, Any], row: dict[str, Any]) -> bool:
    return np.array_equal(
        np.asarray(Image.open(io.BytesIO(stored["bytes"]))), np.asarray(row["screenshot"])
    )


def conversation(row: dict[str, Any], pictures: int) -> tuple[str, str]:
    """What is asked and answered, with as many places for pictures as there are pictures."""
    user, assistant = row["messages"]
    assert (user["role"], assistant["role"]) == ("user", "assistant")
    assert [message["content"].count("<image>") for message in row["messages"]] == [pictures, 0]
    assert f"Task: {row['instruction']}\n" in user["content"]
    return user["content"], assistant["content"]


@pytest.mark.parametrize("output", ["materialised", "lazy"])
def test_reminders(source: Path, assets: Path, tmp_path: Path, output: str) -> None:
    dataset = build_and_export(source, assets, tmp_path / "set", output=output)
    report = export(dataset, tmp_path / "out", to="onlooker")
    rows, original = table(tmp_path / "out", "reminders"), by_id(dataset)
    needed = [row["id"] for row in original.values() if row["reminder"]]
    assert len(needed) == 6
    assert [row["id"] for row in rows if row["kind"] == WITH_REMINDER] == needed
    assert len(rows) == len({row["id"] for row in rows}) == 12
    for row in rows:
        assert row["reminder"] == (original[row["id"]]["reminder"] or "None")
        assert (row["kind"] == WITH_REMINDER) == (row["reminder"] != "None")
        assert row["corruption"] == original[row["id"]]["corruption"]
        assert same(row["screenshot"], original[row["id"]])
        assert conversation(row, 1)[1] == f"Reminder: {row['reminder']}"
        if row["kind"] in ("same_step", "clean"):
            assert (row["corruption"], row["step"] == 0) == ("clean", row["kind"] == "same_step")
        if row["kind"] == "picture":
            assert row["corruption"] in ("marks", "half")
        if row["kind"] == "event":
            assert row["corruption"] in ("touch", "minimise")
    for name in ("t0", "t1", "t2"):  # each trajectory is in balance by itself
        kinds = [row["kind"] for row in rows if row["trajectory_id"] == name]
        assert (len(kinds), kinds.count(WITH_REMINDER)) == (4, 2)
    assert dict(report.reminders) == {"network": 3, "lock": 3}
    assert report.none == Counter(row["kind"] for row in rows if row["kind"] != WITH_REMINDER)


@pytest.mark.parametrize(
    ("balance", "without", "short"), [(0, 0, 0), (0.5, 3, 0), (3, 18, 0), (1000, 51, 5949)]
)
def test_balance(dataset: Path, tmp_path: Path, balance: float, without: int, short: int) -> None:
    """All that have none are 3 trajectories of 5 steps clean and under two corruptions, and 6
    inserted ones."""
    report = export(dataset, tmp_path / "out", to="onlooker", balance=balance)
    rows = table(tmp_path / "out", "reminders")
    assert Counter(row["reminder"] == "None" for row in rows) == Counter({False: 6, True: without})
    assert (sum(report.none.values()), report.short) == (without, short)
    assert any("more frames without" in line for line in report.lines()) == bool(short)
    if without == 51:
        assert dict(report.none) == {"same_step": 3, "clean": 12, "picture": 30, "event": 6}


@pytest.mark.parametrize(
    ("balance", "error"),
    [
        (-0.1, ParameterError),
        (1001, ParameterError),
        (float("nan"), ParameterError),
        (10**5000, ParameterError),
        (True, ParameterTypeError),
        ("1", ParameterTypeError),
    ],
    ids=["low", "high", "nan", "giant", "bool", "text"],
)
def test_a_balance_that_cannot_be(
    dataset: Path, tmp_path: Path, balance: Any, error: type[Exception]
) -> None:
    with pytest.raises(error, match="balance must be"):
        export(dataset, tmp_path / "out", to="onlooker", balance=balance)


@pytest.mark.parametrize("output", ["materialised", "lazy"])
def test_summaries(source: Path, assets: Path, tmp_path: Path, output: str) -> None:
    dataset = build_and_export(source, assets, tmp_path / "set", output=output)
    report = export(dataset, tmp_path / "out", to="onlooker")
    rows, original = table(tmp_path / "out", "summaries"), by_id(dataset)
    expected = {
        f"t{t}/{step + 1:04d}/{label}": f"t{t}/{step:04d}/{label}"
        for t in range(3)
        for label in ("clean", "marks", "half")
        for step in range(4)
    }
    expected |= {
        f"t{t}/0003/{name}": f"t{t}/0002/clean"
        for t in range(3)
        for name in ("touch+touch", "minimise+minimise")
    }
    assert {row["id"]: row["before_id"] for row in rows} == expected
    for row in rows:
        before, after = original[row["before_id"]], original[row["id"]]
        assert same(row["before"], before)
        assert same(row["after"], after)
        assert row["action"] == before["action"]
        assert (
            row["action_text"]
            == f"pyautogui.click({before['action']['x']}, {before['action']['y']})"
        )
        assert (row["event"], row["made_by"]) == (after["event"], "template")
        requests, answered = conversation(row, 2)
        assert answered == row["summary"]
        assert f"\nAction: {row['action_text']}\n" in requests
        point_text = f"({before['action']['x']}, {before['action']['y']})"
        assert row["summary"].startswith(f"The agent clicked at {point_text}. ")
        if after["event"]:
            assert row["summary"].endswith(f". {NOT_THE_AGENT} {after['event']}")
            assert row["changed"] is None
        else:
            screens = [
                np.asarray(original[i.rpartition("/")[0] + "/clean"]["screenshot"]).astype(int)
                for i in (row["before_id"], row["id"])
            ]
            share = (abs(screens[0] - screens[1]) > TOLERANCE).any(axis=2).mean()
            # of the clean screens, not of what is drawn over them
            assert row["changed"] == pytest.approx(share)
            assert f"About {round(100 * share)} % of the screen changed" in row["summary"]
    assert dict(report.summaries) == {
        "clean": 12,
        "marks": 12,
        "half": 12,
        "touch": 3,
        "minimise": 3,
    }
    assert list(report.summaries) == ["clean", "marks", "half", "touch", "minimise"]
    assert report.skipped == Counter(
        {
            f"summary of {name}: nothing was recorded before the event": 3
            for name in ("network", "lock")
        }
    )


def test_without_clean_rows_no_change_is_claimed(
    source: Path, assets: Path, tmp_path: Path
) -> None:
    dataset = build_and_export(source, assets, tmp_path / "set", clean=False)
    report = export(dataset, tmp_path / "out", to="onlooker")
    rows = table(tmp_path / "out", "summaries")
    assert {row["corruption"] for row in rows} == {"marks", "half"}
    for row in rows:
        assert row["changed"] is None
        assert (
            row["summary"] == f"The agent clicked at ({row['action']['x']}, {row['action']['y']})."
        )
    assert (
        report.skipped[
            "summary of touch: what the agent met before the event is not in the dataset"
        ]
        == 3
    )


def test_a_step_that_is_missing_breaks_the_chain(
    recording: Any, assets: Path, tmp_path: Path
) -> None:
    """Steps 0, 1, 3, 4, 5: the screen of step 3 is not what the action of step 1 led to."""
    numbers = [0, 1, 3, 4, 5]
    source = in_browser(recording(trajectories=1, steps=5), step=lambda row: numbers[row["step"]])
    planners = {"lock": hj.Verification(), "touch": hj.AccidentalTouch(step=2)}
    report = export(
        build_and_export(source, assets, tmp_path / "set", planners),
        tmp_path / "out",
        to="onlooker",
    )
    rows = table(tmp_path / "out", "summaries")
    assert [(row["before_id"], row["id"]) for row in rows] == [
        (f"t0/000{a}/clean", f"t0/000{b}/clean") for a, b in ((0, 1), (3, 4), (4, 5))
    ]
    assert report.skipped["summary of touch: nothing was recorded before the event"] == 1


def test_events_among_the_steps_of_one_corruption(
    recording: Any, assets: Path, tmp_path: Path
) -> None:
    """The chain goes through the event, on the screens of its own corruption, and never on from a
    waiting step."""
    planners = {
        "half": hj.Sequence([hj.Resolution(), hj.AppMinimization(step=2)]),
        "locked": hj.Sequence([hj.Marks(number=3, mark_size=6), hj.Verification(step=(-1, 3))]),
    }
    source = in_browser(recording(trajectories=1, steps=5))
    export(
        build_and_export(source, assets, tmp_path / "set", planners),
        tmp_path / "out",
        to="onlooker",
    )
    entries = {row["id"].removeprefix("t0/"): row for row in table(tmp_path / "out", "summaries")}
    pairs = {
        name: row["before_id"].removeprefix("t0/")
        for name, row in entries.items()
        if "clean" not in name
    }
    assert pairs == {
        "0001/half": "0000/half",
        "0002/half+minimise": "0001/half",
        "0003/half": "0002/half",
        "0004/half": "0003/half",
        "0002/locked": "0001/locked",
        "0003/locked": "0002/locked",
    }
    assert "The session was locked" in entries["0003/locked"]["summary"]
    # the agent's own, not the wait that it calls for
    assert entries["0003/locked"]["action"]["type"] == "click"
    # in pixels of the screen that was acted on
    assert entries["0002/half+minimise"]["action"]["x"] == 50


@pytest.mark.parametrize("dialect", ["pyautogui", "ui_tars"])
def test_recovery(dataset: Path, tmp_path: Path, dialect: str) -> None:
    report = export(dataset, tmp_path / "out", to="onlooker", dialect=dialect)
    rows, original = table(tmp_path / "out", "recovery"), by_id(dataset)
    assert [row["id"] for row in rows] == [
        row["id"] for row in original.values() if row["inserted"]
    ]
    assert dict(report.recovery) == {"touch": 3, "minimise": 3}
    for row in rows:
        source = original[row["id"]]
        assert same(row["screenshot"], source)
        assert {name: row[name] for name in ("event", "action", "target_box")} == {
            name: source[name] for name in ("event", "action", "target_box")
        }
        assert conversation(row, 1)[1] == row["answer"]
        if dialect == "pyautogui":
            assert row["answer"] == source["action_code"]
        elif row["corruption"] == "minimise":
            assert row["answer"] == "click(start_box='(156,950)')"  # 0..1000 of 320 x 200
    assert any(("click(start_box=" in row["answer"]) == (dialect == "ui_tars") for row in rows)


def test_a_recovery_that_cannot_be_seen_is_no_label(
    source: Path, assets: Path, tmp_path: Path
) -> None:
    covered = hj.Sequence(
        [hj.AppMinimization(), hj.Marks(number=9000, mark_size=30, avoid_elements=False)]
    )
    planners = {"covered": covered, "lock": hj.Verification()}
    dataset = build_and_export(source, assets, tmp_path / "set", planners)
    report = export(dataset, tmp_path / "out", to="onlooker")
    assert dict(report.hidden) == {"covered": 3}
    assert not (tmp_path / "out" / "recovery").exists()
    assert (
        export(dataset, tmp_path / "all", to="onlooker", keep_hidden=True).recovery["covered"] == 3
    )


def test_actions_that_nothing_is_known_of(recording: Any, assets: Path, tmp_path: Path) -> None:
    """What was recorded is quoted; where nothing was, there is no summary."""
    codes = {
        0: "Scroll [2]; <image> down",
        1: "",
        2: "pyautogui.click(1, 2)\npyautogui.click(3, 4)",
    }
    source = in_browser(
        recording(trajectories=1, steps=4),
        action=lambda row: {"type": "other"},
        target_box=lambda row: None,
        action_code=lambda row: codes.get(row["step"], ""),
    )
    report = export(
        build_and_export(source, assets, tmp_path / "set", {"lock": hj.Verification()}),
        tmp_path / "out",
        to="onlooker",
    )
    first, second = table(tmp_path / "out", "summaries")
    assert first["summary"].startswith(
        'The agent did what was recorded as "Scroll [2]; <image> down". '
    )
    assert "Action: Scroll [2]; < image> down\n" in conversation(first, 2)[0]
    assert second["before_id"] == "t0/0002/clean"
    assert second["action_text"] == codes[2]
    assert report.skipped["summary of other: pyautogui cannot say 'other' with nothing else"] == 1


def test_one_step_is_read_at_a_time() -> None:
    taken_counts: list[int] = []

    def shots() -> Any:
        for number in range(20):
            taken_counts.append(number)
            yield RowFrame(
                {"trajectory_id": "t", "step": number // 4, "corruption": f"c{number % 4}"}, b""
            )

    steps = frames_by_step(shots())
    assert [len(next(steps).frames), len(taken_counts)] == [4, 5]
    assert [next(steps).step, len(taken_counts)] == [1, 9]


def test_lazy_and_materialised_give_the_same_bytes(
    source: Path, assets: Path, tmp_path: Path
) -> None:
    for name, output in (("a", "materialised"), ("b", "lazy")):
        export(
            build_and_export(source, assets, tmp_path / f"set-{name}", output=output),
            tmp_path / name,
            to="onlooker",
        )
    export(tmp_path / "set-a", tmp_path / "c", to="onlooker")
    a, b, c = (file_contents(tmp_path / name) for name in "abc")
    assert a == c
    assert len(a) == 3 * 3 + 1  # a file a shard, here a trajectory: no trajectory is split
    about = json.loads(a.pop("export.json"))
    assert (about["to"], about["balance"], about["total"]) == ("onlooker", 1.0, 12 + 42 + 6)
    del b["export.json"]  # names the dataset by its bytes, which differ
    assert a == b
    for name in TABLES:
        for file in sorted((tmp_path / "a" / name).iterdir()):
            assert (
                len(
                    set(pq.read_table(file, columns=["trajectory_id"])["trajectory_id"].to_pylist())
                )
                == 1
            )


def test_tables_load(dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    datasets.disable_progress_bars()
    report = export(dataset, tmp_path / "out", to="onlooker")
    sizes = {}
    for name in TABLES:
        folder = str(tmp_path / "out" / name)
        dataset_rows = datasets.load_dataset(
            folder, split="train", cache_dir=str(tmp_path / "cache")
        )
        sizes[name] = len(dataset_rows)
        picture = dataset_rows[0]["before" if name == "summaries" else "screenshot"]
        assert picture.size == (320, 200)
        assert dataset_rows[0]["messages"][1]["role"] == "assistant"
    assert sum(sizes.values()) == report.total
    assert sizes == {"reminders": 12, "summaries": 42, "recovery": 6}


def test_a_dataset_without_reminders_says_what_to_build(
    source: Path, assets: Path, tmp_path: Path
) -> None:
    dataset = build_and_export(source, assets, tmp_path / "set", {"marks": PLANNERS["marks"]})
    with pytest.raises(
        BuildError,
        match=r"no row has a reminder or an event.*--corruptions all, or with network_error",
    ):
        export(dataset, tmp_path / "out", to="onlooker")
    offline = in_browser(source, apps=lambda row: ["gimp"])
    build(offline, tmp_path / "set2", corruptions="network_error", assets=assets)
    with pytest.raises(
        BuildError, match="not applicable there: network_error: the recording names no browser"
    ):
        export(tmp_path / "set2", tmp_path / "out", to="onlooker")
    assert not (tmp_path / "out").exists()


def test_a_damaged_row_leaves_nothing_behind(dataset: Path, tmp_path: Path) -> None:
    (dataset / "data" / "train-00002.parquet").write_bytes(b"PAR1")
    with pytest.raises(DatasetError, match="train-00002"):
        export(dataset, tmp_path / "out", to="onlooker")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["set", "source"]


KILLED = """
import os, sys
from pipelines.exports import export

def die(done, total, text):
    os.kill(os.getpid(), 9)

export(sys.argv[1], sys.argv[2], to="onlooker", progress=die)
"""


def test_an_export_that_was_killed_is_done_again(dataset: Path, tmp_path: Path) -> None:
    process = subprocess.run(
        [sys.executable, "-c", KILLED, str(dataset), str(tmp_path / "out")], cwd=ROOT, check=False
    )
    assert process.returncode == -9
    assert not (tmp_path / "out").exists()
    assert (tmp_path / ".out.exporting" / "summaries").is_dir()
    for name in ("out", "whole"):
        export(dataset, tmp_path / name, to="onlooker")
    assert file_contents(tmp_path / "out") == file_contents(tmp_path / "whole")
    assert not (tmp_path / ".out.exporting").exists()


def test_the_command(dataset: Path, tmp_path: Path) -> None:
    arguments = [
        "export",
        str(dataset),
        "--to",
        "onlooker",
        "--out",
        str(tmp_path / "out"),
        "--balance",
        "2",
    ]
    run = CliRunner().invoke(hijack, arguments)
    assert run.exit_code == 0, run.output
    assert "66 examples (onlooker, actions in pyautogui)" in run.output
    assert "reminders: 6 frames with one (network 3, lock 3)" in run.output
    assert "recovery: touch 3, minimise 3" in run.output
    again = [*arguments[:5], str(tmp_path / "two"), *arguments[6:], "--json"]
    data = json.loads(CliRunner().invoke(hijack, again).output)
    assert (data["to"], data["balance"], sum(data["none"].values())) == ("onlooker", 2.0, 12)
    wrong = [
        "export",
        str(dataset),
        "--to",
        "chat",
        "--out",
        str(tmp_path / "three"),
        "--balance",
        "2",
    ]
    run = CliRunner().invoke(hijack, wrong)
    assert isinstance(run.exception, BuildError)
    assert "balance is for the format 'onlooker'" in str(run.exception)
