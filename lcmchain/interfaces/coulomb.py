"""Coulomb friction between plies, with an elastic slip.

The slip of a point is measured from an anchor: slip = anchor + P r, where r is the way from its
place on the facet to the point and P leaves out the normal. A slip whose force passes the
coefficient times the pressure is cut, and the anchor follows. At a refresh the uncut slip is
carried over to the new facet, turned with its length: cut before, or with its energy taken uncut, a
sliding ply would lose or make energy at every refresh.
Source: return mapping of stick and slip, e.g. Wriggers, "Computational Contact Mechanics", section
5.2; the energy as for tools (:mod:`lcmchain.effects.friction`).
"""

from __future__ import annotations

import math

from lcmchain.elements.vectors import dot, plus, scaled
from lcmchain.jit import equation


@equation
def tangential(a, normal):
    """Return a vector without its part along a normal."""
    return plus(-dot(a, normal), normal, a)


@equation
def cut_slip(trial, stiffness, limit):
    """Return the slip whose force is at most a limit [N]."""
    length = math.sqrt(dot(trial, trial))
    if stiffness * length > limit:
        return scaled(limit / (stiffness * length), trial)
    return trial


@equation
def turned(a, normal):
    """Return a vector of the same length without its part along a normal."""
    flat = tangential(a, normal)
    length2 = dot(flat, flat)
    if length2 <= 0.0:
        return flat
    return scaled(math.sqrt(dot(a, a) / length2), flat)
