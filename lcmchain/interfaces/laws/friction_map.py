"""Friction whose coefficient goes with pressure and sliding speed, by a table.

Between its points the coefficient is linear in both; outside it keeps that of the nearest ones.
Slip and its energy are those of Coulomb friction (:mod:`lcmchain.interfaces.slip`), with
the coefficient of the last step's speed.
Source: measured coefficients are given so, e.g. Gorczyca-Cole, Sherwood, Chen, "A friction model
for thermostamping commingled glass-polypropylene woven fabrics", Composites A 38 (2007).
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
from lcmchain.quantities.entry_types import FrictionCoefficient, Pressure, Row, Speed


class FrictionMap(NamedTuple):
    """Tables of all interfaces one behind the other.

    pressure_start, speed_start, friction_start : (interface_count + 1,) where those of each
    interface begin in ``pressure`` [Pa], ``speed`` [m/s] and ``friction``, row by row of one
    pressure. ratio : (interface_count,) tangential over normal stiffness.
    """

    pressure_start: np.ndarray
    speed_start: np.ndarray
    friction_start: np.ndarray
    pressure: np.ndarray
    speed: np.ndarray
    friction: np.ndarray
    ratio: np.ndarray

    @staticmethod
    def remembers() -> int:
        return SLIP_NUMBERS

    @staticmethod
    def title() -> str:
        return "friction between plies by pressure and speed"

    def reason(self) -> str:
        return f"coefficient {range_in_words(self.friction)}"


@equation
def friction_at(law, interface, pressure, speed):
    """Return the coefficient at a pressure [Pa] and a speed [m/s]."""
    first, last = law.pressure_start[interface], law.pressure_start[interface + 1]
    if first == last:
        return 0.0
    i, along = place_between(law.pressure, first, last, pressure)
    begin, end = law.speed_start[interface], law.speed_start[interface + 1]
    j, across = place_between(law.speed, begin, end, speed)
    columns = end - begin
    at = law.friction_start[interface] + (i - first) * columns + (j - begin)
    right = min(1, columns - 1)
    below = columns * min(1, last - first - 1)
    low = law.friction[at] + across * (law.friction[at + right] - law.friction[at])
    high = law.friction[at + below]
    high += across * (law.friction[at + below + right] - high)
    return low + along * (high - low)


@implements(parameters, FrictionMap)
@equation
def map_parameters(law, interface):
    return interface, law.ratio[interface]


@implements(uses_sliding, FrictionMap)
@equation
def map_uses_sliding(law):
    return True


@implements(respond, FrictionMap)
@equation
def map_response(law, values, memory, touch):
    interface, ratio = values
    friction = 0.0
    if touch.pressure > 0.0 and touch.area > 0.0:
        friction = friction_at(law, interface, touch.pressure / touch.area, sliding_speed(touch))
    return friction_response(friction, ratio, memory, touch)


implements(carried, FrictionMap)(friction_carried)


class FrictionMapTable(FrictionLawTable):
    """Friction by pressure and sliding speed: the coefficient is a table of both."""

    law: ClassVar[type] = FrictionMap

    type: Literal["friction_map"] = "friction_map"
    pressure: Annotated[
        tuple[Pressure, ...], Row('"0.01 0.1 MPa"', minimum_count=1, entries="pressures")
    ] = Field(description="Pressures of the table, increasing.")
    speed: Annotated[
        tuple[Speed, ...], Row('"1 10 100 mm/s"', minimum_count=1, entries="speeds")
    ] = Field(description="Sliding speeds of the table, increasing.")
    friction: Annotated[
        tuple[tuple[FrictionCoefficient, ...], ...],
        Row("[[0.3, 0.25, 0.2], [0.2, 0.18, 0.15]]", minimum_count=1, entries="rows", units=False),
    ] = Field(description="Coefficients: a row for each pressure, a number for each speed.")

    @classmethod
    def gathered(cls, tables: Sequence[Any]) -> FrictionMap:
        pressure, speed = rows_of(tables, "pressure"), rows_of(tables, "speed")
        friction = rows_of(tables, "friction")
        return FrictionMap(
            pressure_start=starts(pressure),
            speed_start=starts(speed),
            friction_start=starts(friction),
            pressure=np.concatenate(pressure),
            speed=np.concatenate(speed),
            friction=np.concatenate(friction),
            ratio=cls.ratios(tables),
        )

    def in_words(self) -> str:
        low, high = np.min(self.friction), np.max(self.friction)
        return f"friction {low:g} to {high:g} by pressure and speed"

    def conflicts(self) -> str | None:
        for entry in ("pressure", "speed"):
            if not increasing(getattr(self, entry)):
                return f"{entry} does not increase"
        if len(self.friction) != len(self.pressure):
            return f"friction has {len(self.friction)} rows for {len(self.pressure)} pressures"
        for number, row in enumerate(self.friction):
            if len(row) != len(self.speed):
                return f"friction[{number}] has {len(row)} numbers for {len(self.speed)} speeds"
        return None
