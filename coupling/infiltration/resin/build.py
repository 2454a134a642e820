"""From the resin's table in a scene to its laws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lcmchain.coupling.infiltration.resin.kinetics import KamalSourour
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
from lcmchain.scene import resin as tables


def resin_of(table: tables.Resin) -> Resin:
    """Return the laws of viscosity and cure that a resin's table of a scene names."""
    return _VISCOSITIES[table.law](table, _shared(table))


def temperature_of(table: tables.Resin) -> ResinTemperature | None:
    """Return the temperature that a resin's table gives; None where none is needed."""
    given = table.temperature
    return None if given is None else _TEMPERATURES[given.law](given)


def _shared(table: Any) -> dict[str, Any]:
    """Entries that all resins have, as keywords of their laws."""
    return {
        "density": table.density,
        "initial_cure": table.initial_cure,
        "gel_cure": np.inf if table.gel_cure is None else table.gel_cure,
        "kinetics": None if table.cure is None else _CURES[table.cure.law](table.cure),
    }


def _constant(table: tables.ConstantViscosityResin, shared: dict[str, Any]) -> Resin:
    return ConstantViscosity(table.viscosity, **shared)


def _thermal(table: tables.ArrheniusResin) -> dict[str, Any]:
    reference = np.inf if table.reference_temperature is None else table.reference_temperature
    return {
        "reference_viscosity": table.reference_viscosity,
        "activation_energy": table.activation_energy,
        "reference_temperature": reference,
    }


def _arrhenius(table: tables.ArrheniusResin, shared: dict[str, Any]) -> Resin:
    return ArrheniusViscosity(**_thermal(table), **shared)


def _castro_macosko(table: tables.CastroMacoskoResin, shared: dict[str, Any]) -> Resin:
    return CastroMacoskoViscosity(
        **_thermal(table), **shared, exponent=table.exponent, exponent_slope=table.exponent_slope
    )


def _kamal_sourour(table: tables.KamalSourourCure) -> KamalSourour:
    return KamalSourour(**table.model_dump(exclude={"law", "preset"}))


def _nth_order(table: tables.NthOrderCure) -> KamalSourour:
    return KamalSourour.nth_order(table.rate, table.energy, table.order)


def _autocatalytic(table: tables.AutocatalyticCure) -> KamalSourour:
    return KamalSourour.autocatalytic(
        table.rate, table.energy, table.autocatalytic_order, table.order
    )


def _constant_temperature(table: tables.ConstantResinTemperature) -> ResinTemperature:
    return ConstantTemperature(table.value)


def _prescribed(table: tables.PrescribedResinTemperature) -> ResinTemperature:
    return PrescribedTemperature(table.times, table.values)


def _mould(table: tables.MouldResinTemperature) -> ResinTemperature:
    times = (0.0,) if table.times is None else table.times
    return MouldTemperature(table.inlet, times, table.mould, table.diffusivity)


_VISCOSITIES: dict[str, Callable[[Any, dict[str, Any]], Resin]] = {
    "constant": _constant,
    "arrhenius": _arrhenius,
    "castro_macosko": _castro_macosko,
}
_CURES: dict[str, Callable[[Any], KamalSourour]] = {
    "kamal_sourour": _kamal_sourour,
    "nth_order": _nth_order,
    "autocatalytic": _autocatalytic,
}
_TEMPERATURES: dict[str, Callable[[Any], ResinTemperature]] = {
    "constant": _constant_temperature,
    "prescribed": _prescribed,
    "mould": _mould,
}
