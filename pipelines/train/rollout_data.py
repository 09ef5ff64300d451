"""Rollouts as data for `torch.save`: numbers, texts and tensors, which load without code."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch

from hijack_data.config import load_config
from hijack_data.planner import Planner

from .errors import TrainError
from .rollouts import PolicyAnswer, PolicyTurn, Rollout, RolloutRequest
from .sampler import Draw


def rollout_to_data(rollout: Rollout) -> dict[str, Any]:
    """Return a rollout as data.

    Raises:
        TrainError: something observed is neither an array nor a text, a number or `None`.
    """
    request = rollout.request
    planner = request.draw.planner
    return {
        "step": request.step,
        "group": request.group,
        "slot": request.slot,
        "seed": request.seed,
        "stream_seed": request.stream_seed,
        "label": request.draw.label,
        "key": request.draw.key,
        "planner": "" if planner is None else json.dumps(planner.to_config()),
        "turns": [_packed_turn(turn) for turn in rollout.turns],
        "success": rollout.success,
        "well_formed": rollout.is_well_formed,
    }


def rollout_from_data(data: Mapping[str, Any]) -> Rollout:
    """Return the rollout that `rollout_to_data` wrote."""
    request = RolloutRequest(
        step=data["step"],
        group=data["group"],
        slot=data["slot"],
        seed=data["seed"],
        stream_seed=data["stream_seed"],
        draw=Draw(label=data["label"], planner=_planner(data["planner"]), key=data["key"]),
    )
    return Rollout(
        request=request,
        turns=[_unpacked_turn(turn) for turn in data["turns"]],
        success=data["success"],
        is_well_formed=data["well_formed"],
    )


def _planner(text: str) -> Planner | None:
    if not text:
        return None
    config = load_config({"corruptions": [json.loads(text)]})
    return next(iter(config.corruptions.values()))


def _packed_turn(turn: PolicyTurn) -> dict[str, Any]:
    return {
        "observation": {name: _packed_value(name, seen) for name, seen in turn.observation.items()},
        "action": turn.answer.action,
        "tokens": list(turn.answer.tokens),
        "logprobs": list(turn.answer.logprobs),
        "well_formed": turn.answer.is_well_formed,
    }


def _packed_value(name: str, seen: Any) -> Any:
    if isinstance(seen, np.ndarray):
        return torch.from_numpy(np.ascontiguousarray(seen))
    if seen is None or isinstance(seen, str | int | float | bool):
        return seen
    raise TrainError(
        f"observation {name!r} is a {type(seen).__name__}, which a replay buffer cannot store: give"
        " an array, a text, a number or None"
    )


def _unpacked_turn(data: Mapping[str, Any]) -> PolicyTurn:
    observation = {
        name: seen.numpy() if isinstance(seen, torch.Tensor) else seen
        for name, seen in data["observation"].items()
    }
    answer = PolicyAnswer(
        action=data["action"],
        tokens=tuple(data["tokens"]),
        logprobs=tuple(data["logprobs"]),
        is_well_formed=data["well_formed"],
    )
    return PolicyTurn(observation, answer)
