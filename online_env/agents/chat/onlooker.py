"""The onlooker of the paper as a model: it watches the screen while another agent acts."""

import re
from collections.abc import Mapping
from typing import Any

from hijack_data.types import UInt8Array

from ...errors import AgentSetupError
from ..guarded import Notice, PastStep
from ..settings import AgentSettings, KnownError, OnlookerSettings
from .endpoint import Endpoint
from .prompts import read_prompt
from .query import NOT_THE_AGENT, ModelQuery, ScreenPicture
from .run import ChatRun
from .usage import UsageMeter

CHECK = "onlooker_check"
SUMMARY = "onlooker_summary"
_UNEXPECTED = re.compile(r"not the agent['\u2019]s doing\s*:", re.IGNORECASE)
_REMINDER = re.compile(r"Reminder\s*:", re.IGNORECASE)
_QUOTES = " \t\r\n\"'`*."
_NONE = "none"
# Characters of an answer that later requests repeat, so that a huge answer is not sent again in
# full.
MAX_ANSWER_CHARS = 32_000
ENVIRONMENT_ERROR = "environment error"


class ModelOnlooker:
    """A model that checks the first screen, and summarises what happened after each step.

    It never acts itself: it asks for re-initialisation, and reminds the agent.

    Args:
        settings: an agent file with an onlooker.
        run: what it shares with others: log, replay, prompts.
        meter: counts what is used; by default one of its own.

    Raises:
        AgentSetupError: the file has no onlooker.
    """

    name: str = "model"

    def __init__(
        self, settings: AgentSettings, run: ChatRun, meter: UsageMeter | None = None
    ) -> None:
        onlooker = settings.onlooker
        if onlooker is None:
            raise AgentSetupError(f"{settings.source}: has no onlooker; add one: onlooker: {{}}")
        self._source = {"path": settings.source, "sha256": settings.sha256}
        self._onlooker: OnlookerSettings = onlooker
        self._counts_alone = meter is None
        self._meter = meter = UsageMeter() if meter is None else meter
        folders = run.folders(settings)
        self._check = read_prompt(CHECK, folders)
        self._summary = read_prompt(SUMMARY, folders)
        self._model = Endpoint(
            onlooker.model, meter, run.recorder, run.waits, offline=run.replay is not None
        )

    @property
    def checks(self) -> bool:
        """Whether it checks the first screen."""
        return self._onlooker.check

    @property
    def reinits(self) -> bool:
        """Whether it asks for re-initialisation if the check finds an error."""
        return self._onlooker.reinit

    @property
    def settings(self) -> Mapping[str, Any]:
        """Its file and modules, for the record."""
        onlooker = self._onlooker
        modules = {"check": onlooker.check, "reinit": onlooker.reinit}
        return {**self._source, **modules, "summarise": onlooker.summarise}

    @property
    def usage(self) -> Mapping[str, Any] | None:
        """What it has used; `None` if it shares a meter, whose owner reports it."""
        return self._meter.to_data() if self._counts_alone else None

    def reset(self) -> None:
        """Close its connections; the usage counts stay."""
        self._model.close()

    def begin_step(self) -> None:
        """Count everything from now on for the next step."""
        self._meter.begin_step()

    def check(self, picture: UInt8Array, instruction: str) -> Notice:
        """Return the reminder that a screen calls for.

        An answer without `Reminder:` or `None` cannot be read. It is counted, and treated as
        `None`.
        """
        values = {"errors": _error_list(self._onlooker.errors), "instruction": instruction}
        query = ModelQuery(prompt=self._check.fill(values), picture=ScreenPicture(picture))
        reminder = read_reminder(self._model.ask(query, "check").text)
        if reminder is None:
            self._meter.unreadable_checks += 1
        return Notice(kind=ENVIRONMENT_ERROR, reminder=reminder) if reminder else Notice()

    def watch(self, instruction: str, step: PastStep, picture: UInt8Array) -> Notice:
        """Return what the last action did, and what else happened until the next picture.

        Each of the two is empty if the answer does not have it. An answer in which nothing is set
        apart by `NOT_THE_AGENT` is about the action as a whole.
        """
        if not self._onlooker.summarise:
            return Notice()
        values = {"instruction": instruction, "action": step.text[:MAX_ANSWER_CHARS]}
        query = ModelQuery(
            prompt=self._summary.fill(values),
            picture=ScreenPicture(picture),
            before=(ScreenPicture(step.picture),),
        )
        summary, unexpected = read_summary(self._model.ask(query, "summarise").text)
        return Notice(summary=summary, unexpected=unexpected)


def read_reminder(text: str) -> str | None:
    """Return the reminder in an answer: empty for the word `None`; `None` if neither is there."""
    parts = _REMINDER.split(text)
    last = parts[-1].strip()
    if last.strip(_QUOTES).lower() == _NONE:
        return ""
    if len(parts) == 1 or not last.strip(_QUOTES):
        return None
    return last.strip(" \t\r\n\"'`")


def read_summary(text: str) -> tuple[str, str]:
    """Return the parts of a summary before and after the words `NOT_THE_AGENT`."""
    summary, _, unexpected = _UNEXPECTED.sub(NOT_THE_AGENT, text, 1).partition(NOT_THE_AGENT)
    unexpected = unexpected.strip()
    if unexpected.strip(_QUOTES).lower() in ("", _NONE, "nothing"):
        unexpected = ""
    return summary.strip(), unexpected


def _error_list(errors: tuple[KnownError, ...]) -> str:
    """Return an error repository as a numbered list."""
    entries: list[str] = []
    for number, error in enumerate(errors, 1):
        entries.append(f'{number}. {error.name}: {error.looks}\n   Say: "{error.say}"')
    return "\n".join(entries)
