"""Numbers at indices, loaded by vectors: the same as one by one, for any indices."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lcmchain.elements.blocks import LANES, SCATTERED, find_runs, load_vectors
from lcmchain.jit import routine
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text

SIZE = 50
STEP = 60
BEHIND = -7.0


@routine
def loaded(values, step, indices, runs, out):
    for k in range(indices.size // LANES):
        load_vectors(values, step, indices, k * LANES, runs, k, out, 3 * k * LANES)


def runs_of(starts: list[int], turns: list[int]) -> np.ndarray:
    """16 indices in runs, a new one from each of the turns on."""
    which = np.searchsorted(turns, np.arange(LANES), side="right")
    return np.take(starts, which) + np.arange(LANES) - np.take([0, *turns], which)


indices_in_runs = st.integers(1, 4).flatmap(
    lambda count: st.builds(
        runs_of,
        st.lists(st.integers(0, SIZE - LANES), min_size=count, max_size=count),
        st.lists(
            st.integers(1, LANES - 1), min_size=count - 1, max_size=count - 1, unique=True
        ).map(sorted),
    )
)
scattered = st.lists(st.integers(0, SIZE - 1), min_size=LANES, max_size=LANES).map(np.array)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(indices_in_runs | scattered, min_size=1, max_size=6), st.sampled_from([(-1,), (4, -1)])
)
def test_loads_are_those_of_the_indices(rows, shape):
    indices = np.array(rows, dtype=np.int32)
    values = np.arange(2.0 * STEP + SIZE + 10.0).reshape(shape)
    out = np.full((len(rows) + 1, 3, LANES), BEHIND)
    loaded(values, STEP, indices.ravel(), find_runs(indices).ravel(), out.ravel())
    for d in range(3):
        np.testing.assert_array_equal(out[:-1, d], values.ravel()[indices + d * STEP])
    assert (out[-1] == BEHIND).all()


@settings(max_examples=200, deadline=None)
@given(st.lists(indices_in_runs | scattered, min_size=1, max_size=6))
def test_runs_stay_within_what_the_indices_span(rows):
    indices = np.array(rows, dtype=np.int32)
    runs = find_runs(indices)
    whole = runs[runs[:, 0] != SCATTERED]
    assert (whole[:, :2] >= 0).all()
    assert (whole[:, :2] + LANES <= indices.max() + 1).all()


def test_two_runs_are_found_and_more_are_not():
    rows = {
        "one": (runs_of([20], []), [20, 20, LANES]),
        "two": (runs_of([20, 9], [7]), [20, 2, 7]),
        "last lane": (runs_of([20, 40], [15]), [20, 25, 15]),
        "three": (runs_of([20, 9, 30], [7, 11]), None),
        "begins below 0": (runs_of([20, 1], [7]), None),
        "ends behind all": (runs_of([46, 9], [4]), None),
    }
    runs = find_runs(np.array([indices for indices, _ in rows.values()]))
    for found, (name, (_, known)) in zip(runs.tolist(), rows.items(), strict=True):
        assert found == known if known else found[0] == SCATTERED, name


SHEET = """
process = { time = "1 ms" }
blank = { size = ["140 mm", "120 mm"], edge_length = "4 mm" }
material = { preset = "MD600" }
tools = []
"""


def test_a_sheet_numbered_by_rows_is_loaded_by_vectors():
    model = build_model(scene_from_text(SHEET))
    for runs in (model.only_body().data.corner_run, model.fibre_bending.data.runs):
        whole = runs.reshape(-1, 3)[:, 0] != SCATTERED
        assert whole.mean() > 0.5
