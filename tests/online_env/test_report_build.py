"""The report as data: its statistics against cases worked out by hand, and its JSON."""

import json
from dataclasses import replace

import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")

from click.testing import CliRunner
from scipy import stats

from hijack_data.cli import hijack
from hijack_data.errors import UnknownNameError
from online_env.report import (
    ReportError,
    build_report,
    formats,
    load_report,
    scores_by_name,
    terminal,
)
from online_env.report.document import ReportDocument
from online_env.report.figures import success_panels
from online_env.report.model import from_data
from online_env.results import records, scores, statistics
from online_env.results.reading import Run, RunError, read, with_first_seeds

from support.reported import CONDITIONS, made, read_run, run_of, scored, whole

SOLVED = dict(zip(CONDITIONS, (8, 4, 2, 8, 6, 7, 5, 5, 1, 3), strict=True))


def cell_of(report, agent, label):
    result = report.cell(agent, label)
    assert result is not None
    return result


def test_a_cell_by_hand(tmp_path):
    items = [
        *scored("a", "clean", [1, 1, 1, 0]),
        *scored("a", "marks", [1, 0, 0, 0]),
        *scored("recovering", "marks", [1, 1, 1, 0]),
    ]
    report = build_report(read_run(tmp_path / "run", items))
    cell = cell_of(report, "a", "marks")
    assert (cell.n, cell.tasks, cell.success, cell.delta) == (4, 4, 0.25, -0.5)
    assert cell.retention == pytest.approx(1 / 3)
    assert (cell.p, cell.ceiling) == (0.5, 0.75)  # two lost, none won: 2 * 0.5 ** 2
    assert cell.retention_low == pytest.approx(0.0177, abs=1e-3)
    assert cell.retention_high == pytest.approx(1.4063, abs=1e-3)
    assert (cell.steps, cell.seconds, cell.malformed) == (4, 2, 0.25)
    clean = cell_of(report, "a", "clean")
    assert (clean.delta, clean.retention, clean.detectable, clean.ceiling) == (None,) * 4


def test_power_is_that_of_the_paired_t_test(tmp_path):
    marks = [0.0, 1.0] * 10
    items = [*scored("a", "clean", [1.0] * 20), *scored("a", "marks", marks)]
    cell = cell_of(build_report(read_run(tmp_path / "run", items)), "a", "marks")
    spread = stats.tstd([score - 1 for score in marks])
    shift = cell.detectable / spread * 20**0.5
    limit = stats.t.ppf(0.975, 19)
    calls = stats.nct.sf(limit, 19, shift) + stats.nct.cdf(-limit, 19, shift)
    assert calls == pytest.approx(0.8, abs=1e-4)


def test_an_agent_over_the_ten_conditions(tmp_path):
    report = build_report(read_run(tmp_path / "run", whole("a", SOLVED)))
    (row,) = report.summaries
    assert (row.n, row.clean, row.conditions) == (100, 0.8, 9)
    assert row.corrupted == row.nine == pytest.approx(41 / 90)
    assert row.paper_average == pytest.approx(49 / 100)  # ten columns: clean is one of them
    assert (row.worst, row.worst_success) == ("network_error", 0.1)
    assert row.retention == pytest.approx(41 / 72)
    assert row.corrupted_low < row.corrupted < row.corrupted_high
    assert row.retention_low < row.retention < row.retention_high
    assert (row.steps, row.malformed) == (4, 0.25)


