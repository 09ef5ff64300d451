"""The page's table of a run has the numbers of its report, whatever the journal holds."""

import json
from pathlib import Path
from typing import Any

import pytest

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)

from online_env.results import reading, scores
from pipelines.viewer.runs import RunSource

from support.reported import made, run_of


def table(source: RunSource) -> dict[tuple[str, str], tuple[int, float | None]]:
    """How many episodes count and their mean score, by agent and condition, as run_table.js has it:
    the last attempt at a case counts."""
    about = source.about()
    texts: dict[str, Any] = about["texts"]

    def text(name: str, n: int) -> str:
        return texts[name]["values"][texts[name]["codes"][n]]

    cells: dict[tuple[str, str], list[float]] = {}
    for n in range(len(about["ids"])):
        if not about["last"][n]:
            continue
        cell = cells.setdefault((text("agent", n), text("corruption", n)), [])
        if about["counts"][n]:
            cell.append(about["numbers"]["score"][n] or 0)
    return {key: (len(c), sum(c) / len(c) if c else None) for key, c in cells.items()}


def reported(folder: Path) -> dict[tuple[str, str], tuple[int, float | None]]:
    rows = scores.rows(reading.read(folder).records)
    return {(row["agent"], row["corruption"]): (row["n"], row["success"]) for row in rows}


ODD: list[dict[str, Any]] = [
    {"task": "t0", "score": 0.0, "id": "t0-0__clean__s0__a"},  # a line that is there twice
    {"task": "t2", "score": 7.0},
    {"task": "t3", "score": True},
    {"task": "t4", "score": None, "status": "ok"},
    {"task": "t5", "score": 1.0, "status": "error", "cause": "agent"},
    {"task": "t6", "score": 1.0, "status": "error", "cause": "machine"},
    {"task": "t7", "score": 1.0, "status": "error", "cause": "machine", "attempt": 1},
    {"task": "t8", "score": 1.0, "status": "invalid"},
    {"task": "t9", "score": 1.0, "status": "odd"},
    {"task": "t10", "score": 0.5},
]


@pytest.mark.parametrize("kept", [[one] for one in ODD] + [ODD], ids=str)
def test_the_table_has_the_numbers_of_the_report(kept: list[dict[str, Any]], tmp_path: Path):
    run = run_of(tmp_path / "run", [made("a", "t0"), made("a", "t1", score=0.0)])
    with (run / "records.jsonl").open("a") as file:
        for changes in kept:
            record = {**made("a", changes["task"]), "problem": "", **changes}
            record["task"] += "-0"
            file.write(json.dumps(record) + "\n")
    source = RunSource(run)
    assert table(source) == reported(run)
    unread = len(reading.read(run).damaged)
    problems = [entry.problem for entry in source.entries if "is no" in entry.problem]
    doubled = [text for text in source.problems if "is on line 1 already" in text]
    assert len(problems) + len(doubled) == unread


def test_the_last_of_many_attempts_counts_as_in_the_report(tmp_path: Path):
    """Folders are sorted by their names, so the tenth attempt came before the second."""
    log = tmp_path / "log"
    for attempt in range(11):
        suffix = f"__a{attempt}" if attempt else ""
        record = made("a", "t", score=float(attempt == 10), attempt=attempt)
        folder = log / "episodes" / f"{record['id']}{suffix}"
        folder.mkdir(parents=True)
        (folder / "episode.json").write_text(json.dumps(record | {"id": folder.name}))
    assert table(RunSource(log)) == reported(log) == {("a", "clean"): (1, 1.0)}


def test_conditions_come_in_the_order_of_the_configuration(tmp_path: Path):
    labels = [{"marks": {"as": "many", "number": 9}}, {"subtitle": {}}, "pop_ups"]
    played = ("pop_ups", "subtitle", "clean", "many")
    run = run_of(tmp_path / "run", [made("a", "t", label) for label in played], corruptions=labels)
    values = RunSource(run).about()["texts"]["corruption"]["values"]
    assert values == ["clean", "many", "subtitle", "pop_ups"]
