"""A registry of desktops of a test's own.

`registry.claim` removes every network namespace and control group of the machine whose desktop is
not in its registry. With another registry, these are those of all desktops that run, so a test
replaces the three places together.
"""

from online_env.embedded.runtime import limits, network, registry


def own_registry(folder, monkeypatch):
    """Let the registry, the namespaces and the control groups be in a folder; return the first."""
    monkeypatch.setattr(registry, "RUN", folder / "run")
    monkeypatch.setattr(network, "NETNS", folder / "netns")
    monkeypatch.setattr(limits, "GROUPS", folder / "cgroup")
    return folder / "run"
