"""Numbers and texts that others state: what can be summed, and what can be stored."""

import pytest

from hijack_data.runs.amounts import is_amount, is_count
from hijack_data.surrogates import has_half, without_halves
from online_env.agents.chat.wires.common import tokens

LARGEST = 2**53


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
    text = "Öffne 名前 🎉"
    assert not has_half(text)
    assert without_halves(text) == text
    assert has_half("a\ud800")
    assert without_halves("\udfffa\ud83c\udf89") == "�a��", "a pair in two halves is no pair"