@pytest.mark.parametrize(
    ("solved", "worst", "least"),
    [
        ({"clean": 0, "marks": 0, "subtitle": 0}, (), 0.0),  # solves nothing
        ({"marks": 0}, (), 0.0),  # nothing either
        ({"clean": 10, "marks": 10, "subtitle": 10}, (), 1.0),  # alike
        ({"clean": 10, "marks": 0, "subtitle": 0}, (), 0.0),
        ({"clean": 10, "marks": 0}, ("marks",), 0.0),  # alone, and worse than clean
        ({"clean": 10, "marks": 2, "subtitle": 2, "pop_ups": 3}, ("marks", "subtitle"), 0.2),
        ({"clean": 4}, (), None),
    ],
)
def test_the_worst_corruption_is_one_that_is_worse_than_another(solved, worst, least, tmp_path):
    values = [
        record
        for label, count in solved.items()
        for record in scored("a", label, [float(n < count) for n in range(10)])
    ]
    report = build_report(read_run(tmp_path / "run", values))
    (row,) = report.summaries
    assert report.worst_corruptions("a") == worst
    assert (row.worst, row.worst_success) == (worst[0] if worst else None, least)
    output = terminal.text(ReportDocument(report=report, full=True))
    if least is None:
        assert "worst" not in output
    elif not worst:
        assert "a: corrupted" in output
        assert ", worst none" in output
    else:
        assert f", worst {', '.join(worst)} {100 * least:.1f}" in output
    (panel,) = success_panels(report)
    marked = [bar.label for bar in panel.bars if bar.kind == "worst"]
    assert marked == (list(worst) if len(solved) > 2 else [])


@pytest.mark.parametrize(
    ("source", "shown"),
    [
        ("/home/me/runs/mine.yaml", "mine.yaml"),
        ("C:\\Users\\me\\mine.yaml", "mine.yaml"),
        ("../mine.yaml", "mine.yaml"),
        ("benchmark/embedded_small", "benchmark/embedded_small"),  # packaged, under this name
        ("rows", "rows"),
        ("..", ""),
    ],
)
def test_a_source_means_the_same_on_any_machine(source, shown, tmp_path):
    run = read_run(tmp_path / "run", scored("a", "clean", [1]), source=source)
    assert build_report(run).run.source == shown


def test_the_papers_means_need_all_nine_under_their_own_names(tmp_path):
    renamed = [
        {
            **record,
            "corruption": "many" if record["corruption"] == "marks" else record["corruption"],
        }
        for record in whole("a", SOLVED)
    ]
    settings = ["many" if label == "marks" else label for label in CONDITIONS]
    report = build_report(read_run(tmp_path / "run", renamed, corruptions=settings))
    (row,) = report.summaries
    assert (row.nine, row.paper_average) == (None, None)
    assert row.corrupted == pytest.approx(41 / 90)
    assert any("all nine corruptions" in note for note in report.notes)
    # A label of one of the nine that is another corruption does not count, either.
    disguised = [{"subtitle": {"as": "marks"}} if x == "marks" else x for x in CONDITIONS]
    run = read_run(tmp_path / "other", whole("a", SOLVED), corruptions=disguised)
    assert build_report(run).summaries[0].nine is None


def test_parameters_that_are_not_the_papers_are_named(tmp_path):
    settings = [{"marks": {"number": 100}} if x == "marks" else x for x in CONDITIONS]
    run = read_run(tmp_path / "run", whole("a", SOLVED), corruptions=settings)
    report = build_report(run)
    assert report.run.changed == ("marks",)
    assert "Not with the paper's parameters: marks." in report.notes
    same = [{"marks": {"number": 50}} if x == "marks" else x for x in CONDITIONS]
    run = read_run(tmp_path / "same", whole("a", SOLVED), corruptions=same)
    assert build_report(run).run.changed == ()


def test_mce_is_the_mean_ratio_of_errors(tmp_path):
    items = [
        *scored("a", "clean", [1, 1]),
        *scored("a", "marks", [1, 0]),  # error 1/2
        *scored("a", "subtitle", [1, 1]),  # error 0
        *scored("weak", "marks", [0, 0]),  # error 1
        *scored("weak", "subtitle", [1, 0]),  # error 1/2
    ]
    run = read_run(tmp_path / "run", items)
    report = build_report(run, reference="weak")
    mce = {row.agent: row.mce for row in report.summaries}
    assert mce == {"a": pytest.approx(0.25), "weak": pytest.approx(1.0)}
    assert {row.mce for row in build_report(run).summaries} == {None}
    # `a` never fails under subtitle: no ratio to it exists.
    assert {row.mce for row in build_report(run, reference="a").summaries} == {None}
    with pytest.raises(UnknownNameError, match=r"--reference: 'weka' is not in .*mean 'weak'"):
        build_report(run, reference="weka")


