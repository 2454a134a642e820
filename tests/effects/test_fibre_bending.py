"""Bending of the fibres within the plane: energy of known shapes, forces, bound, and its limits."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lcmchain.effects.fibre_bending import (
    MIDDLE_ROWS,
    VECTOR_ROWS,
    build_fibre_bending,
    curvatures,
    fibre_bending_forces,
    frequency_bound,
    mid_positions,
    stored_energy,
)
from lcmchain.effects.switches import effects_of
from lcmchain.elements.blocks import LANES
from lcmchain.mesh.blank import Blank, build_blank
from lcmchain.mesh.lines import fibre_lines
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.verification.hard_cases.sheets import simulation as moved_simulation

SCENE = """
process = { time = "2 ms" }
blank = { size = ["60 mm", "40 mm"], edge_length = "5 mm", fibre_angle = "ANGLE deg" }
element = "TYPE"
material = { preset = "MD600" }
"""
TYPES = ["solid-shell", "membrane-shell"]


def model_of(element="solid-shell", angle=0.0, **changes):
    text = SCENE.replace("TYPE", element).replace("ANGLE", str(angle))
    return build_model(scene_from_text(text, overrides=[f"{k}={v}" for k, v in changes.items()]))


def unfolded(table, x):
    """Share (mid_count,) of their energy that nodes keep, 1 where nothing is folded."""
    first, second = x[table.after] - x[table.before]
    area2 = (np.cross(first, second) ** 2).sum(axis=-1)
    s = np.minimum(table.per_area2 * area2, 1.0)
    return s * (2.0 - s)


def forces_on_nodes(model, position):
    """Internal forces (3, node_count) [N] of the fibres' bending alone, summed as the loop does."""
    table = model.fibre_bending
    corner_force = np.zeros(model.corner_force_size)
    scratch = (np.empty(table.padded_count * rows) for rows in (MIDDLE_ROWS, VECTOR_ROWS))
    blocks = 0, table.data.start.size
    positions = np.ascontiguousarray(position)
    fibre_bending_forces(table.data, *blocks, positions, corner_force, *scratch)
    slot = model.nodes.force_slot
    return np.stack([corner_force[slot + d * LANES].sum(axis=0) for d in range(3)])


def crumpled(model, size=1e-3, seed=0):
    """Rotated, sheared and crumpled at random (3, node_count) [m]."""
    rng = np.random.default_rng(seed)
    position = model.node_positions.T.copy()
    position[0] += 0.4 * position[1] + 3.0 * position[1] ** 2
    position[2] += 4.0 * position[0] ** 2 - 3.0 * position[0] * position[1]
    turn = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()
    return turn @ position + rng.uniform(-size, size, position.shape)


def folded(model, degrees, size=2e-4):
    """Folded about the y axis, a line of nodes, and crumpled a little (3, node_count) [m]."""
    position = model.node_positions.T.copy()
    turn = Rotation.from_rotvec([0.0, -np.radians(degrees), 0.0]).as_matrix()
    right = position[0] > 1e-6
    position[:, right] = turn @ position[:, right]
    return position + np.random.default_rng(2).uniform(-size, size, position.shape)


def least_kept(model, position):
    """The least part of their energy that nodes keep where the sheet is folded on itself."""
    table = model.fibre_bending
    kept = unfolded(table, mid_positions(table, position))
    return kept[table.stiffness.any(axis=0)].min()


@pytest.mark.parametrize("element", TYPES)
@pytest.mark.parametrize("angle, fold", [(0.0, 0.0), (45.0, 0.0), (0.0, 173.0)])
def test_forces_are_the_derivative_of_the_energy(element, angle, fold):
    """Cut outlines too, where lines end within the sheet, and where it is folded on itself."""
    model = model_of(element, angle)
    position = folded(model, fold) if fold else crumpled(model)
    assert (least_kept(model, position) < 0.9) == (fold > 0.0)
    force = forces_on_nodes(model, position)
    rng = np.random.default_rng(1)
    for _ in range(5):
        way = rng.normal(size=position.shape)
        step = 1e-8
        ahead, back = (
            stored_energy(model.fibre_bending, position + s * way) for s in (step, -step)
        )
        assert np.sum(force * way) == pytest.approx((ahead - back) / (2.0 * step), rel=1e-6)
    largest = np.abs(force).max()
    node = np.argmax(np.abs(force).sum(axis=0))
    assert largest > 0.0
    for d in range(3):
        way = np.zeros_like(position)
        way[d, node] = 1e-8
        ahead, back = (stored_energy(model.fibre_bending, position + s * way) for s in (1, -1))
        assert (ahead - back) / 2e-8 == pytest.approx(force[d, node], abs=1e-5 * largest)


