"""How many elements the waves of a sheet have: where it turns back and forth along a fibre."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.sheet import (
    face_centres,
    mesh_axes,
    reference_positions,
    sheet_areas,
    sheet_faces,
    sheet_positions,
)
from lcmchain.fields.wrinkles import node_normals
from lcmchain.mesh.lines import FibreLines, lines_along
from lcmchain.mesh.sheet_mesh import NO_NODE
from lcmchain.quantities.places import millimetres
from lcmchain.thresholds import LEAST_ELEMENTS_PER_WAVE

if TYPE_CHECKING:
    import xarray as xr

#: Turn of the sheet over half a wave that counts as one [rad]. At eight elements of 5 mm it is a
#: wave of 1.1 mm from crest to trough; shallower ones are no wrinkles.
LEAST_TURN = np.radians(10.0)


def elements_per_wave(sheet: xr.Dataset, frame: int = -1) -> np.ndarray:
    """Return the elements per wavelength of the shortest wave along each face, inf without one.

    Along every line of edges that follows a fibre the sheet turns at the nodes. Half a wave is a
    piece that turns one way by ``LEAST_TURN``, between two pieces that turn the other way; it
    reaches from inflection to inflection, and a wave has twice its elements.

    Parameters
    ----------
    sheet : root group of a result.
    frame : saved frame, the last one by default.

    Returns
    -------
    Shape (face_count,).
    """
    faces = sheet_faces(sheet)
    lines = lines_along(reference_positions(sheet), faces, mesh_axes(sheet))
    return elements_in_waves(sheet_positions(sheet, frame), faces, lines)


def elements_in_waves(points: np.ndarray, faces: np.ndarray, lines: FibreLines) -> np.ndarray:
    """Return what :func:`elements_per_wave` does, of a surface (n, 3) with faces (F, 4).

    lines : along the fibres of the undeformed surface.
    """
    normals = node_normals(points, faces)
    shortest = np.full(len(faces), np.inf)
    for before, after in zip(lines.before, lines.after, strict=True):
        of_edge = np.full(len(points), np.inf)  # from a node on
        for line in _lines(before, after):
            for first, last in half_waves(_turns(points[line], normals[line])):
                inside = line[int(first) + 1 : int(last) + 1]
                of_edge[inside] = np.minimum(of_edge[inside], 2.0 * (last - first))
        for side in range(4):
            start, end = faces[:, side], faces[:, (side + 1) % 4]
            for one, other in ((start, end), (end, start)):
                found = np.where(after[one] == other, of_edge[one], np.inf)
                shortest = np.minimum(shortest, found)
    return shortest


def area_in_waves_below(sheet: xr.Dataset, found: np.ndarray, count: float) -> float:
    """Return the part of the undeformed area in waves of fewer elements than ``count``.

    found : from :func:`elements_per_wave`.
    """
    areas = sheet_areas(sheet, 0)
    return float(areas[found < count].sum() / areas.sum())


def wave_warnings(sheet: xr.Dataset, frame: int = -1) -> list[str]:
    """Say where waves of a frame have too few elements."""
    found = elements_per_wave(sheet, frame)
    part = area_in_waves_below(sheet, found, LEAST_ELEMENTS_PER_WAVE)
    if part == 0.0:
        return []
    place = millimetres(face_centres(sheet, formed=True)[int(np.argmin(found))], 1)
    return [
        f"waves are unresolved: down to {found.min():.1f} elements per wavelength, at {place}, and "
        f"fewer than {LEAST_ELEMENTS_PER_WAVE} in {part:.2%} of the area, so that their height and "
        "length are those of the mesh; use a smaller blank.edge_length"
    ]


def _lines(before: np.ndarray, after: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the nodes of every line, from its first to its last."""
    for first in np.flatnonzero((before == NO_NODE) & (after != NO_NODE)):
        line = [first]
        while after[line[-1]] != NO_NODE:
            line.append(after[line[-1]])
        yield np.array(line)


def _turns(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the angles [rad] at the inner nodes of a line, positive where it turns upwards.

    Of the turn of a fibre only that out of the plane of the sheet counts, not what shear makes of
    its way in the plane.
    """
    edges = np.diff(points, axis=0)
    edges /= np.maximum(np.linalg.norm(edges, axis=1), 1e-300)[:, None]
    inner = normals[1:-1]
    ahead, behind = (np.einsum("ni,ni->n", part, inner) for part in (edges[1:], edges[:-1]))
    return np.arcsin(np.clip(ahead, -1.0, 1.0)) - np.arcsin(np.clip(behind, -1.0, 1.0))


def half_waves(turns: np.ndarray) -> list[tuple[float, float]]:
    """Return the places of both inflections of every half wave, in edges from the line's start.

    turns : (n - 1,) [rad], at the inner nodes of a line of n edges; the first one has the place 0.
    """
    ends = np.flatnonzero(np.diff(np.sign(turns)) != 0)
    pieces = np.split(np.arange(len(turns)), ends + 1)
    notable = [p for p in pieces if len(p) and abs(turns[p].sum()) >= LEAST_TURN]
    found = []
    for before, piece, after in zip(notable, notable[1:], notable[2:]):
        sign = np.sign(turns[piece[0]])
        if sign != np.sign(turns[before[0]]) and sign != np.sign(turns[after[0]]):
            found.append((_inflection(turns, before, piece), _inflection(turns, piece, after)))
    return found


def _inflection(turns: np.ndarray, one: np.ndarray, other: np.ndarray) -> float:
    """Return where the turn passes zero, between the last node of a piece and the next one's."""
    last, first = int(one[-1]), int(other[0])
    left, right = abs(turns[last]), abs(turns[first])
    return last + (first - last) * left / (left + right)
