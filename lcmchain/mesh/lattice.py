"""Lattice along the two fibre directions, laid so that it fits the outline."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np

from lcmchain.mesh.cut import COINCIDENT, Cells, cut_lattice
from lcmchain.mesh.outline import polygon_area, whole_number

# Pitch may deviate by this factor from the edge length to fit diagonals to the outline.
DIAGONAL_FIT = 1.25

# Smallest height of a cell, relative to the pitch: enough to stop the search for a better lattice
# position, and the least that is accepted before coverage of the outline counts.
GOOD_HEIGHT = 0.5
ACCEPTABLE_HEIGHT = 0.25


def best_lattice(outline: np.ndarray, edge_length: float) -> Cells:
    """Cells of the best of several positions of the lattice under the outline.

    Only a position that the outline's edges do not prescribe is varied. The first ones are
    symmetric to the middle of the outline and are taken if they are good.
    """
    area = polygon_area(outline)
    pitch = _pitch_fitting_diagonals(outline, edge_length)
    if pitch is not None:
        lines = [_uniform_lines(outline[:, axis], outline[0, axis], pitch) for axis in range(2)]
        return cut_lattice(outline, *lines, pitch)  # type: ignore[arg-type, call-arg]

    anchors = [_aligned_edges(outline, axis, edge_length) for axis in range(2)]
    quick = area / edge_length**2 > 100_000
    steps = (0.0, 0.5) if quick else (0.0, 0.5, 0.2, 0.4, 0.6, 0.8)
    shifts = product(*((0.0,) if len(anchor) else steps for anchor in anchors))
    best: Any = None
    best_rank: Any = None
    for shift in sorted(shifts, key=lambda pair: sum(part not in (0.0, 0.5) for part in pair)):
        lines = []
        for axis in range(2):
            values = outline[:, axis]
            if len(anchors[axis]):
                lines.append(_anchored_lines(values, anchors[axis], edge_length))
            else:
                middle = 0.5 * (values.min() + values.max())
                lines.append(
                    _uniform_lines(values, middle + shift[axis] * edge_length, edge_length)
                )
        cells = cut_lattice(outline, *lines, edge_length)  # type: ignore[arg-type, call-arg]
        missing = abs(cells.area - area) / area
        missing = 0.0 if missing < 1e-9 else missing
        rank = (
            cells.piece_count != 1,
            cells.smallest_height < ACCEPTABLE_HEIGHT,
            missing,
            -cells.smallest_height,
        )
        if best is None or rank < best_rank:
            best, best_rank = cells, rank
        if cells.piece_count == 1 and missing == 0.0 and cells.smallest_height >= GOOD_HEIGHT:
            break
    return best


def _pitch_fitting_diagonals(outline: np.ndarray, edge_length: float) -> float | None:
    """Pitch whose diagonal divides all sides of an outline under 45 degrees; None if none does."""
    along = np.roll(outline, -1, axis=0) - outline
    lengths = np.hypot(*along.T)
    if (np.abs(np.abs(along[:, 0]) - np.abs(along[:, 1])) > COINCIDENT * lengths).any():
        return None
    diagonal = math.sqrt(2.0) * edge_length
    shortest = lengths.min()
    counts = np.arange(
        max(1, math.ceil(shortest / (diagonal * DIAGONAL_FIT))),
        math.floor(shortest / diagonal * DIAGONAL_FIT) + 1,
    )
    if len(counts) == 0:
        return None
    diagonals = shortest / counts
    ratios = lengths / diagonals[:, np.newaxis]
    fits = (np.abs(ratios - np.round(ratios)) < 1e-6).all(axis=1)
    if not fits.any():
        return None
    mismatch = np.where(fits, np.abs(np.log(diagonals / diagonal)), np.inf)
    return float(diagonals[np.argmin(mismatch)] / math.sqrt(2.0))


def _aligned_edges(outline: np.ndarray, axis: int, edge_length: float) -> np.ndarray:
    """Coordinates of the outline's edges across an axis, at least half an edge length apart."""
    end = np.roll(outline, -1, axis=0)
    along = np.abs(end - outline)
    aligned = (along[:, axis] <= COINCIDENT * edge_length) & (along[:, 1 - axis] >= edge_length)
    kept: list[float] = []
    for value in np.sort(outline[aligned, axis]):
        if not kept or value - kept[-1] >= 0.5 * edge_length:
            kept.append(float(value))
    return np.array(kept)


def _uniform_lines(values: np.ndarray, through: float, pitch: float) -> np.ndarray:
    """Lattice lines at multiples of the pitch, reaching beyond all values on both sides."""
    first = math.floor((values.min() - through) / pitch) - 1
    last = math.ceil((values.max() - through) / pitch) + 1
    return through + pitch * np.arange(first, last + 1)


def _anchored_lines(values: np.ndarray, anchors: np.ndarray, edge_length: float) -> np.ndarray:
    """Lattice lines through all anchors, evenly spaced between them, reaching beyond all values."""
    below = math.ceil((anchors[0] - values.min()) / edge_length - COINCIDENT) + 1
    above = math.ceil((values.max() - anchors[-1]) / edge_length - COINCIDENT) + 1
    parts = [anchors[0] - edge_length * np.arange(below, 0, -1)]
    for start, end in zip(anchors[:-1], anchors[1:]):
        count = max(1, whole_number((end - start) / edge_length))
        parts.append(np.linspace(start, end, count, endpoint=False))
    parts.append(anchors[-1] + edge_length * np.arange(above + 1))
    return np.concatenate(parts)
