"""A forming result as datasets: sheet (root group), solid, and history over the frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
import xarray as xr

from lcmchain.fields.derived import derive_fields
from lcmchain.fields.table import FIELD_OF_VARIABLE, FIELDS
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.triangulation import TriangleMesh

SHEET, SOLID, HISTORY = "/", "/solid", "/history"

#: What a result of the 2D approach says about the thickness, in the file and in its summary.
NO_THICKNESS = (
    'element = "membrane-shell" predicts no thickness, and therefore no fibre volume fraction, no '
    "compaction pressure and no permeability"
)

#: Marks the missing fourth node of a triangle, and the missing last nodes of a wedge.
NO_NODE = np.int32(-1)

# Nodes of a degenerate hexahedron (n0 n1 n2 n2) in VTK's order of a wedge, whose first face is
# seen clockwise from the second: bottom n0 n2 n1, then top.
WEDGE_NODES = [0, 2, 1, 4, 6, 5]
# Flags of UGRID 1.0 for the shape of volumes.
WEDGE, HEXAHEDRON = 2, 3


@dataclass
class FrameSeries:
    """Saved frames of a run; the first one is the start.

    Parameters
    ----------
    time : [s], shape (F,).
    positions : of all nodes [m], shape (F, node_count, 3).
    tool_travel : along each tool's direction [m], shape (F, T).
    tool_force : of the blank on each tool [N], shape (F, T, 3).
    energy : parts of the energy balance [J] by name, each of shape (F,).
    tool_names : names of the T tools.
    """

    time: np.ndarray
    positions: np.ndarray
    tool_travel: np.ndarray
    tool_force: np.ndarray
    energy: Mapping[str, np.ndarray] = field(default_factory=dict)
    tool_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        frames, tools = len(self.time), len(self.tool_names)
        for name, shape in (
            ("positions", (frames, np.shape(self.positions)[1], 3)),
            ("tool_travel", (frames, tools)),
            ("tool_force", (frames, tools, 3)),
        ):
            if np.shape(getattr(self, name)) != shape:
                raise ValueError(
                    f"{name} has the shape {np.shape(getattr(self, name))}, not {shape}"
                )
        for name, values in self.energy.items():
            if np.shape(values) != (frames,):
                raise ValueError(f"energy {name} has the shape {np.shape(values)}, not {(frames,)}")

    @classmethod
    def from_snapshots(cls, snapshots, tool_names: tuple[str, ...]) -> FrameSeries:
        """Return the snapshots of a simulation as arrays over frames."""
        shape = len(snapshots), len(tool_names)
        return cls(
            time=np.array([s.time for s in snapshots]),
            positions=np.array([s.position for s in snapshots]),
            tool_travel=np.array([s.tool_travel for s in snapshots]).reshape(shape),
            tool_force=np.array([s.tool_force for s in snapshots]).reshape(*shape, 3),
            energy={
                name: np.array([s.energy[name] for s in snapshots]) for name in snapshots[0].energy
            },
            tool_names=tool_names,
        )

    @property
    def frame_count(self) -> int:
        return len(self.time)


def build_datasets(
    scene, blank: BlankMesh | TriangleMesh, frames: FrameSeries, *, material=None
) -> dict[str, xr.Dataset]:
    """Turn saved frames into the groups of ``forming.nc``.

    The root group ``"/"`` holds the mid-surface as the two-dimensional UGRID mesh ``sheet`` with
    the fields of :data:`lcmchain.fields.table.FIELDS`, and nothing that readers of such meshes
    do not know. Its node coordinates are those of the **last frame**, so that viewers show the
    formed shape; ``reference_position_*`` and ``displacement_*`` give the shape of every frame
    (:func:`lcmchain.fields.summary.sheet_positions`). ``"/solid"`` holds the solid-shell elements,
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
    material = _material(scene) if material is None else material
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
    shape = (sheet.sizes["frame"], sheet.sizes["sheet_face"])
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
            sheet[variable] = (
                ("frame", "sheet_face"),
                np.broadcast_to(component, shape).copy(),
                given | {"mesh": "sheet", "location": "face"},
            )
    return {**datasets, SHEET: sheet}


