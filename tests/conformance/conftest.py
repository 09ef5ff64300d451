"""Plug-ins that a test loads and that are forgotten after it."""

import pytest

from hijack_data import corruption as registry
from hijack_data import loading

from support.plugins import write


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Load a plug-in from a file: `load(slot=text)` returns the class; see `support.plugins`."""
    registry.corruption_names()
    monkeypatch.setenv(loading.VARIABLE, "")
    monkeypatch.setattr(registry.CORRUPTIONS, "entries", dict(registry.CORRUPTIONS.entries))
    monkeypatch.setattr(loading, "_files", {})
    monkeypatch.chdir(tmp_path)

    def make(**slots):
        file = loading.load_file(write(tmp_path, **slots))
        return registry.find_corruption(file.corruptions[0])

    return make
