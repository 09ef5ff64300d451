"""`hijack report` of results that other harnesses wrote: what is read, paired and refused."""

import csv
import json
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")

from scipy import stats

from hijack_data.cli import main
from online_env.report import ReportError, build_report, formats
from online_env.report.conclusions import conclude
from online_env.report.document import ReportDocument
from online_env.results.outcomes import OutcomeError, collect_run, parse_columns

SOLVED = {"clean": [1, 1, 1, 1, 1, 0], "marks": [1, 1, 0, 0, 0, 0]}


def rows(**more):
    return [
        {"task": f"t{number}", "condition": label, "agent": "mine", "score": score, **more}
        for label, scores in SOLVED.items()
        for number, score in enumerate(scores)
    ]


def write_csv(path, listed):
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(listed[0]))
        writer.writeheader()
        writer.writerows(listed)
    return path


def write_jsonl(path, listed):
    path.write_text("".join(json.dumps(row) + "\n" for row in listed))
    return path


def write_parquet(path, listed):
    pa = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    parquet.write_table(pa.Table.from_pylist(listed), path)
    return path


def success(report, agent="mine"):
    return {cell.corruption: cell.success for cell in report.cells if cell.agent == agent}


@pytest.mark.parametrize(
    ("write", "suffix"), [(write_csv, "csv"), (write_jsonl, "jsonl"), (write_parquet, "parquet")]
)
def test_a_table_gives_the_report_of_the_same_scores(write, suffix, tmp_path):
    report = build_report(collect_run([write(tmp_path / f"r.{suffix}", rows())]))
    assert success(report) == {"clean": 5 / 6, "marks": 2 / 6}
    cell = report.cell("mine", "marks")
    assert (cell.delta, cell.retention, cell.p) == (pytest.approx(-0.5), 0.4, 0.25)
    assert report.run.kind == "results"
    assert not any("before their corruption" in note for note in report.notes)


def test_what_is_no_outcome_is_not_a_zero(tmp_path):
    listed = rows()
    listed[-1]["score"] = listed[-2]["score"] = None
    for write, name in (
        (write_csv, "a.csv"),
        (write_jsonl, "a.jsonl"),
        (write_parquet, "a.parquet"),
    ):
        run = collect_run([write(tmp_path / name, listed)])
        cell = build_report(run).cell("mine", "marks")
        assert (cell.n, cell.invalid, cell.success) == (4, 2, 0.5)
        assert [record["id"] for record in run.failures] == [
            f"t{number} under marks, seed 0, mine" for number in (4, 5)
        ]


@pytest.mark.parametrize(
    ("write", "name", "place"),
    [
        (write_csv, "a.csv", "line 13"),
        (write_jsonl, "a.jsonl", "line 12"),
        (write_parquet, "a.parquet", "row 12"),
    ],
)
@pytest.mark.parametrize(
    ("value", "said"), [(float("nan"), "is NaN; leave it empty"), (float("inf"), "is not in 0..1")]
)
def test_nan_and_infinity_are_refused_with_their_row(value, said, write, name, place, tmp_path):
    listed = rows()
    listed[-1]["score"] = value
    listed = [{**row, "score": float(row["score"])} for row in listed]
    with pytest.raises(OutcomeError) as error:
        collect_run([write(tmp_path / name, listed)])
    assert f"{name}: {place}: the score" in str(error.value)
    assert said in str(error.value)


def test_a_column_that_only_later_lines_have_is_refused(tmp_path):
    listed = rows()
    listed[3]["seed"] = 1
    with pytest.raises(OutcomeError, match="line 4: has 'seed', which the first line has not"):
        collect_run([write_jsonl(tmp_path / "r.jsonl", listed)])
    path = tmp_path / "r.csv"
    path.write_text("task,score,score\na,1,0\n")
    with pytest.raises(OutcomeError, match="has two columns 'score'"):
        collect_run([path])


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", "task,score\n t0,1\n", "result 1: the task ' t0' begins or ends with a space"),
        ("a.csv", "task;score\nt0;1\n", "is one column; separate columns by commas"),
        ("a.csv", "task,score\nt\xe9,1\n", "is not UTF-8"),
        ("a.csv", "task,score,steps\na,1,-2\n", "line 2: steps '-2' is no number of at least 0"),
        ("a.csv", "task,score,seed\na,1,1_0\n", "line 2: the seed '1_0' is no whole number"),
        ("a.jsonl", '{"task": "a", "score": 1, "score": 0}\n', "has the key 'score' twice"),
        ("a.jsonl", '{"task": "a", "score": 1}\n{"task": 1, "score": 1}\n', "of another type"),
        ("a.jsonl", '[{"task": "a", "score": 1}]\n', "is no object; write one object a line"),
        ("a.csv", "task,score,Condition\na,1,m\n", "a column 'Condition'; rename it 'condition'"),
        ("a.csv", "task,score, seed\na,1,0\n", "has a column ' seed'; rename it 'seed'"),
        ("a.jsonl", '{"task": "a", "score": 1, "Agent": "b"}\n', "a column 'Agent'; rename it"),
    ],
)
def test_what_would_be_read_wrong_without_a_word_is_refused(name, text, said, tmp_path):
    path = tmp_path / name
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(OutcomeError) as error:
        collect_run([path])
    assert str(path) in str(error.value)
    assert said in str(error.value)


