"""The arms of the comparison: GRPO, DA-GRPO, and DA-GRPO with one change."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One way to train.

    Args:
        corrupted: whether the rollouts are corrupted; without, this is GRPO.
        per: the unit for which a corruption is drawn, see `CorruptionSampler`.
        p_clean: share of the rollouts that stay clean, 0..1.
        replay: whether there is a replay buffer.
        replay_slot: which rollout is replaced; `None` draws it.
        format_share: the format penalty, as a share of the configuration's.
        words: its description, for tables.
    """

    corrupted: bool = True
    per: str = "rollout"
    p_clean: float = 0.0
    replay: bool = True
    replay_slot: int | None = None
    format_share: float = 1.0
    words: str = ""


BASE = "grpo"
MAIN = "da_grpo"
ARMS: Mapping[str, Arm] = MappingProxyType(
    {
        BASE: Arm(corrupted=False, words="GRPO, clean rollouts"),
        MAIN: Arm(words="DA-GRPO, a corruption for each rollout"),
        "per_group": Arm(per="group", words="one corruption for each group"),
        "per_worker": Arm(per="worker", words="one corruption for each worker"),
        "no_replay": Arm(replay=False, words="without the replay buffer"),
        "no_format": Arm(format_share=0.0, words="without the format penalty"),
        "with_clean": Arm(p_clean=0.2, words="a fifth of the rollouts clean"),
        "authors": Arm(
            per="worker",
            replay_slot=0,
            format_share=0.5,
            words="as the authors' code: per worker, slot 0, half the penalty",
        ),
    }
)
