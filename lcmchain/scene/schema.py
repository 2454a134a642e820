"""The scene: every entry of a scene file, its unit, default, range and meaning.

Attribute names are the keys of the TOML file. All values are SI floats. Models built in Python
take SI numbers or texts with units; a scene file must give physical quantities with units.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationInfo,
    field_validator,
    model_validator,
)

from lcmchain.scene.entry_types import (
    NOT_NEGATIVE,
    POSITIVE,
    AbsentMeans,
    AcuteAngle,
    Angle,
    ArealMass,
    Density,
    Direction,
    FibreRadius,
    Force,
    FrictionCoefficient,
    Length,
    LengthOrZero,
    LengthUnit,
    Modulus,
    Name,
    Number,
    Penalty,
    PointInPlane,
    Position,
    PositiveLength,
    PositiveMass,
    PositiveStiffness,
    PositiveTime,
    Range,
    Rate,
    Row,
    Stiffness,
    Switch,
    Text,
    TimeOrZero,
    ViscousDamping,
    wrong,
)
from lcmchain.scene.presets import PRESETS
from lcmchain.scene.units import length_factor

#: Text that takes back an optional table, for overrides: TOML has no null.
NONE = "none"


class SceneModel(BaseModel):
    """Base of all scene tables: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)


# --- blank ----------------------------------------------------------------------------------------


class Blank(SceneModel):
    """The flat textile layer before forming, centred on the origin when given by its size."""

    size: Annotated[
        tuple[PositiveLength, PositiveLength] | None,
        Row('["300 mm", "300 mm"]', count=2, entries="lengths"),
        AbsentMeans(""),
    ] = Field(default=None, description="Width along x and height along y of a rectangular blank.")
    outline: Annotated[
        tuple[PointInPlane, ...] | None,
        Row(
            '[["0 mm", "0 mm"], ["300 mm", "0 mm"], ["0 mm", "200 mm"]]',
            minimum_count=3,
            entries="corner points",
            units=False,
        ),
        AbsentMeans(""),
    ] = Field(default=None, description="Corner points [x, y] of a polygonal blank, in order.")
    edge_length: PositiveLength = Field(description="Edge length of the elements.")
    fibre_angle: Angle = Field(
        default="0 deg",
        description="Angle from x to fibre direction 1; fibre direction 2 lies 90 deg further.",
    )
    height: Length = Field(default="0 mm", description="z coordinate of the mid-surface.")

    @model_validator(mode="after")
    def _check_shape(self) -> Self:
        if (self.size is None) == (self.outline is None):
            raise wrong(
                'needs either size, for example size = ["300 mm", "300 mm"], or outline'
                + (", not both" if self.size is not None else "")
            )
        width, height = self.extent
        if self.edge_length > min(width, height) * (1 + 1e-12):
            raise wrong(
                f"is {self.edge_length * 1e3:g} mm, larger than the blank "
                f"({width * 1e3:g} mm x {height * 1e3:g} mm); give a smaller edge length",
                field="edge_length",
            )
        return self

    @property
    def extent(self) -> tuple[float, float]:
        """Width along x and height along y of the bounding box [m]."""
        if self.size is not None:
            return self.size
        x, y = zip(*self.outline)
        return max(x) - min(x), max(y) - min(y)


# --- material -------------------------------------------------------------------------------------


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
    name: Annotated[str, Text("MD600")] = Field(
        default="fabric", description="Name of the fabric in reports."
    )
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
    name: Annotated[str, Text("steel")] = Field(
        default="isotropic", description="Name of the material in reports."
    )
    young_modulus: Modulus = Field(description="Young's modulus E.")
    poisson_ratio: Annotated[float, Number(0.3, Range(-1.0, 0.5, (-1.0, 0.5)))] = Field(
        description="Poisson's ratio, above -1 and below 0.5."
    )


class OrthotropicMaterial(_SolidMaterial):
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