@pytest.mark.parametrize("element", TYPES)
def test_rigid_motion_and_homogeneous_shear_cost_nothing(element):
    model = model_of(element)
    X = model.node_positions.T
    turn = Rotation.from_rotvec([1.0, 0.4, -2.0]).as_matrix()
    shear = np.array([[1.0, 0.3, 0.0], [0.2, 0.9, 0.0], [0.0, 0.0, 1.0]])
    scale = stored_energy(model.fibre_bending, crumpled(model))
    moved = turn @ shear @ X + np.array([[1.0], [2.0], [3.0]])
    assert stored_energy(model.fibre_bending, moved) < 1e-20 * scale
    force = forces_on_nodes(model, crumpled(model))
    assert np.abs(force.sum(axis=1)).max() < 1e-9 * np.abs(force).max()
    moment = np.cross(crumpled(model).T, force.T).sum(axis=0)
    assert np.abs(moment).max() < 1e-8 * np.abs(force).max()


@pytest.mark.parametrize("element", TYPES)
@pytest.mark.parametrize("family", [0, 1])
def test_an_arc_within_the_plane_has_its_energy(element, family):
    """Fibres of one family on parallel arcs of radius R: ½ D/R² per area, less where lines end."""
    model = model_of(element)
    X = model.node_positions
    R = 0.3
    along, across = (0, 1) if family == 0 else (1, 0)
    position = X.copy()
    position[:, across] += R - np.sqrt(R**2 - X[:, along] ** 2)
    table = model.fibre_bending
    kappa = curvatures(table, mid_positions(table, position.T))
    bent = table.stiffness[family] > 0.0
    # a fibre shifted across itself keeps its arc; at 60 mm the chord of 10 mm leaves 0.03 %
    np.testing.assert_allclose(np.abs(kappa[family, bent]), 1.0 / R, rtol=0.01)
    np.testing.assert_allclose(kappa[1 - family], 0.0, atol=1e-9 / R)
    D = model.only_body().material.fibre_bending[family]
    area = model.nodes.area[table.below][bent].sum()
    energy = stored_energy(table, position.T)
    assert energy == pytest.approx(0.5 * D / R**2 * area, rel=0.01)
    inertia = model.only_body().material.thickness ** 3 / 12.0
    assert D == pytest.approx(
        0.1 * model.only_body().material.bending_matrix()[family, family] * inertia
    )


@pytest.mark.parametrize("element", TYPES)
@pytest.mark.parametrize("fold", [0.0, 173.0])
def test_the_energy_is_that_of_the_curvatures(element, fold):
    model = model_of(element)
    table, position = model.fibre_bending, folded(model, fold) if fold else crumpled(model)
    x = mid_positions(table, position)
    known = 0.5 * (table.stiffness * curvatures(table, x) ** 2 * unfolded(table, x)).sum()
    assert stored_energy(table, position) == pytest.approx(known, rel=1e-12)


def test_bending_out_of_the_plane_costs_nothing():
    """On a cylinder all fibres along and around it are geodesics."""
    model = model_of()
    X = model.node_positions
    R = 0.05
    position = np.column_stack([R * np.sin(X[:, 0] / R), X[:, 1], R * np.cos(X[:, 0] / R)])
    scale = stored_energy(model.fibre_bending, crumpled(model, size=0.0))
    assert stored_energy(model.fibre_bending, position.T) < 1e-12 * scale


@pytest.mark.parametrize("element", TYPES)
def test_the_bound_is_above_the_highest_frequency_and_not_far(element):
    model = model_of(element)
    mass, start = model.nodes.mass, model.node_positions.T
    mode = np.random.default_rng(1).normal(size=start.shape)
    for _ in range(400):
        mode /= np.sqrt(np.sum(mass * mode**2))
        ahead, back = (forces_on_nodes(model, start + s * 1e-7 * mode) for s in (1.0, -1.0))
        mode = (ahead - back) / 2e-7 / mass
        value = np.sqrt(np.sum(mass * mode**2))
    bound = frequency_bound(model.fibre_bending, mass)
    assert value < bound < 3.0 * value


def test_lines_follow_the_fibres_of_moved_nodes_and_end_at_cut_edges():
    blank = Blank(size=("60 mm", "40 mm"), edge_length="5 mm")
    regular = fibre_lines(build_blank(blank, 1e-3))
    moved = fibre_lines(build_blank(blank, 1e-3, perturbation=0.2))
    np.testing.assert_array_equal(regular.after, moved.after)
    assert (regular.after[0] >= 0).sum() == 12 * 9
    assert (regular.after[1] >= 0).sum() == 13 * 8
    for lines in (
        regular,
        fibre_lines(build_blank(blank.model_copy(update={"fibre_angle": 0.5}), 1e-3)),
    ):
        for after, before in zip(lines.after, lines.before, strict=True):
            there = np.flatnonzero(after >= 0)
            np.testing.assert_array_equal(before[after[there]], there)


