"""Contact between plies within a step: forces of springs that are renewed when it is time."""

from __future__ import annotations

import numpy as np

from lcmchain.dispatch import implements
from lcmchain.effects.interaction import (
    Bound,
    add_to_nodes,
    before_nodes,
    begin_steps,
    bound,
)
from lcmchain.elements.blocks import SPAN
from lcmchain.interfaces.forces import STEPS_LEFT, add_ply_forces, forces_of_points, list_points
from lcmchain.interfaces.refresh import refresh
from lcmchain.interfaces.rows import INTERFACE, STIFFNESS, WEIGHT, row_start
from lcmchain.interfaces.surfaces import PlyContact
from lcmchain.jit import entry, equation, standalone_routine
from lcmchain.model import Model
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
def _bound_of_plies(plies: PlyContact, model: Model, state: State, ahead: float) -> Bound:
    omega2 = omega2_bound(plies, model, state)
    rate = plies.data.damping_time * omega2 + plies.data.sliding_rate
    return Bound(omega2, rate, "contact between plies")


def omega2_bound(plies: PlyContact, model: Model, state: State) -> float:
    """Return what the springs between plies add to the largest ω² [1/s²], at most.

    The largest row sum of M⁻¹K, of all springs that are there and at least of plies of equal meshes
    in full contact: what comes into contact until the next look is then covered.
    """
    data, mass = plies.data, model.nodes.mass
    return max(data.omega2, largest_row_sum(data, state.ply_facet, state.ply_rows, mass))


@entry
def largest_row_sum(data, facets, springs, mass):
    """Return the largest Σ |K| / m of all nodes [1/s²] by the springs of points over facets.

    Springs against sliding are at right angles to those of the pressure: the stiffer ones count.
    """
    rows = np.zeros(mass.size)
    for point in range(facets.size):
        facet = facets[point]
        if facet >= 0:
            at = row_start(data, point)
            total = 1.0
            for k in range(4):
                total += abs(springs[at + (WEIGHT + k) * SPAN])
            stiffness = springs[at + STIFFNESS * SPAN]
            stiffness *= data.stiffer[int(springs[at + INTERFACE * SPAN])]
            rows[point] += stiffness * total
            for k in range(4):
                weight = abs(springs[at + (WEIGHT + k) * SPAN])
                rows[data.facet_node[facet, k]] += stiffness * weight * total
    largest = 0.0
    for node in range(mass.size):
        largest = max(largest, rows[node] / mass[node])
    return largest
