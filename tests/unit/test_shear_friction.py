"""Friction in shear: loops in closed form, energies, springback, and what is refused."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lcmchain.check import check_scene
from lcmchain.compilation.threads import use_threads
from lcmchain.coupling.solids.stack_compaction import at_rest
from lcmchain.coupons.bias_extension import bias_extension
from lcmchain.coupons.cantilever import cantilever
from lcmchain.coupons.off_axis import off_axis
from lcmchain.coupons.picture_frame import picture_frame
from lcmchain.coupons.result import write_coupon
from lcmchain.coupons.specimen import Loop
from lcmchain.effects.supports import Support
from lcmchain.errors import InputError
from lcmchain.identification.from_file import identify_shear_loop_file
from lcmchain.materials.fabric import FabricLaw
from lcmchain.materials.features.shear_friction import ShearFriction
from lcmchain.materials.law import (
    evolved_history,
    history_count,
    knows_step,
    membrane_response,
    own_memory,
    stress_in_step,
)
from lcmchain.mesh.blank import build_blank
from lcmchain.model import assemble_sheet, build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.statics import StaticProblem

CONSTANT = ShearFriction(5e3, math.radians(1.0))
GROWING = ShearFriction(5e3, math.radians(1.0), 0.3)
RUBBED = 'membrane.friction = { stress = "5 kPa", angle = "1 deg", growth = 0.3 }\n'


def scene(material=RUBBED, process='time = "20 ms"', *overrides):
    return scene_from_text(
        f"""