# --- root group -----------------------------------------------------------------------------------


def _sheet(
    scene, blank: BlankMesh | TriangleMesh, frames: FrameSeries, material
) -> xr.Dataset:
    if isinstance(blank, TriangleMesh):
        reference, current, faces = blank.node_positions, frames.positions, blank.elements
    else:
        reference, current = _mid_surface(blank.node_positions), _mid_surface(frames.positions)
        faces = np.where(blank.is_triangle[:, None] & (np.arange(4) == 3), NO_NODE, blank.faces)
    variables: dict[str, tuple] = {
        "sheet": (
            (),
            np.int32(0),
            {
                "cf_role": "mesh_topology",
                "long_name": "mid-surface of the textile, one face per element",
                "topology_dimension": np.int32(2),
                "node_coordinates": "sheet_node_x sheet_node_y sheet_node_z",
                "face_node_connectivity": "sheet_face_nodes",
                "face_dimension": "sheet_face",
            },
        ),
        "sheet_face_nodes": (
            ("sheet_face", "sheet_face_corner"),
            faces.astype(np.int32),
            {
                "cf_role": "face_node_connectivity",
                "long_name": "nodes of each face",
                "start_index": np.int32(0),
                "_FillValue": NO_NODE,
            },
        ),
        **_coordinates("sheet", current[-1]),
        **_time(frames),
        # VTK's reader finds time steps only under this name, and shows the first frame without it.
        "time": ("time", np.array(frames.time, dtype=float), _time_attributes()),
        **_node_fields("sheet", reference, current),
    }
    steps = [derive_fields(blank, material, positions) for positions in frames.positions]
    for name in steps[0]:
        variables[name] = (
            ("frame", "sheet_face"),
            np.stack([step[name] for step in steps]),
            FIELD_OF_VARIABLE[name].attributes(name) | {"mesh": "sheet", "location": "face"},
        )
    attributes = _global_attributes(scene, material)
    if isinstance(blank, TriangleMesh):
        attributes["comment"] = NO_THICKNESS
    dataset = xr.Dataset(variables, attrs=attributes)
    return dataset.set_coords([f"sheet_node_{axis}" for axis in "xyz"] + ["frame_time"])


