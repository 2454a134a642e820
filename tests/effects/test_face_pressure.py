"""Pressure on faces: resultants, moments, the work of a moving face, its table, and its bound."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lcmchain.check.remarks import scene_warnings
from lcmchain.effects.face_pressure import PressureOnFace, face_forces, face_frequencies
from lcmchain.effects.supports import Support
from lcmchain.effects.switches import effects_of
from lcmchain.elements.blocks import LANES
from lcmchain.errors import InputError
from lcmchain.fields.derived import pressure_fields
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

SCENE = """
process = { time = "2 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm", fibre_angle = "ANGLE deg" }
material = { preset = "MD600" }
"""
BAG = 'pressure=[{ name = "bag", face = "FACE", value = "0.1 MPa", ramp = "0.2 ms" }]'
ANGLES = [0.0, 45.0]


def model_of(angle=0.0, face="top", supports=lambda mesh: ()):
    text = SCENE.replace("ANGLE", str(angle))
    return build_model(scene_from_text(text, overrides=[BAG.replace("FACE", face)]), supports)


def crumpled(model, size=0.3e-3, seed=0):
    rng = np.random.default_rng(seed)
    position = model.node_positions.T.copy()
    position[2] += 4.0 * position[0] ** 2 - 3.0 * position[0] * position[1]
    turn = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()
    return np.ascontiguousarray(turn @ position + rng.uniform(-size, size, position.shape))


def forces_on_nodes(model, position, bottom, top):
    load = np.zeros(model.corner_force_size)
    face_forces(model.face_pressure.elements, position, bottom, top, None, load)
    slot = model.nodes.force_slot
    return np.stack([load[slot + d * LANES].sum(axis=0) for d in range(3)])


def swept(model, position, way, pairs):
    """Volume swept by the bilinear faces whose corners are ``pairs``, exact to first order.

    A Gauss rule of its own: ∫ δx·(g1 × g2) dξ dη.
    """
    total = 0.0
    g = 1.0 / np.sqrt(3.0)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    for xi, eta in ((a, b) for a in (-g, g) for b in (-g, g)):
        N = 0.25 * (1 + signs[:, 0] * xi) * (1 + signs[:, 1] * eta)
        d_xi = 0.25 * signs[:, 0] * (1 + signs[:, 1] * eta)
        d_eta = 0.25 * signs[:, 1] * (1 + signs[:, 0] * xi)
        x, u = position.T[pairs], way.T[pairs]
        area = np.cross(np.einsum("n,end->ed", d_xi, x), np.einsum("n,end->ed", d_eta, x))
        total += np.einsum("n,end,ed->", N, u, area)
    return total


@pytest.mark.parametrize("angle", ANGLES)
def test_work_is_pressure_times_the_volume_that_the_face_sweeps(angle):
    model = model_of(angle)
    x = crumpled(model)
    elements = model.only_body().mesh.elements
    rng = np.random.default_rng(1)
    for _ in range(3):
        way = rng.normal(size=x.shape)
        top = np.sum(forces_on_nodes(model, x, 0.0, 2e5) * way)
        assert top == pytest.approx(-2e5 * swept(model, x, way, elements[:, 4:]), rel=1e-11)
        bottom = np.sum(forces_on_nodes(model, x, 3e5, 0.0) * way)
        assert bottom == pytest.approx(3e5 * swept(model, x, way, elements[:, :4]), rel=1e-11)


def test_flat_sheet_gets_pressure_times_area_and_no_moment():
    model = model_of()
    x = model.node_positions.T.copy()
    force = forces_on_nodes(model, x, 0.0, 1e5)
    np.testing.assert_allclose(force.sum(axis=1), [0.0, 0.0, -1e5 * 0.03 * 0.02], atol=1e-12)
    pairs = model.only_body().mesh.pair_count
    assert np.abs(force[:, :pairs]).max() == 0.0
    np.testing.assert_allclose(force[2, pairs:], -1e5 * model.nodes.area[pairs:], rtol=1e-12)


def test_pressure_follows_the_face():
    model = model_of()
    x = crumpled(model)
    R = Rotation.from_rotvec([0.2, 1.0, -2.0]).as_matrix()
    turned = forces_on_nodes(model, np.ascontiguousarray(R @ x), 1e5, 2e5)
    np.testing.assert_allclose(turned, R @ forces_on_nodes(model, x, 1e5, 2e5), atol=1e-12)


def test_load_stiffness_is_within_its_bound():
    model = model_of()
    x = crumpled(model)
    element = 9
    nodes = model.only_body().mesh.elements[element]
    lanes = np.zeros(model.face_pressure.elements.padded_count)
    face_frequencies(model.face_pressure.elements, x, 1e6, lanes)
    mass = model.face_pressure.elements.mass[element]
    elements = model.face_pressure.elements
    only = elements.corner_node.reshape(-1, 8, LANES)[:, :, element % LANES][element // LANES]
    np.testing.assert_array_equal(only, nodes)
    K = np.empty((24, 24))
    step = 1e-6

    def own(position):
        load = np.zeros(model.corner_force_size)
        face_forces(elements, np.ascontiguousarray(position), 0.0, 1e6, None, load)
        rows = load[: elements.padded_count * 24].reshape(-1, 24, LANES)
        return rows[element // LANES, :, element % LANES]

    for column in range(24):
        way = np.zeros_like(x)
        way[column % 3, nodes[column // 3]] = step
        K[:, column] = (own(x + way) - own(x - way)) / (2 * step)
    largest = np.linalg.norm(K, 2) / (mass / 8.0)
    assert largest <= lanes[element] < 3.0 * largest


def test_bag_on_both_faces_compacts_to_the_pressure_of_the_law():
    """And the error of the energy balance falls with the square of the step."""

    def held(mesh):
        return [Support("plane", np.arange(mesh.node_count), "xy")]

    errors = []
    for safety in (0.9, 0.45):
        overrides = [
            BAG.replace("FACE", "both"), "process.mass_damping=20000 1/s",
            f"process.step_safety={safety}",
        ]  # fmt: skip
        scene = scene_from_text(SCENE.replace("ANGLE", "0"), overrides=overrides)
        model = build_model(scene, held)
        simulation = Simulation(model)
        simulation.advance_to(2e-3)
        stretch = simulation.require_sound()[0].thickness_stretch
        np.testing.assert_allclose(
            model.only_body().material.compaction_pressure(stretch), 1e5, rtol=2e-3
        )
        energy = simulation.energy()
        assert energy["external"] > energy["internal"] > 0.0
        errors.append(abs(energy["balance_error"]) / energy["external"])
    assert errors[1] < 1e-3
    assert errors[0] > 3.5 * errors[1]


def test_a_sheet_under_a_bag_is_not_taken_to_lie_still():
    text = SCENE.replace("ANGLE", "0")
    bag = scene_from_text(text, overrides=[BAG.replace("FACE", "both")])
    assert not [remark for remark in scene_warnings(bag) if "nothing moves" in remark]
    assert [remark for remark in scene_warnings(scene_from_text(text)) if "nothing moves" in remark]


def test_constant_pressure_comes_on_smoothly():
    entry = PressureOnFace(name="bag", face="both", value=1e5)
    times, values = entry.table(2.0)
    assert (times[0], times[-1]) == (0.0, 0.2)
    assert (values[0], values[-1]) == (0.0, 1e5)
    assert np.interp(0.1, times, values) == pytest.approx(5e4)
    slope = np.diff(values) / np.diff(times)
    assert slope[0] < 0.01 * slope.max() and slope[-1] < 0.01 * slope.max()


def test_pressures_add_up_by_face():
    overrides = [
        'pressure=[{ name = "bag", face = "both", times = "0 1 ms", values = "0 1 bar" },'
        '{ name = "film", face = "top", times = "0 2 ms", values = "0 4 bar" }]'
    ]
    model = build_model(scene_from_text(SCENE.replace("ANGLE", "0"), overrides=overrides))
    table = model.face_pressure
    assert np.interp(5e-4, table.times, table.top) == pytest.approx(1.5e5)
    assert np.interp(5e-4, table.times, table.bottom) == pytest.approx(0.5e5)
    assert table.largest == pytest.approx(5e5)
    names = [effect.name for effect in effects_of(model) if effect.active]
    assert {"pressure on the top face", "pressure on the bottom face"} <= set(names)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ('name = "bag", face = "top"', "either a constant value"),
        ('name = "bag", face = "top", value = "1 bar", times = "0 1 s"', "either a constant value"),
        ('name = "bag", face = "top", times = "0 1 s"', "values"),
        ('name = "bag", face = "top", times = "0 1 s", values = "0 1 2 bar"', "one per time"),
        ('name = "bag", face = "top", times = "0 0 s", values = "0 1 bar"', "do not increase"),
        ('name = "bag", face = "side", value = "1 bar"', "top"),
    ],
)
def test_wrong_entries_are_named(entry, said):
    with pytest.raises(InputError, match=said):
        scene_from_text(SCENE.replace("ANGLE", "0") + f"pressure = [{{ {entry} }}]")


def test_a_sheet_without_thickness_has_no_two_faces():
    text = SCENE.replace("ANGLE", "0") + 'element = "membrane-shell"\n'
    with pytest.raises(InputError, match="solid-shell"):
        scene_from_text(text, overrides=[BAG.replace("FACE", "top")])


# --- a stack of plies -----------------------------------------------------------------------------

STACK = """
layup = "[0/90, 30/-60]"
process = { time = "6 ms", mass_damping = "4000 1/s" }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
contact = { friction = 0.1 }
interfaces = [{ friction = 0.2 }]
pressure = [{ name = "bag", face = "top", value = "20 kPa", ramp = "2 ms" }]
[[tools]]
name = "table"
shape = { type = "plate", side = "below" }
"""


def test_of_a_stack_the_outer_faces_are_pressed():
    """The bottom of the lowest ply, the top of the uppermost, and no face between plies."""
    model = build_model(scene_from_text(STACK.replace("[0/90, ", "[0/90, 0/90, ")))
    bottom, top = 1.0e3, 2.5e3
    force = forces_on_nodes(model, model.node_positions.T.copy(), bottom, top)
    area = 20e-3 * 20e-3
    for number, body in enumerate(model.bodies):
        own = force[:, body.first_node :][:, : body.mesh.node_count]
        upward = (bottom if number == 0 else 0.0) - (top if number == 2 else 0.0)
        np.testing.assert_allclose(own.sum(axis=1), [0.0, 0.0, upward * area], atol=1e-12)
        sides = body.mesh.sides()
        loaded = {side for side, nodes in sides.items() if np.abs(own[2, nodes]).max() > 0.0}
        assert loaded == [{"bottom"}, set(), {"top"}][number]


@pytest.mark.slow
def test_a_bag_presses_a_stack_onto_its_table():
    """The table bears pressure times area, and both plies the pressure."""
    simulation = Simulation.from_scene(scene_from_text(STACK))
    simulation.advance_to(6e-3)
    model, state = simulation.model, simulation.state
    assert state.tool_force[0, 2] == pytest.approx(-20e3 * 4e-4, rel=0.01)
    for body in model.bodies:
        history = model.history_of(body, state.history)
        found = pressure_fields(body, state.position.T, history)["compaction_pressure"]
        centre = body.mesh.node_positions[body.mesh.elements].mean(axis=1)
        inner = (np.abs(centre[:, :2]) < 6e-3).all(axis=1)
        assert inner.sum() >= 4
        np.testing.assert_allclose(found[inner], 20e3, rtol=0.02)
    energy = simulation.energy()
    assert abs(energy["balance_error"]) < 0.01 * energy["internal"]
