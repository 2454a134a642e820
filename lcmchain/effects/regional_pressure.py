"""Pressures on regions of faces, and on the faces of named plies; a part of ``[[pressure]]``.

A scene all of whose pressures act on whole outer faces has two numbers per step and keeps
:class:`lcmchain.effects.face_pressure.FacePressure`. Here every pressure has its share of every
face: 1 inside its region, the part of the area inside where the border cuts the face, 0 beside it.
A region is of the material: it is named on the flat sheet and moves with it. On a face that the
border cuts the pressure is taken as that share of it, evenly over the face: resultants are exact,
moments about the border to the order of an element.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import prange

from lcmchain.effects.face_pressure import (
    PressureOnFace,
    add_face_load,
    common_times,
    face_modes_of_lane,
)
from lcmchain.elements.blocks import LANES
from lcmchain.elements.pressed_elements import (
    CORNERS,
    LOAD_ROWS,
    PressedElements,
    pressed_elements,
)
from lcmchain.errors import InputError
from lcmchain.jit import kernel, routine
from lcmchain.mesh.places import area_shares
from lcmchain.tools.motion.prescribed import tabulated_travel

SIDES = ("bottom", "top")


class RegionalPressure(NamedTuple):
    """Pressures with a share of every face.

    elements : see :class:`PressedElements`.
    times : (K,) [s]. values : (L * K,) pressures of the L entries [Pa], linear in between.
    share : (L * 2 * block_count * 16,), of the bottom and the top faces of all lanes.
    peak : (block_count * 16,) the largest size of a pressure on a face of the lane [Pa].
    """

    elements: PressedElements
    times: np.ndarray
    values: np.ndarray
    share: np.ndarray
    peak: np.ndarray

    @classmethod
    def of_shares(
        cls, elements: PressedElements, share: np.ndarray, times: np.ndarray, values: np.ndarray
    ) -> RegionalPressure:
        """Return pressures (L, K) [Pa] at times (K,) [s] with their shares (L, 2, lanes)."""
        # the pressures are linear in between: the largest stands at one of the times
        peak = np.abs(np.einsum("lk,lsn->ksn", values, share)).max(axis=(0, 1))
        return cls(elements, times, values.ravel(), share.ravel(), peak)

    @property
    def largest(self) -> float:
        """Largest size of a pressure on a face [Pa]."""
        return float(self.peak.max())

    @property
    def entry_values(self) -> np.ndarray:
        """Pressures of the entries (L, K) [Pa]."""
        return self.values.reshape(-1, self.times.size)

    @property
    def entry_shares(self) -> np.ndarray:
        """Shares of the entries in the bottom and top faces (L, 2, lanes)."""
        return self.share.reshape(-1, 2, self.peak.size)

    def size_at(self, time: float) -> float:
        """Return the largest size of a pressure on a face at a time [Pa]."""
        now = [np.interp(time, self.times, values) for values in self.entry_values]
        return float(np.abs(np.einsum("l,lsn->sn", now, self.entry_shares)).max())


def build_regional_pressure(
    entries: Sequence[PressureOnFace],
    bodies: Sequence[Any],
    order: Sequence[int],
    process_time: float,
) -> RegionalPressure:
    """Return the table of pressures of which some have a region or a ply.

    Parameters are those of :func:`lcmchain.effects.face_pressure.build_face_pressure`.

    Raises
    ------
    InputError : a sheet without thickness, a ply that is not there, or a region beside the sheet.
    """
    elements = pressed_elements(bodies, order, key="pressure")
    times, values = common_times([entry.table(process_time) for entry in entries])
    share = regional_shares(entries, bodies, elements)
    return RegionalPressure.of_shares(elements, share, times, values)


def regional_shares(
    entries: Sequence[PressureOnFace],
    bodies: Sequence[Any],
    elements: PressedElements,
    at_work: Sequence[bool] = (),
) -> np.ndarray:
    """Return the shares of pressures in the bottom and top faces of all lanes (L, 2, lanes).

    at_work : of every entry; the others have none. All are without it.

    Raises
    ------
    InputError : as :func:`build_regional_pressure`.
    """
    share = np.zeros((len(entries), 2, elements.padded_count))
    for index, entry in enumerate(entries):
        if at_work and not at_work[index]:
            continue
        key = f'pressure[{index}] "{entry.name}"'
        own = _shares_of(entry, bodies, key)
        lanes = elements.in_lanes(own)
        for side, outer in zip(SIDES, (elements.bottom, elements.top), strict=True):
            if entry.face in (side, "both"):
                share[index, SIDES.index(side)] = lanes if entry.ply is not None else lanes * outer
        if not share[index].any():
            raise InputError(
                "presses on no outer face of the stack there; name the ply whose face is meant",
                key=f"{key}.ply",
            )
    return share


def _shares_of(entry: PressureOnFace, bodies: Sequence[Any], key: str) -> np.ndarray:
    """Return the share of an entry in every element of the model, whatever the face."""
    names = [body.name for body in bodies]
    if entry.ply is not None and entry.ply not in names:
        raise InputError(
            f'there is no ply "{entry.ply}"; there is {", ".join(names)}', key=f"{key}.ply"
        )
    found, beside = [], []
    for body in bodies:
        count = body.mesh.element_count
        if entry.ply not in (None, body.name):
            found.append(np.zeros(count))
        elif not entry.ways:
            found.append(np.ones(count))
        else:
            corners = body.mesh.mid_surface_positions[body.mesh.faces]
            try:
                found.append(area_shares(entry, corners, key))
            except InputError as error:  # the region may lie on another ply
                beside.append(error)
                found.append(np.zeros(count))
    if beside and not any(shares.any() for shares in found):
        raise beside[0]
    return np.concatenate(found)


@routine
def present_pressures(table, time):
    """Return the pressures of all entries at a time (L,) [Pa]."""
    count = table.times.size
    now = np.empty(table.values.size // count)
    for entry in range(now.size):
        own = table.values[entry * count : (entry + 1) * count]
        now[entry] = tabulated_travel(table.times, own, 0, count, time)[0]
    return now


@routine
def pressure_of_lane(now, share, first, lanes):
    """Return the sum of all pressures on a face [Pa], whose shares begin at ``first``."""
    total = 0.0
    for entry in range(now.size):
        total += now[entry] * share[2 * entry * lanes + first]
    return total


@kernel
def regional_forces(elements, position, now, share, added, load):
    """Write the forces of all pressures on the corners of all elements.

    Parameters
    ----------
    elements, position, added, load : as for :func:`lcmchain.effects.face_pressure.face_forces`.
    now : (L,) pressures of the entries [Pa]. share : as in :class:`RegionalPressure`.
    """
    lanes = elements.mass.size
    for block in prange(lanes // LANES):
        nodes = elements.corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        own = load[block * LOAD_ROWS * LANES : (block + 1) * LOAD_ROWS * LANES]
        if added is None:
            own[:] = 0.0
        for lane in range(LANES):
            # padding repeats an element, and has no share
            below = pressure_of_lane(now, share, block * LANES + lane, lanes)
            above = pressure_of_lane(now, share, lanes + block * LANES + lane, lanes)
            add_face_load(own, lane, 0, below, face_modes_of_lane(position, nodes, lane, 0))
            add_face_load(own, lane, 4, -above, face_modes_of_lane(position, nodes, lane, 4))
