"""A filling as the fluid side of a coupling: volume rates in, pore pressures out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.state import FillingState
from lcmchain.coupling.iteration.interface import (
    PORE_PRESSURE,
    REFERENCE_PRESSURE,
    VOLUME_RATE,
    VOLUME_RATE_SLOPE,
    Fields,
    PartFailed,
)
from lcmchain.coupling.solids.fields import POINTS, checked, chosen
from lcmchain.errors import InputError, SimulationError


class SavedFilling(NamedTuple):
    """State of a :class:`FillingPart`: of the filling, and the inputs that were set last."""

    state: FillingState
    inputs: dict[str, np.ndarray]
    mean_pressure: np.ndarray


class FillingPart:
    """A filling whose cells are those of the solid; a ``CoupledPart``.

    It takes ``volume_rate`` (C,) [m³/s], the mean over the coming step, and ``points`` (3 N,) [m],
    where the nodes will be: a cell keeps its volume when they move and then changes it at that
    rate, so that it has the volume of the solid at the end. With ``volume_rate_slope`` (C,)
    [m³/(s Pa)] and ``reference_pressure`` (C,) [Pa] the rate follows the pressure that the filling
    finds, the fixed-stress split; the pressure of such cells is the mean over the last step, so
    that both sides have the same volume when they agree on it. It gives ``pore_pressure`` (C,)
    [Pa], the mean over the corners of a cell by their areas: of the resin where their control
    volumes are full, else of the air.

    Parameters
    ----------
    filling : on a mesh with the solid's cells in their order.
    on_step : called after every time step of the filling.
    """

    inputs = (VOLUME_RATE, VOLUME_RATE_SLOPE, REFERENCE_PRESSURE, POINTS)

    def __init__(self, filling: Filling, on_step: Callable[[Filling], None] | None = None) -> None:
        self.filling, self.on_step = filling, on_step
        #: Outcome and message of the last step (:class:`.state.FillingResult`).
        self.ended = ("reached", "")
        # a window ends where the solid is, whether anything flows or not
        filling.options = replace(filling.options, stop_when_idle=False)
        none = np.zeros(filling.mesh.cell_count)
        self._given = dict.fromkeys(self.inputs, none) | {POINTS: filling.state.points.ravel()}
        self._mean = np.full(filling.mesh.cell_count, np.nan)

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
        filling, begin, given = self.filling, self.time, self._given
        points = given[POINTS].reshape(-1, 3)
        try:
            volume = filling.state.thickness * filling.mesh.areas
            if not np.array_equal(points, filling.state.points):
                filling.set_points(points)
            area = filling.mesh.areas
            start, rate = volume / area, given[VOLUME_RATE] / area
            lift, reference = given[VOLUME_RATE_SLOPE] / area, given[REFERENCE_PRESSURE]
            filling.set_thickness(start, rate, lift, reference)
            self.ended = filling.advance(begin + step, self.on_step)
        except SimulationError as error:
            raise PartFailed(
                str(error), time=begin, step=step, inputs={VOLUME_RATE: given[VOLUME_RATE]}
            ) from error
        lifted = filling.state.thickness - start - step * rate
        slope = np.where(lift > 0.0, step * lift, np.nan)
        self._mean = reference + lifted / slope

    def save(self) -> SavedFilling:
        """Return a copy of the state."""
        given = {name: values.copy() for name, values in self._given.items()}
        return SavedFilling(self.filling.save(), given, self._mean.copy())

    def restore(self, saved: SavedFilling) -> None:
        """Go back to a saved state; going on from it is bit-identical."""
        self.filling.restore(saved.state)
        self._given = {name: values.copy() for name, values in saved.inputs.items()}
        self._mean = saved.mean_pressure.copy()

    def set_fields(self, fields: Mapping[str, np.ndarray]) -> None:
        """Take inputs.

        Raises
        ------
        InputError : another name, a wrong number of values, or one that is no number.
        """
        for name, values in fields.items():
            if name not in self.inputs:
                raise InputError(
                    f'"{name}" is no input of a filling; it takes {" and ".join(self.inputs)}'
                )
            self._given[name] = checked(name, values, self._given[name].size)

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return ``pore_pressure`` [Pa], ``thickness`` [m] and ``volume`` [m³] of the cells.

        Raises
        ------
        InputError : a name that is no output.
        """
        state, mesh = self.filling.state, self.filling.mesh
        found = {
            PORE_PRESSURE: np.where(np.isnan(self._mean), self.present_pressure(), self._mean),
            "thickness": state.thickness,
            "volume": state.thickness * mesh.areas,
        }
        return chosen(names, found)

    def present_pressure(self) -> np.ndarray:
        """Return the mean pressure over each cell now [Pa], (C,)."""
        state, network = self.filling.state, self.filling.medium.network
        pressure = np.where(state.full, state.pressure, state.air_pressure)
        areas = network.corner_areas
        return (areas * pressure[network.cells]).sum(axis=1) / areas.sum(axis=1)

    def places(self, name: str) -> np.ndarray | None:
        """Return the centres of the cells (C, 3) [m]; None for the points."""
        return None if name == POINTS else self.filling.mesh.corners.mean(axis=1)
