"""Two runs beside each other, and the leaderboard of a folder of runs."""

import csv
import io
import json
import shutil

import pytest
import yaml

pytest.importorskip("scipy", reason="needs the extra [online]")

from hijack_data.cli import main
from online_env.report import ReportError, build_report, formats
from online_env.report.board_page import board_page
from online_env.report.comparison import compare_runs
from online_env.report.document import ReportDocument
from online_env.report.identity import run_identity
from online_env.report.leaderboard import RULE, rank_agents, read_reports
from online_env.results import statistics
from online_env.results.reading import Run, read

from support.chromium import chromium
from support.reported import CONDITIONS, made, read_run, run_of, scored, whole

SOLVED = dict(zip(CONDITIONS, (8, 4, 2, 8, 6, 7, 5, 5, 1, 3), strict=True))


def hijack(capsys, *words):
    """Run a command in this process: exit code, output, errors."""
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    output = capsys.readouterr()
    return ended.value.code, output.out, output.err


def test_cases_are_paired_by_task_corruption_and_seed(tmp_path):
    before = [
        *scored("a", "clean", [1, 1, 0, 0]),
        *scored("a", "marks", [0, 0, 0, 0, 0, 0]),
        *scored("a", "marks", [1, 1], seed=1),
        *scored("a", "subtitle", [1]),
    ]
    after = [*scored("a", "clean", [1, 0, 1, 1]), *scored("a", "marks", [1, 1, 1, 1, 1, 1])]
    result = compare_runs(read_run(tmp_path / "old", before), read_run(tmp_path / "new", after))
    clean, marks, subtitle = result.cells
    assert (clean.n, clean.success_before, clean.success_after) == (4, 0.5, 0.75)
    assert (clean.difference, clean.p) == (0.25, 1.0)  # one lost, two won
    assert (marks.n, marks.only_before, marks.only_after) == (6, 2, 0)
    assert marks.difference == 1
    assert marks.p == pytest.approx(2 * 2 / 2**6)  # Holm: the lesser of two tests counts twice
    assert (marks.low, marks.high) == (pytest.approx(0.444, abs=1e-3), 1)  # Newcombe's
    assert (subtitle.n, subtitle.only_before, subtitle.p) == (0, 1, None)
    assert "3 cases that only" in result.notes[0]
    output = "differ in their settings, too (tasks, corruptions), first in this: tasks was "
    assert output in result.notes[1]
    assert "a: no difference is shown under clean (" in result.notes[2]


def test_a_task_from_another_file_is_named(tmp_path):
    """Only the files of the agents may differ without a word."""
    runs = [
        read_run(
            tmp_path / name,
            scored("a", "marks", [1, 0]),
            code={"a": {"sha256": name}, "t0-0": {"sha256": task}, "t1-0": {"sha256": "same"}},
        )
        for name, task in (("old", "1"), ("new", "2"), ("newer", "2"))
    ]
    notes = compare_runs(*runs[:2]).notes
    assert notes[0].startswith("Other files define t0-0 in old than in new:")
    assert not any("files" in note for note in compare_runs(*runs[1:]).notes)


def test_all_that_differs_between_two_runs_is_named(tmp_path):
    run = read_run(tmp_path / "one", scored("a", "marks", [1, 0]), corruptions=["marks"])
    louder = [{"marks": {"number": 99}}]
    second = read_run(
        tmp_path / "other", scored("a", "marks", [1, 0]), corruptions=louder, max_steps=50
    )
    (output, *_) = compare_runs(run, second).notes
    assert "differ in their settings, too (corruptions, max_steps), first in this" in output
    head = tmp_path / "other" / "run.json"
    data = json.loads(head.read_text())
    head.write_text(json.dumps(data | {"versions": {**data["versions"], "agenthijack": "9.0"}}))
    notes = compare_runs(run, read(tmp_path / "other")).notes
    assert "other with 9.0: tasks and corruptions may have changed." in "\n".join(notes)


def test_cases_of_one_name_that_ask_for_something_else_are_counted(tmp_path):
    """A task whose wording changed between two commits was paired without a word."""
    items = scored("a", "marks", [1, 0, 1])
    folders = []
    for name, text in (("old", "Save it."), ("new", "Save and close it.")):
        records = [{**record, "instruction": "Quit."} for record in items]
        records[1]["instruction"] = text
        folders.append(run_of(tmp_path / name, records))
    for folder in folders:
        head = json.loads((folder / "run.json").read_text())
        head["git"] = {"agenthijack": {"commit": folder.name * 9, "dirty": False}}
        (folder / "run.json").write_text(json.dumps(head))
    notes = compare_runs(*map(read, folders)).notes
    assert (
        "1 case had another instruction in old than in new (t1-0): what differs may be the task,"
        " not the agent." in notes
    )
    assert any(
        "old was played by commit oldoldol of agenthijack, new by newnewne" in n for n in notes
    )
    same = compare_runs(read(folders[0]), read(folders[0])).notes
    assert not any("instruction" in note or "commit" in note for note in same)


