"""Task sets of OSWorld, and the table of tasks and corruptions made from them."""

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from hijack_data.cli import hijack
from hijack_data.errors import ConfigError, HijackError, ParameterError
from online_env.osworld import task_table
from online_env.osworld.tasks import load

GOOD: dict[str, Any] = {
    "id": "a1",
    "instruction": "Do it",
    "related_apps": ["os"],
    "config": [{"type": "sleep", "parameters": {}}],
    "evaluator": {
        "func": "exact_match",
        "result": {"type": "vm_file"},
        "expected": {"type": "rule"},
    },
}


def write_tasks(folder: Path, *tasks: dict[str, Any] | str, domain: str = "os") -> Path:
    for number, task in enumerate(tasks):
        name = (
            task["id"]
            if isinstance(task, dict) and isinstance(task.get("id"), str)
            else f"x{number}"
        )
        path = folder / "examples" / domain / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(task if isinstance(task, str) else json.dumps(task))
    return folder


@pytest.mark.parametrize(
    ("folder", "revision", "infeasible"),
    [("osworld_verified", "osworld-verified", 29), ("osworld_fork", "agenthijack-fork", 30)],
)
def test_both_revisions_load_and_are_named(
    shared_data: Path, folder: str, revision: str, infeasible: int
) -> None:
    tasks = load(shared_data / "tasks" / folder)
    assert len(tasks) == 369
    assert tasks.revision.name == revision
    assert sum(not task.feasible for task in tasks) == infeasible
    assert [(t.domain, t.id) for t in tasks] == sorted((t.domain, t.id) for t in tasks)
    inner = load(shared_data / "tasks" / folder / "examples")
    assert (inner.revision, inner.tasks) == (tasks.revision, tasks.tasks)


def test_any_change_is_another_revision(tmp_path: Path) -> None:
    before = load(write_tasks(tmp_path / "a", GOOD)).revision
    assert before.name == "unknown"
    assert load(write_tasks(tmp_path / "b", GOOD)).revision == before
    assert load(write_tasks(tmp_path / "c", {**GOOD, "instruction": "Do it."})).revision != before
    assert load(write_tasks(tmp_path / "d", GOOD, domain="vlc")).revision != before


def test_the_table_has_3321_rows_and_is_the_same_every_time(
    shared_data: Path, tmp_path: Path
) -> None:
    source = str(shared_data / "tasks" / "osworld_verified")
    outs = [tmp_path / "1.jsonl", tmp_path / "2.jsonl"]
    for out in outs:
        result = CliRunner().invoke(hijack, ["osworld", "tasks", source, "--out", str(out)])
        assert result.exit_code == 0, result.output
    assert "3321 rows, 369 tasks, revision osworld-verified@" in result.output
    assert outs[0].read_bytes() == outs[1].read_bytes()
    rows = [json.loads(line) for line in outs[0].read_text().splitlines()]
    assert len(rows) == len({row["id"] for row in rows}) == 3321
    assert [row["corruption"] for row in rows[:9]] == task_table.paper_nine()
    assert task_table.paper_nine()[0] == "pop_ups"
    assert {
        len([r for r in rows if r["corruption"] == name]) for name in task_table.paper_nine()
    } == {369}


def test_clean_rows_come_on_top_and_the_table_reads_back(shared_data: Path, tmp_path: Path) -> None:
    tasks = load(shared_data / "tasks" / "osworld_fork")
    out = tmp_path / "tasks.jsonl"
    assert task_table.write(tasks, out, clean=True) == 3690
    back = task_table.read(out)
    assert back.revision == tasks.revision
    assert [(t.id, t.domain, t.config) for t in back] == [(t.id, t.domain, t.config) for t in tasks]


@pytest.mark.parametrize("odd", ["\u2028", "\u2029", "\x85", "\x0c", "\x1c", "\r"])
def test_an_instruction_may_hold_what_some_take_for_the_end_of_a_line(
    odd: str, tmp_path: Path
) -> None:
    out = tmp_path / "tasks.jsonl"
    instruction = f"Write{odd}this"
    task_table.write(load(write_tasks(tmp_path, {**GOOD, "instruction": instruction})), out)
    (task,) = task_table.read(out)
    assert task.instruction == instruction


