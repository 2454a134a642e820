"""All tools of a scene as plain arrays, in one tuple type that every compiled kernel takes.

What depends on the travel of a tool alone is answered here for whole arrays of points; the compiled
equations for one point stand in :mod:`lcmchain.tools.distance`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lcmchain.tools.distance import REVOLVED, gaps
from lcmchain.tools.motion import GUIDED
from lcmchain.tools.profiles import CORNER_COLUMNS, LEVEL_PART_COLUMNS, SEGMENT_COLUMNS, level_part
from lcmchain.tools.tool import Tool

#: Deepest overlap of a tool with the blank that still counts as touching, in parts of thickness.
OVERLAP_TOLERANCE = 0.01
#: Overlap in parts of thickness that is rounding, and too little to hold any energy.
ROUNDING = 1e-6


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
        axis is 0 for all others. Both are None where no tool turns. A tool that turns has its angle
        [rad] for a travel, and its direction is 0.
    friction : Coulomb friction coefficients, shape [T].
    initial_overlap : depth [m] in the tool up to which a node exerts no force, shape [T], see
        :func:`without_initial_overlap`.
    motion_kind : FIXED, PRESCRIBED or GUIDED, shape [T].
    mass, force, damping, gravity_along, ramp : of guided tools: mass [kg], force along the
        direction [N], viscous damping [N s/m], acceleration of gravity along the direction
        [m/s2], time over which weight and force come on smoothly [s], shape [T]; zero for all
        others.
    load_start : time [s] at which weight and force of a guided tool begin to come on, shape [T].
    travel_start : travel [m] that prescribed motions count from, shape [T]: 0, or the travel of a
        tool when a stage begins.
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
    level_part : of the profiles, shape [T, 5], see
        :func:`lcmchain.tools.profiles.level_part`.
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
    rows = [
        _entries(tool, directory, process_time, blank, key=f'tools[{i}] "{tool.name}"')
        for i, tool in enumerate(tools)
    ]
    rotations = [row["rotation"] for row in rows]

    def column(name, dtype=float, width=()):
        return np.array([row[name] for row in rows], dtype=dtype).reshape(len(rows), *width)

    def arrays(name):
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
        table_start=_starts(arrays("table_times")),
        table_times=_joined(arrays("table_times"), np.zeros(0)),
        table_travels=_joined(arrays("table_travels"), np.zeros(0)),
        segment_start=_starts(arrays("segments")),
        segments=_joined(arrays("segments"), np.zeros((0, SEGMENT_COLUMNS))),
        corner_start=_starts(arrays("corners")),
        corners=_joined(arrays("corners"), np.zeros((0, CORNER_COLUMNS))),
        level_part=np.array(
            [
                level_part(row["segments"], row["corners"], revolved=row["kind"] == REVOLVED)
                for row in rows
            ]
        ).reshape(count, LEVEL_PART_COLUMNS),
        spacing=column("spacing"),
        grid_origin=column("grid_origin", width=(3,)),
        grid_shape=column("grid_shape", np.int64, (3,)),
        box=column("box", width=(6,)),
        grid_start=_starts(arrays("coefficients")),
        coefficients=_joined(arrays("coefficients"), np.zeros(0, np.float32)),
        far_bound=_joined(arrays("far_bound"), np.zeros(0, np.int8)),
    )


def without_initial_overlap(
    tools: ToolTable, positions: np.ndarray, offset: np.ndarray, thickness: float
) -> ToolTable:
    """Return tools whose small overlap with nodes at the start exerts no force.

    Positions of tools are typed with a few digits, and surfaces of files are facets: what is meant
    to touch overlaps by micrometres. Its contact springs would hold energy that nobody put in, and
    push the sheet away at the first step. The overlap is taken for zero instead, during the whole
    run: as if the surface of the tool lay deeper by it.

    Parameters
    ----------
    tools : at their start; positions : of the nodes [m], shape [node_count, 3].
    offset : distance of the sheet's surface from the nodes [m], shape [node_count].
    thickness : of the sheet [m]; deeper overlaps than its tolerated part are left as they are.
    """
    positions = np.ascontiguousarray(positions, dtype=float)
    overlap = np.zeros(tools.kind.size)
    for tool in range(tools.kind.size):
        deepest = -float((gaps(tools, tool, positions, 0.0) - offset).min())
        if ROUNDING * thickness < deepest <= OVERLAP_TOLERANCE * thickness:
            overlap[tool] = deepest
    return tools._replace(initial_overlap=overlap)


def yields(tools: ToolTable) -> np.ndarray:
    """Return which tools, shape [T], go as far as a force lets them.

    A load guides them, or ends their stroke.
    """
    return (tools.motion_kind == GUIDED) | np.isfinite(tools.until_force)


def in_frame_of(tool: Tool, axes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points [m], shape [point_count, 3], in the local frame of a tool with these axes."""
    return (points - np.array(tool.position, dtype=float)) @ axes.T


