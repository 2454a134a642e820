"""The explicit forming simulation as the solid side of a coupling.

The fluid gives one pore pressure per element; forming gives back the volume of the elements and how
fast it changed. Forces and volumes belong together: p dV is the work on the sheet
(:mod:`lcmchain.effects.pore_pressure`).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcmchain.coupling.iteration.interface import PORE_PRESSURE, Fields, PartFailed
from lcmchain.effects.pore_pressure import volumes_and_rates
from lcmchain.errors import InputError, SimulationError
from lcmchain.model import build_model
from lcmchain.solver.simulation import Simulation, StepControl
from lcmchain.state import State


@dataclass(frozen=True)
class SavedForming:
    """State of a :class:`ExplicitForming` at a time.

    state : of the simulation. control : what limits its step.
    pore_pressure : given last (element_count,) [Pa].
    step : length of the last step [s], 0 before the first one.
    volume, area : of the elements where the last step began (element_count,) [m³, m²].
    """

    state: State
    control: StepControl
    pore_pressure: np.ndarray
    step: float
    volume: np.ndarray
    area: np.ndarray


class ExplicitForming:
    """A forming simulation with a fluid in its pores; a
    :class:`lcmchain.coupling.iteration.interface.CoupledPart`.

    The pore pressure comes on linearly over a step, from the value at its beginning to the one that
    was set: a pressure that jumps would let the sheet vibrate. Own steps are the explicit ones.

    Parameters
    ----------
    simulation : of one sheet with a thickness, whose model was built with ``pore_pressure=True``.
    surroundings : pressure around the sheet [Pa]; the pressures that are set are in the same
        system, and what loads the sheet is the difference.

    Raises
    ------
    InputError : the model has no pore pressure, or several sheets.
    """

    inputs = (PORE_PRESSURE,)

    def __init__(self, simulation: Simulation, *, surroundings: float = 0.0) -> None:
        model = simulation.model
        if model.pore is None:
            raise InputError("the model was built without pore_pressure=True; no fluid can act")
        if len(model.bodies) != 1:
            raise InputError(
                f"the model has {len(model.bodies)} sheets; a fluid is coupled with one"
            )
        self.simulation = simulation
        self.surroundings = float(surroundings)
        self._lanes = model.pore
        self._pressure = self.present_pressure()
        self._step = 0.0
        self._volume, self._area = self.volume(), self.area()

    @classmethod
    def from_scene(cls, scene: Any, **options: Any) -> ExplicitForming:
        """Build the forming of a scene."""
        return cls(Simulation(build_model(scene, pore_pressure=True)), **options)

    # --- shape ------------------------------------------------------------------------------------

    @property
    def element_count(self) -> int:
        return self.simulation.model.element_count

    def node_positions(self) -> np.ndarray:
        """Return the present positions of the nodes (node_count, 3) [m]."""
        return np.ascontiguousarray(self.simulation.state.position.T)

    def points(self) -> np.ndarray:
        """Return the present positions of the mid-surface's nodes (pair_count, 3) [m]."""
        return self.simulation.model.blank.mid_surface(self.node_positions())

    @property
    def cells(self) -> np.ndarray:
        """Cells of the mid-surface (element_count, 4), the elements in their order; -1 is none."""
        return self.simulation.model.blank.sheet_faces

    def normals(self) -> np.ndarray:
        """Return the unit normals of the mid-surface at the element centres (element_count, 3)."""
        base = self.simulation.model.blank.base_vectors(self.node_positions())
        normal = np.cross(base[:, 0], base[:, 1])
        return normal / np.linalg.norm(normal, axis=1)[:, None]

    def area(self) -> np.ndarray:
        """Return the areas of the mid-surface (element_count,) [m²], half the diagonals' product."""
        return self.simulation.model.blank.areas(self.node_positions())

    def volume(self) -> np.ndarray:
        """Return the volumes of the elements (element_count,) [m³]."""
        return self._volumes_and_rates()[0]

    def normal_thickness(self) -> np.ndarray:
        """Return the thickness that the law of compaction sees (element_count,) [m]."""
        body = self.simulation.model.body
        history = self.simulation.model.history_of(body, self.simulation.state.history)
        condition = body.condition(self.simulation.state.position, history)
        return condition.thickness_stretch * 2.0 * body.geometry.height

    def present_pressure(self) -> np.ndarray:
        """Return the pore pressures that act now (element_count,) [Pa]."""
        return self.simulation.state.pore_pressure[self._lanes.place] + self.surroundings

    def _volumes_and_rates(self) -> tuple[np.ndarray, np.ndarray]:
        state = self.simulation.state
        volume, rate = np.empty((2, self._lanes.padded_count))
        volumes_and_rates(self._lanes, state.position, state.velocity, volume, rate)
        return volume[self._lanes.place], rate[self._lanes.place]

    # --- coupled part -----------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self.simulation.time

    def advance(self, step: float) -> None:
        """Form for ``step`` [s]; the pore pressure goes linearly to what was set.

        Raises
        ------
        PartFailed : a guard stopped the forming.
        """
        simulation, state = self.simulation, self.simulation.state
        begin = self.time
        self._volume, self._area, self._step = self.volume(), self.area(), float(step)
        target = self._lanes.in_lanes(self._pressure - self.surroundings)
        state.pore_rate[:] = (target - state.pore_pressure) / step
        try:
            simulation.advance_to(begin + step)
        except SimulationError as error:
            raise PartFailed(
                str(error), time=begin, step=step, inputs={PORE_PRESSURE: self._pressure}
            ) from error
        finally:
            state.pore_rate[:] = 0.0
        state.pore_pressure[:] = target

    def save(self) -> SavedForming:
        """Return a copy of the state, which no later step changes."""
        return SavedForming(
            self.simulation.state.copy(),
            copy.deepcopy(self.simulation.control),
            self._pressure.copy(),
            self._step,
            self._volume.copy(),
            self._area.copy(),
        )

    def restore(self, saved: SavedForming) -> None:
        """Go back to a saved state; going on from it is bit-identical."""
        self.simulation.restore(saved.state)
        self.simulation.control = copy.deepcopy(saved.control)
        self._pressure, self._step = saved.pore_pressure.copy(), saved.step
        self._volume, self._area = saved.volume.copy(), saved.area.copy()

    def set_fields(self, fields: Mapping[str, np.ndarray]) -> None:
        """Take ``pore_pressure`` (element_count,) [Pa] for the end of the next step.

        Raises
        ------
        InputError : another name, a wrong number of values, or one that is no number.
        """
        for name, values in fields.items():
            if name != PORE_PRESSURE:
                raise InputError(f'"{name}" is no input of forming; it takes {PORE_PRESSURE}')
            self._pressure = checked(name, values, self.element_count)

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return outputs at the present time; rates are means over the last step, 0 before it.

        ``volume`` [m³], ``thickness`` (volume over area) [m], ``area`` [m²] with their ``_rate``;
        ``pore_pressure`` [Pa].

        Raises
        ------
        InputError : a name that is no output.
        """
        volume, area = self.volume(), self.area()
        now = {"volume": volume, "thickness": volume / area, "area": area}
        before = {
            "volume": self._volume, "thickness": self._volume / self._area, "area": self._area
        }  # fmt: skip
        found = {PORE_PRESSURE: self.present_pressure(), **now}
        for name, value in now.items():
            change = value - before[name]
            found[f"{name}_rate"] = change / self._step if self._step else np.zeros_like(value)
        return chosen(names, found)

    def places(self, name: str) -> np.ndarray | None:
        """Return the centres of the elements (element_count, 3) [m]."""
        positions = self.node_positions()[self.simulation.model.blank.elements]
        return positions.mean(axis=1)


def checked(name: str, values: np.ndarray, count: int) -> np.ndarray:
    """Return a copy of the values of a field (count,).

    Raises
    ------
    InputError : a wrong number of values, or one that is no number.
    """
    values = np.array(values, dtype=float)
    if values.shape != (count,):
        raise InputError(f"{name} has the shape {values.shape}; there are {count} cells")
    if not np.isfinite(values).all():
        cell = int(np.flatnonzero(~np.isfinite(values))[0])
        raise InputError(f"{name} is {values[cell]} in cell {cell}")
    return values


def chosen(names: Sequence[str], found: Fields) -> Fields:
    """Return the named ones of fields.

    Raises
    ------
    InputError : a name that is no output.
    """
    unknown = [name for name in names if name not in found]
    if unknown:
        raise InputError(f'"{unknown[0]}" is no output; there are {", ".join(found)}')
    return {name: found[name] for name in names}
