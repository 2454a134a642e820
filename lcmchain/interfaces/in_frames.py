"""What a saved frame holds of the contact between plies: numbers of every node, for the fields.

A node takes what it bears as a point of contact, and its part of what the points of other plies
press on the facets around it: the sum over a face is the whole force on it, and that on the face of
the other ply is as large.
"""

from __future__ import annotations

import math

import numpy as np

from lcmchain.elements.blocks import SPAN, vector_at
from lcmchain.elements.vectors import dot, plus
from lcmchain.interfaces.refresh import slip_of, touches
from lcmchain.interfaces.rows import (
    BASELINE,
    FORCE,
    HELD,
    LAST_GAP,
    LOST_ENERGY,
    NORMAL,
    PATH,
    RIM,
    SLIP,
    STORED_ENERGY,
    WAY,
    WEIGHT,
    row_start,
    share_at,
)
from lcmchain.interfaces.springs import tangential
from lcmchain.interfaces.surfaces import NONE
from lcmchain.jit import entry, equation

# Rows of what a frame holds; of vectors the first of three.
PRESSED = 0  # force of other plies along the normal at the last step, a pull negative [N]
SHEARED = 1  # and along the face [N]
GAP = 4  # to the ply that the node faces at the last step, not a number where it faces none [m]
SLID = 5  # on other plies while it touched them, turned with the surface [m]
SLID_PATH = 8  # and the length of that way [m]
CONTACT = 9  # one of the three below
FACED = 10  # number of the ply that the node faces, NONE without
FRAME_ROWS = 11

# What a point does on the other ply: no force, held against sliding, or sliding.
APART, STICKS, SLIDES = 0, 1, 2

# Forces against sliding below this part of the pressure are rounding.
NO_SHEAR = 1e-9


@entry
def frame_of_points(data, position, slopes, facets, rows, frame):
    """Write what a frame holds of all points into ``frame`` (FRAME_ROWS, node_count)."""
    frame[:] = 0.0
    frame[GAP] = np.nan
    frame[FACED] = NONE
    for point in range(facets.size):
        at, facet = row_start(data, point), facets[point]
        slip, path = vector_at(rows, SLIP, at), rows[at + PATH * SPAN]
        if facet >= 0:
            gap = rows[at + LAST_GAP * SPAN] + rows[at + HELD * SPAN]
            if touches(data, rows, at, gap, point, facet):
                slip, path = slip_of(position, data, slopes, facet, rows, at, point)
            frame[GAP, point] = gap - rows[at + BASELINE * SPAN]
            frame[FACED, point] = data.facet_ply[facet]
            pressure, shear = parts_of_force(rows, at)
            frame[CONTACT, point] = what_it_does(rows, at, pressure, shear)
            frame[PRESSED, point] += pressure
            for d in range(3):
                frame[SHEARED + d, point] += shear[d]
            for k in range(4):
                node, weight = data.facet_node[facet, k], rows[at + (WEIGHT + k) * SPAN]
                frame[PRESSED, node] += weight * pressure
                for d in range(3):
                    frame[SHEARED + d, node] -= weight * shear[d]
        for d in range(3):
            frame[SLID + d, point] = slip[d]
        frame[SLID_PATH, point] = path


@equation
def parts_of_force(rows, at):
    """Return the force on a point along the normal and along the facet [N].

    Without the one by which its share at a rim changes: no law resists sliding there.
    """
    normal, slope = vector_at(rows, NORMAL, at), vector_at(rows, RIM, at)
    force = vector_at(rows, FORCE, at)
    share = share_at(rows, at, vector_at(rows, WAY, at))
    if share > 0.0:
        force = plus(rows[at + STORED_ENERGY * SPAN] / share, slope, force)
    return dot(force, normal), tangential(force, normal)


@equation
def what_it_does(rows, at, pressure, shear):
    """Tell whether a point is apart, sticks or slides."""
    resists = math.sqrt(dot(shear, shear)) > NO_SHEAR * abs(pressure)
    if pressure == 0.0 and not resists:
        return APART
    return STICKS if resists and rows[at + LOST_ENERGY * SPAN] <= 0.0 else SLIDES
