"""Stacks of plies for the tests: scenes of one ply each, put together with interfaces.

All have plates and supports, so that they share what is compiled.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lcmchain.effects.supports import Support, translation
from lcmchain.elements.blocks import SPAN
from lcmchain.interfaces.laws.adhesion import AdhesionTable
from lcmchain.interfaces.laws.coulomb import FrictionTable
from lcmchain.interfaces.laws.friction_map import FrictionMapTable
from lcmchain.interfaces.laws.hersey import HerseyTable
from lcmchain.interfaces.laws.shear_by_points import ShearByPointsTable
from lcmchain.interfaces.laws.viscous_film import ViscousFilmTable
from lcmchain.interfaces.table import Interface
from lcmchain.mesh.blank import build_blank
from lcmchain.model import Sheet, assemble_bodies
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.state import PLY_REFRESH
from lcmchain.tools.table import build_tool_table

T = 1.004  # thickness of a ply [mm]
FAR = 1000.0  # where plates touch nothing [mm]

MU = 0.2
FRICTION = FrictionTable(friction=MU)
BY_SPEED = FrictionMapTable(pressure=(1e3, 1e6), speed=(1.0, 3.0), friction=((0.1, 0.3),) * 2)
BY_HERSEY = HerseyTable(viscosity=0.05, hersey=(0.0, 1e-5), friction=(0.1, 0.6))
FILM = ViscousFilmTable(viscosity=0.5, thickness=0.1e-3)
TACK = AdhesionTable(stress=1e4, on=0.05e-3, off=0.1e-3)
CURVE = ShearByPointsTable(
    slip=(0.01e-3, 0.1e-3, 0.3e-3), stress=(20e3, 50e3, 30e3), distance=0.1e-3
)
#: Of no pair of plies: it is there for the laws of the others to be of one type in all tests.
ALL = Interface(laws=(FRICTION, BY_SPEED, BY_HERSEY, FILM, TACK, CURVE))

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
motion = {{ type = "table", direction = [0, 0, -1], times = "{times}", travel = "{way}" }}
"""


def ply(name, shift=(0.0, 0.0, 0.0), **entries):
    """A ply moved by ``shift`` [mm]; its scene with ``entries`` in mm, ms and degrees."""
    scene = scene_of(**entries)
    mesh = build_blank(scene.blank, scene.material.thickness)
    mesh = replace(mesh, node_positions=mesh.node_positions + 1e-3 * np.asarray(shift))
    return Sheet(name, mesh, scene.material.build(), scene.element)


def wrapped(name, radius, turn=np.inf, ends=np.inf, **entries):
    """A ply around the y axis; ``radius`` of its mid-surface [m], its upper face inside.

    turn : angle [rad] around which it goes, half to either side. ends : radius of what is left [m],
        straight by default; flat elements beside curved ones take a loop of their own.
    """
    flat = ply(name, **entries)
    mesh = flat.mesh

    def angle(x):
        around = np.clip(x / radius, -0.5 * turn, 0.5 * turn)
        return around + (x - radius * around) / ends

    def turned(x, vectors):
        a = angle(x)
        along = np.stack([np.cos(a), 0.0 * a, np.sin(a)], axis=1)
        inwards = np.stack([-np.sin(a), 0.0 * a, np.cos(a)], axis=1)
        y = np.array([0.0, 1.0, 0.0])
        return vectors[:, :1] * along + vectors[:, 1:2] * y + vectors[:, 2:] * inwards

    x = mesh.node_positions[:, 0]
    place = mesh.node_positions - [0.0, 0.0, radius]
    place[:, 0] -= radius * angle(x)
    centre = mesh.node_positions[mesh.elements].mean(axis=1)[:, 0]
    return flat._replace(
        mesh=replace(
            mesh,
            node_positions=turned(x, place),
            fibre_direction_1=turned(centre, mesh.fibre_direction_1),
            fibre_direction_2=turned(centre, mesh.fibre_direction_2),
        )
    )


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
    times=None,
    way=None,
):
    """The scene of one ply between plates; lengths in mm, times in ms, the angle in degrees.

    The upper plate goes down by ``travel`` until ``stop``; ``times`` and ``way`` say it as a table.
    """
    stop = 0.5 * time if stop is None else stop
    times = times or f"0 {stop} {time} ms"
    way = way or f"0 {travel} {travel} mm"
    entries = locals()
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


#: Part of its time that :func:`dragged` takes to come to its speed, and to rest.
RAMP = 0.2


def dragged(time, start, stop):
    """Part of a way at a time [s]: a ramp of a fifth of the time, at one speed, then a ramp."""
    s = min(max((time - start) / (stop - start), 0.0), 1.0)
    speed = 1.0 / (1.0 - RAMP)
    if s < RAMP:
        return 0.5 * speed * (s - np.sin(np.pi * s / RAMP) * RAMP / np.pi)
    if s < 1.0 - RAMP:
        return speed * (s - 0.5 * RAMP)
    left = 1.0 - s
    return 1.0 - 0.5 * speed * (left - np.sin(np.pi * left / RAMP) * RAMP / np.pi)


def drawn(name, nodes, travel, start, stop):
    """A support that draws nodes along x by ``travel`` [m], smoothly, from start to stop [s]."""
    way = translation([1, 0, 0], lambda time: travel * dragged(time, start, stop))
    return Support(name, nodes, "x", way)


def smooth(s):
    """A ramp from 0 to 1 that is at rest at both ends."""
    s = min(max(s, 0.0), 1.0)
    return s * s * (3.0 - 2.0 * s)


def support_forces(sim, times):
    """Mean forces of the supports between times [s], (len(times) - 1, support_count, 3) [N]."""
    sim.advance_to(times[0])
    impulses = [sim.state.support_impulse.copy()]
    for time in times[1:]:
        sim.advance_to(time)
        impulses.append(sim.state.support_impulse.copy())
    return np.diff(impulses, axis=0) / np.diff(times)[:, np.newaxis, np.newaxis]


def require_balance(sim, part=1e-2):
    energy = sim.energy()
    assert abs(energy["balance_error"]) < part * abs(energy["external"])


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
