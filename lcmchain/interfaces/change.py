"""What happens to points between plies where a stage gives their plies another interface.

A film is cured, a tack is gone, plies are tied: the points stay where they are, and what the laws
of the old interface stored goes. Each point begins on the new interface as one that has just come
to touch. What that changes in the energy is returned.

The energy ½ v₋·M v₊ + U that central differences conserve changes by ΔU + ½ dt v₋·Δf, where f are
the forces, and by the work that friction of the present step has taken already. A refresh may take
ΔU half a step before instead (:mod:`lcmchain.interfaces.refresh`). That leaves out (dt v)² ∂²U/8: a
sliding ply that is tied from one step to the next would be booked a part of its motion.
"""

from __future__ import annotations

import math

from lcmchain.elements.blocks import SPAN, put_vector, vector_at
from lcmchain.elements.vectors import dot, plus
from lcmchain.interfaces.refresh import carry_over, way_to_facet
from lcmchain.interfaces.rows import (
    AREA,
    HELD,
    INTERFACE,
    LAST_DAMPING,
    REACH,
    RIM,
    SLIP,
    STIFFNESS,
    all_parameters,
    memory_rows,
    row_start,
    spring_energy,
    sum_of_laws,
    touch_of,
)
from lcmchain.interfaces.surfaces import NONE
from lcmchain.jit import entry, ordered_span_routine


@entry
def change_interfaces(data, laws, arrays, dt_last):
    """Put all points on the interfaces of their plies, and return what that stores [J].

    Parameters
    ----------
    data : :class:`lcmchain.interfaces.surfaces.InterfaceData` of the stage that begins.
    laws : of all stages. dt_last : the last step [s].
    """
    booked = 0.0
    for point in range(arrays.ply_facet.size):
        booked += change_point(data, laws, arrays, dt_last, point)
    return booked


@ordered_span_routine
def change_point(data, laws, arrays, dt_last, point):
    """Put a point on the interface of its plies, and return what that stores [J]."""
    facet, at, rows = arrays.ply_facet[point], row_start(data, point), arrays.ply_rows
    if facet < 0:
        return 0.0
    ply, other = data.ply[point], data.facet_ply[facet]
    interface = data.interface[ply, other]
    if int(rows[at + INTERFACE * SPAN]) == interface:
        return 0.0
    booked = -energy_at_border(data, laws, arrays, rows, at, facet, dt_last, point)
    starts = memory_rows(laws)
    if interface == NONE:
        arrays.ply_facet[point] = NONE
        for row in range(starts[6]):
            rows[at + row * SPAN] = 0.0
        return booked
    rows[at + INTERFACE * SPAN] = interface
    rows[at + STIFFNESS * SPAN] = 0.5 * data.penalty[interface] * data.area[point]
    rows[at + REACH * SPAN] = data.near[ply, other] if rows[at + HELD * SPAN] == 0.0 else math.inf
    rows[at + LAST_DAMPING * SPAN] = 0.0
    put_vector(rows, SLIP, at, (0.0, 0.0, 0.0))
    r = way_to_facet(arrays.position, data.facet_node, facet, rows, at, point)
    touch = touch_of(rows, at, r, (0.0, 0.0, 0.0), dt_last)
    values = all_parameters(laws, interface)
    carry_over(laws, values, rows, at, touch, touch, True)
    return booked + energy_at_border(data, laws, arrays, rows, at, facet, dt_last, point)


@ordered_span_routine
def energy_at_border(data, laws, arrays, rows, at, facet, dt_last, point):
    """Return U + ½ dt v₋·f of the spring and the laws of a point, and what is lost in the step [J].

    facet : that the point is over. at : its place in the first row. dt_last : the last step [s].
    """
    r = way_to_facet(arrays.position, data.facet_node, facet, rows, at, point)
    v = way_to_facet(arrays.velocity, data.facet_node, facet, rows, at, point)
    moved = (dt_last * v[0], dt_last * v[1], dt_last * v[2])
    touch = touch_of(rows, at, r, moved, dt_last)
    values = all_parameters(laws, int(rows[at + INTERFACE * SPAN]))
    force, tension, stored, lost, _ = sum_of_laws(laws, values, memory_rows(laws), rows, at, touch)
    stored += spring_energy(rows, at, touch)
    force = plus(touch.pressure - tension, touch.normal, force)
    per_share = stored * rows[at + AREA * SPAN] / touch.area if touch.area > 0.0 else 0.0
    force = plus(-per_share, vector_at(rows, RIM, at), force)
    return stored + lost + 0.5 * dot(moved, force)
