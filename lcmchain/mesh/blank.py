"""Flat blank: a fibre-aligned mesh of solid-shell hexahedra inside a rectangle or polygon.

A lattice is laid along the two fibre directions. Lattice lines run exactly through outline edges
that are parallel to a fibre, and under 45 degrees the cell diagonals are fitted to the outline's
sides (:mod:`lcmchain.mesh.lattice`). What does not fit is cut (:mod:`lcmchain.mesh.cut`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
import shapely
from pydantic import Field, PrivateAttr, ValidationInfo, model_validator
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lcmchain.errors import InputError
from lcmchain.mesh.cells import boundary_edges, cell_areas, cell_heights
from lcmchain.mesh.contours import Contours, Drawn, contours_of
from lcmchain.mesh.courses import Courses, outlines_of
from lcmchain.mesh.cut import ON_OUTLINE, LatticeCells
from lcmchain.mesh.drawing import Drawing
from lcmchain.mesh.hexahedron import MODES, bend_part, edge_neighbours
from lcmchain.mesh.lattice import best_lattice, number_by_lines
from lcmchain.mesh.outline import (
    check_element_count,
    check_lattice_size,
    in_mm,
)
from lcmchain.mesh.sheet_mesh import NO_NODE, UndeformedFrame, spanned
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Angle,
    Length,
    PointInPlane,
    PositiveLength,
    Row,
    SceneModel,
    wrong,
)

MAXIMUM_PERTURBATION = 0.25

# A mesh that misses more of the outline, or shortens the step by more, is told of.
REMARKABLE_AREA = 1e-3
REMARKABLE_RATIO = 1.25

# Largest relative difference of the meshed area from the outline's that is accepted.
AREA_TOLERANCE = 0.02


def _corners(example: str, count: int, entries: str = "points") -> Row:
    """Row of points in the plane, of at least so many."""
    return Row(example, minimum_count=count, entries=entries, units=False)


Hole = Annotated[
    tuple[PointInPlane, ...],
    _corners('[["0 mm", "0 mm"], ["20 mm", "0 mm"], ["0 mm", "20 mm"]]', 3, "corner points"),
]
Dart = Annotated[
    tuple[PointInPlane, PointInPlane, PointInPlane],
    Row(
        '[["150 mm", "10 mm"], ["90 mm", "0 mm"], ["150 mm", "-10 mm"]]',
        count=3,
        entries="points (rim, apex, rim)",
        units=False,
    ),
]
Slit = Annotated[tuple[PointInPlane, ...], _corners('[["150 mm", "0 mm"], ["90 mm", "0 mm"]]', 2)]


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
    drawing: Annotated[Drawing | None, AbsentMeans("")] = Field(
        default=None,
        description="Drawing of the blank, in place of size or outline: its holes and slits too.",
    )
    holes: Annotated[
        tuple[Hole, ...],
        Row(
            '[[["0 mm", "0 mm"], ["20 mm", "0 mm"], ["0 mm", "20 mm"]]]',
            entries="holes",
            units=False,
        ),
    ] = Field(default=(), description="Corner points of each hole, in order.")
    darts: Annotated[
        tuple[Dart, ...],
        Row(
            '[[["150 mm", "10 mm"], ["90 mm", "0 mm"], ["150 mm", "-10 mm"]]]',
            entries="darts",
            units=False,
        ),
    ] = Field(
        default=(),
        description="Wedges cut out from the rim: a point of the rim, the apex, and another point "
        "of the rim, each on the rim or beyond it.",
    )
    slits: Annotated[
        tuple[Slit, ...],
        Row('[[["150 mm", "0 mm"], ["90 mm", "0 mm"]]]', entries="slits", units=False),
    ] = Field(
        default=(),
        description="Cuts without a width, each a line of points, from the rim or inside.",
    )
    courses: Annotated[Courses | None, AbsentMeans("one piece")] = Field(
        default=None,
        description="Courses that the ply is laid in: strips along fibre 1, side by side.",
    )
    edge_length: PositiveLength = Field(description="Edge length of the elements.")
    fibre_angle: Angle = Field(  # type: ignore[assignment]
        default="0 deg",
        description="Angle from x to fibre direction 1; fibre direction 2 lies 90 deg further.",
    )
    height: Length = Field(default="0 mm", description="z coordinate of the mid-surface.")  # type: ignore[assignment]

    _drawn: Drawn | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _check_shape(self, info: ValidationInfo) -> Self:
        given = [name for name in ("size", "outline", "drawing") if getattr(self, name) is not None]
        if len(given) != 1:
            raise wrong(
                'needs either size, for example size = ["300 mm", "300 mm"], or outline'
                + (", not both" if given == ["size", "outline"] else "")
                + (f", not {' and '.join(given)}" if "drawing" in given else "")
            )
        if self.drawing is not None and not self._read_drawing(info):
            return self
        width, height = self.extent
        if self.edge_length > min(width, height) * (1 + 1e-12):
            raise wrong(
                f"is {self.edge_length * 1e3:g} mm, larger than the blank "
                f"({width * 1e3:g} mm x {height * 1e3:g} mm); give a smaller edge length",
                field="edge_length",
            )
        return self

    def _read_drawing(self, info: ValidationInfo) -> bool:
        """Read the drawing; False where a scene's own check of its files names what is missing."""
        directory = Path((info.context or {}).get("directory", "."))
        path = directory / self.drawing.file  # type: ignore[union-attr]
        if not path.is_file() and (info.context or {}).get("from_file"):
            return False
        try:
            self._drawn = self.drawing.read(directory)  # type: ignore[union-attr]
        except InputError as error:
            raise wrong(f"{path.name} {error.message}", field="drawing.file") from None
        return True

    @property
    def left_out(self) -> str:
        """What of the drawing was not read, in words; empty for none."""
        return "" if self._drawn is None else self._drawn.left_out

    @property
    def rim(self) -> tuple[tuple[float, float], ...] | None:
        """Corner points of the outline [m]; None for a blank that is given by its size."""
        return self.outline if self._drawn is None else _points_of(self._drawn.rim)

    @property
    def cuts(self) -> dict[str, tuple]:
        """Holes, darts and slits [m], those of a drawing first."""
        drawn = self._drawn
        holes = () if drawn is None else tuple(map(_points_of, drawn.holes))
        slits = () if drawn is None else tuple(map(_points_of, drawn.slits))
        return {"holes": holes + self.holes, "darts": self.darts, "slits": slits + self.slits}

    @property
    def shape(self) -> dict[str, Any]:
        """Entries of the shape, a drawing as points."""
        return {"size": self.size, "outline": self.rim, **self.cuts}

    def with_outline(self, outline: np.ndarray) -> Self:
        """Return the blank with another outline (n, 2) [m], and its own holes, darts and slits."""
        changes = {"size": None, "outline": _points_of(outline), "drawing": None, **self.cuts}
        changed = self.model_copy(update=changes)
        changed._drawn = None
        return changed

    @property
    def extent(self) -> tuple[float, float]:
        """Width along x and height along y of the bounding box [m]."""
        if self.size is not None:
            return self.size
        if self.rim is None:  # a drawing that is not there, which is told elsewhere
            return math.inf, math.inf
        x, y = zip(*self.rim)
        return max(x) - min(x), max(y) - min(y)


