"""The objective of DA-GRPO: reward, advantage within the group, clipped loss (paper, section 5).

There is no KL term: the paper turns it off.
"""

import torch

from hijack_data.errors import ParameterError

EPSILON = 1e-6  # added to the deviation, as in verl
CLIP_LOW = 0.2
CLIP_HIGH = 0.3


def reward(success: float, is_well_formed: bool, weight: float = 1.0) -> float:
    """Return the reward of a rollout, `success + format` (paper, equation "reward").

    Args:
        success: 1 if the task was solved, 0 otherwise; scores between them are used unchanged.
        is_well_formed: whether every answer had the required form; otherwise `weight` is
            subtracted.
        weight: of the penalty: 1 in the paper, 0.5 in the authors' code, 0 for none.
    """
    return success if is_well_formed else success - weight


def group_advantage(rewards: torch.Tensor) -> torch.Tensor:
    """Return `(r - mean) / deviation` within one group (paper, section 5).

    The deviation is that of a sample (divided by G - 1) plus 1e-6, as in verl. If all rewards are
    equal, all advantages are exactly 0: such a group has no gradient.

    Args:
        rewards: float `[G]`, G at least 2.

    Returns:
        Float `[G]`.

    Raises:
        ParameterError: the group has fewer than two rollouts, or a reward is not finite.
    """
    if rewards.ndim != 1 or rewards.numel() < 2:
        raise ParameterError(
            f"a group needs at least 2 rewards, got shape {list(rewards.shape)}: the advantage"
            " compares rollouts of one task; use rollouts: 2 or more"
        )
    if not bool(torch.isfinite(rewards).all()):
        raise ParameterError(f"a reward is not finite: {rewards.tolist()}")
    if bool((rewards == rewards[0]).all()):
        return torch.zeros_like(rewards)
    return (rewards - rewards.mean()) / (rewards.std() + EPSILON)


def clipped_loss(
    new: torch.Tensor,
    old: torch.Tensor,
    advantages: torch.Tensor,
    mask: torch.Tensor,
    *,
    low: float = CLIP_LOW,
    high: float = CLIP_HIGH,
) -> torch.Tensor:
    """Return the loss of each response (paper, equation "grpo", negated).

    The ratio of the probabilities is clipped to `[1 - low, 1 + high]`, and the loss of a response
    is the mean over its tokens, so a long response weighs as much as a short one.

    Args:
        new: float `[R, L]`, log-probabilities of the tokens under the policy that is trained.
        old: float `[R, L]`, under the policy before the update; no gradient flows into it.
        advantages: float `[R]`.
        mask: bool `[R, L]`, which tokens the policy wrote; each row has at least one.
        low: 0.2 in the paper.
        high: 0.3 in the paper.

    Returns:
        Float `[R]`.

    Raises:
        ParameterError: the shapes do not fit, or a response has no tokens.
    """
    rows = advantages.shape[0] if advantages.ndim == 1 else -1
    if not new.shape == old.shape == mask.shape or new.ndim != 2 or new.shape[0] != rows:
        shapes = [list(tensor.shape) for tensor in (new, old, mask, advantages)]
        raise ParameterError(f"new, old, mask must be [R, L] and advantages [R], got {shapes}")
    counts = mask.sum(1)
    if not bool((counts > 0).all()):
        raise ParameterError("a response has no tokens: leave its rollout out of the group")
    # masked places may hold any value; 0 keeps them out of the gradient
    change = torch.where(mask, new - old.detach(), torch.zeros_like(new))
    ratio = change.exp()
    bounded = ratio.clamp(1 - low, 1 + high)
    weight = advantages.unsqueeze(1)
    gain = torch.minimum(ratio * weight, bounded * weight)
    total = torch.where(mask, gain, torch.zeros_like(gain)).sum(1)
    return -total / counts
