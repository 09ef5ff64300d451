"""What builds make is sound to `verify`, whatever was asked for, with the source and without."""

from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
from pipelines import build, verify

from support.events import COMBINED


def check(source: Path, out: Path, planners: Any, **options: Any) -> None:
    build(source, out, corruptions=planners, **options)
    for item in (None, source):
        assert verify(out, source=item).problems == []


@pytest.mark.parametrize("output", ["materialised", "lazy"])
@pytest.mark.parametrize("policy", ["keep", "avoid", "drop", "recover"])
def test_all_nine(
    output: str,
    policy: str,
    browsing: Path,
    nine: Any,
    assets: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("AGENTHIJACK_ASSETS", str(assets))
    over = {"covers": hj.PopUps(width=150, height=90)}
    check(browsing, tmp_path / "out", {**nine, **over}, label_policy=policy, output=output)


@pytest.mark.parametrize("output", ["materialised", "lazy"])
@pytest.mark.parametrize("clean", [True, False])
def test_combinations(
    output: str,
    clean: bool,
    browsing: Path,
    assets: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("AGENTHIJACK_ASSETS", str(assets))
    small = hj.OneOf([hj.Marks(number=3, mark_size=6), hj.Resolution(scale=0.5)], p_clean=0.3)
    planners = {label: planner for label, planner in COMBINED.items() if label != "late"}
    twice = hj.Sequence([hj.Resolution(scale=0.5), hj.Marks(number=3, mark_size=6)])
    check(
        browsing,
        tmp_path / "out",
        {**planners, "some": small, "twice": twice},
        output=output,
        clean=clean,
    )


def test_inputs_that_are_rejected(
    recording: Any, small: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    source = recording(trajectories=3, steps=2)
    (source / "images" / "t1-0.png").write_bytes(b"no picture")
    add_line(source, b"rubbish")
    add_line(
        source,
        good_line("t9", 0, action_code="pyautogui.click(somewhere)", image="images/t0-0.png"),
    )
    check(source, tmp_path / "out", small, rows_per_shard=7)


@pytest.mark.parametrize("output", ["materialised", "lazy"])
@pytest.mark.parametrize("clean", [True, False])
def test_what_else_a_recording_says(
    output: str, clean: bool, recording: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    source = recording(trajectories=1, steps=1)
    more = {"thought": "The column is too narrow.", "reward": 0.5, "huge": 10**400}
    add_line(source, good_line("t9", 0, image="images/t0-0.png", **more))
    planners = {"few": hj.Marks(number=3, mark_size=6), "half": hj.Resolution(scale=0.5)}
    check(source, tmp_path / "out", planners, output=output, clean=clean)