def test_notes_name_runs_and_not_where_they_lie(tmp_path):
    run = read_run(tmp_path / "old", [*scored("a", "clean", [1, 0]), *scored("b", "clean", [1])])
    second = read_run(tmp_path / "new", scored("a", "clean", [1]))
    notes = "\n".join(compare_runs(run, second).notes)
    assert "Only in old: b." in notes
    assert "1 cases that only old has, 0 that only new has" in notes
    assert str(tmp_path) not in notes
    same = read_run(tmp_path / "deep" / "old", scored("a", "clean", [1]))
    assert "Only in old (before): b." in compare_runs(run, same).notes


def test_intervals_are_those_of_paired_differences(tmp_path):
    old = [float(n % 3 == 0) for n in range(30)]
    new = [float(n % 2 == 0) for n in range(30)]
    runs = [read_run(tmp_path / name, scored("a", "x", s)) for name, s in (("o", old), ("n", new))]
    (cell,) = compare_runs(*runs).cells
    tasks = [f"t{number}" for number in range(30)]
    expected = statistics.difference_interval(old, new, tasks)
    assert (cell.difference, cell.low, cell.high) == (expected.value, expected.low, expected.high)
    assert cell.p == statistics.mcnemar_by_task(old, new, tasks)


def test_p_takes_each_task_as_one_case_whatever_its_seeds(tmp_path):
    def run(name, scores):
        items = [*scored("a", "marks", scores), *scored("a", "marks", scores, seed=1)]
        return read_run(tmp_path / name, items)

    result = compare_runs(run("old", [1, 1, 1, 1, 0]), run("new", [0, 0, 0, 0, 0]))
    assert result.cells[0].p == 0.125
    # Where no size of a difference can be told, the note promises none.
    same = [scored("a", "marks", [1, 1, 1])] * 2
    (note,) = compare_runs(
        *(read_run(tmp_path / f"s{n}", rows) for n, rows in enumerate(same))
    ).notes
    assert note == "a: no difference is shown under marks."


def test_which_agents_are_compared(tmp_path):
    run = read_run(tmp_path / "one", scored("a", "clean", [1, 0]))
    second = read_run(tmp_path / "other", scored("b", "clean", [1, 1]))
    both = read_run(tmp_path / "both", [*run.records, *second.records])
    (cell,) = compare_runs(run, second).cells
    assert (cell.before, cell.after, cell.difference) == ("a", "b", 0.5)
    (cell,) = compare_runs(run, both).cells
    assert (cell.before, cell.after) == ("a", "a")
    assert any(note.endswith("both: b.") for note in compare_runs(run, both).notes)
    (cell,) = compare_runs(both, both, {"a": "b"}).cells
    assert (cell.before, cell.after, cell.difference) == ("a", "b", 0.5)
    with pytest.raises(ReportError, match=r"--pair: 'c' is not in .*both \(a, b\)"):
        compare_runs(both, both, {"a": "c"})
    third = read_run(tmp_path / "third", [made("c", "t0"), made("d", "t0")])
    with pytest.raises(ReportError, match=r"nothing to pair: .* name two with --pair a=c"):
        compare_runs(both, third)


def test_runs_without_a_shared_case_are_refused(tmp_path, capsys):
    run_of(tmp_path / "old", scored("a", "clean", [1, 0]))
    run_of(tmp_path / "new", scored("a", "clean", [1, 0], seed=5))
    words = ("compare", tmp_path / "new", tmp_path / "old")
    code, out, err = hijack(capsys, *words)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert "share no case" in err
    assert "the same --tasks, --corruptions and --seeds" in err
    code, _, err = hijack(capsys, *words, "--pair", "a")
    assert (code, "'a' is not OLD=NEW" in err) == (2, True)