class Element(SceneModel):
    """The solid-shell of the paper's section 2, and the choices in it."""

    type: Literal["solid-shell"] = "solid-shell"
    integration_points: Annotated[int, Number(3, Range(2, 7), whole=True)] = Field(
        default=3, description="Integration points over the thickness."
    )
    compaction_strain: Literal["normal", "director"] = Field(
        default="normal",
        description="Compaction measured by the normal thickness, or by the length of the "
        "director as published (which collapses on small radii).",
    )
    cross_terms: Switch = Field(
        default=False,
        description="Keep the cross terms of Eqs. (15) and (19) as printed: where membrane and "
        "bending stiffness differ they have no potential and feed energy to a limp sheet.",
    )
    hourglass: Literal["conservative", "published"] = Field(
        default="conservative",
        description="Derive the hourglass forces from an energy, or take Eq. (16) as printed.",
    )
    fibre_hourglass: Annotated[float, Number(1.0, Range(0.0, 1.0, (0.0,)))] = Field(
        default=1.0,
        description="Share of the fibre stiffness in the in-plane hourglass terms; 0.03 unlocks a "
        "mesh whose edges cross the fibres.",
    )
    in_plane_shear_hourglass: Switch = Field(
        default=True, description="Keep the in-plane shear row in the hourglass stabilisation."
    )


class MembraneShellElement(SceneModel):
    """Superimposed membrane and shell triangles, the 2D approach; they predict no thickness."""

    type: Literal["membrane-shell"] = "membrane-shell"


SheetElement = Annotated[Element | MembraneShellElement, Field(discriminator="type")]


# --- tools ----------------------------------------------------------------------------------------

Side = Literal["below", "above"]


class SphereCappedPunch(SceneModel):
    """Cylinder with a spherical end; the pole is at the origin and points to local -z."""

    type: Literal["sphere_capped_punch"]
    radius: PositiveLength = Field(description="Radius of cylinder and sphere.")


class Plate(SceneModel):
    """Infinite plane z = 0, solid on one side."""

    type: Literal["plate"]
    side: Side = Field(description="Side of the plane that is solid.")


class PlateWithHole(SceneModel):
    """Infinite plane z = 0 with a round hole along local z whose edge is rounded."""

    type: Literal["plate_with_hole"]
    hole_radius: PositiveLength = Field(description="Radius of the hole below its rounded edge.")
    fillet_radius: LengthOrZero = Field(description="Radius of the rounded edge; 0 is sharp.")
    side: Side = Field(description="Side of the plane that is solid.")


class Cylinder(SceneModel):
    """Cylinder about local z: infinite (a roller), or from z = 0 to z = length."""

    type: Literal["cylinder"]
    radius: PositiveLength = Field(description="Radius of the cylinder.")
    edge_radius: LengthOrZero = Field(
        default="0 mm", description="Radius of the rounded edges at both ends; 0 is sharp."
    )
    length: Annotated[PositiveLength | None, AbsentMeans("infinite")] = Field(
        default=None, description="Length along local z."
    )

    @model_validator(mode="after")
    def _check_edges(self) -> Self:
        if self.edge_radius > 0.0 and self.length is None:
            raise wrong(
                "has no edge to round on an infinite cylinder; give a length", field="edge_radius"
            )
        if self.edge_radius > self.radius:
            raise wrong("is larger than the radius of the cylinder", field="edge_radius")
        if self.length is not None and 2 * self.edge_radius > self.length:
            raise wrong("is larger than half the length of the cylinder", field="edge_radius")
        return self


class Cone(SceneModel):
    """Cone with a spherical tip; the tip's pole is at the origin and points to local -z."""

    type: Literal["cone"]
    half_angle: AcuteAngle = Field(description="Angle between axis and surface.")
    tip_radius: LengthOrZero = Field(description="Radius of the spherical tip; 0 is sharp.")


