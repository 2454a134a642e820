"""What a filling asks of a resin."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Resin(Protocol):
    """A liquid of constant density whose viscosity depends on temperature and cure.

    All methods take arrays of one shape, or shapes that broadcast, and return that shape.
    """

    @property
    def density(self) -> float:
        """Density [kg/m3]."""

    @property
    def gel_cure(self) -> float:
        """Cure from which the resin no longer flows; infinite for one that never gels."""

    @property
    def initial_cure(self) -> float:
        """Cure of the resin that enters."""

    @property
    def reacts(self) -> bool:
        """Whether the resin cures at all; if not, nothing of its cure needs to be computed."""

    @property
    def depends_on_temperature(self) -> bool:
        """Whether viscosity or cure depend on the temperature."""

    def viscosity(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        """Viscosity [Pa s] at temperature [K] and cure [1]; infinite from the gel point on."""

    def cure_rate(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        """Rate of cure [1/s]; not negative, and zero for the cured resin."""

    def advance_cure(
        self,
        cure: np.ndarray,
        temperature: np.ndarray,
        step: float,
        end_temperature: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the cure after a step [s] of resin that stays where it is."""
