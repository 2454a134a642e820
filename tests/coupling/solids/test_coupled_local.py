"""Coupled cases with closed solutions: consolidation, limits of drainage, squeeze flow."""

from __future__ import annotations

import numpy as np
import pytest
from saturated_strip import Strip, coupled_strip
from scipy.integrate import solve_ivp

from lcmchain.coupling.iteration import fixed_point, iqn_ils
from lcmchain.coupling.iteration.consolidation import degree_of_consolidation
from lcmchain.coupling.iteration.interface import PORE_PRESSURE
from lcmchain.coupling.solids.closures import Bag, Gap, Press
from lcmchain.coupling.solids.local import LocalCompaction

LENGTH, WIDTH = 0.1, 0.02
VISCOSITY = 0.1


def soft_strip(cells, count=40):
    """A strip of 1 MPa that is pressed by 100 Pa: linear to 1e-4."""
    return cells(count, "isotropic"), np.full(count, LENGTH / count * WIDTH)


@pytest.mark.parametrize("scheme", [fixed_point, iqn_ils])
def test_strip_under_a_bag_consolidates_as_terzaghi_says(cells, scheme):
    law, area = soft_strip(cells)
    load, modulus, permeability = 100.0, 1e6, 1e-11
    time_scale = LENGTH**2 * VISCOSITY / (permeability * modulus)
    solid = LocalCompaction(law, Bag(load), area, pore_pressure=load)
    mobility = permeability / VISCOSITY
    fluid = Strip(solid.thickness, LENGTH / area.size, WIDTH, mobility, start=load)
    system = coupled_strip(solid, fluid, scheme(), time_scale * 3e-3)
    start = solid.thickness
    final = law.thickness_under(np.full(area.size, load))
    np.testing.assert_allclose(start, law.thickness, rtol=1e-12)
    for T, expected in ((0.197, 0.5003), (0.848, 0.9000)):
        system.advance(T * time_scale - system.time)
        U = float(np.sum(start - solid.thickness) / np.sum(start - final))
        assert degree_of_consolidation(T) == pytest.approx(expected, abs=1e-4)
        assert U == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("closure", ["bag", "press"])
def test_limits_of_drainage(cells, closure):
    """A tight strip keeps its volume and its fluid bears the load; an open one drains at once."""
    load = 2e4
    for permeability, p_share in ((1e-20, 1.0), (1e-4, 0.0)):
        law, area = cells(20), np.full(20, LENGTH / 20 * WIDTH)
        outside = Bag(load) if closure == "bag" else Press(load * float(area.sum()))
        solid = LocalCompaction(law, outside, area, pore_pressure=load)
        start = solid.thickness
        mobility = permeability / VISCOSITY
        fluid = Strip(start, LENGTH / 20, WIDTH, mobility, start=load)
        system = coupled_strip(solid, fluid, iqn_ils(), 0.5)
        system.advance(1.0)
        pressure = fluid.get_fields([PORE_PRESSURE])[PORE_PRESSURE]
        np.testing.assert_allclose(pressure, p_share * load, atol=1e-3 * load)
        change = 1.0 - solid.thickness / start
        if p_share:
            assert np.abs(change).max() < 1e-6
        else:
            expected = law.thickness_under(np.full(20, load))
            np.testing.assert_allclose(solid.thickness, expected, rtol=1e-4)


def test_squeeze_flow_between_closing_plates(cells):
    """F/width = 2 mu |dh/dt| L³/(3 K h) of both halves, and the fibres' force."""
    count, permeability, speed = 50, 1e-10, 1e-5
    law, area = cells(count), np.full(count, LENGTH / count * WIDTH)
    h0 = 0.9 * law.thickness[0]
    solid = LocalCompaction(law, Gap(lambda t: h0 - speed * t), area)
    mobility = permeability / VISCOSITY
    fluid = Strip(solid.thickness, LENGTH / count, WIDTH, mobility, start=0.0)
    system = coupled_strip(solid, fluid, fixed_point(), 0.1, split=False)
    system.advance(3.0)
    h = h0 - speed * 3.0
    parts = solid.force_parts()
    half = VISCOSITY * speed * LENGTH**3 / (3.0 * permeability * h)  # x from 0, closed, to L
    assert parts["fluid"] / WIDTH == pytest.approx(half, rel=0.01)
    fibres = float(law.material.compaction_pressure(h / law.thickness[0])) * area.sum()
    assert parts["fibres"] == pytest.approx(fibres, rel=1e-9)
    assert parts["total"] == pytest.approx(half * WIDTH + fibres, rel=0.01)


def test_squeeze_flow_at_a_force(cells):
    """The speed follows from what the fibres leave of the force: an equation for h(t) alone."""
    count, permeability, force = 40, 1e-10, 60.0
    law, area = cells(count), np.full(count, LENGTH / count * WIDTH)
    solid = LocalCompaction(law, Press(force), area, pore_pressure=force / float(area.sum()))
    mobility = permeability / VISCOSITY
    h0 = float(law.thickness[0])
    fluid = Strip(solid.thickness, LENGTH / count, WIDTH, mobility, start=force / area.sum())
    system = coupled_strip(solid, fluid, iqn_ils(), 0.04)

    def speed(_, h):
        fibres = law.material.compaction_pressure(h / h0) * area.sum()
        return -3.0 * permeability * h * (force - fibres) / (VISCOSITY * LENGTH**3 * WIDTH)

    end = 8.0
    expected = solve_ivp(speed, (0.0, end), [h0], rtol=1e-9, atol=1e-15).y[0, -1]
    system.advance(end)
    closed, way = h0 - solid.thickness[0], h0 - expected
    assert way > 0.05 * h0
    assert closed == pytest.approx(way, rel=0.01)
    assert solid.force_parts()["total"] == pytest.approx(force, rel=1e-6)
