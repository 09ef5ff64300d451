"""Exports: the rows, in the form that trainers read, without a label on a hidden target."""

import io
import json
import subprocess
import sys
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from PIL import Image

import hijack_data as hj
from hijack_data.cli import hijack
from hijack_data.errors import UnknownNameError
from pipelines import build, open_dataset
from pipelines.errors import BuildError, DatasetError
from pipelines.exports import FORMATS, ExportReport, export, push_to_hub
from pipelines.exports.webdataset import typed_row

from support.dataset_files import file_contents

PLANNERS: dict[str, Any] = {
    "cover": hj.PopUps(width=320, height=200, avoid_elements=False),
    "half": hj.Resolution(),
    "marks": hj.Marks(number=4, mark_size=8),
}
ROOT = Path(__file__).resolve().parents[2]


def make(source: Path, out: Path, **options: Any) -> Path:
    build(source, out, corruptions=PLANNERS, rows_per_shard=8, **options)
    return out


@pytest.fixture
def source(recording: Any, add_line: Any, good_line: Any) -> Path:
    folder = recording(trajectories=3, steps=2)
    picture = {"image": "images/t0-0.png", "action_code": ""}
    hidden = {"action": {"type": "click", "x": 310, "y": 190}, "target_box": [300, 180, 320, 200]}
    add_line(folder, good_line("u", 0, **picture, **hidden, instruction="find the <image> tag"))
    add_line(folder, good_line("v", 0, **picture, action={"type": "other"}, target_box=None))
    add_line(
        folder,
        good_line("w", 0, **picture, action={"type": "type", "text": "<image>"}, target_box=None),
    )
    return folder


@pytest.fixture(params=["materialised", "lazy"])
def dataset(request: Any, source: Path, tmp_path: Path) -> Path:
    return make(source, tmp_path / "set", output=request.param)


@pytest.mark.parametrize("to", ["chat", "verl", "webdataset", "atif", "onlooker"])
def test_a_dataset_with_splits_is_exported_one_split_at_a_time(
    to: str, recording: Any, tmp_path: Path
) -> None:
    planners = {"marks": hj.Marks(number=4, mark_size=8)}
    folder = tmp_path / "set"
    splits = {"train": 0.5, "test": 0.5}
    build(recording(trajectories=12, steps=1), folder, corruptions=planners, splits=splits)
    with pytest.raises(DatasetError, match=r"the splits train, test.*--split train"):
        export(folder, tmp_path / "all", to=to)
    assert not (tmp_path / "all").exists()
    with pytest.raises(DatasetError, match="no rows of a split 'tset'; it has train, test"):
        export(folder, tmp_path / "all", to=to, split="tset")
    if to == "onlooker":
        return  # nothing in this dataset is an event
    report = export(folder, tmp_path / "out", to=to, split="test", keep_hidden=True)
    assert isinstance(report, ExportReport)
    assert report.total == len(open_dataset(folder, "test"))
    assert json.loads((tmp_path / "out" / "export.json").read_text())["split"] == "test"
    if to == "verl":
        table = pq.read_table(tmp_path / "out" / "data")
        assert {row["split"] for row in table["extra_info"].to_pylist()} == {"test"}


def expected(dataset: Path) -> list[dict[str, Any]]:
    """The rows that may be exported: the target shows, and the action can be said."""
    rows = [
        row
        for row in open_dataset(dataset)
        if row["target_visible"] is None or row["target_visible"] >= 0.5
    ]
    return [row for row in rows if row["trajectory_id"] not in ("v", "w")]


def pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)))