def test_sources_and_columns_are_given_once(tmp_path):
    path = write_csv(tmp_path / "a.csv", rows())
    with pytest.raises(OutcomeError, match="is given twice"):
        collect_run([path, tmp_path / ".." / tmp_path.name / "a.csv"])
    with pytest.raises(OutcomeError, match="'task' is that of the task and of the agent"):
        collect_run([path], columns={"agent": "task"})
    results_folder(tmp_path / "o", "gpt-4o", scores=[1])
    with pytest.raises(OutcomeError, match="--columns score= is not for this format, which takes"):
        collect_run([tmp_path / "o"], columns={"score": "x"})


def test_steps_tokens_and_cost_are_compared_where_they_are_known(tmp_path):
    listed = [
        {**row, "steps": 4 + 2 * at, "cost": "" if at == 3 else 0.25, "read": 1000}
        for at, row in enumerate(rows())
    ]
    path = write_csv(tmp_path / "r.csv", listed)
    report = build_report(collect_run([path], columns={"tokens": "read"}))
    rows_by_name = {row.measure: row for row in report.measures}
    assert list(rows_by_name) == ["steps", "tokens", "usd"]
    steps = rows_by_name["steps"]
    assert (steps.tasks, steps.mean_clean, steps.change) == (6, 9.0, 12.0)
    assert rows_by_name["usd"].tasks == 5  # the clean one of t3 is not known, and is no 0
    cells = {cell.corruption: (cell.steps, cell.usd) for cell in report.cells}
    assert cells == {"clean": (9.0, None), "marks": (21.0, 1.5)}
    listed[3] |= {"score": "", "steps": ""}  # the agent did not act, so there is nothing to pay
    report = build_report(collect_run([write_csv(tmp_path / "s.csv", listed)]))
    assert [cell.usd for cell in report.cells] == [1.25, 1.5]
    listed = [{**row, "steps": 5 + at % 6 + (at > 5) * (at % 3)} for at, row in enumerate(rows())]
    (row,) = build_report(collect_run([write_csv(tmp_path / "t.csv", listed)])).measures
    test = stats.ttest_1samp([0, 1, 2, 0, 1, 2], 0)
    assert row.p == pytest.approx(test.pvalue)
    assert (row.change_low, row.change_high) == pytest.approx(tuple(test.confidence_interval()))


