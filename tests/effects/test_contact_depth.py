"""Depth in tools: driven to zero where tools close, without energy from nowhere; and measured."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.effects.contact_depth import (
    closest_gap,
    nominal_pressure,
    pressure_in_gap,
)
from lcmchain.judgements.contact import hidden_compaction, hidden_compaction_warnings
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.tools.closest_gap import closest_gaps, places_of_sheet

THICKNESS = 1.004e-3
GAP = 0.7e-3  # between the plates at the end of their stroke [m]
PLATES = """
process = {{ time = "20 ms" }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }}
material = {{ preset = "MD600" }}
contact = {{ {contact} }}

[[tools]]
name = "lower"
shape = {{ type = "plate", side = "below" }}

[[tools]]
name = "upper"
shape = {{ type = "plate", side = "above" }}
position = "0 0 1.004 mm"
motion = {motion}
"""
CLOSE = '{ type = "stroke", direction = [0, 0, -1], distance = "0.304 mm" }'
CLOSE_AND_OPEN = (
    '{ type = "table", direction = [0, 0, -1], times = "0 8 10 12 20 ms", '
    'travel = "0 0.3 0.304 0.3 -1 mm" }'
)


def plates(motion=CLOSE, contact=""):
    return scene_from_text(PLATES.format(motion=motion, contact=contact))


@pytest.fixture(scope="module")
def pressed():
    """Simulation of plates that have closed to their gap."""
    simulation = Simulation.from_scene(plates())
    simulation.advance_to(20e-3)
    return simulation


def test_force_and_thickness_between_plates_are_those_of_the_law_at_their_gap(pressed):
    """With springs alone these elements give 0.73 mm and 0.6 of the force."""
    positions = pressed.state.position
    top, bottom = positions[2].max(), positions[2].min()
    assert top - bottom == pytest.approx(GAP, rel=1e-3)
    law = float(pressed.model.only_body().material.compaction_pressure(GAP / THICKNESS))
    force = np.abs(pressed.state.tool_force[:, 2])
    assert force == pytest.approx(law * 20e-3**2, rel=0.02)


def test_the_energy_balance_holds_while_the_springs_follow(pressed):
    """What the offsets put in is booked: it is a tenth of the internal energy here."""
    energy = pressed.energy()
    assert abs(energy["balance_error"]) < 1e-3 * energy["internal"]
    # the springs themselves hold next to nothing once the depth is gone
    assert abs(energy["contact"]) < 1e-2 * energy["internal"]


def test_a_press_force_closes_plates_to_the_gap_of_the_law(pressed):
    """Within 0.5 %, with depths driven to zero: the travel of the tool tells the thickness."""
    law = pressed.model.only_body().material
    force = float(law.compaction_pressure(GAP / THICKNESS)) * 400e-6
    guided = f'{{ type = "guided", direction = [0, 0, -1], force = "{force} N", mass = "0.1 kg", '
    guided += 'gravity = false, damping = "500 N*s/m", ramp = "10 ms" }'
    press = Simulation.from_scene(plates(guided, contact='depth = "zero"'))
    press.advance_to(20e-3)
    state = press.state
    assert THICKNESS - state.tool_travel[1] == pytest.approx(GAP, rel=5e-3)
    assert np.ptp(state.position[2]) == pytest.approx(GAP, rel=5e-3)
    assert state.tool_force[1, 2] == pytest.approx(force, rel=5e-3)
    upper = press.model.only_body().mesh.elements[:, 4:]
    borne = press.snapshot().contact_force[np.unique(upper)].sum()
    assert borne == pytest.approx(state.tool_force[1, 2], rel=1e-9)
    energy = press.energy()
    assert abs(energy["balance_error"]) < 1e-3 * energy["external"]


def test_plates_that_open_again_leave_no_offset_and_the_balance_whole():
    simulation = Simulation.from_scene(plates(CLOSE_AND_OPEN))
    simulation.advance_to(10e-3)
    largest = simulation.energy()["internal"]
    assert simulation.state.depth_offset.max() > 5e-6
    simulation.advance_to(20e-3)
    assert not simulation.state.depth_offset.any()
    assert abs(simulation.energy()["balance_error"]) < 2e-3 * largest


def test_what_is_hidden_is_what_the_offsets_would_have_shown(pressed):
    """Two springs leave as much of the thickness as their depth; the law tells the force."""
    assert hidden_compaction(pressed.model, [pressed.snapshot()]) == pytest.approx(
        {"hidden_thickness_part": 0.0, "hidden_force_part": 0.0}, abs=5e-3
    )
    free = Simulation.from_scene(plates(contact='depth = "free"'))
    free.advance_to(20e-3)
    found = hidden_compaction(free.model, [free.snapshot()])
    height = np.ptp(free.state.position[2])
    assert found["hidden_thickness_part"] == pytest.approx((height - GAP) / height, rel=0.02)
    forces = [np.abs(run.state.tool_force[1, 2]) for run in (pressed, free)]
    assert 1.0 + found["hidden_force_part"] == pytest.approx(forces[0] / forces[1], rel=0.02)
    (warning,) = hidden_compaction_warnings(found)
    assert 'contact.depth = "zero"' in warning


def test_a_sheet_under_a_guided_tool_is_not_between_the_others():
    """Its upper nodes are pushed by a tool that a force guides; the other one is far above them."""
    other = """
