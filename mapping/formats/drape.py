"""DRAPE tables: thinning and fibre angle of each element, as bulk data of OptiStruct.

Source: Altair OptiStruct reference guide, bulk data entries DRAPE and PLY.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.mapping.formats.bulk_data import line, real, require_narrow, rounded
from lcmchain.mapping.formats.cells import MappedCells
from lcmchain.mapping.formats.draped_plies import (
    Tables,
    covered_cells,
    draped_plies,
    losses_of_layers,
    plain,
    title,
)
from lcmchain.mapping.formats.report import ExportReport, Loss, Saver, worst

NAME = "drape"


def prepare(path: Path, cells: MappedCells) -> Saver:
    """Get ready to write one DRAPE table per ply and fibre family, with a row per element there.

    The angle counts from side 1-2 of the element, positive about its normal. Each family is a ply
    with its share of the thickness; the thinning factor relates it to the mean of its ply. Of a
    stack every ply has tables of its own, the lowest along the normals of the elements first.

    Raises
    ------
    InputError : solid cells, no thickness or fibre directions, or numbers of cells that do not
        fit into eight columns.
    """
    plies = draped_plies(cells, NAME)
    require_narrow(cells.target.cell_ids, "cell", cells.target.file)
    return partial(_write, path, cells, plies)


def _write(path: Path, cells: MappedCells, plies: list[Tables]) -> ExportReport:
    families = [(ply, number) for ply in plies for number in range(len(ply.angles))]
    with replacing(path) as temporary, temporary.open("w", encoding="ascii") as file:
        for text in _head(cells, families):
            file.write(f"$ {text}\n")
        for number, (ply, family) in enumerate(families, start=1):
            file.write(f"$ {title(ply, family)}\n{line('DRAPE', number)}\n")
            columns = (ply.ids, ply.thinning, ply.angles[family])
            for row in zip(*(column.tolist() for column in columns)):
                file.write(line("", "ELEM", *row) + "\n")
    losses = [*losses_of_layers(plies), *_rounding(plies)]
    covered = covered_cells(plies)
    missing = cells.target.cell_count - covered
    if missing:
        losses.append(Loss(f"{missing} unmapped cells have no row"))
    thicknesses = {ply.name: ply.of_family for ply in plies}
    if "" in thicknesses:
        given = f"give each ply the thickness {thicknesses['']:.6g} m"
        details: dict[str, object] = {"ply_thickness_m": thicknesses[""]}
    else:
        each = ", ".join(f"{value:.6g} m ({name})" for name, value in thicknesses.items())
        given = f"give each ply the thickness of its table, {each},"
        details = {"ply_thickness_m": thicknesses}
    note = (
        f"{given} and the angle 0, and the elements no material angle or coordinate system of "
        "their own"
    )
    return ExportReport(NAME, [path.name], covered, losses, [note], details)


def _rounding(plies: list[Tables]) -> list[Loss]:
    turned = [
        np.max([np.abs(rounded(angles) - angles) for angles in ply.angles], axis=0) for ply in plies
    ]
    stretched = [np.abs(rounded(ply.thinning) / ply.thinning - 1.0) for ply in plies]
    ids = np.concatenate([ply.ids for ply in plies])
    angles = np.radians(np.concatenate(turned))
    return [
        worst("angles have eight columns", angles, ids, unit="rad"),
        worst("thinning factors have eight columns", np.concatenate(stretched), ids, unit="1"),
    ]


def _head(cells: MappedCells, families: list[tuple[Tables, int]]) -> list[str]:
    source = cells.provenance.get("source", "lcmchain")
    names = [title(ply, family) for ply, family in families]
    plies = [
        f"PLY,{number},MID,{real(ply.of_family)},0.0,,,{number}, +, ESID   ({name})"
        for number, ((ply, _), name) in enumerate(zip(families, names), start=1)
    ]
    of_sheet = {1: "the fibre family", 2: "both fibre families", 3: "three fibre families"}
    is_stack = bool(families[0][0].name) if families else False
    what = "every ply of a stack" if is_stack else of_sheet[len(families)]
    order = [
        "The plies stand in the order of their heights along the normals, lowest first; the",
        "element set ESID of a ply holds the elements that have a row in its table.",
    ]
    return [
        f"Draping of {what}; {plain(str(source))}; lengths in m, angles in degrees.",
        f"T of a row: thickness of the formed {'ply' if is_stack else 'sheet'} over its mean; "
        "THETA: angle of the fibre from",
        "side 1-2 of the element, positive about its normal.",
        *(order if is_stack else []),
        "The plies that take these tables (fill in material and element sets):",
        *plies,
    ]
