"""Permeability on a mapping's target: the tensor in the plane of the sheet, not its axes alone."""

from __future__ import annotations

import numpy as np

from lcmchain.mapping.orientation import map_directions
from lcmchain.mapping.sheet import PrincipalPermeability
from lcmchain.mapping.weights import MappingWeights


def map_permeability(
    weights: MappingWeights, sheet: PrincipalPermeability, normals: np.ndarray | None
) -> PrincipalPermeability:
    """Map permeabilities to the target cells; the axes in the plane lie in the cell's plane.

    Every face's tensor is turned with its normal into the plane of the cell, without a change of
    its values, and the tensors are averaged. Neither their axes nor their values are averaged by
    themselves: where the shear changes its sign the larger axis jumps by a right angle, while the
    tensor is continuous. Cells that take from a face without permeability have none.

    Parameters
    ----------
    normals : unit normals of the cells, shape (C, 3); None for solid cells, which take the mean
        axis through the sheet.
    """
    if normals is None:
        normals = map_directions(weights, sheet.axes[:, 2], None).direction
    first, second = _basis(normals)
    cell, face = weights.cell, weights.face
    turned = _turned(sheet.axes[face, 0], sheet.axes[face, 2], normals[cell])
    angle = np.arctan2(_dot(turned, second[cell]), _dot(turned, first[cell]))

    def mean(values: np.ndarray) -> np.ndarray:
        summed = np.bincount(cell, weights.average * values, minlength=weights.cell_count)
        return np.where(weights.mapped, summed, np.nan)

    larger, smaller, through = sheet.values[face].T
    half = 0.5 * (larger - smaller)
    # The tensor in the plane is its mean value and a vector at twice the angle of the larger axis.
    cosine, sine = mean(half * np.cos(2.0 * angle)), mean(half * np.sin(2.0 * angle))
    middle, half_of_cell = mean(0.5 * (larger + smaller)), np.hypot(cosine, sine)
    values = np.stack([middle + half_of_cell, middle - half_of_cell, mean(through)], axis=1)
    turn = 0.5 * np.arctan2(sine, cosine)[:, None]
    axis = np.cos(turn) * first + np.sin(turn) * second
    axes = np.stack([axis, np.cross(normals, axis), normals], axis=1)
    known = np.isfinite(values).all(axis=1)
    return PrincipalPermeability(
        np.where(known[:, None], values, np.nan), np.where(known[:, None, None], axes, np.nan)
    )


def _turned(vectors: np.ndarray, old_normals: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Turn vectors across ``old_normals`` as these turn, the shorter way, into ``normals``."""
    old = np.where(_dot(old_normals, normals)[:, None] < 0.0, -old_normals, old_normals)
    between = old + normals
    share = _dot(vectors, normals) / (1.0 + _dot(old, normals))
    return vectors - share[:, None] * between


def _basis(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across each normal, which form a right-handed frame with it."""
    away = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, away)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return first, np.cross(normals, first)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("ci,ci->c", a, b)
