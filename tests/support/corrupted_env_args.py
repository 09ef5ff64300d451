"""An environment for AgentLab's experiments, at the top of a module because they pickle it."""

from dataclasses import dataclass
from typing import Any

from agentlab.experiments.loop import EnvArgs

from online_env.browser.browsergym import corrupt


@dataclass
class CorruptedEnvArgs(EnvArgs):
    """A task of BrowserGym under a corruption."""

    corruption: str = ""

    def make_env(self, *args: Any, **options: Any) -> Any:
        """Return the environment of AgentLab, corrupted."""
        return corrupt(super().make_env(*args, **options), self.corruption, seed=0)
