"""What the configuration tests share."""

import re
from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
from hijack_data.config import Config, load_config
from hijack_data.errors import ConfigError


def write(folder: Path, text: str | bytes) -> Path:
    path = folder / "c.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def load(folder: Path, text: str | bytes) -> Config:
    return load_config(write(folder, text))


def problems(folder: Path, text: str | bytes) -> list[str]:
    """The problems of a file, as `line:column: message`."""
    path = write(folder, text)
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert str(caught.value) == "\n".join(caught.value.problems)
    assert all(
        re.fullmatch(re.escape(str(path)) + r":\d+:\d+: \S.*", p) for p in caught.value.problems
    )
    return [p.removeprefix(f"{path}:") for p in caught.value.problems]


def structure(planner: Any) -> Any:
    """What makes two planners equal; combinators have no equality of their own."""
    if isinstance(planner, hj.OneOf):
        # a running sum: equal to the last bits
        edges = [round(edge, 9) for edge in vars(planner)["_edges"]]
        return "one_of", [structure(p) for p in planner.options], planner.p_clean, edges
    if isinstance(planner, hj.Sequence):
        return "sequence", [structure(p) for p in planner.parts]
    return planner
