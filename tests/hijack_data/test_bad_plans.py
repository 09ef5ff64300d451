"""Plans from elsewhere: what is damaged or of the wrong type is a `PlanError` that says where."""

import copy
import dataclasses
import json
import pickle
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.errors import HijackError, ParameterError, ParameterTypeError, PlanError
from hijack_data.file_io import write_atomic
from hijack_data.picture_io import encode_png
from hijack_data.plan import Effect, Paste, Plan, Resample, _digest

MARK = {"draw": "mark", "shape": "circle", "size": 5, "color": "blue"}
TEXT = {
    "draw": "text",
    "lines": ["one", "two"],
    "font": "DejaVuSans",
    "size": 14,
    "color": "white",
    "edge_color": "black",
    "edge": 1,
}
PANEL = {"box": [0, 0, 40, 30], "fill": "white", "lines": ["a"], "font_size": 9}
WINDOW = {
    "draw": "window",
    "size": [40, 30],
    "edge": 1,
    "panels": [PANEL],
    "font": "DejaVuSans",
    "color": "black",
    "edge_color": "black",
}
PNG = hj.plugin.png_recipe(np.full((6, 5, 4), 200, np.uint8))
RECIPES = [MARK, TEXT, WINDOW, PNG]
STRANGE = [
    *(None, True, 0, -1, 2**40, 10**300, 1.0, 1.5, "", "x", "5"),
    *([], [1], [None], [[1, 2]], {}, {"a": 1}),
]


def valid_plan() -> dict:
    """JSON data of a plan that has everything: operations, effects, notes, nested parameters."""
    ops = (*(Paste(recipe, ((3, 4), (-2, 70))) for recipe in RECIPES), Resample((50, 60)))
    effects = (Effect("lock", {"after": [1, 2], "how": {"by": "key"}}),)
    params = {"step": [1, 2], "color": "red", "scale": 0.5, "deep": {"a": [None, True]}}
    return Plan("test-v1", (90, 120), params, ops, effects, ("a note",)).to_data()


def sealed(data: dict) -> str:
    """The JSON text of plan data with its digest made right."""
    body = {key: value for key, value in data.items() if key != "digest"}
    return json.dumps({**body, "digest": _digest(body)})


def with_value(data: dict, path: tuple, value: object) -> dict:
    """The data with the value at a path of keys and indices replaced."""
    data = copy.deepcopy(data)
    node = data
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    return data


def paths(data: object, path: tuple = ()) -> list[tuple]:
    """The paths of all values."""
    inner = ()
    if isinstance(data, dict):
        inner = data.items()
    elif isinstance(data, list):
        inner = enumerate(data)
    return [path, *(item for key, value in inner for item in paths(value, (*path, key)))]


# --- reading


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_json_does_not_have_are_named(number):
    text = '{"format":"agenthijack-plan","version":1,"params":{"a":[0,HERE]}}'
    message = r"plan\.params\.a\[1\] is (nan|-?inf).*use a finite number"
    with pytest.raises(PlanError, match=message):
        Plan.from_json(text.replace("HERE", number))


@pytest.mark.parametrize("number", ["NaN", "1e999"])
def test_the_command_says_it_in_a_line(tmp_path, number):
    write_atomic(tmp_path / "screen.png", encode_png(np.zeros((20, 30, 3), np.uint8)))
    text = json.dumps({**valid_plan(), "params": {"scale": 0.25}}).replace("0.25", number)
    write_atomic(tmp_path / "plan.json", text)
    words = ["apply", "screen.png", "-o", "out.png", "--plan", "plan.json"]
    command = [sys.executable, "-m", "hijack_data.cli", *words]
    process = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=120)
    assert process.returncode == 2
    assert process.stderr.startswith("hijack: error: plan.params.scale is")
    assert "Traceback" not in process.stderr
    assert not (tmp_path / "out.png").exists()


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("version",), -5, "version -5 must be an integer"),
        (("version",), 0, "version 0 must be an integer"),
        (("version",), True, "version True must be an integer"),
        (("version",), 1.0, r"version 1\.0 must be an integer"),
        (("corruption",), None, "corruption has the wrong type: None"),
        (("corruption",), {}, "corruption has the wrong type"),
        (("corruption",), "", "corruption is empty"),
        (("notes",), "note", "notes has the wrong type: 'note'.*a list"),
        (("notes",), [5], r"notes\[0\] has the wrong type"),
        (("params",), [["a", 1]], "params has the wrong type"),
        (("ops",), {}, "ops has the wrong type"),
        (("ops", 0), [], r"ops\[0\] has the wrong type"),
        (("ops", 0, "sprite"), [["draw", "mark"]], r"ops\[0\]\.sprite has the wrong type"),
        (("ops", 0, "fingerprint"), 7, r"ops\[0\]\.fingerprint has the wrong type"),
        (("ops", 0, "fingerprint"), "0" * 15 + "\n", r"ops\[0\]\.fingerprint is malformed"),
        (("ops", 0, "at"), {}, r"ops\[0\]\.at has the wrong type"),
        (("ops", 0, "at", 0), [True, 2], r"ops\[0\]\.at\[0\] .* pixel coordinates"),
        (("ops", 0, "at", 1), [2, 2**20 + 1], r"ops\[0\]\.at\[1\] .* pixel coordinates"),
        (("ops", 0, "at", 1), "ab", r"ops\[0\]\.at\[1\] .* pixel coordinates"),
        (("ops", 4, "size"), [True, 5], r"ops\[4\]\.size\[0\] has the wrong type"),
        (("ops", 4, "size"), [5], r"ops\[4\]\.size must be \(height, width\)"),
        (("ops", 4, "filter"), [], r"ops\[4\]\.filter has the wrong type"),
        (("ops", 4, "op"), ["paste"], r"ops\[4\]\.op = \['paste'\] is not known"),
        (("size",), [90.0, 120], r"size\[0\] has the wrong type"),
        (("size",), "ab", "size has the wrong type"),
        (("effects",), {}, "effects has the wrong type"),
        (("effects", 0, "effect"), 3, r"effects\[0\]\.effect has the wrong type"),
        (("effects", 0, "params"), [["a", 1]], r"effects\[0\]\.params has the wrong type"),
        (("colour",), "red", "colour is not a field"),
        (("ops", 0, "filter"), "bicubic", r"ops\[0\]\.filter is not a field"),
        (("ops", 4, "at"), [], r"ops\[4\]\.at is not a field"),
        (("effects", 0, "when"), 1, r"effects\[0\]\.when is not a field"),
    ],
)
def test_fields_of_the_wrong_type_are_refused_not_turned_into_the_right_one(path, value, message):
    with pytest.raises(PlanError, match=message):
        Plan.from_json(sealed(with_value(valid_plan(), path, value)))


