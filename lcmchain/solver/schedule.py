"""The order of a step's work: every element, fibre and node as soon as what it needs is there.

Done one after the other, the loops of a step each run through all of the sheet, and what one of
them writes has left the nearer caches before the next one reads it. Here elements are taken in
tiles; behind each of them follow the nodes whose forces are complete and whose positions nobody
needs any more. Each thread does so with a batch of the tiles, in two rounds: in the first one all
batches make their first half, so that in the second one each batch finds the beginning of the next
one done and completes what lies between them. What needs more than that, as with numberings across
the sheet, is done last. Nothing of this changes a sum: every node sums up its own forces, and every
chunk of nodes its own energies, in an order of their own.

The order holds for any numbering of elements and nodes. A numbering along the sheet makes it pay.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lcmchain.effects.fibre_bending import (
    FORCE_ROWS,
    INDEX_ROWS,
    MIDDLE_ROWS,
    VECTOR_ROWS,
    FibreBendingData,
)
from lcmchain.elements.blocks import LANES
from lcmchain.elements.solid_shell.kernel import CORNER_ROWS
from lcmchain.model import PlacedBody

#: Blocks of 16 elements in a tile, at most: few enough for what they write to stay in the nearer
#: caches, and enough for the code of one loop to stay at hand before that of the next one follows.
TILE = 32
#: Blocks of a batch, at least.
LEAST_BATCH = 4


class Schedule(NamedTuple):
    """The order of a step; all arrays are int32.

    Batches of one phase can be done at once, by as many threads; a phase begins when the last one
    is done. A batch has tiles, and a tile has pieces of work of five kinds, done in this order:
    blocks of elements, the three stages of the fibres' bending, and chunks of nodes.

    phase_start : (phase_count + 1,) first batch of each phase. batch_start : (batch_count + 1,)
    first tile of each batch. block, middle, vector, sum, chunk : numbers of the pieces, tile by
    tile; those of the bending are empty without it. block_start and so on : (tile_count + 1,) where
    those of each tile begin. Blocks of elements are numbered within what is put together, all
    others within the model.
    place, bending_place : where the blocks of elements and those of the bending write, in blocks
    from the beginning of what the body has. force_slot : as in
    :class:`lcmchain.model.NodeData`, for these places.
    """

    phase_start: np.ndarray
    batch_start: np.ndarray
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
    bending_place: np.ndarray
    force_slot: np.ndarray


class _Tiles(NamedTuple):
    """Tiles of the rounds, in the order of rounds and batches, and one more for what is done last.

    phase, batch, following : (tile_count + 1,) where each tile is done, and the first tile of the
    same batch in the next round. of_block : (block_count,) tile of each block. batch_start : first
    tile of each batch of each round, and the last tile.
    """

    phase: np.ndarray
    batch: np.ndarray
    following: np.ndarray
    of_block: np.ndarray
    batch_start: list[int]

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
        at_once = (self.phase[tile] == self.phase[there]) & (self.batch[tile] != self.batch[there])
        found[piece[at_once]] = self.following[there[at_once]]
        return found


def build_schedule(
    bodies: Sequence[PlacedBody],
    corner_node: np.ndarray,
    bending_data: FibreBendingData | None,
    force_slot: np.ndarray,
    chunk_start: np.ndarray,
    batch_count: int,
) -> Schedule:
    """Return the order of a step of a body of solid-shells, or of several that are put together.

    Parameters
    ----------
    bodies : whose forces and blocks of the fibres' bending follow each other.
    corner_node : nodes of the corners of all of their blocks.
    bending_data : of the fibres of all bodies, or None.
    force_slot : where each node of the model finds its forces.
    chunk_start : first node of every chunk of the model, and the number of nodes.
    batch_count : at most so many batches; a small sheet has fewer.
    """
    corner_nodes = corner_node.reshape(-1, 8 * LANES)
    node_count = int(chunk_start[-1])
    chunk_numbers = np.concatenate(
        [np.arange(body.first_chunk, body.last_chunk) for body in bodies]
    )
    # of all nodes of the model; those of other bodies are not asked for
    own_chunk = np.zeros(chunk_start.size - 1, dtype=np.int64)
    own_chunk[chunk_numbers] = np.arange(chunk_numbers.size)
    chunk_of = own_chunk[np.repeat(np.arange(own_chunk.size), np.diff(chunk_start))]
    first_bending, last_bending = bodies[0].first_bending, bodies[-1].last_bending
    batches = min(batch_count, -(-len(corner_nodes) // LEAST_BATCH))
    tiles = _tiles(len(corner_nodes), batches)

    # a node is there from the first of its elements on, and free to move after the last one
    block = np.repeat(np.arange(len(corner_nodes)), 8 * LANES)
    node, tile = corner_nodes.ravel(), tiles.of_block[block]
    chunk_needs, bending = [(chunk_of[node], tile)], NO_BENDING
    if bending_data is not None and last_bending > first_bending:
        first = np.full(node_count, tiles.last)
        np.minimum.at(first, node, tile)
        bending = _bending(bending_data, first_bending, last_bending, first, tiles)
        chunk_needs += [
            (chunk_of[bending.node], stage[bending.node_piece])
            for stage in (bending.middle, bending.sum)
        ]
    piece, needed = map(np.concatenate, zip(*chunk_needs, strict=True))
    chunks = tiles.after(piece, needed, chunk_numbers.size)

    used = tiles.after(block, chunks[chunk_of[node]], len(corner_nodes))
    place = _places(tiles, tiles.of_block, used)
    piece = np.concatenate([bending.used_piece, bending.node_piece])
    tile = np.concatenate([bending.used_tile, chunks[chunk_of[bending.node]]])
    bending_place = _places(tiles, bending.middle, tiles.after(piece, tile, bending.middle.size))

    batch_start, phase_start = (
        list(tiles.batch_start),
        list(range(0, len(tiles.batch_start), batches)),
    )
    late = np.flatnonzero(chunks == tiles.last)
    if late.size:
        # the fibres' bending in one batch, then the nodes divided among as many as there are
        chunks[late] += 1 + np.arange(late.size) * batches // late.size
        batch_start += list(tiles.last + 1 + np.arange(batches + 1))
        phase_start += [phase_start[-1] + 1, phase_start[-1] + 1 + batches]
    stages = (tiles.of_block, bending.middle, bending.vector, bending.sum, chunks)
    bent = first_bending + np.arange(last_bending - first_bending)
    numbers = (np.arange(len(corner_nodes)), bent, bent, bent, chunk_numbers)
    arrays: list[Any] = [phase_start, batch_start]
    for of, number in zip(stages, numbers, strict=True):
        order, start = _queue(of, batch_start[-1])
        arrays += [number[order], start]
    force_slot = _moved(force_slot, bodies[0].first_force, CORNER_ROWS, place)
    force_slot = _moved(force_slot, bending.first_force, FORCE_ROWS, bending_place)
    arrays += [place, bending_place, force_slot]
    return Schedule(*(np.asarray(array, dtype=np.int32) for array in arrays))


def _tiles(block_count: int, batches: int) -> _Tiles:
    """Divide the blocks among batches, rounds and tiles."""
    rounds = 2 if batches > 1 else 1
    ends = np.round(np.linspace(0, block_count, batches * rounds + 1)).astype(np.int64)
    counts = -(-np.diff(ends) // TILE).reshape(batches, rounds).T.ravel()
    batch_start = np.concatenate([[0], np.cumsum(counts)])
    turn, own = np.divmod(np.arange(counts.size), batches)
    following = np.concatenate([batch_start[batches:-1], np.full(batches, batch_start[-1])])
    block = np.arange(block_count)
    stretch = np.searchsorted(ends, block, side="right") - 1
    first = batch_start[stretch % rounds * batches + stretch // rounds]
    return _Tiles(
        np.append(np.repeat(turn, counts), rounds),
        np.append(np.repeat(own, counts), 0),
        np.append(np.repeat(following, counts), batch_start[-1]),
        first + (block - ends[stretch]) // TILE,
        batch_start.tolist(),
    )


def _places(tiles: _Tiles, written: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Return where what pieces write may lie: where what nobody needs any more did.

    Each batch has places of its own. What another batch reads last, or what is read last of all,
    keeps its own.

    Parameters
    ----------
    written, used : (piece_count,) tile in which a piece writes, and one that finds done all that
        reads it.
    """
    place, count = np.empty(used.size, dtype=np.int64), 0
    pieces, start = _queue(written, tiles.last + 1)
    for batch in range(int(tiles.batch.max()) + 1):
        free: list[int] = []
        left: dict[int, list[int]] = {}
        for tile in np.flatnonzero(tiles.batch[: tiles.last] == batch).tolist():
            for piece in pieces[start[tile] : start[tile + 1]].tolist():
                if not free:
                    free, count = [count], count + 1
                place[piece] = free.pop()
                left.setdefault(int(used[piece]), []).append(int(place[piece]))
            free += left.pop(tile, [])
    late = pieces[start[tiles.last] :]
    place[late] = count + np.arange(late.size)
    return place


