"""`hijack view` shows a damaged run: each episode with its reason, and all the others."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from hijack_data.errors import HijackError
from pipelines.viewer.opening import open_source
from pipelines.viewer.runs import RunSource

from support.edited_runs import journal, read_lines, write_lines
from support.viewed_runs import episode_id

MARKS = episode_id("write_note", "marks", "gpt-9")
CLEAN = episode_id("write_note", "clean", "gpt-9")


def problems(folder: Path, name: str = MARKS) -> list[str]:
    """Open a run: no other episode may have suffered. Returns the problems of one."""
    source = open_source(folder)
    assert isinstance(source, RunSource)
    names = [entry.id for entry in source.entries]
    assert len(names) == len(set(names)) == 12
    for number, second in enumerate(names):
        data = source.episode(number)
        if second not in (name, CLEAN):
            assert (data["problems"], len(data["steps"]) > 2) == ([], True), second
    return source.episode(names.index(name))["problems"]


def line_edit(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    """Change the line of one episode in the journal."""

    def edit(run: Path) -> None:
        path = run / "records.jsonl"
        lines = path.read_bytes().split(b"\n")
        at = next(k for k, line in enumerate(lines) if MARKS.encode() in line)
        lines[at] = change(lines[at])
        path.write_bytes(b"\n".join(lines))

    return edit


def steps_edit(change: Callable[[list[bytes]], list[bytes]]) -> Callable[[Path], None]:
    """Change the lines of the steps of one episode."""

    def edit(run: Path) -> None:
        path = run / "episodes" / MARKS / "steps.jsonl"
        path.write_bytes(b"\n".join(change(path.read_bytes().splitlines())) + b"\n")

    return edit


def home(run: Path) -> Path:
    return run / "episodes" / MARKS


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (line_edit(lambda line: line[:-40]), "not JSON"),
        (
            line_edit(lambda line: line.replace(b'"status": "ok"', b'"status": 5')),
            "status: is miss",
        ),
        (line_edit(lambda line: b""), "has no line of it; shown from its episode.json"),
        (line_edit(lambda line: line.replace(b'"score": 0.0', b'"score": 1.0')), "differ in score"),
        (lambda run: (home(run) / "frames" / "0002.seen.png").unlink(), "pictures of 1 of 7 steps"),
        (lambda run: (home(run) / "steps.jsonl").unlink(), "steps.jsonl' is not"),
        (lambda run: (home(run) / "episode.json").write_text("{"), "episode.json: not JSON"),
        (lambda run: (home(run) / "episode.json").unlink(), "has no episode.json"),
        (steps_edit(lambda lines: lines[:4]), "has 4 lines, episode.json says 7"),
        (steps_edit(lambda lines: [*lines[:2], b"{rubbish", *lines[3:]]), "line 3 of steps.jsonl"),
        (steps_edit(lambda lines: [b"[" * 100_000, *lines[1:]]), "nested too deeply"),
    ],
)
def test_damage_is_shown_with_its_episode(
    harmed: Path, harm: Callable[[Path], object], words: str
) -> None:
    harm(harmed)
    result = problems(harmed)
    assert any(words in problem for problem in result), result


def test_a_record_that_was_edited_everywhere_is_found_by_the_next_line(harmed: Path) -> None:
    edit = line_edit(lambda line: line.replace(b'"score": 0.0', b'"score": 1.0'))
    edit(harmed)
    path = home(harmed) / "episode.json"
    path.write_text(path.read_text().replace('"score": 0.0', '"score": 1.0'))
    (problem,) = problems(harmed)
    assert "was changed, or one after it removed" in problem


def test_an_episode_of_another_version_says_so(harmed: Path) -> None:
    journal(lambda rows: [r | {"version": 9} if r["id"] == MARKS else r for r in rows])(harmed)
    assert "was written by version 9 of the log" in problems(harmed)[0]


@pytest.mark.parametrize("head", ['{"format": "agenthijack-run", "version": 99}', "{", ""])
def test_a_head_of_another_version_leaves_the_episodes(harmed: Path, head: str) -> None:
    (harmed / "run.json").write_text(head)
    source = open_source(harmed)
    assert len(source.problems) == 1
    assert source.problems[0].startswith("run.json: ")
    assert isinstance(source, RunSource)
    assert all(len(source.episode(number)["steps"]) > 2 for number in range(12))


def test_the_run_of_another_program_is_refused(harmed: Path) -> None:
    (harmed / "run.json").write_text('{"format": "another", "version": 1}')
    with pytest.raises(HijackError, match="not the log of a run of ours"):
        RunSource(harmed)


def test_an_episode_without_a_folder_shows_its_record(harmed: Path) -> None:
    home(harmed).rename(harmed / "elsewhere")
    source = open_source(harmed)
    assert isinstance(source, RunSource)
    data = source.episode([entry.id for entry in source.entries].index(MARKS))
    assert data["problems"] == [f"there is no episodes/{MARKS}: its steps are lost"]
    assert (data["steps"], dict(data["fields"])["status"]) == ([], "ok")


def test_an_episode_that_is_being_played_is_shown_as_far_as_it_is(harmed: Path) -> None:
    journal(lambda rows: rows[:-1])(harmed)
    last = episode_id("rename_file", "app_minimization", "gpt-9")
    (harmed / "episodes" / last / "episode.json").unlink()
    source = open_source(harmed)
    assert isinstance(source, RunSource)
    entry = source.entries[-1]
    assert (entry.id, entry.outcome, entry.problem) == (last, "unfinished", "")
    assert (entry.agent, entry.task, entry.corruption, entry.seed) == (
        "gpt-9",
        "rename_file-7",
        "app_minimization",
        "7",
    )
    steps = harmed / "episodes" / last / "steps.jsonl"
    rows = read_lines(steps)
    assert len(source.episode(11)["steps"]) == 4
    write_lines(steps, rows[:2])
    assert len(source.episode(11)["steps"]) == 2


def test_nothing_outside_the_run_is_read(harmed: Path) -> None:
    secret = harmed.parent / "secret.png"
    secret.write_bytes((home(harmed) / "frames" / "0000.png").read_bytes())
    rows = read_lines(home(harmed) / "steps.jsonl")
    rows[0] |= {"image": "../../../secret.png", "seen": None}
    rows[1] |= {"image": str(secret), "seen": str(secret)}
    rows[2] |= {"image": 5, "seen": {}}
    write_lines(home(harmed) / "steps.jsonl", rows)
    (home(harmed) / "frames" / "0003.png").unlink()
    (home(harmed) / "frames" / "0003.png").symlink_to(secret)
    source = open_source(harmed)
    assert isinstance(source, RunSource)
    number = [entry.id for entry in source.entries].index(MARKS)
    lost_values = [step["lost"] for step in source.episode(number)["steps"]]
    assert [
        "leaves" in lost_values[0],
        "absolute" in lost_values[1],
        "names no picture" in lost_values[2],
    ] == [True] * 3
    for step, before in ((0, False), (1, False), (2, False), (3, True)):
        with pytest.raises(HijackError):
            source.picture(number, step, before)


def test_a_damaged_log_of_requests_is_named(harmed: Path) -> None:
    (harmed / "requests" / f"{MARKS}.jsonl").write_text('{"step": 0}\n{"rol')
    assert problems(harmed) == [
        f"requests/{MARKS}.jsonl: not JSON (Unterminated string starting at: line 1 column 2 (char 1))"
    ]


def test_lines_without_an_id_are_problems_of_the_run(harmed: Path) -> None:
    path = harmed / "records.jsonl"
    lines = path.read_bytes().splitlines()
    path.write_bytes(b"\n".join([b"rubbish", *lines[1:-1], lines[-1][:90]]))
    source = open_source(harmed)
    assert isinstance(source, RunSource)
    assert any(
        problem.startswith("line 1 of records.jsonl: not JSON") for problem in source.problems
    )
    assert len(source.entries) == 12
    entries = {entry.id: entry.problem for entry in source.entries}
    missing_id = json.loads(lines[0])["id"]
    assert entries[missing_id].startswith("records.jsonl has no line of it")


def test_a_journal_without_hashes_is_one_problem(harmed: Path) -> None:
    journal(lambda rows: [{k: v for k, v in r.items() if k != "previous"} for r in rows])(harmed)
    source = open_source(harmed)
    assert source.problems == ["lines of records.jsonl do not name the hash of the line before"]
    assert isinstance(source, RunSource)
    assert not any(entry.problem for entry in source.entries)
