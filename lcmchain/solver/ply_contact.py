"""Contact between plies within a step: forces of springs that are renewed when it is time."""

from __future__ import annotations

from typing import Any

from lcmchain.dispatch import implements
from lcmchain.effects.interaction import (
    Bound,
    add_to_nodes,
    before_nodes,
    begin_steps,
    bound,
)
from lcmchain.interfaces.forces import STEPS_LEFT, add_ply_forces, forces_of_points, list_points
from lcmchain.interfaces.limits import omega2_bound
from lcmchain.interfaces.refresh import refresh
from lcmchain.interfaces.surfaces import PlyContact
from lcmchain.jit import equation, standalone_routine
from lcmchain.state import CONTACT, CONTACT_DAMPING, FRICTION, PLY_REFRESH, State


@implements(begin_steps, PlyContact)
@equation
def list_points_of_nodes(plies, arrays):
    list_points(plies.data, arrays)


@implements(before_nodes, PlyContact)
@equation
def press_plies(plies, arrays, dt_last, dt):
    move_plies(plies, arrays, dt_last, dt)


@standalone_routine
def move_plies(plies, arrays, dt_last, dt):
    """Make the forces of all points between plies, on springs that are renewed when it is time."""
    if arrays.ply_counters[STEPS_LEFT] <= 0:
        arrays.work[PLY_REFRESH] -= refresh(plies.data, plies.laws, arrays, dt_last, dt)
    forces_of_points(plies, arrays, dt_last)
    arrays.ply_counters[STEPS_LEFT] -= 1


@implements(add_to_nodes, PlyContact)
@equation
def ply_forces_of_chunk(plies, arrays, environment, chunk, first, last, dt_last, dt, work, sums):
    stored, lost, damped = add_ply_forces(plies, arrays, chunk, first, last)
    sums[CONTACT] += stored
    sums[FRICTION] += lost
    sums[CONTACT_DAMPING] += damped


@bound.register(PlyContact)
def _bound_of_plies(plies: PlyContact, model: Any, state: State, ahead: float) -> Bound:
    omega2 = omega2_bound(model, state)
    rate = plies.data.damping_time * omega2 + plies.data.sliding_rate
    return Bound(omega2, rate, "contact between plies")
