"""Every node of a combinator draws from a stream of its own path: odds multiply, and no two parts
coincide."""

import math
import os
import pickle
import subprocess
import sys
from collections import Counter

import pytest
from scipy.stats import chisquare

import hijack_data as hj
from hijack_data.config import load_config
from hijack_data.errors import ParameterError, ParameterTypeError
from hijack_data.rng import Branch, Stream, branch

SCREEN = hj.Scene(size=(360, 640))
SAMPLES = 2000
COLORS = ("red", "blue", "lime", "black")


def mark(color="red", number=1):
    return hj.Marks(color=color, number=number)


def pair(*colors, **more):
    return hj.OneOf([mark(color) for color in colors], **more)


def count_colors(planner, samples=SAMPLES):
    """What each sample got: the colour of its marks, or that it stayed clean."""
    plans = [planner.plan(SCREEN, seed=1, sample=i) for i in range(samples)]
    return Counter(str(plan.params.get("color", "clean")) for plan in plans)


def nested(depth):
    """A tree of pairs whose leaves are all of the colours, each as likely."""
    if depth == 1:
        return [pair("red", "blue"), pair("lime", "black")]
    return [hj.OneOf(nested(depth - 1)), hj.OneOf(nested(depth - 1))]


SCHEDULED = hj.Schedule(lambda _: hj.OneOf([pair("red", "blue"), pair("lime", "black")]))
WEIGHTED = hj.OneOf([pair("red", "blue", weights=[3, 1]), pair("lime", "black")], weights=[2, 1])
INNER = "one_of: {options: [marks: {color: %s, number: 1}, marks: {color: %s, number: 1}]%s}"
FIRST, SECOND = INNER % ("red", "blue", ""), INNER % ("lime", "black", "")
LABELLED = INNER % ("red", "blue", ", as: one"), INNER % ("lime", "black", ", as: two")


@pytest.mark.parametrize(
    ("planner", "odds"),
    [
        (hj.OneOf(nested(1)), dict.fromkeys(COLORS, 1 / 4)),
        (hj.OneOf(nested(3)), dict.fromkeys(COLORS, 1 / 4)),
        (hj.OneOf([SCHEDULED]), dict.fromkeys(COLORS, 1 / 4)),
        (hj.Sequence([hj.OneOf(nested(1))]), dict.fromkeys(COLORS, 1 / 4)),
        (WEIGHTED, {"red": 1 / 2, "blue": 1 / 6, "lime": 1 / 6, "black": 1 / 6}),
        (hj.OneOf([pair("red", p_clean=0.5)], p_clean=0.5), {"clean": 3 / 4, "red": 1 / 4}),
        (
            hj.OneOf([pair("red", p_clean=0.5), pair("blue", p_clean=0.2)], p_clean=0.2),
            {"clean": 0.2 + 0.8 * 0.35, "red": 0.2, "blue": 0.32},
        ),
    ],
)
def test_every_leaf_is_reached_with_its_odds(planner, odds):
    counts = count_colors(planner)
    assert set(counts) == set(odds)
    expected = [SAMPLES * odds[name] for name in counts]
    assert chisquare(list(counts.values()), expected).pvalue > 1e-4


def test_trees_written_in_yaml_reach_every_leaf(tmp_path):
    file = tmp_path / "tree.yaml"
    file.write_text(f"corruptions: [one_of: {{options: [{FIRST}, {SECOND}]}}]")
    (tree,) = load_config(file).corruptions.values()
    assert chisquare([count_colors(tree)[color] for color in COLORS]).pvalue > 1e-4


def test_transforms_reach_every_leaf(tmp_path):
    tr = pytest.importorskip("hijack_data.transforms")
    file = tmp_path / "two.yaml"
    file.write_text(f"corruptions: [{', '.join(LABELLED)}]")
    configured = tr.FromConfig(file)
    nested_twice = tr.OneOf(
        [tr.OneOf([mark("red"), mark("blue")]), tr.OneOf([mark("lime"), mark("black")])]
    )
    for transform in (configured, nested_twice):
        counts = count_colors(transform.settings.planner)
        assert chisquare([counts[color] for color in COLORS]).pvalue > 1e-4


def test_the_draws_of_a_transform_have_one_pickle_in_every_process():
    code = (
        "import pickle, hijack_data as hj\n"
        "from hijack_data.chained_draws import find_draws\n"
        "half = hj.OneOf([hj.Marks(), hj.Resolution()], p_clean=0.5)\n"
        "print(pickle.dumps(find_draws(hj.OneOf([half, half], p_clean=0.5), 3, 'id')))"
    )
    pickles = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": hash_seed},
            capture_output=True,
            check=True,
        ).stdout
        for hash_seed in "123"
    }
    assert len(pickles) == 1


def wrapped():
    """One mark, wrapped in every way."""
    return [
        mark(),
        mark("blue"),
        hj.OneOf([mark()]),
        hj.OneOf([mark(), mark()]),
        hj.OneOf([hj.OneOf([mark()])]),
        hj.Sequence([mark()]),
        hj.Sequence([hj.Sequence([mark()])]),
        hj.Schedule(lambda _: mark()),
        hj.Schedule(lambda _: hj.OneOf([mark()])),
    ]


