"""`hijack report` where little is there: logs without a head, formats that lack a place, notes."""

import json
from dataclasses import replace

import pytest
import yaml
from lxml import etree

pytest.importorskip("scipy", reason="needs the extra [online]")


from hijack_data.cli import main
from hijack_data.corruption import make_corruption
from hijack_data.runs.run_planners import dump_planner
from online_env.report import ReportError, build_report, formats
from online_env.report.certificate import certify
from online_env.report.comparison import compare_runs
from online_env.report.document import ReportDocument
from online_env.report.paper import compare_with_paper, paper_table
from online_env.results import reading, scores

from support.reported import CONDITIONS, made, read_run, run_of, scored, whole

MARKS = "corruptions:\n- marks:\n    number: 3\n"


def hijack(capsys, *words):
    """Run a command in this process: exit code, output, errors."""
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    output = capsys.readouterr()
    return ended.value.code, output.out, output.err


@pytest.fixture
def log(tmp_path):
    """Episodes that an environment logged by itself: clean 1.0, marks 0.25, no `run.json`."""
    items = [*scored("mine", "clean", [1, 1, 1, 1]), *scored("mine", "marks", [1, 0, 0, 0])]
    for record in items:
        folder = tmp_path / "log" / "episodes" / record["id"]
        folder.mkdir(parents=True)
        (folder / "episode.json").write_text(json.dumps(record))
    return tmp_path / "log"


@pytest.fixture
def two(tmp_path):
    """The folders of two runs with the same cases."""
    return [run_of(tmp_path / name, scored("a", "clean", [1, 0])) for name in ("old", "new")]


# Logs of environments


def rewrite(log, name, **changes):
    """Change the record of an episode of a log."""
    path = log / "episodes" / name / "episode.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"params": {"number": 9, "size": 2}}, "'marks' is {'number': 3} in t0-0__marks__s0__mine"),
        ({"planner": MARKS.replace("3", "9")}, "env.reset(options={'corruption': ..., 'label':"),
        ({"max_steps": 40}, "max_steps is 15 in t0-0__clean__s0__mine and 40 in t2-0__marks__s0"),
        ({"recovery": {"policy": "reset"}}, "recovery is 'none' in"),
        ({"desktop": {"size": [640, 480]}}, "the size of the screen is [1920, 1080] in"),
        ({"planner": "marks"}, "planner 'marks' of 'marks' is no configuration"),
    ],
)
def test_a_log_of_several_settings_is_refused(changes, said, log, capsys):
    """One label or task that was played in two ways was pooled, or the later hid the earlier."""
    for path in (log / "episodes").iterdir():
        settings = {"max_steps": 15, "recovery": {"policy": "none"}, "allow_code": False}
        rewrite(log, path.name, **settings, desktop={"size": [1920, 1080]})
        if "marks" in path.name and changes != {"planner": "marks"}:
            rewrite(log, path.name, params={"number": 3, "size": 2}, planner=MARKS)
    assert hijack(capsys, "report", log)[0] == 0
    rewrite(log, "t2-0__marks__s0__mine", **changes)
    code, _, err = hijack(capsys, "report", log)
    assert (code, said in err) == (2, True), err


def test_what_the_records_of_a_log_tell_is_in_its_report(log):
    """Parameters, episodes that ended too early and the policy were taken for those of nothing."""
    for number in range(4):
        corruption = make_corruption("missed_input", step=2)
        rewrite(
            log,
            f"t{number}-0__marks__s0__mine",
            corruption="late",
            recovery={"policy": "repair"},
            params=corruption.params(),
            planner=dump_planner(corruption),
        )
    report = build_report(reading.read(log))
    assert report.run.corruptions == {"late": "missed_input"}
    assert report.run.settings["late"] == {"step": 2}
    assert (report.run.recovery, report.run.early) == ("repair", 4)
    certificate = certify(reading.read(log))
    (entry,) = certificate.distribution
    assert (entry.corruption, entry.parameters["step"]) == ("missed_input", 2)


def test_a_certificate_of_a_log_claims_no_parameters_that_nothing_tells(log):
    (entry,) = certify(reading.read(log)).distribution
    assert (entry.condition, entry.corruption, entry.severity) == ("marks", None, None)


