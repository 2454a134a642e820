"""St. Venant-Kirchhoff materials: isotropic, orthotropic, or any two stiffness matrices.

S = C : E with a constant C, for the constant part of the strain (membrane, C^M) and for its part
linear and quadratic in the thickness coordinate (bending, C^B), Eq. (19). Voigt order
11, 22, 33, 12, 23, 13 with engineering shear strains.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, field_validator, model_validator

from lcmchain.jit import equation
from lcmchain.materials.law import bending_stiffness, implements, membrane_response
from lcmchain.materials.stiffness import (
    COLUMNS,
    ROWS,
    Orthotropic,
    full_product,
    orthotropic_product,
)
from lcmchain.materials.table import MaterialTable
from lcmchain.quantities.entry_types import (
    POSITIVE,
    AbsentMeans,
    Density,
    Modulus,
    Number,
    PositiveLength,
    Range,
    Row,
    Stiffness,
    Text,
    wrong,
)


class StiffnessLaw(NamedTuple):
    """C^M and C^B [Pa], each (36,) row by row."""

    membrane: np.ndarray
    bending: np.ndarray


class OrthotropicLaw(NamedTuple):
    """C^M and C^B [Pa] that couple the normal strains alone, each (9,) as ``Orthotropic``."""

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


@equation
def moduli(C):
    """Return the moduli of (9,)."""
    return Orthotropic(C[0], C[1], C[2], C[3], C[4], C[5], C[6], C[7], C[8])


@implements(membrane_response, OrthotropicLaw)
@equation
def orthotropic_response(law, E, history):
    C_M = moduli(law.membrane)
    return orthotropic_product(C_M, E), C_M


@implements(bending_stiffness, OrthotropicLaw)
@equation
def orthotropic_bending(law):
    return moduli(law.bending)


def law_of_stiffness(membrane: np.ndarray, bending: np.ndarray) -> OrthotropicLaw | StiffnessLaw:
    """Return the law of C^M and C^B (6, 6) that computes no product with what is zero in both."""
    if all(_couples_normal_strains_alone(C) for C in (membrane, bending)):
        return OrthotropicLaw(membrane[ROWS, COLUMNS], bending[ROWS, COLUMNS])
    return StiffnessLaw(membrane.ravel(), bending.ravel())


def _couples_normal_strains_alone(C: np.ndarray) -> bool:
    """Tell whether nine moduli are all of C; of an unsymmetric one they are a part."""
    rest = C.copy()
    rest[ROWS, COLUMNS] = rest[COLUMNS, ROWS] = 0.0
    return not rest.any() and np.allclose(C, C.T, rtol=1e-12, atol=0.0)


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


def orthotropic_stiffness(
    E1: float,
    E2: float,
    E3: float,
    nu12: float,
    nu13: float,
    nu23: float,
    G12: float,
    G13: float,
    G23: float,
) -> np.ndarray:
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
    compacts = False
    shear_range: float | None = None
    locks = False

    def __init__(
        self,
        membrane: ArrayLike,
        bending: ArrayLike | None = None,
        *,
        thickness: float,
        density: float,
        fibre_density: float | None = None,
        name: str = "",
    ) -> None:
        self.C_membrane = np.array(membrane, dtype=float)
        self.C_bending = np.array(membrane if bending is None else bending, dtype=float)
        self.thickness = thickness
        self.density = density
        self.areal_mass = density * thickness
        self.fibre_density = fibre_density
        self.fibre_bending = (0.0, 0.0)  # a continuum, whatever its fibres
        self.name = name
        self.law = law_of_stiffness(self.C_membrane, self.C_bending)

    def stress_and_tangent(self, E: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return S^M (..., 6) and C^M broadcast to (..., 6, 6)."""
        E = np.asarray(E)
        return E @ self.C_membrane, np.broadcast_to(self.C_membrane, (*E.shape, 6))

    def tangent_slope(self, E: ArrayLike) -> np.ndarray:
        """Return dC_ii/dE_i (..., 6): zero."""
        return np.zeros_like(np.asarray(E))

    def tangent_curvature(self, E: ArrayLike) -> np.ndarray:
        """Return d²C_ii/dE_i² (..., 6): zero."""
        return np.zeros_like(np.asarray(E))

    def bending_matrix(self) -> np.ndarray:
        """Return C^B (6, 6)."""
        return self.C_bending

    @property
    def couples_thickness(self) -> bool:
        """Whether other strains than 33 that are linear in ζ cause a stress 33."""
        return bool(self.C_bending[2, [0, 1, 3, 4, 5]].any())

    def membrane_energy(self, E: ArrayLike, history: np.ndarray | None = None) -> np.ndarray:
        """Return the stored energy density W^M [J/m³] of the centre strain E (..., 6)."""
        E = np.asarray(E)
        return 0.5 * np.einsum("...i,ij,...j->...", E, self.C_membrane, E)

    def compaction_pressure(
        self, thickness_stretch: ArrayLike, history: np.ndarray | None = None
    ) -> np.ndarray:
        """Return p = λ |S33| [Pa] of compaction without lateral strain; 0 when thicker."""
        stretch = np.asarray(thickness_stretch, dtype=float)
        stress33 = self.C_membrane[2, 2] * 0.5 * (stretch**2 - 1.0)
        return np.where(stretch < 1.0, -stretch * stress33, 0.0)

    def wave_stiffness(self) -> tuple[float, float]:
        """Return the largest stiffness in the plane and over the thickness, undeformed [Pa]."""
        diagonal = np.maximum(np.diag(self.C_membrane), np.diag(self.C_bending))
        return float(max(diagonal[0], diagonal[1])), float(diagonal[2])


