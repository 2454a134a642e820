"""The size of a shear strain without its kink at zero, for the stabilisation of an element.

A shear law in powers of |E12| (Eq. 21) has a tangent with a kink at zero. The hourglass energy
(V/6) E^ξ:C(E⁰):E^ξ makes stress of the slope of C, which jumps there: with a change of the shear
angle over the element, S12 would point the wrong way at small angles. The stabilising tangent
takes a size of the strain that is smooth instead: |g| for |g| >= w, else w (3 + 6 r² - r⁴) / 8
with r = g/w, of class C². It is any tangent that keeps the energy positive, so that the potential
stays exact; the law itself does not change.
"""

from __future__ import annotations

import math

import numpy as np

from lcmchain.jit import equation

# Of the engineering shear strain 2 E12 = sin γ. For MD600 S12 keeps its sign where the shear angle
# changes by up to 19° over an element.
WIDTH = math.sin(math.radians(5.0))


@equation
def rounded_shear(g):
    """Return the rounded size of an engineering shear strain g, and its two derivatives."""
    r = min(abs(g) / WIDTH, 1.0)
    size = max(abs(g), 0.125 * WIDTH * (3.0 + r * r * (6.0 - r * r)))
    first = 0.5 * r * (3.0 - r * r)
    return size, (first if g >= 0.0 else -first), 1.5 * (1.0 - r * r) / WIDTH


def rounded_shear_of(g: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the same for an array of any shape, in NumPy, written apart from the compiled one."""
    r = g / WIDTH
    inside = abs(r) < 1.0
    size = np.where(inside, WIDTH * (3.0 + 6.0 * r**2 - r**4) / 8.0, abs(g))
    first = np.where(inside, (12.0 * r - 4.0 * r**3) / 8.0, np.sign(g))
    second = np.where(inside, (12.0 - 12.0 * r**2) / (8.0 * WIDTH), 0.0)
    return size, first, second