def test_a_gate_judges_results_of_others_paired_and_unpaired(tmp_path, capsys):
    paired = write_csv(tmp_path / "paired.csv", rows())
    other = [row | {"task": row["condition"] + row["task"]} for row in rows()]
    unpaired = write_csv(tmp_path / "unpaired.csv", other)
    for words, code, said in (
        ([paired, "--fail-under", "retention=0.3"], 0, "retention of mine is 0.400, at least 0.3"),
        ([unpaired, "--fail-under", "retention=0.3"], 2, "they share none"),
        ([unpaired, "--unpaired", "--fail-under", "retention=0.5"], 1, "is 0.400, below 0.5"),
        ([unpaired, "--unpaired", "--fail-under", "delta.marks=-0.6"], 0, "-0.500, at least -0.6"),
        ([unpaired, "--unpaired", "--fail-under", "retention_low=0.9"], 1, "below 0.9"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(["gate", *map(str, words), "--junit", str(tmp_path / "junit.xml")])
        assert (ended.value.code, said in capsys.readouterr().err) == (code, True), words
    low = build_report(collect_run([unpaired], unpaired=True)).summaries[0].retention_low
    gate = f"retention_low={low - 1e-6}"
    with pytest.raises(SystemExit) as ended:
        main(["gate", str(unpaired), "--unpaired", "--fail-under", gate])
    assert ended.value.code == 0


def test_one_task_one_seed_and_no_clean_run_are_said(tmp_path):
    single = [row for row in rows() if row["task"] == "t0"]
    notes = build_report(collect_run([write_csv(tmp_path / "one.csv", single)])).notes
    assert any(note.startswith("mine: played on one task, so") for note in notes)
    assert any(note.startswith("mine: one result of each task and condition") for note in notes)
    marked = [row for row in rows() if row["condition"] == "marks"]
    report = build_report(collect_run([write_csv(tmp_path / "marked.csv", marked)]))
    assert report.cells[0].delta is None
    assert any(note.startswith("The run has no clean condition") for note in report.notes)


def test_sources_with_the_same_agent_and_condition_are_said_to_be_repetitions(tmp_path):
    sources = [write_csv(tmp_path / f"{name}.csv", rows()) for name in "ab"]
    run = collect_run(sources)
    report = build_report(run)
    note = "Several sources have mine under clean, mine under marks on the same tasks"
    assert any(text.startswith(note) for text in report.notes)
    assert report.cell("mine", "marks").n == 12
    assert (len(run.records), run.records[-1]["seed"]) == (24, 1)


def test_other_seeds_than_the_clean_ones_are_matched_in_their_order(tmp_path):
    listed = [
        {**row, "seed": seed + 100 * (row["condition"] == "marks")}
        for seed in range(3)
        for row in rows()
    ]
    same = [row for seed in range(3) for row in rows(seed=seed)]
    report = build_report(collect_run([write_csv(tmp_path / "r.csv", listed)]))
    assert any(
        note.startswith("mine: a condition was played with other seeds") for note in report.notes
    )
    expected = build_report(collect_run([write_csv(tmp_path / "same.csv", same)]))
    assert report.cells == expected.cells


def test_one_condition_with_other_seeds_leaves_the_pairs_of_the_others(tmp_path):
    listed = [
        {"task": task, "condition": label, "seed": seed, "score": int(seed % 10 > 1)}
        for task in "abc"
        for label, seeds in {"clean": range(4), "marks": (2, 3), "pop_ups": range(10, 15)}.items()
        for seed in seeds
    ]
    report = build_report(collect_run([write_csv(tmp_path / "r.csv", listed)]))
    assert report.cell("r", "marks").delta == 0  # both are solved clean, too
    assert report.cell("r", "pop_ups").delta == 0
    assert any("r under pop_ups 3)" in note for note in report.notes)  # the fifth of each task


def test_other_tasks_of_another_agent_and_capital_letters_are_said(tmp_path):
    listed = [*rows(), *({**row, "agent": "other", "task": f"u{row['task']}"} for row in rows())]
    report = build_report(collect_run([write_csv(tmp_path / "r.csv", listed)]))
    assert any("other and mine share 0 of 6 and 6 tasks" in note for note in report.notes)
    listed[0]["condition"] = "Clean"
    with pytest.raises(OutcomeError, match="'Clean' and 'clean' differ in capital letters alone"):
        collect_run([write_csv(tmp_path / "r.csv", listed)])


def gpqa(tmp_path):
    """The design of inspect_ai#4206: 198 items, 5 epochs, two conditions; returns scores, too."""
    random = np.random.default_rng(4206)
    ability = random.beta(1, 1, 198)
    scores = {
        label: (random.random((198, 5)) < np.clip(ability + shift, 0, 1)[:, None]).astype(float)
        for label, shift in (("clean", 0.0), ("prompt", -0.04))
    }
    listed = [
        {"task": f"item {item}", "condition": label, "agent": "m", "seed": epoch, "score": score}
        for label, values in scores.items()
        for (item, epoch), score in np.ndenumerate(values)
    ]
    return listed, scores


def wilson_by_item(scores):
    """Wilson's interval over items, by statsmodels or by hand: one prior item, as in the docs."""
    items, mean = len(scores), scores.mean()
    chance, spread = mean * (1 - mean), scores.mean(axis=1).var(ddof=1)
    trials = items / min(1.0, (spread + 1 / items) / (chance + 1 / items))
    try:
        from statsmodels.stats.proportion import proportion_confint
    except ImportError:
        z = stats.norm.ppf(0.975)
        middle = (mean + z * z / 2 / trials) / (1 + z * z / trials)
        half = z / (1 + z * z / trials) * np.sqrt(chance / trials + z * z / 4 / trials**2)
        return middle - half, middle + half
    return proportion_confint(mean * trials, trials, method="wilson")


def test_198_items_with_5_epochs_agree_with_scipy_and_statsmodels(tmp_path):
    listed, scores = gpqa(tmp_path)
    report = build_report(collect_run([write_jsonl(tmp_path / "r.jsonl", listed)]))
    base, cell = report.cell("m", "clean"), report.cell("m", "prompt")
    assert (cell.n, cell.tasks, cell.success) == (990, 198, pytest.approx(scores["prompt"].mean()))
    for row, values in ((base, scores["clean"]), (cell, scores["prompt"])):
        assert (row.ci_low, row.ci_high) == pytest.approx(wilson_by_item(values), abs=1e-9)
    means = {label: values.mean(axis=1) for label, values in scores.items()}
    differences = means["prompt"] - means["clean"]
    paired_t = stats.ttest_1samp(differences, 0).confidence_interval(0.95)
    assert cell.delta == pytest.approx(differences.mean())
    assert (cell.delta_low, cell.delta_high) == pytest.approx(tuple(paired_t), abs=0.004)
    flips = np.random.default_rng(0).choice([-1, 1], (100_000, 198)) @ differences
    assert cell.p == pytest.approx((abs(flips) >= abs(differences.sum()) - 1e-9).mean(), abs=0.006)
    power = stats.nct.sf(
        stats.t.ppf(0.975, 197), 197, cell.detectable / differences.std(ddof=1) * np.sqrt(198)
    )
    assert power == pytest.approx(0.8, abs=1e-4)


def test_different_tasks_are_compared_as_unpaired_only_when_told(tmp_path, capsys):
    listed, scores = gpqa(tmp_path)
    for row in listed:
        row["task"] = f"{row['condition']} {row['task']}"
    path = write_jsonl(tmp_path / "r.jsonl", listed)
    with pytest.raises(OutcomeError, match="they share none, and --unpaired compares them"):
        collect_run([path])
    report = build_report(collect_run([path], unpaired=True))
    cell = report.cell("m", "prompt")
    before, after = (values.mean(axis=1) for values in scores.values())
    welch = stats.ttest_ind(after, before, equal_var=False)
    assert cell.p == pytest.approx(welch.pvalue)
    assert cell.delta == pytest.approx(after.mean() - before.mean())
    ends = [wilson_by_item(values) for values in scores.values()]
    below = np.hypot(after.mean() - ends[1][0], ends[0][1] - before.mean())
    assert cell.delta_low == pytest.approx(cell.delta - below)
    assert (cell.delta_low, cell.delta_high) == pytest.approx(
        tuple(welch.confidence_interval(0.95)), abs=0.004
    )
    assert cell.retention == pytest.approx(after.mean() / before.mean())
    assert (report.is_paired, cell.detectable) == (False, None)
    with pytest.raises(SystemExit):
        main(["report", str(path), "--unpaired"])
    output = capsys.readouterr().out
    assert "p is of Welch's t test over tasks" in output
    assert "Unpaired: each agent was played clean and corrupted on different tasks" in output
    same = write_csv(tmp_path / "same.csv", rows())
    with pytest.raises(OutcomeError, match="on the same 6 tasks clean and under marks"):
        collect_run([same], unpaired=True)


def test_a_condition_of_one_task_has_no_test_for_want_of_tasks(tmp_path):
    """The conclusion said that scipy was missing."""
    path = tmp_path / "a.csv"
    path.write_text("task,condition,score\nt0,clean,1\nt1,clean,1\nt2,clean,1\nt9,marks,0\n")
    (sentence,) = conclude(build_report(collect_run([path], unpaired=True)))
    assert sentence.endswith("whether this is chance is not known with a single task.")


def test_a_sharp_difference_without_spread_has_the_exact_p(tmp_path):
    listed = [
        {"task": f"{label} {number}", "condition": label, "score": score}
        for label, score in (("clean", 1), ("marks", 0))
        for number in range(4)
    ]
    run = collect_run([write_csv(tmp_path / "r.csv", listed)], unpaired=True)
    assert build_report(run).cell("r", "marks").p == pytest.approx(2 / 70)


def test_many_rows_take_little_memory(tmp_path):
    """300,000 rows grow a process by less than 150 MiB; as dictionaries they took 600."""
    path = tmp_path / "r.csv"
    lines = (
        f"t{task},{label},{seed},{(task + seed) % 2}\n"
        for label in ("clean", "marks")
        for task in range(30_000)
        for seed in range(5)
    )
    with path.open("w") as file:
        file.write("task,condition,seed,score\n")
        file.writelines(lines)
    code = (
        "import resource, sys\n"
        "from pathlib import Path\n"
        "from online_env.report import build_report\n"
        "from online_env.results.outcomes import collect_run\n"
        "start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "report = build_report(collect_run([Path(sys.argv[1])]))\n"
        "print(report.cells[0].n, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - start)\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", code, str(path)], check=True, capture_output=True, text=True
    )
    count, grown = map(int, process.stdout.split())
    assert count == 150_000
    assert grown < 150 * 1024


def test_seeds_repeat_a_task_and_do_not_make_it_several_cases(tmp_path):
    once = build_report(collect_run([write_csv(tmp_path / "once.csv", rows())]))
    listed = [row for seed in range(5) for row in rows(seed=seed)]
    often = build_report(collect_run([write_csv(tmp_path / "often.csv", listed)]))
    for row in listed:
        del row["seed"]
    unnumbered = build_report(collect_run([write_csv(tmp_path / "none.csv", listed)]))
    for report in (often, unnumbered):
        cell, base = report.cell("mine", "marks"), once.cell("mine", "marks")
        assert (cell.n, cell.tasks, cell.p) == (30, 6, base.p)
        assert (cell.ci_low, cell.delta_low) == pytest.approx((base.ci_low, base.delta_low))


def test_a_result_without_a_clean_one_of_its_task_and_seed_is_said(tmp_path):
    listed = rows(seed=0) + [row for row in rows(seed=1) if row["condition"] == "marks"]
    report = build_report(collect_run([write_csv(tmp_path / "r.csv", listed)]))
    (note,) = [note for note in report.notes if "without a clean one" in note]
    assert note.startswith("6 results without a clean one of the same task and seed")
    assert note.endswith("(mine under marks 6).")
    named = [row | {"condition": row["condition"].replace("clean", "none")} for row in rows()]
    report = build_report(collect_run([write_csv(tmp_path / "n.csv", named)]))
    assert "--clean NAME names the clean one of its conditions (none, marks)." in report.notes


def test_columns_and_the_clean_condition_have_other_names(tmp_path, capsys):
    listed = [
        {"id": row["task"], "noise": row["condition"].replace("clean", "none"), "ok": row["score"]}
        for row in rows()
    ]
    path = write_csv(tmp_path / "gpt.csv", listed)
    with pytest.raises(SystemExit) as ended:
        main(
            [
                "report",
                str(path),
                "--columns",
                "task=id,condition=noise,score=ok",
                "--clean",
                "none",
            ]
        )
    assert ended.value.code == 0
    output = capsys.readouterr().out
    assert output.startswith("gpt on gpt.csv\n")
    assert "gpt: worst under marks, loses 50 points" in output


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"score": 55}, "line 2: the score 55 is not in 0..1; scale the column"),
        ({"score": "yes"}, "line 2: the score 'yes' is no number"),
        ({"agent": ""}, "line 2: has no agent; fill the column in every row"),
        ({"task": "t1"}, "mine has two results of the task t1 under clean with seed 0"),
    ],
)
def test_a_row_that_is_no_result_is_named(change, said, tmp_path):
    listed = rows(seed=0)
    listed[0].update(change)
    with pytest.raises(OutcomeError) as error:
        collect_run([write_csv(tmp_path / "r.csv", listed)])
    assert said in str(error.value)


