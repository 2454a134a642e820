"""Plies that slide on each other: friction, curved interfaces, rims, ends inside a stack."""

from __future__ import annotations

import numpy as np
import pytest
from stacks import ALL, FAR, MU, T, booked, drawn, ply, scene_of, stack, wrapped

from lcmchain.effects.supports import Support
from lcmchain.interfaces.table import Interface

# --- a strip that runs round inside a drum --------------------------------------------------------

RADIUS = 0.04
EDGE = 2e3 * np.pi * RADIUS / 64.0  # [mm]
SPEED = 5.5


def spun(friction, time=12.0):
    """A strip inside a drum that is held, started at 100 degrees with :data:`SPEED`."""
    half = 0.5e-3 * T
    drum = wrapped("drum", RADIUS + half, width=48 * EDGE, height=12.0, edge=EDGE)
    edge = 0.8 * EDGE
    strip = wrapped("strip", RADIUS - half, width=8 * edge, height=8.0, edge=edge)
    own = drum.mesh.node_count
    held = [Support("drum", np.arange(own))]
    between = Interface(friction=friction)
    sim = stack([drum, strip], scene_of(time=time), ALL, between, supports=held)
    angle = np.radians(-100.0)
    position = sim.state.position
    x, z = position[0, own:].copy(), position[2, own:].copy()
    position[0, own:] = np.cos(angle) * x - np.sin(angle) * z
    position[2, own:] = np.sin(angle) * x + np.cos(angle) * z
    velocity = np.zeros_like(position)
    velocity[0, own:] = -SPEED / RADIUS * position[2, own:]
    velocity[2, own:] = SPEED / RADIUS * position[0, own:]
    sim.set_velocity(velocity)
    sim.prepare_steps()
    sim.advance_to(1e-3 * time)
    mass = sim.model.nodes.mass[own:]
    place, velocity = sim.state.position[:, own:], sim.state.velocity[:, own:]
    spin = mass * (place[0] * velocity[2] - place[2] * velocity[0])
    square = place[0] ** 2 + place[2] ** 2
    # its mass lies a little further inside than the face that slides
    lever = (mass * square).sum() / (mass * np.sqrt(square)).sum()
    return sim, spin.sum() / (mass * square).sum() * RADIUS, lever


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_a_strip_in_a_drum_loses_the_speed_that_friction_takes(friction):
    """Pressed on by its own way round: dv/dt = -µ v²/r; it has passed some 15 facets."""
    sim, speed, lever = spun(friction)
    wanted = SPEED / (1.0 + friction * SPEED / lever * 12e-3)
    energy = sim.energy()
    assert speed == pytest.approx(wanted, rel=2e-3)
    assert abs(booked(sim)) < 1e-2 * energy["external"]
    assert abs(energy["balance_error"]) < 5e-3 * energy["external"]


# --- flat -----------------------------------------------------------------------------------------


def sled():
    """A small ply that is pressed on a held one and drawn over it."""
    entries = {"time": 8.0, "bottom": -FAR, "top": 2 * T}
    entries |= {"travel": 0.2 * T, "stop": 2.0}
    bed = ply("bed", width=50.0, height=20.0, edge=4.0, angle=30.0, z=0.5 * T)
    small = ply("sled", shift=(-8.0, 0.0, 0.0), width=16.0, height=12.0, edge=4.0, z=1.5 * T)
    own = bed.mesh.node_count
    x = small.mesh.node_positions[:, 0]
    back = own + np.flatnonzero(x < x.min() + 1e-6)
    supports = [Support("bed", np.arange(own)), drawn("grip", back, 8e-3, 2e-3, 8e-3)]
    return stack([bed, small], scene_of(**entries), ALL, Interface(friction=MU), supports=supports)


def test_a_sled_takes_its_friction_times_its_load():
    sim = sled()
    sim.advance_to(4e-3)
    before = sim.state.copy()
    sim.advance_to(6.5e-3)
    after = sim.state
    drag = (after.support_impulse[1, 0] - before.support_impulse[1, 0]) / 2.5e-3
    load = (after.tool_impulse[1, 2] - before.tool_impulse[1, 2]) / 2.5e-3
    energy = sim.energy()
    assert drag == pytest.approx(MU * load, rel=5e-3)
    assert abs(energy["balance_error"]) < 5e-3 * energy["external"]


def slid(bodies, top, press, travel, which, time=5.0):
    """Plies under a plate of which one is drawn by its rear end."""
    entries = {"time": time, "damping": 100.0, "bottom": 0.0, "top": top}
    entries |= {"travel": press, "stop": 0.3 * time}
    counts = [body.mesh.node_count for body in bodies]
    first = sum(counts[:which])
    x = bodies[which].mesh.node_positions[:, 0]
    grip = first + np.flatnonzero(x > x.max() - 1e-6)
    still = bodies[0].mesh.node_positions[:, 0]
    supports = [
        Support("end", np.flatnonzero(still < still.min() + 1e-6), "x"),
        drawn("grip", grip, travel, 0.3e-3 * time, 1e-3 * time),
    ]
    return stack(bodies, scene_of(**entries), ALL, Interface(friction=MU), supports=supports)


@pytest.mark.slow
def test_a_ply_is_drawn_over_another_one_with_the_same_rims():
    plies = [ply(f"ply {i}", width=30.0, height=15.0, z=(i + 0.5) * T) for i in range(2)]
    sim = slid(plies, 2 * T, 0.2 * T, 8e-3, 1)
    sim.advance_to(5e-3)
    energy = sim.energy()
    assert abs(energy["balance_error"]) < 1e-2 * energy["external"]
    assert abs(booked(sim)) < 1e-2 * energy["external"]


@pytest.mark.slow
def test_a_short_ply_is_drawn_out_between_two_long_ones():
    """Away from another one: a gap opens inside the stack, and the long ones bend into it."""
    long = {"width": 50.0, "height": 12.0, "edge": 4.0}
    short = {"width": 18.0, "height": 12.0, "edge": 3.0, "z": 1.5 * T}
    plies = [
        ply("lower", z=0.5 * T, **long),
        ply("front", shift=(9.0, 0.0, 0.0), **short),
        ply("upper", z=2.5 * T, **long),
        ply("rear", shift=(-9.0, 0.0, 0.0), **short),  # ends where the front one begins
    ]
    sim = slid(plies, 3 * T, 0.3 * T, 8e-3, 1)
    sim.advance_to(5e-3)
    energy = sim.energy()
    assert abs(energy["balance_error"]) < 1e-2 * energy["external"]
    assert abs(booked(sim)) < 2e-2 * energy["external"]
