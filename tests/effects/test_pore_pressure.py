"""Pore pressure: exact volume and forces, work, patch test, an element that cannot drain."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lcmchain.effects.face_pressure import face_forces
from lcmchain.effects.pore_pressure import (
    pore_forces,
    pore_frequencies,
    resistance_mobilities,
    volumes_and_rates,
)
from lcmchain.effects.supports import Support
from lcmchain.effects.switches import effects_of
from lcmchain.elements.blocks import LANES
from lcmchain.errors import InputError
from lcmchain.fields.dataset import model_datasets
from lcmchain.fields.saved import FrameSeries
from lcmchain.mesh.hexahedron import MODES, NODE_SIGNS
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

SCENE = """
process = { time = "2 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm", fibre_angle = "ANGLE deg" }
material = { preset = "MD600" }
"""
ANGLES = [0.0, 45.0]  # 45 degrees cut elements at the edges


def model_of(angle=0.0, *overrides, supports=lambda mesh: ()):
    scene = scene_from_text(SCENE.replace("ANGLE", str(angle)), overrides=list(overrides))
    return build_model(scene, supports, pore_pressure=True)


def crumpled(model, size=0.3e-3, seed=0):
    """Curved, sheared and crumpled at random (3, node_count) [m]."""
    rng = np.random.default_rng(seed)
    position = model.node_positions.T.copy()
    position[0] += 0.3 * position[1]
    position[2] += 4.0 * position[0] ** 2 - 3.0 * position[0] * position[1]
    turn = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()
    return turn @ position + rng.uniform(-size, size, position.shape)


def trilinear_volumes(corners):
    """Volumes [m³] of hexahedra with corner positions (element_count, 8, 3) [m]."""
    a = np.einsum("kn,end->ked", MODES, corners)

    def triple(i, j, k):
        return np.einsum("ed,ed->e", np.cross(a[i - 1], a[j - 1]), a[k - 1])

    bent = triple(1, 4, 6) + triple(4, 2, 5) + triple(6, 5, 3)
    return 8.0 * (triple(1, 2, 3) + bent / 3.0)


def volumes(model, position, velocity=None):
    volume, rate = np.empty((2, model.pore.padded_count))
    velocity = np.zeros_like(position) if velocity is None else velocity
    volumes_and_rates(model.pore, np.ascontiguousarray(position), velocity, volume, rate)
    return volume[model.pore.place], rate[model.pore.place]


def forces_on_nodes(model, position, pressure):
    """Forces of the pore pressure (3, node_count) [N], summed as the loop does."""
    load = np.zeros(model.corner_force_size)
    p = model.pore.in_lanes(pressure)
    none = np.zeros_like(p)
    position = np.ascontiguousarray(position)
    pore_forces(model.pore, position, np.zeros_like(position), p, none, none, 0.0, load)
    slot = model.nodes.force_slot
    return np.stack([load[slot + d * LANES].sum(axis=0) for d in range(3)])


def test_volume_is_that_of_the_trilinear_hexahedron():
    """Against Gauss integration of the Jacobian, exact with two points a direction."""
    corners = np.random.default_rng(3).normal(size=(20, 8, 3)) * 0.3 + NODE_SIGNS
    points = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T / np.sqrt(3.0)
    factors = 1.0 + NODE_SIGNS[None] * points[:, None]  # (point, node, axis)
    slope = np.stack(
        [NODE_SIGNS[:, d] * np.prod(np.delete(factors, d, axis=2), axis=2) / 8.0 for d in range(3)],
        axis=-1,
    )
    jacobian = np.einsum("pnd,enx->epxd", slope, corners)
    expected = np.linalg.det(jacobian).sum(axis=1)
    np.testing.assert_allclose(trilinear_volumes(corners), expected, rtol=1e-12)


@pytest.mark.parametrize("angle", ANGLES)
def test_compiled_volume_and_its_rate(angle):
    model = model_of(angle)
    x = crumpled(model)
    v = np.random.default_rng(1).normal(size=x.shape)
    volume, rate = volumes(model, x, v)
    np.testing.assert_allclose(
        volume, trilinear_volumes(x.T[model.only_body().mesh.elements]), rtol=1e-12
    )
    step = 1e-6
    ahead, back = (volumes(model, x + s * v)[0] for s in (step, -step))
    # a cubic of the step: the difference leaves its third derivative
    expected = (ahead - back) / (2 * step)
    np.testing.assert_allclose(rate, expected, atol=1e-7 * abs(rate).max())


@pytest.mark.parametrize("angle", ANGLES)
def test_force_is_the_derivative_of_the_work(angle):
    """f·v = Σ p dV/dt for every motion and every field of pressures."""
    model = model_of(angle)
    x = crumpled(model)
    rng = np.random.default_rng(2)
    for _ in range(5):
        p = rng.uniform(-1e5, 1e6, model.element_count)
        v = rng.normal(size=x.shape)
        power = np.sum(forces_on_nodes(model, x, p) * v)
        assert power == pytest.approx(np.sum(p * volumes(model, x, v)[1]), rel=1e-11)


def test_force_by_complex_step():
    """One component at a time, from the plain volume of complex positions."""
    model = model_of()
    x = crumpled(model)
    p = np.random.default_rng(4).uniform(0.0, 1e6, model.element_count)
    force = forces_on_nodes(model, x, p)
    for node in (0, 7, model.node_count - 3):
        for d in range(3):
            moved = x.astype(complex)
            moved[d, node] += 1e-30j
            work = np.sum(p * trilinear_volumes(moved.T[model.only_body().mesh.elements]))
            assert force[d, node] == pytest.approx(work.imag / 1e-30, rel=1e-11, abs=1e-9)


@given(turn=st.tuples(*[st.floats(-3.0, 3.0)] * 3), way=st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_rigid_motion_turns_forces_and_keeps_volumes(turn, way):
    model = model_of()
    x = crumpled(model)
    p = np.random.default_rng(5).uniform(0.0, 1e6, model.element_count)
    R = Rotation.from_rotvec(turn).as_matrix()
    force = forces_on_nodes(model, x, p)
    moved = R @ x + np.array(way)[:, None]
    scale = np.abs(force).max()
    np.testing.assert_allclose(forces_on_nodes(model, moved, p), R @ force, atol=1e-9 * scale)
    np.testing.assert_allclose(volumes(model, moved)[0], volumes(model, x)[0], rtol=1e-9)
    assert np.abs(force.sum(axis=1)).max() < 1e-9 * scale
    assert np.abs(np.cross(x.T, force.T).sum(axis=0)).max() < 1e-9 * scale


def test_stiffness_of_the_geometry_is_symmetric_and_within_its_bound():
    """Eigenvalues of p ∂²V/∂x∂x over an element's mass, by differences of the exact forces."""
    model = model_of()
    x = crumpled(model)
    element = 9
    p = np.zeros(model.element_count)
    p[element] = 1e6
    nodes = model.only_body().mesh.elements[element]
    K = np.empty((24, 24))
    step = 1e-6
    for column in range(24):
        way = np.zeros_like(x)
        way[column % 3, nodes[column // 3]] = step
        change = forces_on_nodes(model, x + way, p) - forces_on_nodes(model, x - way, p)
        K[:, column] = change[:, nodes].T.ravel() / (2 * step)
    assert np.abs(K - K.T).max() < 1e-9 * np.abs(K).max()
    lanes = model.pore.in_lanes(p)
    bound = np.empty_like(lanes)
    pore_frequencies(model.pore, np.ascontiguousarray(x), lanes, bound)
    mass = model.pore.mass[model.pore.place[element]]
    largest = np.abs(np.linalg.eigvalsh(K)).max() / (mass / 8.0)
    assert largest <= bound[model.pore.place[element]] < 3.0 * largest
    assert np.count_nonzero(bound) == 1


@pytest.mark.parametrize("angle", ANGLES)
def test_equal_pressure_loads_no_node_within_the_sheet(angle):
    """Patch test: what an inner node gets is the pressure on the two faces around it."""
    model = model_of(angle)
    x = crumpled(model)
    force = forces_on_nodes(model, x, np.full(model.element_count, 1e5))
    pairs = model.only_body().mesh.pair_count
    inner = np.ones(pairs, dtype=bool)
    edges = np.concatenate(
        [
            np.sort(np.column_stack([f, np.roll(f, -1)]), axis=1)
            for f in model.only_body().mesh.faces
        ]
    )
    edges = edges[edges[:, 0] != edges[:, 1]]
    pair, count = np.unique(edges, axis=0, return_counts=True)
    inner[pair[count == 1]] = False
    assert inner.sum() > 4
    # what remains is what a pressure of the same size on the two faces takes away
    load = np.zeros(model.corner_force_size)
    face_forces(model.pore, np.ascontiguousarray(x), 1e5, 1e5, None, load)
    slot = model.nodes.force_slot
    bag = np.stack([load[slot + d * LANES].sum(axis=0) for d in range(3)])
    both = force + bag
    of_inner = np.concatenate([inner, inner])
    assert np.abs(both[:, of_inner]).max() < 1e-12 * np.abs(force).max()
    assert np.abs(both[:, ~of_inner]).max() > 0.01 * np.abs(force).max()


def test_pressed_element_that_cannot_drain_bears_the_load_by_its_fluid():
    """A bag of 0.1 MPa on both faces, p = 0.1 MPa in the pores: nothing moves but the edges.

    Without the pore pressure the same bag compacts the sheet.
    """

    def held(mesh):
        return [Support("plane", np.arange(mesh.node_count), "xy")]

    bag = 'pressure=[{name = "bag", face = "both", value = "0.1 MPa", ramp = "0 s"}]'
    found = []
    for p in (1e5, 0.0):
        model = model_of(0.0, bag, supports=held)
        simulation = Simulation(model)
        simulation.state.pore_pressure[:] = model.pore.in_lanes(np.full(model.element_count, p))
        simulation.advance_to(3e-4)
        volume, initial = (
            volumes(model, x)[0] for x in (simulation.state.position, model.node_positions.T)
        )
        found.append(volume / initial)
    np.testing.assert_allclose(found[0], 1.0, atol=1e-12)
    assert found[1].max() < 0.99


@pytest.mark.parametrize("rising", [False, True])
def test_work_of_the_pressures_closes_the_balance(rising):
    """A free sheet swells, in the plane too: p dV is what the balance gets from outside.

    The error of the balance falls with the square of the step, as it does without a fluid.
    """
    errors = []
    for part in (0.4, 0.2):
        model = model_of()
        simulation = Simulation(model)
        state = simulation.state
        pressure = np.random.default_rng(6).uniform(0.0, 1e5, model.element_count)
        lanes = model.pore.in_lanes(pressure)
        (state.pore_rate if rising else state.pore_pressure)[:] = lanes / (2e-4 if rising else 1.0)
        count = int(2e-4 / (part * simulation.prepare_steps()))
        work, last = 0.0, state.pore_pressure.copy()
        before = volumes(model, state.position)[0]
        for _ in range(count):
            simulation.make_steps(1, 2e-4 / count)
            energy = simulation.energy()  # of the step before: without the last displacement
            assert energy["external"] == pytest.approx(work, rel=1e-2 * part, abs=1e-8)
            after, now = volumes(model, state.position)[0], state.pore_pressure.copy()
            work += np.sum(0.5 * (last + now)[model.pore.place] * (after - before))
            before, last = after, now
        assert energy["kinetic"] > 0.0
        errors.append(abs(energy["balance_error"]) / energy["external"])
    assert errors[1] < 1e-4
    assert errors[0] > 3.0 * errors[1]


def test_pressure_makes_the_stable_step_shorter():
    model = model_of()
    simulation = Simulation(model)
    dry = simulation.critical_step()
    simulation.state.pore_pressure[:] = model.pore.in_lanes(np.full(model.element_count, 1e8))
    omega2 = np.empty(model.pore.padded_count)
    position = np.ascontiguousarray(model.node_positions.T)
    pore_frequencies(model.pore, position, simulation.state.pore_pressure, omega2)
    total = 4.0 / dry**2 + omega2.max()
    assert simulation.critical_step() == pytest.approx(2.0 / np.sqrt(total), rel=1e-12)
    assert simulation.critical_step() < 0.9 * dry


def test_resistance_presses_against_the_rate_of_the_volume():
    model = model_of()
    rng = np.random.default_rng(3)
    position, velocity = crumpled(model), rng.normal(size=(3, model.nodes.mass.size))
    pressure = rng.uniform(0.0, 1e5, model.element_count)
    resistance = rng.uniform(0.0, 1e10, model.element_count)
    rate = volumes(model, position, velocity)[1]
    load = np.zeros(model.corner_force_size)
    p, z = model.pore.in_lanes(pressure), model.pore.in_lanes(resistance)
    position = np.ascontiguousarray(position)
    pore_forces(model.pore, position, velocity, p, np.zeros_like(p), z, 0.0, load)
    slot = model.nodes.force_slot
    found = np.stack([load[slot + d * LANES].sum(axis=0) for d in range(3)])
    wanted = forces_on_nodes(model, position, pressure - resistance * rate)
    np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-9 * np.abs(wanted).max())


def test_resistance_makes_the_stable_step_shorter():
    """One free element between its bound and instability: the step is safe, and not timid."""
    scene = scene_from_text(SCENE.replace("ANGLE", "0"))
    simulation = Simulation(build_model(scene, pore_pressure=True))
    model, state = simulation.model, simulation.state
    mobility = np.empty(model.pore.padded_count)
    resistance_mobilities(model.pore, state.position, mobility)
    dry = simulation.critical_step()
    rate = 0.5 / dry
    state.pore_resistance[:] = rate / np.maximum(mobility, mobility[model.pore.place].min())
    step = simulation.critical_step()
    assert step / dry == pytest.approx(np.sqrt(1.0 + 0.125**2) - 0.125, rel=1e-9)
    # |∂V/∂a3| = 2A of a flat element, whose other gradients are smaller by its thickness
    area, mass = (
        model.only_body().mesh.areas(model.node_positions),
        model.pore.mass[model.pore.place],
    )
    np.testing.assert_allclose(mobility[model.pore.place], 4.0 * area**2 / mass, rtol=0.1)


def test_rate_moves_the_pressure_on():
    model = model_of()
    simulation = Simulation(model)
    simulation.state.pore_rate[:] = model.pore.in_lanes(np.full(model.element_count, 1e6))
    simulation.advance_to(1e-4)
    np.testing.assert_allclose(simulation.state.pore_pressure[model.pore.place], 100.0, rtol=1e-12)


def test_result_holds_the_pore_pressure_of_every_element():
    scene = scene_from_text(SCENE.replace("ANGLE", "0"))
    simulation = Simulation(build_model(scene, pore_pressure=True))
    pressure = np.arange(simulation.model.element_count) * 1e3
    simulation.state.pore_pressure[:] = simulation.model.pore.in_lanes(pressure)
    frames = FrameSeries.from_snapshots([simulation.snapshot()], ())
    sheet = model_datasets(scene, simulation.model, frames)["/"]
    np.testing.assert_array_equal(sheet["pore_pressure"].values[0], pressure)
    assert sheet["pore_pressure"].attrs["units"] == "Pa"
    dry = Simulation(build_model(scene))
    frames = FrameSeries.from_snapshots([dry.snapshot()], ())
    assert "pore_pressure" not in model_datasets(scene, dry.model, frames)["/"]


def test_without_fluid_there_is_nothing_of_it():
    scene = scene_from_text(SCENE.replace("ANGLE", "0"))
    simulation = Simulation(build_model(scene))
    state = simulation.state
    assert state.pore_pressure.size == state.pore_rate.size == 0
    assert state.node_load.size == simulation._scratch.corner_load.size == 0
    told = [effect[:3] for effect in effects_of(simulation.model)]
    assert ("pore pressure", False, "no fluid is coupled") in told
    with_fluid = {effect.name: effect.active for effect in effects_of(model_of())}
    assert with_fluid["pore pressure"]


def test_a_sheet_without_thickness_has_no_pores():
    scene = scene_from_text(SCENE.replace("ANGLE", "0"), overrides=["element=membrane-shell"])
    with pytest.raises(InputError, match="solid-shell"):
        build_model(scene, pore_pressure=True)
