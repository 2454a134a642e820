"""Filling along a strip against the closed solutions, at constant pressure and constant rate."""

import numpy as np
import pytest

from lcmchain.coupling.infiltration.filling import Filling, FillingOptions
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Schedule, TimeTable, Vent
from lcmchain.coupling.infiltration.flow.preform import Preform

from .sample_meshes import plate, random_plate

LENGTH, WIDTH, HEIGHT = 0.3, 0.1, 0.003
POROSITY, VISCOSITY, PERMEABILITY, PRESSURE = 0.5, 0.1, 1e-10, 1e5
FILL_TIME = 225.0


def strip(mesh, options=None, **gate):
    gate = gate or {"pressure": PRESSURE}
    return Filling(
        mesh, Preform(HEIGHT, POROSITY, PERMEABILITY), VISCOSITY,
        [Gate("inlet", mesh.node_sets["left"], **gate)], [Vent("end", mesh.node_sets["right"])],
        options=options,
    )  # fmt: skip


def balanced(filling):
    state = filling.state
    assert abs(state.balance_error) <= 1e-10 * state.stored
    assert state.fill.min() >= 0.0 and state.fill.max() <= 1.0
    assert (state.resin_volume <= filling.pores * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("triangles", [False, True])
def test_constant_pressure_fills_in_225_seconds(triangles):
    filling = strip(plate(30, 4, LENGTH, WIDTH, triangles=triangles))
    outcome, _ = filling.advance(1e4, balanced)
    assert outcome == "filled"
    assert filling.time == pytest.approx(FILL_TIME, rel=5e-3)


def test_front_and_pressure_over_time():
    mesh = plate(40, 3, LENGTH, WIDTH)
    filling = strip(mesh)
    for time, front in ((10.0, 0.06325), (50.0, 0.14142), (100.0, 0.2), (200.0, 0.28284)):
        filling.advance(time, balanced)
        volume = front * WIDTH * HEIGHT * POROSITY
        assert filling.state.stored == pytest.approx(volume, rel=3e-3)
        x = mesh.points[:, 0]
        exact = PRESSURE * np.maximum(1.0 - x / front, 0.0)
        full = filling.state.full
        assert np.abs(filling.state.pressure - exact)[full].max() < 4e-3 * PRESSURE
    assert filling.time == 200.0


def test_second_order_in_space():
    errors = []
    for columns in (5, 10, 20):
        mesh = plate(columns, 2, LENGTH, WIDTH)
        filling = strip(mesh, FillingOptions(front_step=0.05))
        filling.advance(1e4)
        exact = FILL_TIME * (mesh.points[:, 0] / LENGTH) ** 2
        # The gate's own control volume belongs to its line.
        away = mesh.points[:, 0] > 0.0
        errors.append(np.abs(filling.state.fill_time - exact)[away].max() / FILL_TIME)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[0] < 5e-3
    assert orders.min() > 1.8


def test_second_order_in_time():
    errors = []
    for step in (0.8, 0.4, 0.2):
        filling = strip(plate(40, 1, LENGTH, WIDTH), FillingOptions(front_step=step))
        filling.advance(100.0)
        exact = 0.2 * WIDTH * HEIGHT * POROSITY
        errors.append(abs(filling.state.stored / exact - 1.0))
    assert errors[0] < 2e-3
    assert errors[0] / errors[2] > 8.0


@pytest.mark.parametrize("triangles", [False, True])
def test_constant_rate(triangles):
    rate = 1e-7
    filling = strip(plate(20, 3, LENGTH, WIDTH, triangles=triangles), flow_rate=rate)
    filling.advance(300.0, balanced)
    front = rate * 300.0 / (POROSITY * WIDTH * HEIGHT)
    inlet = VISCOSITY * rate * front / (PERMEABILITY * WIDTH * HEIGHT)
    assert filling.state.stored == pytest.approx(rate * 300.0, rel=1e-10)
    assert filling.state.gate_pressure[0] == pytest.approx(inlet, rel=5e-3)
    assert filling.state.gate_rate[0] == pytest.approx(rate, rel=1e-9)
    assert filling.advance(1e4)[0] == "filled"
    assert filling.time == pytest.approx(LENGTH * WIDTH * HEIGHT * POROSITY / rate, rel=1e-6)


def test_rate_gate_keeps_its_largest_pressure():
    filling = strip(plate(20, 2, LENGTH, WIDTH), flow_rate=1e-7, pressure=2e4)
    filling.advance(1e5, balanced)
    # At a rate up to where 20 kPa are needed, then x² grows linearly.
    front = PERMEABILITY * 2e4 * WIDTH * HEIGHT / (VISCOSITY * 1e-7)
    first = POROSITY * WIDTH * HEIGHT * front / 1e-7
    rest = POROSITY * VISCOSITY * (LENGTH**2 - front**2) / (2.0 * PERMEABILITY * 2e4)
    assert filling.time == pytest.approx(first + rest, rel=5e-3)
    assert np.nanmax(filling.state.pressure) <= 2e4 * (1.0 + 1e-6)


def test_pressure_over_time():
    """x² grows with the integral of the pressure."""
    table = TimeTable([0.0, 200.0], [0.0, 2e5])
    filling = strip(plate(20, 2, LENGTH, WIDTH), FillingOptions(largest_step=5.0), pressure=table)
    filling.advance(150.0, balanced)
    integral = 0.5 * 150.0 * 1.5e5
    front = np.sqrt(2.0 * PERMEABILITY / (POROSITY * VISCOSITY) * integral)
    volume = front * WIDTH * HEIGHT * POROSITY
    assert filling.state.stored == pytest.approx(volume, rel=1e-2)


def test_unstructured_triangles():
    mesh = random_plate(0.012, LENGTH, WIDTH)
    filling = strip(mesh)
    filling.advance(100.0, balanced)
    assert filling.state.stored == pytest.approx(0.2 * WIDTH * HEIGHT * POROSITY, rel=5e-3)


def test_gate_that_closes_stops_the_front():
    mesh = plate(20, 2, LENGTH, WIDTH)
    gate = Gate("inlet", mesh.node_sets["left"], pressure=PRESSURE, schedule=Schedule(closes=50.0))
    filling = Filling(
        mesh, Preform(HEIGHT, POROSITY, PERMEABILITY), VISCOSITY, [gate],
        [Vent("end", mesh.node_sets["right"])],
    )  # fmt: skip
    outcome, message = filling.advance(1e4)
    assert outcome == "no_source" and "inlet" in message
    assert filling.time == 50.0
    volume = 0.14142 * WIDTH * HEIGHT * POROSITY
    assert filling.state.stored == pytest.approx(volume, rel=3e-3)


def test_sequential_gate_opens_on_arrival():
    """A second line gate that opens when the front is there restarts the same filling."""
    mesh = plate(40, 2, LENGTH, WIDTH)
    middle = np.flatnonzero(np.abs(mesh.points[:, 0] - 0.15) < 1e-9)
    second = Gate("middle", middle, pressure=PRESSURE, schedule=Schedule(opens_on_arrival=middle))
    filling = Filling(
        mesh, Preform(HEIGHT, POROSITY, PERMEABILITY), VISCOSITY,
        [Gate("inlet", mesh.node_sets["left"], pressure=PRESSURE), second],
        [Vent("end", mesh.node_sets["right"])],
    )  # fmt: skip
    filling.advance(1e4, balanced)
    assert filling.time == pytest.approx(2.0 * FILL_TIME / 4.0, rel=1.5e-2)
    assert filling.state.injected[1] == pytest.approx(0.5 * filling.pores.sum(), rel=2e-2)


def test_saved_state_goes_on_bit_identically():
    mesh = random_plate(0.02, LENGTH, WIDTH, seed=3)
    whole, parted = strip(mesh), strip(mesh)
    whole.advance(30.0)
    parted.advance(30.0)
    saved = parted.save()
    parted.advance(70.0)
    parted.restore(saved)
    whole.advance(120.0)
    other = strip(mesh)
    other.restore(saved)
    parted.advance(120.0)
    other.advance(120.0)
    for filling in (parted, other):
        for name in ("resin_volume", "pressure", "fill_time", "injected", "full"):
            assert np.array_equal(
                getattr(filling.state, name), getattr(whole.state, name), equal_nan=True
            )
        assert filling.state.step_count == whole.state.step_count
