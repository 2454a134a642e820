"""Pressures in and on a sheet within a step: loads on the corners, summed up by nodes."""

from __future__ import annotations

import numpy as np

from lcmchain.dispatch import implements, required
from lcmchain.effects.face_pressure import (
    FacePressure,
    RegionalPressure,
    face_forces,
    face_frequencies,
    face_pressures,
    present_pressures,
    regional_forces,
)
from lcmchain.effects.interaction import Bound, add_to_nodes, before_nodes, bound
from lcmchain.effects.pore_pressure import (
    column_drops,
    mobilities,
    of_columns,
    pore_forces,
    pore_frequencies,
    resistance_mobilities,
    scale_loads,
    unit_loads,
)
from lcmchain.effects.pressures import (
    BothPressures,
    ColumnAndFacePressures,
    ColumnPressures,
    FacePressures,
    PorePressures,
)
from lcmchain.elements.blocks import LANES
from lcmchain.elements.pressed_elements import PressedElements
from lcmchain.jit import equation, routine, standalone_span_routine, uncounted_routine
from lcmchain.model import Model
from lcmchain.state import EXTERNAL, TIME, State


@implements(before_nodes, PorePressures)
@equation
def make_pore_loads(pressures, arrays, dt_last, dt):
    add_pore_loads(pressures.pore, arrays, dt)


@implements(before_nodes, FacePressures)
@equation
def make_face_loads(pressures, arrays, dt_last, dt):
    add_face_loads(pressures.face, arrays, None)


@implements(before_nodes, BothPressures)
@equation
def make_both_loads(pressures, arrays, dt_last, dt):
    add_pore_loads(pressures.pore, arrays, dt)
    add_face_loads(pressures.face, arrays, True)


@implements(before_nodes, ColumnPressures)
@equation
def make_column_loads(pressures, arrays, dt_last, dt):
    add_column_loads(pressures.pore, pressures.columns, arrays, dt)


@implements(before_nodes, ColumnAndFacePressures)
@equation
def make_column_and_face_loads(pressures, arrays, dt_last, dt):
    add_column_loads(pressures.pore, pressures.columns, arrays, dt)
    add_face_loads(pressures.face, arrays, True)


@uncounted_routine
def add_column_loads(pore, columns, arrays, dt):
    """Write the loads of the pressures in the columns of a stack, and move these on."""
    load = arrays.corner_load
    unit_loads(pore, arrays.position, arrays.velocity, columns.rate, load)
    column_drops(columns, arrays.pore_resistance, columns.drop)
    scale_loads(columns, columns.drop, arrays.pore_pressure, arrays.pore_rate, dt, load)


@uncounted_routine
def add_pore_loads(pore, arrays, dt):
    """Write the loads of the pressures in the pores, and move these on."""
    pore_forces(
        pore,
        arrays.position,
        arrays.velocity,
        arrays.pore_pressure,
        arrays.pore_rate,
        arrays.pore_resistance,
        dt,
        arrays.corner_load,
    )


@required
def add_face_loads(face, arrays, added):
    """Write the loads of the pressures on the faces; ``added`` is True where others lie there."""


@implements(add_face_loads, RegionalPressure)
@routine
def add_regional_loads(face, arrays, added):
    now = present_pressures(face, arrays.clock[TIME])
    regional_forces(face.elements, arrays.position, now, face.share, added, arrays.corner_load)


@implements(add_face_loads, FacePressure)
@uncounted_routine
def add_outer_face_loads(face, arrays, added):
    bottom, top = face_pressures(face, arrays.clock[TIME])
    face_forces(face.elements, arrays.position, bottom, top, added, arrays.corner_load)


@equation
def loads_of_chunk(pressures, arrays, environment, chunk, first, last, dt_last, dt, work, sums):
    add_pressure_loads(arrays, first, last, dt_last, sums)


for kind in (
    PorePressures, FacePressures, BothPressures, ColumnPressures, ColumnAndFacePressures
):  # fmt: skip
    implements(add_to_nodes, kind)(loads_of_chunk)


