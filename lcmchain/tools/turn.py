"""Where a tool stands that turns about an axis: its place and its axes at an angle.

The travel of such a tool is the angle, and its direction is 0. Where no tool of a scene turns, the
table has no axes, and the code of this file is left out of all that is compiled.
Source: Rodrigues' formula for the rotation of a vector.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lcmchain.jit import equation


@equation
def turned(x, y, z, axis, tool, angle):
    """Turn a vector about the axis of a tool, a row of ``axis`` (T, 3); as it is about 0."""
    ax, ay, az = axis[tool, 0], axis[tool, 1], axis[tool, 2]
    if ax * ax + ay * ay + az * az == 0.0:
        return x, y, z
    c, s = math.cos(angle), math.sin(angle)
    rest = (1.0 - c) * (ax * x + ay * y + az * z)
    return (
        c * x + s * (ay * z - az * y) + rest * ax,
        c * y + s * (az * x - ax * z) + rest * ay,
        c * z + s * (ax * y - ay * x) + rest * az,
    )


@equation
def origin_at(turn_axis, table, tool, travel):
    """Return the origin of a tool [m] at a travel [m], or at an angle [rad] if it turns.

    turn_axis : of the table, None where no tool turns.
    """
    x = table.origin[tool, 0] + travel * table.direction[tool, 0]
    y = table.origin[tool, 1] + travel * table.direction[tool, 1]
    z = table.origin[tool, 2] + travel * table.direction[tool, 2]
    if turn_axis is not None:
        px, py, pz = table.turn_point[tool, 0], table.turn_point[tool, 1], table.turn_point[tool, 2]
        x, y, z = turned(x - px, y - py, z - pz, turn_axis, tool, travel)
        return x + px, y + py, z + pz
    return x, y, z


@equation
def local_axis_at(turn_axis, table, tool, travel, axis):
    """Return a local axis of a tool, 0 to 2, in global coordinates at a travel or angle."""
    x = table.rotation[tool, axis, 0]
    y = table.rotation[tool, axis, 1]
    z = table.rotation[tool, axis, 2]
    if turn_axis is not None:
        return turned(x, y, z, turn_axis, tool, travel)
    return x, y, z


@equation
def arm_at(table, tool, x, y, z):
    """Return the velocity of a tool at a point for an angular velocity of 1 [m]; 0 without a turn.

    The moment of a force about the axis is its product with this vector.
    """
    ax, ay, az = table.turn_axis[tool, 0], table.turn_axis[tool, 1], table.turn_axis[tool, 2]
    rx = x - table.turn_point[tool, 0]
    ry = y - table.turn_point[tool, 1]
    rz = z - table.turn_point[tool, 2]
    return ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx


def turning(table: Any) -> np.ndarray:
    """Return which tools of a table turn, shape [T]."""
    if table.turn_axis is None:
        return np.zeros(table.kind.size, dtype=bool)
    axes: np.ndarray = table.turn_axis
    return np.array([axis.any() for axis in axes])


def placed(table: Any, tool: int, points: np.ndarray, travel: float) -> np.ndarray:
    """Return points of a tool at rest [m], shape [n, 3], where it has taken them.

    travel : along its direction [m], or its angle [rad].
    """
    rotation, shift = placement(table, tool, travel)
    return points @ rotation.T + shift


def placement(table: Any, tool: int, travel: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation [3, 3] of a tool since the start, and the shift [m] that goes with it."""
    shift = travel * np.asarray(table.direction[tool])
    if not turning(table)[tool]:
        return np.eye(3), shift
    axis, point = np.asarray(table.turn_axis[tool]), np.asarray(table.turn_point[tool])
    across = np.array(
        [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]]
    )
    rotation = np.eye(3) + math.sin(travel) * across + (1.0 - math.cos(travel)) * across @ across
    return rotation, point - rotation @ point


def lever(table: Any, tool: int, points: np.ndarray) -> float:
    """Return how far a tool moves at most at points [m], shape [n, 3], for its travel of 1.

    1 for a travel along a direction, the largest distance from the axis [m] for an angle.
    """
    if not turning(table)[tool]:
        return 1.0
    arms = np.cross(table.turn_axis[tool], points - table.turn_point[tool])
    return float(np.linalg.norm(arms, axis=1).max())
