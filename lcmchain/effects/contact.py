"""Contact of a node with a rigid tool: penalty pressure, damping, and Coulomb friction.

Adds: a force on a node that lies inside a tool. Source: penalty method, e.g. Wriggers,
"Computational Contact Mechanics", sections 5.2 (stick and slip by a return mapping) and 6.3.
Stability limit: adds k/m to the square of the highest frequency of the nodes in contact
(``Simulation._step_of``).
Scene: ``[[tools]]`` (none: no contact code runs), ``contact.penalty``, ``contact.damping_ratio``,
``contact.tangential_ratio``, ``tools.friction``.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from lcmchain.elements.vectors import dot, plus
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import AbsentMeans, FrictionCoefficient, Number, Penalty, Range
from lcmchain.quantities.scene_model import SceneModel


@equation
def share_inside(depth, way):
    """Return the part of a way towards or out of the tool that is spent inside."""
    return depth / way if way > depth else 1.0


@equation
def normal_force(stiffness, damping, gap, velocity, mobility, acceleration, dt_last, dt):
    """Return the contact pressure force [N] and the energy that its damping takes [J].

    The spring counts only for the parts of the two neighbouring steps that the node spends inside.
    To the order of the step this closes the energy balance of the steps that cross the surface;
    with the full force ½ k ab is lost where a node goes from a outside to b inside, and gained on
    the way out. The damping acts on the mean of the velocities before and after the step, as in
    :mod:`lcmchain.effects.damping`: it then limits no step, and what it takes is exactly what the
    motion loses. Adhesion is excluded.

    Parameters
    ----------
    stiffness, damping : of the contact [N/m, N s/m]; gap : negative [m].
    velocity : normal velocity relative to the tool before the step [m/s].
    mobility : inverse mass along the normal, of the components that are free [1/kg].
    acceleration : along the normal by all other forces [m/s²].
    dt_last, dt : the steps before and after [s].
    """
    interval = 0.5 * (dt_last + dt)
    elastic = -stiffness * gap
    leaving = velocity + interval * (acceleration + mobility * elastic)
    inside = share_inside(-gap, -velocity * dt_last) + share_inside(-gap, leaving * dt)
    elastic *= 0.5 * inside
    mean = velocity + 0.5 * interval * (acceleration + mobility * elastic)
    mean /= 1.0 + 0.5 * interval * mobility * damping
    force = max(elastic - damping * mean, 0.0)
    mean = velocity + 0.5 * interval * (acceleration + mobility * force)
    return force, (elastic - force) * mean * interval


@equation
def friction(stick, slip_increment, normal, stiffness, limit):
    """Return the new elastic slip, the friction force, and the energy dissipated by sliding.

    ``stick`` (elastic slip of the tangential spring, [m]) is carried to the present tangent plane,
    grows by the relative displacement since the last step, and returns to the cone |F| <= limit.
    The slip is measured relative to the tool, so that a common motion produces none.
    """
    out_of_plane = dot(stick, normal)
    trial = plus(-out_of_plane, normal, stick)
    trial = plus(1.0, trial, slip_increment)
    squared = dot(trial, trial)
    length = math.sqrt(squared)
    dissipated = 0.0
    if stiffness * length > limit:
        scale = limit / (stiffness * length)
        dissipated = limit * (1.0 - scale) * length
        trial = (scale * trial[0], scale * trial[1], scale * trial[2])
    force = (-stiffness * trial[0], -stiffness * trial[1], -stiffness * trial[2])
    return trial, force, dissipated


class Contact(SceneModel):
    """Penalty contact and Coulomb friction between blank and tools."""

    penalty: Annotated[Penalty | None, AbsentMeans("automatic")] = Field(
        default=None, description="Contact stiffness per area."
    )
    damping_ratio: Annotated[float, Number(0.2, Range(0.0, 2.0))] = Field(
        default=0.2, description="Contact damping as a fraction of critical."
    )
    friction: FrictionCoefficient = Field(default=0.0, description="Coulomb friction coefficient.")
    tangential_ratio: Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.5, description="Tangential over normal contact stiffness."
    )
