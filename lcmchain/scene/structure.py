"""Scene tables of the structural stage: composite, supports, loads and what is solved.

They stand here and not in the package that writes the decks: that package is built on the core,
which holds the scene and never imports what is built on it.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Acceleration,
    Density,
    Direction,
    Force,
    Length,
    Modulus,
    Name,
    Number,
    Position,
    PositiveLength,
    PositiveTime,
    Pressure,
    Range,
    Row,
    SceneModel,
    Switch,
    Text,
    with_own_names,
    wrong,
)
from lcmchain.scene.presets import FIBRES, RESINS, filled, published_values

#: What a support can hold: displacements, and rotations of the nodes of shells.
COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")

MOST_CONDITIONS = 200
_Component = Literal["x", "y", "z", "rx", "ry", "rz"]

_POISSON = Range(0.0, 1.0, open_ends=(1.0,))
_OF_RESIN = Range(0.0, 0.5, open_ends=(0.5,))


class Fibre(SceneModel):
    """Fibre of a composite, transversely isotropic about its axis.

    Without ``E2``, ``G12`` and ``nu23`` it is isotropic.
    """

    preset: Annotated[Literal["T300", "AS4", "E-glass"] | None, AbsentMeans("")] = Field(
        default=None, description="Published fibre whose values fill what is left out."
    )
    E1: Modulus = Field(description="Young's modulus along the fibre.")
    E2: Annotated[Modulus | None, AbsentMeans("E1")] = Field(
        default=None, description="Young's modulus across the fibre."
    )
    G12: Annotated[Modulus | None, AbsentMeans("E1 / (2 + 2 nu12)")] = Field(
        default=None, description="Shear modulus along the fibre."
    )
    nu12: Annotated[float, Number(0.2, _POISSON)] = Field(
        description="Poisson's ratio: contraction across the fibre under tension along it."
    )
    nu23: Annotated[Annotated[float, Number(0.07, _POISSON)] | None, AbsentMeans("nu12")] = Field(
        default=None, description="Poisson's ratio in the plane across the fibre."
    )
    density: Annotated[Density | None, AbsentMeans("that of the forming result")] = Field(
        default=None, description="Density of the fibre."
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_preset(cls, values: object) -> object:
        return filled(values, FIBRES)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if 1.0 - self.across_poisson - 2.0 * self.nu12**2 * self.across / self.E1 <= 0.0:
            raise wrong(
                "is not possible with the other constants: the fibre would give energy away "
                "(1 - nu23 - 2 nu12^2 E2/E1 has to be positive)",
                field="nu23",
            )
        return self

    @property
    def across(self) -> float:
        """Young's modulus across the fibre [Pa]."""
        return self.E1 if self.E2 is None else self.E2

    @property
    def across_poisson(self) -> float:
        """Poisson's ratio in the plane across the fibre."""
        return self.nu12 if self.nu23 is None else self.nu23

    @property
    def shear(self) -> float:
        """Shear modulus along the fibre [Pa]."""
        return 0.5 * self.E1 / (1.0 + self.nu12) if self.G12 is None else self.G12

    @property
    def across_shear(self) -> float:
        """Shear modulus in the plane across the fibre [Pa]."""
        return 0.5 * self.across / (1.0 + self.across_poisson)


class Resin(SceneModel):
    """Cured resin, isotropic."""

    preset: Annotated[Literal["MY750", "3501-6"] | None, AbsentMeans("")] = Field(
        default=None, description="Published resin whose values fill what is left out."
    )
    E: Modulus = Field(description="Young's modulus.")
    nu: Annotated[float, Number(0.35, _OF_RESIN)] = Field(description="Poisson's ratio.")
    density: Density = Field(description="Density of the cured resin.")

    @model_validator(mode="before")
    @classmethod
    def _fill_preset(cls, values: object) -> object:
        return filled(values, RESINS)

    @property
    def shear(self) -> float:
        """Shear modulus [Pa]."""
        return 0.5 * self.E / (1.0 + self.nu)


class Plane(SceneModel):
    """A plane whose nodes are taken."""

    normal: Direction = Field(description="Normal of the plane.")
    position: Length = Field(description="Distance from the origin along the normal.")
    tolerance: Annotated[PositiveLength | None, AbsentMeans("a thousandth of the mesh's size")] = (
        Field(default=None, description="How far from the plane a node may lie.")
    )


class Place(SceneModel):
    """Where a support or a load acts: one of ``set``, ``plane``, ``point`` and ``edge``."""

    name: Annotated[str, Name("clamp")] = Field(description="Name, for messages and the deck.")
    set: Annotated[Annotated[str, Text("CLAMPED")] | None, AbsentMeans("")] = Field(
        default=None, description="Name of a node or cell set of the mesh file."
    )
    plane: Annotated[Plane | None, AbsentMeans("")] = Field(
        default=None, description="Nodes on a plane."
    )
    point: Annotated[Position | None, AbsentMeans("")] = Field(
        default=None, description="The node nearest to a point."
    )
    edge: Switch = Field(default=False, description="Nodes on the outer edge of a mesh of shells.")

    @property
    def ways(self) -> list[str]:
        """Ways in which the place is given."""
        given = [way for way in ("set", "plane", "point") if getattr(self, way) is not None]
        return [*given, *(["edge"] if self.edge else [])]


