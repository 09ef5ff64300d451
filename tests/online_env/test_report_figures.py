"""What a page of results draws: bars, axes and marks, and the order of a leaderboard."""

import itertools
import re
from dataclasses import replace

import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")

from online_env.report import ReportError, build_report, formats, formatting
from online_env.report.ablations import Ablation
from online_env.report.conclusions import conclude
from online_env.report.document import ReportDocument
from online_env.report.figures import WIDTH, retention_panels, success_panels
from online_env.report.leaderboard import ReportFolder, rank_agents, read_reports
from online_env.report.level_figure import grouped_panel
from online_env.report.model import AgentSummary, Cell, RunIdentity, RunReport

from support.reported import read_run, run_of, scored

AT_MOST = 1.5  # the share at which the axis of a retention ends at the latest


def cell(label, success, agent="a", **more):
    return Cell(agent=agent, corruption=label, n=4, tasks=2, success=success, **more)


def report_of(*cells, **more):
    labels = {item.corruption: item.corruption for item in cells}
    identity = RunIdentity(name="run", kind="bench", corruptions=labels)
    return RunReport(run=identity, cells=cells, **more)


# Bars


def test_a_bar_is_as_long_as_its_share_with_its_interval_and_its_ceiling():
    report = report_of(
        cell("clean", 0.75),
        cell("marks", 0.5, ci_low=0.25, ci_high=1.0, ceiling=0.875),
        cell("lock", 0.25),
    )
    (panel,) = success_panels(report)
    clean, marks, lock = panel.bars
    assert [bar.width / WIDTH for bar in panel.bars] == [0.75, 0.5, 0.25]
    assert [bar.kind for bar in panel.bars] == ["clean", "other", "worst"]
    assert (marks.low / WIDTH, marks.high / WIDTH, marks.mark / WIDTH) == (0.25, 1.0, 0.875)
    assert (clean.low, clean.high, clean.mark) == (None, None, None)
    assert panel.line / WIDTH == 0.75
    assert marks.title == "marks: 50.0 %, 95 % [25.0, 100.0], 4 episodes of 2 tasks"
    assert lock.title == "lock: 25.0 %, 4 episodes of 2 tasks"
    assert [(place / WIDTH, text) for place, text in panel.ticks] == [
        (0.0, "0"),
        (0.25, "25"),
        (0.5, "50"),
        (0.75, "75"),
        (1.0, "100"),
    ]


def test_bars_lie_below_each_other_within_their_drawing():
    report = report_of(*(cell(label, 0.5) for label in ("clean", "marks", "lock", "pop_ups")))
    (panel,) = success_panels(report)
    tops = [bar.y for bar in panel.bars]
    steps = {low - high for high, low in itertools.pairwise(tops)}
    assert len(steps) == 1
    assert steps.pop() > 13, "a bar is 13 high"
    assert tops[0] > 0
    assert tops[-1] + 13 < panel.height


def test_bars_come_in_the_order_of_the_configuration_and_agents_without_scores_have_none():
    report = report_of(
        cell("clean", 1.0),
        cell("lock", 0.5),
        cell("marks", 0.5, agent="b"),
        cell("clean", 1.0, agent="b"),
        cell("lock", None),
    )
    values = [(panel.agent, [bar.label for bar in panel.bars]) for panel in success_panels(report)]
    assert values == [("a", ["clean", "lock"]), ("b", ["clean", "marks"])]
    assert retention_panels(report) == []


@pytest.mark.parametrize(
    ("kept", "low", "high", "end"),
    [
        (0.5, 0.25, 0.75, 1.0),
        (1.0, 0.5, 1.0, 1.0),
        (1.0, 0.5, 1.125, 1.25),
        (1.25, 1.0, 1.25, 1.25),
        (1.25, 1.0, 1.5, AT_MOST),
        (3.0, 2.0, 9.0, AT_MOST),
    ],
)
def test_the_axis_of_a_retention_ends_where_its_bars_do(kept, low, high, end):
    report = report_of(
        cell("clean", 0.5),
        cell("marks", 0.5, retention=kept, retention_low=low, retention_high=high),
    )
    (panel,) = retention_panels(report)
    (bar,) = panel.bars
    assert bar.width == pytest.approx(WIDTH * min(kept, end) / end, abs=0.01)
    assert bar.low == pytest.approx(WIDTH * min(low, end) / end, abs=0.01)
    assert bar.high == pytest.approx(WIDTH * min(high, end) / end, abs=0.01)
    assert panel.line == pytest.approx(WIDTH / end, abs=0.01)
    assert panel.ticks[-1] == (WIDTH, f"{100 * end:.0f}")
    assert len(panel.ticks) == 1 + round(4 * end)


