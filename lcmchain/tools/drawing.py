"""Triangles of rigid tools for pictures and for files that show the tools."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from lcmchain.tools.profiles import Profile
from lcmchain.tools.surfaces.distance_field import read_surface
from lcmchain.tools.table import tool_profile, tool_rotation

#: Triangles around the axis of a revolved tool.
CIRCUMFERENCE = 72


def tool_surface(tool, directory: Path, extent) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate the surface of a scene tool where it stands at travel 0.

    Parameters
    ----------
    tool : tool of the scene.
    directory : folder of the scene file, to which mesh files are relative.
    extent : lower and upper corner [m] of the box to draw, shape [2, 3], or one length [m]: half
        the edge of a cube around the tool's position. The surface is clipped to it.

    Returns
    -------
    points [m], shape [point_count, 3], and triangles, shape [triangle_count, 3], with normals that
    point away from the solid; both empty where nothing of the tool lies inside.
    """
    position = np.array(tool.position, dtype=float)
    box = np.asarray(extent, dtype=float)
    if box.ndim == 0:
        box = position + np.array([[-1.0], [1.0]]) * box * np.ones(3)
    # Infinite parts must reach the corner of the box that lies farthest from the tool.
    reach = float(np.linalg.norm(np.maximum(np.abs(box[0] - position), np.abs(box[1] - position))))
    key = f'tool "{tool.name}"'
    if tool.shape.type == "surface_mesh":
        surface = read_surface(Path(directory) / tool.shape.file, tool.shape.length_unit)
        points, faces = surface.points, surface.triangles
    elif tool.shape.type == "plate":
        points, faces = _square(reach, upwards=tool.shape.side == "below")
    else:
        profile = tool_profile(tool, key=key)
        points, faces = _revolved(profile, reach) if profile.revolved else _extruded(profile, reach)
    points = position + points @ tool_rotation(tool, key=key)
    return clip_to_box(points, faces, box)


def clip_to_box(points, faces, box) -> tuple[np.ndarray, np.ndarray]:
    """Cut triangles at the planes of a box (corners as rows, shape [2, 3]) and keep the inside."""
    corners = np.asarray(points, dtype=float)[np.asarray(faces, dtype=int)]
    for axis in range(3):
        corners = _clip(corners, axis, box[0][axis], 1.0)
        corners = _clip(corners, axis, box[1][axis], -1.0)
    clipped, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return clipped, index.reshape(-1, 3)


def _clip(corners, axis, limit, sign) -> np.ndarray:
    """Keep the part of triangles, shape [count, 3, 3], where sign (coordinate - limit) >= 0."""
    height = sign * (corners[:, :, axis] - limit)
    inside = (height >= 0.0).sum(axis=1)
    kept = [corners[inside == 3]]
    for count in (1, 2):
        cut, h = corners[inside == count], height[inside == count]
        # Turn each triangle until its odd corner, alone inside or alone outside, comes first.
        odd = np.argmax(h >= 0.0, axis=1) if count == 1 else np.argmax(h < 0.0, axis=1)
        order = (odd[:, None] + np.arange(3)) % 3
        h = np.take_along_axis(h, order, axis=1)[:, :, None]
        cut = np.take_along_axis(cut, order[:, :, None], axis=1)
        a, b, c = cut[:, 0], cut[:, 1], cut[:, 2]
        ab = a + (b - a) * h[:, 0] / (h[:, 0] - h[:, 1])
        ac = a + (c - a) * h[:, 0] / (h[:, 0] - h[:, 2])
        if count == 1:
            kept.append(np.stack((a, ab, ac), axis=1))
        else:
            kept.append(np.stack((ab, b, c), axis=1))
            kept.append(np.stack((ab, c, ac), axis=1))
    return np.concatenate(kept)


def _square(reach: float, *, upwards: bool) -> tuple[np.ndarray, np.ndarray]:
    points = reach * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return points, faces if upwards else faces[:, ::-1]


def _revolved(profile: Profile, reach: float) -> tuple[np.ndarray, np.ndarray]:
    curve = profile.polyline(_polyline_reach(profile, reach))
    angle = np.linspace(0.0, 2.0 * math.pi, CIRCUMFERENCE, endpoint=False)
    ring = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    points = np.empty((len(curve), CIRCUMFERENCE, 3))
    points[:, :, :2] = curve[:, None, :1] * ring
    points[:, :, 2] = curve[:, None, 1]
    points = points.reshape(-1, 3)
    index = np.arange(len(points)).reshape(len(curve), CIRCUMFERENCE)
    return points, _strips(index, np.roll(index, -1, axis=1), profile, points)


def _extruded(profile: Profile, reach: float) -> tuple[np.ndarray, np.ndarray]:
    curve = profile.polyline(_polyline_reach(profile, reach))
    points = np.empty((len(curve), 2, 3))
    points[:, :, 0] = curve[:, None, 0]
    points[:, :, 1] = (-reach, reach)
    points[:, :, 2] = curve[:, None, 1]
    index = np.arange(2 * len(curve)).reshape(len(curve), 2)
    points = points.reshape(-1, 3)
    return points, _strips(index[:, :1], index[:, 1:], profile, points)


def _strips(near, far, profile: Profile, points) -> np.ndarray:
    """Two triangles between consecutive points of the profile; the normal is on its free side."""
    if profile.closed:
        near, far = np.concatenate((near, near[:1])), np.concatenate((far, far[:1]))
    a, b, c, d = near[:-1].ravel(), near[1:].ravel(), far[1:].ravel(), far[:-1].ravel()
    # Travel, then the way across, turn by the right-hand rule to the left side of the travel.
    faces = np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))
    if profile.solid_left:
        faces = faces[:, ::-1]
    p, q, r = (points[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(q - p, r - p), axis=1)
    return faces[area > 1e-14 * area.max()]  # none at the poles, where a ring is a point


def _polyline_reach(profile: Profile, reach: float) -> float:
    """Length of infinite ends: the box, seen from wherever the given points of the profile lie."""
    ends = [value for piece in profile.pieces for value in (*piece.start, *piece.end)]
    return reach + 2.0 * max(map(abs, ends))