process = {{ {process} }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "10 mm", height = "0.502 mm" }}
[material]
preset = "MD600"
{material}
""",
        overrides=overrides,
    )


MD600 = scene("").material.build()


def elastic(g):
    E = np.zeros((*np.shape(g), 6))
    E[..., 3] = g
    return MD600.stress_and_tangent(E)[0][..., 3]


def followed(friction, angles):
    """Return the memory (steps, 3) along shear angles [rad] of MD600."""
    memory, rows = np.zeros(3), []
    for g, stress in zip(np.sin(angles), elastic(np.sin(angles)), strict=True):
        memory = friction.in_step(g, memory, stress)
        rows.append(memory)
    return np.array(rows)


def course(*points, count=400):
    return np.concatenate(
        [np.linspace(first, last, count + 1)[1:] for first, last in zip(points, points[1:])]
    )


def test_a_loop_of_constant_friction_loses_its_area_to_both_sides():
    """4 T_0 (A - γ_f tanh(A/γ_f)), as dry friction less what the presliding gives back."""
    largest = math.radians(20.0)
    rows = followed(CONSTANT, course(0.0, *[largest, -largest] * 3, count=2000))
    expected = 4.0 * 5e3 * (largest - math.radians(1.0) * math.tanh(20.0))
    assert CONSTANT.at(0.0).loop_loss(largest) == pytest.approx(expected, rel=1e-12)
    assert rows[-1, 2] - rows[-1 - 4000, 2] == pytest.approx(expected, rel=1e-5)
    # both branches lie T_0 beside the elastic curve
    assert rows[1999, 1] == pytest.approx(5e3, rel=1e-5)
    assert rows[3999, 1] == pytest.approx(-5e3, rel=1e-5)


def test_growing_friction_follows_its_equation():
    """dT = G (1 - s T/T_y) dγ there and back; the loss is that of T²/T_y |dγ|."""
    largest = math.radians(45.0)
    rows = followed(GROWING, course(0.0, largest, 0.0, count=4000))

    def rate(sense):
        def slope(angle, state):
            limit = 5e3 + 0.3 * abs(float(elastic(math.sin(angle)))) * math.cos(angle)
            moment, _ = state
            return [
                GROWING.modulus * (1.0 - sense * moment / limit),
                sense * moment**2 / limit,
            ]

        return slope

    kind = {"rtol": 1e-9, "atol": 1e-9, "max_step": 1e-3}
    there = solve_ivp(rate(1.0), (0.0, largest), [0.0, 0.0], **kind).y[:, -1]
    back = solve_ivp(rate(-1.0), (largest, 0.0), there, **kind).y[:, -1]
    assert rows[3999, 1:] == pytest.approx(there, rel=2e-3)
    assert rows[-1, 1:] == pytest.approx(back, rel=2e-3)
    assert np.diff(rows[:, 2]).min() >= 0.0
    # friction at 45° takes more than twice that of the unsheared fabric
    assert 2.0 * 5e3 < there[0]


def test_no_step_makes_the_friction_larger_than_its_limit():
    angles = math.radians(50.0) * np.random.default_rng(1).uniform(-1.0, 1.0, 200)
    rows = followed(GROWING, angles)
    limit = 5e3 + 0.3 * np.abs(elastic(np.sin(angles))) * np.cos(angles)
    assert np.abs(rows[:, 1]).max() <= limit.max()
    assert np.diff(rows[:, 2]).min() >= 0.0


def left(friction, largest):
    """Return the angle [rad] at which MD600 stays that was sheared to another one and let go."""
    angles = course(0.0, largest, 0.0, count=4000)
    total = elastic(np.sin(angles)) * np.cos(angles) + followed(friction, angles)[:, 1]
    # the moment falls on the way back: the angle where it is zero
    return float(np.interp(0.0, total[:3999:-1], angles[:3999:-1]))


def test_sheared_fabric_springs_back_less():
    """Let go at 40°, it turns back until the elastic part is as small as the friction."""
    stays = [left(ShearFriction(5e3, math.radians(1.0), growth), 0.7) for growth in (0.0, 0.3)]
    assert elastic(math.sin(stays[0])) * math.cos(stays[0]) == pytest.approx(5e3, rel=2e-3)
    assert math.radians(1.0) < stays[0] < 0.8 * stays[1] < 0.7
    # friction as large as the elastic part holds all of it
    assert left(ShearFriction(5e4, math.radians(1.0)), 0.7) > 0.6


@pytest.mark.parametrize("kind", ["fabric", "set", "viscous"])
def test_the_compiled_law_is_the_plain_one(kind):
    """Stress, memory and bound of a step; behind a set and a shear that depends on its rate."""
    more = {
        "fabric": "",
        "set": 'law = "fabric-with-set"\ncompaction.permanent_set = 0.3\n',
        "viscous": 'viscous = { viscosity = "2000 Pa*s" }\n',
    }[kind]
    material = scene(more + RUBBED).material.build()
    law = material.law
    assert pickle.loads(pickle.dumps(type(law))) is type(law)
    assert knows_step(law) == (kind == "viscous")
    base = {"fabric": (), "set": (-0.2,), "viscous": (0.4, 0.0, 0.0)}[kind]
    assert history_count(law) == len(base) + 3
    step = (0.0, 0.5) if kind == "viscous" else ()
    E = np.array([1e-3, 0.0, -0.1, 0.42, 0.0, 0.0])
    for own in ([0.4, 2e4, 3.0], [0.43, 2e4, 3.0], [0.42, -4e3, 1.0]):
        history = (*base, *own, *step)
        S, C = membrane_response(law, tuple(E), history)
        after = GROWING.in_step(E[3], own, elastic(E[3]))
        S_plain, C_plain = stress_in_step(
            material, E, np.array(history[: history_count(law)]), None
        )
        if kind != "set":
            np.testing.assert_allclose(S, S_plain, rtol=1e-9)
        assert S[3] == pytest.approx(S_plain[3], rel=1e-9)
        assert S[3] != pytest.approx(elastic(E[3]), rel=1e-3)
        np.testing.assert_allclose(
            evolved_history(law, tuple(E), history)[len(base) :], after, rtol=1e-9
        )
        middle = 1.0 - (0.5 * (E[3] + own[0])) ** 2
        stiff = C[3] - C_plain[3, 3]
        assert stiff == pytest.approx(2.0 * GROWING.modulus / middle, rel=1e-9)
    past = np.array(history[: history_count(law)])[:, None]
    assert material.dissipated_energy(past)[0] >= past[-1, 0] == 1.0
    stored = material.membrane_energy(E[None], past) - material.membrane_energy(
        E[None], np.where(np.arange(len(past))[:, None] < len(base), past, 0.0)
    )
    assert stored[0] == pytest.approx(4e3**2 / (2.0 * GROWING.modulus), rel=1e-6)


def test_what_does_not_know_the_friction_refuses_it_by_name():
    rubbed = scene()
    name = "material.membrane.friction: "
    with pytest.raises(InputError, match=name + ".* without thickness"):
        build_model(scene(RUBBED, 'time = "1 ms"', "element=membrane-shell"))
    model = assemble_sheet(build_blank(rubbed.blank, 1e-3), rubbed.material.build())
    with pytest.raises(InputError, match=name + ".* static solver does not"):
        StaticProblem(model=model, held=np.ones((3, model.node_count), dtype=bool))
    for coupon in (bias_extension, cantilever, off_axis):
        with pytest.raises(InputError, match=name + ".* picture-frame --cycles"):
            coupon(rubbed.material)
    with pytest.raises(InputError, match="--cycles: go there and back"):
        picture_frame(rubbed.material, cycles=1, speed=0.1)
    assert type(at_rest(rubbed.material).law) is FabricLaw


def test_check_names_the_friction_and_a_scene_may_leave_it_out():
    report = check_scene(scene())
    effects = {effect.key: effect for effect in report.effects}
    assert effects["shear_friction"].active
    assert "up to 5 kPa within 1°, growing with 0.3" in effects["shear_friction"].reason
    assert not effects["memory"].active and not effects["viscous_shear"].active
    off = scene(RUBBED, 'time = "1 ms"', "effects.shear_friction=off")
    assert type(off.material.build().law) is FabricLaw


# --- in the solver --------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_picture_frame_shows_the_loop(tmp_path):
    """There and back twice: forces within 1 % of the largest, the loss of a cycle within 1 %.

    ``identify shear-loop`` finds the law of the simulated cycles again.
    """
    material = scene().material
    result = picture_frame(material, shear_angle=0.8, edge_length=0.1, cycles=2)
    largest = max(own.reference for own in result.comparisons if own.unit == "N")
    for own in result.comparisons:
        assert abs(own.difference) < 0.01 * (largest if own.unit == "N" else own.reference)
    back = [own for own in result.comparisons if "back" in own.quantity]
    assert len(back) == 4 and back[0].reference < 0.5 * result.comparisons[0].reference
    write_coupon(tmp_path, result)
    found = identify_shear_loop_file(tmp_path / "curve.csv", {"side": "200 mm"})
    assert found["friction_stress"].value == pytest.approx(GROWING.stress, rel=0.05)
    assert found["friction_angle"].value == pytest.approx(GROWING.angle, rel=0.05)
    assert found["friction_growth"].value == pytest.approx(GROWING.growth, rel=0.05)


def hinged_frame(angle):
    """Return the support of a square of 20 mm, sheared by an angle [rad] over time."""

    def hinged(time):
        c, s = math.cos(0.5 * angle(time)), math.sin(0.5 * angle(time))
        return np.array([[c, s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])

    def frame(blank):
        rim = (np.abs(blank.node_positions[:, :2]) > 0.01 - 1e-9).any(axis=1)
        return [Support("frame", np.flatnonzero(rim), "xy", motion=hinged)]

    return frame


@pytest.mark.slow
def test_a_loop_goes_on_bit_identical_with_its_memory():
    """From a state restored on the way back, with two threads, and not without the memory."""
    text = 'time = "20 ms", mass_damping = "500 1/s"'

    def begun():
        loop = Loop([0.0, math.radians(20.0), 0.0], 0.01)
        frame = hinged_frame(loop.travel)
        return Simulation(build_model(scene(RUBBED, text, "blank.edge_length=2 mm"), frame))

    simulation = begun()
    simulation.advance_to(0.011)
    half_way = simulation.state.copy()
    simulation.advance_to(0.014)
    again, threads = begun(), begun()
    again.restore(half_way)
    again.advance_to(0.014)
    try:
        use_threads(2, 10**6)
        threads.advance_to(0.011)
        threads.advance_to(0.014)
    finally:
        use_threads(1, 1)
    for other in (again, threads):
        for name, array in other.state.as_dict().items():
            np.testing.assert_array_equal(array, getattr(simulation.state, name), err_msg=name)
    again.restore(half_way)
    again.state.history[:] = 0.0
    again.advance_to(0.014)
    assert not np.array_equal(again.state.position, simulation.state.position)


@pytest.mark.slow
def test_a_released_frame_keeps_the_angle_of_the_law():
    """Sheared to 30° and let go, without a swing: it stays where both parts are in balance."""
    largest, ramp = math.radians(30.0), 0.05
    text = 'time = "0.4 s", mass_damping = "10000 1/s"'

    frame = hinged_frame(
        lambda time: largest * 0.5 * (1.0 - math.cos(math.pi * min(time / ramp, 1.0)))
    )
    held = Simulation(build_model(scene(RUBBED, text), frame))
    held.advance_to(ramp)
    free = Simulation(build_model(scene(RUBBED, text)))
    for name in ("position", "history", "work"):
        getattr(free.state, name)[:] = getattr(held.state, name)
    free.advance_to(0.4)
    body = free.model.only_body()
    past = own_memory(body.material.law, GROWING.memory, body.element_history(free._history(body)))
    np.testing.assert_allclose(np.arcsin(past[0]), left(GROWING, largest), rtol=0.02)
    energy = free.energy()
    assert energy["kinetic"] < 1e-3 * energy["internal"]
