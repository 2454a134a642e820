"""What a scene will simulate and why, what it costs, and whether it can start."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.blank import BlankMesh, build_blank
from lcmchain.errors import InputError
from lcmchain.fields.dataset import NO_THICKNESS
from lcmchain.model import AUTOMATIC_PENALTY
from lcmchain.scene.schema import (
    FabricMaterial,
    GuidedMotion,
    IsotropicMaterial,
    MembraneShellElement,
    OrthotropicMaterial,
    PlateWithHole,
    Scene,
    StiffnessMaterial,
    StrokeMotion,
    TableMotion,
    Tool,
)
from lcmchain.tools.distance import gaps as node_gaps
from lcmchain.tools.motion import STANDARD_GRAVITY
from lcmchain.tools.table import ToolTable, build_tool_table
from lcmchain.triangulation import TriangleMesh, triangulate

if TYPE_CHECKING:
    from rich.table import Table

#: Deepest overlap of a tool with the blank that still counts as touching, in parts of thickness.
OVERLAP_TOLERANCE = 0.01

#: Time per element and step on one core that the estimate assumes, by the kind of element.
SECONDS_PER_ELEMENT_STEP = {"solid-shell": 0.12e-6, "membrane-shell": 0.05e-6}


@dataclass(frozen=True)
class Effect:
    """A piece of physics, whether the scene calls for it, and why."""

    name: str
    active: bool
    reason: str


@dataclass(frozen=True)
class Estimate:
    """Expected cost of a run.

    Parameters
    ----------
    critical_step : stable time step of the undeformed blank [s].
    step_count : steps of the whole process, with the scene's safety factor.
    seconds : expected computing time [s], without compilation.
    controlled_by : what limits the step, in words.
    """

    critical_step: float
    step_count: int
    seconds: float
    controlled_by: str


@dataclass(frozen=True)
class InitialGap:
    """Smallest distance between a tool and the blank before anything moves.

    Parameters
    ----------
    tool : name of the tool.
    gap : signed distance of the nearest node [m], negative inside the tool.
    position : that node [m].
    """

    tool: str
    gap: float
    position: tuple[float, float, float]


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
            _entry_table("Given in the scene", self.scene.source.given),
            _entry_table("Defaulted", self.scene.source.defaulted),
            _effect_table(self.effects),
            *([_gap_table(self.gaps, self.scene.material.thickness)] if self.gaps else []),
            _cost_table(self),
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
    from lcmchain.report.start import draw_initial
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


# --- tools at the start ---------------------------------------------------------------------------


def initial_gaps(
    tools: Sequence[Tool], blank: BlankMesh, tool_table: ToolTable
) -> list[InitialGap]:
    """Measure the smallest distance of every tool to the blank's nodes before anything moves."""
    positions = np.ascontiguousarray(blank.node_positions, dtype=np.float64)
    nearest = []
    for index, tool in enumerate(tools):
        gaps = node_gaps(tool_table, index, positions, 0.0)
        node = int(np.argmin(gaps))
        nearest.append(InitialGap(tool.name, float(gaps[node]), tuple(positions[node].tolist())))
    return nearest


def require_no_initial_overlap(
    scene: Scene, blank: BlankMesh, tool_table: ToolTable
) -> list[InitialGap]:
    """Stop when a tool reaches into the blank at the start, deeper than 1 % of the thickness.

    Such a tool would push the blank away with a jump of contact force that no process has.

    Parameters
    ----------
    scene : validated scene.
    blank : its mesh.
    tool_table : its tools, in the order of ``scene.tools``.

    Returns
    -------
    The smallest gap of every tool.

    Raises
    ------
    InputError : names every tool that overlaps, the depth and the place.
    """
    gaps = initial_gaps(scene.tools, blank, tool_table)
    tolerance = OVERLAP_TOLERANCE * scene.material.thickness
    sentences = []
    keys = []
    for index, gap in enumerate(gaps):
        if gap.gap >= -tolerance:
            continue
        x, y, z = (1e3 * coordinate for coordinate in gap.position)
        keys.append(f'tools[{index}] "{gap.tool}".position')
        sentences.append(
            f"the tool reaches {-1e3 * gap.gap:.3g} mm into the blank at the start, deepest at "
            f"({x:.4g}, {y:.4g}, {z:.4g}) mm; the blank lies between z = "
            f"{1e3 * (scene.blank.height - scene.material.thickness / 2):.4g} mm and "
            f"{1e3 * (scene.blank.height + scene.material.thickness / 2):.4g} mm. Move the tool, "
            "or set blank.height"
        )
    if len(keys) == 1:
        raise InputError(sentences[0], key=keys[0])
    if keys:
        lines = "".join(f"\n  {key}: {text}" for key, text in zip(keys, sentences))
        raise InputError(f"{len(keys)} tools overlap the blank at the start:{lines}", key="tools")
    return gaps


