"""Contact of a node with a rigid tool: penalty pressure and damping.

Adds: a force on a node that lies inside a tool.
Source: penalty method, e.g. Wriggers, "Computational Contact Mechanics", section 6.3.
Stability limit: adds k/m to the square of the highest frequency of the nodes in contact
(``Simulation._step_of``); the damping acts on the mean velocity and adds none.
Scene: ``[[tools]]`` (none: no contact code runs), ``contact.penalty``, ``contact.damping_ratio``.
Fields: ``tool_pressure_top``, ``tool_pressure_bottom``, ``tool_pressure``; ``tool_force``,
``energy_contact``, ``energy_damping`` (history).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from lcmchain.effects.effect import Effect, EffectModel, EffectScene, Refusal, Switch, refused
from lcmchain.jit import equation
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    FrictionCoefficient,
    Number,
    Penalty,
    Range,
    SceneModel,
)
from lcmchain.tools.distance import EXTRUDED, FIELD, PLANE, REVOLVED
from lcmchain.tools.motion import GUIDED

# How the distance to a tool is computed, in words.
SHAPES = {
    PLANE: "plane",
    REVOLVED: "revolved profile",
    EXTRUDED: "extruded profile",
    FIELD: "distance field of a surface mesh",
}

#: Least way into a tool or out of it that is divided by [m]; its square is still a normal number.
SHORTEST_WAY = 1e-100


@equation
def normal_force(stiffness, damping, gap, velocity, mobility, acceleration, dt_last, dt):
    """Return the pressure force [N], what damping takes off the spring's [N], and its energy [J].

    The spring acts only in the parts of the two neighbouring steps that the node spends inside. To
    the order of the step this closes the energy balance of the steps that cross the surface. With
    the full force ½ k ab would be lost where a node goes from a outside to b inside, and gained on
    the way out. The damping acts on the mean of the velocities before and after the step, as in
    :mod:`.process.damping`: it then limits no step, and what it takes is exactly what the motion
    loses. Adhesion is excluded.

    Parameters
    ----------
    stiffness, damping : of the contact [N/m, N s/m]; gap : negative [m].
    velocity : normal velocity relative to the tool before the step [m/s].
    mobility : inverse mass along the normal, of the components that are free [1/kg].
    acceleration : along the normal by all other forces, of other tools as well [m/s²].
    dt_last, dt : the steps before and after [s].
    """
    interval = 0.5 * (dt_last + dt)
    depth = -gap
    elastic = stiffness * depth
    leaving = velocity + interval * (acceleration + mobility * elastic)
    # of a way longer than the depth, depth over way is spent inside
    way_in = max(-velocity * dt_last, max(depth, SHORTEST_WAY))
    way_out = max(leaving * dt, max(depth, SHORTEST_WAY))
    ways = way_in * way_out
    damped = 1.0 + 0.5 * interval * mobility * damping
    # one division for the sum of both parts and for the damping
    inverse = 1.0 / (ways * damped)
    elastic *= 0.5 * depth * (way_in + way_out) * damped * inverse
    mean = velocity + 0.5 * interval * (acceleration + mobility * elastic)
    mean *= ways * inverse
    force = max(elastic - damping * mean, 0.0)
    mean = velocity + 0.5 * interval * (acceleration + mobility * force)
    taken = elastic - force
    return force, taken, taken * mean * interval


class Contact(SceneModel):
    """Penalty contact and Coulomb friction between blank and tools."""

    penalty: Annotated[Penalty | None, AbsentMeans("automatic")] = Field(
        default=None, description="Contact stiffness per area."
    )
    damping_ratio: Annotated[float, Number(0.2, Range(0.0, 2.0))] = Field(
        default=0.2, description="Contact damping as a fraction of critical."
    )
    depth: Literal["automatic", "zero", "free"] = Field(
        default="automatic",
        description="Whether the depth of the nodes in the tools is driven to zero.",
    )
    friction: FrictionCoefficient = Field(default=0.0, description="Coulomb friction coefficient.")
    tangential_ratio: Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.5, description="Tangential over normal contact stiffness."
    )


SWITCH = Switch(
    entry="[[tools]]",
    without="the tools: nothing but weight, pressures and supports acts on the sheet",
    called=lambda scene: bool(scene.tools),
    off=lambda scene: _without_tools(scene),
    on=refused("there are no tools; add [[tools]]"),
    unless="of a guided tool",
)


def _without_tools(scene: EffectScene) -> dict[str, Any]:
    guided = [tool.name for tool in scene.tools if tool.motion.kind == GUIDED]
    if guided:
        raise Refusal(
            f"the guided tool {guided[0]} rests on its contact; give it another motion, or leave "
            "the tool out"
        )
    return {"tools": ()}


def active(model: EffectModel) -> list[Effect]:
    """Return one effect per tool, and the damping."""
    contacts = [
        Effect(f"contact with {name}", True, SHAPES[kind])
        for name, kind in zip(model.tool_names, model.tools.kind.tolist(), strict=True)
    ]
    if not contacts:
        return [Effect("contact", False, "the scene has no tool")]
    ratio = model.environment.contact_damping_ratio
    return [*contacts, Effect("contact damping", ratio > 0.0, f"{ratio:g} of critical")]
