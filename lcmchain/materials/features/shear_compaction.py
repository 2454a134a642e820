"""Shear-compaction coupling: how the thickness that a fabric would take grows as it is sheared.

The energy of compaction W33 of :mod:`.compaction` is taken at a strain E'. It is counted from the
thickness that the sheared fabric takes without pressure,

    1 + 2 E' = (1 + 2 E33) a,  a = (1 - g²)^β,  g = 2 E12 = sin γ,

for fibres that keep their length: E' belongs to the stretch λ cos^β γ. Without pressure the fabric
then thickens as cos^-β γ. With β = 0 the thickness does not depend on the shear. β = 1 keeps the
fibre volume fraction: the pressure on the present area is that of the unsheared law at the same
fibre volume fraction. One potential gives all that follows,

    S33 = a S,  S12 = -τ m S,  with S = dW33/dE', m = 1 + 2 E', τ = β g / (1 - g²),

so that a fabric under pressure resists shear more. The published shear law holds as it is wherever
nothing presses.

A table of pressures (:mod:`.pressure_table`) states the strain as another map ε(E33, g), a
:class:`StrainMap`. With S = dW33/dε and C = dS/dε, stress and tangent follow by the chain rule,

    S33 = S ε_E,  S12 += S ε_g,  C33 = C ε_E² + S ε_EE,  C12 += C ε_g² + S ε_gg.

The tangent that stabilises the element (Eq. 18) is then C m² in place of C33, with the stretch m(g)
of the map: as large, without the second derivatives of ε.

Source: the fibre volume fraction as what governs the compaction of sheared fabric, Schäfer, Mitsch,
Kärger, references 87 and 88; the form is the simplest potential with both limits (manual: theory).

A law of a fabric with the coupling is a class of its own with one more parameter
(:func:`coupled_class`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.dispatch import implements, optional
from lcmchain.jit import equation
from lcmchain.materials.features.elementary import exponential, logarithm
from lcmchain.materials.law import Material, TangentCoupling
from lcmchain.materials.twins import LawOrTwin, prefixed, twin_of

#: Beyond sin² γ of 84 degrees the thickness no longer follows the shear: 1/cos has no end.
LARGEST_SQUARE = 0.99


class Thickening(NamedTuple):
    """What the shear does to the compaction strain: E', a, τ, and dτ/dg."""

    strain: Any
    a: Any
    tau: Any
    rate: Any


class StrainMap(NamedTuple):
    """The strain ε that a law of compaction sees, and its derivatives with E33 and g = 2 E12.

    m, m_g, m_gg : the stretch of the map that stabilises the elements, and its derivatives.
    """

    strain: np.ndarray
    E: np.ndarray
    g: np.ndarray
    EE: np.ndarray
    Eg: np.ndarray
    gg: np.ndarray
    m: np.ndarray
    m_g: np.ndarray
    m_gg: np.ndarray


# --- compiled -------------------------------------------------------------------------------------


@optional
def thickening(law, E33, g):
    """Return :class:`Thickening` at the shear strain g; ``None`` for a law without the coupling."""
    return None


@equation
def power_thickening(law, E33, g):
    beta = law.shear_coupling
    square = g * g
    rest = 1.0 - min(square, LARGEST_SQUARE)
    a = exponential(beta * logarithm(rest))
    inverse = 1.0 / rest
    follows = beta * inverse if square < LARGEST_SQUARE else 0.0
    strain = E33 * a + 0.5 * (a - 1.0)
    return Thickening(strain, a, follows * g, follows * (1.0 + square) * inverse)


@equation
def strain_of(thickening, E33):
    """Return the strain that the compaction law sees."""
    if thickening is None:
        return E33
    return thickening.strain


@optional
def pressed(thickening, S33, C33, S12, C12):
    """Return S33, C33, S12, C12 with what S33 and C33 at the strain of ``thickening`` make."""
    a, tau = thickening.a, thickening.tau
    m = 1.0 + 2.0 * thickening.strain
    stress = -tau * m * S33
    tangent = m * ((2.0 * tau * tau - thickening.rate) * S33 + tau * tau * m * C33)
    return a * S33, a * a * C33, S12 + stress, C12 + tangent


