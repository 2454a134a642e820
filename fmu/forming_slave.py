"""The forming simulation behind the functions of FMI 2.0 co-simulation."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_URL, uuid5
from xml.etree.ElementTree import Element
from zipfile import BadZipFile

import numpy as np
from pythonfmu import DefaultExperiment, Fmi2Slave
from pythonfmu.enums import Fmi2Status

from lcmchain import __version__
from lcmchain.elements.families import family_of
from lcmchain.errors import InputError, LcmchainError, SimulationError
from lcmchain.fields import derive_fields
from lcmchain.fingerprint import run_fingerprint
from lcmchain.fmu.frames import require_writable, with_present, write_result
from lcmchain.fmu.model_description import complete, scalar_variables
from lcmchain.fmu.saved_state import SavedState
from lcmchain.fmu.variables import Group, Kind, Variable, forming_variables, quoted
from lcmchain.mesh.blank import build_blank
from lcmchain.mesh.sheet_mesh import SheetMesh
from lcmchain.scene import Scene, read_scene
from lcmchain.solver.simulation import Simulation, Snapshot
from lcmchain.state import State
from lcmchain.threads import use_threads
from lcmchain.tools.motion import PRESCRIBED, prescribed_travel

#: File in the resources of a unit that says what it holds; written by ``fmu/build.py``.
UNIT_FILE = "unit.json"

# A master that sums up its steps drifts from ours by rounding, relative to the process time.
CLOCK_TOLERANCE = 1e-9
# A tool may go back to the motion of the scene where its travel is that of the scene [m].
TRAVEL_TOLERANCE = 1e-6


def sheet_mesh(scene: Scene) -> SheetMesh:
    """Return the mesh whose elements a unit counts: that of the model of the scene."""
    return family_of(scene.element).mesh_of(build_blank(scene.blank, scene.material.thickness))


def variables_of(scene: Scene, mesh: SheetMesh) -> tuple[Variable, ...]:
    """Return the interface of the unit that forms a scene on its :func:`sheet_mesh`."""
    tools = [(tool.name, tool.motion.kind) for tool in scene.tools]
    has_thickness = scene.element.type == "solid-shell"
    has_fraction = has_thickness and scene.material.fibre_density is not None
    return forming_variables(
        tools,
        mesh.element_count,
        has_thickness=has_thickness,
        has_fibre_volume_fraction=has_fraction,
    )


def unit_guid(scene: Scene, variables: Sequence[Variable]) -> str:
    """Return the identifier of a unit, which changes with its scene and with its interface."""
    interface = hashlib.sha256(repr(variables).encode()).hexdigest()
    return str(uuid5(NAMESPACE_URL, f"lcmchain {scene.source.sha256} {interface}"))


def _reported(method: Callable) -> Callable:
    """Let an exception reach the master as a fatal error, with its message on stderr too.

    Most masters show no log messages unless asked to. And pythonfmu gives its references to the
    slave back when an exception arrives, and once more when the instance is freed: the references
    taken here keep that from destroying objects in use.
    """

    @functools.wraps(method)
    def wrapped(self, *arguments, **keywords):
        try:
            return method(self, *arguments, **keywords)
        except Exception as error:
            self._say(str(error), Fmi2Status.fatal)
            for shared in (self, type(self), self.log_queue):
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(shared))
            raise

    return wrapped


class FormingSlave(Fmi2Slave):
    """Forms the scene in the resources of its unit.

    Value references count the scalar variables of :func:`forming_variables` in their order. Inputs
    are held constant over a communication step. Outputs are those of the last communication point.
    """

    author = "lcmchain"
    version = __version__

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._simulation: Simulation = None  # type: ignore[assignment]  # until initialization
        self._critical_step = 0.0
        self._start_time = 0.0
        self._frames: tuple[Snapshot, ...] = ()
        self._failure = ""
        try:
            self._load(Path(self.resources))
        except LcmchainError as error:
            print(f"{self.instance_name}: {error}", file=sys.stderr, flush=True)
            raise

    def _load(self, resources: Path) -> None:
        unit = json.loads((resources / UNIT_FILE).read_text(encoding="utf-8"))
        self.modelName = unit["model_name"]
        self._scene = read_scene(resources / unit["scene"], unit["overrides"])
        process = self._scene.process
        self.description = self._scene.title
        self.default_experiment = DefaultExperiment(
            start_time=0.0, stop_time=process.time, step_size=process.time / (process.frames - 1)
        )
        self._fingerprint = run_fingerprint(self._scene)
        self._variables = variables_of(self._scene, sheet_mesh(self._scene))
        self.guid = unit_guid(self._scene, self._variables)
        if self.guid != unit["guid"]:
            raise InputError(
                f"the unit was built with lcmchain {unit['lcmchain_version']}; the lcmchain "
                f"{__version__} of this environment gives it other variables: build it again",
                file=self.modelName,
            )
        self._lay_out()

    def _lay_out(self) -> None:
        """Give every variable its range of value references, and the start values."""
        self._range: dict[str, slice] = {}
        kinds: list[Kind] = []
        groups: list[Group | None] = []
        for variable in self._variables:
            first, count = len(kinds), variable.size or 1
            self._range[variable.name] = slice(first, first + count)
            kinds += [variable.kind] * count
            groups += [variable.group] * count
        self._kinds = np.array([list(Kind).index(kind) for kind in kinds])
        group_list = [None, *Group]
        self._groups = np.array([group_list.index(group) for group in groups])
        self._settable = np.zeros(len(kinds), dtype=bool)
        self._values = np.zeros(len(kinds))  # of all but texts
        self._texts: dict[int, str] = {}
        for variable in self._variables:
            if variable.causality == "output":
                continue
            index = self._range[variable.name].start
            self._settable[index] = True
            if variable.kind is Kind.STRING:
                self._texts[index] = str(variable.start)
            else:
                self._values[index] = variable.start
        self._stale = set(Group)

    # --- model description ------------------------------------------------------------------------

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """Return the model description of the unit."""
        for scalar in scalar_variables(self._variables):
            self.register_variable(scalar, nested=False)
        root = super().to_xml(model_options or {})
        complete(root, self._variables)
        root.set("generationTool", f"lcmchain {__version__} ({root.get('generationTool')})")
        return root

    # --- course of a simulation -------------------------------------------------------------------

    @_reported
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """Note when the process starts."""
        self._start_time = float(start_time)

    @_reported
    def enter_initialization_mode(self) -> None:
        """Build and compile the simulation."""
        self._require_simulation()

    @_reported
    def exit_initialization_mode(self) -> None:
        """Check where the results go, and save the start."""
        if self._out_dir is not None:
            require_writable(self._out_dir)
        self._keep_frame()

    @_reported
    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance to ``current_time + step_size`` [s] exactly.

        A step that a guard stops, or whose inputs make no sense, leaves the state of
        ``current_time`` and returns False: the master may roll back, change the inputs, or stop.
        """
        simulation = self._require_simulation()
        before = self._get_fmu_state()
        try:
            self._require_present(current_time, step_size)
            self._apply_inputs()
            use_threads(self._threads)
            simulation.advance_to(current_time + step_size - self._start_time)
            simulation.require_resolved()
        except SimulationError as error:
            self._set_fmu_state(before)
            self._failure = (
                f"{self.instance_name}: the step from {current_time:.9g} s to "
                f"{current_time + step_size:.9g} s was stopped and undone: {error}. "
                f"Inputs of the step: {self._inputs_in_words()}"
            )
            self._say(self._failure, Fmi2Status.error)
            return False
        self._failure = ""
        self._stale = set(Group)
        if simulation.control.step > 0.0:
            self._critical_step = simulation.control.step / simulation.model.step_safety
        self._keep_frame()
        return True

    @_reported
    def terminate(self) -> None:
        """Write the result if ``out_dir`` is set; a simulation that failed does not end well.

        Some masters take a discarded step for an early end. They learn here that it was none.
        """
        if self._simulation is not None and self._out_dir is not None:
            self._keep_frame(last=True)
            path = write_result(
                self._out_dir, self._scene, self._simulation, self._frames, failure=self._failure
            )
            self.log(f"{self.instance_name}: wrote {path}")
        if self._failure:
            present = 0.0 if self._simulation is None else self._simulation.time
            raise SimulationError(
                f"{self.instance_name}: the last step was stopped and undone, the results end at "
                f"{present + self._start_time:.9g} s"
            )

    @property
    def _threads(self) -> int | None:
        return int(self._values[self._range["threads"].start]) or None

    @property
    def _out_dir(self) -> Path | None:
        text = self._texts[self._range["out_dir"].start]
        return Path(text) if text else None

    def _require_simulation(self) -> Simulation:
        if self._simulation is None:
            threads = use_threads(self._threads)
            simulation = Simulation.from_scene(self._scene)
            simulation.compile()
            self._critical_step = simulation.critical_step()
            self._simulation = simulation
            self.log(
                f"{self.instance_name}: {self._scene.title}, {simulation.model.element_count} "
                f"elements, {threads} threads"
            )
        return self._simulation

    def _require_present(self, current_time: float, step_size: float) -> None:
        present = self._simulation.time + self._start_time
        if abs(current_time - present) > CLOCK_TOLERANCE * self._scene.process.time:
            raise SimulationError(
                f"the unit stands at {present:.9g} s, not at {current_time:.9g} s; go on from "
                "there, or restore a state of that time"
            )
        if step_size < 0.0:
            raise SimulationError(f"the step size is negative ({step_size:g} s)")

    def _keep_frame(self, *, last: bool = False) -> None:
        if self._out_dir is not None:
            self._frames = with_present(self._frames, self._simulation, self._scene, last=last)

    def _say(self, message: str, status: Fmi2Status) -> None:
        self.log(message, status)
        print(message, file=sys.stderr, flush=True)

    # --- inputs -----------------------------------------------------------------------------------

    def _input(self, tool: str, suffix: str) -> float:
        """Value of an input of a tool, 0 where the tool has no such input."""
        where = self._range.get(f"{quoted(tool)}.{suffix}")
        return 0.0 if where is None else float(self._values[where.start])

    def _apply_inputs(self) -> None:
        for variable in self._variables:
            if variable.causality == "input":
                value = self._values[self._range[variable.name].start]
                if not math.isfinite(value):
                    raise SimulationError(f"the input {variable.name} is {value}")
        model, state = self._simulation.model, self._simulation.state
        for index, tool in enumerate(model.tool_names):
            state.driven[index] = int(self._input(tool, "drive"))
            state.tool_input[index] = (
                self._input(tool, "velocity_input"),
                self._input(tool, "force_input"),
            )
            if not state.driven[index] and model.tools.motion_kind[index] == PRESCRIBED:
                travel = prescribed_travel(model.tools, index, self._simulation.time)[0]
                jump = travel - state.tool_travel[index]
                if abs(jump) > TRAVEL_TOLERANCE:
                    raise SimulationError(
                        f"{tool} would jump by {1e3 * jump:.4g} mm to the motion of the scene; "
                        f"keep {quoted(tool)}.drive true, or drive it to where the scene has it "
                        "before"
                    )

    def _inputs_in_words(self) -> str:
        values = self._settings("input")
        return ", ".join(f"{name} = {value}" for name, value in values.items()) or "none"

    def _settings(self, *causalities: str) -> dict[str, float | int | bool | str]:
        """Values of parameters or inputs, by name."""
        getters = {
            Kind.REAL: self.get_real,
            Kind.INTEGER: self.get_integer,
            Kind.BOOLEAN: self.get_boolean,
            Kind.STRING: self.get_string,
        }
        return {
            variable.name: getters[variable.kind]([self._range[variable.name].start])[0]
            for variable in self._variables
            if variable.causality in causalities
        }

    # --- outputs ----------------------------------------------------------------------------------

    def _refresh(self, group: Group) -> None:
        """Compute the outputs of a group for the present state; 0 before initialization."""
        if group not in self._stale or self._simulation is None:
            return
        compute: dict[Group, Callable[[], Mapping[str, Any]]] = {
            Group.TOOLS: self._tool_outputs,
            Group.ENERGY: self._energy_outputs,
            Group.FIELDS: self._field_outputs,
            Group.SOLVER: self._solver_outputs,
        }
        for name, value in compute[group]().items():
            if name in self._range:
                self._values[self._range[name]] = value
        self._stale.discard(group)

    def _tool_outputs(self) -> dict[str, float]:
        model, state = self._simulation.model, self._simulation.state
        values = {}
        for index, tool in enumerate(model.tool_names):
            force = state.tool_force[index]
            prefix = quoted(tool)
            values[f"{prefix}.travel"] = state.tool_travel[index]
            values[f"{prefix}.velocity"] = state.tool_velocity[index]
            values[f"{prefix}.force"] = force @ model.tools.direction[index]
            values |= {f"{prefix}.force_{axis}": part for axis, part in zip("xyz", force)}
        return values

    def _energy_outputs(self) -> dict[str, float]:
        energy = self._simulation.energy()
        return {
            "kinetic_energy": energy["kinetic"],
            "internal_energy": energy["internal"],
            "hourglass_energy": energy["hourglass"],
            "external_work": energy["external"],
            "energy_balance_error": energy["balance_error"],
        }

    def _field_outputs(self) -> dict[str, float | np.ndarray]:
        model = self._simulation.model
        state = self._simulation.state
        position = np.ascontiguousarray(state.position.T)
        fields = derive_fields(model.blank, model.material, position)
        values = {"shear_angle_max": np.abs(fields["shear_angle"]).max()}
        for name in ("thickness", "fibre_volume_fraction"):
            if name in fields:
                field = fields[name]
                values |= {name: field, f"{name}_min": field.min(), f"{name}_max": field.max()}
        return values

    def _solver_outputs(self) -> dict[str, float]:
        return {
            "critical_time_step": self._critical_step,
            "step_count": self._simulation.state.step_count,
        }

    # --- access by value reference ----------------------------------------------------------------

    @_reported
    def get_real(self, vrs: list[int]) -> list[float]:
        """Return the values of real variables, all in one look-up."""
        return self._numbers(vrs, Kind.REAL).tolist()

    @_reported
    def get_integer(self, vrs: list[int]) -> list[int]:
        """Return the values of integer variables."""
        return self._numbers(vrs, Kind.INTEGER).astype(int).tolist()

    @_reported
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """Return the values of boolean variables."""
        return self._numbers(vrs, Kind.BOOLEAN).astype(bool).tolist()

    @_reported
    def get_string(self, vrs: list[int]) -> list[str]:
        """Return the values of text variables."""
        self._require_kind(np.asarray(vrs, dtype=int), Kind.STRING)
        return [self._texts[vr] for vr in vrs]

    @_reported
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set real inputs."""
        self._set_numbers(vrs, values, Kind.REAL)

    @_reported
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set integer parameters."""
        self._set_numbers(vrs, values, Kind.INTEGER)

    @_reported
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """Set boolean inputs."""
        self._set_numbers(vrs, values, Kind.BOOLEAN)

    @_reported
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """Set text parameters."""
        self._require_kind(np.asarray(vrs, dtype=int), Kind.STRING)
        self._texts.update(zip(vrs, values))

    def _numbers(self, vrs: list[int], kind: Kind) -> np.ndarray:
        indices = np.asarray(vrs, dtype=int)
        self._require_kind(indices, kind)
        for number in np.unique(self._groups[indices]):
            if number > 0:
                self._refresh(list(Group)[number - 1])
        return self._values[indices]

    def _set_numbers(self, vrs: list[int], values: list, kind: Kind) -> None:
        indices = np.asarray(vrs, dtype=int)
        self._require_kind(indices, kind)
        if not self._settable[indices].all():
            vr = int(indices[~self._settable[indices]][0])
            raise SimulationError(f"the variable with value reference {vr} cannot be set")
        self._values[indices] = values

    def _require_kind(self, indices: np.ndarray, kind: Kind) -> None:
        known = (indices >= 0) & (indices < len(self._kinds))
        fits = known & (self._kinds[np.where(known, indices, 0)] == list(Kind).index(kind))
        if not fits.all():
            vr = int(indices[~fits][0])
            raise SimulationError(f"no {kind.value} variable has the value reference {vr}")

    # --- rollback ---------------------------------------------------------------------------------

    @_reported
    def _get_fmu_state(self) -> SavedState:
        simulation = self._simulation
        return SavedState(
            guid=self.guid,
            fingerprint=self._fingerprint,
            state=None if simulation is None else simulation.state.copy(),
            critical_step=self._critical_step,
            values=self._settings("parameter", "input"),
            start_time=self._start_time,
            frames=self._frames,
            failure=self._failure,
        )

    @_reported
    def _set_fmu_state(self, saved: SavedState) -> None:
        if saved.guid != self.guid:
            raise SimulationError(f"{self.instance_name}: the state is that of another unit")
        if saved.fingerprint != self._fingerprint:
            raise SimulationError(
                f"{self.instance_name}: the state was saved with "
                f"{saved.fingerprint.difference(self._fingerprint)}; simulate up to it anew"
            )
        if saved.state is not None:
            self._require_simulation().restore(saved.state)
        elif self._simulation is not None:
            self._simulation.restore(State.at_rest(self._simulation.model))
        self._critical_step = saved.critical_step
        self._start_time = saved.start_time
        self._frames = saved.frames
        self._failure = saved.failure
        for name, value in saved.values.items():
            index = self._range[name].start
            if isinstance(value, str):
                self._texts[index] = value
            else:
                self._values[index] = value
        self._stale = set(Group)

    @staticmethod
    def _fmu_state_to_bytes(state: SavedState) -> bytes:
        return state.to_bytes()

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> SavedState:
        try:
            return SavedState.from_bytes(state)
        except (OSError, EOFError, BadZipFile, ValueError, KeyError, TypeError) as error:
            raise LcmchainError(f"this is no saved state of a forming unit ({error})") from None
