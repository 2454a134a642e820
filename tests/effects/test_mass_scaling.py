"""Added mass: a larger step, and nothing else that a quasi-static process could see."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.check import estimate_run, run_effects, scene_warnings
from lcmchain.check.expected_cost import contact_omega2
from lcmchain.effects.process.mass_scaling import added_mass
from lcmchain.errors import InputError
from lcmchain.judgements.quasi_static import process_time_needed
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.state import EXTERNAL

SHEET = """
process = { time = "10 ms", gravity = false }
blank = { size = ["40 mm", "30 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
"""
# the outline cuts elements, and leaves triangles of many sizes
TURNED = ("blank.fibre_angle=25 deg",)
ELEMENTS = ("solid-shell", "membrane-shell")
G = 9.81


def model_of(*overrides):
    return build_model(scene_from_text(SHEET, overrides=overrides))


def simulation(*overrides):
    return Simulation(model_of(*overrides))


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("angle", ["0 deg", "25 deg"])
def test_the_step_grows_with_the_root_of_a_factor(element, angle):
    chosen = (f"element={element}", f"blank.fibre_angle={angle}")
    plain = simulation(*chosen).critical_step()
    scaled = simulation(*chosen, "process.mass_scaling.factor=9").critical_step()
    assert scaled == pytest.approx(3.0 * plain, rel=1e-12)


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_target_step_is_met_by_adding_mass_where_it_is_short(element):
    chosen = (f"element={element}", *TURNED)
    plain = simulation(*chosen)
    step = plain.prepare_steps()
    between = 1e6 * step * 1.1
    scaled = simulation(*chosen, f"process.mass_scaling.target_step={between:.6f} us")
    # the bound of the reference knows the fibres, that of the run the small moduli, too
    assert scaled.prepare_steps() == pytest.approx(1.1 * step, rel=0.02)
    factor = scaled.model.nodes.mass / plain.model.nodes.mass
    # what uniform scaling would add, and no element gets more than it lacks
    assert factor.max() <= 1.1**2 * (1.0 + 1e-3)
    assert factor.min() >= 1.0


def test_only_parts_with_a_short_step_get_mass():
    model = model_of("element=membrane-shell", *TURNED)
    slowest, fastest = np.sqrt(np.percentile(model.only_body().part_omega2, [20, 100]))
    # the bound of cut triangles is levelled out to that of whole ones: most nodes are alike
    assert fastest > 1.01 * slowest
    middle = 0.5 * (slowest + fastest)
    step = 1e6 * 0.9 * 2.0 / middle
    scaled = model_of(
        "element=membrane-shell", *TURNED, f"process.mass_scaling.target_step={step:.6f} us"
    )
    factor = scaled.nodes.mass / model.nodes.mass
    fast = np.sqrt(model.only_body().part_omega2) > middle
    assert 0 < fast.sum() < fast.size
    np.testing.assert_array_equal(factor > 1.0 + 1e-9, fast)


def test_a_larger_step_than_the_target_needs_no_mass():
    scaled = model_of("process.mass_scaling.target_step=1 us")
    assert added_mass(scaled) == {
        "mass_added_kg": 0.0, "mass_added_total": 0.0, "mass_added_largest": 0.0
    }  # fmt: skip
    told = {effect.name: effect for effect in run_effects(scene_from_text(SHEET), scaled)}
    assert not told["mass scaling"].active


@pytest.mark.parametrize("element", ELEMENTS)
def test_the_report_is_the_sum_of_nodal_masses(element):
    chosen = (f"element={element}", *TURNED)
    plain, scaled = model_of(*chosen), model_of(*chosen, "process.mass_scaling.target_step=6 us")
    added = scaled.nodes.mass - plain.nodes.mass
    told = added_mass(scaled)
    assert told["mass_added_kg"] == pytest.approx(added.sum(), rel=1e-12)
    assert told["mass_added_total"] == pytest.approx(added.sum() / plain.nodes.mass.sum())
    assert told["mass_added_largest"] == pytest.approx((added / plain.nodes.mass).max())
    np.testing.assert_allclose(scaled.sheet_mass, plain.nodes.mass, rtol=1e-14)
    assert scaled.only_body().material.density == plain.only_body().material.density
    assert scaled.only_body().volume == plain.only_body().volume
    assert added.min() >= -1e-18


@pytest.mark.parametrize("scaling", ["factor=5", "target_step=6 us"])
def test_a_free_sheet_falls_by_its_own_weight(scaling):
    """The impulse of the weight is that of the fabric, so that the added mass slows the fall."""
    sim = simulation("process.gravity=true", f"process.mass_scaling.{scaling}", *TURNED)
    time = 2e-3
    sim.advance_to(time)
    inertia, weight = sim.model.nodes.mass, G * sim.model.sheet_mass.sum()
    momentum = inertia @ (sim.state.velocity[2])
    assert momentum == pytest.approx(-weight * (time - 0.5 * sim.state.last_step), rel=2e-3)
    energy = sim.energy()
    # the kinetic energy is that of the middle of the last step: one step of the impulse is missing
    assert abs(energy["balance_error"]) < 1.1 / sim.state.step_count * energy["external"]
    if scaling.startswith("factor"):
        fall = sim.state.position[2] - sim.model.node_positions[:, 2]
        assert fall == pytest.approx(-0.5 * G / 5.0 * time**2, rel=1e-2)
        np.testing.assert_allclose(fall, fall[0], rtol=1e-9)  # a rigid fall


def test_a_resting_sheet_weighs_what_the_fabric_weighs():
    bed = (
        'tools=[{ name = "bed", shape = { type = "plate", side = "below" } }]',
        "process.gravity=true", "process.time=40 ms", "process.mass_damping=300 1/s",
        "blank.edge_length=10 mm",
    )  # fmt: skip
    for scaling in (
        (),
        ("process.mass_scaling.factor=4",),
        ("process.mass_scaling.target_step=12 us",),
    ):
        sim = simulation(*bed, *scaling)
        sim.advance_to(40e-3)
        before = sim.state.tool_impulse[0, 2]
        sim.advance_to(60e-3)
        force = -(sim.state.tool_impulse[0, 2] - before) / 20e-3
        assert force == pytest.approx(G * sim.model.sheet_mass.sum(), rel=0.02)


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_vibrating_strip_slows_down_with_the_root_of_its_mass(element):
    """Fibre waves along a strip: the time between two turns of the motion."""

    def period(*scaling):
        sim = simulation(f"element={element}", *scaling)
        along = sim.model.node_positions[:, 0]
        velocity = np.zeros_like(sim.state.velocity)
        velocity[0] = 1e-3 * np.sin(np.pi * along / 0.04)  # centred: the ends swing against another
        sim.set_velocity(velocity)
        weight = sim.model.nodes.mass * np.sin(np.pi * along / 0.04)
        step = 0.2 * sim.prepare_steps()
        times, swings = [], []
        for _ in range(400):
            sim.make_steps(1, step)
            times.append(sim.time)
            swings.append(weight @ sim.state.velocity[0])
        swings = np.array(swings)
        turns = np.flatnonzero((swings[:-1] > 0.0) != (swings[1:] > 0.0))
        exact = [times[i] + step * swings[i] / (swings[i] - swings[i + 1]) for i in turns[:2]]
        return 2.0 * (exact[1] - exact[0])

    assert period("process.mass_scaling.factor=4") == pytest.approx(2.0 * period(), rel=1e-6)


@pytest.mark.parametrize("element", ELEMENTS)
def test_vibration_is_stable_at_the_scaled_step(element):
    chosen = (f"element={element}", *TURNED)
    sim = simulation(*chosen, "process.mass_scaling.target_step=6 us", "process.step_safety=0.95")
    rng = np.random.default_rng(0)
    sim.state.position += rng.uniform(-1e-8, 1e-8, sim.state.position.shape)
    balance = sim.energy()
    energy = balance["internal"] + balance["hourglass"]
    sim.state.work[EXTERNAL] = energy
    step, balances = sim.prepare_steps(), []
    for _ in range(5):
        sim.make_steps(200, step)
        balances.append(sim.energy())
    assert np.ptp([b["balance_error"] for b in balances]) < 1e-3 * energy
    assert min(b["kinetic"] + b["internal"] + b["hourglass"] for b in balances) > 0.2 * energy


def test_the_expected_cost_knows_the_added_mass():
    for chosen in ((), TURNED, ("element=membrane-shell",)):
        plain, scaled = model_of(*chosen), model_of(*chosen, "process.mass_scaling.factor=4")
        assert estimate_run(scaled).critical_step == pytest.approx(
            2.0 * estimate_run(plain).critical_step, rel=1e-12
        )
    bed = ('tools=[{ name = "bed", shape = { type = "plate", side = "below" } }]',)
    plain, scaled = model_of(*bed), model_of(*bed, "process.mass_scaling.factor=4")
    assert scaled.environment.penalty == plain.environment.penalty
    assert contact_omega2(scaled) == pytest.approx(0.25 * contact_omega2(plain), rel=1e-12)
    slower = process_time_needed(scaled).period / process_time_needed(plain).period
    assert slower == pytest.approx(2.0, rel=1e-12)


def test_without_the_entry_nothing_changes():
    plain = model_of()
    np.testing.assert_array_equal(plain.nodes.mass, plain.sheet_mass)
    assert plain.environment.gravity == 0.0
    assert isinstance(model_of("process.gravity=true").environment.gravity, float)


def test_a_factor_below_one_is_refused():
    with pytest.raises(InputError, match="process.mass_scaling.factor"):
        model_of("process.mass_scaling.factor=0.5")


def test_a_check_names_the_rate_that_damps_as_before():
    chosen = ("process.mass_scaling.factor=4", "process.gravity=true")
    (told,) = scene_warnings(
        scene_from_text(SHEET, overrides=(*chosen, "process.mass_damping=200 1/s"))
    )
    assert '"100 1/s"' in told and "4 times as hard" in told
    assert scene_warnings(scene_from_text(SHEET, overrides=chosen)) == []
