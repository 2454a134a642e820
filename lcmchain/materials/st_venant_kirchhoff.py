"""St. Venant-Kirchhoff materials: isotropic, orthotropic, or any two stiffness matrices.

S = C : E with a constant C, for the constant part of the strain (membrane, C^M) and for its part
linear and quadratic in the thickness coordinate (bending, C^B), Eq. (19). Voigt order
11, 22, 33, 12, 23, 13 with engineering shear strains.
"""

from __future__ import annotations

import numpy as np

from lcmchain.jit import equation


@equation
def row(law, i):
    return (law[i], law[i + 1], law[i + 2], law[i + 3], law[i + 4], law[i + 5])


@equation
def membrane_rows(law):
    """Return the rows of C^M from the flat law (72,)."""
    return (row(law, 0), row(law, 6), row(law, 12), row(law, 18), row(law, 24), row(law, 30))


@equation
def bending_rows(law):
    """Return the rows of C^B from the flat law (72,)."""
    return (row(law, 36), row(law, 42), row(law, 48), row(law, 54), row(law, 60), row(law, 66))


@equation
def row_product(c, E):
    return c[0] * E[0] + c[1] * E[1] + c[2] * E[2] + c[3] * E[3] + c[4] * E[4] + c[5] * E[5]


@equation
def stress(C, E):
    """Return S = C : E for the rows of C."""
    return (
        row_product(C[0], E),
        row_product(C[1], E),
        row_product(C[2], E),
        row_product(C[3], E),
        row_product(C[4], E),
        row_product(C[5], E),
    )


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

    def __init__(self, membrane, bending=None, *, thickness, density, fibre_density=None, name=""):
        self.C_membrane = np.array(membrane, dtype=float)
        self.C_bending = np.array(membrane if bending is None else bending, dtype=float)
        self.thickness = thickness
        self.density = density
        self.areal_mass = density * thickness
        self.fibre_density = fibre_density
        self.name = name
        self.law = np.concatenate([self.C_membrane.ravel(), self.C_bending.ravel()])

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

    def membrane_energy(self, E):
        """Return the stored energy density W^M [J/m³] of the centre strain E (..., 6)."""
        E = np.asarray(E)
        return 0.5 * np.einsum("...i,ij,...j->...", E, self.C_membrane, E)

    def compaction_pressure(self, thickness_stretch):
        """Return p = λ |S33| [Pa] of compaction without lateral strain; 0 when thicker."""
        stretch = np.asarray(thickness_stretch, dtype=float)
        stress33 = self.C_membrane[2, 2] * 0.5 * (stretch**2 - 1.0)
        return np.where(stretch < 1.0, -stretch * stress33, 0.0)
