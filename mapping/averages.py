"""Means and contents of cells from the weights, with fields constant or linear within each face."""

from __future__ import annotations

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.gradients import limited_gradients, limited_tensor_gradients
from lcmchain.mapping.pairing import TILED
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.weights import MappingWeights


def mean_over_cells(surface: Surface, weights: MappingWeights, values: np.ndarray) -> np.ndarray:
    """Mean of a face field (F,) over what each cell takes of the sheet, shape (C,).

    Cells without weights have none (not a number).
    """
    means = np.empty(weights.cell_count)
    values = np.ascontiguousarray(values, dtype=float)
    gradients = _gradients(surface, weights, values)
    _sum(weights.start, weights.face, weights.average, weights.place, values, gradients, means)
    means[~weights.mapped] = np.nan
    return means


def mean_tensor_over_cells(
    surface: Surface,
    weights: MappingWeights,
    components: np.ndarray,
    multiplicity: tuple[float, ...],
) -> np.ndarray:
    """Mean of a tensor in space over what each cell takes of the sheet, shape (C, M).

    Parameters
    ----------
    components : different components of the symmetric tensor of each face, shape (F, M).
    multiplicity : how often each of them stands in the tensor.
    """
    components = np.ascontiguousarray(components)
    gradients = np.empty((components.shape[1], 0, 2))
    if weights.order > 1:
        stencil = surface.gradient_stencil
        found = limited_tensor_gradients(
            stencil, components, components[stencil.face], multiplicity
        )
        gradients = np.ascontiguousarray(found.swapaxes(0, 1))
    means = np.empty((components.shape[1], weights.cell_count))
    for values, slopes, mean in zip(components.T.copy(), gradients, means, strict=True):
        _sum(weights.start, weights.face, weights.average, weights.place, values, slopes, mean)
    means[:, ~weights.mapped] = np.nan
    return means.T


def contents_of_cells(
    surface: Surface, weights: MappingWeights, per_area: np.ndarray
) -> np.ndarray:
    """Content that the faces hand to each cell, shape (C,), of a content per area (F,).

    The parts of a wholly covered face have its centroid together, so that their sum is its content
    whatever varies within it.
    """
    contents = np.empty(weights.cell_count)
    gradients = _gradients(surface, weights, per_area)
    areas = surface.areas
    if len(gradients):
        per_area = per_area - np.einsum("fd,fd->f", gradients, weights.content_centroid)
        gradients = gradients * areas[:, None]
    _sum(
        weights.start, weights.face, weights.content, weights.place, per_area * areas, gradients,
        contents,
    )  # fmt: skip
    return contents


def contents_of_faces(
    surface: Surface, weights: MappingWeights, per_area: np.ndarray
) -> np.ndarray:
    """Content that lies over the target of each face, shape (F,), of a content per area (F,).

    Of a face that the cells tile it is the content of the face itself, not the sum of what the
    cells got: comparing both checks the weights.
    """
    contents = per_area * surface.areas
    partly = weights.face_coverage[weights.face] < 1.0 - TILED
    face = weights.face[partly]
    gradients = _gradients(surface, weights, per_area)
    there = per_area[face]
    if len(gradients):
        there = there + np.einsum("kd,kd->k", gradients[face], weights.place[partly])
    handed = weights.content[partly] * there * surface.areas[face]
    over_edge = weights.face_coverage < 1.0 - TILED
    summed = np.bincount(face, handed, minlength=surface.face_count)
    return np.where(over_edge, summed, contents)


def leading_faces(weights: MappingWeights) -> np.ndarray:
    """Face with the largest share in each cell, shape (C,); the first of equal ones, else 0."""
    leading = np.zeros(weights.cell_count, dtype=np.int64)
    _largest(weights.start, weights.face, weights.average, leading)
    return leading


def _gradients(surface: Surface, weights: MappingWeights, values: np.ndarray) -> np.ndarray:
    """Gradients (F, 2) that the order of the weights asks for; none (0, 2) for the first."""
    if weights.order == 1:
        return np.empty((0, 2))
    return limited_gradients(surface.gradient_stencil, values)


@routine
def _sum(start, face, shares, places, values, gradients, sums):
    linear = len(gradients) > 0
    for c in range(len(sums)):
        total = 0.0
        for k in range(start[c], start[c + 1]):
            f = face[k]
            value = values[f]
            if linear:
                value += gradients[f, 0] * places[k, 0] + gradients[f, 1] * places[k, 1]
            total += shares[k] * value
        sums[c] = total


@routine
def _largest(start, face, shares, leading):
    for c in range(len(leading)):
        best = -1.0
        for k in range(start[c], start[c + 1]):
            if shares[k] > best:
                best, leading[c] = shares[k], face[k]
