"""Drape the blank of a scene: choose surface, seed and lines, lay the net, place the mesh on it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from lcmchain.draping.lines import fibre_coordinates, net_lines, places_between
from lcmchain.draping.net import (
    ACCURACY,
    LOCKED,
    PLACED,
    UNREACHED,
    lay_net,
    project_all,
    unit_normal,
)
from lcmchain.draping.surface import (
    ASKER,
    DrapedSurface,
    draped_surface,
    level,
    stroke_direction,
    surface_in_words,
    touching_tool,
)
from lcmchain.errors import InputError, SimulationError
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.fibres import shear_angles
from lcmchain.mesh.mid_surface import MidSurfaceMesh
from lcmchain.quantities.places import millimetres
from lcmchain.scene import Scene
from lcmchain.tools.distance import gaps
from lcmchain.tools.table import ToolTable, build_tool_table

#: Shear angle at which bars count as lying on each other [rad].
FOLDED = math.radians(89.0)
#: Shear angle that is reported as locking where neither scene nor material gives one [rad].
USUAL_LOCKING = math.radians(60.0)
#: Nodes whose distance from a tool is the least one up to this part of the thickness touch first.
FIRST_TOUCH = 1e-3
#: Relative difference of distances that are the same but for rounding.
SAME_DISTANCE = 1e-9
#: Parts of the blank's size that the way from the seed to the surface is looked for.
LONGEST_WAY = 20.0
#: Steps of that search, and where it ends [parts of the edge length].
MOST_WAYPOINTS = 2000
ARRIVED = 1e-6


@dataclass(frozen=True)
class Draped:
    """A draped blank.

    mesh : undeformed mid-surface.
    positions : of its nodes [m] (node_count, 3), nan without a place.
    surface : what it lies on, in words. seed : material point of the flat blank [m] (2,).
    place : of the seed [m] (3,).
    net_places : of the net [m] (U, V, 3); net_status : what became of its nodes (U, V);
    net_lengths : of the bars along fibre 1 (U - 1,) and 2 (V - 1,) [m].
    tools : of the scene. locking_angle : above which the net counts as locked [rad].
    wall_s : time of laying the net and placing the mesh on it [s].
    """

    mesh: MidSurfaceMesh
    positions: np.ndarray
    surface: str
    seed: np.ndarray
    place: np.ndarray
    net_places: np.ndarray
    net_status: np.ndarray
    net_lengths: tuple[np.ndarray, np.ndarray]
    tools: ToolTable
    locking_angle: float
    wall_s: float

    @property
    def shear_angle(self) -> np.ndarray:
        """Shear angle of every face (element_count,) [rad]; nan where it has no place."""
        return shear_angles(self.mesh, self.positions)

    @property
    def is_whole(self) -> bool:
        """Whether every node of the blank has a place."""
        return bool(np.isfinite(self.positions).all())

    def largest_shear(self) -> tuple[float, np.ndarray, np.ndarray]:
        """Return the largest magnitude [rad], where it lies [m] (3,), and where in the blank."""
        shear = np.nan_to_num(np.abs(self.shear_angle), nan=-1.0)
        worst = int(np.argmax(shear))
        corners = np.unique(self.mesh.elements[worst])
        return (
            float(shear[worst]),
            self.positions[corners].mean(axis=0),
            self.mesh.node_positions[corners].mean(axis=0),
        )

    def unplaced_part(self) -> float:
        """Part of the blank's area that the net does not reach."""
        areas = self.mesh.element_areas
        return float(areas[~np.isfinite(self.shear_angle)].sum() / areas.sum())

    def locked_part(self) -> float:
        """Part of the blank's area that is sheared beyond the locking angle, or has no place."""
        shear = np.nan_to_num(np.abs(self.shear_angle), nan=math.pi)
        areas = self.mesh.element_areas
        return float(areas[shear > self.locking_angle].sum() / areas.sum())

    def missing(self) -> str | None:
        """Say where the net ended and why; None where every node has a place."""
        if self.is_whole:
            return None
        absent = ~np.isfinite(self.positions).all(axis=1)
        first = self.mesh.node_positions[absent][:, :2] - self.seed
        nearest = self.mesh.node_positions[absent][np.argmin(np.linalg.norm(first, axis=1))]
        ended = self.net_status[(self.net_status != PLACED) & (self.net_status != UNREACHED)]
        locked = bool((ended == LOCKED).any()) and float((ended == LOCKED).mean()) >= 0.5
        why = (
            f"its bars lie on each other there (more than {math.degrees(FOLDED):.0f} deg of shear)"
            if locked
            else "no place on the surface is a bar away from both neighbours"
        )
        return (
            f"the net of {self.surface} ends at the point {millimetres(nearest, 1)} of the flat "
            f"blank: {why}; {int(absent.sum()):,} of {self.mesh.node_count:,} nodes have no place"
        )

    def require_whole(self) -> None:
        """Refuse a net that could not be laid to its end.

        Raises
        ------
        SimulationError : some nodes have no place; says where and why.
        """
        missing = self.missing()
        if missing is not None:
            raise SimulationError(
                f"{missing}. Use a smaller blank or another draping.seed, a larger "
                "draping.edge_radius or smaller blank.edge_length where the surface has an edge, "
                "or a model with forces (element)"
            )


