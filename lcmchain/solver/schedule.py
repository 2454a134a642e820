"""The order of a step's work: every element, fibre and node as soon as what it needs is there.

Done one after the other, the loops of a step each run through all of the sheet, and what one of
them writes has left the nearer caches before the next one reads it. Here elements are taken in
tiles; behind each of them follow the nodes whose forces are complete and whose positions nobody
needs any more. Each thread does so with a part of the tiles, in two rounds: in the first one all
parts make their first half, so that in the second one each part finds the beginning of the next
one done and completes what lies between them. What needs more than that, as with numberings across
the sheet, is done last. Nothing of this changes a sum: every node sums up its own forces, and every
chunk of nodes its own energies, in an order of their own.

The order holds for any numbering of elements and nodes. A numbering along the sheet makes it pay.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.effects.fibre_bending import INDEX_ROWS, MIDDLE_ROWS, VECTOR_ROWS, FibreBendingData
from lcmchain.elements.blocks import LANES
from lcmchain.elements.solid_shell.kernel import CORNER_ROWS
from lcmchain.model import NODE_CHUNK, Model

#: Blocks of 16 elements in a tile, at most: few enough for what they write to stay in the nearer
#: caches, and enough for the code of one loop to stay at hand before that of the next one follows.
TILE = 32
#: Blocks of a part, at least.
LEAST_PART = 4


class Schedule(NamedTuple):
    """The order of a step; all arrays are int32.

    Parts of one phase can be done at once, by as many threads; a phase begins when the last one is
    done. A part has tiles, and a tile has pieces of work of five kinds, done in this order: blocks
    of elements, the three stages of the fibres' bending, and chunks of nodes.

    phase_start : (phase_count + 1,) first part of each phase. part_start : (parts + 1,) first tile
    of each part. block, middle, vector, sum, chunk : numbers of the pieces, tile by tile; those of
    the bending are empty without it. block_start and so on : (tile_count + 1,) where those of each
    tile begin.
    """

    phase_start: np.ndarray
    part_start: np.ndarray
    block: np.ndarray
    block_start: np.ndarray
    middle: np.ndarray
    middle_start: np.ndarray
    vector: np.ndarray
    vector_start: np.ndarray
    sum: np.ndarray
    sum_start: np.ndarray
    chunk: np.ndarray
    chunk_start: np.ndarray
    place: np.ndarray
    force_slot: np.ndarray


class _Tiles(NamedTuple):
    """Tiles of the rounds, in the order of rounds and parts, and one more for what is done last.

    phase, part, following : (tile_count + 1,) where each tile is done, and the first tile of the
    same part in the next round. of_block : (block_count,) tile of each block. part_start : first
    tile of each part of each round, and the last tile.
    """

    phase: np.ndarray
    part: np.ndarray
    following: np.ndarray
    of_block: np.ndarray
    part_start: list[int]

    @property
    def last(self) -> int:
        return self.phase.size - 1

    def after(self, piece: np.ndarray, tile: np.ndarray, count: int) -> np.ndarray:
        """Return in which tile each of ``count`` pieces finds done what it needs.

        Parameters
        ----------
        piece, tile : pairs of a piece and a tile that does something it needs.
        """
        found = _latest(piece, tile, count)
        there = found[piece]
        at_once = (self.phase[tile] == self.phase[there]) & (self.part[tile] != self.part[there])
        found[piece[at_once]] = self.following[there[at_once]]
        return found


def build_schedule(model: Model, part_count: int) -> Schedule:
    """Return the order of a step of a model of one sheet.

    Parameters
    ----------
    part_count : at most so many parts; a small sheet has fewer.
    """
    corner_nodes = model.body.data.corner_node.reshape(-1, 8 * LANES)
    parts = min(part_count, -(-len(corner_nodes) // LEAST_PART))
    tiles = _tiles(len(corner_nodes), parts)

    # a node is there from the first of its elements on, and free to move after the last one
    node, tile = corner_nodes.ravel(), np.repeat(tiles.of_block, 8 * LANES)
    needs = [(node // NODE_CHUNK, tile)]
    middles = vectors = sums = np.zeros(0, dtype=np.int64)
    if model.fibre_bending is not None and model.fibre_bending.data is not None:
        first = np.full(model.node_count, tiles.last)
        np.minimum.at(first, node, tile)
        middles, vectors, sums, more = _bending(model.fibre_bending.data, first, tiles)
        needs += more
    chunk_count = -(-model.node_count // NODE_CHUNK)
    piece, needed = map(np.concatenate, zip(*needs, strict=True))
    chunks = tiles.after(piece, needed, chunk_count)

    last_use = np.maximum.reduceat(chunks[node // NODE_CHUNK], np.arange(0, node.size, 8 * LANES))
    place = _places(tiles, last_use)

    part_start, phase_start = list(tiles.part_start), list(range(0, len(tiles.part_start), parts))
    late = np.flatnonzero(chunks == tiles.last)
    if late.size:
        # the fibres' bending in one part, then the nodes divided among as many as there are
        chunks[late] += 1 + np.arange(late.size) * parts // late.size
        part_start += list(tiles.last + 1 + np.arange(parts + 1))
        phase_start += [phase_start[-1] + 1, phase_start[-1] + 1 + parts]
    queues = [_queue(of, part_start[-1]) for of in (tiles.of_block, middles, vectors, sums, chunks)]
    arrays = [phase_start, part_start, *(array for queue in queues for array in queue)]
    arrays += [place, _moved(model.nodes.force_slot, place)]
    return Schedule(*(np.asarray(array, dtype=np.int32) for array in arrays))


def _tiles(block_count: int, parts: int) -> _Tiles:
    """Divide the blocks among parts, rounds and tiles."""
    rounds = 2 if parts > 1 else 1
    ends = np.round(np.linspace(0, block_count, parts * rounds + 1)).astype(np.int64)
    counts = -(-np.diff(ends) // TILE).reshape(parts, rounds).T.ravel()
    part_start = np.concatenate([[0], np.cumsum(counts)])
    turn, own = np.divmod(np.arange(counts.size), parts)
    following = np.concatenate([part_start[parts:-1], np.full(parts, part_start[-1])])
    block = np.arange(block_count)
    stretch = np.searchsorted(ends, block, side="right") - 1
    first = part_start[stretch % rounds * parts + stretch // rounds]
    return _Tiles(
        np.append(np.repeat(turn, counts), rounds),
        np.append(np.repeat(own, counts), 0),
        np.append(np.repeat(following, counts), part_start[-1]),
        first + (block - ends[stretch]) // TILE,
        part_start.tolist(),
    )


def _places(tiles: _Tiles, last_use: np.ndarray) -> np.ndarray:
    """Return where the forces of each block lie: where others were that nobody needs any more.

    Each part has places of its own. Forces that another part sums up, or that are summed up last,
    keep theirs.

    Parameters
    ----------
    last_use : (block_count,) tile in which the last forces of each block are summed up.
    """
    place, count = np.empty(last_use.size, dtype=np.int64), 0
    blocks, block_start = _queue(tiles.of_block, tiles.last)
    for part in range(int(tiles.part.max()) + 1):
        free: list[int] = []
        left: dict[int, list[int]] = {}
        for tile in np.flatnonzero(tiles.part[: tiles.last] == part).tolist():
            for block in blocks[block_start[tile] : block_start[tile + 1]].tolist():
                if not free:
                    free, count = [count], count + 1
                place[block] = free.pop()
                left.setdefault(int(last_use[block]), []).append(int(place[block]))
            free += left.pop(tile, [])
    return place


def _moved(force_slot: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return slots for other places of the blocks; those behind the blocks stay."""
    size = CORNER_ROWS * LANES
    block, within = np.divmod(force_slot, size)
    return np.where(
        block < place.size, place[np.minimum(block, place.size - 1)] * size + within, force_slot
    )


