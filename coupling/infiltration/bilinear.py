"""Conductances within quadrilaterals that are not negative, wherever that is possible.

The matrix of a bilinear quadrilateral is that of its mean gradient, which alone is right for
every linear pressure, and a multiple of g gᵀ, with the one vector g that no linear pressure has a
part of (D. P. Flanagan, T. Belytschko, International Journal for Numerical Methods in Engineering
17 (1981) 679). With that of the exact integral the conductance across a long cell, or across the
fibres, is negative. Consistency leaves the multiple free: the more the cell's material differs
from an isotropic one in a square, the more of it is taken, up to where the smaller of the two
diagonals no longer conducts. No conductance is then negative, and few are small.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

_SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))
_DIAGONALS = ((0, 2), (1, 3))
#: The exact integral is kept where this many times its least conductance is its largest.
ENOUGH = 4.0
# Of the largest entry: less is round-off.
_ROUND_OFF = 1e-9


class Quadrilaterals(NamedTuple):
    """matrix (Q, 4, 4) : conductances T_ij of every pair of corners off the diagonal.

    split (Q,) : 1 or 2 where none are positive but those of two triangles, cut along the diagonal
        between corners 0 and 2, or 1 and 3; 0 elsewhere.
    """

    matrix: np.ndarray
    split: np.ndarray


def raised(
    flat: np.ndarray, matrix: np.ndarray, mean: np.ndarray, at_gate: np.ndarray
) -> Quadrilaterals:
    """Return conductances of quadrilaterals that are as little negative as possible.

    Parameters
    ----------
    flat : corners in the plane [m], (Q, 4, 2).
    matrix : T_ij of the exact integral, mean : of the mean gradient, both (Q, 4, 4).
    at_gate : cells (Q,) that keep the exact integral as far as it is not negative: the flow
        around a gate is singular there, and any more conducts too well.
    """
    g = _without_linear_part(flat)
    product = g[:, :, None] * g[:, None, :]
    convex = (g * np.array([1.0, -1.0, 1.0, -1.0]) > 0.0).all(axis=1)
    safe = np.where(convex[:, None, None], product, 1.0)
    exact = ((mean - matrix) / safe)[:, 0, 2]
    least = np.max([(mean / safe)[:, a, b] for a, b in _SIDES], axis=0)
    across = np.stack([(mean / safe)[:, a, b] for a, b in _DIAGONALS], axis=1)
    most = across.min(axis=1)
    size = np.abs(mean).max(axis=(1, 2))
    infeasible = convex & (most < least - _ROUND_OFF * size)
    most = np.maximum(most, least)
    pairs = np.stack([matrix[:, a, b] for a, b in (*_SIDES, *_DIAGONALS)], axis=1)
    margin = np.clip(ENOUGH * pairs.min(axis=1) / pairs.max(axis=1), 0.0, 1.0)
    share = most + margin * (exact - most)
    share = np.where(at_gate, np.clip(exact, least, most), share)
    found = np.where(convex[:, None, None], mean - share[:, None, None] * product, matrix)
    return Quadrilaterals(found, np.where(infeasible, 1 + across.argmax(axis=1), 0))


def _without_linear_part(flat: np.ndarray) -> np.ndarray:
    """Vectors (Q, 4) whose sum, and whose moment about every line, is zero; about 1."""
    g = np.empty(flat.shape[:2])
    for k in range(4):
        a, b, c = (flat[:, m] for m in range(4) if m != k)
        g[:, k] = (-1.0) ** k * _cross(b - a, c - a)
    return g / np.abs(g).max(axis=1)[:, None]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
