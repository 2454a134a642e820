"""Weights from a sheet to solid cells: which part of each face's column every cell holds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.sheet import Sheet
from lcmchain.mapping.solids.columns import Columns, columns_of, merged_places
from lcmchain.mapping.solids.overlap import Overlaps, overlaps, own_walls, sliced
from lcmchain.mapping.solids.skin import covered_faces, skin_of
from lcmchain.mapping.solids.stack import one_ply, stack_of
from lcmchain.mapping.solids.tetrahedra import Solids, solids_of_cells
from lcmchain.mapping.surfaces.search import closest_points
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.weights import (
    COVERED,
    MappingWeights,
    Status,
    default_maximum_distance,
    half_thickness,
    mesh_key,
)

#: Solids are looked for this many thicknesses of all plies on either side of the sheet: far enough
#: to see that a mesh is ten times too thick.
THICKEST = 5.0


class _Parts(NamedTuple):
    """Overlaps of the columns of the sheet with the target, by cell, then face.

    volume, centroid : of each overlap [m3], shape (K,), and [m], shape (K, 3).
    height : of its centroid over the face [m], shape (K,).
    content : share of the face's content that it holds, shape (K,).
    solid_thickness : of the target, of all plies, in the column of the face [m], shape (K,).
    """

    cell: np.ndarray
    face: np.ndarray
    volume: np.ndarray
    centroid: np.ndarray
    height: np.ndarray
    content: np.ndarray
    solid_thickness: np.ndarray


def compute_solid_weights(
    sheet: Sheet, target: TargetMesh, *, order: int = 2, maximum_distance: float | None = None
) -> MappingWeights:
    """Compute the weights that carry face fields of a sheet to the solid cells of a target.

    Every face of the sheet is extruded to a column along the normals of its nodes, so that the
    columns fill the space around the sheet without gaps. A face's content goes to the cells in
    its column in proportion to their volume there, and nowhere else: the shares of a covered face
    sum to one without being scaled. Plies that lie over each other share the target's thickness
    in proportion to their own.

    Parameters
    ----------
    order : 1 takes a field as constant within each face, 2 as linear.
    maximum_distance : how far [m] from the sheet a cell may lie; by default the largest of one
        edge length of the sheet, the radius of a typical cell, and five times the thickness of
        all plies.

    Raises
    ------
    InputError : a distance that is not positive.
    """
    maximum_distance = _solid_distance(sheet, target, maximum_distance)
    cells = solids_of_cells(target.points, target.corners)
    skin = skin_of(cells, merged_places(target.points, target.corners))
    columns = columns_of(sheet.surface, maximum_distance, sheet.plies)
    overlap = overlaps(cells, columns)
    walls = own_walls(overlap, columns, sheet.plies, target.cell_count)
    overlap = overlap.only(walls.kept)
    by_ply = _coverage(overlap, sheet.plies, cells)
    coverage = by_ply.max(axis=0)
    held = np.bincount(overlap.face, weights=overlap.volume, minlength=sheet.surface.face_count)
    covered = covered_faces(skin, columns, held)
    face_thickness = sheet.scalars.get("thickness", np.ones(sheet.surface.face_count))
    if len(np.unique(sheet.plies)) > 1:
        stack = stack_of(cells, columns, skin, overlap, sheet.plies, face_thickness)
        overlap = sliced(cells, columns, overlap, stack.slices)
    else:
        stack = one_ply(overlap, face_thickness, target.cell_count)
    parts = _parts(overlap, columns, covered.share, stack.part)

    volume = np.bincount(parts.cell, weights=parts.volume, minlength=target.cell_count)
    beside = _beside(sheet.surface, target, volume, maximum_distance)
    cell = np.concatenate([parts.cell, beside.cell])
    face = np.concatenate([parts.face, beside.face])
    average = np.concatenate([parts.volume / volume[parts.cell], np.ones(len(beside.cell))])
    content = np.concatenate([parts.content, np.zeros(len(beside.cell))])
    places = _places(sheet.surface, columns, parts, covered.share)
    place = np.concatenate([places, beside.place])
    rows = np.lexsort((face, cell))

    distance = _distance(parts, target.cell_count)
    distance[beside.cell] = beside.distance
    formed = stack.thickness.copy()
    formed[beside.cell] = face_thickness[beside.face]
    solid = _solid_thickness(parts, formed, target.cell_count)
    within = distance <= _mean(half_thickness(sheet)[parts.face], parts, target.cell_count)
    status = _status(volume > 0.0, beside.cell, coverage >= COVERED, within)
    status[walls.undecided] = Status.AMBIGUOUS
    taken = np.bincount(parts.face, minlength=sheet.surface.face_count) > 0
    return MappingWeights(
        cell=cell[rows],
        face=face[rows],
        average=average[rows],
        content=content[rows],
        place=place[rows],
        status=status,
        coverage=coverage,
        distance=distance,
        cell_area=cells.volumes / solid,
        face_coverage=np.where(taken, covered.share, 0.0),
        missed=np.zeros(sheet.surface.face_count, dtype=bool),
        wedge_correction=0.0,
        moved=0.0,
        method="overlap",
        order=order,
        maximum_distance=float(maximum_distance),
        conservative=True,
        source_key=mesh_key(sheet.surface.points, sheet.surface.faces),
        target_key=mesh_key(target.points, target.corners),
        solid_thickness=solid,
        formed_thickness=formed,
        ply_coverage=by_ply if sheet.is_stack else np.zeros((0, 0)),
    )


def _status(
    reached: np.ndarray, beside: np.ndarray, covered: np.ndarray, within: np.ndarray
) -> np.ndarray:
    """Return the status of cells (C,), from those far away to those within the sheet.

    reached, covered : whether any of the sheet is in a cell, or all of the cell is, shape (C,).
    beside : numbers of cells without an overlap that lie near enough.
    within : whether a cell lies in the sheet as thick as it is, shape (C,).
    """
    status = np.full(len(reached), Status.UNMAPPED, dtype=np.int8)
    status[beside] = Status.EXTRAPOLATED
    status[reached] = Status.EXTRAPOLATED
    status[covered] = Status.PROJECTED
    status[covered & within] = Status.INSIDE
    return status


class _Beside(NamedTuple):
    """Cells without an overlap, and the closest place of the sheet.

    cell, face : numbers, shape (K,). place : on the face, in its frame [m], shape (K, 2).
    distance : [m], shape (K,).
    """

    cell: np.ndarray
    face: np.ndarray
    place: np.ndarray
    distance: np.ndarray


def _beside(
    surface: Surface, target: TargetMesh, volume: np.ndarray, maximum_distance: float
) -> _Beside:
    """Return the cells without an overlap that lie within a distance [m] of the sheet.

    volume : that each cell has in common with the sheet [m3], shape (C,).
    """
    alone = np.flatnonzero(volume == 0.0)
    closest = closest_points(surface, target.centroids[alone], maximum_distance)
    near = closest.face >= 0
    face = closest.face[near]
    place = surface.in_frames(face, closest.foot[near])
    return _Beside(alone[near], face, place, closest.distance[near])


def _solid_distance(sheet: Sheet, target: TargetMesh, given: float | None) -> float:
    """Distance [m] up to which a solid cell and the sheet count as the same part."""
    if given is not None:
        if not (np.isfinite(given) and given > 0.0):
            raise InputError(f"maximum_distance has to be positive, not {given} m")
        return given
    distance = default_maximum_distance(sheet, target)
    if "thickness" not in sheet.scalars:
        return distance
    thickness = sheet.scalars["thickness"]
    stack = sum(
        np.nanmax(thickness[sheet.plies == ply], initial=0.0) for ply in np.unique(sheet.plies)
    )
    return max(distance, THICKEST * float(stack))


def _coverage(overlap: Overlaps, ply: np.ndarray, cells: Solids) -> np.ndarray:
    """Share of each cell's volume that lies over every ply, shape (P, C)."""
    ply_count, cell_count = int(ply.max()) + 1, len(cells.volumes)
    key = ply[overlap.face] * cell_count + overlap.cell
    held = np.bincount(key, weights=overlap.volume, minlength=ply_count * cell_count)
    return held.reshape(ply_count, cell_count) / cells.volumes


