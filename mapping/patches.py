"""Cells of a sheet in compact, connected patches, for an interface coarser than the mesh.

Recursive bisection finds parts of equal area, and Lloyd's iteration (Du, Faber, Gunzburger 1999)
rounds them: every cell goes to the nearest middle, and the middles follow. A few cells that lie
nearest to a middle through the air, on the other side of a fold, go to the patch that reaches them
along the sheet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from lcmchain.errors import InputError

#: Rounds of Lloyd's iteration; the shapes hardly change after the first few.
ROUNDS = 12
#: Where more of the area lies nearest to a middle that it has no way to, places in space do not
#: tell what lies together: then distances along the sheet to so many cells do.
FOLDED = 0.05
LANDMARKS = 6


@dataclass(frozen=True)
class Patches:
    """Which patch each cell belongs to.

    Parameters
    ----------
    of_cell : number of the patch of each cell, from 0 without gaps, shape (C,).
    count : number of patches.
    """

    of_cell: np.ndarray
    count: int

    def __post_init__(self) -> None:
        of_cell = np.ascontiguousarray(self.of_cell, dtype=np.int64)
        object.__setattr__(self, "of_cell", of_cell)
        if not np.array_equal(np.unique(of_cell), np.arange(self.count)):
            raise InputError(f"the patches must be 0 to {self.count - 1}, none of them empty")

    @classmethod
    def of_single_cells(cls, cell_count: int) -> Patches:
        """Return a patch for every cell."""
        return cls(np.arange(cell_count), cell_count)


def group_cells(
    points: np.ndarray,
    cells: np.ndarray,
    count: int,
    *,
    areas: np.ndarray,
    part: np.ndarray | None = None,
) -> Patches:
    """Group the cells of a sheet into patches of about the same area.

    Every patch is connected through edges of cells, has no cell of another part, and lies in one
    loose piece of the sheet; every piece has at least one. The result depends on nothing but the
    arguments. Patches are numbered by their first cell.

    Parameters
    ----------
    points : node positions [m], shape (N, 3).
    cells : node rows of triangles and quadrilaterals, shape (C, 3) or (C, 4), -1 is no node.
    count : patches wanted; with more than there are cells, every cell is one.
    areas : of the cells [m2], shape (C,).
    part : labels that patches must not mix, such as plies, shape (C,).

    Raises
    ------
    InputError : a count below 1, or below the number of loose pieces.
    """
    if count < 1:
        raise InputError(f"an interface needs at least one patch, not {count}")
    if count >= len(cells):
        return Patches.of_single_cells(len(cells))
    one, other = shared_edges(cells, part)
    half = coo_matrix((np.ones(len(one)), (one, other)), shape=(len(cells),) * 2)
    neighbours = (half + half.T).tocsr()
    piece_count, piece = connected_components(neighbours, directed=False)
    if count < piece_count:
        raise InputError(
            f"the sheet has {piece_count} loose pieces, each of which needs a patch of its own; "
            f"ask for at least {piece_count} patches, not {count}"
        )
    centres = centres_of(points, cells)
    of_cell = np.empty(len(cells), dtype=np.int64)
    first = 0
    shares = _shares(np.bincount(piece, areas), np.bincount(piece), count)
    for number, share in enumerate(shares):
        rows = np.flatnonzero(piece == number)
        graph = neighbours[rows][:, rows]
        of_cell[rows] = first + _group_piece(centres[rows], areas[rows], graph, int(share))
        first += int(share)
    _, at, inverse = np.unique(of_cell, return_index=True, return_inverse=True)
    rank = np.empty(count, dtype=np.int64)
    rank[np.argsort(at)] = np.arange(count)
    return Patches(rank[inverse], count)


def shared_edges(cells: np.ndarray, part: np.ndarray | None = None) -> np.ndarray:
    """Return the pairs of cells that share an edge, shape (2, n); many at one edge are chained.

    Parameters
    ----------
    cells : node rows, shape (C, 3) or (C, 4), -1 is no node.
    part : labels; cells of different ones make no pair, shape (C,).
    """
    corners = np.where(cells >= 0, cells, cells[:, :1])  # a missing corner makes no new edge
    begin, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    cell = np.repeat(np.arange(len(cells)), cells.shape[1])
    is_edge = begin != end
    low, high = np.minimum(begin, end)[is_edge], np.maximum(begin, end)[is_edge]
    label = np.zeros(len(cells), dtype=np.int64)
    if part is not None:
        label = np.unique(part, return_inverse=True)[1].reshape(-1)
    cell = cell[is_edge]
    order = np.lexsort((cell, label[cell], high, low))
    low, high, cell = low[order], high[order], cell[order]
    same = (low[1:] == low[:-1]) & (high[1:] == high[:-1]) & (label[cell[1:]] == label[cell[:-1]])
    return np.stack([cell[:-1][same], cell[1:][same]])


def centres_of(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the mean of the corners of each cell, shape (C, 3)."""
    there = cells >= 0
    sums = np.where(there[:, :, None], points[cells], 0.0).sum(axis=1)
    return sums / there.sum(axis=1)[:, None]


