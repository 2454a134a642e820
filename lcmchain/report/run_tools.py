"""The tools of a run as its pictures show them: surfaces that move, and distances from them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.stages import STAGE
from lcmchain.report.style import SERIES
from lcmchain.scene.stages import at_work
from lcmchain.tools.drawing import clip_to_box, tool_surface
from lcmchain.tools.turn import placed

if TYPE_CHECKING:
    import xarray as xr

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
