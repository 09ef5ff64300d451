"""Adapters for agents that were written for other frameworks.

Two kinds exist. *Step agents* answer an observation with actions, like ours: `osworld` wraps any of
OSWorld's `mm_agents`, `agent_s` is Agent S3. *Loop agents* call the computer themselves: `loop`
presents the environment to such a loop as a computer, `cua` is cua-agent. A foreign package is
imported only when an agent is made. All of these agents get picture and instruction, and nothing
else.
"""

from .agent_s import AgentS
from .cua import CuaAgent
from .loop import LoopAgent, LoopComputer
from .osworld import OsworldAgent

__all__ = ["AgentS", "CuaAgent", "LoopAgent", "LoopComputer", "OsworldAgent"]
