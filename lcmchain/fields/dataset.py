"""A forming result as datasets: sheet (root group), solid, and history over the frames."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from lcmchain import __version__
from lcmchain.elements.families import family_of
from lcmchain.fields.between_plies import BetweenPlies
from lcmchain.fields.courses import course_fields, gap_fields
from lcmchain.fields.derived import (
    TWO_ALONG_THE_AXES,
    derive_fields,
    pressure_fields,
    tool_pressure,
)
from lcmchain.fields.netcdf_file import ROOT
from lcmchain.fields.saved import HISTORY, FrameSeries, Histories, history_dataset
from lcmchain.fields.sheet import BUCKLES, COURSE, FROM_PLY_AXIS, JOINT_GAP
from lcmchain.fields.stack import FILMS, PLY, Columns, StackedPly, columns_of
from lcmchain.fields.ugrid import (
    CONVENTIONS,
    NO_NODE,
    TIME,
    Described,
    UgridMesh,
    Variable,
    saved_times,
)
from lcmchain.fields.wrinkles import Lifted, closed_faces, lifted_off, longest_wave, wrinkle_risk
from lcmchain.materials.law import (
    Material,
    fibre_angles,
    is_film,
    remembered,
    tells_fibres,
)
from lcmchain.mesh.sheet_mesh import SheetMesh
from lcmchain.quantities.fields import FIELD_OF_VARIABLE, FIELDS, NO_THICKNESS
from lcmchain.scene.stages import plies_there
from lcmchain.tools.table import turning

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.elements.family import Body
    from lcmchain.model import Model
    from lcmchain.scene import Scene
    from lcmchain.tools.table import ToolTable

SHEET, SOLID = ROOT, "/solid"
SHEET_MESH = UgridMesh("sheet")
SOLID_MESH = UgridMesh("solid", topology_dimension=3)

#: Fields that a group of a ply has, and the group of all plies has not: courses have numbers of
#: their own in every ply.
OF_ONE_PLY = (COURSE, JOINT_GAP)

#: Attribute of ``wrinkle_height``: the longest wave that counts as wrinkle [m].
WRINKLE_LENGTH = "longest_wave_m"


class LaidSheet(NamedTuple):
    """A sheet without elements that have forces: its undeformed mesh, and what it is made of."""

    mesh: SheetMesh
    material: Material


@dataclass(frozen=True)
class SheetFrames:
    """One sheet with its part of the saved frames.

    positions : (F, node_count, 3) [m].
    history : (F, history_count, element_count), what the law remembers.
    pressures : face fields of :func:`lcmchain.fields.derived.pressure_fields`, (F, element_count),
        and that of a fluid.
    tool_pressure : on the nodes (F, node_count) [Pa], or None.
    wrinkles : on the nodes of the mid-surface, or None where no wrinkles are predicted.
    wrinkle_length : longest wave that counts as wrinkle [m].
    between_plies : against other plies, or None.
    wrinkle_risk : the fields of :mod:`lcmchain.fields.wrinkles` by name (F, element_count);
        empty unless the scene asks for them.
    """

    body: Body | LaidSheet
    positions: np.ndarray
    history: np.ndarray
    pressures: dict[str, np.ndarray]
    tool_pressure: np.ndarray | None
    wrinkles: Lifted | None
    wrinkle_length: float
    between_plies: BetweenPlies | None = None
    wrinkle_risk: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)

    @classmethod
    def of_body(cls, scene: Scene, model: Model, body: Body, frames: FrameSeries) -> SheetFrames:
        """Return the part of a body of the model."""
        past = [model.history_of(body, values) for values in frames.history]  # type: ignore[union-attr]
        sheet = cls.of_frames(scene, body, frames, past, model.tools)
        if frames.between_plies is not None:
            names = [other.name for other in model.bodies]
            between = BetweenPlies.of_body(body, frames.positions, frames.between_plies, names)
            sheet = replace(sheet, between_plies=between)
        if model.pore is None or frames.pore_pressure is None:
            return sheet
        place = model.pore.place[body.first_element :][: body.mesh.element_count]
        pore = {"pore_pressure": np.ascontiguousarray(frames.pore_pressure[:, place])}
        return replace(sheet, pressures=sheet.pressures | pore)

    @classmethod
    def of_frames(
        cls,
        scene: Scene,
        body: Body,
        frames: FrameSeries,
        history: Sequence[np.ndarray],
        tools: ToolTable | None = None,
    ) -> SheetFrames:
        """Return the part of a body; ``history`` is its own, in blocks, for every frame."""
        nodes = slice(body.first_node, body.first_node + body.mesh.node_count)
        steps = [pressure_fields(body, *state) for state in zip(frames.positions, history)]
        on_nodes = None
        if frames.contact_force is not None:
            states = zip(frames.positions, frames.contact_force)
            on_nodes = np.stack([tool_pressure(body, *state) for state in states])
        length = scene.output.wrinkle_length or longest_wave(body.mesh)
        own = frames.positions[:, nodes]
        beside_tools: dict[str, Any] = {"tools": tools, "travel": frames.tool_travel}
        risk = {}
        if scene.output.wrinkle_risk and tells_fibres(body.material):
            touch = max(scene.stack.thickness, body.mesh.thickness)
            risk = wrinkle_risk(body.mesh, body.material, own, length, touch=touch, **beside_tools)
        return cls(
            body,
            own,
            np.stack([body.element_history(values) for values in history]),
            {name: np.stack([step[name] for step in steps]) for name in steps[0]},
            on_nodes,
            lifted_off(body.mesh, own, length, **beside_tools),
            length,
            wrinkle_risk=risk,
        )

    def between(self, columns: Columns) -> SheetFrames:
        """Return the sheet as a ply of a stack: others take a part of the room of its wrinkles."""
        if self.wrinkles is None:
            return self
        faces = closed_faces(self.mesh.sheet_faces)
        node, face = faces.ravel(), np.repeat(np.arange(len(faces)), faces.shape[1])
        share = 1.0 / np.bincount(node)[node]
        shape = self.wrinkles.height.shape[1], len(faces)
        means = csr_matrix((share, (node, face)), shape)
        height = self.wrinkles.less((means @ columns.below.T).T, (means @ columns.above.T).T)
        return replace(self, wrinkles=self.wrinkles._replace(height=height))

    @property
    def mesh(self) -> SheetMesh:
        return self.body.mesh

    @property
    def material(self) -> Material:
        return self.body.material

    def fields(self) -> dict[str, Described]:
        """Return values (F, element_count) and attributes of every face field."""
        values = derive_fields(self.mesh, self.material, self.positions) | self.pressures
        values |= self.wrinkle_risk
        variables: dict[str, Described] = {
            name: (value, FIELD_OF_VARIABLE[name].attributes(name))
            for name, value in values.items()
        }
        angles = fibre_angles(self.material)
        if angles != TWO_ALONG_THE_AXES and tells_fibres(self.material):
            for name in FIELDS["fibre_direction_1"].variables:
                variables[name][1][FROM_PLY_AXIS] = float(angles[0])
        if getattr(self.material, "buckles", False):
            for number in range(1, len(angles) + 1):
                variables[f"fibre_strain_{number}"][1][BUCKLES] = 1
        # of a sheet without forces nothing is remembered, whatever its law
        for entry, value in zip(remembered(self.material.law), np.moveaxis(self.history, 1, 0)):
            attributes = {"units": entry.unit, "long_name": entry.meaning}
            variables[entry.name] = (np.ascontiguousarray(value), attributes)
        return variables | course_fields(self.mesh, len(self.positions))

    def node_fields(self) -> dict[str, Described]:
        """Return values (F, n) and attributes of the fields on the mid-surface nodes."""
        variables = {}
        if self.wrinkles is not None:
            attributes: dict[str, Any] = FIELDS["wrinkle_height"].attributes("wrinkle_height")
            attributes[WRINKLE_LENGTH] = self.wrinkle_length
            variables["wrinkle_height"] = self.wrinkles.height, attributes
        for side, nodes in self.mesh.sides().items():
            if self.tool_pressure is not None:
                name = f"tool_pressure_{side}" if side else "tool_pressure"
                values = np.ascontiguousarray(self.tool_pressure[:, nodes])
                variables[name] = (values, FIELDS[name].attributes(name))
            if self.between_plies is not None:
                variables |= self.between_plies.fields(side, nodes)
        return variables | gap_fields(self.mesh, self.mesh.mid_surface(self.positions))


def build_datasets(
    scene: Scene, blank: SheetMesh, frames: FrameSeries, *, material: Material | None = None
) -> dict[str, xr.Dataset]:
    """Turn the saved frames of one sheet into the groups of ``forming.nc``.

    The root group ``"/"`` holds the mid-surface as the two-dimensional UGRID mesh ``sheet`` with
    the fields of :data:`lcmchain.quantities.fields.FIELDS`, and nothing that readers of such meshes
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
    Datasets by group name. Face variables have the dimensions ``time`` and ``sheet_face``.
    """
    ply = scene.only_ply("build_datasets")
    fabric = ply.built_material() if material is None else material
    body = family_of(ply.element).build("sheet", blank, fabric, ply.element, 0, 0)
    past = []
    for positions in frames.positions:
        past.append(body.no_history())
        body.renew(np.ascontiguousarray(positions.T), past[-1])
    sheet = SheetFrames.of_frames(scene, body, frames, past)
    return _one_sheet(scene, sheet, frames) | {HISTORY: history_dataset(frames)}


def model_datasets(
    scene: Scene,
    model: Model,
    frames: FrameSeries,
    histories: Histories | None = None,
    *,
    attributes: Mapping[str, str] | None = None,
) -> dict[str, xr.Dataset]:
    """Turn the saved frames of a model into the groups of ``forming.nc``.

    One body: as :func:`build_datasets`. Several: body ``b`` has the group ``"/b"`` with its
    mid-surface as the mesh ``b`` and, if it has a thickness, ``"/b/solid"``. The root group holds
    all mid-surfaces together as the mesh ``sheet``, in the order of the bodies, with the face
    variable ``body`` (flags) that tells them apart; a field that a body does not have is nan there.
    What lies over each other at a face is told by the fields ``stack_thickness`` and so on
    (:mod:`lcmchain.fields.stack`).

    histories : of the run; ``"/history"`` holds those of the frames without them.
    attributes : further global attributes of the file, such as the state of the run.
    """
    frames = replace(frames, tool_turns=turning(model.tools))
    sheets = {b.name: SheetFrames.of_body(scene, model, b, frames) for b in model.bodies}
    return sheets_datasets(scene, sheets, frames, histories, attributes=attributes)


def sheets_datasets(
    scene: Scene,
    sheets: Mapping[str, SheetFrames],
    frames: FrameSeries,
    histories: Histories | None = None,
    *,
    attributes: Mapping[str, str] | None = None,
) -> dict[str, xr.Dataset]:
    """Turn the frames of sheets by their names, bottom first, into the groups of ``forming.nc``.

    As :func:`model_datasets`, for sheets that need not have forces.
    """
    if len(sheets) == 1:
        groups = _one_sheet(scene, next(iter(sheets.values())), frames)
    else:
        each = [sheet.fields() for sheet in sheets.values()]
        columns = _columns(sheets, each, plies_there(scene, frames.time))
        sheets = {
            name: sheet.between(of_ply)
            for (name, sheet), of_ply in zip(sheets.items(), columns, strict=True)
        }
        each = [own | _through_stack(of_ply) for own, of_ply in zip(each, columns, strict=True)]
        groups = {SHEET: _all_sheets(scene, sheets, each, frames)}
        for name, sheet in sheets.items():
            groups[f"/{name}"] = _sheet(scene, UgridMesh(name), sheet, frames)
            if sheet.mesh.volumes is not None:
                groups[f"/{name}/solid"] = _solid(sheet, frames)
    groups[SHEET].attrs.update(attributes or {})
    return groups | {HISTORY: history_dataset(frames, histories)}


def laid_datasets(
    scene: Scene,
    sheet: LaidSheet,
    frames: FrameSeries,
    given: Mapping[str, np.ndarray],
    *,
    attributes: Mapping[str, str] | None = None,
) -> dict[str, xr.Dataset]:
    """Turn frames of a sheet that was laid without forces into the groups of ``forming.nc``.

    Parameters
    ----------
    frames : with the positions of the mid-surface.
    given : face fields that do not follow from them, by name (F, face_count).
    attributes : further global attributes of the file.
    """
    none = np.empty((frames.frame_count, 0, sheet.mesh.element_count))
    laid = SheetFrames(sheet, frames.positions, none, dict(given), None, None, np.nan)
    groups = _one_sheet(scene, laid, frames)
    groups[SHEET].attrs.update(attributes or {})
    return groups | {HISTORY: history_dataset(frames)}


def add_face_variables(
    datasets: Mapping[str, xr.Dataset], variables: Mapping[str, Any]
) -> dict[str, xr.Dataset]:
    """Return the datasets with further fields on the faces of the sheet, such as permeabilities.

    Parameters
    ----------
    datasets : from :func:`build_datasets`.
    variables : values by name, of shape (frame_count, face_count), or with a last axis of three
        for a vector, which becomes three variables. Either the values alone, for a name in
        :data:`lcmchain.quantities.fields.FIELDS`, or ``(values, attributes)`` with ``units`` and
        ``long_name``. Shapes without the leading axis hold for every frame.

    Raises
    ------
    ValueError : wrong shape; no unit or name known for a field.
    """
    sheet = datasets[SHEET].copy()
    shape = (sheet.sizes[TIME], sheet.sizes[SHEET_MESH.cell_dimension])
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


# --- sheets ---------------------------------------------------------------------------------------


def _one_sheet(scene: Scene, sheet: SheetFrames, frames: FrameSeries) -> dict[str, xr.Dataset]:
    groups = {SHEET: _sheet(scene, SHEET_MESH, sheet, frames)}
    if sheet.mesh.volumes is not None:
        groups[SOLID] = _solid(sheet, frames)
    return groups


def _sheet(scene: Scene, mesh: UgridMesh, sheet: SheetFrames, frames: FrameSeries) -> xr.Dataset:
    reference = sheet.mesh.mid_surface(sheet.mesh.node_positions)
    current = sheet.mesh.mid_surface(sheet.positions)
    variables: dict[str, Variable] = {
        **mesh.topology(
            sheet.mesh.sheet_faces, long_name="mid-surface of the textile, one face per element"
        ),
        **_moving_nodes(mesh, reference, current, frames),
    }
    for name, (values, attributes) in sheet.fields().items():
        variables[name] = mesh.on_cells(values, attributes)
    for name, (values, attributes) in sheet.node_fields().items():
        variables[name] = mesh.on_nodes(values, attributes)
    attributes = _global_attributes(scene, sheet.material)
    if "thickness" not in variables:
        attributes["comment"] = NO_THICKNESS
    return mesh.dataset(variables, attributes)


def _all_sheets(
    scene: Scene,
    sheets: Mapping[str, SheetFrames],
    each: Sequence[dict[str, Described]],
    frames: FrameSeries,
) -> xr.Dataset:
    """Return the mid-surfaces of all bodies as one mesh; ``each`` has the face fields of each."""
    mesh = SHEET_MESH
    references = [s.mesh.mid_surface(s.mesh.node_positions) for s in sheets.values()]
    current = [s.mesh.mid_surface(s.positions) for s in sheets.values()]
    faces, first = [], 0
    for sheet, reference in zip(sheets.values(), references, strict=True):
        own = sheet.mesh.sheet_faces
        own = np.pad(own, ((0, 0), (0, 4 - own.shape[1])), constant_values=NO_NODE)
        faces.append(np.where(own == NO_NODE, NO_NODE, own + first))
        first += len(reference)
    variables: dict[str, Variable] = {
        **mesh.topology(
            np.concatenate(faces), long_name="mid-surfaces of all sheets, one face per element"
        ),
        **_moving_nodes(mesh, np.concatenate(references), np.concatenate(current, axis=1), frames),
    }
    counts = [s.mesh.element_count for s in sheets.values()]
    for name, field in _joined(each, counts).items():
        variables[name] = mesh.on_cells(*field)
    node_counts = [len(reference) for reference in references]
    for name, field in _joined([s.node_fields() for s in sheets.values()], node_counts).items():
        variables[name] = mesh.on_nodes(*field)
    flags = np.arange(len(sheets), dtype=np.int32)
    variables[PLY] = mesh.on_cells(
        np.repeat(flags, counts),
        {
            "long_name": "sheet that the face belongs to",
            "units": "1",
            "flag_values": flags,
            "flag_meanings": " ".join(sheets),
        },
    )
    films = [name for name, sheet in sheets.items() if is_film(sheet.material)]
    if films:
        variables[PLY][2][FILMS] = " ".join(films)
    attributes = _global_attributes(scene, None)
    attributes["comment"] = (
        "all plies, bottom first; each has a group of its own, and stack_ fields are of those that "
        "lie over each other"
    )
    return mesh.dataset(variables, attributes)


def _columns(
    sheets: Mapping[str, SheetFrames],
    each: Sequence[dict[str, Described]],
    there: Mapping[str, np.ndarray],
) -> list[Columns]:
    """Return what the columns of each ply meet.

    each : face fields of each sheet.
    there : in which frames a ply is there, by its name; those without an entry are in all.
    """
    plies = [
        StackedPly.of_mesh(
            sheet.mesh,
            sheet.material,
            sheet.positions,
            {field: values for field, (values, _) in own.items()},
            there.get(name),
        )
        for (name, sheet), own in zip(sheets.items(), each, strict=True)
    ]
    return columns_of(plies)


def _through_stack(columns: Columns) -> dict[str, Described]:
    """Return the fields of the stack on the faces of a ply."""
    values = {
        "stack_thickness": columns.thickness,
        "stack_areal_fibre_mass": columns.areal_mass,
        "stack_fibre_volume_fraction": columns.fibre_volume_fraction,
        "stack_ply_count": columns.ply_count.astype(float),
    }
    return {
        name: (value, FIELDS[name].attributes(name))
        for name, value in values.items()
        if value is not None
    }


def _joined(fields: Sequence[dict[str, Described]], counts: Sequence[int]) -> dict[str, Described]:
    """Return the fields of several sheets one after the other, nan where a sheet has none."""
    joined = {}
    names = dict.fromkeys(name for own in fields for name in own)
    for name in [name for name in names if name not in OF_ONE_PLY]:
        values, attributes = next(own[name] for own in fields if name in own)
        # what plies do not share is no attribute of all
        unlike = [
            key
            for key in (FROM_PLY_AXIS, BUCKLES)
            if len({own[name][1].get(key, 0) for own in fields if name in own}) > 1
        ]
        attributes = {key: value for key, value in attributes.items() if key not in unlike}
        missing = [np.full((len(values), count), np.nan) for count in counts]
        parts = [own[name][0] if name in own else gap for own, gap in zip(fields, missing)]
        joined[name] = np.concatenate(parts, axis=1), attributes
    return joined


def _moving_nodes(
    mesh: UgridMesh, reference: np.ndarray, current: np.ndarray, frames: FrameSeries
) -> dict[str, Variable]:
    return {
        **_coordinates(mesh, current[-1]),
        TIME: saved_times(frames.time),
        **_node_fields(mesh, reference, current),
    }


def _global_attributes(scene: Scene, material: Material | None) -> dict[str, Any]:
    """Return what the file says of its origin, and of the one material of a group."""
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    attributes: dict[str, Any] = {
        "Conventions": CONVENTIONS,
        "title": str(scene.title),
        "history": f"{now} formed by lcmchain {__version__}",
        "source": f"lcmchain {__version__}",
        "scene": scene.source.text,
        "scene_sha256": scene.source.sha256,
    }
    if material is None:
        return attributes
    attributes |= {
        "material": str(material.name),
        "areal_mass_kg_m2": float(material.areal_mass),
    }
    if not tells_fibres(material):
        del attributes["areal_mass_kg_m2"]
    if material.fibre_density is not None:
        attributes["fibre_density_kg_m3"] = float(material.fibre_density)
    return attributes


# --- solid ----------------------------------------------------------------------------------------


def _solid(sheet: SheetFrames, frames: FrameSeries) -> xr.Dataset:
    volumes = sheet.mesh.volumes.astype(np.int32)  # type: ignore[union-attr]
    mesh = SOLID_MESH
    variables = {
        **mesh.topology(
            volumes,
            long_name="solid-shell elements; volume i belongs to face i of the sheet",
            cell_nodes_long_name="nodes of each volume in the order of VTK, bottom face first",
        ),
        **mesh.volume_shapes(volumes, long_name="shape of each volume", node_counts=(6, 8)),
        **_coordinates(mesh, sheet.positions[-1]),
        TIME: saved_times(frames.time),
        **_node_fields(mesh, sheet.mesh.node_positions, sheet.positions),
    }
    if sheet.tool_pressure is not None:
        attributes = FIELDS["tool_pressure"].attributes("tool_pressure")
        variables["tool_pressure"] = mesh.on_nodes(sheet.tool_pressure, attributes)
    return mesh.dataset(variables, {"Conventions": CONVENTIONS})


# --- shared ---------------------------------------------------------------------------------------


def _coordinates(mesh: UgridMesh, positions: np.ndarray) -> dict[str, Variable]:
    return mesh.node_positions(positions, long_name="coordinate of the node in the last frame")


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


def _scalars(name: str, values: np.ndarray, shape: tuple[int, int]) -> list[tuple[str, np.ndarray]]:
    """Return names and values of the components of a field, each of the shape of a scalar."""
    for scalar_shape in (shape, shape[1:]):
        if values.shape == scalar_shape:
            return [(name, values)]
        if values.shape == (*scalar_shape, 3):
            return [(f"{name}_{axis}", values[..., i]) for i, axis in enumerate("xyz")]
    raise ValueError(
        f"{name} has the shape {values.shape}; (frame_count, face_count) is {shape}, "
        "with a last axis of 3 for vectors"
    )
