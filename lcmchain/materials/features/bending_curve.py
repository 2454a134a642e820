"""Bending of the fibres by a measured curve: moment over curvature by points.

The moment per width M(κ) is linear between points, odd in κ, and goes on with its last slope. It
is steepest at the start: fabric softens as its fibres begin to slide. The strain linear in the
thickness is E^ζ = κ h with half the thickness h. The stress S^ζ = h f(κ) with f = 12 M/t0³,
Eq. (19), has the moment M. It has a potential: fabric that is bent back follows the curve again.

As a sum of its kinks, with x = |κ|,

    |f| = B x - Σ_k d_k max(x - x_k, 0),   W = h² (B x² - Σ_k d_k max(x - x_k, 0)²)/2,

where B is the slope at the start, x_k a point, and d_k the fall of the slope there. B stays the
stiffness of the small terms (quadratic in the thickness, gradients of the curvature within an
element), and bounds the step.

Source: moment over curvature of fabrics is no straight line: Kawabata's test and cantilevers at
several lengths; Yu et al. 2021 find that a constant stiffness gives unrealistic wrinkles.

A law of a fabric with a curve is a class of its own with one more parameter (:func:`bent_class`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from lcmchain.jit import equation
from lcmchain.materials.law import bending_excess, bending_stress
from lcmchain.materials.twins import prefixed, twin_of
from lcmchain.quantities.entry_types import PositiveCurvature, PositiveForce, Row, SceneModel, wrong

#: Points of a curve at most, the first at zero left out.
KINKS = 16
# Numbers of a curve: the slope at the start, the kinks, and how much the slope falls at each.
SIZE = 1 + 2 * KINKS


class BendingCurve(NamedTuple):
    """Points of a curve: curvature [1/m] and moment per width [N], both rising from zero."""

    curvature: tuple[float, ...]
    moment: tuple[float, ...]

    @property
    def start_slope(self) -> float:
        """Bending stiffness per width at the start [N m]."""
        return self.moment[0] / self.curvature[0]

    def fault(self) -> str:
        """Say what is wrong with the points; empty where nothing is."""
        if len(self.curvature) != len(self.moment):
            return (
                f"has {len(self.moment)} moments for {len(self.curvature)} curvatures; "
                "give one for each"
            )
        if not 1 <= len(self.curvature) <= KINKS:
            return f"has {len(self.curvature)} points; give 1 to {KINKS}"
        x, y = np.array([0.0, *self.curvature]), np.array([0.0, *self.moment])
        falls = np.flatnonzero((np.diff(x) <= 0.0) | (np.diff(y) <= 0.0))
        if falls.size:
            return f"does not rise at point {falls[0] + 1}; both start above 0 and rise"
        slope = np.diff(y) / np.diff(x)
        if slope.max() > slope[0] * (1.0 + 1e-6):
            number = int(np.argmax(slope))
            return (
                f"is steepest at point {number + 1}, {slope[number]:.4g} N m after "
                f"{slope[0]:.4g} N m at the start, whose slope bounds the step; fabric softens as "
                "it is bent"
            )
        return ""

    def numbers(self, thickness: float) -> np.ndarray:
        """Return B [Pa], the kinks x_k [1/m] and the falls d_k [Pa] (SIZE,) of f over κ."""
        x = np.array([0.0, *self.curvature])
        y = np.array([0.0, *self.moment]) * 12.0 / thickness**3
        slope = np.diff(y) / np.diff(x)
        falls = -np.diff(slope)
        values = np.zeros(SIZE)
        values[0] = slope[0]
        values[1 : 1 + falls.size] = x[1:-1]
        values[1 + KINKS : 1 + KINKS + falls.size] = falls
        return values


def linear_curve(stiffness: float) -> np.ndarray:
    """Return the numbers (SIZE,) of a constant stiffness [Pa]."""
    values = np.zeros(SIZE)
    values[0] = stiffness
    return values


def curve_response(values: np.ndarray, curvature: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return f [Pa/m] and its slope [Pa] of a curve (SIZE,) at curvatures (...), in NumPy."""
    curvature = np.asarray(curvature)
    kinks, falls = values[1 : 1 + KINKS], values[1 + KINKS :]
    x = np.abs(curvature)[..., None]
    beyond = np.maximum(x - kinks, 0.0)
    size = values[0] * x[..., 0] - (falls * beyond).sum(axis=-1)
    slope = values[0] - (falls * (beyond > 0.0)).sum(axis=-1)
    return np.sign(curvature) * size, slope


def curve_energy(values: np.ndarray, curvature: ArrayLike) -> np.ndarray:
    """Return W/h² [Pa/m²] of a curve at curvatures (...), in NumPy."""
    kinks, falls = values[1 : 1 + KINKS], values[1 + KINKS :]
    x = np.abs(np.asarray(curvature))[..., None]
    beyond = np.maximum(x - kinks, 0.0)
    return 0.5 * (values[0] * x[..., 0] ** 2 - (falls * beyond**2).sum(axis=-1))