def _global_attributes(scene, material) -> dict[str, Any]:
    from lcmchain import __version__

    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    attributes = {
        "Conventions": "CF-1.11 UGRID-1.0",
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


def _material(scene):
    from lcmchain.materials.fabric import Fabric
    from lcmchain.materials.st_venant_kirchhoff import StVenantKirchhoff

    law = Fabric if scene.material.law == "fabric" else StVenantKirchhoff
    return law.from_scene(scene.material)


def _mid_surface(positions: np.ndarray) -> np.ndarray:
    pairs = positions.shape[-2] // 2
    return 0.5 * (positions[..., :pairs, :] + positions[..., pairs:, :])


# --- solid ----------------------------------------------------------------------------------------


def _solid(blank: BlankMesh, frames: FrameSeries) -> xr.Dataset:
    volumes = blank.elements.astype(np.int32)
    wedges = blank.is_triangle
    volumes[wedges, :6] = blank.elements[wedges][:, WEDGE_NODES]
    volumes[wedges, 6:] = NO_NODE
    variables = {
        "solid": (
            (),
            np.int32(0),
            {
                "cf_role": "mesh_topology",
                "long_name": "solid-shell elements; volume i belongs to face i of the sheet",
                "topology_dimension": np.int32(3),
                "node_coordinates": "solid_node_x solid_node_y solid_node_z",
                "volume_node_connectivity": "solid_volume_nodes",
                "volume_dimension": "solid_volume",
                "volume_shape_type": "solid_volume_shape",
            },
        ),
        "solid_volume_nodes": (
            ("solid_volume", "solid_volume_corner"),
            volumes,
            {
                "cf_role": "volume_node_connectivity",
                "long_name": "nodes of each volume in the order of VTK, bottom face first",
                "start_index": np.int32(0),
                "_FillValue": NO_NODE,
            },
        ),
        "solid_volume_shape": (
            "solid_volume",
            np.where(wedges, WEDGE, HEXAHEDRON).astype(np.int8),
            {
                "cf_role": "volume_shape_type",
                "long_name": "shape of each volume",
                "flag_values": np.array([WEDGE, HEXAHEDRON], dtype=np.int8),
                "flag_meanings": "wedge hexahedron",
            },
        ),
        **_coordinates("solid", frames.positions[-1]),
        **_time(frames),
        **_node_fields("solid", blank.node_positions, frames.positions),
    }
    dataset = xr.Dataset(variables, attrs={"Conventions": "CF-1.11 UGRID-1.0"})
    return dataset.set_coords([f"solid_node_{axis}" for axis in "xyz"] + ["frame_time"])


# --- history --------------------------------------------------------------------------------------


def _history(frames: FrameSeries) -> xr.Dataset:
    variables: dict[str, tuple] = {
        "time": ("frame", np.array(frames.time, dtype=float), _time_attributes()),
        "tool": (
            "tool",
            np.array(frames.tool_names, dtype=str),
            {"long_name": "name of the tool"},
        ),
        "tool_travel": (
            ("frame", "tool"),
            np.array(frames.tool_travel, dtype=float),
            {"units": "m", "long_name": "travel of the tool along its direction"},
        ),
    }
    for axis, values in zip("xyz", np.moveaxis(frames.tool_force, -1, 0), strict=True):
        variables[f"tool_force_{axis}"] = (
            ("frame", "tool"),
            np.array(values, dtype=float),
            {"units": "N", "long_name": f"force of the blank on the tool, {axis} component"},
        )
    for name, values in frames.energy.items():
        variables[f"energy_{name}"] = (
            "frame",
            np.array(values, dtype=float),
            {"units": "J", "long_name": f"{name.replace('_', ' ')} (energy balance)"},
        )
    return xr.Dataset(variables, attrs={"Conventions": "CF-1.11"}).set_coords("time")


# --- shared ---------------------------------------------------------------------------------------


def _coordinates(mesh: str, positions: np.ndarray) -> dict[str, tuple]:
    variables = {}
    for axis, values in zip("xyz", positions.T, strict=True):
        attributes = {
            "units": "m",
            "long_name": f"{axis} coordinate of the node in the last frame",
            # Readers of two-dimensional meshes know the plane of the map by these names.
            "standard_name": f"projection_{axis}_coordinate",
        }
        if axis == "z":
            attributes |= {"standard_name": "height", "positive": "up"}
        variables[f"{mesh}_node_{axis}"] = (f"{mesh}_node", np.array(values), attributes)
    return variables


def _node_fields(mesh: str, reference: np.ndarray, current: np.ndarray) -> dict[str, tuple]:
    place = {"mesh": mesh, "location": "node"}
    variables: dict[str, tuple] = {}
    for name, values in (("displacement", current - reference), ("reference_position", reference)):
        dimensions = ("frame", f"{mesh}_node")[-(values.ndim - 1) :]
        for variable, component in zip(
            FIELDS[name].variables, np.moveaxis(values, -1, 0), strict=True
        ):
            attributes = FIELDS[name].attributes(variable) | place
            variables[variable] = (dimensions, np.ascontiguousarray(component), attributes)
    return variables


def _time(frames: FrameSeries) -> dict[str, tuple]:
    return {"frame_time": ("frame", np.array(frames.time, dtype=float), _time_attributes())}


def _time_attributes() -> dict[str, str]:
    return {"units": "s", "long_name": "process time of the saved frame"}


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