# --- scene ----------------------------------------------------------------------------------------


class SolidMaterial(MaterialTable):
    """Entries that the solid (non-fabric) laws share."""

    thickness: PositiveLength = Field(description="Thickness of the sheet.")
    density: Density = Field(description="Mass per volume.")
    fibre_density: Annotated[Density | None, AbsentMeans("no fibre volume fraction")] = Field(
        default=None, description="Density of the fibres; needed for a fibre volume fraction."
    )

    @property
    def areal_mass(self) -> float:
        """Mass per area [kg/m²]."""
        return self.density * self.thickness

    def stiffnesses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return C^M and C^B (6, 6) [Pa]."""
        raise NotImplementedError

    def build(self) -> StVenantKirchhoff:
        """Return the material."""
        membrane, bending = self.stiffnesses()
        return StVenantKirchhoff(
            membrane,
            bending,
            thickness=self.thickness,
            density=self.density,
            fibre_density=self.fibre_density,
            name=self.name,  # type: ignore[attr-defined]
        )


class IsotropicMaterial(SolidMaterial):
    """St. Venant-Kirchhoff isotropic sheet."""

    law: Literal["isotropic"] = "isotropic"
    name: Annotated[str, Text("steel")] = Field(
        default="isotropic", description="Name of the material in reports."
    )
    young_modulus: Modulus = Field(description="Young's modulus E.")
    poisson_ratio: Annotated[float, Number(0.3, Range(-1.0, 0.5, (-1.0, 0.5)))] = Field(
        description="Poisson's ratio, above -1 and below 0.5."
    )

    def stiffnesses(self) -> tuple[np.ndarray, np.ndarray]:
        C = isotropic_stiffness(self.young_modulus, self.poisson_ratio)
        return C, C


class OrthotropicMaterial(SolidMaterial):
    """St. Venant-Kirchhoff orthotropic sheet in the axes of the fibres."""

    law: Literal["orthotropic"] = "orthotropic"
    name: Annotated[str, Text("tape")] = Field(
        default="orthotropic", description="Name of the material in reports."
    )
    E1: Modulus = Field(description="Young's modulus along fibre direction 1.")
    E2: Modulus = Field(description="Young's modulus along fibre direction 2.")
    E3: Modulus = Field(description="Young's modulus along the normal.")
    nu12: Annotated[float, Number(0.3)] = Field(
        description="Poisson's ratio: strain -nu12 along 2 for a unit strain along 1."
    )
    nu13: Annotated[float, Number(0.3)] = Field(
        description="Poisson's ratio: strain -nu13 along 3 for a unit strain along 1."
    )
    nu23: Annotated[float, Number(0.3)] = Field(
        description="Poisson's ratio: strain -nu23 along 3 for a unit strain along 2."
    )
    G12: Modulus = Field(description="In-plane shear modulus.")
    G13: Modulus = Field(description="Transverse shear modulus 13.")
    G23: Modulus = Field(description="Transverse shear modulus 23.")
    bending_factor: Annotated[float, Number(1.0, POSITIVE)] = Field(
        default=1.0, description="C^B = factor * C^M."
    )

    @model_validator(mode="after")
    def _check_stability(self) -> Self:
        for nu, first, second in (("nu12", "E1", "E2"), ("nu13", "E1", "E3"), ("nu23", "E2", "E3")):
            limit = math.sqrt(getattr(self, first) / getattr(self, second))
            if abs(getattr(self, nu)) >= limit:
                raise wrong(
                    f"is {getattr(self, nu):g}; with {first} and {second} as given its size must "
                    f"stay below sqrt({first}/{second}) = {limit:.3g}",
                    field=nu,
                )
        if np.linalg.eigvalsh(self.normal_compliance).min() <= 0.0:
            raise wrong(
                "has Poisson ratios that together give a negative stiffness; make nu12, nu13 or "
                "nu23 smaller"
            )
        return self

    @property
    def normal_compliance(self) -> np.ndarray:
        """Compliance of the normal strains 11, 22, 33, shape [3, 3], in 1/Pa times E1."""
        s12, s13, s23 = -self.nu12, -self.nu13, -self.nu23 * self.E1 / self.E2
        return np.array(
            [
                [1.0, s12, s13],
                [s12, self.E1 / self.E2, s23],
                [s13, s23, self.E1 / self.E3],
            ]
        )

    def stiffnesses(self) -> tuple[np.ndarray, np.ndarray]:
        C = orthotropic_stiffness(
            self.E1, self.E2, self.E3, self.nu12, self.nu13, self.nu23,
            self.G12, self.G13, self.G23,
        )  # fmt: skip
        return C, self.bending_factor * C


StiffnessMatrix = Annotated[
    tuple[
        Annotated[
            tuple[Stiffness, Stiffness, Stiffness, Stiffness, Stiffness, Stiffness],
            Row('"1000 20 0 0 0 0 MPa"', count=6, entries="entries"),
        ],
        ...,
    ],
    Row('["1000 20 0 0 0 0 MPa", ...]', count=6, entries="rows", units=False),
]


class StiffnessMaterial(SolidMaterial):
    """Sheet with given full membrane and bending stiffness matrices."""

    law: Literal["stiffness"] = "stiffness"
    name: Annotated[str, Text("laminate")] = Field(
        default="stiffness", description="Name of the material in reports."
    )
    membrane: StiffnessMatrix = Field(
        description="C^M, six rows in the order 11, 22, 33, 12, 23, 13, engineering shear."
    )
    bending: StiffnessMatrix = Field(description="C^B in the same order.")

    @field_validator("membrane", "bending")
    @classmethod
    def _check_matrix(cls, rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        matrix = np.array(rows)
        difference = np.abs(matrix - matrix.T)
        if difference.max() > 1e-9 * np.abs(matrix).max():
            row, column = np.unravel_index(np.argmax(difference), difference.shape)
            row, column = int(min(row, column)), int(max(row, column))  # type: ignore[assignment]
            raise wrong(
                f"is not symmetric: entry [{row}][{column}] is {matrix[row, column] * 1e-6:g} MPa, "
                f"entry [{column}][{row}] is {matrix[column, row] * 1e-6:g} MPa"
            )
        # Scaled to a unit diagonal, so that soft and stiff directions count alike.
        scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
        if scale.min() <= 0.0:
            index = int(np.argmin(np.diag(matrix)))
            raise wrong(f"must have positive diagonal entries; [{index}][{index}] is not")
        lowest = float(np.linalg.eigvalsh(matrix / np.outer(scale, scale)).min())
        if lowest <= 1e-12:
            raise wrong(
                "is not positive definite: some deformation would need no or negative energy; "
                "make the off-diagonal entries smaller"
            )
        return rows

    def stiffnesses(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.membrane), np.array(self.bending)
