"""Fibre directions as orientations: a fibre has an axis, not a head and a tail."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.mapping.averages import leading_faces, mean_tensor_over_cells
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.weights import MappingWeights

# Pairs of tensor indices that are stored of a symmetric 3x3 tensor.
_ROWS, _COLUMNS = np.array([0, 1, 2, 1, 0, 0]), np.array([0, 1, 2, 2, 2, 1])
_MULTIPLICITY = (1.0, 1.0, 1.0, 2.0, 2.0, 2.0)


class MappedDirections(NamedTuple):
    """One fibre family on the target."""

    direction: np.ndarray  # (C, 3) unit vectors; not a number where the cell is unmapped
    alignment: np.ndarray  # (C,) largest eigenvalue of the mean orientation tensor, 1/3 to 1
    tilt: np.ndarray  # (C,) [rad] angle by which the projection turned the direction


def map_directions(
    surface: Surface, weights: MappingWeights, directions: np.ndarray, normals: np.ndarray | None
) -> MappedDirections:
    """Map fibre directions, shape (F, 3), to the target cells.

    The orientation tensors a ⊗ a are averaged, so that the sign of a direction has no meaning;
    the principal direction of the mean is projected onto the cell's tangent plane and normalised.
    Its sign follows the face with the largest weight.

    Parameters
    ----------
    normals : unit normals of the cells, shape (C, 3); None leaves the directions as they are
        (solid cells have no tangent plane).

    Source: Advani and Tucker, Journal of Rheology 31 (1987) 751, for the orientation tensor.
    """
    products = directions[:, _ROWS] * directions[:, _COLUMNS]
    averaged = mean_tensor_over_cells(surface, weights, products, _MULTIPLICITY)
    averaged[~weights.mapped] = 0.0
    tensors = np.empty((weights.cell_count, 3, 3))
    tensors[:, _ROWS, _COLUMNS] = averaged
    tensors[:, _COLUMNS, _ROWS] = averaged
    values, vectors = np.linalg.eigh(tensors)
    principal = vectors[:, :, 2]
    against = np.einsum("ci,ci->c", principal, directions[leading_faces(weights)]) < 0.0
    principal = np.where(against[:, None], -principal, principal)

    tilt = np.zeros(weights.cell_count)
    direction = principal
    if normals is not None:
        out_of_plane = np.einsum("ci,ci->c", principal, normals)
        in_plane = principal - out_of_plane[:, None] * normals
        length = np.linalg.norm(in_plane, axis=1)
        tilt = np.arctan2(np.abs(out_of_plane), length)
        direction = in_plane / np.where(length > 0.0, length, np.nan)[:, None]
    unmapped = ~weights.mapped
    direction = np.where(unmapped[:, None], np.nan, direction)
    alignment = np.where(unmapped, np.nan, values[:, 2])
    return MappedDirections(direction, alignment, np.where(unmapped, np.nan, tilt))


def perpendicular_family_error(direction_1: np.ndarray, direction_2: np.ndarray) -> np.ndarray:
    """Error [rad] of a format that keeps the first family and takes the second as perpendicular.

    It is the absolute shear angle between the families, shape (C,), 0 to pi/2.
    """
    cosine = np.abs(np.einsum("ci,ci->c", direction_1, direction_2))
    return np.arcsin(np.clip(cosine, 0.0, 1.0))
