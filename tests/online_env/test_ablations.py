"""The paper's ablations as benchmarks that run without a model, and their tables and figures."""

import json

import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")

import hijack_data as hj
from hijack_data.cli import main
from hijack_data.config import load_config
from hijack_data.plan import CLEAN
from hijack_data.runs.run_planners import read_planners
from online_env import tasks
from online_env.agents.registry import AGENTS
from online_env.bench.config import load_bench
from online_env.bench.jobs import jobs
from online_env.environment.script import BEFORE
from online_env.report import build_report, formats
from online_env.report.ablations import MODULES, ONLOOKERS, find_ablations, level_table
from online_env.report.board_page import board_page
from online_env.report.document import ReportDocument
from online_env.report.leaderboard import rank_agents, read_reports
from online_env.report.model import ReportError, from_data
from online_env.tasks.plan_words import read_plan

from support.reported import made, read_run, whole

# The configurations of levels that make each figure.
FIGURES = {
    "intensity": (
        "resolution_scale",
        "marks_number",
        "accidental_touch_frequency",
        "app_minimization_frequency",
    ),
    "content": ("pop_ups_content", "subtitle_content", "marks_shape", "marks_color"),
    "location": ("subtitle_position", "accidental_touch_location", "app_minimization_location"),
}
EPISODES = {"intensity": 260, "content": 240, "location": 200, "modules": 400}
SCREEN = hj.Scene(size=(1080, 1920))
STEPS = range(BEFORE, 13)


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_has_the_levels_of_its_ablations(name):
    planners = load_bench(f"ablations/{name}").planners
    levels = [
        planner
        for part in FIGURES[name]
        for planner in load_config(f"ablations/{part}").corruptions.values()
    ]
    assert planners[CLEAN] is None
    matches = [planner for planner in planners.values() if planner is not None]
    assert all(planner in levels for planner in matches)
    assert all(planner in matches for planner in levels)


@pytest.mark.parametrize("name", EPISODES)
def test_a_figure_is_read_and_plans_its_episodes(name, capsys):
    bench = load_bench(f"ablations/{name}")
    assert len(jobs(bench)) == EPISODES[name]
    for planner in bench.planners.values():
        if planner is not None:
            plans = [planner.plan(SCREEN, seed=0, sample="s", step=step) for step in STEPS]
            assert any(plan.ops or plan.effects for plan in plans), planner
    for task in bench.tasks:
        assert read_plan(tasks.get(task, 0).plan()), f"{task} has no plan in words"
    with pytest.raises(SystemExit) as ended:
        main(["bench", f"ablations/{name}", "--dry-run"])
    assert ended.value.code in (None, 0)
    assert f"{EPISODES[name]} episodes on" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("names", "benchmark", "episodes"),
    [
        (MODULES["pixel_onlooker"], "modules", 400),
        (MODULES["agenthijack-agent"], "agenthijack_modules", 500),
        (ONLOOKERS["agenthijack-agent"], "onlooker", 300),
    ],
)
def test_the_variants_of_a_figure_are_the_agents_of_its_benchmark(names, benchmark, episodes):
    bench = load_bench(f"ablations/{benchmark}")
    assert set(names) == set(bench.agents)
    assert len(jobs(bench)) == episodes
    for name in names:
        AGENTS.find(name)


def reported(folder, entries, levels):
    """A report of a run with these corruptions; `levels` says what each agent solves of ten."""
    values = [
        made(agent, f"t{number}", label, float(number < solved), version=3, given=["plan"])
        for agent, by_label in levels.items()
        for label, solved in by_label.items()
        for number in range(10)
    ]
    return build_report(read_run(folder / "run", values, corruptions=entries))


MARKS = [
    CLEAN,
    {"marks": {"as": "marks_red_star", "mark_type": "star", "color": "red"}},
    {"marks": {"as": "marks_circle", "mark_type": "circle"}},
    {"marks": {"as": "marks_blue", "color": "blue"}},
    {"resolution": {"as": "half", "scale": 0.5}},
]
SOLVED = {CLEAN: 10, "marks_red_star": 8, "marks_circle": 7, "marks_blue": 4, "half": 2}


def test_conditions_that_differ_in_the_same_parameters_are_levels(tmp_path):
    report = reported(tmp_path, MARKS, {"one": SOLVED, "two": SOLVED})
    shape, colour = find_ablations(report)
    assert (shape.title, colour.title) == ("marks: mark_type", "marks: color")
    assert shape.levels == (
        (CLEAN, CLEAN),
        ("marks_red_star", "red star"),
        ("marks_circle", "circle"),
    )
    assert [name for _, name in colour.levels] == [CLEAN, "red star", "blue"]
    headings, rows = level_table(report, colour)
    assert headings == ["level", "one, %", "95 %", "two, %", "95 %"]
    assert [(row[0], row[1], row[3]) for row in rows] == [
        (CLEAN, "100.0", "100.0"),
        ("red star", "80.0", "80.0"),
        ("blue", "40.0", "40.0"),
    ]


