"""What the hyperelastic laws of films share: a sheet of rubber that keeps its volume.

    W = Ψ(c1, c2) + K/2 (J - 1)² + μ/2 ((2 E13)² + (2 E23)²)

Ψ is the energy of the incompressible sheet in plane stress, a function of the eigenvalues c1, c2 of
the right Cauchy-Green tensor C in the plane alone: the stretch over the thickness in it is
1/(λ1 λ2). J² = C33 (C11 C22 - C12²) is the real change of volume, with the real thickness.

A sheet that nothing presses on takes J = 1 and has the stress of the incompressible law exactly,
whatever the bulk modulus K is. Under a pressure p on its faces J - 1 is about -p/K, and its stress
is that of the incompressible law less p in all directions, as it should be. So K has to be large
beside the pressure, not beside the shear modulus μ, and may be low for the sake of the step. With
(J - 1)² the force on the thickness is linear in the thickness. A thickness that vibrates under a
stiffening force would gain energy from central differences where its period is near three steps,
and steps are that long where the thickness governs them.

This suits a solid-shell with one point in the plane: its thickness is free in every element, so
that J = 1 locks nothing. Strains that vary along ζ see the incompressible sheet in plane stress at
rest. The terms that stabilise the element take a constant diagonal stiffness without K: they have a
potential of their own, and no volume to lock.

Derivatives are taken over the mean m = (c1 + c2)/2 and half the difference r of the eigenvalues.
All energies are even in r, so that every quotient by r below has a limit where both stretches are
equal.
Sources: Ogden, Proc. R. Soc. A 326 (1972) 565 and 328 (1972) 567; Holzapfel, "Nonlinear Solid
Mechanics", 6.4 and 6.5.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from lcmchain.jit import equation
from lcmchain.materials.stiffness import Orthotropic
from lcmchain.materials.table import MaterialTable
from lcmchain.quantities.entry_types import AbsentMeans, Density, Modulus, PositiveLength

#: Bulk modulus by default, in shear moduli: as stiff as vacuum asks for, and no dearer.
BULK_OVER_SHEAR = 25.0
#: Stabilising stiffness of 11, 22, 33, 12, 23, 13, in shear moduli.
STABILISING = (0.3, 0.3, 1.0, 0.1, 0.3, 0.3)


class PlaneTerms(NamedTuple):
    """Derivatives of an energy Ψ(m, r) that is even in r.

    mean : Ψ_m. ratio : Ψ_r / r. mean2 : Ψ_mm. mixed : Ψ_mr / r. change : (Ψ_rr - Ψ_r / r) / r².
    """

    mean: Any
    ratio: Any
    mean2: Any
    mixed: Any
    change: Any


# --- compiled -------------------------------------------------------------------------------------


@equation
def of_determinant(m, slope, curvature):
    """Return the :class:`PlaneTerms` of h(D), D = m² - r², from h' and h''."""
    return PlaneTerms(
        2.0 * m * slope,
        -2.0 * slope,
        2.0 * slope + 4.0 * m * m * curvature,
        -4.0 * m * curvature,
        4.0 * curvature,
    )


@equation
def plus_terms(a, b):
    return PlaneTerms(a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4])


@equation
def sheet_response(terms, shear, bulk, E):
    """Return S (6) and the rows of C of a sheet of rubber.

    terms : :class:`PlaneTerms` of the incompressible sheet at E.
    """
    C11, C22, C33, C12 = 1.0 + 2.0 * E[0], 1.0 + 2.0 * E[1], 1.0 + 2.0 * E[2], E[3]
    m, d = 0.5 * (C11 + C22), 0.5 * (C11 - C22)
    D = C11 * C22 - C12 * C12
    J = math.sqrt(C33 * D)
    half = 0.5 * bulk
    volume = of_determinant(m, half * (J - 1.0) * J / D, 0.5 * half * J / (D * D))
    mean, ratio, mean2, mixed, change = plus_terms(terms, volume)
    S33 = bulk * (J - 1.0) * J / C33
    of_area = bulk * (2.0 - 1.0 / J)  # dS33 over that of D
    S = (mean + ratio * d, mean - ratio * d, S33, ratio * C12, shear * E[4], shear * E[5])
    # with dm = dE11 + dE22, dd = dE11 - dE22 and dC12 = 2 dE12
    even, odd = mean2 + ratio + change * d * d, 2.0 * mixed * d
    side = mixed + change * d
    other = mixed - change * d
    C_12 = mean2 - ratio - change * d * d
    rows = (
        (even + odd, C_12, of_area * C22, side * C12, 0.0, 0.0),
        (C_12, even - odd, of_area * C11, other * C12, 0.0, 0.0),
        (of_area * C22, of_area * C11, bulk * J / (C33 * C33), -of_area * C12, 0.0, 0.0),
        (side * C12, other * C12, -of_area * C12, ratio + change * C12 * C12, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, shear, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, shear),
    )
    return S, rows


