"""Elastic slip of a point on another ply, up to a limit: what all laws of friction rest on.

The slip of a point is measured from an anchor: slip = anchor + way, where the way leads from its
place on the facet to the point, along the facet. A slip whose force passes its limit is cut, and
the anchor follows. At a refresh the uncut slip is carried over to the new facet, turned with its
length: cut before, or with its energy taken uncut, a sliding ply would lose or make energy at every
refresh.
Source: return mapping of stick and slip, e.g. Wriggers, "Computational Contact Mechanics", section
5.2; the energy as for tools (:mod:`lcmchain.effects.friction`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from lcmchain.elements.vectors import dot, plus, scaled
from lcmchain.interfaces.law import InterfaceLawTable
from lcmchain.interfaces.springs import turned
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import Number, Range

#: Numbers that a point keeps: the anchor, then the slip after the last step.
SLIP_NUMBERS = 6


@equation
def trial_slip(memory, way):
    """Return the slip before it is cut [m]."""
    return plus(1.0, (memory[0], memory[1], memory[2]), way)


@equation
def slip_to(limit, stiffness, memory, way):
    """Return force, energy stored and lost, and memory, of a slip whose force is limited.

    Parameters
    ----------
    limit : [N], 0 for a point that carries none. stiffness : against the slip [N/m].
    """
    trial = trial_slip(memory, way)
    before = (memory[3], memory[4], memory[5])
    force = stiffness * math.sqrt(dot(trial, trial))
    part = limit / force if force > limit else (1.0 if limit > 0.0 else 0.0)
    after = scaled(part, trial)
    anchor = plus(-1.0, way, after)
    stored = 0.5 * stiffness * dot(after, after)
    # ½ k (b + a)·(t - b) - ½ k (a² - b²), what the motion loses and the spring does not keep
    lost = 0.5 * stiffness * dot(plus(1.0, before, after), plus(-1.0, after, trial))
    memory = (anchor[0], anchor[1], anchor[2], after[0], after[1], after[2])
    return scaled(-stiffness, after), stored, lost, memory


@equation
def slip_carried(memory, before, after, kept):
    """Return the memory of a slip on a new facet."""
    slip = turned(trial_slip(memory, before.way), after.normal)
    old = turned((memory[3], memory[4], memory[5]), after.normal)
    way = after.way
    return (
        kept * slip[0] - way[0], kept * slip[1] - way[1], kept * slip[2] - way[2],
        kept * old[0], kept * old[1], kept * old[2],
    )  # fmt: skip


@equation
def friction_response(friction, ratio, memory, touch):
    """Return what a law answers whose limit is a coefficient times the pressure.

    ratio : tangential over normal stiffness.
    """
    force, stored, lost, memory = slip_to(
        friction * touch.pressure, ratio * touch.stiffness, memory, touch.way
    )
    return force, 0.0, stored, lost, memory


@equation
def friction_carried(law, values, memory, before, after, kept):
    """Return the memory of such a law on a new facet: what does not press has no slip."""
    return slip_carried(memory, before, after, kept if before.pressure > 0.0 else 0.0)


@equation
def sliding_speed(touch):
    """Return the speed of the last step along the facet [m/s], 0 before the first one."""
    length = math.sqrt(dot(touch.moved, touch.moved))
    return length / touch.time if touch.time > 0.0 else 0.0


class FrictionLawTable(InterfaceLawTable):
    """Base of the tables of laws whose limit is a coefficient times the pressure."""

    tangential_ratio: Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.5, description="Tangential over normal contact stiffness."
    )

    @staticmethod
    def ratios(tables: Sequence[Any]) -> np.ndarray:
        """Return the ratio of each interface; of one without the law it does not matter."""
        return np.array([0.5 if table is None else table.tangential_ratio for table in tables])
