"""Values on the parts of faces, from quadratics through the means of the faces around."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from lcmchain.mapping.surface import Surface

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
    # What rounding and warped faces leave of the mean is taken from all parts alike.
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
