"""Permeability on a mapping's target: the tensor in the plane of the sheet, not its axes alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcmchain.mapping.gradients import limited_gradients, limited_tensor_gradients
from lcmchain.mapping.orientation import map_directions
from lcmchain.mapping.sheet import PrincipalPermeability
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.weights import MappingWeights


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

    Of second order they vary linearly within the face; the tensors of its neighbours are turned
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
