"""The sheet or stack that is being formed, as the part that resin flows through."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array

from lcmchain.coupling.forming_fields import forming_datasets
from lcmchain.coupling.infiltration.formed_part import (
    NEEDED,
    FormedPart,
    blocks_of,
    with_permeability,
)
from lcmchain.coupling.solids.stack import StackForming
from lcmchain.fields import derive_fields
from lcmchain.fields.stack import plies_of
from lcmchain.fields.ugrid import TIME, UgridMesh, Variable
from lcmchain.mapping.plies import SHARE
from lcmchain.mapping.sheet import FIBRE_FAMILIES
from lcmchain.mapping.target import TargetMesh
from lcmchain.scene import Scene
from lcmchain.scene.infiltration.laws import Permeability
from lcmchain.solver.simulation import Simulation, Snapshot

#: Vectors of a ply that the columns need, of as many families as it has.
FIBRES = tuple(f"{family}_{axis}" for family in FIBRE_FAMILIES for axis in "xyz")


def law_of_scene(scene: Scene) -> Permeability:
    """Return the permeability of a scene whose resin flows in the sheet that is formed."""
    case = scene.wet_forming
    law = scene.permeability if case is None or case.permeability is None else case.permeability
    assert law is not None  # a scene without is refused
    return law


def part_of_sheet(
    scene: Scene, simulation: Simulation, snapshots: Sequence[Snapshot], points: np.ndarray
) -> FormedPart:
    """Return the sheet in the last of saved states; its cells are the elements in their order.

    Parameters
    ----------
    snapshots : the start, and any later ones. points : of its mid-surface then (N, 3) [m].
    """
    (body,) = simulation.model.bodies
    cells = np.asarray(body.mesh.sheet_faces, dtype=np.int64)
    target = TargetMesh(points, blocks_of(cells), {})
    fields = forming_datasets(scene, simulation, snapshots)["/"].isel({TIME: -1})
    return FormedPart(target, fields.drop_vars(TIME), str(scene.source.path or "the scene"))


def part_of_stack(
    scene: Scene,
    forming: StackForming,
    snapshots: Sequence[Snapshot],
    points: np.ndarray,
    law: Permeability,
) -> FormedPart:
    """Return the stack in the last of saved states; its cells are the columns.

    Fields without a name before their own are those of the ply whose elements the columns are, but
    for thickness, fibre volume fraction, areal mass and permeability, which are of all plies.

    Parameters
    ----------
    snapshots : the start, and any later ones; the last is the present. points : of the
        mid-surface of that ply (N, 3) [m]. law : of the permeability.
    """
    simulation, shares = forming.simulation, forming.shares
    datasets = forming_datasets(scene, simulation, snapshots)
    sheets = {name: groups["/"].isel({TIME: -1}) for name, groups in plies_of(datasets)}
    bodies = simulation.model.bodies
    own = bodies[forming.reference]
    mesh, part = UgridMesh("sheet"), sheets[own.name].drop_vars(TIME)
    volume, area = forming.ply_volumes(), forming.area()
    total = shares.T @ volume
    added: dict[str, Variable] = {}
    for body in bodies:
        rows = slice(body.first_element, body.first_element + body.mesh.element_count)
        parts = shares[rows].multiply(volume[rows, None]).tocsr()
        sheet = sheets[body.name]
        for name in (*NEEDED, *(name for name in FIBRES if name in sheet)):
            values = sheet[name]
            mean = mean_over_columns(parts, values.values)
            added[f"{body.name}_{name}"] = mesh.on_cells(mean, dict(values.attrs))
        share = {"units": "1", "long_name": f"share of the column that the ply {body.name} has"}
        added[f"{SHARE}{body.name}"] = mesh.on_cells(parts.sum(axis=0) / total, share)

    def of_elements(name: str) -> np.ndarray:
        return np.concatenate([sheets[body.name][name].values for body in bodies])

    fraction, on_area = of_elements("fibre_volume_fraction"), of_elements("areal_fibre_mass")
    for name, values in {
        "thickness": total / area,
        "fibre_volume_fraction": (shares.T @ (fraction * volume)) / total,
        "areal_fibre_mass": (shares.T @ (on_area * volume / of_elements("thickness"))) / area,
    }.items():
        added[name] = mesh.on_cells(values, dict(part[name].attrs))
    cells = np.asarray(own.mesh.sheet_faces, dtype=np.int64)
    found = FormedPart(
        TargetMesh(points, blocks_of(cells), {}),
        part.assign(added).assign_attrs(datasets["/"].attrs),
        str(scene.source.path or "the scene"),
    )
    return with_permeability(found, law, scene.source.directory)


def mean_over_columns(parts: csr_array, values: np.ndarray) -> np.ndarray:
    """Return means of values of elements (E,) in columns (C,), not a number where there are none.

    parts : volume of each element in each column (E, C).
    """
    there, summed = parts.sum(axis=0), parts.T @ np.asarray(values, dtype=float)
    return np.divide(summed, there, out=np.full_like(summed, np.nan), where=there > 0.0)


def fibre_fractions(simulation: Simulation) -> np.ndarray:
    """Return the fibre volume fractions of all elements at present (element_count,)."""
    positions = np.ascontiguousarray(simulation.state.position.T)
    found = []
    for body in simulation.model.bodies:
        nodes = slice(body.first_node, body.first_node + body.mesh.node_count)
        now = derive_fields(body.mesh, body.material, positions[nodes])
        found.append(now["fibre_volume_fraction"])
    return np.concatenate(found)


def blank_of_scene(scene: Scene) -> FormedPart:
    """Return the blank or stack of a scene, before it is formed.

    A stack has the columns of :class:`~lcmchain.coupling.solids.stack.StackForming` for cells.
    """
    simulation = Simulation.from_scene(scene)
    if len(simulation.model.bodies) > 1:
        forming, law = StackForming.of_scene(scene, simulation), law_of_scene(scene)
        return part_of_stack(scene, forming, [simulation.snapshot()], forming.points(), law)
    (body,) = simulation.model.bodies
    points = body.mesh.mid_surface(simulation.model.node_positions)
    return part_of_sheet(scene, simulation, [simulation.snapshot()], points)
