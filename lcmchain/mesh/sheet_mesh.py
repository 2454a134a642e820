"""What fields, files and solver ask the mesh of a sheet, and the fibres of a deformed one.

Every mesh of a sheet answers :class:`SheetMesh`, whatever its elements are.
"""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np

#: Marks the missing last nodes of a face or volume with fewer than the others.
NO_NODE = -1


class SheetMesh(Protocol):
    """Mesh of an undeformed sheet with its fibre directions."""

    @property
    def node_positions(self) -> np.ndarray:
        """Positions (node_count, 3) [m]."""

    @property
    def elements(self) -> np.ndarray:
        """Node numbers (element_count, corner_count)."""

    @property
    def fibre_direction_1(self) -> np.ndarray:
        """Unit vectors (element_count, 3)."""

    @property
    def fibre_direction_2(self) -> np.ndarray:
        """Unit vectors (element_count, 3)."""

    @property
    def course(self) -> np.ndarray | None:
        """Number of the course of each element (element_count,); None for a sheet of one piece."""

    @property
    def thickness(self) -> float:
        """Of the undeformed sheet [m]."""

    @property
    def has_thickness(self) -> bool:
        """Whether the elements know their present thickness."""

    @property
    def node_count(self) -> int: ...

    @property
    def element_count(self) -> int: ...

    @property
    def element_areas(self) -> np.ndarray:
        """Areas of the undeformed elements (element_count,) [m²]."""

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
        """As :meth:`bend_part`, of the undeformed mesh, shape (element_count,) [m²]."""

    def sides(self) -> dict[str, slice]:
        """Return the nodes that stand for the mid-surface nodes, by the side that they lie on.

        The keys ``"bottom"`` and ``"top"``, or one that is empty where the nodes serve both sides.
        """

    def base_vectors(self, positions: np.ndarray) -> np.ndarray:
        """Return a1, a2, a3 (..., element_count, 3, 3) at the element centres.

        a1 and a2 lie in the mid-surface; a3 is half the director, or the unit normal where the
        mesh has no thickness.
        """


class UndeformedFrame:
    """Counts of a mesh, and what its undeformed positions decide, computed once."""

    node_positions: np.ndarray
    elements: np.ndarray
    fibre_direction_1: np.ndarray
    fibre_direction_2: np.ndarray

    @property
    def node_count(self) -> int:
        return len(self.node_positions)

    @property
    def element_count(self) -> int:
        return len(self.elements)

    def base_vectors(self, positions: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def bend_part(self, positions: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    @cached_property
    def initial_base_vectors(self) -> np.ndarray:
        """Base vectors of the undeformed mesh (element_count, 3, 3)."""
        return self.base_vectors(self.node_positions)

    @cached_property
    def fibre_components(self) -> tuple[np.ndarray, np.ndarray]:
        """Components (element_count, 3) of both fibre directions in them."""
        base = self.initial_base_vectors
        return components(base, self.fibre_direction_1), components(base, self.fibre_direction_2)

    @cached_property
    def initial_bend_part(self) -> np.ndarray:
        """As :meth:`bend_part`, of the undeformed mesh, shape (element_count,) [m²]."""
        return self.bend_part(self.node_positions)


def spanned(vectors: np.ndarray) -> np.ndarray:
    """Return the area |a1 × a2| (...) [m²] that the first two of vectors (..., 2 or 3, 3) span."""
    return np.linalg.norm(np.cross(vectors[..., 0, :], vectors[..., 1, :]), axis=-1)


def components(base: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the contravariant components (..., 3) of directions (..., 3) in bases (..., 3, 3)."""
    return np.linalg.solve(np.swapaxes(base, -1, -2), direction[..., None])[..., 0]


def carried(components: np.ndarray, current: np.ndarray) -> np.ndarray:
    """Return F·direction (..., 3): components (..., 3) of the reference in the current base."""
    first, second, third = (components[..., k, None] * current[..., k, :] for k in range(3))
    return first + second + third


def angle_of_shear(
    direction_1: np.ndarray, direction_2: np.ndarray, normal: np.ndarray
) -> np.ndarray:
    """Return a right angle minus the angle from direction 1 to 2 about the unit normal [rad].

    The length of the directions (..., 3) does not matter.
    """
    # arctan of cosine over sine stays exact for small angles, where arccos loses half the digits.
    return np.arctan2(
        np.einsum("...i,...i->...", direction_1, direction_2),
        np.einsum("...i,...i->...", np.cross(direction_1, direction_2), normal),
    )


def change_of_angle(
    line_1: np.ndarray, line_2: np.ndarray, normal: np.ndarray, apart: float
) -> np.ndarray:
    """Return by how much the angle from line 1 to 2 about the unit normal has become smaller [rad].

    Parameters
    ----------
    line_1, line_2 : (..., 3), of any length. apart : from 1 to 2 at the start [rad]; lines have no
        sense, so that the angle counts up to π.
    """
    initial = apart % np.pi
    # the sense of line 2 in which it lay on the left of line 1
    sense = 1.0 if apart % (2.0 * np.pi) < np.pi else -1.0
    along = np.einsum("...i,...i->...", line_1, line_2)
    across = np.einsum("...i,...i->...", np.cross(line_1, line_2), normal)
    return initial - np.arctan2(sense * across, sense * along)


def shear_angles(mesh: SheetMesh, positions: np.ndarray) -> np.ndarray:
    """Return the shear angle of every element [rad] at node positions (..., node_count, 3)."""
    current = mesh.base_vectors(positions)
    normal = np.cross(current[..., 0, :], current[..., 1, :])
    normal /= np.linalg.norm(normal, axis=-1)[..., None]
    first, second = (carried(fibre, current) for fibre in mesh.fibre_components)
    return angle_of_shear(first, second, normal)
