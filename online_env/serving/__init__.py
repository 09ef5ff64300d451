"""Environments as a service: an OpenEnv server over a pool of desktops (`hijack serve`).

`pool` holds the desktops and lends them, `drawing` decides what a reset plays, `service` is what
all sessions share, and `sessions` is one client. `openenv_env` is OpenEnv's interface to a session,
and `app` adds the token, the health and the metrics: these two alone import `openenv`. `running`
starts and ends it all.
"""
