"""Means over the cells from the weights: of scalars, of directions without a sense, and of tensors.

Fields are constant or linear within each face, as the order of the weights asks for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lcmchain.jit import routine
from lcmchain.mapping.sheet import PrincipalPermeability
from lcmchain.mapping.surfaces.gradients import limited_gradients, limited_tensor_gradients
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.mapping.weights import TILED, MappingWeights

# --- scalars, tensors in space, and contents ------------------------------------------------------


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


def _mean_tensor_over_cells(
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

    Where the cells tile a face it is the content of the face itself, not the sum of what the cells
    got, so that comparing both checks the weights.
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


def _leading_faces(weights: MappingWeights) -> np.ndarray:
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


# --- fibre directions: a fibre has an axis, not a head and a tail ---------------------------------

# How often each component of :func:`packed` stands in the tensor.
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
    averaged = _mean_tensor_over_cells(surface, weights, products, _MULTIPLICITY)
    averaged[~weights.mapped] = 0.0
    values, vectors = np.linalg.eigh(unpacked(averaged))
    principal = vectors[:, :, 2]
    against = np.einsum("ci,ci->c", principal, directions[_leading_faces(weights)]) < 0.0
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


# --- permeability: the tensor in the plane of the sheet, not its axes alone -----------------------


def map_permeability(
    surface: Surface,
    weights: MappingWeights,
    sheet: PrincipalPermeability,
    normals: np.ndarray | None,
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
        normals = map_directions(surface, weights, sheet.axes[:, 2], None).direction
    first, second = _basis(normals)
    cell, face = weights.cell, weights.face
    plane = (first[cell], second[cell], normals[cell])
    k11, k22, k12 = _seen_in(surface, face, _at_places(surface, weights, sheet), *plane)
    through = sheet.values[:, 2]
    k33 = through[face]
    if weights.order > 1:
        slope = limited_gradients(surface.gradient_stencil, through)
        k33 = k33 + _dot(slope[face], weights.place)

    def mean(values: np.ndarray) -> np.ndarray:
        summed = np.bincount(cell, weights.average * values, minlength=weights.cell_count)
        return np.where(weights.mapped, summed, np.nan)

    return _principal(mean(k11), mean(k22), mean(k12), mean(k33), first, normals)


def through_layers(
    thickness: np.ndarray, layers: Sequence[PrincipalPermeability], normals: np.ndarray
) -> PrincipalPermeability:
    """Return the permeability of layers that lie over each other in every cell.

    Along the sheet they conduct side by side: the tensor is the mean of theirs by thickness, each
    turned with its normal into the plane of the cell. Through it they conduct one after the other:
    1/k3 is the mean of theirs. That holds for flow that is even over the thickness; resistances
    between layers are not known.

    Parameters
    ----------
    thickness : of the layers, or their shares in it, shape (P, C); 0 where a cell has none.
    layers : P of them, (C,) cells each; a layer that a cell does not have counts for nothing.
    normals : unit normals of the cells, shape (C, 3).
    """
    first, second = _basis(normals)
    total = thickness.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = thickness / total
        k11, k22, k12, resistance = np.zeros((4, len(normals)))
        for share, (values, axes) in zip(shares, layers, strict=True):
            there = share > 0.0
            for number in (0, 1):
                along = turned(axes[:, number], axes[:, 2], normals)
                u, v = _dot(along, first), _dot(along, second)
                k = share * values[:, number]
                k11 += np.where(there, k * u * u, 0.0)
                k22 += np.where(there, k * v * v, 0.0)
                k12 += np.where(there, k * u * v, 0.0)
            resistance += np.where(there, share / values[:, 2], 0.0)
        k11, k22, k12 = (np.where(total > 0.0, component, np.nan) for component in (k11, k22, k12))
        return _principal(k11, k22, k12, 1.0 / resistance, first, normals)


def _principal(
    k11: np.ndarray,
    k22: np.ndarray,
    k12: np.ndarray,
    k33: np.ndarray,
    first: np.ndarray,
    normals: np.ndarray,
) -> PrincipalPermeability:
    """Return principal values and axes of tensors given in the frame of ``first`` and normals."""
    second = np.cross(normals, first)
    middle, half = 0.5 * (k11 + k22), np.hypot(0.5 * (k11 - k22), k12)
    values = np.stack([middle + half, middle - half, k33], axis=1)
    turn = 0.5 * np.arctan2(k12, 0.5 * (k11 - k22))[:, None]
    axis = np.cos(turn) * first + np.sin(turn) * second
    axes = np.stack([axis, np.cross(normals, axis), normals], axis=1)
    known = np.isfinite(values).all(axis=1)
    return PrincipalPermeability(
        np.where(known[:, None], values, np.nan), np.where(known[:, None, None], axes, np.nan)
    )


def _at_places(
    surface: Surface, weights: MappingWeights, sheet: PrincipalPermeability
) -> list[np.ndarray]:
    """Components uu, vv, uv of every weight (K,), in the frame of its face.

    In second order they vary linearly within the face. The tensors of its neighbours are turned
    into its plane for that.
    """
    larger, smaller, _ = sheet.values.T
    u, v = surface.frames.swapaxes(0, 1)
    along, across = ((_dot(axis, u), _dot(axis, v)) for axis in sheet.axes[:, :2].swapaxes(0, 1))
    of_faces = [
        larger * along[a] * along[b] + smaller * across[a] * across[b]
        for a, b in ((0, 0), (1, 1), (0, 1))
    ]
    face = weights.face
    if weights.order == 1:
        return [component[face] for component in of_faces]
    stencil = surface.gradient_stencil
    owner = np.repeat(np.arange(surface.face_count), np.diff(stencil.start))
    neighbours = [component[stencil.face] for component in of_faces]
    plane = (u[owner], v[owner], surface.normals[owner])
    around = np.stack(_seen_in(surface, stencil.face, neighbours, *plane), axis=1)
    slopes = limited_tensor_gradients(
        stencil, np.stack(of_faces, axis=1), around, multiplicity=(1.0, 1.0, 2.0)
    )
    return [
        component[face] + _dot(slopes[face, m], weights.place)
        for m, component in enumerate(of_faces)
    ]


def _seen_in(
    surface: Surface,
    face: np.ndarray,
    components: list[np.ndarray],
    first: np.ndarray,
    second: np.ndarray,
    normals: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Components 11, 22, 12 (P,) of tensors uu, vv, uv of faces (P,) that are turned into planes.

    first, second, normals : axes of the planes and their normals, shape (P, 3).
    """
    u, v = (
        turned(axis, surface.normals[face], normals) for axis in surface.frames[face].swapaxes(0, 1)
    )
    u1, u2, v1, v2 = _dot(u, first), _dot(u, second), _dot(v, first), _dot(v, second)
    uu, vv, uv = components
    return (
        uu * u1 * u1 + vv * v1 * v1 + 2.0 * uv * u1 * v1,
        uu * u2 * u2 + vv * v2 * v2 + 2.0 * uv * u2 * v2,
        uu * u1 * u2 + vv * v1 * v2 + uv * (u1 * v2 + u2 * v1),
    )


