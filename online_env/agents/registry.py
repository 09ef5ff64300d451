"""All agents by name, and the one that does nothing.

An agent of your own is one class with `predict`, see `base.Agent`: from an installed package
(entry points `agenthijack.agents`), or as `--agent my_agent.py:MyAgent`. A model behind an API is
an agent file: `--agent my_agent.yaml`, or the bare name of one that comes with the package.
"""

from collections.abc import Callable, Sequence
from typing import TypeAlias

from hijack_data.entry_points import left_out
from hijack_data.errors import suggest
from hijack_data.registry import Registry

from .agent_checks import agent_problems
from .base import DONE, WAIT, Agent, Observation

AgentMaker: TypeAlias = Callable[[], Agent]


class DoNothing:
    """Waits until every corruption has had its turn, then claims to be done.

    It must fail at every task.
    """

    MAX_WAITS = 5  # the paper's latest corruption comes at step 3

    def __init__(self) -> None:
        self._waits = 0

    def reset(self) -> None:
        """A new episode."""
        self._waits = 0

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Wait, and at last answer `DONE`."""
        self._waits += 1
        if self._waits > self.MAX_WAITS:
            return "That should do.", [DONE]
        return "Let us see what happens.", [WAIT]


class AgentRegistry(Registry[AgentMaker]):
    """Agents by name; an agent file is found, too, by its path or its packaged name."""

    def find(self, text: str) -> str:
        """Return the name of what a user asks for, as `Registry.find`.

        An agent file is read, and registered under `text`. Its mistakes are a `ConfigError`. Python
        code of a user is imported by another process, which describes it, and not by this one.
        """
        from . import agent_files, makers  # they need PyYAML and all parsers
        from .agent_process import describe
        from .references import is_foreign

        if text in self.entries:
            return text
        if agent_files.is_agent_file(text):
            self.load()
            return self.add(makers.agent_file_maker(text), text)
        if super().is_reference(text) and text.rpartition(":")[2] and is_foreign(text):
            return self.add(describe(text), text)
        return super().find(text)

    def is_reference(self, text: str) -> bool:
        """Return whether a text names a file, a module or an agent file, and not an agent."""
        from . import agent_files

        return agent_files.is_agent_file(text) or super().is_reference(text)

    def hint(self, name: str) -> str:
        """Return the closest name, packaged agent files included."""
        from . import agent_files

        names = [*self.entries, *agent_files.packaged()]
        return suggest(name, names) + left_out(self.group)


AGENTS = AgentRegistry(
    "agent",
    "agents",
    builtin={
        "oracle": "online_env.agents.oracle:Oracle",
        "recovering": "online_env.agents.oracle:Recovering",
        "do_nothing": "online_env.agents.registry:DoNothing",
        "random": "online_env.agents.baselines:RandomActions",
        "fail": "online_env.agents.baselines:AlwaysFails",
        "scripted": "online_env.agents.scripted:Scripted",
        "pixel": "online_env.agents.pixel.agent:Pixel",
        "pixel_onlooker": "online_env.agents.pixel.onlooker_agent:PixelOnlooker",
        "pixel_onlooker_no_check": "online_env.agents.pixel.onlooker_agent:NoCheck",
        "pixel_onlooker_no_summary": "online_env.agents.pixel.onlooker_agent:NoSummary",
    },
    problems=agent_problems,
)
register = AGENTS.register


def names() -> tuple[str, ...]:
    """The names of all agents."""
    return tuple(AGENTS.names())


def make(name: str) -> Agent:
    """Return a new agent.

    Args:
        name: of an agent, `package.module:Class`, `path/to/file.py:Class`, or an agent file.

    Raises:
        UnknownNameError: There is no such agent; the message has the closest name.
        PluginError: The file, module or plug-in cannot be loaded.
        ParameterError: It does not hold an agent.
    """
    return AGENTS.get(AGENTS.find(name))()