# --- compiled -------------------------------------------------------------------------------------


@equation
def four_kinks(curve, at, x):
    """Return the sum of d_k max(x - x_k, 0) over four kinks."""
    fall = at + KINKS
    return (
        curve[fall] * max(x - curve[at], 0.0)
        + curve[fall + 1] * max(x - curve[at + 1], 0.0)
        + curve[fall + 2] * max(x - curve[at + 2], 0.0)
        + curve[fall + 3] * max(x - curve[at + 3], 0.0)
    )


@equation
def squared(x):
    return x * x


@equation
def four_energies(curve, at, x):
    """Return the sum of d_k max(x - x_k, 0)² over four kinks."""
    fall = at + KINKS
    return (
        curve[fall] * squared(max(x - curve[at], 0.0))
        + curve[fall + 1] * squared(max(x - curve[at + 1], 0.0))
        + curve[fall + 2] * squared(max(x - curve[at + 2], 0.0))
        + curve[fall + 3] * squared(max(x - curve[at + 3], 0.0))
    )


@equation
def curve_at(curve, start, curvature):
    """Return f of the curve whose numbers begin at ``start``."""
    x, k = abs(curvature), start + 1
    size = curve[start] * x - (four_kinks(curve, k, x) + four_kinks(curve, k + 4, x))
    size -= four_kinks(curve, k + 8, x) + four_kinks(curve, k + 12, x)
    return size if curvature >= 0.0 else -size


@equation
def excess_at(curve, start, curvature):
    """Return 2 W/h² - f κ."""
    x, k = abs(curvature), start + 1
    twice = curve[start] * x * x - (four_energies(curve, k, x) + four_energies(curve, k + 4, x))
    twice -= four_energies(curve, k + 8, x) + four_energies(curve, k + 12, x)
    return twice - x * curve_at(curve, start, x)


@equation
def stress_by_curves(law, C_B, E, inverse_height):
    """Return S^ζ with the curves of both fibre directions in place of C11 and C22."""
    height = 1.0 / inverse_height
    return (
        height * curve_at(law.curves, 0, E[0] * inverse_height),
        height * curve_at(law.curves, SIZE, E[1] * inverse_height),
        C_B[2] * E[2],
        C_B[3] * E[3],
        C_B[4] * E[4],
        C_B[5] * E[5],
    )


@equation
def excess_by_curves(law, E, inverse_height):
    """Return 2 W^B - S^ζ:E^ζ."""
    first = excess_at(law.curves, 0, E[0] * inverse_height)
    second = excess_at(law.curves, SIZE, E[1] * inverse_height)
    return (first + second) / (inverse_height * inverse_height)


# --- laws -----------------------------------------------------------------------------------------


def bent_class(law_class: type) -> Any:
    """Return the twin of a class of laws that bends by curves, see :func:`.twins.twin_of`."""
    return twin_of(
        law_class,
        "Bent",
        about=", and (2 SIZE,) of both curves.",
        entries=[("curves", np.ndarray)],
        answers={bending_stress: stress_by_curves, bending_excess: excess_by_curves},
    )


class BendingLaw(Protocol):
    """A law, a NamedTuple, with bending moduli along both directions of fibres [Pa]."""

    @property
    def B11(self) -> float: ...

    @property
    def B22(self) -> float: ...

    def __iter__(self) -> Iterator[Any]: ...

    def _asdict(self) -> dict[str, Any]: ...


def with_curves(law: BendingLaw, curves: Sequence[BendingCurve | None], thickness: float) -> Any:
    """Return a law that bends by the curves of its two directions, or the law itself without any.

    B11 and B22 become the slopes of the curves at the start.
    """
    if not any(curves):
        return law
    values = [
        linear_curve(stiffness) if curve is None else curve.numbers(thickness)
        for curve, stiffness in zip(curves, (law.B11, law.B22), strict=True)
    ]
    first, second = values
    parameters = law._asdict() | {"B11": float(first[0]), "B22": float(second[0])}
    return prefixed(law, "Bent")(**parameters, curves=np.concatenate(values))


# --- scene ----------------------------------------------------------------------------------------


class BendingCurveTable(SceneModel):
    """Moment per width over curvature, by points from zero; it softens, and goes on straight."""

    curvature: Annotated[
        tuple[PositiveCurvature, ...], Row('"2 5 20 1/m"', minimum_count=1, entries="curvatures")
    ] = Field(description=f"Curvatures of the points, increasing, {KINKS} at most.")
    moment: Annotated[
        tuple[PositiveForce, ...], Row('"0.24 0.32 0.38 N"', minimum_count=1, entries="moments")
    ] = Field(description="Moments per width at these curvatures [N m/m].")

    @property
    def curve(self) -> BendingCurve:
        """The points."""
        return BendingCurve(self.curvature, self.moment)

    @model_validator(mode="after")
    def _check_points(self) -> Self:
        if fault := self.curve.fault():
            raise wrong(fault, field="moment")
        return self