BROKEN: list[tuple[Any, str]] = [
    ("{", "not JSON"),
    ("[]", "must hold an object"),
    ("[" * 100_000, "not JSON"),
    ({**GOOD, "id": 7}, "id: must be a text"),
    ({**GOOD, "instruction": ""}, "instruction: must be a text that is not empty"),
    ({**GOOD, "related_apps": "os"}, "related_apps: must be a list"),
    (
        {**GOOD, "config": [{"type": "sleep"}]},
        r"config\[0\]: must be an object with `type` and `parameters`",
    ),
    ({**GOOD, "config": {}}, "config: must be a list of steps"),
    ({**GOOD, "evaluator": None}, "evaluator: must be an object"),
    ({**GOOD, "evaluator": {"func": []}}, "evaluator.func: must be a name"),
    (
        {**GOOD, "evaluator": {"func": "f", "result": [{"type": "a"}, {"kind": 1}]}},
        r"evaluator.result\[1\]",
    ),
    ({**GOOD, "evaluator": {"func": "f", "postconfig": ["x"]}}, r"evaluator.postconfig\[0\]"),
    ({**GOOD, "evaluator": {"func": ["f", "g"], "conj": "AND"}}, "conj: must be 'and' or 'or'"),
    ({**GOOD, "evaluator": {"func": ["infeasible"]}}, "'infeasible' stands alone"),
    ({**GOOD, "evaluator": {"func": "f", "options": [{}]}}, "options: must be one, for"),
    (
        {**GOOD, "evaluator": {"func": ["f", "g"], "result": [{"type": "a"}]}},
        "result: must be a list of 2, one for each evaluator.func",
    ),
]


@pytest.mark.parametrize(("content", "message"), BROKEN)
def test_mistakes_name_file_and_field(tmp_path: Path, content: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        load(write_tasks(tmp_path, content))
    assert str(tmp_path / "examples" / "os") in str(caught.value)


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    write_tasks(tmp_path, "{", {**GOOD, "id": "a1"})
    write_tasks(
        tmp_path, {**GOOD, "id": "a1"}, {**GOOD, "id": "a2", "instruction": 3}, domain="vlc"
    )
    (tmp_path / "examples" / "os" / "other.json").write_text(json.dumps(GOOD))
    (tmp_path / "examples" / "os" / "bytes.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError) as caught:
        load(tmp_path)
    text = "\n".join(caught.value.problems)
    assert len(caught.value.problems) == 5, text
    assert "id: is 'a1', the file's name says 'other'" in text
    assert "is also that of" in text


def test_an_empty_folder_says_what_was_expected(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(ConfigError, match=r"examples/<domain>/<id>\.json"):
            load(folder)


def test_only_takes_beginnings_and_refuses_the_unclear(tmp_path: Path) -> None:
    tasks = load(write_tasks(tmp_path, GOOD, {**GOOD, "id": "a2"}, {**GOOD, "id": "b1"}))
    assert [task.id for task in tasks.only(["b", "a2"])] == ["a2", "b1"]
    for wrong, message in (
        ("a", "fits 2 tasks"),
        ("c", "not in this set"),
        ("", "not in this set"),
    ):
        with pytest.raises(ParameterError, match=message):
            tasks.only([wrong])


def test_nothing_is_left_where_the_table_cant_be_written(tmp_path: Path) -> None:
    tasks = load(write_tasks(tmp_path, GOOD))
    with pytest.raises(HijackError, match="cannot be written"):
        task_table.write(tasks, tmp_path / "no" / "tasks.jsonl")
    (tmp_path / "out").mkdir()
    with pytest.raises(HijackError):
        task_table.write(tasks, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


def test_a_damaged_table_names_its_line(tmp_path: Path) -> None:
    out = tmp_path / "tasks.jsonl"
    task_table.write(load(write_tasks(tmp_path, GOOD)), out)
    lines = out.read_text().splitlines()
    second = json.loads(lines[0]) | {"revision": "unknown@0"}
    for text, message in (
        ("\n".join([lines[0], "{"]), ":2: not JSON"),
        (json.dumps({**second, "task": {**GOOD, "instruction": 1}}), ":1: task.instruction"),
        (json.dumps({**second, "domain": None}), ":1: domain"),
        ("3", ":1: a row must be an object"),
        ("\n".join([lines[0], json.dumps(second)]), "rows of 2 revisions"),
        ("", "rows of 0 revisions"),
    ):
        out.write_text(text)
        with pytest.raises(ConfigError, match=message):
            task_table.read(out)


def test_rows_of_one_task_that_differ_are_refused(tmp_path: Path) -> None:
    out = tmp_path / "tasks.jsonl"
    task_table.write(load(write_tasks(tmp_path, GOOD)), out)
    lines = out.read_text().splitlines()
    row = json.loads(lines[3])
    row["task"]["instruction"] = "Do something else"
    lines[3] = json.dumps(row)
    out.write_text("\n".join(lines) + "\n")
    with pytest.raises(ConfigError, match=r"jsonl:4: task: is not the one of an earlier row of"):
        task_table.read(out)


def test_mistakes_end_with_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from hijack_data.cli import main

    with pytest.raises(SystemExit) as caught:
        main(["osworld", "tasks", str(tmp_path / "none"), "--out", str(tmp_path / "t.jsonl")])
    assert caught.value.code == 2
    assert "no task files" in capsys.readouterr().err