def test_chat(dataset: Path, tmp_path: Path) -> None:
    report = export(dataset, tmp_path / "out", to="chat")
    lines = [
        json.loads(line) for line in (tmp_path / "out" / "train.jsonl").read_text().splitlines()
    ]
    rows = expected(dataset)
    assert report.total == len(lines) == len(rows) == 4 * 7 - 1
    assert dict(report.hidden) == {"cover": 1}
    assert sum(report.unsaid.values()) == 8
    assert any("<image>" in reason for reason in report.unsaid)
    for line, row in zip(lines, rows, strict=True):
        (name,) = line["images"]
        user, assistant = line["messages"]
        assert (user["role"], assistant["role"]) == ("user", "assistant")
        assert [message["content"].count("<image>") for message in line["messages"]] == [1, 0]
        assert row["instruction"].replace("<image>", "< image>") in user["content"]
        x, y = row["action"]["x"], row["action"]["y"]
        assert assistant["content"] == f"pyautogui.click({x}, {y})"
        assert np.array_equal(
            pixels((tmp_path / "out" / name).read_bytes()), np.asarray(row["screenshot"])
        )
        assert (line["id"], line["corruption"]) == (row["id"], row["corruption"])
    info = json.loads((tmp_path / "out" / "dataset_info.json").read_text())["agenthijack"]
    assert (tmp_path / "out" / info["file_name"]).is_file()
    assert {info["tags"]["role_tag"], info["tags"]["content_tag"]} == {"role", "content"}


