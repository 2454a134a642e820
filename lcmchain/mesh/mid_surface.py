"""The mid-surface of a blank as a mesh of its own: quadrilaterals, or triangles along the fibres.

Neither has a thickness. The triangles, with legs along the fibres, are the mesh of the 2D approach.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.hexahedron import MODES
from lcmchain.mesh.sheet_mesh import UndeformedFrame, spanned


class FlatMesh(UndeformedFrame):
    """Mesh of a mid-surface, without a thickness of its own: what all kinds of faces share."""

    has_thickness = False
    volumes = None

    @property
    def element_areas(self) -> np.ndarray:
        """Area of every undeformed element [m²], shape (element_count,)."""
        return self.areas(self.node_positions)

    def tangents(self, positions: np.ndarray) -> np.ndarray:
        """Return a1 and a2 at the element centres (..., element_count, 2, 3)."""
        raise NotImplementedError

    def areas(self, positions: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def bend_part(self, positions: np.ndarray) -> np.ndarray:
        """None: zeros (..., element_count)."""
        return np.zeros(np.shape(positions)[:-2] + (self.element_count,))

    def sides(self) -> dict[str, slice]:
        return {"": slice(None)}

    def mid_surface(self, positions: np.ndarray) -> np.ndarray:
        """The nodes themselves."""
        return positions

    def base_vectors(self, positions: np.ndarray) -> np.ndarray:
        """Return a1, a2 at the centres, and the unit normal (..., element_count, 3, 3)."""
        tangents = self.tangents(positions)
        normal = np.cross(tangents[..., 0, :], tangents[..., 1, :])
        with np.errstate(invalid="ignore", divide="ignore"):
            normal = normal / np.linalg.norm(normal, axis=-1)[..., None]
        return np.concatenate([tangents, normal[..., None, :]], axis=-2)


@dataclass(eq=False)
class MidSurfaceMesh(FlatMesh):
    """Mid-surface of an undeformed, flat blank; see :class:`lcmchain.mesh.sheet_mesh.SheetMesh`.

    Attributes
    ----------
    node_positions : positions [m], shape (node_count, 3); node ``i`` is the middle of the blank's
        node pair ``i``.
    elements : nodes of the faces, shape (element_count, 4); a triangle repeats its last node.
    sheet_faces : the same; a triangle ends with -1.
    fibre_direction_1, fibre_direction_2 : unit vectors, shape (element_count, 3).
    thickness : initial thickness [m].
    course : number of the course of each face (element_count,); None for one piece.
    """

    node_positions: np.ndarray
    elements: np.ndarray
    sheet_faces: np.ndarray
    fibre_direction_1: np.ndarray
    fibre_direction_2: np.ndarray
    thickness: float
    course: np.ndarray | None = None

    @classmethod
    def of_blank(cls, blank: BlankMesh) -> MidSurfaceMesh:
        """Return the mid-surface of a blank."""
        return cls(
            blank.mid_surface_positions, blank.faces, blank.sheet_faces,
            blank.fibre_direction_1, blank.fibre_direction_2, blank.thickness, blank.course,
        )  # fmt: skip

    def tangents(self, positions: np.ndarray) -> np.ndarray:
        return 2.0 * MODES[:2, :4] @ positions[..., self.elements, :]

    def areas(self, positions: np.ndarray) -> np.ndarray:
        """Area of every face (..., element_count) [m²]."""
        return 4.0 * spanned(self.tangents(positions))


# Cells whose centre is nearer to a middle axis of the blank than this part of their size lie on it.
ON_AXIS = 1e-6


@dataclass(frozen=True)
class TriangleMesh(FlatMesh):
    """Triangles on the mid-surface of an undeformed, flat blank.

    Attributes
    ----------
    node_positions : positions [m], shape (node_count, 3); node ``i`` is the middle of the blank's
        node pair ``i``.
    elements : node numbers, anticlockwise seen from above, shape (element_count, 3).
    fibre_direction_1, fibre_direction_2 : unit vectors, shape (element_count, 3).
    thickness : initial thickness [m].
    is_cut : whether some are halved cells at a cut edge.
    course : number of the course of each triangle (element_count,); None for one piece.
    """

    node_positions: np.ndarray
    elements: np.ndarray
    fibre_direction_1: np.ndarray
    fibre_direction_2: np.ndarray
    thickness: float
    is_cut: bool = False
    course: np.ndarray | None = None

    @property
    def sheet_faces(self) -> np.ndarray:
        return self.elements

    def tangents(self, positions: np.ndarray) -> np.ndarray:
        """Two sides of every triangle (..., element_count, 2, 3)."""
        corners = positions[..., self.elements, :]
        return corners[..., 1:, :] - corners[..., :1, :]

    def areas(self, positions: np.ndarray) -> np.ndarray:
        """Area of every triangle (..., element_count) [m²]."""
        return 0.5 * spanned(self.tangents(positions))


def triangulate(blank: BlankMesh) -> TriangleMesh:
    """Split every quadrilateral of a blank into two triangles with legs along the fibres.

    Edges along the fibres keep the stiff fibres from locking the shear (ten Thije and Akkerman,
    "A multi-layer triangular membrane finite element for the forming simulation of laminated
    composites"): each triangle has one edge in either fibre direction. The diagonals run around the
    middle of the blank, for two reasons. A blank that is symmetric to its middle axes keeps its
    mirror images. And within a quarter all diagonals are parallel, so that the curvatures of
    ``elements/membrane_shell`` are central differences about every node, with equal weights;
    diagonals that alternate from cell to cell leave out every other node, and folds through the
    nodes left out cost too little. The one exception is the node in the middle, where the quarters
    meet: its curvatures count twice (they would not count at all if the diagonals met there).
    Halved cells at a cut edge stay as they are.
    """
    positions, faces = blank.mid_surface_positions, blank.faces
    quadrilaterals = np.flatnonzero(~blank.is_triangle)
    corners = faces[quadrilaterals]
    first = _runs_around(blank, quadrilaterals)[:, None]
    lower = np.where(first, corners[:, [0, 1, 2]], corners[:, [0, 1, 3]])
    upper = np.where(first, corners[:, [0, 2, 3]], corners[:, [1, 2, 3]])

    cells = np.concatenate([np.flatnonzero(blank.is_triangle), quadrilaterals, quadrilaterals])
    triangles = np.concatenate([faces[blank.is_triangle][:, :3], lower, upper])
    order = np.argsort(cells, kind="stable")  # neighbours stay together in memory
    return TriangleMesh(
        node_positions=positions,
        elements=triangles[order],
        fibre_direction_1=blank.fibre_direction_1[cells[order]],
        fibre_direction_2=blank.fibre_direction_2[cells[order]],
        thickness=blank.thickness,
        is_cut=bool(blank.is_triangle.any()),
        course=None if blank.course is None else blank.course[cells[order]],
    )


def _runs_around(blank: BlankMesh, cells: np.ndarray) -> np.ndarray:
    """Whether the diagonal 0-2 of each cell runs around the middle of the blank, not through it.

    The middle is that of the blank's box along the fibres. A cell on a middle axis has no diagonal
    that its mirror image shares; it takes 0-2.
    """
    axes = np.stack([blank.fibre_direction_1[0], blank.fibre_direction_2[0]])
    along_fibres = blank.mid_surface_positions @ axes.T
    middle = 0.5 * (along_fibres.min(axis=0) + along_fibres.max(axis=0))
    corners = along_fibres[blank.faces[cells]]
    centre = corners.mean(axis=1) - middle
    diagonal = corners[:, 2] - corners[:, 0]
    size = np.abs(diagonal).sum(axis=1)
    on_axis = (np.abs(centre) < ON_AXIS * size[:, None]).any(axis=1)
    return on_axis | (np.prod(centre, axis=1) * np.prod(diagonal, axis=1) < 0.0)
