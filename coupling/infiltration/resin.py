"""The resin: its viscosity, and how it cures up to the gel point and beyond.

A resin is an object that answers to :class:`~lcmchain.coupling.infiltration.flow.medium.Resin`. The
filling asks it for viscosity and rate of cure and knows nothing of its law. Its temperature is in
:mod:`lcmchain.coupling.infiltration.resin_temperature`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcmchain.coupling.infiltration.flow.medium import Resin
from lcmchain.errors import InputError
from lcmchain.scene.infiltration import laws as tables

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
        """Return the cure after a step, see :func:`advance_cure`."""
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


# --- rate of cure ---------------------------------------------------------------------------------


#: Molar gas constant [J/(mol K)], exact since 2019.
GAS_CONSTANT = 8.31446261815324


@dataclass(frozen=True)
class KamalSourour:
    """Two reactions side by side, the second one catalysed by its own product.

    d(cure)/dt = k1 (1 - cure)^n1 + k2 cure^m (1 - cure)^n with k = rate exp(-E / (R T)).

    With n1 = n it is the form k1 + k2 cure^m of Kamal and Sourour, Polymer Engineering and Science
    13 (1973) 59; orders of their own for both reactions: Karkanas, Partridge, Attwood, Polymer
    International 41 (1996) 183. The first reaction alone is one of n-th order, the second alone
    an autocatalytic one, which never starts from a cure of zero.

    Parameters
    ----------
    rate_1, rate_2 : [1/s]; energy_1, energy_2 : activation energies [J/mol].
    autocatalytic_order : m; order : n; order_1 : n1, by default n.

    Raises
    ------
    InputError : a negative rate, energy or order, an order of 0 of 1 - cure, or no reaction at all.
    """

    rate_1: float = 0.0
    energy_1: float = 0.0
    rate_2: float = 0.0
    energy_2: float = 0.0
    autocatalytic_order: float = 1.0
    order: float = 1.0
    order_1: float | None = None

    def __post_init__(self) -> None:
        names = ("rate_1", "energy_1", "rate_2", "energy_2", "autocatalytic_order", "order")
        for name in names:
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise InputError(f"must not be negative, but is {value}", key=f"resin.cure.{name}")
        for name in ("order", "order_1"):
            value = getattr(self, name)
            # At order zero the rate would not vanish for the cured resin.
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise InputError(f"must be positive, but is {value}", key=f"resin.cure.{name}")
        if self.rate_1 == 0.0 and self.rate_2 == 0.0:
            raise InputError("has no reaction; leave the table out", key="resin.cure")

    @classmethod
    def nth_order(cls, rate: float, energy: float, order: float) -> KamalSourour:
        """One reaction of n-th order: rate exp(-energy / (R T)) (1 - cure)^order."""
        return cls(rate_1=rate, energy_1=energy, order=order)

    @classmethod
    def autocatalytic(
        cls, rate: float, energy: float, autocatalytic_order: float, order: float
    ) -> KamalSourour:
        """One autocatalytic reaction: rate exp(-energy / (R T)) cure^m (1 - cure)^order."""
        return cls(
            rate_2=rate, energy_2=energy, autocatalytic_order=autocatalytic_order, order=order
        )

    @property
    def starts_by_itself(self) -> bool:
        """Whether a resin of cure zero reacts."""
        return self.rate_1 > 0.0 or self.autocatalytic_order == 0.0

    def cure_rate(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        """Rate of cure [1/s] at temperature [K] and cure [1]."""
        cure = np.clip(cure, 0.0, 1.0)
        left = 1.0 - cure
        thermal = GAS_CONSTANT * np.asarray(temperature, dtype=float)
        first = self.order if self.order_1 is None else self.order_1
        rate = self.rate_1 * np.exp(-self.energy_1 / thermal) * left**first
        if self.rate_2 == 0.0:
            return rate
        second = self.rate_2 * np.exp(-self.energy_2 / thermal)
        return rate + second * cure**self.autocatalytic_order * left**self.order


# --- cure over a time step: bounded for any step, and as accurate as asked for --------------------


#: Largest error of the cure that one sub-step may make.
TOLERANCE = 1e-7

# What is left to react is taken as at least this, so that an order below one, whose rate has an
# infinite slope at the end of the reaction, needs no smaller steps there.
_LEAST_LEFT = 1e-12
# A sub-step is never shorter than this share of the whole step.
_SHORTEST = 1e-9
_SAFETY, _MOST_GROWTH, _MOST_CUT = 0.9, 5.0, 0.1


def advance_cure(
    cure_rate: Callable[[np.ndarray, np.ndarray], np.ndarray],
    cure: np.ndarray,
    temperature: np.ndarray,
    step: float,
    *,
    end_temperature: np.ndarray | None = None,
    tolerance: float = TOLERANCE,
) -> np.ndarray:
    """Return the cure after a step of resin that stays where it is.

    The equation is solved for b = -ln((1 - cure) / (1 - start)), which only grows and may be of any
    size: with stages and weights that are not negative the cure rises from its start and stays
    below one, whatever the step. Bogacki and Shampine's pair of orders 3 and 2 (Applied Mathematics
    Letters 2 (1989) 321) chooses the sub-steps of every place by itself: its cure does
    not depend on which others are computed beside it.

    Parameters
    ----------
    cure_rate : of arrays temperature [K] and cure [1], [1/s]; not negative.
    cure : 0 to 1, any shape; places that are not a number stay so.
    temperature, end_temperature : [K] at start and end of the step, of a shape that broadcasts to
        that of the cure, linear between; without the latter constant.
    step : [s], not negative.
    tolerance : largest error of the cure in a sub-step.

    Raises
    ------
    ValueError : a cure outside 0 to 1, or a negative step.
    """
    cure = np.asarray(cure, dtype=float)
    flat = cure.ravel()
    if not step >= 0.0:
        raise ValueError(f"a step of {step} s")
    if np.any((flat < 0.0) | (flat > 1.0)):
        raise ValueError("a cure outside 0 to 1")
    start = np.broadcast_to(temperature, cure.shape).ravel().astype(float)
    end = start if end_temperature is None else np.broadcast_to(end_temperature, cure.shape).ravel()
    result = flat.copy()
    active = np.flatnonzero(np.isfinite(flat) & np.isfinite(start) & np.isfinite(end))
    if step > 0.0 and active.size:
        march = _March(cure_rate, flat[active], start[active], (end - start)[active], step)
        result[active] = march.run(tolerance)
    return result.reshape(cure.shape)


class _March:
    """Sub-steps of many places, each with a step size of its own."""

    def __init__(self, cure_rate, cure, temperature, warming, step) -> None:
        self.cure_rate = cure_rate
        self.left, self.temperature, self.warming = 1.0 - cure, temperature, warming
        self.step = step
        self.grown = np.zeros(cure.shape)  # b
        self.done = np.zeros(cure.shape)  # share of the step, 0 to 1

    def run(self, tolerance: float) -> np.ndarray:
        """Return the cure at the end of the step."""
        size = np.ones(self.done.shape)
        rows = np.arange(self.done.size)
        while rows.size:
            share = np.minimum(size[rows], 1.0 - self.done[rows])
            grown, error = self._try(rows, share)
            with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
                factor = _SAFETY * np.cbrt(tolerance / error)
            factor = np.where(np.isfinite(factor), factor, _MOST_CUT)
            factor = np.where(error == 0.0, _MOST_GROWTH, np.clip(factor, _MOST_CUT, _MOST_GROWTH))
            taken = (error <= tolerance) | (share <= _SHORTEST)
            good = rows[taken]
            self.grown[good] = grown[taken]
            last = share[taken] >= 1.0 - self.done[good]
            self.done[good] = np.where(last, 1.0, self.done[good] + share[taken])
            size[rows] = np.maximum(share * factor, _SHORTEST)
            rows = rows[self.done[rows] < 1.0]
        return np.minimum(1.0 - self.left * np.exp(-self.grown), 1.0)

    def _try(self, rows: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return b after a sub-step and the error of the cure there."""
        time = share * self.step
        done, grown = self.done[rows], self.grown[rows]
        first = self._growth(rows, done, grown)
        second = self._growth(rows, done + 0.5 * share, grown + 0.5 * time * first)
        third = self._growth(rows, done + 0.75 * share, grown + 0.75 * time * second)
        end = grown + time * (2.0 * first + 3.0 * second + 4.0 * third) / 9.0
        last = self._growth(rows, done + share, end)
        difference = (-5.0 * first + 6.0 * second + 8.0 * third - 9.0 * last) / 72.0
        # An error of b counts by what it changes of the cure, over the whole sub-step.
        return end, np.abs(time * difference) * self.left[rows] * np.exp(-grown)

    def _growth(self, rows: np.ndarray, done: np.ndarray, grown: np.ndarray) -> np.ndarray:
        """Return the rate of b [1/s]."""
        left = np.maximum(self.left[rows] * np.exp(-grown), _LEAST_LEFT)
        temperature = self.temperature[rows] + done * self.warming[rows]
        return self.cure_rate(temperature, 1.0 - left) / left


# --- from a scene's table -------------------------------------------------------------------------


def resin_of(table: tables.Resin) -> Resin:
    """Return the laws of viscosity and cure that a resin's table of a scene names."""
    return _VISCOSITIES[table.law](table, _shared(table))


def _shared(table: tables.Resin) -> dict[str, Any]:
    """Return the entries that all resins have, as keywords of their laws."""
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


_VISCOSITIES: dict[str, Callable[..., Resin]] = {
    "constant": _constant,
    "arrhenius": _arrhenius,
    "castro_macosko": _castro_macosko,
}
_CURES: dict[str, Callable[..., KamalSourour]] = {
    "kamal_sourour": _kamal_sourour,
    "nth_order": _nth_order,
    "autocatalytic": _autocatalytic,
}
