"""Shear of a fabric: the polynomial of Eq. (21), locking, and the tangent that stabilises elements.

The shear stress is a function of the shear strain g = 2 E12 alone, S12 = C12(|E12|) g, and so has a
potential. For fibres that keep their length g = sin γ with the shear angle γ. A fabric whose shear
is not alike to both sides has another polynomial for g < 0 (:mod:`.unlike_sides`).

**Locking.** The polynomial is fitted to a test and knows nothing of what comes after it: the yarns
touch, and the fabric locks. A scene may state that from a locking angle γ_L on. With the excess
x = |g| - sin γ_L > 0

    dS12/dg += a x²,  S12 += a x³/3 sign g,  W += a x⁴/12,  a = C_L / (1 - sin γ_L)²,

a tangent without a jump or a kink that has gained the locking stiffness C_L at 90 degrees. Source:
the phenomenon, Cao et al., "Characterization of mechanical behavior of woven fabrics: experimental
methods and benchmark results", Composites Part A 39 (2008); the form is the simplest with a
continuous slope of the tangent, which the conservative hourglass energy asks for.

**Stabilising tangent.** The tangent of a law in powers of |E12| has a kink at zero. The hourglass
energy (V/6) E^ξ:C(E⁰):E^ξ makes stress of the slope of C, which jumps there: where the shear angle
changes over the element, S12 would point the wrong way at small angles. The stabilising tangent is
taken at a size of the strain that is smooth: |g| for |g| >= w, else w (3 + 6 r² - r⁴) / 8 with
r = g/w, of class C². Any tangent that keeps the energy positive will do, and the potential stays
exact; the law itself does not change.

A law that locks is a class of its own with two more parameters (:func:`locking_class`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from lcmchain.dispatch import optional
from lcmchain.jit import equation
from lcmchain.materials.twins import LawOrTwin, prefixed, twin_of

# Of the engineering shear strain 2 E12 = sin γ. For MD600 S12 keeps its sign where the shear angle
# changes by up to 19° over an element.
WIDTH = math.sin(math.radians(5.0))


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


def rounded_shear_of(g: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what :func:`rounded_shear` does for an array, in NumPy, written apart from it."""
    r = g / WIDTH
    inside = abs(r) < 1.0
    size = np.where(inside, WIDTH * (3.0 + 6.0 * r**2 - r**4) / 8.0, abs(g))
    first = np.where(inside, (12.0 * r - 4.0 * r**3) / 8.0, np.sign(g))
    second = np.where(inside, (12.0 - 12.0 * r**2) / (8.0 * WIDTH), 0.0)
    return size, first, second


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


@optional
def with_side(law, S12, C12, g):
    """Return S12 and dS12/dg of the side that g is on; as they are for a law of like sides."""
    return S12, C12


@optional
def with_stabilising_side(law, C12, g):
    """Return the stabilising tangent with its share of the other side."""
    return C12


@optional
def with_stabilising_side_slope(law, slope, g):
    """Return the derivative by g of the stabilising tangent with that of the other side."""
    return slope


@optional
def with_stabilising_side_curvature(law, curvature, g):
    """Return the second derivative by g of the stabilising tangent with that of the other side."""
    return curvature


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


@equation
def polynomial_response(law, g):
    """Return S12 and dS12/dg of the polynomial of Eq. (21) alone."""
    e = 0.5 * abs(g)
    modulus = law.s0 + e * (law.s1 + e * (law.s2 + e * (law.s3 + e * law.s4)))
    slope = law.s1 + e * (2.0 * law.s2 + e * (3.0 * law.s3 + e * (4.0 * law.s4)))
    return modulus * g, modulus + e * slope


@equation
def shear_stress_and_tangent(law, g):
    """Return S12 and dS12/dg for the engineering shear strain g = 2 E12, Eq. (21) and locking."""
    S12, C12 = polynomial_response(law, g)
    stress, tangent = locking_response(law, g)
    return with_side(law, S12 + stress, C12 + tangent, g)


@equation
def shear_tangent_slope(law, g):
    """Return d²S12/dg² of shear that is alike to both sides (odd in g)."""
    e = 0.5 * abs(g)
    first = law.s1 + e * (2.0 * law.s2 + e * (3.0 * law.s3 + e * (4.0 * law.s4)))
    second = 2.0 * law.s2 + e * (6.0 * law.s3 + e * (12.0 * law.s4))
    slope = 0.5 * (2.0 * first + e * second)
    return (slope if g >= 0.0 else -slope) + locking_tangent_slope(law, g)


@equation
def shear_tangent_curvature(law, g):
    """Return d³S12/dg³ of shear that is alike to both sides."""
    e = 0.5 * abs(g)
    second = 2.0 * law.s2 + e * (6.0 * law.s3 + e * (12.0 * law.s4))
    third = 6.0 * law.s3 + e * (24.0 * law.s4)
    return 0.25 * (3.0 * second + e * third) + locking_tangent_curvature(law, g)


@equation
def rounded_shear(g):
    """Return the rounded size of an engineering shear strain g, and its two derivatives."""
    r = min(abs(g) / WIDTH, 1.0)
    size = max(abs(g), 0.125 * WIDTH * (3.0 + r * r * (6.0 - r * r)))
    first = 0.5 * r * (3.0 - r * r)
    return size, (first if g >= 0.0 else -first), 1.5 * (1.0 - r * r) / WIDTH


@equation
def stabilising_shear_tangent(law, g):
    """Return dS12/dg at the rounded size of the strain: without the kink at g = 0."""
    size = rounded_shear(g)[0]
    return with_stabilising_side(law, shear_stress_and_tangent(law, size)[1], g)


@equation
def stabilising_shear_slope(law, g):
    """Return the derivative of :func:`stabilising_shear_tangent` with g."""
    size, first, _ = rounded_shear(g)
    slope = first * shear_tangent_slope(law, size)
    return with_stabilising_side_slope(law, slope, g)


@equation
def stabilising_shear_curvature(law, g):
    """Return the second derivative of :func:`stabilising_shear_tangent` with g."""
    size, first, second = rounded_shear(g)
    slope, curvature = shear_tangent_slope(law, size), shear_tangent_curvature(law, size)
    curvature = first * first * curvature + second * slope
    return with_stabilising_side_curvature(law, curvature, g)


# --- laws -----------------------------------------------------------------------------------------


def locking_class(law_class: type) -> Any:
    """Return the twin of a class of laws that locks, see :func:`.twins.twin_of`."""
    return twin_of(
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


def with_locking(law: LawOrTwin, locking: ShearLocking | None) -> LawOrTwin:
    """Return a law that locks as stated, or the law itself where nothing is stated."""
    return law if locking is None else prefixed(law, "Locking")(*law, *locking)
