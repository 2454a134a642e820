"""The error that a mapping adds: what a mapping on finer meshes, and one there and back, change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from lcmchain.mapping.fields import ERROR, PERMEABILITY, MappedFields, covered_areas
from lcmchain.mapping.sheet import PERMEABILITIES, PERMEABILITY_AXES, PrincipalPermeability, Sheet
from lcmchain.mapping.surfaces.averages import (
    MappedDirections,
    angles_between,
    packed,
    pointing_along,
    principal_permeability,
    squares,
    tensors_of,
    unpacked,
)
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.transfer import transfer
from lcmchain.mapping.weights import COVERED, MappingWeights

#: Computes weights with the options of the mapping that is verified.
Weigh = Callable[[Sheet, TargetMesh], MappingWeights]


@dataclass(frozen=True)
class FieldError:
    """Estimated error of one mapped field, in its units (directions: rad).

    Parameters
    ----------
    worst, worst_cell : the largest error, and the cell that has it.
    root_mean_square : over the cells, weighted by their covered areas.
    there_and_back_worst, there_and_back : largest and root-mean-square change of the field on the
        faces of the sheet when it is mapped back from the target; None for solid targets.
    """

    units: str
    worst: float
    worst_cell: int
    root_mean_square: float
    there_and_back_worst: float | None = None
    there_and_back: float | None = None


@dataclass(frozen=True)
class Verification:
    """Errors of the mapped fields by name: cell by cell, shape (C,), and in numbers."""

    cells: dict[str, np.ndarray]
    fields: dict[str, FieldError]

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """Plain values, ready for JSON."""
        return {name: asdict(found) for name, found in self.fields.items()}


def verify(
    sheet: Sheet,
    target: TargetMesh,
    weights: MappingWeights,
    mapped: MappedFields,
    weigh: Weigh,
) -> Verification:
    """Estimate the error that the mapping adds to every field, in every cell.

    Sheet and target are refined: each face and each cell becomes four in its own facet, and the
    faces' values a quadratic through those around (:mod:`lcmchain.mapping.verify`). The
    same method maps between these, and what its means over the cells differ by from the mapped
    values is the estimate. It sees what the finite size of faces and cells costs; it holds as far
    as the fields are smooth over a few faces, and knows nothing of the error of the fields
    themselves.

    Parameters
    ----------
    weigh : computes weights as those of the mapping were; called on the refined meshes and, for
        the way back, with target and sheet exchanged.
    """
    fine_sheet = refined_sheet(sheet)
    fine_target, parent = refined_target(target)
    fine_weights = weigh(fine_sheet, fine_target)
    fine = transfer(fine_sheet, fine_target, fine_weights)
    share = _shares(fine_weights, parent, target.cell_count)
    found = _differences(mapped, _means(fine, parent, share, target.cell_count))
    # a solid has fields of its own, such as its thickness, which do not come from the sheet
    of_sheet = {*sheet.scalars, *sheet.directions, PERMEABILITY}
    cells = {name: errors for name, errors in found.items() if name in of_sheet}
    area = np.where(weights.mapped, covered_areas(weights), 0.0)
    area = area if area.sum() > 0.0 else weights.mapped.astype(float)
    back = _there_and_back(sheet, target, weights, mapped, weigh)
    return Verification(
        cells, {name: _judged(name, sheet, errors, area, back) for name, errors in cells.items()}
    )


# --- cell by cell ---------------------------------------------------------------------------------


def _shares(weights: MappingWeights, parent: np.ndarray, cell_count: int) -> np.ndarray:
    """Share of each part in the mean over its cell, shape (P,): as much of it as is covered."""
    area = np.where(weights.mapped, covered_areas(weights), 0.0)
    covered = np.bincount(parent, area, minlength=cell_count)
    alone = weights.mapped & (covered[parent] == 0.0)  # beyond the edge of the sheet
    area[alone] = np.where(weights.cell_area[alone] > 0.0, weights.cell_area[alone], 1.0)
    covered = np.bincount(parent, area, minlength=cell_count)
    return area / np.where(covered[parent] > 0.0, covered[parent], np.nan)


def _means(
    fine: MappedFields, parent: np.ndarray, share: np.ndarray, cell_count: int
) -> dict[str, np.ndarray]:
    """Means over the cells of scalars (C,) and of the tensors of all else (C, 3, 3)."""
    return {
        name: _summed(np.where(share.reshape(-1, *[1] * (values.ndim - 1)) > 0.0, values, 0.0),
                      parent, share, cell_count)
        for name, values in _comparable(fine).items()
    }  # fmt: skip


def _summed(
    values: np.ndarray, parent: np.ndarray, share: np.ndarray, cell_count: int
) -> np.ndarray:
    flat = values.reshape(len(values), -1)
    columns = [np.bincount(parent, share * column, minlength=cell_count) for column in flat.T]
    return np.stack(columns, axis=1).reshape(cell_count, *values.shape[1:])


def _comparable(mapped: MappedFields) -> dict[str, np.ndarray]:
    """Scalars (C,), and tensors (C, 3, 3) of directions and of the permeability."""
    found = {
        name: values
        for name, values in mapped.scalars.items()
        if name not in PERMEABILITIES and not name.endswith(ERROR)
    }
    found |= {name: squares(family.direction) for name, family in mapped.directions.items()}
    if mapped.axes and all(name in mapped.scalars for name in PERMEABILITIES):
        values = np.stack([mapped.scalars[name] for name in PERMEABILITIES], axis=1)
        axes = np.stack([mapped.axes[name] for name in PERMEABILITY_AXES], axis=1)
        found[PERMEABILITY] = tensors_of(values, axes)
    return found


def _differences(one: MappedFields, means: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Size of the differences, shape (C,): of scalars, angles of directions, norms of tensors."""
    cells = {}
    for name, values in _comparable(one).items():
        if name not in means:
            continue
        known = np.isfinite(means[name]).reshape(len(values), -1).all(axis=1)
        known &= np.isfinite(values).reshape(len(values), -1).all(axis=1)
        cells[name] = np.full(len(values), np.nan)
        if name in one.directions:
            axes = np.linalg.eigh(means[name][known])[1][:, :, 2]
            cells[name][known] = angles_between(one.directions[name].direction[known], axes)
        elif values.ndim == 3:
            difference = values[known] - means[name][known]
            cells[name][known] = np.abs(np.linalg.eigvalsh(difference)).max(axis=1, initial=0.0)
        else:
            cells[name][known] = np.abs(values[known] - means[name][known])
    return cells


