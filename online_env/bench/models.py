"""Set up a run whose agents ask models: its log or replay, its prompts, and its budget."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hijack_data.errors import ParameterError

from ..agents import guards
from ..agents.agent_calls import NEEDS_TASK, method_names
from ..agents.chat.request_log import FOLDER, log_folder
from ..agents.chat.run import ChatRun
from ..agents.chat.wires.common import require_clients
from ..agents.makers import file_makers, prompts_folder
from ..agents.references import AgentReference, is_user_code, reference_to
from ..agents.registry import AGENTS
from ..errors import AgentSetupError
from ..tasks.machines import MachineSettings
from .config import Bench


@dataclass(frozen=True, kw_only=True)
class ModelOptions:
    """The options of the command line about models.

    Args:
        prompts: folder with prompts that replace ours by name, or a Python file with UI-TARS'.
        replay: folder of a run whose log answers instead of the endpoints.
        max_cost: USD; no episode begins once the run has cost that much.
    """

    prompts: Path | None = None
    replay: Path | None = None
    max_cost: float | None = None

    @property
    def used_options(self) -> list[str]:
        """The options that were given."""
        options = {"--prompts": self.prompts, "--replay": self.replay, "--max-cost": self.max_cost}
        return [name for name, value in options.items() if value is not None]


def prepare(bench: Bench, options: ModelOptions, out: Path | None) -> None:
    """Tell the agents of agent files, and the guard, about their run.

    Args:
        bench: the benchmark.
        options: the options for all of them.
        out: folder of the run; `None` if nothing is going to be run.

    Raises:
        AgentSetupError: a key, a price or a log is missing, or an option or a file of errors
            applies to no agent.
    """
    agents = bench.asked_agents
    if out is not None:
        _make_ready(agents, out)
        guards.share_in(bench.guard, out)
    makers = file_makers(AGENTS.get(name) for name in agents)
    if options.used_options and not makers:
        raise AgentSetupError(
            f"{options.used_options[0]} is for agents of files, and there is none"
        )
    prompts = None if options.prompts is None else prompts_folder(options.prompts)
    replay = None if options.replay is None else log_folder(options.replay)
    machines = bench.machines or MachineSettings()
    secrets = (machines.password,) if "client_password" in machines.options else ()
    for maker in makers:
        maker.run = ChatRun(
            prompts=prompts,
            log=None if out is None else out / FOLDER,
            replay=replay,
            password=machines.password,
            secrets=secrets,
        )
        maker.check_errors()
        if options.max_cost is not None:
            maker.check_prices()
        if out is not None and replay is None:
            require_clients(maker.settings)
            maker.settings.check_keys(os.environ)


def model_locations(bench: Bench) -> dict[str, str]:
    """Return the models that are asked in the episodes of each agent and where, in words."""
    guard = file_makers([AGENTS.get(bench.guard)] if guards.is_file(bench.guard) else [])
    locations: dict[str, str] = {}
    for name in bench.agents:
        makers = [*file_makers([AGENTS.get(name)]), *guard]
        models = [model.location for maker in makers for model in maker.settings.models]
        if models:
            locations[name] = ", ".join(dict.fromkeys(models))
    return locations


def check_agents(bench: Bench) -> None:
    """Check that the agents of a run can be run where they are to run.

    Raises:
        ParameterError: an agent of a user wants the task and the machine, but has a process of its
            own; or no other process can import it.
    """
    for name in bench.agents:
        entry: Any = AGENTS.get(name)
        if bench.in_process or not is_user_code(entry):
            continue
        reference_to(entry, name)
        methods = entry.methods if isinstance(entry, AgentReference) else method_names(entry)
        if "prepare" in methods:
            raise ParameterError(f"--agent: {name}: {NEEDS_TASK}")


def _make_ready(agents: Sequence[str], out: Path) -> None:
    """Call the agents' `check_ready`, so that they report what they lack, and `share_in`.

    With the latter they may share files of the run among its processes.
    """
    for name in agents:
        agent = AGENTS.get(name)
        check_ready = getattr(agent, "check_ready", None)
        if check_ready is not None:
            check_ready()
        share_in = getattr(agent, "share_in", None)
        if share_in is not None:
            share_in(out)


def begin(agent: str, guard: str, episode: str) -> ChatRun | None:
    """Open the log of an episode, if its agent or its guard comes from an agent file.

    Returns:
        Their log, or `None` if neither does.
    """
    names = (agent, guard) if guards.is_file(guard) else (agent,)
    makers = file_makers(AGENTS.get(name) for name in names)
    if not makers:
        return None
    run = makers[0].run
    run.begin(episode, [maker.settings for maker in makers])
    return run
