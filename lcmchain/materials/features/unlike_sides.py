"""Shear that is not alike to both sides, as of a stitched fabric.

The stitches of a non-crimp fabric are drawn in shear to one side and go slack in shear to the
other, so that one takes several times the force of the other. Where the shear strain g = 2 E12 is
negative, the angle from fibres 1 to 2 having grown, the polynomial of Eq. (21) has coefficients of
its own. With d(e) their polynomial less that of the positive side, e = |g|/2,

    S12 += d(e) g,  dS12/dg += d + e d',  W += Σ 4 d_k e^(k+2) / (k+2)   for g < 0.

Stress and energy are continuous, whatever the coefficients; the tangent jumps at g = 0 where both
sides differ in s0.

**Stabilising tangent** (:mod:`.shear`). It must not jump: it takes the difference at the rounded
size of the strain times a share of class C² that falls from 1 at g <= -w to 0 at g >= w, between
with r = g/w as (8 - 15 r + 10 r³ - 3 r⁵)/16. So it lies between the tangents of both sides, and is
positive where these are.

Source: the phenomenon, in picture frames: Lomov, Barburski, Stoilova, Verpoest, Akkerman,
Loendersloot, ten Thije, "Carbon composites based on multiaxial multiply stitched preforms. Part 3:
Biaxial tension, picture frame and compression tests of the preforms", Composites Part A 36 (2005);
the form is that of Eq. (21), once for each side.

A law of a fabric with it is a class of its own, made on demand (:mod:`lcmchain.materials.twins`).
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np

from lcmchain.jit import equation
from lcmchain.materials.features.shear import (
    WIDTH,
    polynomial_response,
    rounded_shear,
    rounded_shear_of,
    shear_tangent_curvature,
    shear_tangent_slope,
    with_side,
    with_stabilising_side,
    with_stabilising_side_curvature,
    with_stabilising_side_slope,
)
from lcmchain.materials.twins import LawOrTwin, made_on_demand, twin_named, twin_of


class UnlikeSides(NamedTuple):
    """Coefficients of the shear polynomial of the negative side less those of the positive [Pa]."""

    side0: float
    side1: float
    side2: float
    side3: float
    side4: float

    def response(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the added stress and tangent [Pa] at shear strains g = 2 E12, in NumPy."""
        e, negative = 0.5 * np.abs(g), np.asarray(g) < 0.0
        stress = 2.0 * e * self._polynomial(0, e)
        return np.where(negative, -stress, 0.0), np.where(negative, self._tangent(0, e), 0.0)

    def slope_and_curvature(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives of the added tangent [Pa] by g, in NumPy."""
        e, negative = 0.5 * np.abs(g), np.asarray(g) < 0.0
        slope, curvature = -0.5 * self._tangent(1, e), 0.25 * self._tangent(2, e)
        return np.where(negative, slope, 0.0), np.where(negative, curvature, 0.0)

    def energy(self, g: np.ndarray) -> np.ndarray:
        """Return the added energy density [J/m³]."""
        e = 0.5 * np.maximum(-np.asarray(g), 0.0)
        terms = [4.0 * d * e ** (k + 2) / (k + 2) for k, d in enumerate(self)]
        return np.sum(terms, axis=0)

    def stabilising(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the added stabilising tangent [Pa] and its two derivatives by g."""
        share = np.polynomial.Polynomial([8.0, -15.0, 0.0, 10.0, 0.0, -3.0]) / 16.0
        r = np.clip(np.asarray(g) / WIDTH, -1.0, 1.0)
        v, v1, v2 = (share.deriv(k)(r) / WIDTH**k if k else share(r) for k in range(3))
        size, first, second = rounded_shear_of(np.asarray(g))
        e = 0.5 * size
        t, of_e, of_ee = (self._tangent(k, e) for k in range(3))
        t1 = 0.5 * of_e * first
        t2 = 0.25 * of_ee * first**2 + 0.5 * of_e * second
        return v * t, v1 * t + v * t1, v2 * t + 2.0 * v1 * t1 + v * t2

    def _polynomial(self, derivative: int, e: np.ndarray) -> np.ndarray:
        return np.polynomial.Polynomial(self).deriv(derivative)(e)

    def _tangent(self, derivative: int, e: np.ndarray) -> np.ndarray:
        """Return a derivative by e of the tangent d + e d'."""
        coefficients = [(k + 1.0) * d for k, d in enumerate(self)]
        return np.polynomial.Polynomial(coefficients).deriv(derivative)(e)


# --- compiled -------------------------------------------------------------------------------------


class SidePolynomial(NamedTuple):
    """The difference of both sides, as a shear law of its own (:mod:`.shear`)."""

    s0: float
    s1: float
    s2: float
    s3: float
    s4: float


@equation
def difference(law):
    """Return the polynomial of the negative side less that of the positive side."""
    return SidePolynomial(law.side0, law.side1, law.side2, law.side3, law.side4)


@equation
def share_of_side(g):
    """Return the share of the negative side at a strain, and its two derivatives by g."""
    r = min(max(g / WIDTH, -1.0), 1.0)
    q = r * r
    rest = 1.0 - q
    value = (8.0 - r * (15.0 - q * (10.0 - 3.0 * q))) / 16.0
    return value, -15.0 / 16.0 * rest * rest / WIDTH, 3.75 * r * rest / (WIDTH * WIDTH)


@equation
def stress_of_side(law, S12, C12, g):
    stress, tangent = polynomial_response(difference(law), g)
    return S12 + (stress if g < 0.0 else 0.0), C12 + (tangent if g < 0.0 else 0.0)


@equation
def stabilising_side(law, C12, g):
    tangent = polynomial_response(difference(law), rounded_shear(g)[0])[1]
    return C12 + share_of_side(g)[0] * tangent


@equation
def stabilising_side_slope(law, slope, g):
    share, share_slope, _ = share_of_side(g)
    size, first, _ = rounded_shear(g)
    tangent = polynomial_response(difference(law), size)[1]
    return (
        slope + share_slope * tangent + share * first * shear_tangent_slope(difference(law), size)
    )


@equation
def stabilising_side_curvature(law, curvature, g):
    share, share_slope, share_curvature = share_of_side(g)
    size, first, second = rounded_shear(g)
    sides = difference(law)
    tangent = polynomial_response(sides, size)[1]
    of_size = shear_tangent_slope(sides, size)
    slope = first * of_size
    bend = first * first * shear_tangent_curvature(sides, size) + second * of_size
    return curvature + share_curvature * tangent + 2.0 * share_slope * slope + share * bend


# --- laws -----------------------------------------------------------------------------------------


@made_on_demand(r"UnlikeSides(?P<base>\w+)")
def _twin(name: re.Match[str], base: type) -> Any:
    """Return the twin of a class of laws that is sheared unlike to both sides."""
    return twin_of(
        base,
        "UnlikeSides",
        about=" and of :class:`UnlikeSides`.",
        entries=UnlikeSides.__annotations__.items(),
        answers={
            with_side: stress_of_side,
            with_stabilising_side: stabilising_side,
            with_stabilising_side_slope: stabilising_side_slope,
            with_stabilising_side_curvature: stabilising_side_curvature,
        },
    )


def with_unlike_sides(law: LawOrTwin, sides: UnlikeSides | None) -> LawOrTwin:
    """Return a law that is sheared unlike to both sides, or the law itself where none is stated."""
    if sides is None:
        return law
    return twin_named(f"UnlikeSides{type(law).__name__}")(*law, *sides)
