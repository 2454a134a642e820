"""The resin: viscosity, cure, gel point and temperature.

A resin is an object that answers to :class:`~lcmchain.coupling.infiltration.resin.law.Resin`; the
filling asks it for viscosity and rate of cure and knows nothing of its law.
"""

from __future__ import annotations

from lcmchain.coupling.infiltration.resin.build import resin_of, temperature_of
from lcmchain.coupling.infiltration.resin.cure import advance_cure
from lcmchain.coupling.infiltration.resin.kinetics import GAS_CONSTANT, KamalSourour
from lcmchain.coupling.infiltration.resin.law import Resin
from lcmchain.coupling.infiltration.resin.temperature import (
    ConstantTemperature,
    MouldTemperature,
    PrescribedTemperature,
    ResinTemperature,
)
from lcmchain.coupling.infiltration.resin.viscosity import (
    ArrheniusViscosity,
    CastroMacoskoViscosity,
    ConstantViscosity,
)

__all__ = [
    "GAS_CONSTANT",
    "ArrheniusViscosity",
    "CastroMacoskoViscosity",
    "ConstantTemperature",
    "ConstantViscosity",
    "KamalSourour",
    "MouldTemperature",
    "PrescribedTemperature",
    "Resin",
    "ResinTemperature",
    "advance_cure",
    "resin_of",
    "temperature_of",
]
