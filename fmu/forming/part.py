"""The forming simulation as the physics of a unit."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_URL, uuid5

import numpy as np

from lcmchain.coupling.forming_fields import forming_datasets
from lcmchain.coupling.iteration.interface import (
    PORE_PRESSURE,
    PRESSURE_AT_REST,
    REFERENCE_PRESSURE,
)
from lcmchain.coupling.solids.explicit import ExplicitForming, SavedForming
from lcmchain.coupling.solids.stack import forming_of_scene
from lcmchain.elements.family import Body
from lcmchain.errors import InputError, SimulationError
from lcmchain.fields import derive_fields, write_forming_netcdf
from lcmchain.fields.between_plies import BetweenPlies, ContactOfFaces
from lcmchain.fields.stack import StackedPly, columns_of
from lcmchain.fmu.conduct import Status
from lcmchain.fmu.forming.interface import at_interface
from lcmchain.fmu.forming.scene_parameters import SceneParameter, overrides, scene_parameters
from lcmchain.fmu.forming.variables import (
    AT_REST,
    BETWEEN,
    BETWEEN_SCALARS,
    ENERGY,
    FIELDS,
    FLUID,
    FLUID_OUTPUTS,
    GRIPPERS,
    HOLDS,
    MEANS,
    RATES,
    SOLVER,
    STACK,
    TOOLS,
    surroundings_of,
    variables_of,
)
from lcmchain.fmu.part import (
    INTERFACE_FILE,
    Part,
    PartState,
    UnitDefinition,
    named_arrays,
)
from lcmchain.fmu.variables import Outputs, Variable, quoted
from lcmchain.mapping.interface import Interface, read_interface
from lcmchain.model import build_model
from lcmchain.provenance import run_fingerprint
from lcmchain.results import COMPLETE, stopped
from lcmchain.scene import Scene, read_scene
from lcmchain.solver.histories import grip_forces, grippers_at_work, let_go_times, of_grips
from lcmchain.solver.simulation import Simulation, Snapshot, StepControl
from lcmchain.state import STOPPED_TIME, State
from lcmchain.tools.motion import PRESCRIBED, prescribed_travel
from lcmchain.tools.table import turning

# A tool may go back to the motion of the scene where its travel is that of the scene [m].
TRAVEL_TOLERANCE = 1e-6

# Communication points seldom hit the times of the scene's frames exactly.
TIME_TOLERANCE = 1e-6

#: Name of the file of the results, as that of a run.
RESULT_FILE = "forming.nc"

# Entries of a saved state that the simulation itself keeps.
_OF_SIMULATION = ("state", "control")


@dataclasses.dataclass(frozen=True)
class BeforeStep:
    """What the state was before a step of the master: copies of arrays of the same names."""

    position: np.ndarray
    tool_impulse: np.ndarray
    tool_moment_impulse: np.ndarray
    gripper_impulse: np.ndarray
    support_impulse: np.ndarray

    @classmethod
    def of(cls, state: State) -> BeforeStep:
        """Copy it from a state."""
        names = [entry.name for entry in dataclasses.fields(cls)]
        return cls(**{name: getattr(state, name).copy() for name in names})


def define_forming(unit: Mapping[str, Any], resources: Path) -> tuple[UnitDefinition, Part]:
    """Return what a forming unit is, from its file and its resources."""
    path = resources / unit["scene"]
    scene = read_scene(path, unit["overrides"])
    fields, pore_pressure = unit["fields"], bool(unit["pore_pressure"])
    interface = read_interface(resources / INTERFACE_FILE)
    count = interface.size if interface.is_coarse else 0
    variables = variables_of(scene, fields, pore_pressure=pore_pressure, patch_count=count)
    fingerprint = run_fingerprint(scene)
    definition = UnitDefinition(
        guid=unit_guid(scene, variables),
        fingerprint={
            "scene": fingerprint.scene,
            "contents of the mesh files of its tools, or of its drawings": fingerprint.files,
            "source files of lcmchain": fingerprint.sources,
        },
        title=scene.title,
        model_name=unit["model_name"],
        variables=variables,
        stop_time=scene.process.time,
        step_size=scene.process.time / (scene.process.frames - 1),
    )
    part = FormingPart(scene, path, unit["overrides"], interface, pore_pressure=pore_pressure)
    return definition, part


def unit_guid(scene: Scene, variables: Sequence[Variable]) -> str:
    """Return the identifier of a unit, which changes with its scene and with its interface."""
    interface = hashlib.sha256(repr(variables).encode()).hexdigest()
    return str(uuid5(NAMESPACE_URL, f"lcmchain {scene.source.sha256} {interface}"))


class FormingPart(Part):
    """Forms a scene; with a fluid in its pores as the solid side of a coupling does.

    Parameters
    ----------
    scene : as built. path, overrides : where it was read, for values that a master sets.
    interface : at which fields are exchanged.
    pore_pressure : whether a fluid may act.
    """

    def __init__(
        self,
        scene: Scene,
        path: Path,
        given: Sequence[str],
        interface: Interface,
        *,
        pore_pressure: bool,
    ) -> None:
        self._interface = interface
        self._built_scene, self._path, self._given = scene, path, list(given)
        self._has_pores = pore_pressure
        self._parameters: tuple[SceneParameter, ...] = scene_parameters(scene)
        self.scene = scene
        self.simulation: Simulation = None  # type: ignore[assignment]  # until it is built
        self.wet: ExplicitForming | None = None
        self.critical_step = 0.0
        self.frames: tuple[Snapshot, ...] = ()
        self.before: BeforeStep = None  # type: ignore[assignment]  # until it is built
        self.step = 0.0  # length of the last one [s]
        self._unheard: set[str] = set()  # tools whose inputs drive nothing, and that were told

    # --- course -----------------------------------------------------------------------------------

    def build(self) -> None:
        """Build and compile the simulation of the scene with the values that the master has set."""
        values = {p.variable.name: self.values.number(p.variable.name) for p in self._parameters}
        changed = overrides(self._parameters, values)
        scene = self._built_scene
        if changed:
            scene = read_scene(self._path, [*self._given, *changed])
        model = build_model(scene, pore_pressure=True) if self._has_pores else build_model(scene)
        simulation = Simulation(model)
        self.scene, self.simulation = scene, simulation
        threads = self.use_threads()
        self.say(
            f"{scene.title}, {self.element_count} elements, {threads} threads; compiling or "
            "loading the compiled loops (about a minute the first time, then less than a second)",
            aloud=True,
        )
        self.wet = None
        if self._has_pores:
            self.wet = forming_of_scene(scene, simulation, surroundings=surroundings_of(scene))
        simulation.compile()  # with the columns of a stack, whose loop is another one
        self.critical_step = simulation.critical_step()
        self.frames, self.step = (), 0.0
        self.before = BeforeStep.of(simulation.state)

    @property
    def element_count(self) -> int | None:
        return self.simulation.model.element_count

    def begin(self) -> None:
        """Check where the results go, and save the start."""
        self.prepare_result(RESULT_FILE)
        self._keep_frame()

    @property
    def present(self) -> float:
        """Time since the start [s]."""
        return self.simulation.time

    def advance(self, size: float) -> None:
        """Form for ``size`` [s]; a guard may stop it."""
        simulation = self.simulation
        self._apply_inputs(size)
        self.before = BeforeStep.of(simulation.state)
        if self.wet is not None:
            pressure = self.values.field(PORE_PRESSURE)
            if self._interface.is_coarse:
                pressure = self._interface.spread(pressure)
            at_rest = bool(self.values.number(AT_REST))
            self.wet.set_fields({PRESSURE_AT_REST if at_rest else PORE_PRESSURE: pressure})
            self.wet.advance(size)
            simulation.require_resolved()
        else:
            simulation.advance_to(self.target, lambda _: simulation.require_resolved())
        self.step = size
        if simulation.control.step > 0.0:
            self.critical_step = simulation.control.step / simulation.model.step_safety
        self._keep_frame()

    def finish(self, failure: str) -> None:
        """Write ``forming.nc`` if ``out_dir`` is set."""
        if self.out_dir is None:
            return
        self._keep_frame(last=True)
        path = write_result(self.out_dir, self.scene, self.simulation, self.frames, failure=failure)
        self.result_written(path)

    def capture(self) -> PartState:
        """Return a copy of the state; what is never changed in place is shared."""
        state = self.simulation.state
        arrays = {f"state_{name}": array.copy() for name, array in state.as_dict().items()}
        arrays |= {f"before_{name}": array for name, array in vars(self.before).items()}
        values: dict[str, Any] = {
            "critical_step": self.critical_step,
            "step": self.step,
            "control": dataclasses.asdict(self.simulation.control),
            "frame_time": [frame.time for frame in self.frames],
            "frame_energy": [frame.energy for frame in self.frames],
        }
        for number, frame in enumerate(self.frames):
            arrays |= {f"frame_{number}_{name}": array for name, array in frame.arrays.items()}
        if self.wet is not None:
            for name, value in _beside_the_simulation(self.wet.save()).items():
                (arrays if isinstance(value, np.ndarray) else values)[f"wet_{name}"] = value
        return PartState(values, arrays)

    def reinstate(self, saved: PartState) -> None:
        """Go back to a captured state.

        Raises
        ------
        InputError : it is that of another model.
        """
        values, arrays = saved.values, saved.arrays
        try:
            state = State.from_arrays(named_arrays(arrays, "state_"))
            frames = tuple(
                Snapshot(float(time), dict(energy), named_arrays(arrays, f"frame_{number}_"))
                for number, (time, energy) in enumerate(
                    zip(values["frame_time"], values["frame_energy"], strict=True)
                )
            )
            control = StepControl(**values["control"])
            control.history = dict(control.history)
            before = BeforeStep(**named_arrays(arrays, "before_"))
            step, critical = values["step"], values["critical_step"]
            wet = None if self.wet is None else _wet(state, control, saved)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"the saved state is not that of a forming unit ({error})") from None
        present = vars(BeforeStep.of(self.simulation.state))
        if any(vars(before)[name].shape != array.shape for name, array in present.items()):
            raise InputError("the saved state belongs to another model")
        if self.wet is None or wet is None:
            self.simulation.restore(state)
            self.simulation.control = control
        else:
            self.wet.restore(wet)
        self.before, self.step, self.critical_step = before, float(step), float(critical)
        self.frames = frames

    def _keep_frame(self, *, last: bool = False) -> None:
        if self.out_dir is not None:
            self.frames = with_present(self.frames, self.simulation, self.scene, last=last)

    # --- inputs -----------------------------------------------------------------------------------

    def _apply_inputs(self, size: float) -> None:
        model, state = self.simulation.model, self.simulation.state
        for index, tool in enumerate(model.tool_names):
            prefix = quoted(tool)
            drive, to_position, velocity, position, force = (
                self.values.number(f"{prefix}.{suffix}")
                for suffix in (
                    "drive", "drive_to_position", "velocity_input", "position_input", "force_input",
                )
            )  # fmt: skip
            if drive and to_position:
                raise SimulationError(
                    f"{prefix}.drive and {prefix}.drive_to_position are both true; the tool "
                    "follows one of them"
                )
            if to_position:
                velocity = (position - state.tool_travel[index]) / size
            state.driven[index] = int(bool(drive or to_position))
            if (velocity or position) and not state.driven[index] and tool not in self._unheard:
                self._unheard.add(tool)
                self.say(
                    f"{prefix}.velocity_input and {prefix}.position_input do nothing as long as "
                    f"neither {prefix}.drive nor {prefix}.drive_to_position is true: the tool "
                    "follows the scene",
                    Status.WARNING,
                )
            state.tool_input[index] = velocity, force
            stopped = state.tool_stopped[index, model.stage, STOPPED_TIME] <= state.time
            led = model.tools.motion_kind[index] == PRESCRIBED and not stopped
            if not state.driven[index] and led:
                self._require_no_jump(index, tool)

    def _require_no_jump(self, index: int, tool: str) -> None:
        travel = prescribed_travel(self.simulation.model.tools, index, self.simulation.time)[0]
        jump = travel - self.simulation.state.tool_travel[index]
        if abs(jump) > TRAVEL_TOLERANCE:
            turns = bool(turning(self.simulation.model.tools)[index])
            way = f"{math.degrees(jump):.4g} degrees" if turns else f"{1e3 * jump:.4g} mm"
            raise SimulationError(
                f"{tool} would jump by {way} to the motion of the scene; keep "
                f"{quoted(tool)}.drive true, or drive it to where the scene has it before"
            )

    # --- outputs ----------------------------------------------------------------------------------

    def outputs(self, group: str) -> Outputs:
        """Return the outputs of a group by name."""
        compute: dict[str, Callable[[], Outputs]] = {
            TOOLS: self._tool_outputs,
            ENERGY: self._energy_outputs,
            FIELDS: self._field_outputs,
            RATES: self._rate_outputs,
            SOLVER: self._solver_outputs,
            FLUID: self._fluid_outputs,
            STACK: self._stack_outputs,
            BETWEEN: self._between_outputs,
            GRIPPERS: self._gripper_outputs,
            MEANS: self._mean_outputs,
        }
        return at_interface(self._interface, compute[group](), self.step)

    def _tool_outputs(self) -> dict[str, float]:
        model, state = self.simulation.model, self.simulation.state
        values = {}
        for index, tool in enumerate(model.tool_names):
            force = state.tool_force[index]
            prefix = quoted(tool)
            if turning(model.tools)[index]:
                values[f"{prefix}.angle"] = state.tool_travel[index]
                values[f"{prefix}.angular_velocity"] = state.tool_velocity[index]
                values[f"{prefix}.moment"] = state.tool_moment[index]
            else:
                values[f"{prefix}.travel"] = state.tool_travel[index]
                values[f"{prefix}.velocity"] = state.tool_velocity[index]
                values[f"{prefix}.force"] = force @ model.tools.direction[index]
            values |= {f"{prefix}.force_{axis}": part for axis, part in zip("xyz", force)}
        return values

    def _mean_outputs(self) -> dict[str, float]:
        """Forces and moments, from what their impulses grew by in the step; 0 before the first."""
        model, state, before = self.simulation.model, self.simulation.state, self.before
        length = self.step or math.inf
        forces = (state.tool_impulse - before.tool_impulse) / length
        moments = (state.tool_moment_impulse - before.tool_moment_impulse) / length
        values: dict[str, float] = {}
        for index, tool in enumerate(model.tool_names):
            prefix = f"{quoted(tool)}.mean_"
            if turning(model.tools)[index]:
                values[f"{prefix}moment"] = moments[index]
            else:
                values[f"{prefix}force"] = forces[index] @ model.tools.direction[index]
            values |= {f"{prefix}force_{axis}": part for axis, part in zip("xyz", forces[index])}
        pulls = (state.gripper_impulse - before.gripper_impulse) / length
        holds = (state.support_impulse - before.support_impulse) / length
        for grip, force in zip(model.grips, of_grips(model, pulls, holds), strict=True):
            prefix = f"{quoted(grip.name)}.mean_"
            values |= {f"{prefix}grip_force_{axis}": part for axis, part in zip("xyz", force)}
        return values

    def _gripper_outputs(self) -> dict[str, float]:
        """Force on the blank, way of the place since the start, and whether it holds."""
        model, state = self.simulation.model, self.simulation.state
        values: dict[str, float] = {}
        grips = zip(
            model.grips, grip_forces(model, state), let_go_times(model, state),
            grippers_at_work(model), strict=True,
        )  # fmt: skip
        for grip, force, let_go, works in grips:
            prefix = quoted(grip.name)
            travel = state.position[:, grip.nodes] @ grip.weights - grip.place
            values |= {f"{prefix}.grip_force_{axis}": part for axis, part in zip("xyz", force)}
            values |= {f"{prefix}.grip_travel_{axis}": part for axis, part in zip("xyz", travel)}
            values[f"{prefix}.{HOLDS}"] = float(works and math.isinf(let_go))
        return values

    def _energy_outputs(self) -> dict[str, float]:
        energy = self.simulation.energy()
        return {
            "kinetic_energy": energy["kinetic"],
            "internal_energy": energy["internal"],
            "hourglass_energy": energy["hourglass"],
            "external_work": energy["external"],
            "energy_balance_error": energy["balance_error"],
        }

    @property
    def _prefixes(self) -> list[str]:
        """Prefixes of the outputs of each body: the name of its ply in a stack, else empty."""
        bodies = self.simulation.model.bodies
        return [f"{quoted(body.name)}." for body in bodies] if len(bodies) > 1 else [""]

    def _fields_at(self, position: np.ndarray) -> list[dict[str, np.ndarray]]:
        """Return the fields of each body at positions of all nodes (3, node_count)."""
        return [
            derive_fields(body.mesh, body.material, _own(body, position))
            for body in self.simulation.model.bodies
        ]

    def _field_outputs(self) -> dict[str, float | np.ndarray]:
        position = self.simulation.state.position
        bodies, each = self.simulation.model.bodies, self._fields_at(position)
        values: dict[str, float | np.ndarray] = {}
        for prefix, body, fields in zip(self._prefixes, bodies, each, strict=True):
            for name in ("shear_angle", "thickness", "fibre_volume_fraction"):
                if name in fields:
                    values[f"{prefix}{name}"] = fields[name]
                    values |= _extrema(f"{prefix}{name}", fields[name])
            if f"{prefix}position_x" in self.values.layout.slots:
                centres = _own(body, position)[body.mesh.elements].mean(axis=1)
                values |= {f"{prefix}position_{axis}": x for axis, x in zip("xyz", centres.T)}
        if len(bodies) > 1:
            for name in ("shear_angle", "thickness", "fibre_volume_fraction"):
                known = [fields[name] for fields in each if name in fields]
                values |= _extrema(name, np.concatenate(known)) if known else {}
        return values

    def _stack_outputs(self) -> dict[str, float | np.ndarray]:
        """Sums over the plies that lie over each other, on the elements of every ply."""
        position, stage = self.simulation.state.position, self.simulation.model.present_stage
        absent = None if stage is None else stage.absent
        plies = [
            StackedPly.of_mesh(
                body.mesh, body.material, _own(body, position)[None], fields,
                None if absent is None else np.array([not absent[body.first_node]]),
            )
            for body, fields in zip(
                self.simulation.model.bodies, self._fields_at(position), strict=True
            )
        ]  # fmt: skip
        columns = columns_of(plies)
        values: dict[str, float | np.ndarray] = {}
        for name in ("thickness", "fibre_volume_fraction"):
            of_plies = [getattr(column, name) for column in columns]
            if all(field is not None for field in of_plies):
                values[f"stack_{name}"] = np.concatenate(of_plies, axis=1)[0]
                values |= _extrema(f"stack_{name}", np.concatenate(of_plies, axis=1)[0])
        return values

    def _between_outputs(self) -> dict[str, float]:
        """Contact between plies, as in ``summary.json`` of a run that ends here."""
        model, state = self.simulation.model, self.simulation.state
        prefixes, of_all = self._prefixes, ContactOfFaces()
        each = [ContactOfFaces() for _ in prefixes]
        if model.ply_contact is not None:
            rows = self.simulation.between_plies(model.ply_contact.data)[None]
            names = [body.name for body in model.bodies]
            for body, own in zip(model.bodies, each, strict=True):
                faces = BetweenPlies.of_body(body, state.position.T[None], rows, names)
                for nodes in body.mesh.sides().values():
                    faces.add_to(own, nodes)
                    faces.add_to(of_all, nodes)
        values: dict[str, float] = {}
        for prefix, contact in zip([*prefixes, ""], [*each, of_all], strict=True):
            measures = list(contact.measures().values()) or [0.0] * len(BETWEEN_SCALARS)
            for (name, *_), value in zip(BETWEEN_SCALARS, measures, strict=True):
                values[f"{prefix}{name}"] = value
        return values

    def _rate_outputs(self) -> dict[str, np.ndarray]:
        rates = {}
        each, before = self._fields_at(self.simulation.state.position), None
        if self.step > 0.0:
            before = self._fields_at(self.before.position)
        for index, (prefix, fields) in enumerate(zip(self._prefixes, each, strict=True)):
            if "thickness" not in fields:
                continue
            now, rate = fields["thickness"], np.zeros_like(fields["thickness"])
            if before is not None:
                rate = (now - before[index]["thickness"]) / self.step
            rates[f"{prefix}thickness_rate"] = rate
        return rates

    def _fluid_outputs(self) -> dict[str, np.ndarray]:
        assert self.wet is not None
        names = {e[0]: e[0].removeprefix("fluid_") for e in FLUID_OUTPUTS}
        fields = self.wet.get_fields(list(names.values()))
        assert REFERENCE_PRESSURE in fields
        return {own: fields[name] for own, name in names.items()}

    def _solver_outputs(self) -> dict[str, float]:
        return {
            "critical_time_step": self.critical_step,
            "step_count": self.simulation.state.step_count,
        }


def _own(body: Body, position: np.ndarray) -> np.ndarray:
    """Return a body's part (n, 3) of the positions of all nodes (3, node_count)."""
    nodes = slice(body.first_node, body.first_node + body.mesh.node_count)
    return np.ascontiguousarray(position[:, nodes].T)


