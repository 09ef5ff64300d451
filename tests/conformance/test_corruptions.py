"""Every registered corruption passes every conformance check."""

import pytest

import hijack_data as hj
from hijack_data import conformance
from hijack_data.corruption import find_corruption


@pytest.mark.parametrize(
    "check", conformance.CHECKS, ids=lambda c: c.__name__.removeprefix("check_")
)
@pytest.mark.parametrize("name", [*hj.corruption_names(), *hj.corruption_names("everyday")])
def test_conformance(name, check):
    result = conformance.run_check(check, find_corruption(name))
    assert result.ok, result.problem


def test_the_paper_has_nine_corruptions_in_its_order():
    assert hj.corruption_names()[:9] == [
        "pop_ups",
        "resolution",
        "marks",
        "subtitle",
        "multi_apps",
        "accidental_touch",
        "app_minimization",
        "network_error",
        "verification",
    ]