def test_a_comparison_in_the_formats(tmp_path, capsys):
    run_of(tmp_path / "old", scored("a", "marks", [1, 0, 1]))
    run_of(tmp_path / "new", scored("a", "marks", [1, 1, 1]))
    words = ("compare", tmp_path / "new", tmp_path / "old")
    code, out, _ = hijack(capsys, *words)
    assert code == 0
    assert out.split("marks")[1].split()[:4] == ["3", "66.7", "100.0", "+33.3"]
    _, out, _ = hijack(capsys, *words, "--format", "json")
    assert json.loads(out)["comparison"]["cells"][0]["n"] == 3
    _, out, _ = hijack(capsys, *words, "--format", "csv")
    (row,) = csv.DictReader(io.StringIO(out))
    assert float(row["difference"]) == pytest.approx(1 / 3)
    _, out, _ = hijack(capsys, *words, "--format", "markdown")
    assert "### old and then new, the same cases" in out
    _, out, _ = hijack(capsys, *words, "--format", "html")
    assert "old, then new" in out


# The leaderboard


@pytest.fixture
def runs(tmp_path):
    folder = tmp_path / "runs"
    better = {label: min(10, solved + 1) for label, solved in SOLVED.items()}
    run_of(folder / "a", [*whole("weak", SOLVED), *whole("oracle", dict.fromkeys(CONDITIONS, 10))])
    run_of(folder / "deep" / "b", whole("strong", better))
    return folder


def test_agents_are_ranked_where_the_setting_is_the_same(runs):
    run_of(runs / "c", whole("other", dict.fromkeys(CONDITIONS, 9)), max_steps=99)
    boards = rank_agents(read_reports(runs))
    assert [[(x.rank, x.row.agent, x.path) for x in board.lines] for board in boards] == [
        [(None, "oracle", "a"), (1, "strong", "deep/b"), (2, "weak", "a")],
        [(1, "other", "c")],
    ]
    assert [board.title for board in boards] == [
        "small, at most 15 actions",
        "small, at most 99 actions",
    ]


@pytest.mark.parametrize(
    "changed",
    [
        {"layer": "dom"},
        {"text_boxes": True},
        {"unplayable": {"other": {}}, "unplayable_score": 0.0},
        {"plans": {"corruptions": [{"marks": {"number": 3}}], "seed": 0, "part": "all"}},
        {"a_field_of_a_later_version": 1},
    ],
    ids=str,
)
def test_whatever_decides_scores_is_a_setting_of_its_own(runs, changed):
    """They were ranked together, over other pictures, denominators or plans."""
    run_of(runs / "c", whole("other", dict.fromkeys(CONDITIONS, 9)), **changed)
    boards = rank_agents(read_reports(runs))
    assert [[x.row.agent for x in board.lines] for board in boards] == [
        ["oracle", "strong", "weak"],
        ["other"],
    ]


def test_a_board_names_the_guard_of_a_setting(runs):
    """A guarded agent stood under the title and the name that it has without a guard."""
    run_of(runs / "c", whole("strong", dict.fromkeys(CONDITIONS, 9)), guard="rules")
    titles = [board.title for board in rank_agents(read_reports(runs))]
    assert titles == ["small", "small, guard rules"]


def test_a_run_that_ended_at_its_bound_is_a_setting_with_its_tasks(tmp_path):
    config = {"until_retention": {"retention": 0.5, "confidence": 0.95, "seed": 0}}
    digests = {
        run_identity(Run(folder=tmp_path, config=config, episodes=episodes)).setting_sha256
        for episodes in (("a", "b"), ("a", "b", "c", "d"))
    }
    assert len(digests) == 2


def test_equal_means_share_a_rank_whatever_rounding_makes_of_them(tmp_path):
    """0.1 and 0.2 have the mean 0.15000000000000002, 0.3 and 0 have 0.15."""
    solved = {"first": (10, 1, 2), "second": (10, 3, 0)}
    records = [
        record
        for agent, counts in solved.items()
        for label, count in zip(("clean", "marks", "subtitle"), counts, strict=True)
        for record in scored(agent, label, [1] * count + [0] * (10 - count))
    ]
    run_of(tmp_path / "runs" / "a", records)
    (board,) = rank_agents(read_reports(tmp_path / "runs"))
    assert [line.rank for line in board.lines] == [1, 1]


def test_what_lacks_episodes_has_no_rank(runs):
    path = runs / "a" / "records.jsonl"
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:-1]))
    (board,) = rank_agents(read_reports(runs))
    ranks = {line.row.agent: (line.rank, line.reason) for line in board.lines}
    assert ranks["weak"] == (None, "1 of 200 episodes are missing")
    assert ranks["strong"] == (1, "")


