"""TRL's GRPOTrainer with our environments, on a CPU: real pictures, loss, gradient and optimiser.

A random model calls no tool, so a subclass puts the words of a script into its mouth; all else is
TRL's own.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from support import needs

torch = pytest.importorskip("torch", reason="needs the extra [train]")
pytest.importorskip("gymnasium", reason="needs the extra [train]")
pytest.importorskip("trl", reason=needs.TRL)
os.environ.setdefault("TRL_EXPERIMENTAL_SILENCE", "1")
# of accelerate and torch, on a machine without an accelerator
pytestmark = pytest.mark.filterwarnings("ignore")

import hijack_data as hj  # noqa: E402
from hijack_data.errors import ParameterError, UnknownNameError  # noqa: E402
from pipelines.train.adapters.trl_environment import TrlEnvironments, format_reward, training_rows  # noqa: E402
from pipelines.train.adapters.trl_trainer import DAGRPOTrainer  # noqa: E402
from pipelines.train.errors import LeakError, TrainError  # noqa: E402
from pipelines.train.objective import clipped_loss, group_advantage  # noqa: E402
from pipelines.train.replay import ReplayBuffer  # noqa: E402
from pipelines.train.sampler import CorruptionSampler  # noqa: E402
from pipelines.train.toy.cloning import expert_answer  # noqa: E402
from pipelines.train.toy.env import ToyEnv  # noqa: E402

from support import tiny_qwen3  # noqa: E402

ROOT = Path(__file__).resolve().parents[3]
TASKS = ("toy-00000", "toy-00001")
HOW = "Call the tool with click(x, y) or DONE."
PICTURES = hj.OneOf(
    [
        hj.Marks(number=9, mark_size=2),
        hj.Subtitle(font_size=7, padding=3, edge_width=1, fit="shrink", subtitle_text="LISTEN"),
        hj.Resolution(scale=0.75, restore=True),
        hj.Verification(),
    ]
)


def call(action):
    arguments = json.dumps({"name": "computer", "arguments": {"action": action}})
    return f"<tool_call>\n{arguments}\n</tool_call><|im_end|>"


class Scripted(DAGRPOTrainer):
    """Says what `says(number, turn, env)` returns for each rollout; `""` ends it."""

    says = staticmethod(lambda number, turn, env: "")

    def _generate_single_turn(self, prompt_ids, images, *args, **kwargs):
        is_first = len(prompt_ids) == len(self.environments) and not kwargs.get("has_tool_images")
        if is_first and not any(
            environment._episode.rollout.answers for environment in self.environments
        ):
            self.live = list(range(len(prompt_ids)))
            self.turn = 0
        if len(prompt_ids) != len(self.live):
            self.live = [i for i in self.live if i not in self.silent]
        self.pictures = [len(item or []) for item in images or []]
        pad = self._tokenizer.convert_tokens_to_ids("<|image_pad|>")
        self.tokens = [ids.count(pad) for ids in prompt_ids]
        self.silent = set()
        output = []
        for i in self.live:
            env = self.environments[i]._episode._env
            text = self.says(i, self.turn, None if env is None else env)
            if not text:
                self.silent.add(i)
            output.append(text or "I am lost.<|im_end|>")
        self.turn += 1
        return [self._tokenizer.encode(text, add_special_tokens=False) for text in output], None


def expert(number, turn, env):
    """The first rollout of each group solves its task, the others say DONE at once."""
    if env is None or env.record is not None:
        return ""
    if number % 2:
        return call("DONE")
    return call(expert_answer(env)[0])


@pytest.fixture(scope="module", autouse=True)
def _one_thread():
    """Threads of a tiny model wait for each other on a busy machine."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def words():
    return tiny_qwen3.processor(tiny_qwen3.trl_template())


