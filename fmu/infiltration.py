"""The infiltration as the physics of a unit."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_URL, uuid5

import numpy as np

from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Schedule, Vent
from lcmchain.coupling.infiltration.formed_part import read_part
from lcmchain.coupling.infiltration.report import filling_report
from lcmchain.coupling.infiltration.results import FilledPart
from lcmchain.coupling.infiltration.setup import FillingSetup, set_up
from lcmchain.coupling.infiltration.stage import ENDING, fingerprint_of, write_filling
from lcmchain.coupling.iteration.interface import (
    PORE_PRESSURE,
    PRESSURE_AT_REST,
    REFERENCE_PRESSURE,
    RESISTANCE,
    VOLUME_RATE,
    VOLUME_RATE_SLOPE,
)
from lcmchain.errors import InputError
from lcmchain.fmu import infiltration_state
from lcmchain.fmu.filling_record import RecordPieces
from lcmchain.fmu.frames import require_writable
from lcmchain.fmu.infiltration_variables import (
    FIELDS,
    FRONT,
    PLACES,
    SUMS,
    Abilities,
    Motion,
    infiltration_variables,
)
from lcmchain.fmu.interface_fields import INTERFACE_FILE
from lcmchain.fmu.part import Part, UnitDefinition
from lcmchain.fmu.saved_state import PartState
from lcmchain.fmu.variables import Variable, quoted
from lcmchain.mapping.interface import Interface, read_interface
from lcmchain.scene import read_scene
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.reading.single_tables import read_infiltration

#: Folder of the formed part in the resources, by :mod:`lcmchain.fmu.infiltration_build`.
PART_FOLDER = "part"

#: What the filling takes where the master moves the volume of its cells.
VOLUME_INPUTS = (VOLUME_RATE, VOLUME_RATE_SLOPE, REFERENCE_PRESSURE, RESISTANCE)

#: Of a gate or vent that the master has shut: it never opens.
SHUT = Schedule(-2.0, -1.0)


def read_case(unit: Mapping[str, Any], resources: Path) -> tuple[Infiltration, Path]:
    """Return the infiltration of a unit, and the folder to which its file names are relative."""
    path = resources / unit["case"]
    if unit["entry"] is None:
        return read_infiltration(path, unit["overrides"]), path.parent
    return read_scene(path, unit["overrides"]).infiltrations[unit["entry"]][0], path.parent


def define_infiltration(
    unit: Mapping[str, Any], resources: Path
) -> tuple[UnitDefinition, InfiltrationPart]:
    """Return what an infiltration unit is, from its file and its resources."""
    case, directory = read_case(unit, resources)
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
        if self._out_dir is not None:
            require_writable(self._out_dir)
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
        if self._out_dir is None:
            return
        self.record.end(self.filling)
        outcome, message = self.ended
        if failure:
            outcome, message = "reached", failure
        filled = FilledPart.of_record(
            self.setup, self.record.whole(), self.filling.save(), outcome, message
        )
        path = self._out_dir / f"{self.name}{ENDING}.nc"
        write_filling(path, filled, filling_report(self.name, filled))
        self.values.texts["result_file"] = str(path)
        self.say(f"wrote {path}")

    def capture(self) -> PartState:
        """Return a copy of the state."""
        return infiltration_state.capture(self)

    def reinstate(self, state: PartState) -> None:
        """Go back to a captured state."""
        infiltration_state.reinstate(self, state)

    @property
    def _out_dir(self) -> Path | None:
        text = self.values.texts["out_dir"]
        return Path(text) if text else None

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

    def outputs(self, group: str) -> Mapping[str, Any]:
        """Return the outputs of a group by name."""
        compute: dict[str, Callable[[], Mapping[str, Any]]] = {
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
