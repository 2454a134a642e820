"""Meshes of cases with a known solution."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

from lcmchain.coupling.infiltration.flow.preform import FlowMesh


def plate(
    columns: int, rows: int, length: float, width: float, *, triangles: bool = False,
    roll_radius: float | None = None,
) -> FlowMesh:  # fmt: skip
    """Return a plate of a regular grid, flat or with its length rolled around the y axis.

    Rolled up, the lines of the grid lie on a cylinder and the cells keep their size.
    """
    x, y = np.meshgrid(
        np.linspace(0.0, length, columns + 1), np.linspace(0.0, width, rows + 1), indexing="ij"
    )
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    if roll_radius is not None:
        # The chord between two lines is as long as the flat cell.
        turn = 2.0 * np.arcsin(0.5 * length / columns / roll_radius) * columns / length
        angle = turn * points[:, 0]
        points[:, 0] = roll_radius * np.sin(angle)
        points[:, 2] = roll_radius * (1.0 - np.cos(angle))
    node = np.arange(len(points)).reshape(columns + 1, rows + 1)
    corners = (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])
    cells = np.stack([corner.ravel() for corner in corners], axis=1)
    if triangles:
        cells = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    return FlowMesh(points, cells, node_sets=_sides(x.ravel(), y.ravel(), length, width))


def _sides(x: np.ndarray, y: np.ndarray, length: float, width: float) -> dict[str, np.ndarray]:
    near = 1e-9 * length
    return {
        "left": np.flatnonzero(x < near), "right": np.flatnonzero(x > length - near),
        "bottom": np.flatnonzero(y < near), "top": np.flatnonzero(y > width - near),
    }  # fmt: skip


def random_plate(edge: float, length: float, width: float, seed: int = 0) -> FlowMesh:
    """Return a plate of triangles (Delaunay) between scattered nodes, with sets of its sides."""
    random = np.random.default_rng(seed)
    columns, rows = max(int(round(length / edge)), 1), max(int(round(width / edge)), 1)
    regular = plate(columns, rows, length, width)
    x, y = regular.points[:, 0].copy(), regular.points[:, 1].copy()
    inner = np.setdiff1d(np.arange(len(x)), regular.rim)
    shift = random.uniform(-0.35, 0.35, (len(inner), 2))
    x[inner] += shift[:, 0] * length / columns
    y[inner] += shift[:, 1] * width / rows
    cells = Delaunay(np.stack([x, y], axis=1)).simplices
    points = np.stack([x, y, np.zeros(len(x))], axis=1)
    corner = points[cells]
    twice = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2]
    cells = cells[np.abs(twice) > 1e-6 * edge**2]
    return FlowMesh(points, cells, node_sets=_sides(x, y, length, width))


def disc(hole: float, radius: float, edge: float, around_hole: int) -> FlowMesh:
    """Return a disc of triangles with a hole, in rings that grow towards ``edge``.

    Node sets: ``hole`` and ``rim``.
    """
    size = 2.0 * np.pi * hole / around_hole
    radii = [hole]
    while radii[-1] < radius:
        size = min(edge, 1.3 * size)
        radii.append(radii[-1] + 0.87 * size)
    rings = hole + (np.array(radii) - hole) * (radius - hole) / (radii[-1] - hole)
    spacing = np.gradient(rings) / 0.87
    places, ring = [], []
    for k, r in enumerate(rings):
        count = max(around_hole, int(round(2.0 * np.pi * r / spacing[k])))
        count = around_hole if k == 0 else count
        angle = (np.arange(count) + 0.5 * (k % 2)) * 2.0 * np.pi / count
        places.append(np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1))
        ring += [k] * count
    flat, number = np.concatenate(places), np.array(ring)
    cells = Delaunay(flat).simplices
    cells = cells[~(number[cells] == 0).all(axis=1)]
    points = np.hstack([flat, np.zeros((len(flat), 1))])
    sets = {"hole": np.flatnonzero(number == 0), "rim": np.flatnonzero(number == number.max())}
    return FlowMesh(points, cells, node_sets=sets)
