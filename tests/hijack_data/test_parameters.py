"""What parameters are refused, and what the message says."""

import pytest

import hijack_data as hj
from hijack_data.errors import ParameterError, ParameterTypeError, UnknownNameError


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"number": -1}, ParameterError, r"marks.number must be int in \[0, 100000\], got -1"),
        (
            {"number": 2.5},
            ParameterTypeError,
            "marks.number must be an integer, got 2.5 \\(float\\)",
        ),
        ({"number": True}, ParameterTypeError, "an integer"),
        ({"mark_type": "sqare"}, ParameterError, "did you mean|known|one of"),
        ({"mark_type": "str"}, ParameterError, "did you mean 'star'"),
        ({"color": "rde"}, ParameterError, "did you mean 'red'"),
        ({"color": [1, 2, 300]}, ParameterError, "0..255"),
        ({"color": [True, False, True]}, ParameterError, "three integers in 0..255"),
        ({"color": [1, 2, True]}, ParameterError, "three integers in 0..255"),
        ({"color": "rgba(1,2,3,4)"}, ParameterError, "has transparency.*use '#010203'"),
        (
            {"color": "#ff000080"},
            ParameterError,
            "marks.color = '#ff000080' has transparency.*'#ff0000'",
        ),
        ({"color": "#f00f"}, ParameterError, "has transparency"),
        ({"color": "hsla(0,100%,50%,0.5)"}, ParameterError, "marks.color"),
        ({"avoid_elements": 1}, ParameterTypeError, "true or false"),
        ({"nmber": 3}, UnknownNameError, "no parameter 'nmber'; did you mean 'number'"),
    ],
)
def test_wrong_parameters(values, error, message):
    with pytest.raises(error, match=message):
        hj.make_corruption("marks", **values)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("resolution", {"scale": float("nan")}, "finite"),
        ("resolution", {"scale": 0}, "in \\[0.01, 16\\]"),
        ("network_error", {"local_ip": "300.1.1.1"}, "not an IP address"),
        ("network_error", {"local_ip": "fe80::1%eth0;ls"}, "has a zone; leave out the zone"),
        ("network_error", {"local_ip": "fe80::1%eth0"}, "has a zone; leave out the zone"),
        ("network_error", {"local_ip": " 10.0.0.1"}, "not an IP address"),
        ("app_minimization", {"step": []}, "empty list"),
        ("app_minimization", {"step": {"evry": 3}}, "every: k"),
        ("app_minimization", {"step": -2}, "must be"),
        ("subtitle", {"subtitle_text": "a\x00b"}, "control character"),
    ],
)
def test_wrong_values(name, values, message):
    with pytest.raises(ValueError, match=message):
        hj.make_corruption(name, **values)


def test_unknown_names_get_a_suggestion():
    with pytest.raises(
        UnknownNameError, match="unknown corruption 'popups'; did you mean 'pop_ups'"
    ):
        hj.make_corruption("popups")
    with pytest.raises(UnknownNameError, match="version 1 here, not 2"):
        hj.make_corruption("marks-v2")


def test_severity_is_checked():
    assert hj.PopUps.at(severity=1).small_factor == 3
    assert hj.Marks.at(5, color="blue") == hj.Marks(number=200, color="blue")
    with pytest.raises(ParameterError, match=r"severity must be in 1\.\.5"):
        hj.Marks.at(6)
    with pytest.raises(ParameterError, match="no severity scale"):
        hj.Verification.at(2)
    with pytest.raises(ParameterTypeError, match="severity must be an integer"):
        hj.Marks.at("3")


def test_a_misspelt_parameter_is_suggested_by_the_class_too():
    with pytest.raises(
        UnknownNameError, match=r"marks has no parameter 'nmber'; did you mean 'number'\?"
    ):
        hj.Marks(nmber=5)
    assert hj.Marks(5) == hj.Marks(number=5)
