"""The order of a step's work: every element, fibre and node as soon as what it needs is there.

Done one after the other, the loops of a step each run through all of the sheet, and what one of
them writes has left the nearer caches before the next one reads it. Here elements are taken in
tiles; behind each of them follow the nodes whose forces are complete and whose positions nobody
needs any more. Each thread does so with a part of the tiles. What lies between two parts is done
after all of them. Nothing of this changes a sum: every node sums up its own forces, and every
chunk of nodes its own energies, in an order of their own.

The order holds for any numbering of elements and nodes. A numbering along the sheet makes it pay.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from lcmchain.effects.fibre_bending import INDEX_ROWS, MIDDLE_ROWS, VECTOR_ROWS, FibreBendingData
from lcmchain.elements.blocks import LANES
from lcmchain.model import NODE_CHUNK, Model

#: Blocks of 16 elements in a tile, at most: few enough for what they write to stay in the nearer
#: caches, and enough for the code of one loop to stay at hand before that of the next one follows.
TILE = 16
#: Blocks of a part, at least.
LEAST_PART = 4

#: Up to so many parts one thread does alone what lies between them: sooner than they would begin.
FEW_PARTS = 2


class Queue(NamedTuple):
    """Pieces of work by the tile that they follow.

    piece : their numbers, tile by tile. start : (tile_count + 1,) where those of each tile begin.
    """

    piece: np.ndarray
    start: np.ndarray


class Schedule(NamedTuple):
    """The order of a step; all arrays are int32.

    Parts of one phase can be done at once, by as many threads; a phase begins when the last one is
    done. In the first one every part has its tiles of elements. In the next one a single part does
    what lies between them. With many parts the nodes there are divided among as many again.

    phase_start : (phase_count + 1,) first part of each phase. part_start : (parts + 1,) first tile
    of each part. block_start : (tile_count + 1,) first block of elements of each tile; tiles of
    later phases have none. The others are queues (:class:`Queue`) of blocks of the fibres' bending
    in its three stages, empty without it, and of chunks of nodes.
    """

    phase_start: np.ndarray
    part_start: np.ndarray
    block_start: np.ndarray
    middle: np.ndarray
    middle_start: np.ndarray
    vector: np.ndarray
    vector_start: np.ndarray
    sum: np.ndarray
    sum_start: np.ndarray
    chunk: np.ndarray
    chunk_start: np.ndarray


class _Needs(NamedTuple):
    """From which tile on pieces of work can be done, and in which parts what they need is done.

    tile : the last one needed. first_part, last_part : the same where all is done in one part.
    """

    tile: np.ndarray
    first_part: np.ndarray
    last_part: np.ndarray

    def of(self, piece: np.ndarray, needed: np.ndarray, count: int) -> _Needs:
        """Return what ``count`` pieces need that need some of these: pairs of piece and needed."""
        tile = np.zeros(count, dtype=np.int64)
        first = np.full(count, np.iinfo(np.int64).max)
        last = np.full(count, -1)
        np.maximum.at(tile, piece, self.tile[needed])
        np.minimum.at(first, piece, self.first_part[needed])
        np.maximum.at(last, piece, self.last_part[needed])
        return _Needs(tile, np.minimum(first, last), last)

    def queue(self, tile_count: int, late: np.ndarray) -> Queue:
        """Return the pieces in order; those that need several parts follow the ``late`` tiles."""
        several = np.flatnonzero(self.first_part != self.last_part)
        tile = self.tile.copy()
        tile[several] = late[np.arange(several.size) * late.size // max(several.size, 1)]
        order = np.argsort(tile, kind="stable")
        start = np.searchsorted(tile[order], np.arange(tile_count + 1))
        return Queue(order.astype(np.int32), start.astype(np.int32))


def build_schedule(model: Model, part_count: int) -> Schedule:
    """Return the order of a step of a model of one sheet.

    Parameters
    ----------
    part_count : at most so many parts; a small sheet has fewer.
    """
    corner_nodes = model.body.data.corner_node.reshape(-1, 8 * LANES)
    block_count = len(corner_nodes)
    parts = min(part_count, -(-block_count // LEAST_PART))
    part_block = np.round(np.linspace(0, block_count, parts + 1)).astype(np.int64)
    tile_block = np.concatenate([np.arange(*ends, TILE) for ends in pairwise(part_block)])
    tile_count = tile_block.size
    part_start = np.searchsorted(tile_block, part_block)
    block = np.arange(block_count)
    block_part = np.searchsorted(part_block, block, side="right") - 1
    blocks = _Needs(np.searchsorted(tile_block, block, side="right") - 1, block_part, block_part)

    # a node is there from the first of its elements on, and free to move after the last one
    node = corner_nodes.ravel()
    block = np.repeat(block, 8 * LANES)
    needs = [(node // NODE_CHUNK, block, blocks)]
    middles = vectors = sums = _empty()
    if model.fibre_bending is not None and model.fibre_bending.data is not None:
        first = np.full(model.node_count, block_count - 1)
        np.minimum.at(first, node, block)
        middles, vectors, sums, more = _bending(model.fibre_bending.data, first, blocks)
        needs += more
    chunk_count = -(-model.node_count // NODE_CHUNK)
    chunks = _together([given.of(piece, needed, chunk_count) for piece, needed, given in needs])
    between = np.array([tile_count])
    divided = tile_count + 1 + np.arange(parts if parts > FEW_PARTS else 0)
    all_tiles = tile_count + 1 + divided.size
    queues = [needs.queue(all_tiles, between) for needs in (middles, vectors, sums)]
    queues.append(chunks.queue(all_tiles, divided if divided.size else between))
    phases = [0, parts, parts + 1, *([2 * parts + 1] if divided.size else [])]
    block_start = np.append(tile_block, np.full(all_tiles + 1 - tile_count, block_count))
    arrays = [
        np.array(phases),
        np.concatenate([part_start, tile_count + 1 + np.arange(1 + divided.size)]),
        block_start,
        *(array for queue in queues for array in queue),
    ]
    return Schedule(*(array.astype(np.int32) for array in arrays))


def _bending(
    data: FibreBendingData, first_block: np.ndarray, blocks: _Needs
) -> tuple[_Needs, _Needs, _Needs, list[tuple[Any, Any, _Needs]]]:
    """Return what the three stages of the fibres' bending need, and what chunks of nodes need."""
    count = data.start.size
    own = np.arange(count)
    indices = data.indices.reshape(count, INDEX_ROWS, LANES)
    nodes, before_and_after, sources = indices[:, :2], indices[:, 2:6], indices[:, 6:]
    node_piece = np.repeat(own, 2 * LANES)
    middles = blocks.of(node_piece, first_block[nodes.ravel()], count)
    middles = middles._replace(first_part=middles.last_part)  # any part may read the nodes
    neighbour_piece = np.concatenate([own, np.repeat(own, 4 * LANES)])
    neighbour = before_and_after.ravel() // (MIDDLE_ROWS * LANES)
    vectors = middles.of(neighbour_piece, np.concatenate([own, neighbour]), count)
    neighbour = sources.ravel() // (VECTOR_ROWS * LANES)
    sums = vectors.of(neighbour_piece, np.concatenate([own, neighbour]), count)
    chunk = nodes.ravel() // NODE_CHUNK
    return middles, vectors, sums, [(chunk, node_piece, middles), (chunk, node_piece, sums)]


def _together(needs: list[_Needs]) -> _Needs:
    """Return what pieces need that need all of it."""
    return _Needs(
        np.max([one.tile for one in needs], axis=0),
        np.min([one.first_part for one in needs], axis=0),
        np.max([one.last_part for one in needs], axis=0),
    )


def _empty() -> _Needs:
    nothing = np.zeros(0, dtype=np.int64)
    return _Needs(nothing, nothing, nothing)
