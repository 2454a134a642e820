"""Plies that are laid down at the border of two stages: whether there is room, and what changes.

Until its first stage a ply waits at the place of the scene, flat and at rest: its nodes are held,
no tool and no other ply touches it, and nothing loads it. Then it is as any other. What has been
formed until then is another than at the start, so that its place is looked at when it comes: a
flat ply is laid on a flat flange, or on a stack that is as flat.

A tool touches it by less than counts, or not at all. What its springs hold then has come with the
ply, and the balance counts it as work of the outside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from lcmchain.elements.family import Body
from lcmchain.errors import SimulationError
from lcmchain.interfaces.forces import REFRESHES_LEFT
from lcmchain.model import Model
from lcmchain.quantities.readable import millimetres
from lcmchain.solver.guards import when
from lcmchain.stages import StageTables
from lcmchain.state import START_OVERLAP, State
from lcmchain.tools.distance import gaps
from lcmchain.tools.initial_overlap import OVERLAP_TOLERANCE

#: How deep a ply may be laid into another one, in parts of the thickness of the thinner one. A
#: point that is found inside another ply begins without force there; a sheared flange is thicker by
#: some percent than the flat one that the height of the next ply was found from.
DEEPEST_LAID = 0.1
#: Places of an element at which the room that it takes up is looked at, along either side.
PLACES = 3
#: Of a face; a triangle repeats its last one.
CORNERS = 4


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
