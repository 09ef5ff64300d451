"""`compare` on data frames, beside statsmodels."""

import numpy as np
import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")
pytest.importorskip("pyarrow", reason="needs the extra [hf]")
pytest.importorskip("statsmodels", reason="needs the extra [dev]")

import pandas as pd
import pyarrow as pa
from scipy import stats
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.proportion import proportion_confint

from online_env.report import compare
from online_env.results.outcomes import OutcomeError

NAMES = {"task": "id", "condition": "noise", "score": "reward", "clean": "none"}


@pytest.fixture(scope="module")
def frame():
    rng = np.random.default_rng(0)
    rows = [
        (f"t{task}", noise, int(rng.random() < share))
        for task in range(60)
        for noise, share in (("none", 0.8), ("popup", 0.5))
    ]
    return pd.DataFrame(rows, columns=["id", "noise", "reward"])


def test_the_numbers_are_those_of_statsmodels(frame):
    result = compare(frame, **NAMES)
    cells = result.to_frame().set_index("corruption")
    wide = frame.pivot(index="id", columns="noise", values="reward")
    table = pd.crosstab(wide["none"], wide["popup"])
    assert cells.p["popup"] == pytest.approx(mcnemar(table, exact=True).pvalue)
    for label, noise in (("clean", "none"), ("popup", "popup")):
        ends = proportion_confint(wide[noise].sum(), len(wide), method="wilson")
        assert (cells.ci_low[label], cells.ci_high[label]) == pytest.approx(ends)
    assert cells.delta["popup"] == pytest.approx(wide["popup"].mean() - wide["none"].mean())
    assert "loses 32 points [14, 47]; this only loss is shown" in repr(result)
    assert "--full" not in repr(result)
    assert "| agent | popup | 60 |" in result._repr_markdown_()


def test_a_frame_comes_back_as_what_it_was_given(frame):
    table = pa.Table.from_pandas(frame)
    rows = compare(table, **NAMES).to_frame()
    assert isinstance(rows, pa.Table)
    assert rows.to_pylist() == compare(table.to_pydict(), **NAMES).to_frame().to_pylist()
    assert compare(frame, **NAMES).to_frame().delta.tolist()[1] == rows["delta"][1].as_py()
    polars = pytest.importorskip("polars")
    assert isinstance(compare(polars.from_arrow(table), **NAMES).to_frame(), polars.DataFrame)


def test_different_tasks_are_compared_as_unpaired_when_told(frame):
    other = frame.assign(id=frame.noise + frame.id, used=1.5)
    with pytest.raises(OutcomeError, match="--unpaired"):
        compare(other, **NAMES)
    result = compare(other, **NAMES, unpaired=True, cost="used")
    before, after = (frame.reward[frame.noise == noise] for noise in ("none", "popup"))
    welch = stats.ttest_ind(after, before, equal_var=False)
    cell = result.cells[1]
    assert (cell.p, cell.usd) == (pytest.approx(welch.pvalue), 90.0)


def test_a_missing_score_is_invalid_and_what_is_no_result_is_refused(frame):
    missing = frame.astype({"reward": float})
    missing.loc[1, "reward"] = None
    assert [(c.n, c.invalid) for c in compare(missing, **NAMES).cells] == [(60, 0), (59, 1)]
    for change, output in (
        ({"task": "idd"}, "no column 'idd'; did you mean 'id'.*compare.table, task="),
        ({"score": "noise"}, "the table: row 1: the score 'none' is no number|score"),
        ({"clean": "no"}, "no condition 'no'"),
    ):
        with pytest.raises(OutcomeError, match=output):
            compare(frame, **(NAMES | change))
    with pytest.raises(OutcomeError, match=r"score 2 is not in 0..1"):
        compare(frame.assign(reward=2), **NAMES)
    with pytest.raises(OutcomeError, match="not list"):
        compare([1, 2], **NAMES)
