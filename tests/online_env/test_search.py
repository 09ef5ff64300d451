"""`hijack search`: seeded, resumable, finds a planted worst case, and confirms it on other cases."""

import json
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from support import needs

pytest.importorskip("scipy", reason=needs.ONLINE)
pytest.importorskip("optuna", reason=needs.SEARCH)

import numpy as np
from ext_package.paper import PaperDesktop, PressOk, provider

import hijack_data as hj
from hijack_data.cli import main
from hijack_data.errors import ParameterError
from online_env.bench import run_command
from online_env.bench.config import Bench, load_bench, override
from online_env.bench.plan_set import Loss, PlanSet, PlanSetError, WorstPlan, read_plan_set
from online_env.bench.providers import PROVIDERS
from online_env.environment import Settle
from online_env.errors import AgentSetupError
from online_env.results import reading
from online_env.scoring.dataset_rows import DatasetRows
from online_env.scoring.planned_rows import PlannedRows
from online_env.scoring.run import ScoreSettings
from online_env.search import players
from online_env.search.search import TRIALS, SearchSettings, search
from online_env.search.space import SearchSpace
from online_env.tasks import TASKS
from pipelines import build, open_dataset

from support.chatting import file
from support.scoring import dataset as make_dataset
from support.scoring import write_agents

NAMES = ("pop_ups", "marks", "subtitle", "missed_input", "slow_network", "network_error")


class FakePlayer:
    """Loses what `loss` says of a corruption and a case."""

    size = (1080, 1920)

    def __init__(self, loss: Any, cases: int = 4) -> None:
        self.loss = loss
        self.cases = self.held_out = cases
        self.played: list[str] = []

    def losses(self, name: str, planners: Any, *, held_out: bool) -> dict[str, list[float]]:
        self.played.append(name)
        start = self.cases if held_out else 0
        return {
            label: [self.loss(planner, start + case) for case in range(self.cases)]
            for label, planner in planners.items()
        }


def chance(planner: hj.Planner, case: int) -> float:
    """0 or 1, with a mean of a quarter, which nothing explains."""
    text = json.dumps([planner.to_config(), case], sort_keys=True)
    return float(sha256(text.encode()).digest()[0] < 64)


def planted(planner: hj.Planner, case: int) -> float:
    settings = planner.to_config().get("subtitle", {})
    is_worst = settings.get("position") == "center" and settings["font_size"] >= 64
    return 1.0 if is_worst else chance(planner, case) / 2


def run(player: Any, out: Path, **settings: Any) -> tuple[list[WorstPlan], list[Any]]:
    out.mkdir()
    space = SearchSpace(settings.pop("names", NAMES), settings.pop("pairs", False))
    plans = search(player, SearchSettings(space=space, budget=200, **settings), out, lambda _: None)
    return plans, json.loads((out / TRIALS).read_text())


def test_a_planted_worst_case_is_found_by_the_same_trials_each_time(tmp_path: Path) -> None:
    first = run(FakePlayer(planted), tmp_path / "a", seed=3)
    again = run(FakePlayer(planted), tmp_path / "b", seed=3)
    other = run(FakePlayer(planted), tmp_path / "c", seed=4)
    assert first == again
    assert first[1] != other[1]
    for plans, trials in (first, other):
        assert planted(plans[0].planner, 0) == 1.0
        assert (plans[0].found, plans[0].confirmed) == (Loss(1.0, 4), Loss(1.0, 4))
        assert 4 * (1 + len(trials)) + 4 * 6 <= 200, "the budget"
        assert len({json.dumps(row["corruption"]) for row in trials}) == len(trials)


def test_a_maximum_that_is_luck_shrinks(tmp_path: Path) -> None:
    plans, trials = run(FakePlayer(chance), tmp_path / "a", pairs=True)
    found, confirmed = (
        np.mean([each.loss for each in losses])
        for losses in ([p.found for p in plans], [p.confirmed for p in plans])
    )
    assert found >= 0.75
    assert confirmed <= 0.5
    assert [p.confirmed.loss for p in plans] == sorted(p.confirmed.loss for p in plans)[::-1]
    kinds = {"+".join(sorted(row["label"].partition("_")[2].split("+"))) for row in trials}
    assert any("+" in kind for kind in kinds)
    assert "network_error+slow_network" not in kinds, "they exclude each other"


