"""`hijack train` with method sft: exports as chats, the leak check, and TRL's SFTTrainer."""

import json

import pytest
from click.testing import CliRunner
from PIL import Image

from support import needs

pytest.importorskip("pyarrow", reason="needs the extra [hf]")

from hijack_data.errors import ConfigError, MissingDependencyError, ParameterError
from pipelines import build
from pipelines.errors import DatasetError
from pipelines.exports import export
from pipelines.train.errors import LeakError, TrainError
from pipelines.train.sft.chat_rows import check_rows, named_tasks, read_rows
from pipelines.train.sft.settings import load_sft, read_method
from pipelines.train.split import members
from pipelines.train.train_command import train

RECORDINGS = "examples/recordings"


@pytest.fixture(scope="module")
def exports(tmp_path_factory):
    """The shipped recordings as 60 chat rows, and as onlooker data."""
    folder = tmp_path_factory.mktemp("exports")
    for to, corruptions in (("chat", "marks,subtitle"), ("onlooker", "verification")):
        dataset = folder / f"{to}_dataset"
        build(RECORDINGS, str(dataset), corruptions=corruptions, seed=7, output="lazy")
        export(dataset, folder / to, to=to)
    return folder


@pytest.fixture
def chat(tmp_path):
    """A chat export of two rows; `chat(trajectory)` adds one of another trajectory."""

    def write(*trajectories):
        folder = tmp_path / "chat"
        (folder / "images").mkdir(parents=True, exist_ok=True)
        rows = []
        for number, trajectory in enumerate(("mine/1", "mine/2", *trajectories)):
            name = f"images/{number}.png"
            Image.new("RGB", (64, 64), (40 * number, 90, 120)).save(folder / name)
            question = {"role": "user", "content": f"<image>\nTask: open {number}"}
            answer = {"role": "assistant", "content": "pyautogui.click(3, 4)"}
            rows.append(
                {"messages": [question, answer], "images": [name], "trajectory_id": trajectory}
            )
        (folder / "train.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
        return folder

    return write


@pytest.fixture
def config(tmp_path, chat):
    """A configuration: `config(**changes)` writes it and returns its path."""

    def write(**changes):
        options = {
            "method": "sft",
            "model": str(tmp_path / "model"),
            "data": [str(chat())],
            "epochs": 1,
            "batch": 5,
            "accumulation": 2,
            "learning_rate": 0.003,
            "max_pixels": 4096,
            "trl": {"use_cpu": True, "bf16": False, "disable_tqdm": True},
            **changes,
        }
        path = tmp_path / "sft.yaml"
        path.write_text(json.dumps(options))  # JSON is YAML
        return path

    return write


def run(*arguments):
    return CliRunner().invoke(
        train, [str(argument) for argument in arguments], catch_exceptions=False
    )


@pytest.mark.slow
def test_both_exports_are_read(exports):
    chat = read_rows(exports / "chat")
    assert len(chat) >= 50
    example = chat[0].example()
    assert "<image>" not in example["prompt"][0]["content"]
    assert example["images"][0].size == (1920, 1080)
    assert example["completion"][0]["content"]
    watched = read_rows(exports / "onlooker")
    counts = {len(row.pictures) for row in watched}
    assert counts == {1, 2}
    assert len(watched[-1].open_images()) == len(watched[-1].pictures)
    summaries = read_rows(exports / "onlooker" / "summaries")
    assert all(len(row.open_images()) == 2 for row in summaries[:3])
    assert {row.location for row in summaries} <= {row.location for row in watched}


@pytest.mark.slow
def test_pictures_are_those_of_their_rows(exports):
    """A picture is found by its number over groups of rows."""
    import io

    import pyarrow.parquet as pq

    path = next((exports / "onlooker" / "summaries").glob("*.parquet"))
    stored = pq.read_table(path, columns=["after"]).to_pylist()
    number = len(stored) - 1
    row = read_rows(exports / "onlooker" / "summaries")[number]
    expected = Image.open(io.BytesIO(stored[number]["after"]["bytes"])).convert("RGB")
    assert row.open_images()[1].tobytes() == expected.tobytes()


@pytest.mark.parametrize(
    ("trajectory", "tasks"),
    [
        ("copy_folder-3__marks__s0__oracle", ["copy_folder"]),
        ("chrome/2ad9387a-65d8-4e33-ad5b-7580065a27ca", ["2ad9387a-65d8-4e33-ad5b-7580065a27ca"]),
        ("runs/a/chrome_2ad9387a-65d8-4e33-ad5b-7580065a27ca__clean__s0__x", 1),
        ("my recording 12", []),
    ],
)
def test_tasks_are_found_in_the_ids_of_trajectories(trajectory, tasks):
    result = named_tasks(trajectory)
    assert (len(result) if isinstance(tasks, int) else result) == tasks


def test_held_out_and_reported_tasks_are_refused(config, chat, tmp_path):
    held_out = members("suite/held_out")[0]
    path = config()
    folder = chat(f"{held_out}-0__marks__s0__agent")
    with pytest.raises(LeakError, match=f"{held_out} of suite/held_out must not be trained on"):
        run(path, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    rows = read_rows(chat("mine/a-task"))
    check_rows(rows, source="chat")
    with pytest.raises(LeakError, match="a-task would be trained on and reported"):
        check_rows(rows, ["a-task"], source=str(folder))


def test_the_authors_tasks_are_trained_on_with_their_split(config, chat, tmp_path):
    held_out_tasks = set(members("agenthijack/training")) & set(members("osworld/held_out"))
    path = config()
    folder = chat(min(held_out_tasks))
    with pytest.raises(LeakError, match="osworld_split='agenthijack'"):
        run(path, "--out", tmp_path / "out")
    path = config(osworld_split="agenthijack")
    chat(min(held_out_tasks))
    assert run(path, "--dry-run").stdout == f"{folder}: 3 rows\n"


def test_a_dry_run_counts_the_rows(config, chat):
    listed = run(config(data=["none"]), "--dry-run", "--data", chat())
    assert listed.stdout == f"{chat()}: 2 rows\n"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"methods": "sft"}, "unknown key 'methods'; did you mean 'method'"),
        ({"evaluation": ["suite/heldout"]}, "did you mean 'suite/held_out'"),
        ({"batch": 0}, "batch"),
        ({"trl": 3}, "trl: fields of SFTConfig"),
        ({"model": ""}, "model is a text"),
    ],
)
def test_mistakes_are_named(config, changes, message):
    with pytest.raises(ConfigError, match=message):
        load_sft(config(**changes))


