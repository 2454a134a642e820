"""Internal forces at the nodes: the sums of what elements and fibres have written for them.

Every node has slots, places where the x-components of forces on it lie; y and z follow one and two
rows of a block behind. Elements and nodes are mostly numbered along the rows of a mesh: what eight
neighbours find in their first slots lies in one run of memory, or in two, where a row or a block
ends. A pack of nodes reads run by run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.elements.blocks import LANES, PACKS_OF_CHUNK
from lcmchain.jit import standalone_routine
from lcmchain.packs import PACK, load_lanes, pack_of, store_vector


class SlotRuns(NamedTuple):
    """Where packs of nodes read the forces in their slots; all arrays are int32.

    start : (pack_count + 1,) where the runs of each pack begin; every chunk of nodes has as many
    packs, of which the last ones may have fewer nodes or none. place : (run_count,) of the number
    for the first lane, as if the run began there. lanes : (run_count,) those that it serves, bit by
    bit.
    """

    start: np.ndarray
    place: np.ndarray
    lanes: np.ndarray


def runs_of_slots(force_slot: np.ndarray, chunk_start: np.ndarray, empty: int) -> SlotRuns:
    """Return the runs of all packs, slot by slot.

    Parameters
    ----------
    force_slot, chunk_start : as in :class:`lcmchain.model.NodeData`.
    empty : the slot in which there is nothing.
    """
    begin = (chunk_start[:-1, None] + PACK * np.arange(PACKS_OF_CHUNK)).ravel()
    lane = np.arange(PACK)
    node = begin[:, None] + lane
    missing = node >= np.repeat(chunk_start[1:], PACKS_OF_CHUNK)[:, None]
    slot = force_slot[:, np.minimum(node, force_slot.shape[1] - 1)].transpose(1, 0, 2)
    left = (slot != empty) & ~missing[:, None]  # (pack_count, valence, PACK)
    start = slot.astype(np.int64) - lane
    found = []
    while left.any():
        first = np.take_along_axis(start, left.argmax(axis=-1)[..., None], axis=-1)
        taken = left & (start == first)
        left &= ~taken
        pack, valence = np.nonzero(taken.any(axis=-1))
        lanes = (taken[pack, valence] << lane).sum(axis=-1)
        found.append(np.stack([pack, valence, first[pack, valence, 0], lanes]))
    pack, valence, place, lanes = np.concatenate(found, axis=1)
    order = np.lexsort((valence, pack))
    starts = np.searchsorted(pack[order], np.arange(begin.size + 1))
    arrays = (starts, place[order], lanes[order])
    return SlotRuns(*(array.astype(np.int32) for array in arrays))


@standalone_routine
def gather_internal_forces(arrays, runs, chunk, first, last):
    """Set the forces on the nodes ``first`` to ``last`` of a chunk to minus their corner forces.

    Summed in the order of their slots: a sheet moves as it does without the slots that others need.

    Parameters
    ----------
    runs : :class:`SlotRuns`.
    """
    corner_force = arrays.corner_force
    for begin in range(first, last, PACK):
        number = chunk * PACKS_OF_CHUNK + (begin - first) // PACK
        x = y = z = pack_of(0.0)
        for run in range(runs.start[number], runs.start[number + 1]):
            place, lanes = runs.place[run], runs.lanes[run]
            x -= load_lanes(corner_force, place, lanes)
            y -= load_lanes(corner_force, place + LANES, lanes)
            z -= load_lanes(corner_force, place + 2 * LANES, lanes)
        store_vector(arrays.force, begin, min(PACK, last - begin), (x, y, z))
