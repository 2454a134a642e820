"""Stacks of plies for the tests: scenes of one ply each, put together with interfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lcmchain.interfaces.table import Interface
from lcmchain.mesh.blank import build_blank
from lcmchain.model import Sheet, assemble_bodies
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.tools.table import build_tool_table

THICKNESS = 1.004e-3

PLY = """
title = "ply"
process = {{ {process} }}
blank = {{ size = ["{width} mm", "{height} mm"], edge_length = "{edge} mm", fibre_angle = "{angle} deg", height = "{z} mm" }}
contact = {{ {contact} }}

[material]
{material}
"""
FABRIC = 'preset = "MD600"'


def ply_scene(
    *,
    width=20.0,
    height=20.0,
    edge=5.0,
    angle=0.0,
    z=0.0,
    material=FABRIC,
    process='time = "1 ms"',
    contact="",
    tools="",
):
    """The scene of one ply; lengths in mm, the angle in degrees."""
    text = PLY.format(
        width=width, height=height, edge=edge, angle=angle, z=z, material=material,
        process=process, contact=contact,
    )  # fmt: skip
    return scene_from_text(text + tools)


def ply(name, scene, shift=(0.0, 0.0, 0.0), change=None):
    """The ply of a scene, moved by ``shift`` [m]; ``change`` makes other positions of its own."""
    mesh = build_blank(scene.blank, scene.material.thickness)
    positions = mesh.node_positions + np.asarray(shift)
    if change is not None:
        positions = change(positions)
    return Sheet(name, replace(mesh, node_positions=positions), scene.material.build(), scene.element)


def stack(plies, scene, *, interfaces=(Interface(),), supports=(), tools=None):
    """The simulation of plies; process, contact and tools are those of a scene."""
    table = tools or build_tool_table(scene.tools, None, scene.process.time)
    model = assemble_bodies(
        plies,
        tools=table,
        tool_names=[tool.name for tool in scene.tools],
        contact=scene.contact,
        process=scene.process,
        supports=supports,
        interfaces=interfaces,
    )
    return Simulation(model)


def thickness(sim, body):
    """Thickness of the elements of a body at their centres (element_count,) [m]."""
    condition = body.condition(sim.state.position, sim.model.history_of(body, sim.state.history))
    return condition.thickness_stretch * body.mesh.thickness
