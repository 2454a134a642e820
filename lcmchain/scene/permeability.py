"""Scene tables of the permeability laws.

They stand here and not in the package with the laws: that package is built on the core, which holds
the scene and never imports what is built on it.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from lcmchain.quantities.entry_types import (
    POSITIVE,
    AbsentMeans,
    Angle,
    FibreRadius,
    FileName,
    Number,
    PermeabilityValue,
    Range,
    Row,
    SceneModel,
    wrong,
)

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