def test_an_interval_without_an_upper_end_reaches_to_the_end_of_the_axis():
    report = report_of(
        cell("clean", 0.5),
        cell("marks", 0.25, retention=0.5, retention_low=0.125),
        cell("lock", 0.25, retention=0.5),
    )
    (panel,) = retention_panels(report)
    marks, lock = panel.bars
    assert (marks.low, marks.high) == (WIDTH / 8, WIDTH)
    assert marks.title == "marks: keeps 50.0 % of its clean success, 95 % [12.5, …)"
    assert (lock.low, lock.high) == (None, None)
    assert lock.title == "lock: keeps 50.0 % of its clean success"


def test_levels_of_an_ablation_are_groups_of_bars_in_the_colours_of_their_agents():
    agents = [f"agent {number}" for number in range(6)]
    cells = [cell("few", 0.5, agent=name, ci_low=0.25, ci_high=0.75) for name in agents]
    report = report_of(*cells, cell("many", 0.25), cell("clean", None))
    series = tuple((name, name.title()) for name in agents)
    levels = (("few", "3"), ("many", "50"), ("clean", "none"))
    panel = grouped_panel(report, Ablation(title="x", levels=levels, series=series))
    assert panel.names == tuple(name.title() for name in agents)
    assert [bar.number for bar in panel.bars] == [0, 1, 2, 3, 4, 0], "five colours, then again"
    assert {bar.width for bar in panel.bars} == {WIDTH / 2}
    assert {(bar.low, bar.high) for bar in panel.bars} == {(WIDTH / 4, WIDTH * 3 / 4)}
    assert panel.bars[1].title == "Agent 1, 3: 50.0 %, 95 % [25.0, 75.0]"
    # A level without a bar keeps its place.
    middles = [place for place, _ in panel.levels]
    assert [level for _, level in panel.levels] == ["3", "50", "none"]
    assert middles[1] - middles[0] == middles[2] - middles[1]
    assert panel.bars[0].y < middles[0] < panel.bars[-1].y + panel.bar
    assert panel.height > middles[-1]


def test_a_page_says_how_the_run_was_played(tmp_path):
    report = build_report(read_run(tmp_path / "run", scored("a", "clean", [1, 0])))
    identity = replace(report.run, created=1_767_323_045.0, seeds=tuple(range(9)), recovery="")
    page = formats.write(ReportDocument(report=replace(report, run=identity)), "html")
    facts = dict(re.findall("<dt>(.*?)</dt><dd>(.*?)</dd>", page))
    assert facts["begun"] == "2026-01-02 03:04 UTC"
    assert facts["seeds"] == "0, 1, 2, 3, 4, 5, 6, 7 ..."
    assert facts["actions at most"] == "15"
    assert facts["SHA-256 of run.json"] == report.run.head_sha256
    assert "recovery policy" not in facts
    assert "<title>a on small: AgentHijack report</title>" in page
    extent = "2 tasks, 1 condition, 9 seeds, 2 episodes that count."
    assert f'<p class="lead">{extent}</p>' in page
    assert "<li>a: solves 50.0 % clean; no corruption was played.</li>" in page


@pytest.mark.parametrize(
    ("marks", "words"), [([0, 0], "nothing, clean or"), ([0, 1], "nothing clean")]
)
def test_who_solves_nothing_clean_is_not_said_to_lose_nothing(tmp_path, marks, words):
    records = scored("a", "clean", [0, 0]) + scored("a", "marks", marks)
    (text,) = conclude(build_report(read_run(tmp_path / "run", records)))
    assert f"solves {words}" in text
    assert text.endswith("no loss can be seen.")


@pytest.mark.parametrize(("p", "lost"), [(0.049, True), (0.05, False), (None, False)])
def test_a_page_marks_a_loss_that_the_test_shows(p, lost):
    report = report_of(cell("clean", 1.0, delta=0.0), cell("marks", 0.5, delta=-0.5, p=p))
    page = formats.write(ReportDocument(report=report), "html")
    assert page.count('<td style="--v:50" class="lost"') == lost
    assert page.count('<span class="delta">-50.0</span>') == 1
    assert '<span class="delta">+0.0</span>' not in page, "clean has no difference to clean"


# Numbers in words


