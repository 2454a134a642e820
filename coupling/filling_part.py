"""A filling as the fluid side of a coupling: it takes volumes and gives pore pressures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.state import FillingState
from lcmchain.coupling.iteration.interface import (
    POINTS,
    PORE_PRESSURE,
    PRESSURE_AT_REST,
    REFERENCE_PRESSURE,
    RESISTANCE,
    THICKNESS,
    VOLUME,
    VOLUME_RATE,
    VOLUME_RATE_SLOPE,
    Fields,
    PartFailed,
    checked_field,
    selected_fields,
)
from lcmchain.errors import InputError, SimulationError


class SavedFilling(NamedTuple):
    """State of a :class:`FillingPart`.

    Parameters
    ----------
    state : of the filling.
    inputs : that were set last, by name.
    mean_pressure : over the last step (C,) [Pa], not a number where the pressure moves no volume.
    resisted : pressure by the solid's resistance in the last step (C,) [Pa].
    clock : see :attr:`FillingPart.clock`.
    """

    state: FillingState
    inputs: dict[str, np.ndarray]
    mean_pressure: np.ndarray
    resisted: np.ndarray
    clock: tuple[float, float, float] = (0.0, 0.0, 1.0)


class FillingPart:
    """A filling whose cells are those of the solid; a ``CoupledPart``.

    Inputs:

    - ``volume`` (C,) [m³] of the solid at the end of the next step, or ``volume_rate`` (C,) [m³/s],
      its mean rate over the step. With the volume, small differences do not add up over time.
    - ``points`` (3 N,) [m], the positions of the nodes at the end of the step. When they move a
      cell first keeps its volume, then changes it at the rate, so that it has the volume of the
      solid at the end.
    - ``volume_rate_slope`` (C,) [m³/(s Pa)] and ``reference_pressure`` (C,) [Pa] make the rate
      depend on the pressure of the filling (fixed-stress split). The pressure of such cells is the
      mean over the last step, so that both sides have the same volume when they agree on it.
    - ``pore_resistance`` (C,) [Pa s/m³] of the solid, for the pressure at rest.

    Outputs are ``pore_pressure`` (C,) [Pa], the mean over the corners of a cell weighted by their
    areas, of the resin in full control volumes and else of the air; and ``pressure_at_rest``, which
    adds the resistance times the rate.

    Parameters
    ----------
    filling : on a mesh with the solid's cells in their order.
    on_step : called after every time step of the filling.
    pace : time of the filling per time of the solid, whose process may be computed in less time
        than it takes.
    """

    inputs = (VOLUME, VOLUME_RATE, VOLUME_RATE_SLOPE, REFERENCE_PRESSURE, RESISTANCE, POINTS)

    def __init__(
        self,
        filling: Filling,
        on_step: Callable[[Filling], None] | None = None,
        *,
        pace: float = 1.0,
    ) -> None:
        if not 0.0 < pace < np.inf:
            raise InputError(f"the pace of a filling must be positive, not {pace:g}")
        if filling.medium.network.links is not None:
            raise InputError(
                "is a layer without a solid of its own, so that no other program can move or press "
                "it; leave it out",
                key="flow_medium",
            )
        self.filling, self.on_step = filling, on_step
        #: Begin of the present pace by the clocks of the solid and of the filling [s]; the pace.
        self.clock = (0.0, 0.0, float(pace))
        #: Outcome and message of the last step (:class:`.state.FillingResult`).
        self.ended = ("reached", "")
        # a window ends at the time of the solid, whether resin flows or not
        filling.options = replace(filling.options, stop_when_idle=False)
        self._start_anew()

    def _start_anew(self) -> None:
        """Forget the inputs and the results of the last step."""
        none = np.zeros(self.filling.mesh.cell_count)
        names = (VOLUME_RATE, VOLUME_RATE_SLOPE, REFERENCE_PRESSURE, RESISTANCE)
        self._given = dict.fromkeys(names, none) | {POINTS: self.filling.state.points.ravel()}
        self._mean = np.full(self.filling.mesh.cell_count, np.nan)
        self._resisted = none

    @property
    def time(self) -> float:
        """Present time of the solid's clock [s]."""
        begin, filling_begin, pace = self.clock
        return begin + (self.filling.time - filling_begin) / pace

    @property
    def pace(self) -> float:
        """Present time of the filling per time of the solid."""
        return self.clock[2]

    def go_on_at(self, pace: float, time: float) -> None:
        """Go on at another pace from now, which is ``time`` [s] by the solid's clock."""
        self.clock = (float(time), float(self.filling.time), float(pace))

    def follow(self, volume: np.ndarray, points: np.ndarray) -> None:
        """Take volumes (C,) [m³] and points (N, 3) [m] that the solid has reached alone.

        The time of the filling does not go on: resin stays in its control volume. Pores that have
        become larger take air.

        Raises
        ------
        SimulationError : pores have become smaller than their resin.
        """
        self.filling.carry_to(points)
        self.filling.set_thickness(volume / self.filling.mesh.areas)
        self.filling.settle()
        self._start_anew()

    def volume(self) -> np.ndarray:
        """Return the volumes of the cells (C,) [m³]."""
        return self.filling.state.thickness * self.filling.mesh.areas

    def advance(self, step: float) -> None:
        """Fill for ``step`` [s].

        Raises
        ------
        PartFailed : the filling cannot do it.
        """
        filling, given, duration, begin = self.filling, self._given, step * self.pace, self.time
        before = self.volume()
        change = given[VOLUME] - before if VOLUME in given else given[VOLUME_RATE] * step
        points = given[POINTS].reshape(-1, 3)
        try:
            if not np.array_equal(points, filling.state.points):
                filling.carry_to(points)
            area = filling.mesh.areas
            start, rate = before / area, change / (area * duration)
            lift = given[VOLUME_RATE_SLOPE] / (area * self.pace)
            filling.set_thickness(start, rate, lift, given[REFERENCE_PRESSURE])
            self.ended = filling.advance(filling.time + duration, self.on_step)
        except SimulationError as error:
            raise PartFailed(
                str(error), time=begin, step=step, inputs={VOLUME_RATE: change / step}
            ) from error
        lifted = filling.state.thickness - start - duration * rate
        slope = np.where(lift > 0.0, duration * lift, np.nan)
        self._mean = given[REFERENCE_PRESSURE] + lifted / slope
        self._resisted = given[RESISTANCE] * (self.volume() - before) / step

    def save(self) -> SavedFilling:
        """Return a copy of the state."""
        given = {name: values.copy() for name, values in self._given.items()}
        return SavedFilling(
            self.filling.save(), given, self._mean.copy(), self._resisted.copy(), self.clock
        )

    def restore(self, saved: SavedFilling) -> None:
        """Go back to a saved state; going on from it is bit-identical."""
        self.filling.restore(saved.state)
        self._given = {name: values.copy() for name, values in saved.inputs.items()}
        self._mean, self._resisted = saved.mean_pressure.copy(), saved.resisted.copy()
        begin, filling_begin, pace = saved.clock
        self.clock = (begin, filling_begin, pace)

    def set_fields(self, fields: Mapping[str, np.ndarray]) -> None:
        """Set inputs.

        Raises
        ------
        InputError : another name, a wrong number of values, or a value that is no number.
        """
        for name, values in fields.items():
            if name not in self.inputs:
                raise InputError(
                    f'"{name}" is no input of a filling; it takes {", ".join(self.inputs)}'
                )
            size = self._given[POINTS].size if name == POINTS else self.filling.mesh.cell_count
            self._given[name] = checked_field(name, values, size)
            if name == VOLUME_RATE:
                self._given.pop(VOLUME, None)

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return ``pore_pressure``, ``pressure_at_rest`` [Pa], ``thickness`` [m], ``volume`` [m³].

        Raises
        ------
        InputError : a name that is no output.
        """
        outputs = {
            PORE_PRESSURE: self.pressure(),
            PRESSURE_AT_REST: self.pressure() + self._resisted,
            THICKNESS: self.filling.state.thickness,
            VOLUME: self.volume(),
        }
        return selected_fields(names, outputs)

    def pressure(self) -> np.ndarray:
        """Return the pressure of each cell (C,) [Pa]: the mean where it lifts a cell, else now."""
        return np.where(np.isnan(self._mean), self.present_pressure(), self._mean)

    def present_pressure(self) -> np.ndarray:
        """Return the mean pressure over each cell now [Pa], (C,)."""
        state, network = self.filling.state, self.filling.medium.network
        pressure = np.where(state.full, self.filling.pressure, state.air_pressure)
        areas = network.corner_areas
        return (areas * pressure[network.cells]).sum(axis=1) / areas.sum(axis=1)

    def places(self, name: str) -> np.ndarray | None:
        """Return the centres of the cells (C, 3) [m]; None for the points."""
        return None if name == POINTS else self.filling.mesh.corners.mean(axis=1)