# --- effects --------------------------------------------------------------------------------------


def scene_effects(scene: Scene) -> list[Effect]:
    """List the effects that a scene calls for and those it does without, each with the reason."""
    process = scene.process
    if isinstance(scene.element, MembraneShellElement):
        effects = _membrane_shell_effects()
    else:
        effects = _solid_shell_effects(scene)

    def add(name: str, active: bool, reason: str) -> None:
        effects.append(Effect(name, active, reason))

    if not scene.tools:
        add("contact", False, "the scene has no tool")
    for tool in scene.tools:
        add(f"contact with {tool.name}", True, f"{tool.shape.type.replace('_', ' ')}")
        rough = tool.friction > 0.0
        add(f"friction on {tool.name}", rough, f"coefficient {tool.friction:g}")
        if isinstance(tool.motion, GuidedMotion):
            add(f"guided tool {tool.name}", True, _guided_reason(tool.motion))
        elif isinstance(tool.motion, (StrokeMotion, TableMotion)):
            add(f"prescribed motion of {tool.name}", True, _prescribed_reason(tool.motion))
    add(
        "contact damping",
        bool(scene.tools) and scene.contact.damping_ratio > 0.0,
        f"contact.damping_ratio = {scene.contact.damping_ratio:g}",
    )
    add(
        "gravity",
        process.gravity,
        "9.81 m/s2 along -z on the blank" if process.gravity else "process.gravity = false",
    )
    add("mass damping", process.mass_damping > 0.0, f"{process.mass_damping:g} 1/s")
    if not scene.mapping:
        add("mapping", False, "no [[mapping]] entry")
    for target in scene.mapping:
        add(f"mapping to {target.name}", True, f"{target.kind} mesh {target.mesh}, {target.method}")
    law = scene.permeability.law if scene.permeability else "no [permeability] entry"
    add("permeability", scene.permeability is not None, law)
    return effects


def _membrane_shell_effects() -> list[Effect]:
    return [
        Effect("thickness", False, NO_THICKNESS),
        Effect("compaction", False, "the mid-surface has no thickness direction"),
        Effect("bending", True, "C^B, superimposed on the membrane; rotation-free"),
        Effect("transverse shear", False, "the normal of a triangle stays normal"),
        Effect("hourglass control", False, "constant strain triangles have no zero-energy mode"),
        Effect("enhanced strain", False, "no thickness direction"),
    ]


def _solid_shell_effects(scene: Scene) -> list[Effect]:
    material, element = scene.material, scene.element
    if isinstance(material, FabricMaterial):
        measure = {"normal": "normal thickness", "director": "length of the director"}
        law = f"C33 = c0 exp(c1 |E33|^c2), measured by the {measure[element.compaction_strain]}"
        compaction = Effect("compaction", True, law)
        bending = "C^B is independent of the membrane"
    else:
        law = f"the {material.law} law has a constant stiffness C33"
        compaction = Effect("compaction", False, law)
        bending = _bending_reason(material)
    row = "with" if element.in_plane_shear_hourglass else "without"
    hourglass = f"one in-plane integration point; {element.hourglass}, {row} the in-plane shear row"
    coupled = couples_thickness(scene)
    return [
        compaction,
        Effect("bending", True, bending),
        Effect("transverse shear", True, "assumed natural strains, C13 and C23"),
        Effect("hourglass control", True, hourglass),
        Effect(
            "enhanced strain",
            coupled,
            f"normal and in-plane strains {'couple' if coupled else 'do not couple'}",
        ),
    ]


