"""Tables of a formed sheet along lines: a section with its fields, the rim with its draw-in."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.fields.sheet import (
    COURSE,
    JOINT_GAP,
    reference_positions,
    sheet_faces,
    sheet_positions,
)
from lcmchain.mesh.lines import cut_edges, in_order
from lcmchain.mesh.places import Places

if TYPE_CHECKING:
    import xarray as xr

#: Fields of a section, by the heading of their column.
SECTION_FIELDS = {
    "thickness [m]": "thickness",
    "shear angle [rad]": "shear_angle",
    "fibre volume fraction [1]": "fibre_volume_fraction",
}
#: A plane through nodes is moved aside by this part of the sheet's extent.
ASIDE = 1e-7

Table = dict[str, np.ndarray]


def section_table(
    sheet: xr.Dataset, point: np.ndarray, normal: np.ndarray, frame: int = -1
) -> Table:
    """Return thickness, shear and fibre volume fraction along a section of a formed sheet.

    One row for each element that the plane cuts, at the middle of its cut.

    Parameters
    ----------
    sheet : group of a result. point, normal : of the plane (3,) [m], [1].

    Returns
    -------
    columns of equal length: strip (pieces that hang together are counted from 0), length along the
    strip [m], position [m], element, and the fields that the elements have.

    Raises
    ------
    InputError : the plane misses the sheet.
    """
    positions, faces = sheet_positions(sheet, frame), sheet_faces(sheet)
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    height = (positions - point) @ normal - ASIDE * float(np.ptp(positions, axis=0).max())
    cut = cut_edges(faces, height)
    if len(cut.polygons) == 0:
        raise InputError("the plane of the section misses the sheet; move its point")
    places = cut.places(positions)
    rows = _along(cut.ends, places, normal)
    element = cut.polygons[[row for _, row, _ in rows]]
    pair = cut.ends[[row for _, row, _ in rows]]
    middle = places[pair].mean(axis=1)
    table = {
        "strip": np.array([strip for strip, _, _ in rows]),
        "length [m]": np.array([length for _, _, length in rows]),
        **{f"{axis} [m]": middle[:, k] for k, axis in enumerate("xyz")},
        "element": element,
    }
    for heading, name in SECTION_FIELDS.items():
        if name in sheet:
            table[heading] = sheet[name].values[frame][element]
    return table


def _along(
    pairs: np.ndarray, places: np.ndarray, normal: np.ndarray
) -> list[tuple[int, int, float]]:
    """Order pieces (n, 2) of a cut along it: strip, piece, and length at the piece's middle [m]."""
    at: dict[int, list[int]] = {}
    for row, (first, second) in enumerate(pairs.tolist()):
        at.setdefault(first, []).append(row)
        at.setdefault(second, []).append(row)
    direction = np.cross(normal, [0.0, 0.0, 1.0] if abs(normal[2]) < 0.9 else [0.0, 1.0, 0.0])
    order = sorted(at, key=lambda end: (len(at[end]) != 1, float(places[end] @ direction)))
    rows: list[tuple[int, int, float]] = []
    seen: set[int] = set()
    strip = 0
    for start in order:
        here, length, begun = start, 0.0, len(rows)
        while onward := [row for row in at[here] if row not in seen]:
            row = onward[0]
            seen.add(row)
            first, second = pairs[row]
            own = float(np.linalg.norm(places[second] - places[first]))
            rows.append((strip, row, length + 0.5 * own))
            length += own
            here = int(second if first == here else first)
        strip += len(rows) > begun
    return rows


def rim_table(sheet: xr.Dataset, frame: int = -1) -> Table:
    """Return how far the rim of a sheet has been drawn in, node by node along it.

    Returns
    -------
    columns of equal length: length along the flat rim, anticlockwise from its corner with the
    smallest x + y [m]; place in the flat blank; position in the part; draw-in, the way inward
    normal to the flat rim, and along it, both in plan [m].

    Raises
    ------
    InputError : the sheet consists of several courses.
    """
    if COURSE in sheet:
        raise InputError(
            "holds a ply in several courses, which have no common rim; the gaps at their joints "
            f"are {JOINT_GAP} in it"
        )
    flat, formed = reference_positions(sheet), sheet_positions(sheet, frame)
    faces = sheet_faces(sheet)
    cells = np.where((faces == np.roll(faces, 1, axis=1)) & (np.arange(4) == 3), -1, faces)
    places = Places(flat, cells, {}, {})
    line = in_order(places.outermost(), flat)
    here = flat[line, :2]
    onward = np.roll(here, -1, axis=0) - here
    length = np.hypot(*onward.T)
    along = onward / length[:, None]
    tangent = along + np.roll(along, 1, axis=0)
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-12)[:, None]
    moved = formed[line, :2] - here
    return {
        "length [m]": np.append(0.0, np.cumsum(length[:-1])),
        "flat x [m]": here[:, 0],
        "flat y [m]": here[:, 1],
        **{f"{axis} [m]": formed[line, k] for k, axis in enumerate("xyz")},
        "draw-in [m]": moved[:, 1] * tangent[:, 0] - moved[:, 0] * tangent[:, 1],
        "along the rim [m]": (moved * tangent).sum(axis=1),
    }


def write_table(path: Path, table: Table) -> None:
    """Write columns as CSV with a row of headings; numbers in SI, in full."""
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(table)
        writer.writerows(zip(*(column.tolist() for column in table.values()), strict=True))