def test_pass_hat_k_over_seeds(tmp_path):
    values = [
        record
        for seed, scores in enumerate(([1, 1, 0], [1, 0, 0], [1, 1, 0]))
        for record in scored("a", "clean", scores, seed)
    ]
    cell = cell_of(build_report(read_run(tmp_path / "run", values)), "a", "clean")
    # t0 is solved by all three seeds, t1 by two, t2 by none: C(2, k) / C(3, k) for t1.
    assert cell.pass_hat == pytest.approx(((3 + 2) / 9, (1 + 1 / 3) / 3, 1 / 3))
    assert (cell.n, cell.tasks) == (9, 3)
    fewer = [record for record in values if (record["task"], record["seed"]) != ("t2-2", 2)]
    cell = cell_of(build_report(read_run(tmp_path / "fewer", fewer)), "a", "clean")
    assert len(cell.pass_hat) == 2  # as many seeds as every task has


def test_errors_invalid_and_what_was_used(tmp_path):
    usage = {"requests": 2, "input_tokens": 1000, "output_tokens": 50, "usd": 0.25}
    invalid = {"status": "invalid", "score": None, "usage": usage}
    items = [
        made("a", "t0", usage=usage),
        made("a", "t1", score=None, cause="agent", usage=usage),
        made("a", "t2", **invalid),
    ]
    report = build_report(read_run(tmp_path / "run", items))
    (cell,) = report.cells
    assert (cell.n, cell.success, cell.errors, cell.invalid) == (2, 0.5, 1, 1)
    # What an invalid episode used was paid for, too.
    assert (cell.requests, cell.input_tokens, cell.output_tokens) == (6, 3000, 150)
    assert (cell.usd, report.summaries[0].usd) == (0.75, 0.75)
    items[1]["usage"] = usage | {"usd": None}
    (cell,) = build_report(read_run(tmp_path / "other", items)).cells
    assert (cell.requests, cell.usd) == (6, None)
    # A part is not taken for the whole, but an episode without an action took nothing.
    items[1]["usage"] = None
    (cell,) = build_report(read_run(tmp_path / "partial", items)).cells
    assert (cell.requests, cell.input_tokens, cell.usd) == (None, None, None)
    items[1:] = [made("a", "t1", status="invalid", score=None, steps=0, usage=None)]
    (cell,) = build_report(read_run(tmp_path / "nothing", items)).cells
    assert (cell.requests, cell.usd) == (2, 0.25)


def test_malformed_actions_are_a_share_of_the_actions_that_were_judged(tmp_path):
    items = [made("a", "t0", malformed=4), made("a", "t1", malformed=None)]
    (cell,) = build_report(read_run(tmp_path / "run", items)).cells
    assert cell.malformed == 1


def test_feasible_and_infeasible_apart(tmp_path):
    result = scored("a", "clean", [1, 1, 0, 0])
    for record in result[3:]:
        record["infeasible"] = True
    report = build_report(read_run(tmp_path / "run", result))
    assert [cell.n for cell in (*report.cells, *report.feasible, *report.infeasible)] == [4, 3, 1]
    assert report.feasible[0].success == pytest.approx(2 / 3)
    assert report.infeasible[0].success == 0


def test_the_mean_over_corruptions_counts_each_task_once():
    # Two cells of the same tasks, perfectly alike: as uncertain as one of them.
    scores = [1.0] * 30 + [0.0] * 70
    items = (scores, list(range(100)))
    twice = statistics.grand_mean_interval([items, items])
    single = statistics.mean_interval(*items)
    assert (twice.value, twice.low, twice.high) == (0.3, single.low, single.high)
    # Opposite cells cancel out: every task has the same mean.
    opposite = ([1 - score for score in scores], list(range(100)))
    still = statistics.grand_mean_interval([items, opposite])
    assert still.value == 0.5
    assert still.high - 0.5 == pytest.approx(0.5 - still.low)
    uneven = statistics.grand_mean_interval([items, ([1.0], [0])])
    assert uneven.value == pytest.approx(0.65)
    assert 0 < uneven.low < 0.65 < uneven.high <= 1


# As JSON