def test_a_run_that_was_broken_off_hides_no_column_of_the_others(runs):
    """It comes first, and has the clean condition of three tasks alone."""
    path = runs / "a" / "records.jsonl"
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:3]))
    (board,) = rank_agents(read_reports(runs))
    assert board.labels == CONDITIONS
    assert board.title == "small"
    assert (board.facts["tasks"], board.facts["seeds"]) == ("10 tasks", "1 seed")
    values = {line.row.agent: line.values for line in board.lines}
    assert [bool(value) for value in values["weak"]] == [True] + [False] * 9
    assert all(values["strong"])


def test_an_episode_that_is_there_twice_has_no_rank(runs):
    path = runs / "deep" / "b" / "records.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines, lines[0].replace(b'"score": 1.0', b'"score": 0.0')]))
    (board,) = rank_agents(read_reports(runs))
    ranks = {line.row.agent: (line.rank, line.reason) for line in board.lines}
    assert ranks["weak"] == (1, "")
    output = "1 line of the run cannot be read"
    assert ranks["strong"] == (None, output)


def test_a_finished_report_counts_as_a_run(runs, capsys, tmp_path):
    run_of(tmp_path / "elsewhere" / "a", whole("weak", SOLVED))
    _, out, _ = hijack(capsys, "report", tmp_path / "elsewhere" / "a", "--format", "json")
    (runs / "mine.report.json").write_text(out)
    (board,) = rank_agents(read_reports(runs))
    values = [(line.path, line.rank) for line in board.lines if line.row.agent == "weak"]
    assert values == [("a", 2), ("mine.report.json", 2)]  # alike, so they share the rank


def test_a_run_and_its_own_report_count_once(runs, capsys):
    _, out, _ = hijack(capsys, "report", runs / "deep" / "b", "--format", "json")
    (runs / "b.report.json").write_text(out)
    reports = read_reports(runs)
    assert reports.problems == ()
    (board,) = rank_agents(reports)
    assert [(line.path, line.rank) for line in board.lines if line.rank] == [
        ("b.report.json", 1),
        ("a", 2),
    ]


def test_a_copy_from_while_the_run_went_on_is_named(runs):
    shutil.copytree(runs / "deep" / "b", runs / "copy")
    path = runs / "copy" / "records.jsonl"
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:60]))
    reports = read_reports(runs)
    assert [place for place, _ in reports.reports] == ["a", "deep/b"]
    assert reports.problems == ("copy: is the run of deep/b, with other episodes",)


def test_symbolic_links_are_followed_once_and_never_up(runs, tmp_path, capsys):
    far = tmp_path / "far"
    far.mkdir()
    (runs / "deep" / "b").rename(far / "b")
    (runs / "deep" / "linked").symlink_to(far / "b")
    (runs / "again").symlink_to(far)
    (runs / "itself").symlink_to(runs)
    (runs / "a-too").symlink_to("a")
    assert [place for place, _ in read_reports(runs).reports] == ["a", "again/b"]
    assert read_reports(runs).problems == ()
    (runs / "up").symlink_to(tmp_path)
    (runs / "gone").symlink_to("nowhere")
    (runs / "round").symlink_to("round")
    words = ("leaderboard", runs, "-o", tmp_path / "board.html")
    code, _, err = hijack(capsys, *words)
    assert code == 1
    assert "left out: gone: is a symbolic link to nowhere, which cannot be reached" in err
    assert "left out: round: is a symbolic link to round, which cannot be reached" in err
    assert f"left out: up: is a symbolic link to {tmp_path}, a folder above" in err
    assert [place for place, _ in read_reports(runs).reports] == ["a", "again/b"]


def test_a_page_has_no_paths_of_this_machine(runs, tmp_path):
    (runs / "bad").mkdir()
    (runs / "bad" / "run.json").write_text("{")
    assert str(tmp_path) not in board_page(read_reports(runs))


def test_the_page_names_what_was_left_out(runs, capsys, tmp_path):
    (runs / "<bad>").mkdir()
    (runs / "<bad>" / "run.json").write_text("{")
    words = ("leaderboard", runs, "-o", tmp_path / "board.html")
    code, _, err = hijack(capsys, *words)
    assert code == 1
    assert "left out: " in err
    page = (tmp_path / "board.html").read_text()
    assert page == board_page(read_reports(runs))
    assert "&lt;bad&gt;" in page
    assert "<bad>" not in page
    assert page.index("strong") < page.index("weak")


def test_logs_without_a_head_are_not_ranked_against_each_other(tmp_path):
    """Of neither is known what was played, so they only look alike."""
    runs = tmp_path / "runs"
    runs.mkdir()
    for name, solved in (("easy", 10), ("hard", 3)):
        log = Run(folder=tmp_path / name, records=whole(name, dict.fromkeys(CONDITIONS, solved)))
        text = formats.write(ReportDocument(report=build_report(log)), "json")
        (runs / f"{name}.report.json").write_text(text)
    (board,) = rank_agents(read_reports(runs))
    output = "a log without run.json, so its setting is not known"
    assert {(line.rank, line.reason) for line in board.lines} == {(None, output)}


