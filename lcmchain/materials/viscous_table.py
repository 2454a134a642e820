"""Scene table of what depends on a rate, shear and compaction: ``[material.viscous]``."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from lcmchain.materials.relaxation import CompactionRelaxation
from lcmchain.materials.viscous_shear import Relaxation, ViscousShear, arrhenius_factor
from lcmchain.quantities.entry_types import (
    POSITIVE,
    AbsentMeans,
    ActivationEnergy,
    Number,
    PositiveStiffness,
    PositiveTime,
    Range,
    Row,
    Temperature,
    Viscosity,
    wrong,
)
from lcmchain.quantities.scene_model import SceneModel


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


class ViscousTable(SceneModel):
    """What resists the rate of the shear, a dashpot and Maxwell elements, and what relaxes."""

    viscosity: Annotated[Viscosity | None, AbsentMeans("no dashpot")] = Field(
        default=None, description="Viscosity η of the dashpot, with cross that at rest, η0."
    )
    cross: Annotated[CrossTable | None, AbsentMeans("the viscosity is constant")] = Field(
        default=None, description="How the viscosity falls with the rate (Cross)."
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
    compaction: Annotated[
        tuple[RelaxingCompactionTable, ...],
        Row(
            '[{ share = 0.4, relaxation_time = "5 s" }]',
            maximum_count=8,
            entries="relaxing parts",
            units=False,
        ),
    ] = Field(default=(), description="Parts of the compaction that relax.")
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
        if not (self.resists_shear or self.compaction):
            raise wrong(
                'needs a viscosity, as viscosity = "1000 Pa*s", or Maxwell elements, as maxwell = '
                '[{ modulus = "0.05 MPa", relaxation_time = "0.2 s" }], or relaxing compaction'
            )
        if self.cross is not None:
            if self.viscosity is None:
                raise wrong("is needed with cross: the viscosity at rest", field="viscosity")
            least = self.cross.infinite_viscosity or 0.0
            if least > self.viscosity:
                raise wrong(
                    f"is {least:g} Pa*s, more than the viscosity at rest of {self.viscosity:g} "
                    "Pa*s; it bounds the step, and must be the largest",
                    field="cross.infinite_viscosity",
                )
        given: dict[str, Any] = {
            name: getattr(self, name)
            for name in ("temperature", "reference_temperature", "activation_energy")
        }
        missing = [name for name, value in given.items() if value is None]
        if 0 < len(missing) < len(given):
            there = next(name for name, value in given.items() if value is not None)
            raise wrong(f"is needed together with {there}", field=missing[0])
        return self

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
    def resists_shear(self) -> bool:
        """Whether it resists the rate of the shear."""
        return self.viscosity is not None or bool(self.maxwell)

    def without_shear(self) -> Self:
        """Return what relaxes of the compaction alone."""
        return self.model_copy(update={"viscosity": None, "cross": None, "maxwell": ()})

    @property
    def relaxation(self) -> CompactionRelaxation | None:
        """What relaxes of the compaction, at the temperature of the fabric."""
        if not self.compaction:
            return None
        terms = tuple(Relaxation(own.share, own.relaxation_time) for own in self.compaction)
        return CompactionRelaxation(terms).shifted(self.time_factor)

    @property
    def viscous(self) -> ViscousShear | None:
        """What resists the shear at the temperature of the fabric, in SI."""
        if not self.resists_shear:
            return None
        cross = self.cross
        at_reference = ViscousShear(
            viscosity=self.viscosity or 0.0,
            infinite_viscosity=0.0 if cross is None else cross.infinite_viscosity or 0.0,
            time_constant=0.0 if cross is None else cross.time_constant,
            exponent=0.0 if cross is None else cross.exponent,
            terms=tuple(Relaxation(own.modulus, own.relaxation_time) for own in self.maxwell),
        )
        return at_reference.shifted(self.time_factor)
