"""A rigid tool: its scene table, and its triangles for pictures and files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import (
    AT_WORK,
    AbsentMeans,
    AtWork,
    Direction,
    FrictionCoefficient,
    Name,
    Position,
    SceneModel,
)
from lcmchain.tools.motion import FixedMotion, Motion
from lcmchain.tools.shapes import Shape


class Tool(SceneModel):
    """A rigid tool: shape, place, motion, friction."""

    name: Annotated[str, Name("punch")] = Field(
        description="Name in reports, files and overrides, as in --set tools.punch.friction=0.2."
    )
    stages: AtWork = Field(default=None, description=AT_WORK)
    shape: Shape = Field(description="Surface of the tool.")
    position: Position = Field(  # type: ignore[assignment]
        default=("0 mm", "0 mm", "0 mm"), description="Place of the shape's local origin."
    )
    axis: Direction = Field(default=(0, 0, 1), description="Local z axis of the shape.")
    motion: Motion = Field(default_factory=FixedMotion, description="How the tool moves.")
    friction: Annotated[FrictionCoefficient | None, AbsentMeans("contact.friction")] = Field(
        default=None, description="Coulomb friction coefficient; default contact.friction."
    )

    def completed(self, friction: float, process_time: float, *, key: str) -> Self:
        """Fill the entries whose default is another entry of the scene; an error names the key."""
        changes: dict[str, Any] = {}
        if self.friction is None:
            changes["friction"] = friction
        motion = self.motion.completed(process_time, key=f"{key}.motion")
        if motion is not self.motion:
            changes["motion"] = motion
        return self.model_copy(update=changes)

    def without_time(self, process_time: float, *, key: str) -> Self:
        """Fill the times of the motion in a process without a time; an error names the key."""
        motion = self.motion.without_time(process_time, key=f"{key}.motion")
        return self.model_copy(update={"motion": motion})

    def local_axes(self, *, key: str) -> np.ndarray:
        """Local axes of the tool as rows, shape [3, 3]; an error names the key.

        Local z is the tool's axis. Local y is perpendicular to it and to global x (or is global y
        where the axis is along x), so that a tool with the axis (0, 0, 1) is not rotated.
        """
        axis = np.array(self.axis, dtype=float)
        length = np.linalg.norm(axis)
        if axis.shape != (3,) or not 0.0 < length < math.inf:
            raise InputError(
                f"{self.axis} is not a direction; give three numbers, not all zero", key=key
            )
        axis /= length
        across = np.cross(axis, [1.0, 0.0, 0.0])
        if np.linalg.norm(across) < 1e-9:
            across = np.array([0.0, 1.0, 0.0])
            axis = np.array([math.copysign(1.0, axis[0]), 0.0, 0.0])
        across /= np.linalg.norm(across)
        return np.array([np.cross(across, axis), across, axis]) + 0.0  # + 0.0 turns -0 into 0


def tool_surface(tool: Tool, directory: Path, extent: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
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
    points, faces = tool.shape.surface(directory, reach, key=key)
    points = position + points @ tool.local_axes(key=key)
    return clip_to_box(points, faces, box)


def clip_to_box(
    points: ArrayLike, faces: ArrayLike, box: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
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
