"""Vacuum infusion of a strip against the self-similar solution of compaction and flow.

With x = xi x_f(t), x_f² = C t, and p and h functions of xi alone, dh/dt = (h K/mu p')' becomes

    (h K/mu p_xi)_xi + C/2 xi h_xi = 0,  p(0) = p0,  p(1) = 0,  C = -2 K p_xi(1) / (phi(1) mu)

where the last is the front: the resin's velocity in the pores. The bag bears P = sigma(h) + p.
Source: Correia, Robitaille, Long, Rudd, Simacek, Advani: Compos. Part A 36 (2005) 1645-1656.
"""

from __future__ import annotations

import numpy as np
from saturated_strip import Strip, coupled_strip
from scipy.integrate import solve_bvp
from scipy.linalg import solve_banded

from lcmchain.coupling.iteration import fixed_point
from lcmchain.coupling.iteration.interface import (
    PORE_PRESSURE,
    REFERENCE_PRESSURE,
    THICKNESS,
    VOLUME_RATE,
    VOLUME_RATE_SLOPE,
)
from lcmchain.coupling.solids.closures import Bag
from lcmchain.coupling.solids.local import LocalCompaction

LENGTH, WIDTH, VISCOSITY = 0.3, 0.02, 0.1
BAG, INLET = 1.0e5, 0.95e5  # over the vent's pressure


def fibre_volume_fraction(law, thickness):
    material = law.material
    return material.areal_mass / (material.fibre_density * thickness)


def permeability(law, thickness):
    v = fibre_volume_fraction(law, thickness)
    return 2e-11 * (1.0 - v) ** 3 / v**2


class Infusion(Strip):
    """A strip that fills from the left: the front is tracked, what is dry has the vent's pressure.

    The front moves with the flow into the cell that it is in; a cell takes part in the flow once it
    is full. Thickness and rate come from the solid.
    """

    def __init__(self, law, thickness, length):
        super().__init__(thickness, length, WIDTH, 0.0, start=0.0)
        self.law, self.front = law, 0.0

    def advance(self, step):
        f = self._fields
        h = f[THICKNESS]
        mobility = permeability(self.law, h) / VISCOSITY
        per_length = 1.0 / (self.width * h * mobility)
        full = int(self.front / self.length + 1e-9)
        rest = self.front - full * self.length
        pressure = np.zeros_like(h)
        if full:
            resistance = self.length * per_length[:full]
            between = 2.0 / (resistance[:-1] + resistance[1:])
            out = 1.0 / (0.5 * resistance[-1] + rest * per_length[min(full, h.size - 1)])
            band = np.zeros((3, full))
            band[0, 1:] = band[2, :-1] = -between
            slope = f[VOLUME_RATE_SLOPE][:full]
            band[1] = slope
            band[1, :-1] += between
            band[1, 1:] += between
            source = slope * f[REFERENCE_PRESSURE][:full] - f[VOLUME_RATE][:full]
            band[1, 0] += 2.0 / resistance[0]
            source[0] += 2.0 / resistance[0] * INLET
            band[1, -1] += out
            pressure[:full] = solve_banded((1, 1), band, source)
            flow = out * pressure[full - 1]
        else:
            flow = INLET / max(rest * per_length[0], 1e-30)
        cell = min(full, h.size - 1)
        pores = 1.0 - fibre_volume_fraction(self.law, h[cell])
        if full:
            self.front += step * flow / (self.width * h[cell] * pores)
        else:  # no cell is full: the front of a rigid cell, exactly
            self.front = float(np.sqrt(self.front**2 + 2.0 * mobility[0] * INLET * step / pores))
        f[PORE_PRESSURE] = pressure
        self._time += step

    def save(self):
        return super().save(), self.front

    def restore(self, saved):
        super().restore(saved[0])
        self.front = saved[1]


def similarity(law, count):
    """Return C and p(xi) of the closed solution."""
    total = np.full(count, BAG)

    def thickness(p):
        return np.interp(np.clip(p, 0.0, INLET), table_p, table_h)

    table_p = np.linspace(0.0, INLET, count)
    table_h = law.thickness_under(total - table_p)
    slope = np.gradient(table_h, table_p)

    def equations(xi, y, parameters):
        p, q = y
        h = thickness(p)
        p_xi = q * VISCOSITY / (h * permeability(law, h))
        return np.stack([p_xi, -0.5 * parameters[0] * xi * np.interp(p, table_p, slope) * p_xi])

    def ends(a, b, parameters):
        h = thickness(b[0])
        pores = 1.0 - fibre_volume_fraction(law, h)
        front = parameters[0] * h * pores + 2.0 * b[1]
        scale = 2.0 * np.abs(b[1]) + 1e-20
        return np.array([(a[0] - INLET) / INLET, b[0] / INLET, front / scale])

    xi = np.linspace(0.0, 1.0, 101)
    h = thickness(0.0)
    K = permeability(law, h)
    guess = 2.0 * K * INLET / ((1.0 - fibre_volume_fraction(law, h)) * VISCOSITY)
    y = np.stack([INLET * (1.0 - xi), np.full_like(xi, -h * K / VISCOSITY * INLET)])
    found = solve_bvp(equations, ends, xi, y, p=[guess], tol=1e-7, max_nodes=20000)
    assert found.success, found.message
    return float(found.p[0]), guess, lambda s: found.sol(s)[0], thickness


def test_front_and_thickness_of_a_vacuum_infusion(cells):
    C, rigid, profile, thickness = similarity(cells(4001), 4001)
    assert abs(C / rigid - 1.0) > 0.05  # compaction counts
    errors = []
    for count in (25, 50):
        law = cells(count)
        length = LENGTH / count
        solid = LocalCompaction(law, Bag(BAG), np.full(count, length * WIDTH))
        fluid = Infusion(law, solid.thickness, length)
        system = coupled_strip(solid, fluid, fixed_point(), 1e9, tolerance=1e-6)
        end = (0.8 * LENGTH) ** 2 / C
        for x in np.linspace(0.0, 0.8 * LENGTH, 2 * count + 1)[1:]:
            system.advance(min(x**2 / C, end) - system.time)
        errors.append(abs(fluid.front / (0.8 * LENGTH) - 1.0))
        xi = (np.arange(count) + 0.5) * length / fluid.front
        wet = xi < 0.95
        expected = thickness(profile(xi[wet]))
        span = np.ptp(thickness(np.array([0.0, INLET])))
        assert np.abs(solid.thickness[wet] - expected).max() < 0.02 * span
        dry = xi > 1.1
        np.testing.assert_allclose(solid.thickness[dry], thickness(0.0), rtol=1e-6)
    assert max(errors) < 0.02
    assert errors[1] < errors[0]