def test_tasks_that_differ_are_refused_with_the_difference(tmp_path):
    listed = [row for row in rows() if (row["task"], row["condition"]) != ("t0", "marks")]
    listed.append({**listed[-1], "task": "other"})
    path = write_csv(tmp_path / "r.csv", listed)
    with pytest.raises(OutcomeError) as error:
        collect_run([path])
    assert str(error.value) == (
        "mine was not played on the same tasks: 1 task only under marks (other), 1 task only clean"
        " (t0); --common-tasks reports the 5 tasks that all conditions have, --unpaired compares"
        " them as samples of different tasks"
    )
    report = build_report(collect_run([path], common_tasks=True))
    assert success(report) == {"clean": 4 / 5, "marks": 1 / 5}
    assert "Without 2 results of tasks that not all conditions have." in report.notes


def test_numbers_of_several_sources_are_no_names_of_tasks(tmp_path):
    sources = []
    for label in SOLVED:
        listed = [row | {"task": row["task"][1:]} for row in rows() if row["condition"] == label]
        sources.append(write_csv(tmp_path / f"{label}.csv", listed))
    with pytest.raises(OutcomeError, match="which match by chance"):
        collect_run(sources)
    named = [
        write_csv(tmp_path / f"{label}.csv", [row for row in rows() if row["condition"] == label])
        for label in SOLVED
    ]
    assert success(build_report(collect_run(named))) == {"clean": 5 / 6, "marks": 2 / 6}