def test_a_score_that_a_later_attempt_replaces_is_told(log):
    """An environment counts attempts at a case: a second one replaced the first without a word."""
    again = made("mine", "t1", "marks", 1.0, attempt=1, id="t1-0__marks__s0__mine__a1")
    (log / "episodes" / again["id"]).mkdir()
    (log / "episodes" / again["id"] / "episode.json").write_text(json.dumps(again))
    report = build_report(reading.read(log))
    assert report.cell("mine", "marks").success == 0.5
    assert any(
        "1 episode with a score left out" in note and "(mine under marks 1)" in note
        for note in report.notes
    )


# Gates


@pytest.mark.parametrize(
    ("gate", "said"),
    [
        ("average=0.9", "average of mine is 0.625, below 0.9"),
        ("success.marks=0.3", "success.marks of mine is 0.250, below 0.3"),
        ("retention=0.5", "retention of mine is 0.250, below 0.5"),
        ("mine:worst=0.26", "worst of mine is 0.250, below 0.26"),
    ],
)
def test_a_log_without_a_head_fails_a_gate_that_it_does_not_pass(gate, said, log, capsys):
    """Nothing says which agents it was to have, so those that played are judged."""
    code, _, err = hijack(capsys, "gate", log, "--fail-under", gate)
    assert (code, err) == (1, f"hijack: gate failed: {said}\n")


def test_a_log_without_a_head_passes_a_gate_and_suggests_what_it_has(log, capsys, tmp_path):
    words = ("gate", log, "--junit", tmp_path / "gates.xml", "--fail-under")
    code, _, err = hijack(capsys, *words, "success=1")
    assert (code, err) == (0, "gate passed: success.clean of mine is 1.000, at least 1\n")
    assert etree.parse(tmp_path / "gates.xml").getroot().get("tests") == "9"
    code, _, err = hijack(capsys, *words, "success.mark=0")
    assert (code, "the run has no condition 'mark'; did you mean 'marks'?" in err) == (2, True)
    code, _, err = hijack(capsys, *words, "mind:success=0")
    assert (code, "no agent 'mind'; did you mean 'mine'?" in err) == (2, True)


def test_a_gate_on_an_interval_says_that_intervals_need_scipy(log, capsys, monkeypatch):
    monkeypatch.setattr(scores, "can_infer", lambda: False)
    code, _, err = hijack(capsys, "gate", log, "--fail-under", "ci_low.marks=0")
    assert code == 1
    assert err == (
        "hijack: gate failed: ci_low.marks of mine cannot be computed, scipy is not"
        " installed: marks (mine:ci_low.marks=0)\n"
    )


# What a format has no place for


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["compare", "OLD", "--format", "latex"],
            "a comparison is not shown by the format latex; give one of terminal, json, csv, markdown,"
            " html",
        ),
        (
            ["compare", "OLD", "-o", "card.yaml"],
            "a comparison is not shown by the format model-index; give one of terminal, json, csv,"
            " markdown, html",
        ),
        (
            ["report", "--paper", "-o", "rows.csv"],
            "--paper is not shown by the format csv; give one of terminal, json, latex, markdown,"
            " html",
        ),
        (
            ["report", "--reference", "mine", "--format", "csv"],
            "--reference is not shown by the format csv; give one of terminal, json, markdown,"
            " html",
        ),
    ],
)
def test_what_a_format_would_leave_out_in_silence_is_refused(words, said, two, capsys):
    old, new = two
    command, *options = [old if word == "OLD" else word for word in words]
    assert hijack(capsys, command, new, *options) == (2, "", f"hijack: error: {said}\n")


def test_a_finished_report_refuses_it_too(two, capsys, tmp_path):
    path = tmp_path / "report.json"
    hijack(capsys, "report", two[0], "-o", path)
    code, out, err = hijack(capsys, "report", path, "--paper", "--format", "csv")
    assert (code, out) == (2, "")
    assert "--paper is not shown by the format csv" in err
    code, out, _ = hijack(capsys, "report", path, "--paper", "--format", "markdown")
    assert (code, "### Beside the paper" in out) == (0, True)


@pytest.mark.parametrize("format", ["terminal", "json", "csv", "markdown", "html"])
def test_formats_that_have_a_place_for_a_comparison_show_it(format, two, capsys):
    old, new = two
    code, out, _ = hijack(capsys, "compare", new, old, "--format", format)
    assert code == 0
    assert "old" in out or "only_before" in out


