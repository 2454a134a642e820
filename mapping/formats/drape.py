"""DRAPE tables: thinning and fibre angle of each element, as bulk data of OptiStruct.

Source: Altair OptiStruct reference guide, bulk data entries DRAPE and PLY.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.mapping.formats.bulk_data import line, real, require_narrow, rounded
from lcmchain.mapping.formats.cells import MappedCells
from lcmchain.mapping.formats.report import ExportReport, Loss, Saver, worst
from lcmchain.mapping.sheet import FIBRE_FAMILIES

NAME = "drape"


class Tables(NamedTuple):
    """Rows of the mapped elements, M of them.

    ids : numbers of the elements, shape (M,).
    thinning : thickness over its mean over the part, shape (M,).
    angles : of each family [degrees], each of shape (M,).
    """

    ids: np.ndarray
    thinning: np.ndarray
    angles: list[np.ndarray]


def prepare(path: Path, cells: MappedCells) -> Saver:
    """Get ready to write one DRAPE table per fibre family, with a row per mapped element.

    The angle counts from side 1-2 of the element, positive about its normal. Each family is a ply
    with its share of the thickness; the thinning factor relates it to the mean of the part.

    Raises
    ------
    InputError : solid cells, no thickness or fibre directions, or numbers of cells that do not
        fit into eight columns.
    """
    cells.require_shells(NAME)
    target = cells.target
    require_narrow(target.cell_ids, "cell", target.file)
    thickness = cells.scalar("thickness", NAME)
    families = cells.families(NAME)
    known = cells.mapped & np.isfinite(sum(families)).all(axis=1)
    mean = float(np.average(thickness[known], weights=target.surface.areas[known]))
    tables = Tables(
        target.cell_ids[known],
        thickness[known] / mean,
        [np.degrees(angle_from_first_side(cells, family))[known] for family in families],
    )
    return partial(_write, path, cells, tables, mean)


def _write(path: Path, cells: MappedCells, tables: Tables, mean: float) -> ExportReport:
    count = len(tables.angles)
    share = 1.0 / count
    with replacing(path) as temporary, temporary.open("w", encoding="ascii") as file:
        for text in _head(cells, mean, count):
            file.write(f"$ {text}\n")
        for number, angles in enumerate(tables.angles, start=1):
            file.write(f"$ {FIBRE_FAMILIES[number - 1]}\n{line('DRAPE', number)}\n")
            for row in zip(*(column.tolist() for column in (tables.ids, tables.thinning, angles))):
                file.write(line("", "ELEM", *row) + "\n")
    layer = {
        1: "the fibre volume fraction and every other field have no place in the table",
        2: "each family is a ply of half the thickness; that both lie in one layer, the fibre "
        "volume fraction and every other field have no place in the table",
        3: "each family is a ply of a third of the thickness; that all lie in one layer, the fibre "
        "volume fraction and every other field have no place in the table",
    }[count]
    losses = [Loss(layer), *_rounding(tables)]
    missing = cells.target.cell_count - len(tables.ids)
    if missing:
        losses.append(Loss(f"{missing} unmapped cells have no row"))
    note = (
        f"give each ply the thickness {share * mean:.6g} m and the angle 0, and the elements no "
        "material angle or coordinate system of their own"
    )
    return ExportReport(
        NAME, [path.name], len(tables.ids), losses, [note], {"ply_thickness_m": share * mean}
    )


def _rounding(tables: Tables) -> list[Loss]:
    turned = np.max([np.abs(rounded(angles) - angles) for angles in tables.angles], axis=0)
    stretched = np.abs(rounded(tables.thinning) / tables.thinning - 1.0)
    return [
        worst("angles have eight columns", np.radians(turned), tables.ids, unit="rad"),
        worst("thinning factors have eight columns", stretched, tables.ids, unit="1"),
    ]


def angle_from_first_side(cells: MappedCells, directions: np.ndarray) -> np.ndarray:
    """Angle [rad] of a fibre from side 1-2 of its cell, in (-pi/2, pi/2], shape (C,).

    A fibre has no sense: an angle and that half a turn further are the same.
    """
    corners, normals = cells.target.surface.corners, cells.normals
    side = corners[:, 1] - corners[:, 0]
    side = side - np.einsum("ci,ci->c", side, normals)[:, None] * normals
    across = np.cross(normals, side)
    angle = np.arctan2(
        np.einsum("ci,ci->c", directions, across), np.einsum("ci,ci->c", directions, side)
    )
    return 0.5 * np.pi - np.mod(0.5 * np.pi - angle, np.pi)


def _head(cells: MappedCells, mean: float, count: int) -> list[str]:
    source = cells.provenance.get("source", "lcmchain")
    plies = [
        f"PLY,{number},MID,{real(mean / count)},0.0,,,{number}, +, ESID   ({name})"
        for number, name in enumerate(FIBRE_FAMILIES[:count], start=1)
    ]
    of_families = {1: "the fibre family", 2: "both fibre families", 3: "three fibre families"}
    return [
        f"Draping of {of_families[count]}; {_plain(str(source))}; lengths in m, angles in degrees.",
        "T of a row: thickness of the formed sheet over its mean; THETA: angle of the fibre from",
        "side 1-2 of the element, positive about its normal.",
        "The plies that take these tables (fill in material and element sets):",
        *plies,
    ]


def _plain(text: str) -> str:
    return text.encode("ascii", "replace").decode("ascii")
