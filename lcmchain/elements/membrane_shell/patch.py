"""Reference geometry of triangles and of the patches that give their curvature (NumPy).

The patch of a triangle is the triangle and its up to three neighbours: six nodes, through whose
positions one quadratic surface goes (Phaal and Calladine, "A simple class of finite elements for
plate and shell problems. II", 1992; the patch is that of Oñate and Flores, "Advances in the
formulation of the rotation-free basic shell triangle", 2005). Its second derivatives along the
fibres are linear in the positions, with coefficients that the reference gives once and for all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.errors import InputError
from lcmchain.mesh.mid_surface import TriangleMesh

CORNERS = 3
PATCH_NODES = 6

# Coefficients of second derivatives on right triangles are at most 2 / leg². Six nodes near a conic
# section leave the quadratic surface almost undetermined, its coefficients grow beyond all bounds.
LARGEST_COEFFICIENT = 10.0

NO_NODE = -1


class TriangleGeometry(NamedTuple):
    """Reference geometry of E triangles in fibre axes.

    nodes : (E, 6) corners, then the far nodes of the neighbours across the sides 1-2, 2-0 and 0-1;
        -1 where the side is free.
    gradient : (E, 3, 2) derivatives of the corners' shape functions along the fibres [1/m].
    curvature : (E, 3, 6) weights [1/m²] of the patch's nodes in the second derivatives 11, 22 and
        twice 12; 0 for absent nodes.
    area : (E,) [m²].
    """

    nodes: np.ndarray
    gradient: np.ndarray
    curvature: np.ndarray
    area: np.ndarray


def triangle_geometry(mesh: TriangleMesh, bending_stiffness: ArrayLike) -> TriangleGeometry:
    """Return gradients and curvature weights of the triangles of a flat mesh.

    Parameters
    ----------
    mesh : :class:`lcmchain.mesh.mid_surface.TriangleMesh`.
    bending_stiffness : (3,) stiffnesses of the curvatures 11, 22 and twice 12, in any unit. They
        enter at free edges only: there the missing node of the patch lies where it costs least
        energy, which is the condition of an edge without moments.

    Raises
    ------
    InputError : a triangle without area.
    """
    nodes = np.concatenate([mesh.elements, neighbours_across(mesh.elements)], axis=1)
    positions = patch_positions(mesh, nodes)
    corners = positions[:, :CORNERS]
    area = 0.5 * _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if np.any(~(area > 0.0)):
        bad = int(np.flatnonzero(~(area > 0.0))[0])
        raise InputError(f"triangle {bad} of the blank has no positive area")
    gradient = _shape_gradients(corners, area)
    curvature = _quadratic_fit(positions, area)
    size = np.abs(curvature).max(axis=(1, 2)) * 2.0 * area
    degenerate = ~(size < LARGEST_COEFFICIENT)
    if degenerate.any():
        curvature[degenerate] = _mean_gradients(positions[degenerate], area[degenerate])
    curvature = _without_edge_moments(curvature, nodes, np.asarray(bending_stiffness, dtype=float))
    return TriangleGeometry(nodes, gradient, curvature, area)


def neighbours_across(triangles: np.ndarray) -> np.ndarray:
    """Return the far nodes of the neighbours across the sides 1-2, 2-0, 0-1, (E, 3); -1 is none."""
    sides = np.stack([triangles[:, [1, 2]], triangles[:, [2, 0]], triangles[:, [0, 1]]], axis=1)
    keys = np.sort(sides.reshape(-1, 2), axis=1)
    far = triangles.reshape(-1)  # the corner opposite to each side
    order = np.lexsort((keys[:, 1], keys[:, 0]))
    same = np.flatnonzero((keys[order[1:]] == keys[order[:-1]]).all(axis=1))
    first, second = order[same], order[same + 1]
    result = np.full(far.size, NO_NODE, dtype=np.int64)
    result[first], result[second] = far[second], far[first]
    return result.reshape(-1, 3)


def patch_positions(mesh: TriangleMesh, nodes: np.ndarray) -> np.ndarray:
    """Return the patch's nodes in fibre axes about the first corner, (E, 6, 2) [m].

    A neighbour that is missing is taken as the triangle's own image, turned by 180 degrees about
    the middle of the side.
    """
    relative = mesh.node_positions[np.where(nodes < 0, nodes[:, :1], nodes)]
    relative = relative - relative[:, :1]
    axes = np.stack([mesh.fibre_direction_1, mesh.fibre_direction_2], axis=1)
    local = np.einsum("ead,end->ena", axes, relative)
    corners = local[:, :CORNERS]
    image = corners.sum(axis=1, keepdims=True) - 2.0 * corners
    local[:, CORNERS:] = np.where((nodes < 0)[:, CORNERS:, None], image, local[:, CORNERS:])
    return local


def angle_shares(corners: np.ndarray) -> np.ndarray:
    """Return the part of a triangle that belongs to each corner, its angle over 180°, (E, 3).

    On a mesh of right triangles every inner node gets the area of one cell, however the diagonals
    run; equal thirds would give a node where diagonals meet more than its neighbours.
    """
    forward = np.roll(corners, -1, axis=1) - corners
    backward = np.roll(corners, 1, axis=1) - corners
    cosine = np.einsum("enc,enc->en", forward, backward)
    sine = np.linalg.norm(np.cross(forward, backward), axis=2)
    return np.arctan2(sine, cosine) / np.pi


def _shape_gradients(corners: np.ndarray, area: np.ndarray) -> np.ndarray:
    far_side = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    normal = np.stack([-far_side[..., 1], far_side[..., 0]], axis=-1)  # inwards
    return normal / (2.0 * area[:, None, None])


def _quadratic_fit(positions: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Return the weights of the second derivatives of the quadratic surface, (E, 3, 6)."""
    scale = np.sqrt(2.0 * area)
    x, y = np.moveaxis(positions / scale[:, None, None], -1, 0)
    monomials = np.stack([np.ones_like(x), x, y, 0.5 * x * x, 0.5 * y * y, 0.5 * x * y], axis=-1)
    weights = np.full_like(monomials, np.inf)
    regular = np.linalg.cond(monomials) < 1.0 / np.finfo(float).eps
    weights[regular] = np.linalg.inv(monomials[regular])
    return weights[:, 3:] / (scale * scale)[:, None, None]


