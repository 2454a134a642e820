"""Preform that moves: squeeze flow, a front in a closing gap, and volumes that stay."""

import numpy as np
import pytest

from lcmchain.coupling.infiltration.filling import Filling, FillingOptions
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Vent
from lcmchain.coupling.infiltration.flow.film import Film
from lcmchain.coupling.infiltration.flow.preform import Preform
from lcmchain.errors import SimulationError

from .sample_meshes import plate, random_plate

HALF, WIDTH, HEIGHT, SPEED = 0.1, 0.05, 0.003, 1e-5
PERMEABILITY, VISCOSITY = 1e-10, 0.1
GOING_ON = FillingOptions(stop_when_idle=False)


def saturated(mesh):
    ends = np.concatenate([mesh.node_sets["left"], mesh.node_sets["right"]])
    return Filling(
        mesh, Preform(HEIGHT, 0.5, PERMEABILITY), VISCOSITY, [],
        [Vent("ends", ends, closes_when_wet=False)], wetted=np.arange(mesh.node_count),
        options=GOING_ON,
    )  # fmt: skip


@pytest.mark.parametrize("triangles", [False, True])
def test_squeeze_force_of_a_saturated_strip(triangles):
    """F / width = 2 µ |h'| L³ / (3 K h), of both halves together."""
    mesh = plate(40, 4, 2.0 * HALF, WIDTH, triangles=triangles)
    filling = saturated(mesh)
    filling.set_thickness(HEIGHT, -SPEED)
    filling.advance(1e-3)
    force = filling.state.pressure @ filling.medium.node_area / WIDTH
    exact = 2.0 * VISCOSITY * SPEED * HALF**3 / (3.0 * PERMEABILITY * HEIGHT)
    assert force == pytest.approx(exact, rel=1e-2)
    x = mesh.points[:, 0] - HALF
    profile = VISCOSITY * SPEED * (HALF**2 - x**2) / (2.0 * PERMEABILITY * HEIGHT)
    assert np.abs(filling.state.pressure - profile).max() < 1e-2 * profile.max()


def test_squeezed_resin_leaves_at_the_vents():
    mesh = random_plate(0.01, 2.0 * HALF, WIDTH)
    filling = saturated(mesh)
    filling.set_thickness(HEIGHT, -SPEED)
    filling.advance(50.0)
    assert filling.state.thickness == pytest.approx(HEIGHT - 50.0 * SPEED)
    left = 2.0 * HALF * WIDTH * SPEED * 50.0
    assert filling.state.vented.sum() == pytest.approx(left, rel=1e-10)
    assert abs(filling.state.balance_error) <= 1e-10 * filling.state.stored
    assert filling.state.full.all()


def test_front_in_a_closing_gap_keeps_the_resin():
    """No gate: the resin of one half is pressed into the other; x h (1 - v) stays."""
    mesh = plate(40, 2, 2.0 * HALF, WIDTH)
    wet = np.where(mesh.points[:, 0] < HALF - 1e-9, 1.0, 0.0)
    wet[np.abs(mesh.points[:, 0] - HALF) < 1e-9] = 0.5
    filling = Filling(
        mesh, Preform(HEIGHT, 0.5, PERMEABILITY), VISCOSITY, [],
        [Vent("end", mesh.node_sets["right"])], wetted=wet,
    )  # fmt: skip
    start = filling.state.stored

    def kept(filling):
        assert abs(filling.state.stored - start) <= 1e-10 * start
        assert filling.state.fill.max() <= 1.0 and filling.state.fill.min() >= 0.0

    filling.set_thickness(HEIGHT, -SPEED)
    filling.advance(40.0, kept)
    height = HEIGHT - 40.0 * SPEED
    front = HALF * (HEIGHT - 0.5 * HEIGHT) / (height - 0.5 * HEIGHT)
    passed = filling.state.fill_time <= filling.time
    assert mesh.points[passed, 0].max() == pytest.approx(front, abs=2.0 * HALF / 40)
    inside = filling.state.full & (mesh.points[:, 0] < front - 0.01)
    closed = VISCOSITY * SPEED * (front**2 - mesh.points[:, 0] ** 2)
    closed /= 2.0 * filling.medium.factor(filling.state.thickness)[0] * PERMEABILITY * height
    error = np.abs(filling.state.pressure - closed)[inside]
    assert error.max() < 3e-2 * closed.max()


def test_thickness_that_jumps_loses_no_resin():
    mesh = plate(20, 2, 2.0 * HALF, WIDTH)
    filling = Filling(
        mesh, Preform(HEIGHT, 0.5, PERMEABILITY), VISCOSITY,
        [Gate("inlet", mesh.node_sets["left"], pressure=1e5)],
        [Vent("end", mesh.node_sets["right"])],
    )  # fmt: skip
    filling.advance(5.0)
    for height in (0.0029, 0.0028, 0.0031):
        filling.set_thickness(height)
        filling.advance(filling.time + 1.0)
        assert abs(filling.state.balance_error) <= 1e-10 * filling.state.stored
        assert filling.state.fill.max() <= 1.0


