"""All agents by name, and the one that does nothing.

An agent of your own is one class with `predict`, see `base.Agent`: from an installed package
(entry points `agenthijack.agents`), or as `--agent my_agent.py:MyAgent`. A model behind an API is
an agent file: `--agent my_agent.yaml`, or the bare name of one that comes with the package.
"""

import inspect
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

from hijack_data.entry_points import left_out
from hijack_data.errors import ParameterError, suggest
from hijack_data.registry import Registry

from .base import DONE, WAIT, Agent, Observation

AgentMaker: TypeAlias = Callable[[], Agent]


class DoNothing:
    """Waits until every corruption has had its turn, then claims to be done.

    It must fail at every task.
    """

    MAX_WAITS = 5  # the paper's latest corruption comes at step 3

    def __init__(self) -> None:
        self._waited = 0

    def reset(self) -> None:
        """A new episode."""
        self._waited = 0

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Wait, and at last answer `DONE`."""
        self._waited += 1
        if self._waited > self.MAX_WAITS:
            return "That should do.", [DONE]
        return "Let us see what happens.", [WAIT]


def _problems(maker: Any, _: str) -> Iterator[str]:
    """Yield what is wrong with the class of an agent, or with a function that makes agents."""
    if not callable(maker):
        yield "an agent is a class, or a function that returns an agent"
        return
    if isinstance(maker, type) and not callable(getattr(maker, "predict", None)):
        yield "it has no predict(instruction, obs)"
    needed = [name for name, value in _parameters(maker).items() if _is_needed(value)]
    if needed:
        yield f"it is made without arguments; give {', '.join(needed)} a default"


def _parameters(maker: Any) -> dict[str, inspect.Parameter]:
    try:
        return dict(inspect.signature(maker).parameters)
    except (TypeError, ValueError):  # of a class in C
        return {}


def _is_needed(parameter: inspect.Parameter) -> bool:
    several = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return parameter.default is inspect.Parameter.empty and parameter.kind not in several


def check_agent(maker: Any) -> None:
    """Check the class of an agent, or a function that makes agents.

    Raises:
        ParameterError: it is none; the message has all problems.
    """
    problems = "; ".join(_problems(maker, ""))
    if problems:
        title = getattr(maker, "__qualname__", type(maker).__qualname__)
        raise ParameterError(f"cannot register {title}: {problems}")


class AgentRegistry(Registry[AgentMaker]):
    """Agents by name; an agent file is found, too, by its path or its packaged name."""

    def find(self, text: str) -> str:
        """Return the name of what a user asks for, as `Registry.find`.

        An agent file is read, and registered under `text`. Its mistakes are a `ConfigError`. Python
        code of a user is imported by another process, which describes it, and not by this one.
        """
        from . import agent_files, makers  # they need PyYAML and all parsers
        from .references import is_foreign

        if text in self.entries:
            return text
        if agent_files.is_agent_file(text):
            self.load()
            return self.add(makers.agent_file_maker(text), text)
        if super().is_reference(text) and text.rpartition(":")[2] and is_foreign(text):
            from .agent_process import describe

            return self.add(describe(text), text)
        return super().find(text)

    def is_reference(self, text: str) -> bool:
        """Return whether a text names a file, a module or an agent file, and not an agent."""
        from . import agent_files

        return agent_files.is_agent_file(text) or super().is_reference(text)

    def hint(self, name: str) -> str:
        """Return the closest name, packaged agent files included."""
        from . import agent_files

        known = [*self.entries, *agent_files.packaged()]
        return suggest(name, known) + left_out(self.group)


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
    problems=_problems,
)
register = AGENTS.register


def names() -> tuple[str, ...]:
    """The names of all agents."""
    return tuple(AGENTS.names())


def make(name: str) -> Agent:
    """Return a new agent.

    Raises `UnknownNameError` with the closest name, `PluginError` if the file, module or plug-in
    cannot be loaded, and `ParameterError` if it does not hold an agent.

    Args:
        name: of an agent, `package.module:Class`, `path/to/file.py:Class`, or an agent file.
    """
    return AGENTS.get(AGENTS.find(name))()
