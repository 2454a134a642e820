"""A piston in an incompressible fluid: the added mass that explicit coupling cannot carry."""

import math

import numpy as np
import pytest

from lcmchain.coupling.iteration import (
    CoupledSystem,
    Exchange,
    NotConverged,
    Tolerance,
    WindowControl,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
)

PISTON_MASS, STIFFNESS = 1.0, 100.0


class Piston:
    """m a + k u = f by the trapezoidal rule; gives its acceleration."""

    def __init__(self):
        self.time, self.force = 0.0, np.zeros(1)
        self.u, self.v = np.ones(1), np.zeros(1)
        self.a = np.zeros(1)

    def advance(self, step):
        # a at the end of the step, with u and v by the trapezoidal rule
        u, v = self.u + step * self.v + step**2 / 4.0 * self.a, self.v + step / 2.0 * self.a
        a = (self.force - STIFFNESS * u) / (PISTON_MASS + STIFFNESS * step**2 / 4.0)
        self.u, self.v, self.a = u + step**2 / 4.0 * a, v + step / 2.0 * a, a
        self.time += step

    def save(self):
        return self.time, self.force, self.u, self.v, self.a

    def restore(self, saved):
        self.time, self.force, self.u, self.v, self.a = saved

    def set_fields(self, fields):
        self.force = fields["force"].copy()

    def get_fields(self, names):
        known = {"acceleration": self.a, "position": self.u}
        return {name: known[name].copy() for name in names}


class FluidColumn:
    """A column of incompressible fluid that moves with the piston: f = -m a."""

    def __init__(self, mass):
        self.time, self.mass, self.a = 0.0, mass, np.zeros(1)

    def advance(self, step):
        self.time += step

    def save(self):
        return self.time, self.a

    def restore(self, saved):
        self.time, self.a = saved

    def set_fields(self, fields):
        self.a = fields["acceleration"].copy()

    def get_fields(self, names):
        return {"force": -self.mass * self.a}


def system(ratio, scheme, window=0.002, **options):
    piston, fluid = Piston(), FluidColumn(ratio * PISTON_MASS)
    # Consistent at the begin: (m + m_f) a = -k u.
    piston.a = fluid.a = -STIFFNESS * piston.u / (PISTON_MASS * (1.0 + ratio))
    piston.force = -fluid.mass * fluid.a
    exchanges = [
        Exchange("piston", "fluid", "acceleration"),
        Exchange("fluid", "piston", "force", tolerance=Tolerance(1e-9)),
    ]
    parts = {"piston": piston, "fluid": fluid}
    return CoupledSystem(parts, exchanges, scheme, window=window, **options)


def position(coupled):
    return float(coupled.get_fields(["piston.position"])["piston.position"][0])


def exact(ratio, time):
    return math.cos(math.sqrt(STIFFNESS / (PISTON_MASS * (1.0 + ratio))) * time)


@pytest.mark.parametrize("ratio", [0.5, 0.9])
def test_explicit_coupling_is_stable_below_the_mass_of_the_structure(ratio):
    coupled = system(ratio, gauss_seidel(), prediction=0)
    coupled.advance(0.5)
    assert position(coupled) == pytest.approx(exact(ratio, 0.5), abs=0.02)


@pytest.mark.parametrize("window", [0.002, 0.0005])
def test_explicit_coupling_diverges_above_it_for_every_window(window):
    """Errors grow by the ratio of the masses in each window, however short (Causin et al. 2005)."""
    coupled = system(1.5, gauss_seidel(), window, prediction=0)
    forces = []
    for _ in range(120):
        coupled.advance(window)
        forces.append(abs(coupled.get_fields(["fluid.force"])["fluid.force"][0]))
    assert (forces[-1] / forces[-41]) ** (1.0 / 40.0) == pytest.approx(1.5, rel=0.01)


@pytest.mark.parametrize("ratio", [1.5, 10.0, 1000.0])
@pytest.mark.parametrize("scheme", [aitken, iqn_ils, lambda: iqn_ils(order="parallel")])
def test_implicit_coupling_carries_any_added_mass(ratio, scheme):
    coupled = system(ratio, scheme())
    coupled.advance(0.5)
    assert position(coupled) == pytest.approx(exact(ratio, 0.5), abs=2e-4)
    assert coupled.history.mean_iterations <= 5.0


def test_constant_relaxation_converges_below_two_over_one_plus_the_ratio():
    ratio, limit = 10.0, 2.0 / 11.0
    coupled = system(ratio, fixed_point(0.98 * limit, most_iterations=2000))
    coupled.advance(0.01)
    with pytest.raises(NotConverged):
        system(ratio, fixed_point(1.02 * limit, most_iterations=2000)).advance(0.01)


def test_the_coupled_answer_converges_with_the_window_as_its_parts_do():
    """Second order, that of the trapezoidal rule; Gauss-Seidel at half the mass only first."""

    def order(ratio, scheme, **options):
        errors = []
        for window in (0.01, 0.005):
            coupled = system(ratio, scheme(), window, **options)
            coupled.advance(0.5)
            errors.append(abs(position(coupled) - exact(ratio, 0.5)))
        return math.log2(errors[0] / errors[1])

    assert order(5.0, iqn_ils) == pytest.approx(2.0, abs=0.05)
    assert order(0.5, gauss_seidel, prediction=0) == pytest.approx(1.0, abs=0.2)


def test_windows_led_by_the_coupling_residual_keep_an_explicit_scheme_accurate():
    """The error follows the wanted residual; the windows stay within their limits."""
    errors = []
    for wanted in (1e-2, 1e-3):
        control = WindowControl(0.002, smallest=1e-5, largest=0.02, residual=wanted)
        coupled = system(0.5, gauss_seidel(), control, prediction=0)
        coupled.advance(0.5)
        errors.append(abs(position(coupled) - exact(0.5, 0.5)))
        sizes = [window.size for window in coupled.history.accepted]
        assert min(sizes) >= 1e-5 and max(sizes) <= 0.02
    assert errors[1] < errors[0] / 3.0
