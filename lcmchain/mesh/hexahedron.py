"""Corners of the eight-node solid-shell, and the vectors that its shape is made of."""

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