[[tools]]
name = "far"
shape = { type = "plate", side = "above" }
position = "0 0 20 mm"
"""
    weight = '{ type = "guided", direction = [0, 0, -1], mass = "1 kg", ramp = "1 ms" }'
    scene = scene_from_text(PLATES.format(motion=weight, contact='depth = "free"') + other)
    simulation = Simulation.from_scene(scene)
    simulation.advance_to(2e-3)
    assert (simulation.snapshot().contact_force > 0.0).all()
    assert hidden_compaction(simulation.model, [simulation.snapshot()]) == {}


@pytest.mark.parametrize(
    ("change", "held"),
    [
        ([], True),
        (['tools.upper.motion.distance="0.0005 mm"'], False),
        (["contact.penalty=1000 N/mm^3"], False),
        (["contact.penalty=1000 N/mm^3", "contact.depth=zero"], True),
        (["contact.damping_ratio=0"], False),
        (["contact.depth=free"], False),
    ],
)  # fmt: skip
def test_depths_are_driven_to_zero_where_tools_close_on_the_sheet(change, held):
    scene = scene_from_text(PLATES.format(motion=CLOSE, contact=""), overrides=change)
    assert (build_model(scene).environment.depth_time is not None) == held


def test_the_gap_between_curved_tools_is_found_from_the_flat_sheet():
    """A ball of 20 mm above a pan of 21 mm, whose centres meet at the end of the stroke."""
    scene = scene_from_text(
        """
        process = { time = "20 ms" }
        blank = { size = ["30 mm", "30 mm"], edge_length = "5 mm", height = "21.6 mm" }
        material = { preset = "MD600" }
        [[tools]]
        name = "ball"
        shape = { type = "sphere_capped_punch", radius = "20 mm" }
        position = "0 0 22.2 mm"
        motion = { type = "stroke", direction = [0, 0, -1], distance = "21.2 mm" }
        [[tools]]
        name = "floor"
        shape = { type = "plate", side = "below" }
        position = "0 0 0.2 mm"
        """
    )
    model = build_model(scene)
    found = closest_gap(model.tools, [model.only_body().mesh], 20e-3)
    assert found == pytest.approx(0.8e-3, rel=0.01)
    assert model.environment.depth_time is not None


def test_the_pressure_in_a_gap_is_that_of_the_laws():
    """Of one sheet, and of two that share the gap such that both bear the same."""
    thin, thick = (
        scene_from_text(
            PLATES.format(motion=CLOSE, contact="").replace(
                '"MD600"', f'"MD600", areal_mass = "{0.6 * t} kg/m^2", thickness = "{t} mm"'
            )
        ).material.build()
        for t in (0.5, 2.0)
    )
    pressure = float(nominal_pressure(thin, np.array([0.7]))[0])
    assert pressure_in_gap(0.35e-3, [thin]) == pytest.approx(pressure, rel=1e-3)
    assert pressure_in_gap(0.7 * 2.5e-3, [thin, thick]) == pytest.approx(pressure, rel=0.02)
    assert pressure_in_gap(2.6e-3, [thin, thick]) == 0.0
    assert pressure_in_gap(0.1e-3, [thin]) == pressure_in_gap(0.15e-3, [thin]) > pressure


@pytest.mark.parametrize(
    ("law", "fastest"),
    [
        # 4 C33 / (rho t^2), the wave over the thickness: C33 = 5 MPa 0.7 / (1.3 * 0.4)
        (
            'law = "isotropic"\nyoung_modulus = "5 MPa"\npoisson_ratio = 0.3\n'
            'thickness = "1 mm"\ndensity = "900 kg/m^3"',
            4.0 * 5e6 * 0.7 / (1.3 * 0.4) / (900.0 * 1e-6),
        ),
        # 4 C11 / (rho l^2), the wave along the fibres: C11 = 1 GPa, 0.6 kg/m^2 on 1.004 mm
        ('preset = "MD600"', 4.0 * 1e9 / (0.6 / 1.004e-3 * 0.01**2)),
    ],
)
def test_the_automatic_stiffness_follows_the_fastest_wave(law, fastest):
    """A film as soft along as across would else be pressed through by what touches it."""
    model = build_model(
        scene_from_text(
            'process = { time = "1 ms" }\nblank = { size = ["40 mm", "40 mm"], '
            f'edge_length = "10 mm" }}\n[material]\n{law}\n'
        )
    )
    material = model.only_body().material
    expected = 0.1 * fastest * 0.5 * material.density * material.thickness
    assert model.environment.penalty == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("edge", ["5 mm", "25 mm"])
def test_springs_bear_what_closing_tools_press_in_a_stack(edge):
    """Also under long elements, whose own stiffness asks for soft ones: on tools and plies."""
    text = 'layup = "[0/90]2"\n' + PLATES.format(motion=CLOSE, contact="")
    for old, new in (("5 mm", edge), ("20 mm", "100 mm"), ("0.304 mm", "0.608 mm")):
        text = text.replace(f'"{old}"', f'"{new}"')
    text = text.replace("0 0 1.004 mm", "0 0 2.008 mm")
    model = build_model(scene_from_text(text))
    law = model.bodies[0].material
    pressure = float(law.compaction_pressure(GAP / THICKNESS))
    for penalty in (model.environment.penalty, model.ply_contact.data.penalty[0]):
        assert penalty * 0.03 * THICKNESS >= 0.99 * pressure
    given = build_model(scene_from_text(text, overrides=['contact.penalty="1 N/mm^3"']))
    assert given.environment.penalty == 1e9
    assert given.environment.depth_time is None
    assert given.ply_contact.data.penalty[0] * 0.03 * THICKNESS >= 0.99 * pressure


def test_tools_close_on_a_stack_where_they_leave_less_than_all_plies():
    text = 'layup = "[0/90]2"\n' + PLATES.format(motion=CLOSE, contact="").replace(
        '"0 0 1.004 mm"', '"0 0 2.008 mm"'
    )
    model = build_model(scene_from_text(text))
    assert model.environment.depth_time is not None
    apart = text.replace("0.304 mm", "0.05 mm").replace("2.008 mm", "2.2 mm")
    assert build_model(scene_from_text(apart)).environment.depth_time is None


#: Two plies, on a plate, under a punch; and a ring on the plies, which the punch overlaps by 1 mm.
PUNCHED = """
layup = "[0/90]2"
process = { time = "20 ms" }
interfaces = [{ friction = 0.2 }]
blank = { size = ["40 mm", "40 mm"], edge_length = "5 mm", height = "1.004 mm" }
material = { preset = "MD600" }

