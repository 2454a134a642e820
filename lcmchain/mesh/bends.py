"""How a sheet of solid elements is bent, told by the neighbours of each element (NumPy).

An element's own thickness a3·n is taken on its chord and shrinks where its directors turn. What its
neighbours say of the curvature gives the thickness back; see
``lcmchain/elements/solid_shell/curvature.py``, where the same is written for the kernels.
"""

from __future__ import annotations

import numpy as np

from lcmchain.mesh.hexahedron import MODES

# Corners at the ends of the edges of the lower face: at ξ = 1, ξ = -1, η = 1, η = -1.
EDGES = ((1, 2), (3, 0), (2, 3), (0, 1))
# Keeps the least squares regular where all neighbours lie in one direction: part of the trace.
RIDGE = 1e-4
# Largest c over half the thickness, the sine of half the angle by which directors turn: an element
# that turns by more than 60° resolves no bend; where a sheet folds on itself normals mean little.
LARGEST_TURN = 0.5
# Largest b - c over half the thickness: beyond it the directors tilt to and fro instead of turning
# with the sheet, and the element keeps the thickness on its chord.
LARGEST_TILT = 0.25


def edge_neighbours(elements: np.ndarray) -> np.ndarray:
    """Return the elements (4, element_count) int32 across the edges of hexahedra, -1 for none.

    ``elements`` (element_count, 8) are node numbers; elements that share an edge of the lower face
    are neighbours. An edge of no length has none, nor one that more than two elements share.
    """
    count = len(elements)
    ends = np.sort(np.stack([elements[:, edge] for edge in EDGES]), axis=2).reshape(-1, 2)
    _, edge, times = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    edge = edge.ravel()
    result = np.full(4 * count, -1, dtype=np.int32)
    shared = (times[edge] == 2) & (ends[:, 0] != ends[:, 1])
    order = np.flatnonzero(shared)[np.argsort(edge[shared], kind="stable")]
    first, second = order[::2], order[1::2]
    result[first], result[second] = second % count, first % count
    return result.reshape(4, count)


def bend_part(elements: np.ndarray, neighbours: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return 2 c·b - c² (..., element_count) [m²], what (a3·n)² misses of half the thickness².

    b is the change of the director within an element along ξ and η, c that of the normal over its
    neighbours, times half the thickness.

    Parameters
    ----------
    elements : (element_count, 8). neighbours : from :func:`edge_neighbours`.
    positions : (..., node_count, 3) [m].
    """
    modes = np.einsum("km,...emd->...ekd", MODES, positions[..., elements, :])
    tangents, half = modes[..., :2, :], modes[..., 2, :]
    changes = modes[..., [5, 4], :]  # of the director along ξ (a6) and η (a5)
    normal = np.cross(tangents[..., 0, :], tangents[..., 1, :])
    with np.errstate(invalid="ignore", divide="ignore"):
        normal = normal / np.linalg.norm(normal, axis=-1)[..., None]
    centre = positions[..., elements, :].mean(axis=-2)
    metric = np.einsum("...kd,...ld->...kl", tangents, tangents)
    inverse = _inverse(metric)

    there = neighbours >= 0
    way = np.where(there[..., None], centre[..., neighbours, :] - centre[..., None, :, :], 0.0)
    turn = np.where(there[..., None], normal[..., neighbours, :] - normal[..., None, :, :], 0.0)
    # (..., 4, E, 2) covariant, then the way along ξ and η
    way = np.einsum("...ekd,...bed->...bek", tangents, way)
    way = np.einsum("...ekl,...bel->...bek", inverse, way)
    turn = np.einsum("...ekd,...bed->...bek", tangents, turn)
    squares = np.einsum("...bek,...bel->...ekl", way, way)
    ridge = RIDGE * np.trace(squares, axis1=-2, axis2=-1)
    # an element without neighbours shares nothing
    squares = squares + np.where(ridge > 0.0, ridge, 1.0)[..., None, None] * np.eye(2)
    products = np.einsum("...bek,...bel->...ekl", way, turn)
    shared = _inverse(squares) @ products  # ∂n/∂ξ_k·a_l
    height = np.einsum("...ed,...ed->...e", half, normal)
    turned = np.einsum("...ekl,...ekl->...e", shared @ inverse, shared)
    part = LARGEST_TURN / np.sqrt(np.maximum(turned, LARGEST_TURN**2))
    shared = shared * height[..., None, None]

    own = np.einsum("...ekd,...eld->...ekl", changes, tangents)
    tilt = shared - own
    tilt = np.einsum("...ekl,...ekl->...e", tilt @ inverse, tilt)
    with np.errstate(invalid="ignore", divide="ignore"):
        agreement = np.maximum(1.0 - tilt / (LARGEST_TILT * height) ** 2, 0.0)
    shared = shared * (part * agreement**2)[..., None, None]
    own[..., 0, 1] = own[..., 1, 0] = 0.5 * (own[..., 0, 1] + own[..., 1, 0])
    raised = shared @ inverse
    mixed = 0.5 * (raised[..., 0, 1] + raised[..., 1, 0])
    linear = raised[..., 0, 0] * own[..., 0, 0] + raised[..., 1, 1] * own[..., 1, 1]
    linear += 2.0 * mixed * own[..., 0, 1]
    return 2.0 * linear - np.einsum("...ekl,...ekl->...e", raised, shared)


def _inverse(A: np.ndarray) -> np.ndarray:
    """Return the inverses of symmetric matrices (..., 2, 2); not a number where there is none."""
    determinant = A[..., 0, 0] * A[..., 1, 1] - A[..., 0, 1] ** 2
    cofactors = np.empty_like(A)
    cofactors[..., 0, 0], cofactors[..., 1, 1] = A[..., 1, 1], A[..., 0, 0]
    cofactors[..., 0, 1] = cofactors[..., 1, 0] = -A[..., 0, 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        return cofactors / determinant[..., None, None]
