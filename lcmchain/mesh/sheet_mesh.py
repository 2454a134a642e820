"""What fields, files and solver ask the mesh of an undeformed sheet, whatever its elements are."""

from __future__ import annotations

from typing import Protocol

import numpy as np

#: Marks the missing last nodes of a face or volume with fewer than the others.
NO_NODE = -1


class SheetMesh(Protocol):
    """Mesh of an undeformed sheet with its fibre directions.

    node_positions : (node_count, 3) [m]. elements : (element_count, corner_count) node numbers.
    fibre_direction_1, fibre_direction_2 : unit vectors (element_count, 3).
    thickness : initial [m]. has_thickness : whether the elements know their present thickness.
    element_areas : initial (element_count,) [m²].
    """

    node_positions: np.ndarray
    elements: np.ndarray
    fibre_direction_1: np.ndarray
    fibre_direction_2: np.ndarray
    thickness: float
    has_thickness: bool

    @property
    def node_count(self) -> int: ...

    @property
    def element_count(self) -> int: ...

    @property
    def element_areas(self) -> np.ndarray: ...

    @property
    def sheet_faces(self) -> np.ndarray:
        """Faces of the mid-surface (element_count, 3 or 4) in its own nodes; -1 is none."""

    @property
    def volumes(self) -> np.ndarray | None:
        """Nodes of the volumes (element_count, 8) in VTK's order, -1 is none; None without."""

    def mid_surface(self, positions: np.ndarray) -> np.ndarray:
        """Return the mid-surface nodes (..., n, 3) of node positions (..., node_count, 3)."""

    def areas(self, positions: np.ndarray) -> np.ndarray:
        """Return the mid-surface areas (..., element_count) [m²] at the element centres."""

    @property
    def initial_base_vectors(self) -> np.ndarray:
        """Base vectors of the undeformed mesh (element_count, 3, 3)."""

    @property
    def fibre_components(self) -> tuple[np.ndarray, np.ndarray]:
        """Components (element_count, 3) of both fibre directions in them."""

    def bend_part(self, positions: np.ndarray) -> np.ndarray:
        """Return what (a3·n)² of bent elements misses of half the thickness² [m²]."""

    @property
    def initial_bend_part(self) -> np.ndarray:
        """That of the undeformed mesh, shape (element_count,) [m²]."""

    def sides(self) -> dict[str, slice]:
        """Return the nodes that stand for the mid-surface nodes, by the side that they lie on.

        The keys ``"bottom"`` and ``"top"``, or one that is empty where the nodes serve both sides.
        """

    def base_vectors(self, positions: np.ndarray) -> np.ndarray:
        """Return a1, a2, a3 (..., element_count, 3, 3) at the element centres.

        a1 and a2 lie in the mid-surface; a3 is half the director, or the unit normal where the
        mesh has no thickness.
        """
