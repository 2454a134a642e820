"""Closest gap between two tools on their way, where the sheet lies between them.

The search goes downhill: from a place on one tool to the nearest place of the other one, from there
to the nearest place of the first, and so on. The ways shrink to the smallest gap nearby, or to
where the tools meet; from there the search follows their overlap to its deepest place. It begins at
places of the flat sheet, and straight above and below them on both tools: the middle of a deep tool
is far from the sheet, and not the nearest to any place of it.

Every gap is measured between two places on the surfaces, so that none is too small. Only gaps above
or below the blank count. A small overlap of a tool with the sheet at the start, which exerts no
force (:func:`lcmchain.tools.table.without_initial_overlap`), adds to its gaps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lcmchain.jit import entry, equation
from lcmchain.mesh.sheet_mesh import SheetMesh
from lcmchain.tools.distance import FIELD, gaps, signed_distance
from lcmchain.tools.motion.prescribed import prescribed_travel
from lcmchain.tools.table import ToolTable

#: Places of the sheet at which the search begins, about.
PLACES = 500
#: From so many of the best starts it goes on, and so often from one tool to the other.
KEPT, LEGS = 100, 40
#: Evaluations of a distance within one leg, and along a straight line to a tool. A distance field
#: far from its surface gives a bound of the distance alone, which takes several.
EVALUATIONS = 64
#: A place lies on a tool whose distance is less than this part of the size of the sheet; surfaces
#: meet whose gap is less than so many times that.
ON_TOOL, TOUCH = 1e-7, 10.0
#: Way to places around one, in parts of the size of the sheet, by which a distance changes on a
#: surface: at least and at most by these parts of the way, in one of six directions.
PROBE, LEAST_RATE, MOST_RATE = 1e-6, 0.3, 1.7
#: First step on the way to the deepest place of an overlap, in parts of the size of the sheet.
FIRST_STEP = 0.01


class ClosestGap(NamedTuple):
    """Where two tools are closest at a time.

    gap : between them [m], negative where they overlap, infinite where none is found above or
    below the blank. place : in the middle of it [m]. time : [s].
    """

    gap: float
    place: np.ndarray
    time: float


def places_of_sheet(meshes: Sequence[SheetMesh]) -> np.ndarray:
    """Return about ``PLACES`` places (count, 3) [m] all over flat sheets, on their mid-surfaces."""
    places = []
    for mesh in meshes:
        nodes, faces = mesh.mid_surface(mesh.node_positions), np.array(mesh.sheet_faces)
        missing = faces[:, -1] < 0
        faces[missing, -1] = faces[missing, -2]
        if faces.shape[1] == 3:
            faces = faces[:, [0, 1, 2, 2]]
        along = np.linspace(0.0, 1.0, 1 + int(np.ceil(np.sqrt(PLACES / len(faces)))))
        s, t = (axis.ravel() for axis in np.meshgrid(along, along))
        weights = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=1)
        places.append(np.einsum("wk,fki->fwi", weights, nodes[faces]).reshape(-1, 3))
    every = np.unique(np.concatenate(places), axis=0)
    return every[:: len(every) // PLACES or 1]


def side_of_sheet(tools: ToolTable, tool: int, meshes: Sequence[SheetMesh]) -> int:
    """Return 1 for a tool above flat sheets at the start, -1 for one below, 0 for one beside."""
    nodes = np.concatenate([mesh.mid_surface(mesh.node_positions) for mesh in meshes])
    thickness = sum(mesh.thickness for mesh in meshes)
    nearest = nodes[[np.argmin(gaps(tools, tool, nodes, 0.0))]]
    step = np.array([0.0, 0.0, 0.5 * thickness])
    below = gaps(tools, tool, nearest - step, 0.0)[0]
    above = gaps(tools, tool, nearest + step, 0.0)[0]
    rise = (below - above) / thickness
    return 0 if abs(rise) < 0.5 else int(np.sign(rise))


def times_of_motion(tools: ToolTable, process_time: float, count: int) -> np.ndarray:
    """Return evenly spaced times of a process, its start and end among them, and knots of tables.

    Shape (at least ``count``,) [s], in order.
    """
    even = np.linspace(0.0, process_time, count)
    times = np.unique(np.concatenate([even, tools.table_times]))
    return times[times <= process_time]


def closest_gaps(
    tools: ToolTable, pair: tuple[int, int], places: np.ndarray, times: np.ndarray
) -> list[ClosestGap]:
    """Return how close two tools come to each other at every time.

    Parameters
    ----------
    tools : with prescribed motions. pair : their indices.
    places : of the flat sheet (count, 3) [m] (:func:`places_of_sheet`).
    times : [s].
    """
    low, high = places.min(axis=0), places.max(axis=0)
    size = float((high - low).max())
    accuracy = ON_TOOL * size
    overlap = float(tools.initial_overlap[list(pair)].sum())
    found = []
    for time in times.tolist():
        travel = np.array([prescribed_travel(tools, k, time)[0] for k in range(tools.kind.size)])
        reach = size + 2.0 * float(np.abs(travel[list(pair)]).max())
        hits = [straight_hits(tools, k, travel[k], places, reach, accuracy) for k in pair]
        starts = np.concatenate([places, *hits])
        starts = starts[np.isfinite(starts[:, 2])]
        area = np.concatenate([low[:2] - accuracy, high[:2] + accuracy])
        rows = nearest_gaps(tools, *pair, travel, starts, 2, area, accuracy)
        drop_fringes(tools, pair, travel, rows, PROBE * size)
        best = starts[np.argsort(rows[:, 0], kind="stable")[:KEPT]]
        further = nearest_gaps(tools, *pair, travel, best, LEGS, area, accuracy)
        drop_fringes(tools, pair, travel, further, PROBE * size)
        rows = np.concatenate([rows, further])
        meet = rows[rows[:, 0] < TOUCH * accuracy]
        if len(meet):
            rows = meet[np.argsort(meet[:, 0], kind="stable")[:KEPT]]
            deepest_overlaps(tools, *pair, travel, rows, FIRST_STEP * size, area, accuracy)
        least = rows[np.argmin(rows[:, 0])]
        middle = 0.5 * (least[1:4] + least[4:7])
        found.append(ClosestGap(float(least[0]) + overlap, middle, time))
    return found


def drop_fringes(
    tools: ToolTable, pair: tuple[int, int], travel: np.ndarray, rows: np.ndarray, step: float
) -> None:
    """Make gaps infinite that end where a distance field is zero without a surface.

    Beside the rim of a skin the field is a bound of the distance alone, which may be zero. It is so
    all around, while away from a surface the distance grows with the way.

    Parameters
    ----------
    travel : of all tools [m]. rows : of :func:`nearest_gaps`. step : to places around [m].
    """
    for tool in pair:
        if tools.kind[tool] != FIELD:
            continue
        for own, columns in ((True, slice(1, 4)), (False, slice(4, 7))):
            ends_there = (rows[:, 7] == tool) == own
            chosen = np.flatnonzero(np.isfinite(rows[:, 0]) & ends_there)
            places = rows[chosen, columns]
            here = gaps(tools, tool, places, travel[tool])
            on_surface = np.zeros(len(chosen), dtype=bool)
            for move in step * np.concatenate([np.eye(3), -np.eye(3)]):
                change = np.abs(gaps(tools, tool, places + move, travel[tool]) - here)
                on_surface |= (change > LEAST_RATE * step) & (change < MOST_RATE * step)
            rows[chosen[~on_surface], 0] = np.inf


@entry
def straight_hits(tools, tool, travel, places, reach, accuracy):
    """Return where lines up and down from places meet a tool (2 count, 3) [m], nan where none does.

    Every step is as long as the distance to the tool, so that none leads through its surface.
    """
    count = places.shape[0]
    hits = np.full((2 * count, 3), np.nan)
    for line in range(2 * count):
        up = 1.0 if line < count else -1.0
        x, y, z = places[line % count, 0], places[line % count, 1], places[line % count, 2]
        begin = z
        for _ in range(EVALUATIONS):
            gap, _nx, _ny, _nz = signed_distance(tools, tool, x, y, z, travel)
            if abs(gap) < accuracy:
                hits[line, 0], hits[line, 1], hits[line, 2] = x, y, z
                break
            z += up * abs(gap)
            if abs(z - begin) > reach:
                break
    return hits


@entry
def nearest_gaps(tools, first, second, travel, starts, legs, area, accuracy):
    """Return the smallest gap between two tools found from every start, and where (count, 8).

    Parameters
    ----------
    travel : of all tools [m]. starts : (count, 3) [m]. legs : ways from one tool to the other.
    area : least and largest x and y above which gaps count, (4,): x, y, x, y [m].
    accuracy : distance at which a place lies on a tool [m].

    Returns
    -------
    Gap [m], place on one tool (3) [m], place on the other one (3) [m], and the index of the one.
    """
    found = np.full((starts.shape[0], 8), np.inf)
    for s in range(starts.shape[0]):
        x, y, z = starts[s, 0], starts[s, 1], starts[s, 2]
        from_x, from_y, from_z = x, y, z
        one, tool = second, first
        leg, before, way, evaluations = 0, np.inf, 0.0, 0
        while leg <= legs and evaluations < EVALUATIONS:
            gap, nx, ny, nz = signed_distance(tools, tool, x, y, z, travel[tool])
            x, y, z = x - gap * nx, y - gap * ny, z - gap * nz
            way += gap
            evaluations += 1
            if abs(gap) < accuracy:  # on the tool
                over = is_within(area, 0.5 * (x + from_x), 0.5 * (y + from_y))
                if leg > 0 and over and way < found[s, 0]:
                    found[s, 0], found[s, 7] = way, one
                    found[s, 1], found[s, 2], found[s, 3] = from_x, from_y, from_z
                    found[s, 4], found[s, 5], found[s, 6] = x, y, z
                if leg > 1 and abs(way - before) < accuracy:
                    break
                before = way if leg > 0 else np.inf
                from_x, from_y, from_z = x, y, z
                leg, way, evaluations = leg + 1, 0.0, 0
                one, tool = tool, one
    return found


@entry
def deepest_overlaps(tools, first, second, travel, found, step, area, accuracy):
    """Follow overlaps of two tools to where they are deepest, in what :func:`nearest_gaps` found.

    Ways from tool to tool end where the surfaces meet. From there on a place on the one tool moves
    against the normal of the other one and back to the surface of the one, as long as that leads
    deeper; the steps grow and shrink, from ``step`` on [m].
    """
    for s in range(found.shape[0]):
        one = int(found[s, 7])
        other = second if one == first else first
        x, y, z, size = found[s, 1], found[s, 2], found[s, 3], step
        least, nx, ny, nz = signed_distance(tools, other, x, y, z, travel[other])
        for _ in range(EVALUATIONS):
            new_x, new_y, new_z = x - size * nx, y - size * ny, z - size * nz
            for _ in range(EVALUATIONS):
                away, ax, ay, az = signed_distance(tools, one, new_x, new_y, new_z, travel[one])
                new_x, new_y, new_z = new_x - away * ax, new_y - away * ay, new_z - away * az
                if abs(away) < accuracy:
                    break
            gap, mx, my, mz = signed_distance(tools, other, new_x, new_y, new_z, travel[other])
            if abs(away) < accuracy and gap < least and is_within(area, new_x, new_y):
                x, y, z, least, nx, ny, nz = new_x, new_y, new_z, gap, mx, my, mz
                size *= 2.0
            else:
                size *= 0.5
            if size < accuracy:
                break
        if least < found[s, 0]:
            found[s, 0] = least
            found[s, 1], found[s, 2], found[s, 3] = x, y, z
            found[s, 4], found[s, 5], found[s, 6] = x - least * nx, y - least * ny, z - least * nz


@equation
def is_within(area, x, y):
    """Tell whether a place lies above or below a rectangle (4,): least x, y, largest x, y [m]."""
    return area[0] <= x and x <= area[2] and area[1] <= y and y <= area[3]
