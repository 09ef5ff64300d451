"""Datasets with what happens to the machine: plug-ins, what people are told, and the command."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import pytest
from click.testing import CliRunner

import hijack_data as hj
from hijack_data import corruption as registry
from hijack_data.cli import hijack
from hijack_data.errors import AssetError
from hijack_data.pack import AssetPack
from hijack_data.plugin import Corruption, Draft, Effect, Every, Stream, register
from pipelines import build, verify
from pipelines.dataset.stats import stats
from pipelines.dataset.stats_page import page
from pipelines.errors import BuildError

from support.events import FIVE


def test_plug_ins_whose_look_is_not_known_are_refused(
    browsing: Path, assets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry.CORRUPTIONS, "entries", dict(registry.CORRUPTIONS.entries))

    @register
    @dataclass(frozen=True)
    class Muted(Corruption):
        """Turns the sound off."""

        name: ClassVar[str] = "muted"
        category: ClassVar[Any] = "environment_error"
        scope: ClassVar[Any] = "state"
        effects: ClassVar[tuple[str, ...]] = ("mute",)

        def make_plan(self, scene: hj.Scene, stream: Stream, step: int) -> Draft:
            return Draft(effects=(Effect("mute"),))

    for requests in ("all", "muted", {"x": hj.OneOf([hj.Sequence([Muted()])])}):
        with pytest.raises(
            BuildError,
            match=r"muted does mute to the machine.*leave it out: pop_ups,.*,verification$",
        ):
            build(browsing, tmp_path / "out", corruptions=requests, assets=assets)  # type: ignore[arg-type]

    class Hidden(hj.Planner):
        needs_elements = False

        def plan(self, scene: hj.Scene, **key: Any) -> hj.Plan:
            return Muted().plan(scene, **key)

    with pytest.raises(
        BuildError,
        match=r"x: muted-v1 gave a plan with effects .*\(mute\), which Hidden.effects does not",
    ):
        build(browsing, tmp_path / "out", corruptions={"x": Hidden()}, assets=assets)


def test_plug_ins_with_a_known_effect_are_built(
    browsing: Path, assets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry.CORRUPTIONS, "entries", dict(registry.CORRUPTIONS.entries))

    @register
    @dataclass(frozen=True)
    class Locked(Corruption):
        """Locks the session at every step."""

        name: ClassVar[str] = "locked_out"
        category: ClassVar[Any] = "environment_error"
        scope: ClassVar[Any] = "state"
        effects: ClassVar[tuple[str, ...]] = ("lock",)

        def make_plan(self, scene: hj.Scene, stream: Stream, step: int) -> Draft:
            return Draft(effects=(Effect("lock"),))

    @register
    @dataclass(frozen=True)
    class LockedLate(Locked):
        """Locks the session after some seconds."""

        name: ClassVar[str] = "locked_late"

        def make_plan(self, scene: hj.Scene, stream: Stream, step: int) -> Draft:
            return Draft(effects=(Effect("lock", {"begins": {"seconds": 9}}),))

    with pytest.raises(BuildError, match="lock begins at a second"):
        build(browsing, tmp_path / "late", corruptions="locked_late", assets=assets)
    report = build(browsing, tmp_path / "out", corruptions="locked_out", assets=assets)
    assert dict(report.rows) == {"clean": 10, "locked_out": 10}


def test_what_people_are_told(browsing: Path, nine: Any, assets: Path, tmp_path: Path) -> None:
    build(browsing, tmp_path / "out", corruptions=nine, assets=assets)
    card = (tmp_path / "out" / "README.md").read_text()
    for text in (
        "* `exact`:",
        "* `composited`:",
        "* `recorded`:",
        "`reminder`",
        "made up for tests",
        AssetPack.load(assets).digest[:16],
    ):
        assert text in card
    result = stats(tmp_path / "out")
    data = result.to_data()["corruptions"]
    assert data["verification"]["fidelity"] == {"recorded": 2}
    assert data["verification"]["reminders"] == 2
    assert data["app_minimization"]["inserted"] == 2
    assert sum(data["accidental_touch"]["event"].values()) == 2
    assert data["marks"]["event"] == {}
    lines = "\n".join(result.lines())
    assert "verification: 2 rows: The session was locked" in lines
    assert "verification: 2 rows with a reminder" in lines
    assert "app_minimization: 2 steps inserted" in lines
    text = page(tmp_path / "out", result)
    assert "recorded: The session was locked; the screen asks for the password" in text
    assert "Action: WAIT" in text


def test_the_command(browsing: Path, assets: Path, tmp_path: Path) -> None:
    command = ["build", str(browsing), "--label-policy", "recover", "--corruptions"]
    run = CliRunner().invoke(
        hijack, [*command, ",".join(FIVE), "--assets", str(assets), "--out", str(tmp_path / "out")]
    )
    assert run.exit_code == 0, run.output
    assert "verification: 2" in run.output
    none = str(tmp_path / "none")
    run = CliRunner().invoke(
        hijack, [*command, "all", "--assets", none, "--out", str(tmp_path / "x")]
    )
    assert isinstance(run.exception, AssetError)
    assert not (tmp_path / "x").exists()


class EveryOther(hj.Planner):
    """A planner of somebody else: its part, at even steps."""

    def __init__(self, part: hj.Planner) -> None:
        self.part = part

    @property
    def parts(self) -> tuple[hj.Planner, ...]:
        return (self.part,)

    def is_due(self, step: int) -> bool:
        return step % 2 == 0

    def plan(self, scene: hj.Scene, *, step: int | None = None, **key: Any) -> hj.Plan:
        if (step or 0) % 2:
            return hj.Plan.clean(scene.size)
        return self.part.plan(scene, step=step, **key)


def test_a_planner_of_somebody_else_is_built(
    browsing: Path, assets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planners = {
        "dots": EveryOther(hj.Marks(number=3, mark_size=8)),
        "locked": EveryOther(hj.OneOf([hj.Verification(step=Every(2))])),
        "all": hj.Marks(number=3, mark_size=8),
    }
    monkeypatch.setenv("AGENTHIJACK_ASSETS", str(assets))
    report = build(browsing, tmp_path / "out", corruptions=planners, assets=assets)
    rows = dict(report.rows)
    assert 0 < rows["dots"] < rows["all"]
    assert rows["locked"] > 0
    assert verify(tmp_path / "out").problems == []
    corruptions = stats(tmp_path / "out").to_data()["corruptions"]
    assert corruptions["locked"]["fidelity"] == {"recorded": rows["locked"]}


def test_what_only_looks_like_a_planner_is_refused(browsing: Path, tmp_path: Path) -> None:
    class Lookalike:
        def plan(self, scene: hj.Scene, **key: Any) -> hj.Plan:
            return hj.Plan.clean(scene.size)

    with pytest.raises(BuildError, match=r"Lookalike must inherit from hijack_data\.Planner"):
        build(browsing, tmp_path / "out", corruptions={"x": Lookalike()})  # type: ignore[dict-item]