def drape(
    scene: Scene, *, tools: ToolTable | None = None, blank: BlankMesh | None = None
) -> Draped:
    """Drape the blank of a scene onto its surface.

    Parameters
    ----------
    scene : its ``[draping]``, ``[blank]`` and tools are used; loads, friction and law are not.
    tools, blank : of the scene, where they are built already.

    Raises
    ------
    InputError : there is no surface, or the seed has no place on it.
    """
    ply = scene.only_ply(ASKER)
    if blank is None:
        blank = ply.build_blank()
    if tools is None:
        tools = build_tool_table(
            scene.tools, scene.source.directory, scene.process.time, blank=blank.node_positions
        )
    surface = draped_surface(scene, tools, blank.mid_surface_positions)
    start = time.perf_counter()
    seed = _seed(scene, blank, tools)
    place = _place(scene, surface, tools, seed)
    side, direction_1, direction_2 = _frame(scene, surface, blank, place)
    edge_length = ply.blank.edge_length
    coordinates = fibre_coordinates(blank, seed)
    lines = net_lines(blank, coordinates, edge_length)
    accuracy = ACCURACY * edge_length
    places, status = lay_net(
        surface, side, tuple(place), tuple(direction_1), tuple(direction_2), lines.u, lines.v,
        lines.i0, lines.j0, math.cos(FOLDED), accuracy,
    )  # fmt: skip
    positions, between = places_between(lines, places, coordinates, edge_length)
    inside = positions[between]
    project_all(surface, inside, accuracy)
    positions[between] = inside
    return Draped(
        mesh=MidSurfaceMesh.of_blank(blank),
        positions=positions,
        surface=surface_in_words(scene, surface),
        seed=seed,
        place=place,
        net_places=places,
        net_status=status,
        net_lengths=(np.diff(lines.u), np.diff(lines.v)),
        tools=tools,
        locking_angle=_locking_angle(scene),
        wall_s=time.perf_counter() - start,
    )


def _locking_angle(scene: Scene) -> float:
    if scene.draping.locking_angle is not None:
        return scene.draping.locking_angle
    membrane = getattr(scene.only_ply(ASKER).material, "membrane", None)
    return getattr(membrane, "locking_angle", None) or USUAL_LOCKING


