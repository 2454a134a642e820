"""Flat blank: a fibre-aligned mesh of solid-shell hexahedra inside a rectangle or polygon.

A lattice is laid along the two fibre directions. Lattice lines run exactly through outline edges
that are parallel to a fibre, and under 45 degrees the cell diagonals are fitted to the outline's
sides (:mod:`lcmchain.mesh.lattice`). What does not fit is cut (:mod:`lcmchain.mesh.cut`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from lcmchain.errors import InputError
from lcmchain.mesh.bends import bend_part, edge_neighbours
from lcmchain.mesh.cells import cell_heights
from lcmchain.mesh.contours import contours_of
from lcmchain.mesh.cut import ON_OUTLINE, Cells
from lcmchain.mesh.fibres import UndeformedFrame
from lcmchain.mesh.hexahedron import MODES
from lcmchain.mesh.lattice import best_lattice
from lcmchain.mesh.numbering import number_by_lines
from lcmchain.mesh.outline import (
    check_element_count,
    check_lattice_size,
    cross,
    place,
)
from lcmchain.mesh.sheet_mesh import NO_NODE
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Angle,
    Length,
    PointInPlane,
    PositiveLength,
    Row,
    wrong,
)
from lcmchain.quantities.scene_model import SceneModel

MAXIMUM_PERTURBATION = 0.25

# A mesh that misses more of the outline, or shortens the step by more, is told of.
REMARKABLE_AREA = 1e-3
REMARKABLE_RATIO = 1.25

# Largest relative difference of the meshed area from the outline's that is accepted.
AREA_TOLERANCE = 0.02


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
    fibre_angle: Angle = Field(  # type: ignore[assignment]
        default="0 deg",
        description="Angle from x to fibre direction 1; fibre direction 2 lies 90 deg further.",
    )
    height: Length = Field(default="0 mm", description="z coordinate of the mid-surface.")  # type: ignore[assignment]

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
        x, y = zip(*self.outline)  # type: ignore[misc]
        return max(x) - min(x), max(y) - min(y)


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
        fibres alone (:mod:`lcmchain.mesh.step_measure`).
    """

    node_positions: np.ndarray
    elements: np.ndarray
    fibre_direction_1: np.ndarray
    fibre_direction_2: np.ndarray
    thickness: float
    outline_area: float = math.nan
    step_ratio: float = 1.0

    has_thickness = True

    @property
    def node_count(self) -> int:
        return len(self.node_positions)

    @property
    def pair_count(self) -> int:
        """Number of pairs of a bottom node and the top node above it."""
        return len(self.node_positions) // 2

    @property
    def element_count(self) -> int:
        return len(self.elements)

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
        a = self.base_vectors(positions)
        return 4.0 * np.linalg.norm(np.cross(a[..., 0, :], a[..., 1, :]), axis=-1)

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
        corner = self.mid_surface_positions[self.faces][..., :2]
        return 0.5 * cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])

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
        across or more than two million in all, an outline too narrow for the edge length.
    """
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
    cells: Cells, area: float, edge_length: float, to_scene: np.ndarray, key: str
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
            f"cannot be meshed near {place(middle)}, an element would be inverted; {advice}",
            key=key,
        )
    difference = cells.area / area - 1.0
    if abs(difference) > AREA_TOLERANCE:
        raise InputError(
            f"has details that elements of this size cannot follow: the meshed area differs by "
            f"{100.0 * difference:+.1f} %; {advice}",
            key=key,
        )


def _check_jacobians(positions: np.ndarray, faces: np.ndarray) -> None:
    heights = cell_heights(positions[faces])
    if not (heights > 0.0).all():
        element = int(np.argmin(heights))
        raise InputError(
            f"element {element} near {place(positions[faces[element]].mean(axis=0))} is inverted "
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
