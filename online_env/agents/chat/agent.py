"""`ChatAgent`: a model behind an API, asked once per step."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..base import Observation
from ..guarded import Guarded, Notice, add_notice
from ..settings import AgentSettings
from .endpoint import Endpoint
from .onlooker import MAX_ANSWER_CHARS, ModelOnlooker
from .parsing import ReplyParser
from .prompts import Prompt, read_prompt
from .query import ModelQuery, Reply, ScreenPicture, Turn
from .run import ChatRun
from .usage import UsageMeter

LANGUAGE = "English"


class ChatAgent:
    """Asks a model for each action, with its earlier pictures and answers.

    Args:
        settings: the agent file.
        run: the state shared by the agents of a run: log, replay, prompts.
        meter: counts what is used, for a guard that counts steps, too; by default one of its own.
    """

    words_have_actions = True

    def __init__(
        self, settings: AgentSettings, run: ChatRun | None = None, meter: UsageMeter | None = None
    ) -> None:
        self._settings = settings
        self._run = run or ChatRun()
        self._parser = ReplyParser.of(settings)
        self._prompt = read_prompt(settings.prompt, self._run.folders(settings))
        self._counts_steps = meter is None
        self._meter = UsageMeter() if meter is None else meter
        self._model = self._endpoint()
        self._turns: list[Turn] = []
        self._notice = Notice()

    def reset(self) -> None:
        """Forget the episode and close connections, but keep the usage counts."""
        self._turns = []
        self._notice = Notice()
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
        if self._counts_steps:
            self._meter.begin_step()
        picture = ScreenPicture(obs["screenshot"])
        if self._settings.model.tool is None:
            self._add_notice(picture)
        else:  # the history of a tool is made of the model's calls
            instruction = add_notice(instruction, replace(self._notice, reminder=""))
        reply = self._model.ask(self._query(instruction, picture, self._notice.reminder), "act")
        words = reply.transcript
        self._turns.append(_make_turn(picture, reply))
        return words, self._parser.read(reply, picture.size)

    def take_notice(self, notice: Notice) -> None:
        """Take what an onlooker says of the picture that the next `predict` gets.

        The prompt has the reminder. The summary replaces the words of the last turn, and what the
        action cannot have caused is a turn of its own (the paper's o_k, d_k). With a computer tool,
        both stand after the instruction.
        """
        self._notice = notice

    def _add_notice(self, picture: ScreenPicture) -> None:
        notice = self._notice
        if self._turns and notice.summary:
            self._turns[-1] = replace(self._turns[-1], summary=notice.summary)
        if self._turns and notice.unexpected:
            unexpected = notice.unexpected
            self._turns.append(
                Turn(picture=picture, answer="", summary=unexpected, unexpected=True)
            )
        # A request that fails is sent again: the history must not have the notice twice.
        self._notice = Notice(reminder=notice.reminder)

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
        """Whether summaries replace the model's own words: those of its onlooker, or of a guard."""
        onlooker = self._settings.onlooker
        if onlooker is not None:
            return onlooker.summarise
        return any(turn.summary and not turn.unexpected for turn in self._turns)

    def _fill_prompt(self, instruction: str, picture: ScreenPicture, reminder: str) -> Prompt:
        height, width = self._parser.model_size(picture.size)
        values = {
            "instruction": instruction,
            "language": LANGUAGE,
            "width": width,
            "height": height,
            "reminder": reminder,
            "password": self._run.password,
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


def _make_turn(picture: ScreenPicture, reply: Reply) -> Turn:
    return Turn(picture=picture, answer=reply.transcript[:MAX_ANSWER_CHARS], raw=reply.raw)


def make_agent(settings: AgentSettings, run: ChatRun | None = None) -> ChatAgent | Guarded:
    """Return the agent of a file: the paper's AgentHijack-Agent, if the file has an onlooker."""
    if settings.onlooker is None:
        return ChatAgent(settings, run)
    run = run or ChatRun()
    meter = UsageMeter()
    return Guarded(ChatAgent(settings, run, meter), ModelOnlooker(settings, run, meter))