def test_the_levels_of_a_run_that_was_configured_by_a_file_are_told(tmp_path):
    """`Bench.to_data` writes every parameter out, and its steps as mappings."""
    entries = load_bench("ablations/intensity").to_data()["corruptions"]
    labels = list(read_planners(entries))
    report = reported(tmp_path, entries, {"pixel": dict.fromkeys(labels, 5)})
    assert [
        (find_ablation.title, len(find_ablation.levels)) for find_ablation in find_ablations(report)
    ] == [
        ("resolution: scale", 4),
        ("marks: number", 4),
        ("accidental_touch: step", 4),
        ("app_minimization: step", 4),
    ]


TOUCHES = [
    CLEAN,
    {"accidental_touch": {"as": "touch_3", "step": 3}},
    {"accidental_touch": {"as": "touch_12", "step": 12}},
    "resolution",
]


def test_levels_that_come_late_say_how_often_they_came(tmp_path):
    touched = {"touch_3": 10, "touch_12": 4}
    values = [
        made(
            "one",
            f"t{number}",
            label,
            effects=[{"step": 3}] if number < touched.get(label, 0) else [],
        )
        for label in (CLEAN, "touch_3", "touch_12", "resolution")
        for number in range(10)
    ]
    report = build_report(read_run(tmp_path / "run", values, corruptions=TOUCHES))
    (touches,) = find_ablations(report)
    headings, rows = level_table(report, touches)
    assert headings == ["level", "one, %", "95 %", "disturbed"]
    assert [(row[0], row[3]) for row in rows] == [
        (CLEAN, ""),
        ("touch 3", "10 of 10"),
        ("touch 12", "4 of 10"),
    ]
    page = formats.write(ReportDocument(report=report), "html")
    assert "disturbed" in page
    assert "4 of 10" in page


def test_agents_without_a_module_are_an_ablation(tmp_path):
    levels = {agent: {CLEAN: 9, "marks": 5} for agent in MODULES["pixel_onlooker"]}
    report = reported(tmp_path, [CLEAN, "marks"], levels)
    (value,) = find_ablations(report)
    assert value.title == "modules of pixel_onlooker"
    assert [name for _, name in value.series][-1] == "all modules"
    assert [label for label, _ in value.levels] == [CLEAN, "marks"]


def test_a_run_of_the_nine_has_no_ablation(tmp_path):
    run = read_run(
        tmp_path / "run", whole("mine", dict.fromkeys((CLEAN, *hj.corruption_names()), 3))
    )
    assert find_ablations(build_report(run)) == ()


def test_markdown_and_page_show_levels_and_a_finished_report_keeps_them(tmp_path):
    document = ReportDocument(report=reported(tmp_path, MARKS, {"one": SOLVED}))
    text = formats.write(document, "markdown")
    assert "### marks: color" in text.replace("\\", "")
    assert "| blue | 40.0 |" in text
    page = formats.write(document, "html")
    assert page.count("<h3>marks: ") == 2
    assert "one, blue: 40.0 %, 95 % [" in page
    again = from_data(json.loads(formats.write(document, "json")), "r.json")
    assert find_ablations(again) == find_ablations(document.report)


def test_what_agents_were_given_stands_beside_them(tmp_path):
    document = ReportDocument(report=reported(tmp_path, MARKS, {"one": SOLVED}))
    assert document.report.summaries[0].given == ("plan",)
    note = "one was given the task's plan in words"
    assert note in formats.write(document, "markdown")
    assert "| the plan |" in formats.write(document, "markdown")
    assert "one (given the plan): worst under" in formats.write(document, "terminal")
    assert "one (given the plan) &" in formats.write(document, "latex")
    assert "<td>the plan</td>" in formats.write(document, "html")
    with pytest.raises(ReportError, match="only reference agents"):
        formats.write(document, "model-index")


def test_who_was_given_more_is_ranked_apart(tmp_path):
    reported(tmp_path, MARKS, {"one": SOLVED})
    (line,) = rank_agents(read_reports(tmp_path))[0].lines
    assert (line.rank, line.rivals, line.inputs) == (1, 1, "the plan")
    assert '<td class="plain" data-order="the plan">the plan</td>' in board_page(
        read_reports(tmp_path)
    )
