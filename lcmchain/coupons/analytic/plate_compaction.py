"""Compaction of a fabric between plates: pressure over thickness, as law and as power law.

All quantities in SI units; the area between the plates stays constant.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def compaction_strain(stretch: ArrayLike) -> np.ndarray:
    """Return the Green-Lagrange strain E33 of a thickness stretch t/t0."""
    return 0.5 * (np.asarray(stretch) ** 2 - 1.0)


def compaction_pressure(stretch: ArrayLike, c0: float, c1: float, c2: float) -> np.ndarray:
    """Return the pressure p = λ|S33| [Pa] on the plates for the compaction law, Eq. (23).

    Zero for λ >= 1: an unloaded fabric does not pull on the plates.
    """
    stretch = np.asarray(stretch, dtype=float)
    strain = np.maximum(-compaction_strain(stretch), 0.0)
    return stretch * c0 * strain * np.exp(c1 * strain**c2)


def power_law_fibre_volume_fraction(pressure: ArrayLike, A: float, B: float) -> np.ndarray:
    """Return Φ = A (p / 1 kPa)^B of the experimental compaction law, Eq. (24); pressure in Pa."""
    return A * (np.asarray(pressure) / 1e3) ** B


def power_law_pressure(thickness: ArrayLike, A: float, B: float, solid_height: float) -> np.ndarray:
    """Return the pressure [Pa] of the experimental law, Eq. (24), at a thickness [m].

    ``solid_height`` is the height of the fibres without voids, areal mass / fibre density [m].
    """
    return 1e3 * (solid_height / (np.asarray(thickness) * A)) ** (1.0 / B)