def test_chat_rows_load(dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    datasets.disable_progress_bars()
    out = tmp_path / "out"
    export(dataset, out, to="chat")
    # as LLaMA-Factory does: the file, the columns and the tags are those of dataset_info.json
    info = json.loads((out / "dataset_info.json").read_text())["agenthijack"]
    columns, tags = info["columns"], info["tags"]
    assert info["formatting"] == "sharegpt"
    file = str(out / info["file_name"])
    dataset_rows = datasets.load_dataset(
        "json", data_files=file, split="train", cache_dir=str(tmp_path / "cache")
    )
    assert len(dataset_rows) == 27
    for row in dataset_rows:
        pictures, messages = row[columns["images"]], row[columns["messages"]]
        output = "".join(message[tags["content_tag"]] for message in messages)
        roles = [message[tags["role_tag"]] for message in messages]
        assert roles == [tags["user_tag"], tags["assistant_tag"]]
        assert output.count("<image>") == len(pictures)
        assert all((out / name).is_file() for name in pictures)


def test_verl(dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The columns of verl's own preprocessing examples, read as its dataset reads them."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    datasets.disable_progress_bars()
    report = export(dataset, tmp_path / "out", to="verl")
    files = sorted(str(file) for file in (tmp_path / "out" / "data").iterdir())
    assert len(files) == 5
    assert pq.read_table(files[4]).num_rows == 0  # every row of the last step is left out
    dataset_rows = datasets.load_dataset(
        "parquet", data_files=files, cache_dir=str(tmp_path / "cache")
    )["train"]
    rows = expected(dataset)
    assert len(dataset_rows) == len(rows) == report.total
    assert dataset_rows.column_names == [
        "data_source",
        "prompt",
        "images",
        "ability",
        "reward_model",
        "extra_info",
    ]
    raw = pq.read_table(files[0]).to_pylist()[0]
    assert raw["images"][0]["bytes"].startswith(b"\x89PNG")
    for index, (example, row) in enumerate(zip(dataset_rows, rows, strict=True)):
        (message,) = example["prompt"]
        assert message["role"] == "user"
        assert message["content"].count("<image>") == len(example["images"]) == 1
        assert np.array_equal(np.asarray(example["images"][0]), np.asarray(row["screenshot"]))
        truth = json.loads(example["reward_model"]["ground_truth"])
        assert example["reward_model"]["style"] == "rule"
        assert (truth["action"], truth["target_box"]) == (row["action"], row["target_box"])
        assert truth["answer"] == example["extra_info"]["answer"]
        assert (example["extra_info"]["index"], example["extra_info"]["split"]) == (index, "train")
        assert example["extra_info"]["question"] == row["instruction"]


def test_webdataset(dataset: Path, tmp_path: Path) -> None:
    export(dataset, tmp_path / "out", to="webdataset")
    files = sorted((tmp_path / "out").glob("*.tar"))
    assert len(files) == 4  # no file for a shard without examples
    items: list[tuple[str, str, bytes]] = []
    for file in files:
        with tarfile.open(file) as tar:
            for info in tar:
                assert (info.mtime, info.uid, info.gid, info.uname, info.gname, info.mode) == (
                    0,
                    0,
                    0,
                    "",
                    "",
                    0o644,
                )
                key, _, kind = info.name.partition(".")
                items.append((key, kind, tar.extractfile(info).read()))  # type: ignore[union-attr]
    assert len({key for key, _, _ in items}) == len(items) // 3
    rows = expected(dataset)
    for index, row in enumerate(rows):
        (key, *_), *_ = group = items[3 * index : 3 * index + 3]
        assert [(k, kind) for k, kind, _ in group] == [(key, "png"), (key, "json"), (key, "txt")]
        assert np.array_equal(pixels(group[0][2]), np.asarray(row["screenshot"]))
        about = json.loads(group[1][2])
        assert about["answer"] == group[2][2].decode()
        assert {name: about[name] for name in row if name != "screenshot"} == typed_row(
            {name: value for name, value in row.items() if name != "screenshot"}
        )
        assert json.loads(about["action"]) == row["action"]


def test_webdataset_streams_through_datasets(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    export(dataset, tmp_path / "out", to="webdataset")
    files = sorted(str(file) for file in (tmp_path / "out").glob("train-0000[0-3].tar"))
    dataset_rows = list(
        datasets.load_dataset("webdataset", data_files=files, split="train", streaming=True)
    )
    assert len(dataset_rows) == 27
    assert dataset_rows[0]["json"]["id"] == "t0/0000/clean"
    assert dataset_rows[0]["png"].size == (320, 200)


ACTIONS: list[dict[str, Any]] = [
    *[{"type": "hotkey", "keys": ["ctrl", "s"]}] * 6,
    {"type": "wait", "amount": 1.5},
    {"type": "type", "text": "a"},
    {"type": "scroll", "x": 5, "y": 5, "amount": -3},
    {"type": "drag", "x": 5, "y": 5, "x2": 50, "y2": 60},
    {"type": "click", "x": 100, "y": 50},
    {"type": "done"},
]


@pytest.mark.parametrize("backwards", [False, True])
def test_webdataset_loads_whatever_the_order_of_the_rows(
    backwards: bool,
    recording: Any,
    add_line: Any,
    good_line: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`datasets` takes the types from the first examples, which may hold no point, no target and no
    event; the seed is one that needs 64 bits."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    datasets.disable_progress_bars()
    folder = recording(trajectories=1, steps=1)
    (folder / "trajectories.jsonl").write_text("")
    for step, action in enumerate(ACTIONS[::-1] if backwards else ACTIONS):
        target = [90, 40, 130, 60] if action["type"] == "click" else None
        more = {"action": action, "target_box": target, "apps": ["chrome"], "note": step}
        add_line(folder, good_line("t", step, image="images/t0-0.png", **more))
    seed = 2**64 - 1
    build(folder, tmp_path / "set", corruptions="verification,marks", seed=seed, assets=None)
    report = export(tmp_path / "set", tmp_path / "out", to="webdataset")
    cache = str(tmp_path / "cache")
    by_name = datasets.load_dataset(
        "webdataset", data_files=str(tmp_path / "out" / "*.tar"), split="train", cache_dir=cache
    )
    by_folder = datasets.load_dataset(str(tmp_path / "out"), split="train", cache_dir=cache)
    assert len(by_name) == len(by_folder) == report.total > len(ACTIONS)
    rows = {row["id"]: row for row in open_dataset(tmp_path / "set")}
    for example in by_name:
        about, row = example["json"], rows[example["json"]["id"]]
        assert json.loads(about["action"]) == row["action"]
        assert (json.loads(about["target_box"]), json.loads(about["seed"])) == (
            row["target_box"],
            seed,
        )
        assert (about["event"], about["reminder"]) == (row["event"] or "", row["reminder"] or "")
        assert example["txt"] == about["answer"]


# the library leaves its files open
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_webdataset_opens_it(dataset: Path, tmp_path: Path) -> None:
    webdataset = pytest.importorskip("webdataset", reason="pip install webdataset")
    report = export(dataset, tmp_path / "out", to="webdataset")
    files = sorted(str(file) for file in (tmp_path / "out").glob("*.tar"))
    items = list(webdataset.WebDataset(files, shardshuffle=False).decode("pil"))
    assert len(items) == report.total
    assert all(example["txt"] == example["json"]["answer"] for example in items)


@pytest.mark.parametrize("to", list(FORMATS))
def test_the_same_rows_give_the_same_bytes(to: str, source: Path, tmp_path: Path) -> None:
    for name, output in (("a", "materialised"), ("b", "lazy")):
        make(source, tmp_path / f"set-{name}", output=output)
        export(tmp_path / f"set-{name}", tmp_path / name, to=to)
    export(tmp_path / "set-a", tmp_path / "c", to=to)
    a, b, c = (file_contents(tmp_path / name) for name in "abc")
    assert a == c
    del a["export.json"], b["export.json"]  # names the dataset by its bytes, which differ
    assert a == b


def test_hidden_targets_only_when_asked_for(dataset: Path, tmp_path: Path) -> None:
    report = export(dataset, tmp_path / "out", to="chat", keep_hidden=True)
    assert (report.total, dict(report.hidden)) == (28, {})
    about = json.loads((tmp_path / "out" / "export.json").read_text())
    assert (about["keep_hidden"], about["total"], about["dialect"]) == (True, 28, "pyautogui")


def test_what_is_refused(dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("x")
    (tmp_path / "file").write_text("x")
    for out in (
        tmp_path / "full",
        tmp_path / "file",
        tmp_path / "file" / "x",
        Path("a\0b"),
        Path("/proc/x"),
    ):
        with pytest.raises(BuildError, match=r"in the way|cannot be written"):
            export(dataset, out, to="chat")
    with pytest.raises(BuildError, match="lies in the dataset"):
        export(dataset, dataset / "out", to="chat")
    with pytest.raises(UnknownNameError, match="did you mean 'chat'"):
        export(dataset, tmp_path / "out", to="chatt")
    with pytest.raises(UnknownNameError, match="did you mean 'ui_tars'"):
        export(dataset, tmp_path / "out", to="chat", dialect="uitars")
    with pytest.raises(DatasetError, match="not a dataset"):
        export(tmp_path / "full", tmp_path / "out", to="chat")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "full", "set", "source"]


def test_a_damaged_row_leaves_nothing_behind(dataset: Path, tmp_path: Path) -> None:
    (dataset / "data" / "train-00002.parquet").write_bytes(b"PAR1")
    with pytest.raises(DatasetError, match="train-00002"):
        export(dataset, tmp_path / "out", to="chat")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["set", "source"]


KILLED = """
import os, sys
from pipelines.exports import export

def die(done, total, text):
    if done > 12:
        os.kill(os.getpid(), 9)

export(sys.argv[1], sys.argv[2], to="chat", progress=die)
"""


def test_an_export_that_was_killed_is_done_again(source: Path, tmp_path: Path) -> None:
    dataset = make(source, tmp_path / "set")
    process = subprocess.run(
        [sys.executable, "-c", KILLED, str(dataset), str(tmp_path / "out")], cwd=ROOT, check=False
    )
    assert process.returncode == -9
    assert not (tmp_path / "out").exists()
    assert (tmp_path / ".out.exporting" / "train.jsonl").exists()
    (tmp_path / "out").mkdir()  # an empty folder is as good as none
    export(dataset, tmp_path / "out", to="chat")
    export(dataset, tmp_path / "whole", to="chat")
    assert file_contents(tmp_path / "out") == file_contents(tmp_path / "whole")
    assert not (tmp_path / ".out.exporting").exists()


def test_two_exports_to_one_folder(source: Path, tmp_path: Path) -> None:
    dataset = make(source, tmp_path / "set")
    refused: list[int] = []

    def second(*_: Any) -> None:
        with pytest.raises(BuildError, match="another export"):
            export(dataset, tmp_path / "out", to="chat")
        refused.append(1)

    export(dataset, tmp_path / "out", to="chat", progress=second)
    assert refused
    assert (tmp_path / "out" / "train.jsonl").exists()


def test_the_command(dataset: Path, tmp_path: Path) -> None:
    arguments = [
        "export",
        str(dataset),
        "--to",
        "verl",
        "--out",
        str(tmp_path / "out"),
        "--dialect",
        "ui_tars",
    ]
    run = CliRunner().invoke(hijack, arguments)
    assert run.exit_code == 0, run.output
    assert "27 examples (verl, actions in ui_tars)" in run.output
    assert "cover: 1 left out, their target is hidden" in run.output
    data = json.loads(
        CliRunner().invoke(hijack, [*arguments[:-3], str(tmp_path / "two"), "--json"]).output
    )
    assert (data["to"], data["total"]) == ("verl", 27)


def test_a_report_without_examples_is_a_failure() -> None:
    assert ExportReport("out", "chat", "pyautogui").exit_code == 1


class Hub:
    """Takes down what the real client would be asked."""

    def __init__(self, **options: Any) -> None:
        self.calls: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = [("init", (), options)]
        Hub.last = self

    def create_repo(self, *args: Any, **options: Any) -> None:
        self.calls.append(("create", args, options))

    def upload_folder(self, **options: Any) -> Any:
        self.calls.append(("upload", (), options))
        return type("Done", (), {"commit_url": "https://hub.example/commit/1"})()


def test_push_to_hub_passes_on_what_it_is_told(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hub = pytest.importorskip("huggingface_hub")
    dataset = make(source, tmp_path / "set")
    monkeypatch.setattr(hub, "HfApi", Hub)
    url = push_to_hub(dataset, "me/set", token="t", revision="r", endpoint="http://e", message="m")
    assert url == "https://hub.example/commit/1"
    init, create, upload = Hub.last.calls
    assert init[2] == {"endpoint": "http://e", "token": "t"}
    assert create[1:] == (("me/set",), {"repo_type": "dataset", "private": True, "exist_ok": True})
    assert upload[2]["folder_path"] == str(dataset)
    assert (upload[2]["repo_id"], upload[2]["revision"], upload[2]["commit_message"]) == (
        "me/set",
        "r",
        "m",
    )
    with pytest.raises(DatasetError, match="not a dataset"):
        push_to_hub(tmp_path, "me/set")


def test_a_hub_that_cannot_be_reached(source: Path, tmp_path: Path) -> None:
    pytest.importorskip("huggingface_hub")
    dataset = make(source, tmp_path / "set")
    with pytest.raises(BuildError, match="me/set: not uploaded"):
        push_to_hub(dataset, "me/set", token="hf_x", endpoint="http://127.0.0.1:9")


TOKENS = [
    "<|im_end|>",
    "<|im_start|>",
    "<|image_pad|>",
    "<|vision_start|>",
    "<|endoftext|>",
    "<|eot_id|>",
    "<image>",
    "</s>",
    "<start_of_turn>",
    "<end_of_turn>",
    "<IMG_CONTEXT>",
    "[INST]",
    "[/INST]",
]


@pytest.mark.parametrize("to", ["chat", "verl", "webdataset"])
def test_no_special_token_of_a_chat_model_gets_through(
    to: str, recording: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=1, steps=1)
    picture = {"image": "images/t0-0.png", "action_code": "", "target_box": None}
    for number, token in enumerate(TOKENS):
        add_line(folder, good_line(f"ask{number}", 0, **picture, instruction=f"a{token}b if x < y"))
        typed = {"type": "type", "text": f"a{token}"}
        add_line(folder, good_line(f"type{number}", 0, **picture, action=typed))
    build(folder, tmp_path / "set", corruptions={}, clean=True)
    report = export(tmp_path / "set", tmp_path / "out", to=to)
    assert report.total == 1 + len(TOKENS)
    assert sum(report.unsaid.values()) == len(TOKENS)
    assert {token for token in TOKENS if any(token in reason for reason in report.unsaid)} == set(
        TOKENS
    )
    if to == "chat":
        text = (tmp_path / "out" / "train.jsonl").read_text()
        assert text.count("<image>") == report.total
        assert not [token for token in TOKENS if token != "<image>" and token in text]
        assert "b if x < y" in text
    if to == "verl":
        rows = pq.read_table(tmp_path / "out" / "data").to_pylist()
        texts = [row["prompt"][0]["content"] for row in rows]
        assert not [token for token in TOKENS[:5] for text in texts if token in text]


@pytest.mark.parametrize("to", ["chat", "verl", "webdataset"])
def test_rows_without_a_task_are_left_out_and_counted(to: str, tmp_path: Path) -> None:
    from support.formats import osworld

    osworld(tmp_path / "source")
    for file in (tmp_path / "source" / "examples").rglob("*.json"):
        file.unlink()
    build(tmp_path / "source", tmp_path / "set", corruptions={}, clean=True)
    report = export(tmp_path / "set", tmp_path / "out", to=to)
    assert (report.total, dict(report.untold)) == (0, {"the instruction is empty": 2})
    assert any("instruction is empty" in line for line in report.lines())
