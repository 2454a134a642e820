"""The tools of a run as its pictures show them: where they are, and transparent around the sheet.

A transparent surface that is painted facet by facet shows the seams of its facets. Here all facets
of a tool in front of the sheet are one path, whose overlaps are filled once, and all facets behind
the sheet another one. A depth buffer of the sheet tells them apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.patches import PathPatch

from lcmchain.fields.stages import STAGE
from lcmchain.report.renderer import one_path
from lcmchain.report.style import SERIES
from lcmchain.report.view import View, contour_edges, facet_normals
from lcmchain.scene.stages import at_work
from lcmchain.tools.table import placed
from lcmchain.tools.tool import clip_to_box, tool_surface

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.typing import ColorType

    from lcmchain.scene import Scene
    from lcmchain.tools.table import ToolTable


@dataclass(frozen=True)
class RunTools:
    """Tools of a run.

    names : of the T tools. table : their shapes as contact sees them.
    surfaces : points [m] and triangles of every tool at travel 0.
    by_stage : whether each tool is at work, for every stage; empty without stages.
    at_work : whether each tool is shown; None for all of them.
    """

    names: tuple[str, ...]
    table: ToolTable
    surfaces: tuple[tuple[np.ndarray, np.ndarray], ...]
    by_stage: tuple[tuple[bool, ...], ...] = ()
    at_work: tuple[bool, ...] | None = None

    @classmethod
    def of_scene(cls, scene: Scene, table: ToolTable, points: np.ndarray) -> RunTools:
        """Return the tools of a scene, as far as they reach around points [m] (..., 3)."""
        low, high = points.reshape(-1, 3).min(axis=0), points.reshape(-1, 3).max(axis=0)
        # what is infinite must reach the picture from wherever a tool travels to
        reach = 3.0 * np.linalg.norm(high - low)
        box = np.stack([low - reach, high + reach])
        return cls(
            tuple(tool.name for tool in scene.tools),
            table,
            tuple(tool_surface(tool, scene.source.directory, box) for tool in scene.tools),
            tuple(tuple(at_work(tool, stage) for tool in scene.tools) for stage in scene.stages),
        )

    def in_stage(self, number: int) -> RunTools:
        """Return the tools as a stage has them: those that are not at work are not shown."""
        return replace(self, at_work=self.by_stage[number]) if self.by_stage else self

    def in_frame(self, history: xr.Dataset, frame: int) -> RunTools:
        """Return the tools as the stage of a saved frame has them."""
        return self.in_stage(int(history[STAGE].values[frame])) if STAGE in history else self

    def shows(self, tool: int) -> bool:
        """Tell whether a tool is shown."""
        return self.at_work is None or self.at_work[tool]

    @property
    def colours(self) -> tuple[str, ...]:
        return tuple(SERIES[i % len(SERIES)] for i in range(len(self.names)))

    def within(
        self, box: np.ndarray, travel: np.ndarray
    ) -> Iterator[tuple[str, np.ndarray, np.ndarray, str]]:
        """Yield name, points [m], triangles and colour of what lies in a box at travels (T,)."""
        for tool, (points, triangles) in enumerate(self.surfaces):
            if not self.shows(tool):
                continue
            moved = placed(self.table, tool, points, travel[tool])
            yield self.names[tool], *clip_to_box(moved, triangles, box), self.colours[tool]


# --- transparent surfaces -------------------------------------------------------------------------


# Of each side of a tool; a line of sight passes two.
OPACITY = 0.13
# Cells of the depth buffer over the larger extent of the sheet.
CELLS = 500
# Triangles of a tool: so large none may hide a gap, so small where the sheet hides a part.
LARGEST, SMALLEST = 5.0, 0.6
BEHIND, IN_FRONT = 1.0, 3.0  # zorder; the sheet has 2


class DepthBuffer:
    """Depth of the foremost facet of a sheet, corners (F, 4, 3), on a grid over the screen."""

    def __init__(self, corners: np.ndarray, view: View) -> None:
        screen = view.on_screen(corners)
        self._view = view
        self._low = screen.reshape(-1, 2).min(axis=0)
        extent = np.ptp(screen.reshape(-1, 2), axis=0)
        self._cell = max(float(extent.max()) / CELLS, 1e-300)
        sides = np.linalg.norm(np.roll(screen, -1, axis=1) - screen, axis=2)
        # samples so dense that every cell within a facet has one
        count = int(np.ceil(1.5 * float(np.quantile(sides, 0.99)) / self._cell)) + 2
        s = np.linspace(0.0, 1.0, count)
        u, v = (part.ravel() for part in np.meshgrid(s, s))
        weights = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
        shape = np.floor(extent / self._cell).astype(int) + 1
        self.depth = np.full(shape, -np.inf)
        for part in np.array_split(corners, max(1, len(corners) * len(u) // 2_000_000)):
            points = np.einsum("ws,fwd->fsd", weights, part).reshape(-1, 3)
            np.maximum.at(self.depth, self._cells(points), points @ view.towards)

    def hides(self, points: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Tell which points (P, 3), taken at the depths (P,), the sheet hides."""
        i, j = self._cells(points)
        inside = (i >= 0) & (j >= 0) & (i < self.depth.shape[0]) & (j < self.depth.shape[1])
        hidden = np.zeros(len(points), dtype=bool)
        hidden[inside] = self.depth[i[inside], j[inside]] > depth[inside]
        return hidden

    def _cells(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        cells = np.floor((self._view.on_screen(points) - self._low) / self._cell).astype(int)
        return cells[:, 0], cells[:, 1]


def draw_tool(
    axis: Axes,
    points: np.ndarray,
    triangles: np.ndarray,
    view: View,
    colour: ColorType,
    sheet: DepthBuffer,
    size: float,
    *,
    over_sheet: bool = True,
) -> None:
    """Draw the transparent surface of a tool, and the lines that describe it, around a sheet.

    A sheet lies on the free side of a tool: where both are closer than ``size``, the tool is in
    front if it is seen from its solid side.

    Parameters
    ----------
    points, triangles : (P, 3) and (F, 3), normals away from the solid.
    size : of the sheet's facets.
    over_sheet : whether the tool tints what it lies in front of; a sheet whose colours are values
        stays as it is, and only the lines of the tool are upon it.
    """
    if len(triangles) == 0:
        return
    towards_viewer = facet_normals(points[triangles]) @ view.towards
    for side in (1.0, -1.0):
        parts = hidden_and_seen(
            points[triangles[side * towards_viewer > 0.0]], view, sheet, side, size
        )
        for zorder, corners in zip((BEHIND, IN_FRONT if over_sheet else BEHIND), parts):
            path = one_path(view.on_screen(corners))
            # an artist, since adding a patch takes the limits of every triangle
            axis.add_artist(
                PathPatch(path, facecolor=colour, alpha=OPACITY, linewidth=0.0, zorder=zorder)
            )
    edges = divided_segments(contour_edges(points, triangles, view), 0.3 * size)
    middles = edges.mean(axis=1)
    hidden = sheet.hides(middles, middles @ view.towards)
    for zorder, here in ((BEHIND + 0.5, hidden), (IN_FRONT + 0.5, ~hidden)):
        axis.add_collection(
            LineCollection(
                view.on_screen(edges[here]), colors=[colour], linewidths=0.9, zorder=zorder,  # type: ignore[arg-type]
                capstyle="round",
            )
        )  # fmt: skip


def hidden_and_seen(
    corners: np.ndarray, view: View, sheet: DepthBuffer, side: float, size: float
) -> tuple[np.ndarray, np.ndarray]:
    """Divide triangles (F, 3, 3) into those that a sheet hides and those that it does not.

    Triangles are halved across their longest edge, the large ones first, then those that the sheet
    hides in part, until they are small.

    Parameters
    ----------
    side : 1 where the free side of the triangles is seen, -1 where the solid side is.
    """
    parts: tuple[list, list] = ([corners[:0]], [corners[:0]])
    while len(corners):
        edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        longest = edges.max(axis=1)
        places = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
        depth = places @ view.towards - size * side
        hidden = sheet.hides(places.reshape(-1, 3), depth.ravel()).reshape(depth.shape)
        alike = (hidden == hidden[:, 3:]).all(axis=1)
        done = (alike & (longest <= LARGEST * size)) | (longest <= SMALLEST * size)
        for part, here in zip(parts, (hidden[:, 3], ~hidden[:, 3])):
            part.append(corners[done & here])
        corners, edges = corners[~done], edges[~done]
        order = (np.argmax(edges, axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(corners, order[:, :, None], axis=1), 1, 0)
        middle = 0.5 * (a + b)
        corners = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return np.concatenate(parts[0]), np.concatenate(parts[1])


def divided_segments(segments: np.ndarray, size: float) -> np.ndarray:
    """Divide segments (S, 2, 3) into equal parts no longer than ``size``."""
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    count = np.maximum(np.ceil(length / size).astype(int), 1)
    owner = np.repeat(np.arange(len(segments)), count)
    part = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    start, along = segments[owner, 0], (segments[owner, 1] - segments[owner, 0])
    share = (np.stack([part, part + 1], axis=1) / count[owner, None])[:, :, None]
    return start[:, None] + share * along[:, None]
