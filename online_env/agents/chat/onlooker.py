"""The onlooker of the paper: it watches the screen while another agent acts."""

import re
from typing import ClassVar

from hijack_data.actions.agent_actions import REINIT

from ...errors import AgentSetupError
from ..settings import AgentSettings, KnownError
from .endpoint import Endpoint
from .prompts import read_prompt
from .query import NOT_THE_AGENT, ModelQuery, ScreenPicture, Turn
from .run import ChatRun
from .usage import UsageMeter

CHECK = "onlooker_check"
SUMMARY = "onlooker_summary"
_UNEXPECTED = re.compile(r"not the agent['\u2019]s doing\s*:", re.IGNORECASE)
_REMINDER = re.compile(r"Reminder\s*:", re.IGNORECASE)
_QUOTES = " \t\r\n\"'`*."
_NONE = "none"


class Onlooker:
    """Checks the first screen, and summarises what happened after each step.

    Args:
        settings: an agent file with an onlooker.
        run: what it shares with others: log, replay, prompts.
        meter: counts what is used.

    Raises:
        AgentSetupError: the file has no onlooker.
    """

    REQUEST: ClassVar[str] = REINIT

    def __init__(self, settings: AgentSettings, run: ChatRun, meter: UsageMeter) -> None:
        onlooker = settings.onlooker
        if onlooker is None:
            raise AgentSetupError(f"{settings.source}: has no onlooker; add one: onlooker: {{}}")
        self._onlooker = onlooker
        self._meter = meter
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
    def summarises(self) -> bool:
        """Whether it summarises what happened after each step."""
        return self._onlooker.summarise

    def close(self) -> None:
        """Close its connections."""
        self._model.close()

    def check(self, picture: ScreenPicture, instruction: str) -> str:
        """Return the reminder that a screen calls for; empty if nothing is wrong.

        An answer without `Reminder:` or `None` cannot be read. It is counted, and treated as
        `None`.
        """
        values = {"errors": _error_list(self._onlooker.errors), "instruction": instruction}
        query = ModelQuery(prompt=self._check.fill(values), picture=picture)
        reminder = read_reminder(self._model.ask(query, "check").text)
        if reminder is None:
            self._meter.unreadable_checks += 1
            return ""
        return reminder

    def summarise(self, instruction: str, turn: Turn, after: ScreenPicture) -> tuple[str, str]:
        """Return what the action of a turn did, and what else happened until the next picture.

        Each of the two is empty if the answer does not have it. An answer in which nothing is set
        apart by `NOT_THE_AGENT` is about the action as a whole.
        """
        values = {"instruction": instruction, "action": turn.answer}
        query = ModelQuery(prompt=self._summary.fill(values), picture=after, before=(turn.picture,))
        return read_summary(self._model.ask(query, "summarise").text)


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
    own, _, unexpected = _UNEXPECTED.sub(NOT_THE_AGENT, text, 1).partition(NOT_THE_AGENT)
    unexpected = unexpected.strip()
    if unexpected.strip(_QUOTES).lower() in ("", _NONE, "nothing"):
        unexpected = ""
    return own.strip(), unexpected


def _error_list(errors: tuple[KnownError, ...]) -> str:
    """Return an error repository as a numbered list."""
    entries: list[str] = []
    for number, error in enumerate(errors, 1):
        entries.append(f'{number}. {error.name}: {error.looks}\n   Say: "{error.say}"')
    return "\n".join(entries)