@optional
def stabilising_at_shear(thickening, own33, C33):
    """Return the stabilising C33, where C33 of the element's own is ``own33``."""
    return own33


@optional
def slope_at_shear(thickening, slope33):
    """Return dC33/dE33 of the stabilising C33; ``slope33`` is that at the strain it sees."""
    return thickening.a * thickening.a * thickening.a * slope33


@optional
def curvature_at_shear(thickening, slope33, curvature33):
    """Return d²C33/dE33²."""
    square = thickening.a * thickening.a
    return square * square * curvature33


@optional
def shear_tangents(thickening, S33, C33, slope33, curvature33):
    """Return the :class:`TangentCoupling`."""
    a, tau = thickening.a, thickening.tau
    m = 1.0 + 2.0 * thickening.strain
    bracket = 4.0 * C33 + m * slope33
    bracket_rate = 6.0 * slope33 + m * curvature33
    return TangentCoupling(
        -a * tau * (2.0 * S33 + m * C33),
        -a * a * tau * bracket,
        -a * a * a * tau * bracket_rate,
        a * a * ((4.0 * tau * tau - thickening.rate) * bracket + tau * tau * m * bracket_rate),
    )


@equation
def with_thickening(thickening, S33, C33, S12, C12):
    """Return S33, C33, S12, C12 of a law whose compaction answers S33 and C33 to E'."""
    if thickening is None:
        return S33, C33, S12, C12
    return pressed(thickening, S33, C33, S12, C12)


# --- of a strain that is any map of thickness and shear -------------------------------------------
# The same functions serve kernels and, as plain Python, arrays.


@implements(pressed, StrainMap)
@equation
def mapped_pressure(m, S33, C33, S12, C12):
    """Return S33, C33, S12 and C12 with what S and C at ε make of the shear stress."""
    return (
        m.E * S33,
        m.E * m.E * C33 + m.EE * S33,
        S12 + m.g * S33,
        C12 + m.gg * S33 + m.g * m.g * C33,
    )


@implements(stabilising_at_shear, StrainMap)
@equation
def mapped_stabilising(m, own33, C33):
    """Return the stabilising C33."""
    return m.m * m.m * C33


@implements(slope_at_shear, StrainMap)
@equation
def mapped_slope(m, slope33):
    """Return the derivative of the stabilising C33 with E33."""
    return m.m * m.m * m.E * slope33


@implements(curvature_at_shear, StrainMap)
@equation
def mapped_curvature(m, slope33, curvature33):
    """Return the second derivative of the stabilising C33 with E33."""
    return m.m * m.m * (m.E * m.E * curvature33 + m.EE * slope33)


@implements(shear_tangents, StrainMap)
@equation
def mapped_coupling(m, S33, C33, slope33, curvature33):
    """Return dS33/dg, and dC33/dg, d²C33/dE33dg and d²C33/dg² of the stabilising C33."""
    square, change = m.m * m.m, 2.0 * m.m * m.m_g  # of m² with g
    bent = 2.0 * (m.m_g * m.m_g + m.m * m.m_gg)
    return TangentCoupling(
        m.E * m.g * C33 + m.Eg * S33,
        square * m.g * slope33 + change * C33,
        square * (m.E * m.g * curvature33 + m.Eg * slope33) + change * m.E * slope33,
        square * (m.g * m.g * curvature33 + m.gg * slope33)
        + 2.0 * change * m.g * slope33
        + bent * C33,
    )


# --- laws -----------------------------------------------------------------------------------------


def coupled_class(law_class: type) -> Any:
    """Return the twin of a class of laws whose thickness depends on its shear."""
    return twin_of(
        law_class,
        "Coupled",
        about=" and β.",
        entries=[("shear_coupling", float)],
        answers={thickening: power_thickening},
    )


# --- plain Python ---------------------------------------------------------------------------------


