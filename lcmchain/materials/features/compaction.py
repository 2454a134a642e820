"""Compaction of a fabric, C33 = c0 exp(c1 |E33|^c2): stiffening under pressure, or not.

Source: Schäfer, Mitsch, Kärger, Eq. (23). The law costs an exponential and a logarithm per element
and step. A fabric that states no growth (c1 = 0) keeps the C33 of the undeformed fabric. Its law is
a class of its own with the same parameters (:func:`linear_class`), and its kernels hold neither.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np

from lcmchain.dispatch import optional
from lcmchain.jit import equation
from lcmchain.materials.features.elementary import exponential, logarithm
from lcmchain.materials.twins import prefixed, twin_of

# Below this strain the exponent of the compaction law is zero to double precision for c2 >= 1.
SMALLEST_COMPACTION_STRAIN = 1e-16


class CompactionLaw(Protocol):
    """A law, a NamedTuple, with the parameters of Eq. (23): c0 [Pa], c1 and c2 [1]."""

    @property
    def c0(self) -> float: ...

    @property
    def c1(self) -> float: ...

    @property
    def c2(self) -> float: ...

    def __iter__(self) -> Iterator[Any]: ...


@optional
def compaction_stress_and_tangent(law, E33):
    """Return S33 and dS33/dE33, Eq. (23): stiffening in compression, c0 in thickening."""
    e = max(-E33, SMALLEST_COMPACTION_STRAIN)
    exponent = law.c1 * exponential(law.c2 * logarithm(e))
    modulus = law.c0 * exponential(min(exponent, 600.0))
    return modulus * E33, modulus * (1.0 + law.c2 * exponent)


@optional
def compaction_tangent_slope(law, E33):
    """Return d²S33/dE33², the slope of the compaction tangent (0 in thickening)."""
    e = max(-E33, SMALLEST_COMPACTION_STRAIN)
    exponent = law.c1 * exponential(law.c2 * logarithm(e))
    modulus = law.c0 * exponential(min(exponent, 600.0))
    return -modulus * (law.c2 * exponent / e) * (1.0 + law.c2 + law.c2 * exponent)


@optional
def compaction_tangent_curvature(law, E33):
    """Return d³S33/dE33³ (0 in thickening)."""
    if E33 >= 0.0:
        return 0.0  # e**(c2 - 2) below would grow without bound for c2 < 2
    e = max(-E33, SMALLEST_COMPACTION_STRAIN)
    c2 = law.c2
    X = law.c1 * exponential(c2 * logarithm(e))
    modulus = law.c0 * exponential(min(X, 600.0))
    first = c2 * X / e
    second = (c2 - 1.0) * first / e
    factor = 1.0 + c2 + c2 * X
    return modulus * (first * first * (factor + c2) + second * factor)


def compaction_of(
    c0: float, c1: float, c2: float, E33: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return S33 and dS33/dE33, Eq. (23), in NumPy."""
    exponent = c1 * np.maximum(-E33, 0.0) ** c2
    modulus = c0 * np.exp(exponent)
    return modulus * E33, modulus * (1.0 + c2 * exponent)


@equation
def linear_stress_and_tangent(law, E33):
    return law.c0 * E33, law.c0


@equation
def no_tangent_change(law, E33):
    return 0.0


def linear_class(law_class: type) -> Any:
    """Return the twin of a class of laws whose C33 never changes, see :func:`.twins.twin_of`."""
    return twin_of(
        law_class,
        "Linear",
        about=", with a constant C33.",
        answers={
            compaction_stress_and_tangent: linear_stress_and_tangent,
            compaction_tangent_slope: no_tangent_change,
            compaction_tangent_curvature: no_tangent_change,
        },
    )


def linear_where_constant(law: CompactionLaw) -> Any:
    """Return the law itself, or its twin of :func:`linear_class` where c1 is 0."""
    return law if law.c1 != 0.0 else prefixed(law, "Linear")(*law)
