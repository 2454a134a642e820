"""Eight-node solid-shell: corners, the vectors that its shape is made of, and how a sheet bends.

An element's own thickness a3·n is taken on its chord and shrinks where its directors turn. What its
neighbours say of the curvature gives the thickness back; see
``lcmchain/elements/solid_shell/curvature.py``, where the same is written for the kernels.
"""

from __future__ import annotations

import numpy as np

# signs of (ξ, η, ζ) of the nodes of VTK's hexahedron, Fig. 1a
NODE_SIGNS = np.array(
    [
        [-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
        [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1],
    ],
    dtype=float,
)  # fmt: skip
_XI, _ETA, _ZETA = NODE_SIGNS.T
# rows: 1 ξ, 2 η, 3 ζ, 4 ξη, 5 ηζ, 6 ξζ, 7 ξηζ
MODES = np.array([_XI, _ETA, _ZETA, _XI * _ETA, _ETA * _ZETA, _XI * _ZETA, _XI * _ETA * _ZETA]) / 8


# --- bends, told by the neighbours of each element ------------------------------------------------


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


def largest_ripple(turn: float) -> float:
    """Return by how much the force that draws a sheet over a radius changes, in parts of it.

    A mesh runs over a radius as a chain of links over a sprocket, evenly on average only ("chordal
    action"; e.g. Fuglede, Thomsen, "Kinematics of roller chain drives", Mech. Mach. Theory 100
    (2016) 17-32). A link that turns by θ is shorter than its arc by θ²/24 of it. While it comes
    onto the radius the sheet is gained on the one end at the rate of up to θ²/8, while it leaves
    lost on the other: the speed changes by θ²/4 from its largest to its least value, and since the
    work is the same, so does the force. Friction on the radius, and bending, add to it.

    Parameters
    ----------
    turn : θ from one element to the next [rad], their length over the radius.
    """
    return 0.25 * turn**2


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
    # Axes of components lead, elements come last: NumPy is slow in loops over two or three.
    corners = np.ascontiguousarray(np.moveaxis(positions, -1, 0))[..., elements]
    modes = np.ascontiguousarray(np.moveaxis(corners @ MODES.T, -1, 0))
    tangents, half = modes[:2], modes[2]
    changes = modes[[5, 4]]  # of the director along ξ (a6) and η (a5)
    normal = np.cross(tangents[0], tangents[1], axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal = normal / np.sqrt(_dot(normal, normal))
    centre = corners @ np.full(corners.shape[-1], 1.0 / corners.shape[-1])
    inverse = _inverse(_products(tangents, tangents))

    there = neighbours >= 0
    way = _to_neighbours(centre, neighbours, there)
    turn = _to_neighbours(normal, neighbours, there)
    # (2, 4, ..., E) covariant, then the way along ξ and η
    way = _products(tangents, way)
    way = _matrix_product(inverse, way)
    turn = _products(tangents, turn)
    squares = _products(way, way)
    ridge = RIDGE * (squares[0, 0] + squares[1, 1])
    # an element without neighbours shares nothing
    ridge = np.where(ridge > 0.0, ridge, 1.0)
    squares[0, 0] += ridge
    squares[1, 1] += ridge
    shared = _matrix_product(_inverse(squares), _products(way, turn))  # ∂n/∂ξ_k·a_l
    height = _dot(half, normal)
    turned = _contraction(_matrix_product(shared, inverse), shared)
    part = LARGEST_TURN / np.sqrt(np.maximum(turned, LARGEST_TURN**2))
    shared = shared * height

    bent = _products(changes, tangents)
    tilt = shared - bent
    tilt = _contraction(_matrix_product(tilt, inverse), tilt)
    with np.errstate(invalid="ignore", divide="ignore"):
        agreement = np.maximum(1.0 - tilt / (LARGEST_TILT * height) ** 2, 0.0)
    shared = shared * (part * agreement**2)
    bent[0, 1] = bent[1, 0] = 0.5 * (bent[0, 1] + bent[1, 0])
    raised = _matrix_product(shared, inverse)
    mixed = 0.5 * (raised[0, 1] + raised[1, 0])
    linear = raised[0, 0] * bent[0, 0] + raised[1, 1] * bent[1, 1] + 2.0 * mixed * bent[0, 1]
    return 2.0 * linear - _contraction(raised, shared)


def _to_neighbours(values: np.ndarray, neighbours: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Differences (4, 3, ..., E) of values (3, ..., E) from those of the neighbours, 0 for none."""
    found = [np.where(known, values[..., k] - values, 0.0) for known, k in zip(there, neighbours)]
    return np.array(found)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(axis=0)


def _products(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Sums over the second axis, (K, D, ...) and (L, D, ...) to (K, L, ...)."""
    return (a[:, None] * b[None]).sum(axis=2)


def _matrix_product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of matrices (K, L, ...) and (L, M, ...)."""
    return (a[:, :, None] * b[None]).sum(axis=1)


def _contraction(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(axis=(0, 1))


def _inverse(A: np.ndarray) -> np.ndarray:
    """Return the inverses of symmetric matrices (2, 2, ...); not a number where there is none."""
    determinant = A[0, 0] * A[1, 1] - A[0, 1] ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.array([[A[1, 1], -A[0, 1]], [-A[0, 1], A[0, 0]]]) / determinant
