"""Forces of tools on a sheet with fluid, split into those of fibres, fluid and friction.

At a node in contact the force of the tool is in balance with that of the fibres (internal forces of
the elements), of the pore pressure, of pressures on faces, and with inertia and damping. Each share
is the force along the tool's normal at the node, summed over the nodes in contact. Friction is the
force of the tool across its normals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.effects.pore_pressure import pore_forces, unit_loads
from lcmchain.elements.blocks import LANES
from lcmchain.elements.family import internal_forces
from lcmchain.elements.pressed_elements import LOAD_ROWS
from lcmchain.jit import routine
from lcmchain.model import Model
from lcmchain.solver.simulation import Simulation
from lcmchain.tools.distance import signed_distance


class ToolLoad(NamedTuple):
    """Force of the sheet on a tool at the last step and its shares, vectors (3,) [N].

    ``total`` is their sum. ``rest`` is inertia, damping and the pressure on faces.
    """

    total: np.ndarray
    fibres: np.ndarray
    fluid: np.ndarray
    friction: np.ndarray
    rest: np.ndarray


def tool_loads(simulation: Simulation) -> dict[str, ToolLoad]:
    """Return the load on every tool by its name, of the forces of the last step."""
    model, state = simulation.model, simulation.state
    position = state.position - state.last_step * state.velocity
    fibres = fibre_forces(simulation, position)
    fluid = _fluid_forces(model, position, state.pore_pressure)
    loads, works = {}, model.tools_at_work(simulation.time)
    for tool, name in enumerate(model.tool_names):
        if not works[tool]:  # a tool that is away may still be where others touch the sheet
            loads[name] = ToolLoad(*(np.zeros(3) for _ in ToolLoad._fields))
            continue
        travel = state.tool_travel[tool] - state.last_step * state.tool_velocity[tool]
        normal = _contact_normals(simulation, tool, position, travel)
        total = state.tool_force[tool].copy()
        by_fibres, by_fluid = _along(normal, fibres), _along(normal, fluid)
        pressed = -np.sum(normal * state.contact_force, axis=1)
        loads[name] = ToolLoad(
            total, by_fibres, by_fluid, total - pressed, pressed - by_fibres - by_fluid
        )
    return loads


def _contact_normals(
    simulation: Simulation, tool: int, position: np.ndarray, travel: float
) -> np.ndarray:
    """Return the tool's normals at the nodes that it touches (3, node_count), 0 at the others.

    Where depths are driven to zero a node may be pressed from just outside the tool: its spring
    feels the offset as further depth.
    """
    model, state = simulation.model, simulation.state
    normal = np.zeros_like(position)
    reach = model.nodes.offset - model.tools.initial_overlap[tool]
    if model.environment.depth_time is not None:
        reach = reach + state.depth_offset[tool]
    _normals(model.tools, tool, position, reach, travel, state.contact_force, normal)
    return normal


@routine
def _normals(tools, tool, position, reach, travel, contact_force, normal):
    for node in range(position.shape[1]):
        if contact_force[node] == 0.0:
            continue
        gap, nx, ny, nz = signed_distance(
            tools, tool, position[0, node], position[1, node], position[2, node], travel
        )
        if gap < reach[node]:
            normal[0, node] = nx
            normal[1, node] = ny
            normal[2, node] = nz


def _along(normal: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return the sum of the components of forces (3, node_count) along the normals (3,) [N]."""
    return np.sum(normal * np.sum(normal * force, axis=0), axis=1)


def fibre_forces(simulation: Simulation, position: np.ndarray) -> np.ndarray:
    """Return the forces of the elements on the nodes (3, node_count) [N]."""
    model, history = simulation.model, simulation.state.history.copy()
    corner = np.zeros(model.corner_force_size)
    for body in model.placed:
        internal_forces(
            body.data,
            np.ascontiguousarray(position),
            corner[body.first_force : body.last_force],
            history[body.first_history : body.last_history],
        )
    return -_on_nodes(model, corner)


def _fluid_forces(model: Model, position: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Return the forces of the pore pressure on the nodes (3, node_count) [N]."""
    if model.pore is None:
        return np.zeros_like(position)
    corner = np.zeros(model.corner_force_size)
    held, none = pressure.copy(), np.zeros_like(pressure)
    position = np.ascontiguousarray(position)
    if model.pore_columns is not None:
        load = corner[: pressure.size * LOAD_ROWS]
        unit_loads(model.pore, position, np.zeros_like(position), none, load)
        load *= np.repeat(pressure.reshape(-1, 1, LANES), LOAD_ROWS, axis=1).ravel()
        return _on_nodes(model, corner)
    pore_forces(model.pore, position, np.zeros_like(position), held, none, none, 0.0, corner)
    return _on_nodes(model, corner)


def _on_nodes(model: Model, corner: np.ndarray) -> np.ndarray:
    slot = model.nodes.force_slot
    return np.stack([corner[slot + d * LANES].sum(axis=0) for d in range(3)])