class Support(Place):
    """Nodes that are held."""

    fixed: Annotated[
        tuple[_Component, ...],
        Row('["x", "y", "z"]', minimum_count=1, entries="components", units=False),
    ] = Field(
        default=("x", "y", "z"),
        description="Displacements held (x, y, z), and rotations of nodes of shells (rx, ry, rz).",
    )

    @model_validator(mode="after")
    def _check_place(self) -> Self:
        _require_one_way(self)
        return self


class Load(Place):
    """A force, a pressure or an acceleration."""

    force: Annotated[
        Annotated[tuple[Force, Force, Force], Row('["0 N", "0 N", "-10 N"]', count=3)] | None,
        AbsentMeans(""),
    ] = Field(default=None, description="Sum of the forces, which the nodes share equally.")
    pressure: Annotated[Pressure | None, AbsentMeans("")] = Field(
        default=None,
        description="Pressure on solids; on shells along the normal. Without a place on all cells "
        "of a shell.",
    )
    acceleration: Annotated[
        Annotated[
            tuple[Acceleration, Acceleration, Acceleration],
            Row('["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]', count=3),
        ]
        | None,
        AbsentMeans(""),
    ] = Field(default=None, description="Acceleration of all mass, as of gravity; takes no place.")

    @property
    def kind(self) -> str:
        """Which of the three the load is."""
        kinds = ("force", "pressure", "acceleration")
        return next(kind for kind in kinds if getattr(self, kind) is not None)

    @model_validator(mode="after")
    def _check_load(self) -> Self:
        given = [k for k in ("force", "pressure", "acceleration") if getattr(self, k) is not None]
        if len(given) != 1:
            named = " and ".join(given) or "none"
            raise wrong(f"needs one of force, pressure and acceleration, but has {named}")
        if self.kind == "force":
            _require_one_way(self)
        if self.kind == "acceleration" and self.ways:
            raise wrong(f"acts on all mass; leave {self.ways[0]} out", field="acceleration")
        if self.kind == "pressure" and len(self.ways) > 1:
            _require_one_way(self)
        return self


def _require_one_way(place: Place) -> None:
    if len(place.ways) != 1:
        named = " and ".join(place.ways) or "none"
        raise wrong(f"needs one of set, plane, point and edge = true, but has {named}")


class Structure(SceneModel):
    """Structural analysis of the formed part with CalculiX."""

    fibre: Fibre
    resin: Resin
    micromechanics: Literal["rule_of_mixtures", "chamis", "halpin_tsai", "mori_tanaka"] = Field(
        default="chamis", description="Model of the stiffness of each fibre family in its resin."
    )
    family_1_share: Annotated[float, Number(0.5, Range(0.0, 1.0))] = Field(
        default=0.5, description="Share of the first fibre family in the fibre mass."
    )
    lay_up: Literal["interleaved", "plies", "stacked", "symmetric"] = Field(
        default="interleaved",
        description="interleaved: all families mixed over the thickness. plies: those of a stack "
        "over each other, the families of each mixed. stacked: the second family of "
        "a ply above the first, as the normal of the cell or the order of the plies "
        "points. symmetric: the first family in two halves outside.",
    )
    elements: Literal["quadratic", "as_mesh"] = Field(
        default="quadratic",
        description="With nodes added in the middle of edges, or as the mesh has them.",
    )
    material_tolerance: Annotated[float, Number(0.01, Range(0.0, 0.2))] = Field(
        default=0.0,
        description="Largest relative error of the stiffness of cells that share a material; 0 "
        "gives each its own.",
    )
    units: Literal["m-kg-s", "mm-t-s"] = Field(
        default="m-kg-s", description="Units of the deck; results are in SI."
    )
    supports: Annotated[
        tuple[Support, ...],
        Row(
            "[[supports]] ...",
            entries="tables",
            units=False,
            maximum_count=MOST_CONDITIONS,
        ),
    ] = ()
    loads: Annotated[
        tuple[Load, ...],
        Row("[[loads]] ...", entries="tables", units=False, maximum_count=MOST_CONDITIONS),
    ] = ()
    frequencies: Annotated[int, Number(6, Range(0.0, 1000.0), whole=True)] = Field(
        default=0, description="Number of the lowest eigenfrequencies to find."
    )
    time_limit: PositiveTime = Field(
        default="1 h",  # type: ignore[assignment]
        description="Time after which the solver is stopped.",
    )

    def preset_values(self) -> dict[str, Any]:
        """Return the entries of the presets of fibre and resin, with the names of these."""
        return {
            "fibre": published_values(FIBRES, self.fibre.preset),
            "resin": published_values(RESINS, self.resin.preset),
        }

    @field_validator("supports", "loads")
    @classmethod
    def _check_names(cls, items: tuple[Any, ...]) -> tuple[Any, ...]:
        return with_own_names(items)

    @model_validator(mode="after")
    def _check_static(self) -> Self:
        if self.loads and not self.supports:
            raise wrong(
                "is missing: under loads the part has to be held; give [[supports]]",
                field="supports",
            )
        return self
