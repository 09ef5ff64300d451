"""`hijack train`: a small replication from start to end, resumed, and every mistake named."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner

pytest.importorskip("torch", reason="needs the extra [train]")
pytest.importorskip("gymnasium", reason="needs the extra [train]")

import hijack_data as hj
from hijack_data.config import load_config
from hijack_data.errors import ConfigError, HijackError
from pipelines.train.errors import LeakError, TrainError
from pipelines.train.toy import results
from pipelines.train.toy.arms import ARMS
from pipelines.train.toy.settings import load_replication
from pipelines.train.train_command import train

from support.waiting import until

ROOT = Path(__file__).parents[3]
VISUAL = {
    name
    for name in hj.corruption_names()
    if hj.make_corruption(name).category == "visual_disruptor"
}
SMALL = """\
environment: toy
training: [toy-00000, toy-00001, toy-00002, toy-00003]
evaluation: [toy-10000, toy-10001, toy-10002]
seeds: 2
epochs: 2
rollouts: 2
batch: 2
start_tasks: 8
start_epochs: 2
trained:
  - marks: {number: 5, mark_size: 2}
  - resolution: {scale: 0.5, restore: true}
untrained: [verification]
"""


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "small.yaml"
    path.write_text(SMALL)
    return path


def run(*arguments):
    return CliRunner().invoke(
        train, [str(argument) for argument in arguments], catch_exceptions=False
    )


def files(folder: Path):
    names = ("scores.json", "rollouts.jsonl", "steps.jsonl")
    paths = [path for path in sorted(folder.rglob("*")) if path.name in names]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def rows(path: Path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_from_start_to_end_and_again(config, tmp_path):
    out = tmp_path / "out"
    result = run(config, "--out", out, "--workers", 1, "--json")
    assert result.exit_code == 0, result.output
    summary = json.loads((out / "summary.json").read_text())
    assert json.loads(result.stdout.splitlines()[-1]) == summary
    for name in ("gain_visual", "gain_clean", "gain_heldout"):
        gain = summary[name]
        assert gain.keys() == {"mean", "ci_low", "ci_high", "per_seed"}
        assert len(gain["per_seed"]) == 2
        assert gain["ci_low"] <= gain["mean"] <= gain["ci_high"]
    # equal rollouts
    assert summary["rollouts"] == {"start": 0, "grpo": 16, "da_grpo": 16}
    met = rows(out / "da_grpo-0" / "rollouts.jsonl")
    assert {row["corruption"] for row in met} == {"marks", "resolution"}
    clean = rows(out / "grpo-0" / "rollouts.jsonl")
    assert {row["corruption"] for row in clean} == {"clean"}
    assert "| `da_grpo`" in (out / "table.md").read_text()

    assert run(config, "--out", out).exit_code == 2  # not without --resume
    before = files(out)
    (out / "da_grpo-1" / "scores.json").unlink()  # as if it was stopped before the end
    assert run(config, "--out", out, "--workers", 1, "--resume").exit_code == 0
    assert files(out) == before
    more = run(config, "--out", out, "--workers", 1, "--resume", "--arms", "grpo,da_grpo,no_replay")
    assert more.exit_code == 0
    assert "without the replay buffer" in more.stdout
    with pytest.raises(TrainError, match="holds a replication with other epochs"):
        run(config, "--out", out, "--resume", "--epochs", 3)


def test_workers_end_with_a_replication_that_is_killed(config, tmp_path):
    config.write_text(SMALL.replace("\nepochs: 2", "\nepochs: 10000"))
    out = tmp_path / "out"
    command = [sys.executable, "-m", "hijack_data", "train", config, "--out", out, "--workers", "2"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as process:
        until(lambda: len(list(out.glob("*/steps.jsonl"))) == 2, "two runs")
        tasks = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        children = [Path("/proc") / pid for pid in tasks.read_text().split()]
        process.kill()
    assert len(children) >= 2
    until(lambda: not any(child.exists() for child in children), "their end")


def test_a_dry_run_lists_the_runs(config, tmp_path):
    listed = run(config, "--dry-run", "--out", tmp_path / "none", "--arms", "all")
    assert len(listed.stdout.splitlines()) == 2 * len(ARMS)
    assert not (tmp_path / "none").exists()


def test_the_shipped_configuration_is_the_paper_s():
    shipped = load_replication("train/toy")
    assert (len(shipped.training), shipped.epochs, shipped.rollouts) == (128, 15, 4)
    assert (shipped.clip_low, shipped.clip_high, shipped.format_weight) == (0.2, 0.3, 1.0)
    assert shipped.seeds >= 4
    assert set(shipped.trained) == VISUAL
    assert {*shipped.trained, *shipped.untrained} == set(hj.corruption_names())


@pytest.mark.parametrize("name", ["verl_agent", "verl_served"])
def test_every_shipped_trainer_draws_from_the_paper_s_five_visual_disruptors(name):
    (loop,) = yaml.safe_load((ROOT / "configs" / "train" / f"{name}.yaml").read_text())
    assert set(load_config({"corruptions": loop["corruptions"]}).corruptions) == VISUAL


def test_the_servers_of_the_cluster_play_what_the_trainer_draws():
    script = (ROOT / "examples" / "cluster" / "desktops.sh").read_text()
    options = script.partition("--corruptions ")[2].split()[0]
    assert set(options.split(",")) == {*VISUAL, "clean"}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seeds: 2", "seed: 2", "4:1: unknown key 'seed'; did you mean 'seeds'"),
        ("rollouts: 2", "rollouts: 1", "rollouts"),
        ("environment: toy", "environment: tox", "no 'tox'; did you mean 'toy'"),
        ("toy-10000", "toy/heldout", "did you mean 'toy/held_out'"),
        ("  - marks:", "  - mark:", "did you mean 'marks'"),
        ("epochs: 2\n", "arms: [grpo, dagrpo]\n", "did you mean 'da_grpo'"),
        ("trained:\n", "traned:\n", "trained is missing"),
        ("epochs: 2\n", "arms: [grpo, grpo]\n", "arms: 'grpo' is there twice; remove one"),
        ("epochs: 2\n", "arms: []\n", "arms is empty; known: grpo, da_grpo"),
        (
            "[toy-10000, toy-10001, toy-10002]",
            "[]",
            "evaluation is empty; name a set, such as toy/",
        ),
        ("[verification]", "[marks]", "untrained: 'marks' is in trained, too"),
    ],
)
def test_mistakes_are_named(config, old, new, message):
    config.write_text(SMALL.replace(old, new, 1))
    with pytest.raises(ConfigError) as caught:
        load_replication(config)
    assert message in str(caught.value)


def test_tasks_of_another_desktop_are_told_before_anything_is_played(config, tmp_path):
    config.write_text(SMALL.replace("toy-00003", "task-3"))
    result = CliRunner().invoke(train, [str(config), "--out", str(tmp_path / "out"), "--dry-run"])
    assert isinstance(result.exception, HijackError)
    assert f"{config}: no task 'task-3' of the toy desktop" in str(result.exception)


def test_several_mistakes_at_once(config):
    config.write_text(SMALL.replace("seeds: 2", "sed: 2").replace("batch: 2", "batch: x"))
    with pytest.raises(ConfigError) as caught:
        load_replication(config)
    assert len(caught.value.problems) == 2


@pytest.mark.parametrize(
    ("tasks", "message"),
    [
        ("[toy-00000, toy-10001]", "task toy-10001 would be trained on and reported"),
        ("[toy-10099]", "of toy/held_out must not be trained on"),
        ("[suite/held_out]", "of suite/held_out must not be trained on"),
        ("[osworld/held_out]", "of osworld/held_out must not be trained on"),
    ],
)
def test_leaks_are_refused_before_anything_is_played(config, tmp_path, tasks, message):
    text = SMALL.replace("[toy-00000, toy-00001, toy-00002, toy-00003]", tasks)
    config.write_text(text)
    with pytest.raises(LeakError, match=message):
        run(config, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_unknown_arm(config):
    with pytest.raises(HijackError, match="no arm 'groups'"):
        run(config, "--arms", "groups", "--dry-run")


def test_intervals_are_student_s():
    gain = results.paired_interval([1.0, 2.0, 3.0, 6.0])
    assert gain["mean"] == 3.0
    assert (gain["ci_low"], gain["ci_high"]) == pytest.approx((-0.4373, 6.4373), abs=1e-3)
    assert results.paired_interval([2.0, 2.0])["ci_low"] == 2.0


def test_the_plot_is_the_same_every_time(tmp_path):
    pytest.importorskip("matplotlib", reason="needs the extra [train]")
    gain = results.paired_interval([1.0, 2.0])
    names = dict.fromkeys(("visual", "clean", "heldout"), 50.0)
    summary = {
        "success": {"start": names, "grpo": names, "da_grpo": names},
        "arms": {
            "da_grpo - grpo": dict.fromkeys(names, gain),
            "start - grpo": dict.fromkeys(names, gain),
        },
    }
    results.plot(summary, tmp_path / "one.svg")
    results.plot(summary, tmp_path / "two.svg")
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()
    assert b"da_grpo" in (tmp_path / "one.svg").read_bytes()