@pytest.fixture
def make_trainer(tmp_path, words):
    """Make a trainer: `make_trainer(says=..., make=..., replay=..., tasks=..., **config)`."""

    def build(
        says=expert,
        make=ToyEnv,
        *,
        replay=None,
        tasks=TASKS,
        kind=Scripted,
        planner=PICTURES,
        rollouts=2,
        report=print,
        **config,
    ):
        from datasets import Dataset
        from trl import GRPOConfig

        settings = {
            "output_dir": str(tmp_path / "trl"),
            "per_device_train_batch_size": rollouts * len(tasks),
            "num_generations": rollouts,
            "max_completion_length": 3000,
            "max_steps": 1,
            "learning_rate": 1e-3,
            "loss_type": "grpo",
            "epsilon": 0.2,
            "epsilon_high": 0.3,
            "beta": 0.0,
            "use_cpu": True,
            "bf16": False,
            "gradient_checkpointing": False,
            "report_to": [],
            "disable_tqdm": True,
            "logging_steps": 1,
            "save_strategy": "no",
            "remove_unused_columns": False,
            "shuffle_dataset": False,
            **config,
        }
        args = GRPOConfig(**settings)
        environments = TrlEnvironments(
            make, args, sampler=CorruptionSampler(planner, seed=7), folder=tmp_path, report=report
        )
        trainer = kind(
            tiny_qwen3.model(words.tokenizer),
            args=args,
            train_dataset=Dataset.from_list(training_rows(tasks, HOW)),
            processing_class=words,
            environment_factory=environments,
            replay=replay,
        )
        trainer.says = says
        return trainer

    return build


def log_of(tmp_path):
    return [json.loads(line) for line in (tmp_path / "rollouts.jsonl").read_text().splitlines()]


def parameters(trainer):
    return {name: value.detach().clone() for name, value in trainer.model.named_parameters()}


def counting(trainer):
    """Collect the pictures and the picture tokens of each rollout in each turn."""
    counts = []
    single = trainer._generate_single_turn

    def spy(*args, **kwargs):
        out = single(*args, **kwargs)
        counts.extend(zip(trainer.pictures, trainer.tokens, strict=True))
        return out

    trainer._generate_single_turn = spy
    return counts


