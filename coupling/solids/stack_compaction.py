"""Compaction of plies on each other: all bear one pressure, and their thicknesses add up.

Springs in series. The thickness of a stack under a pressure P is h(P) = Σ t_i(P), where each ply
has its own law, its own fibres per area and its own memory. h falls with P: a thickness of the
stack stands for one pressure, which Newton's iteration within bounds finds. The compliances add up,
dh/dP = Σ dt_i/dP.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcmchain.coupling.solids.compaction_law import MOST_ITERATIONS, ROUND_OFF, CellCompaction
from lcmchain.errors import SimulationError


@dataclass(frozen=True)
class PressedPly:
    """A ply in the cells that it covers.

    name : for messages. law : of those cells alone. cells : their rows in the stack.
    """

    name: str
    law: CellCompaction
    cells: np.ndarray


class StackCompaction:
    """Compaction law of C cells of several plies; answers as :class:`CellCompaction` does.

    Parameters
    ----------
    plies : of the stack; a cell may lack some of them, and needs one.
    count : of the cells.
    """

    def __init__(self, plies: Sequence[PressedPly], count: int) -> None:
        self.plies, self._count = tuple(plies), count
        #: Of the undeformed plies of each cell (C,) [m].
        self.thickness = self._summed([ply.law.thickness for ply in self.plies])

    @property
    def history(self) -> np.ndarray:
        """What the laws of all plies remember, one ply after the other, in one row."""
        return np.concatenate([ply.law.history.ravel() for ply in self.plies])

    @history.setter
    def history(self, values: np.ndarray) -> None:
        first = 0
        for ply in self.plies:
            shape, size = ply.law.history.shape, ply.law.history.size
            ply.law.history = np.array(values[first : first + size]).reshape(shape)
            first += size

    @property
    def thinnest(self) -> np.ndarray:
        """Thickness (C,) [m] at which the weakest ply bears all that its law gives."""
        return self._summed(self._thicknesses(self._largest_pressure()))

    def least_gap(self, offset: np.ndarray | float) -> float:
        """Return the gap [m] below which cells that are thicker by an offset have no pressure."""
        return float(np.max(self.thinnest - offset))

    def pressure(self, thickness: np.ndarray) -> np.ndarray:
        """Return the pressure that the fibres bear (C,) [Pa]; negative where they are pulled.

        Raises
        ------
        SimulationError : thinner than any pressure makes a cell.
        """
        return self._shared(thickness)[0]

    def stiffness(self, thickness: np.ndarray) -> np.ndarray:
        """Return minus the derivative of the pressure by the thickness (C,) [Pa/m], positive."""
        own = zip(self.plies, self._shared(thickness)[1], strict=True)
        return 1.0 / self._summed([1.0 / ply.law.stiffness(thickness) for ply, thickness in own])

    def thickness_under(self, pressure: np.ndarray) -> np.ndarray:
        """Return the thickness at which the fibres bear a pressure (C,) [m].

        Raises
        ------
        SimulationError : more than the law of a ply can bear at any thickness.
        """
        largest = self._largest_pressure()
        lacking = np.flatnonzero(largest < pressure)
        if len(lacking):
            cell = int(lacking[0])
            raise SimulationError(
                f"the fibres of cell {cell} would have to bear {pressure[cell]:.4g} Pa, more than "
                f"the law of {self._weakest(cell)} gives at any thickness"
            )
        return self._summed(self._thicknesses(pressure))

    def of_plies(self, thickness: np.ndarray) -> np.ndarray:
        """Return the thickness of each ply (P, C) [m] in cells of a thickness (C,) [m].

        It is 0 where a ply does not cover a cell.

        Raises
        ------
        SimulationError : as of :meth:`pressure`.
        """
        found = np.zeros((len(self.plies), self._count))
        for row, ply, own in zip(found, self.plies, self._shared(thickness)[1], strict=True):
            row[ply.cells] = own
        return found

    def remember(self, thickness: np.ndarray) -> None:
        """Move the histories on to the end of a step that leads to a thickness (C,) [m]."""
        if not self.history.size:
            return
        for ply, own in zip(self.plies, self._shared(thickness)[1], strict=True):
            ply.law.remember(own)

    def _thicknesses(self, pressure: np.ndarray) -> list[np.ndarray]:
        """Thickness of every ply in its cells, under the pressures of all cells (C,)."""
        return [ply.law.thickness_under(pressure[ply.cells]) for ply in self.plies]

    def _shared(self, thickness: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the pressure of a thickness (C,) and what the plies have of it, each in its cells.

        Newton's iteration on the thicknesses of all plies at once, from the one where all are
        compressed by the same part. As the pressure of a textile grows about exponentially, a ply
        is taken to become thinner by ln P; where a fluid lifts it, by P. Plies that are together
        too thick hold one that bears less than all will, which bounds the pressure from below, and
        the other way round.

        Raises
        ------
        SimulationError : thinner than any pressure makes a cell.
        """
        free = [ply.law.free_stretch * ply.law.thickness for ply in self.plies]
        part = thickness / self._summed(free)
        own = [part[ply.cells] * of_ply for ply, of_ply in zip(self.plies, free, strict=True)]
        least = [ply.law.thinnest for ply in self.plies]
        low, high = np.full(self._count, -np.inf), self._largest_pressure()
        largest = high.copy()
        for _ in range(MOST_ITERATIONS):
            own = [np.maximum(one, bound) for one, bound in zip(own, least, strict=True)]
            borne = [ply.law.pressure(one) for ply, one in zip(self.plies, own, strict=True)]
            gives = [1.0 / ply.law.stiffness(one) for ply, one in zip(self.plies, own, strict=True)]
            too_thick = self._summed(own) - thickness
            smallest, greatest = self._extremes(borne)
            low = np.where(too_thick >= 0.0, np.maximum(low, smallest), low)
            high = np.where(too_thick <= 0.0, np.minimum(high, greatest), high)
            pressed = (part < 1.0) & (smallest > 0.0)
            pressure, change = self._newton(pressed, too_thick, borne, gives, (low, high))
            own = [one + by for one, by in zip(own, change, strict=True)]
            moved = self._extremes([np.abs(by) / one for by, one in zip(change, own, strict=True)])
            found = (moved[1] <= ROUND_OFF) & (np.abs(too_thick) <= ROUND_OFF * thickness)
            if found.all():
                return pressure, own
        thinnest = self.thinnest
        lacking = np.flatnonzero(~found & (thickness < thinnest))
        if len(lacking):
            cell = int(lacking[0])
            raise SimulationError(
                f"the plies of cell {cell} would have to become {thickness[cell]:.4g} m thin, but "
                f"the law of {self._weakest(cell)} gives no more than about "
                f"{largest[cell]:.4g} Pa, where they are {thinnest[cell]:.4g} m thick"
            )
        return self._under_common(thickness, pressure, (low, high), ~found)

    def _under_common(
        self,
        thickness: np.ndarray,
        pressure: np.ndarray,
        bounds: tuple[np.ndarray, np.ndarray],
        wanted: np.ndarray,
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return what :meth:`_shared` does, by iteration on the one pressure of a cell.

        Each ply has the thickness that it has under this pressure. That takes longer, and is not
        disturbed by the end of a law, where its pressure hardly grows any more.

        Parameters
        ----------
        pressure : to begin with, and to keep where it is not ``wanted`` (C,). bounds : of it.
        """
        low, high = np.where(np.isfinite(bounds[0]), bounds[0], 0.0), bounds[1]
        pressure = np.where(wanted, 0.5 * (low + high), pressure)
        for _ in range(MOST_ITERATIONS):
            own = self._thicknesses(pressure)
            too_thick = self._summed(own) - thickness
            low = np.where(too_thick >= 0.0, pressure, low)
            high = np.where(too_thick <= 0.0, pressure, high)
            gives = [1.0 / ply.law.stiffness(one) for ply, one in zip(self.plies, own, strict=True)]
            better = pressure + too_thick / self._summed(gives)
            better = np.where((better > low) & (better < high), better, 0.5 * (low + high))
            wanted = wanted & (np.abs(too_thick) > ROUND_OFF * thickness)
            wanted = wanted & (np.abs(better - pressure) > ROUND_OFF * np.abs(pressure))
            if not wanted.any():
                break
            pressure = np.where(wanted, better, pressure)
        return pressure, own

    def _newton(
        self,
        pressed: np.ndarray,
        too_thick: np.ndarray,
        borne: list[np.ndarray],
        gives: list[np.ndarray],
        bounds: tuple[np.ndarray, np.ndarray],
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the pressures (C,) of a step, and by how much it makes each ply thicker.

        pressed : cells that change by the logarithm (C,). too_thick : sum of the plies over the
        thickness that they are to have (C,) [m]. borne, gives : pressure and compliance of every
        ply [Pa, m/Pa]. bounds : of the pressure (C,) [Pa].
        """
        rows = [ply.cells for ply in self.plies]
        level = [np.where(pressed[c], np.log(np.where(pressed[c], p, 1.0)), p)
                 for c, p in zip(rows, borne, strict=True)]  # fmt: skip
        yields = [np.where(pressed[c], p * give, give)
                  for c, p, give in zip(rows, borne, gives, strict=True)]  # fmt: skip
        weighed = [value * give for value, give in zip(level, yields, strict=True)]
        aim = (too_thick + self._summed(weighed)) / self._summed(yields)
        pressure = np.where(pressed, np.exp(np.where(pressed, aim, 0.0)), aim)
        low, high = bounds
        inside = (pressure >= low) & (pressure <= high)
        middle = np.where(np.isfinite(low), 0.5 * (low + high), high)
        pressure = np.where(inside, pressure, middle)
        aim = np.where(pressed, np.log(np.where(pressed, pressure, 1.0)), pressure)
        return pressure, [
            (value - aim[c]) * give for c, value, give in zip(rows, level, yields, strict=True)
        ]

    def _extremes(self, of_plies: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest (C,) of values that every ply has in its cells."""
        low, high = np.full(self._count, np.inf), np.full(self._count, -np.inf)
        for ply, values in zip(self.plies, of_plies, strict=True):
            low[ply.cells] = np.minimum(low[ply.cells], values)
            high[ply.cells] = np.maximum(high[ply.cells], values)
        return low, high

    def _largest_pressure(self) -> np.ndarray:
        """Largest pressure (C,) [Pa] that the laws of all plies of a cell give."""
        return self._extremes([ply.law.pressure(ply.law.thinnest) for ply in self.plies])[0]

    def _weakest(self, cell: int) -> str:
        """Name of the ply whose law gives the least pressure in a cell."""
        there = [
            (float(ply.law.pressure(ply.law.thinnest)[ply.cells == cell][0]), ply.name)
            for ply in self.plies
            if cell in ply.cells
        ]
        return f'the ply "{min(there)[1]}"'

    def _summed(self, of_plies: Sequence[np.ndarray]) -> np.ndarray:
        """Sum (C,) of values that every ply has in its cells."""
        total = np.zeros(self._count)
        for ply, values in zip(self.plies, of_plies, strict=True):
            total[ply.cells] += values
        return total