def results_folder(root, *above, scores):
    for number, score in enumerate(scores):
        folder = root.joinpath(*above, "os" if number % 2 else "chrome", f"id-{number}")
        folder.mkdir(parents=True)
        (folder / "traj.jsonl").touch()
        if score is not None:
            (folder / "result.txt").write_text(f"{float(score)}\n")


@pytest.mark.parametrize(
    ("name", "condition"), [("Marks", "marks"), ("missed-input", "missed_input")]
)
def test_a_folder_of_osworld_has_its_corruption_where_its_name_is(name, condition, tmp_path):
    for label, scores in SOLVED.items():
        folder = name if label == "marks" else label
        results_folder(tmp_path, folder, "pyautogui", "screenshot", "gpt-4o", scores=scores)
        results_folder(tmp_path, folder, "pyautogui", "screenshot", "claude", scores=[1] * 6)
    report = build_report(collect_run([tmp_path]))
    assert success(report, "gpt-4o") == {"clean": 5 / 6, condition: 2 / 6}
    assert success(report, "claude") == {"clean": 1, condition: 1}


def test_a_folder_of_osworld_verified_is_one_clean_run(tmp_path):
    results_folder(tmp_path, "pyautogui", "screenshot", "gpt-4o", scores=[1, 0, None])
    report = build_report(collect_run([tmp_path]))
    (cell,) = report.cells
    assert (cell.agent, cell.corruption, cell.n, cell.invalid) == ("gpt-4o", "clean", 2, 1)