def test_tasks_of_one_name_from_other_files_are_other_tasks(runs):
    mine = {"my.py:Task": {"path": "/a/my.py", "sha256": "1" * 64}}
    moved = {"my.py:Task": {"path": "/b/my.py", "sha256": "1" * 64}}
    edited = {"my.py:Task": {"path": "/a/my.py", "sha256": "2" * 64}}
    agent = {"x": {"path": "/a/x.py", "sha256": "3" * 64}}
    for name, code in (("c", mine), ("d", moved), ("e", edited), ("f", agent)):
        run_of(runs / name, whole("x", SOLVED), code=code)
    boards = rank_agents(read_reports(runs))
    places = sorted(sorted({line.path for line in board.lines}) for board in boards)
    assert places == [["a", "deep/b", "f"], ["c", "d"], ["e"]]


def test_a_board_says_that_its_runs_are_of_different_versions(runs):
    assert " and " not in rank_agents(read_reports(runs))[0].facts["version"]
    head = runs / "a" / "run.json"
    data = json.loads(head.read_text())
    head.write_text(json.dumps(data | {"versions": {"agenthijack": "9.0"}}))
    (board,) = rank_agents(read_reports(runs))
    assert board.facts["version"].startswith("agenthijack 0.")
    assert board.facts["version"].endswith(" and 9.0")


def test_a_folder_without_runs_is_refused(tmp_path, capsys):
    code, _, err = hijack(capsys, "leaderboard", tmp_path, "-o", tmp_path / "b.html")
    assert (code, len(err.splitlines())) == (2, 1)
    assert "holds no run with episodes" in err


def test_a_board_sorts_filters_and_has_the_columns_that_are_chosen(runs, tmp_path):
    run_of(runs / "c", whole("other", dict.fromkeys(CONDITIONS, 9)), max_steps=99)
    page = tmp_path / "board.html"
    page.write_text(board_page(read_reports(runs)))
    names = (
        "[...document.querySelectorAll('tbody tr')].filter(row => !row.hidden)"
        ".map(row => row.cells[1].textContent).join()"
    )
    heads = (
        "[...document.querySelectorAll('thead th')].filter(head => !head.hidden)"
        ".map(head => head.dataset.key).join()"
    )
    with chromium(tmp_path / "profile") as browser:
        browser.open(f"file://{page}")
        assert browser.js(names) == "strong,weak,oracle", "one setting, the ranked first"
        assert browser.js("document.querySelectorAll('table').length") == 1
        browser.js("document.querySelector('th[data-key=corrupted] button').click()")
        assert browser.js(names) == "oracle,strong,weak"
        browser.js("document.querySelector('th[data-key=corrupted] button').click()")
        assert browser.js(names) == "weak,strong,oracle"
        browser.js("document.querySelector('input[name=ranked]').click()")
        browser.js("document.querySelector('input[value=under-marks]').click()")
        assert browser.js(names) == "weak,strong"
        assert browser.js(heads).endswith(",worst,under-marks")
        # The choices stand in the address.
        browser.open(browser.js("location.href"), width=420, scheme="dark")
        assert browser.js(names) == "weak,strong"
        assert browser.js(heads).endswith(",worst,under-marks")
        assert browser.js("document.documentElement.scrollWidth - innerWidth") <= 0
        browser.open(f"file://{page}#setting=&text=OTH")
        assert browser.js(names) == "other"


def test_a_space_is_a_folder_that_the_hub_shows_as_it_is(runs, tmp_path, capsys):
    space = tmp_path / "space"
    assert hijack(capsys, "leaderboard", runs, "--space", space)[0] == 0
    assert {path.name for path in space.iterdir()} == {"README.md", "index.html"}
    assert (space / "index.html").read_text() == board_page(read_reports(runs))
    head, text = (space / "README.md").read_text().removeprefix("---\n").split("---\n", 1)
    assert yaml.safe_load(head) | {"tags": []} == {
        "title": "AgentHijack leaderboard",
        "sdk": "static",
        "app_file": "index.html",
        "pinned": False,
        "license": "apache-2.0",
        "tags": [],
    }
    assert RULE in text
    code, _, err = hijack(capsys, "leaderboard", runs)
    assert (code, "say where to write: -o FILE.html or --space FOLDER" in err) == (2, True)