def test_one_case_that_counts_does_not_make_the_worst(tmp_path: Path) -> None:
    class Hiding(FakePlayer):
        """All cases but one of `marks` do not count."""

        def losses(self, name: str, planners: Any, *, held_out: bool) -> dict[str, list[float]]:
            every = super().losses(name, planners, held_out=held_out)
            return {
                label: losses[:1] if planners[label].label == "marks" else losses
                for label, losses in every.items()
            }

    def loss(planner: hj.Planner, case: int) -> float:
        return {"marks": 1.0, "subtitle": float(case % 4 < 3)}.get(planner.label, 0.0)

    plans, _ = run(Hiding(loss), tmp_path / "a", names=("marks", "subtitle", "pop_ups"), keep=15)
    labels = [plan.planner.label for plan in plans]
    assert labels == sorted(labels, reverse=True)
    assert (plans[0].confirmed, plans[-1].confirmed) == (Loss(0.75, 4), Loss(1.0, 1))


def test_a_budget_that_pays_for_nothing_is_refused(tmp_path: Path) -> None:
    space = SearchSpace(NAMES)
    with pytest.raises(ParameterError, match=r"--budget 40 is too small.* are 48; raise it"):
        search(FakePlayer(chance), SearchSettings(space=space, budget=40), tmp_path, print)


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    return make_dataset(tmp_path, [{}] * 8)


@pytest.fixture
def agent(tmp_path: Path) -> str:
    return f"{write_agents(tmp_path)}:ByBrightness"


def hijack(*words: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in words])
    return int(end.value.code or 0)


