"""Viscosity of a resin: constant, with the temperature, with temperature and cure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcmchain.coupling.infiltration.resin.cure import advance_cure
from lcmchain.coupling.infiltration.resin.kinetics import GAS_CONSTANT, KamalSourour
from lcmchain.errors import InputError

#: Density of an uncured epoxy resin [kg/m3], where none is given.
USUAL_DENSITY = 1150.0


@dataclass(frozen=True, kw_only=True)
class _Thermoset:
    """What all resins share: density, cure and gel point.

    Parameters
    ----------
    density : [kg/m3].
    kinetics : rate of cure; None for a resin that does not cure.
    gel_cure : cure from which the resin no longer flows; infinite for one that never gels.
    initial_cure : cure of the resin that enters.

    Raises
    ------
    InputError : a value out of range, or a reaction that never starts from the initial cure.
    """

    density: float = USUAL_DENSITY
    kinetics: KamalSourour | None = None
    gel_cure: float = np.inf
    initial_cure: float = 0.0

    def __post_init__(self) -> None:
        _require_positive("density", self.density)
        if not self.gel_cure > 0.0:
            raise InputError(f"must be positive, but is {self.gel_cure}", key="resin.gel_cure")
        if not 0.0 <= self.initial_cure < min(self.gel_cure, 1.0):
            raise InputError(
                f"must be at least 0 and below the gel point and 1, but is {self.initial_cure}",
                key="resin.initial_cure",
            )
        if self.initial_cure == 0.0 and self.kinetics and not self.kinetics.starts_by_itself:
            raise InputError(
                "is 0, from which an autocatalytic reaction never starts; give a small cure such "
                "as 0.001, or a first reaction",
                key="resin.initial_cure",
            )

    @property
    def reacts(self) -> bool:
        """Whether the resin cures."""
        return self.kinetics is not None

    def cure_rate(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        """Rate of cure [1/s] at temperature [K] and cure [1]."""
        if self.kinetics is None:
            return np.zeros(np.broadcast_shapes(np.shape(temperature), np.shape(cure)))
        return self.kinetics.cure_rate(temperature, cure)

    def advance_cure(
        self,
        cure: np.ndarray,
        temperature: np.ndarray,
        step: float,
        end_temperature: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the cure after a step, see :func:`~.cure.advance_cure`."""
        if self.kinetics is None:
            return np.array(cure, dtype=float)
        return advance_cure(
            self.kinetics.cure_rate, cure, temperature, step, end_temperature=end_temperature
        )

    def _unless_gelled(self, viscosity: np.ndarray, cure: np.ndarray) -> np.ndarray:
        shape = np.broadcast_shapes(np.shape(viscosity), np.shape(cure))
        return np.where(
            np.asarray(cure) >= self.gel_cure, np.inf, np.broadcast_to(viscosity, shape)
        )


@dataclass(frozen=True)
class ConstantViscosity(_Thermoset):
    """A resin of constant viscosity ``value`` [Pa s], up to the gel point where it has one."""

    value: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("viscosity", self.value)

    @property
    def depends_on_temperature(self) -> bool:
        """Whether anything depends on the temperature: the cure may."""
        return self.reacts

    def viscosity(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        """Viscosity [Pa s], infinite from the gel point on."""
        shape = np.broadcast_shapes(np.shape(temperature), np.shape(cure))
        return self._unless_gelled(np.full(shape, self.value), cure)


@dataclass(frozen=True)
class ArrheniusViscosity(_Thermoset):
    """Viscosity that falls with the temperature: mu = reference exp(E/R (1/T - 1/T_reference)).

    Source: E. N. da C. Andrade, Nature 125 (1930) 309.

    Parameters
    ----------
    reference_viscosity : [Pa s] at the reference temperature.
    activation_energy : E [J/mol].
    reference_temperature : [K]; infinite where the factor before exp(E / (R T)) is given.
    """

    reference_viscosity: float
    activation_energy: float
    reference_temperature: float = np.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("reference_viscosity", self.reference_viscosity)
        if not (np.isfinite(self.activation_energy) and self.activation_energy >= 0.0):
            raise InputError(
                f"must not be negative, but is {self.activation_energy}",
                key="resin.activation_energy",
            )
        if not self.reference_temperature > 0.0:
            raise InputError(
                f"must be positive, but is {self.reference_temperature} K",
                key="resin.reference_temperature",
            )

    @property
    def depends_on_temperature(self) -> bool:
        """Whether anything depends on the temperature."""
        return True

    def uncured_viscosity(self, temperature: np.ndarray) -> np.ndarray:
        """Viscosity [Pa s] at a cure of zero."""
        inverse = 1.0 / np.asarray(temperature, dtype=float) - 1.0 / self.reference_temperature
        return self.reference_viscosity * np.exp(self.activation_energy / GAS_CONSTANT * inverse)

    def viscosity(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        """Viscosity [Pa s], infinite from the gel point on."""
        return self._unless_gelled(self.uncured_viscosity(temperature), cure)


@dataclass(frozen=True, kw_only=True)
class CastroMacoskoViscosity(ArrheniusViscosity):
    """Viscosity that falls with the temperature and grows without bound towards the gel point.

    mu = mu0(T) (gel_cure / (gel_cure - cure))^(exponent + exponent_slope cure), with mu0 as
    :class:`ArrheniusViscosity`.

    Source: J. M. Castro, C. W. Macosko, AIChE Journal 28 (1982) 250.

    Raises
    ------
    InputError : no finite gel point, or exponents with which the viscosity would not grow without
        bound there.
    """

    exponent: float
    exponent_slope: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.gel_cure <= 1.0:
            raise InputError("is missing, or above 1; give the gel point", key="resin.gel_cure")
        at_gel = self.exponent + self.exponent_slope * self.gel_cure
        if not (np.isfinite(at_gel) and at_gel > 0.0 and self.exponent >= 0.0):
            raise InputError(
                f"gives the exponent {self.exponent:g} at the start and {at_gel:g} at the gel "
                "point; it must be positive there and must not be negative before",
                key="resin.exponent",
            )

    def viscosity(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        """Viscosity [Pa s], infinite from the gel point on."""
        cure = np.asarray(cure, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            # Past the gel point the expression has no meaning; it is replaced below.
            remaining = np.maximum(self.gel_cure - cure, 0.0) / self.gel_cure
            growth = remaining ** -(self.exponent + self.exponent_slope * cure)
            value = self.uncured_viscosity(temperature) * growth
        return self._unless_gelled(value, cure)


def _require_positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"must be positive, but is {value}", key=f"resin.{name}")
