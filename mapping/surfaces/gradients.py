"""Gradients of face fields within the sheet: fitted to the faces around, limited where they jump.

A field is known by its means over the faces. Second order takes it as linear within each face,

    f(x) = f_i + g_i · (x - x_i),

with the gradient g_i by weighted least squares over the faces that share a corner with face i. The
sheet is unrolled for that: the way to a neighbour has the direction that its centroid has on the
plane of the face, and the length of the straight line to it.

Where the field is not resolved by the mesh, such a line runs beyond the values around. There it is
limited so that no corner of the face exceeds them (Barth and Jespersen, AIAA 89-0366). A field is
taken as resolved where the mean of the gradients of two faces explains the difference between them,
as it does for every quadratic field; it is not limited there, so that linear fields stay exact up
to the edge of the sheet, and maxima are not cut off.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import equation, routine

# Neighbours beyond a bend of 60 degrees say nothing of the gradient within a face.
LEAST_COSINE = 0.5

# Directions in which neighbours spread less than this share of the widest say nothing.
LEAST_SPREAD = 1e-3

# Unexplained share of the squared differences below which a field counts as resolved, and above
# which it does not at all.
RESOLVED = 0.01
UNRESOLVED = 0.04

# The same for tensors, which are compared with the linear fit alone: their gradient fades out from
# this share to twice it.
RESOLVED_TENSOR = 0.1


class GradientStencil(NamedTuple):
    """Faces around each face and what they add to its gradient.

    start : first neighbour of each face, shape (F + 1,).
    face : neighbours, shape (N,).
    way : to the neighbour in the face's frame [m], shape (N, 2).
    back : from the neighbour to the face in the neighbour's frame [m], shape (N, 2).
    share : of the neighbour's difference in the gradient [1/m], shape (N, 2).
    corners : of the faces in their frames, from the centroid [m], shape (F, 4, 2).
    """

    start: np.ndarray
    face: np.ndarray
    way: np.ndarray
    back: np.ndarray
    share: np.ndarray
    corners: np.ndarray


def gradient_stencil(
    places: np.ndarray,
    corners: np.ndarray,
    centroids: np.ndarray,
    frames: np.ndarray,
    normals: np.ndarray,
) -> GradientStencil:
    """Find the neighbours of every face and fit the gradient to them.

    Parameters
    ----------
    places : numbers of the places of the corners, shape (F, 4); a triangle repeats one.
    corners : their positions [m], shape (F, 4, 3).
    normals : unit normals, wound alike within a connected piece, shape (F, 3).
    """
    start, other = _neighbours(places, normals)
    way, share = np.empty((len(other), 2)), np.empty((len(other), 2))
    _unroll(start, other, centroids, frames, way)
    _fit(start, way, share)
    back = np.empty_like(way)
    _ways_back(start, other, way, back)
    return GradientStencil(start, other, way, back, share, _in_frames(corners, centroids, frames))


def limited_gradients(stencil: GradientStencil, values: np.ndarray) -> np.ndarray:
    """Return the gradients of a face field (F,) in the faces' frames, shape (F, 2).

    A field that is nowhere negative stays so within every face.
    """
    values = np.ascontiguousarray(values, dtype=float)
    fitted, gradients = np.empty((len(values), 2)), np.empty((len(values), 2))
    never_negative = len(values) > 0 and bool(values.min() >= 0.0)
    _fit_gradients(stencil, values, fitted)
    _limit_gradients(stencil, values, fitted, never_negative, gradients)
    return gradients


def limited_tensor_gradients(
    stencil: GradientStencil,
    components: np.ndarray,
    around: np.ndarray,
    multiplicity: tuple[float, ...],
) -> np.ndarray:
    """Return the gradients of a tensor field in the faces' frames, shape (F, M, 2).

    One limit holds for all components, by invariants of the tensor, so that it does not depend on
    the axes: where the linear fit leaves too much unexplained, the tensor counts as constant.
    A tensor of two dimensions stays positive within the face if it is so in its mean.

    Parameters
    ----------
    components : of the symmetric tensor of each face, shape (F, M); two-dimensional ones as
        11, 22, 12.
    around : those of the neighbours as each face sees them, shape (N, M).
    multiplicity : how often a component stands in the tensor.
    """
    gradients = np.empty((*components.shape, 2))
    _tensor_gradients(
        stencil,
        np.ascontiguousarray(components),
        np.ascontiguousarray(around),
        np.array(multiplicity),
        gradients,
    )
    return gradients


# --- the faces around each face, and the fit to them ----------------------------------------------


def _neighbours(places: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Faces that share a corner with each face, ascending: (start (F + 1,), faces)."""
    order = np.argsort(places.ravel(), kind="stable") // 4  # faces by place
    at_place = np.concatenate([[0], np.cumsum(np.bincount(places.ravel()))])
    return _gather(places, at_place, order, normals)


