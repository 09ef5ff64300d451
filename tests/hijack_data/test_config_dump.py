"""Corruptions written as YAML load back to equal corruptions."""

from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.config import dump, load_config
from hijack_data.drawing.text import font_file
from hijack_data.errors import ConfigError, ParameterError, ParameterTypeError
from hijack_data.params import Parameter, parameters

from support.config import load, structure

# Back to YAML


def values_of(parameter: Parameter) -> st.SearchStrategy[Any]:
    low, high = parameter.low, parameter.high
    integers = st.integers(int(low or 0), int(high) if high is not None else 10**6)
    strategies: dict[str, st.SearchStrategy[Any]] = {
        "bool": st.booleans(),
        "int": integers,
        "float": st.floats(low, high, allow_nan=False),
        "color": st.sampled_from(["red", "#000000", "#1e1000", [1, 2, 255]]),
        "choice": st.sampled_from(parameter.choices),
        "steps": st.one_of(
            integers,
            st.lists(integers, min_size=1, max_size=4),
            st.integers(1, 99).map(hj.plugin.Every),
        ),
        "ip": st.sampled_from([None, "10.0.0.1", "::1"]),
        "str": (
            st.text(st.sampled_from("no 1e3:#-'\"\\\n~,[]%&*!|>?@`aé{}"), max_size=12)
            | st.sampled_from(
                [
                    "no",
                    "010",
                    "1e3",
                    "true",
                    "null",
                    "~",
                    "1:30",
                    "2024-01-01",
                    "---",
                    "<<",
                    "=",
                    "+.5",
                    " a ",
                ]
            )
        ),
    }
    return strategies[parameter.kind]


@st.composite
def specs(draw: st.DrawFn) -> hj.corruption.Corruption:
    cls = hj.corruption.find_corruption(draw(st.sampled_from(hj.corruption_names())))
    entries = {key: parameter for key, (parameter, _) in parameters(cls).items()}
    names = draw(st.lists(st.sampled_from(sorted(entries)), unique=True))
    values = {key: draw(values_of(entries[key])) for key in names}
    if "window_string" in values:
        values["window_string"] = values["window_string"].replace("{", "{{").replace("}", "}}")
    if "font_path" in values:  # it must be there
        values["font_path"] = draw(st.sampled_from(["DejaVuSans", str(font_file("DejaVuSans"))]))
    return cls(**values)


planners = st.recursive(
    specs(),
    lambda inner: st.one_of(
        st.lists(inner, min_size=1, max_size=3).map(hj.Sequence),
        st.lists(st.tuples(inner, st.floats(0.1, 10)), min_size=1, max_size=3).flatmap(
            lambda rows: st.builds(
                lambda p, equal: hj.OneOf(
                    [r[0] for r in rows], p_clean=p, weights=None if equal else [r[1] for r in rows]
                ),
                st.floats(0, 1),
                st.booleans(),
            )
        ),
    ),
    max_leaves=4,
)
labels = st.from_regex(r"[a-z][a-z0-9_.-]{0,8}x", fullmatch=True)


@settings(max_examples=100, deadline=None)
@given(st.dictionaries(labels, planners, min_size=1, max_size=3))
def test_dump_loads_back_to_equal_corruptions(tmp_path_factory, wanted):
    path = tmp_path_factory.mktemp("dump") / "c.yaml"
    path.write_text(dump(wanted), encoding="utf-8")
    corruptions = load_config(path).corruptions
    assert list(corruptions) == list(wanted)
    assert [structure(p) for p in corruptions.values()] == [structure(p) for p in wanted.values()]
    assert dump(corruptions) == dump(wanted)


def test_dump_is_canonical_and_whole(tmp_path):
    config = load_config("visual")
    text = dump(config.corruptions, config.options)
    again = load(tmp_path, text)
    assert (again.corruptions, again.options) == (config.corruptions, config.options)
    assert dump(again.corruptions, again.options) == text
    assert (
        dump([hj.Marks()])
        == "corruptions:\n- marks:\n    number: 50\n    mark_size: 20\n    mark_type: star\n   "
        " color: red\n    avoid_elements: false\n"
    )
    dumped = dump([hj.OneOf([hj.Marks(), hj.Subtitle()], p_clean=0.25, weights=[0.1, 0.2])])
    assert "p_clean: 0.25\n    weights:\n    - 0.1\n    - 0.2\n" in dumped


def test_dump_does_not_lean_on_defaults():
    entries = yaml.safe_load(dump([hj.make_corruption(name) for name in hj.corruption_names()]))[
        "corruptions"
    ]
    for entry in entries:
        ((name, values),) = entry.items()
        assert values.keys() == parameters(hj.make_corruption(name)).keys()


def test_dump_refuses_what_a_file_cannot_hold():
    with pytest.raises(ParameterTypeError, match="Schedule"):
        dump([hj.Schedule(lambda epoch: hj.Marks())])
    with pytest.raises(ParameterError, match="marks appears twice"):
        dump([hj.Marks(), hj.Marks(number=1)])
    for bad in ({}, [], {"a b": hj.Marks()}, {"subtitle": hj.Marks()}):
        with pytest.raises(ConfigError):
            dump(bad)
