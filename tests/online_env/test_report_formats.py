"""`hijack report` in every format, and its refusals."""

import csv
import io
import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
import yaml

pytest.importorskip("scipy", reason="needs the extra [online]")

from hijack_data.cli import main
from hijack_data.cli.printable_console import PrintableConsole
from online_env.report import build_report, formats, formatting, terminal
from online_env.report.comparison import compare_runs
from online_env.report.document import ReportDocument
from online_env.report.paper import COLUMNS, paper_table
from online_env.results import reading, records, scores

from support.chromium import chromium
from support.reported import CONDITIONS, made, read_run, run_of, scored, whole

SOLVED = dict(zip(CONDITIONS, (8, 4, 2, 8, 6, 7, 5, 5, 1, 3), strict=True))
HOSTILE = "<script>|_&%$#{x}~^\\`* @x"


def hijack(capsys, *words):
    """Run a command in this process: exit code, output, errors."""
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    output = capsys.readouterr()
    return ended.value.code, output.out, output.err


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    items = [*whole("mine", SOLVED), *whole("recovering", dict.fromkeys(CONDITIONS, 9))]
    return run_of(tmp_path_factory.mktemp("reported") / "run", items)


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    items = [*scored(HOSTILE, "clean", [1, 1]), *scored(HOSTILE, "a|<b>_%", [1, 0])]
    run = read_run(tmp_path_factory.mktemp("hostile") / "run", items)
    return ReportDocument(report=build_report(run))


def test_json_is_the_whole_report(folder, capsys, tmp_path):
    code, out, _ = hijack(capsys, "report", folder, "--format", "json", "--reference", "mine")
    assert code == 0
    data = json.loads(out)
    assert (data["format"], data["version"], data["reference"]) == ("agenthijack-report", 1, "mine")
    assert data["summaries"][0]["paper_average"] == pytest.approx(0.49)
    assert data["cells"][2]["ceiling"] == 0.9
    # A finished report is read like a run.
    (tmp_path / "r.json").write_text(out)
    code, text, _ = hijack(capsys, "report", tmp_path / "r.json", "--format", "csv")
    assert (code, len(text.splitlines())) == (0, 21)
    code, text, _ = hijack(capsys, "report", tmp_path / "r.json")
    assert (code, "mine: worst under network_error, loses 70 points" in text) == (0, True)


def test_the_rows_of_json_are_as_they_were(folder, capsys):
    code, out, _ = hijack(capsys, "report", folder, "--json")
    assert code == 0
    assert json.loads(out) == scores.rows(records.read(folder).records)


def test_the_terminal_shows_what_there_is(folder, capsys):
    code, out, _ = hijack(
        capsys, "report", folder, "--reference", "recovering", "--paper", "--full"
    )
    assert code == 0
    assert "average with clean, as in the paper 49.0" in out
    assert "mCE 544.4 (against recovering)" in out
    assert "The paper prints 3.69 as the average of GPT-4o; its columns give 3.697." in out
    further = out.split("further results")[1].split("pop_ups")[1].split()
    assert further[0] == "90.0"  # the ceiling
    headings = out.split("further results")[1].splitlines()[1]
    assert "pass^k" not in headings  # one seed
    assert "USD" not in headings  # no model


def test_csv_has_a_line_a_cell(folder, capsys):
    _, out, _ = hijack(capsys, "report", folder, "--format", "csv")
    rows = list(csv.DictReader(io.StringIO(out)))
    assert [row["corruption"] for row in rows[:10]] == list(CONDITIONS)
    assert (rows[2]["success"], rows[2]["n"], rows[0]["delta"]) == ("0.2", "10", "")


def test_markdown_keeps_names_as_they_are(hostile):
    text = formats.write(hostile, "markdown")
    lines = [line for line in text.splitlines() if line.startswith("|")]
    bars = {len(re.findall(r"(?<!\\)\|", line)) for line in lines[:3]}
    assert len(bars) == 1
    assert "\\<script\\>" in text
    assert "<script>" not in text