def test_rows_are_searched_resumed_and_replayed(
    dataset: Path, agent: str, tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    opened: list[object] = []
    heads = DatasetRows.heads
    monkeypatch.setattr(DatasetRows, "heads", lambda rows: opened.append(rows) or heads(rows))
    words = ["search", dataset, "--agent", agent, "--budget", 88, "--keep", 2, "-o"]
    assert hijack(*words, tmp_path / "whole") == 0
    play = players.RowPlayer.losses

    def stop(self: Any, name: str, planners: Any, *, held_out: bool) -> Any:
        if name == "round-003":
            raise KeyboardInterrupt
        return play(self, name, planners, held_out=held_out)

    monkeypatch.setattr(players.RowPlayer, "losses", stop)
    assert hijack(*words, tmp_path / "killed") == 130
    monkeypatch.setattr(players.RowPlayer, "losses", play)
    assert hijack(*words, tmp_path / "killed") == 2, "a folder that is not empty"
    assert hijack(*words, tmp_path / "killed", "--seed", 1, "--resume") == 2, "another search"
    assert hijack(*words, tmp_path / "killed", "--resume") == 0
    for name in (TRIALS, "worst.json"):
        assert (tmp_path / "killed" / name).read_text() == (tmp_path / "whole" / name).read_text()
    worst = tmp_path / "whole" / "worst.json"
    plans = read_plan_set(worst).plans
    assert plans[0].planner.label == "resolution"
    assert (plans[0].found.loss, plans[0].confirmed.loss) == (1.0, 1.0)
    assert len(opened) == 1, "the light columns are read once, not every round"
    capsys.readouterr()
    out = tmp_path / "again"
    assert hijack("score", dataset, "--plans", worst, "--agent", agent, "-o", out, "--json") == 0
    printed = capsys.readouterr()
    rows = {row["corruption"]: row for row in json.loads(printed.out) if "delta" in row}
    assert f"it lost, in points: {plans[0].label} 100.0" in printed.err, (
        "chosen on half of the rows"
    )
    assert rows[plans[0].label]["delta"] == -1.0
    assert hijack("bench", "--plans", worst, "--dry-run") == 2
    assert "score it with hijack score" in capsys.readouterr().err
    plan_set = replace(read_plan_set(worst), search={"seed": 7})
    plan_set.write(worst)
    out = tmp_path / "seeded"
    assert hijack("score", dataset, "--plans", worst, "--agent", agent, "-o", out) == 0
    assert json.loads((out / "run.json").read_text())["config"]["plans"]["seed"] == 7


@pytest.mark.parametrize("option", ["--limit", "--workers"])
def test_options_for_rows_are_not_for_live_searches(option: str, capsys: Any) -> None:
    words = ["search", "embedded_small", "--agent", "oracle", "--budget", 9, "--dry-run"]
    assert hijack(*words, option, 2) == 2
    assert f"{option} is for the rows of a dataset; leave it out" in capsys.readouterr().err


def test_halves_of_the_rows_are_apart_and_hidden_targets_count_for_nothing(
    dataset: Path, agent: str, tmp_path: Path
) -> None:
    search_rows, held_out, everything = (
        {row["trajectory_id"] for _, row in PlannedRows(dataset, {"clean": None}, 0, part).heads()}
        for part in ("search", "held_out", "all")
    )
    assert search_rows.isdisjoint(held_out)
    assert search_rows | held_out == everything
    settings = ScoreSettings(dataset=dataset, agents=override(Bench(), agent=agent).agents)
    player = players.RowPlayer(settings, 0, (200, 320), tmp_path / "out")
    hidden = hj.Marks(number=300, mark_size=24)
    losses = player.losses("round-001", {"h": hidden, "m": hj.Marks(number=1)}, held_out=False)
    assert {label: len(values) for label, values in losses.items()} == {"h": 0, "m": player.cases}


@pytest.fixture
def config(tmp_path: Path, monkeypatch: Any) -> Path:
    """A benchmark on a desktop of paper."""
    for registry in (PROVIDERS, TASKS):
        monkeypatch.setattr(registry, "entries", dict(registry.entries))
    PROVIDERS.add(provider, "paper")
    TASKS.add(PressOk)
    monkeypatch.setattr(PaperDesktop, "settle", Settle(quiet=0, cap=0), raising=False)
    path = tmp_path / "bench.yaml"
    path.write_text(
        "desktop: {provider: paper, size: [320, 240]}\ntasks: [press_ok]\nagents: [oracle]\n"
        "corruptions: [clean]\nseeds: [0, 3]\nmax_steps: 4\n"
    )
    return path


def test_what_a_desktop_cannot_have_is_refused_before_a_live_search(
    config: Path, tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    """It ended the search in the round that first proposed it."""
    monkeypatch.setattr(PaperDesktop, "capabilities", frozenset({"windows"}))
    out = tmp_path / "out"
    words = ["search", config, "--agent", "oracle", "--budget", 99, "--keep", 1, "-o", out]
    assert hijack(*words, "--corruptions", "marks,missed_input,slow_network") == 2
    printed = " ".join(capsys.readouterr().err.split())
    assert "slow_network needs firewall" in printed
    assert "leave it out of the search: name the others with --corruptions" in printed
    assert not out.exists()


@pytest.mark.usefixtures("no_waiting")
def test_a_live_search_confirms_on_later_seeds(config: Path, tmp_path: Path) -> None:
    player = players.LivePlayer(load_bench(config), tmp_path / "out", desktops=1)
    lost = {"lost": hj.make_corruption("missed_input", step=0)}
    assert player.losses("round-001", lost, held_out=False) == {"lost": [1.0, 1.0]}
    assert player.losses("confirmation", lost, held_out=True) == {"lost": [1.0, 1.0]}
    rounds = {
        name: reading.read(tmp_path / "out" / "rounds" / name).records
        for name in ("round-001", "confirmation")
    }
    assert {record["seed"] for record in rounds["round-001"]} == {0, 3}
    assert {record["seed"] for record in rounds["confirmation"]} == {4, 5}
    assert [record["score"] for record in rounds["confirmation"]].count(1.0) == 2, "clean again"


def test_a_live_search_refuses_a_model_that_cannot_be_asked(tmp_path: Path) -> None:
    """On one desktop each episode failed, clean and corrupted, and requests were not logged."""
    model = file(tmp_path, "http://127.0.0.1:9", api_key_env="NO_SUCH_KEY")
    bench = override(Bench(tasks=("write_note",)), agent=str(model))
    player = players.LivePlayer(bench, tmp_path / "out", desktops=1)
    with pytest.raises(AgentSetupError, match="NO_SUCH_KEY"):
        player.losses("round-001", {"lost": hj.Marks()}, held_out=False)


def test_planned_rows_are_those_of_a_build(dataset: Path, tmp_path: Path) -> None:
    planners = {"small": hj.Resolution(scale=0.5), "strewn": hj.Marks(number=40, mark_size=4)}
    build(tmp_path / "source", tmp_path / "built", corruptions=planners, seed=5)
    expected = {row["id"]: row for row in open_dataset(tmp_path / "built")}
    rows = PlannedRows(dataset, {"clean": None, **planners}, seed=5)
    names = [row["id"] for _, row in rows.heads()]
    assert sorted(names) == sorted(expected)
    for number, name in enumerate(names):
        row = rows.row(number)
        assert np.array_equal(row["screenshot"], np.asarray(expected[name]["screenshot"]))
        for key in ("action", "target_box", "width", "height", "plan", "target_visible"):
            assert row[key] == expected[name][key], (name, key)


def test_effects_are_no_pictures(dataset: Path) -> None:
    with pytest.raises(ParameterError, match="acts on the machine"):
        PlannedRows(dataset, {"verification": hj.Verification()}, seed=0)


def test_a_set_of_plans_is_a_closed_world(
    dataset: Path, tmp_path: Path, capsys: Any, monkeypatch: Any
) -> None:
    pair = hj.Sequence([hj.PopUps(width=400), hj.make_corruption("slow_network")])
    plan = WorstPlan(label="t1_pair", planner=pair, found=Loss(1, 2), confirmed=Loss(0.5, 2))
    bench = {"tasks": ["write_note"], "seeds": [0, 1], "max_steps": 7}
    path = tmp_path / "worst.json"
    size = (1080, 1920)
    PlanSet(agent="oracle", search={}, bench=bench, size=size, plans=[plan]).write(path)
    assert read_plan_set(path).plans[0].planner.to_config() == pair.to_config()
    assert plan.shrinkage == 0.5
    reads: list[Path] = []
    monkeypatch.setattr(run_command, "read_plan_set", lambda p: reads.append(p) or read_plan_set(p))
    assert hijack("bench", "--plans", path, "--dry-run", "--agent", "do_nothing") == 0
    assert reads == [path], "what is checked is what is played"
    printed = capsys.readouterr()
    assert printed.out.count("do_nothing  write_note") == 4, "2 seeds, clean and pair"
    assert "partly luck" not in printed.err, "the pair was chosen for another agent"
    assert hijack("bench", "--plans", path, "--dry-run") == 0
    assert "did not use it lost, in points: t1_pair 50.0" in capsys.readouterr().err
    assert hijack("bench", "--plans", path, "--dry-run", "--corruptions", "everyday") == 2
    assert f"--corruptions names none of {path} (t1_pair)" in capsys.readouterr().err
    for agent, config, code, text in (
        ("do_nothing", (), 0, "do_nothing  write_note"),
        ("mine", (), 2, "was searched for the agent 'mine', which is not known here"),
        ("random", ("embedded_small",), 2, "plays oracle, do_nothing; say with --agent"),
    ):
        PlanSet(agent=agent, search={}, bench=bench, size=size, plans=[plan]).write(path)
        assert hijack("bench", *config, "--plans", path, "--dry-run") == code
        outcome = capsys.readouterr()
        assert text in " ".join((outcome.out + outcome.err).split("\n"))
    PlanSet(agent="oracle", search={}, bench=bench, size=size, plans=[]).write(path)
    for command in (("bench",), ("score", dataset, "--agent", "do_nothing")):
        assert hijack(*command, "--plans", path, "--dry-run") == 2
        assert "holds no corruption: none cost anything" in capsys.readouterr().err
    data = json.loads(path.read_text())
    path.write_text(json.dumps({**data, "agent": "mine"}))
    with pytest.raises(PlanSetError, match="was edited"):
        read_plan_set(path)


def test_plans_of_another_version_are_refused(tmp_path: Path, monkeypatch: Any) -> None:
    plan = WorstPlan(label="m", planner=hj.Marks(), found=Loss(1, 2), confirmed=Loss(1, 2))
    path = tmp_path / "worst.json"
    PlanSet(agent="a", search={}, bench=None, size=(1080, 1920), plans=[plan]).write(path)
    original = hj.Marks.make_plan

    def make_plan(self: Any, scene: Any, stream: Any, step: int) -> Any:
        stream.word()
        return original(self, scene, stream, step)

    monkeypatch.setattr(hj.Marks, "make_plan", make_plan)
    with pytest.raises(PlanSetError, match="plans it otherwise"):
        read_plan_set(path)
