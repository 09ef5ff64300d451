"""Agents that were written for other frameworks, as agents of ours.

Two kinds exist. *Step agents* answer an observation with actions, as ours do: `osworld` wraps any
of OSWorld's `mm_agents`, `agent_s` is Agent S3. *Loop agents* call the computer themselves: `loop`
hands the environment to such a loop as a computer, `cua` is cua-agent.

A foreign package is imported when an agent is made, never before. None of these agents gets more
than picture and instruction.
"""

from .agent_s import AgentS
from .cua import CuaAgent
from .loop import LoopAgent, LoopComputer
from .osworld import OsworldAgent

__all__ = [
    "AgentS",
    "CuaAgent",
    "LoopAgent",
    "LoopComputer",
    "OsworldAgent",
]