[[tools]]
name = "lower"
shape = { type = "plate", side = "below" }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "11 mm" }
position = "0 0 2.2 mm"
{motion}
"""
STROKE = '{ type = "stroke", direction = [0, 0, -1], distance = "0.05 mm" }'
RING = """
[[tools]]
name = "ring"
shape = { type = "plate_with_hole", side = "above", hole_radius = "10 mm", fillet_radius = "1 mm" }
position = "0 0 2.2 mm"
"""
STAGES = """
[[stages]]
name = "all"
time = "20 ms"
motions.punch = {motion}
"""


@pytest.mark.parametrize("stages", ["", STAGES])
def test_tools_that_overlap_on_one_side_of_the_sheet_leave_it_its_gap(stages):
    """They say nothing of its thickness: springs and gap are those without the one of them."""
    led = PUNCHED.replace("{motion}", f"motion = {STROKE}")
    text = led + RING
    if stages:
        text = PUNCHED.replace('process = { time = "20 ms" }\n', "").replace("{motion}", "")
        text += RING + stages.replace("{motion}", STROKE)
    model, alone = (build_model(scene_from_text(own)) for own in (text, led))
    (punch,) = np.flatnonzero(np.array(model.tool_names) == "punch")
    (ring,) = np.flatnonzero(np.array(model.tool_names) == "ring")
    meshes = [body.mesh for body in model.bodies]
    pair = (int(punch), int(ring))
    assert closest_gaps(model.tools, pair, places_of_sheet(meshes), np.zeros(1))[0].gap < 0.0
    found = closest_gap(model.tools, meshes, 20e-3)
    assert found == closest_gap(alone.tools, meshes, 20e-3) > 2e-3
    assert model.environment.penalty == alone.environment.penalty
    assert model.ply_contact.data.penalty[0] == alone.ply_contact.data.penalty[0]
    assert model.environment.depth_time is None
