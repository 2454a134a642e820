"""Scene tables of what a fabric loses to rates, and to friction of its bending.

They are ``[material.viscous]``, and of ``[material.bending]`` the entries ``friction_1``,
``friction_2``, ``viscous_1`` and ``viscous_2``.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from lcmchain.materials.features.bending_losses import BendingLosses, DirectionLosses
from lcmchain.materials.features.relaxation import CompactionRelaxation
from lcmchain.materials.features.rheology import Friction, Relaxation
from lcmchain.materials.features.temperature_field import TemperatureField, arrhenius_factor
from lcmchain.materials.features.viscous_shear import ViscousShear
from lcmchain.quantities.entry_types import (
    POSITIVE,
    AbsentMeans,
    ActivationEnergy,
    Length,
    Number,
    PositiveCurvature,
    PositiveForce,
    PositiveStiffness,
    PositiveTime,
    Range,
    Row,
    SceneModel,
    Temperature,
    Viscosity,
    wrong,
)


class MaxwellTable(SceneModel):
    """A Maxwell element: a spring and a dashpot in series, beside the fabric's own shear law."""

    modulus: PositiveStiffness = Field(description="Modulus G against the shear angle.")
    relaxation_time: PositiveTime = Field(description="Time l in which a stress falls to 1/e.")


class RelaxingCompactionTable(SceneModel):
    """A part of the compaction that relaxes: a share of the law of compaction, and its time."""

    share: Annotated[float, Number(0.4, POSITIVE)] = Field(
        description="Pressure that relaxes over the pressure that stays, of a gap closed at once."
    )
    relaxation_time: PositiveTime = Field(description="Time l in which it falls to 1/e.")


class CrossTable(SceneModel):
    """Viscosity that falls with the rate: η∞ + (η0 - η∞)/(1 + (M rate)^(1 - N))."""

    time_constant: PositiveTime = Field(description="M: one over the rate at which it falls.")
    exponent: Annotated[float, Number(0.4, Range(0.0, 1.0, (1.0,)))] = Field(
        description="N: 0 falls as one over the rate, towards 1 ever less."
    )
    infinite_viscosity: Annotated[Viscosity | None, AbsentMeans("0")] = Field(
        default=None, description="Viscosity η∞ at very high rates."
    )


class TemperatureFieldTable(SceneModel):
    """Temperature on a grid in the coordinates of the undeformed blank, kept for the run."""

    x: Annotated[tuple[Length, ...], Row('"-100 0 100 mm"', minimum_count=1)] = Field(
        description="Coordinates x of the grid, rising."
    )
    y: Annotated[tuple[Length, ...], Row('"-100 100 mm"')] = Field(
        default=(), description="Coordinates y of the grid, rising; none: the same at any y."
    )
    temperature: Annotated[
        tuple[Temperature, ...], Row('["280 degC", "285 degC", "290 degC"]', units=False)
    ] = Field(description="Temperature at every x of the first y, then of the next one.")

    @property
    def row_count(self) -> int:
        """How many rows of temperatures there are, one for each y."""
        return max(len(self.y), 1)

    @model_validator(mode="after")
    def _check_grid(self) -> Self:
        for name, values in (("x", self.x), ("y", self.y)):
            if any(after <= before for before, after in itertools.pairwise(values)):
                raise wrong("must rise from one point to the next", field=name)
        wanted = len(self.x) * self.row_count
        if len(self.temperature) != wanted:
            raise wrong(
                f"has {len(self.temperature)} values for a grid of {len(self.x)} times "
                f"{self.row_count} points; give {wanted}",
                field="temperature",
            )
        return self


