"""The loop: equal to GRPO when clean, resumable, and with an outcome for everything that fails."""

import json
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="needs the extra [train]")
pytest.importorskip("gymnasium", reason="needs the extra [train]")

import hijack_data as hj  # noqa: E402
from hijack_data.errors import ParameterError, ParameterTypeError  # noqa: E402
from pipelines.train.errors import TrainError  # noqa: E402
from pipelines.train.replay import ReplayBuffer  # noqa: E402
from pipelines.train.rollouts import PolicyTurn  # noqa: E402
from pipelines.train.trainer import TrainSettings  # noqa: E402

CORRUPTED = hj.OneOf([hj.Marks(number=1, mark_size=1), hj.Resolution(scale=0.5)])


def weights(trainer):
    return {name: value.clone() for name, value in trainer.policy.network().state_dict().items()}


def same(first, second):
    return all(torch.equal(first[name], second[name]) for name in first)


def rows(folder: Path, name="rollouts.jsonl"):
    return [json.loads(line) for line in (folder / name).read_text().splitlines()]


def grpo(trainer, steps):
    """Plain GRPO written out: no sampler, no replay, no corruption; rewards 0 and 1."""
    policy, settings = trainer.policy, trainer.settings
    optimiser = torch.optim.AdamW(
        policy.network().parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay
    )
    per_epoch = trainer.steps_per_epoch
    for step in range(steps):
        trainer.step_number = step
        order = trainer._order(step // per_epoch)
        first = step % per_epoch * settings.batch
        requests = [
            trainer._request(task, slot, step // per_epoch)
            for task in order[first : first + settings.batch]
            for slot in range(settings.rollouts)
        ]
        scores = []
        states = [(request, request.stream()) for request in requests]
        envs = trainer._environments
        calls = [
            env.reset(seed=request.seed, options={"task": request.group})[0]
            for env, (request, _) in zip(envs, states, strict=False)
        ]
        history = [[] for _ in requests]
        for _ in range(2):
            answers = policy.act(calls, [stream for _, stream in states])
            for i, answer in enumerate(answers):
                history[i].append(PolicyTurn(calls[i], answer))
                calls[i], score, *_ = envs[i].step(answer.action)
                if envs[i].record is not None:
                    scores.append(score)
        used_rollouts, advantages = [], []
        for first in range(0, len(requests), settings.rollouts):
            result = torch.tensor(scores[first : first + settings.rollouts])
            if bool((result == result[0]).all()):
                continue
            used_rollouts += history[first : first + settings.rollouts]
            advantages.append((result - result.mean()) / (result.std() + 1e-6))
        if not used_rollouts:
            continue
        chances, _ = policy.log_probs([turn for turns in used_rollouts for turn in turns])
        by_response = chances.view(len(used_rollouts), -1)
        ratio = (by_response - by_response.detach()).exp()
        weight = torch.cat(advantages).unsqueeze(1)
        gain = torch.minimum(ratio * weight, ratio.clamp(0.8, 1.3) * weight)
        value = -gain.sum(1) / by_response.shape[1]
        loss = (
            value * torch.full((len(used_rollouts),), 1 / settings.rollouts)
        ).sum() / settings.batch
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.network().parameters(), settings.max_norm)
        optimiser.step()


def test_clean_only_is_grpo_bit_for_bit(make_trainer):
    ours = make_trainer()
    ours.run()
    other_trainer = make_trainer()
    before = weights(other_trainer)
    grpo(other_trainer, ours.steps)
    assert same(weights(ours), weights(other_trainer))
    assert not same(weights(ours), before)
    all_clean = make_trainer(planner=hj.OneOf([hj.Marks()], p_clean=1.0), per="group")
    all_clean.run()
    assert same(weights(all_clean), weights(ours))


def test_it_learns(make_trainer):
    trainer = make_trainer(epochs=40)
    reports = trainer.run()
    first = sum(report.success for report in reports[:6])
    last = sum(report.success for report in reports[-6:])
    assert last > first + 1


def test_who_met_what_is_saved(make_trainer, tmp_path):
    make_trainer(tmp_path, planner=CORRUPTED).run()
    result = rows(tmp_path)
    assert len(result) == 3 * 6 * 4
    assert {row["corruption"] for row in result} == {"marks", "resolution"}
    assert result[0].keys() >= {"step", "task", "slot", "seed", "planner", "status", "success"}
    assert len(rows(tmp_path, "steps.jsonl")) == 9


def interrupted(make_trainer, folder, steps, extra):
    trainer = make_trainer(folder, planner=CORRUPTED, replay=ReplayBuffer(), save_every=2)
    for _ in range(steps):
        trainer.step()
        if trainer.step_number % 2 == 0:
            trainer.save()
    for _ in range(extra):  # after the checkpoint: is played again
        trainer.step()


@pytest.mark.parametrize(("steps", "extra"), [(2, 0), (4, 1), (6, 2)])
def test_a_resumed_run_has_the_same_future(make_trainer, tmp_path, steps, extra):
    trainer = make_trainer(
        tmp_path / "whole", planner=CORRUPTED, replay=ReplayBuffer(), save_every=2
    )
    trainer.run()
    interrupted(make_trainer, tmp_path / "cut", steps, extra)
    after = make_trainer(tmp_path / "cut", planner=CORRUPTED, replay=ReplayBuffer(), save_every=2)
    assert after.resume()
    assert after.step_number == steps
    after.run()
    assert same(weights(trainer), weights(after))
    for name in ("rollouts.jsonl", "steps.jsonl"):
        assert (tmp_path / "cut" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_nothing_to_resume(make_trainer, tmp_path):
    make_trainer(tmp_path).step()  # killed before its first checkpoint
    again = make_trainer(tmp_path)
    assert not again.resume()
    again.run()
    assert len(rows(tmp_path, "steps.jsonl")) == 9


def test_the_checkpoint_of_another_run_is_refused(make_trainer, tmp_path):
    make_trainer(tmp_path).run()
    second = make_trainer(tmp_path, learning_rate=0.1)
    with pytest.raises(TrainError, match="another run; it differs in settings"):
        second.resume()


def test_another_replay_seed_is_another_run(make_trainer, tmp_path):
    make_trainer(tmp_path, replay=ReplayBuffer(seed=1)).run()
    with pytest.raises(TrainError, match="another run; it differs in replay"):
        make_trainer(tmp_path, replay=ReplayBuffer(seed=2)).resume()


def test_the_checkpoint_of_another_network_is_refused_and_the_logs_stay(make_trainer, tmp_path):
    trainer = make_trainer(tmp_path)
    trainer.step()
    trainer.save()
    trainer.step()
    before = (tmp_path / "rollouts.jsonl").read_bytes()
    second = make_trainer(tmp_path)
    second.policy.net = torch.nn.Linear(3, 4)
    with pytest.raises(TrainError, match=r"of another network \(.*size mismatch"):
        second.resume()
    assert (tmp_path / "rollouts.jsonl").read_bytes() == before


def test_a_damaged_checkpoint_is_refused(make_trainer, tmp_path):
    make_trainer(tmp_path).run()
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(TrainError, match="cannot be read as a checkpoint"):
        make_trainer(tmp_path).resume()


def test_a_log_that_was_shortened_is_refused(make_trainer, tmp_path):
    make_trainer(tmp_path).run()
    (tmp_path / "rollouts.jsonl").write_text("")
    with pytest.raises(TrainError, match="shortened"):
        make_trainer(tmp_path).resume()


def test_an_environment_that_fails_is_left_out(make_trainer, tmp_path):
    output = []
    trainer = make_trainer(tmp_path, fails=("say-1",), report=output.append)
    reports = trainer.run()
    assert len(reports) == 9
    failed = [row for row in rows(tmp_path) if row["status"] == "error"]
    assert {row["task"] for row in failed} == {"say-1"}
    assert "reset: RuntimeError: no desktop" in failed[0]["problem"]
    assert any("say-1, rollout 0 is left out" in line for line in output)
    assert any("a group of 0 teaches nothing" in line for line in output)


def test_one_rollout_that_is_left_is_no_group(make_trainer):
    output = []
    trainer = make_trainer(report=output.append, batch=1, tasks=("say-1",))
    for env in trainer._environments[:3]:
        env.fails = ("say-1",)
    before = weights(trainer)
    assert trainer.step().groups == 0
    assert same(before, weights(trainer))
    assert any("a group of 1 teaches nothing" in line for line in output)


def test_if_nothing_can_be_played_the_run_ends(make_trainer):
    with pytest.raises(TrainError, match=r"none of 8 rollouts could be played.*no desktop"):
        make_trainer(fails=("say-0", "say-1", "say-2", "say-3", "say-0-0", "say-0-1")).run()


def test_equal_rewards_change_nothing(make_trainer):
    trainer = make_trainer(tasks=("say-9",), batch=1)  # no answer is right
    before = weights(trainer)
    report = trainer.step()
    assert (report.equal, report.groups, report.loss) == (1, 0, None)
    assert same(before, weights(trainer))


def test_a_loss_that_is_no_number_stops_before_the_step(make_trainer, tmp_path):
    trainer = make_trainer(tmp_path)
    trainer.step()
    trainer.save()
    before = weights(trainer)
    real = trainer.policy.log_probs

    def broken(turns):
        chances, mask = real(turns)
        return chances * float("nan"), mask

    trainer.policy.log_probs = broken
    with pytest.raises(TrainError, match="loss or its gradient is nan"):
        trainer.run()
    assert same(before, weights(trainer))
    assert make_trainer(tmp_path).resume()


def test_replay_acts_in_the_loop(make_trainer, tmp_path):
    replay = ReplayBuffer()
    trainer = make_trainer(tmp_path, replay=replay, epochs=12, rollouts=2, seed=1)
    reports = trainer.run()
    assert len(replay) > 0
    assert sum(report.replayed for report in reports) > 0


def test_wrong_arguments(make_trainer):
    with pytest.raises(ParameterError, match="given twice"):
        make_trainer(tasks=("say-1", "say-1"))
    with pytest.raises(ParameterError, match="there are none"):
        make_trainer(tasks=())
    with pytest.raises(ParameterTypeError, match=r"a list of names, such as \['say-1'\]"):
        make_trainer(tasks="say-1")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rollouts", 1),
        ("epochs", 0),
        ("learning_rate", 0.0),
        ("learning_rate", float("inf")),
        ("weight_decay", -0.1),
        ("clip_low", 2.0),
        ("clip_high", float("nan")),
        ("format_weight", -1.0),
        ("max_norm", 0.0),
        ("seed", -1),
    ],
)
def test_a_setting_out_of_its_range_is_refused(name, value):
    with pytest.raises(ParameterError, match=name):
        TrainSettings(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [("batch", True), ("epochs", 1.5), ("max_steps", "3"), ("learning_rate", "1e-3")],
)
def test_a_setting_of_another_type_is_refused(name, value):
    with pytest.raises(ParameterTypeError, match=name):
        TrainSettings(**{name: value})
