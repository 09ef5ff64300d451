"""The objective against its formulas written out, and against verl's functions where it is."""

import importlib.util
import math

import pytest

torch = pytest.importorskip("torch", reason="needs the extra [train]")

from hijack_data.errors import ParameterError  # noqa: E402
from pipelines.train.objective import clipped_loss, group_advantage, reward  # noqa: E402


def test_reward_is_success_and_a_penalty():
    assert reward(1.0, True) == 1.0
    assert reward(1.0, False) == 0.0
    assert reward(0.0, False) == -1.0
    assert reward(0.0, False, weight=0.5) == -0.5


def test_advantage_by_hand():
    result = group_advantage(torch.tensor([1.0, 0.0, 0.0, -1.0]))
    deviation = math.sqrt(2 / 3) + 1e-6
    assert result.tolist() == pytest.approx([1 / deviation, 0, 0, -1 / deviation])


@pytest.mark.parametrize("value", [0.0, 1.0, 0.1])
def test_equal_rewards_teach_nothing(value):
    assert group_advantage(torch.full((3,), value)).tolist() == [0.0] * 3


def test_a_group_of_one_is_refused():
    with pytest.raises(ParameterError, match="at least 2 rewards"):
        group_advantage(torch.tensor([1.0]))


def test_a_reward_that_is_no_number_is_refused():
    with pytest.raises(ParameterError, match="not finite"):
        group_advantage(torch.tensor([1.0, math.nan]))


def by_hand(new, old, advantage, mask):
    """Equation "grpo" of the paper for one response, negated, with clip 0.2 and 0.3."""
    terms = []
    for a, b, is_token in zip(new, old, mask, strict=True):
        if is_token:
            ratio = math.exp(a - b)
            bounded = min(max(ratio, 0.8), 1.3)
            terms.append(min(ratio * advantage, bounded * advantage))
    return -sum(terms) / len(terms)


def test_loss_by_hand():
    new = torch.tensor([[-1.0, -0.2, -3.0], [-0.5, -2.0, 9.0]])
    old = torch.tensor([[-1.0, -1.0, -1.0], [-1.0, -1.0, math.inf]])
    mask = torch.tensor([[True, True, True], [True, True, False]])
    advantages = torch.tensor([1.5, -0.7])
    result = clipped_loss(new, old, advantages, mask)
    rows = zip(new.tolist(), old.tolist(), advantages.tolist(), mask.tolist(), strict=True)
    assert result.tolist() == pytest.approx([by_hand(*row) for row in rows], rel=1e-5)


def test_masked_places_have_no_gradient():
    new = torch.tensor([[-1.0, -1.0]], requires_grad=True)
    old = torch.tensor([[-1.0, math.nan]])
    loss = clipped_loss(new, old, torch.tensor([1.0]), torch.tensor([[True, False]]))
    loss.sum().backward()
    assert new.grad.tolist() == [[-1.0, 0.0]]


def test_no_gradient_beyond_the_clip():
    new = torch.tensor([[0.0]], requires_grad=True)
    old = torch.tensor([[-1.0]])  # the ratio is e, above 1.3
    clipped_loss(new, old, torch.tensor([1.0]), torch.tensor([[True]])).sum().backward()
    assert new.grad.tolist() == [[0.0]]


def test_shapes_that_do_not_fit_are_refused():
    result = torch.zeros(1, 2)
    with pytest.raises(ParameterError, match="must be"):
        clipped_loss(result, result, torch.zeros(2), result.bool())
    with pytest.raises(ParameterError, match="no tokens"):
        clipped_loss(result, result, torch.zeros(1), result.bool())


@pytest.mark.skipif(
    importlib.util.find_spec("verl") is None,
    reason="verl is the oracle; install verl 0.9.x in an environment of its own to compare",
)
def test_equal_to_verl():
    import numpy as np
    from omegaconf import OmegaConf
    from verl.trainer.ppo import core_algos

    torch.manual_seed(0)
    rewards = torch.randn(8)
    mask = torch.rand(8, 5) < 0.8
    mask[:, 0] = True
    spread = torch.zeros(8, 5)
    spread[:, 0] = rewards
    reference, _ = core_algos.compute_grpo_outcome_advantage(
        spread, mask.float(), np.array(["a"] * 4 + ["b"] * 4)
    )
    ours = torch.cat([group_advantage(rewards[:4]), group_advantage(rewards[4:])])
    assert torch.allclose(reference[:, 0], ours, atol=1e-6)
    new, old = torch.randn(8, 5), torch.randn(8, 5)
    config = OmegaConf.create(
        {
            "clip_ratio": 0.2,
            "clip_ratio_low": 0.2,
            "clip_ratio_high": 0.3,
            "clip_ratio_c": 1e9,  # the paper has no third bound
            "global_batch_info": {},
        }
    )
    loss, *_ = core_algos.compute_policy_loss_vanilla(
        old, new, reference, mask.float(), loss_agg_mode="seq-mean-token-mean", config=config
    )
    assert torch.allclose(loss, clipped_loss(new, old, ours, mask).mean(), atol=1e-5)
