"""Files of a filling: netCDF (UGRID), VTU and a time series for ParaView, and its checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import xarray as xr

from lcmchain import __version__
from lcmchain.coupling.filling_part import SavedFilling
from lcmchain.coupling.infiltration.flow.state import DrySpot, FillingState
from lcmchain.coupling.infiltration.results import FORCES, FilledPart, FillingRecord
from lcmchain.coupling.iteration.checkpoint import (
    flattened,
    read_archive,
    restored,
    write_archive,
)
from lcmchain.coupling.iteration.history import IterationRecord, WindowRecord
from lcmchain.coupling.solids.explicit import SavedForming
from lcmchain.coupling.solids.local import SavedCompaction
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import ROOT
from lcmchain.fields.stages import STAGE, stage_variable
from lcmchain.fields.ugrid import CONVENTIONS, TIME, Variable
from lcmchain.fields.vtu import frame_file, vtk_blocks, write_frame_list, write_mesh
from lcmchain.quantities.fields import FACE, NODE, Field
from lcmchain.solver.simulation import StepControl
from lcmchain.state import State

_FIELDS = (
    Field(
        "resin_pressure", "Pa", "pressure of the resin", NODE,
        "in the resin; where no resin is, that of the air",
    ),
    Field(
        "fill_factor", "1", "fill factor", NODE,
        "volume of resin per pore volume of the control volume of the node",
    ),
    Field(
        "fill_time", "s", "fill time", NODE,
        "time at which the front passed the node; not a number where it is dry",
    ),
    Field(
        "resin_mass", "kg", "resin mass", NODE,
        "resin in the control volume of the node: the sum over the nodes is that in the part",
    ),
    Field(
        "degree_of_cure", "1", "degree of cure", NODE,
        "of the resin at the node, carried along by the flow",
    ),
    Field("resin_temperature", "K", "temperature of the resin", NODE, "of the resin at the node"),
    Field(
        "resin_film",
        "m",
        "thickness of the resin film",
        NODE,
        "of the resin that lies on the preform",
    ),
    Field(
        "darcy_velocity", "m s-1", "Darcy velocity", FACE,
        "volume of resin per time and area of the cross-section, - K grad p / viscosity, in the "
        "plane of the face: the resin itself is faster by one over the porosity",
        is_vector=True,
    ),
    Field(
        "flow_medium_fill_factor", "1", "fill factor of the flow medium", NODE,
        "resin over pore volume in the layer above the node; not a number where there is none",
    ),
    Field(
        "flow_medium_fill_time", "s", "fill time of the flow medium", NODE,
        "time at which the front passed in the layer above the node; not a number where it is dry",
    ),
    Field(
        "flow_medium_pressure", "Pa", "pressure in the flow medium", NODE,
        "of the resin, or of the air where the layer above the node is dry",
    ),
    Field(
        "flow_medium_resin_mass", "kg", "resin mass in the flow medium", NODE,
        "in the layer above the node: none of the resin in the part",
    ),
    Field(
        "pressed_thickness", "m", "thickness under what presses on the part", FACE,
        "of the part between closing tools or under a bag",
    ),
    Field(
        "pressed_fibre_volume_fraction", "1", "fibre volume fraction under what presses", FACE,
        "of the part between closing tools or under a bag",
    ),
)  # fmt: skip

#: Fields of an infiltration by name.
FILLING_FIELDS: dict[str, Field] = {field.name: field for field in _FIELDS}


# --- files ----------------------------------------------------------------------------------------


#: Groups of the netCDF file besides the root.
HISTORY, DRY_SPOTS, COUPLING = "/history", "/dry_spots", "/coupling"
SAMPLE = "history_time"

#: Values (F, N), (F, C, 3) or (N,) by the name of the field.
Values = dict[str, np.ndarray]


def _filling_values(filled: FilledPart) -> Values:
    """Return the fields of all saved states by name, without those that the case does not have."""
    density = filled.setup.resin_density
    values = {
        "resin_pressure": filled.pressure,
        "fill_factor": filled.fill,
        "fill_time": filled.fill_time,
        "resin_mass": density * filled.resin_volume,
        "darcy_velocity": filled.velocity,
    }
    if np.nanmax(filled.cure, initial=0.0) > 0.0:
        values["degree_of_cure"] = filled.cure
    if filled.setup.case.resin.temperature is not None:
        values["resin_temperature"] = filled.temperature
    if filled.setup.film is not None:
        values["resin_film"] = filled.film
    if filled.layer is not None:
        values["flow_medium_fill_factor"] = filled.layer.fill
        values["flow_medium_fill_time"] = filled.layer.fill_time
        values["flow_medium_pressure"] = filled.layer.pressure
        values["flow_medium_resin_mass"] = density * filled.layer.resin_volume
    if filled.is_pressed:
        values["pressed_thickness"] = filled.thickness
        values["pressed_fibre_volume_fraction"] = filled.fibre_volume_fraction
    return values


def filling_groups(filled: FilledPart, attributes: Mapping[str, Any]) -> dict[str, xr.Dataset]:
    """Return the groups of the netCDF file: the part with its fields, histories, dry spots.

    attributes : further global attributes.
    """
    part, mesh = filled.setup.part, filled.setup.part.mesh
    dataset = part.dataset.assign_coords({TIME: _saved_times(filled.time)})
    for name, values in _filling_values(filled).items():
        field = FILLING_FIELDS[name]
        for axis, variable in enumerate(field.variables):
            component = values[..., axis] if field.is_vector else values
            about: dict[str, Any] = {**field.attributes(variable), "_FillValue": np.nan}
            located = mesh.on_cells if field.location == "face" else mesh.on_nodes
            dataset[variable] = located(np.ascontiguousarray(component), about)
    for kind, openings in (("gate", filled.setup.gates), ("vent", filled.setup.vents)):
        taken: set[str] = set()
        for opening in openings:
            variable = f"{kind}_{opening.name.replace('-', '_')}"
            while variable in taken:  # a-b after a_b
                variable += "_"
            taken.add(variable)
            marks = np.zeros(len(part.target.points), dtype=np.int8)
            marks[opening.nodes] = 1
            about = {
                "long_name": f"{kind} {opening.name}", "units": "1", "set_name": opening.name,
                "flag_values": np.array([0, 1], dtype=np.int8), "flag_meanings": "outside member",
            }  # fmt: skip
            dataset[variable] = mesh.on_nodes(marks, about)
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    history = f"{now} filled by lcmchain {__version__}\n{part.dataset.attrs.get('history', '')}"
    dataset.attrs |= {
        **attributes,
        "Conventions": CONVENTIONS,
        "history": history.strip(),
        "source": f"lcmchain {__version__}, infiltration",
        "filling_outcome": filled.outcome,
        "filling_message": filled.message,
    }
    groups = {ROOT: dataset, HISTORY: _history(filled)}
    if filled.stages is not None:
        names, of_frames, of_steps = filled.stages
        dataset[STAGE] = stage_variable((TIME,), of_frames, names)
        groups[HISTORY][STAGE] = stage_variable((SAMPLE,), of_steps, names)
    if filled.coupling is not None:
        groups[COUPLING] = filled.coupling.dataset()
    if filled.dry_spots:
        groups[DRY_SPOTS] = _dry_spots(filled)
    return groups


def write_series(path: Path | str, filled: FilledPart) -> None:
    """Write every saved state as VTU, and the PVD file that lists their times."""
    for frame in range(len(filled.time)):
        write_vtu(frame_file(path, frame), filled, frame)
    write_frame_list(path, filled.time)


def write_vtu(path: Path | str, filled: FilledPart, frame: int = -1) -> None:
    """Write one saved state as VTU, with thickness and material of the cells.

    Values that are not known, such as the fill time of dry nodes, are not a number.
    """
    part = filled.setup.part
    target = part.target
    ends = np.cumsum([len(cells) for _, cells in target.blocks])[:-1]
    on_cells = {
        name: part.cell(name) for name in ("thickness", "fibre_volume_fraction", "permeability_1",
                                           "permeability_2", "shear_angle")
        if name in part.dataset
    }  # fmt: skip
    on_points: dict[str, np.ndarray] = {}
    for name, values in _filling_values(filled).items():
        field = FILLING_FIELDS[name]
        own = values if name.endswith("fill_time") else values[frame]
        if field.location == "face":
            on_cells[name] = own
        else:
            on_points[name] = own
    on_cells["cell_id"], on_points["node_id"] = target.cell_ids, target.node_ids
    write_mesh(
        path,
        meshio.Mesh(
            target.points,
            vtk_blocks(target.blocks),
            point_data=on_points,
            cell_data={name: np.split(values, ends) for name, values in on_cells.items()},
        ),
    )


def _saved_times(time: np.ndarray) -> Variable:
    about = {
        "units": "s", "long_name": "time since the start of the filling",
        "standard_name": "time", "axis": "T",
    }  # fmt: skip
    return (TIME,), np.asarray(time, dtype=float), about


def _history(filled: FilledPart) -> xr.Dataset:
    history, setup = filled.history, filled.setup
    sums = {
        "filled_share": (history.filled_share, "1", "resin over pore volume"),
        "stored_volume": (history.stored, "m3", "resin in the part"),
        "balance_error": (
            history.balance_error, "m3", "what entered and did not leave, less what is stored"
        ),
        "wet_area": (history.wet_area, "m2", "area of the part that resin covers"),
    }  # fmt: skip
    variables: dict[str, Variable] = {
        name: ((SAMPLE,), values, {"units": units, "long_name": words})
        for name, (values, units, words) in sums.items()
    }
    for name, values, units, words in (
        ("gate_pressure", history.gate_pressure, "Pa", "pressure of the gate"),
        ("gate_flow_rate", history.gate_rate, "m3 s-1", "flow rate of the gate, nan while closed"),
        ("injected_volume", history.injected, "m3", "resin that has entered through the gate"),
    ):
        variables[name] = ((SAMPLE, "gate"), values, {"units": units, "long_name": words})
    for column, (name, words) in zip(history.force.T, FORCES.items(), strict=False):
        variables[name] = ((SAMPLE,), column, {"units": "N", "long_name": f"force {words}"})
    about = {"units": "m3", "long_name": "resin that has left through the vent"}
    variables["vented_volume"] = ((SAMPLE, "vent"), history.vented, about)
    for kind, places in (("gate", setup.gates), ("vent", setup.vents)):
        names = np.array([place.name for place in places], dtype=str)
        variables[kind] = ((kind,), names, {"long_name": f"name of the {kind}"})
    time = {"units": "s", "long_name": "time at the end of the step", "standard_name": "time"}
    variables[SAMPLE] = ((SAMPLE,), history.time, time)
    dataset = xr.Dataset(variables, attrs={"Conventions": "CF-1.11"})
    return dataset.set_coords([SAMPLE, "gate", "vent"])


def _dry_spots(filled: FilledPart) -> xr.Dataset:
    names, spots = zip(*filled.dry_spots, strict=True)
    area_left, volume_left = zip(*filled.left_dry, strict=True)
    columns = {
        "time": ([s.time for s in spots], "s", "when the front closed around it"),
        "area": ([s.area for s in spots], "m2", "area that was dry then"),
        "pore_volume": ([s.volume for s in spots], "m3", "volume of the pores that were dry then"),
        "area_left": (area_left, "m2", "area that is dry in the end"),
        "pore_volume_left": (volume_left, "m3", "volume of the pores that are dry in the end"),
        **{
            axis: ([s.place[k] for s in spots], "m", f"{axis} of the centre of its dry pores")
            for k, axis in enumerate("xyz")
        },
    }
    variables: dict[str, Variable] = {
        f"dry_spot_{name}": (
            ("dry_spot",), np.array(values, dtype=float), {"units": units, "long_name": words}
        )
        for name, (values, units, words) in columns.items()
    }  # fmt: skip
    variables["dry_spot"] = (("dry_spot",), np.array(names, dtype=str), {"long_name": "name"})
    return xr.Dataset(variables, attrs={"Conventions": "CF-1.11"}).set_coords(["dry_spot"])


# --- checkpoint: the whole state, so that a filling goes on as if it had never stopped ------------


#: Records within a saved state.
RECORDS = {
    record.__name__: record
    for record in (
        FillingState, DrySpot, SavedFilling, SavedCompaction, SavedForming, State, StepControl,
        IterationRecord, WindowRecord,
    )
}  # fmt: skip
_FORM = "lcmchain filling 4"


def write_checkpoint(
    path: Path, fingerprint: dict[str, str], state: object, record: FillingRecord
) -> None:
    """Write state and record, whole or not at all.

    Parameters
    ----------
    fingerprint : hashes of all that the result depends on, by name.
    state : saved by a filling, or by the mould that closes on it.
    """
    tree, of_state = flattened(state)
    header = {"fingerprint": fingerprint, "state": tree, "array_count": len(of_state)}
    arrays = {f"state_{number}": array for number, array in enumerate(of_state)}
    for entry in fields(FillingRecord):
        arrays[f"record_{entry.name}"] = np.array(getattr(record, entry.name))
    write_archive(path, _FORM, header, arrays)


def read_checkpoint(path: Path, fingerprint: dict[str, str]) -> tuple[Any, FillingRecord]:
    """Return saved state and record of the filling with this fingerprint.

    Raises
    ------
    InputError : there is none, it is damaged, or it belongs to another filling.
    """
    header, arrays = read_archive(path, _FORM, "fill without --resume")
    stored = header["fingerprint"]
    differing = [name for name in fingerprint if stored.get(name) != fingerprint[name]]
    if differing:
        raise InputError(
            f"the checkpoint was written for another {' and another '.join(differing)}; fill "
            "without --resume, or into another folder",
            file=path,
        )
    of_state = [arrays[f"state_{number}"] for number in range(header["array_count"])]
    record = FillingRecord(
        **{e.name: _listed(arrays[f"record_{e.name}"]) for e in fields(FillingRecord)}
    )
    return restored(header["state"], of_state, RECORDS), record


def _listed(values: np.ndarray) -> list:
    """Return a list of the numbers, or of the arrays, in the rows of an array."""
    return values.tolist() if values.ndim == 1 else list(values)
