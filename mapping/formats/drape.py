"""DRAPE tables: thinning and fibre angle of each element, as bulk data of OptiStruct.

Source: Altair OptiStruct reference guide, bulk data entries DRAPE and PLY.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import first_few
from lcmchain.mapping.formats.bulk_data import line, real, require_narrow, rounded
from lcmchain.mapping.formats.format import ExportReport, Loss, MappedCells, Saver, worst
from lcmchain.mapping.sheet import FIBRE_FAMILIES, HEIGHT, SHARE

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
    losses = [*losses_of_layers(plies), *losses_of_order(cells, plies, NAME), *_rounding(plies)]
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


# --- every ply by element: thinning, and the angle of its fibres from a side ----------------------
# The format of OpenRadioss takes these rows too.


class Tables(NamedTuple):
    """Rows of one ply, on the M elements where it lies.

    name : of the ply; empty for the only sheet of a part.
    ids : numbers of the elements, shape (M,).
    thinning : thickness over its mean over the ply, shape (M,).
    angles : of each family [degrees], each of shape (M,).
    mean : thickness of the ply, weighted by area [m].
    """

    name: str
    ids: np.ndarray
    thinning: np.ndarray
    angles: list[np.ndarray]
    mean: float

    @property
    def of_family(self) -> float:
        """Thickness of each family [m]."""
        return self.mean / len(self.angles)


def draped_plies(cells: MappedCells, wanted_by: str) -> list[Tables]:
    """Return the rows of every ply that lies anywhere, the lowest along the normals first.

    Parameters
    ----------
    wanted_by : name of the format, for messages.

    Raises
    ------
    InputError : solid cells, no thickness or no fibre directions.
    """
    cells.require_shells(wanted_by)
    plies = [_tables_of(cells, name, wanted_by) for name in _names(cells, wanted_by)]
    return [ply for ply in plies if len(ply.ids)]


def covered_cells(plies: list[Tables]) -> int:
    """Return how many cells have a row of any ply."""
    return len(np.unique(np.concatenate([ply.ids for ply in plies]))) if plies else 0


def _angle_from_first_side(cells: MappedCells, directions: np.ndarray) -> np.ndarray:
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


def losses_of_layers(plies: list[Tables]) -> list[Loss]:
    """Say what a ply for each family leaves out."""
    most = max((len(ply.angles) for ply in plies), default=1)
    layer = {
        1: "the fibre volume fraction and every other field have no place in the table",
        2: "each family is a ply of half the thickness; that both lie in one layer, the fibre "
        "volume fraction and every other field have no place in the table",
        3: "each family is a ply of a third of the thickness; that all lie in one layer, the fibre "
        "volume fraction and every other field have no place in the table",
    }[most]
    return [Loss(layer)]


def losses_of_order(cells: MappedCells, plies: list[Tables], wanted_by: str) -> list[Loss]:
    """Say where the plies lie in another order along the normals than in the file."""
    if len(plies) < 2:
        return []
    heights = np.stack([cells.scalar(f"{HEIGHT}{ply.name}", wanted_by) for ply in plies])
    highest_below = np.fmax.accumulate(heights, axis=0)[:-1]
    other = np.flatnonzero((heights[1:] < highest_below).any(axis=0))
    if len(other) == 0:
        return []
    return [
        Loss(
            f"in {len(other)} cells ({first_few(cells.target.cell_ids[other])}) the plies lie in "
            "another order along the normal than in the file, as where the normal points to the "
            "other side of the stack; turn the normals of the target to one side"
        )
    ]


def title(ply: Tables, family: int) -> str:
    """Return the name of a ply and of one of its families, in ASCII."""
    return plain(f"{ply.name} {FIBRE_FAMILIES[family]}".strip())


def plain(text: str) -> str:
    """Return a text in ASCII, with question marks for all else."""
    return text.encode("ascii", "replace").decode("ascii")


def _names(cells: MappedCells, wanted_by: str) -> list[str]:
    """Names of the plies from the lowest to the highest; one that is empty without a stack.

    Plies are compared where both lie: a target may lie lower below a part of the stack, so that the
    mean height of a short ply says nothing of its place. Those that never lie upon each other have
    the order of their mean heights.
    """
    names = [key.removeprefix(SHARE) for key in cells.scalars if key.startswith(SHARE)]
    heights = {name: cells.scalar(f"{HEIGHT}{name}", wanted_by) for name in names}
    areas = cells.target.surface.areas

    def mean(height: np.ndarray) -> float:
        known = np.isfinite(height)
        return float(np.average(height[known], weights=areas[known])) if known.any() else 0.0

    left = sorted(names, key=lambda name: mean(heights[name]))
    order = []
    while left:
        lies_on_none = (
            name
            for name in left
            if not any(mean(heights[name] - heights[other]) > 0.0 for other in left)
        )
        order.append(next(lies_on_none, left[0]))
        left.remove(order[-1])
    return order or [""]


def _tables_of(cells: MappedCells, name: str, wanted_by: str) -> Tables:
    prefix = f"{name}_" if name else ""
    thickness = cells.scalar(f"{prefix}thickness", wanted_by)
    families = cells.families(wanted_by, prefix)
    known = np.isfinite(thickness) & np.isfinite(sum(families)).all(axis=1)
    if not name:
        known &= cells.mapped
    areas = cells.target.surface.areas[known]
    mean = float(np.average(thickness[known], weights=areas)) if known.any() else 0.0
    return Tables(
        name,
        cells.target.cell_ids[known],
        thickness[known] / mean,
        [np.degrees(_angle_from_first_side(cells, family))[known] for family in families],
        mean,
    )
