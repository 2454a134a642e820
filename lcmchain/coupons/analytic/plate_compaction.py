"""Compaction of a fabric between plates: pressure over thickness, as law and as power law.

All quantities in SI units; the area between the plates stays constant.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq


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


def stretch_at_pressure(pressure: ArrayLike, c0: float, c1: float, c2: float) -> np.ndarray:
    """Return the thickness stretch t/t0 at which the law, Eq. (23), carries these pressures [Pa].

    The pressure of the law rises with compaction up to a largest value far beyond use (400 MPa at
    a stretch of 0.13 for MD600) and falls towards λ = 0, where it vanishes; the first branch is
    returned.

    Raises
    ------
    ValueError : negative pressure, or more than the law can carry.
    """
    pressure = np.asarray(pressure, dtype=float)
    grid = np.linspace(1.0, 0.02, 491)
    carried = compaction_pressure(grid, c0, c1, c2)
    top = int(np.argmax(carried))
    if pressure.min() < 0.0 or pressure.max() > carried[top]:
        raise ValueError(f"pressure must lie between 0 and {carried[top]:.3g} Pa")

    def stretch(p):
        upper = max(int(np.searchsorted(carried[: top + 1], p)), 1)
        return brentq(
            lambda s: float(compaction_pressure(s, c0, c1, c2)) - p,
            grid[upper], grid[upper - 1], xtol=1e-14,
        )  # fmt: skip

    return np.array([stretch(p) for p in pressure.ravel()]).reshape(pressure.shape)


def power_law_fibre_volume_fraction(pressure: ArrayLike, A: float, B: float) -> np.ndarray:
    """Return Φ = A (p / 1 kPa)^B of the experimental compaction law, Eq. (24); pressure in Pa."""
    return A * (np.asarray(pressure) / 1e3) ** B


def power_law_pressure(thickness: ArrayLike, A: float, B: float, solid_height: float) -> np.ndarray:
    """Return the pressure [Pa] of the experimental law, Eq. (24), at a thickness [m].

    ``solid_height`` is the height of the fibres without voids, areal mass / fibre density [m].
    """
    return 1e3 * (solid_height / (np.asarray(thickness) * A)) ** (1.0 / B)


def power_law_thickness(pressure: ArrayLike, A: float, B: float, solid_height: float) -> np.ndarray:
    """Return the thickness [m] of the experimental law, Eq. (24), under a pressure [Pa]."""
    return solid_height / power_law_fibre_volume_fraction(pressure, A, B)
