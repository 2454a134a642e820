"""Adhesion between plies (tack): a tension that holds them together until they part.

Plies that come nearer than a distance stick to each other; from then on a stress of one size draws
them together, until their gap passes a larger distance. A cycle of coming together and parting
takes the stress times the difference of the two distances.
Energy: σ (gap - on) per area while they stick, lower by σ on where they lie on each other than
where they came together.
Source: tack with two distances, as interfaces of plies have it in forming programs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from lcmchain.effects.effect import range_in_words
from lcmchain.interfaces.law import (
    InterfaceLawTable,
    carried,
    implements,
    parameters,
    respond,
)
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import PositiveLength, PositiveStiffness


class Adhesion(NamedTuple):
    """stress : [Pa]. on, off : gaps below and above which plies stick and part [m].

    All (interface_count,).
    """

    stress: np.ndarray
    on: np.ndarray
    off: np.ndarray

    @staticmethod
    def remembers() -> int:
        return 1  # 1 for a point that sticks

    @staticmethod
    def title() -> str:
        return "adhesion between plies"

    def reason(self) -> str:
        return f"tension {range_in_words(1e-6 * self.stress[self.stress > 0.0])} MPa"


@implements(parameters, Adhesion)
@equation
def adhesion_parameters(law, interface):
    return law.stress[interface], law.on[interface], law.off[interface]


@equation
def sticks(on, off, memory, gap):
    """Return 1 for a point that sticks at a gap, else 0."""
    held = memory[0] if gap < off else 0.0
    return 1.0 if gap < on else held


@implements(respond, Adhesion)
@equation
def adhesion_response(law, values, memory, touch):
    stress, on, off = values
    now = sticks(on, off, memory, touch.gap)
    full = stress * touch.area
    tension, last = now * full, memory[0] * full
    stored, before = tension * (touch.gap - on), last * (touch.last_gap - on)
    # the work of the mean tension of two steps, less what is stored of it
    lost = 0.5 * (tension + last) * (touch.gap - touch.last_gap) - (stored - before)
    return (0.0, 0.0, 0.0), tension, stored, lost, (now,)


@implements(carried, Adhesion)
@equation
def adhesion_carried(law, values, memory, before, after, kept):
    # plies that are found near each other stick: those that are laid down do
    return (sticks(values[1], values[2], (kept * memory[0],), after.gap),)


class AdhesionTable(InterfaceLawTable):
    """Adhesion (tack): a tension that holds plies together until they part."""

    law: ClassVar[type] = Adhesion

    type: Literal["adhesion"] = "adhesion"
    stress: PositiveStiffness = Field(description="Tension while plies stick to each other.")
    on: PositiveLength = Field(description="Gap below which plies begin to stick.")
    off: PositiveLength = Field(description="Gap above which they part; not below `on`.")

    @classmethod
    def gathered(cls, tables: Sequence[Any]) -> Adhesion:
        return Adhesion(
            *(
                np.array([0.0 if table is None else getattr(table, entry) for table in tables])
                for entry in ("stress", "on", "off")
            )
        )

    def reach(self) -> float:
        return self.off

    def in_words(self) -> str:
        return (
            f"adhesion {1e-6 * self.stress:g} MPa, on {1e3 * self.on:g} mm, "
            f"off {1e3 * self.off:g} mm"
        )

    def conflicts(self) -> str | None:
        if self.off < self.on:
            return (
                f"off is {1e3 * self.off:g} mm, below on, {1e3 * self.on:g} mm: plies would part "
                "before they stick; give a larger off"
            )
        return None
