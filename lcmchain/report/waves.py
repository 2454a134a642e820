"""How many elements the waves of a sheet have: where it turns back and forth along a row."""

from __future__ import annotations

import numpy as np
import xarray as xr

from lcmchain.fields.sheet import sheet_faces, sheet_positions

#: Turn of the sheet over half a wave that counts as one [rad]. At eight elements of 5 mm it is a
#: wave of 1.1 mm from crest to trough; shallower ones are no wrinkles.
LEAST_TURN = np.radians(10.0)


def elements_per_wave(sheet: xr.Dataset, frame: int = -1) -> np.ndarray | None:
    """Return the elements per wavelength of the shortest wave through each face, inf without one.

    Along every row of elements the sheet turns at the edges between them. Half a wave is a piece
    that turns one way by ``LEAST_TURN``, between two pieces that turn the other way; it reaches
    from inflection to inflection, and a wave has twice its elements.

    Parameters
    ----------
    sheet : root group of a result.
    frame : saved frame, the last one by default.

    Returns
    -------
    Shape (face_count,); None where the faces are triangles, which form no rows.
    """
    faces = sheet_faces(sheet)
    if sheet["sheet_face_nodes"].shape[1] == 3:
        return None
    corners = sheet_positions(sheet, frame)[faces]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    centres = corners.mean(axis=1)
    shortest = np.full(len(faces), np.inf)
    for row in rows_of_faces(faces):
        turns = _turns(normals[row], centres[row])
        for first, last in half_waves(turns):
            inside = row[int(first) + 1 : int(last) + 1]
            shortest[inside] = np.minimum(shortest[inside], 2.0 * (last - first))
    return shortest


def rows_of_faces(faces: np.ndarray) -> list[np.ndarray]:
    """Return the rows of quadrilaterals (face_count, 4) that share opposite edges, both ways."""
    across: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for face, nodes in enumerate(faces.tolist()):
        for side in range(4):
            a, b = nodes[side], nodes[(side + 1) % 4]
            if a != b:
                across.setdefault((min(a, b), max(a, b)), []).append((face, side))
    # (face, side) -> the face beyond that side, and its side there
    beside: dict[tuple[int, int], tuple[int, int]] = {}
    for pair in across.values():
        if len(pair) == 2:
            beside[pair[0]], beside[pair[1]] = pair[1], pair[0]
    rows: list[np.ndarray] = []
    done: set[tuple[int, int]] = set()
    for start in [(face, side) for face in range(len(faces)) for side in (0, 1)]:
        if start in done:
            continue
        first, behind = _follow(beside, (start[0], start[1] + 2))[-1]
        row = _follow(beside, (first, behind + 2))
        done.update((face, side % 2) for face, side in row)
        rows.append(np.array([face for face, _ in row]))
    return rows


def _follow(beside: dict, start: tuple[int, int]) -> list[tuple[int, int]]:
    """Return (face, side left behind) from a face on, away from its side, to the end of the row."""
    face, behind = start[0], start[1] % 4
    found = [(face, behind)]
    while (face, (behind + 2) % 4) in beside:
        face, behind = beside[(face, (behind + 2) % 4)]
        if face == start[0]:
            break  # a closed ring
        found.append((face, behind))
    return found


def _turns(normals: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Return the angles [rad] between neighbours of a row, positive where it turns upwards."""
    cosine = np.clip(np.sum(normals[1:] * normals[:-1], axis=1), -1.0, 1.0)
    along = np.diff(centres, axis=0)
    return np.arccos(cosine) * np.sign(np.sum(along * (normals[:-1] - normals[1:]), axis=1))


def half_waves(turns: np.ndarray) -> list[tuple[float, float]]:
    """Return the places of both inflections of every half wave, in elements from the row's start.

    turns : (n - 1,) [rad], of the edges between the n elements of a row; edge i has the place i.
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
    """Return where the turn passes zero, between the last edge of a piece and the next one's."""
    last, first = int(one[-1]), int(other[0])
    left, right = abs(turns[last]), abs(turns[first])
    return last + (first - last) * left / (left + right)
