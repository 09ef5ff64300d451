"""verl's own agent loop worker, TransferQueue and losses with our loop and replay, on a CPU.

In place of the inference server a script answers; no vLLM and no GPU is needed. It runs where verl
is installed, in an environment of its own (docs/train.md).
"""

import asyncio
import json
import sys
import warnings
from pathlib import Path

import pytest

from support import needs

torch = pytest.importorskip("torch", reason="needs the extra [train]")
pytest.importorskip("gymnasium", reason="needs the extra [train]")
pytest.importorskip("verl", reason=needs.VERL)
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    tq = pytest.importorskip("transfer_queue", reason=needs.VERL)
pytestmark = pytest.mark.filterwarnings("ignore")

import numpy as np  # noqa: E402

with warnings.catch_warnings():  # of ray and of verl, while they are imported
    warnings.simplefilter("ignore")
    from omegaconf import OmegaConf
    from verl.experimental.agent_loop.agent_loop import AgentLoopWorker, DictConfigWrap
    from verl.trainer.ppo.core_algos import (
        compute_grpo_outcome_advantage,
        compute_policy_loss_vanilla,
    )
    from verl.utils.dataset.rl_dataset import RLHFDataset
    from verl.workers.rollout.replica import TokenOutput

from hijack_data.errors import ConfigError, ParameterError, UnknownNameError  # noqa: E402
from pipelines.train.adapters.verl_loop import HijackLoop, close_idle, make_planner  # noqa: E402
from pipelines.train.adapters.verl_rows import write_evaluation_rows, write_rows  # noqa: E402
from pipelines.train.errors import LeakError  # noqa: E402
from pipelines.train.objective import clipped_loss, group_advantage  # noqa: E402
from pipelines.train.sampler import CorruptionSampler  # noqa: E402
from pipelines.train.toy.cloning import expert_answer  # noqa: E402
from pipelines.train.toy.env import ToyEnv  # noqa: E402

from support import tiny_qwen3  # noqa: E402

ROOT = Path(__file__).resolve().parents[3]
TOY = "pipelines.train.toy.env:ToyEnv"
CORRUPTIONS = [
    {"marks": {"number": 9, "mark_size": 2}},
    {"resolution": {"scale": 0.75, "restore": True}},
    "verification",
]
TEMPLATE = (
    "{% for m in messages %}<|im_start|>{{ m['role'] }}\n"
    "{% if m['content'] is string %}{{ m['content'] }}{% else %}{% for c in m['content'] %}"
    "{% if c['type'] == 'image' %}<|vision_start|><|image_pad|><|vision_end|>"
    "{% else %}{{ c['text'] }}{% endif %}{% endfor %}{% endif %}<|im_end|>\n{% endfor %}"
    "{% if add_generation_prompt %}<|im_start|>assistant\n{% endif %}"
)
RAW = [{"role": "system", "content": [{"type": "text", "text": "Say click(x, y) or DONE."}]}]


class Server:
    """In place of verl's client of an inference server: says what `says(env)` returns."""

    def __init__(self, words, says):
        self.words = words
        self.says = says
        self.env = None
        self.seen = []

    async def generate(self, request_id, *, prompt_ids, sampling_params, image_data=None, **_):
        pad = self.words.convert_tokens_to_ids("<|image_pad|>")
        self.seen.append((len(image_data), list(prompt_ids).count(pad)))
        tokens = self.words.encode(self.says(self.env()) + "<|im_end|>", add_special_tokens=False)
        return TokenOutput(
            token_ids=tokens, log_probs=[-1.0] * len(tokens), stop_reason="completed"
        )


@pytest.fixture(scope="module", autouse=True)
def _one_thread():
    """Threads of a tiny model wait for each other on a busy machine."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def words():
    return tiny_qwen3.processor(TEMPLATE)


@pytest.fixture(scope="module")
def net(words):
    from transformers.models.qwen3_vl.modeling_qwen3_vl import Qwen3VLModel

    result = tiny_qwen3.model(words.tokenizer)
    words.config = result.config  # as verl.utils.tokenizer.hf_processor does for a checkpoint
    words.get_rope_index = lambda *a, **k: Qwen3VLModel.get_rope_index(result.model, *a, **k)
    return result


def settings(response_length=1024):
    rollout = {"prompt_length": 512, "response_length": response_length, "name": "vllm"}
    return OmegaConf.create({"actor_rollout_ref": {"rollout": rollout}, "data": {}})


def expert(env):
    return expert_answer(env)[0]


@pytest.fixture
def play(words, net, monkeypatch):
    """Play an episode: `play(says, slot=..., task=...)` gives verl's output and the server."""

    def run(says=expert, *, slot=0, response_length=1024, row=None, **options):
        close_idle()
        server = Server(words.tokenizer, says)
        config = settings(response_length)
        loop_options = {"environment": TOY, "corruptions": CORRUPTIONS, "seed": 7, **options}

        async def whole():
            loop = HijackLoop(
                DictConfigWrap(config),
                server,
                words.tokenizer,
                words,
                RLHFDataset,
                DictConfigWrap(config.data),
                hf_model_type="qwen3_vl",
                **loop_options,
            )
            take_idle = loop._take_idle

            def spy():
                key, episode = take_idle()
                server.env = lambda: episode._env
                return key, episode

            monkeypatch.setattr(loop, "_take_idle", spy)
            about = {"task": "toy-00000", **(row or {})}
            entries = {
                "raw_prompt": RAW,
                "extra_info": about,
                "session_id": slot,
                "global_steps": 3,
            }
            return await loop.run({"temperature": 1.0}, **entries)

        output = asyncio.run(whole())
        return output, server

    yield run
    close_idle()