def _bending(
    data: FibreBendingData, first_tile: np.ndarray, tiles: _Tiles
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
    """Return the tiles of the three stages of the fibres' bending, and what chunks of nodes need.

    Parameters
    ----------
    first_tile : (node_count,) in which each node is read first.
    """
    count = data.start.size
    own = np.arange(count)
    indices = data.indices.reshape(count, INDEX_ROWS, LANES)
    nodes, before_and_after, sources = indices[:, :2], indices[:, 2:6], indices[:, 6:]
    node_piece = np.repeat(own, 2 * LANES)
    middles = _latest(node_piece, first_tile[nodes.ravel()], count)  # any part may read the nodes
    neighbour_piece = np.concatenate([own, np.repeat(own, 4 * LANES)])
    neighbour = before_and_after.ravel() // (MIDDLE_ROWS * LANES)
    vectors = tiles.after(neighbour_piece, middles[np.concatenate([own, neighbour])], count)
    neighbour = sources.ravel() // (VECTOR_ROWS * LANES)
    sums = tiles.after(neighbour_piece, vectors[np.concatenate([own, neighbour])], count)
    chunk = nodes.ravel() // NODE_CHUNK
    return middles, vectors, sums, [(chunk, middles[node_piece]), (chunk, sums[node_piece])]


def _latest(piece: np.ndarray, tile: np.ndarray, count: int) -> np.ndarray:
    """Return the last tile of each of ``count`` pieces."""
    found = np.zeros(count, dtype=np.int64)
    np.maximum.at(found, piece, tile)
    return found


def _queue(tile: np.ndarray, tile_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return pieces in the order of their tiles, and where those of each tile begin."""
    order = np.argsort(tile, kind="stable")
    return order, np.searchsorted(tile[order], np.arange(tile_count + 1))
