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

from lcmchain.dispatch import optional
from lcmchain.jit import equation
from lcmchain.materials.twins import LawOrTwin, made_on_demand, twin_named, twin_of

#: Size of a strain, and its two derivatives by the strain.
Rounded = tuple[np.ndarray, np.ndarray, np.ndarray]


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

    def stabilising(self, g: np.ndarray, rounded: Rounded, width: float) -> Rounded:
        """Return the added stabilising tangent [Pa] and its two derivatives by g.

        rounded : size of the strain and its derivatives. width : w of the share.
        """
        share = np.polynomial.Polynomial([8.0, -15.0, 0.0, 10.0, 0.0, -3.0]) / 16.0
        r = np.clip(np.asarray(g) / width, -1.0, 1.0)
        v, v1, v2 = (share.deriv(k)(r) / width**k if k else share(r) for k in range(3))
        size, first, second = rounded
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


@optional
def with_side(law, S12, C12, g):
    """Return S12 and dS12/dg of the side that g is on; as they are for a law of like sides."""
    return S12, C12


@optional
def with_stabilising_side(law, C12, g, size, width):
    """Return the stabilising tangent with its share of the other side."""
    return C12


@optional
def with_stabilising_side_slope(law, slope, g, size, first, width):
    """Return the derivative by g of the stabilising tangent with that of the other side."""
    return slope


@optional
def with_stabilising_side_curvature(law, curvature, g, size, first, second, width):
    """Return the second derivative by g of the stabilising tangent with that of the other side."""
    return curvature


@equation
def side_tangent(law, e):
    """Return the tangent d + e d' of the difference of both sides, and two derivatives by e."""
    d1, d2, d3, d4 = 2.0 * law.side1, 3.0 * law.side2, 4.0 * law.side3, 5.0 * law.side4
    tangent = law.side0 + e * (d1 + e * (d2 + e * (d3 + e * d4)))
    slope = d1 + e * (2.0 * d2 + e * (3.0 * d3 + e * (4.0 * d4)))
    return tangent, slope, 2.0 * d2 + e * (6.0 * d3 + e * (12.0 * d4))


@equation
def share_of_side(g, width):
    """Return the share of the negative side at a strain, and its two derivatives by g."""
    r = min(max(g / width, -1.0), 1.0)
    q = r * r
    rest = 1.0 - q
    value = (8.0 - r * (15.0 - q * (10.0 - 3.0 * q))) / 16.0
    return value, -15.0 / 16.0 * rest * rest / width, 3.75 * r * rest / (width * width)


@equation
def stress_of_side(law, S12, C12, g):
    e = 0.5 * max(-g, 0.0)
    modulus = law.side0 + e * (law.side1 + e * (law.side2 + e * (law.side3 + e * law.side4)))
    tangent = side_tangent(law, e)[0]
    return S12 - 2.0 * e * modulus, C12 + (tangent if g < 0.0 else 0.0)


@equation
def stabilising_side(law, C12, g, size, width):
    return C12 + share_of_side(g, width)[0] * side_tangent(law, 0.5 * size)[0]


@equation
def stabilising_side_slope(law, slope, g, size, first, width):
    v, v1, _ = share_of_side(g, width)
    t, of_e, _ = side_tangent(law, 0.5 * size)
    return slope + v1 * t + v * 0.5 * of_e * first


@equation
def stabilising_side_curvature(law, curvature, g, size, first, second, width):
    v, v1, v2 = share_of_side(g, width)
    t, of_e, of_ee = side_tangent(law, 0.5 * size)
    t1 = 0.5 * of_e * first
    t2 = 0.25 * of_ee * first * first + 0.5 * of_e * second
    return curvature + v2 * t + 2.0 * v1 * t1 + v * t2


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