@pytest.mark.parametrize("format", ["terminal", "json", "latex", "markdown", "html"])
def test_formats_that_have_a_place_for_the_papers_table_show_it(format, two, capsys):
    code, out, _ = hijack(capsys, "report", two[0], "--paper", "--format", format)
    assert (code, "GPT-4o" in out) == (0, True)


# Where it is written


def test_a_folder_that_is_not_there_is_made_with_the_file(two, capsys, tmp_path):
    path = tmp_path / "none" / "yet" / "report.html"
    code, out, _ = hijack(capsys, "report", two[0], "-o", path)
    assert (code, out) == (0, f"wrote {path}\n")
    assert path.is_file()


def test_a_file_where_no_folder_can_be_made_is_one_line(two, capsys, tmp_path):
    (tmp_path / "file").touch()
    path = tmp_path / "file" / "report.html"
    code, out, err = hijack(capsys, "report", two[0], "-o", path)
    assert (code, out) == (2, "")
    assert err == f"hijack: error: {path}: cannot be written (File exists)\n"


def test_rows_go_to_a_file_and_a_run_that_is_refused_leaves_the_file_as_it_was(
    two, capsys, tmp_path
):
    path = tmp_path / "rows.json"
    _, value, _ = hijack(capsys, "report", two[0], "--json")
    code, out, _ = hijack(capsys, "report", two[0], "--json", "-o", path)
    assert (code, out) == (0, f"wrote {path}\n")
    assert path.read_text() == value
    code, _, _ = hijack(capsys, "report", tmp_path / "no run", "--json", "-o", path)
    assert (code, path.read_text()) == (2, value)


# Notes


def report_notes(folder, found, **config):
    return build_report(read_run(folder, found, **config)).notes


def test_a_note_counts_episodes_that_ended_before_their_corruption_was_due(tmp_path):
    """Only a corruption that acts on the machine can come too late, whatever its label is."""
    early = [
        made("a", "t0", "small", effects=[]),
        made("a", "t1", "small", effects=[{"kind": "minimise"}]),
        made("a", "t2", "small"),
        made("a", "t3", "small", score=None, cause="agent", effects=[]),
        made("a", "t0", "marks", effects=[]),
        made("a", "t0", "clean", effects=[]),
    ]
    entries = ["clean", "marks", {"app_minimization": {"as": "small"}}]
    output = (
        "2 episodes with a score ended before their corruption was due: they count as they are"
        " (a under small 2 of 4)."
    )
    assert output in report_notes(tmp_path / "early", early, corruptions=entries)
    parts = ["missed_input", {"app_freeze": {"step": 9}}]
    pairs = [
        {"sequence": {"as": "small", "parts": parts}},
        {"sequence": {"as": "marks", "parts": [*parts, "marks"]}},
    ]
    assert output in report_notes(tmp_path / "pairs", early, corruptions=["clean", *pairs])
    alike = [*early[1:2], *early[3:]]
    notes = report_notes(tmp_path / "alike", alike, corruptions=entries)
    assert not any("before their corruption" in note for note in notes)
    offline = report_notes(tmp_path / "offline", early, corruptions=entries, kind="score")
    assert not any("before their corruption" in note for note in offline)


def test_a_note_says_that_agents_were_not_played_under_the_same_conditions(tmp_path):
    output = "The agents were not played under the same conditions: their means differ in kind."
    uneven = [made("a", "t0"), made("a", "t0", "marks"), made("b", "t0")]
    assert output in report_notes(tmp_path / "uneven", uneven)
    even = [*uneven, made("b", "t0", "marks")]
    assert output not in report_notes(tmp_path / "even", even)


def test_a_note_says_what_a_run_without_the_clean_condition_lacks(tmp_path):
    output = "The run has no clean condition, so there is no delta, no retention and no test."
    assert output in report_notes(tmp_path / "marks", [made("a", "t0", "marks")])
    both = [made("a", "t0"), made("a", "t0", "marks")]
    assert output not in report_notes(tmp_path / "both", both)


