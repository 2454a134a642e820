"""Supports within a step: held nodes follow their motions, and the forces that this takes."""

from __future__ import annotations

import math

from lcmchain.dispatch import implements
from lcmchain.effects.gravity import weight_at
from lcmchain.effects.interaction import after_nodes, before_nodes
from lcmchain.effects.supports import SupportTable, prescribed_position
from lcmchain.jit import equation, standalone_routine
from lcmchain.state import EXTERNAL, KINETIC, PACE, TIME


@implements(before_nodes, SupportTable)
@equation
def release(supports, arrays, dt_last, dt):
    let_go(supports, arrays)


@standalone_routine
def let_go(supports, arrays):
    """Free the nodes of supports that let go at this step."""
    time, force = arrays.clock[TIME], arrays.support_force
    for g in range(supports.release_time.size):
        if arrays.support_let_go[g] < math.inf:
            continue
        size = math.sqrt(force[g, 0] ** 2 + force[g, 1] ** 2 + force[g, 2] ** 2)
        if time < supports.release_time[g] and size <= supports.release_force[g]:
            continue
        arrays.support_let_go[g] = time
        for k in range(supports.node.size):
            if supports.group[k] == g:
                arrays.free[:, supports.node[k]] = 1.0


@implements(after_nodes, SupportTable)
@equation
def hold(supports, arrays, environment, dt_last, dt):
    move_supports(arrays, supports, environment, dt_last, dt)


@standalone_routine
def move_supports(arrays, supports, environment, dt_last, dt):
    """Move held components as prescribed, and sum the forces that the supports exert [N].

    Their impulses [N s] are summed over the process as well: a force averaged over an interval is
    the difference of two impulses, free of the noise of single steps.
    """
    position, velocity, free, mass = arrays.position, arrays.velocity, arrays.free, arrays.mass
    pace = arrays.clock[PACE]
    interval = 0.5 * (dt_last + dt)
    place = (arrays.clock[TIME] + pace * dt - supports.start) / supports.interval
    piece = min(int(place), supports.affine.shape[1] - 2)
    s = min(place - piece, 1.0)
    arrays.support_force[:] = 0.0
    for k in range(supports.node.size):
        node, group = supports.node[k], supports.group[k]
        for d in range(3):
            if free[d, node] > 0.0:
                continue
            old = velocity[d, node]
            new = (prescribed_position(supports, k, d, piece, s) - position[d, node]) / dt
            gravity = -weight_at(environment.gravity, node) if d == 2 else 0.0
            held = mass[node] * ((new - old) / interval - gravity) - arrays.force[d, node]
            arrays.support_force[group, d] += held
            arrays.support_impulse[group, d] += held * (pace * interval)
            arrays.work[KINETIC] += 0.5 * mass[node] * old * new
            arrays.work[EXTERNAL] += (held + mass[node] * gravity) * 0.5 * (old + new) * interval
            velocity[d, node] = new
            position[d, node] += dt * new
