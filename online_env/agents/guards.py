"""Guards by name: `rules`, `model`, or an agent file whose onlooker watches."""

from dataclasses import replace
from pathlib import Path

from hijack_data.errors import ParameterError, UnknownNameError, suggest

from . import agent_files
from .chat.onlooker import ModelOnlooker
from .chat.run import ChatRun
from .guarded import Onlooker
from .makers import FileAgentMaker
from .registry import AGENTS
from .settings import AgentSettings, OnlookerSettings

RULES = "rules"
MODEL = "model"
_CHOICES = f"{RULES}, {MODEL} (the model of an agent file also looks on), or an agent file"


def find_guard(text: str) -> str:
    """Return the name of a guard that a user asks for; an agent file is read and registered.

    Raises:
        UnknownNameError: There is no such guard.
        ConfigError: The agent file has mistakes.
    """
    if text in (RULES, MODEL):
        return text
    if agent_files.is_agent_file(text):
        return AGENTS.find(text)
    names = (RULES, MODEL, *agent_files.packaged())
    raise UnknownNameError(f"--guard is {_CHOICES}, not {text!r}{suggest(text, names)}")


def is_file(guard: str) -> bool:
    """Return whether a guard is an agent file, which is registered as an agent."""
    return guard not in ("", RULES, MODEL)


def check_guard(guard: str, agents: tuple[str, ...]) -> None:
    """Check that a guard can watch these agents.

    Raises:
        ParameterError: An agent has an onlooker of its own, cannot be reminded, or has no model
            that could look on.
        MissingDependencyError: The extra `ocr` is not installed.
    """
    if not guard:
        return
    for name in agents:
        entry = AGENTS.get(name)
        settings = entry.settings if isinstance(entry, FileAgentMaker) else None
        if getattr(entry, "has_onlooker", False):
            advice = ", or take the onlooker out of its file" if settings is not None else ""
            raise ParameterError(
                f"--guard {guard}: {name} has an onlooker of its own; leave out --guard{advice}"
            )
        if settings is not None and settings.model.client == "openai_computer":
            raise ParameterError(
                f"--guard {guard}: OpenAI keeps the conversation of {name}, so reminders would not"
                " reach it; leave out --guard, or name an agent file with another client"
            )
        if settings is None and guard == MODEL:
            raise ParameterError(
                f"--guard {MODEL}: {name} is no agent file; name {RULES}, or the agent file of the"
                " model that is to look on"
            )
    if guard == RULES:
        from .pixel.rules_onlooker import RulesOnlooker  # loads OCR

        RulesOnlooker.check_ready()


def share_in(guard: str, folder: Path) -> None:
    """Share what the guard reads with the other processes of a run, in its folder."""
    if guard == RULES:
        from .pixel.agent import Pixel  # loads OCR

        Pixel.share_in(folder)


def make_onlooker(guard: str, agent: str, run: ChatRun | None = None) -> Onlooker:
    """Return a new onlooker for one episode of an agent.

    Args:
        guard: as `find_guard` returned it.
        agent: the agent's name in the registry.
        run: the log or replay of the episode; by default that of the guard's file.

    Raises:
        UnknownNameError: The guard is no agent file.
        MissingDependencyError: The extra `ocr` is not installed.
    """
    if guard == RULES:
        from .pixel.rules_onlooker import RulesOnlooker  # loads OCR

        return RulesOnlooker()
    maker = AGENTS.get(agent if guard == MODEL else guard)
    if not isinstance(maker, FileAgentMaker):
        raise UnknownNameError(f"--guard is {_CHOICES}, not {guard!r}")
    return ModelOnlooker(_with_onlooker(maker.settings), run or maker.run)


def _with_onlooker(settings: AgentSettings) -> AgentSettings:
    """Return an agent file with an onlooker: its own, or else one of the same model."""
    if settings.onlooker is not None:
        return settings
    errors = agent_files.read_errors(agent_files.DEFAULT_ERRORS)[0]
    return replace(settings, onlooker=OnlookerSettings(model=settings.model, errors=errors))