class RateTable(SceneModel):
    """What resists a rate: a dashpot, and Maxwell elements beside it, at a temperature."""

    viscosity: Annotated[Viscosity | None, AbsentMeans("no dashpot")] = Field(
        default=None, description="Viscosity η of the dashpot, with cross that at rest, η0."
    )
    maxwell: Annotated[
        tuple[MaxwellTable, ...],
        Row(
            '[{ modulus = "0.05 MPa", relaxation_time = "0.2 s" }]',
            maximum_count=8,
            entries="Maxwell elements",
            units=False,
        ),
    ] = Field(default=(), description="Maxwell elements, whose stress relaxes.")
    temperature: Annotated[Temperature | None, AbsentMeans("reference_temperature")] = Field(
        default=None, description="Temperature of the fabric while it is formed."
    )
    reference_temperature: Annotated[Temperature | None, AbsentMeans("none needed")] = Field(
        default=None, description="Temperature at which viscosities and times were measured."
    )
    activation_energy: Annotated[ActivationEnergy | None, AbsentMeans("none needed")] = Field(
        default=None, description="Energy E of exp(E/R (1/T - 1/T_reference)), on all times."
    )

    @model_validator(mode="after")
    def _check_entries(self) -> Self:
        if self._is_empty:
            raise wrong(self._needs)
        given: dict[str, Any] = {
            name: getattr(self, name)
            for name in (self._own_temperature, "reference_temperature", "activation_energy")
        }
        missing = [name for name, value in given.items() if value is None]
        if 0 < len(missing) < len(given):
            there = next(name for name, value in given.items() if value is not None)
            raise wrong(f"is needed together with {there}", field=missing[0])
        return self

    @property
    def resists(self) -> bool:
        """Whether it resists the rate, be it by a dashpot or by Maxwell elements."""
        return self.viscosity is not None or bool(self.maxwell)

    @property
    def _is_empty(self) -> bool:
        return not self.resists

    @property
    def _needs(self) -> str:
        return (
            'needs a viscosity, as viscosity = "1000 Pa*s", or Maxwell elements, as maxwell = '
            '[{ modulus = "0.05 MPa", relaxation_time = "0.2 s" }]'
        )

    @property
    def _own_temperature(self) -> str:
        """The entry that says how warm the fabric is."""
        return "temperature"

    @property
    def time_factor(self) -> float:
        """Factor on viscosities and times at the temperature of the fabric."""
        if self.temperature is None:
            return 1.0
        assert self.reference_temperature is not None and self.activation_energy is not None
        return arrhenius_factor(
            self.temperature, self.reference_temperature, self.activation_energy
        )

    @property
    def viscous(self) -> ViscousShear | None:
        """What resists the rate at the temperature of the fabric, in SI; None for nothing."""
        return None if not self.resists else self._at_reference().shifted(self.time_factor)

    def _at_reference(self) -> ViscousShear:
        return ViscousShear(
            viscosity=self.viscosity or 0.0,
            terms=tuple(
                Relaxation(element.modulus, element.relaxation_time) for element in self.maxwell
            ),
        )


