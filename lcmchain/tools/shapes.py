"""Shapes of rigid tools: planes, bodies that a profile bounds, and surface meshes.

A shape is a scene table with the methods of :class:`ToolShape`. It is registered by its place in
``Shape``. Planes and profiles have an exact distance, surface meshes a distance field.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

import numpy as np
from pydantic import Field, model_validator

from lcmchain.errors import InputError
from lcmchain.mesh.hexahedron import largest_ripple
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    AcuteAngle,
    FileName,
    LengthOrZero,
    LengthUnit,
    PointInPlane,
    PositiveLength,
    Row,
    SceneModel,
    Switch,
    wrong,
)
from lcmchain.quantities.readable import two_digits
from lcmchain.thresholds import LARGEST_RIPPLE
from lcmchain.tools.distance import EXTRUDED, FIELD, PLANE, REVOLVED
from lcmchain.tools.profile_corners import build_profile
from lcmchain.tools.profiles import CORNER_COLUMNS, SEGMENT_COLUMNS, Profile, profile_surface
from lcmchain.tools.surfaces.surface import Surface


def shape_entries(kind: int, **given: Any) -> dict[str, Any]:
    """Entries of one tool in the shape columns of the tool table; what is not given is empty."""
    return {
        "kind": kind,
        "segments": np.zeros((0, SEGMENT_COLUMNS)),
        "corners": np.zeros((0, CORNER_COLUMNS)),
        "spacing": 0.0,
        "grid_origin": np.zeros(3),
        "grid_shape": np.zeros(3, np.int64),
        "box": np.zeros(6),
        "coefficients": np.zeros(0, np.float32),
        "far_bound": np.zeros(0, np.int8),
        **given,
    }


class ToolShape(SceneModel):
    """Shape of a rigid tool in its local frame; sub-classes are tables of a scene."""

    def table_entries(
        self, directory: Path, *, key: str, blank: np.ndarray | None = None
    ) -> dict[str, Any]:
        """Entries of the shape in the tool table, see :func:`shape_entries`.

        Parameters
        ----------
        directory : folder of the scene file, to which mesh files are relative.
        key : scene key of the shape, named in errors.
        blank : points [m] of the blank at the start in the local frame, shape [point_count, 3],
            which are not in the tool; None where they are not known.

        Raises
        ------
        InputError : a shape that cannot be built, or a file that cannot be used.
        """
        raise NotImplementedError

    def surface_mesh(self, directory: Path, blank: np.ndarray | None = None) -> Surface | None:
        """Triangles that define the shape, None for one that needs none.

        Parameters and errors as for :meth:`table_entries`.
        """
        return None

    def surface(self, directory: Path, reach: float, *, key: str) -> tuple[np.ndarray, np.ndarray]:
        """Triangulate the shape for drawings; normals point away from the solid.

        Parameters
        ----------
        directory, key : as for :meth:`table_entries`.
        reach : length [m] of what is infinite.

        Returns
        -------
        points [m], shape [point_count, 3], and triangles, shape [triangle_count, 3].
        """
        raise NotImplementedError

    def oriented(self, axes: np.ndarray) -> np.ndarray:
        """Local axes that the compiled distance works in, from those of the tool, shape [3, 3]."""
        return axes

    def remarks(self, tool_name: str, edge_length: float, whose: str = "") -> list[str]:
        """Say what is allowed but probably not meant, for elements of an edge length [m].

        whose : the plies that the elements belong to, as in " of the ply patch".
        """
        return []


# --- planes and profiles --------------------------------------------------------------------------


Side = Literal["below", "above"]


class Plate(ToolShape):
    """Infinite plane z = 0, solid on one side."""

    type: Literal["plate"]
    side: Side = Field(description="Side of the plane that is solid.")

    def table_entries(
        self, directory: Path, *, key: str, blank: np.ndarray | None = None
    ) -> dict[str, Any]:
        return shape_entries(PLANE)

    def oriented(self, axes: np.ndarray) -> np.ndarray:
        # The distance takes local z as the outward normal.
        return np.diag([1.0, -1.0, -1.0]) @ axes if self.side == "above" else axes

    def surface(self, directory: Path, reach: float, *, key: str) -> tuple[np.ndarray, np.ndarray]:
        points = reach * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        return points, faces if self.side == "below" else faces[:, ::-1]


class ProfileShape(ToolShape):
    """Shape that a plane curve bounds, revolved or extruded."""

    def profile(self, *, key: str) -> Profile:
        """Curve of the shape in its local frame; errors as :meth:`table_entries`."""
        raise NotImplementedError

    def table_entries(
        self, directory: Path, *, key: str, blank: np.ndarray | None = None
    ) -> dict[str, Any]:
        profile = self.profile(key=key)
        return shape_entries(
            REVOLVED if profile.revolved else EXTRUDED,
            segments=profile.segments(),
            corners=profile.corners(),
        )

    def surface(self, directory: Path, reach: float, *, key: str) -> tuple[np.ndarray, np.ndarray]:
        return profile_surface(self.profile(key=key), reach)


class PlateWithHole(ProfileShape):
    """Infinite plane z = 0 with a round hole along local z whose edge is rounded."""

    type: Literal["plate_with_hole"]
    hole_radius: PositiveLength = Field(description="Radius of the hole below its rounded edge.")
    fillet_radius: LengthOrZero = Field(description="Radius of the rounded edge; 0 is sharp.")
    side: Side = Field(description="Side of the plane that is solid.")

    def profile(self, *, key: str) -> Profile:
        hole = self.hole_radius
        depth, solid = (hole, "right") if self.side == "above" else (-hole, "left")
        points = [(2.0 * hole, 0.0), (hole, 0.0), (hole, depth)]
        radii = [0.0, self.fillet_radius, 0.0]
        return build_profile(points, radii, solid=solid, revolved=True, key=key)

    def remarks(self, tool_name: str, edge_length: float, whose: str = "") -> list[str]:
        if self.fillet_radius == 0.0:
            return [f'the hole of "{tool_name}" has a sharp edge (fillet_radius = 0)']
        ripple = largest_ripple(edge_length / self.fillet_radius)
        if ripple <= LARGEST_RIPPLE:
            return []
        enough = 1e3 * edge_length * math.sqrt(LARGEST_RIPPLE / ripple)
        return [
            f"the elements{whose} ({1e3 * edge_length:g} mm) are long for the fillet of "
            f'"{tool_name}" ({1e3 * self.fillet_radius:g} mm): where they are drawn over it, the '
            f"forces of the tools go up and down by up to {ripple:.0%}; use "
            f'blank.edge_length = "{two_digits(enough)} mm"'
        ]


class SphereCappedPunch(ProfileShape):
    """Cylinder with a spherical end; the pole is at the origin and points to local -z."""

    type: Literal["sphere_capped_punch"]
    radius: PositiveLength = Field(description="Radius of cylinder and sphere.")

    def profile(self, *, key: str) -> Profile:
        radius = self.radius
        points = [(0.0, 0.0), (radius, 0.0), (radius, 2.0 * radius)]
        return build_profile(points, [0.0, radius, 0.0], solid="left", revolved=True, key=key)


class Cylinder(ProfileShape):
    """Cylinder about local z: infinite (a roller), or from z = 0 to z = length."""

    type: Literal["cylinder"]
    radius: PositiveLength = Field(description="Radius of the cylinder.")
    edge_radius: LengthOrZero = Field(  # type: ignore[assignment]
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

    def profile(self, *, key: str) -> Profile:
        radius, edge, length = self.radius, self.edge_radius, self.length
        if length is None:
            points, radii = [(radius, -radius), (radius, radius)], None
        else:
            points = [(0.0, 0.0), (radius, 0.0), (radius, length), (0.0, length)]
            radii = [0.0, edge, edge, 0.0]
        return build_profile(points, radii, solid="left", revolved=True, key=key)


class Cone(ProfileShape):
    """Cone, endless or cut off flat, with a round tip; its pole, at the origin, points to -z."""

    type: Literal["cone"]
    half_angle: AcuteAngle = Field(description="Angle between axis and surface.")
    tip_radius: LengthOrZero = Field(description="Radius of the spherical tip; 0 is sharp.")
    height: Annotated[PositiveLength | None, AbsentMeans("infinite")] = Field(
        default=None, description="Height along local z from the tip to the flat end."
    )

    @model_validator(mode="after")
    def _check_height(self) -> Self:
        if self.height is not None and self.height <= self.tip_radius * (
            1.0 - math.sin(self.half_angle)
        ):
            raise wrong("ends in the spherical tip; give more height", field="height")
        return self

    def profile(self, *, key: str) -> Profile:
        radius, angle = self.tip_radius, self.half_angle
        apex = radius - radius / math.sin(angle)
        if self.height is not None:
            rim = (self.height - apex) * math.tan(angle)
            points = [(0.0, apex), (rim, self.height), (0.0, self.height)]
            return build_profile(points, [radius, 0.0, 0.0], solid="left", revolved=True, key=key)
        height = radius if radius else 1.0
        points = [(0.0, apex), (height * math.tan(angle), apex + height)]
        return build_profile(points, [radius, 0.0], solid="left", revolved=True, key=key)


class GivenProfile(ProfileShape):
    """Corner points, fillet radii and the solid side of a profile."""

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

    def build(self, *, revolved: bool, key: str) -> Profile:
        """Build the profile of the entries; errors as :meth:`table_entries`."""
        return build_profile(
            self.points, self.fillet_radii, solid=self.solid, revolved=revolved, key=key
        )


class RevolvedProfile(GivenProfile):
    """Profile of points [r, z] revolved about local z."""

    type: Literal["revolved_profile"]

    def profile(self, *, key: str) -> Profile:
        return self.build(revolved=True, key=key)


class ExtrudedProfile(GivenProfile):
    """Profile of points [x, z] extruded along local y without end."""

    type: Literal["extruded_profile"]

    def profile(self, *, key: str) -> Profile:
        return self.build(revolved=False, key=key)


# --- surface meshes -------------------------------------------------------------------------------


class SurfaceMesh(ToolShape):
    """Closed or open surface from a file, turned into a distance field."""

    type: Literal["surface_mesh"]
    file: Annotated[str, FileName("punch.stl")] = Field(
        description="STL, a deck, or any other mesh file; relative to the scene file."
    )
    length_unit: Annotated[str, LengthUnit()] = Field(
        description="Unit of the coordinates in the file."
    )
    spacing: Annotated[PositiveLength | None, AbsentMeans("automatic")] = Field(
        default=None, description="Grid spacing of the distance field."
    )

    union: Switch = Field(
        default=False,
        description="Unite closed solids of the file that overlap or touch; only the outer "
        "surface of the whole counts. Needs lcmchain[union].",
    )

    def surface_mesh(self, directory: Path, blank: np.ndarray | None = None) -> Surface:
        # Imported where a tool is a file: what these need of scipy takes as long as other scenes
        # take to be read.
        from lcmchain.tools.surfaces.reading import read_surface

        path = Path(directory) / self.file
        return read_surface(path, self.length_unit, blank, union=self.union)

    def table_entries(
        self, directory: Path, *, key: str, blank: np.ndarray | None = None
    ) -> dict[str, Any]:
        from lcmchain.tools.surfaces.distance_field import build_distance_field

        try:
            surface = self.surface_mesh(directory, blank)
        except InputError as error:
            text = f"{error.file}: {error.message}"
            raise InputError(text, key=f"{key}.file", file=error.file) from None
        field = build_distance_field(surface, self.spacing, key=key)
        return shape_entries(
            FIELD,
            spacing=field.spacing,
            grid_origin=field.origin,
            grid_shape=np.array(field.shape),
            box=field.box,
            coefficients=field.coefficients.ravel(),
            far_bound=field.far_bound.ravel(),
        )

    def surface(self, directory: Path, reach: float, *, key: str) -> tuple[np.ndarray, np.ndarray]:
        surface = self.surface_mesh(directory)
        return surface.points, surface.triangles


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


def shape_names() -> list[str]:
    """Return the ``type`` of every shape, in the order of ``Shape``."""
    shapes = get_args(get_args(Shape)[0])
    return [get_args(shape.model_fields["type"].annotation)[0] for shape in shapes]