class _Profile(SceneModel):
    points: Annotated[
        tuple[PointInPlane, ...],
        Row(
            '[["0 mm", "0 mm"], ["50 mm", "0 mm"]]', minimum_count=2, entries="points", units=False
        ),
    ] = Field(description="Corner points of the profile, in order.")
    fillet_radii: Annotated[
        tuple[LengthOrZero, ...], Row('["0 mm", "5 mm", "0 mm"]', entries="radii")
    ] = Field(default=(), description="Fillet radius at each point; left out, all are sharp.")
    solid: Literal["left", "right"] = Field(
        description="Side of the direction of travel along the points that is solid."
    )

    @model_validator(mode="after")
    def _check_radii(self) -> Self:
        if self.fillet_radii and len(self.fillet_radii) != len(self.points):
            raise wrong(
                f"needs one radius per point ({len(self.points)}), but has "
                f"{len(self.fillet_radii)}",
                field="fillet_radii",
            )
        return self


class RevolvedProfile(_Profile):
    """Profile of points [r, z] revolved about local z."""

    type: Literal["revolved_profile"]


class ExtrudedProfile(_Profile):
    """Profile of points [x, z] extruded along local y without end."""

    type: Literal["extruded_profile"]


class SurfaceMesh(SceneModel):
    """Closed or open surface from a file, turned into a distance field."""

    type: Literal["surface_mesh"]
    file: Annotated[str, Text("punch.stl")] = Field(
        description="STL or any mesh that meshio reads; relative to the scene file."
    )
    length_unit: Annotated[str, LengthUnit()] = Field(
        description="Unit of the coordinates in the file."
    )
    spacing: Annotated[PositiveLength | None, AbsentMeans("automatic")] = Field(
        default=None, description="Grid spacing of the distance field."
    )

    @property
    def length_scale(self) -> float:
        """Metres per unit of the file."""
        return length_factor(self.length_unit)


Shape = Annotated[
    SphereCappedPunch
    | Plate
    | PlateWithHole
    | Cylinder
    | Cone
    | RevolvedProfile
    | ExtrudedProfile
    | SurfaceMesh,
    Field(discriminator="type"),
]


class FixedMotion(SceneModel):
    """The tool does not move."""

    type: Literal["fixed"] = "fixed"


class StrokeMotion(SceneModel):
    """The tool travels a distance along a direction between two times, then stays."""

    type: Literal["stroke"]
    direction: Direction = Field(description="Direction of travel; scaled to length one.")
    distance: PositiveLength = Field(description="Travel at the end of the stroke.")
    profile: Literal["smooth", "linear"] = Field(
        default="smooth", description="Smooth: starts and ends without velocity and acceleration."
    )
    start: TimeOrZero = Field(default="0 s", description="Time at which the stroke starts.")
    end: Annotated[PositiveTime | None, AbsentMeans("process.time")] = Field(
        default=None, description="Time at which the stroke ends."
    )

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        if self.end is not None and self.end <= self.start:
            raise wrong(f"is {self.end:g} s, not after the start at {self.start:g} s", field="end")
        return self


class TableMotion(SceneModel):
    """The tool follows a table of travel over time along a direction."""

    type: Literal["table"]
    direction: Direction = Field(description="Direction of travel; scaled to length one.")
    times: Annotated[
        tuple[TimeOrZero, ...], Row('"0 10 20 ms"', minimum_count=2, entries="times")
    ] = Field(description="Times of the table, increasing.")
    travel: Annotated[
        tuple[Length, ...], Row('"0 5 20 mm"', minimum_count=2, entries="lengths")
    ] = Field(description="Travel at these times, from 0; linear in between.")

    @model_validator(mode="after")
    def _check_table(self) -> Self:
        if len(self.times) != len(self.travel):
            raise wrong(
                f"has {len(self.travel)} values for {len(self.times)} times; give one per time",
                field="travel",
            )
        for number, (earlier, later) in enumerate(zip(self.times, self.times[1:])):
            if later <= earlier:
                raise wrong(f"do not increase after entry [{number}]", field="times")
        if self.travel[0] != 0.0:
            raise wrong(
                f"starts at {self.travel[0] * 1e3:g} mm; it is counted from the tool's position "
                "and must start at 0 mm",
                field="travel",
            )
        return self


