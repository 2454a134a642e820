"""Coulomb friction between plies, with an elastic slip.

The slip of a point is measured from an anchor: slip = anchor + way, where the way leads from its
place on the facet to the point, along the facet. A slip whose force passes the coefficient times
the pressure is cut, and the anchor follows. At a refresh the uncut slip is carried over to the new
facet, turned with its length: cut before, or with its energy taken uncut, a sliding ply would lose
or make energy at every refresh.
Source: return mapping of stick and slip, e.g. Wriggers, "Computational Contact Mechanics", section
5.2; the energy as for tools (:mod:`lcmchain.effects.friction`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from lcmchain.elements.vectors import dot, plus, scaled
from lcmchain.interfaces.law import (
    InterfaceLawTable,
    carried,
    implements,
    parameters,
    respond,
    span,
)
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import FrictionCoefficient, Number, Range

#: Elastic slip of a point: the anchor, then the slip after the last step.
SLIP = 6


class Coulomb(NamedTuple):
    """friction : coefficient. ratio : tangential over normal stiffness; both (interface_count,)."""

    friction: np.ndarray
    ratio: np.ndarray

    @staticmethod
    def remembers() -> int:
        return SLIP

    @staticmethod
    def title() -> str:
        return "friction between plies"

    def reason(self) -> str:
        return f"coefficient {span(self.friction)}"


@equation
def tangential(a, normal):
    """Return a vector without its part along a normal."""
    return plus(-dot(a, normal), normal, a)


@equation
def turned(a, normal):
    """Return a vector of the same length without its part along a normal."""
    flat = tangential(a, normal)
    length2 = dot(flat, flat)
    factor = math.sqrt(dot(a, a) / length2) if length2 > 0.0 else 0.0
    return scaled(factor, flat)


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


@implements(parameters, Coulomb)
@equation
def coulomb_parameters(law, interface):
    return law.friction[interface], law.ratio[interface]


@implements(respond, Coulomb)
@equation
def coulomb_response(law, values, memory, touch):
    friction, ratio = values
    force, stored, lost, memory = slip_to(
        friction * touch.pressure, ratio * touch.stiffness, memory, touch.way
    )
    return force, 0.0, stored, lost, memory


@implements(carried, Coulomb)
@equation
def coulomb_carried(law, values, memory, before, after, kept):
    pressed = kept if before.pressure > 0.0 else 0.0
    return slip_carried(memory, before, after, pressed)


class FrictionTable(InterfaceLawTable):
    """Coulomb friction: the coefficient is one number."""

    law: ClassVar[type] = Coulomb

    type: Literal["coulomb"] = "coulomb"
    friction: FrictionCoefficient = Field(description="Coulomb friction coefficient.")
    tangential_ratio: Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.5, description="Tangential over normal contact stiffness."
    )

    @classmethod
    def gathered(cls, tables: Sequence[Any]) -> Coulomb:
        return Coulomb(
            np.array([0.0 if table is None else float(table.friction) for table in tables]),
            np.array([0.5 if table is None else table.tangential_ratio for table in tables]),
        )

    def in_words(self) -> str:
        return f"friction {self.friction:g}"