def test_without_scipy_a_report_has_the_numbers_and_says_what_it_lacks(tmp_path, monkeypatch):
    monkeypatch.setattr(scores, "can_infer", lambda: False)
    items = [*scored("a", "clean", [1, 1]), *scored("a", "marks", [1, 0])]
    report = build_report(read_run(tmp_path / "run", items))
    output = "Without intervals and tests: scipy is not installed."
    assert output in report.notes
    cell = report.cell("a", "marks")
    assert (cell.success, cell.delta, cell.retention) == (0.5, -0.5, 0.5)
    lacking = ("ci_low", "ci_high", "delta_low", "delta_high", "p", "retention_low", "detectable")
    assert {getattr(cell, name) for name in lacking} == {None}
    assert cell.pass_hat == ()
    (row,) = report.summaries
    assert (row.clean, row.corrupted, row.retention, row.corrupted_low) == (1, 0.5, 0.5, None)
    text = formats.write(ReportDocument(report=report, full=True), "terminal")
    assert "a: corrupted 50.0, worst marks 50.0, retention 50.0" in text
    assert "[" not in text
    assert "worst under marks, loses 50 points; whether this is chance is not known" in text


def test_a_comparison_needs_episodes_in_both_runs(tmp_path):
    run = read_run(tmp_path / "there", [made("a", "t0")])
    empty = read_run(tmp_path / "empty", [])
    for runs in ((run, empty), (empty, run)):
        with pytest.raises(ReportError) as error:
            compare_runs(*runs)
        output = f"{tmp_path / 'empty'}: holds no episodes yet, so there is nothing to pair"
        assert str(error.value) == output


def test_a_comparison_of_partial_scores_says_what_its_test_makes_of_them(tmp_path):
    old = read_run(tmp_path / "old", scored("a", "clean", [0.5, 1]))
    new = read_run(tmp_path / "new", scored("a", "clean", [0.25, 0.75]))
    output = (
        "3 scores are between 0 and 1: p takes them for not solved, so it may miss a difference"
        " that the intervals show."
    )
    assert output in compare_runs(old, new).notes


def test_a_comparison_names_which_conditions_show_no_difference_and_which_do(tmp_path):
    old = [*scored("a", "clean", [1.0] * 12), *scored("a", "marks", [1.0] * 12)]
    new = [*scored("a", "clean", [0.0] * 12), *scored("a", "marks", [0.0] + [1.0] * 11)]
    result = compare_runs(read_run(tmp_path / "old", old), read_run(tmp_path / "new", new))
    (note,) = (note for note in result.notes if "no difference is shown" in note)
    detectable = result.cells[1].detectable
    assert note.startswith(
        f"a: no difference is shown under marks ({100 * detectable:.1f} points). In brackets"
    )
    renamed = [{**record, "agent": "b", "id": f"b-{record['id']}"} for record in new]
    second = compare_runs(read_run(tmp_path / "o", old), read_run(tmp_path / "n", renamed))
    assert any(note.startswith("a and b: no difference is shown") for note in second.notes)


# Beside the paper

LOSSES = "compare the losses, not the levels."


def test_beside_the_papers_table_stands_what_ours_is(tmp_path):
    items = [*scored("a", "clean", [1, 0]), *scored("a", "marks", [1, 1])]
    entries = ["clean", {"marks": {"number": 3}}]
    report = build_report(read_run(tmp_path / "run", items, corruptions=entries))
    live = compare_with_paper(report)
    assert live.notes[:2] == (
        f"Ours: 2 tasks on the provider 'embedded'. Other tasks, so {LOSSES}",
        "Not with the paper's parameters: marks.",
    )
    (*_, ours) = live.rows
    assert (ours.ours, ours.success, ours.average) == (True, {"clean": 0.5, "marks": 1.0}, None)
    nowhere = compare_with_paper(replace(report, run=replace(report.run, provider="", changed=())))
    assert nowhere.notes[0] == f"Ours: 2 tasks. Other tasks, so {LOSSES}"
    assert nowhere.notes[1:] == paper_table().notes
    offline = compare_with_paper(replace(report, run=replace(report.run, kind="score")))
    assert offline.notes[0] == (
        "Ours are steps of recorded trajectories, scored one by one; the paper's are whole tasks."
        f" {LOSSES.capitalize()}"
    )


def test_another_corruption_under_a_name_of_the_papers_is_no_column_of_it(tmp_path):
    items = [*scored("a", "clean", [1]), *scored("a", "marks", [1]), *scored("b", "marks", [0])]
    entries = ["clean", {"subtitle": {"as": "marks"}}]
    report = build_report(read_run(tmp_path / "run", items, corruptions=entries))
    assert [row.success for row in compare_with_paper(report).rows[-2:]] == [{"clean": 1.0}, {}]