@pytest.mark.parametrize(
    ("shown", "wanted"),
    [
        (formatting.percent(None), ""),
        (formatting.percent(0.4565), "45.6"),
        (formatting.percent(0.05, "+"), "+5.0"),
        (formatting.percent(-0.05, "+"), "-5.0"),
        (formatting.interval(0.1, None), ""),
        (formatting.interval(-0.1, 0.25, "+"), "[-10.0, +25.0]"),
        (formatting.retention_interval(0.5, None), "[50.0, …)"),
        (formatting.retention_interval(None, None), ""),
        (formatting.retention_interval(0.5, 1.25), "[50.0, 125.0]"),
        (formatting.p_value(None), ""),
        (formatting.p_value(0.00049), "<0.001"),
        (formatting.p_value(0.0005), "0.001"),
        (formatting.p_value(1.0), "1.000"),
        (formatting.number(None), ""),
        (formatting.number(2.25, 0), "2"),
        (formatting.money(None), ""),
        (formatting.money(0.125), "0.12"),
        (formatting.count(None), ""),
        (formatting.count(0), "0"),
        (formatting.count(12_345_678_901), "12.3G"),
        (formatting.worst((), None), ""),
        (formatting.worst((), 0.5), "none"),
        (formatting.worst(("marks", "lock"), 0.25), "marks, lock 25.0"),
        (formatting.privileged_inputs(None), ""),
        (formatting.privileged_inputs(("task", "plan")), "the task and the plan"),
    ],
)
def test_numbers_are_written_alike_everywhere(shown, wanted):
    assert shown == wanted


# The leaderboard


def standing(agent, corrupted, clean=0.5, **more):
    return AgentSummary(agent=agent, n=4, clean=clean, corrupted=corrupted, **more)


def ranked(*rows, **identity):
    """Rank agents of one run; returns ranks, reasons and the order."""
    run = RunIdentity(name="run", kind="bench", head_sha256="a" * 64, **identity)
    report = RunReport(run=run, summaries=rows)
    report_folder = ReportFolder(folder=None, reports=(("here", report),), problems=())
    (board,) = rank_agents(report_folder)
    return [(line.rank, line.row.agent, line.reason) for line in board.lines]


def test_agents_with_the_same_mean_share_a_rank_and_the_next_one_is_left_free():
    result = ranked(
        standing("last", 0.25),
        standing("tied", 0.5, clean=0.5),
        standing("tied too", 0.5, clean=0.75),
        standing("first", 0.75),
    )
    assert result == [(1, "first", ""), (2, "tied too", ""), (2, "tied", ""), (4, "last", "")]


def test_agents_are_ranked_with_those_that_were_given_the_same_and_yardsticks_are_not():
    result = ranked(
        standing("oracle", 1.0),
        standing("told", 0.9, given=("task", "plan")),
        standing("pixel", 0.4, given=("plan",)),
        standing("pixel_onlooker", 0.8, given=("plan",)),
        standing("second", 0.25),
        standing("half", 0.5, invalid=3),
        standing("clean only", None),
        standing("first", 0.5),
        standing("unplayed", None, clean=None),
    )
    assert result == [
        (None, "oracle", "yardstick"),
        (1, "told", ""),
        (1, "pixel_onlooker", ""),
        (None, "half", "3 invalid episodes"),
        (1, "first", ""),
        (2, "pixel", ""),
        (2, "second", ""),
        (None, "clean only", "no corruption was played"),
        (None, "unplayed", "no corruption was played"),
    ]


@pytest.mark.parametrize(
    ("identity", "why"),
    [
        ({"planned": 8, "missing": 2}, "2 of 8 episodes are missing"),
        ({"damaged": 1}, "1 line of the run cannot be read"),
    ],
)
def test_nobody_has_a_rank_in_a_run_that_is_not_whole(identity, why):
    result = ranked(standing("a", 0.5), standing("b", 0.25), **identity)
    assert result == [(None, "a", why), (None, "b", why)]


def test_a_board_of_offline_steps_says_so_and_more_agents_come_first(tmp_path):
    run_of(tmp_path / "live", scored("a", "marks", [1, 0]))
    offline = [record for name in ("b", "c") for record in scored(name, "marks", [1, 0, 0])]
    run_of(tmp_path / "steps", offline, kind="score")
    steps, live = rank_agents(read_reports(tmp_path))
    assert steps.title == "small, offline steps, 3 tasks"
    assert live.title == "small, live episodes, 2 tasks"
    assert [line.values for line in live.lines] == [("50.0",)]
    assert [line.shares for line in steps.lines] == [(33,), (33,)]


def test_a_file_is_no_folder_of_runs(tmp_path):
    path = tmp_path / "report.json"
    path.touch()
    with pytest.raises(ReportError) as error:
        read_reports(path)
    assert str(error.value) == f"{path}: is no folder of runs"