def couples_thickness(scene: Scene) -> bool:
    """Tell whether the material couples the normal strain 33 with the in-plane strains."""
    material = scene.material
    if isinstance(material, IsotropicMaterial):
        return material.poisson_ratio != 0.0
    if isinstance(material, OrthotropicMaterial):
        return material.nu13 != 0.0 or material.nu23 != 0.0
    if isinstance(material, StiffnessMaterial):
        matrices = np.array([material.membrane, material.bending])
        return bool(np.any(matrices[:, 2, [0, 1, 3]]))
    return False


def _bending_reason(material) -> str:
    if isinstance(material, StiffnessMaterial):
        return "C^B given by material.bending"
    if isinstance(material, OrthotropicMaterial) and material.bending_factor != 1.0:
        return f"C^B = {material.bending_factor:g} C^M"
    return "C^B = C^M"


def _guided_reason(motion: GuidedMotion) -> str:
    load = guided_load(motion)
    return f"{motion.mass:g} kg under {load:.4g} N along its direction"


def guided_load(motion: GuidedMotion) -> float:
    """Force along the direction of travel from weight and given force [N]."""
    weight = -STANDARD_GRAVITY * motion.mass * motion.direction[2] if motion.gravity else 0.0
    return motion.force + weight


def _prescribed_reason(motion: StrokeMotion | TableMotion) -> str:
    if isinstance(motion, StrokeMotion):
        duration = 1e3 * (motion.end - motion.start)
        return f"{motion.profile} stroke of {1e3 * motion.distance:g} mm in {duration:g} ms"
    return f"table of {len(motion.times)} times, {1e3 * motion.travel[-1]:g} mm at the end"


# --- cost -----------------------------------------------------------------------------------------


def estimate_run(scene: Scene, mesh: BlankMesh | TriangleMesh) -> Estimate:
    """Estimate time step, step count and computing time from the undeformed blank.

    The step follows from the fastest elastic wave: in-plane over the shortest edge, or over the
    thickness, and from the automatic contact stiffness. Compaction and a given
    ``contact.penalty`` may shorten it during a run.
    """
    density = scene.material.areal_mass / scene.material.thickness
    in_plane_stiffness, normal_stiffness = _wave_stiffnesses(scene)
    shortest_edge = _shortest_edge(mesh)
    steps = {"in-plane waves": shortest_edge / math.sqrt(in_plane_stiffness / density)}
    if not isinstance(scene.element, MembraneShellElement):
        thickness_wave = math.sqrt(normal_stiffness / density)
        steps["waves over the thickness"] = scene.material.thickness / thickness_wave
    controlled_by = min(steps, key=steps.get)
    critical_step = steps[controlled_by] * _contact_share(scene)
    step_count = math.ceil(scene.process.time / (critical_step * scene.process.step_safety))
    seconds = step_count * mesh.element_count * SECONDS_PER_ELEMENT_STEP[scene.element.type]
    return Estimate(critical_step, step_count, seconds, controlled_by)


def _contact_share(scene: Scene) -> float:
    """Return the part of the time step that the automatic contact stiffness leaves."""
    if not scene.tools or scene.contact.penalty is not None:
        return 1.0
    return 1.0 / math.sqrt(1.0 + AUTOMATIC_PENALTY)


def _wave_stiffnesses(scene: Scene) -> tuple[float, float]:
    """Largest in-plane and largest normal stiffness of the undeformed material [Pa]."""
    material = scene.material
    if isinstance(material, FabricMaterial):
        membrane, bending = material.membrane, material.bending
        in_plane = max(membrane.C11, membrane.C22, bending.C11, bending.C22)
        return in_plane, max(material.compaction.c0, bending.C33)
    if isinstance(material, IsotropicMaterial):
        nu = material.poisson_ratio
        stiffness = material.young_modulus * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
        return stiffness, stiffness
    if isinstance(material, OrthotropicMaterial):
        matrix = np.linalg.inv(material.normal_compliance) * material.E1
        matrix *= max(1.0, material.bending_factor)
        return float(max(matrix[0, 0], matrix[1, 1])), float(matrix[2, 2])
    diagonal = np.maximum(np.diag(material.membrane), np.diag(material.bending))
    return float(max(diagonal[0], diagonal[1])), float(diagonal[2])