def test_our_average_beside_the_papers_is_over_its_ten_columns(tmp_path):
    solved = {label: number for number, label in enumerate(CONDITIONS)}
    report = build_report(read_run(tmp_path / "run", whole("a", solved)))
    assert compare_with_paper(report).rows[-1].average == pytest.approx(0.45)


# The block of a model card


def test_a_model_card_has_percent_with_two_digits_and_what_is_known(tmp_path):
    items = [*scored("a", "clean", [1, 1, 0]), *scored("a", "marks", [1, 0, 0])]
    report = build_report(read_run(tmp_path / "run", items, seeds=[0]))
    text = formats.write(ReportDocument(report=report), "model-index")
    assert "value: 66.67\n" in text  # clean success
    assert "value: 33.33\n" in text  # that under marks
    assert "value: 50.0\n" in text  # retention
    assert "Average over clean and the nine" not in text, "not all nine were played"
    named = [line.strip() for line in text.splitlines() if "name: AgentHijack (" in line]
    assert named == [
        "name: AgentHijack (3 live tasks), clean",
        "name: AgentHijack (3 live tasks), corruption marks",
        "name: AgentHijack (3 live tasks), all corruptions",
    ]
    hub = pytest.importorskip("huggingface_hub")
    results = yaml.safe_load(formats.write(ReportDocument(report=report), "eval-results"))
    entries = hub.parse_eval_result_entries(results)
    assert {entry.task_id: entry.value for entry in entries} == {
        "clean": 66.67,
        "marks": 33.33,
        "all": 33.33,
    }
    offline = replace(report, run=replace(report.run, kind="score", provider="", damaged=2))
    text = formats.write(ReportDocument(report=offline), "model-index")
    assert "name: AgentHijack (offline steps), clean" in text
    assert "provider:" not in text
    assert "damaged_records: 2" in text


def test_a_model_card_has_the_papers_average_where_all_ten_columns_are(tmp_path):
    report = build_report(read_run(tmp_path / "run", whole("a", dict.fromkeys(CONDITIONS, 5))))
    text = formats.write(ReportDocument(report=report), "model-index")
    assert text.count("Average over clean and the nine, %") == 1


# Files of the run itself


@pytest.mark.parametrize(
    ("option", "name"),
    [("--out", "run.json"), ("--out", "records.jsonl"), ("--out", "sessions.jsonl")],
)
def test_no_output_replaces_a_file_of_the_run(option, name, two, capsys):
    path = two[0] / name
    before = path.read_bytes() if path.exists() else None
    code, out, err = hijack(capsys, "report", two[0], "--format", "json", option, path)
    problem = f"{option} {path}: is a file of the run itself; give another name"
    assert (code, out, err) == (2, "", f"hijack: error: {problem}\n")
    assert (path.read_bytes() if path.exists() else None) == before


def test_a_file_with_such_a_name_elsewhere_is_written(two, capsys, tmp_path):
    path = tmp_path / "run.json"
    assert hijack(capsys, "report", two[0], "-o", path)[0] == 0
    assert path.exists()


def test_the_file_of_a_gate_replaces_no_file_of_the_run(two, capsys):
    path = two[0] / "records.jsonl"
    before = path.read_bytes()
    code, out, err = hijack(capsys, "gate", two[0], "--junit", path)
    problem = f"--junit {path}: is a file of the run itself; give another name"
    assert (code, out, err) == (2, "", f"hijack: error: {problem}\n")
    assert path.read_bytes() == before


def test_a_gate_judges_something(two, capsys):
    code, _, err = hijack(capsys, "gate", two[0])
    assert (code, "say what is too low: --fail-under SCORE=X" in err) == (2, True)


def test_what_an_agent_printed_does_not_control_the_terminal(tmp_path, capsys):
    """Its words reach the report as text: in tables, notes, lists of failures and messages."""
    hostile = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202eevil"
    items = [*scored("a", "clean", [1, 1]), *scored(hostile, "marks", [1, None])]
    items[-1]["problem"] = f"the agent raised {hostile}"
    folder = run_of(tmp_path / "run", items)
    for words in (["report"], ["report", "--format", "markdown"], ["verify"]):
        _, out, err = hijack(capsys, words[0], folder, *words[1:])
        printed = out + err
        assert "owned" in printed
        assert not set(printed) & set("\x1b\x07\x9b\u202e")
