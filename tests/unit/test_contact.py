"""Sheets on plates: Coulomb friction, guided tools, and where the energy goes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from lcmchain.elements.blocks import PACKS_OF_CHUNK
from lcmchain.packs import PACK
from lcmchain.scene import scene_from_text
from lcmchain.solver.interactions.contact_forces import find_near_packs
from lcmchain.solver.simulation import Simulation
from lcmchain.state import EXTERNAL

GRAVITY = 9.81
MU = 0.157
THICKNESS = 1.004e-3
AREAL_MASS = 0.6
AREA = 0.02**2
C33 = 0.1563e6  # compaction stiffness of MD600 at no pressure [Pa]

SHEET = """
title = "sheet on plates"
[process]
time = "1 s"
gravity = {gravity}
[blank]
size = ["20 mm", "20 mm"]
edge_length = "5 mm"
height = "{height} mm"
[material]
preset = "MD600"
[contact]
damping_ratio = {damping}
friction = {friction}
{penalty}
"""
BED = """
[[tools]]
name = "bed"
shape = {{ type = "plate", side = "below" }}
axis = [{x}, 0, {z}]
motion = {motion}
"""
HOLDER = """
[[tools]]
name = "holder"
shape = {{ type = "plate", side = "above" }}
position = ["0 mm", "0 mm", "{height} mm"]
friction = {friction}
motion = {motion}
"""
FIXED = '{ type = "fixed" }'


def simulation(*tools, gravity=True, friction=0.0, damping=0.2, height=0.502, penalty=""):
    sheet = SHEET.format(
        gravity=str(gravity).lower(),
        height=height,
        damping=damping,
        friction=friction,
        penalty=f'penalty = "{penalty}"' if penalty else "",
    )
    return Simulation.from_scene(scene_from_text(sheet + "".join(tools)))


def bed(angle=0.0, motion=FIXED):
    return BED.format(x=math.sin(angle), z=math.cos(angle), motion=motion)


def launch(sim, velocity):
    """Give all nodes a velocity, and enter its energy as work from outside."""
    sim.state.velocity[:] = np.reshape(velocity, (3, 1))
    energy = 0.5 * sim.model.nodes.mass.sum() * np.dot(velocity, velocity)
    sim.state.work[EXTERNAL] = energy
    return energy


def mean_velocity(sim):
    mass = sim.model.nodes.mass
    return sim.state.velocity @ mass / mass.sum()


def at_rest_on_its_bed(angle=0.0, **options):
    """A sheet on a plate tilted about y, sunk in and compacted as its own weight demands."""
    sim = simulation(bed(angle), **options)
    pressure = AREAL_MASS * GRAVITY * math.cos(angle)
    z = sim.state.position[2]
    upper = z > 0.5 * THICKNESS
    z -= pressure / sim.model.environment.penalty
    z[upper] -= 0.5 * pressure / C33 * THICKNESS  # the lumped upper half rests on the fabric
    c, s = math.cos(angle), math.sin(angle)
    sim.state.position[:] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ sim.state.position
    return sim


DOWNHILL = 15.0


def test_sheet_slides_down_an_incline():
    """Beyond arctan μ = 8.9 degrees the acceleration is g (sin θ − μ cos θ)."""
    angle = math.radians(DOWNHILL)
    sim = at_rest_on_its_bed(angle, friction=MU)
    sim.advance_to(4e-3)
    before = mean_velocity(sim)
    sim.advance_to(12e-3)
    acceleration = (mean_velocity(sim) - before) / 8e-3
    expected = GRAVITY * (math.sin(angle) - MU * math.cos(angle))
    assert acceleration @ [math.cos(angle), 0, -math.sin(angle)] == pytest.approx(
        expected, rel=5e-3
    )
    assert abs(acceleration @ [math.sin(angle), 0, math.cos(angle)]) < 5e-3 * expected
    assert abs(acceleration[1]) < 1e-6 * expected
    balance = sim.energy()
    assert abs(balance["balance_error"]) < 0.01 * balance["external"]


def test_sheet_sticks_to_a_gentle_incline():
    angle = math.radians(8.5)
    sim = at_rest_on_its_bed(angle, friction=MU)
    start = sim.state.position.mean(axis=1)
    sim.advance_to(12e-3)
    free = 0.5 * GRAVITY * math.sin(angle) * 12e-3**2
    assert np.linalg.norm(sim.state.position.mean(axis=1) - start) < 1e-3 * free
    # without friction it would be gone
    sim = at_rest_on_its_bed(angle)
    sim.advance_to(12e-3)
    assert np.linalg.norm(sim.state.position.mean(axis=1) - start) == pytest.approx(free, rel=1e-3)


def test_sliding_sheet_stops_where_friction_has_used_up_its_energy():
    """Stopping way v²/2μg; the kinetic energy ends as friction work."""
    sim = at_rest_on_its_bed(friction=MU)
    start = sim.state.position.mean(axis=1)
    speed = 0.03
    energy = launch(sim, [speed, 0.0, 0.0])
    sim.advance_to(1.3 * speed / (MU * GRAVITY))
    way = sim.state.position.mean(axis=1) - start
    assert way[0] == pytest.approx(speed**2 / (2.0 * MU * GRAVITY), rel=0.01)
    balance = sim.energy()
    assert balance["friction"] == pytest.approx(energy, rel=0.01)
    assert balance["kinetic"] < 1e-3 * energy
    assert abs(balance["balance_error"]) < 0.01 * energy


def test_sheet_rides_on_a_moving_bed_without_slip():
    """Slip is measured relative to the tool: a common motion costs no friction work."""
    motion = '{ type = "stroke", direction = [1, 0, 0], distance = "20 um", end = "12 ms" }'
    sim = simulation(bed(motion=motion), friction=MU)
    sim.restore(at_rest_on_its_bed(friction=MU).state)
    start = sim.state.position.mean(axis=1)
    sim.advance_to(12e-3)
    way = sim.state.position.mean(axis=1) - start
    assert way[0] == pytest.approx(20e-6, rel=2e-3)  # a_max = 5.77 d/T² = 0.8 m/s² < μ g
    assert sim.energy()["friction"] < 1e-3 * MU * AREAL_MASS * AREA * GRAVITY * 20e-6


@pytest.mark.parametrize("friction", [MU, 0.5])
def test_sled_is_held_back_by_friction_of_its_weight(friction):
    """A bed drawn from under a held sheet under a guided plate: F = μ N, N both weights."""
    mass = 0.05
    load = (mass + AREAL_MASS * AREA) * GRAVITY
    critical = 2.0 * math.sqrt(C33 * AREA / THICKNESS * mass)
    drawn = (
        '{ type = "stroke", direction = [1, 0, 0], distance = "20 mm", end = "200 ms", '
        'profile = "linear" }'
    )
    guided = (
        f'{{ type = "guided", direction = [0, 0, -1], mass = "{mass} kg", '
        f'damping = "{critical} N s/m" }}'
    )
    holder = HOLDER.format(height=1.004, friction=0.0, motion=guided)
    sim = simulation(bed(motion=drawn), holder, friction=friction)
    held = sim.state.position[0] < sim.state.position[0].min() + 1e-6
    free = np.ones((3, len(held)))
    free[0, held] = 0.0
    sim = Simulation(replace(sim.model, nodes=sim.model.nodes._replace(free=free)), sim.state)
    sim.advance_to(25e-3)
    fx, fy, fz = sim.state.tool_force[0]
    assert -fz == pytest.approx(load, rel=0.01)
    assert -fx / -fz == pytest.approx(friction, rel=1e-6)  # every node slides
    assert abs(fy) < 1e-3 * load
    assert sim.state.tool_force[1] == pytest.approx([0.0, 0.0, mass * GRAVITY], abs=0.01 * load)
    # the plate came to rest where the fabric carries it
    sunk = mass * GRAVITY / AREA / C33 * THICKNESS
    assert sim.state.tool_travel[1] == pytest.approx(sunk, rel=0.1)


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.7])
def test_bouncing_sheet_keeps_its_energy(phase):
    """To and fro between two frictionless plates, undamped; softer contact resolves the impact."""
    holder = HOLDER.format(height=1.204, friction=0.0, motion=FIXED)
    sim = simulation(
        bed(), holder, gravity=False, damping=0.0, height=0.602 + 1e-3 * phase, penalty="0.5 N/mm^3"
    )
    energy = launch(sim, [0.0, 0.0, -0.5])
    turns, direction, worst = 0, -1.0, 0.0
    for k in range(1, 61):
        sim.advance_to(1e-4 * k)
        worst = max(worst, abs(sim.energy()["balance_error"]))
        now = math.copysign(1.0, mean_velocity(sim)[2])
        turns, direction = turns + (now != direction), now
    assert turns >= 8
    assert worst < 2e-3 * energy


def test_contact_damping_only_takes_energy():
    sim = simulation(bed(), gravity=False, damping=0.2)
    energy = launch(sim, [0.0, 0.0, -0.5])
    last = 0.0
    for k in range(1, 21):
        sim.advance_to(2e-5 * k)
        balance = sim.energy()
        assert balance["damping"] >= last
        last = balance["damping"]
    assert 0.1 * energy < last < energy
    assert balance["kinetic"] + balance["internal"] < 0.95 * energy
    # an impact of some five steps
    assert abs(balance["balance_error"]) < 0.015 * energy


@pytest.mark.parametrize(("penalty", "tolerance"), [("", 3e-3), ("0.5 N/mm^3", 1e-4)])
def test_an_undamped_impact_keeps_its_energy_at_any_phase(penalty, tolerance):
    """Where between two steps the surface lies must not matter: with the full spring force from the
    first step inside, single impacts changed the energy by 3 % (0.2 %), up or down."""
    for phase in np.linspace(0.0, 1.0, 7):
        height = 0.502 + 1e-3 * (1.0 + 1.75 * phase)  # one step is 1.7 um
        sim = simulation(bed(), gravity=False, damping=0.0, height=height, penalty=penalty)
        energy = launch(sim, [0.0, 0.0, -0.5])
        sim.advance_to(2e-4)
        assert mean_velocity(sim)[2] > 0.0
        assert abs(sim.energy()["balance_error"]) < tolerance * energy


def test_contact_holds_a_sheet_without_adhesion():
    """It only ever pushes, however strong its damping, and leaves nothing behind."""
    sim = simulation(bed(), gravity=False, damping=1.0)
    launch(sim, [0.0, 0.0, -0.2])
    pushes = []
    for k in range(1, 101):
        sim.advance_to(2e-6 * k)
        pushes.append(-sim.state.tool_force[0, 2])
    assert min(pushes) >= 0.0
    assert max(pushes) > 0.0
    assert 0.0 < sim.state.penetration_max[0] < 20e-6
    sim.advance_to(2e-3)
    np.testing.assert_array_equal(sim.state.tool_force, 0.0)
    assert sim.state.position[2].min() > 0.0


def near_packs(near, chunk_start):
    """Return which packs are near to which tools, and the counts of these."""
    count = (len(chunk_start) - 1) * PACKS_OF_CHUNK
    marked, tools = np.full((count, len(near)), 7, dtype=np.uint8), np.full(count, 7)
    find_near_packs(near, np.array(chunk_start, dtype=np.int32), marked, tools)
    return marked, tools


def test_a_pack_of_nodes_is_looked_at_where_any_of_them_is_near():
    """Packs of 8, the last one of the two nodes that remain of 18."""
    for node, pack in ((0, 0), (7, 0), (8, 1), (17, 2)):
        near = np.zeros((2, 18), dtype=np.uint8)
        near[1, node] = 1
        marked, tools = near_packs(near, [0, 18])
        assert np.argwhere(marked).tolist() == [[pack, 1]]
        assert np.flatnonzero(tools).tolist() == [pack] and tools[pack] == 1


def test_packs_of_nodes_begin_anew_with_each_chunk():
    """The second chunk, of another body, begins with node 20."""
    near = np.zeros((1, 30), dtype=np.uint8)
    near[0, [19, 20]] = 1
    marked, _ = near_packs(near, [0, 20, 30])
    assert np.flatnonzero(marked[:, 0]).tolist() == [2, PACKS_OF_CHUNK]


def test_tools_near_a_pack_are_counted():
    near = np.zeros((3, 10), dtype=np.uint8)
    near[0, 1] = near[2, 2] = near[1, 9] = 1
    _, tools = near_packs(near, [0, 10])
    assert tools[:2].tolist() == [2, 1]


def test_nodes_that_there_are_none_of_touch_no_tool():
    """Of 50 nodes the last pack has two, and six that lie nowhere: not in a ball about 0 either."""
    ball = """
[[tools]]
name = "ball"
shape = { type = "sphere_capped_punch", radius = "20 mm" }
position = "0 0 -10 mm"
"""
    sim = simulation(ball, gravity=False, height=-50.0)
    assert sim.model.node_count % PACK != 0
    step = sim.prepare_steps()
    sim.state.near[:] = 1  # behind the search: where nodes lie is looked at in the steps
    sim.make_steps(5, step)
    assert sim.state.penetration_max[0] == 0.0
