"""Which wall of the sheet a cell belongs to, where two are closer than the cell is large."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import strict_equation
from lcmchain.mapping.solids.columns import Columns
from lcmchain.mapping.solids.overlap import Overlaps

#: A cell that holds at least this part of another wall, as against its own, belongs to neither.
UNDECIDED = 0.5

#: Two pieces of a sheet are walls when they lie over each other rather than beside each other.
OVER = 0.7


class Walls(NamedTuple):
    """Overlaps of cells with their own walls.

    kept : overlaps that belong to the wall of their cell, shape (K,).
    undecided : cells that two walls share, shape (C,).
    """

    kept: np.ndarray
    undecided: np.ndarray


def own_walls(found: Overlaps, columns: Columns, body: np.ndarray, cell_count: int) -> Walls:
    """Keep of each cell's overlaps those with the wall that it holds most of, ply by ply.

    Faces over a cell that are connected through common nodes are one wall; pieces that are not
    connected, such as both sides of a cut, are different walls if they lie over each other.

    Parameters
    ----------
    body : ply of each face, shape (F,).
    """
    start = np.searchsorted(found.cell, np.arange(cell_count + 1))
    piece = _pieces(start, found.face, columns.faces, len(columns.points))
    kept = np.ones(len(piece), dtype=bool)
    undecided = np.zeros(cell_count, dtype=bool)
    height = np.einsum(
        "ki,ki->k",
        found.centroid - columns.centroids[found.face],
        columns.face_normals[found.face],
    )
    foot = found.centroid - height[:, None] * columns.face_normals[found.face]
    ply = body[found.face]
    first = piece == np.arange(len(piece))
    pairs, count = np.unique(np.stack([found.cell, ply], axis=1)[first], axis=0, return_counts=True)
    for cell, own_ply in pairs[count > 1]:
        entries = np.arange(start[cell], start[cell + 1])
        own = entries[ply[entries] == own_ply]
        dropped, open_question = _other_walls(own, piece, found, foot, columns.face_normals)
        kept[dropped] = False
        undecided[cell] |= open_question
    return Walls(kept, undecided)


def _other_walls(
    entries: np.ndarray, piece: np.ndarray, found: Overlaps, foot: np.ndarray, normals: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Entries of a cell that belong to another wall than its largest, and whether that is open."""
    pieces, which = np.unique(piece[entries], return_inverse=True)
    volume = np.bincount(which, weights=found.volume[entries])
    largest = int(np.argmax(volume))

    def mean(values: np.ndarray, number: int) -> np.ndarray:
        own = entries[which == number]
        return np.average(values[own], axis=0, weights=found.volume[own])

    place = mean(foot, largest)
    normal = mean(normals[found.face], largest)
    dropped = np.zeros(len(entries), dtype=bool)
    undecided = False
    for number in range(len(pieces)):
        apart = mean(foot, number) - place
        if number == largest or abs(apart @ normal) < OVER * np.linalg.norm(apart):
            continue
        dropped |= which == number
        undecided |= bool(volume[number] > UNDECIDED * volume[largest])
    return entries[dropped], undecided


@strict_equation
def _pieces(start, face, faces, node_count):
    """First entry of the connected piece that each entry belongs to, shape (K,)."""
    parent = np.arange(len(face))
    seen_in = np.full(node_count, -1, np.int64)
    seen_by = np.zeros(node_count, np.int64)
    for c in range(len(start) - 1):
        for k in range(start[c], start[c + 1]):
            for corner in range(4):
                node = faces[face[k], corner]
                if seen_in[node] != c:
                    seen_in[node] = c
                    seen_by[node] = k
                    continue
                a, b = k, seen_by[node]
                while parent[a] != a:
                    a = parent[a]
                while parent[b] != b:
                    b = parent[b]
                parent[max(a, b)] = min(a, b)
    for k in range(len(face)):
        a = k
        while parent[a] != a:
            a = parent[a]
        parent[k] = a
    return parent