def test_latex_escapes_and_marks_the_best(folder, hostile, capsys):
    _, out, _ = hijack(capsys, "report", folder, "--format", "latex")
    mine, top = [line for line in out.splitlines() if line.startswith(("mine", "recovering"))]
    assert top.count(r"\textbf{90.0}") == 11
    assert "textbf" not in mine
    assert mine.startswith("mine & 80.0 & 40.0 & 20.0 & 80.0 ")
    text = formats.write(hostile, "latex")
    line = next(line for line in text.splitlines() if "script" in line)
    assert line.startswith(r"\textless{}script\textgreater{}|\_\&\%\$\#\{x\}")
    assert line.replace(r"\&", "").count("&") == 4
    table = out[out.index(r"\begin{tabular}") : out.index(r"\end{tabular}")]
    assert {row.count("&") for row in table.splitlines() if row.endswith(r"\\")} == {12}


def test_latex_with_the_paper_has_both_tables(folder, capsys):
    _, out, _ = hijack(capsys, "report", folder, "--format", "latex", "--paper")
    paper, ours = out.split(r"\midrule")[1:]
    assert "GPT-4o & 5.38 & 1.44" in paper
    assert "mine & 80.00 & 40.00" in ours
    assert out.startswith("% Ours: 10 tasks")


def test_latex_with_the_paper_says_what_agents_were_given_and_what_is_missing(tmp_path, capsys):
    result = scored("mine", "clean", [1, 0])
    folder = run_of(
        tmp_path / "run",
        [record | {"given": ["plan"]} for record in result],
        tasks=["t0", "t1", "t2"],
    )
    (folder / "run.json").write_text(
        (folder / "run.json").read_text().replace('"episodes": [', '"episodes": ["more", ')
    )
    _, out, _ = hijack(capsys, "report", folder, "--format", "latex", "--paper")
    assert "mine (given the plan) & 50.00" in out
    assert "1 of 3 episodes are missing." in out


def test_every_form_says_who_asked_for_recovery(tmp_path, capsys):
    requests = {"policy": "repair", "requests": 2, "false_alarms": 1, "repaired": 1}
    records = [
        *(record | {"recovery": requests} for record in scored("mine", "marks", [1, 0])),
        *(
            record | {"recovery": requests | {"requests": 0}}
            for record in scored("calm", "marks", [1, 0])
        ),
    ]
    folder = run_of(tmp_path / "run", records, recovery="repair")
    output = (
        "Recovery policy repair: mine asked 4 times to be re-initialised (2 false alarms), and 2"
        " were repaired."
    )
    for form in ("terminal", "json", "markdown", "html"):
        words = () if form == "terminal" else ("--format", form)
        _, out, _ = hijack(capsys, "report", folder, *words)
        assert output in " ".join(out.split()), form
    guarded = run_of(tmp_path / "guarded", records, recovery="repair", guard="rules")
    _, out, _ = hijack(capsys, "report", guarded)
    assert "mine with its guard asked 4 times" in " ".join(out.split()), "either may have asked"
    _, out, _ = hijack(capsys, "report", folder, "--format", "latex")
    assert "Recovery policy: repair." in out


def test_a_report_says_where_the_network_was_cut_later_than_in_the_paper(tmp_path):
    """The order decides what network_error costs, and was in run.json alone."""
    records = [
        *(r | {"environment_errors": "after_setup"} for r in scored("a", "network_error", [1, 0])),
        *(r | {"environment_errors": "before_setup"} for r in scored("b", "network_error", [1, 0])),
        *(r | {"environment_errors": None} for r in scored("a", "clean", [1, 0])),
    ]
    notes = build_report(read_run(tmp_path / "run", records)).notes
    output = "In 2 episodes the network was cut after the task had been set up (network_error 2)"
    assert any(output in note for note in notes)
    early = read_run(tmp_path / "early", [r for r in records if r["agent"] == "b"])
    assert not any("network was cut" in note for note in build_report(early).notes)


@pytest.mark.parametrize("form", ["terminal", "markdown", "html"])
def test_every_form_says_why_there_is_no_mce(tmp_path, capsys, form):
    records = [
        *scored("mine", "marks", [1, 0]),
        *scored("perfect", "marks", [1, 1]),
        *scored("perfect", "subtitle", [1, 0]),
    ]
    folder = run_of(tmp_path / "run", records)
    words = () if form == "terminal" else ("--format", form)
    _, out, _ = hijack(capsys, "report", folder, "--reference", "perfect", *words)
    out = " ".join(out.split())
    assert "There is no mCE: the reference agent perfect never fails under marks," in out
    assert "mCE is the mean" not in out
    _, out, _ = hijack(capsys, "report", folder, "--reference", "mine", *words)
    assert "There is no mCE" not in out