def test_a_report_comes_back_from_its_json(tmp_path):
    folder = run_of(tmp_path / "run", whole("a", SOLVED))
    report = load_report(folder)
    text = json.dumps(report.to_data(), allow_nan=False)
    assert from_data(json.loads(text), "here") == report
    (tmp_path / "r.json").write_text(text)
    assert load_report(tmp_path / "r.json") == report
    with pytest.raises(ReportError, match="finished report, whose reference agent is ''"):
        load_report(tmp_path / "r.json", reference="a")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"version": 2}, "version 2 is newer .* upgrade agenthijack"),
        ({"format": "other"}, "not a report"),
        ({"cells": 3}, "cells: must be a list, got 3"),
        ({"cells": [{"agent": "a", "corruption": "x", "n": "4"}]}, "n: must be int, got '4'"),
        ({"cells": [{"agent": "a", "corruption": "x"}]}, "'n'"),
        ({"extra": 1}, "unknown field 'extra'"),
        ({"run": None}, "run: must be an object"),
    ],
)
def test_what_is_no_report_is_refused(change, words, tmp_path):
    report = build_report(read_run(tmp_path / "run", scored("a", "clean", [1, 0])))
    with pytest.raises(ReportError, match=words):
        from_data({**report.to_data(), **change}, "r.json")


def test_an_empty_run_and_no_run_are_refused(tmp_path):
    with pytest.raises(ReportError, match=r"holds no episodes yet; hijack bench .* --resume"):
        load_report(run_of(tmp_path / "run", [], agents=["a"]))
    with pytest.raises(RunError, match="is not the folder of a run"):
        load_report(tmp_path / "none")
    with pytest.raises(ReportError, match="is the head of a run"):
        load_report(tmp_path / "run" / "run.json")


INVALID = {"status": "invalid", "score": None, "cause": "machine", "problem": "no proof"}


def alike(agent, corruption, scores, seeds):
    """The same scores with each of several seeds."""
    return [record for seed in range(seeds) for record in scored(agent, corruption, scores, seed)]


def test_p_takes_each_task_as_one_case_whatever_its_seeds(tmp_path):
    def p(seeds):
        items = [
            *alike("a", "clean", [1] * 8, seeds),
            *alike("a", "marks", [0] * 4 + [1] * 4, seeds),
        ]
        return cell_of(build_report(read_run(tmp_path / str(seeds), items)), "a", "marks").p

    assert (p(1), p(3)) == (0.125, 0.125)


def test_notes_say_what_numbers_do_not_mean(tmp_path):
    def notes(name, found):
        return "\n".join(build_report(read_run(tmp_path / name, found)).notes)

    half = [*scored("a", "clean", [0.9, 0.9, 1]), *scored("a", "marks", [0.1, 0.1, 0])]
    assert "4 scores are between 0 and 1: p takes them for not solved" in notes("half", half)
    missed = [*scored("a", "clean", [1, 1]), *scored("b", "clean", [1])]
    assert "under the same condition (clean: a 2, b 1)" in notes("missed", missed)
    invalid = [record | INVALID for record in scored("a", "clean", [1, 1])]
    unpaired = [*invalid, *scored("a", "marks", [1, 0])]
    assert "No clean episode counts for a, so there is no delta" in notes("unpaired", unpaired)
    lost = [*invalid[:1], *scored("a", "clean", [1, 1])[1:], *scored("a", "marks", [1, 0])]
    assert (
        "1 result without a clean one of the same task and seed: in the success, and in no delta,"
        " retention or test (a under marks 1)."
    ) in notes("lost", lost)
    broken = [*scored("a", "clean", [1, 1]), *scored("a", "marks", [1, 0])]
    broken[2] |= INVALID
    assert (
        "1 invalid result whose clean one counts: the pair is in no delta, retention or test,"
        " which may flatter the agent where the corruption was the reason (a under marks 1)."
    ) in notes("broken", broken)
    assert "invalid" not in notes("both", [record | INVALID for record in broken])
    whole = notes("whole", [*scored("a", "clean", [1, 0]), *scored("a", "marks", [1, 0])])
    words_of_notes = (
        "between 0 and 1",
        "as many scores",
        "No clean episode",
        "a clean one",
        "pair",
    )
    for words in words_of_notes:
        assert words not in whole