@pytest.mark.parametrize(
    "path", [path for path in paths(valid_plan()) if path and path != ("digest",)]
)
def test_what_is_read_is_what_was_written(path):
    """Whatever stands at a place is refused or kept: what was read has the digest of the text."""
    for value in STRANGE:
        text = sealed(with_value(valid_plan(), path, value))
        try:
            plan = Plan.from_json(text)
        except PlanError:
            continue
        assert plan.digest() == json.loads(text)["digest"]
        assert Plan.from_json(plan.to_json()) == plan


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=4,
)


@settings(max_examples=300, deadline=None)
@given(st.sampled_from([path for path in paths(valid_plan()) if path]), values)
def test_any_value_anywhere_is_ours_to_refuse(path, value):
    """Reading and applying raise our errors only, whatever stands in a field."""
    data = with_value(valid_plan(), path, value)
    try:
        text = sealed(data)
    except PlanError:  # NaN: no digest can be made
        text = json.dumps(data)
    with suppress(HijackError):
        plan = Plan.from_json(text)
        if max(plan.size) < 300:
            hj.apply(plan, np.zeros((*plan.size, 3), np.uint8))


@pytest.mark.parametrize("text", [None, 5, [], {}, object()])
def test_what_is_no_text_is_said(text):
    with pytest.raises(ParameterTypeError, match="reads JSON text"):
        Plan.from_json(text)


@pytest.mark.parametrize("data", [{1, 2}, {1: 2}, b"x", np.int64(3), float("nan"), object()])
def test_data_that_is_no_json_is_refused(data):
    with pytest.raises(PlanError, match="plan"):
        Plan.from_data({**valid_plan(), "params": {"a": data}})


@pytest.mark.parametrize("depth", [900, 5000, 100_000])
def test_endless_nesting_is_refused(depth):
    text = json.dumps({**valid_plan(), "params": {"a": "HERE"}})
    with pytest.raises(PlanError, match=r"nested|recursion|digest"):
        Plan.from_json(text.replace('"HERE"', "[" * depth + "]" * depth))
    data: list = []
    for _ in range(max(depth, 5000)):
        data = [data]
    with pytest.raises(PlanError, match="nested too deeply"):
        Plan("test-v1", (4, 5), {"a": data})
    with pytest.raises(PlanError, match="nested too deeply"):
        Plan.from_data({**valid_plan(), "params": {"a": data}})


@pytest.mark.parametrize("color", ["#ff000080", "rgba(1, 2, 3, 0.5)", "no colour", 5, None])
def test_a_colour_that_cannot_be_drawn_is_refused(color):
    plan = Plan("test-v1", (9, 9), ops=(Paste({**MARK, "color": color}, ((1, 1),)),))
    with pytest.raises(PlanError, match="the 'mark' sprite cannot be drawn"):
        hj.apply(plan, np.zeros((9, 9, 3), np.uint8))