def _points_of(points: np.ndarray) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in points)


# Nodes of a degenerate hexahedron (n0 n1 n2 n2) in VTK's order of a wedge, whose first face is
# seen clockwise from the second: bottom n0 n2 n1, then top.
WEDGE_NODES = [0, 2, 1, 4, 6, 5]


@dataclass(frozen=True)
class BlankMesh(UndeformedFrame):
    """Hexahedral mesh of the undeformed blank with its fibre directions.

    Attributes
    ----------
    node_positions : positions [m], shape (node_count, 3); the first half is the bottom face, node
        ``i + pair_count`` lies above node ``i``.
    elements : node numbers in VTK hexahedron order, shape (element_count, 8); node 0 to node 1
        points along fibre 1. Triangles at a cut edge repeat their last node: the first two nodes
        are the cut edge, bottom (n0, n1, n2, n2).
    fibre_direction_1, fibre_direction_2 : unit vectors, shape (element_count, 3).
    thickness : initial thickness [m].
    outline_area : area inside the prescribed outline [m2]; nan where no outline was prescribed.
    step_ratio : stable step of whole elements over that of the cut ones, at least 1, by the stiff
        fibres alone (:mod:`lcmchain.mesh.cells`).
    course : number of the course of each element (element_count,), the lowest first; None for a
        blank of one piece (:mod:`lcmchain.mesh.courses`).
    """

    node_positions: np.ndarray
    elements: np.ndarray
    fibre_direction_1: np.ndarray
    fibre_direction_2: np.ndarray
    thickness: float
    outline_area: float = math.nan
    step_ratio: float = 1.0
    course: np.ndarray | None = None

    has_thickness = True

    @property
    def pair_count(self) -> int:
        """Number of pairs of a bottom node and the top node above it."""
        return len(self.node_positions) // 2

    @property
    def faces(self) -> np.ndarray:
        """Mid-surface faces in pair numbering, shape (element_count, 4)."""
        return self.elements[:, :4]

    @property
    def is_triangle(self) -> np.ndarray:
        """True for halved cells, shape (element_count,)."""
        return self.elements[:, 2] == self.elements[:, 3]

    @property
    def mid_surface_positions(self) -> np.ndarray:
        """Initial positions of the mid-surface nodes [m], shape (pair_count, 3)."""
        return self.mid_surface(self.node_positions)

    def mid_surface(self, positions: np.ndarray) -> np.ndarray:
        """Middles of the node pairs (..., pair_count, 3) of positions (..., node_count, 3)."""
        pairs = self.pair_count
        return 0.5 * (positions[..., :pairs, :] + positions[..., pairs:, :])

    @property
    def sheet_faces(self) -> np.ndarray:
        """Faces in pair numbering (element_count, 4); a triangle ends with -1."""
        is_absent = self.is_triangle[:, np.newaxis] & (np.arange(4) == 3)
        return np.where(is_absent, NO_NODE, self.faces)

    @property
    def volumes(self) -> np.ndarray:
        """Nodes of hexahedra, and of wedges with -1 at the end (element_count, 8), VTK's order."""
        volumes = self.elements.copy()
        wedges = self.is_triangle
        volumes[wedges, :6] = self.elements[wedges][:, WEDGE_NODES]
        volumes[wedges, 6:] = NO_NODE
        return volumes

    def base_vectors(self, positions: np.ndarray) -> np.ndarray:
        """Covariant base vectors a1, a2, a3 at the element centres (..., element_count, 3, 3)."""
        return MODES[:3] @ positions[..., self.elements, :]

    @cached_property
    def neighbours(self) -> np.ndarray:
        """Elements across the edges (4, element_count), see :func:`edge_neighbours`."""
        return edge_neighbours(self.elements)

    def bend_part(self, positions: np.ndarray) -> np.ndarray:
        """Return what (a3·n)² of bent elements misses of half the thickness² [m²]."""
        return bend_part(self.elements, self.neighbours, positions)

    def areas(self, positions: np.ndarray) -> np.ndarray:
        """Mid-surface area 4 |a1 × a2| of every element (..., element_count) [m²]."""
        return 4.0 * spanned(self.base_vectors(positions))

    def remarks(self) -> list[str]:
        """Say where the elements are too large for the outline."""
        found = []
        difference = self.area / self.outline_area - 1.0
        if abs(difference) > REMARKABLE_AREA:
            found.append(
                f"the meshed area differs from the outline's by {100.0 * difference:+.2f} %: tips "
                "and details narrower than an element; use a smaller blank.edge_length, or blunt "
                "them"
            )
        if self.step_ratio > REMARKABLE_RATIO:
            found.append(
                f"elements at the outline make the time step {self.step_ratio:.1f} times shorter: "
                "tips and details narrower than an element; use another blank.edge_length, or "
                "blunt them"
            )
        return found

    def sides(self) -> dict[str, slice]:
        return {"bottom": slice(0, self.pair_count), "top": slice(self.pair_count, None)}

    @property
    def element_areas(self) -> np.ndarray:
        """Initial mid-surface area of every element [m2], shape (element_count,)."""
        return cell_areas(self.mid_surface_positions[self.faces][..., :2])

    @property
    def area(self) -> float:
        """Initial mid-surface area [m2]."""
        return math.fsum(self.element_areas)