def _extrema(name: str, field: np.ndarray) -> dict[str, float]:
    """Return the extrema of a field by the names of their outputs."""
    if name.rpartition(".")[2] == "shear_angle":  # signed: what counts is its size
        return {f"{name}_max": np.abs(field).max()}
    return {f"{name}_min": field.min(), f"{name}_max": field.max()}


def _wet(state: State, control: StepControl, saved: PartState) -> SavedForming:
    held = {**saved.arrays, **saved.values}
    names = [
        entry.name for entry in dataclasses.fields(SavedForming) if entry.name not in _OF_SIMULATION
    ]
    return SavedForming(state, control, **{name: held[f"wet_{name}"] for name in names})


def _beside_the_simulation(saved: SavedForming) -> dict[str, Any]:
    """Return what a part of a coupling keeps beside the state of its simulation."""
    return {
        entry.name: getattr(saved, entry.name)
        for entry in dataclasses.fields(saved)
        if entry.name not in _OF_SIMULATION
    }


# --- saved frames, and the result file ------------------------------------------------------------


def with_present(
    frames: tuple[Snapshot, ...], simulation: Simulation, scene: Scene, *, last: bool = False
) -> tuple[Snapshot, ...]:
    """Append the present if a frame interval of the scene has passed, or if it is the last one."""
    if frames:
        waited = simulation.time - frames[-1].time
        interval = _interval_after(frames[-1].time, scene)
        if waited <= 0.0 or (not last and waited < interval * (1.0 - TIME_TOLERANCE)):
            return frames
    return (*frames, simulation.snapshot())


