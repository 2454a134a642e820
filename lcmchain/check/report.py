"""The check of a scene: what it will simulate, what it costs, and whether it can start."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.check.effects_of_run import run_effects
from lcmchain.check.expected_cost import Estimate, estimate_run
from lcmchain.check.quasi_static import ProcessTime, process_time_needed, process_time_remarks
from lcmchain.check.remarks import scene_warnings
from lcmchain.check.tables import (
    cost_table,
    effect_table,
    entry_table,
    gap_table,
    process_time_table,
)
from lcmchain.check.tools_at_start import InitialGap, require_no_initial_overlap
from lcmchain.effects.effect import Effect
from lcmchain.mesh.blank import BlankMesh, build_blank
from lcmchain.model import build_model
from lcmchain.scene import Scene

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
    needed: ProcessTime
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
            process_time_table(self.needed, self.scene.process),
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
    with warnings.catch_warnings(record=True) as tool_warnings:
        warnings.simplefilter("always")
        model = build_model(scene)
    # the tools meet the faces of the sheet, whatever its elements
    blank = build_blank(scene.blank, scene.material.thickness)
    gaps = require_no_initial_overlap(scene, blank, model.tools)
    needed = process_time_needed(model)
    found = scene_warnings(scene) + blank.remarks() + process_time_remarks(scene, needed)
    picture = None
    if out is not None:
        picture = Path(out) / "initial.png"
        draw_start(picture, scene, blank)
    return CheckReport(
        scene=scene,
        element_count=model.element_count,
        node_count=model.node_count,
        effects=run_effects(scene, model),
        estimate=estimate_run(model),
        needed=needed,
        gaps=gaps,
        warnings=found + [str(entry.message) for entry in tool_warnings],
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
