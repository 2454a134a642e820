"""Rows of a span of nodes: what is copied into them and back, of full spans and of the last one."""

import numpy as np
import pytest

from lcmchain.tools.span_rows import SPAN, load_row, load_rows, store_row, store_rows

ROWS = 5


@pytest.mark.parametrize(
    ("first", "count"), [(0, SPAN), (SPAN, SPAN), (2 * SPAN, 3), (2 * SPAN, 1)]
)
def test_rows_are_copied_there_and_back(first, count):
    nodes = 2 * SPAN + count % SPAN
    values = np.random.default_rng(1).normal(size=(3, nodes))
    work = np.full(ROWS * SPAN, np.nan)
    load_rows(values, first, count, 1, work)
    rows = work.reshape(ROWS, SPAN)
    np.testing.assert_array_equal(rows[1:4, :count], values[:, first : first + count])
    # those that are missing are like the last one
    missing = np.tile(values[:, -1:], SPAN - count)
    np.testing.assert_array_equal(rows[1:4, count:], missing)
    assert np.isnan(rows[[0, 4]]).all()

    expected = values.copy()
    expected[:, first : first + count] += 1.0
    work += 1.0
    store_rows(work, 1, values, first, count)
    np.testing.assert_array_equal(values, expected)


@pytest.mark.parametrize("count", [SPAN, 5])
def test_one_row_lies_behind_others_in_memory(count):
    values = np.arange(4.0 * SPAN + count)
    work = np.full(2 * SPAN, -1.0)
    load_row(values, 4 * SPAN, count, 1, work)
    np.testing.assert_array_equal(work[SPAN : SPAN + count], values[4 * SPAN :])
    work[SPAN:] *= 2.0
    store_row(work, 1, values, 4 * SPAN, count)
    np.testing.assert_array_equal(values[: 4 * SPAN], np.arange(4.0 * SPAN))
    np.testing.assert_array_equal(
        values[4 * SPAN :], 2.0 * np.arange(4.0 * SPAN, 4.0 * SPAN + count)
    )
