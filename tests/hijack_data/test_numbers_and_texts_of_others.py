"""Numbers and texts that others state: each has one home, which every package asks."""

import ast
from pathlib import Path

import pytest

from hijack_data.runs.amounts import MAX_AMOUNT, is_amount, is_count
from hijack_data.surrogates import has_half, without_halves
from online_env.agents.chat.wires.common import tokens

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("hijack_data", "pipelines", "online_env")
LARGEST = 2**53
ELSEWHERE = "hijack_data/actions/program/folding.py"  # how large a number of a program may grow


@pytest.mark.parametrize("value", [0, 0.5, 3, LARGEST, float(LARGEST)])
def test_what_can_be_summed(value):
    assert is_amount(value)
    assert is_count(value) is isinstance(value, int)


NOT_SUMMED = [-1, True, "3", None, float("nan"), float("inf"), LARGEST + 1, 10**400]


@pytest.mark.parametrize("value", NOT_SUMMED)
def test_what_cannot_be_summed_is_no_token_either(value):
    assert not is_amount(value)
    assert not is_count(value)
    assert tokens({"read": 4, "cached": value}, "read", "cached") == 4


def test_half_of_a_surrogate_pair_is_found_and_replaced():
    whole = "Öffne 名前 🎉"
    assert not has_half(whole)
    assert without_halves(whole) == whole
    assert has_half("a\ud800")
    assert without_halves("\udfffa\ud83c\udf89") == "�a��", "a pair in two halves is no pair"


def modules():
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield path.relative_to(ROOT).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def holds_half(node):
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and has_half(node.value)


def test_each_check_has_one_home():
    """No second module spells out the range of halves, or the largest count."""
    halves = set()
    largest = set()
    for name, tree in modules():
        for node in ast.walk(tree):
            if holds_half(node):
                halves.add(name)
            if isinstance(node, ast.BinOp) and ast.unparse(node) == f"2 ** {53}":
                largest.add(name)
    assert MAX_AMOUNT == LARGEST
    assert halves == {"hijack_data/surrogates.py"}
    assert largest - {ELSEWHERE} == {"hijack_data/runs/amounts.py"}
