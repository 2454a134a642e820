"""The explicit forming simulation as the solid side of a coupling.

The fluid gives one pore pressure per element. Forming gives the volume of the elements and its
rate. Forces and volumes are conjugate: p dV is the work on the sheet
(:mod:`lcmchain.effects.pore_pressure`).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lcmchain.coupling.iteration.interface import (
    POINTS,
    PORE_PRESSURE,
    PRESSURE_AT_REST,
    REFERENCE_PRESSURE,
    RESISTANCE,
    VOLUME_RATE_SLOPE,
    Fields,
    PartFailed,
    checked_field,
    selected_fields,
)
from lcmchain.effects.pore_pressure import resistance_mobilities, volumes_and_rates
from lcmchain.elements.family import Body
from lcmchain.errors import InputError, SimulationError
from lcmchain.model import build_model
from lcmchain.scene import Scene
from lcmchain.solver.simulation import Simulation, StepControl
from lcmchain.state import State

# Share of the stability limit of the explicit step that the resistances of the fluid may use.
DAMPED_SHARE = 0.25
# Least part of a face that a tool touches where it keeps air out.
COVERED = 0.5
# Largest distance of the end of a step from the border of a stage that is rounding, over the step.
ROUNDED_BORDER = 1e-6


@dataclass(frozen=True)
class SavedForming:
    """State of a :class:`ExplicitForming` at a time.

    Parameters
    ----------
    state : of the simulation.
    control : of its time step.
    given : pressure that was set last (element_count,) [Pa].
    at_rest : whether it is the pressure at rest.
    mean_pressure : over the last step (element_count,) [Pa].
    resistance : over the last step (element_count,) [Pa s/m³].
    step : length of the last step [s], 0 before the first one.
    volume, area : of the elements at the begin of the last step (element_count,) [m³, m²].
    columns_at : of a stack, positions of the nodes for which its columns were found (3, N) [m].
    """

    state: State
    control: StepControl
    given: np.ndarray
    at_rest: bool
    mean_pressure: np.ndarray
    resistance: np.ndarray
    step: float
    volume: np.ndarray
    area: np.ndarray
    columns_at: np.ndarray = field(default_factory=lambda: np.empty((3, 0)))


class ExplicitForming:
    """A forming simulation with a fluid in its pores.

    It is a :class:`lcmchain.coupling.iteration.interface.CoupledPart` whose steps consist of many
    explicit time steps. There are three ways to set the pressure:

    - ``pore_pressure`` is constant over a step. With an incompressible fluid, which determines the
      volume of an element, windows must resolve its thickness wave (:meth:`longest_window`).
    - ``pressure_at_rest`` is for longer windows. The pressure falls within the step with the rate
      of the volume, by a resistance that each element reports and that its explicit step bears, so
      that thickness waves die away. Where solid and fluid agree, the mean pressure of both is the
      same (a Robin condition on the side of the solid).
    - With ``ramped``, ``pore_pressure`` changes linearly over the step: for outer pressures that
      change slowly, in windows of any length. With a fluid that depends on the mean rate over a
      window, short windows are then unstable.

    Parameters
    ----------
    simulation : of one sheet with a thickness, whose model was built with ``pore_pressure=True``.
    surroundings : pressure around the sheet [Pa], absolute or gauge as the pressures that are set;
        the difference loads the sheet.
    ramped : whether the pressure changes linearly over a step instead of at its beginning.

    Raises
    ------
    InputError : the model has no pore pressure, or several sheets.
    """

    inputs = (PORE_PRESSURE, PRESSURE_AT_REST)

    def __init__(
        self, simulation: Simulation, *, surroundings: float = 0.0, ramped: bool = False
    ) -> None:
        model = simulation.model
        if model.pore is None:
            raise InputError("the model was built without pore_pressure=True; no fluid can act")
        self.simulation = simulation
        self.surroundings, self.ramped = float(surroundings), ramped
        self._lanes = model.pore
        self._body = self._sheet()
        self.start_anew()

    def start_anew(self) -> None:
        """Begin the next step with the present state, and forget the last step."""
        self._given, self._at_rest = self.present_pressure(), False
        self._mean, self._resistance = self._given.copy(), np.zeros(self.element_count)
        self._step = 0.0
        self._volume, self._area = self.volume(), self.area()

    def drain(self) -> None:
        """Give the fluid the pressure of the surroundings until another one is set."""
        state = self.simulation.state
        for array in (state.pore_pressure, state.pore_rate, state.pore_resistance):
            array[:] = 0.0

    def _sheet(self) -> Body:
        """Return the body whose elements are the cells.

        Raises
        ------
        InputError : there are several sheets.
        """
        bodies = self.simulation.model.bodies
        if len(bodies) != 1:
            raise InputError(
                f"the model has {len(bodies)} sheets; "
                "lcmchain.coupling.solids.stack.StackForming couples a stack with a fluid"
            )
        return bodies[0]

    @classmethod
    def from_scene(
        cls, scene: Scene, *, surroundings: float = 0.0, ramped: bool = False
    ) -> ExplicitForming:
        """Return the forming of the sheet of a scene; options as of the class."""
        simulation = Simulation(build_model(scene, pore_pressure=True))
        return cls(simulation, surroundings=surroundings, ramped=ramped)

    # --- shape ------------------------------------------------------------------------------------

    @property
    def element_count(self) -> int:
        return self.simulation.model.element_count

    def node_positions(self) -> np.ndarray:
        """Return the present positions of the nodes (node_count, 3) [m]."""
        return np.ascontiguousarray(self.simulation.state.position.T)

    def points(self) -> np.ndarray:
        """Return the present positions of the mid-surface's nodes (pair_count, 3) [m]."""
        return self._body.mesh.mid_surface(self.node_positions())

    @property
    def cells(self) -> np.ndarray:
        """Cells of the mid-surface (element_count, 4), the elements in their order; -1 is none."""
        return self._body.mesh.sheet_faces

    def normals(self) -> np.ndarray:
        """Return the unit normals of the mid-surface at the element centres (element_count, 3)."""
        base = self._body.mesh.base_vectors(self.node_positions())
        normal = np.cross(base[:, 0], base[:, 1])
        return normal / np.linalg.norm(normal, axis=1)[:, None]

    def area(self) -> np.ndarray:
        """Return the areas of the mid-surface (element_count,) [m²], as meshes have them."""
        return self._body.mesh.areas(self.node_positions())

    def volume(self) -> np.ndarray:
        """Return the volumes of the elements (element_count,) [m³]."""
        return self._volumes_and_rates()[0]

    def present_pressure(self) -> np.ndarray:
        """Return the pore pressures that act now (element_count,) [Pa]."""
        return self.simulation.state.pore_pressure[self._lanes.place] + self.surroundings

    def _pressure_in_lanes(self, pressure: np.ndarray) -> np.ndarray:
        """Return the loads on the elements by lane [Pa], from pressures of the cells (C,) [Pa]."""
        return self._lanes.in_lanes(pressure - self.surroundings)

    def _resistance_in_lanes(self) -> np.ndarray:
        return self._lanes.in_lanes(self._resistance)

    def _volumes_and_rates(self) -> tuple[np.ndarray, np.ndarray]:
        state = self.simulation.state
        volume, rate = np.empty((2, self._lanes.padded_count))
        volumes_and_rates(self._lanes, state.position, state.velocity, volume, rate)
        return volume[self._lanes.place], rate[self._lanes.place]

    def compliance(self) -> np.ndarray:
        """Return the change of volume per pressure over the last step (C,) [m³/Pa].

        It is the smaller of two estimates: by the law of compaction, with the contact of elements
        between two tools; and 2 A² dt² / m by the inertia of an element of mass m within a step.
        It speeds up an iteration and does not change its result.
        """
        area = self.area()
        inertial = 2.0 * (area * self._step) ** 2 / self._lanes.mass[self._lanes.place]
        held = 1.0 / self._static_compliance() + self._contact_stiffness(area) / area**2
        return np.minimum(1.0 / held, inertial)

    def _contact_stiffness(self, area: np.ndarray) -> np.ndarray:
        """Return the stiffness of contact on both faces against closing (element_count,) [N/m]."""
        below, above = self._touched()
        both = below + above
        series = np.divide(below * above, both, out=np.zeros_like(both), where=both > 0.0)
        return self.simulation.model.environment.penalty * area * series

    def _touched(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the parts of the lower and upper face that tools touch (element_count,) each."""
        touched = self.simulation.state.contact_force[self._body.mesh.elements] > 0.0
        return touched[:, :4].mean(axis=1), touched[:, 4:].mean(axis=1)

    def covered(self) -> np.ndarray:
        """Whether tools touch both faces of an element, at least half of each (C,)."""
        below, above = self._touched()
        return (below >= COVERED) & (above >= COVERED)

    def _next_resistance(self) -> np.ndarray:
        """Return the resistances (element_count,) [Pa s/m³] that the explicit step can bear."""
        simulation = self.simulation
        step = simulation.control.step
        mobility = np.empty(self._lanes.padded_count)
        resistance_mobilities(self._lanes, simulation.state.position, mobility)
        return 2.0 * DAMPED_SHARE / (step * mobility[self._lanes.place])

    def longest_window(self) -> float:
        """Return half the period of the fastest thickness wave of single elements [s].

        Under a pressure that is constant for longer an element swings back within the step, so that
        its change of volume no longer follows from the pressure: the coupling is unstable.
        """
        mass = self._lanes.mass[self._lanes.place]
        omega2 = 4.0 * self.area() ** 2 / (mass * self._static_compliance())
        return float(np.pi / np.sqrt(omega2.max()))

    def _static_compliance(self) -> np.ndarray:
        """Return dV/dp of the law of compaction alone (C,) [m³/Pa]."""
        return self._compliance_of(self._body)

    def _compliance_of(self, body: Body) -> np.ndarray:
        """Return V0 (A/A0)² / (λ² C33 + S33) of the elements of a body [m³/Pa]."""
        model = self.simulation.model
        history = model.history_of(body, self.simulation.state.history)
        condition = body.condition(self.simulation.state.position, history)
        stretch = condition.thickness_stretch
        strain = np.zeros((len(stretch), 6))
        strain[:, 2] = 0.5 * (stretch**2 - 1.0)
        S, C = body.material.stress_and_tangent(strain)
        place = self._lanes.place[body.first_element :][: len(stretch)]
        volume = self._lanes.mass[place] / body.material.density
        return volume * condition.area_stretch**2 / (stretch**2 * C[:, 2, 2] + S[:, 2])

    # --- coupled part -----------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self.simulation.time

    def advance(self, step: float) -> None:
        """Form for ``step`` [s] under the pressure that was set.

        Raises
        ------
        PartFailed : a guard stopped the forming.
        """
        if self.simulation.control.step == 0.0:  # compiling determines the time step
            self.simulation.compile()
        simulation, state = self.simulation, self.simulation.state
        begin = self.time
        self._volume, self._area, self._step = self.volume(), self.area(), float(step)
        given = self._pressure_in_lanes(self._given)
        self._resistance = np.zeros(self.element_count)
        if self._at_rest:
            self._resistance = self._next_resistance()
        if self.ramped:
            state.pore_rate[:] = (given - state.pore_pressure) / step
        else:
            state.pore_pressure[:] = given
        state.pore_resistance[:] = self._resistance_in_lanes()
        try:
            simulation.advance_to(self._end_of(begin, step))
        except SimulationError as error:
            raise PartFailed(
                str(error), time=begin, step=step, inputs={PORE_PRESSURE: self._given}
            ) from error
        finally:
            state.pore_rate[:] = 0.0
            state.pore_resistance[:] = 0.0
        self._mean = self._given - self._resistance * (self.volume() - self._volume) / step
        state.pore_pressure[:] = self._pressure_in_lanes(self._mean)

    def _end_of(self, begin: float, step: float) -> float:
        """Return the end of a step [s], exactly at the border of a stage where it is near one."""
        end, present = begin + step, self.simulation.model.present_stage
        borders = [] if present is None else [stage.end for stage in self.simulation.model.stages]
        return next((b for b in borders if abs(b - end) < ROUNDED_BORDER * step), end)

    def save(self) -> SavedForming:
        """Return a copy of the state, which no later step changes."""
        return SavedForming(
            self.simulation.state.copy(),
            copy.deepcopy(self.simulation.control),
            self._given.copy(),
            self._at_rest,
            self._mean.copy(),
            self._resistance.copy(),
            self._step,
            self._volume.copy(),
            self._area.copy(),
        )

    def restore(self, saved: SavedForming) -> None:
        """Go back to a saved state; going on from it is bit-identical."""
        self.simulation.restore(saved.state)
        self.simulation.control = copy.deepcopy(saved.control)
        self._given, self._at_rest = saved.given.copy(), saved.at_rest
        self._mean, self._resistance = saved.mean_pressure.copy(), saved.resistance.copy()
        self._step = saved.step
        self._volume, self._area = saved.volume.copy(), saved.area.copy()

    def set_fields(self, fields: Mapping[str, np.ndarray]) -> None:
        """Set ``pore_pressure`` or ``pressure_at_rest`` (element_count,) [Pa] for the next step.

        Raises
        ------
        InputError : another name, both, a wrong number of values, or one that is no number.
        """
        if len(fields) > 1:
            raise InputError(f"forming takes one of {' and '.join(self.inputs)}, not both")
        for name, values in fields.items():
            if name not in self.inputs:
                raise InputError(
                    f'"{name}" is no input of forming; it takes {" or ".join(self.inputs)}'
                )
            self._given = checked_field(name, values, self.element_count)
            self._at_rest = name == PRESSURE_AT_REST

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return outputs at the present time; rates are means over the last step, 0 before it.

        ``volume`` [m³], ``thickness`` (volume over area) [m], ``area`` [m²] with their ``_rate``;
        ``pore_pressure`` [Pa], the mean over the last step; ``points`` (3 N,) [m];
        ``pore_resistance`` [Pa s/m³] of the last step; for the fixed-stress split
        ``volume_rate_slope`` (an estimate, see :meth:`compliance`) and ``reference_pressure``.

        Raises
        ------
        InputError : a name that is no output.
        """
        volume, area = self.volume(), self.area()
        now = {"volume": volume, "thickness": volume / area, "area": area}
        before = {
            "volume": self._volume, "thickness": self._volume / self._area, "area": self._area
        }  # fmt: skip
        outputs = {
            PORE_PRESSURE: self._mean, REFERENCE_PRESSURE: self._mean,
            RESISTANCE: self._resistance, **now,
        }  # fmt: skip
        outputs[POINTS] = self.points().ravel()
        for name, value in now.items():
            change = value - before[name]
            outputs[f"{name}_rate"] = change / self._step if self._step else np.zeros_like(value)
        if VOLUME_RATE_SLOPE in names:
            outputs[VOLUME_RATE_SLOPE] = self.compliance() / (self._step or np.inf)
        else:
            outputs[VOLUME_RATE_SLOPE] = np.zeros_like(volume)
        return selected_fields(names, outputs)

    def places(self, name: str) -> np.ndarray | None:
        """Return the centres of the elements (element_count, 3) [m]."""
        positions = self.node_positions()[self._body.mesh.elements]
        return positions.mean(axis=1)
