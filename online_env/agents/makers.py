"""Agent files in the registry of agents, where each is an object that makes agents."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hijack_data.errors import suggest

from ..errors import AgentSetupError
from .agent_files import DEFAULT_ERRORS, read_agent, read_errors
from .base import Agent
from .chat import prompts
from .chat.agent import make_agent
from .chat.onlooker import CHECK
from .chat.run import ChatRun
from .chat.ui_tars_prompts import NAME, SOURCES, read_ui_tars_prompts, write_prompts
from .settings import AgentSettings


class FileAgentMaker:
    """Makes the agents of an agent file.

    Args:
        settings: the file.
    """

    def __init__(self, settings: AgentSettings) -> None:
        self.settings = settings
        self.run = ChatRun()

    def __call__(self) -> Agent:
        """Return a new agent."""
        return make_agent(self.settings, self.run)

    @property
    def has_onlooker(self) -> bool:
        """Whether the file has an onlooker."""
        return self.settings.onlooker is not None

    @property
    def source(self) -> dict[str, str]:
        """Return what a run records: the file's path and SHA-256, and that of its prompts."""
        data = {"path": self.settings.source, "sha256": self.settings.sha256}
        folders = self.run.folders(self.settings)
        if folders:
            data["prompts_sha256"] = " ".join(prompts.digest(folder) for folder in folders)
        return data

    def check_errors(self) -> None:
        """Check that the onlooker is asked for the errors of the user's repository.

        Raises:
            AgentSetupError: the prompt of its check has errors of its own instead.
        """
        onlooker = self.settings.onlooker
        if onlooker is None or not onlooker.check:
            return
        is_asked = prompts.read_prompt(CHECK, self.run.folders(self.settings)).has("errors")
        if not is_asked and onlooker.errors != read_errors(DEFAULT_ERRORS)[0]:
            raise AgentSetupError(
                f"{self.settings.source}: onlooker.errors would not be asked for, since the prompt"
                f" {CHECK} names errors of its own: put {{errors}} into it, or leave out one of"
                " onlooker.errors and the prompt (--prompts, prompts)"
            )

    def check_prices(self) -> None:
        """Check that the price of every model is known.

        Raises:
            AgentSetupError: a price is unknown.
        """
        for model in self.settings.models:
            if model.prices is None:
                raise AgentSetupError(
                    f"--max-cost: {self.settings.source} does not say what {model.model} costs; add"
                    " prices: {input: 2.5, output: 10}, in USD per million tokens (0 for your own)"
                )


def agent_file_maker(path_or_name: str) -> FileAgentMaker:
    """Return the maker for an agent file.

    Raises:
        ConfigError: All mistakes of the file.
    """
    return FileAgentMaker(read_agent(path_or_name))


def file_makers(entries: Iterable[Any]) -> list[FileAgentMaker]:
    """Return those of some registry entries that are makers of agent files."""
    return [entry for entry in entries if isinstance(entry, FileAgentMaker)]


def asks_for_reinit(entry: Any) -> bool:
    """Return whether a registry entry makes agents whose onlooker asks for re-initialisation."""
    onlooker = entry.settings.onlooker if isinstance(entry, FileAgentMaker) else None
    return onlooker is not None and onlooker.check and onlooker.reinit


def prompts_folder(path: Path) -> Path:
    """Check that a folder of prompts is not empty, and that each replaces a packaged one.

    For a Python file with UI-TARS' prompts, the folder is made from it.

    Raises:
        AgentSetupError: there is no such folder, or a file does not have the name of a packaged
            prompt.
        ConfigError: A prompt has mistakes.
    """
    if path.suffix == ".py":
        path = write_prompts(read_ui_tars_prompts(path))
    files = sorted(path.glob(f"*{prompts.SUFFIX}")) if path.is_dir() else []
    names = prompts.names()
    if not files and str(path) == NAME:
        raise AgentSetupError(
            f"--prompts {NAME}: UI-TARS' own wording is read from your copy of a file: {SOURCES}"
        )
    if not files:
        raise AgentSetupError(f"--prompts {path}: no folder with prompts (*{prompts.SUFFIX})")
    for file in files:
        if file.stem not in names:
            hint = suggest(file.stem, names)
            raise AgentSetupError(f"--prompts {path}: {file.name} replaces no prompt of ours{hint}")
        prompts.read_prompt(file.stem, (path,))
    return path
