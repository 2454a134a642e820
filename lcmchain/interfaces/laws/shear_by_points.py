"""Shear stress between plies over their slip, by points.

Up to the first point the stress is elastic; from there on the slip is plastic: unloading goes along
the first slope, and reloading comes back to the curve where it was left. Stress may rise
(hardening), fall (damage of a bond, a peak at the start of sliding) or stay; behind the last point
it keeps its value. The points are those of one way without return. It acts at any pressure, while
the gap is below a distance.
Source: return mapping with a limit that goes with the plastic slip, e.g. Simo & Hughes,
"Computational Inelasticity", section 1.2; the piecewise linear limit is met exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from lcmchain.elements.vectors import dot
from lcmchain.interfaces.law import (
    InterfaceLawTable,
    carried,
    implements,
    increasing,
    parameters,
    respond,
    rows_of,
    starts,
)
from lcmchain.interfaces.slip import SLIP_NUMBERS, slip_carried, slip_to, trial_slip
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import PositiveLength, PositiveStiffness, Row


class ShearByPoints(NamedTuple):
    """Curves of all interfaces one behind the other.

    start : (interface_count + 1,) where each begins in ``plastic``, the plastic slip of its points
    [m], and ``stress`` [Pa]. stiffness : first slope [Pa/m]. distance : gap up to which it acts
    [m]; both (interface_count,).
    """

    start: np.ndarray
    plastic: np.ndarray
    stress: np.ndarray
    stiffness: np.ndarray
    distance: np.ndarray

    @staticmethod
    def remembers() -> int:
        return SLIP_NUMBERS + 1  # and the plastic slip so far

    @staticmethod
    def title() -> str:
        return "shear stress between plies by points"

    def reason(self) -> str:
        return f"up to {1e-3 * self.stress.max():.3g} kPa"


@equation
def plastic_slip(law, first, last, stiffness, path, trial):
    """Return the plastic slip [m] after a step, and the stress [Pa].

    Where the stress of the trial slip [m] less what is added to the plastic one meets the limit.
    """
    whole = trial + path
    k = first
    while k < last - 1:
        rise = law.stress[k + 1] - law.stress[k]
        run = law.plastic[k + 1] - law.plastic[k]
        at_next = stiffness * (whole - law.plastic[k + 1])
        if at_next <= law.stress[k + 1]:
            slope = rise / run
            plastic = stiffness * whole - law.stress[k] + slope * law.plastic[k]
            plastic /= stiffness + slope
            break
        k += 1
    if k == last - 1:
        plastic = whole - law.stress[k] / stiffness
    plastic = max(plastic, path)
    return plastic, stiffness * (whole - plastic)


@implements(parameters, ShearByPoints)
@equation
def shear_parameters(law, interface):
    return (
        law.start[interface],
        law.start[interface + 1],
        law.stiffness[interface],
        law.distance[interface],
    )


@implements(respond, ShearByPoints)
@equation
def shear_response(law, values, memory, touch):
    first, last, stiffness, distance = values
    path, limit = memory[6], 0.0
    if first < last and touch.area > 0.0 and touch.gap < distance:
        slip = trial_slip(memory, touch.way)
        trial = math.sqrt(dot(slip, slip))
        path, stress = plastic_slip(law, first, last, stiffness, path, trial)
        # never below what a slip within the limit has: it is not cut there
        limit = max(stress * touch.area, 1e-300)
    force, stored, lost, slip_memory = slip_to(limit, stiffness * touch.area, memory, touch.way)
    return force, 0.0, stored, lost, (*slip_memory, path)


@implements(carried, ShearByPoints)
@equation
def shear_carried(law, values, memory, before, after, kept):
    held = kept if before.gap < values[3] else 0.0
    return (*slip_carried(memory, before, after, held), kept * memory[6])


class ShearByPointsTable(InterfaceLawTable):
    """Shear stress over slip, by points: elastic at first, then plastic."""

    law: ClassVar[type] = ShearByPoints

    type: Literal["shear_by_points"] = "shear_by_points"
    slip: Annotated[
        tuple[PositiveLength, ...], Row('"0.002 0.5 mm"', minimum_count=1, entries="slips")
    ] = Field(description="Slips of the points, increasing; the curve starts at zero.")
    stress: Annotated[
        tuple[PositiveStiffness, ...], Row('"11 60 kPa"', minimum_count=1, entries="stresses")
    ] = Field(description="Shear stresses at these slips; linear in between, then constant.")
    distance: PositiveLength = Field(
        default="0.1 mm",  # type: ignore[assignment]
        description="Gap up to which it acts.",
    )

    @classmethod
    def gathered(cls, tables: Sequence[Any]) -> ShearByPoints:
        slip, stress = rows_of(tables, "slip"), rows_of(tables, "stress")
        stiffness = np.array([1.0 if t is None else t.stiffness() for t in tables])
        plastic = [s - tau / k for s, tau, k in zip(slip, stress, stiffness, strict=True)]
        return ShearByPoints(
            starts(slip),
            np.concatenate(plastic),
            np.concatenate(stress),
            stiffness,
            np.array([0.0 if table is None else table.distance for table in tables]),
        )

    def reach(self) -> float:
        return self.distance

    def stiffness(self) -> float:
        return self.stress[0] / self.slip[0]

    def in_words(self) -> str:
        return f"shear stress up to {1e-3 * max(self.stress):g} kPa by slip"

    def conflicts(self) -> str | None:
        if len(self.stress) != len(self.slip):
            return f"stress has {len(self.stress)} values for {len(self.slip)} slips"
        if not increasing(self.slip):
            return "slip does not increase"
        for k in range(1, len(self.slip)):
            slope = (self.stress[k] - self.stress[k - 1]) / (self.slip[k] - self.slip[k - 1])
            if slope >= self.stiffness():
                return (
                    f"the curve is steeper before its point [{k}] than from zero to the first one, "
                    "the slope of its elastic part; give a first point on the steepest part"
                )
        return None
