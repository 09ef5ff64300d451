"""Many labels at the end of a path are changed at once, and each as if it were alone."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.errors import HijackError, LabelError
from hijack_data.labels import FORMATS, Move
from hijack_data.labels.label_paths import locate_at_path, map_at_path

SIZE = (540, 960)
MOVE = Move(SIZE, (270, 480))
ROWS = sorted(name for name, form in FORMATS.items() if form.rows is not None)
NUMBERS = st.one_of(
    st.integers(-20, 1100), st.floats(-1, 1100, width=32), st.floats(0, 1, width=16)
)


@st.composite
def labels(draw, width):
    label = st.lists(NUMBERS, min_size=width, max_size=width)
    plain = st.one_of(label, label.map(tuple), st.none())
    return draw(st.lists(plain, max_size=5))


def alone(form, values):
    return [None if value is None else form.map_value(value, MOVE) for value in values]


@settings(max_examples=40)
@given(st.data())
@pytest.mark.parametrize("name", ROWS)
def test_together_as_alone(name, data):
    form = FORMATS[name]
    values = data.draw(labels(form.rows.width))
    entry = [{"box": value, "name": "button"} for value in values]
    try:
        expected = alone(form, values)
    except HijackError as error:
        with pytest.raises(LabelError, match=re.escape(str(error))):
            map_at_path("objects.box", form, entry, ["box"], MOVE)
        return
    mapped = [part["box"] for part in map_at_path("objects.box", form, entry, ["box"], MOVE)]
    assert repr(mapped) == repr(expected)  # also int or float, list or tuple
    places = [point for value in values if value is not None for point in form.locate(value, SIZE)]
    assert locate_at_path("objects.box", form, entry, ["box"], SIZE) == places
