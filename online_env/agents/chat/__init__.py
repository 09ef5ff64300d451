"""Agents that ask a model over HTTP; see docs/score_my_model.md.

`agent.ChatAgent` plays, `endpoint.Endpoint` asks, `wires` has one module for each API, `parsing`
reads the replies, `prompts` and `query` make the requests, and `run.ChatRun` holds the state shared
by all agents of a run: log, replay and waits.
"""