def _shortest_edge(mesh: BlankMesh | TriangleMesh) -> float:
    corners = mesh.node_positions[mesh.elements[:, :4]]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return float(lengths[lengths > 0.0].min())  # a triangle repeats its last node


# --- warnings -------------------------------------------------------------------------------------


def scene_warnings(scene: Scene) -> list[str]:
    """Say what is allowed but probably not meant."""
    found = [NO_THICKNESS] if isinstance(scene.element, MembraneShellElement) else []
    material, process = scene.material, scene.process
    if isinstance(material, FabricMaterial):
        if material.fibre_volume_fraction > 0.9:
            found.append(
                f"the fibre volume fraction of the unloaded fabric is "
                f"{material.fibre_volume_fraction:.2f}, more than fibres can be packed to"
            )
        director = getattr(scene.element, "compaction_strain", None) == "director"
        if director and scene.tools:
            found.append(
                'element.compaction_strain = "director" (as published) lets elements fold over on '
                'small radii under pressure; "normal" does not'
            )
    moved = [tool for tool in scene.tools if isinstance(tool.motion, (StrokeMotion, TableMotion))]
    loaded = [
        tool
        for tool in scene.tools
        if isinstance(tool.motion, GuidedMotion) and guided_load(tool.motion) != 0.0
    ]
    if not moved and not loaded and not process.gravity:
        found.append("nothing moves: no tool is driven and process.gravity is false")
    for tool in scene.tools:
        motion = tool.motion
        if isinstance(motion, GuidedMotion) and guided_load(motion) < 0.0:
            found.append(
                f'the load on "{tool.name}" ({guided_load(motion):.3g} N) points against its '
                "direction of travel"
            )
        if isinstance(motion, TableMotion) and motion.times[-1] > process.time * (1 + 1e-12):
            found.append(f'the motion table of "{tool.name}" goes on after process.time')
        if isinstance(tool.shape, PlateWithHole):
            if 0.0 < tool.shape.fillet_radius < scene.blank.edge_length:
                found.append(
                    f'the fillet of "{tool.name}" ({1e3 * tool.shape.fillet_radius:g} mm) is '
                    f"smaller than the elements ({1e3 * scene.blank.edge_length:g} mm)"
                )
            if tool.shape.fillet_radius == 0.0:
                found.append(f'the hole of "{tool.name}" has a sharp edge (fillet_radius = 0)')
    return found


# --- tables ---------------------------------------------------------------------------------------


def _table(title: str, *columns: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _text(content: str):
    from rich.text import Text

    return Text(content)  # brackets in scene values are no markup


def _entry_table(title: str, entries: list[tuple[str, str]]) -> Table:
    table = _table(title, "key", "value")
    for key, value in entries:
        table.add_row(_text(key), _text(value))
    return table


def _effect_table(effects: list[Effect]) -> Table:
    table = _table("Effects", "effect", "", "why")
    for effect in effects:
        style = None if effect.active else "dim"
        table.add_row(
            _text(effect.name), "yes" if effect.active else "no", _text(effect.reason), style=style
        )
    return table


def _gap_table(gaps: list[InitialGap], thickness: float) -> Table:
    table = _table("Tools at the start", "tool", "gap", "nearest node, mm")
    for gap in gaps:
        touching = abs(gap.gap) <= OVERLAP_TOLERANCE * thickness
        text = "touches" if touching else f"{1e3 * gap.gap:.3f} mm"
        place = ", ".join(f"{1e3 * coordinate:.1f}" for coordinate in gap.position)
        table.add_row(_text(gap.tool), text, place)
    return table


def _cost_table(report: CheckReport) -> Table:
    estimate, process = report.estimate, report.scene.process
    table = _table("Expected cost", "", "")
    table.show_header = False
    table.add_row("elements", f"{report.element_count:,}")
    table.add_row("nodes", f"{report.node_count:,}")
    table.add_row("process time", f"{1e3 * process.time:g} ms, {process.frames} saved frames")
    table.add_row(
        "critical time step",
        f"{1e6 * estimate.critical_step:.3g} us at the start, set by {estimate.controlled_by}",
    )
    table.add_row("steps", f"about {estimate.step_count:,}")
    table.add_row("computing time", f"about {estimate.seconds:.3g} s on one core, once compiled")
    return table
