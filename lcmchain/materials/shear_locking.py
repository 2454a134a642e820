"""Locking of a fabric in shear: what it does beyond the angle up to which its test goes.

The polynomial of Eq. (21) is fitted to a test and knows nothing of what comes after it: the yarns
touch, and the fabric locks. A scene may state that from a locking angle γ_L on. The stress stays a
function of the shear strain g = 2 E12 alone, so that it keeps a potential: with the excess
x = |g| - sin γ_L > 0 (g = sin γ for inextensible fibres)

    dS12/dg += a x²,  S12 += a x³/3 sign g,  W += a x⁴/12,  a = C_L / (1 - sin γ_L)²,

a tangent without a jump or a kink that has gained the locking stiffness C_L at 90 degrees. Source:
the phenomenon, Cao et al., "Characterization of mechanical behavior of woven fabrics: experimental
methods and benchmark results", Composites Part A 39 (2008); the form is the simplest with a
continuous slope of the tangent, which the conservative hourglass energy asks for.

A law that locks is a class of its own with two more parameters (:func:`locking_class`): where a
scene states no locking angle, its kernels hold none of this.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from lcmchain.dispatch import optional
from lcmchain.jit import equation
from lcmchain.materials.twins import twin_of


class ShearLocking(NamedTuple):
    """Parameters of a law that locks: sin γ_L, and the factor a [Pa] of the squared excess."""

    locking_strain: float
    locking_growth: float

    @classmethod
    def from_angle(cls, angle: float, stiffness: float) -> ShearLocking:
        """Return the parameters for a locking angle [rad] and a locking stiffness [Pa]."""
        strain = math.sin(angle)
        return cls(strain, stiffness / (1.0 - strain) ** 2)

    def response(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the added stress and tangent [Pa] at shear strains g = 2 E12, in NumPy."""
        x = np.maximum(np.abs(g) - self.locking_strain, 0.0)
        return self.locking_growth * np.sign(g) * x**3 / 3.0, self.locking_growth * x**2

    def slope_and_curvature(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives of the added tangent [Pa] by g, in NumPy."""
        x = np.abs(g) - self.locking_strain
        locked = np.where(x > 0.0, 2.0 * self.locking_growth, 0.0)
        return locked * x * np.sign(g), locked

    def energy(self, g: np.ndarray) -> np.ndarray:
        """Return the added energy density [J/m³]."""
        x = np.maximum(np.abs(g) - self.locking_strain, 0.0)
        return self.locking_growth * x**4 / 12.0


# --- compiled -------------------------------------------------------------------------------------


@optional
def locking_response(law, g):
    """Return what locking adds to S12 and to dS12/dg; nothing for a law that does not lock."""
    return 0.0, 0.0


@optional
def locking_tangent_slope(law, g):
    """Return what locking adds to d²S12/dg²."""
    return 0.0


@optional
def locking_tangent_curvature(law, g):
    """Return what locking adds to d³S12/dg³."""
    return 0.0


@equation
def cubic_response(law, g):
    x = max(abs(g) - law.locking_strain, 0.0)
    tangent = law.locking_growth * x * x
    stress = tangent * x / 3.0
    return (stress if g >= 0.0 else -stress), tangent


@equation
def cubic_tangent_slope(law, g):
    slope = 2.0 * law.locking_growth * max(abs(g) - law.locking_strain, 0.0)
    return slope if g >= 0.0 else -slope


@equation
def cubic_tangent_curvature(law, g):
    return 2.0 * law.locking_growth if abs(g) > law.locking_strain else 0.0


# --- laws -----------------------------------------------------------------------------------------

_locking_classes: dict[type, type] = {}


def locking_class(law_class: Any) -> Any:
    """Return the twin of a class of laws that locks, see :func:`.twins.twin_of`."""
    twin = twin_of(
        law_class,
        "Locking",
        about=" and of :class:`ShearLocking`.",
        entries=ShearLocking.__annotations__.items(),
        answers={
            locking_response: cubic_response,
            locking_tangent_slope: cubic_tangent_slope,
            locking_tangent_curvature: cubic_tangent_curvature,
        },
    )
    _locking_classes[law_class] = twin
    return twin


def with_locking(law: Any, locking: ShearLocking | None) -> Any:
    """Return a law that locks as stated, or the law itself where nothing is stated."""
    return law if locking is None else _locking_classes[type(law)](*law, *locking)