def test_a_run_of_infeasible_tasks_alone_has_one_table_more(tmp_path):
    values = [{**record, "infeasible": True} for record in scored("a", "clean", [1, 0])]
    document = ReportDocument(report=build_report(read_run(tmp_path / "run", values)), full=True)
    for format in ("terminal", "markdown", "html"):
        text = formats.write(document, format).lower()
        assert "infeasible tasks" in text
        assert "feasible tasks" not in text.replace("infeasible tasks", "")


@pytest.mark.parametrize("has_head", [True, False])
def test_the_last_attempt_counts_wherever_its_line_is(has_head, tmp_path):
    """Folders are sorted by name, a10 before a2; lines may have been sorted or joined."""
    items = [made("a", "t0", score=float(n == 11), attempt=n, id=f"t0__a{n}") for n in range(12)]
    folder = tmp_path / "run"
    if has_head:
        run_of(folder, sorted(items, key=lambda item: item["id"]), tasks=["t0-0"])
    for item in [] if has_head else items:
        (folder / "episodes" / item["id"]).mkdir(parents=True)
        (folder / "episodes" / item["id"] / "episode.json").write_text(json.dumps(item))
    (cell,) = build_report(read(folder)).cells
    assert (cell.n, cell.success) == (1, 1)


def test_rows_in_json_are_those_of_the_report(tmp_path):
    """Tasks that count 0 without being played were in the table alone."""
    folder = run_of(
        tmp_path / "run",
        [*scored("a", "clean", [1, 1]), *scored("a", "marks", [1, 0])],
        unplayable={"other": {"reason": "no file", "apps": [], "infeasible": False}},
        unplayable_score=0.0,
    )
    rows = json.loads(CliRunner().invoke(hijack, ["report", str(folder), "--json"]).stdout)
    cells = build_report(read(folder)).cells
    assert [(row["n"], row["success"]) for row in rows] == [(c.n, c.success) for c in cells]
    assert [row["n"] for row in rows] == [3, 3]


def test_a_log_without_a_head_is_reported_too(tmp_path):
    run = Run(folder=tmp_path, records=scored("a", "clean", [1, 0]))
    report = build_report(run)
    assert (report.run.head_sha256, report.run.kind, report.cells[0].success) == ("", "bench", 0.5)


# The first seeds of a run that goes on


def going_on(folder):
    """Write a run of three seeds, of whose last one only one agent was played."""
    played = [*scored("a", "clean", [1, 0]), *scored("b", "clean", [1, 1])]
    played += [*scored("a", "clean", [1, 1], 1), *scored("b", "clean", [0, 1], 1)]
    played += scored("a", "clean", [0, 0], 2)
    ids = [record["id"] for record in played] + ["t0-2__clean__s2__b", "t1-2__clean__s2__b"]
    config = {"agents": ["a", "b"], "tasks": ["t0", "t1"], "corruptions": ["clean"]}
    with records.create(folder, {**config, "seeds": [0, 1, 2]}, ids):
        records.append_all(folder, played)
    return folder


def test_the_first_seeds_are_reported_as_if_there_were_no_more(tmp_path):
    run = with_first_seeds(read(going_on(tmp_path / "run")), 2)
    assert (run.planned, run.missing, run.left_out) == (8, 0, (2,))
    report = build_report(run)
    assert [(cell.agent, cell.n, cell.success) for cell in report.cells] == [
        ("a", 4, 0.75),
        ("b", 4, 0.75),
    ]
    assert report.run.seeds == (0, 1)
    assert "The run has more seeds than this report, which leaves out: 2." in report.notes
    assert from_data(report.to_data(), "here").run.left_out == (2,)


def test_the_command_takes_the_first_seeds(tmp_path):
    folder = str(going_on(tmp_path / "run"))
    whole = CliRunner().invoke(hijack, ["report", folder])
    assert (whole.exit_code, "2 are missing" in whole.output) == (1, True)
    chosen = CliRunner().invoke(hijack, ["report", folder, "--seeds", "2"])
    assert (chosen.exit_code, "missing" in chosen.output) == (0, False), chosen.output