def test_an_episode_as_verl_takes_it(play):
    output, server = play(slot=1)
    value = (64 // 32) * (96 // 32)  # picture tokens of a screenshot
    assert all(tokens == pictures * value for pictures, tokens in server.seen)
    assert len(server.seen) >= 2
    assert len(output.multi_modal_data["images"]) == len(server.seen)
    assert output.reward_score == 1.0
    assert len(output.response_ids) == len(output.response_mask) == len(output.response_logprobs)
    assert 0 < sum(output.response_mask) < len(output.response_mask)
    planner = CorruptionSampler(make_planner(CORRUPTIONS), seed=7).draw(
        step=3, group="toy-00000", slot=1
    )
    facts = output.extra_fields["reward_extra_info"]
    assert facts["corruption"] == planner.label
    assert facts["success"] == 1.0


def test_each_rollout_meets_a_corruption_of_its_own(play):
    met = {play(slot=slot)[0].extra_fields["reward_extra_info"]["corruption"] for slot in range(8)}
    assert len(met) > 1
    clean, _ = play(row={"corruption": "clean"})
    assert clean.extra_fields["reward_extra_info"]["corruption"] == "clean"


def test_a_key_of_the_configuration_that_means_nothing_is_refused(play):
    play(name="agenthijack", tools=object())  # verl gives these, too
    with pytest.raises(ParameterError, match=r"the key 'corruption'.*did you mean 'corruptions'"):
        play(corruption=["marks"])  # verl's base class would take it, and play clean rollouts


@pytest.mark.parametrize(("says", "reward"), [("DONE", 0.0), ("I do not know", -1.0)])
def test_reward_is_success_and_format(play, says, reward):
    output, _ = play(lambda env: says, max_steps=2)
    assert output.reward_score == reward


def test_a_response_that_is_full_ends_before_its_picture(play):
    output, server = play(lambda env: "click(1, 1)", response_length=60, corruptions=())
    images = output.multi_modal_data["images"]
    pad = server.words.convert_tokens_to_ids("<|image_pad|>")
    tokens = (output.prompt_ids + output.response_ids).count(pad)
    assert tokens == 6 * len(images)
    assert len(output.response_ids) <= 60


class Broken(ToyEnv):
    """No desktop."""

    def reset(self, *, seed=None, options=None):
        raise RuntimeError("no desktop")


def test_an_environment_that_fails_in_reset_leaves_the_group(play, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "broken_env_of_a_test", sys.modules[__name__])
    output, _ = play(environment="broken_env_of_a_test:Broken")
    assert output == []
    assert "toy-00000, rollout 0 is left out: error, reset: RuntimeError" in capsys.readouterr().out


def test_mistakes_are_named(play):
    with pytest.raises(UnknownNameError, match="toy-x"):
        play(row={"task": "toy-x"})
    with pytest.raises(ParameterError, match=r"extra_info\.task"):
        play(row={"task": ""})
    with pytest.raises(ConfigError, match="did you mean 'marks'"):
        play(corruptions=["mark"])


def test_losses_of_a_step_are_ours(play, words, net):
    """verl's post-processing of two rollouts, its advantage and its loss; then a real gradient."""
    outputs = [play()[0], play(lambda env: "DONE", slot=1)[0]]
    worker = object.__new__(AgentLoopWorker)  # without ray
    config = settings()
    worker.config = config
    worker.rollout_config = config.actor_rollout_ref.rollout
    worker.tokenizer = words.tokenizer
    worker.processor = words
    worker.mm_processor_kwargs = {}
    worker.reward_loop_worker_handles = None
    worker.distillation_enabled = False

    async def padded():
        return [
            await worker._agent_loop_postprocess(output, False, raw_prompt=RAW)
            for output in outputs
        ]

    data = worker._postprocess(asyncio.run(padded()))
    mask = data.batch["response_mask"]
    rewards = data.batch["rm_scores"].sum(-1)
    assert rewards.tolist() == [1.0, 0.0]
    reference, _ = compute_grpo_outcome_advantage(
        data.batch["rm_scores"], mask.float(), np.array(["a", "a"])
    )
    ours = group_advantage(rewards)
    assert torch.allclose(reference.amax(1) + reference.amin(1), ours, atol=1e-5)
    new = torch.stack([_log_probs(net, data, row) for row in range(2)])
    old = new.detach() + 0.5 * torch.randn_like(new).detach()
    loss, *_ = compute_policy_loss_vanilla(
        old, new, reference, mask.float(), loss_agg_mode="seq-mean-token-mean", config=_actor()
    )
    expected = clipped_loss(new, old, ours, mask.bool()).mean()
    assert torch.allclose(loss, expected, atol=1e-5)
    loss.backward()
    trained_names = [name for name, item in net.named_parameters() if item.grad is not None]
    assert any("visual" in name for name in trained_names)
    assert any("language_model" in name for name in trained_names)


def _log_probs(net, data, row):
    """The log-probabilities of a response, with the pictures and positions that verl made."""
    batch = data.batch
    pictures = {
        name: value
        for name, value in data.non_tensor_batch["multi_modal_inputs"][row].items()
        if name in ("pixel_values", "image_grid_thw")
    }
    assert pictures["pixel_values"].shape[0] > 0
    logits = net(
        input_ids=batch["input_ids"][row : row + 1],
        attention_mask=batch["attention_mask"][row : row + 1],
        position_ids=batch["position_ids"][row : row + 1].transpose(0, 1),
        **pictures,
    ).logits
    responses = batch["responses"][row]
    chances = torch.log_softmax(logits[0, -len(responses) - 1 : -1].float(), -1)
    return chances.gather(-1, responses.unsqueeze(-1)).squeeze(-1)


def _actor():
    """The shipped settings of the actor, as verl reads them."""
    actor = shipped().actor_rollout_ref.actor
    return OmegaConf.merge(
        {name: actor[name] for name in actor if name.startswith("clip_ratio")},
        {"global_batch_info": {}},
    )


def shipped():
    from hydra import compose, initialize_config_dir

    with initialize_config_dir(str(ROOT / "configs" / "train"), version_base=None):
        return compose("verl")


def test_the_shipped_configuration_is_the_paper_s():
    config = shipped()
    actor = config.actor_rollout_ref.actor
    rollout = config.actor_rollout_ref.rollout
    assert (actor.optim.lr, actor.optim.optimizer) == (1e-6, "AdamW")
    assert (actor.clip_ratio_low, actor.clip_ratio_high) == (0.2, 0.3)
    assert (rollout.n, rollout.temperature) == (4, 1.0)
    assert (config.data.train_batch_size, actor.ppo_mini_batch_size) == (4, 4)
    assert config.trainer.total_epochs == 15
    assert not actor.use_kl_loss
    assert not config.algorithm.use_kl_in_reward
    assert config.algorithm.adv_estimator == "grpo"
    assert config.trainer.use_v1


def test_the_shipped_loop_is_one_that_verl_can_make(words, net):
    import hydra

    entries = OmegaConf.load(ROOT / "configs" / "train" / "verl_agent.yaml")
    config = settings()

    async def made():
        return hydra.utils.instantiate(
            config=entries[0],
            trainer_config=DictConfigWrap(config=config),
            server_manager=None,
            tokenizer=words.tokenizer,
            processor=words,
            hf_model_type="qwen3_vl",
            dataset_cls=RLHFDataset,
            data_config=DictConfigWrap(config.data),
        )

    loop = asyncio.run(made())
    assert len(loop.sampler.planner.options) == 5
    assert loop.environment_args == {"max_steps": 10}


def test_rows(tmp_path):
    import pyarrow.parquet as pq

    assert write_rows(tmp_path / "a.parquet", ["toy-00000", "toy-00001"], "How") == 2
    rows = pq.read_table(tmp_path / "a.parquet").to_pylist()
    assert [row["extra_info"]["task"] for row in rows] == ["toy-00000", "toy-00001"]
    assert {row["agent_name"] for row in rows} == {"agenthijack"}
    with pytest.raises(LeakError, match="toy-10000"):
        write_rows(tmp_path / "b.parquet", ["toy-10000"], "How")
    assert not (tmp_path / "b.parquet").exists()
    assert write_evaluation_rows(tmp_path / "c.parquet", ["toy-10000"], "How") == 1
    row = pq.read_table(tmp_path / "c.parquet").to_pylist()[0]
    assert row["extra_info"]["corruption"] == "clean"


@pytest.fixture(scope="module")
def queue():
    """TransferQueue itself, on a Ray of this process."""
    import ray

    patch = pytest.MonkeyPatch()
    patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    patch.setenv("RAY_raylet_start_wait_time_s", "300")  # on a busy machine
    patch.setenv("RAY_agent_register_timeout_ms", "300000")
    ray.init(
        num_cpus=4, include_dashboard=False, log_to_driver=False, object_store_memory=80 * 2**20
    )
    tq.init()
    yield
    tq.close()
    ray.shutdown()
    patch.undo()


def _buffer(**options):
    from pipelines.train.adapters.verl_replay import HijackReplay

    return HijackReplay(
        trainer_mode="sync",
        trainer_config=OmegaConf.create({}),
        max_off_policy_threshold=8,
        max_off_policy_strategy="drop",
        sampler_kwargs=OmegaConf.create({"seed": 3, **options}),
        poll_interval=0.05,
    )


def _put(uid, rewards, step, task="toy-00000"):
    """What verl's workers put into the queue for a group, of different lengths."""
    from verl.utils.tensordict_utils import list_of_dict_to_tensordict

    fields, keys, tags = [], [], []
    for slot, reward in enumerate(rewards):
        length = 3 + slot + step
        scores = torch.zeros(length)
        scores[-1] = reward
        facts = {
            "task": task,
            "corruption": "marks",
            "success": max(reward, 0.0),
            "well_formed": reward >= 0,
        }
        fields.append(
            {
                "prompts": torch.full((2,), step),
                "responses": torch.full((length,), 100 * step + slot),
                "response_mask": torch.ones(length, dtype=torch.int64),
                "rm_scores": scores,
                "extra_fields": {"reward_extra_info": facts},
                "multi_modal_inputs": {"pixel_values": torch.full((4, 8), float(step))},
                "uid": uid,
                "session_id": slot,
                "global_steps": step,
            }
        )
        keys.append(f"{uid}_{slot}_0")
        tags.append(
            {
                "status": "success",
                "prompt_len": 2,
                "response_len": length,
                "seq_len": 2 + length,
                "global_steps": step,
            }
        )
    tq.kv_batch_put(
        keys=keys, fields=list_of_dict_to_tensordict(fields), tags=tags, partition_id="train"
    )
    prompt = {"is_prompt": True, "status": "finished", "global_steps": step}
    tq.kv_put(key=uid, partition_id="train", tag=prompt)


def test_a_stored_success_takes_the_place_of_a_failure(queue):
    buffer = _buffer()
    _put("aa", [1.0, 0.0], step=1)
    first, _ = buffer.sample(1, "train", 1)
    assert sorted(first.keys) == ["aa_0_0", "aa_1_0"]
    assert len(buffer.stored) == 1
    tq.kv_clear(keys=first.keys, partition_id="train")
    _put("bb", [0.0, 0.0], step=2)
    second, _ = buffer.sample(2, "train", 1)
    rows = tq.kv_batch_get(keys=second.keys, partition_id="train")
    rewards = [float(rows[i]["rm_scores"].sum()) for i in range(2)]
    assert sorted(rewards) == [0.0, 1.0]
    index = rewards.index(1.0)
    row = rows[index]
    assert row["responses"].tolist() == [100] * 4, "the tokens of step 1"
    assert row["uid"] == "bb", "in the group of step 2"
    assert int(row["global_steps"]) == 2
    assert second.tags[index]["response_len"] == 4
    tq.kv_clear(keys=second.keys, partition_id="train")
    _put("cc", [0.0, -1.0], step=3)
    third, _ = buffer.sample(3, "train", 1)
    rows = tq.kv_batch_get(keys=third.keys, partition_id="train")
    assert sorted(float(rows[i]["rm_scores"].sum()) for i in range(2)) == [-1.0, 0.0]
    tq.kv_clear(keys=third.keys, partition_id="train")


def test_held_out_tasks_and_unknown_options_are_refused(queue):
    _put("dd", [0.0, 1.0], step=1, task="toy-10000")
    with pytest.raises(LeakError, match="toy-10000"):
        _buffer().sample(1, "train", 1)
    with pytest.raises(ParameterError, match="unknown capasity"):
        _buffer(capasity=3)


def test_the_replaced_row_is_json_too(play):
    """What verl dumps of a rollout must be JSON."""
    output, _ = play()
    json.dumps(output.extra_fields)
