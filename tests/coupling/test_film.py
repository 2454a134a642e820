"""A resin film that sinks into the textile: exact times, nothing lost, nothing over-full."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.coupling.infiltration.flow.film import film_conductance, impregnate
from lcmchain.errors import InputError

PHI, MU, K3, DP, THICKNESS = 0.5, 0.1, 2e-12, 1e5, 2e-3
TIME = PHI * MU * THICKNESS**2 / (2.0 * K3 * DP)  # 0.5 s
COLUMN = {
    "thickness": THICKNESS, "porosity": PHI, "permeability": K3, "viscosity": MU, "pressure": DP,
}  # fmt: skip


def test_a_column_is_through_after_the_closed_time_in_any_steps():
    assert pytest.approx(0.5, rel=1e-12) == TIME
    for count in (1, 7, 1000):
        depth, film = np.zeros(1), np.full(1, 5e-3)
        for _ in range(count):
            state = impregnate(depth, film, **COLUMN, step=0.999 * TIME / count)
            depth, film = state.depth, state.film
        assert np.isinf(state.time_through[0])
        assert depth[0] == pytest.approx(THICKNESS * np.sqrt(0.999), rel=1e-12)
        state = impregnate(depth, film, **COLUMN, step=0.01 * TIME)
        assert state.time_through[0] == pytest.approx(0.001 * TIME, rel=1e-9)
        assert state.depth[0] == THICKNESS
        assert state.film[0] == pytest.approx(5e-3 - PHI * THICKNESS, rel=1e-12)


def test_half_the_depth_takes_a_quarter_of_the_time():
    state = impregnate(np.zeros(1), np.ones(1), **COLUMN, step=0.25 * TIME)
    assert state.depth[0] == pytest.approx(0.5 * THICKNESS, rel=1e-12)
    assert state.passed[0] == pytest.approx(0.5 * THICKNESS * PHI, rel=1e-12)


def test_a_thin_film_is_used_up_to_nothing_and_stops():
    film = 0.3 * PHI * THICKNESS
    state = impregnate(np.zeros(1), np.full(1, film), **COLUMN, step=10.0 * TIME)
    assert state.film[0] == 0.0
    assert state.depth[0] == pytest.approx(0.3 * THICKNESS, rel=1e-12)
    assert np.isinf(state.time_through[0])
    later = impregnate(state.depth, state.film, **COLUMN, step=10.0 * TIME)
    assert later.depth[0] == state.depth[0] and later.passed[0] == 0.0


def test_a_column_that_is_through_takes_nothing_more():
    state = impregnate(np.full(1, THICKNESS), np.ones(1), **COLUMN, step=TIME)
    assert (state.passed[0], state.film[0], state.time_through[0]) == (0.0, 1.0, 0.0)


def test_capillary_pressure_adds_to_the_pressure_and_may_hold_the_resin_back():
    drawn = impregnate(
        np.zeros(1), np.ones(1), **{**COLUMN, "pressure": 0.4 * DP}, capillary_pressure=0.6 * DP,
        step=0.25 * TIME,
    )  # fmt: skip
    assert drawn.depth[0] == pytest.approx(0.5 * THICKNESS, rel=1e-12)
    held = impregnate(np.zeros(1), np.ones(1), **COLUMN, capillary_pressure=-2.0 * DP, step=TIME)
    assert held.depth[0] == 0.0 and held.film[0] == 1.0 and np.isinf(held.time_through[0])


def test_gelled_resin_stays_where_it_is():
    state = impregnate(np.full(1, 1e-4), np.ones(1), **{**COLUMN, "viscosity": np.inf}, step=1e6)
    assert state.depth[0] == 1e-4 and state.passed[0] == 0.0


positive = st.floats(1e-3, 1.0)


@given(
    st.lists(st.tuples(positive, positive, positive, st.floats(0.0, 1.0)), min_size=1, max_size=5),
    st.lists(st.floats(0.0, 2.0), min_size=1, max_size=30),
)
def test_film_and_textile_keep_the_resin(columns, steps):
    film, porosity, push, start = (np.array(values) for values in zip(*columns, strict=True))
    film, depth = film * 4e-3, start * THICKNESS
    porosity = 0.2 + 0.7 * porosity
    total = film + porosity * depth
    entered = np.zeros(len(film))
    for step in steps:
        state = impregnate(
            depth, film, **{**COLUMN, "porosity": porosity, "pressure": push * DP}, step=step * TIME
        )
        assert np.all(state.depth >= depth) and np.all(state.depth <= THICKNESS)
        assert np.all(state.film >= 0.0)
        depth, film, entered = state.depth, state.film, entered + state.passed
    np.testing.assert_allclose(film + porosity * depth, total, rtol=1e-13)
    np.testing.assert_allclose(entered, porosity * (depth - start * THICKNESS), atol=1e-15)


def test_the_conductance_is_that_of_an_evenly_drained_column():
    # Solve (K/mu) p'' = q/h with p = 0 on top and no flow at the bottom, and take the mean.
    count = 4000
    height = (np.arange(count) + 0.5) * THICKNESS / count
    drained = 3e-6  # [m/s]
    pressure = -(MU / K3) * drained * (height - 0.5 * height**2 / THICKNESS)
    assert drained / -pressure.mean() == pytest.approx(
        film_conductance(THICKNESS, K3, MU), rel=1e-6
    )


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"thickness": 0.0}, "thickness"),
        ({"porosity": -0.1}, "porosity"),
        ({"permeability": 0.0}, "permeability"),
        ({"viscosity": np.nan}, "viscosity"),
        ({"depth": -1e-6}, "depth"),
        ({"depth": 1.1 * THICKNESS}, "depth"),
        ({"film": -1e-6}, "film"),
    ],
)
def test_impossible_columns_are_refused(change, what):
    with pytest.raises(InputError, match=what):
        impregnate(**{"depth": np.zeros(2), "film": np.zeros(2), **COLUMN, "step": 1.0, **change})