def test_a_folder_that_nothing_explains_is_asked_for(tmp_path):
    for label, scores in SOLVED.items():
        name = "my_noise" if label == "marks" else label
        results_folder(tmp_path, name, "gpt-4o", scores=scores)
    with pytest.raises(OutcomeError) as error:
        collect_run([tmp_path])
    output = "it is not clear whether my_noise are conditions; --columns condition=1 says so"
    assert output in str(error.value)
    report = build_report(collect_run([tmp_path], columns=parse_columns("condition=1")))
    assert success(report, "gpt-4o") == {"clean": 5 / 6, "my_noise": 2 / 6}
    results_folder(tmp_path, "x", "gpt-4o", "again", scores=[1])
    with pytest.raises(OutcomeError, match="different depths"):
        collect_run([tmp_path])


def test_a_score_that_is_none_is_named_with_its_file(tmp_path):
    results_folder(tmp_path, "gpt-4o", scores=[1])
    (path,) = tmp_path.rglob("result.txt")
    path.write_text("Traceback")
    with pytest.raises(OutcomeError) as error:
        collect_run([tmp_path])
    assert str(error.value).startswith(f"{path}: must hold a score from 0 to 1, got 'Traceback'")


def test_results_of_others_are_no_model_card_of_this_benchmark(tmp_path):
    document = ReportDocument(
        report=build_report(collect_run([write_csv(tmp_path / "r.csv", rows())]))
    )
    for format in ("html", "latex", "markdown", "csv"):
        assert "mine" in formats.write(document, format)
    with pytest.raises(ReportError, match="results of another harness"):
        formats.write(document, "model-index")


def test_runs_of_this_library_are_reported_alone(tmp_path, capsys):
    from support.reported import run_of, scored

    folder = run_of(tmp_path / "deep" / "mine", scored("a", "clean", [1, 0]))
    table = write_csv(tmp_path / "r.csv", rows())
    report = folder.parent / "report.json"
    report.write_text("{}")
    for words, output in (
        ([folder, table], "is a run of this library, and is reported alone"),
        ([folder, "--clean", "none"], "is a run of this library, which --clean is not for"),
        ([folder.parent], f"is not the folder of a run; give {report}"),
        ([table, "--columns", "taks=id"], "no field 'taks'; did you mean 'task'?"),
        ([table, "--columns", "task=id,task=name"], "names the task twice"),
        ([table, "--from", "osword"], "no reader 'osword'; did you mean 'osworld'?"),
        ([table, "--clean", "mark"], "no condition 'mark'; did you mean 'marks'?"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(["report", *map(str, words)])
        assert ended.value.code == 2
        assert output in capsys.readouterr().err