class GuidedMotion(SceneModel):
    """The tool slides along a direction under its weight and a given force."""

    type: Literal["guided"]
    direction: Direction = Field(description="Positive direction of travel.")
    mass: PositiveMass = Field(description="Mass of the tool.")
    force: Force = Field(default="0 N", description="Constant force along the direction.")
    gravity: Switch = Field(
        default=True, description="Add the component of 9.81 m/s2 (0, 0, -1) along the direction."
    )
    damping: ViscousDamping = Field(default="0 N*s/m", description="Viscous damping of the travel.")
    ramp: TimeOrZero = Field(
        default="0 s",
        description="Time over which weight and force come on smoothly; without it a tool laid on "
        "the blank bounces with twice its load.",
    )


Motion = Annotated[
    FixedMotion | StrokeMotion | TableMotion | GuidedMotion, Field(discriminator="type")
]


class Tool(SceneModel):
    """A rigid tool: shape, place, motion, friction."""

    name: Annotated[str, Name("punch")] = Field(
        description="Name in reports, files and overrides, as in --set tools.punch.friction=0.2."
    )
    shape: Shape = Field(description="Surface of the tool.")
    position: Position = Field(
        default=("0 mm", "0 mm", "0 mm"), description="Place of the shape's local origin."
    )
    axis: Direction = Field(default=(0, 0, 1), description="Local z axis of the shape.")
    motion: Motion = Field(default_factory=FixedMotion, description="How the tool moves.")
    friction: Annotated[FrictionCoefficient | None, AbsentMeans("contact.friction")] = Field(
        default=None, description="Coulomb friction coefficient; default contact.friction."
    )


class Contact(SceneModel):
    """Penalty contact and Coulomb friction between blank and tools."""

    penalty: Annotated[Penalty | None, AbsentMeans("automatic")] = Field(
        default=None, description="Contact stiffness per area."
    )
    damping_ratio: Annotated[float, Number(0.2, Range(0.0, 2.0))] = Field(
        default=0.2, description="Contact damping as a fraction of critical."
    )
    friction: FrictionCoefficient = Field(default=0.0, description="Coulomb friction coefficient.")
    tangential_ratio: Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.5, description="Tangential over normal contact stiffness."
    )


# --- process, output and what follows -------------------------------------------------------------