class ViscousTable(RateTable):
    """What resists the rate of the shear, a dashpot and Maxwell elements, and what relaxes."""

    cross: Annotated[CrossTable | None, AbsentMeans("the viscosity is constant")] = Field(
        default=None, description="How the viscosity falls with the rate (Cross)."
    )
    compaction: Annotated[
        tuple[RelaxingCompactionTable, ...],
        Row(
            '[{ share = 0.4, relaxation_time = "5 s" }]',
            maximum_count=8,
            entries="relaxing parts",
            units=False,
        ),
    ] = Field(default=(), description="Parts of the compaction that relax.")
    temperature_field: Annotated[
        TemperatureFieldTable | None, AbsentMeans("one temperature for the sheet")
    ] = Field(default=None, description="Temperature over the blank, in place of one value.")

    @model_validator(mode="after")
    def _check_temperature(self) -> Self:
        if self.temperature is not None and self.temperature_field is not None:
            raise wrong("cannot stand beside temperature; leave one out", field="temperature_field")
        return self

    @model_validator(mode="after")
    def _check_cross(self) -> Self:
        if self.cross is None:
            return self
        if self.viscosity is None:
            raise wrong("is needed with cross: the viscosity at rest", field="viscosity")
        least = self.cross.infinite_viscosity or 0.0
        if least > self.viscosity:
            raise wrong(
                f"is {least:g} Pa*s, more than the viscosity at rest of {self.viscosity:g} "
                "Pa*s; it bounds the step, and must be the largest",
                field="cross.infinite_viscosity",
            )
        return self

    @property
    def _is_empty(self) -> bool:
        return not (self.resists or self.compaction)

    @property
    def _needs(self) -> str:
        return f"{super()._needs}, or relaxing compaction"

    @property
    def _own_temperature(self) -> str:
        return "temperature" if self.temperature_field is None else "temperature_field"

    @property
    def field(self) -> TemperatureField | None:
        """Temperature over the blank, None where it is one."""
        grid = self.temperature_field
        if grid is None:
            return None
        assert self.reference_temperature is not None and self.activation_energy is not None
        width = len(grid.x)
        rows = tuple(grid.temperature[k * width : (k + 1) * width] for k in range(grid.row_count))
        return TemperatureField(
            grid.x, grid.y or (0.0,), rows, self.reference_temperature, self.activation_energy
        )

    def without_shear(self) -> Self:
        """Return what relaxes of the compaction alone."""
        return self.model_copy(update={"viscosity": None, "cross": None, "maxwell": ()})

    @property
    def relaxation(self) -> CompactionRelaxation | None:
        """What relaxes of the compaction, at the temperature of the fabric."""
        if not self.compaction:
            return None
        terms = tuple(Relaxation(part.share, part.relaxation_time) for part in self.compaction)
        return CompactionRelaxation(terms).shifted(self.time_factor)

    def _at_reference(self) -> ViscousShear:
        shear = super()._at_reference()
        if self.cross is None:
            return shear
        return replace(
            shear,
            infinite_viscosity=self.cross.infinite_viscosity or 0.0,
            time_constant=self.cross.time_constant,
            exponent=self.cross.exponent,
        )


# --- bending --------------------------------------------------------------------------------------


class BendingFrictionTable(SceneModel):
    """Friction between bent fibres (Dahl): what is bent back follows another path."""

    moment: PositiveForce = Field(
        description="Limit of the friction's moment per width [N m/m]: half the width of a loop of "
        "moment over curvature, Kawabata's HB."
    )
    curvature: PositiveCurvature = Field(
        description="Curvature over which the friction comes to 63 % of its limit."
    )

    @property
    def friction(self) -> Friction:
        return Friction(self.moment, self.curvature)


class BendingRateTable(RateTable):
    """What resists the rate of bending: a dashpot, and Maxwell elements beside it.

    Moduli and viscosities are of the same kind as the bending stiffness C11.
    """


def bending_losses(
    frictions: tuple[BendingFrictionTable | None, BendingFrictionTable | None],
    rates: tuple[BendingRateTable | None, BendingRateTable | None],
    thickness: float,
) -> BendingLosses | None:
    """Return what a fabric of a thickness [m] loses along its fibres 1 and 2; None for nothing."""
    if not any(frictions) and not any(rates):
        return None
    inertia = thickness**3 / 12.0
    first, second = (
        _of_direction(friction, rate, inertia)
        for friction, rate in zip(frictions, rates, strict=True)
    )
    return BendingLosses((first, second), thickness)


def _of_direction(
    friction: BendingFrictionTable | None, rate: BendingRateTable | None, inertia: float
) -> DirectionLosses:
    viscous = None if rate is None else rate.viscous
    return DirectionLosses(
        friction=None if friction is None else friction.friction,
        viscosity=0.0 if viscous is None else viscous.viscosity * inertia,
        terms=()
        if viscous is None
        else tuple(Relaxation(term.modulus * inertia, term.time) for term in viscous.terms),
    )
