"""Streams depend on their key alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.errors import ParameterError, ParameterTypeError
from hijack_data.rng import Stream

GOLDEN_WORDS = [
    6134859213362261477,
    16228907376107358674,
    2263286470438944939,
    13982217205916788540,
]


def words(*key, count=4):
    stream = Stream(*key)
    return [stream.word() for _ in range(count)]


def test_the_words_are_fixed_forever():
    assert words(7, "marks-v1", "traj-3", 0, 0) == GOLDEN_WORDS


@given(st.integers(0, 2**64 - 1), st.text(), st.integers(-5, 1000), st.integers(0, 100))
def test_same_key_same_words(seed, sample, step, epoch):
    assert words(seed, "a", sample, step, epoch) == words(seed, "a", sample, step, epoch)


def test_every_part_of_the_key_matters():
    base = (1, "marks-v1", "x", 2, 3)
    remaining = [
        (2, *base[1:]),
        (1, "marks-v2", "x", 2, 3),
        (1, "marks-v1", "y", 2, 3),
        (*base[:3], 3, 3),
        (*base[:4], 4),
    ]
    assert len({tuple(words(*key)) for key in [base, *remaining]}) == 6


def test_step_and_epoch_do_not_run_into_each_other():
    assert words(1, "a", "x", 0, 1) != words(1, "a", "x", 1, 0)
    assert words(1, "a", "x", -1, 0) != words(1, "a", "x", 2**31 - 1, 0)


def test_numbers_and_their_text_are_one_sample():
    assert words(1, "a", 3) == words(1, "a", "3") == words(1, "a", np.int64(3))


@given(st.integers(-100, 100), st.integers(0, 1000), st.integers(0, 50))
def test_integers_stay_in_range(low, span, seed):
    stream = Stream(seed, "a")
    assert all(low <= stream.integer(low, low + span) <= low + span for _ in range(20))


def test_integers_are_uniform():
    stream = Stream(5, "a")
    counts = np.bincount([stream.integer(0, 9) for _ in range(20000)], minlength=10)
    assert abs(counts - 2000).max() < 200


def test_fractions_are_in_the_unit_interval():
    stream = Stream(5, "a")
    values = [stream.random() for _ in range(5000)]
    assert min(values) >= 0
    assert max(values) < 1
    assert abs(np.mean(values) - 0.5) < 0.02


@pytest.mark.parametrize("seed", [-1, 2**64])
def test_seed_out_of_range(seed):
    with pytest.raises(ParameterError, match="seed must be in"):
        Stream(seed, "a")


@pytest.mark.parametrize(
    "key", [(1.5, "a"), (True, "a"), (None, "a"), (1, "a", None), (1, "a", 1.0), (1, "a", "x", 1.5)]
)
def test_wrong_types(key):
    with pytest.raises(ParameterTypeError, match="must be an integer"):
        Stream(*key)


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(-50, 50), st.sampled_from([51, 1000, 2**32, 2**62, 2**62 + 2**61])),
        min_size=1,
        max_size=3,
    ),
    st.integers(0, 20),
    st.integers(0, 1000),
)
def test_integers_are_those_drawn_one_by_one(ranges, count, sample):
    """Ranges of 2**62 reject every fourth word: the rest of the stream moves up, and what follows
    is the same, too."""
    stream, many = Stream(3, "a-v1", sample), Stream(3, "a-v1", sample)
    for _ in range(2):
        expected = [[stream.integer(*pair) for pair in ranges] for _ in range(count)]
        assert many.integers(ranges, count).tolist() == expected
    assert stream.word() == many.word()


def test_an_empty_range_among_integers_is_refused():
    with pytest.raises(ParameterError, match=r"empty range \[4, 3\]"):
        Stream(3, "a-v1").integers([(0, 5), (4, 3)], 2)
