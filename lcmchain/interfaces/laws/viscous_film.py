"""Viscous film between plies: a shear stress in proportion to the sliding speed.

τ = η v / h with the viscosity η and the thickness h of the film, while the gap is below h. The
stress is that of the last step's speed; what it takes is its mean of two steps times the way.
Source: Newton's law of viscosity; a film as an interface of plies: e.g. Haanappel et al.,
"Formability analyses of uni-directional and textile reinforced thermoplastics", Composites A 56
(2014).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from lcmchain.effects.effect import range_in_words
from lcmchain.elements.vectors import dot, plus, scaled
from lcmchain.interfaces.law import (
    InterfaceLawTable,
    carried,
    implements,
    parameters,
    respond,
    uses_sliding,
)
from lcmchain.interfaces.springs import turned
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import PositiveLength, Viscosity


class ViscousFilm(NamedTuple):
    """viscosity : [Pa s], 0 without a film. thickness : of the film [m]; (interface_count,)."""

    viscosity: np.ndarray
    thickness: np.ndarray

    @staticmethod
    def remembers() -> int:
        return 3  # force after the last step

    @staticmethod
    def title() -> str:
        return "viscous film between plies"

    def reason(self) -> str:
        return f"viscosity {range_in_words(self.viscosity[self.viscosity > 0.0])} Pa s"


@implements(parameters, ViscousFilm)
@equation
def film_parameters(law, interface):
    return law.viscosity[interface] / law.thickness[interface], law.thickness[interface]


@implements(uses_sliding, ViscousFilm)
@equation
def film_uses_sliding(law):
    return True


@implements(respond, ViscousFilm)
@equation
def film_response(law, values, memory, touch):
    resistance, thickness = values
    wet = touch.gap < thickness and touch.time > 0.0
    factor = -resistance * touch.area / touch.time if wet else 0.0
    force = scaled(factor, touch.moved)
    lost = -0.5 * dot(plus(1.0, force, memory), touch.moved)
    return force, 0.0, 0.0, lost, force


@implements(carried, ViscousFilm)
@equation
def film_carried(law, values, memory, before, after, kept):
    return scaled(kept, turned(memory, after.normal))


class ViscousFilmTable(InterfaceLawTable):
    """Viscous film: a shear stress in proportion to the sliding speed."""

    law: ClassVar[type] = ViscousFilm

    type: Literal["viscous_film"] = "viscous_film"
    viscosity: Viscosity = Field(description="Viscosity of the film.")
    thickness: PositiveLength = Field(
        description="Thickness of the film; it acts while the gap is smaller."
    )

    @classmethod
    def gathered(cls, tables: Sequence[Any]) -> ViscousFilm:
        return ViscousFilm(
            np.array([0.0 if table is None else table.viscosity for table in tables]),
            np.array([1.0 if table is None else table.thickness for table in tables]),
        )

    def reach(self) -> float:
        return self.thickness

    def slip_viscosity(self) -> float:
        return self.viscosity / self.thickness

    def in_words(self) -> str:
        return f"film of {self.viscosity:g} Pa s, {1e3 * self.thickness:g} mm"
