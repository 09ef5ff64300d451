"""Tables of figures on terminals of any width."""

import io
import re

import pytest
from rich.console import Console

from hijack_data.cli.figure_table import FigureTable, grouped

BLOCKS = ["n", ("success", "95 %"), ("delta", "95 %", "p"), "retention"]
ROWS = [
    ("a.py:Mine[1]", "clean", "24", "95.8", "[87.5, 100.0]", "", "", "", "100.0"),
    (
        "a.py:Mine[1]",
        "pop_ups",
        "24",
        "0.0",
        "[0.0, 13.8]",
        "-95.8",
        "[-100.0, -86.2]",
        "1.000",
        "",
    ),
    ("b", "clean", "7", "0.0", "[0.0, 41.0]", "", "", "", "33.3"),
]


def printed(table, width):
    out = io.StringIO()
    Console(file=out, width=width, highlight=False).print(table)
    return out.getvalue()


def table(rows=ROWS, title=None):
    return FigureTable("corruption", BLOCKS, grouped(rows), title)


def words(text):
    return sorted(re.split(r"\s{2,}|\n", text))


def test_a_wide_screen_shows_one_table():
    lines = [line.rstrip() for line in printed(table(title="[all] of it"), 120).splitlines()]
    assert lines == [
        "[all] of it",
        "corruption     n  success           95 %  delta             95 %      p  retention",
        "a.py:Mine[1]",
        "  clean       24     95.8  [87.5, 100.0]                                     100.0",
        "  pop_ups     24      0.0    [0.0, 13.8]  -95.8  [-100.0, -86.2]  1.000",
        "b",
        "  clean        7      0.0    [0.0, 41.0]                                      33.3",
    ]


@pytest.mark.parametrize("width", range(48, 121))
def test_no_width_cuts_or_folds_a_figure(width):
    text = printed(table(), width)
    assert max(map(len, text.splitlines())) <= width
    result = words(text)
    for row in ROWS:
        for word in row:
            assert not word or word in result


@pytest.mark.parametrize("width", range(48, 121))
def test_the_figures_of_a_block_stay_side_by_side(width):
    headings = [line for line in printed(table(), width).splitlines() if "corruption" in line]
    assert all(line.startswith("corruption") for line in headings)
    assert sum("success" in line for line in headings) == 1
    for line in headings:
        assert ("delta" in line) == (re.search(r"\bp\b", line) is not None)
        assert line.count("95 %") == ("success" in line) + ("delta" in line)


def test_a_column_without_figures_is_left_out_but_not_from_an_empty_table():
    assert "delta" not in printed(table([ROWS[0], ROWS[2]]), 120)
    assert "retention" in printed(table([]), 120)


def test_a_long_label_is_folded_not_cut():
    name = "x" * 90
    text = printed(table([(name, *ROWS[0][1:])]), 80)
    assert "".join(re.findall("x+", text)) == name * text.count("corruption")


@pytest.mark.parametrize("width", [24, 40])
def test_a_figure_wider_than_the_screen_is_folded_not_cut(width):
    long = "".join(map(chr, range(65, 123)))
    text = printed(FigureTable("label", ["figure"], [("x", long)]), width)
    folded = "".join(line.split()[-1] for line in text.splitlines()[1:])
    assert folded.removeprefix("x") == long
