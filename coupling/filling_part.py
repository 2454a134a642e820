"""A filling as the fluid side of a coupling: volume rates in, pore pressures out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.state import FillingState
from lcmchain.coupling.iteration.interface import PORE_PRESSURE, VOLUME_RATE, Fields, PartFailed
from lcmchain.coupling.solids.fields import POINTS, checked, chosen
from lcmchain.errors import InputError, SimulationError


class SavedFilling(NamedTuple):
    """State of a :class:`FillingPart`: of the filling, and the inputs that were set last."""

    state: FillingState
    volume_rate: np.ndarray
    points: np.ndarray


class FillingPart:
    """A filling whose cells are those of the solid; a ``CoupledPart``.

    It takes ``volume_rate`` (C,) [m³/s], the mean over the coming step, and ``points`` (3 N,) [m],
    where the nodes will be: a cell keeps its volume when they move and then changes it at that
    rate, so that it has the volume of the solid at the end. It gives ``pore_pressure`` (C,) [Pa],
    the mean over the corners of a cell: of the resin where their control volumes are full, else of
    the air.

    Parameters
    ----------
    filling : on a mesh with the solid's cells in their order.
    """

    inputs = (VOLUME_RATE, POINTS)

    def __init__(self, filling: Filling) -> None:
        self.filling = filling
        # a window ends where the solid is, whether anything flows or not
        filling.options = replace(filling.options, stop_when_idle=False)
        self._rate = np.zeros(filling.mesh.cell_count)
        self._points = filling.state.points.copy()

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self.filling.time

    def advance(self, step: float) -> None:
        """Fill for ``step`` [s].

        Raises
        ------
        PartFailed : the filling cannot do it.
        """
        filling, begin = self.filling, self.time
        try:
            volume = filling.state.thickness * filling.mesh.areas
            if not np.array_equal(self._points, filling.state.points):
                filling.set_points(self._points)
            area = filling.mesh.areas
            filling.set_thickness(volume / area, self._rate / area)
            filling.advance(begin + step)
        except SimulationError as error:
            raise PartFailed(
                str(error), time=begin, step=step, inputs={VOLUME_RATE: self._rate}
            ) from error

    def save(self) -> SavedFilling:
        """Return a copy of the state."""
        return SavedFilling(self.filling.save(), self._rate.copy(), self._points.copy())

    def restore(self, saved: SavedFilling) -> None:
        """Go back to a saved state; going on from it is bit-identical."""
        self.filling.restore(saved.state)
        self._rate, self._points = saved.volume_rate.copy(), saved.points.copy()

    def set_fields(self, fields: Mapping[str, np.ndarray]) -> None:
        """Take inputs.

        Raises
        ------
        InputError : another name, a wrong number of values, or one that is no number.
        """
        for name, values in fields.items():
            if name == VOLUME_RATE:
                self._rate = checked(name, values, self._rate.size)
            elif name == POINTS:
                self._points = checked(name, values, self._points.size).reshape(-1, 3)
            else:
                raise InputError(
                    f'"{name}" is no input of a filling; it takes {" and ".join(self.inputs)}'
                )

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return ``pore_pressure`` [Pa], ``thickness`` [m] and ``volume`` [m³] of the cells.

        Raises
        ------
        InputError : a name that is no output.
        """
        state, mesh = self.filling.state, self.filling.mesh
        pressure = np.where(state.full, state.pressure, state.air_pressure)
        there = mesh.cells >= 0
        of_corners = np.where(there, pressure[mesh.cells], 0.0)
        found = {
            PORE_PRESSURE: of_corners.sum(axis=1) / there.sum(axis=1),
            "thickness": state.thickness,
            "volume": state.thickness * mesh.areas,
        }
        return chosen(names, found)

    def places(self, name: str) -> np.ndarray | None:
        """Return the centres of the cells (C, 3) [m]; None for the points."""
        return None if name == POINTS else self.filling.mesh.corners.mean(axis=1)
