"""Fibre directions of a deformed sheet, and the shear angle between them."""

from __future__ import annotations

import numpy as np

from lcmchain.mesh.sheet_mesh import SheetMesh


def dragged_along(reference: np.ndarray, current: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return F·direction (..., 3) of base vectors (..., 3, 3).

    Contravariant components in the reference are carried by the current base.
    """
    return carried(components(reference, direction), current)


def components(base: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the contravariant components (..., 3) of directions (..., 3) in bases (..., 3, 3)."""
    return np.linalg.solve(np.swapaxes(base, -1, -2), direction[..., None])[..., 0]


def carried(components: np.ndarray, current: np.ndarray) -> np.ndarray:
    """Return the sum of base vectors (..., 3, 3) times components (..., 3)."""
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


def shear_angles(mesh: SheetMesh, positions: np.ndarray) -> np.ndarray:
    """Return the shear angle of every element [rad] at node positions (..., node_count, 3)."""
    reference = mesh.base_vectors(mesh.node_positions)
    current = mesh.base_vectors(positions)
    normal = np.cross(current[..., 0, :], current[..., 1, :])
    normal /= np.linalg.norm(normal, axis=-1)[..., None]
    fibres = [
        dragged_along(reference, current, direction)
        for direction in (mesh.fibre_direction_1, mesh.fibre_direction_2)
    ]
    return angle_of_shear(fibres[0], fibres[1], normal)