def _mean_gradients(positions: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Return the weights of the basic shell triangle (Oñate and Zárate 2000), (E, 3, 6).

    The gradient on a side is the mean of those on both its sides; Gauss's theorem gives the second
    derivatives. It exists for every patch, but sees curvature in a twist of unequal neighbours.
    """
    weights = np.zeros((len(positions), 3, PATCH_NODES))
    own = _shape_gradients(positions[:, :CORNERS], area)
    for side in range(CORNERS):
        # corners of the neighbour: the far node, then the side in opposite direction
        order = [CORNERS + side, (side + 2) % CORNERS, (side + 1) % CORNERS]
        corners = positions[:, order]
        neighbour_area = 0.5 * _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        gradient = _shape_gradients(corners, neighbour_area)
        outwards = -own[:, side]  # outer normal times length over twice the area
        weights[:, 0, order] += outwards[:, None, 0] * gradient[..., 0]
        weights[:, 1, order] += outwards[:, None, 1] * gradient[..., 1]
        weights[:, 2, order] += outwards[:, None, 0] * gradient[..., 1]
        weights[:, 2, order] += outwards[:, None, 1] * gradient[..., 0]
    return weights


def _without_edge_moments(
    curvature: np.ndarray, nodes: np.ndarray, bending_stiffness: np.ndarray
) -> np.ndarray:
    """Eliminate the images across free sides: each lies where the bending energy is least."""
    result = curvature.copy()
    absent = nodes < 0
    for pattern in np.unique(absent[absent.any(axis=1)], axis=0):
        members = np.flatnonzero((absent == pattern).all(axis=1))
        images = curvature[members][:, :, pattern]
        weighted = bending_stiffness[:, None] * images
        stiffness = np.einsum("eci,ecj->eij", weighted, images)
        coupling = np.einsum("eci,ecn->ein", weighted, curvature[members])
        result[members] -= np.einsum("eci,ein->ecn", images, np.linalg.solve(stiffness, coupling))
    result[np.broadcast_to(absent[:, None], result.shape)] = 0.0
    return result


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
