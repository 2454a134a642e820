"""Tables of the check for a terminal."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.check.effect_cost import Effect
from lcmchain.check.expected_cost import Estimate
from lcmchain.check.large_mesh import BUILDING_BYTES, PROGRAM_BYTES, frame_bytes
from lcmchain.check.tool_strokes import Closing
from lcmchain.check.tools_at_start import InitialGap
from lcmchain.judgements.quasi_static import PERIODS, ProcessTime
from lcmchain.quantities.readable import (
    duration_text,
    memory_text,
    millimetres,
    milliseconds_text,
    two_digits_up,
)
from lcmchain.scene import Process, Scene
from lcmchain.scene.presets import Basis, preset_basis
from lcmchain.scene.resin_stages import resin_stages
from lcmchain.scene.stages import at_work, first_stage, laid_later, stack_at
from lcmchain.tools.closest_gap import ClosestGap
from lcmchain.tools.motion import Motion, TurnMotion
from lcmchain.tools.surfaces.surface import Orientation
from lcmchain.tools.table import OVERLAP_TOLERANCE

if TYPE_CHECKING:
    from rich.table import Table

    from lcmchain.scene.stack import PlySettings


#: Parts of the time that effects take, where none is known.
NO_PARTS: Mapping[str, float] = MappingProxyType({})


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


def entry_table(title: str, entries: list[tuple[str, str]]) -> Table:
    """Keys of a scene and their values."""
    table = _table(title, "key", "value")
    for key, value in entries:
        table.add_row(_text(key), _text(value))
    return table


def basis_table(preset: str, rows: list[tuple[str, str, Basis]]) -> Table:
    """What the values rest on that a preset gives."""
    table = _table(f"Values of the preset {preset}", "key", "value", "rests on")
    for key, value, basis in rows:
        style = "yellow" if basis.carried_over else None
        table.add_row(_text(key), _text(value), _text(str(basis)), style=style)
    return table


def scene_tables(scene: Scene) -> list[Table]:
    """Entries of a scene, given and defaulted, and what those of a preset rest on."""
    of_presets = {
        getattr(material, "preset", ""): preset_basis(material)
        for material in scene.stack.materials.values()
    }
    return [
        entry_table("Given in the scene", scene.source.given),
        entry_table("Defaulted", scene.source.defaulted),
        *(basis_table(name, basis) for name, basis in of_presets.items() if basis),
    ]


def _fibres_of(ply: PlySettings) -> str:
    """Return the angle of the first fibres of a ply, for a film that it has none."""
    if ply.film:
        return "film"
    if not ply.material.has_directions:
        return "none"
    return f"{np.degrees(ply.blank.fibre_angle) + 0.0:.4g} deg"


def stack_tables(scene: Scene, element_counts: Sequence[int]) -> list[Table]:
    """Plies of a stack from the top down, as they lie, and what lies between them."""
    stack = scene.stack
    if len(stack) == 1:
        return []
    films = f" and {len(stack.films)} of films" if stack.films else ""
    later = laid_later(scene)
    plies = _table(
        f"Stack of {len(stack.preform)} plies{films}, {1e3 * stack.thickness:.4g} mm thick, "
        "top first",
        "ply", "material", "fibres 1", "thickness", "middle at z", "edge", "elements", "size",
    )  # fmt: skip
    for ply, count in reversed(list(zip(stack, element_counts, strict=True))):
        width, height = ply.blank.extent
        shift = ", ".join(f"{1e3 * way:.4g}" for way in ply.center)
        plies.add_row(
            _text(ply.name),
            _text(str(ply.material.name)),
            _fibres_of(ply),
            f"{1e3 * ply.thickness:.4g} mm",
            f"{1e3 * ply.blank.height + 0.0:.4g} mm",
            f"{1e3 * ply.blank.edge_length:.4g} mm",
            f"{count:,}",
            f"{1e3 * width:.4g} x {1e3 * height:.4g} mm"
            + (f", shifted by ({shift}) mm" if any(ply.center) else "")
            + (f", laid down in {first_stage(scene, ply)}" if ply in later else ""),
        )
    between = _table("Between plies", "plies", "what they do", "stiffness")
    for entry in stack.interfaces(scene.interfaces):
        names = (
            "all that no other entry names"
            if entry.between is None
            else " and ".join(entry.between)
        )
        stiffness = "automatic" if entry.penalty is None else f"{1e-9 * entry.penalty:.4g} MPa/mm"
        between.add_row(_text(names), entry.in_words(), stiffness)
    return [plies, between]


def active_in_words(effects: list[Effect]) -> str:
    """Name the effects that are simulated, in one line."""
    return ", ".join(effect.name for effect in effects if effect.active)


def course_tables(scene: Scene) -> list[Table]:
    """Courses that each ply is laid in, and the joints between them."""
    tables = []
    for ply in scene.stack:
        if ply.courses is None:
            continue
        of_ply = "" if len(scene.stack) == 1 else f" of {ply.name}"
        gap = ply.courses.gap
        joint = f"{1e3 * gap:.4g} mm open" if gap else "butt joints"
        table = _table(
            f"Courses{of_ply}, {joint}: from the lowest along fibre 2", "course", "from", "to",
            "width",
        )  # fmt: skip
        for name, strip in ply.strips.items():
            low, high = 1e3 * strip[0], 1e3 * strip[1]
            table.add_row(name, f"{low:.4g} mm", f"{high:.4g} mm", f"{high - low:.4g} mm")
        tables.append(table)
    return tables


def effect_table(
    effects: list[Effect],
    parts: Mapping[str, float] = NO_PARTS,
    measurable: Collection[str] = (),
) -> Table:
    """Effects, whether they are simulated, why, and the measured part of the time they take.

    parts : by the key of an effect; an effect of several tools has one for all of them.
    measurable : keys of the effects that can have one.
    """
    table = _table("Effects", "effect", "", "of the time", "why")
    for effect in effects:
        style = None if effect.active else "dim"
        part = ""
        if effect.active and effect.key in parts:
            part = "below 1 %" if parts[effect.key] < 0.01 else f"{100 * parts[effect.key]:.0f} %"
        elif effect.active and effect.key in measurable:
            part = "not measured"
        table.add_row(
            _text(effect.name),
            "yes" if effect.active else "no",
            part,
            _text(effect.reason),
            style=style,
        )
    if measurable and not parts:
        table.caption = "lcmchain study effects measures what each takes of the time"
        table.caption_justify = "left"
    return table


def preview_table(rows: list[tuple[str, str]]) -> list[Table]:
    """What kinematic draping says, in milliseconds."""
    if not rows:
        return []
    table = _table("Preview by kinematic draping (no forces, no wrinkles)", "", "")
    table.show_header = False
    for name, value in rows:
        table.add_row(_text(name), _text(value))
    return [table]


def gap_table(
    gaps: list[InitialGap], thickness: float, initial_overlap: list[float]
) -> list[Table]:
    """Gap of every tool to a blank of a thickness [m], and what of it [m] counts as a touch."""
    if not gaps:
        return []
    table = _table("Tools at the start", "tool", "gap", "nearest place, mm")
    for gap, overlap in zip(gaps, initial_overlap, strict=True):
        touching = abs(gap.gap) <= OVERLAP_TOLERANCE * thickness
        text = "touches" if touching else f"{1e3 * gap.gap:.3f} mm"
        if overlap > 0.0:
            text += f"; contact begins {1e6 * overlap:.2g} um deeper"
        place = millimetres(gap.position, 1).strip("() m")
        table.add_row(_text(gap.tool), text, place)
    return [table]


def closing_table(closing: list[Closing], scene: Scene) -> list[Table]:
    """Gaps between the tools that have the sheet between them, against its thickness."""
    if not closing:
        return []
    thickness = scene.stack.thickness
    table = _table(
        f"Gaps between tools; the sheet is {1e3 * thickness:.4g} mm thick",
        "tools", "at the end of the process", "closest on the way", "there at, mm",
    )  # fmt: skip
    for tools in closing:
        names = " and ".join(scene.tools[k].name for k in tools.pair)
        end, closest = tools.end, tools.closest
        place = millimetres(closest.place, 1).strip("() m")
        on_the_way = _gap_text(closest, thickness)
        if closest.time < end.time:
            on_the_way += f", at {1e3 * closest.time:.4g} ms"
        table.add_row(_text(names), _gap_text(end, thickness), on_the_way, place)
    return [table]


def _gap_text(closest: ClosestGap, thickness: float) -> str:
    """Say how large a gap is, in millimetres and in parts of the thickness [m] of the sheet."""
    if not np.isfinite(closest.gap):
        return "none over the blank"
    if closest.gap < 0.0:
        return f"overlap by {-1e3 * closest.gap:.3f} mm"
    return f"{1e3 * closest.gap:.3f} mm, {closest.gap / thickness:.0%} of the thickness"


def surface_table(gaps: list[InitialGap]) -> list[Table]:
    """Surfaces of the tools from files: what they are, where normals point, what was turned."""
    table = _table("Surfaces of tools", "tool", "triangles", "surface", "normals point", "turned")
    for gap in gaps:
        if gap.surface is not None:
            orientation = gap.surface.orientation
            table.add_row(
                _text(gap.tool),
                f"{len(gap.surface.triangles):,}",
                _parts(orientation),
                " and ".join(orientation.reasons),
                _turned(orientation),
            )
    return [table] if table.rows else []


def _parts(orientation: Orientation) -> str:
    if orientation.united > 1:
        return f"closed, the union of {orientation.united} solids"
    kinds = (("closed", orientation.closed), ("open", orientation.open))
    return ", ".join(
        kind if count == 1 else f"{kind} ({count} parts)" for kind, count in kinds if count
    )


def _turned(orientation: Orientation) -> str:
    counts = (
        (orientation.against_neighbours, "to agree with their neighbours"),
        (orientation.with_part, "with their part"),
    )
    return ", ".join(f"{count:,} {how}" for count, how in counts if count) or "none"


def stage_table(scene: Scene) -> list[Table]:
    """Stages of the process in their order: time, what is at work, and what moves how."""
    if not scene.stages:
        return []
    table = _table("Stages", "stage", "time", "at work", "motions", "damping")
    others: tuple[Any, ...] = (*scene.tools, *scene.grippers, *scene.pressure)
    lying = {ply.name for ply in stack_at(scene, 0.0)}
    resin = {} if scene.wet_forming is None else {own.name: own for own in resin_stages(scene)}
    for stage, plan in zip(scene.stages, scene.stage_plans(), strict=True):
        time = milliseconds_text(stage.time)
        if stage.time_is_found:
            time = f"found: {time} at the fastest"
        elif stage.rest:
            time = f"until rest, at most {time}"
        if stage.name in resin:
            own = resin[stage.name]
            span = own.resin_end - own.resin_start
            time += f"; for the resin {span:.4g} s" if own.flows else "; the resin stands still"
        works = ", ".join(entry.name for entry in others if at_work(entry, stage)) or "nothing"
        laid = [p.name for p in laid_later(scene) if at_work(p, stage) and p.name not in lying]
        if laid:
            works += f"; laid down: {', '.join(laid)}"
            lying.update(laid)
        damping = "stopped at peaks of the kinetic energy"
        if not stage.rest:
            damping = f"{plan.mass_damping:.4g} 1/s"
        table.add_row(
            _text(stage.name),
            time,
            _text(works),
            _text(", ".join(_motion_in_words(*item) for item in stage.motions.items()) or "none"),
            damping,
        )
    return [table]


def _motion_in_words(name: str, motion: Motion) -> str:
    if isinstance(motion, TurnMotion):
        return f"{name} {math.degrees(motion.angle):.4g} degrees"
    way = getattr(motion, "distance", None)
    if way is None and hasattr(motion, "travel"):
        way = motion.travel[-1]
    if way is not None:
        return f"{name} {1e3 * way:.4g} mm"
    load = getattr(motion, "load", None)
    return f"{name} {motion.type}" + ("" if load is None else f" with {load:.4g} N")


def cost_table(
    estimate: Estimate,
    process: Process,
    *,
    element_count: int,
    node_count: int,
    time_is_found: bool = False,
    is_stack: bool = False,
) -> Table:
    """Size of the mesh, steps, computing time and memory."""
    table = _table("Expected cost", "", "")
    table.show_header = False
    table.add_row("elements", f"{element_count:,}")
    table.add_row("nodes", f"{node_count:,}")
    frames = process.frames * frame_bytes(element_count, node_count, is_stack=is_stack)
    mesh = BUILDING_BYTES * element_count
    table.add_row(
        "memory",
        f"about {memory_text(PROGRAM_BYTES + mesh + frames)}: {memory_text(PROGRAM_BYTES)} for the "
        f"program, {memory_text(mesh)} for the mesh, {memory_text(frames)} for the saved frames",
    )
    table.add_row(
        "process time",
        f"{_time_text(process, time_is_found)}, {process.frames} saved frames",
    )
    table.add_row(
        "critical time step",
        f"{1e6 * estimate.critical_step:.3g} us at the start, set by {estimate.controlled_by}",
    )
    least, most = estimate.range
    steps = f"about {estimate.step_count:,}"
    if time_is_found:
        steps += ", and more where the pace is lower"
    if most > 1.01 * least:
        steps += f" ({least:,} without shear, {most:,} with much)"
    table.add_row("steps", steps)
    table.add_row(
        "computing time",
        f"about {duration_text(estimate.seconds)} once compiled "
        f"({1e6 * estimate.speed.seconds_per_element_step:.3f} us per element and step, "
        f"{estimate.speed.source})",
    )
    return table


def _time_text(process: Process, time_is_found: bool) -> str:
    if time_is_found:
        return f"found: {milliseconds_text(process.time)} at the fastest"
    return f"{1e3 * process.time:g} ms"


def process_time_table(
    needed: ProcessTime, process: Process, *, time_is_found: bool = False
) -> Table:
    """How long a quasi-static process of the sheet takes."""
    table = _table("Process time of a quasi-static run", "", "")
    table.show_header = False
    table.add_row("process.time", _time_text(process, time_is_found))
    table.add_row(
        "slowest shear vibration",
        f"{milliseconds_text(needed.period)} at rest, "
        f"{milliseconds_text(needed.softened_period)} where the law is softest",
    )
    table.add_row(
        "needed",
        "the pace follows the kinetic energy; process.quasi_static = 2 takes twice as long"
        if time_is_found
        else f"at least {two_digits_up(1e3 * needed.least)} ms ({PERIODS[0]} periods at rest); "
        f"from {milliseconds_text(needed.sufficient)} on ({PERIODS[1]} periods where softest) "
        "nothing should change any more",
    )
    for name, period in needed.holder_periods.items():
        table.add_row(f"{name} on the sheet", f"vibrates with {milliseconds_text(period)}")
    return table
