"""What docs/results publishes of a run is what the records beside it give."""

import importlib
import json
from pathlib import Path

import pytest
import yaml

from online_env import tasks
from online_env.report.build import build_report, read_report, reports_agree
from online_env.results import reading, scores
from online_env.results.reading import Run

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs" / "results"
REMEDY = "write it anew: python benchmarks/published.py NAME --report-only SEEDS"
WITH_RECORDS = sorted(path.parent.name for path in RESULTS.glob("*/run"))


@pytest.fixture
def published_table(monkeypatch):
    """The script that makes the tables of the pages."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return importlib.import_module("published_table")


def published_run(name: str) -> Run:
    """The records of a result, of the seeds that its report has."""
    report = read_report(RESULTS / name / "report.json")
    run = reading.read(RESULTS / name / "run")
    return reading.with_first_seeds(run, len(report.run.seeds))


@pytest.mark.parametrize("name", WITH_RECORDS)
def test_a_report_is_that_of_its_records(name):
    report = read_report(RESULTS / name / "report.json")
    assert report.run.name == name
    assert reports_agree(build_report(published_run(name)), report), REMEDY


def test_the_tables_of_pages_are_those_of_the_records(published_table):
    tabled = [name for name in WITH_RECORDS if name in published_table.TABLES]
    assert "reference_agents" in tabled
    for name in tabled:
        page = (RESULTS / name / "about.md").read_text(encoding="utf-8")
        run = published_run(name)
        for kind, value in published_table.TABLES[name].items():
            assert published_table.read_block(page, kind) == value(run).strip(), REMEDY


def test_the_readme_counts_the_episodes_of_its_figure():
    report = read_report(RESULTS / "reference_agents" / "report.json")
    episodes = sum(row.n + row.invalid for row in report.summaries)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"({report.run.tasks} tasks, {episodes:,} episodes;" in text
    titles = yaml.safe_load((ROOT / "docs" / "site" / "texts.yaml").read_text(encoding="utf-8"))
    solved = {
        label: round(100 * report.cell("pixel", label).success) for label in ("clean", *titles)
    }
    for label, share in solved.items():  # as docs/site/figure.py draws them
        title = titles[label]["title"] if label in titles else label
        assert f"{title.lower()} {share} %" in text
    clean = solved.pop("clean")
    assert f"**{clean} %**" in text
    assert f"**{min(solved.values())} to {max(solved.values())} %**" in text


def solved_by_case(name: str) -> dict[tuple[str, str], bool]:
    """Whether `pixel` solved a task under a corruption with seed 0."""
    entries = {}
    for record in published_run(name).records:
        if record["agent"] == "pixel" and record["seed"] == 0:
            task = scores.task_name(record["task"], record["task_seed"])
            entries[task, record["corruption"]] = record["score"] == 1.0
    return entries


def test_the_counts_in_the_text_of_all_tasks_are_those_of_the_records():
    solved = solved_by_case("all_tasks")
    played_tasks = {name: tasks.get(name) for name, _ in solved}
    begins = {name: task.plan()[1].split()[0] for name, task in played_tasks.items()}
    clicks = [name for name, verb in begins.items() if "click" in verb]
    keys = [name for name, verb in begins.items() if verb == "press"]
    online = [name for name, task in played_tasks.items() if "network_error" in task.unsolvable]
    impossible = [name for name, task in played_tasks.items() if task.infeasible]

    def under(corruption: str, names: list[str]) -> int:
        return sum(solved[name, corruption] for name in names)

    offline = [name for name in played_tasks if name not in online]
    feasible = [name for name in played_tasks if name not in impossible]
    reference = solved_by_case("reference_agents")
    again = [case for case in reference if case in solved]
    alike = sum(reference[case] == solved[case] for case in again)
    text = (RESULTS / "all_tasks" / "about.md").read_text(encoding="utf-8")
    for phrase in (
        f"Of the {len(clicks)} tasks whose plan begins with a click, which gives the keyboard back,"
        f" it solved {under('multi_apps', clicks)}; of the {len(keys)} that begin with a key,"
        f" {under('multi_apps', keys)}:",
        f"{under('network_error', online)} of {len(online)} tasks that need it were solved,"
        f" {under('network_error', offline)} of the {len(offline)} others",
        f"Of the {len(impossible)} tasks that cannot be done,"
        f" {under('app_minimization', impossible)} were solved under `app_minimization`",
        f"Of the feasible tasks, {under('app_minimization', feasible)} of {len(feasible)} were",
        f"{alike} of the {len(again)} cases",
    ):
        assert phrase in text


def test_a_page_without_a_place_for_its_table_stays_as_it_is(published_table, tmp_path):
    text = f"# A page\n\n{published_table.begin('differences')}"
    page = tmp_path / "about.md"
    page.write_text(text)
    with pytest.raises(ValueError, match=r"about\.md: has no place for a table"):
        published_table.rewrite(page, "reference_agents", published_run("reference_agents"))
    assert page.read_text() == text


def test_the_ten_episodes_are_sound_and_end_as_their_page_says():
    page = (RESULTS / "ten_episodes_viewer.html").read_text(encoding="utf-8")
    assert len(page) < 2_000_000
    data = json.loads(page.partition('id="run-data">')[2].partition("</script>")[0])
    assert len(data["episodes"]) == 10
    for episode in data["episodes"]:
        assert episode["problems"] + episode["checked"] == []
        assert all(not step["lost"] for step in episode["steps"])
    labels, outcomes = (
        [data["texts"][key]["values"][code] for code in data["texts"][key]["codes"]]
        for key in ("corruption", "outcome")
    )
    solved = [label for label, end in zip(labels, outcomes, strict=True) if end == "success"]
    failed = [label for label in labels if label not in solved]
    text = (RESULTS / "ten_episodes.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith("| clean"))
    assert [set(cell.split(", ")) for cell in row.strip("| ").split(" | ")] == [
        set(solved),
        set(failed),
    ]
