"""`benchmarks/compare.py` names what got worse, in ratios and in times, and nothing else."""

import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
RESULTS = """
## The desktop

Speed of this run: {speed} ms for 200,000 sums in Python.

| what | time | steps/s | to a copy |
| --- | --- | --- | --- |
| up | {up} / 1.2 / 1.3 s | 150 / 151 / 152 | 1.50x |
| click | 2.0 / 2.5 / 3 ms | {rate} / 201 / 202 | {ratio}x |
"""


@pytest.mark.parametrize(
    ("now", "worse"),
    [
        ({}, []),
        ({"speed": 40, "up": 2.0}, []),  # a machine half as fast
        ({"up": 1.4}, ["up", "time"]),
        ({"ratio": "2.80"}, ["click", "to a copy"]),
        ({"rate": 400}, []),
    ],
)
def test_what_got_worse(now, worse, monkeypatch, tmp_path, capsys):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import compare

    values = {"speed": 20, "up": 1.0, "rate": 200, "ratio": "2.00"}
    monkeypatch.setattr(compare, "committed", lambda commit: RESULTS.format(**values))
    monkeypatch.setattr(compare, "RESULTS", tmp_path / "RESULTS.md")
    compare.RESULTS.write_text(RESULTS.format(**{**values, **now}))
    monkeypatch.setattr(sys, "argv", ["compare.py"])
    with pytest.raises(SystemExit) as ended:
        compare.main()
    output = capsys.readouterr().out
    assert ended.value.code == int(bool(worse))
    assert all(word in output for word in worse)
    assert output.count("->") == len(worse) // 2