def test_parts_of_a_sequence_never_coincide():
    places = Counter()
    tree = hj.Sequence([*wrapped(), hj.Sequence(wrapped())])
    for sample in range(30):
        ops = tree.plan(SCREEN, seed=1, sample=sample).ops
        assert len(ops) == 18
        places.update(op.at for op in ops)
    # 16,000 places for a mark: some few of the 4,590 pairs of a sample may meet by chance, none
    # does as a rule.
    assert max(places.values()) <= 3


@pytest.mark.parametrize("number", range(3))
def test_keys_of_parts_cannot_be_sample_ids(number):
    tree = hj.Sequence([mark(), mark(), mark()])
    part = tree.plan(SCREEN, seed=1, sample="x").ops[number].at
    key = branch("x", number)
    for text in (f"x#{number}", f"x~{number}", f"x/{number}", str(key), f"{number}\nx", "x"):
        assert Stream(1, "marks-v1", text).word() != Stream(1, "marks-v1", key).word()
        assert mark().plan(SCREEN, seed=1, sample=text).ops[0].at != part


def test_tries_of_plan_avoiding_have_streams_of_their_own():
    target = (0, 0, 640, 360)
    calls = []

    class Spy(hj.Marks):
        def plan(self, scene, *, sample, **key):
            calls.append(Stream(1, self.id, sample).word())
            return super().plan(scene, sample=sample, **key)

    assert (
        hj.plugin.plan_avoiding(
            Spy(number=3), hj.Scene((360, 640), target=target), seed=1, sample="x"
        )
        is None
    )
    assert len(set(calls)) == 16
    assert calls[0] == Stream(1, "marks-v1", "x").word()
    assert not set(calls) & {Stream(1, "marks-v1", f"x~{i}").word() for i in range(20)}


def test_a_corruption_alone_draws_from_the_plain_stream():
    plan = mark().plan(SCREEN, seed=1, sample="x")
    assert plan != hj.Sequence([mark()]).plan(SCREEN, seed=1, sample="x")
    stream = Stream(1, "marks-v1", "x")
    draft = mark().make_plan(SCREEN, stream, 0)
    assert draft.ops == plan.ops


def test_branches_are_strings_that_travel():
    key = branch(branch(3, 1), "try 2")
    assert (key.sample, key.path) == ("3", ("1", "try 2"))
    for copy in (pickle.loads(pickle.dumps(key)), branch(branch("3", 1), "try 2")):
        assert isinstance(copy, Branch)
        assert (copy, copy.path) == (key, key.path)
        assert Stream(1, "a", copy).word() == Stream(1, "a", key).word()
    assert branch("a", 1) != branch("a", 11)
    assert Stream(1, "a", branch("1\n", 1)).word() != Stream(1, "a", branch("\n", "1")).word()


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: hj.OneOf([None]), ParameterTypeError),
        (lambda: hj.OneOf([mark(), None]), ParameterTypeError),
        (lambda: hj.Sequence([None]), ParameterTypeError),
        (lambda: hj.Sequence([]), ParameterError),
        (lambda: hj.OneOf([hj.Marks]), ParameterTypeError),
        (lambda: hj.OneOf("marks"), ParameterTypeError),
        (lambda: hj.OneOf(5), ParameterTypeError),
        (lambda: hj.Schedule(3), ParameterTypeError),
        (lambda: hj.Schedule(lambda _: None).plan(SCREEN, seed=1), ParameterTypeError),
        (lambda: hj.OneOf([hj.Schedule(lambda _: None)]).plan(SCREEN, seed=1), ParameterTypeError),
        *[
            (lambda p=p: hj.OneOf([mark()], p_clean=p), error)
            for p, error in [
                ("0.5", ParameterTypeError),
                (None, ParameterTypeError),
                (True, ParameterTypeError),
                (1.5, ParameterError),
                (-0.1, ParameterError),
                (math.nan, ParameterError),
            ]
        ],
        *[
            (lambda w=w: hj.OneOf([mark(), mark()], weights=w), error)
            for w, error in [
                ([math.nan, 1], ParameterError),
                ([1, math.nan], ParameterError),
                ([1, math.inf], ParameterError),
                ([1e308, 1e308], ParameterError),
                ([0, 0], ParameterError),
                ([1], ParameterError),
                ([-1, 2], ParameterError),
                ("12", ParameterTypeError),
                (3, ParameterTypeError),
                (["1", "2"], ParameterTypeError),
                ((w for w in (1, 2)), ParameterTypeError),
                ([True, False], ParameterTypeError),
            ]
        ],
        (lambda: mark().plan(SCREEN, seed=1, sample=10**5000), ParameterError),
        (lambda: hj.Sequence([mark()]).plan(SCREEN, seed=1, sample=10**5000), ParameterError),
        (lambda: hj.Sequence([mark()]).plan(SCREEN, seed=1, sample=1.5), ParameterTypeError),
    ],
)
def test_what_cannot_be_combined_is_refused_at_once(make, error):
    with pytest.raises(error):
        make()
