"""All tools of a scene as plain arrays, in one tuple type that every compiled kernel takes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.tools.distance import REVOLVED
from lcmchain.tools.level_part import COLUMNS, level_part
from lcmchain.tools.motion import GUIDED
from lcmchain.tools.profiles import CORNER_COLUMNS, SEGMENT_COLUMNS
from lcmchain.tools.tool import Tool


class ToolTable(NamedTuple):
    """Shapes and motions of T rigid tools; constant during a run.

    Parameters
    ----------
    kind : shape [T], a plane, revolved or extruded profile, or distance field.
    origin : positions [m] at travel 0, shape [T, 3].
    rotation : rows are the local axes in global coordinates, shape [T, 3, 3]; the local z of a
        plane is its outward normal.
    aligned : 1 where the rotation is the identity and stays it, shape [T].
    direction : unit directions of travel, shape [T, 3].
    turn_axis, turn_point : unit axis and a point of it [m] of tools that turn, shape [T, 3]; the
        axis is 0 for all others. Both None where no tool turns. The travel of one that does is its
        angle [rad], and its direction is 0.
    friction : Coulomb friction coefficients, shape [T].
    initial_overlap : depth [m] in the tool up to which a node exerts no force, shape [T], see
        :mod:`lcmchain.tools.initial_overlap`.
    motion_kind : FIXED, PRESCRIBED or GUIDED, shape [T].
    mass, force, damping, gravity_along, ramp : of guided tools: mass [kg], force along the
        direction [N], viscous damping [N s/m], acceleration of gravity along the direction
        [m/s2], time over which weight and force come on smoothly [s], shape [T]; zero for all
        others.
    load_start : time [s] at which weight and force of a guided tool begin to come on, shape [T].
    travel_start : travel [m] that prescribed motions count from, shape [T]: 0, or what a tool has
        gone by when a stage begins.
    stop : travel [m] after ``travel_start`` at which a guided tool is held; its sign is that of the
        way there; infinite without a stop, shape [T].
    until_force : force [N] of the sheets against a stroke at which it ends; infinite where none
        does, shape [T].
    stroke_profile, stroke_distance, stroke_start, stroke_end : kind, travel [m] and times [s] of
        prescribed strokes, shape [T].
    table_start, table_times, table_travels : tabulated motions one after the other; tool t owns
        entries table_start[t] to table_start[t + 1].
    segment_start, segments, corner_start, corners : profiles one after the other, see
        `Profile.segments` and `Profile.corners`.
    level_part : of the profiles, shape [T, 5], see :mod:`lcmchain.tools.level_part`.
    spacing, grid_origin, grid_shape, box, grid_start, coefficients, far_bound : distance fields one
        after the other, in local coordinates; see `DistanceField`.
    """

    kind: np.ndarray
    origin: np.ndarray
    rotation: np.ndarray
    aligned: np.ndarray
    direction: np.ndarray
    turn_axis: np.ndarray | None
    turn_point: np.ndarray | None
    friction: np.ndarray
    initial_overlap: np.ndarray
    motion_kind: np.ndarray
    mass: np.ndarray
    force: np.ndarray
    damping: np.ndarray
    gravity_along: np.ndarray
    ramp: np.ndarray
    load_start: np.ndarray
    travel_start: np.ndarray
    stop: np.ndarray
    until_force: np.ndarray
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
    level_part: np.ndarray
    spacing: np.ndarray
    grid_origin: np.ndarray
    grid_shape: np.ndarray
    box: np.ndarray
    grid_start: np.ndarray
    coefficients: np.ndarray
    far_bound: np.ndarray


def build_tool_table(
    tools: Sequence[Tool],
    directory: Path | None,
    process_time: float,
    *,
    default_friction: float = 0.0,
    blank: np.ndarray | None = None,
) -> ToolTable:
    """Turn the tools of a scene into the arrays that the solver's kernels read.

    Parameters
    ----------
    tools : tools of the scene.
    directory : folder of the scene file, to which mesh files are relative.
    process_time : simulated time [s], the end of strokes that do not give one.
    default_friction : friction coefficient of tools that do not give one.
    blank : positions [m] of the blank's nodes at the start, shape [node_count, 3], on whose side
        open surface meshes are free; None leaves these as their files have them.

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
    axes = [tool.local_axes(key=f"{key}.axis") for tool, key in zip(tools, keys)]
    shapes = [
        tool.shape.table_entries(
            directory,  # type: ignore[arg-type]
            key=f"{key}.shape",
            blank=None if blank is None else in_frame_of(tool, own, blank),
        )
        for tool, key, own in zip(tools, keys, axes)
    ]
    motions = [
        tool.motion.table_entries(own[2], process_time, key=f"{key}.motion")
        for tool, own, key in zip(tools, axes, keys)
    ]
    rotations = [tool.shape.oriented(own) for tool, own in zip(tools, axes)]
    rows = [{**shape, **motion} for shape, motion in zip(shapes, motions)]

    def column(name, dtype=float, width=()):
        return np.array([row[name] for row in rows], dtype=dtype).reshape(len(rows), *width)

    def parts(name):
        return [row[name] for row in rows]

    count = len(tools)
    turn_axis = column("turn_axis", width=(3,))
    turns = turn_axis.any(axis=1)
    return ToolTable(
        kind=column("kind", np.int64),
        origin=np.array([tool.position for tool in tools], dtype=float).reshape(count, 3),
        rotation=np.array(rotations, dtype=float).reshape(count, 3, 3),
        aligned=np.array(
            [np.array_equal(r, np.eye(3)) and not turn for r, turn in zip(rotations, turns)],
            dtype=np.int64,
        ),
        direction=column("direction", width=(3,)),
        turn_axis=turn_axis if turns.any() else None,
        turn_point=column("turn_point", width=(3,)) if turns.any() else None,
        friction=np.array(
            [default_friction if tool.friction is None else tool.friction for tool in tools],
            dtype=float,
        ),
        initial_overlap=np.zeros(count),
        motion_kind=column("motion_kind", np.int64),
        mass=column("mass"),
        force=column("force"),
        damping=column("damping"),
        gravity_along=column("gravity_along"),
        ramp=column("ramp"),
        load_start=column("load_start"),
        travel_start=column("travel_start"),
        stop=column("stop"),
        until_force=column("until_force"),
        stroke_profile=column("stroke_profile", np.int64),
        stroke_distance=column("stroke_distance"),
        stroke_start=column("stroke_start"),
        stroke_end=column("stroke_end"),
        table_start=_starts(parts("table_times")),
        table_times=_joined(parts("table_times"), np.zeros(0)),
        table_travels=_joined(parts("table_travels"), np.zeros(0)),
        segment_start=_starts(parts("segments")),
        segments=_joined(parts("segments"), np.zeros((0, SEGMENT_COLUMNS))),
        corner_start=_starts(parts("corners")),
        corners=_joined(parts("corners"), np.zeros((0, CORNER_COLUMNS))),
        level_part=np.array(
            [
                level_part(row["segments"], row["corners"], revolved=row["kind"] == REVOLVED)
                for row in rows
            ]
        ).reshape(count, COLUMNS),
        spacing=column("spacing"),
        grid_origin=column("grid_origin", width=(3,)),
        grid_shape=column("grid_shape", np.int64, (3,)),
        box=column("box", width=(6,)),
        grid_start=_starts(parts("coefficients")),
        coefficients=_joined(parts("coefficients"), np.zeros(0, np.float32)),
        far_bound=_joined(parts("far_bound"), np.zeros(0, np.int8)),
    )


def yields(tools: ToolTable) -> np.ndarray:
    """Return of which tools, shape [T], a force decides how far they go.

    A load guides them, or ends their stroke.
    """
    return (tools.motion_kind == GUIDED) | np.isfinite(tools.until_force)


def in_frame_of(tool: Tool, axes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points [m], shape [point_count, 3], in the local frame of a tool with these axes."""
    return (points - np.array(tool.position, dtype=float)) @ axes.T


def _starts(parts) -> np.ndarray:
    return np.cumsum([0, *(len(part) for part in parts)], dtype=np.int64)


def _joined(parts, empty: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.concatenate([empty, *parts]), dtype=empty.dtype)