def test_an_optimiser_step_with_pictures_and_a_corruption_a_rollout(make_trainer, tmp_path):
    trainer = make_trainer()
    before = parameters(trainer)
    entries = {}
    forward = trainer.model.forward

    def spy(*args, **kwargs):
        entries.update({k: tuple(v.shape) for k, v in kwargs.items() if hasattr(v, "shape")})
        return forward(*args, **kwargs)

    trainer.model.forward = spy
    counts = counting(trainer)
    trainer.train()
    value = (64 // 32) * (96 // 32)  # patches of 16 pixels, merged 2 x 2
    assert all(tokens == pictures * value for pictures, tokens in counts)
    assert max(pictures for pictures, _ in counts) >= 2
    logged = trainer.state.log_history[0]
    assert logged["rewards/TrlEnvironment/mean"] == 0.5  # one of two in both groups
    assert logged["rewards/format_reward/mean"] == 0.0
    assert logged["grad_norm"] > 0
    after = parameters(trainer)
    trained_names = {name for name in after if not torch.equal(after[name], before[name])}
    assert any("visual" in name for name in trained_names), "the gradient reaches the pictures"
    assert any("language_model" in name for name in trained_names)
    assert entries["pixel_values"][0] > 0
    rows = log_of(tmp_path)
    assert [row["task"] for row in rows] == [TASKS[0]] * 2 + [TASKS[1]] * 2
    assert [row["slot"] for row in rows] == [0, 1, 0, 1]
    assert rows[0]["seed"] == rows[1]["seed"], "a group plays one variant"
    assert len({row["corruption"] for row in rows}) > 1
    sampler = CorruptionSampler(PICTURES, seed=7)
    for row in rows:
        draw = sampler.draw(step=0, group=row["task"], slot=row["slot"])
        assert row.items() >= draw.to_data().items()
    assert [row["success"] for row in rows] == [1.0, 0.0, 1.0, 0.0]
    assert rows[0]["turns"] >= 2


def test_a_stored_success_takes_the_place_of_a_failure(make_trainer, tmp_path):
    def first_step_only(number, turn, env):
        if trainer.state.global_step == 0:
            return expert(number, turn, env)
        return "" if env.record is not None else call("DONE")

    trainer = make_trainer(
        first_step_only, replay=ReplayBuffer(seed=3), max_steps=2, tasks=TASKS[:1]
    )
    trainer.train()
    first, second = [row for row in trainer.state.log_history if "reward" in row]
    assert first["rewards/TrlEnvironment/mean"] == 0.5
    assert second["rewards/TrlEnvironment/mean"] == 0.5, "one of two rollouts is a stored success"
    assert second["grad_norm"] > 0
    rows = log_of(tmp_path)
    assert [row["success"] for row in rows] == [1.0, 0.0, 0.0, 0.0], "the log has what was played"
    assert {row["step"] for row in rows} == {0, 1}


def test_without_replay_equal_rewards_teach_nothing(make_trainer):
    trainer = make_trainer(
        lambda number, turn, env: "" if env.record else call("DONE"), weight_decay=0.0
    )
    before = parameters(trainer)
    trainer.train()
    logged = trainer.state.log_history[0]
    assert logged["frac_reward_zero_std"] == 1.0
    assert logged["grad_norm"] == 0.0
    assert all(torch.equal(value, before[name]) for name, value in parameters(trainer).items())


@pytest.mark.parametrize(
    ("says", "well_formed"),
    [
        (lambda number, turn, env: "" if turn else call("click(1)"), False),  # a wrong action
        (lambda number, turn, env: "", False),  # no tool is called
        (lambda number, turn, env: "" if env.record else call("DONE"), True),
    ],
    ids=["malformed", "no call", "done"],
)
def test_reward_is_success_and_format(make_trainer, tmp_path, says, well_formed):
    trainer = make_trainer(says, tasks=TASKS[:1])
    trainer.train()
    logged = trainer.state.log_history[0]
    assert logged["rewards/format_reward/mean"] == (0.0 if well_formed else -1.0)
    assert {row["well_formed"] for row in log_of(tmp_path)} == {well_formed}


class Broken(ToyEnv):
    """Fails in the resets of these tasks."""

    fails = frozenset(TASKS[:1])

    def reset(self, *, seed=None, options=None):
        if options["task"] in self.fails:
            raise RuntimeError("no desktop")
        return super().reset(seed=seed, options=options)


def test_an_environment_that_fails_in_reset_loses_its_rollouts_only(make_trainer, tmp_path):
    output = []
    trainer = make_trainer(make=Broken, report=output.append)
    trainer.train()
    assert trainer.state.log_history[0]["rewards/TrlEnvironment/mean"] == 0.5  # of the two left
    assert format_reward([[]] * 4, trainer.environments) == [None, None, 0.0, 0.0]
    rows = log_of(tmp_path)
    assert [row["status"] for row in rows] == ["error", "error", "ok", "ok"]
    assert rows[0]["problem"] == "reset: RuntimeError: no desktop"
    assert output[0].startswith("batch 0: toy-00000, rollout 0 is left out: error, reset")


def test_a_batch_that_cannot_be_played_ends_the_run(make_trainer):
    trainer = make_trainer(make=Broken, tasks=TASKS[:1])
    with pytest.raises(TrainError, match="none of 2 rollouts could be played"):
        trainer.train()


def test_a_loss_that_is_not_finite_ends_the_run(make_trainer):
    trainer = make_trainer()
    with torch.no_grad():
        trainer.model.lm_head.weight.fill_(float("nan"))
    with pytest.raises(TrainError, match="the loss is nan; no step was taken"):
        trainer.train()


def test_unknown_and_held_out_tasks_are_refused(make_trainer):
    with pytest.raises(UnknownNameError, match="toy-x"):
        make_trainer(tasks=("toy-x",)).train()
    with pytest.raises(LeakError, match="toy-10000"):
        training_rows(["toy-10000"], HOW)
    with pytest.raises(LeakError, match="reported"):
        training_rows(TASKS, HOW, evaluation=TASKS[1:])
    with pytest.raises(ParameterError, match="no tasks"):
        training_rows([], HOW)


def test_replay_needs_whole_groups():
    args = SimpleNamespace(
        num_generations=4,
        per_device_train_batch_size=1,
        steps_per_generation=2,
        process_index=1,
        world_size=2,
    )
    environments = TrlEnvironments(ToyEnv, args)
    assert environments.request("toy-00000", 1, None).slot == 3, "the second process has 2 and 3"
    with pytest.raises(ParameterError, match="replay needs whole groups in each process"):
        DAGRPOTrainer(None, environment_factory=environments, replay=ReplayBuffer())


def test_the_loss_is_ours(make_trainer):
    """TRL's advantage and loss, of one batch, against `pipelines.train.objective`."""
    trainer = make_trainer(rollouts=4, tasks=TASKS[:1])
    torch.manual_seed(0)
    mask = (torch.rand(4, 6) < 0.7).long()
    mask[:, 0] = 1
    new, old = torch.randn(4, 6), torch.randn(4, 6)
    rewards = torch.tensor([1.0, 0.0, -1.0, 0.0])
    advantages = group_advantage(rewards)
    trainer._get_per_token_logps_and_entropies = lambda *a, **k: (new, torch.zeros(4, 6), None)
    trainer.current_gradient_accumulation_steps = 1
    ids = torch.zeros(4, 6, dtype=torch.long)
    inputs = {
        "prompt_ids": ids,
        "prompt_mask": torch.ones_like(ids),
        "completion_ids": ids,
        "completion_mask": torch.ones_like(ids),
        "tool_mask": mask,
        "advantages": advantages,
        "old_per_token_logps": old,
    }
    reference = trainer._compute_loss(trainer.model, inputs)
    ours = clipped_loss(new, old, advantages, mask.bool()).mean()
    assert torch.allclose(reference, ours, atol=1e-6)


def test_the_example_runs_from_a_folder(tmp_path, words):
    """`examples/train_trl.py` with the shipped fields, made small: a random model, one step."""
    tiny_qwen3.model(words.tokenizer).save_pretrained(tmp_path / "model")
    words.save_pretrained(tmp_path / "model")
    fields = yaml.safe_load((ROOT / "configs" / "train" / "trl.yaml").read_text())
    assert fields["gradient_accumulation_steps"] == 4 * fields["num_generations"]
    small = {
        "num_generations": 2,
        "steps_per_generation": 2,
        "gradient_accumulation_steps": 2,
        "max_completion_length": 16,
        "max_steps": 1,
        "bf16": False,
        "use_cpu": True,
        "disable_tqdm": True,
    }
    config = tmp_path / "trl.yaml"
    config.write_text(yaml.safe_dump({**fields, **small}))
    out = tmp_path / "out"
    command = [sys.executable, ROOT / "examples" / "train_trl.py", "--model", tmp_path / "model"]
    command += ["--config", config, "--out", out, "--tasks", "1"]
    process = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, check=False, timeout=900
    )
    assert process.returncode == 0, process.stderr[-2000:]
    assert (out / "model" / "model.safetensors").is_file()
    rows = log_of(out)
    assert [row["well_formed"] for row in rows] == [False, False], "a random model calls no tool"


def test_the_shipped_fields_are_the_paper_s(tmp_path):
    from trl import GRPOConfig

    fields = yaml.safe_load((ROOT / "configs" / "train" / "trl.yaml").read_text())
    args = GRPOConfig(output_dir=str(tmp_path), **{**fields, "bf16": False, "use_cpu": True})
    assert (args.learning_rate, args.temperature, args.num_train_epochs) == (1e-6, 1.0, 15)
    assert (args.epsilon, args.epsilon_high, args.beta) == (0.2, 0.3, 0.0)
    assert (args.num_generations, args.loss_type) == (4, "grpo")
    assert args.optim.startswith("adamw")
    groups = args.gradient_accumulation_steps * args.per_device_train_batch_size
    assert groups == 4 * args.num_generations
