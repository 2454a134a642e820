"""How far nodes reach into tools and other plies, and what that hides of the compaction.

Also strokes that a force was to end and did not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.effects.contact_depth import nominal_pressure
from lcmchain.elements.family import Body
from lcmchain.fields.saved import tables_of_tools
from lcmchain.judgements.grades import GOOD, GRADES, Verdict, grade_of, share
from lcmchain.quantities.readable import milliseconds_text, percent
from lcmchain.scene import Scene
from lcmchain.solver import guards
from lcmchain.state import STOPPED_TIME
from lcmchain.thresholds import (
    BAD,
    LARGEST_HIDDEN_FORCE,
    LARGEST_HIDDEN_THICKNESS,
    LARGEST_PENETRATION,
    LARGEST_PLY_DEPTH,
)
from lcmchain.tools.distance import gaps
from lcmchain.tools.table import yields

if TYPE_CHECKING:
    from lcmchain.model import Model
    from lcmchain.solver.simulation import Snapshot
    from lcmchain.state import State


def penetration_warnings(summary: Mapping[str, Any], thickness: float) -> list[str]:
    """Say which tools nodes reached too far into.

    thickness : of the fabric [m].
    """
    return [
        f"nodes reached {1e3 * depth:.2f} mm into {tool}; set "
        f"{summary.get('contact_penalty_needed', 'a larger contact.penalty')}"
        for tool, depth in summary["penetration_max_m"].items()
        if depth > LARGEST_PENETRATION * thickness
    ]


def penetration_verdict(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    """Judge the deepest node in a tool."""
    depths = summary.get("penetration_max_m")
    if not depths:
        return
    tool, depth = max(depths.items(), key=lambda item: item[1])
    thickness = scene.stack.least_thickness
    limit = LARGEST_PENETRATION * thickness
    grade = grade_of(depth, limit, guards.DEEPEST_PENETRATION * thickness)
    text = f"nodes reach up to {1e3 * depth:.3f} mm into {tool} (good up to {1e3 * limit:.2g} mm)"
    yield Verdict("Penetration", grade, text, "contact.penalty" if grade != GOOD else "")


def ply_depth_warnings(summary: Mapping[str, Any]) -> list[str]:
    """Say which ply nodes of another one reached so far into that the verdict on it is bad.

    Less than that single nodes at the rim of a ply reach for a moment, of which no run warns.
    """
    deepest = summary.get("stack", {}).get("ply_depth")
    if deepest is None or not deepest["part"] > BAD * LARGEST_PLY_DEPTH:
        return []
    return [
        f"{_reach_into_ply(deepest).format(percent(deepest['part']))}, and thickness and pressure "
        "are not known there; set a higher interfaces.penalty, or shorten the edges"
    ]


def _reach_into_ply(deepest: Mapping[str, Any]) -> str:
    """Say where a node is deepest in another ply, with {} for its part of the thinner one."""
    return (
        f"nodes of {deepest['ply']} reach up to {1e3 * deepest['depth_m']:.3f} mm into "
        f"{deepest['into']}, at {milliseconds_text(deepest['time_s'])}: {{}} of the thinner one"
    )


def ply_depth_verdict(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    """Judge the deepest node of a ply in another one."""
    deepest = summary.get("stack", {}).get("ply_depth")
    if deepest is None:
        return
    yield share(
        "Depth between plies",
        deepest["part"],
        LARGEST_PLY_DEPTH,
        _reach_into_ply(deepest),
        "thickness and pressure are not known there; a ply whose rim dents another one does so at "
        "single nodes",
        "interfaces.penalty, edge_length",
    )


# --- what the depth of nodes in the tools hides of the compaction ---------------------------------
# Two tools that close to a gap leave a sheet thicker by the depths of its nodes in both of them. A
# law of compaction that stiffens turns a few hundredths of the thickness into a large part of the
# pressure. Tools that a force guides are left out: under a given force the thickness does not
# depend on how deep they stand.


def hidden_compaction(model: Model, snapshots: Sequence[Snapshot]) -> dict[str, float]:
    """Return what depths hide in the frame in which the sheet between tools is pressed most.

    Returns
    -------
    ``hidden_thickness_part`` : by how much the sheet between tools is too thick, in parts of its
    thickness, weighted with the pressure. ``hidden_force_part`` : by how much the force over its
    thickness would be larger without the depths, by the law of the material, in parts of it. Both
    are absent where no frame has a sheet between two tools with prescribed motions.
    """
    tools = np.flatnonzero(~yields(model.tools)).tolist()
    bodies = [body for body in model.bodies if body.mesh.has_thickness]
    if len(tools) < 2 or not bodies:
        return {}
    force, largest = 0.0, {}
    for snapshot in snapshots:
        depth = _depths(model, tools, snapshot)
        for body in bodies:
            pressed, measures = _of_body(body, snapshot.position, depth)
            if pressed > force:
                force, largest = pressed, measures
    return largest


def _depths(model: Model, tools: Sequence[int], snapshot: Snapshot) -> np.ndarray:
    """Return how deep nodes with contact lie in their tool (node_count,) [m], -inf for the others.

    Depths that are driven to zero lie on both sides of it.
    """
    depth, at_work = np.full(model.node_count, -np.inf), model.tools_at_work(snapshot.time)
    for tool in tools:
        if not at_work[tool]:
            continue
        travel = float(snapshot.tool_travel[tool])
        gap = gaps(model.tools, tool, snapshot.position, travel)
        gap -= model.nodes.offset - model.tools.initial_overlap[tool]
        depth = np.maximum(depth, -gap)
    return np.where(snapshot.contact_force > 0.0, depth, -np.inf)


def _of_body(
    body: Body, positions: np.ndarray, depth: np.ndarray
) -> tuple[float, dict[str, float]]:
    """Return the force over the thickness between tools [N], and what depths hide of it."""
    elements = body.mesh.elements + body.first_node
    bottom, top = depth[elements[:, :4]], depth[elements[:, 4:]]
    at_rest = body.material.thickness
    # A node further away than that is pushed by another tool: one that a force guides.
    least = -0.5 * at_rest
    between = (bottom > least).all(axis=1) & (top > least).all(axis=1)
    if not between.any():
        return 0.0, {}
    corners = positions[elements[between]]
    area, thickness = _area_and_thickness(corners)
    hidden = bottom[between].mean(axis=1) + top[between].mean(axis=1)
    pressure = nominal_pressure(body.material, thickness / at_rest)
    truly = nominal_pressure(body.material, (thickness - hidden) / at_rest)
    force = float(area @ pressure)
    if not force > 0.0:
        return 0.0, {}
    return force, {
        "hidden_thickness_part": float((area * pressure) @ (hidden / thickness)) / force,
        "hidden_force_part": float(area @ truly) / force - 1.0,
    }


def _area_and_thickness(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return area [m²] and thickness [m] of elements (count, 8, 3) at their centres."""
    middle = 0.5 * (corners[:, :4] + corners[:, 4:])
    normal = 0.5 * np.cross(middle[:, 2] - middle[:, 0], middle[:, 3] - middle[:, 1])
    area = np.linalg.norm(normal, axis=1)
    director = corners[:, 4:].mean(axis=1) - corners[:, :4].mean(axis=1)
    return area, np.einsum("ei,ei->e", director, normal) / area


