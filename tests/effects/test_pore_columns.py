"""Columns of fluid through a stack: what their pressure loads, and what their resistance damps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from lcmchain.effects.face_pressure import face_forces
from lcmchain.effects.pore_pressure import (
    PoreColumns,
    column_drops,
    mobilities,
    of_columns,
    scale_loads,
    unit_loads,
)
from lcmchain.elements.pressed_elements import LOAD_ROWS
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text

PLY = """
[[plies]]
size = ["30 mm", "20 mm"]
edge_length = "5 mm"
"""
MIXED = f"""
process = {{ time = "2 ms" }}
{PLY}
{PLY}
material = "glass"
{PLY}
[material]
preset = "MD600"
[materials.glass]
preset = "glass-plain-600"
"""


@pytest.fixture(scope="module")
def model():
    """Three plies, of which the loop takes the outer ones together, before the middle one."""
    found = build_model(scene_from_text(MIXED), pore_pressure=True)
    firsts = [placed.first_force for placed in found.placed]
    assert firsts[2] < firsts[1]
    return found


def crumpled(model, seed=0):
    """Curved plies that still lie on each other (3, node_count) [m]."""
    rng = np.random.default_rng(seed)
    position = model.node_positions.T.copy()
    x, y = position[0].copy(), position[1].copy()
    position[0] += 0.3 * y
    position[2] += 4.0 * x**2 - 3.0 * x * y
    count = model.bodies[0].mesh.node_count
    wave = rng.uniform(-0.2e-3, 0.2e-3, (3, count))
    # nodes of two faces that touch move together
    for body in model.bodies:
        position[:, body.first_node : body.first_node + count] += wave
    return position


def on_nodes(model, load):
    padded = np.zeros(model.corner_force_size)
    padded[: load.size] = load
    slot = model.nodes.force_slot
    return np.stack([padded[slot + 16 * d].sum(axis=0) for d in range(3)])


def unit(model, position, velocity=None):
    velocity = np.zeros_like(position) if velocity is None else velocity
    rate = np.empty(model.pore.padded_count)
    load = np.empty(model.pore.padded_count * LOAD_ROWS)
    unit_loads(model.pore, position, velocity, rate, load)
    return load, rate


def faces(model):
    """Nodes of the lower and the upper face of every ply."""
    return [
        (np.unique(body.mesh.elements[:, :4]) + body.first_node,
         np.unique(body.mesh.elements[:, 4:]) + body.first_node)
        for body in model.bodies
    ]  # fmt: skip


def test_equal_pressure_loads_the_outer_faces_alone(model):
    """Within the rim nothing presses on a face that looks at a ply."""
    position = crumpled(model)
    force = on_nodes(model, unit(model, position)[0])
    place = model.node_positions.T
    inside = (np.abs(place[0]) < 14e-3) & (np.abs(place[1]) < 9e-3)
    (bottom, first), middle, (third, top) = faces(model)
    size = np.abs(force[:, bottom[inside[bottom]]]).max()
    assert size > 1e-5
    for nodes in (first, *middle, third):
        assert np.abs(force[:, nodes[inside[nodes]]]).max() < 1e-12 * size
    # and on these it presses as a pressure on the faces does, from inside
    pressed = np.empty(model.pore.padded_count * LOAD_ROWS)
    face_forces(model.pore, position, -1.0, -1.0, None, pressed)
    outer = np.concatenate([bottom[inside[bottom]], top[inside[top]]])
    np.testing.assert_allclose(
        force[:, outer], on_nodes(model, pressed)[:, outer], atol=1e-12 * size
    )


def test_a_pressure_on_faces_finds_the_nodes_of_mixed_plies(model):
    """The loads lie where nodes look for them, whatever the order in which the loop takes plies."""
    load = np.empty(model.pore.padded_count * LOAD_ROWS)
    position = np.ascontiguousarray(model.node_positions.T)
    face_forces(model.pore, position, 0.0, 2.0, None, load)
    force = on_nodes(model, load)
    *_, (_, top) = faces(model)
    assert force[2, top].sum() == pytest.approx(-2.0 * 30e-3 * 20e-3, rel=1e-12)
    others = np.setdiff1d(np.arange(model.node_count), top)
    assert np.abs(force[:, others]).max() < 1e-18


def equal_columns(model):
    count = model.bodies[0].mesh.element_count
    rows = np.arange(model.element_count)
    ones = csr_array((np.ones(rows.size), (rows, rows % count)), shape=(rows.size, count))
    return PoreColumns.of_shares(model.pore, ones, 0)


def test_resistance_answers_to_the_volume_of_the_whole_column(model):
    """The stack as a whole may move, and its plies give way to each other, without it."""
    position = np.ascontiguousarray(model.node_positions.T)
    columns, area = equal_columns(model), 25e-6
    resistance = np.zeros(model.pore.padded_count)
    resistance[columns.lane] = 3.0e8
    (bottom, first), (second, _), (_, top) = faces(model)

    def drops(velocity):
        load, rate = unit(model, position, velocity)
        columns.rate[:] = rate
        drop = np.full(columns.lane.size, np.nan)
        column_drops(columns, resistance, drop)
        pressure = np.full(model.pore.padded_count, 5.0)
        pressures = load.copy()
        scale_loads(columns, drop, pressure, np.full_like(pressure, 2.0), 0.5, pressures)
        np.testing.assert_array_equal(pressure, 6.0)  # moved on at its rate
        expected = load.reshape(-1, LOAD_ROWS, 16)[0, :, 0] * (5.0 - drop[0])
        np.testing.assert_allclose(pressures.reshape(-1, LOAD_ROWS, 16)[0, :, 0], expected)
        return drop

    up = np.zeros_like(position)
    up[2] = 0.1
    assert np.abs(drops(up)).max() < 1e-9
    inner = np.zeros_like(position)
    inner[2, first] = inner[2, second] = 0.1
    assert np.abs(drops(inner)).max() < 1e-9
    closing = np.zeros_like(position)
    closing[2, bottom], closing[2, top] = 0.02, -0.03
    np.testing.assert_allclose(drops(closing), -3.0e8 * 0.05 * area, rtol=1e-12)


def test_mobility_bounds_the_answer_of_a_column(model):
    """A unit pressure moves the outer faces with A over the mass of their nodes, both ways."""
    position, columns = np.ascontiguousarray(model.node_positions.T), equal_columns(model)
    found = of_columns(columns, mobilities(model.pore, position))
    count = model.bodies[0].mesh.element_count
    mass = model.pore.mass[model.pore.place]
    # within the rim: no sides; a face of four corners with a quarter of the area, an eighth of m
    area = 25e-6
    faces_alone = 2.0 * area**2 * (1.0 / mass[:count] + 1.0 / mass[-count:])
    assert (found >= faces_alone * (1.0 - 1e-12)).all()
    assert (found <= 1.5 * faces_alone).all()
