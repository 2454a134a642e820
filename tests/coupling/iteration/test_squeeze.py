"""A saturated preform under a rigid plate that a force closes: all cells move as one.

Strip of half length L, drained at its edge: load = M e + mu L^2/(3 K) de/dt with the compression e
of the whole strip, so e = load/M (1 - exp(-t/tau)), tau = mu L^2/(3 K M).
"""

import math

import numpy as np
import pytest

from lcmchain.coupling.iteration import (
    CoupledSystem,
    Exchange,
    NotConverged,
    aitken,
    fixed_point,
    fixed_stress_exchanges,
    gauss_seidel,
    iqn_ils,
    iqn_mvj,
)
from lcmchain.coupling.iteration.consolidation import Column, FluidColumn, SolidColumn

STRIP = Column(height=0.1, cell_count=40, modulus=1e6, permeability=1e-11, load=2e5)
TAU = STRIP.viscosity * STRIP.height**2 / (3.0 * STRIP.permeability * STRIP.modulus)


class Plate(SolidColumn):
    """The plate shares the load: its cells see the mean of the pressure."""

    def advance(self, step):
        given = self._fields["pore_pressure"]
        self._fields["pore_pressure"] = np.full_like(given, given.mean())
        super().advance(step)
        self._fields["pore_pressure"] = given
        self._fields["reference_pressure"] = given.copy()


def press(scheme, window, *, split=False, **options):
    exchanges = [
        Exchange("plate", "fluid", "volume_rate", of_window="mean", within="held"),
        Exchange("fluid", "plate", "pore_pressure"),
    ]
    if split:
        exchanges += fixed_stress_exchanges("plate", "fluid")
    parts = {"plate": Plate(STRIP), "fluid": FluidColumn(STRIP)}
    return CoupledSystem(parts, exchanges, scheme, window=window, **options)


def compression(system):
    thickness = system.get_fields(["plate.thickness"])["plate.thickness"]
    assert np.ptp(thickness) < 1e-12 * thickness[0]
    return 1.0 - thickness[0] / STRIP.cell


def mean_pressure(system):
    return system.get_fields(["fluid.pore_pressure"])["fluid.pore_pressure"].mean()


@pytest.mark.parametrize("scheme", [aitken, iqn_ils, iqn_mvj])
@pytest.mark.parametrize("share", [0.5, 1.0, 3.0])
def test_the_plate_closes_as_the_closed_solution_tells(scheme, share):
    system = press(scheme(), TAU / 400.0)
    system.advance(share * TAU)
    expected = STRIP.load / STRIP.modulus * (1.0 - math.exp(-share))
    assert compression(system) == pytest.approx(expected, rel=0.005)


def test_fibres_and_fluid_carry_the_load_together():
    system = press(iqn_ils(), TAU / 50.0)
    for _ in range(10):
        system.advance(TAU / 10.0)
        carried = mean_pressure(system) + STRIP.modulus * compression(system)
        assert carried == pytest.approx(STRIP.load, rel=2e-6)


def test_pressure_under_the_plate_is_that_of_squeeze_flow():
    """mean p = mu L^2 (de/dt)/(3 K), the force 2 mu h' L^3/(3 K h) over the area (section 4.3)."""
    system = press(iqn_ils(), TAU / 50.0)
    system.advance(TAU / 2.0)
    before = compression(system)
    system.advance(TAU / 50.0)
    rate = (compression(system) - before) / (TAU / 50.0)
    expected = STRIP.viscosity * STRIP.height**2 * rate / (3.0 * STRIP.permeability)
    assert mean_pressure(system) == pytest.approx(expected, rel=0.001)
    pressure = system.get_fields(["fluid.pore_pressure"])["fluid.pore_pressure"]
    x = STRIP.centres()[:, 2]
    parabola = 1.5 * expected * (1.0 - (x / STRIP.height) ** 2)
    assert pressure == pytest.approx(parabola, abs=0.001 * pressure[0])


@pytest.mark.parametrize("windows", [4, 100, 10_000])
def test_only_one_mode_moves_so_that_aitken_and_iqn_ils_need_few_iterations(windows):
    """Staggered coupling diverges at the same windows."""
    explicit = press(gauss_seidel(), TAU / windows, prediction=0)
    explicit.advance(40 * TAU / windows)
    assert mean_pressure(explicit) != pytest.approx(STRIP.load, rel=10.0)
    for scheme in (aitken(), iqn_ils()):
        system = press(scheme, TAU / windows)
        system.advance(20 * TAU / windows)
        assert system.history.mean_iterations <= 4.0


def test_the_slope_of_single_cells_overrates_a_rigid_plate():
    """The split still contracts, but slowly; IQN-ILS makes up for it."""
    window = TAU / 100.0
    with pytest.raises(NotConverged, match="fixed point"):
        press(fixed_point(), window, split=True).advance(window)
    slow = press(fixed_point(most_iterations=5000), window, split=True)
    fast = press(iqn_ils(), window, split=True)
    for system in (slow, fast):
        system.advance(5 * window)
    residuals = [record.residual[1] for record in slow.history.iterations if record.window == 0]
    assert np.all(np.diff(residuals) < 0.0)
    assert compression(slow) == pytest.approx(compression(fast), rel=1e-3)
    assert fast.history.mean_iterations <= 8.0
