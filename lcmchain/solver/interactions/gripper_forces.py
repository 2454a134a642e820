"""Grippers that pull, within a step: their forces from the means of their nodes, and the shares."""

from __future__ import annotations

import math

import numpy as np

from lcmchain.dispatch import implements
from lcmchain.effects.grippers import LEAST_DISTANCE, GripperTable, omega2_of_grippers
from lcmchain.effects.interaction import Bound, add_to_nodes, before_nodes, bound
from lcmchain.jit import equation, routine, uncounted_routine
from lcmchain.model import Model
from lcmchain.state import EXTERNAL, PACE, TIME, State
from lcmchain.tools.motion.base import smooth_step


@implements(before_nodes, GripperTable)
@equation
def find_pulls(grippers, arrays, dt_last, dt):
    pull(grippers, arrays, dt_last, dt)


@routine
def pull(grippers, arrays, dt_last, dt):
    """Make the force of every gripper, and count its work since the last step.

    The work is the mean of both forces times the way of the place in between.
    """
    time, pace = arrays.clock[TIME], arrays.clock[PACE]
    force, travel = arrays.gripper_force, arrays.gripper_travel
    interval = 0.5 * (dt_last + dt) * pace
    now = np.empty(3)
    toward = np.empty(3)
    for g in range(grippers.force.size):
        onset, since = 1.0, time - grippers.begin[g]
        if since < grippers.ramp[g]:
            onset = smooth_step(since / grippers.ramp[g])[0]
        now[:] = -grippers.place[g]
        for k in range(grippers.start[g], grippers.start[g + 1]):
            node, weight = grippers.node[k], grippers.weight[k]
            for d in range(3):
                now[d] += weight * arrays.position[d, node]
        extension = 0.0
        first = grippers.distance[g]
        if first > 0.0:
            away = 0.0
            for d in range(3):
                toward[d] = grippers.anchor[g, d] - grippers.place[g, d] - now[d]
                away += toward[d] ** 2
            away = math.sqrt(away)
            extension = away - first
            # near the anchor the direction is lost, and the pull falls
            scale = 1.0 / max(away, LEAST_DISTANCE * first)
            for d in range(3):
                toward[d] *= scale
        else:
            for d in range(3):
                toward[d] = grippers.toward[g, d]
                extension -= toward[d] * now[d]
        size = onset * grippers.force[g] + grippers.stiffness[g] * extension
        size = min(max(size, 0.0), grippers.largest[g])
        gone = math.sqrt(now[0] ** 2 + now[1] ** 2 + now[2] ** 2)
        lets_go = time >= grippers.release_time[g] or size > grippers.release_force[g]
        if lets_go or gone > grippers.release_travel[g]:
            arrays.gripper_let_go[g] = min(arrays.gripper_let_go[g], time)
        if arrays.gripper_let_go[g] < math.inf:
            size = 0.0
        work = 0.0
        for d in range(3):
            new = size * toward[d]
            work += 0.5 * (force[g, d] + new) * (now[d] - travel[g, d])
            arrays.gripper_impulse[g, d] += new * interval
            force[g, d] = new
            travel[g, d] = now[d]
        arrays.gripper_work[g] += work
        arrays.work[EXTERNAL] += work


@implements(add_to_nodes, GripperTable)
@equation
def pulls_of_chunk(grippers, arrays, environment, chunk, first, last, dt_last, dt, work, sums):
    add_pulls(grippers, arrays, chunk)


@uncounted_routine
def add_pulls(grippers, arrays, chunk):
    """Add to the nodes of a chunk their shares in the forces of the grippers."""
    for k in range(grippers.chunk_start[chunk], grippers.chunk_start[chunk + 1]):
        held = grippers.order[k]
        node, weight, owner = grippers.node[held], grippers.weight[held], grippers.owner[held]
        for d in range(3):
            arrays.force[d, node] += weight * arrays.gripper_force[owner, d]


@bound.register(GripperTable)
def _bound_of_grippers(grippers: GripperTable, model: Model, state: State, ahead: float) -> Bound:
    omega2 = omega2_of_grippers(grippers, state.gripper_travel, state.gripper_force)
    return Bound(omega2, 0.0, "springs of grippers")