def _moved(slot: np.ndarray, first: int, rows: int, place: np.ndarray) -> np.ndarray:
    """Return slots in blocks of so many rows, from ``first`` on, for other places of the blocks."""
    block, within = np.divmod(slot - first, rows * LANES)
    inside = (block >= 0) & (block < place.size)
    moved = slot.copy()
    moved[inside] = first + place[block[inside]] * rows * LANES + within[inside]
    return moved


class _Bending(NamedTuple):
    """Where the stages of the fibres' bending are done.

    middle, vector, sum : (piece_count,) tile of each piece. node, node_piece : nodes of the model
    and the pieces that read them, and write the force on them. used_piece, used_tile : pieces, and
    tiles in which another one reads what they write. first_force : where their forces begin.
    """

    first_force: int
    middle: np.ndarray
    vector: np.ndarray
    sum: np.ndarray
    node: np.ndarray
    node_piece: np.ndarray
    used_piece: np.ndarray
    used_tile: np.ndarray


NO_BENDING = _Bending(0, *[np.zeros(0, dtype=np.int64)] * 7)


def _bending(
    data: FibreBendingData, first: int, last: int, first_tile: np.ndarray, tiles: _Tiles
) -> _Bending:
    """Return where the stages of the fibres' bending are done, for blocks ``first`` to ``last``.

    Parameters
    ----------
    first_tile : (node_count,) in which each node of the model is read first.
    """
    count = last - first
    own = np.arange(count)
    indices = data.indices.reshape(-1, INDEX_ROWS, LANES)[first : first + count]
    node = indices[:, :2].ravel()
    before_and_after = indices[:, 2:6] - first * MIDDLE_ROWS * LANES
    sources = indices[:, 6:] - first * VECTOR_ROWS * LANES
    node_piece = np.repeat(own, 2 * LANES)
    middle = _latest(node_piece, first_tile[node], count)  # any batch may read the nodes
    reader = np.concatenate([own, np.repeat(own, 4 * LANES)])
    of_middles = np.concatenate([own, before_and_after.ravel() // (MIDDLE_ROWS * LANES)])
    vector = tiles.after(reader, middle[of_middles], count)
    of_vectors = np.concatenate([own, sources.ravel() // (VECTOR_ROWS * LANES)])
    total = tiles.after(reader, vector[of_vectors], count)
    used_piece = np.concatenate([of_middles, of_vectors])
    used_tile = np.concatenate([vector[reader], total[reader]])
    stages = (middle, vector, total)
    first_force = data.first_force + first * FORCE_ROWS * LANES
    return _Bending(first_force, *stages, node, node_piece, used_piece, used_tile)


def _latest(piece: np.ndarray, tile: np.ndarray, count: int) -> np.ndarray:
    """Return the last tile of each of ``count`` pieces."""
    found = np.zeros(count, dtype=np.int64)
    np.maximum.at(found, piece, tile)
    return found


def _queue(tile: np.ndarray, tile_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return pieces in the order of their tiles, and where those of each tile begin."""
    order = np.argsort(tile, kind="stable")
    return order, np.searchsorted(tile[order], np.arange(tile_count + 1))
