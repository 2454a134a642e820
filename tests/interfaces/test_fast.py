"""Plies that fly at each other: they are found before they meet, however fast they come."""

from __future__ import annotations

import numpy as np
import pytest
from stacks import ALL, T, ply, scene_of, stack

from lcmchain.interfaces.table import Interface


def nodes_of(body):
    return slice(body.first_node, body.first_node + body.mesh.node_count)


def thrown(heights, speeds, weights=None):
    """Plies of 16 elements above each other at heights [mm]; their speeds upwards [m/s].

    weights : of the plies over that of MD600.
    """
    fastest = max(abs(speed) for speed in speeds)
    plies = [ply(f"ply {i}", z=height) for i, height in enumerate(heights)]
    for body, weight in zip(plies, weights or (), strict=False):
        body.material.areal_mass *= weight
        body.material.density *= weight
        body.material.fibre_density *= weight
    sim = stack(plies, scene_of(time=max(heights) / fastest + 1.0), ALL, Interface())
    velocity = np.zeros_like(sim.state.velocity)
    for body, speed in zip(sim.model.bodies, speeds, strict=True):
        velocity[2, nodes_of(body)] = speed
    sim.set_velocity(velocity)
    return sim


def heights_and_speeds(sim):
    """Means over the nodes of each ply: height [m] and speed upwards [m/s]."""
    height, speed = sim.state.position[2], sim.state.velocity[2]
    own = [nodes_of(body) for body in sim.model.bodies]
    return [height[k].mean() for k in own], [speed[k].mean() for k in own]


THROWS = [(gap, v) for gap in (1.0, 10.0, 30.0) for v in ((0.0, -5.0), (0.0, -20.0), (10.0, -10.0))]


@pytest.mark.parametrize(("gap", "speeds"), [*THROWS, (10.0, (0.0, -50.0))])
def test_a_ply_that_is_thrown_at_another_one_hands_on_its_momentum(gap, speeds):
    """Neither passes the other, the momentum of both stays, and they part again."""
    sim = thrown((0.0, gap + T), speeds)
    sim.advance_to(sim.model.process_time)
    (lower, upper), (slow, fast) = heights_and_speeds(sim)
    assert upper - lower > 0.9e-3 * T
    assert fast - slow > -0.1 * abs(speeds[1])
    assert slow + fast == pytest.approx(sum(speeds), abs=1e-9 * abs(speeds[1]))


def test_plies_that_fly_together_are_stopped_by_one_that_is_apart():
    """Each of the two touches the other one already, and what they fly at is none of these."""
    sim = thrown((0.0, 10.0, 10.0 + T), (0.0, -20.0, -20.0))
    sim.advance_to(sim.model.process_time)
    heights, speeds = heights_and_speeds(sim)
    assert (np.diff(heights) > 0.9e-3 * T).all()
    assert (np.diff(speeds) > -2.0).all()
    assert sum(speeds) == pytest.approx(-40.0, abs=1e-7)


def test_a_light_ply_stays_between_two_that_are_a_hundred_times_as_heavy():
    """They hit it from both sides: no impact feeds energy, and the momentum of all stays."""
    sim = thrown((0.0, T + 0.1, 2.0 * T + 0.2), (0.5, 0.0, -0.5), weights=(10.0, 0.1, 10.0))
    start = sim.energy()["external"]
    mass = sim.model.nodes.mass
    for time in np.linspace(0.0, sim.model.process_time, 21)[1:]:
        sim.advance_to(time)
        lower, light, upper = heights_and_speeds(sim)[0]
        assert lower < light - 0.9e-3 * T and light < upper - 0.9e-3 * T
        assert light - 1e-3 * (T + 0.1) == pytest.approx(0.0, abs=0.1e-3 * T)
        assert sim.energy()["balance_error"] < 5e-3 * start
    heavy = mass[nodes_of(sim.model.bodies[0])].sum()
    assert abs((mass * sim.state.velocity[2]).sum()) < 1e-4 * 0.5 * heavy
