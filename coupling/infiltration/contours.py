"""Filled contours of a node field on a curved mesh, as polygons and lines in space."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: A field that varies by less over a triangle, as a share of all, is drawn as constant.
_FLAT = 1e-9


class Contours(NamedTuple):
    """Bands between levels, the lines between them, and what has no value.

    Parameters
    ----------
    polygons : parts of triangles within a band, shape (P, 5, 3), corners may coincide.
    band : of each polygon, from 0, shape (P,). triangle : that it is a part of, shape (P,).
    lines : along the levels, shape (L, 2, 3).
    empty : triangles without a value at a corner, shape (E, 3, 3). empty_triangle : their rows.
    """

    polygons: np.ndarray
    band: np.ndarray
    triangle: np.ndarray
    lines: np.ndarray
    empty: np.ndarray
    empty_triangle: np.ndarray


def contours(corners: np.ndarray, values: np.ndarray, levels: np.ndarray) -> Contours:
    """Cut triangles along the levels of a field that is linear on each.

    Parameters
    ----------
    corners : of triangles, shape (T, 3, 3). values : there, shape (T, 3), nan where unknown.
    levels : ascending, shape (B + 1,); the first and the last take what lies beyond them.
    """
    known = np.isfinite(values).all(axis=1)
    empty = np.flatnonzero(~known)
    rows = np.flatnonzero(known)
    order = np.argsort(values[rows], axis=1, kind="stable")
    v = np.take_along_axis(values[rows], order, axis=1)
    p = np.take_along_axis(corners[rows], order[:, :, None], axis=1)
    # what a constant field varies by is round-off, which must not become a slope
    span = max(float(np.ptp(v)), 1e-3 * float(np.abs(v).max()), 1e-300) if len(v) else 1.0
    v = v + _FLAT * span * np.arange(3)  # ascending even where the field is constant

    polygons, band, triangle, lines = [], [], [], []
    for number in range(len(levels) - 1):
        low = -np.inf if number == 0 else levels[number]
        high = np.inf if number == len(levels) - 2 else levels[number + 1]
        here = np.flatnonzero((v[:, 0] < high) & (v[:, 2] >= low))
        q, w = p[here], v[here]
        a = np.clip(low, w[:, 0], w[:, 2])
        b = np.clip(high, w[:, 0], w[:, 2])
        middle = np.clip(w[:, 1], a, b)
        parts = [_long(q, w, a), _long(q, w, b), _short(q, w, b), _short(q, w, middle),
                 _short(q, w, a)]  # fmt: skip
        polygons.append(np.stack(parts, axis=1))
        band.append(np.full(len(here), number))
        triangle.append(rows[here])
        if number > 0:
            cut = (w[:, 0] < low) & (w[:, 2] > low)
            lines.append(np.stack([parts[0][cut], parts[4][cut]], axis=1))
    return Contours(
        np.concatenate(polygons), np.concatenate(band), np.concatenate(triangle),
        np.concatenate(lines) if lines else np.empty((0, 2, 3)), corners[empty], empty,
    )  # fmt: skip


def triangles_around_centres(
    points: np.ndarray, cells: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Divide cells into triangles around the mean of their corners.

    Parameters
    ----------
    points : (N, 3). cells : (C, 4), -1 behind a triangle, which stays whole. values : (N,).

    Returns
    -------
    Corners (T, 3, 3), values there (T, 3), and the cell of each triangle (T,).
    """
    quad = np.flatnonzero(cells[:, 3] >= 0)
    three = np.flatnonzero(cells[:, 3] < 0)
    corners, at = [points[cells[three, :3]]], [values[cells[three, :3]]]
    owner = [three]
    centre, mean = points[cells[quad]].mean(axis=1), values[cells[quad]].mean(axis=1)
    for k in range(4):
        i, j = cells[quad, k], cells[quad, (k + 1) % 4]
        corners.append(np.stack([points[i], points[j], centre], axis=1))
        at.append(np.stack([values[i], values[j], mean], axis=1))
        owner.append(quad)
    return np.concatenate(corners), np.concatenate(at), np.concatenate(owner)


def _long(p: np.ndarray, v: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Where the longest way through the values, from the lowest to the highest, has a level."""
    share = (level - v[:, 0]) / (v[:, 2] - v[:, 0])
    return p[:, 0] + share[:, None] * (p[:, 2] - p[:, 0])


def _short(p: np.ndarray, v: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Where the way over the middle corner has a level."""
    first = np.clip((level - v[:, 0]) / (v[:, 1] - v[:, 0]), 0.0, 1.0)
    second = np.clip((level - v[:, 1]) / (v[:, 2] - v[:, 1]), 0.0, 1.0)
    before = (level <= v[:, 1])[:, None]
    return np.where(
        before,
        p[:, 0] + first[:, None] * (p[:, 1] - p[:, 0]),
        p[:, 1] + second[:, None] * (p[:, 2] - p[:, 1]),
    )
