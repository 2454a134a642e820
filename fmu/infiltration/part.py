"""The infiltration as the physics of a unit."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_URL, uuid5

import numpy as np

from lcmchain.coupling.filling_part import FillingPart, SavedFilling
from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Schedule, Vent
from lcmchain.coupling.infiltration.flow.state import DrySpot, FillingState
from lcmchain.coupling.infiltration.formed_part import read_part
from lcmchain.coupling.infiltration.report import filling_report
from lcmchain.coupling.infiltration.results import FilledPart, FillingRecord
from lcmchain.coupling.infiltration.setup import FillingSetup, set_up
from lcmchain.coupling.infiltration.stage import (
    ENDING,
    fingerprint_of,
    is_frame_due,
    node_areas,
    write_filling,
)
from lcmchain.coupling.iteration.checkpoint import flattened, restored
from lcmchain.coupling.iteration.interface import (
    PORE_PRESSURE,
    PRESSURE_AT_REST,
    REFERENCE_PRESSURE,
    RESISTANCE,
    VOLUME_RATE,
    VOLUME_RATE_SLOPE,
)
from lcmchain.errors import InputError
from lcmchain.fmu.infiltration.variables import (
    FIELDS,
    FRONT,
    PLACES,
    SUMS,
    Abilities,
    Motion,
    infiltration_variables,
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
from lcmchain.scene import read_scene
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.reading.single_tables import read_infiltration

#: Folder of the formed part in the resources, by :mod:`lcmchain.fmu.infiltration.build`.
PART_FOLDER = "part"

#: Fields that the filling takes where the master moves the volume of its cells.
VOLUME_INPUTS = (VOLUME_RATE, VOLUME_RATE_SLOPE, REFERENCE_PRESSURE, RESISTANCE)

#: Schedule of a gate or vent that the master has shut: it never opens.
SHUT = Schedule(-2.0, -1.0)

RECORDS = {record.__name__: record for record in (SavedFilling, FillingState, DrySpot)}


def define_infiltration(
    unit: Mapping[str, Any], resources: Path
) -> tuple[UnitDefinition, InfiltrationPart]:
    """Return what an infiltration unit is, from its file and its resources."""
    case, directory = _read_case(unit, resources)
    setup = set_up(read_part(resources / PART_FOLDER), case, directory)
    interface = read_interface(resources / INTERFACE_FILE)
    title = f"{setup.part.dataset.attrs.get('title', '')}: {unit['name']}".lstrip(": ")
    abilities = Abilities(
        gates=[(gate.name, gate.flow_rate is not None) for gate in setup.gates],
        vents=[vent.name for vent in setup.vents],
        size=interface.size,
        cell_count=setup.mesh.cell_count,
        title=title,
        motion=unit["motion"],
    )
    variables = infiltration_variables(abilities, unit["fields"])
    hashes = fingerprint_of(setup)
    definition = UnitDefinition(
        guid=_guid(hashes, interface, variables),
        fingerprint={f"{what} of the filling": text for what, text in hashes.items()},
        title=title,
        model_name=unit["model_name"],
        variables=variables,
        stop_time=case.time,
        step_size=case.frame_interval or case.time / (case.frames - 1),
    )
    return definition, InfiltrationPart(setup, interface, unit["motion"], unit["name"])


def _read_case(unit: Mapping[str, Any], resources: Path) -> tuple[Infiltration, Path]:
    """Return the infiltration of a unit, and the folder to which its file names are relative."""
    path = resources / unit["case"]
    if unit["entry"] is None:
        return read_infiltration(path, unit["overrides"]), path.parent
    return read_scene(path, unit["overrides"]).infiltrations[unit["entry"]][0], path.parent


def _guid(hashes: Mapping[str, str], interface: Interface, variables: Sequence[Variable]) -> str:
    """Return an identifier that changes with part, case and interface, not with the version."""
    digest = hashlib.sha256(repr(variables).encode())
    digest.update(interface.patches.of_cell.tobytes())
    words = json.dumps([hashes["part"], hashes["case"], digest.hexdigest()])
    return str(uuid5(NAMESPACE_URL, f"lcmchain infiltration {words}"))


class InfiltrationPart(Part):
    """Fills a formed part; the fluid side of a coupling where the master moves the preform.

    Parameters
    ----------
    setup : part, case and material.
    interface : cells or patches at which fields are exchanged.
    motion : how the master moves the preform.
    name : of the result file.
    """

    def __init__(
        self, setup: FillingSetup, interface: Interface, motion: Motion, name: str
    ) -> None:
        self.setup, self.interface, self.motion, self.name = setup, interface, motion, name
        self.fluid: FillingPart = None  # type: ignore[assignment]  # until it is built
        self.record = RecordPieces(setup)
        self.ended = ("reached", "the filling has not begun")
        self.vented_rate = np.zeros(len(setup.vents))  # mean over the last step [m3/s]
        self._supplied: tuple[Any, ...] = ()

    @property
    def filling(self) -> Filling:
        return self.fluid.filling

    # --- course -----------------------------------------------------------------------------------

    def build(self) -> None:
        """Make the filling at its start, and compile what it needs."""
        threads = self.use_threads()
        mesh = self.setup.mesh
        self.say(
            f"{self.name}, {mesh.cell_count} cells, {mesh.node_count} nodes, {threads} threads; "
            "compiling or loading the compiled loops (some seconds the first time)",
            aloud=True,
        )
        _take_one_step(self.setup)
        self.fluid = FillingPart(self.setup.filling(), self.record.after_step)
        self.record.clear()
        self.ended = ("reached", "the filling has not begun")
        self.vented_rate = np.zeros(len(self.setup.vents))
        self._supplied = ()

    def begin(self) -> None:
        """Check where the results go, and keep the start."""
        self.record.clear()
        self.prepare_result(self._result_file)
        if self.out_dir is not None:
            self.record.begin(self.filling)

    @property
    def present(self) -> float:
        """Time since the start [s]."""
        return self.fluid.time

    def advance(self, size: float) -> None:
        """Fill for ``size`` [s]."""
        self._apply_supply()
        vented = self.filling.state.vented.copy()
        before = self.ended
        if self.motion == "volume":
            self._set_volume_rate()
            self.fluid.advance(size)
            self.ended = self.fluid.ended
        else:
            if self.motion == "thickness":
                self._set_thickness(size)
            self.ended = self.filling.advance(self.present + size, self.record.after_step)
        if self.ended[0] == before[0] != "reached":
            self.ended = before  # the message says since when
        self.vented_rate = (self.filling.state.vented - vented) / size
        self.record.close()

    def finish(self, failure: str) -> None:
        """Write ``NAME_filling.nc`` if ``out_dir`` is set."""
        if self.out_dir is None:
            return
        self.record.end(self.filling)
        outcome, message = self.ended
        if failure:
            outcome, message = "reached", failure
        filled = FilledPart.of_record(
            self.setup, self.record.whole(), self.filling.save(), outcome, message
        )
        path = self.out_dir / self._result_file
        write_filling(path, filled, filling_report(self.name, filled))
        self.result_written(path)

    @property
    def _result_file(self) -> str:
        return f"{self.name}{ENDING}.nc"

    def capture(self) -> PartState:
        """Return a copy of the state; what is never changed in place is shared."""
        tree, kept = flattened(self.fluid.save())
        arrays = {f"filling {number}": array for number, array in enumerate(kept)}
        arrays |= {f"record {name}": array for name, array in self.record.arrays().items()}
        arrays["vented_rate"] = self.vented_rate
        return PartState({"tree": tree, "ended": list(self.ended)}, arrays)

    def reinstate(self, saved: PartState) -> None:
        """Go back to a captured state.

        Raises
        ------
        InputError : it is that of another filling.
        """
        mine, kept = flattened(self.fluid.save())
        arrays = named_arrays(saved.arrays, "filling ")
        try:
            found = [arrays[str(number)] for number in range(len(arrays))]
            state = restored(saved.values["tree"], found, RECORDS)
            outcome, message = saved.values["ended"]
            FRONT[outcome]
            fits = isinstance(state, SavedFilling) and _shapes(state) == _shapes(
                restored(mine, kept, RECORDS)
            )
            vented = saved.arrays["vented_rate"]
            if not fits or vented.shape != self.vented_rate.shape:
                raise ValueError("it belongs to another part")
            self.record.take(named_arrays(saved.arrays, "record "))
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            raise InputError(f"the saved state is not that of a filling ({error})") from None
        self.fluid.restore(state)
        self.ended, self.vented_rate = (str(outcome), str(message)), vented

    # --- inputs -----------------------------------------------------------------------------------

    def _apply_supply(self) -> None:
        """Give gates and vents what the master has set."""
        places: list[Gate | Vent] = [*self.setup.gates, *self.setup.vents]
        told = tuple(
            tuple(
                self.values.number(f"{quoted(place.name)}.{suffix}")
                for suffix in ("drive", "pressure_input", "flow_rate_input", "closed")
            )
            for place in places
        )
        if told == self._supplied:
            return
        gates = [_driven_gate(gate, *own) for gate, own in zip(self.setup.gates, told)]
        vents = [
            _driven_vent(vent, *own)
            for vent, own in zip(self.setup.vents, told[len(gates) :], strict=True)
        ]
        self.filling.set_supply(gates, vents)
        self._supplied = told

    def _set_thickness(self, size: float) -> None:
        """Move the preform to the given thickness; where none is given, at the given rate."""
        wanted, rate = self.values.field("thickness"), self.values.field("thickness_rate")
        if (wanted < 0.0).any():
            raise InputError(f"the thickness is {wanted.min():g} m in places")
        state, spread = self.filling.state, self.interface.spread
        if not (wanted.any() or rate.any() or state.thickness_rate.any()):
            return  # it stands still
        rates, given = spread(rate), spread(wanted)
        if self.interface.is_coarse:  # cells keep what they differ by from the mean of their patch
            given = state.thickness * spread(wanted / self.interface.fields.mean(state.thickness))
        rates = np.where(given > 0.0, (given - state.thickness) / size, rates)
        self.filling.set_thickness(state.thickness, rates)

    def _set_volume_rate(self) -> None:
        given = {name: self.values.field(name) for name in VOLUME_INPUTS}
        if self.interface.is_coarse:
            for name in (VOLUME_RATE, VOLUME_RATE_SLOPE):
                given[name] = self.interface.fields.shared(given[name])
            for name in (REFERENCE_PRESSURE, RESISTANCE):
                given[name] = self.interface.spread(given[name])
            given[RESISTANCE] /= self.interface.fields.shared(np.ones(self.interface.size))
        self.fluid.set_fields(given)

    # --- outputs ----------------------------------------------------------------------------------

    def outputs(self, group: str) -> Outputs:
        """Return the outputs of a group by name."""
        compute: dict[str, Callable[[], Outputs]] = {
            PLACES: self._place_outputs, SUMS: self._sums, FIELDS: self._fields,
        }  # fmt: skip
        return compute[group]()

    def _place_outputs(self) -> dict[str, float]:
        filling, values = self.filling, {}
        state, pressures, rates = filling.state, filling.gate_pressure, filling.gate_rate
        for number, gate in enumerate(self.setup.gates):
            prefix = quoted(gate.name)
            values[f"{prefix}.pressure"] = _or_zero(pressures[number])
            values[f"{prefix}.flow_rate"] = _or_zero(rates[number])
            values[f"{prefix}.injected_volume"] = float(state.injected[number])
        for number, vent in enumerate(self.setup.vents):
            prefix = quoted(vent.name)
            values[f"{prefix}.flow_rate"] = float(self.vented_rate[number])
            values[f"{prefix}.vented_volume"] = float(state.vented[number])
        return values

    def _sums(self) -> dict[str, float]:
        state = self.filling.state
        return {
            "fill_fraction": self.filling.filled_share,
            "injected_volume": float(state.injected.sum()),
            "vented_volume": float(state.vented.sum()),
            "stored_volume": state.stored,
            "balance_error": state.balance_error,
            "pressure_max": float(self.filling.pressure.max()),
            "pressure_force": float(self.fluid.present_pressure() @ self.filling.mesh.areas),
            "front": FRONT[self.ended[0]],
            "front_state": FRONT[self.ended[0]],
            "dry_spot_count": len(state.dry_spots),
            "step_count": state.step_count,
        }

    def _fields(self) -> dict[str, np.ndarray]:
        found = self.fluid.get_fields([PORE_PRESSURE, PRESSURE_AT_REST, "thickness", "volume"])
        network = self.filling.medium.network
        areas = network.corner_areas
        factor = (areas * self.filling.state.fill[network.cells]).sum(axis=1) / areas.sum(axis=1)
        values = {
            "pore_pressure": found[PORE_PRESSURE],
            "pressure_at_rest": found[PRESSURE_AT_REST],
            "fill_factor": factor,
            "preform_thickness": found["thickness"],
        }
        if not self.interface.is_coarse:
            return values | {"preform_volume": found["volume"]}
        fields = self.interface.fields
        means = {name: fields.mean(own) for name, own in values.items()}
        return means | {"preform_volume": fields.total(found["volume"])}


def _shapes(saved: SavedFilling) -> dict[str, tuple[int, ...]]:
    """Shapes of all arrays whose number of values is that of the part."""
    own = {
        name: values.shape
        for name, values in vars(saved.state).items()
        if isinstance(values, np.ndarray)
    }
    own |= {f"input {name}": values.shape for name, values in saved.inputs.items()}
    pressures = {"mean": saved.mean_pressure.shape, "resisted": saved.resisted.shape}
    return own | pressures


def _driven_gate(
    gate: Gate, drive: float, pressure: float, flow_rate: float, closed: float
) -> Gate:
    if closed:
        return replace(gate, schedule=SHUT)
    if not drive:
        return gate
    if gate.flow_rate is not None:
        return replace(gate, flow_rate=flow_rate, schedule=Schedule())
    return replace(gate, pressure=pressure, schedule=Schedule())


def _driven_vent(
    vent: Vent, drive: float, pressure: float, flow_rate: float, closed: float
) -> Vent:
    if closed:
        return replace(vent, schedule=SHUT)
    return replace(vent, pressure=pressure, schedule=Schedule()) if drive else vent


def _or_zero(value: float) -> float:
    return float(value) if np.isfinite(value) else 0.0


class _Enough(Exception):
    """One step is taken."""


def _take_one_step(setup: FillingSetup) -> None:
    """Compile what a step runs through, with a filling that is thrown away."""

    def stop(_: Filling) -> None:
        raise _Enough

    try:
        setup.filling().advance(setup.case.time, stop)
    except _Enough:
        pass


# --- what is kept for the result file, in pieces that are never changed ---------------------------
# A state of the unit refers to the pieces of its time: saving it copies nothing of what lies
# behind. Neighbouring pieces of about the same length are joined, so that there are few of them.

Piece = dict[str, np.ndarray]

#: Entries of a record that saved states have; the others belong to time steps.
OF_FRAMES = (
    "frame_time", "fill", "pressure", "resin_volume", "velocity", "cure", "temperature", "film",
    "thickness", "fibre_volume_fraction", "frame_stage",
)  # fmt: skip
OF_STEPS = tuple(f.name for f in fields(FillingRecord) if f.name not in OF_FRAMES)


class RecordPieces:
    """The record of a filling so far."""

    def __init__(self, setup: FillingSetup) -> None:
        self._case, self._node_areas = setup.case, node_areas(setup)
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self.frames: tuple[Piece, ...] = ()
        self.steps: tuple[Piece, ...] = ()
        self._last = (0.0, 0.0)
        self._new = FillingRecord.empty()

    def begin(self, filling: Filling) -> None:
        """Keep the start."""
        self._add_frame(filling)
        self._new.add_step(filling, self._node_areas)
        self.close()

    def after_step(self, filling: Filling) -> None:
        """Keep what a time step has led to, if the start was kept."""
        if not self.frames:
            return
        self._new.add_step(filling, self._node_areas)
        if is_frame_due(self._case, (filling.time, filling.filled_share), self._last):
            self._add_frame(filling)

    def end(self, filling: Filling) -> None:
        """Keep the last state, if anything has moved since a state was saved.

        Where all is filled time goes on without steps: the state is that of the last one.
        """
        last = float(self.steps[-1]["time"][-1])
        if last > self.frames[-1]["frame_time"][-1]:
            self._add_frame(filling)
            if not filling.state.thickness_rate.any():
                self._new.frame_time[-1] = last
            self.close()

    def close(self) -> None:
        """Make a piece of what was kept since the last one."""
        self.frames = _with(self.frames, self._new, OF_FRAMES)
        self.steps = _with(self.steps, self._new, OF_STEPS)
        self._new = FillingRecord.empty()

    def whole(self) -> FillingRecord:
        """Return the record in one."""
        joined = {**_joined(self.frames, OF_FRAMES), **_joined(self.steps, OF_STEPS)}
        return FillingRecord(**{name: list(values) for name, values in joined.items()})

    # --- saved states -----------------------------------------------------------------------------

    def arrays(self) -> Piece:
        """Return everything as arrays by name."""
        named: Piece = {}
        for kind, pieces in (("frames", self.frames), ("steps", self.steps)):
            for number, piece in enumerate(pieces):
                named |= {f"{kind} {number} {name}": values for name, values in piece.items()}
        return named | {"last frame": np.array(self._last)}

    def take(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to what :meth:`arrays` has returned.

        Raises
        ------
        KeyError, ValueError : these are not arrays of a record.
        """
        found: dict[str, dict[int, Piece]] = {"frames": {}, "steps": {}}
        for key, values in arrays.items():
            if key != "last frame":
                kind, number, name = key.split(" ")
                found[kind].setdefault(int(number), {})[name] = values
        pieces = {kind: tuple(own[k] for k in range(len(own))) for kind, own in found.items()}
        for kind, names in (("frames", OF_FRAMES), ("steps", OF_STEPS)):
            if any(set(piece) != set(names) for piece in pieces[kind]):
                raise KeyError(kind)
        time, share = arrays["last frame"]
        self.frames, self.steps = pieces["frames"], pieces["steps"]
        self._last, self._new = (float(time), float(share)), FillingRecord.empty()

    def _add_frame(self, filling: Filling) -> None:
        self._new.add_frame(filling)
        self._last = filling.time, filling.filled_share


def _with(
    pieces: tuple[Piece, ...], record: FillingRecord, names: tuple[str, ...]
) -> tuple[Piece, ...]:
    """Append what a record holds, and join pieces at the end that are not much longer."""
    new = {name: np.array(getattr(record, name)) for name in names}
    if len(new[names[0]]) == 0:
        return pieces
    while pieces and len(pieces[-1][names[0]]) <= 2 * len(new[names[0]]):
        new = {name: np.concatenate([pieces[-1][name], new[name]]) for name in names}
        pieces = pieces[:-1]
    return (*pieces, new)


def _joined(pieces: tuple[Piece, ...], names: tuple[str, ...]) -> Piece:
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in names}
