"""Distances between tools and blank before anything moves.

The smallest gap is that over the whole surface of the blank, not only at nodes. A signed distance
changes by no more than the way: an element face whose corners are farther than the smallest gap
found, by more than its size, need not be looked at. On the others the distance is sampled, and the
smallest sample followed downhill.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from lcmchain.errors import InputError
from lcmchain.mesh.blank import BlankMesh
from lcmchain.scene import Scene, Tool
from lcmchain.scene.stack import PlySettings
from lcmchain.scene.stages import at_work, stack_at
from lcmchain.tools.distance import gaps as node_gaps
from lcmchain.tools.surfaces.surface import Surface, ToolWarning
from lcmchain.tools.surfaces.triangle_distance import ExactDistance
from lcmchain.tools.table import OVERLAP_TOLERANCE, ToolTable, in_frame_of

# --- smallest gap between a tool and a flat blank -------------------------------------------------


#: Samples along each side of a face, and halvings of their spacing on the way downhill.
SAMPLES = 5
HALVINGS = 12
#: No place of a triangle is farther from its corners than this part of its longest side.
FARTHEST = 0.58

Distance = Callable[[np.ndarray], np.ndarray]


def smallest_gap(
    distance: Distance,
    blank: BlankMesh,
    vertices: np.ndarray | None = None,
    offset: float = 0.0,
) -> tuple[float, np.ndarray]:
    """Return the smallest signed distance [m] of the blank to a tool, and its place [m].

    Parameters
    ----------
    distance : exact signed distances [m] of points [m], shape [point_count, 3], to the tool.
    vertices : of a tool's surface mesh [m], shape [vertex_count, 3]: sharp ones may reach between
        all samples.
    offset : 0 for the faces of the blank; else the distance is that to its mid-surface less this
        [m], and the place lies there.
    """
    nodes = blank.mid_surface_positions if offset else blank.node_positions
    at_nodes = distance(nodes)
    gap, place = _least(at_nodes, nodes)
    both = np.concatenate([blank.elements[:, :4], blank.elements[:, 4:]])
    faces = blank.faces if offset else both
    found = _over_faces(distance, nodes[faces], at_nodes[faces].min(axis=1), gap)
    candidates = [(gap, place), found]
    if vertices is not None:
        candidates.append(_at_vertices(vertices, nodes, blank, min(gap, found[0])))
    gap, place = min(candidates, key=lambda candidate: candidate[0])
    return gap - offset, place


def _least(gaps: np.ndarray, places: np.ndarray) -> tuple[float, np.ndarray]:
    first = int(np.argmin(gaps))
    return float(gaps[first]), places[first]


def _over_faces(
    distance: Distance, corners: np.ndarray, at_corners: np.ndarray, gap: float
) -> tuple[float, np.ndarray]:
    """Least distance over faces with corners [face_count, 4, 3] that can beat a gap [m]."""
    sides = corners[:, :, None] - corners[:, None]
    reach = FARTHEST * np.linalg.norm(sides, axis=3).max(axis=(1, 2))
    near = at_corners - reach < gap
    corners, reach = corners[near], reach[near]
    if len(corners) == 0:
        return np.inf, np.zeros(3)

    def at(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        weights = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=-1)
        return np.einsum("fk,fki->fi", weights, corners)

    best = np.full(len(corners), np.inf)
    s, t = np.zeros(len(corners)), np.zeros(len(corners))
    steps = np.linspace(0.0, 1.0, SAMPLES)
    for new_s, new_t in np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2):
        new_s, new_t = np.full(len(corners), new_s), np.full(len(corners), new_t)
        best, s, t = _better(distance(at(new_s, new_t)), best, new_s, new_t, s, t)
    step = 1.0 / (SAMPLES - 1)
    for _ in range(HALVINGS):
        step *= 0.5
        for along, across in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)):
            new_s = np.clip(s + step * along, 0.0, 1.0)
            new_t = np.clip(t + step * across, 0.0, 1.0)
            best, s, t = _better(distance(at(new_s, new_t)), best, new_s, new_t, s, t)
    return _least(best, at(s, t))


def _better(found, best, new_s, new_t, s, t):
    better = found < best
    return (
        np.where(better, found, best),
        np.where(better, new_s, s),
        np.where(better, new_t, t),
    )


def _at_vertices(
    vertices: np.ndarray, nodes: np.ndarray, blank: BlankMesh, gap: float
) -> tuple[float, np.ndarray]:
    """Least distance of vertices over or under the blank to its faces; negative between them.

    nodes : of both faces, or of the mid-surface.
    """
    bottom, top = nodes[:, 2].min(), nodes[:, 2].max()
    height = np.maximum(vertices[:, 2] - top, bottom - vertices[:, 2])
    near = height < gap
    vertices, height = vertices[near], height[near]
    faces = shapely.polygons(blank.mid_surface_positions[blank.faces][:, :, :2])
    over = shapely.STRtree(faces).query(shapely.points(vertices[:, :2]), predicate="intersects")[0]
    if len(over) == 0:
        return np.inf, np.zeros(3)
    gap, place = _least(height[over], vertices[over])
    return gap, np.append(place[:2], np.clip(place[2], bottom, top))


# --- gaps and overlaps at the start ---------------------------------------------------------------


@dataclass(frozen=True)
class InitialGap:
    """Smallest distance between a tool and the blank before anything moves.

    Parameters
    ----------
    tool : name of the tool.
    gap : signed distance of the blank [m], negative inside the tool: of the nearest place of its
        faces, or of its mid-surface less half the thickness.
    position : that place [m].
    at_nodes : smallest gap of the nodes that the solver sees [m]; it interpolates in the distance
        field of a surface mesh.
    surface : triangles of the tool, None for an analytic shape.
    """

    tool: str
    gap: float
    position: tuple[float, float, float]
    at_nodes: float
    surface: Surface | None = None


def contact_offset(ply: PlySettings) -> float:
    """Return how far the sheet's surface lies from the nodes that the tools meet [m].

    Elements without a thickness have nodes on the mid-surface, and contact keeps these half the
    thickness away, along the normal of the tool: farther than the faces on a slope.
    """
    return 0.0 if ply.element.has_thickness else 0.5 * ply.thickness


def plies_at_start(
    scene: Scene, blanks: Sequence[BlankMesh]
) -> list[tuple[BlankMesh, PlySettings]]:
    """Return those of the plies of a scene, with their blanks, that are there at the start."""
    first = {ply.name for ply in stack_at(scene, 0.0)}
    both = zip(blanks, scene.stack, strict=True)
    return [(blank, ply) for blank, ply in both if ply.name in first]


def gaps_of_stack(
    scene: Scene, blanks: Sequence[BlankMesh], tool_table: ToolTable
) -> list[InitialGap]:
    """Measure the smallest distance of every tool to any ply of a scene that is there at the start.

    blanks : of the plies, as :meth:`lcmchain.scene.stack.PlySettings.build_blank` makes them.
    """
    sheets = [(blank, contact_offset(ply)) for blank, ply in plies_at_start(scene, blanks)]
    return gaps_of_sheets(scene.tools, sheets, tool_table, scene.source.directory)


def gaps_of_sheets(
    tools: Sequence[Tool],
    sheets: Sequence[tuple[BlankMesh, float]],
    tool_table: ToolTable,
    directory: Path,
) -> list[InitialGap]:
    """Measure the smallest distance of every tool to any of some sheets before anything moves.

    Exact for analytic shapes and for the triangles of surface meshes, whatever their fields round.

    sheets : meshes of the sheets, and 0 for the distance to their faces; else the part of that to
        the mid-surface [m] which belongs to the sheet, see :func:`contact_offset`.
    directory : folder of the scene file, to which mesh files are relative.
    """
    return [_initial_gap(t, tool, sheets, tool_table, directory) for t, tool in enumerate(tools)]


def _initial_gap(
    index: int,
    tool: Tool,
    sheets: Sequence[tuple[BlankMesh, float]],
    table: ToolTable,
    directory: Path,
) -> InitialGap:
    def in_field(points: np.ndarray) -> np.ndarray:
        return node_gaps(table, index, np.ascontiguousarray(points, dtype=np.float64), 0.0)

    axes = tool.local_axes(key=f'tools[{index}] "{tool.name}".axis')
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToolWarning)  # said when the table was built
        every_node = np.concatenate([blank.node_positions for blank, _ in sheets])
    surface = tool.shape.surface_mesh(directory, in_frame_of(tool, axes, every_node))
    distance: Distance = in_field
    vertices = None
    if surface is not None:
        exact = ExactDistance(surface)
        vertices = np.array(tool.position) + exact.vertices @ axes
        spacing = float(table.spacing[index])

        def distance(points: np.ndarray) -> np.ndarray:
            return exact(in_frame_of(tool, axes, points), in_field(points), spacing)

    least_gaps = [smallest_gap(distance, blank, vertices, offset) for blank, offset in sheets]
    gap, place = min(least_gaps, key=lambda least: least[0])
    at_nodes = min(
        float(in_field(blank.mid_surface_positions if offset else blank.node_positions).min())
        - offset
        for blank, offset in sheets
    )
    return InitialGap(tool.name, gap, tuple(place.tolist()), at_nodes, surface)


def require_no_initial_overlap(
    scene: Scene, tool_table: ToolTable, blanks: Sequence[BlankMesh] | None = None
) -> list[InitialGap]:
    """Stop when a tool reaches into the blank at the start, deeper than 1 % of the thickness.

    Such a tool would push the blank away with a jump of contact force that no process has.

    Parameters
    ----------
    scene : validated scene.
    tool_table : its tools, in the order of ``scene.tools``.
    blanks : of its plies, with thickness, where they are built already.

    Returns
    -------
    The smallest gap of every tool.

    Raises
    ------
    InputError : names every tool that overlaps, the depth and the place.
    """
    if blanks is None:
        blanks = [ply.build_blank() for ply in scene.stack]
    gaps = gaps_of_stack(scene, blanks, tool_table)
    require_gaps(gaps, scene)
    return gaps


def overlapping(gaps: Sequence[InitialGap], scene: Scene) -> list[InitialGap]:
    """Return the gaps of the tools that reach into the blank deeper than counts as a touch.

    Where the process has stages, only tools of the first one count. A run looks at the others when
    they come to work.
    """
    tolerance = OVERLAP_TOLERANCE * scene.stack.least_thickness
    working = {tool.name for tool in scene.tools if _works_first(scene, tool)}
    return [
        gap for gap in gaps if gap.tool in working and not min(gap.gap, gap.at_nodes) >= -tolerance
    ]


def _works_first(scene: Scene, tool: Tool) -> bool:
    """Tell whether a tool is at work when the process begins."""
    return not scene.stages or at_work(tool, scene.stages[0])


def require_gaps(gaps: Sequence[InitialGap], scene: Scene) -> None:
    """Stop as :func:`require_no_initial_overlap` where the gaps are known."""
    sentences = []
    keys = []
    for gap in overlapping(gaps, scene):
        index = gaps.index(gap)
        keys.append(f'tools[{index}] "{gap.tool}".position')
        sentences.append(_sentence(gap, scene))
    if len(keys) == 1:
        raise InputError(sentences[0], key=keys[0])
    if keys:
        lines = "".join(f"\n  {key}: {text}" for key, text in zip(keys, sentences))
        raise InputError(f"{len(keys)} tools overlap the blank at the start:{lines}", key="tools")


def _sentence(gap: InitialGap, scene: Scene) -> str:
    x, y, z = (round(1e3 * c, 9) + 0.0 for c in gap.position)  # no rounding errors, no minus zero
    stack = stack_at(scene, 0.0)
    if gap.gap >= -OVERLAP_TOLERANCE * stack.least_thickness:
        return (
            f"the distance field of the tool reaches {-1e3 * gap.at_nodes:.3g} mm into the blank, "
            "where its grid rounds an inner corner; give its shape a smaller spacing, or move the "
            "tool away by as much"
        )
    of_slopes = ", and its mid-surface keeps half the thickness away from a slope"
    kept = of_slopes if any(contact_offset(ply) for ply in stack) else ""
    return (
        f"the tool reaches {-1e3 * gap.gap:.3g} mm into the blank at the start, deepest at "
        f"({x:.4g}, {y:.4g}, {z:.4g}) mm; the blank lies between z = "
        f"{1e3 * stack.bottom:.4g} mm and {1e3 * stack.top:.4g} mm{kept}. Move the tool, or set "
        f"{stack[0].key}.height"
    )
