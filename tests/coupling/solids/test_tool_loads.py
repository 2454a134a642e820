"""The force on a tool and its parts: fibres, fluid, friction."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.coupling.iteration.interface import PORE_PRESSURE
from lcmchain.coupling.solids.explicit import ExplicitForming
from lcmchain.coupling.solids.tool_loads import tool_loads
from lcmchain.scene import scene_from_text

SCENE = """
process = { time = "5 ms", mass_damping = "2000 1/s" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
contact = { friction = 0.2 }
[[tools]]
name = "die"
shape = { type = "plate", side = "below" }
position = "0 0 -0.502 mm"
[[tools]]
name = "plate"
shape = { type = "plate", side = "above" }
position = "0 0 0.502 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "0.2 mm" }
"""


def pressed(pressure):
    part = ExplicitForming.from_scene(scene_from_text(SCENE))
    part.set_fields({PORE_PRESSURE: np.full(part.element_count, pressure)})
    part.ramped = True
    for _ in range(2):
        part.advance(2.5e-3)
    return part


def test_fibres_fluid_and_friction_are_the_force_on_the_tool():
    pressure = 5e4
    part = pressed(pressure)
    loads = tool_loads(part.simulation)
    area = part.area().sum()
    for name, sign in (("plate", 1.0), ("die", -1.0)):
        load = loads[name]
        np.testing.assert_allclose(
            load.fibres + load.fluid + load.friction + load.rest, load.total, rtol=1e-12
        )
        assert sign * load.total[2] > 0.0
        # quasi-static: what is not told is below one part in a hundred
        assert np.abs(load.rest).max() < 0.01 * np.abs(load.total).max()
        assert sign * load.fluid[2] == pytest.approx(pressure * area, rel=2e-2, abs=1e-9)
        assert abs(load.friction[2]) < 1e-12 * abs(load.total[2])
        model, state = part.simulation.model, part.simulation.state
        body = model.only_body()
        history = model.history_of(body, state.history)
        stretch = body.condition(state.position, history).thickness_stretch
        law = body.material.compaction_pressure
        assert sign * load.fibres[2] == pytest.approx(law(stretch).mean() * area, rel=0.02)


def test_nodes_pressed_by_the_offset_of_their_depth_alone_are_in_contact():
    """Depths are driven to zero here; while plates open nodes lie just outside of them."""
    text = SCENE.replace(
        'distance = "0.2 mm" }', 'times = "0 3 5 ms", travel = "0 0.2 0.1 mm" }'
    ).replace('"stroke", direction', '"table", direction')
    part = ExplicitForming.from_scene(scene_from_text(text))
    part.advance(4e-3)
    model, state = part.simulation.model, part.simulation.state
    assert model.environment.depth_time is not None
    load = tool_loads(part.simulation)["plate"]
    position = state.position - state.last_step * state.velocity
    travel = state.tool_travel[1] - state.last_step * state.tool_velocity[1]
    gap = 0.502e-3 - travel - position[2]
    assert (state.contact_force[gap > 0.0] > 0.0).any()
    assert load.total[2] > 1.0
    assert abs(load.friction[2]) < 1e-12 * load.total[2]
    assert load.fibres[2] == pytest.approx(load.total[2], rel=0.02)
