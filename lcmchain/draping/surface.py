"""The surface that a draped net lies on, as the zero level of a function of space.

One tool alone: its surface, half the thickness off on its free side. A punch and the plane of the
blank: what the punch has pushed in at the end of its stroke, the plane elsewhere, and a rounded
edge between them. With d the distance from the punch less half the thickness, and b the distance
from the plane on the side that the punch moves to, the solid above the sheet is the union of both,
and its surface is the zero level of min(d, b). The edge is rounded with the radius ρ by

    F = max(ρ, min(d, b)) - sqrt(u² + v²),  u = max(ρ - d, 0),  v = max(ρ - b, 0),

a circular arc where wall and plane are perpendicular. F is continuous with its gradient near its
zero level.

Behind the skin of a punch whose surface is open there is solid for some spacings of its distance
field alone, and free space farther on. What the skin has passed is solid for the sheet: heights of
the skin over the plane of the blank tell it (:class:`PassedColumns`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.jit import equation, routine
from lcmchain.scene import Scene
from lcmchain.tools.distance import FIELD, PLANE, gaps, signed_distance
from lcmchain.tools.motion import PRESCRIBED, prescribed_travel
from lcmchain.tools.motion.base import TABULATED
from lcmchain.tools.table import ToolTable, turning, yields

#: Who asks for the one sheet of a scene.
ASKER = "kinematic draping"
#: Distances from a surface mesh are exact up to so many spacings of its distance field.
EXACT_SPACINGS = 3.0
#: Gradient [1] below which a level has no direction.
NO_GRADIENT = 1e-12
#: Columns are a spacing of the distance field apart: a place that is farther than so many from a
#: surface lies on the same side of it as the nearest column.
BESIDE_COLUMN = 2.0


class ToolShapes(NamedTuple):
    """The columns of a :class:`lcmchain.tools.table.ToolTable` that a distance is read from.

    Half of the table: compiled code takes every column along, and compiles in less time.
    """

    kind: np.ndarray
    origin: np.ndarray
    rotation: np.ndarray
    aligned: np.ndarray
    direction: np.ndarray
    turn_axis: np.ndarray | None
    turn_point: np.ndarray | None
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

    @classmethod
    def of(cls, tools: ToolTable) -> ToolShapes:
        """Return these columns of a table."""
        return cls(*(getattr(tools, name) for name in cls._fields))


class PassedColumns(NamedTuple):
    """Where an open skin has passed the blank: behind it is solid, whatever its distance tells.

    heights : z of the skin over a grid of places [m], (n_x, n_y); not a number where it is not.
    x, y : of the first place [m]. spacing : of the places [m].
    """

    heights: np.ndarray
    x: float
    y: float
    spacing: float


#: Of a tool that is solid behind its surface.
NOTHING_PASSED = PassedColumns(np.empty((0, 0)), 0.0, 0.0, 1.0)


class DrapedSurface(NamedTuple):
    """The surface of a net, as compiled code reads it.

    tools : shapes of the scene's tools; tool, travel : which of them, and its travel [m].
    offset : of the mid-surface from the tool [m].
    has_plane : whether the plane of the blank belongs to it.
    plane_height : z of that plane [m]; plane_side : 1 where the punch moves towards +z, else -1.
    edge_radius : of the edge between them [m].
    passed : what an open skin has passed; nothing of a tool that is solid behind its surface.
    """

    tools: ToolShapes
    tool: int
    travel: float
    offset: float
    has_plane: bool
    plane_height: float
    plane_side: float
    edge_radius: float
    passed: PassedColumns = NOTHING_PASSED


@equation
def with_solid_behind(passed, side, d, gx, gy, gz, x, y, z):
    """Return distance and normal of an open skin, with solid behind it as far as it has passed.

    Parameters
    ----------
    passed : columns of the skin. side : 1 where the skin moves towards +z, else -1.
    d, gx, gy, gz : distance [m] and normal, as :func:`signed_distance` has them.
    x, y, z : place [m].
    """
    # the fringe of the solid behind a skin has the distance 0, free space farther on more
    if d == 0.0 or d > BESIDE_COLUMN * passed.spacing:
        i = int(math.floor((x - passed.x) / passed.spacing + 0.5))
        j = int(math.floor((y - passed.y) / passed.spacing + 0.5))
        n_x, n_y = passed.heights.shape
        if i >= 0 and j >= 0 and i < n_x and j < n_y:
            if side * (z - passed.heights[i, j]) < 0.0:
                return -EXACT_SPACINGS * passed.spacing, 0.0, 0.0, side
    return d, gx, gy, gz


@routine
def level(surface, x, y, z):
    """Return the level F [m] at a point [m], and its gradient; positive on the free side."""
    side = surface.plane_side
    d, gx, gy, gz = signed_distance(surface.tools, surface.tool, x, y, z, surface.travel)
    d, gx, gy, gz = with_solid_behind(surface.passed, side, d, gx, gy, gz, x, y, z)
    d -= surface.offset
    if not surface.has_plane:
        return d, gx, gy, gz
    b = side * (z - surface.plane_height)
    radius = surface.edge_radius
    u, v = max(radius - d, 0.0), max(radius - b, 0.0)
    length = math.sqrt(u * u + v * v)
    if length == 0.0:
        if d < b:
            return d, gx, gy, gz
        return b, 0.0, 0.0, side
    if radius == 0.0 and d < 0.0 and b < 0.0:  # inside of both the nearer surface counts
        if d < b:
            return d, gx, gy, gz
        return b, 0.0, 0.0, side
    # here one of them is nearer than the radius, and max(radius, min(d, b)) is the radius
    u /= length
    v /= length
    return radius - length, u * gx, u * gy, u * gz + v * side


def is_drapable(scene: Scene, tools: ToolTable) -> bool:
    """Tell whether a scene has a surface to drape: one that it names, or a stroke of a shape."""
    if scene.draping.surface is not None:
        return True
    return _largest_stroke(tools, scene.process.time, flat=False) is not None


def draped_surface(scene: Scene, tools: ToolTable, nodes: np.ndarray) -> DrapedSurface:
    """Return the surface that a scene's ``[draping]`` names, or that of its largest stroke.

    A tool that returns counts where it was farthest; one that is named, where it ends.

    Parameters
    ----------
    nodes : of the mid-surface of the flat blank [m], (node_count, 3).

    Raises
    ------
    InputError : there is no such tool, nothing moves, or the travel of the tool is not given.
    """
    time = scene.process.time
    ply = scene.only_ply(ASKER)
    offset = 0.5 * ply.thickness
    shapes = ToolShapes.of(tools)
    name = scene.draping.surface
    if name is not None:
        tool = _tool_named(scene, name)
        if yields(tools)[tool]:
            raise InputError(
                f'"{name}" moves under a load, or until a force stops it, so that its place '
                "at the end is not known before a simulation; name a tool that is fixed or has a "
                "stroke",
                key="draping.surface",
            )
        return DrapedSurface(
            shapes, tool, end_travel(tools, tool, time), offset, False, 0.0, 1.0, 0.0
        )
    tool_or_none = _largest_stroke(tools, time, flat=False)
    if tool_or_none is None:
        raise InputError(
            "is missing, and no shaped tool has a stroke: name the tool that the sheet ends on, "
            'as in surface = "die"',
            key="draping.surface",
        )
    tool = tool_or_none
    side = float(np.sign(_farthest_place(tools, tool, time)[2]))
    if side == 0.0:
        raise InputError(
            f'is missing, and the stroke of "{scene.tools[tool].name}" lies in the plane of the '
            "blank; name the tool that the sheet ends on",
            key="draping.surface",
        )
    travel = farthest_travel(tools, tool, time)
    if _is_open_mould(tools, tool, travel, nodes, side, ply.thickness):
        return DrapedSurface(shapes, tool, travel, offset, False, 0.0, 1.0, 0.0)
    return DrapedSurface(
        shapes, tool, travel, offset, True, ply.blank.height, side,
        _edge_radius(scene, tools, tool),
        _passed_columns(tools, tool, travel, nodes, side),
    )  # fmt: skip


def _is_open_mould(
    tools: ToolTable, tool: int, travel: float, nodes: np.ndarray, side: float, thickness: float
) -> bool:
    """Tell whether a tool has an open surface that has passed all of the blank.

    Then no plane of the blank is left around it, and its distance cannot tell that: behind an open
    surface there is no solid, so that the plane, far behind it, seems free.
    """
    if tools.kind[tool] != FIELD:
        return False
    behind = gaps(tools, tool, np.ascontiguousarray(nodes), travel) > 0.0
    if not behind.any():
        return False
    passed = np.zeros(len(nodes), dtype=bool)
    before = np.full(len(nodes), np.nan)
    # from a little behind the plane, for the crest of a mould, to the end of the stroke
    for way in np.arange(-2.0 * thickness, abs(travel) + 2.0 * thickness, thickness):
        places = nodes + [0.0, 0.0, side * way]
        distance = gaps(tools, tool, np.ascontiguousarray(places), travel)
        passed |= before * distance <= 0.0
        before = distance
    return bool(passed.all())


def _passed_columns(
    tools: ToolTable, tool: int, travel: float, nodes: np.ndarray, side: float
) -> PassedColumns:
    """Return where an open skin has passed the blank; nothing if its distance says so itself."""
    if tools.kind[tool] != FIELD:
        return NOTHING_PASSED
    spacing = float(tools.spacing[tool])
    (x_low, y_low, height), (x_high, y_high, _) = nodes.min(axis=0), nodes.max(axis=0)
    x = np.arange(x_low, x_high + spacing, spacing)
    y = np.arange(y_low, y_high + spacing, spacing)
    heights = np.full(x.size * y.size, np.nan)
    places = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((x.size, y.size), height)], -1)
    places = np.ascontiguousarray(places.reshape(-1, 3))
    before = gaps(tools, tool, places, travel)
    free_in_plane = before >= 0.0
    columns = np.arange(heights.size)
    end = height + side * (abs(travel) + spacing)
    while columns.size:
        # the gap is at most the distance: no step goes past the skin and its solid
        step = np.maximum(np.abs(before), spacing)
        places[:, 2] += side * step
        distance = gaps(tools, tool, places, travel)
        left = (before < 0.0) & (distance >= 0.0)
        share = before[left] / (before[left] - distance[left])
        heights[columns[left]] = places[left, 2] - side * (1.0 - share) * step[left]
        on = side * (end - places[:, 2]) > 0.0
        columns, places, before = columns[on], np.ascontiguousarray(places[on]), distance[on]
    if not (free_in_plane & np.isfinite(heights)).any():
        return NOTHING_PASSED
    return PassedColumns(heights.reshape(x.size, y.size), float(x_low), float(y_low), spacing)


def surface_in_words(scene: Scene, surface: DrapedSurface) -> str:
    """Say which surface a net lies on."""
    name = scene.tools[surface.tool].name
    at = f" at a travel of {1e3 * surface.travel:.4g} mm" if surface.travel else ""
    if not surface.has_plane:
        return f"{name}{at}"
    return (
        f"{name}{at}, and the plane of the blank around it, with an edge of "
        f"{1e3 * surface.edge_radius:.4g} mm radius"
    )


def stroke_direction(scene: Scene, tools: ToolTable) -> np.ndarray:
    """Return the unit direction of the largest stroke [3], and -z where nothing has a stroke."""
    tool = _largest_stroke(tools, scene.process.time, flat=True)
    if tool is None:
        return np.array([0.0, 0.0, -1.0])
    way = _farthest_place(tools, tool, scene.process.time)
    return way / np.linalg.norm(way)


def touching_tool(scene: Scene, tools: ToolTable) -> int | None:
    """Return the tool that comes to the blank: that of the largest stroke of a shape, or None."""
    return _largest_stroke(tools, scene.process.time, flat=False)


def _largest_stroke(tools: ToolTable, time: float, *, flat: bool) -> int | None:
    """Return the tool that goes farthest up to a time [s]; planes count only if ``flat``."""
    ways = [
        abs(farthest_travel(tools, tool, time))
        if (flat or tools.kind[tool] != PLANE) and not turns
        else 0.0
        for tool, turns in enumerate(turning(tools))
    ]
    if not ways or max(ways) == 0.0:
        return None
    return int(np.argmax(ways))


def end_travel(tools: ToolTable, tool: int, time: float) -> float:
    """Return the prescribed travel of a tool at a time [m]; 0 where it has none."""
    if tools.motion_kind[tool] != PRESCRIBED:
        return 0.0
    return float(prescribed_travel(tools, tool, time)[0])


def farthest_travel(tools: ToolTable, tool: int, time: float) -> float:
    """Return the prescribed travel of a tool where it is farthest from its start [m], up to a time.

    A punch that is drawn back has formed the sheet where it turned, not where it comes to rest.
    """
    times = [time]
    if tools.stroke_profile[tool] == TABULATED:
        first, end = tools.table_start[tool], tools.table_start[tool + 1]
        times += [moment for moment in tools.table_times[first:end] if moment < time]
    travels = [end_travel(tools, tool, moment) for moment in times]
    return max(travels, key=abs)


def _farthest_place(tools: ToolTable, tool: int, time: float) -> np.ndarray:
    return farthest_travel(tools, tool, time) * tools.direction[tool]


def _edge_radius(scene: Scene, tools: ToolTable, tool: int) -> float:
    """Return the radius of the edge between a punch and the plane [m]."""
    radius = scene.draping.edge_radius
    ply = scene.only_ply(ASKER)
    half = 0.5 * ply.thickness
    if radius is None:
        fillet = max((getattr(tool.shape, "fillet_radius", 0.0) for tool in scene.tools), default=0)
        radius = fillet + half if fillet > 0.0 else ply.blank.edge_length
    if tools.kind[tool] == FIELD:
        # farther from a surface mesh only a bound of the distance is known
        exact = EXACT_SPACINGS * float(tools.spacing[tool]) - half
        radius = min(radius, max(exact, 0.0))
    return radius


def _tool_named(scene: Scene, name: str) -> int:
    names = [tool.name for tool in scene.tools]
    if name not in names:
        there = f"there are {', '.join(names)}" if names else "the scene has no tools"
        raise InputError(f'there is no tool "{name}"; {there}', key="draping.surface")
    return names.index(name)
