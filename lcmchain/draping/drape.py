"""Drape the blank of a scene: choose surface, seed and lines, lay the net, place the mesh on it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from lcmchain.draping.courses import lay_courses
from lcmchain.draping.laid import LaidNet, joined, lay
from lcmchain.draping.net import LOCKED, PLACED, UNREACHED
from lcmchain.draping.start import start_of
from lcmchain.draping.surface import (
    ASKER,
    draped_surface,
    surface_in_words,
)
from lcmchain.errors import SimulationError
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.mid_surface import MidSurfaceMesh
from lcmchain.mesh.sheet_mesh import shear_angles
from lcmchain.quantities.readable import millimetres
from lcmchain.scene import Scene
from lcmchain.scene.draping import FOLDED, courses_to_lay
from lcmchain.tools.table import ToolTable, build_tool_table

#: Shear angle that is reported as locking where neither scene nor material gives one [rad].
USUAL_LOCKING = math.radians(60.0)


@dataclass(frozen=True)
class Draped:
    """A draped blank: one net, or one of each course of the ply.

    nets : in the order of the courses.
    mesh : undeformed mid-surface, that of all nets as one, without common nodes.
    positions : of its nodes [m] (node_count, 3), nan without a place.
    surface : what it lies on, in words. seed : material point of the flat blank [m] (2,).
    place : of the seed [m] (3,). of several courses, both are what they are reckoned from.
    tools : of the scene. locking_angle : above which the net counts as locked [rad].
    wall_s : time of laying the net and placing the mesh on it [s].
    """

    nets: tuple[LaidNet, ...]
    mesh: MidSurfaceMesh
    positions: np.ndarray
    surface: str
    seed: np.ndarray
    place: np.ndarray
    tools: ToolTable
    locking_angle: float
    wall_s: float

    @property
    def courses(self) -> tuple[LaidNet, ...]:
        """The nets of the courses; empty where the ply is one piece."""
        return self.nets if self.nets[0].strip is not None else ()

    @property
    def course_of_face(self) -> np.ndarray:
        """Number of the net that each face belongs to, from 0 (element_count,)."""
        counts = [net.mesh.element_count for net in self.nets]
        return np.repeat(np.arange(len(self.nets)), counts)

    @property
    def net_places(self) -> np.ndarray:
        """Places of the first net [m] (U, V, 3)."""
        return self.nets[0].net_places

    @property
    def net_status(self) -> np.ndarray:
        """What became of the nodes of the first net (U, V)."""
        return self.nets[0].net_status

    @property
    def net_lengths(self) -> tuple[np.ndarray, np.ndarray]:
        """Lengths of the bars of the first net along fibre 1 (U - 1,) and 2 (V - 1,) [m]."""
        return self.nets[0].net_lengths

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
        net = next(net for net in self.nets if not np.isfinite(net.positions).all())
        absent = ~np.isfinite(net.positions).all(axis=1)
        first = net.mesh.node_positions[absent][:, :2] - net.start.seed
        nearest = net.mesh.node_positions[absent][np.argmin(np.linalg.norm(first, axis=1))]
        ended = net.net_status[(net.net_status != PLACED) & (net.net_status != UNREACHED)]
        locked = bool((ended == LOCKED).any()) and float((ended == LOCKED).mean()) >= 0.5
        why = (
            f"its bars lie on each other there (more than {math.degrees(FOLDED):.0f} deg of shear)"
            if locked
            else "no place on the surface is a bar away from both neighbours"
        )
        of_course = "" if net.strip is None else f'course "{net.name}", '
        return (
            f"{of_course}the net of {self.surface} ends at the point {millimetres(nearest, 1)} of "
            f"the flat blank: {why}; {int(absent.sum()):,} of {net.mesh.node_count:,} nodes have "
            "no place"
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
    begin = start_of(scene, surface, blank, tools)
    if courses_to_lay(scene.draping, scene.stack):
        nets = lay_courses(scene, surface, begin)
    else:
        nets = (lay(surface, blank, begin, ply.blank.edge_length, ply.name),)
    return Draped(
        nets=nets,
        mesh=joined([net.mesh for net in nets]),
        positions=np.concatenate([net.positions for net in nets]),
        surface=surface_in_words(scene, surface),
        seed=begin.seed,
        place=begin.place,
        tools=tools,
        locking_angle=_locking_angle(scene),
        wall_s=time.perf_counter() - start,
    )


def _locking_angle(scene: Scene) -> float:
    if scene.draping.locking_angle is not None:
        return scene.draping.locking_angle
    membrane = getattr(scene.only_ply(ASKER).material, "membrane", None)
    return getattr(membrane, "locking_angle", None) or USUAL_LOCKING
