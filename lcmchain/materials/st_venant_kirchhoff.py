"""St. Venant-Kirchhoff materials: isotropic, orthotropic, or any two stiffness matrices.

S = C : E with a constant C, for the constant part of the strain (membrane, C^M) and for its part
linear and quadratic in the thickness coordinate (bending, C^B), Eq. (19). Voigt order
11, 22, 33, 12, 23, 13 with engineering shear strains.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import equation
from lcmchain.materials.law import bending_stiffness, implements, membrane_response
from lcmchain.materials.stiffness import full_product


class StiffnessLaw(NamedTuple):
    """C^M and C^B [Pa], each (36,) row by row."""

    membrane: np.ndarray
    bending: np.ndarray


@equation
def row(C, i):
    return (C[i], C[i + 1], C[i + 2], C[i + 3], C[i + 4], C[i + 5])


@equation
def rows(C):
    """Return the rows of a matrix (36,)."""
    return (row(C, 0), row(C, 6), row(C, 12), row(C, 18), row(C, 24), row(C, 30))


@implements(membrane_response, StiffnessLaw)
@equation
def stiffness_response(law, E, history):
    C_M = rows(law.membrane)
    return full_product(C_M, E), C_M


@implements(bending_stiffness, StiffnessLaw)
@equation
def stiffness_bending(law):
    return rows(law.bending)


def isotropic_stiffness(young_modulus: float, poisson_ratio: float) -> np.ndarray:
    """Return the isotropic stiffness (6, 6) [Pa] for -1 < nu < 1/2."""
    E, nu = young_modulus, poisson_ratio
    lame = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    shear = E / (2.0 * (1.0 + nu))
    C = np.zeros((6, 6))
    C[:3, :3] = lame
    C[range(3), range(3)] += 2.0 * shear
    C[range(3, 6), range(3, 6)] = shear
    return C


def orthotropic_stiffness(E1, E2, E3, nu12, nu13, nu23, G12, G13, G23) -> np.ndarray:
    """Return the orthotropic stiffness (6, 6) [Pa] from engineering constants, nu_ij/E_i."""
    compliance = np.zeros((6, 6))
    compliance[:3, :3] = [
        [1.0 / E1, -nu12 / E1, -nu13 / E1],
        [-nu12 / E1, 1.0 / E2, -nu23 / E2],
        [-nu13 / E1, -nu23 / E2, 1.0 / E3],
    ]
    compliance[3, 3], compliance[4, 4], compliance[5, 5] = 1.0 / G12, 1.0 / G23, 1.0 / G13
    return np.linalg.inv(compliance)


class StVenantKirchhoff:
    """A material with constant stiffness C^M and C^B (6, 6) [Pa].

    Parameters
    ----------
    membrane, bending : C^M and C^B, symmetric; ``bending`` defaults to ``membrane``.
    thickness : [m]; density : [kg/m³].
    fibre_density : [kg/m³], or None when the material is no textile.
    """

    is_diagonal = False
    constant_tangent = True

    def __init__(self, membrane, bending=None, *, thickness, density, fibre_density=None, name=""):
        self.C_membrane = np.array(membrane, dtype=float)
        self.C_bending = np.array(membrane if bending is None else bending, dtype=float)
        self.thickness = thickness
        self.density = density
        self.areal_mass = density * thickness
        self.fibre_density = fibre_density
        self.name = name
        self.law = StiffnessLaw(self.C_membrane.ravel(), self.C_bending.ravel())

    @classmethod
    def from_scene(cls, spec) -> StVenantKirchhoff:
        """Build from the scene's material with law isotropic, orthotropic or stiffness."""
        bending = None
        if spec.law == "isotropic":
            membrane = isotropic_stiffness(spec.young_modulus, spec.poisson_ratio)
        elif spec.law == "orthotropic":
            membrane = orthotropic_stiffness(
                spec.E1, spec.E2, spec.E3, spec.nu12, spec.nu13, spec.nu23,
                spec.G12, spec.G13, spec.G23,
            )  # fmt: skip
            bending = spec.bending_factor * membrane
        else:
            membrane, bending = np.array(spec.membrane), np.array(spec.bending)
        return cls(
            membrane,
            bending,
            thickness=spec.thickness,
            density=spec.density,
            fibre_density=spec.fibre_density,
            name=spec.name,
        )

    def stress_and_tangent(self, E):
        """Return S^M (..., 6) and C^M broadcast to (..., 6, 6)."""
        E = np.asarray(E)
        return E @ self.C_membrane, np.broadcast_to(self.C_membrane, (*E.shape, 6))

    def tangent_slope(self, E):
        """Return dC_ii/dE_i (..., 6): zero."""
        return np.zeros_like(np.asarray(E))

    def tangent_curvature(self, E):
        """Return d²C_ii/dE_i² (..., 6): zero."""
        return np.zeros_like(np.asarray(E))

    def bending_matrix(self):
        """Return C^B (6, 6)."""
        return self.C_bending

    @property
    def couples_thickness(self) -> bool:
        """Whether other strains than 33 that are linear in ζ cause a stress 33."""
        return bool(self.C_bending[2, [0, 1, 3, 4, 5]].any())

    def membrane_energy(self, E, history=None):
        """Return the stored energy density W^M [J/m³] of the centre strain E (..., 6)."""
        E = np.asarray(E)
        return 0.5 * np.einsum("...i,ij,...j->...", E, self.C_membrane, E)

    def compaction_pressure(self, thickness_stretch, history=None):
        """Return p = λ |S33| [Pa] of compaction without lateral strain; 0 when thicker."""
        stretch = np.asarray(thickness_stretch, dtype=float)
        stress33 = self.C_membrane[2, 2] * 0.5 * (stretch**2 - 1.0)
        return np.where(stretch < 1.0, -stretch * stress33, 0.0)

    def wave_stiffness(self):
        """Return the largest stiffness in the plane and over the thickness, undeformed [Pa]."""
        diagonal = np.maximum(np.diag(self.C_membrane), np.diag(self.C_bending))
        return float(max(diagonal[0], diagonal[1])), float(diagonal[2])
