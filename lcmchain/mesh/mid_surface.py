"""The mid-surface of a blank as a mesh of its own: quadrilaterals without a thickness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.fibres import UndeformedFrame
from lcmchain.mesh.hexahedron import MODES


@dataclass(eq=False)
class MidSurfaceMesh(UndeformedFrame):
    """Mid-surface of an undeformed, flat blank; see :class:`lcmchain.mesh.sheet_mesh.SheetMesh`.

    Attributes
    ----------
    node_positions : positions [m], shape (node_count, 3); node ``i`` is the middle of the blank's
        node pair ``i``.
    elements : nodes of the faces, shape (element_count, 4); a triangle repeats its last node.
    sheet_faces : the same; a triangle ends with -1.
    fibre_direction_1, fibre_direction_2 : unit vectors, shape (element_count, 3).
    thickness : initial thickness [m].
    """

    node_positions: np.ndarray
    elements: np.ndarray
    sheet_faces: np.ndarray
    fibre_direction_1: np.ndarray
    fibre_direction_2: np.ndarray
    thickness: float

    has_thickness = False
    volumes = None

    @classmethod
    def of_blank(cls, blank: BlankMesh) -> MidSurfaceMesh:
        """Return the mid-surface of a blank."""
        return cls(
            blank.mid_surface_positions, blank.faces, blank.sheet_faces,
            blank.fibre_direction_1, blank.fibre_direction_2, blank.thickness,
        )  # fmt: skip

    @property
    def node_count(self) -> int:
        return len(self.node_positions)

    @property
    def element_count(self) -> int:
        return len(self.elements)

    @property
    def element_areas(self) -> np.ndarray:
        """Initial area of every face [m²], shape (element_count,)."""
        return self.areas(self.node_positions)

    def areas(self, positions: np.ndarray) -> np.ndarray:
        """Area 4 |a1 × a2| of every face (..., element_count) [m²]."""
        a = self.base_vectors(positions)
        return 4.0 * np.linalg.norm(np.cross(a[..., 0, :], a[..., 1, :]), axis=-1)

    def bend_part(self, positions: np.ndarray) -> np.ndarray:
        return np.zeros(np.shape(positions)[:-2] + (self.element_count,))

    def sides(self) -> dict[str, slice]:
        return {"": slice(None)}

    def mid_surface(self, positions: np.ndarray) -> np.ndarray:
        """The nodes themselves."""
        return positions

    def base_vectors(self, positions: np.ndarray) -> np.ndarray:
        """Return a1, a2 at the centres, and the unit normal (..., element_count, 3, 3)."""
        in_plane = 2.0 * MODES[:2, :4] @ positions[..., self.elements, :]
        normal = np.cross(in_plane[..., 0, :], in_plane[..., 1, :])
        with np.errstate(invalid="ignore", divide="ignore"):
            normal = normal / np.linalg.norm(normal, axis=-1)[..., None]
        return np.concatenate([in_plane, normal[..., None, :]], axis=-2)