def _parts(
    overlap: Overlaps, columns: Columns, covered: np.ndarray, part_of_stack: np.ndarray
) -> _Parts:
    """Shares of the faces' contents, and the thickness that the target has along each face."""
    face_count = len(columns.faces)
    some = overlap.volume > 0.0
    overlap, part_of_stack = overlap.only(some), part_of_stack[some]
    height = np.einsum(
        "ki,ki->k",
        overlap.centroid - columns.centroids[overlap.face],
        columns.face_normals[overlap.face],
    )
    volume = np.bincount(overlap.face, weights=overlap.volume, minlength=face_count)
    moment = np.bincount(overlap.face, weights=overlap.volume * height, minlength=face_count)
    held = volume > 0.0
    mean_height = np.where(held, moment / np.where(held, volume, 1.0), 0.0)
    # The area of a column changes along its normal where the sheet is curved.
    area = columns.areas(mean_height) * np.maximum(covered, np.finfo(float).tiny)
    content = covered[overlap.face] * overlap.volume / volume[overlap.face]
    thickness = (volume / area)[overlap.face] / part_of_stack
    return _Parts(*overlap, height, content, thickness)


def _places(surface: Surface, columns: Columns, parts: _Parts, covered: np.ndarray) -> np.ndarray:
    """Places of the overlaps on their faces, along the columns, in the faces' frames [m], (K, 2).

    The parts of a wholly covered face together have its centroid.
    """
    face = parts.face
    # The directors of a face's corners as a linear function of the place on it.
    corners = surface.in_frames(
        np.arange(len(columns.faces))[:, None], columns.points[columns.faces]
    )
    lean = np.einsum("fui,fki->fku", surface.frames, columns.directors)
    used = np.ones(columns.faces.shape)
    used[:, 3] = columns.is_quadrilateral
    basis = np.concatenate([np.ones((*corners.shape[:2], 1)), corners], axis=2) * used[..., None]
    fit = np.linalg.pinv(basis) @ lean
    place = surface.in_frames(face, parts.centroid)
    for _ in range(2):
        at = np.concatenate([np.ones((len(face), 1)), place], axis=1)
        slope = np.einsum("km,kmu->ku", at, fit[face])
        place = surface.in_frames(face, parts.centroid) - parts.height[:, None] * slope
    return place - _offset(face, place, parts.content, covered)