def turned(vectors: np.ndarray, old_normals: np.ndarray, normals: np.ndarray) -> np.ndarray:
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


# --- symmetric tensors of many cells --------------------------------------------------------------

# Pairs of indices that are stored of a symmetric 3x3 tensor.
_ROWS, _COLUMNS = np.array([0, 1, 2, 1, 0, 0]), np.array([0, 1, 2, 2, 2, 1])


def squares(vectors: np.ndarray) -> np.ndarray:
    """Return the tensors v v, shape (C, 3, 3), of vectors (C, 3)."""
    return np.einsum("ci,cj->cij", vectors, vectors)


def tensors_of(values: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return tensors (C, 3, 3) with principal values (C, 3) and axes, one a row, (C, 3, 3)."""
    return np.einsum("ck,cki,ckj->cij", values, axes, axes)


def packed(tensors: np.ndarray) -> np.ndarray:
    """Return the six components of symmetric tensors, shape (C, 6)."""
    return tensors[:, _ROWS, _COLUMNS]


def unpacked(components: np.ndarray) -> np.ndarray:
    """Return symmetric tensors, shape (C, 3, 3), from their six components."""
    tensors = np.empty((len(components), 3, 3))
    tensors[:, _ROWS, _COLUMNS] = components
    tensors[:, _COLUMNS, _ROWS] = components
    return tensors


def principal_permeability(tensors: np.ndarray, normals: np.ndarray) -> PrincipalPermeability:
    """Principal values and axes: two in the plane, the larger one first, and through it.

    Components between the plane and its normal are left out: they are rounding, or from a bend.
    """
    plane = np.stack(_basis(normals), axis=1)
    values, vectors = np.linalg.eigh(np.einsum("cai,cij,cbj->cab", plane, tensors, plane))
    in_plane = np.einsum("cak,cai->cki", vectors, plane)[:, ::-1]  # the larger one first
    through = np.einsum("ci,cij,cj->c", normals, tensors, normals)
    return PrincipalPermeability(
        np.concatenate([values[:, ::-1], through[:, None]], axis=1),
        np.concatenate([in_plane, normals[:, None]], axis=1),
    )


def angles_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles between axes [rad], exact for small ones."""
    sine = np.linalg.norm(np.cross(one, other), axis=1)
    return np.arctan2(sine, np.abs(np.einsum("ci,ci->c", one, other)))


def pointing_along(axes: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return axes (C, 3) with the sense of directions (C, 3)."""
    against = np.einsum("ci,ci->c", axes, directions) < 0.0
    return np.where(against[:, None], -axes, axes)