def test_model_index_is_what_the_hub_reads(folder, capsys):
    hub = pytest.importorskip("huggingface_hub.repocard_data")
    code, out, _ = hijack(capsys, "report", folder, "--format", "model-index")
    assert code == 0
    name, results = hub.model_index_to_eval_results(yaml.safe_load(out)["model-index"])
    assert name == "mine"
    by = {(r.dataset_config, r.metric_type): r.metric_value for r in results}
    assert by["clean", "success_rate"] == 80
    assert by["marks", "retention"] == 100
    assert by["all", "average"] == 49
    assert len(yaml.safe_load(out)["model-index"]) == 1  # recovering is no model


def test_what_is_published_of_a_run_says_what_is_missing(tmp_path):
    run = run_of(tmp_path / "run", whole("mine", dict.fromkeys(CONDITIONS, 5)))
    whole_run = ReportDocument(report=build_report(reading.read(run)))
    assert "missing" not in formats.write(whole_run, "latex")
    assert "missing" not in formats.write(whole_run, "model-index")
    path = run / "records.jsonl"
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:-3]))
    cut = ReportDocument(report=build_report(reading.read(run)))
    assert "10 tasks. Recovery policy: none. 3 of 100 episodes are missing.}" in formats.write(
        cut, "latex"
    )
    card = yaml.safe_load(formats.write(cut, "model-index"))["model-index"][0]
    assert card["results"][0]["dataset"]["args"]["missing_episodes"] == 3


def test_what_is_published_of_a_run_says_what_watched_its_agents_and_what_is_invalid(tmp_path):
    """Both were in notes alone, which neither a table of LaTeX nor a model card has."""
    invalid = made("mine", "t10", "marks") | {"status": "invalid", "score": None}
    run = read_run(tmp_path / "run", [*whole("mine", dict.fromkeys(CONDITIONS, 5)), invalid])
    plain = ReportDocument(report=build_report(run))
    guarded = ReportDocument(
        report=build_report(replace(run, config={**run.config, "guard": "rules"}))
    )
    assert guarded.report.run.guard == "rules"
    table = formats.write(guarded, "latex")
    assert "Every agent is watched by the guard rules. Without 1 invalid episode.}" in table
    card = yaml.safe_load(formats.write(guarded, "model-index"))["model-index"][0]
    arguments = card["results"][0]["dataset"]["args"]
    assert (arguments["guard"], arguments["invalid_episodes"]) == ("rules", 1)
    for format in ("latex", "model-index", "html"):
        assert "guard" not in formats.write(plain, format), format
    assert "<dt>guard</dt>" in formats.write(guarded, "html")


def test_names_are_no_formulas_and_no_commands(tmp_path):
    names = ("=1+1", "@sum", "-2", "\tx", "[3pt]", "a&amp;b~~$x$#1", "two\n\nlines")
    values = [record for name in names for record in scored(name, "clean", [1, 0])]
    document = ReportDocument(report=build_report(read_run(tmp_path / "run", values)))
    rows = list(csv.reader(io.StringIO(formats.write(document, "csv"))))[1:]
    assert [row[0] for row in rows] == ["'=1+1", "'@sum", "'-2", "'\tx", *names[4:]]
    assert not any(cell.startswith("'") for row in rows for cell in row[1:]), "numbers stay"
    table = formats.write(document, "latex")
    assert "\n{[}3pt{]} & " in table
    assert "\ntwo lines & " in table
    text = formats.write(document, "markdown")
    assert r"| a\&amp;b\~\~\$x\$\#1 |" in text


def test_the_name_of_a_folder_is_no_markup(tmp_path):
    runs = [read_run(tmp_path / place / "x[bold]", scored("a", "clean", [1, 0])) for place in "ab"]
    document = ReportDocument(report=build_report(runs[0]), comparison=compare_runs(*runs))
    assert "x[bold] before, x[bold] after" in formats.write(document, "terminal")


@pytest.mark.parametrize(
    ("value", "shown"),
    [(999, "999"), (1000, "1k"), (999_499, "999k"), (999_500, "1M"), (999_999_999, "1G")],
)
def test_counts_as_people_read_them(value, shown):
    assert formatting.count(value) == shown


