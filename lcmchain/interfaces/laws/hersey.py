"""Friction of a lubricated interface: the coefficient goes with the Hersey number.

H = viscosity times sliding speed over pressure [m]. The coefficient is linear between points over
H; it falls at first, while solids still touch, and rises along a line once a film carries (curve of
Stribeck). Slip and its energy are those of Coulomb friction.
Source: Hersey, "The laws of lubrication of horizontal journal bearings", J. Wash. Acad. Sci. 4
(1914); for plies with a molten matrix, ten Thije et al., "Design of an experimental setup to
measure tool-ply and ply-ply friction", Key Eng. Mat. 410 (2009).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from lcmchain.effects.effect import range_in_words
from lcmchain.interfaces.law import (
    carried,
    implements,
    increasing,
    parameters,
    place_between,
    respond,
    rows_of,
    starts,
    uses_sliding,
)
from lcmchain.interfaces.slip import (
    SLIP_NUMBERS,
    FrictionLawTable,
    friction_carried,
    friction_response,
    sliding_speed,
)
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import (
    FrictionCoefficient,
    LengthOrZero,
    Row,
    Viscosity,
)


class Hersey(NamedTuple):
    """Curves of all interfaces one behind the other.

    start : (interface_count + 1,) where each begins in ``hersey`` [m] and ``friction``.
    viscosity : [Pa s]. ratio : tangential over normal stiffness; both (interface_count,).
    """

    start: np.ndarray
    hersey: np.ndarray
    friction: np.ndarray
    viscosity: np.ndarray
    ratio: np.ndarray

    @staticmethod
    def remembers() -> int:
        return SLIP_NUMBERS

    @staticmethod
    def title() -> str:
        return "friction between plies by Hersey number"

    def reason(self) -> str:
        return f"coefficient {range_in_words(self.friction)}"


@implements(parameters, Hersey)
@equation
def hersey_parameters(law, interface):
    return (
        law.start[interface],
        law.start[interface + 1],
        law.viscosity[interface],
        law.ratio[interface],
    )


@implements(uses_sliding, Hersey)
@equation
def hersey_uses_sliding(law):
    return True


@implements(respond, Hersey)
@equation
def hersey_response(law, values, memory, touch):
    first, last, viscosity, ratio = values
    friction = 0.0
    if first < last and touch.pressure > 0.0 and touch.area > 0.0:
        number = viscosity * sliding_speed(touch) * touch.area / touch.pressure
        k, part = place_between(law.hersey, first, last, number)
        friction = law.friction[k]
        if last - first > 1:
            friction += part * (law.friction[k + 1] - friction)
    return friction_response(friction, ratio, memory, touch)


implements(carried, Hersey)(friction_carried)


class HerseyTable(FrictionLawTable):
    """Friction of a lubricated interface, by the Hersey number."""

    law: ClassVar[type] = Hersey

    type: Literal["hersey"] = "hersey"
    viscosity: Viscosity = Field(description="Viscosity of what lies between the plies.")
    hersey: Annotated[
        tuple[LengthOrZero, ...], Row('"0 0.1 1 um"', minimum_count=1, entries="Hersey numbers")
    ] = Field(description="Viscosity times speed over pressure, increasing.")
    friction: Annotated[
        tuple[FrictionCoefficient, ...],
        Row("[0.3, 0.1, 0.2]", minimum_count=1, entries="coefficients", units=False),
    ] = Field(description="Coefficient of friction at these numbers; linear in between.")

    @classmethod
    def gathered(cls, tables: Sequence[Any]) -> Hersey:
        hersey, friction = rows_of(tables, "hersey"), rows_of(tables, "friction")
        return Hersey(
            starts(hersey),
            np.concatenate(hersey),
            np.concatenate(friction),
            np.array([0.0 if table is None else table.viscosity for table in tables]),
            cls.ratios(tables),
        )

    def in_words(self) -> str:
        return f"friction {min(self.friction):g} to {max(self.friction):g} by Hersey number"

    def conflicts(self) -> str | None:
        if not increasing(self.hersey):
            return "hersey does not increase"
        if len(self.friction) != len(self.hersey):
            return f"friction has {len(self.friction)} numbers for {len(self.hersey)} of hersey"
        return None
