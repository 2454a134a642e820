"""Pressure of a fluid in a stack of plies: one pressure in each column through all of them.

Adds: the fluid of a column presses on what bounds the column from outside: the bottom of the lowest
ply, the top of the uppermost, and the sides. It is in the pores of the plies and in gaps between
them alike, so that on a face that looks at another ply it acts from both sides: there the fibres
alone press, and what the contact of plies carries is the effective stress (Terzaghi). With the
volume V of an element and the faces f that look at plies, the force on a node is

    p (∂V/∂x - Σ_f ∂V_f/∂x),

where ∂V_f/∂x is the exact load of a unit pressure on the face (:mod:`.face_pressure`). In one sheet
no face looks at a ply, and this is the force of :mod:`.pore_pressure`. A pressure that is the same
everywhere loads no node of an inner face, to round-off and in any shape. The springs of the
contact, whose normals lag behind the faces, could not hand it on like that.

The pressure of an element is that of the columns that it lies over, p_e = Σ_c W_ec p_c, with the
share W_ec of its area. What it does to the column is then Σ_e W_ec dU_e/dt, the rate of the whole
column, gaps included. The resistance of the fluid (:mod:`.pore_pressure`) acts against that rate:
it does not resist plies that become thinner and thicker in turn, or a stack that moves as a whole.
Stability limit: that of a pore pressure and of pressures on faces together. A resistance Z_c damps
at the rate Z_c Σ_e W_ec |∂U_e/∂a|²/m_e at most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange
from scipy.sparse import csr_array

from lcmchain.effects.face_pressure import add_face_load, face_modes_of_lane
from lcmchain.effects.pore_pressure import push_in_lane
from lcmchain.elements.blocks import LANES
from lcmchain.elements.pressed_elements import (
    CORNERS,
    LOAD_ROWS,
    PressedElements,
    corner_positions,
)
from lcmchain.jit import kernel, routine


class PoreColumns(NamedTuple):
    """Which columns of fluid the elements of a stack lie over, C columns.

    lane : (C,) int64, lanes that hold the resistance of the columns.
    first, last : (padded_count,) int64, range of the columns of each lane in the next two.
    column, share : numbers of the columns, and share of the element over each.
    first_of, last_of : (C,) int64, range of the elements of each column in the next two.
    element, share_of : their lanes, and share of each element in the column.
    rate : (padded_count,) of the volumes [m³/s]; drop : (C,) of the pressures by the resistance
        [Pa]; both are written in every step.
    """

    lane: np.ndarray
    first: np.ndarray
    last: np.ndarray
    column: np.ndarray
    share: np.ndarray
    first_of: np.ndarray
    last_of: np.ndarray
    element: np.ndarray
    share_of: np.ndarray
    rate: np.ndarray
    drop: np.ndarray

    @classmethod
    def of_shares(cls, pore: PressedElements, shares: csr_array, first_element: int) -> PoreColumns:
        """Return the columns of a stack.

        Parameters
        ----------
        shares : of the area of each element of the model over each column (element_count, C).
        first_element : of the ply whose elements are the columns, in their order.
        """
        by_column = shares.tocsc()
        first, last = np.zeros((2, pore.padded_count), dtype=np.int64)
        first[pore.place], last[pore.place] = shares.indptr[:-1], shares.indptr[1:]
        count = shares.shape[1]
        return cls(
            lane=pore.place[first_element : first_element + count].astype(np.int64),
            first=first,
            last=last,
            column=shares.indices.astype(np.int64),
            share=shares.data.astype(float),
            first_of=by_column.indptr[:-1].astype(np.int64),
            last_of=by_column.indptr[1:].astype(np.int64),
            element=pore.place[by_column.indices].astype(np.int64),
            share_of=by_column.data.astype(float),
            rate=np.zeros(pore.padded_count),
            drop=np.zeros(count),
        )


@kernel
def unit_loads(elements, position, velocity, rate, load):
    """Write the forces of a unit pressure on the corners of all elements, and their rates dU/dt.

    Parameters
    ----------
    elements : :class:`PressedElements`. position, velocity : (3, node_count) [m, m/s].
    rate : (padded_count,) [m³/s], written.
    load : (block_count * 24 * 16,) or longer [m²], row ``3*corner + component``, written.
    """
    for block in prange(rate.size // LANES):
        nodes = elements.corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        own = load[block * LOAD_ROWS * LANES : (block + 1) * LOAD_ROWS * LANES]
        corner_positions(position, nodes, own)
        for lane in range(LANES):
            push_in_lane(own, lane, 1.0, 0.0, velocity, nodes)
        for lane in range(LANES):
            # the fluid between the plies presses on the faces that look at one
            below = 1.0 - elements.bottom[block * LANES + lane]
            above = 1.0 - elements.top[block * LANES + lane]
            add_face_load(own, lane, 0, below, face_modes_of_lane(position, nodes, lane, 0))
            add_face_load(own, lane, 4, -above, face_modes_of_lane(position, nodes, lane, 4))
        for lane in range(LANES):
            total = 0.0
            for corner in range(CORNERS):
                node = nodes[corner * LANES + lane]
                total += own[3 * corner * LANES + lane] * velocity[0, node]
                total += own[(3 * corner + 1) * LANES + lane] * velocity[1, node]
                total += own[(3 * corner + 2) * LANES + lane] * velocity[2, node]
            rate[block * LANES + lane] = total


@kernel
def column_drops(columns, resistance, drop):
    """Write by how much the pressures of the columns fall with the rates of their volumes.

    Parameters
    ----------
    resistance : (padded_count,) [Pa s/m³], of the columns at their lanes.
    drop : (C,) [Pa], written.
    """
    for c in prange(drop.size):
        drop[c] = resistance[columns.lane[c]] * rate_of_column(columns, c)


@routine
def rate_of_column(columns, c):
    # in a routine of its own: summed up within the parallel loop, the sum was silently lost
    total = 0.0
    for k in range(columns.first_of[c], columns.last_of[c]):
        total += columns.share_of[k] * columns.rate[columns.element[k]]
    return total


@kernel
def scale_loads(columns, drop, pressure, rate, dt, load):
    """Multiply the loads of unit pressures by the pressures, and move these on.

    Parameters
    ----------
    drop : of the pressures of the columns (C,) [Pa].
    pressure, rate : of the elements at rest, and its rate (padded_count,) [Pa, Pa/s].
    dt : the step [s]. load : as of :func:`unit_loads`; afterwards [N].
    """
    for block in prange(pressure.size // LANES):
        own = load[block * LOAD_ROWS * LANES : (block + 1) * LOAD_ROWS * LANES]
        for lane in range(LANES):
            i = block * LANES + lane
            p = pressure[i] - drop_of_element(columns, drop, i)
            for row in range(LOAD_ROWS):
                own[row * LANES + lane] *= p
            pressure[i] += dt * rate[i]


@routine
def drop_of_element(columns, drop, i):
    total = 0.0
    for k in range(columns.first[i], columns.last[i]):
        total += columns.share[k] * drop[columns.column[k]]
    return total


def mobilities(elements: PressedElements, position: np.ndarray) -> np.ndarray:
    """Return |∂U/∂a|²/m of the elements by lane (padded_count,) [m⁴/kg].

    Every corner has an eighth of the element's mass m.
    """
    still = np.zeros_like(position)
    rate = np.empty(elements.padded_count)
    load = np.empty(elements.padded_count * LOAD_ROWS)
    unit_loads(elements, np.ascontiguousarray(position), still, rate, load)
    squared = (load.reshape(-1, LOAD_ROWS, LANES) ** 2).sum(axis=1).ravel()
    mass = elements.mass
    return CORNERS * np.divide(squared, mass, out=np.zeros_like(mass), where=mass > 0.0)


def of_columns(columns: PoreColumns, values: np.ndarray) -> np.ndarray:
    """Return the sums over the elements of each column (C,) of values by lane (padded_count,)."""
    number = np.repeat(np.arange(columns.lane.size), columns.last_of - columns.first_of)
    weighed = columns.share_of * values[columns.element]
    return np.bincount(number, weighed, minlength=columns.lane.size)