def build_blank(
    blank_spec: Blank, thickness: float, *, perturbation: float = 0.0, seed: int = 0
) -> BlankMesh:
    """Mesh a flat blank along its fibres.

    Parameters
    ----------
    blank_spec : the scene's blank: ``size`` (width, height) about the origin or ``outline``
        (vertices x, y) [m], ``edge_length`` [m], ``fibre_angle`` from x to fibre 1 [rad] and
        ``height``, the z of the mid-surface [m].
    thickness : initial thickness [m].
    perturbation : largest in-plane displacement of the nodes that are not on the outline, as a
        fraction of the edge length, at most 0.25 (for studies of mesh sensitivity).
    seed : selects the perturbation; the same seed gives the same mesh.

    Raises
    ------
    InputError
        An outline that intersects itself or encloses no area, a blank with fewer than two elements
        across or more than two million in all, an outline too narrow for the edge length, courses
        that are no pieces of it.
    """
    if blank_spec.courses is not None:
        parts = _parts_of(blank_spec, blank_spec.courses)
        return _joined([
            _mesh_of_course(name, part, thickness, perturbation, seed)
            for name, part in zip(blank_spec.courses.names, parts, strict=True)
        ])  # fmt: skip
    return _mesh_of(blank_spec, thickness, perturbation, seed)


