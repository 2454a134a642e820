"""The air ahead of the front: its pressure, and pockets that no open vent reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lcmchain.coupling.infiltration.boundaries import Vent
from lcmchain.coupling.infiltration.medium import Medium
from lcmchain.coupling.infiltration.state import DrySpot, FillingState


@dataclass(frozen=True)
class Air:
    """Dry regions of a state.

    Parameters
    ----------
    region : number of the connected region of volumes that are not full, -1 for full ones, (N,).
    vented : whether an open vent lies in the region, (R,).
    pressure : of the air of each region [Pa], (R,).
    volume : of the air of each region [m3], (R,).
    """

    region: np.ndarray
    vented: np.ndarray
    pressure: np.ndarray
    volume: np.ndarray


def find_air(
    edges: np.ndarray,
    state: FillingState,
    pores: np.ndarray,
    vents: list[tuple[int, Vent, float]],
    compressed: bool,
) -> Air:
    """Return the dry regions of a state.

    Parameters
    ----------
    vents : those that are open, with their pressure [Pa]; a region has that of the lowest.
    compressed : enclosed air is an ideal gas at constant temperature (its pressure times volume
        stays); otherwise it keeps its pressure, as if it left.
    """
    count = len(state.full)
    dry = ~state.full
    linked = dry[edges[:, 0]] & dry[edges[:, 1]]
    ends = edges[linked]
    graph = coo_matrix((np.ones(len(ends)), ends.T), shape=(count, count))
    _, component = connected_components(graph, directed=False)
    region = np.full(count, -1)
    _, region[dry] = np.unique(component[dry], return_inverse=True)
    size = region.max(initial=-1) + 1
    where = region[dry]
    room = (pores - state.resin_volume)[dry]
    volume = np.bincount(where, room, minlength=size)
    amount = np.bincount(where, room * state.air_pressure[dry], minlength=size)
    most, least = np.full(size, -np.inf), np.full(size, np.inf)
    np.maximum.at(most, where, state.air_pressure[dry])
    np.minimum.at(least, where, state.air_pressure[dry])
    # One pressure is its own mean, to the bit: looking twice at a state must not change it.
    held = np.where(most == least, most, amount / np.where(volume > 0.0, volume, 1.0))
    lowest = np.full(size, np.inf)
    for _, vent, pressure in vents:
        reached = region[vent.nodes]
        np.minimum.at(lowest, reached[reached >= 0], pressure)
    vented = np.isfinite(lowest)
    if not compressed:
        held = most
    return Air(region, vented, np.where(vented, lowest, held), volume)


def new_dry_spots(
    air: Air, medium: Medium, state: FillingState, pores: np.ndarray
) -> tuple[np.ndarray, tuple[DrySpot, ...]]:
    """Return which nodes are enclosed now, and the pockets that have just closed.

    A pocket counts if the front has not passed one of its nodes at least: single volumes that the
    front leaves behind for a moment are none.
    """
    enclosed = np.zeros(len(state.full), dtype=bool)
    dry = air.region >= 0
    enclosed[dry] = ~air.vented[air.region[dry]]
    spots = []
    area = medium.sheet_area
    for number in np.unique(air.region[enclosed & ~state.enclosed]):
        nodes = np.flatnonzero(air.region == number)
        if state.enclosed[nodes].any() or not np.isnan(state.fill_time[nodes]).any():
            continue
        room = (pores - state.resin_volume)[nodes]
        share = room / pores[nodes]
        place = room @ medium.mesh.points[nodes] / room.sum()
        spots.append(
            DrySpot(state.time, place, float(share @ area[nodes]), float(room.sum()), nodes)
        )
    return enclosed, tuple(spots)