class Process(SceneModel):
    """Time, frames, gravity and damping."""

    time: PositiveTime = Field(description="Simulated time.")
    frames: Annotated[int, Number(21, Range(2, 100_000), whole=True)] = Field(
        default=21, description="Saved frames, including the start."
    )
    mass_damping: Rate = Field(default="0 1/s", description="Mass-proportional damping.")
    gravity: Switch = Field(default=False, description="9.81 m/s2 along -z on the blank.")
    step_safety: Annotated[float, Number(0.9, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.9, description="Fraction of the critical time step that is used."
    )


class Output(SceneModel):
    """Which files a run writes beside its netCDF file and summary."""

    pictures: Switch = Field(default=True, description="Draw fields, forces and energies.")
    vtu: Switch = Field(
        default=True, description="Write the last frame and the time series for ParaView."
    )


class MappingTarget(SceneModel):
    """A mesh that receives thickness, fibre volume fraction and fibre directions."""

    name: Annotated[str, Name("infiltration")] = Field(
        description="Name of the target and of its files."
    )
    mesh: Annotated[str, Text("infiltration.vtu")] = Field(
        description="Mesh file, relative to the scene file."
    )
    kind: Literal["infiltration", "structure"] = Field(
        description="Surface cells for infiltration, solids (else shells) for structure."
    )
    method: Literal["overlap", "closest"] = Field(
        default="overlap",
        description="Weights from the overlap of cells and sheet, or of the closest place.",
    )
    maximum_distance: Annotated[
        PositiveLength | None, AbsentMeans("one edge length of the sheet")
    ] = Field(default=None, description="Farthest distance over which a value is taken.")
    length_unit: Annotated[str, LengthUnit()] = Field(
        default="m", description="Unit of the coordinates in the file."
    )


class GebartPermeability(SceneModel):
    """Permeability of ordered fibres after Gebart."""

    law: Literal["gebart"]
    fibre_radius: FibreRadius = Field(description="Radius of a single fibre.")
    packing: Literal["quadratic", "hexagonal"] = Field(
        default="quadratic", description="Arrangement of the fibres."
    )


class KozenyCarmanPermeability(SceneModel):
    """Kozeny-Carman permeability K = r²/(4 k) (1 - v)³/v² with one constant per direction."""

    law: Literal["kozeny_carman"]
    fibre_radius: FibreRadius = Field(description="Radius of a single fibre.")
    k_along: Annotated[float, Number(0.6, POSITIVE)] = Field(
        description="Kozeny constant along the fibres, usually 0.5 to 0.7."
    )
    k_across: Annotated[float, Number(15.0, POSITIVE)] = Field(
        description="Kozeny constant across the fibres, usually 11 to 18."
    )


Permeability = Annotated[GebartPermeability | KozenyCarmanPermeability, Field(discriminator="law")]


@dataclass(frozen=True)
class SceneSource:
    """Where a scene came from, and which of its values were given and which defaulted.

    Parameters
    ----------
    path : the scene file, or None for a text or a scene built in Python.
    directory : folder to which file names in the scene are relative.
    text : text of the scene file; overrides stand at its end as comments.
    sha256 : of that text; without overrides the same as of the file.
    given, defaulted : dotted key and value as text, in the order of the tables.
    """

    path: Path | None
    directory: Path
    text: str
    sha256: str
    given: list[tuple[str, str]] = field(default_factory=list)
    defaulted: list[tuple[str, str]] = field(default_factory=list)


class Scene(SceneModel):
    """Everything that one forming simulation needs, in SI units."""

    title: Annotated[str, Text("Hemisphere with blank holder")] = Field(
        default="untitled", description="Title of pictures and files."
    )
    process: Process
    blank: Blank
    material: Material = Field(description="What the sheet is made of, and how it deforms.")
    element: SheetElement = Field(
        default_factory=Element,
        description="Kind of element and its options; a name alone takes the defaults.",
    )
    contact: Contact = Field(default_factory=Contact)
    tools: Annotated[
        tuple[Tool, ...], Row("[[tools]] ... for each tool", entries="tables", units=False)
    ] = ()
    output: Output = Field(default_factory=Output)
    mapping: Annotated[
        tuple[MappingTarget, ...],
        Row("[[mapping]] ... for each mesh", entries="tables", units=False),
    ] = ()
    permeability: Annotated[Permeability | None, AbsentMeans(NONE)] = Field(
        default=None,
        description="Law that turns fibre volume fraction and directions into permeability.",
    )

    _source: SceneSource | None = PrivateAttr(default=None)

    @property
    def source(self) -> SceneSource:
        """Where the scene came from; empty for a scene built in Python."""
        return self._source or SceneSource(None, Path.cwd(), "", "")

    @field_validator("material", mode="before")
    @classmethod
    def _fill_preset(cls, value: Any) -> Any:
        return fill_preset(value)

    @field_validator("element", mode="before")
    @classmethod
    def _complete_element(cls, value: Any) -> Any:
        """Take a name alone, and the solid-shell where options are given without a type."""
        if isinstance(value, str):
            return {"type": value}
        if isinstance(value, dict) and "type" not in value:
            return {"type": Element.model_fields["type"].default, **value}
        return value

    @field_validator("permeability", mode="before")
    @classmethod
    def _allow_none(cls, value: Any) -> Any:
        return None if value == NONE else value

    @field_validator("tools", "mapping")
    @classmethod
    def _check_names(cls, items: tuple[Any, ...]) -> tuple[Any, ...]:
        names = [item.name for item in items]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise wrong(
                    f'has the name "{name}" twice, at [{names.index(name)}] and [{index}]; '
                    "give each its own name"
                )
        return items

    @field_validator("tools")
    @classmethod
    def _complete_tools(cls, tools: tuple[Tool, ...], info: ValidationInfo) -> tuple[Tool, ...]:
        """Fill the tool entries whose default is another entry of the scene."""
        contact, process = info.data.get("contact"), info.data.get("process")
        if contact is None or process is None:
            return tools  # their own errors are reported; nothing to fill from
        return tuple(
            _completed_tool(tool, contact, process, f'[{index}] "{tool.name}"')
            for index, tool in enumerate(tools)
        )

    @model_validator(mode="after")
    def _check_scene(self) -> Self:
        if self.permeability is not None and self.material.fibre_density is None:
            raise wrong(
                "is missing, but permeability needs the fibre volume fraction; give "
                'fibre_density = "1810 kg/m^3" or leave [permeability] out',
                field="material.fibre_density",
            )
        if isinstance(self.element, MembraneShellElement):
            self._check_membrane_shell()
        elif self.element.fibre_hourglass < 1.0 and self.material.law != "fabric":
            raise wrong(
                f'is {self.element.fibre_hourglass:g}, but only law = "fabric" has fibres; '
                "leave it out",
                field="element.fibre_hourglass",
            )
        if self.material.thickness > min(self.blank.extent):
            raise wrong(
                f"is {self.material.thickness * 1e3:g} mm, larger than the blank; check its unit",
                field="material.thickness",
            )
        return self

    def _check_membrane_shell(self) -> None:
        if not isinstance(self.material, FabricMaterial):
            raise wrong(
                f'is "{self.material.law}", but element = "membrane-shell" knows the law "fabric" '
                'only; use element = "solid-shell"',
                field="material.law",
            )
        if self.permeability is not None:
            raise wrong(
                'needs the thickness, which element = "membrane-shell" does not predict; use '
                'element = "solid-shell", or leave the entry out (on the command line: '
                "--set permeability=none)",
                field="permeability",
            )


def fill_preset(material: Any) -> Any:
    """Merge the keys of a scene's [material] table over those of the preset that it names."""
    if not isinstance(material, dict) or material.get("preset") is None:
        return material
    preset = material["preset"]
    if preset not in PRESETS:
        close = difflib.get_close_matches(str(preset), PRESETS, n=1, cutoff=0.3)
        hint = f'; did you mean "{close[0]}"?' if close else f"; there is {', '.join(PRESETS)}"
        raise wrong(f'there is no preset "{preset}"{hint}', field="preset")
    law = PRESETS[preset]["law"]
    if material.get("law", law) != law:
        raise wrong(
            f'is "{material["law"]}", but the preset "{preset}" is a {law}; leave law out',
            field="law",
        )
    return _merged(PRESETS[preset], material)


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in over.items():
        both_tables = isinstance(value, dict) and isinstance(base.get(key), dict)
        result[key] = _merged(base[key], value) if both_tables else value
    return result


def _completed_tool(tool: Tool, contact: Contact, process: Process, key: str) -> Tool:
    changes: dict[str, Any] = {}
    if tool.friction is None:
        changes["friction"] = contact.friction
    motion = tool.motion
    if isinstance(motion, StrokeMotion):
        end = process.time if motion.end is None else motion.end
        if motion.start >= process.time:
            raise wrong(
                f"is {motion.start:g} s, not before the end of the process at {process.time:g} s; "
                "the tool would never move",
                field=f"{key}.motion.start",
            )
        if end > process.time * (1 + 1e-12):
            raise wrong(
                f"is {end:g} s, after the end of the process at {process.time:g} s: the stroke "
                "would not finish; give a longer process.time or an earlier end",
                field=f"{key}.motion.end",
            )
        changes["motion"] = motion.model_copy(update={"end": end})
    return tool.model_copy(update=changes)