class Coupling(Protocol):
    """How the thickness of a fabric depends on its shear, in NumPy."""

    def law_of(self, law: LawOrTwin) -> LawOrTwin:
        """Return the twin of a law with the coupling."""

    def at(self, E33: ArrayLike, g: ArrayLike) -> StrainMap:
        """Return the strain that the compaction law sees, and its derivatives with E33 and g."""

    def free_stretch(self, g: ArrayLike) -> np.ndarray:
        """Return the thickness stretch without pressure at shear strains g = sin γ."""

    def pressure(
        self, unsheared: Callable[[np.ndarray], np.ndarray], stretch: np.ndarray, g: ArrayLike
    ) -> np.ndarray:
        """Return the pressure of plates [Pa] on the area at the start; ``unsheared`` without g."""

    def in_words(self) -> str:
        """Say what the shear does to the sheet."""


@dataclass(frozen=True)
class PowerCoupling:
    """The coupling by one exponent β."""

    beta: float

    def law_of(self, law: LawOrTwin) -> LawOrTwin:
        """Return the twin of a law with the coupling."""
        return prefixed(law, "Coupled")(*law, self.beta)

    def at(self, E33: ArrayLike, g: ArrayLike) -> StrainMap:
        """Return E' = (1/2 + E33) a - 1/2 and its derivatives."""
        g, beta = np.asarray(g), self.beta
        square = np.minimum(g * g, LARGEST_SQUARE)
        rest, follows = 1.0 - square, g * g < LARGEST_SQUARE
        half, a = 0.5 + np.asarray(E33), rest**beta
        first = np.where(follows, -2.0 * beta * g * rest ** (beta - 1.0), 0.0)
        second = -2.0 * beta * rest ** (beta - 2.0) * (rest - 2.0 * (beta - 1.0) * square)
        second = np.where(follows, second, 0.0)
        none = np.zeros_like(half * a)
        return StrainMap(
            half * a - 0.5, a, half * first, none, first, half * second,
            a, first, second,
        )  # fmt: skip

    def free_stretch(self, g: ArrayLike) -> np.ndarray:
        """Return cos^-β γ."""
        return thickening_stretch(self.beta, g)

    def pressure(
        self, unsheared: Callable[[np.ndarray], np.ndarray], stretch: np.ndarray, g: ArrayLike
    ) -> np.ndarray:
        """Return the pressure of plates [Pa] on the area at the start."""
        free = self.free_stretch(g)
        return unsheared(stretch / free) / free

    def in_words(self) -> str:
        """Say what the shear does to the sheet."""
        return f"sheared by γ the sheet is thicker by 1/cos(γ)^{self.beta:g} without pressure"


def coupling_of(material: Material) -> Coupling | None:
    """Return how the thickness of a material depends on its shear, None where it does not."""
    return getattr(material, "coupling", None)


def free_stretch(material: Material, shear_strain: ArrayLike) -> np.ndarray:
    """Return the thickness stretch that a material takes without pressure at shear strains g."""
    coupling = coupling_of(material)
    if coupling is None:
        return np.ones(np.shape(shear_strain))
    return coupling.free_stretch(shear_strain)


def free_shear_stress(material: Material, shear_angle: ArrayLike) -> np.ndarray:
    """Return S12 [Pa] of a material sheared by angles [rad], whose thickness nothing holds."""
    strain = np.zeros((*np.shape(shear_angle), 6))
    strain[..., 3] = np.sin(shear_angle)
    strain[..., 2] = 0.5 * (free_stretch(material, strain[..., 3]) ** 2 - 1.0)
    return material.stress_and_tangent(strain)[0][..., 3]


def thickening_stretch(shear_coupling: float, shear_strain: ArrayLike) -> np.ndarray:
    """Return cos^-β γ, the thickness stretch without pressure at shear strains g = sin γ."""
    square = np.minimum(np.square(shear_strain), LARGEST_SQUARE)
    return (1.0 - square) ** (-0.5 * shear_coupling)