def _interval_after(time: float, scene: Scene) -> float:
    """Return the time from a frame [s] to the next one of the scene: that of a stage at its end."""
    if not scene.stages:
        return scene.process.time / (scene.process.frames - 1)
    times = scene.frame_times
    after = np.searchsorted(times, time + TIME_TOLERANCE * scene.process.time)
    return float(times[min(int(after), len(times) - 1)]) - time


def write_result(
    folder: Path,
    scene: Scene,
    simulation: Simulation,
    frames: tuple[Snapshot, ...],
    *,
    failure: str = "",
) -> Path:
    """Write ``forming.nc`` as a run does, with the saved frames, and return its path.

    failure : why the last step was undone, if it was.
    """
    state = _state_of(scene, simulation, failure)
    path = folder / RESULT_FILE
    write_forming_netcdf(path, forming_datasets(scene, simulation, frames, state=state))
    return path


def _state_of(scene: Scene, simulation: Simulation, failure: str) -> str:
    """Return what became of the process, in the words of a run's results."""
    if failure:
        return stopped(failure)
    if simulation.time < scene.process.time * (1.0 - TIME_TOLERANCE):
        return stopped(
            f"the master ended the simulation after {1e3 * simulation.time:.4g} of "
            f"{1e3 * scene.process.time:.4g} ms"
        )
    return COMPLETE