def test_small_numbers_are_not_nothing(tmp_path):
    assert formatting.percent(-0.0001, "+") == "+0.0"
    items = [*scored("a", "clean", [1.0] * 20), *scored("a", "marks", [0.0] * 20)]
    document = ReportDocument(report=build_report(read_run(tmp_path / "run", items)))
    assert " <0.001 " in formats.write(document, "terminal")
    assert " 0.000 " not in formats.write(document, "terminal")


@pytest.mark.parametrize("words", [(), ("--json",), ("--format", "csv")])
def test_a_finished_report_ends_with_the_code_of_its_run(tmp_path, capsys, words):
    """It ended with 0, whatever its run lacked."""
    invalid = made("mine", "t2", "marks") | {"status": "invalid", "score": None}
    run = run_of(tmp_path / "run", [*scored("mine", "marks", [1, 0]), invalid])
    whole_run = run_of(tmp_path / "whole", scored("mine", "marks", [1, 0]))
    for folder, expected in ((run, 1), (whole_run, 0)):
        file = tmp_path / f"{folder.name}.report.json"
        assert hijack(capsys, "report", folder, "-o", file)[0] == expected
        assert hijack(capsys, "report", file, *words)[0] == expected


def test_the_rows_of_a_finished_report_are_those_of_its_run(folder, capsys, tmp_path):
    _, rows, _ = hijack(capsys, "report", folder, "--json")
    path = tmp_path / "report.json"
    hijack(capsys, "report", folder, "-o", path)
    code, out, _ = hijack(capsys, "report", path, "--json")
    assert (code, json.loads(out)) == (0, json.loads(rows))
    code, _, err = hijack(capsys, "report", path, "--reference", "mine")
    assert (code, "is a finished report, whose reference agent is ''" in err) == (2, True)


def test_the_rows_of_a_comparison(folder, capsys):
    code, out, _ = hijack(capsys, "compare", folder, folder, "--json")
    rows = json.loads(out)
    assert (code, len(rows)) == (0, 20)
    assert {row["difference"] for row in rows} == {0}
    words = ("--pair", "mine=mine", "--pair", "mine=recovering")
    code, _, err = hijack(capsys, "compare", folder, folder, *words)
    assert (code, "'mine' is compared with 'mine' already" in err) == (2, True)


def test_model_index_needs_an_agent(tmp_path, capsys):
    run_of(tmp_path / "run", scored("oracle", "clean", [1]))
    code, _, err = hijack(capsys, "report", tmp_path / "run", "--format", "model-index")
    assert (code, "has only reference agents (oracle)" in err) == (2, True)


def test_the_name_of_a_file_tells_the_format(folder, capsys, tmp_path):
    starts = {
        "r.html": "<!doctype html>",
        "r.csv": "agent,",
        "r.tex": "% needs",
        "r.md": "## mine and recovering on small\n",
    }
    for name, start in starts.items():
        code, out, _ = hijack(capsys, "report", folder, "-o", tmp_path / name)
        assert (code, out) == (0, f"wrote {tmp_path / name}\n")
        assert (tmp_path / name).read_text().startswith(start)


def test_a_scoring_run_shows_its_parts(tmp_path):
    items = [
        made("a", "row", parts={"type": True, "place": False}, target_visible=0.25),
        made("a", "other", parts={"type": True}, target_visible=1.0),
    ]
    run = read_run(tmp_path / "run", items, kind="score", question="steps")
    document = ReportDocument(report=build_report(run))
    lines = formats.write(document, "markdown").split("Right, by part:")[1].splitlines()
    assert lines[2].startswith("| agent | corruption | n | type, % | place, % | malformed, % ")
    assert [cell.strip() for cell in lines[4].split("|")][4:8] == ["100.0", "0.0", "100.0", "1"]
    assert "Right, by part" in formats.write(document, "html")
    assert document.report.cells[0].pass_hat == ()  # its rows are no repetitions


# The page


