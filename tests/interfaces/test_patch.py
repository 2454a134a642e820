"""Patch test: plies of unlike meshes between plates become equally thick everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from stacks import ALL, T, inner, ply, scene_of, stack, thickness

from lcmchain.effects.contact_depth import nominal_pressure
from lcmchain.interfaces.table import Interface

MESHES = [
    {"edge": 4.0, "angle": 30.0},
    {"edge": 5.0, "angle": 0.0},
    {"edge": 6.0, "angle": 45.0},
    {"edge": 5.0, "angle": -20.0},
]
WIDTH, HEIGHT = 60.0, 50.0


def pressed(count, part):
    """A stack that is compressed by a part of its thickness, and held."""
    entries = {"time": 10.0, "damping": 500.0, "bottom": 0.0, "top": count * T}
    entries |= {"travel": part * count * T, "stop": 5.0}
    plies = [
        ply(f"ply {i}", width=WIDTH, height=HEIGHT, z=(i + 0.5) * T, **MESHES[i])
        for i in range(count)
    ]
    sim = stack(plies, scene_of(**entries), ALL, Interface())
    sim.advance_to(10e-3)
    return sim


@pytest.mark.parametrize("count", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_plies_of_unlike_meshes_are_compressed_alike(count):
    """20 %: every element away from rims as the compaction law says for the plates' pressure."""
    sim = pressed(count, 0.2)
    law = sim.model.bodies[0].material
    stretch = np.linspace(0.7, 1.0, 3001)
    force = 0.5 * np.abs(sim.state.tool_force[:, 2]).sum()
    wanted = np.interp(-force / (1e-6 * WIDTH * HEIGHT), -nominal_pressure(law, stretch), stretch)
    stack_thickness = 0.0
    for body in sim.model.bodies:
        found = thickness(sim, body)[inner(body, 8e-3)] / (1e-3 * T)
        assert np.sqrt(np.mean((found / wanted - 1.0) ** 2)) < 5e-3
        stack_thickness += found.mean()
    assert stack_thickness == pytest.approx(0.8 * count, abs=5e-3)
    energy = sim.energy()
    assert abs(energy["balance_error"]) < 1e-3 * energy["external"]


def test_a_stack_under_half_a_megapascal_is_as_thick_as_its_plies():
    """No interface takes its depth off the stack: within 0.5 % of a ply.

    Looked at in the middle: at this pressure elements at the rims between smooth plates bend aside.
    """
    law = pressed_law()
    stretch = np.linspace(0.5, 1.0, 5001)
    part = 1.0 - np.interp(-0.5e6, -nominal_pressure(law, stretch), stretch)
    sim = pressed(2, part)
    for body in sim.model.bodies:
        found = thickness(sim, body)[inner(body, 12e-3)].mean()
        assert found == pytest.approx(1e-3 * T * (1.0 - part), abs=2.5e-6)


def pressed_law():
    return scene_of().material.build()
