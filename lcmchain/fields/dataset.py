"""A forming result as datasets: sheet (root group), solid, and history over the frames."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np
import xarray as xr

from lcmchain.fields.derived import derive_fields
from lcmchain.fields.frames import FrameSeries
from lcmchain.fields.table import FIELD_OF_VARIABLE, FIELDS
from lcmchain.fields.ugrid import (
    CONVENTIONS,
    FRAME,
    FRAME_TIME,
    NO_NODE,
    ROOT,
    UgridMesh,
    Variable,
    frame_time,
)
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.triangulation import TriangleMesh

SHEET, SOLID, HISTORY = ROOT, "/solid", "/history"
SHEET_MESH = UgridMesh("sheet")
SOLID_MESH = UgridMesh("solid", topology_dimension=3)

#: What a result of the 2D approach says about the thickness, in the file and in its summary.
NO_THICKNESS = (
    'element = "membrane-shell" predicts no thickness, and therefore no fibre volume fraction, no '
    "compaction pressure and no permeability"
)

# Nodes of a degenerate hexahedron (n0 n1 n2 n2) in VTK's order of a wedge, whose first face is
# seen clockwise from the second: bottom n0 n2 n1, then top.
WEDGE_NODES = [0, 2, 1, 4, 6, 5]


def build_datasets(
    scene, blank: BlankMesh | TriangleMesh, frames: FrameSeries, *, material=None
) -> dict[str, xr.Dataset]:
    """Turn saved frames into the groups of ``forming.nc``.

    The root group ``"/"`` holds the mid-surface as the two-dimensional UGRID mesh ``sheet`` with
    the fields of :data:`lcmchain.fields.table.FIELDS`, and nothing that readers of such meshes
    do not know. Its node coordinates are those of the **last frame**, so that viewers show the
    formed shape; ``reference_position_*`` and ``displacement_*`` give the shape of every frame
    (:func:`lcmchain.fields.sheet.sheet_positions`). ``"/solid"`` holds the solid-shell elements,
    volume i being face i of the sheet, and ``"/history"`` time, energies, and travel and forces
    of the tools. Triangles of the 2D approach are the faces themselves: there is no ``"/solid"``.

    Parameters
    ----------
    scene : the scene; its title, text and hash go into the file.
    blank : undeformed mesh.
    frames : saved frames.
    material : as for :func:`lcmchain.fields.derived.derive_fields`; built from the scene by
        default.

    Returns
    -------
    Datasets by group name. Face variables have the dimensions ``frame`` and ``sheet_face``.
    """
    material = scene.material.build() if material is None else material
    datasets = {SHEET: _sheet(scene, blank, frames, material)}
    if isinstance(blank, BlankMesh):
        datasets[SOLID] = _solid(blank, frames)
    datasets[HISTORY] = _history(frames)
    return datasets


def add_face_variables(
    datasets: Mapping[str, xr.Dataset], variables: Mapping[str, Any]
) -> dict[str, xr.Dataset]:
    """Return the datasets with further fields on the faces of the sheet, such as permeabilities.

    Parameters
    ----------
    datasets : from :func:`build_datasets`.
    variables : values by name, of shape (frame_count, face_count), or with a last axis of three
        for a vector, which becomes three variables. Either the values alone, for a name in
        :data:`lcmchain.fields.table.FIELDS`, or ``(values, attributes)`` with ``units`` and
        ``long_name``. Shapes without the leading axis hold for every frame.

    Raises
    ------
    ValueError : wrong shape; no unit or name known for a field.
    """
    sheet = datasets[SHEET].copy()
    shape = (sheet.sizes[FRAME], sheet.sizes[SHEET_MESH.cell_dimension])
    for name, entry in variables.items():
        values, attributes = entry if isinstance(entry, tuple) else (entry, None)
        for variable, component in _scalars(name, np.asarray(values, dtype=float), shape):
            if attributes is not None:
                given = dict(attributes)
            elif variable in FIELD_OF_VARIABLE:
                given = FIELD_OF_VARIABLE[variable].attributes(variable)
            else:
                given = {}
            if not {"units", "long_name"} <= set(given):
                raise ValueError(f"{name} needs the attributes units and long_name")
            sheet[variable] = SHEET_MESH.on_cells(np.broadcast_to(component, shape).copy(), given)
    return {**datasets, SHEET: sheet}


# --- root group -----------------------------------------------------------------------------------


def _sheet(scene, blank: BlankMesh | TriangleMesh, frames: FrameSeries, material) -> xr.Dataset:
    if isinstance(blank, TriangleMesh):
        reference, current, faces = blank.node_positions, frames.positions, blank.elements
    else:
        reference, current = _mid_surface(blank.node_positions), _mid_surface(frames.positions)
        faces = np.where(blank.is_triangle[:, None] & (np.arange(4) == 3), NO_NODE, blank.faces)
    mesh = SHEET_MESH
    variables: dict[str, Variable] = {
        **mesh.topology(faces, long_name="mid-surface of the textile, one face per element"),
        **_coordinates(mesh, current[-1]),
        FRAME_TIME: frame_time(frames.time),
        # VTK's reader finds time steps only under this name, and shows the first frame without it.
        "time": frame_time(frames.time, dimension="time"),
        **_node_fields(mesh, reference, current),
    }
    steps = [derive_fields(blank, material, positions) for positions in frames.positions]
    for name in steps[0]:
        variables[name] = mesh.on_cells(
            np.stack([step[name] for step in steps]), FIELD_OF_VARIABLE[name].attributes(name)
        )
    attributes = _global_attributes(scene, material)
    if isinstance(blank, TriangleMesh):
        attributes["comment"] = NO_THICKNESS
    return mesh.dataset(variables, attributes)


def _global_attributes(scene, material) -> dict[str, Any]:
    from lcmchain import __version__

    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    attributes = {
        "Conventions": CONVENTIONS,
        "title": str(scene.title),
        "history": f"{now} formed by lcmchain {__version__}",
        "source": f"lcmchain {__version__}",
        "scene": scene.source.text,
        "scene_sha256": scene.source.sha256,
        "material": str(material.name),
        "areal_mass_kg_m2": float(material.areal_mass),
    }
    if material.fibre_density is not None:
        attributes["fibre_density_kg_m3"] = float(material.fibre_density)
    return attributes


def _mid_surface(positions: np.ndarray) -> np.ndarray:
    pairs = positions.shape[-2] // 2
    return 0.5 * (positions[..., :pairs, :] + positions[..., pairs:, :])


# --- solid ----------------------------------------------------------------------------------------


def _solid(blank: BlankMesh, frames: FrameSeries) -> xr.Dataset:
    volumes = blank.elements.astype(np.int32)
    wedges = blank.is_triangle
    volumes[wedges, :6] = blank.elements[wedges][:, WEDGE_NODES]
    volumes[wedges, 6:] = NO_NODE
    mesh = SOLID_MESH
    variables = {
        **mesh.topology(
            volumes,
            long_name="solid-shell elements; volume i belongs to face i of the sheet",
            cell_nodes_long_name="nodes of each volume in the order of VTK, bottom face first",
        ),
        **mesh.volume_shapes(volumes, long_name="shape of each volume", node_counts=(6, 8)),
        **_coordinates(mesh, frames.positions[-1]),
        FRAME_TIME: frame_time(frames.time),
        **_node_fields(mesh, blank.node_positions, frames.positions),
    }
    return mesh.dataset(variables, {"Conventions": CONVENTIONS})


# --- history --------------------------------------------------------------------------------------


def _history(frames: FrameSeries) -> xr.Dataset:
    variables: dict[str, Variable] = {
        "time": frame_time(frames.time),
        "tool": (
            "tool",
            np.array(frames.tool_names, dtype=str),
            {"long_name": "name of the tool"},
        ),
        "tool_travel": (
            (FRAME, "tool"),
            np.array(frames.tool_travel, dtype=float),
            {"units": "m", "long_name": "travel of the tool along its direction"},
        ),
    }
    for axis, values in zip("xyz", np.moveaxis(frames.tool_force, -1, 0), strict=True):
        variables[f"tool_force_{axis}"] = (
            (FRAME, "tool"),
            np.array(values, dtype=float),
            {"units": "N", "long_name": f"force of the blank on the tool, {axis} component"},
        )
    for name, values in frames.energy.items():
        variables[f"energy_{name}"] = (
            FRAME,
            np.array(values, dtype=float),
            {"units": "J", "long_name": f"{name.replace('_', ' ')} (energy balance)"},
        )
    return xr.Dataset(variables, attrs={"Conventions": "CF-1.11"}).set_coords("time")


# --- shared ---------------------------------------------------------------------------------------


def _coordinates(mesh: UgridMesh, positions: np.ndarray) -> dict[str, Variable]:
    return mesh.node_positions(
        positions, long_name="coordinate of the node in the last frame", positive="up"
    )


def _node_fields(
    mesh: UgridMesh, reference: np.ndarray, current: np.ndarray
) -> dict[str, Variable]:
    variables: dict[str, Variable] = {}
    for name, values in (("displacement", current - reference), ("reference_position", reference)):
        components = np.moveaxis(values, -1, 0)
        for variable, component in zip(FIELDS[name].variables, components, strict=True):
            variables[variable] = mesh.on_nodes(
                np.ascontiguousarray(component), FIELDS[name].attributes(variable)
            )
    return variables


def _scalars(name: str, values: np.ndarray, shape: tuple[int, int]):
    """Names and values of the components of a field, each of the shape of a scalar."""
    for scalar_shape in (shape, shape[1:]):
        if values.shape == scalar_shape:
            return [(name, values)]
        if values.shape == (*scalar_shape, 3):
            return [(f"{name}_{axis}", values[..., i]) for i, axis in enumerate("xyz")]
    raise ValueError(
        f"{name} has the shape {values.shape}; (frame_count, face_count) is {shape}, "
        "with a last axis of 3 for vectors"
    )
