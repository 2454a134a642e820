"""Rate of cure of a thermoset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcmchain.errors import InputError

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