# --- making


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"corruption": 5}, PlanError, "corruption has the wrong type: 5"),
        ({"corruption": ""}, PlanError, "corruption is empty"),
        ({"size": 5}, ParameterTypeError, "size must be"),
        ({"size": (0, 5)}, ParameterError, "at least"),
        ({"params": [1]}, PlanError, "params has the wrong type"),
        ({"params": {"a": {1}}}, PlanError, r"params\.a is of type set"),
        ({"params": {"a": [np.int64(1)]}}, PlanError, r"params\.a\[0\] is of type int64"),
        ({"params": {"a": float("inf")}}, PlanError, r"params\.a is inf"),
        ({"params": {"a": {1: 2}}}, PlanError, r"params\.a has the key 1"),
        ({"ops": Resample((1, 1))}, PlanError, "ops has the wrong type"),
        ({"ops": [Resample((1, 1))]}, PlanError, "ops has the wrong type.*a tuple"),
        ({"ops": ("paste",)}, PlanError, r"ops\[0\] has the wrong type: 'paste'"),
        ({"effects": (5,)}, PlanError, r"effects\[0\] has the wrong type"),
        ({"notes": "note"}, PlanError, "notes has the wrong type"),
    ],
)
def test_a_plan_of_wrong_parts_cannot_be_made(values, error, message):
    with pytest.raises(error, match=message):
        Plan(**{"corruption": "test-v1", "size": (4, 5), **values})


@pytest.mark.parametrize(
    "make",
    [
        lambda: Effect(5),
        lambda: Effect("lock", 5),
        lambda: Effect("lock", {"a": {2}}),
        lambda: Paste(5, ()),
        lambda: Paste(MARK, [(1, 2)]),
        lambda: Resample("ab"),
        lambda: Resample((0, 1)),
        lambda: Resample(5),
    ],
)
def test_parts_of_the_wrong_type_cannot_be_made(make):
    with pytest.raises(HijackError):
        make()


def test_sizes_of_numpy_are_plain_integers_in_a_plan():
    plan = Plan("test-v1", tuple(np.array([4, 5])), ops=(Resample(tuple(np.array([6, 7]))),))
    assert Plan.from_json(plan.to_json()) == plan


def test_only_plans_are_joined():
    with pytest.raises(ParameterTypeError, match=r"Plan\.then takes a Plan, got dict"):
        Plan.clean((4, 5)).then({})


# --- the digest names what is in the plan


def changes(params):
    """Every way to change a dictionary, and the lists and dictionaries in it."""
    numbers, deep = params["step"], params["deep"]
    return [
        lambda: params.__setitem__("color", "blue"),
        lambda: params.__delitem__("color"),
        lambda: params.update(color="blue"),
        lambda: params.setdefault("new", 1),
        lambda: params.pop("color"),
        lambda: params.popitem(),
        lambda: params.clear(),
        lambda: params.__ior__({"color": "blue"}),
        lambda: deep.update(a=1),
        lambda: numbers.append(3),
        lambda: numbers.extend([3]),
        lambda: numbers.insert(0, 3),
        lambda: numbers.__setitem__(0, 3),
        lambda: numbers.__delitem__(0),
        lambda: numbers.__iadd__([3]),
        lambda: numbers.__imul__(2),
        lambda: numbers.pop(),
        lambda: numbers.remove(1),
        lambda: numbers.clear(),
        lambda: numbers.reverse(),
        lambda: numbers.sort(),
        lambda: deep["a"].append(3),
    ]


def frozen_plans() -> list[Plan]:
    plan = Plan.from_data(valid_plan())
    copies = [pickle.loads(pickle.dumps(plan)), copy.deepcopy(plan), copy.copy(plan)]
    return [plan, *copies, dataclasses.replace(plan, notes=())]


@pytest.mark.parametrize("which", range(5))
def test_parameters_cannot_be_changed(which):
    plan = frozen_plans()[which]
    digest = plan.digest()
    for change in changes(plan.params):
        with pytest.raises(ParameterTypeError, match="cannot be changed"):
            change()
    with pytest.raises(ParameterTypeError, match="cannot be changed"):
        plan.effects[0].params["after"].append(1)
    assert plan.digest() == digest


def test_what_a_plan_was_made_from_may_change():
    params, inner = {"step": [1, 2]}, {"after": [1]}
    plan = Plan("test-v1", (4, 5), params, effects=(Effect("lock", inner),))
    before = plan.digest()
    params["step"].append(3)
    params["new"] = 1
    inner["after"].append(2)
    assert plan.digest() == before


def test_parameters_are_plain_data_to_whoever_reads_them():
    plan = Plan("test-v1", (4, 5), {"step": (1, 2), "deep": {"a": [None]}})
    assert plan.params == {"step": [1, 2], "deep": {"a": [None]}}
    assert json.loads(json.dumps(plan.params)) == plan.params
    assert pickle.loads(pickle.dumps(plan)) == plan == copy.deepcopy(plan)
    assert Plan.from_json(plan.to_json()) == plan
    data = plan.to_data()
    data["params"]["step"].append(5)
    data["params"]["deep"]["a"] = 7
    assert plan.params == {"step": [1, 2], "deep": {"a": [None]}}
    entries = dict(plan.params)
    entries["step"] = 5
    assert dataclasses.asdict(plan)["params"] == plan.params
