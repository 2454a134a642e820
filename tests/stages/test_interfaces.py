"""Interfaces that a stage changes: plies that slide are tied, and what that books."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.interfaces.rows import INTERFACE
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

MS = 1e-3

# Two plies pressed together; the upper one is drawn over the lower one, and tied before it goes on.
STACK = """
process = { frames = 4 }
layup = "[0/90, 0/90]"
blank = { size = ["40 mm", "20 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }
contact = { depth = "free" }

[[interfaces]]
friction = 0.2
stages = ["slide"]

[[interfaces]]
stages = ["tied"]
laws = [
    { type = "shear_by_points", slip = "0.005 1 mm", stress = "0.1 0.2 MPa", distance = "0.1 mm" },
]

[[tools]]
name = "lower"
shape = { type = "plate", side = "below" }
position = "0 0 -0.502 mm"

[[tools]]
name = "upper"
shape = { type = "plate", side = "above" }
position = "0 0 1.506 mm"

[[grippers]]
name = "held"
ply = "ply_1"
box = ["-20 -10 -2 mm", "-20 10 2 mm"]
hold = "x"

[[grippers]]
name = "drawn"
ply = "ply_2"
box = ["20 -10 -2 mm", "20 10 2 mm"]
direction = [1, 0, 0]
force = "6 N"

[[stages]]
name = "slide"
time = "4 ms"
mass_damping = "1000 1/s"
motions.upper = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm", end = "2 ms" }

[[stages]]
name = "tied"
time = "4 ms"
mass_damping = "1000 1/s"
"""


def numbers(simulation):
    """Return the numbers of the interfaces that points are on."""
    data, state = simulation.model.ply_contact.data, simulation.state
    rows = state.ply_rows.reshape(-1, data.row_size // 16, 16)
    here = rows[data.lane // 16, INTERFACE, data.lane % 16][state.ply_facet >= 0]
    return set(here.astype(int).tolist())


def test_an_entry_that_goes_on_keeps_its_number():
    """And the laws of all stages stand in one tuple: nothing is compiled for a stage."""
    model = build_model(scene_from_text(STACK))
    slide, tied = (stage.ply_contact for stage in model.stages)
    assert slide.data.interface.max() == 0 and tied.data.interface.max() == 1
    assert slide.laws is tied.laws and slide.data.interface_count == 2
    assert tied.data.near.max() == pytest.approx(0.1e-3) and not slide.data.near.any()
    head, _, rest = STACK.partition("[[interfaces]]")
    on = f"{head}[[interfaces]]\nfriction = 0.2\n[[tools]]{rest.partition('[[tools]]')[2]}"
    first, second = (stage.ply_contact.data for stage in build_model(scene_from_text(on)).stages)
    assert first.interface_count == 1 and np.array_equal(first.interface, second.interface)


def test_points_go_over_to_the_interface_of_the_stage_and_the_balance_stays():
    simulation = Simulation(build_model(scene_from_text(STACK)))
    simulation.advance_to(4 * MS)
    assert numbers(simulation) == {0}
    before = simulation.energy()
    simulation.advance_to(4.05 * MS)
    assert numbers(simulation) == {1}
    after = simulation.energy()
    scale = max(after["kinetic"], after["contact"], after["internal"])
    assert abs(after["balance_error"] - before["balance_error"]) < 0.01 * scale
