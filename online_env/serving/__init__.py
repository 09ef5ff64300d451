"""Environments as a service: an OpenEnv server over a pool of desktops (`hijack serve`).

`pool` holds the desktops and lends them, `drawing` decides what a reset plays, `service` is shared
by all sessions, and `sessions` handles one client. `openenv_env` is OpenEnv's interface to a
session, and `app` adds the token, the health and the metrics: only these two import `openenv`.
`running` starts and ends the server.
"""
