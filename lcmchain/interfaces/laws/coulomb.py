"""Coulomb friction between plies, with an elastic slip (:mod:`lcmchain.interfaces.slip`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from lcmchain.effects.effect import range_in_words
from lcmchain.interfaces.law import (
    carried,
    implements,
    parameters,
    respond,
)
from lcmchain.interfaces.slip import (
    SLIP_NUMBERS,
    FrictionLawTable,
    friction_carried,
    friction_response,
)
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import FrictionCoefficient


class Coulomb(NamedTuple):
    """friction : coefficient. ratio : tangential over normal stiffness; both (interface_count,)."""

    friction: np.ndarray
    ratio: np.ndarray

    @staticmethod
    def remembers() -> int:
        return SLIP_NUMBERS

    @staticmethod
    def title() -> str:
        return "friction between plies"

    def reason(self) -> str:
        return f"coefficient {range_in_words(self.friction)}"


@implements(parameters, Coulomb)
@equation
def coulomb_parameters(law, interface):
    return law.friction[interface], law.ratio[interface]


@implements(respond, Coulomb)
@equation
def coulomb_response(law, values, memory, touch):
    return friction_response(values[0], values[1], memory, touch)


implements(carried, Coulomb)(friction_carried)


class FrictionTable(FrictionLawTable):
    """Coulomb friction: the coefficient is one number."""

    law: ClassVar[type] = Coulomb

    type: Literal["coulomb"] = "coulomb"
    friction: FrictionCoefficient = Field(description="Coulomb friction coefficient.")

    @classmethod
    def gathered(cls, tables: Sequence[Any]) -> Coulomb:
        return Coulomb(
            np.array([0.0 if table is None else float(table.friction) for table in tables]),
            cls.ratios(tables),
        )

    def in_words(self) -> str:
        return f"friction {self.friction:g}"
