"""Prescribed motion of nodes: rigid motion, shear, hanging under gravity, planes of symmetry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lcmchain.effects.supports import Support, build_supports, translation
from lcmchain.errors import InputError
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

SHEET = """
process = { time = "20 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
element = { cross_terms = false }
"""


def supported(text, make_supports, **environment):
    """A simulation of the scene ``text`` with the supports that its node positions give."""
    model = build_model(scene_from_text(text), lambda blank: make_supports(blank.node_positions))
    environment = model.environment._replace(**environment)
    return Simulation(replace(model, environment=environment))


def smooth(time, duration=20e-3):
    s = time / duration
    return s**3 * (10 - 15 * s + 6 * s**2)


def everywhere(X):
    return np.arange(len(X))


def test_a_sheet_carried_along_needs_mass_times_acceleration():
    carry = translation([3, 0, 4], lambda time: 0.1 * smooth(time))
    sim = supported(SHEET, lambda X: [Support("grip", everywhere(X), motion=carry)])
    start = sim.state.position.copy()
    sim.advance_to(5e-3)
    s, T = 0.25, 20e-3
    acceleration = 0.1 / T**2 * (60 * s - 180 * s**2 + 120 * s**3)
    force = sim.model.nodes.mass.sum() * acceleration * np.array([0.6, 0.0, 0.8])
    np.testing.assert_allclose(sim.state.support_force[0], force, rtol=1e-2, atol=1e-9)
    moved = 0.1 * smooth(5e-3) * np.array([0.6, 0.0, 0.8])
    np.testing.assert_allclose(sim.state.position - start, np.outer(moved, np.ones(start.shape[1])),
                               rtol=1e-7, atol=1e-12)  # fmt: skip
    energy = sim.energy()
    # the work of the last step reaches half a step further than the kinetic energy
    assert energy["external"] == pytest.approx(energy["kinetic"], rel=2e-3)
    assert abs(energy["internal"]) < 1e-12 * energy["kinetic"]
    momentum = sim.model.nodes.mass @ sim.state.velocity.T
    np.testing.assert_allclose(sim.state.support_impulse[0], momentum, rtol=1e-9, atol=1e-15)


def test_work_of_a_support_is_the_motion_and_the_weight_that_it_carries():
    """½ m v² = W after every step, to round-off: gravity's part is in what the support does."""
    lift = translation([0, 0, 1], lambda time: 0.1 * smooth(time))
    sim = supported(SHEET, lambda X: [Support("hand", everywhere(X), motion=lift)], gravity=9.81)
    mass, impulse = sim.model.nodes.mass.sum(), np.zeros(3)
    dt = 0.5 * sim.critical_step()
    for n in range(1, 301):
        sim.advance_to(n * dt)
        speed = sim.state.velocity[2].mean()
        energy = sim.energy()
        assert energy["external"] == pytest.approx(0.5 * mass * speed**2, rel=1e-8, abs=0.0)
        impulse += sim.state.support_force[0] * (dt if n > 1 else 0.5 * dt)
        np.testing.assert_allclose(sim.state.support_impulse[0], impulse, rtol=1e-9, atol=1e-15)
    carried = mass * (speed + 9.81 * 299.5 * dt)
    np.testing.assert_allclose(impulse, [0.0, 0.0, carried], rtol=1e-9, atol=1e-9 * carried)


def shear(time):
    gradient = np.eye(3, 4)
    gradient[0, 1] = 0.8 * smooth(time)
    return gradient


def test_the_work_of_a_prescribed_shear_is_stored():
    """Simple shear of all nodes, and of the edges alone: the inside follows."""

    def edges(X):
        inside = (np.abs(X[:, :2]) < np.abs(X[:, :2]).max(axis=0) - 1e-9).all(axis=1)
        return np.flatnonzero(~inside)

    for nodes in (everywhere, edges):
        sim = supported(
            SHEET,
            lambda X, nodes=nodes: [Support("frame", nodes(X), "xy", motion=shear)],
            mass_damping=100.0,
        )
        X = sim.model.only_body().mesh.node_positions
        sim.advance_to(20e-3)
        energy = sim.energy()
        assert energy["internal"] > 0.01
        assert abs(energy["balance_error"]) < 2e-3 * energy["internal"]
        expected = X @ np.array([[1, 0, 0], [0.8, 1, 0], [0, 0, 1]])
        np.testing.assert_allclose(sim.state.position.T[:, :2], expected[:, :2], atol=2e-4)


def test_a_hanging_sheet_pulls_with_its_weight():
    sim = supported(
        SHEET.replace('"30 mm", "20 mm"', '"20 mm", "20 mm"'),
        lambda X: [Support("clamp", np.flatnonzero(X[:, 0] < -9.9e-3))],
        gravity=9.81,
        mass_damping=800.0,
    )
    # gravity acts along -z: the sheet bends down like a cantilever
    sim.advance_to(20e-3)
    before = sim.state.support_impulse.copy()
    sim.advance_to(22e-3)
    mean = (sim.state.support_impulse - before)[0] / 2e-3
    weight = sim.model.nodes.mass.sum() * 9.81
    np.testing.assert_allclose(mean, [0.0, 0.0, weight], atol=0.02 * weight)


def test_a_plane_of_symmetry_holds_one_component_only():
    whole = Simulation.from_scene(scene_from_text(SHEET))
    corners = '[["0 mm", "-10 mm"], ["15 mm", "-10 mm"], ["15 mm", "10 mm"], ["0 mm", "10 mm"]]'
    half = supported(
        SHEET.replace('size = ["30 mm", "20 mm"]', f"outline = {corners}"),
        lambda X: [Support("symmetry", np.flatnonzero(X[:, 0] < 1e-9), "x")],
    )
    for sim in (whole, half):
        X = sim.model.only_body().mesh.node_positions
        stretch, twist = 20.0 * X[:, 0] / 15e-3, 5.0 * X[:, 1] / 10e-3
        sim.set_velocity(np.array([stretch, 0.0 * stretch, twist]))
        sim.advance_to(0.5e-3)
    X, Y = (sim.model.only_body().mesh.node_positions for sim in (whole, half))
    twin = [int(np.argmin(np.linalg.norm(X - y, axis=1))) for y in Y]
    np.testing.assert_allclose(
        half.state.position, whole.state.position[:, twin], rtol=0.0, atol=1e-9
    )
    assert abs(np.ptp(half.state.position[0]) - 15e-3) > 1e-5  # it has moved


def test_restored_supports_go_on_bit_by_bit():
    pull = translation([1, 0, 0], lambda time: 1e-3 * smooth(time))

    def make(X):
        return [
            Support("left", np.flatnonzero(X[:, 0] < -14.9e-3)),
            Support("right", np.flatnonzero(X[:, 0] > 14.9e-3), motion=pull),
        ]

    sim = supported(SHEET, make)
    sim.advance_to(2e-3)
    copy = sim.state.copy()
    sim.advance_to(4e-3)
    other = supported(SHEET, make)
    other.restore(copy)
    other.advance_to(4e-3)
    for name, array in sim.state.as_dict().items():
        np.testing.assert_array_equal(array, getattr(other.state, name), err_msg=name)
    assert sim.state.support_force[0, 0] < 0.0 < sim.state.support_force[1, 0]


def test_wrong_supports():
    X = np.zeros((4, 3))
    first = Support("left", np.array([0, 1]))
    with pytest.raises(InputError, match="node 1 is held by left and by right"):
        build_supports([first, Support("right", np.array([1, 2]))], X, 1.0)
    jump = Support("grip", np.array([0]), motion=translation([1, 0, 0], lambda t: 1.0))
    with pytest.raises(InputError, match="grip does not start in the reference"):
        build_supports([jump], X, 1.0)
