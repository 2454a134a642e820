"""All tools of a scene as plain arrays, in one tuple type that every compiled kernel takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.tools.distance import EXTRUDED, FIELD, PLANE, REVOLVED
from lcmchain.tools.motion import motion_entries
from lcmchain.tools.profiles import CORNER_COLUMNS, SEGMENT_COLUMNS, Profile, build_profile
from lcmchain.tools.surfaces.distance_field import DistanceField, build_distance_field, read_surface


class ToolTable(NamedTuple):
    """Shapes and motions of T rigid tools; constant during a run.

    Parameters
    ----------
    kind : shape [T], a plane, revolved or extruded profile, or distance field.
    origin : positions [m] at travel 0, shape [T, 3].
    rotation : rows are the local axes in global coordinates, shape [T, 3, 3]; the local z of a
        plane is its outward normal.
    aligned : 1 where the rotation is the identity, shape [T].
    direction : unit directions of travel, shape [T, 3].
    friction : Coulomb friction coefficients, shape [T].
    motion_kind : FIXED, PRESCRIBED or GUIDED, shape [T].
    mass, force, damping, gravity_along, ramp : of guided tools: mass [kg], force along the
        direction [N], viscous damping [N s/m], acceleration of gravity along the direction
        [m/s2], time over which weight and force come on smoothly [s], shape [T]; zero for all
        others.
    stroke_profile, stroke_distance, stroke_start, stroke_end : kind, travel [m] and times [s] of
        prescribed strokes, shape [T].
    table_start, table_times, table_travels : tabulated motions one after the other; tool t owns
        entries table_start[t] to table_start[t + 1].
    segment_start, segments, corner_start, corners : profiles one after the other, see
        `Profile.segments` and `Profile.corners`.
    spacing, grid_origin, grid_shape, box, grid_start, coefficients, far_bound : distance fields one
        after the other, in local coordinates; see `DistanceField`.
    """

    kind: np.ndarray
    origin: np.ndarray
    rotation: np.ndarray
    aligned: np.ndarray
    direction: np.ndarray
    friction: np.ndarray
    motion_kind: np.ndarray
    mass: np.ndarray
    force: np.ndarray
    damping: np.ndarray
    gravity_along: np.ndarray
    ramp: np.ndarray
    stroke_profile: np.ndarray
    stroke_distance: np.ndarray
    stroke_start: np.ndarray
    stroke_end: np.ndarray
    table_start: np.ndarray
    table_times: np.ndarray
    table_travels: np.ndarray
    segment_start: np.ndarray
    segments: np.ndarray
    corner_start: np.ndarray
    corners: np.ndarray
    spacing: np.ndarray
    grid_origin: np.ndarray
    grid_shape: np.ndarray
    box: np.ndarray
    grid_start: np.ndarray
    coefficients: np.ndarray
    far_bound: np.ndarray


def build_tool_table(
    tools: Sequence,
    directory: Path,
    process_time: float,
    *,
    default_friction: float = 0.0,
) -> ToolTable:
    """Turn the tools of a scene into the arrays that the solver's kernels read.

    Parameters
    ----------
    tools : tools of the scene.
    directory : folder of the scene file, to which mesh files are relative.
    process_time : simulated time [s], the end of strokes that do not give one.
    default_friction : friction coefficient of tools that do not give one.

    Raises
    ------
    InputError
        if a shape, motion or mesh file cannot be used; names the tool's key or the file.

    Warns
    -----
    ToolWarning
        if a surface mesh had to be repaired or is not well resolved by its distance field.
    """
    keys = [f'tools[{i}] "{tool.name}"' for i, tool in enumerate(tools)]
    shapes = [tool_shape(tool, directory, key=f"{key}.shape") for tool, key in zip(tools, keys)]
    rotations = [tool_rotation(tool, key=f"{key}.axis") for tool, key in zip(tools, keys)]
    motions = [
        motion_entries(tool.motion, rotation[2], process_time, key=f"{key}.motion")
        for tool, rotation, key in zip(tools, rotations, keys)
    ]
    for i, tool in enumerate(tools):
        if tool.shape.type == "plate" and _flipped(tool):
            rotations[i] = np.diag([1.0, -1.0, -1.0]) @ rotations[i]
    profiles = [shape if isinstance(shape, Profile) else None for shape in shapes]
    fields = [shape if isinstance(shape, DistanceField) else None for shape in shapes]
    segments = [np.zeros((0, SEGMENT_COLUMNS)) if p is None else p.segments() for p in profiles]
    corners = [np.zeros((0, CORNER_COLUMNS)) if p is None else p.corners() for p in profiles]
    no_values, no_bounds = np.zeros(0, np.float32), np.zeros(0, np.int8)
    coefficients = [no_values if f is None else f.coefficients.ravel() for f in fields]
    far_bounds = [no_bounds if f is None else f.far_bound.ravel() for f in fields]

    def column(name):
        return np.array([motion[name] for motion in motions], dtype=float)

    def field_rows(name, width, dtype=float):
        rows = [np.zeros(width) if f is None else getattr(f, name) for f in fields]
        return np.array(rows, dtype=dtype).reshape(len(tools), width)

    count = len(tools)
    return ToolTable(
        kind=np.array([_kind(shape) for shape in shapes], dtype=np.int64),
        origin=np.array([tool.position for tool in tools], dtype=float).reshape(count, 3),
        rotation=np.array(rotations, dtype=float).reshape(count, 3, 3),
        aligned=np.array([np.array_equal(r, np.eye(3)) for r in rotations], dtype=np.int64),
        direction=np.array([m["direction"] for m in motions], dtype=float).reshape(count, 3),
        friction=np.array(
            [default_friction if tool.friction is None else tool.friction for tool in tools],
            dtype=float,
        ),
        motion_kind=np.array([m["motion_kind"] for m in motions], dtype=np.int64),
        mass=column("mass"),
        force=column("force"),
        damping=column("damping"),
        gravity_along=column("gravity_along"),
        ramp=column("ramp"),
        stroke_profile=np.array([m["stroke_profile"] for m in motions], dtype=np.int64),
        stroke_distance=column("stroke_distance"),
        stroke_start=column("stroke_start"),
        stroke_end=column("stroke_end"),
        table_start=_starts([m["table_times"] for m in motions]),
        table_times=_joined([m["table_times"] for m in motions], np.zeros(0)),
        table_travels=_joined([m["table_travels"] for m in motions], np.zeros(0)),
        segment_start=_starts(segments),
        segments=_joined(segments, np.zeros((0, SEGMENT_COLUMNS))),
        corner_start=_starts(corners),
        corners=_joined(corners, np.zeros((0, CORNER_COLUMNS))),
        spacing=np.array([0.0 if f is None else f.spacing for f in fields], dtype=float),
        grid_origin=field_rows("origin", 3),
        grid_shape=field_rows("shape", 3, np.int64),
        box=field_rows("box", 6),
        grid_start=_starts(coefficients),
        coefficients=_joined(coefficients, no_values),
        far_bound=_joined(far_bounds, no_bounds),
    )


def tool_shape(tool, directory: Path, *, key: str) -> Profile | DistanceField | None:
    """Profile or distance field of a scene tool; None for a plane."""
    profile = tool_profile(tool, key=key)
    if profile is not None or tool.shape.type == "plate":
        return profile
    if tool.shape.type == "surface_mesh":
        surface = read_surface(Path(directory) / tool.shape.file, tool.shape.length_unit)
        return build_distance_field(surface, tool.shape.spacing, key=key)
    raise InputError(f'"{tool.shape.type}" is not a kind of tool shape', key=f"{key}.type")


def tool_profile(tool, *, key: str) -> Profile | None:
    """Profile of a scene tool in its local frame; None for planes and surface meshes."""
    shape = tool.shape
    if shape.type == "sphere_capped_punch":
        radius = shape.radius
        points, radii = [(0.0, 0.0), (radius, 0.0), (radius, 2.0 * radius)], [0.0, radius, 0.0]
    elif shape.type == "plate_with_hole":
        hole, fillet = shape.hole_radius, shape.fillet_radius
        depth = hole if _flipped(tool) else -hole
        points, radii = [(2.0 * hole, 0.0), (hole, 0.0), (hole, depth)], [0.0, fillet, 0.0]
    elif shape.type == "cylinder":
        radius, edge = shape.radius, shape.edge_radius
        if shape.length is None:
            points, radii = [(radius, -radius), (radius, radius)], None
        else:
            points = [(0.0, 0.0), (radius, 0.0), (radius, shape.length), (0.0, shape.length)]
            radii = [0.0, edge, edge, 0.0]
    elif shape.type == "cone":
        radius, angle = shape.tip_radius, shape.half_angle
        height = radius if radius else 1.0
        apex = radius - radius / math.sin(angle)
        points = [(0.0, apex), (height * math.tan(angle), apex + height)]
        radii = [radius, 0.0]
    elif shape.type in ("revolved_profile", "extruded_profile"):
        points, radii = shape.points, shape.fillet_radii
    else:
        return None
    revolved = shape.type != "extruded_profile"
    solid = getattr(shape, "solid", None) or ("right" if _flipped(tool) else "left")
    return build_profile(points, radii, solid=solid, revolved=revolved, key=key)


def tool_rotation(tool, *, key: str) -> np.ndarray:
    """Local axes of a tool as rows, shape [3, 3].

    Local z is the tool's axis. Local y is perpendicular to it and to global x (or is global y where
    the axis is along x), so that a tool with the axis (0, 0, 1) is not rotated.
    """
    axis = np.array(tool.axis, dtype=float)
    length = np.linalg.norm(axis)
    if axis.shape != (3,) or not 0.0 < length < math.inf:
        raise InputError(
            f"{tool.axis} is not a direction; give three numbers, not all zero", key=key
        )
    axis /= length
    across = np.cross(axis, [1.0, 0.0, 0.0])
    if np.linalg.norm(across) < 1e-9:
        across = np.array([0.0, 1.0, 0.0])
        axis = np.array([math.copysign(1.0, axis[0]), 0.0, 0.0])
    across /= np.linalg.norm(across)
    return np.array([np.cross(across, axis), across, axis]) + 0.0  # + 0.0 turns -0 into 0


def _flipped(tool) -> bool:
    """Tell whether a plate is solid above its plane."""
    side = getattr(tool.shape, "side", "below")
    return side == "above"


def _kind(shape: Profile | DistanceField | None) -> int:
    if shape is None:
        return PLANE
    if isinstance(shape, DistanceField):
        return FIELD
    return REVOLVED if shape.revolved else EXTRUDED


def _starts(parts) -> np.ndarray:
    return np.cumsum([0, *(len(part) for part in parts)], dtype=np.int64)


def _joined(parts, empty: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.concatenate([empty, *parts]), dtype=empty.dtype)