@routine
def _gather(places, at_place, by_place, normals):
    count = len(places)
    start = np.zeros(count + 1, dtype=np.int64)
    faces = np.empty(16 * count, dtype=np.int64)
    seen = np.full(count, -1, dtype=np.int64)
    end = 0
    for i in range(count):
        seen[i] = i
        first = end
        for corner in range(4):
            place = places[i, corner]
            if end + at_place[place + 1] - at_place[place] > len(faces):
                wider = np.empty(2 * len(faces) + at_place[place + 1], dtype=np.int64)
                wider[:end] = faces[:end]
                faces = wider
            for k in range(at_place[place], at_place[place + 1]):
                j = by_place[k]
                if seen[j] == i:
                    continue
                seen[j] = i
                cosine = (
                    normals[i, 0] * normals[j, 0]
                    + normals[i, 1] * normals[j, 1]
                    + normals[i, 2] * normals[j, 2]
                )
                if cosine < LEAST_COSINE:
                    continue
                k_to = end
                while k_to > first and faces[k_to - 1] > j:
                    faces[k_to] = faces[k_to - 1]
                    k_to -= 1
                faces[k_to] = j
                end += 1
        start[i + 1] = end
    return start, faces[:end].copy()


@routine
def _in_frames(corners, centroids, frames):
    """Corners of the faces in their frames, from the centroid [m], shape (F, 4, 2)."""
    found = np.empty((len(corners), 4, 2))
    for face in range(len(corners)):
        for k in range(4):
            x = corners[face, k, 0] - centroids[face, 0]
            y = corners[face, k, 1] - centroids[face, 1]
            z = corners[face, k, 2] - centroids[face, 2]
            for axis in range(2):
                found[face, k, axis] = (
                    x * frames[face, axis, 0]
                    + y * frames[face, axis, 1]
                    + z * frames[face, axis, 2]
                )
    return found


@routine
def _unroll(start, faces, centroids, frames, way):
    """Write the way to each neighbour: its direction on the face's plane, its length in space."""
    for i in range(len(start) - 1):
        for k in range(start[i], start[i + 1]):
            j = faces[k]
            x = centroids[j, 0] - centroids[i, 0]
            y = centroids[j, 1] - centroids[i, 1]
            z = centroids[j, 2] - centroids[i, 2]
            u = x * frames[i, 0, 0] + y * frames[i, 0, 1] + z * frames[i, 0, 2]
            v = x * frames[i, 1, 0] + y * frames[i, 1, 1] + z * frames[i, 1, 2]
            flat = np.sqrt(u * u + v * v)
            stretch = np.sqrt(x * x + y * y + z * z) / flat if flat > 0.0 else 0.0
            way[k, 0], way[k, 1] = stretch * u, stretch * v


@routine
def _ways_back(start, faces, way, back):
    """Write the way from each neighbour to the face, in the neighbour's frame."""
    # Neighbours ascend, and so do those that have a face as theirs: the next unread one is it.
    unread = start[:-1].copy()
    for i in range(len(start) - 1):
        for k in range(start[i], start[i + 1]):
            j = faces[k]
            back[k] = way[unread[j]]
            unread[j] += 1


@routine
def _fit(start, way, share):
    """Write the rows of the pseudo-inverse; differences weigh with the inverse of the distance."""
    for face in range(len(start) - 1):
        a, b, c = 0.0, 0.0, 0.0
        for k in range(start[face], start[face + 1]):
            x, y = way[k, 0], way[k, 1]
            square = x * x + y * y
            if square > 0.0:
                a, b, c = a + x * x / square, b + x * y / square, c + y * y / square
        # Eigenvalues of [[a, b], [b, c]] and the eigenvector of the larger one.
        middle, half = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
        large, small = middle + half, middle - half
        turn = 0.5 * np.arctan2(2.0 * b, a - c)
        ex, ey = np.cos(turn), np.sin(turn)
        of_large = 1.0 / large if large > 0.0 else 0.0
        of_small = 1.0 / small if small > LEAST_SPREAD * large else 0.0
        for k in range(start[face], start[face + 1]):
            x, y = way[k, 0], way[k, 1]
            square = x * x + y * y
            if square == 0.0:
                share[k, 0], share[k, 1] = 0.0, 0.0
                continue
            along, across = (ex * x + ey * y) * of_large, (ex * y - ey * x) * of_small
            share[k, 0] = (ex * along - ey * across) / square
            share[k, 1] = (ey * along + ex * across) / square