def _judged(
    name: str, sheet: Sheet, errors: np.ndarray, area: np.ndarray, back: dict[str, np.ndarray]
) -> FieldError:
    known = np.isfinite(errors) & (area > 0.0)
    size = np.where(known, errors, 0.0)
    total = area[known].sum()
    changed = back.get(name, np.zeros(0))
    changed = changed[np.isfinite(changed)]
    if name in sheet.directions:
        units = "rad"
    elif name == PERMEABILITY:
        units = "m2"
    else:
        units = str(sheet.attributes.get(name, {}).get("units", "1"))
    return FieldError(
        units=units,
        worst=float(size.max(initial=0.0)),
        worst_cell=int(np.argmax(size)),
        root_mean_square=float(np.sqrt(area @ size**2 / total)) if total > 0.0 else 0.0,
        there_and_back_worst=float(changed.max()) if len(changed) else None,
        there_and_back=float(np.sqrt(np.mean(changed**2))) if len(changed) else None,
    )


# --- there and back -------------------------------------------------------------------------------


def _there_and_back(
    sheet: Sheet, target: TargetMesh, weights: MappingWeights, mapped: MappedFields, weigh: Weigh
) -> dict[str, np.ndarray]:
    """Changes on the faces that lie wholly over the target, not a number on others, shape (F,).

    None of a stack: its cells hold the sums over the plies, its faces the values of one.
    """
    there = weights.mapped
    if target.is_solid or sheet.is_stack or not there.any():
        return {}
    permeability = None
    if mapped.axes and np.isfinite(mapped.scalars[PERMEABILITIES[0]][there]).all():
        permeability = PrincipalPermeability(
            np.stack([mapped.scalars[name][there] for name in PERMEABILITIES], axis=1),
            np.stack([mapped.axes[name][there] for name in PERMEABILITY_AXES], axis=1),
        )
    source = Sheet(
        Surface(target.points, target.surface.faces[there]),
        {n: values[there] for n, values in mapped.scalars.items() if n not in PERMEABILITIES},
        {name: family.direction[there] for name, family in mapped.directions.items()},
        permeability=permeability,
    )
    home, face = as_target(sheet.surface)
    back = weigh(source, home)
    returned = transfer(source, home, back)
    given = _given(sheet, face)
    found = _differences(returned, _comparable(given))
    whole = back.mapped & (back.coverage >= COVERED)
    return {name: np.where(whole, changed, np.nan) for name, changed in found.items()}


