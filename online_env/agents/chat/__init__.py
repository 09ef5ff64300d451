"""Agents that ask a model over HTTP; see docs/score_my_model.md.

`agent.ChatAgent` plays, `endpoint.Endpoint` asks, `wires` has one module for each API, `parsing`
reads what comes back, `prompts` and `query` make what is sent, and `run.ChatRun` holds what all
agents of a run share: its log, its replay and its waits.
"""