# --- gradients of a field, and their limits -------------------------------------------------------


@routine
def _fit_gradients(stencil, values, gradients):
    start, face, share = stencil.start, stencil.face, stencil.share
    for i in range(len(values)):
        gx, gy = 0.0, 0.0
        for k in range(start[i], start[i + 1]):
            difference = values[face[k]] - values[i]
            gx += share[k, 0] * difference
            gy += share[k, 1] * difference
        if not np.isfinite(gx + gy):
            gx, gy = 0.0, 0.0  # beside a face without a value
        gradients[i, 0], gradients[i, 1] = gx, gy


@routine
def _limit_gradients(stencil, values, fitted, never_negative, gradients):
    start, face, corners = stencil.start, stencil.face, stencil.corners
    way, back = stencil.way, stencil.back
    for i in range(len(values)):
        own, gx, gy = values[i], fitted[i, 0], fitted[i, 1]
        low, high, differences, unexplained = 0.0, 0.0, 0.0, 0.0
        for k in range(start[i], start[i + 1]):
            j = face[k]
            difference = values[j] - own
            if np.isnan(difference):
                continue
            low, high = min(low, difference), max(high, difference)
            by_own = gx * way[k, 0] + gy * way[k, 1]
            by_other = fitted[j, 0] * back[k, 0] + fitted[j, 1] * back[k, 1]
            rest = difference - 0.5 * (by_own - by_other)
            square = way[k, 0] ** 2 + way[k, 1] ** 2
            if square > 0.0:
                differences += difference * difference / square
                unexplained += rest * rest / square
        within, positive = 1.0, 1.0
        for corner in range(4):
            step = gx * corners[i, corner, 0] + gy * corners[i, corner, 1]
            within = min(within, _allowed(step, low, high))
            if never_negative:
                positive = min(positive, _allowed(step, -own, np.inf))
        limited = 0.0
        if unexplained > RESOLVED * differences:
            limited = (unexplained / differences - RESOLVED) / (UNRESOLVED - RESOLVED)
        scale = min(positive, 1.0 - min(limited, 1.0) * (1.0 - within))
        gradients[i, 0], gradients[i, 1] = scale * gx, scale * gy


@equation
def _allowed(step, low, high):
    """Largest share, up to 1, of a step that stays between two bounds around 0."""
    if step > high:
        return high / step
    if step < low:
        return low / step
    return 1.0


@routine
def _tensor_gradients(stencil, components, around, multiplicity, gradients):
    count, kinds = components.shape
    way, share = stencil.way, stencil.share
    for i in range(count):
        first, end = stencil.start[i], stencil.start[i + 1]
        differences, unexplained = 0.0, 0.0
        for m in range(kinds):
            gx, gy = 0.0, 0.0
            for k in range(first, end):
                difference = around[k, m] - components[i, m]
                gx, gy = gx + share[k, 0] * difference, gy + share[k, 1] * difference
            for k in range(first, end):
                difference = around[k, m] - components[i, m]
                rest = difference - gx * way[k, 0] - gy * way[k, 1]
                weight = multiplicity[m] / max(way[k, 0] ** 2 + way[k, 1] ** 2, 1e-300)
                differences += weight * difference * difference
                unexplained += weight * rest * rest
            gradients[i, m, 0], gradients[i, m, 1] = gx, gy
        scale = 1.0
        if not np.isfinite(differences):
            scale = 0.0  # beside a face without a value
        elif unexplained > RESOLVED_TENSOR * differences:
            over = (unexplained / differences - RESOLVED_TENSOR) / RESOLVED_TENSOR
            scale = max(0.0, 1.0 - over)
        if kinds == 3:
            scale = _kept_positive(components[i], gradients[i], stencil.corners[i], scale)
        for m in range(kinds):
            gradients[i, m, 0] = scale * gradients[i, m, 0] if scale > 0.0 else 0.0
            gradients[i, m, 1] = scale * gradients[i, m, 1] if scale > 0.0 else 0.0


@equation
def _kept_positive(mean, gradient, corners, scale):
    """Halve a scale until the tensor 11, 22, 12 is positive at all corners of the face."""
    for _ in range(8):
        positive = True
        for corner in range(4):
            x, y = scale * corners[corner, 0], scale * corners[corner, 1]
            a = mean[0] + gradient[0, 0] * x + gradient[0, 1] * y
            b = mean[1] + gradient[1, 0] * x + gradient[1, 1] * y
            c = mean[2] + gradient[2, 0] * x + gradient[2, 1] * y
            if a < 0.0 or b < 0.0 or a * b < c * c:
                positive = False
        if positive:
            return scale
        scale *= 0.5
    return 0.0
