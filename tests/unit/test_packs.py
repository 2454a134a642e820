"""Packs of eight numbers: the same as NumPy makes of arrays of eight."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.jit import entry
from lcmchain.packs import (
    PACK,
    all_lanes,
    any_lane,
    choose,
    first_lanes,
    load,
    load_first,
    store,
    store_first,
    sum_of,
)

NUMBERS = st.lists(st.floats(-1e6, 1e6), min_size=PACK, max_size=PACK).map(np.array)


@entry
def reckon(a, b, number, out):
    """Write everything that packs know into rows of ``out``."""
    x, y = load(a, 0), load(b, 0)
    store(out[0], 0, x + y)
    store(out[1], 0, x - y)
    store(out[2], 0, x * y)
    store(out[3], 0, x / (1.0 + abs(y)))
    store(out[4], 0, -x)
    store(out[5], 0, max(x, y))
    store(out[6], 0, min(x, y))
    store(out[7], 0, math.sqrt(abs(x)))
    store(out[8], 0, number - x)
    store(out[9], 0, max(number, x))
    store(out[10], 0, choose(x < y, x, 0.0))
    store(out[11], 0, choose((x <= y) & (x != number), 1.0, y))
    store(out[12], 0, choose((x > y) | (number >= x), x, y))
    x += 1.0
    x *= y
    store(out[13], 0, x)
    store(out[14], 0, choose(number > 0.0, x, y))


@given(a=NUMBERS, b=NUMBERS, number=st.floats(-10.0, 10.0))
def test_packs_reckon_as_arrays_do(a, b, number):
    out = np.empty((15, PACK))
    reckon(a, b, number, out)
    expected = [
        a + b, a - b, a * b, a / (1.0 + abs(b)), -a, np.maximum(a, b), np.minimum(a, b),
        np.sqrt(abs(a)), number - a, np.maximum(number, a), np.where(a < b, a, 0.0),
        np.where((a <= b) & (a != number), 1.0, b), np.where((a > b) | (number >= a), a, b),
        (a + 1.0) * b, (a + 1.0) * b if number > 0.0 else b,
    ]  # fmt: skip
    np.testing.assert_allclose(out, expected, rtol=1e-15, atol=0.0)


@entry
def ask(a, b, count):
    x, y = load(a, 0), load(b, 0)
    return any_lane(x < y), all_lanes(x < y), any_lane(first_lanes(count) & (x < y)), sum_of(x)


@pytest.mark.parametrize("lanes", [[], [0], [7], [3, 4], list(range(8))])
def test_lanes_answer_together(lanes):
    a, b = np.arange(1.0, 1.0 + PACK), np.zeros(PACK)
    b[lanes] = 100.0
    for count in range(PACK + 1):
        some, every, some_first, total = ask(a, b, count)
        assert some == bool(lanes) and every == (len(lanes) == PACK)
        assert some_first == any(lane < count for lane in lanes)
        assert total == a.sum()


def test_nothing_is_smaller_than_no_number():
    """As of numbers: only "not equal" holds of what is none."""
    a = np.full(PACK, np.nan)
    assert ask(a, a + 1.0, PACK)[:2] == (False, False)
    out = np.empty((15, PACK))
    reckon(a, np.ones(PACK), 1.0, out)
    assert (out[10] == 0.0).all() and (out[12] == 1.0).all()


@entry
def copy_first(source, target, place, count):
    store_first(target, place, load_first(source, place, count) + 1.0, count)


@entry
def copy_with_rest(source, target, place, count):
    store(target, 0, load_first(source, place, count))


@pytest.mark.parametrize("count", range(PACK + 1))
def test_the_first_numbers_are_written_and_no_more(count):
    source, target = np.arange(20.0), np.full(20, -7.0)
    copy_first(source, target, 5, count)
    expected = np.full(20, -7.0)
    expected[5 : 5 + count] = source[5 : 5 + count] + 1.0
    np.testing.assert_array_equal(target, expected)
    copy_with_rest(source, target, 5, count)
    zeros = np.zeros(PACK - count)
    np.testing.assert_array_equal(target[:PACK], [*source[5 : 5 + count], *zeros])


def test_rows_of_an_array_are_read_in_the_order_of_memory():
    source, target = np.arange(40.0).reshape(4, 10), np.zeros(40)
    copy_first(source, target, 8, PACK)
    np.testing.assert_array_equal(target[8:16], np.arange(9.0, 17.0))


def test_a_choice_in_python_is_one_of_two():
    assert choose(True, 1.0, 2.0) == 1.0 and choose(False, 1.0, 2.0) == 2.0
