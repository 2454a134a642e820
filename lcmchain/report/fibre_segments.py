"""Fibre lines of a formed sheet that a picture shows: few, evenly spaced, symmetric."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from lcmchain.fields.sheet import reference_positions, sheet_faces, vector
from lcmchain.mesh.fibre_lines import lines_along
from lcmchain.mesh.sheet_mesh import NO_NODE

if TYPE_CHECKING:
    import xarray as xr

# Lines of either family in a picture, whatever the mesh.
MOST_LINES = 31
# Lines of the mesh that lie nearer to each other than this part of an edge are one line in two
# pieces; pieces of fewer nodes may lie aside, where a cut edge has moved them.
ONE_LINE, LEAST_NODES = 0.25, 4


def fibre_segments(sheet: xr.Dataset, most: int = MOST_LINES) -> list[np.ndarray]:
    """Return edges (S, 2) of the mesh along evenly spaced fibres, for both families.

    Parameters
    ----------
    most : at most so many lines of a family are kept, symmetric to the middle one.
    """
    reference, faces = reference_positions(sheet), sheet_faces(sheet)
    fibres = tuple(vector(sheet, f"fibre_direction_{number}", 0) for number in (1, 2))
    lines = lines_along(reference, faces, fibres)  # type: ignore[arg-type]
    edge = float(np.median(np.linalg.norm(reference[faces[:, 1]] - reference[faces[:, 0]], axis=1)))
    normal = np.cross(*(fibre.mean(axis=0) for fibre in fibres))
    kept = []
    for fibre, after in zip(fibres, lines.after, strict=True):
        start = np.flatnonzero(after != NO_NODE)
        if not len(start):
            kept.append(np.empty((0, 2), dtype=int))
            continue
        across = reference @ np.cross(normal, fibre.mean(axis=0))
        level, count = _level_of_line(start, after[start], across, edge)
        keep = np.isin(level[start], even_choice(count, most))
        kept.append(np.stack([start, after[start]], axis=1)[keep])
    return kept


def _level_of_line(
    start: np.ndarray, end: np.ndarray, across: np.ndarray, edge: float
) -> tuple[np.ndarray, int]:
    """Return which line from one side of the sheet to the other each node lies on, and how many."""
    count = len(across)
    links = csr_matrix((np.ones(len(start)), (start, end)), shape=(count, count))
    pieces, piece = connected_components(links, directed=False)
    order = np.lexsort((across, piece))
    sizes = np.bincount(piece, minlength=pieces)
    first = np.cumsum(sizes) - sizes
    place = across[order][first + sizes // 2]  # the median, which nodes moved aside leave alone
    whole = np.sort(place[sizes >= min(LEAST_NODES, sizes.max())])
    levels = whole[np.diff(whole, prepend=-np.inf) > ONE_LINE * edge]
    nearest = np.abs(place[:, None] - levels).argmin(axis=1)
    return nearest[piece], len(levels)


def even_choice(count: int, most: int) -> np.ndarray:
    """Return numbers of ``count`` at equal distances and symmetric to the middle."""
    step = max(1, -(-count // most))
    rest = (count - 1) % step
    if rest % 2 and step % 2 == 0:  # no even number can be left out on both sides together
        step += 1
        rest = (count - 1) % step
    if rest % 2:
        rest += step
    return np.arange(rest // 2, count - rest // 2, step)