@standalone_span_routine
def add_pressure_loads(arrays, first, last, dt_last, sums):
    """Sum up the loads on the corners for nodes ``first`` to ``last``, and add them to the force.

    The work since the last step, mean of both loads times the displacement, goes to ``sums``.
    """
    load, node_load, force_slot = arrays.corner_load, arrays.node_load, arrays.force_slot
    velocity, force = arrays.velocity, arrays.force
    work = 0.0
    for node in range(first, last):
        x = 0.0
        y = 0.0
        z = 0.0
        for i in range(force_slot.shape[0]):
            slot = force_slot[i, node]
            x += load[slot]
            y += load[slot + LANES]
            z += load[slot + 2 * LANES]
        work += (node_load[0, node] + x) * velocity[0, node]
        work += (node_load[1, node] + y) * velocity[1, node]
        work += (node_load[2, node] + z) * velocity[2, node]
        node_load[0, node] = x
        node_load[1, node] = y
        node_load[2, node] = z
        force[0, node] += x
        force[1, node] += y
        force[2, node] += z
    sums[EXTERNAL] += 0.5 * dt_last * work


@bound.register(PorePressures)
def _bound_of_pore(pressures: PorePressures, model: Model, state: State, ahead: float) -> Bound:
    return _with_cause(*_of_pore(pressures.pore, state, ahead))


@bound.register(FacePressures)
def _bound_of_face(pressures: FacePressures, model: Model, state: State, ahead: float) -> Bound:
    return _with_cause(_of_face(pressures.face, state), 0.0)


@bound.register(BothPressures)
def _bound_of_both(pressures: BothPressures, model: Model, state: State, ahead: float) -> Bound:
    pore, rate = _of_pore(pressures.pore, state, ahead)
    return _with_cause(pore + _of_face(pressures.face, state), rate)


@bound.register(ColumnPressures)
def _bound_of_columns(
    pressures: ColumnPressures, model: Model, state: State, ahead: float
) -> Bound:
    return _with_cause(*_of_columns(pressures, state, ahead))


@bound.register(ColumnAndFacePressures)
def _bound_of_columns_and_face(
    pressures: ColumnAndFacePressures, model: Model, state: State, ahead: float
) -> Bound:
    column, rate = _of_columns(pressures, state, ahead)
    return _with_cause(column + _of_face(pressures.face, state), rate)


def _with_cause(omega2: float, rate: float) -> Bound:
    return Bound(omega2, rate, "pressure of a fluid")


def _of_pore(pore: PressedElements, state: State, ahead: float) -> tuple[float, float]:
    """Return ω² [1/s²] of the pressures until the next look, and the rate of the damping [1/s].

    The resistance of the fluid damps with the velocity of half a step before.
    """
    coming = np.abs(state.pore_pressure) + ahead * np.abs(state.pore_rate)
    found = np.empty(pore.padded_count)
    pore_frequencies(pore, state.position, coming, found)
    if not state.pore_resistance.any():
        return float(found.max()), 0.0
    mobility = np.empty(pore.padded_count)
    resistance_mobilities(pore, state.position, mobility)
    return float(found.max()), float(np.max(state.pore_resistance * mobility))


def _of_columns(
    pressures: ColumnPressures | ColumnAndFacePressures, state: State, ahead: float
) -> tuple[float, float]:
    """Return ω² [1/s²] of the columns' pressures until the next look, and the rate [1/s].

    The fluid presses on the elements and on their inner faces.
    """
    pore, columns = pressures.pore, pressures.columns
    coming = np.abs(state.pore_pressure) + ahead * np.abs(state.pore_rate)
    inside, on_faces = np.empty((2, pore.padded_count))
    pore_frequencies(pore, state.position, coming, inside)
    face_frequencies(pore, state.position, float(coming.max()), on_faces)
    omega2 = float(inside.max() + on_faces.max())
    if not state.pore_resistance.any():
        return omega2, 0.0
    mobility = of_columns(columns, mobilities(pore, state.position))
    return omega2, float(np.max(state.pore_resistance[columns.lane] * mobility))


def _of_face(face: FacePressure | RegionalPressure, state: State) -> float:
    """Return ω² of the largest pressures on the faces [1/s²]."""
    found = np.empty(face.elements.padded_count)
    if isinstance(face, RegionalPressure):
        face_frequencies(face.elements, state.position, 1.0, found)
        return float((found * face.peak).max())
    face_frequencies(face.elements, state.position, face.largest, found)
    return float(found.max())
