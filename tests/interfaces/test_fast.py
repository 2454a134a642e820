"""Plies that fly at each other: they are found before they meet, however fast they come."""

from __future__ import annotations

import numpy as np
import pytest
from stacks import ALL, T, ply, scene_of, stack

from lcmchain.interfaces.table import Interface


def nodes_of(body):
    return slice(body.first_node, body.first_node + body.mesh.node_count)


def thrown(heights, speeds):
    """Plies of 16 elements above each other at heights [mm]; their speeds upwards [m/s]."""
    fastest = max(abs(speed) for speed in speeds)
    plies = [ply(f"ply {i}", z=height) for i, height in enumerate(heights)]
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
