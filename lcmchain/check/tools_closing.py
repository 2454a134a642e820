"""Tools that close on each other farther than the sheet between them can be pressed.

Prescribed tools go their way whatever lies between them. Two that face the sheet from either side
and come closer than half its thickness, or pass through each other, crush it: a punch in a hole
that is too small, a stroke that is too long, a tool in the way of another one.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh.blank import BlankMesh
from lcmchain.model import Model
from lcmchain.quantities.places import millimetres
from lcmchain.scene import Scene, Tool
from lcmchain.tools.distance import gaps
from lcmchain.tools.drawing import tool_surface
from lcmchain.tools.motion import GUIDED, prescribed_travel
from lcmchain.tools.surfaces.surface import ToolWarning

#: Gap in parts of the thickness below which no sheet fits between two tools.
LEAST_GAP = 0.5
#: Evenly spaced times of the process at which the tools are looked at.
TIMES = 101
#: Samples along the longer side of the blank, and the most of a tool's surface.
ALONG, MOST_SAMPLES = 80, 6000


class Closest(NamedTuple):
    """Where two tools come closest: gap [m], place [m] and time [s]."""

    gap: float
    place: np.ndarray
    time: float


def tools_that_close(scene: Scene, blank: BlankMesh, model: Model) -> list[str]:
    """Say which tools leave no space for the sheet between them on their way.

    Only over the blank as it lies at the start, and of tools that a stroke or a table drives: how
    far a guided one goes is not known beforehand. Two tools on the same side of the blank have no
    sheet between them.
    """
    tools = model.tools
    led = [k for k in range(len(scene.tools)) if tools.motion_kind[k] != GUIDED]
    samples = {k: _samples(scene, scene.tools[k], model, k, blank) for k in led}
    sides = {k: _side(model, k, blank) for k in led}
    times = _times(model)
    least = LEAST_GAP * scene.material.thickness
    found = []
    for one, other in combinations(led, 2):
        if sides[one] * sides[other] > 0:
            continue
        course = list(_course(model, blank, times, (one, other), samples))
        closest = min(course, key=lambda closest: closest.gap)
        if closest.gap < least <= course[0].gap:
            first = next(near for near in course if near.gap < least)
            found.append(_sentence(scene, model, (one, other), first, closest))
    return found


def _times(model: Model) -> np.ndarray:
    """Return the start, the end, the knots of all tables, and evenly spaced times between [s]."""
    even = np.linspace(0.0, model.process_time, TIMES)
    times = np.unique(np.concatenate([even, model.tools.table_times]))
    return times[times <= model.process_time]


def _side(model: Model, tool: int, blank: BlankMesh) -> int:
    """Return 1 for a tool above the blank, -1 for one below, 0 where it is beside it."""
    nodes = np.ascontiguousarray(blank.mid_surface_positions)
    nearest = nodes[[np.argmin(gaps(model.tools, tool, nodes, 0.0))]]
    step = np.array([0.0, 0.0, 0.5 * blank.thickness])
    below = gaps(model.tools, tool, nearest - step, 0.0)[0]
    above = gaps(model.tools, tool, nearest + step, 0.0)[0]
    rise = (below - above) / blank.thickness
    return 0 if abs(rise) < 0.5 else int(np.sign(rise))


def _samples(scene: Scene, tool: Tool, model: Model, index: int, blank: BlankMesh) -> np.ndarray:
    """Return points (P, 3) of a tool's surface at travel 0 [m] that may come over the blank."""
    travels = [prescribed_travel(model.tools, index, time)[0] for time in _times(model)]
    ways = np.array([min(travels), max(travels)])[:, np.newaxis] * model.tools.direction[index]
    low, high = blank.node_positions.min(axis=0), blank.node_positions.max(axis=0)
    size = float((high - low).max())
    reach = size + np.abs(ways).max()
    box = np.array([low - ways.max(axis=0), high - ways.min(axis=0)])
    box[:, 2] += [-reach, reach]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ToolWarning)  # said when the table was built
            points, faces = tool_surface(tool, scene.source.directory, box)
    except InputError:
        return np.empty((0, 3))  # what cannot be triangulated the other tool's points still see
    return _spread(points, faces, size / ALONG)


def _spread(points: np.ndarray, faces: np.ndarray, spacing: float) -> np.ndarray:
    """Return the corners of triangles and places inside them, at most a spacing [m] apart."""
    found = [points]
    corners = points[faces]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    counts = np.minimum(np.ceil(sides / spacing).astype(int), ALONG)
    for count in np.unique(counts[counts > 1]):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
        inside = i + j <= count
        weights = np.stack([i[inside], j[inside], (count - i - j)[inside]], axis=1) / count
        found.append(np.einsum("wk,fki->fwi", weights, corners[counts == count]).reshape(-1, 3))
    spread = np.concatenate(found)
    return spread[:: -(-len(spread) // MOST_SAMPLES) or 1]


def _course(
    model: Model,
    blank: BlankMesh,
    times: np.ndarray,
    pair: tuple[int, int],
    samples: dict[int, np.ndarray],
) -> Iterator[Closest]:
    """Yield how close two tools are over the blank at every time."""
    tools = model.tools
    low, high = blank.node_positions.min(axis=0)[:2], blank.node_positions.max(axis=0)[:2]
    for time in times:
        travels = {k: prescribed_travel(tools, k, time)[0] for k in pair}
        closest = Closest(np.inf, np.zeros(3), float(time))
        for of, to in (pair, pair[::-1]):
            points = samples[of] + travels[of] * tools.direction[of]
            points = points[((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1)]
            if len(points) == 0:
                continue
            apart = gaps(tools, to, np.ascontiguousarray(points), travels[to])
            nearest = int(np.argmin(apart))
            if apart[nearest] < closest.gap:
                closest = Closest(float(apart[nearest]), points[nearest], float(time))
        yield closest


def _sentence(
    scene: Scene, model: Model, pair: tuple[int, int], first: Closest, closest: Closest
) -> str:
    """Name tools, gap, place and travel where two tools are closest, and when it begins."""
    moving = [k for k in pair if scene.tools[k].motion.moves]
    way = " and ".join(
        f"{model.tool_names[k]} at a travel of "
        f"{1e3 * prescribed_travel(model.tools, k, closest.time)[0]:.4g} mm"
        for k in moving
    )
    one, other = (model.tool_names[k] for k in pair)
    what = (
        f"overlap by {-1e3 * closest.gap:.3g} mm"
        if closest.gap < 0.0
        else f"are {1e3 * closest.gap:.3g} mm apart"
    )
    keys = " and ".join(f"tools.{model.tool_names[k]}.motion" for k in moving)
    return (
        f"{one} and {other} {what} at {millimetres(closest.place)} at "
        f"{1e3 * closest.time:.4g} ms, {way}: no space for the sheet, which is "
        f"{1e3 * scene.material.thickness:.4g} mm thick, from {1e3 * first.time:.4g} ms on; check "
        f"{keys}, position and size of both"
    )
