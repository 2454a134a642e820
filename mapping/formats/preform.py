"""What the exports to filling programs share: triangles, their properties, classes and mesh."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.mapping.formats.bulk_data import line, require_narrow, rounded
from lcmchain.mapping.formats.cells import MappedCells
from lcmchain.mapping.formats.classes import (
    ClassErrors,
    Classes,
    Permeable,
    class_errors,
    classify,
)
from lcmchain.mapping.formats.report import Loss, worst
from lcmchain.mapping.formats.triangles import Triangles, triangles_of
from lcmchain.mapping.target import TargetMesh

#: Sets and parts of the target with such names are ports; a name that fits both is an inlet.
INLET = re.compile("inlet|inflow|injection")
OUTLET = re.compile("outlet|(?<![a-z])vents?(?![a-z])")


@dataclass(frozen=True)
class Preform:
    """Triangles with classes of permeability.

    Parameters
    ----------
    errors : what the classes leave of each cell, shape (C,).
    area : of each cell [m2], shape (C,).
    of_triangle : class of each triangle, shape (T,).
    inlets, outlets : rows of the triangles of each port.
    """

    target: TargetMesh
    triangles: Triangles
    classes: Classes
    errors: ClassErrors
    area: np.ndarray
    of_triangle: np.ndarray
    inlets: dict[str, np.ndarray]
    outlets: dict[str, np.ndarray]


def preform_of(
    cells: MappedCells, wanted_by: str, *, most_classes: int, classes_per_kind_of_port: int
) -> Preform:
    """Gather what a filling program needs.

    Parameters
    ----------
    most_classes : classes that the program knows where the target has no ports.
    classes_per_kind_of_port : how many of these the inlets take, and how many the outlets.

    Raises
    ------
    InputError : solid cells, no thickness, fibre volume fraction or permeability, cells without
        one of them, or numbers that do not fit into the mesh file.
    """
    cells.require_shells(wanted_by)
    target = cells.target
    triangles = triangles_of(target)
    require_narrow(triangles.ids, "cell", target.file)
    require_narrow(target.node_ids, "node", target.file)
    thickness = cells.scalar("thickness", wanted_by)
    solid_share = cells.scalar("fibre_volume_fraction", wanted_by)
    cells.require_whole(np.isfinite(thickness + solid_share), "no thickness", wanted_by)
    cells.require_whole(solid_share < 1.0, "no pores", wanted_by)
    values, axis = cells.permeability(wanted_by)
    area = target.surface.areas
    permeable = Permeable(values, axis, cells.normals, 1.0 - solid_share, thickness, area)
    inlets, outlets = (_ports(target, triangles, words) for words in (INLET, OUTLET))
    outlets = {name: rows for name, rows in outlets.items() if name not in inlets}
    kinds = int(bool(inlets)) + int(bool(outlets))
    classes = classify(permeable, most_classes - kinds * classes_per_kind_of_port)
    return Preform(
        target, triangles, classes, class_errors(permeable, classes), area,
        classes.of_cell[triangles.cell], inlets, outlets,
    )  # fmt: skip


def _ports(
    target: TargetMesh, triangles: Triangles, words: re.Pattern[str]
) -> dict[str, np.ndarray]:
    """Rows of the triangles of every set and part whose name has one of the words."""
    return {
        name: np.flatnonzero(np.isin(triangles.cell, rows))
        for name, rows in {**target.parts, **target.cell_sets}.items()
        if len(rows) and words.search(name.lower())
    }


def write_mesh(path: Path, preform: Preform, head: list[str], part: np.ndarray) -> None:
    """Write nodes and triangles as bulk data in columns of eight.

    head : lines before the bulk data, such as sets.
    part : number of the property of each triangle, shape (T,).
    """
    target, triangles = preform.target, preform.triangles
    used = np.unique(triangles.nodes)
    with replacing(path) as temporary, temporary.open("w", encoding="ascii") as file:
        file.write("\n".join(["$ lengths in m", "CEND", *head, "BEGIN BULK", ""]))
        for node in used:
            x, y, z = (float(value) for value in target.points[node])
            file.write(line("GRID", int(target.node_ids[node]), "", x, y, z) + "\n")
        for number, of_part, nodes in zip(triangles.ids, part, triangles.nodes, strict=True):
            ids = target.node_ids[nodes].tolist()
            file.write(line("CTRIA3", int(number), int(of_part), *ids) + "\n")
        file.write("ENDDATA\n")


def losses_of(preform: Preform) -> list[Loss]:
    """What a mesh of classes cannot hold, with the worst cells."""
    target, errors = preform.target, preform.errors
    used = np.unique(preform.triangles.nodes)
    points = target.points[used]
    moved = np.linalg.norm(rounded(points) - points, axis=1)
    count = preform.classes.count
    of_classes = f"{count} classes stand for {target.cell_count} cells"
    losses = [
        worst(f"{of_classes}: {name}", error, target.cell_ids, unit="1", area=preform.area)
        for name, error in (
            ("permeability tensor in the plane", errors.permeability),
            ("porosity", errors.porosity),
            ("thickness", errors.thickness),
        )
    ]
    losses.append(
        worst(
            "places of nodes have eight columns",
            moved,
            target.node_ids[used],
            unit="m",
            place="node",
        )
    )
    losses.append(
        Loss(
            "flow through the thickness, both fibre directions and every other field have no place"
        )
    )
    halved = preform.triangles.halved
    if halved:
        what = f"{halved} quadrilaterals are two triangles each, with the values of the cell"
        losses.append(Loss(what, 0.0))
    return losses


def class_table(preform: Preform) -> list[dict[str, float | int | list[float]]]:
    """Properties of the classes, ready for JSON, in the order of their area."""
    classes = preform.classes
    area = np.bincount(classes.of_cell, preform.area, minlength=classes.count)
    return [
        {
            "area_m2": float(area[number]),
            "thickness_m": float(classes.thickness[number]),
            "porosity": float(classes.porosity[number]),
            "permeability_m2": float(classes.values[number, 0]),
            "alpha": float(classes.values[number, 1] / classes.values[number, 0]),
            "reference_direction": classes.direction[number].tolist(),
        }
        for number in range(classes.count)
    ]