class Outside(HTMLParser):
    """Collects what a page would fetch or run."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        if tag in ("script", "link", "img", "iframe", "object"):
            self.found.append(tag)
        self.found += [name for name, _ in attrs if name in ("src", "href", "onclick", "onload")]


def test_a_page_stands_alone_and_escapes(hostile):
    page = formats.write(hostile, "html")
    parser = Outside()
    parser.feed(page)
    assert parser.found == []
    assert re.findall(r'url\("(?!data:)', page) == []
    assert "&lt;script&gt;" in page


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_in_a_browser(folder, capsys, tmp_path, scheme):
    hijack(capsys, "report", folder, "--paper", "-o", tmp_path / "r.html")
    with chromium(tmp_path / "profile") as browser:
        browser.open(f"file://{tmp_path / 'r.html'}", scheme=scheme)
        widths = browser.js(
            "[...document.querySelectorAll('.panel')[0].querySelectorAll('rect')]"
            ".map(bar => bar.getBoundingClientRect().width)"
        )
        # The bars are as long as the shares.
        longest = widths[0] / SOLVED["clean"]
        assert [round(width / longest, 2) for width in widths] == list(SOLVED.values())
        named = browser.js("[...document.querySelectorAll('h2')].map(title => title.textContent)")
        assert "Retention with intervals" in named
        assert "Beside the paper" in named
        contrast = browser.js("getComputedStyle(document.body).backgroundColor")
        assert contrast == {"light": "rgb(245, 246, 248)", "dark": "rgb(14, 16, 20)"}[scheme]
        for width in (1400, 420):
            browser.open(f"file://{tmp_path / 'r.html'}", width=width, scheme=scheme)
            scrolled = browser.js("document.documentElement.scrollWidth - innerWidth")
            assert scrolled <= 0, f"{width} wide: {scrolled} pixels stick out"
        fetched = [event["request"]["url"] for event in browser.of("Network.requestWillBeSent")]
        assert [url for url in fetched if not url.startswith("file://")] == []


# The paper's table


def test_the_papers_numbers_agree_with_themselves():
    paper = paper_table()
    assert paper.columns == COLUMNS
    assert len(paper.rows) == 10
    slips = []
    for row in paper.rows:
        mean = 100 * sum(row.success.values()) / 10
        if abs(mean - 100 * row.average) > 0.0051:
            slips.append(row.agent)
    assert slips == ["GPT-4o"]  # its mean is 3.697, and 3.69 is printed
    assert {row.agent: row.solved_of for row in paper.rows if row.solved_of} == {
        "Claude-3.7-Sonnet": 355
    }


def test_what_the_paper_does_not_have_is_left_out(tmp_path, capsys):
    few = [*scored("a", "clean", [1, 0]), *scored("a", "marks", [1, 0]), *scored("a", "x", [0, 0])]
    run_of(tmp_path / "few", few)
    code, out, _ = hijack(capsys, "report", tmp_path / "few", "--paper", "--format", "json")
    row = json.loads(out)["paper"]["rows"][-1]
    assert (code, row["success"], row["average"]) == (0, {"clean": 0.5, "marks": 0.5}, None)
    run_of(tmp_path / "none", scored("a", "x", [0, 0]))
    code, _, err = hijack(capsys, "report", tmp_path / "none", "--paper")
    assert (code, "none of the paper's conditions" in err) == (2, True)


# Refusals


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--format", "htlm"], "unknown format 'htlm'; did you mean 'html'?"),
        (["-o", "report.pdf"], "its name does not tell the format; give --format (terminal, json"),
        (["--reference", "recoverin"], "did you mean 'recovering'?"),
        (["--json", "--paper"], "--json is a list of rows, without --paper; give --format json"),
        (["--json", "--format", "csv"], "--json is a list of rows, without --format csv"),
        (["--json", "--reference", "oracle"], "--json is a list of rows, without --reference"),
    ],
)
def test_a_mistake_is_one_line_with_its_remedy(words, said, folder, capsys):
    code, out, err = hijack(capsys, "report", folder, *words)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert err.startswith("hijack: error: ")
    assert said in err


def test_an_empty_run_and_another_version_are_refused(tmp_path, capsys):
    run_of(tmp_path / "empty", [])
    code, out, err = hijack(capsys, "report", tmp_path / "empty")
    assert (code, out) == (2, "")
    assert re.fullmatch(r"hijack: error: .*: holds no episodes yet; .* --resume runs them\n", err)
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "run.json").write_text('{"format": "agenthijack-run", "version": 99}')
    code, _, err = hijack(capsys, "report", tmp_path / "new", "-o", tmp_path / "r.html")
    assert (code, "version 99 is newer than this library reads (3); upgrade" in err) == (2, True)
    (tmp_path / "r.json").write_text('{"format": "agenthijack-report", "version": 99}')
    code, _, err = hijack(capsys, "report", tmp_path / "r.json")
    assert (code, "upgrade agenthijack" in err) == (2, True)


def test_what_is_missing_is_said_and_exits_with_1(tmp_path, capsys):
    items = [made("a", "t0")]
    with records.create(tmp_path / "run", {"agents": ["a"]}, [items[0]["id"], "y", "z"]):
        records.append_all(tmp_path / "run", items)
    code, out, err = hijack(capsys, "report", tmp_path / "run", "-o", tmp_path / "r.md")
    assert (code, out) == (1, f"wrote {tmp_path / 'r.md'}\n")
    assert "1 of 3 planned episodes are there, 2 are missing" in err
    assert "2 are missing" in (tmp_path / "r.md").read_text()


def test_a_gate_judges_a_run_that_is_there(folder, capsys, tmp_path):
    gates = ("--fail-under", "mine:corrupted=0.4", "--junit", tmp_path / "gates.xml")
    code, out, err = hijack(capsys, "gate", folder, *gates)
    assert (code, "gate passed: corrupted of mine is 0.456, at least 0.4" in err) == (0, True)
    assert not out
    assert "mine:corrupted=0.4" in (tmp_path / "gates.xml").read_text()
    code, _, err = hijack(capsys, "gate", folder, "--fail-under", "mine:worst=0.2")
    assert (code, "gate failed: worst of mine is 0.100, below 0.2" in err) == (1, True)
    code, _, err = hijack(capsys, "gate", folder, "--fail-under", "retension=0.2")
    assert (code, "did you mean 'retention'?" in err) == (2, True)
    (tmp_path / "r.json").write_text("{}")
    code, _, err = hijack(capsys, "gate", tmp_path / "r.json", "--fail-under", "retention=0.2")
    assert (code, "give the folder of a run" in err) == (2, True)


def many_agents(tmp_path, agents, labels=CONDITIONS):
    """A run in which every agent solves all tasks clean, and none under a corruption."""
    values = [
        record
        for agent in range(agents)
        for label in labels
        for record in scored(f"agent_{agent}", label, [float(label == "clean")] * 12)
    ]
    return run_of(tmp_path / "many", values, corruptions=list(labels))


@pytest.mark.parametrize("columns", [72, 120])
@pytest.mark.parametrize(
    ("agents", "conditions"), [(1, 10), (6, 10), (30, 10), (1, 200), (12, 100)]
)
def test_the_terminal_is_a_screen_that_begins_with_the_conclusion(
    agents, conditions, columns, tmp_path
):
    """However large the run is; what is left out is counted."""
    labels = [*CONDITIONS, *(f"level_{number}" for number in range(conditions - 10))]
    report = build_report(reading.read(many_agents(tmp_path, agents, labels)))
    out = io.StringIO()
    screen = PrintableConsole(file=out, width=columns, force_terminal=False)
    terminal.show_document(ReportDocument(report=report), screen)
    lines = out.getvalue().splitlines()
    assert sum(max(1, math.ceil(len(line) / columns)) for line in lines) < 60
    who = "agent_0" if agents == 1 else f"{agents} agents"
    assert lines[0] == f"{who} on small"
    assert lines[3].startswith("agent_0: loses 100 points [")
    if conditions == 10:
        assert lines[3].endswith("; all nine losses are shown.")
        assert "0.004" in out.getvalue(), "p of the sign-flip test, by Holm: 9 * 2 / 2**12"
    assert lines[-1].startswith("--full: ")
    if agents == 30:
        assert any(line.startswith("... and ") for line in lines)
    if conditions > 50:
        assert "left out)" in out.getvalue()


def test_full_is_for_the_terminal(folder, capsys):
    code, _, err = hijack(capsys, "report", folder, "--full", "--format", "html")
    assert (code, "--full is not shown by the format html" in err) == (2, True)
    _, short, _ = hijack(capsys, "report", folder)
    _, full, _ = hijack(capsys, "report", folder, "--full")
    assert len(short.splitlines()) < len(full.splitlines())
    assert "further results" in full
    assert "further results" not in short
