"""The check of a scene: what it will simulate, what it costs, and whether it can start."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.check.effects_of_scene import Effect, scene_effects
from lcmchain.check.expected_cost import Estimate, estimate_run
from lcmchain.check.remarks import scene_warnings
from lcmchain.check.tables import cost_table, effect_table, entry_table, gap_table
from lcmchain.check.tools_at_start import InitialGap, require_no_initial_overlap
from lcmchain.mesh.blank import BlankMesh, build_blank
from lcmchain.mesh.triangulation import triangulate
from lcmchain.scene import MembraneShellElement, Scene
from lcmchain.tools.table import build_tool_table

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True)
class CheckReport:
    """Everything that ``lcmchain check`` shows."""

    scene: Scene
    element_count: int
    node_count: int
    effects: list[Effect]
    estimate: Estimate
    gaps: list[InitialGap]
    warnings: list[str]
    picture: Path | None

    def tables(self) -> list[Table]:
        """Lay the report out as tables for a terminal."""
        return [
            entry_table("Given in the scene", self.scene.source.given),
            entry_table("Defaulted", self.scene.source.defaulted),
            effect_table(self.effects),
            *([gap_table(self.gaps, self.scene.material.thickness)] if self.gaps else []),
            cost_table(
                self.estimate,
                self.scene.process,
                element_count=self.element_count,
                node_count=self.node_count,
            ),
        ]


def check_scene(scene: Scene, out: Path | None = None) -> CheckReport:
    """Build blank and tools, test that they can start, and tell what a run will do.

    Parameters
    ----------
    scene : validated scene.
    out : folder for the picture ``initial.png``; None draws nothing.

    Raises
    ------
    InputError : blank or tools cannot be built, or a tool overlaps the blank at the start.
    """
    blank = build_blank(scene.blank, scene.material.thickness)
    mesh = triangulate(blank) if isinstance(scene.element, MembraneShellElement) else blank
    with warnings.catch_warnings(record=True) as tool_warnings:
        warnings.simplefilter("always")
        table = build_tool_table(scene.tools, scene.source.directory, scene.process.time)
    gaps = require_no_initial_overlap(scene, blank, table)
    picture = None
    if out is not None:
        picture = Path(out) / "initial.png"
        draw_start(picture, scene, blank)
    return CheckReport(
        scene=scene,
        element_count=mesh.element_count,
        node_count=mesh.node_count,
        effects=scene_effects(scene),
        estimate=estimate_run(scene, mesh),
        gaps=gaps,
        warnings=scene_warnings(scene) + [str(entry.message) for entry in tool_warnings],
        picture=picture,
    )


def draw_start(path: Path, scene: Scene, blank: BlankMesh) -> None:
    """Draw blank, tools and initial fibre directions."""
    from lcmchain.report import draw_initial
    from lcmchain.tools.drawing import tool_surface

    # Infinite tools are shown a little beyond the blank, and as high as the blank is long.
    lowest, highest = blank.node_positions.min(axis=0), blank.node_positions.max(axis=0)
    size = float(max(highest - lowest))
    margin = np.array([0.1, 0.1, 0.5]) * size
    box = np.array([lowest - margin, highest + margin])
    surfaces = [
        (tool.name, *tool_surface(tool, scene.source.directory, box)) for tool in scene.tools
    ]
    draw_initial(path, blank, surfaces)
