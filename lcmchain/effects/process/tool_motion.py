"""Motion of tools: prescribed over time, or guided by mass, load and contact.

Adds: the travel of every tool; a guided one obeys its own equation of motion.
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", box 6.1.
Stability limit: a guided tool adds the stiffness of its contacts over its mass to the square of the
highest frequency (``Simulation._step_of``).
A tool may turn about an axis: its travel is then the angle, and the moment of the contact forces
about the axis stands for their force along a direction.
Scene: ``tools.motion``.
Fields: ``tool_travel``, ``tool_angle``, ``history_tool_moment``, ``energy_external`` (history).
"""

from __future__ import annotations

import math

import numpy as np

from lcmchain.effects.effect import Effect, EffectModel, Switch, refused
from lcmchain.tools.motion import GUIDED, PRESCRIBED, prescribed_travel
from lcmchain.tools.table import turning

SWITCH = Switch(
    entry="tools.motion",
    without="the motion of the tools",
    called=lambda scene: any(tool.motion.moves for tool in scene.tools),
    off=refused("it is the process itself; change tools.motion"),
    on=refused("no tool moves; give tools.motion"),
)


def active(model: EffectModel) -> list[Effect]:
    """Return one effect per tool that can move."""
    tools = model.tools
    effects = []
    for tool, name in enumerate(model.tool_names):
        if tools.motion_kind[tool] == GUIDED:
            load = tools.force[tool] + tools.mass[tool] * tools.gravity_along[tool]
            reason = f"{tools.mass[tool]:g} kg under {load:.4g} N along its direction"
            if np.isfinite(tools.stop[tool]):
                reason += f", up to a stop at {1e3 * abs(tools.stop[tool]):.4g} mm"
            effects.append(Effect(f"guided tool {name}", True, reason))
        elif tools.motion_kind[tool] == PRESCRIBED:
            times = np.linspace(0.0, model.process_time, 101)
            travel = np.array([prescribed_travel(tools, tool, time)[0] for time in times])
            moving = times[:-1][np.diff(travel) != 0.0]
            turns = bool(turning(tools)[tool])
            unit, factor = ("degrees", math.degrees(1.0)) if turns else ("mm", 1e3)
            reason = (
                f"{factor * travel[-1]:.4g} {unit} at the end of {1e3 * model.process_time:g} ms"
            )
            low, high = travel.min(), travel.max()
            if low < min(travel[0], travel[-1]) or high > max(travel[0], travel[-1]):
                reason = f"between {factor * low:.4g} and {factor * high:.4g} {unit}, {reason}"
            if np.isfinite(tools.until_force[tool]):
                reason += f", or until a force of {tools.until_force[tool]:.4g} N"
            effects.append(Effect(f"prescribed motion of {name}", moving.size > 0, reason))
    return effects
