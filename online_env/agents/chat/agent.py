"""`ChatAgent`: a model behind an API, asked once per step."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..base import Observation
from ..settings import AgentSettings
from .endpoint import Endpoint
from .onlooker import Onlooker
from .parsing import ReplyParser
from .prompts import Prompt, read_prompt
from .query import ModelQuery, Reply, ScreenPicture, Turn
from .run import ChatRun
from .usage import UsageMeter

LANGUAGE = "English"
# Characters of an answer that later requests repeat, so that a huge answer is not sent again in
# full.
MAX_ANSWER_CHARS = 32_000


class ChatAgent:
    """Asks a model for each action, with its earlier pictures and answers.

    Args:
        settings: the agent file.
        run: the state shared by the agents of a run: log, replay, prompts.
    """

    def __init__(self, settings: AgentSettings, run: ChatRun | None = None) -> None:
        self._settings = settings
        self._run = run or ChatRun()
        self._parser = ReplyParser.of(settings)
        self._prompt = read_prompt(settings.prompt, self._run.folders(settings))
        self._meter = UsageMeter()
        self._model = self._endpoint()
        self._turns: list[Turn] = []

    def reset(self) -> None:
        """Forget the episode and close connections, but keep the usage counts."""
        self._turns = []
        self._model.close()

    @property
    def usage(self) -> Mapping[str, Any]:
        """Requests, tokens and money used by this agent, in total and for each step."""
        return self._meter.to_data()

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Ask the model.

        Args:
            instruction: the task in words.
            obs: `obs["screenshot"]` is uint8 RGB `[H, W, 3]`.
        """
        self._meter.begin_step()
        return self._act(instruction, ScreenPicture(obs["screenshot"]))

    def _act(
        self, instruction: str, picture: ScreenPicture, reminder: str = ""
    ) -> tuple[str, Sequence[str]]:
        reply = self._model.ask(self._query(instruction, picture, reminder), "act")
        words = reply.shown
        self._turns.append(_make_turn(picture, reply))
        return words, self._parser.read(reply, picture.size)

    def _query(self, instruction: str, picture: ScreenPicture, reminder: str) -> ModelQuery:
        return ModelQuery(
            prompt=self._fill_prompt(instruction, picture, reminder),
            picture=picture,
            turns=tuple(self._turns),
            pictures=self._settings.history,
            summarised=self._summarised,
        )

    @property
    def _summarised(self) -> bool:
        return False

    def _fill_prompt(self, instruction: str, picture: ScreenPicture, reminder: str) -> Prompt:
        height, width = self._parser.seen(picture.size)
        values = {
            "instruction": instruction,
            "language": LANGUAGE,
            "width": width,
            "height": height,
            "reminder": reminder,
        }
        filled = self._prompt.fill(values)
        if not reminder or self._prompt.has("reminder"):
            return filled
        first = f"{filled.first}\n\nReminder: {reminder}".lstrip("\n")
        return Prompt(system=filled.system, first=first, each=filled.each)

    def _endpoint(self) -> Endpoint:
        return Endpoint(
            self._settings.model,
            self._meter,
            self._run.recorder,
            self._run.waits,
            offline=self._run.replay is not None,
        )


class OnlookedAgent(ChatAgent):
    """The paper's AgentHijack-Agent: an agent whose steps an onlooker watches.

    Before its first step, the onlooker compares the screen with the error repository. If it finds
    an error, the agent asks once for re-initialisation, and the onlooker looks again; if it still
    finds one, the agent's prompt contains its reminder. After each step, the onlooker summarises
    what happened, and the summary replaces the agent's own words in the history. A change that the
    action cannot have caused has an entry of its own there. The onlooker is given pictures, the
    instruction and actions, nothing else.
    """

    def __init__(self, settings: AgentSettings, run: ChatRun | None = None) -> None:
        super().__init__(settings, run)
        self._onlooker = Onlooker(settings, self._run, self._meter)
        self._checks = 0
        self._reminder = ""

    def reset(self) -> None:
        """Forget the episode."""
        super().reset()
        self._onlooker.close()
        self._checks = 0
        self._reminder = ""

    @property
    def _summarised(self) -> bool:
        return self._onlooker.summarises

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Let the onlooker check or summarise, then ask the model.

        Args:
            instruction: the task in words.
            obs: `obs["screenshot"]` is uint8 RGB `[H, W, 3]`.
        """
        self._meter.begin_step()
        picture = ScreenPicture(obs["screenshot"])
        if self._needs_check():
            self._reminder = self._onlooker.check(picture, instruction)
            self._checks += 1
            if self._reminder and self._checks == 1 and self._onlooker.reinits:
                return f"Reminder: {self._reminder}", [self._onlooker.REQUEST]
        if self._turns and self._onlooker.summarises and not self._turns[-1].unexpected:
            self._summarise(instruction, picture)
        return self._act(instruction, picture, self._reminder)

    def _summarise(self, instruction: str, picture: ScreenPicture) -> None:
        """Replace the last turn's words by a summary; an unexpected change is a turn of its own."""
        last = self._turns[-1]
        summary, unexpected = self._onlooker.summarise(instruction, last, picture)
        self._turns[-1] = replace(last, summary=summary)
        if unexpected:
            self._turns.append(
                Turn(picture=picture, answer="", summary=unexpected, unexpected=True)
            )

    def _needs_check(self) -> bool:
        """Return whether the agent has not acted yet and the first check is not finished."""
        if self._turns or not self._onlooker.checks:
            return False
        has_asked = bool(self._reminder) and self._onlooker.reinits
        return self._checks == 0 or (has_asked and self._checks == 1)


def _make_turn(picture: ScreenPicture, reply: Reply) -> Turn:
    return Turn(picture=picture, answer=reply.shown[:MAX_ANSWER_CHARS], raw=reply.raw)


def make_agent(settings: AgentSettings, run: ChatRun | None = None) -> ChatAgent:
    """Return the agent of a file: with an onlooker, if the file has one."""
    if settings.onlooker is None:
        return ChatAgent(settings, run)
    return OnlookedAgent(settings, run)