def turning(table: ToolTable) -> np.ndarray:
    """Return which tools of a table turn, shape [T]."""
    if table.turn_axis is None:
        return np.zeros(table.kind.size, dtype=bool)
    return np.array([axis.any() for axis in table.turn_axis])


def placed(table: ToolTable, tool: int, points: np.ndarray, travel: float) -> np.ndarray:
    """Return where a tool has taken its points [m], shape [n, 3].

    travel : along its direction [m], or its angle [rad].
    """
    rotation, shift = placement(table, tool, travel)
    return points @ rotation.T + shift


def placement(table: ToolTable, tool: int, travel: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation [3, 3] of a tool since the start, and the shift [m] that goes with it."""
    if table.turn_axis is None or table.turn_point is None:
        return np.eye(3), travel * table.direction[tool]
    return rotation_and_shift(
        table.direction[tool], table.turn_axis[tool], table.turn_point[tool], travel
    )


def rotation_and_shift(
    direction: np.ndarray, axis: np.ndarray, point: np.ndarray, travel: float
) -> tuple[np.ndarray, np.ndarray]:
    """As :func:`placement`, of a tool with these columns of the table, each of shape [3]."""
    if not axis.any():
        return np.eye(3), travel * direction
    across = np.array(
        [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]]
    )
    rotation = np.eye(3) + math.sin(travel) * across + (1.0 - math.cos(travel)) * across @ across
    return rotation, point - rotation @ point


def lever(table: ToolTable, tool: int, points: np.ndarray) -> float:
    """Return how far the fastest of a tool's points [m], shape [n, 3], moves for a travel of 1.

    1 for a travel along a direction, the largest distance from the axis [m] for an angle.
    """
    if table.turn_axis is None or table.turn_point is None or not table.turn_axis[tool].any():
        return 1.0
    arms = np.cross(table.turn_axis[tool], points - table.turn_point[tool])
    return float(np.linalg.norm(arms, axis=1).max())


def _entries(
    tool: Tool,
    directory: Path | None,
    process_time: float,
    blank: np.ndarray | None,
    *,
    key: str,
) -> dict[str, Any]:
    """Return what a tool's row of the table is made of; parameters as of the table."""
    axes = tool.local_axes(key=f"{key}.axis")
    shape = tool.shape.table_entries(
        directory,  # type: ignore[arg-type]
        key=f"{key}.shape",
        blank=None if blank is None else in_frame_of(tool, axes, blank),
    )
    motion = tool.motion.table_entries(axes[2], process_time, key=f"{key}.motion")
    return {**shape, **motion, "rotation": tool.shape.oriented(axes)}


def _starts(arrays) -> np.ndarray:
    return np.cumsum([0, *map(len, arrays)], dtype=np.int64)


def _joined(arrays, empty: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.concatenate([empty, *arrays]), dtype=empty.dtype)
