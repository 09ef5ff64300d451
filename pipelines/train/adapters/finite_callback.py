"""End a run whose gradient is not finite, for trainers of transformers."""

from typing import Any

import torch
from transformers import TrainerCallback

from ..errors import TrainError


class FiniteCallback(TrainerCallback):
    """Ends a run before a step that would make its weights NaN; for any trainer of transformers."""

    def on_pre_optimizer_step(self, args: Any, state: Any, control: Any, **kwargs: Any) -> None:
        """Check the gradients.

        Raises:
            TrainError: a gradient is not finite.
        """
        for name, parameter in kwargs["model"].named_parameters():
            if parameter.grad is not None and not bool(torch.isfinite(parameter.grad).all()):
                raise TrainError(
                    f"step {state.global_step}: the gradient of {name} is not finite; no step was"
                    " taken. Lower learning_rate or max_grad_norm, and go on from the last"
                    " checkpoint"
                )
