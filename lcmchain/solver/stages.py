"""The border between two stages of a process: what comes to work, what leaves, and what that books.

Tables of the new stage come from the model (:mod:`lcmchain.stages`). Here the state is made ready
for them. What leaves takes its energy along, and the balance counts that as work of the outside:
the springs of contact and of friction of a tool, the motion of a guided one that is held from now
on, what the laws of an interface stored that the plies no longer have. Energies of springs are
taken half a step before, as central differences conserve them
(:meth:`lcmchain.model.Model.renew`).

A ply that is laid down at a border waits until then at its place of the scene, flat and at rest:
its nodes are held, no tool and no other ply touches it, and nothing loads it. Then it is as any
other. What has been formed until then has another shape than at the start, so that its place is
checked when it comes: a flat ply is laid on a flat flange, or on a stack that is as flat. A tool
touches it by less than counts, or not at all. What its springs hold then has come with the ply, and
the balance counts it as work of the outside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from lcmchain.elements.family import Body
from lcmchain.errors import SimulationError
from lcmchain.interfaces.change import change_interfaces
from lcmchain.interfaces.forces import REFRESHES_LEFT, STEPS_LEFT
from lcmchain.model import Model
from lcmchain.quantities.readable import millimetres
from lcmchain.solver.guards import when
from lcmchain.stages import StageTables
from lcmchain.state import (
    CONTACT,
    EXTERNAL,
    KINETIC,
    PACE,
    PLY_REFRESH,
    STAGE,
    START_OVERLAP,
    START_TRAVEL,
    State,
)
from lcmchain.tools.distance import gaps
from lcmchain.tools.motion import GUIDED
from lcmchain.tools.table import OVERLAP_TOLERANCE, ROUNDING

#: How deep a ply may be laid into another one, in parts of the thickness of the thinner one. A
#: point that is found inside another ply begins without force there; a sheared flange is thicker by
#: some percent than the flat one that the height of the next ply was found from.
DEEPEST_LAID = 0.1
#: Places of an element at which the room that it takes up is looked at, along either side.
PLACES = 3
#: Of a face; a triangle repeats its last one.
CORNERS = 4


def is_over(model: Model, state: State) -> bool:
    """Tell whether the present stage has come to its end, and another one follows."""
    stage = model.present_stage
    follows = model.stage + 1 < len(model.stages)
    return stage is not None and follows and state.time >= stage.end


def begin_first(model: Model, state: State) -> None:
    """Make a state at rest ready for the first stage.

    Grippers that hold, and are not at work in it, let the nodes free. Plies that are laid down
    later are held where they wait.
    """
    if model.supports is not None:
        state.gripped_at[:] = state.position
    if model.lets_go:
        state.free[:] = model.stages[0].free(model.whole, state.support_let_go)


def begin_stage(model: Model, state: State, number: int, arrays: object) -> Model:
    """Begin a stage, and return the model in it.

    Parameters
    ----------
    model : in the stage that has ended. number : of the one that begins. arrays : of the loop.

    Raises
    ------
    SimulationError : a tool that comes to work reaches into the sheet, or a ply that is laid down
        lies in a tool or in another ply; the state is that before.
    """
    before, now = model.stages[model.stage], model.stages[number]
    overlap = _overlap_of_newcomers(model, state, before, now)
    laid_down = newcomers(model, before, now)
    if laid_down:
        require_clear(model, state, before, now, laid_down)
    for tool in np.flatnonzero(before.tools_at_work & ~now.tools_at_work).tolist():
        _take_away(state, CONTACT, _take_contact_away(model, state, tool))
    _hold_guided(before, now, state)
    onward = _at_same_stop(before, now)
    state.tool_start[~onward, START_TRAVEL] = state.tool_travel[~onward]
    state.tool_start[:, START_OVERLAP] = overlap
    _begin_grippers(model, state, before, now)
    if model.supports is not None:
        state.gripped_at[:] = state.position
    if model.lets_go:
        state.free[:] = now.free(model.whole, state.support_let_go)
    if laid_down:
        energy = lay_down(model, state, before, now, laid_down)
        _take_away(state, CONTACT, -energy)
    if now.ply_contact is not None and before.ply_contact is not None:
        data = now.ply_contact.data
        if (data.interface != before.ply_contact.data.interface).any():
            given = change_interfaces(data, now.ply_contact.laws, arrays, state.last_step)
            state.work[PLY_REFRESH] -= given
            state.work[CONTACT] += given
            state.ply_acts[:] = 1
            state.ply_counters[STEPS_LEFT] = 0
    if now.pace is None:
        state.clock[PACE] = 1.0
    if model.averaging is not None and np.isinf(now.averaging or 0.0):
        state.mean_velocity[:] = 0.0
    state.counters[STAGE] = number
    return model.in_stage(number, state)


def _take_away(state: State, column: int, energy: float) -> None:
    """Take an energy [J] out of the sheets' and tools', as work of the outside.

    column : of ``State.work`` that holds it since the last step, which the next one makes anew.
    """
    state.work[EXTERNAL] -= energy
    state.work[column] -= energy


def _overlap_of_newcomers(
    model: Model, state: State, before: StageTables, now: StageTables
) -> np.ndarray:
    """Return the depth of every tool in the sheet up to which it exerts no force [m].

    A tool that comes to work may touch the sheet, as at the start of a process.

    Raises
    ------
    SimulationError : one reaches into the sheet; names all of them.
    """
    overlap = state.tool_start[:, START_OVERLAP].copy()
    thinnest = min(body.material.thickness for body in model.bodies)
    there = slice(None) if now.absent is None else ~now.absent
    positions, found = np.ascontiguousarray(state.position.T[there]), []
    for tool in np.flatnonzero(now.tools_at_work & ~before.tools_at_work).tolist():
        gap = gaps(model.tools, tool, positions, float(state.tool_travel[tool]))
        gap = gap - model.nodes.offset[there]
        deepest = int(np.argmin(gap))
        depth = -float(gap[deepest])
        if depth > OVERLAP_TOLERANCE * thinnest:
            found.append(
                f"{model.tool_names[tool]} reaches {1e3 * depth:.3g} mm into the sheet at "
                f"{millimetres(positions[deepest])}"
            )
        overlap[tool] = depth if depth > ROUNDING * thinnest else 0.0
    if found:
        raise SimulationError(
            f'the stage "{now.name}" cannot begin at {when(state)}: {", ".join(found)}. A tool '
            "that comes to work must lie outside of the sheet: check its position and its motion "
            f"in the stages before, or add a stage that brings it there before {now.name}"
        )
    return overlap


def _take_contact_away(model: Model, state: State, tool: int) -> float:
    """Take a tool off the sheet, and return what its springs stored [J]."""
    half = 0.5 * state.last_step
    positions = np.ascontiguousarray((state.position - half * state.velocity).T)
    travel = float(state.tool_travel[tool] - half * state.tool_velocity[tool])
    gap = gaps(model.tools, tool, positions, travel)
    gap = gap - (model.nodes.offset - model.tools.initial_overlap[tool])
    near = state.near[tool] != 0
    stiffness = np.where(near, model.contact_stiffness, 0.0)
    held = np.zeros_like(gap)
    if model.environment.depth_time is not None:
        held = state.depth_offset[tool].copy()
        state.depth_offset[tool] = 0.0
    depth = np.maximum(held - gap, 0.0)
    stored = 0.5 * float(np.sum(stiffness * (depth**2 - held**2)))
    if state.stick.size:
        slip2 = np.sum(state.stick[tool] ** 2, axis=0)
        tangential = model.environment.tangential_ratio * model.contact_stiffness
        stored += 0.5 * float(np.sum(tangential * slip2))
        state.stick[tool] = 0.0
    return stored


def _hold_guided(before: StageTables, now: StageTables, state: State) -> None:
    """Take the motion out of guided tools that are held or led from now on."""
    ended = (before.tools.motion_kind == GUIDED) & (now.tools.motion_kind != GUIDED)
    for tool in np.flatnonzero(ended & (state.driven == 0)).tolist():
        velocity = float(state.tool_velocity[tool])
        _take_away(state, KINETIC, 0.5 * float(before.tools.mass[tool]) * velocity**2)
        state.tool_velocity[tool] = 0.0


def _at_same_stop(before: StageTables, now: StageTables) -> np.ndarray:
    """Return which tools (T,) go on under their load to the same stop, which stays where it is."""
    guided = (before.tools.motion_kind == GUIDED) & (now.tools.motion_kind == GUIDED)
    same = before.tools.load_start == now.tools.load_start
    return guided & same & np.isfinite(now.tools.stop)


def _begin_grippers(model: Model, state: State, before: StageTables, now: StageTables) -> None:
    """Let grippers that come to work grip where their place is now."""
    if model.grippers is None:
        return
    pulling = [grip for grip in model.grips if grip.settings.pulls]
    for number in np.flatnonzero(now.grippers_at_work & ~before.grippers_at_work).tolist():
        grip = pulling[number]
        place = state.position[:, grip.nodes] @ grip.weights
        state.gripper_start[number] = place - grip.place
        state.gripper_travel[number] = 0.0
        state.gripper_force[number] = 0.0


def newcomers(model: Model, before: StageTables, now: StageTables) -> list[Body]:
    """Return the plies that are laid down between two stages, as they stand in the model."""
    if before.absent is None or now.absent is None:
        return []
    return [
        body
        for body in model.bodies
        if before.absent[body.first_node] and not now.absent[body.first_node]
    ]


def lay_down(
    model: Model, state: State, before: StageTables, now: StageTables, plies: Sequence[Body]
) -> float:
    """Make the state ready for plies that are laid down, and return what they bring along [J].

    That is what the springs of tools store that they touch. All points look for the plies that they
    face with the next step.
    """
    if now.ply_contact is not None:
        state.ply_counters[REFRESHES_LEFT] = 0
    energy = 0.0
    for ply in plies:
        own = _nodes(ply)
        if model.averaging is not None:
            state.mean_velocity[:, own] = 0.0  # a held node does not move, whatever pulls at it
        for tool in _tools_that_stay(before, now):
            depth = np.maximum(-_gaps(model, state, tool, own), 0.0)
            energy += 0.5 * float(model.contact_stiffness[own] @ depth**2)
    return energy


def require_clear(
    model: Model,
    state: State,
    before: StageTables,
    now: StageTables,
    plies: Sequence[Body],
) -> None:
    """Refuse plies that are laid into a tool, or into a ply that is there.

    Raises
    ------
    SimulationError : names all of them, how deep they lie in what, and where.
    """
    assert before.absent is not None
    there = [body for body in model.bodies if not before.absent[body.first_node]]
    found = []
    for ply in plies:
        for tool in _tools_that_stay(before, now):
            gap = _gaps(model, state, tool, _nodes(ply))
            deepest = int(np.argmin(gap))
            if -gap[deepest] > OVERLAP_TOLERANCE * ply.material.thickness:
                place = state.position[:, ply.first_node + deepest]
                found.append(_sentence(ply, model.tool_names[tool], -gap[deepest], place))
        for other in there:
            depth, place = _depth_in(state, ply, other)
            if depth > DEEPEST_LAID * min(ply.material.thickness, other.material.thickness):
                found.append(_sentence(ply, f"the ply {other.name}", depth, place))
    if found:
        raise SimulationError(
            f'the stage "{now.name}" cannot begin at {when(state)}: {", ".join(found)}. A ply that '
            "is laid down must lie clear of tools and of the plies as they are formed by then: "
            "give it another height, or let a stage before take the tool away"
        )


def _sentence(ply: Body, what: str, depth: float, place: np.ndarray) -> str:
    return f"the ply {ply.name} lies {1e3 * depth:.3g} mm deep in {what} at {millimetres(place)}"


def _tools_that_stay(before: StageTables, now: StageTables) -> list[int]:
    """Return the tools that are at work already; those that come are looked at with all plies."""
    return np.flatnonzero(before.tools_at_work & now.tools_at_work).tolist()


def _nodes(body: Body) -> np.ndarray:
    return np.arange(body.first_node, body.first_node + body.mesh.node_count)


def _gaps(model: Model, state: State, tool: int, nodes: np.ndarray) -> np.ndarray:
    """Return the gaps between a tool and nodes as their springs feel them [m]."""
    positions = np.ascontiguousarray(state.position[:, nodes].T)
    gap = gaps(model.tools, tool, positions, float(state.tool_travel[tool]))
    return gap - (model.nodes.offset[nodes] - state.tool_start[tool, START_OVERLAP])


def _depth_in(state: State, ply: Body, other: Body) -> tuple[float, np.ndarray]:
    """Return how far a flat ply lies in a formed one [m], and where; 0 where it is clear of it.

    The room of the other one is looked at on columns through its elements. Beside the outline of
    the ply it may be anywhere. An element that goes through the ply from one face to the other lies
    in it by the thickness of both.
    """
    own = state.position[:, _nodes(ply)].T
    bottom, top = float(own[:, 2].min()), float(own[:, 2].max())
    inside = shapely.unary_union(shapely.polygons(_outlines(ply, own)))
    lower, upper = _columns(other, state.position[:, _nodes(other)].T)
    middle = 0.5 * (lower + upper)
    covered = shapely.contains_xy(inside, middle[..., 0], middle[..., 1])
    low = np.minimum(lower[..., 2], upper[..., 2])
    high = np.maximum(lower[..., 2], upper[..., 2])
    depth = np.where(covered, np.minimum(high - bottom, top - low), 0.0)
    # those between whose places one lies below and one above
    through = (covered & (high <= bottom)).any(axis=1) & (covered & (low >= top)).any(axis=1)
    depth[through] = np.where(
        covered[through], ply.material.thickness + other.material.thickness, 0.0
    )
    element, place = np.unravel_index(int(np.argmax(depth)), depth.shape)
    return float(depth[element, place]), middle[element, place]


def _outlines(ply: Body, positions: np.ndarray) -> np.ndarray:
    """Return the corners of the faces of a flat ply in the plane (m, 4, 2), from (n, 3) [m]."""
    return positions[ply.mesh.elements[:, :CORNERS], :2]


def _columns(body: Body, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return places on the lower and the upper face of elements (m, PLACES², 3) each [m].

    positions : of the nodes of the body (n, 3) [m].
    """
    along = np.linspace(0.0, 1.0, PLACES)
    s, t = (axis.ravel() for axis in np.meshgrid(along, along))
    weights = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=1)
    corners = positions[body.mesh.elements]
    lower, upper = corners[:, :CORNERS], corners[:, CORNERS:]
    return weights @ lower, weights @ upper
