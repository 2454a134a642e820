"""Triangles of revolved and extruded profiles, for pictures."""

from __future__ import annotations

import math

import numpy as np

from lcmchain.tools.profiles import Profile

#: Triangles around the axis of a revolved tool.
CIRCUMFERENCE = 72


def profile_surface(profile: Profile, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate a revolved or extruded profile; normals point away from the solid.

    Parameters
    ----------
    profile : in the local frame of the tool.
    reach : length [m] of infinite ends and of an extrusion, to either side.

    Returns
    -------
    points [m], shape [point_count, 3], and triangles, shape [triangle_count, 3].
    """
    return _revolved(profile, reach) if profile.revolved else _extruded(profile, reach)


def _revolved(profile: Profile, reach: float) -> tuple[np.ndarray, np.ndarray]:
    curve = profile.polyline(_polyline_reach(profile, reach))
    angle = np.linspace(0.0, 2.0 * math.pi, CIRCUMFERENCE, endpoint=False)
    ring = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    points: np.ndarray = np.empty((len(curve), CIRCUMFERENCE, 3))
    points[:, :, :2] = curve[:, None, :1] * ring
    points[:, :, 2] = curve[:, None, 1]
    points = points.reshape(-1, 3)
    index = np.arange(len(points)).reshape(len(curve), CIRCUMFERENCE)
    return points, _strips(index, np.roll(index, -1, axis=1), profile, points)


def _extruded(profile: Profile, reach: float) -> tuple[np.ndarray, np.ndarray]:
    curve = profile.polyline(_polyline_reach(profile, reach))
    points: np.ndarray = np.empty((len(curve), 2, 3))
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
