"""Intersection of target cells with faces of the sheet, on the tangent plane of the cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.jit import strict_equation
from lcmchain.mapping.search import balls
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.target import CellPolygons

# Faces steeper than this against the cell (75.5 degrees) say nothing about it: their projection
# is a thin strip whose place depends on where the tangent plane was put.
MINIMUM_COSINE = 0.25

# Parts of a face below this fraction of the cell are rounding at shared edges.
SLIVER = 1e-12


class Intersections(NamedTuple):
    """Pairs of a target cell and a source face whose projections overlap, by cell, then face."""

    cell: np.ndarray  # (K,) int64
    face: np.ndarray  # (K,) int64
    area: np.ndarray  # (K,) [m2] of the overlap on the cell's tangent plane
    face_part: np.ndarray  # (K,) share of the face's material that lies over the cell
    height: np.ndarray  # (K,) [m] mean distance of the overlapping part from the tangent plane


def intersect(surface: Surface, cells: CellPolygons, maximum_distance: float) -> Intersections:
    """Intersect every cell with the faces within ``maximum_distance`` [m] along its normal.

    Cell and face are projected onto the cell's tangent plane; a quadrilateral face counts as two
    triangles, each clipped by the cell (Sutherland-Hodgman).
    """
    reach = cells.radii + surface.face_radii.max() + maximum_distance
    start, candidates = balls(surface.face_tree, cells.centroids, reach)
    cell, face, area, part, height = _overlaps(
        cells.start,
        cells.corners,
        cells.centroids,
        cells.normals,
        start,
        candidates,
        surface.first_triangle,
        surface.triangle_corners,
        maximum_distance,
    )
    return Intersections(cell, face, area, part, height)


@strict_equation
def _overlaps(
    cell_start,
    cell_corners,
    centroids,
    normals,
    start,
    candidates,
    first_triangle,
    triangle_corners,
    maximum_distance,
):
    capacity = len(candidates)
    cell_of = np.empty(capacity, dtype=np.int64)
    face_of = np.empty(capacity, dtype=np.int64)
    area_of = np.empty(capacity)
    part_of = np.empty(capacity)
    height_of = np.empty(capacity)
    count = 0
    clip = np.empty((16, 2))
    subject = np.empty((3, 2))
    work = np.empty((2, 24, 2))
    for c in range(len(centroids)):
        corner_count = cell_start[c + 1] - cell_start[c]
        if corner_count < 3:
            continue
        ox, oy, oz = centroids[c, 0], centroids[c, 1], centroids[c, 2]
        nx, ny, nz = normals[c, 0], normals[c, 1], normals[c, 2]
        ux, uy, uz = tangent(nx, ny, nz)
        vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
        for k in range(corner_count):
            x = cell_corners[cell_start[c] + k, 0] - ox
            y = cell_corners[cell_start[c] + k, 1] - oy
            z = cell_corners[cell_start[c] + k, 2] - oz
            clip[k, 0] = x * ux + y * uy + z * uz
            clip[k, 1] = x * vx + y * vy + z * vz
        first = fan_start(clip, corner_count)
        cell_area = polygon_area(clip, corner_count)
        for j in range(start[c], start[c + 1]):
            face = candidates[j]
            face_area = 0.0
            area, part, moment = 0.0, 0.0, 0.0
            for t in range(first_triangle[face], first_triangle[face + 1]):
                a, b, d = triangle_corners[t, 0], triangle_corners[t, 1], triangle_corners[t, 2]
                ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
                fx, fy, fz = d[0] - a[0], d[1] - a[1], d[2] - a[2]
                mx, my, mz = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
                doubled = np.sqrt(mx * mx + my * my + mz * mz)
                face_area += 0.5 * doubled
                along = mx * nx + my * ny + mz * nz
                if doubled == 0.0 or abs(along) < MINIMUM_COSINE * doubled:
                    continue
                for k in range(3):
                    x = triangle_corners[t, k, 0] - ox
                    y = triangle_corners[t, k, 1] - oy
                    z = triangle_corners[t, k, 2] - oz
                    subject[k, 0] = x * ux + y * uy + z * uz
                    subject[k, 1] = x * vx + y * vy + z * vz
                if along < 0.0:  # counter-clockwise, whatever side the face shows
                    x, y = subject[1, 0], subject[1, 1]
                    subject[1, 0], subject[1, 1] = subject[2, 0], subject[2, 1]
                    subject[2, 0], subject[2, 1] = x, y
                if not boxes_touch(subject, clip, corner_count):
                    continue
                for i in range(1, corner_count - 1):
                    p = first
                    q = (first + i) % corner_count
                    r = (first + i + 1) % corner_count
                    overlap, x, y = clipped_area(subject, clip, p, q, r, work)
                    if overlap <= SLIVER * cell_area:
                        continue
                    # Height of the triangle's plane over the middle of the overlap.
                    to_x, to_y, to_z = (
                        ox + x * ux + y * vx - a[0],
                        oy + x * uy + y * vy - a[1],
                        oz + x * uz + y * vz - a[2],
                    )
                    height = abs((to_x * mx + to_y * my + to_z * mz) / along)
                    if height > maximum_distance:
                        continue
                    area += overlap
                    part += overlap * doubled / abs(along)  # area on the face itself
                    moment += overlap * height
            if area > 0.0:
                cell_of[count] = c
                face_of[count] = face
                area_of[count] = area
                part_of[count] = part / face_area
                height_of[count] = moment / area
                count += 1
    return (
        cell_of[:count].copy(),
        face_of[:count].copy(),
        area_of[:count].copy(),
        part_of[:count].copy(),
        height_of[:count].copy(),
    )


@strict_equation
def tangent(nx, ny, nz):
    """Unit vector perpendicular to a unit normal, from the axis that is least aligned with it."""
    ax, ay, az = abs(nx), abs(ny), abs(nz)
    if ax <= ay and ax <= az:
        length = np.sqrt(ny * ny + nz * nz)
        return 0.0, nz / length, -ny / length
    if ay <= az:
        length = np.sqrt(nx * nx + nz * nz)
        return -nz / length, 0.0, nx / length
    length = np.sqrt(nx * nx + ny * ny)
    return ny / length, -nx / length, 0.0


@strict_equation
def fan_start(polygon, count):
    """Corner from which a fan of triangles covers the polygon without turning over.

    Any corner of a convex polygon does; a quadrilateral with one reflex corner needs that corner
    or the opposite one.
    """
    for first in range(count):
        turned = False
        for i in range(1, count - 1):
            p, q, r = first, (first + i) % count, (first + i + 1) % count
            if doubled_area(polygon, p, q, r) < 0.0:
                turned = True
        if not turned:
            return first
    return 0


@strict_equation
def doubled_area(points, p, q, r):
    return (points[q, 0] - points[p, 0]) * (points[r, 1] - points[p, 1]) - (
        points[q, 1] - points[p, 1]
    ) * (points[r, 0] - points[p, 0])


@strict_equation
def polygon_area(polygon, count):
    total = 0.0
    for i in range(1, count - 1):
        total += 0.5 * doubled_area(polygon, 0, i, i + 1)
    return total


@strict_equation
def boxes_touch(subject, clip, count):
    for axis in range(2):
        low, high = subject[0, axis], subject[0, axis]
        for k in range(1, 3):
            low, high = min(low, subject[k, axis]), max(high, subject[k, axis])
        clip_low, clip_high = clip[0, axis], clip[0, axis]
        for k in range(1, count):
            clip_low, clip_high = min(clip_low, clip[k, axis]), max(clip_high, clip[k, axis])
        if high < clip_low or low > clip_high:
            return False
    return True


@strict_equation
def clipped_area(subject, clip, p, q, r, work):
    """Area and centroid of a triangle clipped by the triangle (p, q, r) of the clip polygon.

    Both counter-clockwise. Source: Sutherland and Hodgman, Communications of the ACM 17 (1974) 32.
    """
    if doubled_area(clip, p, q, r) <= 0.0:
        return 0.0, 0.0, 0.0
    count = 3
    for k in range(3):
        work[0, k, 0], work[0, k, 1] = subject[k, 0], subject[k, 1]
    now = 0
    for edge in range(3):
        start = p if edge == 0 else (q if edge == 1 else r)
        end = q if edge == 0 else (r if edge == 1 else p)
        sx, sy = clip[start, 0], clip[start, 1]
        dx, dy = clip[end, 0] - sx, clip[end, 1] - sy
        kept = 0
        for k in range(count):
            nxt = (k + 1) % count
            ax, ay = work[now, k, 0], work[now, k, 1]
            bx, by = work[now, nxt, 0], work[now, nxt, 1]
            side_a = dx * (ay - sy) - dy * (ax - sx)
            side_b = dx * (by - sy) - dy * (bx - sx)
            if side_a >= 0.0:
                work[1 - now, kept, 0], work[1 - now, kept, 1] = ax, ay
                kept += 1
            if (side_a > 0.0 and side_b < 0.0) or (side_a < 0.0 and side_b > 0.0):
                s = side_a / (side_a - side_b)
                work[1 - now, kept, 0] = ax + s * (bx - ax)
                work[1 - now, kept, 1] = ay + s * (by - ay)
                kept += 1
        now, count = 1 - now, kept
        if count < 3:
            return 0.0, 0.0, 0.0
    area, mx, my = 0.0, 0.0, 0.0
    for i in range(1, count - 1):
        part = 0.5 * doubled_area(work[now], 0, i, i + 1)
        area += part
        mx += part * (work[now, 0, 0] + work[now, i, 0] + work[now, i + 1, 0]) / 3.0
        my += part * (work[now, 0, 1] + work[now, i, 1] + work[now, i + 1, 1]) / 3.0
    if area <= 0.0:
        return 0.0, 0.0, 0.0
    return area, mx / area, my / area
