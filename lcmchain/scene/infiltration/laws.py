"""Scene tables of the laws of the flow: permeability of the textile, and the resin.

A permeability follows from the fibre volume fraction, or is measured. A resin has a viscosity, and
may have a cure and a temperature.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from lcmchain.quantities.entry_types import (
    NOT_NEGATIVE,
    POSITIVE,
    AbsentMeans,
    ActivationEnergy,
    Angle,
    Density,
    Diffusivity,
    FibreRadius,
    FileName,
    Number,
    PermeabilityValue,
    PositiveRate,
    Range,
    Row,
    SceneModel,
    Temperature,
    TimeOrZero,
    Viscosity,
    wrong,
)
from lcmchain.scene.infiltration.boundaries import require_times
from lcmchain.scene.presets import CURES, VISCOSITIES, filled, published_values

# --- permeability ---------------------------------------------------------------------------------


_OPEN = Range(0.0, 1.0, open_ends=(0.0, 1.0))
_Fraction = Annotated[float, Number(0.5, _OPEN)]
_End = Annotated[float, Number(0.5, Range(0.0, 1.0))]
_Limits = Annotated[tuple[_End, _End], Row("[0.4, 0.6]", count=2, entries="numbers", units=False)]
_Slope = Annotated[float, Number(3.0, Range(-1e3, 1e3))]
_Slopes = Annotated[
    tuple[_Slope, _Slope, _Slope], Row("[4, 4, 6]", count=3, entries="numbers", units=False)
]


class GebartPermeability(SceneModel):
    """Permeability of ordered fibres after Gebart."""

    law: Literal["gebart"]
    fibre_radius: FibreRadius = Field(description="Radius of a single fibre.")
    packing: Literal["quadratic", "hexagonal"] = Field(
        default="quadratic", description="Arrangement of the fibres."
    )


class KozenyCarmanPermeability(SceneModel):
    """Kozeny-Carman permeability K = r²/(4 k) (1 - v)³/v² with one constant per direction."""

    law: Literal["kozeny_carman"]
    fibre_radius: FibreRadius = Field(description="Radius of a single fibre.")
    k_along: Annotated[float, Number(0.6, POSITIVE)] = Field(
        description="Kozeny constant along the fibres, usually 0.5 to 0.7."
    )
    k_across: Annotated[float, Number(15.0, POSITIVE)] = Field(
        description="Kozeny constant across the fibres, usually 11 to 18."
    )


class _Measured(SceneModel):
    """What the tables of measured permeabilities share."""

    angle: Angle = Field(
        default="0 deg",  # type: ignore[assignment]
        description="From fibre direction 1 to the axis of k1, towards fibre direction 2, in the "
        "unsheared textile.",
    )


class _MeasuredValues(_Measured):
    """Three values, for the tables that give them."""

    k1: PermeabilityValue = Field(description="Permeability along the first axis in the plane.")
    k2: PermeabilityValue = Field(description="Permeability along the second axis in the plane.")
    k3: PermeabilityValue = Field(description="Permeability through the thickness.")


class _MeasuredOverFraction(_MeasuredValues):
    """Values at one fibre volume fraction, and the range in which they were measured."""

    fibre_volume_fraction: _Fraction = Field(
        description="Fibre volume fraction at which the permeabilities are k1, k2 and k3."
    )
    fibre_volume_fraction_range: _Limits = Field(
        description="Fibre volume fractions between which it was measured; beyond them there is "
        "no permeability."
    )

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        _require_rising(self.fibre_volume_fraction_range)
        return self


class ConstantPermeability(_MeasuredValues):
    """Measured permeability that does not depend on the fibre volume fraction."""

    law: Literal["constant"]
    fibre_volume_fraction_range: Annotated[_Limits | None, AbsentMeans("any")] = Field(
        default=None,
        description="Fibre volume fractions between which it holds; beyond them there is no "
        "permeability.",
    )

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        if self.fibre_volume_fraction_range is not None:
            _require_rising(self.fibre_volume_fraction_range)
        return self


class PowerPermeability(_MeasuredOverFraction):
    """Measured permeability k (v / fibre_volume_fraction)^-exponent."""

    law: Literal["power"]
    exponents: _Slopes = Field(description="Exponent of k1, k2 and k3.")


class ExponentialPermeability(_MeasuredOverFraction):
    """Measured permeability k exp(-rate (v - fibre_volume_fraction))."""

    law: Literal["exponential"]
    rates: _Slopes = Field(description="Rate of k1, k2 and k3.")


class TablePermeability(_Measured):
    """Measured permeability from a CSV file, interpolated as a power between its rows."""

    law: Literal["table"]
    file: Annotated[str, FileName("permeability.csv")] = Field(
        description="CSV with the header `fibre volume fraction [%],k1 [m^2],k2 [m^2],k3 [m^2]`; "
        "relative to the scene file."
    )


Permeability = Annotated[
    GebartPermeability
    | KozenyCarmanPermeability
    | ConstantPermeability
    | PowerPermeability
    | ExponentialPermeability
    | TablePermeability,
    Field(discriminator="law"),
]


def _require_rising(limits: tuple[float, float]) -> None:
    if limits[1] <= limits[0]:
        raise wrong(
            f"is {limits[0]:g} to {limits[1]:g}, which does not rise",
            field="fibre_volume_fraction_range",
        )


# --- the resin: viscosity, cure, temperature ------------------------------------------------------


_Order = Annotated[float, Number(1.5, POSITIVE)]
_Autocatalytic = Annotated[float, Number(1.0, NOT_NEGATIVE)]
_Cure = Range(0.0, 1.0, open_ends=(1.0,))
_Gel = Range(0.0, 1.0, open_ends=(0.0,))


class KamalSourourCure(SceneModel):
    """Cure by two reactions, the second catalysed by its product, after Kamal and Sourour.

    The rate is k1 (1 - c)^order_1 + k2 c^autocatalytic_order (1 - c)^order for the cure c, with
    k = rate exp(-energy / (R T)).
    """

    law: Literal["kamal_sourour"]
    preset: Annotated[
        Literal["RTM6-Karkanas", "RTM6-Pantelelis", "RTM6-Hein"] | None, AbsentMeans("")
    ] = Field(default=None, description="Published fit whose values fill what is left out.")
    rate_1: PositiveRate = Field(description="Factor of the first reaction.")
    energy_1: ActivationEnergy = Field(description="Activation energy of the first reaction.")
    rate_2: PositiveRate = Field(description="Factor of the second reaction.")
    energy_2: ActivationEnergy = Field(description="Activation energy of the second reaction.")
    order: _Order = Field(description="Order n of what is left to react.")
    order_1: Annotated[_Order | None, AbsentMeans("order")] = Field(
        default=None, description="Order of what is left to react in the first reaction."
    )
    autocatalytic_order: _Autocatalytic = Field(description="Order m of the cure itself.")
    starts_by_itself: ClassVar[bool] = True

    @model_validator(mode="before")
    @classmethod
    def _fill_preset(cls, values: object) -> object:
        return filled(values, CURES)


class NthOrderCure(SceneModel):
    """Cure by one reaction of n-th order: rate exp(-energy / (R T)) (1 - c)^order."""

    law: Literal["nth_order"]
    rate: PositiveRate = Field(description="Factor of the reaction.")
    energy: ActivationEnergy = Field(description="Activation energy.")
    order: _Order = Field(description="Order n of what is left to react.")
    starts_by_itself: ClassVar[bool] = True


class AutocatalyticCure(SceneModel):
    """Cure by one reaction that its product catalyses.

    The rate is rate exp(-energy / (R T)) c^autocatalytic_order (1 - c)^order; it needs an initial
    cure.
    """

    law: Literal["autocatalytic"]
    rate: PositiveRate = Field(description="Factor of the reaction.")
    energy: ActivationEnergy = Field(description="Activation energy.")
    order: _Order = Field(description="Order n of what is left to react.")
    autocatalytic_order: _Order = Field(description="Order m of the cure itself.")
    starts_by_itself: ClassVar[bool] = False


Cure = Annotated[
    KamalSourourCure | NthOrderCure | AutocatalyticCure,
    Field(discriminator="law"),
]

_Temperatures = Annotated[tuple[Temperature, ...], Row('"60 80 degC"', minimum_count=1)]
_TemperatureOrSeveral = Annotated[
    tuple[Temperature, ...], Row('"60 80 degC"', minimum_count=1, one=True)
]
_Times = Annotated[tuple[TimeOrZero, ...], Row('"0 60 s"', minimum_count=2)]


class ConstantResinTemperature(SceneModel):
    """The same temperature everywhere and always."""

    law: Literal["constant"]
    value: Temperature = Field(description="Temperature of resin and preform.")


class PrescribedResinTemperature(SceneModel):
    """The same temperature everywhere, which changes over time."""

    law: Literal["prescribed"]
    times: _Times = Field(description="Times of the values.")
    values: _Temperatures = Field(
        description="Temperatures at the times, linear between, constant before and after."
    )

    @model_validator(mode="after")
    def _check_table(self) -> Self:
        require_times("values", self.values, self.times)
        return self


class MouldResinTemperature(SceneModel):
    """Resin that enters at one temperature and warms towards that of the mould.

    Without the heat of the reaction, conduction along the sheet, and cooling of the mould.
    """

    law: Literal["mould"]
    inlet: Temperature = Field(description="Temperature of the resin that enters.")
    mould: _TemperatureOrSeveral = Field(
        description="Temperature of the mould, or one for each of times."
    )
    times: Annotated[_Times | None, AbsentMeans("")] = Field(
        default=None, description="Times of the mould's temperatures, linear between them."
    )
    diffusivity: Diffusivity = Field(
        description="Thermal diffusivity through the thickness of the wet preform."
    )

    @model_validator(mode="after")
    def _check_table(self) -> Self:
        if self.times is None and len(self.mould) != 1:
            raise wrong(f"needs one value without times, but has {len(self.mould)}", field="mould")
        require_times("mould", self.mould, self.times)
        return self


ResinTemperature = Annotated[
    ConstantResinTemperature | PrescribedResinTemperature | MouldResinTemperature,
    Field(discriminator="law"),
]


class _Resin(SceneModel):
    """What the tables of all resins share."""

    density: Density = Field(
        default="1150 kg/m^3",  # type: ignore[assignment]
        description="Density of the liquid resin, for its mass and for gravity.",
    )
    gel_cure: Annotated[Annotated[float, Number(0.6, _Gel)] | None, AbsentMeans("never")] = Field(
        default=None, description="Gel point: cure from which the resin no longer flows."
    )
    initial_cure: Annotated[float, Number(0.01, _Cure)] = Field(
        default=0.0, description="Cure of the resin that enters."
    )
    cure: Annotated[Cure | None, AbsentMeans("none")] = Field(
        default=None, description="Rate of cure; without it the resin does not react."
    )
    temperature: Annotated[ResinTemperature | None, AbsentMeans("none needed")] = Field(
        default=None, description="Temperature, where viscosity or cure depend on it."
    )

    #: Whether the viscosity depends on the temperature.
    is_thermal: ClassVar[bool] = True

    @model_validator(mode="after")
    def _check_resin(self) -> Self:
        if self.temperature is None and (self.is_thermal or self.cure is not None):
            what = "the viscosity depends" if self.is_thermal else "the cure depends"
            raise wrong(
                f'is missing, but {what} on it; give temperature = {{ law = "constant", '
                'value = "60 degC" }',
                field="temperature",
            )
        if self.gel_cure is not None and self.initial_cure >= self.gel_cure:
            raise wrong(
                f"is {self.initial_cure:g}, not below the gel point {self.gel_cure:g}",
                field="initial_cure",
            )
        starts = self.cure is None or self.cure.starts_by_itself or self.initial_cure > 0.0
        if not starts:
            raise wrong(
                "is 0, from which an autocatalytic reaction never starts; give a small one such "
                "as 0.001",
                field="initial_cure",
            )
        return self

    def preset_values(self) -> dict[str, Any]:
        """Return the entries of presets as scene files give them, with the names of these."""
        return {"cure": published_values(CURES, getattr(self.cure, "preset", None))}


class ConstantViscosityResin(_Resin):
    """Resin of constant viscosity."""

    law: Literal["constant"]
    viscosity: Viscosity = Field(description="Viscosity.")
    is_thermal: ClassVar[bool] = False


class ArrheniusResin(_Resin):
    """Resin whose viscosity falls with the temperature.

    It is reference_viscosity exp(E/R (1/T - 1/T_reference)).
    """

    law: Literal["arrhenius"]
    reference_viscosity: Viscosity = Field(
        description="Viscosity at the reference temperature, or the factor of exp(E / (R T))."
    )
    reference_temperature: Annotated[Temperature | None, AbsentMeans("infinite")] = Field(
        default=None,
        description="Temperature of the reference viscosity, which without it is the factor of "
        "exp(E / (R T)).",
    )
    activation_energy: ActivationEnergy = Field(description="Activation energy E.")


class CastroMacoskoResin(ArrheniusResin):
    """Resin that thickens as it cures, after Castro and Macosko.

    The viscosity is that of "arrhenius" times (g / (g - c))^(exponent + exponent_slope c) for the
    cure c and the gel point g.
    """

    law: Literal["castro_macosko"]  # type: ignore[assignment]
    preset: Annotated[Literal["AroCy-L10"] | None, AbsentMeans("")] = Field(
        default=None, description="Published resin whose values fill what is left out."
    )
    gel_cure: Annotated[float, Number(0.6, _Gel)] = Field(
        description="Gel point: cure at which the viscosity grows without bound."
    )
    exponent: Annotated[float, Number(1.5, NOT_NEGATIVE)] = Field(
        description="Exponent at the start of the cure."
    )
    exponent_slope: Annotated[float, Number(1.0)] = Field(
        default=0.0, description="Change of the exponent over the cure."
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_preset(cls, values: object) -> object:
        return filled(values, VISCOSITIES)

    @model_validator(mode="after")
    def _check_exponents(self) -> Self:
        at_gel = self.exponent + self.exponent_slope * self.gel_cure
        if not (math.isfinite(at_gel) and at_gel > 0.0):
            raise wrong(
                f"gives an exponent of {at_gel:g} at the gel point; it must be positive there",
                field="exponent_slope",
            )
        return self

    def preset_values(self) -> dict[str, Any]:
        """Return the entries of presets as scene files give them, with the names of these."""
        return super().preset_values() | published_values(VISCOSITIES, self.preset)


Resin = Annotated[
    ConstantViscosityResin | ArrheniusResin | CastroMacoskoResin, Field(discriminator="law")
]