@equation
def sheet_bending(shear):
    """Return C^B: the incompressible sheet in plane stress at rest, apart from the normal."""
    return Orthotropic(
        4.0 * shear, 4.0 * shear, 4.0 * shear, 2.0 * shear, 0.0, 0.0, shear, shear, shear
    )


@equation
def sheet_bending_rows(shear):
    """Return the rows of :func:`sheet_bending`."""
    return (
        (4.0 * shear, 2.0 * shear, 0.0, 0.0, 0.0, 0.0),
        (2.0 * shear, 4.0 * shear, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 4.0 * shear, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, shear, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, shear, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, shear),
    )


@equation
def sheet_stabilising(shear):
    """Return the rows of the constant stiffness that stabilises the element, a diagonal one."""
    s = STABILISING
    return (
        (s[0] * shear, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, s[1] * shear, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, s[2] * shear, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, s[3] * shear, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, s[4] * shear, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, s[5] * shear),
    )


# --- plain ----------------------------------------------------------------------------------------


class RubberLaw(Protocol):
    """Parameters that all laws of rubber have: shear modulus at rest and bulk modulus [Pa]."""

    @property
    def shear(self) -> float: ...

    @property
    def bulk(self) -> float: ...


class Hyperelastic:
    """A sheet of rubber with the constants of its law; energies by the principal stretches.

    Parameters
    ----------
    law : NamedTuple of the parameters.
    thickness : [m]. density : [kg/m³].

    A law's own class gives ``_energy_of(c)``, the share of one principal value c = λ² in the
    energy, with its two derivatives; the third principal value is 1/(c1 c2).
    """

    is_diagonal = False
    constant_tangent = False
    compacts = True  # of C33 over E33; the force on the thickness is linear in it
    shear_range: float | None = None
    locks = False
    couples_thickness = False
    has_directions = False
    fibre_density: float | None = None
    fibre_bending = (0.0, 0.0)
    fibre_angles: tuple[float, ...] = ()

    def __init__(self, law: RubberLaw, *, thickness: float, density: float, name: str = "") -> None:
        self.law = law
        self.thickness = thickness
        self.density = density
        self.areal_mass = density * thickness
        self.name = name

    def _energy_of(self, c: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return w(c), w'(c) and w''(c), where W = w(c1) + w(c2) + w(1/(c1 c2))."""
        raise NotImplementedError

    def membrane_energy(self, E: ArrayLike, history: np.ndarray | None = None) -> np.ndarray:
        """Return the stored energy density W^M [J/m³] of the centre strain E (..., 6)."""
        E = np.asarray(E)
        C33, (m, _, r) = 1.0 + 2.0 * E[..., 2], _mean_and_difference(E)
        D = m * m - r * r
        energy = self._energy_of(m + r)[0] + self._energy_of(m - r)[0]
        energy = energy + self._energy_of(1.0 / D)[0]
        volume = 0.5 * self.law.bulk * (np.sqrt(C33 * D) - 1.0) ** 2
        return energy + volume + 0.5 * self.law.shear * (E[..., 4] ** 2 + E[..., 5] ** 2)

    def stress_and_tangent(self, E: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return S^M (..., 6) and C^M (..., 6, 6), by the principal axes in the plane."""
        E = np.asarray(E)
        K, C33, (m, d, r) = self.law.bulk, 1.0 + 2.0 * E[..., 2], _mean_and_difference(E)
        gamma, D = E[..., 3], m * m - r * r
        J = np.sqrt(C33 * D)
        (_, p1, q1), (_, p2, q2) = self._energy_of(m + r), self._energy_of(m - r)
        (_, p3, q3) = self._energy_of(1.0 / D)
        # of the part of D alone, with 1/D as the third principal value
        slope = -p3 / D**2 + 0.5 * K * (J - 1.0) * J / D
        bend = q3 / D**4 + 2.0 * p3 / D**3 + 0.25 * K * J / D**2
        # derivatives over (m, d, γ); e is the unit vector of (d, γ)
        near = np.abs(r) < 1e-5 * np.abs(m)  # closer the quotients lose their digits
        safe = np.where(near, 1.0, r)
        ratio = np.where(near, 0.5 * (q1 + q2), (p1 - p2) / (2.0 * safe))
        e = np.stack([np.where(near, 1.0, d / safe), np.where(near, 0.0, gamma / safe)], axis=-1)
        g = np.stack([d, gamma], axis=-1)
        S_mean = p1 + p2 + 2.0 * m * slope
        S_turn = (2.0 * ratio - 2.0 * slope)[..., None] * g
        M = np.zeros((*E.shape[:-1], 3, 3), dtype=S_turn.dtype)
        M[..., 0, 0] = q1 + q2 + 2.0 * slope + 4.0 * m * m * bend
        mixed = (q1 - q2)[..., None] * e - (4.0 * m * bend)[..., None] * g
        M[..., 0, 1:], M[..., 1:, 0] = mixed, mixed
        ee = e[..., :, None] * e[..., None, :]
        M[..., 1:, 1:] = (
            (q1 + q2)[..., None, None] * ee
            + (2.0 * ratio)[..., None, None] * (np.eye(2) - ee)
            - (2.0 * slope)[..., None, None] * np.eye(2)
            + (4.0 * bend)[..., None, None] * g[..., :, None] * g[..., None, :]
        )
        # (m, d, γ) of (E11, E22, 2 E12)
        read = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
        in_plane = [0, 1, 3]
        S = np.zeros(E.shape, dtype=M.dtype)
        S[..., in_plane] = np.concatenate([S_mean[..., None], S_turn], axis=-1) @ read
        S[..., 2] = K * (J - 1.0) * J / C33
        S[..., 4:] = self.law.shear * E[..., 4:]
        C = np.zeros((*E.shape, 6), dtype=M.dtype)
        C[..., np.ix_(in_plane, in_plane)[0], np.ix_(in_plane, in_plane)[1]] = read.T @ M @ read
        of_D = (K * (2.0 - 1.0 / J))[..., None] * np.stack([m - d, m + d, -gamma], axis=-1)
        C[..., in_plane, 2], C[..., 2, in_plane] = of_D, of_D
        C[..., 2, 2] = K * J / C33**2
        C[..., 4, 4] = C[..., 5, 5] = self.law.shear
        return S, C

    def stabilising_tangent(self, E: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the constant stiffness (..., 6, 6) that stabilises, its slope and curvature."""
        E = np.asarray(E)
        C = self.law.shear * np.diag(STABILISING)
        return np.broadcast_to(C, (*E.shape, 6)), np.zeros_like(E), np.zeros_like(E)

    def tangent_slope(self, E: ArrayLike) -> np.ndarray:
        """Return the slope (..., 6) of the stabilising stiffness: zero."""
        return np.zeros_like(np.asarray(E))

    def tangent_curvature(self, E: ArrayLike) -> np.ndarray:
        """Return the curvature (..., 6) of the stabilising stiffness: zero."""
        return np.zeros_like(np.asarray(E))

    def bending_matrix(self) -> np.ndarray:
        """Return C^B (6, 6): the incompressible sheet in plane stress at rest."""
        C = np.diag([4.0, 4.0, 4.0, 1.0, 1.0, 1.0])
        C[0, 1] = C[1, 0] = 2.0
        return self.law.shear * C

    def compaction_pressure(
        self, thickness_stretch: ArrayLike, history: np.ndarray | None = None
    ) -> np.ndarray:
        """Return p = λ |S33| [Pa] of compaction without lateral strain; 0 when thicker."""
        stretch = np.asarray(thickness_stretch, dtype=float)
        return np.where(stretch < 1.0, self.law.bulk * (1.0 - stretch), 0.0)

    def wave_stiffness(self) -> tuple[float, float]:
        """Return the largest stiffness in the plane and over the thickness, undeformed [Pa]."""
        return 4.0 * self.law.shear + self.law.bulk, max(self.law.bulk, 4.0 * self.law.shear)


def _mean_and_difference(E: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return m, d = (C11 - C22)/2 and r of the strains (..., 6); real or complex."""
    d = E[..., 0] - E[..., 1]
    return 1.0 + E[..., 0] + E[..., 1], d, np.sqrt(d * d + E[..., 3] ** 2)


# --- scene ----------------------------------------------------------------------------------------


class HyperelasticMaterial(MaterialTable):
    """Entries that the hyperelastic laws share."""

    has_directions: ClassVar[bool] = False
    fibre_density: ClassVar[float | None] = None

    thickness: PositiveLength = Field(description="Thickness of the film.")
    density: Density = Field(description="Mass per volume.")
    bulk_modulus: Annotated[Modulus | None, AbsentMeans(f"{BULK_OVER_SHEAR:g} shear moduli")] = (
        Field(
            default=None,
            description="Resistance to a pressure over the thickness: the film gets thinner by the "
            "pressure over it. It changes nothing where the film is stretched alone; a high one "
            "makes steps short.",
        )
    )

    @property
    def areal_mass(self) -> float:
        """Mass per area [kg/m²]."""
        return self.density * self.thickness

    @property
    def shear_modulus_at_rest(self) -> float:
        """Shear modulus of the undeformed film [Pa]."""
        raise NotImplementedError

    @property
    def bulk(self) -> float:
        """Bulk modulus that is taken [Pa]."""
        if self.bulk_modulus is not None:
            return self.bulk_modulus
        return BULK_OVER_SHEAR * self.shear_modulus_at_rest

    @property
    def fibre_angles(self) -> tuple[float, ...]:
        """No families of fibres."""
        return ()
