"""Scene tables of the material laws."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from lcmchain.quantities.entry_types import (
    NOT_NEGATIVE,
    POSITIVE,
    AbsentMeans,
    ArealMass,
    Density,
    Modulus,
    Number,
    PositiveLength,
    PositiveStiffness,
    Range,
    Row,
    Stiffness,
    Text,
    wrong,
)
from lcmchain.quantities.scene_model import SceneModel


class FabricMembrane(SceneModel):
    """Membrane and transverse shear stiffness of a fabric (paper section 3.2)."""

    C11: PositiveStiffness = Field(description="Stiffness along fibre direction 1.")
    C22: PositiveStiffness = Field(description="Stiffness along fibre direction 2.")
    shear_polynomial: Annotated[
        tuple[Stiffness, Stiffness, Stiffness, Stiffness, Stiffness],
        Row('"0.1919 -2.3637 14.7593 -40.7199 42.3208 MPa"', count=5, entries="coefficients"),
    ] = Field(description="s0 ... s4 of the shear stiffness C12(|E12|), Eq. (21).")
    C23: PositiveStiffness = Field(description="Transverse shear stiffness 23.")
    C13: PositiveStiffness = Field(description="Transverse shear stiffness 13.")
    shear_convention: Literal["engineering", "tensor"] = Field(
        default="engineering",
        description="S12 = C12 * 2 E12 (engineering) or S12 = C12 * E12 (tensor).",
    )

    @model_validator(mode="after")
    def _check_shear_law(self) -> Self:
        # S12 ~ C12(E) E with E = sin(shear angle) / 2: monotone up to 90 deg means d(C12 E)/dE > 0.
        strain = np.linspace(0.0, 0.5, 2001)
        tangent = sum((k + 1) * s * strain**k for k, s in enumerate(self.shear_polynomial))
        if tangent.min() <= 0.0:
            first = float(strain[np.argmax(tangent <= 0.0)])
            angle = math.degrees(math.asin(min(1.0, 2 * first)))
            raise wrong(
                f"gives a falling shear stress from a shear angle of {angle:.1f} deg "
                f"(tangent {float(tangent.min()) * 1e-6:.3g} MPa); the stress must rise up to "
                "90 deg, check signs, order (s0 first) and units",
                field="shear_polynomial",
            )
        return self


class FabricCompaction(SceneModel):
    """Compaction stiffness C33 = c0 exp(c1 |E33|^c2) (paper Eq. (23))."""

    c0: PositiveStiffness = Field(description="Stiffness of the undeformed fabric.")
    c1: Annotated[float, Number(60.4653, NOT_NEGATIVE)] = Field(description="Growth factor.")
    c2: Annotated[float, Number(2.4528, Range(1.0, 10.0))] = Field(description="Growth exponent.")

    @model_validator(mode="after")
    def _check_growth(self) -> Self:
        # E33 = -1/2 is the strain of a thickness of zero.
        if self.c1 * 0.5**self.c2 > 200.0:
            raise wrong(
                f"together with c2 = {self.c2:g} lets the stiffness grow by "
                f"exp({self.c1 * 0.5**self.c2:.0f}) up to full compaction, which cannot be "
                "computed; check both exponents (MD600: c1 = 60.4653, c2 = 2.4528)",
                field="c1",
            )
        return self


class FabricBending(SceneModel):
    """Bending stiffness C^B, independent of the membrane (paper Eq. (25))."""

    C11: PositiveStiffness = Field(description="Bending stiffness along fibre direction 1.")
    C22: PositiveStiffness = Field(description="Bending stiffness along fibre direction 2.")
    C33: PositiveStiffness = Field(description="Stiffness against a gradient of compaction.")
    C12: PositiveStiffness = Field(description="Torsional stiffness.")
    C23: PositiveStiffness = Field(description="Transverse shear stiffness 23.")
    C13: PositiveStiffness = Field(description="Transverse shear stiffness 13.")


class FabricMaterial(SceneModel):
    """Biaxial fabric: shear polynomial, exponential compaction, decoupled bending."""

    law: Literal["fabric"] = "fabric"
    preset: Annotated[Literal["MD600"] | None, AbsentMeans("")] = Field(
        default=None, description="Published fabric whose values fill all keys not given."
    )
    name: Annotated[str, Text("MD600")] = "fabric"
    thickness: PositiveLength = Field(description="Thickness t0 of the unloaded fabric.")
    areal_mass: ArealMass = Field(description="Fibre mass per area.")
    fibre_density: Density = Field(description="Density of the fibres themselves.")
    membrane: FabricMembrane
    compaction: FabricCompaction
    bending: FabricBending

    @model_validator(mode="after")
    def _check_fibre_volume_fraction(self) -> Self:
        if self.fibre_volume_fraction >= 1.0:
            raise wrong(
                f"gives a fibre volume fraction of {self.fibre_volume_fraction:.2f}, more than all "
                "space: check areal_mass, fibre_density and thickness",
                field="areal_mass",
            )
        return self

    @property
    def density(self) -> float:
        """Mass per volume of the unloaded fabric [kg/m³], areal mass over thickness."""
        return self.areal_mass / self.thickness

    @property
    def fibre_volume_fraction(self) -> float:
        """Fibre volume fraction of the unloaded fabric [1]."""
        return self.areal_mass / (self.fibre_density * self.thickness)


class _SolidMaterial(SceneModel):
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


class IsotropicMaterial(_SolidMaterial):
    """St. Venant-Kirchhoff isotropic sheet."""

    law: Literal["isotropic"] = "isotropic"
    name: Annotated[str, Text("steel")] = "isotropic"
    young_modulus: Modulus = Field(description="Young's modulus E.")
    poisson_ratio: Annotated[float, Number(0.3, Range(-1.0, 0.5, (-1.0, 0.5)))] = Field(
        description="Poisson's ratio, above -1 and below 0.5."
    )


class OrthotropicMaterial(_SolidMaterial):
    """St. Venant-Kirchhoff orthotropic sheet in the axes of the fibres."""

    law: Literal["orthotropic"] = "orthotropic"
    name: Annotated[str, Text("tape")] = "orthotropic"
    E1: Modulus
    E2: Modulus
    E3: Modulus
    nu12: Annotated[float, Number(0.3)]
    nu13: Annotated[float, Number(0.3)]
    nu23: Annotated[float, Number(0.3)]
    G12: Modulus
    G13: Modulus
    G23: Modulus
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


class StiffnessMaterial(_SolidMaterial):
    """Sheet with given full membrane and bending stiffness matrices."""

    law: Literal["stiffness"] = "stiffness"
    name: Annotated[str, Text("laminate")] = "stiffness"
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
            row, column = int(min(row, column)), int(max(row, column))
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


Material = Annotated[
    FabricMaterial | IsotropicMaterial | OrthotropicMaterial | StiffnessMaterial,
    Field(discriminator="law"),
]