def test_moving_and_restoring_is_bit_identical():
    mesh = random_plate(0.02, 2.0 * HALF, WIDTH, seed=1)
    gate = Gate("inlet", mesh.node_sets["left"], pressure=1e5)
    vent = Vent("end", mesh.node_sets["right"])
    states = []
    for detour in (False, True):
        filling = Filling(mesh, Preform(HEIGHT, 0.5, PERMEABILITY), VISCOSITY, [gate], [vent])
        filling.set_thickness(HEIGHT, -SPEED)
        filling.advance(5.0)
        if detour:
            saved = filling.save()
            filling.set_thickness(0.002)
            filling.set_points(mesh.points * 1.01)
            filling.advance(6.0)
            filling.restore(saved)
        filling.advance(12.0)
        states.append(filling.state)
    assert np.array_equal(states[0].resin_volume, states[1].resin_volume)
    assert np.array_equal(states[0].pressure, states[1].pressure)


def test_a_film_fills_columns_that_grow_in_few_steps():
    """What a column lacks by its growth comes with it: else ever shorter steps close the gap."""
    mesh = plate(8, 4, 0.08, 0.04)
    through = 1e-12 * np.random.default_rng(0).uniform(0.8, 1.2, mesh.cell_count)
    filling = Filling(
        mesh, Preform(HEIGHT, 0.5, 1e-10, through), 0.1, [],
        [Vent("end", mesh.node_sets["right"])], film=Film(2.0 * HEIGHT, 1e5),
    )  # fmt: skip
    filling.set_thickness(HEIGHT, rate=HEIGHT / 50.0)
    outcome, _ = filling.advance(10.0)
    state = filling.state
    assert outcome == "reached" and state.full.all()
    assert state.step_count < 100
    assert abs(state.balance_error) <= 1e-10 * state.stored
    on_top = (state.film * filling.medium.node_area).sum()
    assert state.stored + on_top == pytest.approx(2.0 * HEIGHT * mesh.areas.sum(), rel=1e-12)


def test_squeezed_without_a_way_out_is_an_error():
    mesh = plate(6, 2, 2.0 * HALF, WIDTH)
    filling = Filling(
        mesh, Preform(HEIGHT, 0.5, PERMEABILITY), VISCOSITY, [],
        [Vent("end", mesh.node_sets["right"])], wetted=np.arange(mesh.node_count),
    )  # fmt: skip
    filling.set_thickness(HEIGHT, -SPEED)
    with pytest.raises(SimulationError, match="no way in or out"):
        filling.advance(1.0)


def test_fibres_that_fill_a_cell_are_an_error():
    mesh = plate(6, 2, 2.0 * HALF, WIDTH)
    filling = saturated(mesh)
    with pytest.raises(SimulationError, match="cell 0"):
        filling.set_thickness(0.4 * HEIGHT)


def test_a_sheet_that_narrows_squeezes_as_one_that_is_pressed():
    """p(x) = µ |V'|/V (L² - x²) / (2 K), whichever way the volume of the cells shrinks."""
    mesh = plate(40, 4, 2.0 * HALF, WIDTH)
    filling = saturated(mesh)
    share, step = 1e-4, 0.5
    filling.set_points(mesh.points * [1.0, 1.0 - share, 1.0], step)
    filling.advance(1e-3)
    x = mesh.points[:, 0] - HALF
    profile = VISCOSITY * share / step * (HALF**2 - x**2) / (2.0 * PERMEABILITY)
    assert np.abs(filling.state.pressure - profile).max() < 1e-2 * profile.max()
    filling.advance(step)
    assert filling.state.thickness == pytest.approx(HEIGHT, rel=1e-12)
    lost = share * 2.0 * HALF * WIDTH * HEIGHT
    assert filling.state.vented.sum() == pytest.approx(lost, rel=1e-8)


@pytest.mark.parametrize("given", [0.7, None], ids=["at a rate", "at once"])
@pytest.mark.parametrize("triangles", [False, True])
def test_moving_nodes_lose_no_resin_of_sheet_or_film(given, triangles):
    """In plane and out of it, while a film sinks in and spreads: all volumes stay to round-off."""
    mesh = plate(12, 5, 2.0 * HALF, WIDTH, triangles=triangles)
    film = Film(np.where(mesh.points[:, 0] < HALF, 6e-3, 0.0), 2e5)
    filling = Filling(
        mesh, Preform(HEIGHT, 0.5, PERMEABILITY, 1e-12), 0.1 * VISCOSITY, [],
        [Vent("end", mesh.node_sets["right"], closes_when_wet=False)], film=film,
        options=GOING_ON,
    )  # fmt: skip
    start = filling.state.film @ filling.medium.node_area
    x, y = mesh.points[:, 0] / HALF, mesh.points[:, 1] / WIDTH
    for number in range(1, 9):
        a, b = 0.02 * np.sin(number), 0.03 * np.cos(2 * number) - 0.03
        moved = mesh.points + HALF * np.stack([a * x * y, b * y, 0.02 * number * x * x], axis=1)
        filling.set_points(moved, given)
        assert filling.state.film @ filling.medium.node_area + filling.state.stored + (
            filling.state.vented.sum()
        ) == pytest.approx(start, rel=1e-12)
        filling.advance(filling.time + 0.7)
        state = filling.state
        above = state.film @ filling.medium.node_area
        assert above + state.stored + state.vented.sum() == pytest.approx(start, rel=1e-10)
        assert abs(state.balance_error) <= 1e-10 * start
        assert state.fill.max() <= 1.0
        if given is not None:
            assert state.thickness == pytest.approx(HEIGHT, rel=1e-9)
    assert state.vented.sum() > 0.0 and state.film.max() > 0.0