def test_another_method_is_refused(config):
    with pytest.raises(ConfigError, match="no 'sftt'; did you mean 'sft'"):
        read_method(config(method="sftt"))
    assert run(config(), "--arms", "grpo").exit_code == 2
    assert run("toy", "--model", "x", "--dry-run").exit_code == 2


def test_folders_that_are_no_exports_are_refused(config, tmp_path):
    with pytest.raises(DatasetError, match="hijack export DATASET --to chat"):
        read_rows(tmp_path)
    with pytest.raises(ParameterError, match="--data DIR"):
        run(config(data=[]), "--dry-run")
    folder = tmp_path / "broken"
    folder.mkdir()
    row = {"messages": [{"role": "user", "content": "no picture"}], "images": ["a.png"]}
    (folder / "train.jsonl").write_text(json.dumps(row))
    with pytest.raises(DatasetError, match=r"train\.jsonl:1: 'messages' must be a question"):
        read_rows(folder)


def test_the_shipped_configuration_refuses_what_is_reported():
    shipped = load_sft("train/sft")
    assert read_method("train/sft") == "sft"
    assert len(shipped.evaluation) > 241
    assert shipped.data == ("chat", "onlooker")


def tiny_model(folder):
    from support import tiny_qwen3

    words = tiny_qwen3.processor(tiny_qwen3.trl_template())
    tiny_qwen3.model(words.tokenizer).save_pretrained(folder)
    words.save_pretrained(folder)
    return folder


@pytest.fixture
def trl():
    torch = pytest.importorskip("torch", reason="needs the extra [train]")
    pytest.importorskip("trl", reason=needs.TRL)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # threads wait for each other on a busy machine
    yield
    torch.set_num_threads(threads)


@pytest.mark.slow
@pytest.mark.usefixtures("trl")
@pytest.mark.filterwarnings("ignore")
def test_the_loss_goes_down(config, exports, tmp_path):
    tiny_model(tmp_path / "model")
    out = tmp_path / "out"
    watched = ["--data", exports / "chat", "--data", exports / "onlooker" / "reminders"]
    constant = {"lr_scheduler_type": "constant", "use_cpu": True, "bf16": False}
    options = {"accumulation": 1, "learning_rate": 0.01, "trl": constant}
    result = run(config(**options), "--out", out, "--json", *watched)
    assert result.exit_code == 0, result.output
    summary = json.loads(result.stdout.splitlines()[-1])
    assert sum(summary["rows"].values()) >= 50
    losses = [loss["loss"] for loss in summary["losses"]]
    assert summary["last_loss"] < 0.8 * summary["first_loss"], losses
    assert (out / "model" / "model.safetensors").is_file()
    assert json.loads((out / "summary.json").read_text()) == summary
    assert run(config(), "--out", out).exit_code == 2, "the folder is not empty"
    again = run(config(**options, epochs=2), "--out", out, "--resume", "--json", *watched)
    assert json.loads(again.stdout.splitlines()[-1])["steps"] > summary["steps"]
    others = config(**{**options, "learning_rate": 0.1})
    with pytest.raises(TrainError, match="of another run; it differs in learning_rate, rows"):
        run(others, "--out", out, "--resume", *watched[:2])


@pytest.mark.slow
@pytest.mark.usefixtures("trl")
@pytest.mark.filterwarnings("ignore")
def test_what_ends_a_run(config, tmp_path):
    import torch
    from transformers import AutoModelForImageTextToText

    with pytest.raises(TrainError, match="cannot be loaded"):
        run(config(), "--out", tmp_path / "a")
    folder = tiny_model(tmp_path / "model")
    with pytest.raises(Exception, match="SFTConfig has no 'warmup_step'; did you mean"):
        run(config(trl={"warmup_step": 3}), "--out", tmp_path / "b")
    with pytest.raises(Exception, match="seed is set by the keys beside trl"):
        run(config(trl={"seed": 3}), "--out", tmp_path / "b")
    with pytest.raises(TrainError, match="no checkpoint to go on from"):
        run(config(), "--out", tmp_path / "c", "--resume")
    model = AutoModelForImageTextToText.from_pretrained(folder)
    with torch.no_grad():
        model.lm_head.weight.fill_(float("nan"))
    model.save_pretrained(folder)
    with pytest.raises(TrainError, match="is not finite; no step was taken"):
        run(config(), "--out", tmp_path / "d")


def test_without_trl_the_remedy_is_named(config, monkeypatch):
    from hijack_data import extras

    monkeypatch.setattr(extras, "lacking", lambda modules: ["trl"])
    with pytest.raises(MissingDependencyError, match=r"pip install .*\[trl\]'"):
        run(config(), "--out", "none")