def _mesh_of_course(
    name: str, part: Blank, thickness: float, perturbation: float, seed: int
) -> BlankMesh:
    """Mesh one course; an error names it."""
    try:
        return _mesh_of(part, thickness, perturbation, seed)
    except InputError as error:
        raise InputError(
            f"cut off {name}, which cannot be meshed: {error.message}", key="blank.courses.joints"
        ) from None


def _parts_of(blank: Blank, courses: Courses) -> list[Blank]:
    """Return a blank for each course of one that is laid in several."""
    if any(blank.cuts.values()):
        raise InputError(
            "divides a blank without holes, darts and slits; leave these out, or give the courses "
            "as [[plies]] with outlines of their own",
            key="blank.courses",
        )
    whole = contours_of(blank)[0]
    rim = whole.rim
    check_element_count(rim, whole.area, float(blank.edge_length))
    outlines = outlines_of(rim, float(blank.fibre_angle), courses)
    return [
        blank.with_outline(outline).model_copy(update={"courses": None}) for outline in outlines
    ]


def _joined(strips: Sequence[BlankMesh]) -> BlankMesh:
    """Return the meshes of courses as one, without common nodes."""
    pairs = [mesh.pair_count for mesh in strips]
    first = np.cumsum([0, *pairs[:-1]])
    faces = np.concatenate([mesh.faces + n for mesh, n in zip(strips, first, strict=True)])
    bottoms = [mesh.node_positions[: mesh.pair_count] for mesh in strips]
    tops = [mesh.node_positions[mesh.pair_count :] for mesh in strips]
    return replace(
        strips[0],
        node_positions=np.concatenate([*bottoms, *tops]),
        elements=np.hstack([faces, faces + sum(pairs)]),
        fibre_direction_1=np.concatenate([mesh.fibre_direction_1 for mesh in strips]),
        fibre_direction_2=np.concatenate([mesh.fibre_direction_2 for mesh in strips]),
        outline_area=math.fsum(mesh.outline_area for mesh in strips),
        step_ratio=max(mesh.step_ratio for mesh in strips),
        course=np.repeat(np.arange(len(strips)), [mesh.element_count for mesh in strips]),
    )


def _mesh_of(blank_spec: Blank, thickness: float, perturbation: float, seed: int) -> BlankMesh:
    """Mesh a blank of one piece, or one course; as :func:`build_blank`."""
    edge_length = float(blank_spec.edge_length)
    if not (math.isfinite(edge_length) and edge_length > 0.0):
        raise InputError(f"must be positive, got {edge_length:g} m", key="blank.edge_length")
    if not (math.isfinite(thickness) and thickness > 0.0):
        raise InputError(f"must be positive, got {thickness:g} m", key="material.thickness")
    if not 0.0 <= perturbation <= MAXIMUM_PERTURBATION:
        raise InputError(
            f"perturbation must lie between 0 and {MAXIMUM_PERTURBATION:g} of the edge length, "
            f"got {perturbation:g}"
        )
    contours, outline_key = contours_of(blank_spec)
    area = contours.area
    check_element_count(contours.rim, area, edge_length)

    to_fibres = _rotation(-float(blank_spec.fibre_angle))
    to_scene = to_fibres.T
    in_fibres = contours.turned(to_fibres)
    check_lattice_size(in_fibres.rim, edge_length)
    cells = best_lattice(in_fibres, edge_length)
    _check_coverage(cells, area, edge_length, to_scene, outline_key)
    if not contours.is_plain:
        _check_loops(cells, contours, in_fibres, edge_length)

    placed = cells
    if perturbation > 0.0:  # of the lattice, so that it is the same in any numbering
        shift = np.random.default_rng(seed).uniform(-1.0, 1.0, cells.positions.shape)
        shift[cells.node_class == ON_OUTLINE] = 0.0
        placed = replace(cells, positions=cells.positions + perturbation * edge_length * shift)
    positions, faces = number_by_lines(placed)
    positions = positions @ to_scene.T
    _check_jacobians(positions, faces)

    pair_count = len(positions)
    nodes = np.empty((2 * pair_count, 3))
    nodes[:pair_count, :2] = nodes[pair_count:, :2] = positions
    nodes[:pair_count, 2] = blank_spec.height - 0.5 * thickness
    nodes[pair_count:, 2] = blank_spec.height + 0.5 * thickness
    return BlankMesh(
        node_positions=nodes,
        elements=np.hstack([faces, faces + pair_count]),
        fibre_direction_1=_constant_direction(to_scene[:, 0], len(faces)),
        fibre_direction_2=_constant_direction(to_scene[:, 1], len(faces)),
        thickness=float(thickness),
        outline_area=area,
        step_ratio=cells.step_ratio,
    )


