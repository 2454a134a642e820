"""Contact of a node with a rigid tool: penalty pressure, damping, and Coulomb friction.

Adds: a force on a node that lies inside a tool. Source: penalty method, e.g. Wriggers,
"Computational Contact Mechanics", sections 5.2 (stick and slip by a return mapping) and 6.3.
Stability limit: adds k/m to the square of the highest frequency of the nodes in contact, and the
damping ratio shortens the step further (``Simulation._step_of``).
Scene: ``[[tools]]`` (none: no contact code runs), ``contact.penalty``, ``contact.damping_ratio``,
``contact.tangential_ratio``, ``tools.friction``.
"""

from __future__ import annotations

import math

from lcmchain.elements.vectors import dot, plus
from lcmchain.jit import equation


@equation
def normal_force(stiffness, damping, gap, normal_velocity):
    """Return the contact pressure force [N] and its elastic part; adhesion is excluded."""
    elastic = -stiffness * gap
    return max(elastic - damping * normal_velocity, 0.0), elastic


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