def test_a_line_without_the_other_fibre_is_left_out():
    """What bends within the plane is told by the direction across, which no edge gives here."""
    body = model_of("membrane-shell").only_body()
    up = np.broadcast_to([0.0, 0.0, 1.0], body.mesh.fibre_direction_2.shape)
    odd = SimpleNamespace(
        mesh=replace(body.mesh, fibre_direction_2=up),
        material=body.material,
        first_node=0,
        node_area=body.node_area,
    )
    assert (fibre_lines(odd.mesh).after[0] >= 0).any()
    assert build_fibre_bending([odd], 0) is None


@pytest.mark.parametrize("angle", [7, 30, 45, 71])
def test_cut_outlines_have_finite_forces(angle):
    text = SCENE.replace("TYPE", "membrane-shell").replace("ANGLE", str(angle))
    outline = '[["0 mm", "0 mm"], ["70 mm", "5 mm"], ["31 mm", "13 mm"], ["12 mm", "47 mm"]]'
    text = text.replace('size = ["60 mm", "40 mm"]', f"outline = {outline}")
    text = text.replace('edge_length = "5 mm"', 'edge_length = "3 mm"')
    model = build_model(scene_from_text(text))
    assert np.isfinite(model.fibre_bending.rest).all()
    assert np.isfinite(forces_on_nodes(model, crumpled(model))).all()


def test_a_mesh_at_rest_with_crooked_lines_is_free_of_stress():
    text = SCENE.replace("TYPE", "solid-shell").replace("ANGLE", "20")
    model = moved_simulation(text, perturbation=0.2).model
    table = model.fibre_bending
    assert np.abs(table.rest).max() > 10.0
    start = model.node_positions.T
    force = np.abs(forces_on_nodes(model, start)).max()
    assert stored_energy(table, start) < 1e-20 * 0.5 * (table.stiffness * table.rest**2).sum()
    moment = (table.stiffness * np.abs(table.rest) * table.weight_before).max()
    assert force < 1e-10 * moment


def test_without_stiffness_there_is_no_table_and_no_force():
    model = model_of(**{"material.bending.in_plane": 0})
    assert model.fibre_bending is None
    (effect,) = (e for e in effects_of(model) if e.name == "in-plane bending of fibres")
    assert not effect.active
    assert model.nodes.force_slot.shape[0] == model_of().nodes.force_slot.shape[0] - 1


def test_a_sheet_that_swings_within_its_plane_keeps_its_energy():
    """Without tools, let go from fibres bent in the plane: the balance holds with their energy."""
    scene = scene_from_text(
        SCENE.replace("TYPE", "solid-shell").replace("ANGLE", "0"),
        overrides=["material.bending.in_plane=1"],
    )
    simulation = Simulation.from_scene(scene)
    X = simulation.model.node_positions.T
    position = X.copy()
    position[1] += 1e-4 * np.cos(np.pi * X[0] / 10e-3)
    simulation.set_position(position)
    bent = stored_energy(simulation.model.fibre_bending, position)
    assert bent > 0.2 * simulation.energy()["internal"]
    simulation.advance_to(scene.process.time)
    energy = simulation.energy()
    assert energy["kinetic"] > 0.01 * energy["internal"]
    # what stretches fibres at the start vibrates fast: central differences leave out 1.4 % of it
    assert abs(energy["balance_error"]) < 0.02 * energy["external"] < 0.05 * bent


def test_a_sheet_that_folds_on_itself_keeps_its_energy():
    """Two flaps of a sheet that folds at no cost swing through each other."""
    element = '{ type = "membrane-shell", bending = false }'
    text = SCENE.replace('"TYPE"', element).replace("ANGLE", "0")
    simulation = Simulation.from_scene(scene_from_text(text))
    model = simulation.model
    position = folded(model, 170.0, size=1e-7)
    simulation.set_position(position)
    velocity = np.zeros_like(position)
    velocity[2] = 100.0 * model.node_positions[:, 0]
    velocity[2] *= -np.sign(position[2, position[0].argmin()])
    simulation.set_velocity(velocity)
    kept = []
    simulation.advance_to(
        5e-3, lambda simulation: kept.append(least_kept(model, simulation.state.position))
    )
    assert min(kept) < 0.01
    energy = simulation.energy()
    assert abs(energy["balance_error"]) < 1e-3 * energy["external"]
