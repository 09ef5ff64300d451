"""Agents: the base class, the registry of all agents, and the agents that come with the library."""