def _seed(scene: Scene, blank: BlankMesh, tools: ToolTable) -> np.ndarray:
    """Return the material point [m] (2,) where the net begins."""
    if scene.draping.seed is not None:
        return np.array(scene.draping.seed)
    nodes = blank.mid_surface_positions
    tool = touching_tool(scene, tools)
    if tool is None:
        return 0.5 * (nodes.min(axis=0) + nodes.max(axis=0))[:2]
    distance = gaps(tools, tool, np.ascontiguousarray(nodes), 0.0)
    least = distance.min() + FIRST_TOUCH * scene.only_ply(ASKER).thickness
    first = nodes[distance < least]
    middle = first.mean(axis=0)
    if gaps(tools, tool, middle[None], 0.0)[0] < least:
        return middle[:2]
    return _nearest(first, middle)[:2]


def _nearest(nodes: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the node nearest to a point; of several as near, the first by number."""
    away = np.linalg.norm(nodes - point, axis=1)
    # rounding must not choose between places that a symmetric tool touches at once
    return nodes[np.argmax(away <= away.min() * (1.0 + SAME_DISTANCE))]


def _place(scene: Scene, surface: DrapedSurface, tools: ToolTable, seed: np.ndarray) -> np.ndarray:
    """Return the place of the seed on the surface [m] (3,)."""
    accuracy = ACCURACY * scene.only_ply(ASKER).blank.edge_length
    if scene.draping.place is not None:
        point = np.array([scene.draping.place])
        project_all(surface, point, accuracy)
        if not np.isfinite(point).all():
            raise InputError(
                "has no nearest point of the surface; give a place nearer to it",
                key="draping.place",
            )
        return point[0]
    start = np.append(seed, scene.only_ply(ASKER).blank.height)
    ahead = stroke_direction(scene, tools)
    for direction in (ahead, -ahead):
        point = _along(surface, start, direction, scene)[None]
        project_all(surface, point, accuracy)
        if np.isfinite(point).all():
            return point[0]
    raise InputError(
        f"{millimetres(start, 1)} of the flat blank has no place on the surface along the stroke; "
        "give another seed, or draping.place",
        key="draping.seed",
    )


def _along(
    surface: DrapedSurface, start: np.ndarray, direction: np.ndarray, scene: Scene
) -> np.ndarray:
    """Return where a ray first meets the surface, or nan; steps are as long as the distance."""

    def level_at(way: float) -> float:
        return level(surface, *(start + way * direction))[0]

    way, found = 0.0, level_at(0.0)
    blank = scene.only_ply(ASKER).blank
    longest = LONGEST_WAY * max(blank.extent) + abs(surface.travel)
    for _ in range(MOST_WAYPOINTS):
        if abs(found) < ARRIVED * blank.edge_length:
            return start + way * direction
        step = abs(found)
        ahead = level_at(way + step)
        if ahead * found < 0.0:  # rounded edges make the level longer than the distance
            return start + brentq(level_at, way, way + step) * direction
        way, found = way + step, ahead
        if way > longest:
            break
    return np.full(3, np.nan)


def _frame(
    scene: Scene, surface: DrapedSurface, blank: BlankMesh, place: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the side of the sheet's upper face, and both fibre directions at the seed.

    Fibre 1 keeps its direction as far as the tangent plane has it; fibre 2 is perpendicular.
    """
    gradient = np.array(unit_normal(surface, 1.0, tuple(place)))
    side = -1.0 if gradient[2] < 0.0 else 1.0
    normal = side * gradient
    fibre = blank.fibre_direction_1[0]
    tangent = fibre - (fibre @ normal) * normal
    size = np.linalg.norm(tangent)
    if size < 1e-6 or not normal.any():
        raise InputError(
            f"the surface at {millimetres(place, 1)} is perpendicular to fibre 1: its direction is "
            "not known there; give another seed",
            key="draping.seed",
        )
    tangent /= size
    across = np.cross(normal, tangent)
    cosine, sine = math.cos(scene.draping.angle), math.sin(scene.draping.angle)
    return side, cosine * tangent + sine * across, cosine * across - sine * tangent
