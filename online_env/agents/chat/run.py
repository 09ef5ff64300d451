"""The state shared by all chat agents of a run: log or replay, the user's prompts, and waits."""

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from ..settings import AgentSettings
from .endpoint import RetryWaits
from .request_log import NoRecorder, RequestLog, RequestRecorder, RequestReplay


@dataclass(kw_only=True)
class ChatRun:
    """The run of chat agents, whose episodes are played one after the other.

    Args:
        prompts: folder with prompts that replace all others by name.
        log: folder where requests and answers go; `None` keeps none.
        replay: folder of an earlier log that answers instead of the endpoint.
        password: of the machine's user, for prompts that say it.
        secrets: texts that must not be logged, beside the keys.
        waits: between the tries of a request.
    """

    prompts: Path | None = None
    log: Path | None = None
    replay: Path | None = None
    password: str = "password"
    secrets: tuple[str, ...] = ()
    waits: RetryWaits = field(default_factory=RetryWaits)
    recorder: RequestRecorder = field(default_factory=NoRecorder)

    def begin(self, episode: str, files: Iterable[AgentSettings]) -> None:
        """Open the log of an episode, or its replay.

        Args:
            episode: its id.
            files: the agent files whose models are asked in it; their keys are kept out of the log.

        Raises:
            ReplayError: The replayed run has no such episode.
        """
        name = f"{episode}.jsonl"
        if self.replay is not None:
            self.recorder = RequestReplay(self.replay / name)
        elif self.log is not None:
            keys = tuple(secret for settings in files for secret in _secrets(settings))
            self.recorder = RequestLog(self.log / name, (*keys, *self.secrets))

    def folders(self, settings: AgentSettings) -> tuple[str | os.PathLike[str], ...]:
        """Return the folders in which prompts are looked up first."""
        folders: list[str | os.PathLike[str]] = []
        if self.prompts is not None:
            folders.append(self.prompts)
        if settings.prompts is not None:
            folders.append(settings.prompts)
        return tuple(folders)


def _secrets(settings: AgentSettings) -> Iterable[str]:
    for model in settings.models:
        if model.api_key_env is not None:
            yield os.environ.get(model.api_key_env, "")