def _given(sheet: Sheet, face: np.ndarray) -> MappedFields:
    """Fields of the sheet in the form of mapped ones, in the order of the faces given."""
    scalars = {name: values[face] for name, values in sheet.scalars.items()}
    axes = {}
    if sheet.permeability is not None:
        for row, name in enumerate(PERMEABILITIES):
            scalars[name] = sheet.permeability.values[face, row]
        for row, name in enumerate(PERMEABILITY_AXES):
            axes[name] = sheet.permeability.axes[face, row]
    directions = {
        name: MappedDirections(vectors[face], np.ones(len(face)), np.zeros(len(face)))
        for name, vectors in sheet.directions.items()
    }
    return MappedFields(scalars, directions, axes)


# --- twice finer meshes: every triangle and quadrilateral becomes four ----------------------------


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
    ply = None if sheet.ply is None else sheet.ply[parent]
    if not columns:
        return replace(sheet, surface=surface, ply=ply)
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
        sheet, surface=surface, scalars=scalars, directions=directions, permeability=permeability,
        ply=ply,
    )  # fmt: skip


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


# --- means over the parts of faces, from quadratics through those of the faces around -------------

# A quadratic has five coefficients beside the mean: with fewer faces around, those around these
# are taken too, as at the edge of the sheet.
ENOUGH = 7

# Relative size of what keeps the least squares regular where the faces around lie in one row.
_REGULAR = 1e-10


