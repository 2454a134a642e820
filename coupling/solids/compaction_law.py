"""Compaction of many cells by the law of their material: pressure, stiffness, and thickness.

After Terzaghi, fibres and fluid of a cell bear its total pressure, P = sigma(h) + p. The law is
that of the forming (``Material.compaction_pressure``), plate to plate, per area of the reference: a
cell whose mid-surface has shrunk to A bears lambda |S33| A0 / A.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from lcmchain.errors import InputError, SimulationError
from lcmchain.jit import routine
from lcmchain.materials.features.shear_compaction import free_stretch
from lcmchain.materials.law import (
    Material,
    evolved_history,
    history_count,
    load_history,
    store_history,
)

# Thickness stretches at which the largest pressure of the law is searched.
GRID = np.linspace(1.0, 0.05, 96)
# Number of shear strains of that search, where each cell has its own shear.
SHEAR_SAMPLES = 33
# Step of the stretch for the derivative of the law; its error is 1e-9 of the derivative.
DIFFERENCE = 1e-6
MOST_ITERATIONS = 100
#: Largest change by the last step of an iteration, relative to the thickness.
ROUND_OFF = 16.0 * float(np.finfo(float).eps)


class CompactionLaw(Protocol):
    """Compaction law of the textile of C cells: of one sheet, or of plies on each other.

    thickness : of the undeformed textile (C,) [m].
    history : memory of the law, an array.
    """

    thickness: np.ndarray
    history: np.ndarray

    def pressure(self, thickness: np.ndarray) -> np.ndarray:
        """Return the pressure that the fibres bear (C,) [Pa]; negative where they are pulled."""

    def stiffness(self, thickness: np.ndarray) -> np.ndarray:
        """Return minus the derivative of the pressure by the thickness (C,) [Pa/m], positive."""

    def thickness_under(self, pressure: np.ndarray) -> np.ndarray:
        """Return the thickness at which the fibres bear a pressure (C,) [m]."""

    def remember(self, thickness: np.ndarray) -> None:
        """Move the history on to the end of a step that leads to a thickness (C,) [m]."""

    def least_gap(self, offset: np.ndarray | float) -> float:
        """Return the least gap [m] for cells thicker by ``offset`` (C,): below, no law bears it."""


class CellCompaction:
    """Compaction law of C cells of one material.

    A cell that is thicker than free resists with its initial stiffness under pressure, as the
    elements of the forming do. The fluid that lifts it bears this resistance.

    Parameters
    ----------
    material : see :class:`lcmchain.materials.law.Material`.
    thickness : of the unpressed sheet in each cell (C,) [m].
    area_stretch : present over undeformed area of the mid-surface (C,) or one number.
    history : memory of the law (numbers, C); by default that of a virgin textile.
    shear : strain g = sin γ of each cell (C,), of a law that depends on thickness and shear; None
        where ``thickness`` and ``area_stretch`` include the effect of the shear.

    Raises
    ------
    InputError : a thickness or an area that is not positive.
    """

    def __init__(
        self,
        material: Material,
        thickness: np.ndarray,
        area_stretch: np.ndarray | float = 1.0,
        history: np.ndarray | None = None,
        shear: np.ndarray | None = None,
    ) -> None:
        self.material = material
        self.shear = shear
        #: Thickness of the free sheared sheet over that of the unsheared one.
        self._sheared: np.ndarray | float = 1.0
        if shear is not None:
            self._sheared = free_stretch(material, shear)
        self.thickness = np.array(thickness, dtype=float)
        self.area_stretch = np.array(np.broadcast_to(area_stretch, self.thickness.shape))
        for name, values in (("thickness", self.thickness), ("area_stretch", self.area_stretch)):
            wrong = np.flatnonzero(~(values > 0.0))
            if wrong.size:
                raise InputError(f"{name} of cell {wrong[0]} is {values[wrong[0]]:.6g}")
        count = history_count(material.law)
        shape = (count, self.thickness.size)
        self.history = np.zeros(shape) if history is None else np.array(history, dtype=float)
        if self.history.shape != shape:
            raise InputError(f"the history has the shape {self.history.shape}, not {shape}")
        self._lift = self._free_stiffness() / self.area_stretch
        self._thinnest = self._thinnest_stretch()
        #: A history, and the free stretch that belongs to it.
        self._free: tuple[np.ndarray, np.ndarray] | None = None

    def _free_stiffness(self) -> np.ndarray | float:
        """Return minus the derivative of :meth:`_law` by the stretch where nothing presses."""
        strain = np.zeros(6)
        if self.shear is not None:
            strain = np.zeros((len(self.shear), 6))
            # just above free: below, rounding may make it pressed, and unloading from a set
            free = 0.5 * (self._sheared**2 * (1.0 + ROUND_OFF) - 1.0)
            strain[..., 2], strain[..., 3] = free, self.shear
        stiffness: np.ndarray = self.material.stress_and_tangent(strain)[1][..., 2, 2]
        return stiffness * self._sheared**4

    def _thinnest_stretch(self) -> float:
        """Return the stretch at which the law gives its largest pressure, at the worst shear."""
        if self.shear is None:
            return float(GRID[int(np.argmax(self.material.compaction_pressure(GRID)))])
        samples = np.linspace(0.0, float(np.max(np.abs(self.shear), initial=0.0)), SHEAR_SAMPLES)
        free = free_stretch(self.material, samples)
        with np.errstate(invalid="ignore"):  # thinner than any strain of the law
            carried = self._at_shear(
                GRID[:, None] * free, None, np.broadcast_to(samples, (len(GRID), len(samples)))
            )
        largest = np.argmax(np.nan_to_num(carried, nan=-np.inf), axis=0)
        return float(GRID[largest].max())

    @property
    def thinnest(self) -> np.ndarray:
        """Thickness (C,) [m] at which the law gives its largest pressure."""
        return self._thinnest * self.thickness

    def least_gap(self, offset: np.ndarray | float) -> float:
        """Return minus infinity: the law gives a pressure at any thickness."""
        return -np.inf

    @property
    def free_stretch(self) -> np.ndarray:
        """Return the stretch without pressure (C,): 1, or less after a permanent set."""
        low = np.full(self.thickness.shape, self._thinnest)
        high = np.ones_like(low)
        if not len(self.history):
            return high
        if self._free is None or not np.array_equal(self._free[0], self.history):
            for _ in range(60):
                middle = 0.5 * (low + high)
                pressed = self._law(middle) > 0.0
                low, high = np.where(pressed, middle, low), np.where(pressed, high, middle)
            self._free = self.history.copy(), high
        return self._free[1]

    def pressure(self, thickness: np.ndarray) -> np.ndarray:
        """Return the pressure that the fibres bear (C,) [Pa]; negative where they are pulled."""
        stretch = thickness / self.thickness
        return self._pressure(stretch, self.free_stretch)

    def stiffness(self, thickness: np.ndarray) -> np.ndarray:
        """Return minus the derivative of the pressure by the thickness (C,) [Pa/m], positive."""
        stretch = thickness / self.thickness
        return -self._slope(stretch, self.free_stretch) / self.thickness

    def thickness_under(self, pressure: np.ndarray) -> np.ndarray:
        """Return the thickness at which the fibres bear a pressure (C,) [m].

        Raises
        ------
        SimulationError : more than the law can bear at any thickness.
        """
        free = self.free_stretch
        low, high = (
            np.full_like(free, self._thinnest),
            free - np.minimum(pressure, 0.0) / self._lift,
        )
        lacking = self._pressure(low, free) < pressure
        if lacking.any():
            cell = int(np.flatnonzero(lacking)[0])
            raise SimulationError(
                f"the fibres of cell {cell} would have to bear {pressure[cell]:.4g} Pa, more than "
                f"the law of {self.material.name} gives at any thickness"
            )
        stretch = high
        for _ in range(MOST_ITERATIONS):
            excess = self._pressure(stretch, free) - pressure
            low, high = (
                np.where(excess >= 0.0, stretch, low),
                np.where(excess <= 0.0, stretch, high),
            )
            better = stretch - excess / self._slope(stretch, free)
            # a last step within round-off may leave the bounds; then they need not be halved
            found = np.abs(better - stretch) <= ROUND_OFF * stretch
            inside = (better > low) & (better < high)
            better = np.where(inside, better, 0.5 * (low + high))
            stretch = np.where(found, stretch, better)
            if np.all(found | (high - low <= ROUND_OFF)):
                break
        return stretch * self.thickness

    def remember(self, thickness: np.ndarray) -> None:
        """Move the history on to the end of a step that leads to a thickness (C,) [m]."""
        if len(self.history):
            strain = 0.5 * ((self._sheared * thickness / self.thickness) ** 2 - 1.0)
            shear = np.zeros_like(strain) if self.shear is None else self.shear
            flat = np.ascontiguousarray(self.history).ravel()
            _remember(self.material.law, strain, shear, flat)
            self.history = flat.reshape(self.history.shape)

    def _law(self, stretch: np.ndarray) -> np.ndarray:
        past = self.history if len(self.history) else None
        if self.shear is None:
            return self.material.compaction_pressure(stretch, past)
        # as a sheet of the free thickness, on an area that is larger by the same factor
        return self._sheared * self._at_shear(self._sheared * stretch, past, self.shear)

    def _at_shear(
        self, stretch: np.ndarray, past: np.ndarray | None, shear: np.ndarray
    ) -> np.ndarray:
        """Return the pressure of a law of thickness and shear on the area at the start."""
        law: Any = self.material  # a fabric: only these have such laws
        pressure: np.ndarray = law.compaction_pressure(stretch, past, shear)
        return pressure

    def _pressure(self, stretch: np.ndarray, free: np.ndarray) -> np.ndarray:
        lifted = self._lift * np.maximum(stretch - free, 0.0)
        return self._law(stretch) / self.area_stretch - lifted

    def _slope(self, stretch: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Return the derivative by the stretch (C,) [Pa]; that of the pressed side where free."""
        ahead = self._pressure(stretch + np.where(stretch < free, 0.0, DIFFERENCE), free)
        behind = self._pressure(stretch - np.where(stretch > free, 0.0, DIFFERENCE), free)
        width = np.where((stretch < free) | (stretch > free), DIFFERENCE, 2.0 * DIFFERENCE)
        return (ahead - behind) / width


@routine
def _remember(law, strain, shear, history):
    count = strain.size
    for i in range(count):
        past = load_history(law, history, i, count)
        E = (0.0, 0.0, strain[i], shear[i], 0.0, 0.0)
        store_history(law, evolved_history(law, E, past), history, i, count)
