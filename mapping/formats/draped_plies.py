"""Every ply of a mapped result by element: thinning, and the angle of its fibres from a side.

Both formats that hold draping by element, of OptiStruct and of OpenRadioss, take these rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.mapping.formats.cells import MappedCells
from lcmchain.mapping.formats.report import Loss
from lcmchain.mapping.plies import HEIGHT, SHARE
from lcmchain.mapping.sheet import FIBRE_FAMILIES


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


def title(ply: Tables, family: int) -> str:
    """Return the name of a ply and of one of its families, in ASCII."""
    return plain(f"{ply.name} {FIBRE_FAMILIES[family]}".strip())


def plain(text: str) -> str:
    """Return a text in ASCII, with question marks for all else."""
    return text.encode("ascii", "replace").decode("ascii")


def _names(cells: MappedCells, wanted_by: str) -> list[str]:
    """Names of the plies from the lowest to the highest; one that is empty without a stack."""
    names = [key.removeprefix(SHARE) for key in cells.scalars if key.startswith(SHARE)]
    areas = cells.target.surface.areas

    def mean_height(name: str) -> float:
        height = cells.scalar(f"{HEIGHT}{name}", wanted_by)
        known = np.isfinite(height)
        return float(np.average(height[known], weights=areas[known])) if known.any() else 0.0

    return sorted(names, key=mean_height) or [""]


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
        [np.degrees(angle_from_first_side(cells, family))[known] for family in families],
        mean,
    )