def _offset(
    face: np.ndarray, place: np.ndarray, content: np.ndarray, covered: np.ndarray
) -> np.ndarray:
    """Mean place of the parts of wholly covered faces [m], zero of others, for each part (K, 2)."""
    count = len(covered)
    moment = [np.bincount(face, content * place[:, axis], count) for axis in (0, 1)]
    whole = covered == 1.0
    return np.where(whole, np.stack(moment), 0.0).T[face]


def _mean(values: np.ndarray, parts: _Parts, cell_count: int) -> np.ndarray:
    """Mean of values of the overlaps over the covered part of each cell, 0 without, shape (C,)."""
    volume = np.bincount(parts.cell, weights=parts.volume, minlength=cell_count)
    summed = np.bincount(parts.cell, weights=parts.volume * values, minlength=cell_count)
    return summed / np.where(volume > 0.0, volume, 1.0)


def _distance(parts: _Parts, cell_count: int) -> np.ndarray:
    """Distance of the covered part's centroid from the mid-surface [m], nan without, (C,)."""
    mean = _mean(parts.height, parts, cell_count)
    without = np.bincount(parts.cell, minlength=cell_count) == 0
    return np.where(without, np.nan, np.abs(mean))


def _solid_thickness(parts: _Parts, formed: np.ndarray, cell_count: int) -> np.ndarray:
    """Thickness that the target has at each cell [m], shape (C,).

    It is volume by area of the columns, so that area and volume of the target both remain the
    sums over its cells. A cell without an overlap takes the formed thickness.
    """
    volume = np.bincount(parts.cell, weights=parts.volume, minlength=cell_count)
    area = np.bincount(
        parts.cell, weights=parts.volume / parts.solid_thickness, minlength=cell_count
    )
    return np.where(volume > 0.0, volume / np.where(area > 0.0, area, 1.0), formed)