def _check_coverage(
    cells: LatticeCells, area: float, edge_length: float, to_scene: np.ndarray, key: str
) -> None:
    advice = f"choose a smaller blank.edge_length than {edge_length:g} m"
    if len(cells.faces) == 0 or cells.piece_count != 1:
        raise InputError(
            f"is in places narrower than two elements, the mesh falls into {cells.piece_count} "
            f"pieces; {advice}",
            key=key,
        )
    if cells.smallest_height <= 0.0:
        middle = to_scene @ cells.positions[cells.faces[cells.weakest]].mean(axis=0)
        raise InputError(
            f"cannot be meshed near {in_mm(middle)}, an element would be inverted; {advice}",
            key=key,
        )
    difference = cells.area / area - 1.0
    if abs(difference) > AREA_TOLERANCE:
        raise InputError(
            f"has details that elements of this size cannot follow: the meshed area differs by "
            f"{100.0 * difference:+.1f} %; {advice}",
            key=key,
        )


def _check_loops(
    cells: LatticeCells, contours: Contours, in_fibres: Contours, edge_length: float
) -> None:
    """Refuse holes and slits that are lost between the elements, or run into each other."""
    edges = boundary_edges(cells.faces)
    ends = np.unique(edges)
    graph = coo_array((np.ones(len(edges)), edges.T), shape=2 * (len(cells.positions),))
    found = len(np.unique(connected_components(graph, directed=False)[1][ends]))
    if found == contours.loop_count:
        return
    corners = cells.positions[cells.faces]
    shapes = shapely.polygons(corners)
    covered = shapely.STRtree(shapes)
    for number, hole in enumerate(in_fibres.rings[1:]):
        middle = shapely.Polygon(hole).representative_point()
        if len(covered.query(middle, predicate="within")):
            raise InputError(
                f"is narrower than two elements, near {in_mm(contours.rings[1 + number][0])}; "
                f"choose a smaller blank.edge_length than {edge_length:g} m, or leave it out",
                key=f"blank.holes[{number}]",
            )
    raise InputError(
        f"has {contours.loop_count} boundaries, but elements of {1e3 * edge_length:g} mm make "
        f"{found}: holes, darts or slits are shorter than two elements, or nearer to each other or "
        "to the rim; choose a smaller blank.edge_length, or move them apart",
        key="blank",
    )


def _check_jacobians(positions: np.ndarray, faces: np.ndarray) -> None:
    heights = cell_heights(positions[faces])
    if not (heights > 0.0).all():
        element = int(np.argmin(heights))
        raise InputError(
            f"element {element} near {in_mm(positions[faces[element]].mean(axis=0))} is inverted "
            "in the undeformed blank; use a smaller perturbation or another blank.edge_length"
        )


def _rotation(angle: float) -> np.ndarray:
    """Rotation matrix, exact for multiples of 90 degrees."""
    cosine, sine = math.cos(angle), math.sin(angle)
    quarter = math.remainder(angle, 0.5 * math.pi)
    if abs(quarter) < 1e-12:
        cosine, sine = float(round(cosine)), float(round(sine))
    return np.array([[cosine, -sine], [sine, cosine]])


def _constant_direction(direction: np.ndarray, element_count: int) -> np.ndarray:
    directions = np.zeros((element_count, 3))
    directions[:, :2] = direction
    return directions
