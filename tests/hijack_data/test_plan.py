"""Plans are data: exact round trips, and damage is noticed."""

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.errors import PlanError
from hijack_data.gallery.reproduce import python_call
from hijack_data.plan import MAX_SIDE, Paste, Plan, Resample

MARK = {"draw": "mark", "shape": "circle", "size": 5, "color": "blue"}
points = st.tuples(st.integers(-50, 3000), st.integers(-50, 3000))
ops = st.one_of(
    st.builds(lambda at: Paste(MARK, tuple(at)), st.lists(points, max_size=5)),
    st.builds(lambda h, w: Resample((h, w)), st.integers(1, 4000), st.integers(1, 4000)),
)
json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)
plans = st.builds(
    Plan,
    corruption=st.text(min_size=1, max_size=20),
    size=st.tuples(st.integers(1, 5000), st.integers(1, 5000)),
    params=st.dictionaries(st.text(), json_values, max_size=4),
    ops=st.lists(ops, max_size=3).map(tuple),
    effects=st.lists(
        st.builds(hj.plugin.Effect, st.text(), st.dictionaries(st.text(), json_values)), max_size=2
    ).map(tuple),
    notes=st.lists(st.text(), max_size=2).map(tuple),
)


@given(plans)
def test_json_round_trip_is_exact(plan):
    again = Plan.from_json(plan.to_json())
    assert again == plan
    assert again.to_json() == plan.to_json()
    assert again.digest() == plan.digest()


@given(plans, st.data())
def test_a_changed_character_is_noticed(plan, data):
    text = plan.to_json()
    at = data.draw(st.integers(0, len(text) - 1))
    letter = data.draw(st.sampled_from("0123456789abcxyz"))
    edited = text[:at] + letter + text[at + 1 :]
    if not says_the_same(edited, text):
        with pytest.raises(PlanError, match=r"^plan[.:]"):
            Plan.from_json(edited)


def says_the_same(edited: str, text: str) -> bool:
    """Whether both texts are the same JSON: the last digits of a long number can be beyond what a
    float holds."""
    try:
        return json.dumps(json.loads(edited)) == json.dumps(json.loads(text))
    except ValueError:
        return False


def sealed(**changes) -> str:
    """A plan with some fields changed and the digest made right again."""
    from hijack_data.plan import _digest

    data = json.loads(hj.Marks(number=2).plan(hj.Scene(size=(100, 200)), seed=1).to_json())
    del data["digest"]
    data.update(changes)
    return json.dumps({**data, "digest": _digest(data)})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 2}, "version 2 is newer"),
        ({"version": "1"}, "version '1'"),
        ({"format": "other"}, "not an AgentHijack plan"),
        ({"size": [0, 5]}, "must be at least"),
        ({"size": [MAX_SIDE + 1, 5]}, "beyond"),
        ({"size": "big"}, "size"),
        ({"ops": [{"op": "explode"}]}, r"ops\[0\].op = 'explode'"),
        ({"ops": [{"op": "resample", "size": [5, 5], "filter": "box"}]}, "only 'bicubic'"),
        (
            {"ops": [{"op": "paste", "sprite": {}, "at": [[1, 2, 3]], "fingerprint": "0" * 16}]},
            "wrong type",
        ),
        (
            {"ops": [{"op": "paste", "sprite": {}, "at": [[1.5, 2]], "fingerprint": "0" * 16}]},
            "pixel coordinates",
        ),
        ({"ops": [{"op": "paste", "sprite": {}, "at": [], "fingerprint": "xyz"}]}, "fingerprint"),
        ({"ops": 7}, "wrong type"),
        ({"effects": [{}]}, "missing"),
    ],
)
def test_wrong_fields_are_named(changes, message):
    with pytest.raises(PlanError, match=message):
        Plan.from_json(sealed(**changes))


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "null", "3", '{"format": 1}', "[" * 100_000, b"\xff\xfe"]
)
def test_not_a_plan(text):
    with pytest.raises(PlanError, match="plan: not"):
        Plan.from_json(text)


def test_a_missing_field_is_named():
    data = json.loads(sealed())
    for key in ("corruption", "size", "ops", "notes"):
        broken = {k: v for k, v in data.items() if k not in (key, "digest")}
        from hijack_data.plan import _digest

        with pytest.raises(PlanError, match=key):
            Plan.from_data({**broken, "digest": _digest(broken)})


def test_a_drawing_that_would_differ_is_refused(noise):
    text = sealed()
    result = Plan.from_json(text)
    drifted = Plan(
        result.corruption, result.size, result.params, (Paste(MARK, ((3, 3),), "0123456789abcdef"),)
    )
    with pytest.raises(PlanError, match="draws differently here"):
        hj.apply(drifted, noise[:100, :200])


@pytest.mark.parametrize(
    "sprite",
    [
        {"draw": "mark", "shape": "blob", "size": 5, "color": "red"},
        {"draw": "mark", "shape": "star"},
        {"draw": "hologram"},
        {"draw": "png", "data": "!!!"},
        {"draw": "png", "data": "AAAA"},
        {"draw": "mark", "shape": "star", "size": 10**9, "color": "red"},
        {
            "draw": "text",
            "lines": ["x"],
            "font": "DejaVuSans",
            "size": 10**7,
            "color": "red",
            "edge_color": "red",
        },
        {
            "draw": "window",
            "size": [10**6, 10**6],
            "edge": 1,
            "panels": [],
            "font": "DejaVuSans",
            "edge_color": "red",
        },
    ],
)
def test_a_recipe_that_cannot_be_drawn(sprite):
    from hijack_data.drawing.raster import render

    with pytest.raises(hj.HijackError, match="plan: "):
        render(sprite)


def test_joining_plans():
    screen = hj.Scene(size=(400, 600))
    small, marks = hj.Resolution().plan(screen, seed=1), hj.Marks(number=3).plan(screen, seed=1)
    with pytest.raises(PlanError, match="cannot join"):
        small.then(marks)
    combined = marks.then(small)
    assert combined.corruption == "marks-v1+resolution-v2"
    assert set(combined.params) == {"marks-v1", "resolution-v2"}
    assert combined.out_size == (200, 300)
    clean = Plan.clean((400, 600))
    assert clean.then(marks) == marks == marks.then(clean)


def test_one_corruption_twice_keeps_both_its_parameters():
    screen = hj.Scene(size=(400, 600))
    few, many = hj.Marks(number=3), hj.Marks(number=7)
    planner = hj.Sequence([few, many, hj.Marks()])
    joined = planner.plan(screen, seed=1)
    assert [params["number"] for _, params in joined.parts] == [3, 7, 50]
    assert dict(joined.params) == planner.params()
    assert Plan.from_json(joined.to_json()).parts == joined.parts
    assert "number=3" in python_call(joined, screen, 1, 0)
    lacking = replace(joined, params={"marks-v1": joined.params["marks-v1"]})
    with pytest.raises(PlanError, match=r"params\.marks-v1#2"):
        _ = lacking.parts


def test_a_plan_names_the_corruption_that_made_it():
    spec = hj.Marks(number=7, color="blue")
    assert hj.from_plan(spec.plan(hj.Scene(size=(400, 600)), seed=1)) == spec
    spec = hj.AppMinimization(step=hj.plugin.Every(4))
    assert hj.from_plan(spec.plan(hj.Scene(size=(400, 600)), seed=1)) == spec
