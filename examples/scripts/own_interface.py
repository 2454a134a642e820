"""A law of your own between plies: a drag that goes with the square of the sliding speed.

τ = c v². The parameters are arrays of all interfaces; the compiled part answers force and energy at
a point; the table says how far the law reaches and what it asks of the step.
Usage: python examples/scripts/own_interface.py
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from lcmchain.elements.vectors import dot, scaled
from lcmchain.interfaces.law import (
    InterfaceLawTable,
    implements,
    parameters,
    respond,
    uses_sliding,
)
from lcmchain.interfaces.table import Interface
from lcmchain.jit import equation
from lcmchain.mesh.blank import build_blank
from lcmchain.model import Sheet, assemble_bodies
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.tools.table import build_tool_table

REACH = 1e-3  # gap up to which it acts [m]


class Drag(NamedTuple):
    """coefficient : (interface_count,) stress over speed² [Pa s²/m²], 0 without a drag."""

    coefficient: np.ndarray

    @staticmethod
    def title():
        return "drag between plies"

    def reason(self):
        return f"up to {self.coefficient.max():g} Pa s²/m²"


@implements(parameters, Drag)
@equation
def drag_parameters(law, interface):
    return (law.coefficient[interface],)


@implements(uses_sliding, Drag)
@equation
def drag_uses_sliding(law):
    return True


@implements(respond, Drag)
@equation
def drag_response(law, values, memory, touch):
    factor = 0.0
    if touch.gap < REACH and touch.time > 0.0:
        speed = math.sqrt(dot(touch.moved, touch.moved)) / touch.time
        factor = -values[0] * touch.area * speed / touch.time
    force = scaled(factor, touch.moved)
    # force, tension, energy stored, energy lost, memory
    return force, 0.0, 0.0, -dot(force, touch.moved), memory


class DragTable(InterfaceLawTable):
    """Entries of the drag; ``fastest`` is the speed up to which steps are to be stable [m/s]."""

    law: ClassVar[type] = Drag

    type: Literal["drag"] = "drag"
    coefficient: float
    fastest: float

    @classmethod
    def gathered(cls, tables):
        return Drag(np.array([0.0 if t is None else t.coefficient for t in tables]))

    def reach(self):
        return REACH

    def slip_viscosity(self):
        return 2.0 * self.coefficient * self.fastest

    def in_words(self):
        return f"drag {self.coefficient:g} Pa s²/m²"


SCENE = """
title = "A ply that slides on another"
process = {{ time = "2 ms", frames = 2 }}
blank = {{ size = ["{length} mm", "20 mm"], edge_length = "5 mm", height = "{height} mm" }}
material = {{ preset = "MD600" }}
"""
DRAG, SPEED, TIME = 50.0, 2.0, 0.002  # [Pa s²/m²], [m/s], [s]


def main() -> None:
    """Let a ply slide on a longer one, and compare its speed with the closed form."""
    scenes = [
        scene_from_text(SCENE.format(length=length, height=height))
        for length, height in ((30, 0.502), (20, 1.506))
    ]
    plies = [
        Sheet(
            name, build_blank(scene.blank, scene.material.thickness), scene.material.build(),
            scene.element,
        )
        for name, scene in zip(("bed", "sled"), scenes, strict=True)
    ]  # fmt: skip
    model = assemble_bodies(
        plies,
        tools=build_tool_table((), None, TIME),
        tool_names=[],
        contact=scenes[0].contact,
        process=scenes[0].process,
        interfaces=[Interface().with_laws(DragTable(coefficient=DRAG, fastest=2.0 * SPEED))],
    )
    simulation = Simulation(model)
    bed, sled = (slice(b.first_node, b.first_node + b.mesh.node_count) for b in model.bodies)
    velocity = np.zeros_like(simulation.state.velocity)
    velocity[0, sled] = SPEED
    simulation.set_velocity(velocity)
    simulation.advance_to(TIME)

    mass, v = model.nodes.mass, simulation.state.velocity[0]
    found = np.average(v[sled], weights=mass[sled]) - np.average(v[bed], weights=mass[bed])
    # both are free: dv/dt = -c v² A (1/m + 1/M)
    area, masses = 20e-3 * 20e-3, (mass[sled].sum(), mass[bed].sum())
    rate = DRAG * area * sum(1.0 / m for m in masses)
    expected = SPEED / (1.0 + rate * SPEED * TIME)
    print(f"relative speed {found:.4f} m/s, closed form {expected:.4f} m/s")
    assert abs(found / expected - 1.0) < 0.01


if __name__ == "__main__":
    main()
