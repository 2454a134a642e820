"""Stacks of plies for the tests: scenes of one ply each, put together with interfaces.

All have plates and supports, so that they share what is compiled.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lcmchain.effects.supports import Support, translation
from lcmchain.interfaces.table import Interface
from lcmchain.mesh.blank import build_blank
from lcmchain.model import Sheet, assemble_bodies
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.state import PLY_REFRESH
from lcmchain.tools.span_rows import SPAN
from lcmchain.tools.table import build_tool_table

T = 1.004  # thickness of a ply [mm]
FAR = 1000.0  # where plates touch nothing [mm]

SCENE = """
title = "ply"
process = {{ time = "{time} ms", mass_damping = "{damping} 1/s" }}
contact = {{ depth = "zero" }}

[blank]
size = ["{width} mm", "{height} mm"]
edge_length = "{edge} mm"
fibre_angle = "{angle} deg"
height = "{z} mm"

[material]
preset = "MD600"

[[tools]]
name = "lower"
shape = {{ type = "plate", side = "below" }}
position = "0 0 {bottom} mm"

[[tools]]
name = "upper"
shape = {{ type = "plate", side = "above" }}
position = "0 0 {top} mm"
motion = {{ type = "table", direction = [0, 0, -1], times = "0 {stop} {time} ms", travel = "0 {travel} {travel} mm" }}
"""  # noqa: E501


def ply(name, shift=(0.0, 0.0, 0.0), **entries):
    """A ply moved by ``shift`` [mm]; its scene with ``entries`` in mm, ms and degrees."""
    scene = scene_of(**entries)
    mesh = build_blank(scene.blank, scene.material.thickness)
    mesh = replace(mesh, node_positions=mesh.node_positions + 1e-3 * np.asarray(shift))
    return Sheet(name, mesh, scene.material.build(), scene.element)


def scene_of(
    *,
    width=20.0,
    height=20.0,
    edge=5.0,
    angle=0.0,
    z=0.0,
    time=1.0,
    damping=0.0,
    bottom=-FAR,
    top=FAR,
    travel=0.0,
    stop=None,
):
    """The scene of one ply between plates; lengths in mm, times in ms, the angle in degrees."""
    stop = 0.5 * time if stop is None else stop
    entries = {**locals(), "stop": stop}
    return scene_from_text(SCENE.format(**entries))


def stack(plies, scene, *interfaces, supports=None):
    """The simulation of plies; process, contact and plates are those of a scene."""
    model = assemble_bodies(
        plies,
        tools=build_tool_table(scene.tools, None, scene.process.time),
        tool_names=[tool.name for tool in scene.tools],
        contact=scene.contact,
        process=scene.process,
        supports=supports or [Support("corner", np.array([0]), "xy")],
        interfaces=interfaces or [Interface()],
    )
    return Simulation(model)


def drawn(name, nodes, travel, start, stop):
    """A support that draws nodes along x by ``travel`` [m], smoothly, from start to stop [s]."""

    def way(time):
        s = min(max((time - start) / (stop - start), 0.0), 1.0)
        # a ramp of a fifth, then at one speed, then a ramp
        ramp = 0.2
        speed = 1.0 / (1.0 - ramp)
        if s < ramp:
            part = 0.5 * speed * (s - np.sin(np.pi * s / ramp) * ramp / np.pi)
        elif s < 1.0 - ramp:
            part = speed * (s - 0.5 * ramp)
        else:
            left = 1.0 - s
            part = 1.0 - 0.5 * speed * (left - np.sin(np.pi * left / ramp) * ramp / np.pi)
        return travel * part

    return Support(name, nodes, "x", translation([1, 0, 0], way))


def thickness(sim, body):
    """Thickness of the elements of a body at their centres (element_count,) [m]."""
    condition = body.condition(sim.state.position, sim.model.history_of(body, sim.state.history))
    return condition.thickness_stretch * body.mesh.thickness


def inner(body, margin):
    """Elements whose centres lie further inside than ``margin`` [m] (element_count,)."""
    centre = body.mesh.node_positions[body.mesh.elements].mean(axis=1)
    low, high = body.mesh.node_positions.min(axis=0), body.mesh.node_positions.max(axis=0)
    return ((centre > low + margin) & (centre < high - margin))[:, :2].all(axis=1)


def booked(sim):
    """What renewals of the springs have put in [J]."""
    return -float(sim.state.work[PLY_REFRESH])


def of_points(sim, row):
    """A row of all points (node_count,)."""
    data = sim.model.ply_contact.data
    span, lane = np.divmod(data.lane, SPAN)
    return sim.state.ply_rows[span * data.row_size + row * SPAN + lane]
