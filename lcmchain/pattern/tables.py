"""Tables of a formed sheet along lines, and lines in files.

A section has the fields of the sheet, the rim its draw-in. Lines are flat outlines and wanted rims,
as DXF or CSV.
"""

from __future__ import annotations

import csv
import re
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
from lcmchain.mesh.drawing import read_drawing
from lcmchain.mesh.lines import cut_polygons, in_order
from lcmchain.mesh.outline import check_simple, polygon_area
from lcmchain.mesh.places import Places
from lcmchain.quantities.units import QuantityError, length_factor

if TYPE_CHECKING:
    import xarray as xr

#: Fields of a section, by the heading of their column.
SECTION_FIELDS = {
    "thickness [m]": "thickness",
    "shear angle [rad]": "shear_angle",
    "fibre volume fraction [1]": "fibre_volume_fraction",
}
#: Names of files that are meant as tables end so.
TABLES = (".csv", ".txt")
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
    cut = cut_polygons(faces, height)
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
            cut = float(np.linalg.norm(places[second] - places[first]))
            rows.append((strip, row, length + 0.5 * cut))
            length += cut
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


# --- lines in files -------------------------------------------------------------------------------


def read_line(path: Path, length_unit: str | None) -> np.ndarray:
    """Return a closed line (n, 2) [m], anticlockwise, of a DXF drawing or a table of x and y.

    length_unit : of the file; where None that of the drawing or of the heading, as in ``x [mm]``,
        else metres.

    Raises
    ------
    InputError : no such file, no closed line, or one that crosses itself.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    table = _numbers_below_heading(text.decode("utf-8-sig", "replace").splitlines())
    if table is not None:
        unit, values = table
        try:
            line = values * length_factor(length_unit or unit or "m")
        except QuantityError as error:
            raise InputError(str(error), key="heading", file=path) from None
    else:
        # Imported where a line is drawn: the library takes longer than others do.
        try:
            line = read_drawing(
                path, layer=None, slit_layer=None, length_unit=length_unit, sagitta=2e-5, gap=1e-5
            ).rim
        except InputError as error:
            if path.suffix.lower() not in TABLES:
                raise
            raise InputError(
                f"is no table of x and y: two numbers with a decimal point in each of three rows "
                f"or more, under a heading such as x [mm],y [mm]; and {error.message}",
                file=path,
            ) from None
    if len(line) > 1 and np.array_equal(line[0], line[-1]):
        line = line[:-1]
    check_simple(line, "--net")
    return line if polygon_area(line) > 0.0 else line[::-1]


def _numbers_below_heading(lines: list[str]) -> tuple[str, np.ndarray] | None:
    """Return the unit that a heading names, empty without one, and the numbers (n, 2) below it.

    Comma, semicolon or tab separates them. None where there are not two in each row. The heading
    may be left out.
    """
    separator = next((mark for mark in ";\t" if lines and mark in lines[0]), ",")
    rows = [row for row in csv.reader(lines, delimiter=separator) if row]
    if not rows:
        return None
    unit = ""
    try:
        [float(cell) for cell in rows[0][:2]]
    except ValueError:
        found = re.search(r"[\[(]\s*([^\[\]()]+?)\s*[\])]", rows[0][0])
        unit = found[1] if found is not None else ""
        rows = rows[1:]
    try:
        values = [[float(cell) for cell in row[:2]] for row in rows]
    except ValueError:
        return None
    if len(values) < 3 or any(len(value) < 2 for value in values):
        return None
    return unit, np.array(values)


def write_line(path: Path, line: np.ndarray) -> None:
    """Write a closed line (n, 2) [m]: as DXF in mm where the name ends so, else as CSV in m."""
    with replacing(path) as temporary:
        if path.suffix.lower() == ".dxf":
            # Imported where a line is drawn: the library takes longer than others do.
            import ezdxf

            document = ezdxf.new()
            document.units = ezdxf.units.MM
            document.modelspace().add_lwpolyline((1e3 * line).tolist(), close=True)
            document.saveas(temporary)
            return
        with open(temporary, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(("x [m]", "y [m]"))
            writer.writerows(line.tolist())