def _shares(areas: np.ndarray, cell_counts: np.ndarray, count: int) -> np.ndarray:
    """Return how many patches each piece gets: at least one, at most its cells, else by area."""
    shares = np.ones(len(areas), dtype=np.int64)
    for _ in range(count - len(areas)):  # the next one where patches are largest
        shares[np.argmax(np.where(shares < cell_counts, areas / shares, -1.0))] += 1
    return shares


def _group_piece(
    centres: np.ndarray, areas: np.ndarray, graph: csr_matrix, count: int
) -> np.ndarray:
    """Return the patch of each cell of one connected piece."""
    of_cell, moved = _rounded(centres, areas, graph, count)
    if moved > FOLDED * areas.sum():
        of_cell, _ = _rounded(_distances(centres, graph), areas, graph, count)
    return of_cell


def _rounded(
    places: np.ndarray, areas: np.ndarray, graph: csr_matrix, count: int
) -> tuple[np.ndarray, float]:
    """Return the patches that suit the places of the cells, and what :func:`_nearest` had to move.

    That is the largest of all rounds.
    """
    most = 0.0
    of_cell = _bisected(places, areas, count)
    for _ in range(ROUNDS):
        before = of_cell
        of_cell, moved = _nearest(places, areas, graph, before, count)
        most = max(most, moved)
        if np.array_equal(of_cell, before):
            break
    return of_cell, most


def _distances(centres: np.ndarray, graph: csr_matrix) -> np.ndarray:
    """Return distances along the sheet to a few far cells, as places of the cells, (C, n)."""
    ways = _ways(centres, graph)
    far = dijkstra(ways, indices=0).argmax()
    found = []
    for _ in range(LANDMARKS):
        found.append(dijkstra(ways, indices=far))
        far = np.min(found, axis=0).argmax()
    return np.stack(found, axis=1)


def _ways(centres: np.ndarray, graph: csr_matrix) -> csr_matrix:
    """Return the lengths from cell to neighbouring cell [m], never zero."""
    one, other = graph.nonzero()
    lengths = np.linalg.norm(centres[one] - centres[other], axis=1)
    return csr_matrix((np.maximum(lengths, np.finfo(float).tiny), (one, other)), shape=graph.shape)


def _bisected(centres: np.ndarray, areas: np.ndarray, count: int) -> np.ndarray:
    """Halve the cells along the longest side of their box until there are ``count`` groups."""
    of_cell = np.empty(len(centres), dtype=np.int64)
    waiting, done = [(np.arange(len(centres)), count)], 0
    while waiting:
        rows, parts = waiting.pop()
        if parts == 1:
            of_cell[rows] = done
            done += 1
            continue
        axis = np.argmax(np.ptp(centres[rows], axis=0))
        rows = rows[np.argsort(centres[rows, axis], kind="stable")]
        half = parts // 2
        sums = np.cumsum(areas[rows])
        cut = int(np.searchsorted(sums, sums[-1] * half / parts))
        cut = min(max(cut, half), len(rows) - (parts - half))  # enough cells for either side
        waiting += [(rows[:cut], half), (rows[cut:], parts - half)]
    return of_cell


def _nearest(
    centres: np.ndarray, areas: np.ndarray, graph: csr_matrix, before: np.ndarray, count: int
) -> tuple[np.ndarray, float]:
    """Return the patch with the nearest middle, as far as the sheet connects the cell with it.

    And the area of the cells that it does not connect, which go to another patch.
    """
    area = np.bincount(before, areas, count)
    sums = [np.bincount(before, areas * axis, count) for axis in centres.T]
    middles = np.stack(sums, axis=1) / area[:, None]
    # the cell next to the middle stays, so that no patch ends up empty
    distance = ((centres - middles[before]) ** 2).sum(axis=1)
    order = np.lexsort((distance, before))
    seeds = order[np.searchsorted(before[order], np.arange(count))]
    of_cell = cKDTree(middles).query(centres)[1].astype(np.int64)
    of_cell[seeds] = np.arange(count)
    # keep of each patch the piece with its seed
    one, other = graph.nonzero()
    inside = of_cell[one] == of_cell[other]
    pairs = (np.ones(np.count_nonzero(inside)), (one[inside], other[inside]))
    piece = connected_components(coo_matrix(pairs, shape=graph.shape), directed=False)[1]
    kept = piece == piece[seeds][of_cell]
    if kept.all():
        return of_cell, 0.0
    _, _, source = dijkstra(
        _ways(centres, graph),
        indices=np.flatnonzero(kept),
        min_only=True,
        return_predecessors=True,
    )
    return of_cell[source], areas[~kept].sum()  # a cell that is kept is its own source
