"""What contact between plies asks of the step, and where it cannot go on."""

from __future__ import annotations

from typing import Any

import numpy as np

from lcmchain.errors import SimulationError
from lcmchain.interfaces.forces import TOO_DEEP
from lcmchain.interfaces.rows import INTERFACE, STIFFNESS, WEIGHT, row_start
from lcmchain.interfaces.surfaces import InterfaceData
from lcmchain.jit import entry
from lcmchain.quantities.places import millimetres
from lcmchain.tools.span_rows import SPAN


def omega2_bound(model: Any, state: Any) -> float:
    """Return what the springs between plies add to the largest ω² [1/s²], at most.

    The largest row sum of M⁻¹K, of all springs that are there and at least of plies of equal meshes
    in full contact: what comes into contact until the next look is then covered.
    """
    data, mass = model.ply_contact.data, model.nodes.mass
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


def require_on_the_face(model: Any, state: Any) -> None:
    """Stop where a ply has gone into another one deeper than its springs can follow.

    Raises
    ------
    SimulationError : it names the plies, the element, the place and the time.
    """
    data: InterfaceData = model.ply_contact.data
    point = int(state.ply_counters[TOO_DEEP]) - 1
    if point < 0:
        return
    facet = int(state.ply_facet[point])
    own = model.bodies[int(data.ply[point])]
    other = model.bodies[int(data.facet_ply[facet])] if facet >= 0 else None
    raise SimulationError(
        f"the ply {own.name} has gone into "
        f"{'another ply' if other is None else other.name} by more than half the thickness of the "
        f"thicker one, at its element {model.element_at(point) - own.first_element} at "
        f"{millimetres(state.position[:, point])}, {1e3 * state.time:.4f} ms (step "
        f"{state.step_count}): its contact is lost from there on. Likely cause: pressure that a "
        f"contact stiffness of {1e-9 * data.penalty.max():.3g} N/mm^3 cannot carry, plies that "
        "strike each other, or elements that are long for what they are bent over; set a higher "
        "interfaces.penalty, slow what presses them, or shorten the edges"
    )
