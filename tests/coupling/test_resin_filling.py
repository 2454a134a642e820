"""Resin that cures and a film on top, in the filling itself: closed solutions and conservation."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Vent
from lcmchain.coupling.infiltration.flow.film import Film
from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform
from lcmchain.coupling.infiltration.resin import (
    ArrheniusViscosity,
    CastroMacoskoViscosity,
    KamalSourour,
)
from lcmchain.coupling.infiltration.resin_temperature import (
    ConstantTemperature,
    MouldTemperature,
    PrescribedTemperature,
)
from lcmchain.errors import InputError

LENGTH, WIDTH, THICKNESS, PHI, K = 0.3, 0.1, 3e-3, 0.5, 1e-10
RATE, GEL = 2e-3, 0.6  # first order: cure = 1 - exp(-RATE age)
RESIN = CastroMacoskoViscosity(
    reference_viscosity=0.1, activation_energy=0.0, gel_cure=GEL, exponent=1.5, exponent_slope=1.0,
    kinetics=KamalSourour.nth_order(RATE, 0.0, 1.0),
)  # fmt: skip
WARM = ConstantTemperature(400.0)
SECTION = PHI * THICKNESS * WIDTH


def viscosity_at(age):
    return RESIN.viscosity(400.0, 1.0 - np.exp(-RATE * age))


def strip(columns, rows=2):
    x, y = np.meshgrid(np.linspace(0, LENGTH, columns + 1), np.linspace(0, WIDTH, rows + 1))
    node = np.arange(x.size).reshape(x.shape)
    cells = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1)
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    return FlowMesh(points, cells.reshape(-1, 4))


def filling(mesh, resin, preform=None, gates=True, **options):
    x = mesh.points[:, 0]
    inlet = options.pop("inlet", {"pressure": 4e4})
    gate = [Gate("inlet", np.flatnonzero(x < 1e-9), **inlet)] if gates else []
    vent = Vent("outlet", np.flatnonzero(x > LENGTH - 1e-9))
    preform = preform or Preform(THICKNESS, PHI, K)
    return Filling(mesh, preform, resin, gate, [vent], **options)


def test_the_inlet_pressure_at_a_constant_rate_follows_the_closed_solution():
    """Plug flow: the resin at x entered x/u ago; the pressures of all of it add up."""
    speed = LENGTH / 200.0
    inlet = {"flow_rate": SECTION * speed}
    errors = []
    for columns in (30, 60, 120):
        run = filling(strip(columns), RESIN, inlet=inlet, temperature=WARM)
        worst = 0.0
        for time in (50.0, 100.0, 180.0):
            run.advance(time)
            exact = quad(lambda x: viscosity_at(x / speed) * PHI * speed / K, 0, speed * time)[0]
            worst = max(worst, abs(run.state.gate_pressure[0] / exact - 1.0))
        errors.append(worst)
        assert run.state.stored == pytest.approx(SECTION * speed * 180.0, rel=1e-10)
    assert errors[2] < 0.012
    assert np.log2(errors[0] / errors[2]) / 2 > 0.6  # cure is carried upwind, of first order
    assert filling_without_cure_is_far_off(inlet, speed)


def filling_without_cure_is_far_off(inlet, speed):
    run = filling(strip(30), 0.1, inlet=inlet)
    run.advance(180.0)
    exact = quad(lambda x: viscosity_at(x / speed) * PHI * speed / K, 0, speed * 180.0)[0]
    return run.state.gate_pressure[0] < 0.6 * exact


@pytest.mark.parametrize("warms", [1.0, -1.0])
def test_resin_of_changing_temperature_fills_when_the_integral_of_its_fluidity_says(warms):
    """x² grows with ∫ dt/µ: a step that took the viscosity of its start would lag behind."""
    resin = ArrheniusViscosity(
        reference_viscosity=0.1, activation_energy=4e4, reference_temperature=350.0
    )
    table = PrescribedTemperature((0.0, 300.0), (350.0 - 20.0 * warms, 350.0 + 20.0 * warms))
    pressure = 1e5

    def fluidity(time):
        return 1.0 / resin.viscosity(np.array([table.inlet(time)]), np.zeros(1))[0]

    def lag(end):
        return quad(fluidity, 0.0, end)[0] - PHI * LENGTH**2 / (2.0 * K * pressure)

    exact = brentq(lag, 1.0, 300.0)
    run = filling(strip(60), resin, inlet={"pressure": pressure}, temperature=table)
    run.advance(1e4)
    assert run.time == pytest.approx(exact, rel=1e-3)


def gelled_front(pressure, count=4000):
    """Place of the front when its resin, which entered first, gels: a Volterra equation."""
    step = -np.log(1.0 - GEL) / RATE / count
    viscosity = viscosity_at((np.arange(count) + 0.5) * step)
    speed = np.zeros(count)
    for now in range(count):
        behind = (viscosity[1 : now + 1][::-1] * speed[:now]).sum() * step
        here = viscosity[0] * step
        speed[now] = (np.sqrt(behind**2 + 4 * here * pressure * K / PHI) - behind) / (2 * here)
    return speed.sum() * step


def test_gel_stops_the_front_and_says_when_and_where():
    run = filling(strip(60), RESIN, temperature=WARM)
    result = run.run(5000.0)
    assert result.outcome == "gelled"
    assert run.time == pytest.approx(-np.log(1.0 - GEL) / RATE, rel=0.02)
    front = run.state.stored / SECTION
    assert front == pytest.approx(gelled_front(4e4), rel=0.03)
    gelled = run.mesh.points[run.liquid.gelled(run.state)]
    assert np.all(np.abs(gelled[:, 0] - front) < 0.015)
    assert "the resin has gelled" in result.message and f"{run.time:.6g} s" in result.message
    assert f"({gelled[:, 0].mean():.6g}, " in result.message
    assert abs(run.state.balance_error) < 1e-10 * run.state.stored


def test_cure_and_temperature_stay_between_what_enters_and_what_can_be():
    law = MouldTemperature(330.0, (0.0,), (400.0,), diffusivity=2e-7)
    resin = CastroMacoskoViscosity(
        reference_viscosity=1e-6, activation_energy=35e3, gel_cure=GEL, exponent=1.5,
        kinetics=KamalSourour.nth_order(1e5, 60e3, 1.0), initial_cure=0.05,
    )  # fmt: skip
    run = filling(strip(30), resin, temperature=law)
    run.advance(60.0)
    wet = run.state.resin_volume > 0.0
    assert np.all(run.state.cure[wet] >= 0.05 - 1e-12) and np.all(run.state.cure < 1.0)
    hot = run.state.temperature[run.state.full]
    assert np.all((hot >= 330.0 - 1e-9) & (hot <= 400.0 + 1e-9))
    middle = np.flatnonzero(run.state.full & (np.abs(run.mesh.points[:, 1] - 0.05) < 1e-9))
    along = run.state.temperature[middle[np.argsort(run.mesh.points[middle, 0])]]
    assert np.all(np.diff(along) > 0.0) and along[-1] > along[0] + 5.0  # it warms as it flows
    assert run.state.cure[run.state.full].max() > 0.05 + 1e-4


# --- film -----------------------------------------------------------------------------------------

COLUMN = Preform(2e-3, PHI, K, through_permeability=2e-12)
PUSH = 1e5
THROUGH = PHI * 0.1 * 2e-3**2 / (2 * 2e-12 * PUSH)  # 0.5 s


def test_a_film_everywhere_is_through_after_the_closed_time():
    run = filling(strip(12), 0.1, COLUMN, gates=False, film=Film(1.5e-3, PUSH))
    run.advance(0.25 * THROUGH)
    np.testing.assert_allclose(run.state.fill, 0.5, rtol=1e-12)
    outcome, message = run.advance(10.0)
    assert outcome == "filled" and f"{THROUGH:.6g} s" in message
    np.testing.assert_allclose(run.state.film, 1.5e-3 - PHI * 2e-3, rtol=1e-10)


def total(run):
    area = run.medium.node_area
    return run.state.film @ area + run.state.stored + run.state.vented.sum()


def test_a_film_on_a_third_fills_the_rest_along_the_sheet_and_nothing_is_lost():
    mesh = strip(30, 4)
    film = np.where(mesh.points[:, 0] < 0.1 + 1e-9, 4e-3, 0.0)
    run = filling(mesh, 0.1, COLUMN, gates=False, film=Film(film, PUSH))
    start, worst = total(run), []
    through = run.advance(THROUGH, lambda now: worst.append(abs(total(now) / start - 1.0)))
    assert through[0] == "reached"
    # along the sheet nothing has moved yet
    expected = COLUMN.porosity[0] * 2e-3 * run.medium.node_area[film > 0.0].sum()
    assert run.state.stored == pytest.approx(expected, rel=1e-9)
    outcome, _ = run.advance(1000.0, lambda now: worst.append(abs(total(now) / start - 1.0)))
    assert outcome == "filled"
    assert max(worst) < 1e-10
    assert run.state.film.min() == 0.0 and run.state.film.max() > 0.0
    assert run.state.from_film == pytest.approx(run.state.stored, rel=1e-10)
    assert abs(run.state.balance_error) < 1e-10 * run.state.stored


def test_a_film_in_a_short_supply_wets_as_much_as_there_is():
    mesh = strip(30, 2)
    film = np.where(mesh.points[:, 0] < 0.1 + 1e-9, 2e-3, 0.0)  # fills 0.2 m of 0.3 m
    run = filling(mesh, 0.1, COLUMN, gates=False, film=Film(film, PUSH))
    start = total(run)
    run.advance(1e6)
    assert run.filled_share < 0.75
    assert run.state.film @ run.medium.node_area < 1e-6 * start
    assert total(run) == pytest.approx(start, rel=1e-10)


def test_a_filling_with_a_film_goes_on_bit_identically_from_a_copy():
    mesh = strip(20, 2)
    film = np.where(mesh.points[:, 0] < 0.1 + 1e-9, 3e-3, 0.0)
    run = filling(mesh, RESIN, COLUMN, gates=False, film=Film(film, PUSH), temperature=WARM)
    run.advance(1.0)
    saved = run.save()
    run.advance(20.0)
    other = filling(mesh, RESIN, COLUMN, gates=False, film=Film(film, PUSH), temperature=WARM)
    other.restore(saved)
    other.advance(20.0)
    for name in ("resin_volume", "film", "cure", "pressure"):
        np.testing.assert_array_equal(getattr(other.state, name), getattr(run.state, name))
    assert other.state.film_cure == run.state.film_cure
    assert run.state.film_cure == pytest.approx(1.0 - np.exp(-RATE * 20.0), rel=1e-6)


def test_a_film_needs_the_permeability_through_the_thickness():
    with pytest.raises(InputError, match="permeability through the thickness"):
        filling(strip(6), 0.1, gates=False, film=Film(1e-3, PUSH)).advance(1.0)
    with pytest.raises(InputError, match="film"):
        Film(-1e-3, PUSH)
