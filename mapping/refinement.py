"""Uniform refinement of sheets and targets: every triangle and quadrilateral becomes four."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lcmchain.mapping.reconstruction import means_of_parts
from lcmchain.mapping.sheet import Sheet
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.tensors import (
    packed,
    pointing_along,
    principal_permeability,
    squares,
    tensors_of,
    unpacked,
)


def refined_surface(surface: Surface) -> tuple[Surface, np.ndarray]:
    """Return the surface with every face cut into four, and the face of each part, shape (4 F,).

    The parts lie in the facet of their face: nothing but its size changes. Parts 4 f to 4 f + 3
    are those of face f.
    """
    points, faces = _refined(surface.points, surface.faces, surface.is_quadrilateral)
    return Surface(points, faces), np.repeat(np.arange(surface.face_count), 4)


def refined_sheet(sheet: Sheet) -> Sheet:
    """Return the sheet with every face cut into four, and smooth fields between its faces.

    Directions and permeabilities are continued as tensors, which have no sense and no order.
    """
    surface, parent = refined_surface(sheet.surface)
    names = list(sheet.scalars)
    families = list(sheet.directions)
    columns = [sheet.scalars[name][:, None] for name in names]
    columns += [packed(squares(sheet.directions[family])) for family in families]
    permeability = sheet.permeability
    if permeability is not None and not np.isfinite(permeability.values).all():
        permeability = None
    if permeability is not None:
        columns.append(packed(tensors_of(permeability.values, permeability.axes)))
    if not columns:
        return replace(sheet, surface=surface)
    found = means_of_parts(sheet.surface, surface, parent, np.concatenate(columns, axis=1))
    scalars = {name: found[:, column].copy() for column, name in enumerate(names)}
    directions = {}
    for number, family in enumerate(families):
        first = len(names) + 6 * number
        axis = np.linalg.eigh(unpacked(found[:, first : first + 6]))[1][:, :, 2]
        directions[family] = pointing_along(axis, sheet.directions[family][parent])
    if permeability is not None:
        permeability = principal_permeability(unpacked(found[:, -6:]), surface.normals)
    return replace(
        sheet, surface=surface, scalars=scalars, directions=directions, permeability=permeability
    )


def refined_target(target: TargetMesh) -> tuple[TargetMesh, np.ndarray]:
    """Return a shell target with every cell cut into four, and the cell of each part, (4 C,).

    Solids stay as they are: their cells are their own parts.
    """
    if target.is_solid:
        return target, np.arange(target.cell_count)
    surface, parent = refined_surface(target.surface)
    refined, part = as_target(surface)
    return refined, parent[part]


def as_target(surface: Surface) -> tuple[TargetMesh, np.ndarray]:
    """Return a surface as a shell target, and the face that each of its cells is, shape (F,)."""
    quadrilateral = surface.is_quadrilateral
    blocks, order = [], []
    for name, count, chosen in (("quad", 4, quadrilateral), ("triangle", 3, ~quadrilateral)):
        numbers = np.flatnonzero(chosen)
        if len(numbers):
            blocks.append((name, surface.faces[numbers, :count]))
            order.append(numbers)
    return TargetMesh(surface.points, tuple(blocks), {}), np.concatenate(order)


def _refined(
    points: np.ndarray, faces: np.ndarray, is_quadrilateral: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points and faces (4 F, 4) with a new node amid every edge and every quadrilateral."""
    closed = np.where(is_quadrilateral[:, None], faces, faces[:, [0, 1, 2, 2]])
    ends = np.stack([closed, np.roll(closed, -1, axis=1)], axis=2)
    # The last edge of a triangle runs from its third node to the first, as that of its copy does.
    ends[~is_quadrilateral, 2] = ends[~is_quadrilateral, 3]
    edges, edge = np.unique(np.sort(ends, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    middle = len(points) + edge.reshape(-1, 4)
    centre = len(points) + len(edges) + np.cumsum(is_quadrilateral) - 1
    all_points = np.concatenate(
        [points, points[edges].mean(axis=1), points[faces[is_quadrilateral]].mean(axis=1)]
    )
    a, b, c, d = closed.T
    ab, bc, cd, da = middle.T
    none = np.full(len(faces), -1)
    quads = [(a, ab, centre, da), (ab, b, bc, centre), (centre, bc, c, cd), (da, centre, cd, d)]
    triangles = [(a, ab, da, none), (ab, b, bc, none), (da, bc, c, none), (ab, bc, da, none)]
    parts = [
        np.where(is_quadrilateral[:, None], np.stack(quad, axis=1), np.stack(triangle, axis=1))
        for quad, triangle in zip(quads, triangles, strict=True)
    ]
    return all_points, np.stack(parts, axis=1).reshape(-1, 4)
