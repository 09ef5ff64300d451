"""`hijack view` finds rows: filters, counts, search, pages, neighbours."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.errors import HijackError, UnknownNameError
from pipelines import open_dataset
from pipelines.viewer import json_answers
from pipelines.viewer.index import Index
from pipelines.viewer.opening import open_source

LABELS = ["clean", "pop_ups", "resolution", "marks", "subtitle"]
WORDS = st.sampled_from(["", "marks", "clean", "Open the Door", "b/0001"])


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(WORDS, WORDS, st.integers(0, 3)), max_size=30),
    WORDS,
    WORDS,
    st.integers(1, 7),
)
def test_the_index_filters_counts_and_searches_as_a_list_does(
    rows: list[tuple[str, str, int]], corruption: str, text: str, part: int
) -> None:
    index = Index(["fidelity"])
    for first in range(0, len(rows), part):
        part_rows = rows[first : first + part]
        columns = {
            "corruption": [c for c, _, _ in part_rows],
            "instruction": [i for _, i, _ in part_rows],
            "group": ["g"] * len(part_rows),
        }
        numbers = range(2 * first, 2 * first + 2 * len(part_rows), 2)
        index.extend(
            numbers, [f"B/{n:04d}" for n in numbers], [s for _, _, s in part_rows], columns
        )
    index.finish()

    def found(n: int) -> bool:
        return (
            text.strip().casefold() in f"b/{2 * n:04d}"
            or text.strip().casefold() in rows[n][1].casefold()
        )

    matches = [n for n, row in enumerate(rows) if found(n)]
    matching_rows = [n for n in matches if rows[n][0] == corruption]
    assert index.select({"corruption": corruption}, text).tolist() == matching_rows
    counts = index.counts({"corruption": corruption}, text, ["corruption", "fidelity"])
    assert {k: v for k, v in counts["corruption"].items() if v} == {
        c: n for c in {row[0] for row in rows} if (n := sum(rows[m][0] == c for m in matches))
    }
    assert sum(counts["fidelity"].values()) == len(matching_rows)
    for n, row in enumerate(rows):
        assert index.at(2 * n) == n
        assert index.at(2 * n + 1) is None
        assert sorted(index.same_step(n).tolist()) == [
            k for k, second in enumerate(rows) if second[2] == row[2]
        ]
        steps = [k for k, second in enumerate(rows) if second[0] == row[0]]
        assert index.trajectory(n).tolist() == sorted(steps, key=lambda k: rows[k][2])


def test_a_filter_that_does_not_exist_is_refused(dataset: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'corruption'"):
        json_answers.rows(open_source(dataset), {"coruption": "marks"})


def test_filters_have_counts_and_pages(dataset: Path) -> None:
    source = open_source(dataset)
    everything = json_answers.rows(source, {})
    assert (everything["found"], everything["page"], everything["pages"]) == (30, 1, 1)
    assert everything["filters"]["corruption"]["values"] == [[label, 6] for label in LABELS]
    assert everything["filters"]["trajectory"]["values"] == [["t0", 15], ["t1", 15]]
    marks = json_answers.rows(source, {"corruption": "marks", "trajectory": "t1", "page": "1"})
    assert [row["id"] for row in marks["rows"]] == [f"t1/{step:04d}/marks" for step in range(3)]
    assert marks["filters"]["corruption"]["values"] == [
        [label, 3] for label in LABELS
    ]  # what another choice would give
    assert json_answers.rows(source, {"q": "DO T1"})["found"] == 15
    assert json_answers.rows(source, {"q": "0002/sub"})["found"] == 2
    assert json_answers.rows(source, {"corruption": "nothing"})["found"] == 0


def test_pages_are_bounded(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(json_answers, "ROWS_PER_PAGE", 8)
    monkeypatch.setattr(json_answers, "MAX_CHOICES", 2)
    source = open_source(dataset)
    for page, item in (("4", 4), ("1", 1), ("99", 4), ("0", 1), ("-3", 1), ("x", 1), ("9" * 40, 1)):
        assert json_answers.rows(source, {"page": page})["page"] == item
    assert [row["row"] for row in json_answers.rows(source, {"page": "4"})["rows"]] == list(
        range(24, 30)
    )
    choices = json_answers.rows(source, {"corruption": "subtitle"})["filters"]["corruption"]
    assert ([value for value, _ in choices["values"]], choices["more"]) == (
        ["clean", "pop_ups", "subtitle"],
        2,
    )
    last = json_answers.row(source, {"row": "29"})
    assert (last["position"], last["page"], last["next"]) == (29, 4, None)


def test_a_row_knows_its_neighbours(dataset: Path) -> None:
    source = open_source(dataset)
    by_id = {row["id"]: number for number, row in enumerate(open_dataset(dataset))}
    row = json_answers.row(source, {"row": "t0/0001/marks"})
    assert row == json_answers.row(source, {"row": str(by_id["t0/0001/marks"])})
    assert (row["step_back"], row["step_next"]) == (by_id["t0/0000/marks"], by_id["t0/0002/marks"])
    assert (row["back"], row["next"]) == (row["row"] - 1, row["row"] + 1)
    assert row["same_step"] == [[by_id[f"t0/0001/{label}"], label] for label in LABELS]
    assert row["steps"] == [[by_id[f"t0/{step:04d}/marks"], str(step)] for step in range(3)]
    within = json_answers.row(source, {"row": str(row["row"]), "corruption": "marks"})
    assert (within["position"], within["back"], within["next"]) == (
        1,
        row["step_back"],
        row["step_next"],
    )
    outside = json_answers.row(source, {"row": str(row["row"]), "corruption": "subtitle"})
    assert outside["position"] is None
    assert (outside["back"], outside["next"]) == (
        by_id["t0/0000/subtitle"],
        by_id["t0/0001/subtitle"],
    )
    for name in ("30", "-1", "t9/0000/marks", ""):
        with pytest.raises(HijackError, match="there is no row"):
            json_answers.row(source, {"row": name})