def means_of_parts(
    surface: Surface, parts: Surface, parent: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """Means over the parts of faces, shape (P, K), of K fields with means (F, K) over the faces.

    In every face a quadratic with the face's own mean is fitted to the means of the faces around,
    by least squares weighted with the inverse square of the distance; distances along the sheet
    are those between centroids. The error is of third order in the size of the faces where the
    field is smooth. Means of the parts have the mean of their face.

    Parameters
    ----------
    parts : the refined surface. parent : face of each part, shape (P,).

    Source: Barth and Frederickson, AIAA paper 90-0013 (1990), k-exact reconstruction.
    """
    moment = _moments(surface)
    coefficients = _fitted(surface, moment, values)
    offset = parts.centroids - surface.centroids[parent]
    rows, _ = _rows(offset, _moments(parts) - moment[parent], surface.frames[parent])
    found = values[parent] + np.einsum("pk,pkn->pn", rows, coefficients[parent])
    # the mean changes a little by rounding and warped faces: all parts give it back alike
    area = np.bincount(parent, weights=parts.areas, minlength=surface.face_count)
    share = (parts.areas / area[parent])[:, None]
    mean = np.zeros_like(values)
    np.add.at(mean, parent, share * found)
    return found - (mean - values)[parent]


def _fitted(surface: Surface, moment: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Coefficients of the quadratics, shape (F, 5, K)."""
    face, other = _faces_around(surface)
    offset = surface.centroids[other] - surface.centroids[face]
    rows, distance = _rows(offset, moment[other] - moment[face], surface.frames[face])
    length = surface.edge_length
    scales = length ** np.array([1, 1, 2, 2, 2])
    rows /= scales
    weight = (length / distance) ** 2
    pair = np.arange(len(face))
    shape = (surface.face_count, len(face))
    of_face = csr_array((np.ones(len(face)), (face, pair)), shape=shape)
    squares = np.einsum("pi,pj,p->pij", rows, rows, weight)
    matrix = (of_face @ squares.reshape(-1, 25)).reshape(-1, 5, 5)
    trace = np.trace(matrix, axis1=1, axis2=2)
    # A face without others around keeps its mean everywhere.
    matrix += np.where(trace > 0.0, _REGULAR * trace, 1.0)[:, None, None] * np.eye(5)
    products = np.einsum("pi,pn,p->pin", rows, values[other] - values[face], weight)
    right = (of_face @ products.reshape(len(face), 5 * values.shape[1])).reshape(
        -1, 5, values.shape[1]
    )
    return np.linalg.solve(matrix, right) / scales[:, None]


def _rows(
    offset: np.ndarray, moment: np.ndarray, frame: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Means of x, y, x²/2, x y and y²/2 over faces, less those over the face at 0; distances.

    Parameters
    ----------
    offset : from the centroid of the face at 0 [m], shape (K, 3); its length is along the sheet.
    moment : less that of the face at 0 [m2], shape (K, 3, 3). frame : its tangents, (K, 2, 3).
    """
    flat = np.einsum("kai,ki->ka", frame, offset)
    distance, seen = np.linalg.norm(offset, axis=1), np.linalg.norm(flat, axis=1)
    x, y = (flat * (distance / np.where(seen > 0.0, seen, 1.0))[:, None]).T
    more = np.einsum("kai,kij,kbj->kab", frame, moment, frame)
    columns = [x, y, 0.5 * (x * x + more[:, 0, 0]), x * y + more[:, 0, 1],
               0.5 * (y * y + more[:, 1, 1])]  # fmt: skip
    return np.stack(columns, axis=1), distance


def _faces_around(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of a face and another that shares a node with it (or with one that does), by face."""
    there = surface.faces >= 0
    face = np.repeat(np.arange(surface.face_count), there.sum(axis=1))
    place = surface.places[surface.faces[there]]  # nodes may be repeated face by face
    shape = (surface.face_count, len(surface.points))
    touches = csr_array((np.ones(len(face)), (face, place)), shape=shape)
    near = csr_array(touches @ touches.T)
    counts = np.diff(near.indptr) - 1
    few = counts < ENOUGH
    if few.any():
        wider = csr_array((near[few] @ near).tocoo())
        row = np.flatnonzero(few)[np.repeat(np.arange(few.sum()), np.diff(wider.indptr))]
        plain = near.tocoo()
        keep = ~few[plain.row]
        face = np.concatenate([plain.row[keep], row])
        other = np.concatenate([plain.col[keep], wider.indices])
    else:
        plain = near.tocoo()
        face, other = plain.row, plain.col
    apart = face != other
    face, other = face[apart], other[apart]
    order = np.lexsort((other, face))
    return face[order].astype(np.int64), other[order].astype(np.int64)


def _moments(surface: Surface) -> np.ndarray:
    """Mean of d d over each face [m2], d from its centroid, shape (F, 3, 3)."""
    corners, face = surface.triangle_corners, surface.triangle_face
    middle = corners.mean(axis=1)
    offset = corners - middle[:, None]
    area = np.linalg.norm(surface.triangle_area_vectors, axis=1)
    share = area / np.bincount(face, area, minlength=surface.face_count)[face]
    apart = middle - surface.centroids[face]
    squares = np.einsum("tci,tcj->tij", offset, offset) / 12.0
    squares += np.einsum("ti,tj->tij", apart, apart)
    return np.add.reduceat(share[:, None, None] * squares, surface.first_triangle[:-1], axis=0)