def hidden_compaction_warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    """Say where the pressure between tools is not that of the law at their gap."""
    thickness = summary.get("hidden_thickness_part", 0.0)
    force = summary.get("hidden_force_part", 0.0)
    if thickness > LARGEST_HIDDEN_THICKNESS or force > LARGEST_HIDDEN_FORCE:
        yield hidden_text(thickness, force) + '; set contact.depth = "zero"'


def hidden_text(thickness: float, force: float) -> str:
    """Say how much of thickness and force the depths in the tools hide."""
    return (
        f"between tools the sheet is {100.0 * thickness:.2g} % too thick, and at their gap the law "
        f"gives {100.0 * force:.2g} % more pressure, since nodes reach into the tools"
    )


def hidden_compaction_verdict(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    """Judge how far the pressure between tools is off the law at their gap."""
    if "hidden_force_part" not in summary:
        return
    thickness, force = summary["hidden_thickness_part"], summary["hidden_force_part"]
    grades = (
        grade_of(thickness, LARGEST_HIDDEN_THICKNESS, BAD * LARGEST_HIDDEN_THICKNESS),
        grade_of(force, LARGEST_HIDDEN_FORCE, BAD * LARGEST_HIDDEN_FORCE),
    )
    grade = max(grades, key=GRADES.index)
    text = (
        f"{hidden_text(thickness, force)} (good up to {percent(LARGEST_HIDDEN_THICKNESS)} and "
        f"{percent(LARGEST_HIDDEN_FORCE)})"
    )
    remedy = "contact.depth, contact.penalty" if grade != GOOD else ""
    yield Verdict("Pressure between tools", grade, text, remedy)


# --- strokes that a force was to end --------------------------------------------------------------


def stop_warnings(model: Model, state: State) -> Iterator[str]:
    """Say which strokes went their whole way without the force that was to end them."""
    for number, tools in enumerate(tables_of_tools(model)):
        for tool in np.flatnonzero(np.isfinite(tools.until_force)).tolist():
            over = state.time >= tools.stroke_end[tool] * (1.0 - 1e-12)
            if over and np.isinf(state.tool_stopped[tool, number, STOPPED_TIME]):
                name = model.tool_names[tool]
                stage = f"stages.{model.stages[number].name}.motions.{name}" if model.stages else ""
                yield (
                    f"{name} went its whole stroke of {1e3 * abs(tools.stroke_distance[tool]):.4g} "
                    f"mm, and the sheet never pressed against it with "
                    f"{tools.until_force[tool]:.4g} N; give a longer distance or a smaller "
                    f"until_force in {stage or f'tools.{name}.motion'}"
                )
