"""Which points of a mesh are the same place: files written face by face repeat their nodes."""

from __future__ import annotations

import numpy as np

from lcmchain.jit import routine


def places_of(points: np.ndarray, spacing: float) -> np.ndarray:
    """Number the places where points lie; points that round to the same place share one.

    Parameters
    ----------
    points : [m], shape (N, 3).
    spacing : of the grid to which they are rounded [m].

    Returns
    -------
    number of the place of each point, shape (N,), in the order in which the places first occur.
    """
    steps = np.round(points / spacing).astype(np.int64)
    table_size = 1 << max(4, int(2 * len(points)).bit_length())
    return _number(steps, np.full(table_size, -1, dtype=np.int64))


@routine
def _number(steps, table):
    """Number different rows by a hash table with open addressing, twice as large as need be."""
    place = np.empty(len(steps), dtype=np.int64)
    last = np.uint64(len(table) - 1)
    places = 0
    for n in range(len(steps)):
        mixed = np.uint64(0)
        for axis in range(3):
            mixed = (mixed ^ np.uint64(steps[n, axis])) * np.uint64(0x9E3779B97F4A7C15)
            mixed ^= mixed >> np.uint64(29)
        slot = mixed & last
        while True:
            other = table[np.int64(slot)]
            if other < 0:
                table[np.int64(slot)] = n
                place[n] = places
                places += 1
                break
            if (
                steps[other, 0] == steps[n, 0]
                and steps[other, 1] == steps[n, 1]
                and steps[other, 2] == steps[n, 2]
            ):
                place[n] = place[other]
                break
            slot = (slot + np.uint64(1)) & last
    return place
