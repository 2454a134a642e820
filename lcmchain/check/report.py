"""The check of a scene: what it will simulate, what it costs, and whether it can start."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.check.effect_cost import (
    effect_parts,
    later_stages,
    measurable_effects,
    run_effects,
)
from lcmchain.check.expected_cost import Estimate, estimate_run
from lcmchain.check.large_mesh import CheckedMesh, checked_mesh, require_frames_fit
from lcmchain.check.remarks import scene_warnings
from lcmchain.check.tables import (
    closing_table,
    cost_table,
    course_tables,
    effect_table,
    gap_table,
    preview_table,
    process_time_table,
    scene_tables,
    stack_tables,
    stage_table,
    surface_table,
)
from lcmchain.check.tool_strokes import (
    Closing,
    closing_tools,
    require_space,
    tools_out_of_reach,
    tools_that_close,
)
from lcmchain.check.tools_at_start import (
    InitialGap,
    gaps_of_stack,
    overlapping,
    require_gaps,
)
from lcmchain.draping import Draped, drape, is_drapable
from lcmchain.draping.courses import joints_of
from lcmchain.draping.result import draping_effect, locking_warnings
from lcmchain.effects.effect import Effect
from lcmchain.errors import InputError
from lcmchain.judgements.quasi_static import ProcessTime, process_time_needed, process_time_remarks
from lcmchain.mesh.blank import BlankMesh
from lcmchain.model import Model, build_model
from lcmchain.quantities.readable import duration_text, millimetres
from lcmchain.report.style import START_PICTURE
from lcmchain.scene import Scene
from lcmchain.tools import ToolTable, build_tool_table
from lcmchain.tools.surfaces.surface import ToolWarning
from lcmchain.tools.tool import tool_surface

if TYPE_CHECKING:
    from rich.table import Table

    from lcmchain.report.start import ShownGrip


# --- what the net of kinematic draping says -------------------------------------------------------


#: Rows that differ between plies that are draped alike.
SEED, LAID_IN = "seed", "laid in"


@dataclass(frozen=True)
class DrapingReport:
    """Everything that ``lcmchain check`` shows of a scene that is draped."""

    scene: Scene
    effects: list[Effect]
    preview: list[tuple[str, str]]
    warnings: list[str]
    picture: Path | None

    def first_tables(self) -> list[Table]:
        """Lay out for a terminal what decides whether to start."""
        return preview_table(self.preview)

    def further_tables(self) -> list[Table]:
        """Lay out all entries with what they rest on, and all effects with their reason."""
        return [*scene_tables(self.scene), effect_table(self.effects)]

    def tables(self) -> list[Table]:
        """Lay the whole report out as tables for a terminal."""
        return [*self.first_tables(), *self.further_tables()]


def _check_draping(
    scene: Scene, blank: BlankMesh, tools: ToolTable, remarks: list[str], picture: Path | None
) -> DrapingReport:
    """Drape the blank of a scene, and tell what a run of it will find.

    Parameters
    ----------
    blank, tools : of the scene. remarks : found while they were built.
    picture : of the start, that the report names; None for none.

    Raises
    ------
    InputError : there is no surface, or the seed has no place on it.
    """
    draped = drape(scene, tools=tools, blank=blank)
    missing = draped.missing()
    return DrapingReport(
        scene=scene,
        effects=[draping_effect(draped), *later_stages(scene)],
        preview=list(_rows(draped)),
        warnings=[
            *scene_warnings(scene),
            *remarks,
            *(locking_warnings(draped) if missing is None else [f"a run will fail: {missing}"]),
        ],
        picture=picture,
    )


def _draping_preview(
    scene: Scene, blanks: Sequence[BlankMesh], tools: ToolTable
) -> list[tuple[str, str]]:
    """Return what the net says of a scene on any rung; empty where there is nothing to drape.

    Every ply of a stack is draped as if it were alone. Rows that plies share are given once.

    Raises
    ------
    InputError : the scene's own ``[draping]`` cannot be followed.
    """
    if not is_drapable(scene, tools):
        return []
    stack = scene.stack
    with_fibres = [(p, b) for p, b in zip(stack, blanks, strict=True) if p.material.has_fibres]
    drapable = [(p, b) for p, b in with_fibres if p.material.is_biaxial]
    if with_fibres and not drapable:
        return [("no net", "a net is laid for fibres along both axes of a ply, 0 and 90 deg")]
    each = [(ply.name, _preview_of_one(scene.alone(ply), b, tools)) for ply, b in drapable]
    if len(stack) == 1:
        return [row for _, rows in each for row in rows]
    alike: dict[tuple[str, str], list[str]] = {}
    for name, rows in each:
        for row in rows:
            if row[0] not in (SEED, LAID_IN):
                alike.setdefault(row, []).append(name)
    return [
        (what if len(names) == len(each) else f"{', '.join(names)}: {what}", value)
        for (what, value), names in sorted(alike.items(), key=lambda row: row[0][0], reverse=True)
    ]


def _preview_of_one(scene: Scene, blank: BlankMesh, tools: ToolTable) -> list[tuple[str, str]]:
    # strips that are pressed from the flat part otherwise than strips that are laid one by one
    whole = scene.blank.model_copy(update={"courses": None})  # type: ignore[union-attr]
    scene = scene.model_copy(update={"blank": whole})
    try:
        return list(_rows(drape(scene, tools=tools, blank=blank)))
    except InputError as error:
        if scene.draping.model_fields_set:
            raise
        return [("no net", f"{error}")]


def _rows(draped: Draped) -> Iterator[tuple[str, str]]:
    yield "surface", draped.surface
    seed = [*draped.seed, draped.mesh.node_positions[0, 2]]
    yield SEED, f"{millimetres(seed, 1)} of the flat blank, at {millimetres(draped.place, 1)}"
    missing, unplaced = draped.missing(), draped.unplaced_part()
    of_laid = "" if missing is None else f", of the {1.0 - unplaced:.1%} of the area that it covers"
    if unplaced < 1.0:
        angle, place, flat = draped.largest_shear()
        yield (
            "largest shear angle",
            f"{math.degrees(angle):.1f} deg at {millimetres(place, 1)}, "
            f"{millimetres(flat, 1)} of the flat blank{of_laid}",
        )
    # what has no place counts as locked, for a run; it is not sheared
    locking = math.degrees(draped.locking_angle)
    part = max(draped.locked_part() - unplaced, 0.0)
    yield f"beyond {locking:.3g} deg", f"{part:.1%} of the area" if part > 1e-12 else "nothing"
    for joint in joints_of(draped.courses):
        yield f"joint of {joint.below} and {joint.above}", joint.in_words()
    if missing is not None:
        yield "not laid", f"{unplaced:.1%} of the area: {missing}"
    yield LAID_IN, duration_text(draped.wall_s)


# --- the check ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CheckReport:
    """Everything that ``lcmchain check`` shows."""

    scene: Scene
    element_count: int
    node_count: int
    ply_counts: list[int]
    effects: list[Effect]
    effect_parts: dict[str, float]
    estimate: Estimate
    needed: ProcessTime
    gaps: list[InitialGap]
    initial_overlap: list[float]
    closing: list[Closing]
    preview: list[tuple[str, str]]
    warnings: list[str]
    picture: Path | None

    def first_tables(self) -> list[Table]:
        """Lay out for a terminal what decides whether to start: gaps, cost, pace, preview."""
        return [
            *stack_tables(self.scene, self.ply_counts),
            *course_tables(self.scene),
            *stage_table(self.scene),
            *gap_table(self.gaps, self.scene.stack.least_thickness, self.initial_overlap),
            *closing_table(self.closing, self.scene),
            cost_table(
                self.estimate,
                self.scene.process,
                element_count=self.element_count,
                node_count=self.node_count,
                time_is_found=self.scene.time_is_found,
                is_stack=len(self.scene.stack) > 1,
            ),
            process_time_table(
                self.needed, self.scene.process, time_is_found=self.scene.time_is_found
            ),
            *preview_table(self.preview),
        ]

    def further_tables(self) -> list[Table]:
        """Lay out all entries with what they rest on, all effects with their reason, surfaces."""
        return [
            *scene_tables(self.scene),
            effect_table(
                self.effects,
                self.effect_parts,
                [effect.name for effect in measurable_effects(self.scene)],
            ),
            *surface_table(self.gaps),
        ]

    def tables(self) -> list[Table]:
        """Lay the whole report out as tables for a terminal."""
        return [*self.first_tables(), *self.further_tables()]


def check_scene(scene: Scene, out: Path | None = None) -> CheckReport | DrapingReport:
    """Build blank and tools, test that they can start, and tell what a run will do.

    Parameters
    ----------
    scene : validated scene. Of a mesh of very many elements a check builds one with fewer, and
        carries what it finds over (:mod:`lcmchain.check.large_mesh`).
    out : folder for the picture ``initial.png``; None draws nothing.

    Raises
    ------
    InputError : blank or tools cannot be built, or a tool overlaps the blank at the start; names
        the picture, where one can be drawn even so.
    """
    mesh = checked_mesh(scene)
    scene = mesh.scene
    # the tools meet the faces of the sheet, whatever its elements
    blanks = [ply.build_blank() for ply in scene.stack]
    picture = None if out is None else Path(out) / START_PICTURE
    marks: list[tuple[float, float, float]] = []
    model = None
    try:
        with warnings.catch_warnings(record=True) as tool_warnings:
            warnings.simplefilter("always")
            if scene.element.has_forces:
                model = build_model(scene, pore_pressure=scene.wet_forming is not None)
            else:
                tools = _tools(scene, blanks[0])
        if model is not None:
            gaps = gaps_of_stack(scene, blanks, model.tools)
            marks = [gap.position for gap in overlapping(gaps, scene)]
            require_gaps(gaps, scene)
    except InputError as error:
        raise _with_picture(error, picture, scene, blanks, marks) from None
    noted = [str(entry.message) for entry in tool_warnings]
    noted = mesh.remarks(blanks) + noted
    report: CheckReport | DrapingReport
    if model is None:
        report = _check_draping(scene, blanks[0], tools, noted, picture)
    else:
        report = _report(mesh, blanks, model, gaps, noted, picture)
    if picture is not None:
        draw_start(picture, scene, blanks, grips=() if model is None else _grips_of_plies(model))
    return report


def _tools(scene: Scene, blank: BlankMesh) -> ToolTable:
    return build_tool_table(
        scene.tools, scene.source.directory, scene.process.time, blank=blank.node_positions
    )


def _report(
    mesh: CheckedMesh,
    blanks: Sequence[BlankMesh],
    model: Model,
    gaps: list[InitialGap],
    noted: list[str],
    picture: Path | None,
) -> CheckReport:
    """Return the report of a scene with forces; ``noted`` are warnings of its tools."""
    scene = mesh.scene
    counts = mesh.in_run(model.element_count), mesh.in_run(model.node_count)
    require_frames_fit(scene.process.frames, *counts, is_stack=len(scene.stack) > 1)
    needed = process_time_needed(model)
    remarks = scene_warnings(mesh.given) + process_time_remarks(scene, needed)
    closing = closing_tools(scene, blanks, model)
    require_space(scene, model, closing)
    remarks += tools_out_of_reach(scene, model) + tools_that_close(scene, model, closing)
    return CheckReport(
        scene=scene,
        element_count=counts[0],
        node_count=counts[1],
        ply_counts=[mesh.in_run(body.mesh.element_count) for body in model.bodies],
        effects=run_effects(scene, model),
        effect_parts=effect_parts(model),
        estimate=estimate_run(model, mesh.refinement),
        needed=needed,
        gaps=gaps,
        initial_overlap=model.tools.initial_overlap.tolist(),
        closing=closing,
        preview=_draping_preview(scene, blanks, model.tools),
        warnings=[scene.stack.in_own_words(text) for text in remarks + noted],
        picture=picture,
    )


def _with_picture(
    error: InputError,
    picture: Path | None,
    scene: Scene,
    blanks: Sequence[BlankMesh],
    marks: Sequence[tuple[float, float, float]],
) -> InputError:
    """Return an error of the tools that names the picture of the start."""
    if picture is None:
        return error
    try:
        draw_start(picture, scene, blanks, marks)
    except InputError:
        return error  # of the scene; that no picture can be written here is not what was asked
    return InputError(f"{error.message}. {picture} shows the start", key=error.key, file=error.file)


def _grips_of_plies(model: Model) -> list[list[ShownGrip]]:
    """Return what grippers hold of every ply, and where they pull at the start."""
    grips: list[list[ShownGrip]] = []
    for body in model.bodies:
        last = body.first_node + body.mesh.node_count
        inside = [
            (grip, grip.nodes[(grip.nodes >= body.first_node) & (grip.nodes < last)])
            for grip in model.grips
        ]
        positions = model.node_positions
        grips.append([(positions[own], g.pull_direction) for g, own in inside if own.size])
    return grips


def draw_start(
    path: Path,
    scene: Scene,
    blanks: Sequence[BlankMesh],
    marks: Sequence[tuple[float, float, float]] = (),
    grips: Sequence[Sequence[ShownGrip]] = (),
) -> None:
    """Draw the plies, tools and initial fibre directions, and mark places [m] of an overlap.

    A tool whose surface cannot be had is left out. ``grips`` are those of every ply.
    """
    from lcmchain.report import draw_initial, draw_stack

    # Infinite tools are shown a little beyond the blank, and as high as the blank is long.
    nodes = np.concatenate([blank.node_positions for blank in blanks])
    lowest, highest = nodes.min(axis=0), nodes.max(axis=0)
    size = float(max(highest - lowest))
    margin = np.array([0.1, 0.1, 0.5]) * size
    box = np.array([lowest - margin, highest + margin])
    surfaces = []
    for tool in scene.tools:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ToolWarning)  # said by the tool table
                surfaces.append((tool.name, *tool_surface(tool, scene.source.directory, box)))
        except InputError:
            continue  # what is wrong with it is the error that the picture goes with
    names = [ply.name for ply in scene.stack]
    angles = [ply.material.fibre_angles for ply in scene.stack]
    if len(blanks) > 1:
        plies = list(zip(names, blanks, strict=True))
        draw_stack(
            path, plies, surfaces, title=scene.title, marks=marks, angles=angles, grips=grips
        )
    else:
        of_it = grips[0] if grips else ()
        draw_initial(path, blanks[0], surfaces, marks=marks, angles=angles[0], grips=of_it)
