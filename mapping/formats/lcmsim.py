"""LCMsim: the successor of RTMsim, a mesh with parts and a table of their properties.

Source: LCMsim_v2 (Obertscheider and others), its page on mesh and part description files.
"""

from __future__ import annotations

import csv
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.mapping.formats.format import ExportReport, MappedCells, Saver
from lcmchain.mapping.formats.preform import (
    Preform,
    class_table,
    losses_of,
    preform_of,
    write_mesh,
)

NAME = "lcmsim"

# LCMsim counts parts in eight bits. More classes than these make its table hard to read and lower
# the error little: twice as many take less than a third off it.
MOST_PARTS = 127
MOST_CLASSES = 32

COLUMNS = (
    "name", "type", "part_id", "thickness", "porosity", "porosity_noise", "permeability",
    "permeability_noise", "alpha", "refdir1", "refdir2", "refdir3", "porosity_1", "p_1",
)  # fmt: skip

# Pressure at which porosity_1 holds [Pa]; with the porosity itself there, it does not change.
REFERENCE_PRESSURE = 0.1e5


class Part(NamedTuple):
    """Row of the table: name, type and class of a part."""

    name: str
    kind: str
    of_class: int


def prepare(path: Path, cells: MappedCells) -> Saver:
    """Get ready to write the part description ``path`` and, with its stem and ``.bdf``, the mesh.

    Every class is a part, and so is what a port has of it: names with "inlet" or "outlet" (or
    "vent") in them are ports.

    Raises
    ------
    InputError : as :func:`~lcmchain.mapping.formats.preform.preform_of`.
    """
    preform = preform_of(cells, NAME, most_classes=MOST_CLASSES, classes_per_kind_of_port=0)
    parts, part = _parts(preform)
    if len(parts) > MOST_PARTS:
        raise InputError(
            f"the ports of the target make {len(parts)} parts and LCMsim counts to {MOST_PARTS}; "
            "give fewer inlets and outlets",
            file=cells.target.file,
        )
    return partial(_write, path, preform, parts, part)


def _write(path: Path, preform: Preform, parts: list[Part], part: np.ndarray) -> ExportReport:
    mesh = path.with_suffix(".bdf")
    write_mesh(mesh, preform, [], part)
    classes = preform.classes
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for number, (name, kind, row) in enumerate(parts, start=1):
            along, across = classes.values[row]
            porosity = f"{classes.porosity[row]:.9g}"
            table.writerow([
                name, kind, number, f"{classes.thickness[row]:.9g}", porosity, 0.0,
                f"{along:.9g}", 0.0, f"{across / along:.9g}",
                *(f"{value:.9g}" for value in classes.direction[row]), porosity,
                REFERENCE_PRESSURE,
            ])  # fmt: skip
    notes = [
        "LCMsim takes viscosity, pressures and the model from a file of simulation parameters and "
        "its call, which hold the process"
    ]
    if not preform.inlets:
        notes.append('the target has no set with "inlet" in its name, and LCMsim needs an inlet')
    return ExportReport(
        NAME, [path.name, mesh.name], preform.target.cell_count, losses_of(preform), notes,
        {"classes": class_table(preform)},
    )  # fmt: skip


def _parts(preform: Preform) -> tuple[list[Part], np.ndarray]:
    """Every part, and the part of each triangle, counted from 1."""
    port = np.full(len(preform.of_triangle), -1)
    ports = [
        (name, kind, rows)
        for kind, found in (("inlet", preform.inlets), ("outlet", preform.outlets))
        for name, rows in found.items()
    ]
    for number, (_, _, rows) in enumerate(ports):
        port[rows] = number
    parts: list[Part] = []
    part = np.zeros(len(port), dtype=np.int64)
    # Triangles of no port first, so that the first part is the base.
    for own, of_class in sorted({*zip(port.tolist(), preform.of_triangle.tolist(), strict=True)}):
        name, kind = ports[own][:2] if own >= 0 else ("class", "patch" if parts else "base")
        parts.append(Part(f"{name}_{of_class + 1}", kind, of_class))
        part[(port == own) & (preform.of_triangle == of_class)] = len(parts)
    return parts, part