def test_seeds_that_a_run_does_not_have_are_refused(tmp_path):
    later = read_run(tmp_path / "later", scored("a", "clean", [1], 3), seeds=[3, 4])
    with pytest.raises(RunError, match="has no seed below 2; its seeds are 3, 4"):
        with_first_seeds(later, 2)
    with pytest.raises(RunError, match="it has no seeds"):
        with_first_seeds(Run(folder=tmp_path, records=scored("a", "clean", [1])), 2)
    odd = [made("__s1__", "t", seed=0), made("__s1__", "t", seed=1)]
    with pytest.raises(RunError, match=r"the seed of the episode .* cannot be told"):
        with_first_seeds(read_run(tmp_path / "odd", odd, seeds=[0, 1]), 1)


def test_seeds_of_a_run_that_ends_at_a_retention_are_not_chosen(tmp_path):
    """Its first seeds would say whether the retention is shown, which all seeds decide."""
    run = Run(folder=tmp_path, config={"seeds": [0, 1], "until_retention": {"retention": 0.8}})
    with pytest.raises(RunError, match="report it with all seeds"):
        with_first_seeds(run, 1)


def test_a_finished_report_has_no_seeds_to_choose(tmp_path):
    run = read_run(tmp_path / "run", scored("a", "clean", [1, 0]))
    path = tmp_path / "report.json"
    path.write_text(json.dumps(build_report(run).to_data()))
    refused = CliRunner().invoke(hijack, ["report", str(path), "--seeds", "1"])
    assert "--seeds chooses episodes of a run" in str(refused.exception)


# Scores by name


def test_scores_by_name(tmp_path):
    items = [
        *whole("a", SOLVED),
        *whole("b", SOLVED | {"clean": 10, "marks": 2}),
        *whole("do_nothing", dict.fromkeys(CONDITIONS, 0)),
    ]
    report = build_report(read_run(tmp_path / "run", items))
    named = scores_by_name(report)
    # The lesser of both agents; the reference agent does not count.
    assert named["clean"] == 0.8
    assert named["success.marks"] == 0.2
    assert named["retention"] == pytest.approx(35 / 90)
    assert named["worst"] == 0.1
    assert named["do_nothing/clean"] == 0
    assert named["b/clean"] == 1
    assert named["a/delta.subtitle"] == pytest.approx(-0.2)
    assert "mce" not in named
    assert "retention" in named
    assert "do_nothing/retention" not in named  # nothing to keep
    alone = replace(report, summaries=report.summaries[2:])
    assert scores_by_name(alone)["clean"] == 0


def test_a_score_that_one_agent_lacks_is_no_score_of_all(tmp_path):
    """The retention of the other passed for that of both."""
    items = [
        *scored("good", "clean", [1, 1]),
        *scored("good", "marks", [1, 1]),
        *scored("bad", "clean", [0, 0]),
        *scored("bad", "marks", [0, 0]),
    ]
    named = scores_by_name(build_report(read_run(tmp_path / "run", items)))
    assert (named["good/retention"], named["clean"]) == (1, 0)
    assert not {"retention", "retention.marks", "bad/retention"} & named.keys()


def test_of_two_agents_the_greater_error_counts(tmp_path):
    items = [made("a", "t0", malformed=0), made("b", "t0", malformed=3, score=None)]
    named = scores_by_name(build_report(read_run(tmp_path / "run", items)))
    assert (named["errors"], named["malformed"], named["clean"]) == (1, 0.75, 0)


def test_an_attempt_that_was_repeated_was_paid_for(tmp_path):
    usage = {"requests": 1, "input_tokens": 10, "output_tokens": 1, "usd": 1.0}
    first = made("mine", "t0", status="invalid", score=0.0, usage=usage)
    again = made("mine", "t0", attempt=1, usage=usage)
    again["id"] += "__a1"
    report = build_report(read_run(tmp_path / "run", [first, again]))
    (cell,) = report.cells
    (summary,) = report.summaries
    assert (cell.n, cell.requests, cell.usd) == (1, 2, 2.0)
    assert (summary.requests, summary.usd) == (2, 2.0)


def test_the_tasks_of_a_scoring_run_are_its_recordings():
    """Though the name of a recording may end like the number of a step."""
    cases = [("task-0001", "0000", 7), ("task-0001", "0001", 7), ("task-0002", "0002", 7)]
    assert scores.task_names(cases) == ["task-0001", "task-0001", "task-0002"]
    assert scores.task_names([("write_note-0", 0, 0), ("write_note-1", 1, 1)]) == ["write_note"] * 2
