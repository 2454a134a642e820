"""The explicit time loop: stable step, conservation, landing on times, bit-identical repeats."""

from __future__ import annotations

import math
from dataclasses import replace

import numba
import numpy as np
import pytest

from lcmchain.elements.blocks import NODE_CHUNK
from lcmchain.elements.family import internal_forces
from lcmchain.errors import InputError
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import (
    CALM_CHUNKS_PER_FREQUENCY,
    CALM_RISE,
    CHUNKS_PER_FREQUENCY,
    Simulation,
)
from lcmchain.state import EXTERNAL, LAST_STEP, OMEGA2, PLY_REFRESH, RENEWAL, RENEWED
from lcmchain.verification.random_elements import corner_forces

SHEET = """
title = "a small sheet"
[process]
time = "10 ms"
[blank]
size = ["30 mm", "20 mm"]
edge_length = "5 mm"
fibre_angle = "0 deg"
height = "0.502 mm"
[material]
preset = "MD600"
"""
# a light plate falls on a sheet that is drawn over a bed: contact, friction, a guided tool, damping
PRESSED = (
    # several chunks of nodes
    SHEET.replace('"30 mm", "20 mm"', '"80 mm", "60 mm"').replace(
        "[process]", "[process]\ngravity = true\nmass_damping = '20 1/s'"
    )
    + """
[contact]
friction = 0.157
[[tools]]
name = "bed"
shape = { type = "plate", side = "below" }
motion = { type = "stroke", direction = [1, 0, 0], distance = "2 mm" }
[[tools]]
name = "weight"
shape = { type = "sphere_capped_punch", radius = "30 mm" }
position = ["2 mm", "1 mm", "1.2 mm"]
motion = { type = "guided", direction = [0, 0, -1], mass = "20 g", force = "3 N" }
"""
)


def simulation(text, **changes):
    return Simulation(replace(build_model(scene_from_text(text)), **changes))


def kicked(sim, size, seed=0):
    """Move every node at random by up to ``size`` [m]; the energy counts as put in."""
    rng = np.random.default_rng(seed)
    sim.state.position += rng.uniform(-size, size, sim.state.position.shape)
    balance = sim.energy()
    sim.state.work[EXTERNAL] = balance["internal"] + balance["hourglass"]
    return sim.state.work[EXTERNAL]


def node_forces(sim, position):
    """Internal forces (3, node_count), gathered independently of the solver."""
    model = sim.model
    corner_force = np.zeros(model.corner_force_size)
    internal_forces(model.only_body().data, position, corner_force, np.empty(0))
    total = np.zeros_like(position)
    for element, nodes in enumerate(model.only_body().mesh.elements):
        block, lane = divmod(element, 16)
        for corner, node in enumerate(nodes):
            for d in range(3):
                total[d, node] += corner_force[(block * 24 + 3 * corner + d) * 16 + lane]
    return total


def highest_frequency(sim):
    """Of the whole sheet [1/s], by the power method on differences of forces."""
    mass, start = sim.model.nodes.mass, sim.state.position
    mode = np.random.default_rng(1).normal(size=start.shape)
    step, value = 1e-8, 0.0
    for _ in range(300):
        mode /= np.sqrt(np.sum(mass * mode**2))
        image = (node_forces(sim, start + step * mode) - node_forces(sim, start - step * mode)) / (
            2 * step * mass
        )
        value = np.sum(mass * mode * image)
        mode = image
    return np.sqrt(value)


# --- stability ------------------------------------------------------------------------------------


def drift_of_balance(sim, duration):
    """Largest difference of the balance error over the time, and the least energy seen."""
    start = sim.time
    balances = []
    for part in np.linspace(0.1, 1.0, 10):
        sim.advance_to(start + part * duration)
        balances.append(sim.energy())
    stored = [b["kinetic"] + b["internal"] + b["hourglass"] for b in balances]
    return np.ptp([b["balance_error"] for b in balances]), min(stored)


def test_vibration_is_stable_below_the_critical_step():
    sim = simulation(SHEET, step_safety=0.95)
    energy = kicked(sim, 1e-8)
    critical = sim.critical_step()
    drift, stored = drift_of_balance(sim, 3000 * critical)
    assert sim.control.step == pytest.approx(0.95 * critical, rel=1e-3)
    assert stored > 0.2 * energy
    assert drift < 1e-3 * energy


def test_vibration_explodes_beyond_the_true_critical_step():
    """The bound is close to the sheet's own frequency, and the run sees what goes wrong."""
    sim = simulation(SHEET)
    bound = sim.critical_step()
    true = 2.0 / highest_frequency(sim)
    assert 0.8 * true < bound < true * (1.0 + 1e-6)

    sim = simulation(SHEET, step_safety=0.99 * true / bound)
    energy = kicked(sim, 1e-8)
    drift, stored = drift_of_balance(sim, 1000 * true)
    assert drift < 1e-3 * energy < stored

    sim = simulation(SHEET, step_safety=1.3 * true / bound)
    kicked(sim, 1e-8)
    sim.advance_to(1000 * true)
    assert sim.state.step_factor == 0.5 and "half the step cured it" in sim.warnings()[0]


def test_the_step_stays_while_it_could_grow_but_little():
    """A step that changes with every look wanders in energy: it only ever falls here."""
    sim = simulation(SHEET)
    rng = np.random.default_rng(0)
    sim.set_velocity(rng.normal(scale=1.0, size=sim.state.velocity.shape))
    steps = []
    sim.advance_to(8000 * sim.critical_step(), lambda sim: steps.append(sim.control.step))
    assert len(steps) > 100
    assert (np.diff(steps) <= 0.0).all()
    assert len(set(steps)) < len(steps) / 16  # few looks ask for the bound
    assert steps[-1] > 0.98 * steps[0]


# --- conservation ---------------------------------------------------------------------------------


def angular_momentum(sim):
    state, mass = sim.state, sim.model.nodes.mass
    return np.cross(state.position.T, (mass * state.velocity).T).sum(axis=0)


@pytest.mark.parametrize("growth", [0.05, 1.1 * CALM_RISE])
@pytest.mark.parametrize("drift", [0.0, 0.9 * CALM_RISE])
def test_the_frequency_is_looked_at_less_often_while_it_stays(monkeypatch, drift, growth):
    """It hardly rises at first, and from the chunk 60 on grows with every look."""
    sim = simulation(SHEET)
    bound, element, code = sim._highest_frequency()
    looks = []

    def looked(self):
        found.append(found[-1] * (1.0 + (growth if len(prepared) >= 60 else drift)))
        looks.append(len(prepared))
        return found[-1], element, code

    monkeypatch.setattr(Simulation, "_highest_frequency", looked)
    monkeypatch.setattr(Simulation, "_may_stiffen", lambda *_: False)
    prepared, found = [], [bound]
    while len(prepared) < 100:
        prepared.append(sim.prepare_steps())
        assert sim.state.clock[OMEGA2] == found[-1]
    apart = np.diff(looks)
    calm = apart[: np.searchsorted(looks, 60)]
    assert calm[0] == CHUNKS_PER_FREQUENCY  # the first look had nothing to compare with
    assert (calm[1:] == CALM_CHUNKS_PER_FREQUENCY).all()
    assert (apart[calm.size :] == CHUNKS_PER_FREQUENCY).all()


def test_a_thickness_wave_that_governs_is_looked_at_where_it_may_have_become_faster():
    elastic = SHEET.replace(
        'preset = "MD600"',
        'law = "isotropic"\ndensity = "1000 kg/m^3"\nthickness = "0.502 mm"\n'
        'young_modulus = "1 GPa"\npoisson_ratio = 0.3',
    )
    sim = simulation(elastic)
    conditions = sim.require_sound()
    bound = sim._highest_frequency()[0]
    assert not sim._may_stiffen(conditions, bound)
    for stretch in (0.9, 1.1):
        squeezed = simulation(elastic)
        squeezed.state.position[2] *= stretch
        assert squeezed._may_stiffen(squeezed.require_sound(), bound)
    # in a fabric under compaction the law itself stiffens
    fabric = simulation(SHEET)
    fabric.state.position[2] *= 0.98
    height = fabric.model.only_body().geometry.height.min()
    tangent = fabric.model.only_body().material.stress_and_tangent(np.zeros(6))[1][2, 2]
    wave = tangent / (fabric.model.only_body().material.density * height**2)
    assert fabric._may_stiffen(fabric.require_sound(), wave)


def test_free_flight_conserves_energy_and_momenta():
    """A sheet thrown with spin: more than a full turn about a skew axis, and straight on."""
    sim = simulation(SHEET)
    state, mass = sim.state, sim.model.nodes.mass
    spin, speed = np.array([150.0, 250.0, 400.0]), np.array([1.0, -2.0, 3.0])
    centre = state.position @ mass / mass.sum()
    state.velocity[:] = (speed + np.cross(spin, state.position.T - centre)).T
    energy = 0.5 * np.sum(mass * state.velocity**2)
    state.work[EXTERNAL] = energy
    momentum, moment = (mass * state.velocity).sum(axis=1), None
    amount = np.sum(mass * np.linalg.norm(state.velocity, axis=0))
    errors = []
    for k in range(1, 15):
        sim.advance_to(k * 1e-3)
        moment = angular_momentum(sim) if moment is None else moment
        errors.append(sim.energy()["balance_error"])
    np.testing.assert_allclose(
        (mass * state.velocity).sum(axis=1), momentum, rtol=0.0, atol=1e-12 * amount
    )
    drift = angular_momentum(sim) - moment
    assert abs(drift).max() < 1e-11 * np.linalg.norm(moment)
    np.testing.assert_allclose(
        state.position @ mass / mass.sum(), centre + 14e-3 * speed, rtol=0.0, atol=1e-10
    )
    assert max(map(abs, errors)) < 1e-4 * energy
    assert sim.energy()["kinetic"] > 0.9 * energy


def test_free_fall_is_exact():
    """Central differences integrate a constant acceleration exactly, whatever the steps."""
    sim = simulation(SHEET.replace("[process]", "[process]\ngravity = true"))
    start = sim.state.position.copy()
    for time in (1e-6, 0.4e-3, 0.4001e-3, 5e-3):
        sim.advance_to(time)
        fall = start - sim.state.position
        np.testing.assert_allclose(fall[2], 0.5 * 9.81 * time**2, rtol=1e-9, atol=1e-15)
        half_a_step_ago = time - 0.5 * sim.state.last_step
        np.testing.assert_allclose(sim.state.velocity[2], -9.81 * half_a_step_ago, rtol=1e-6)
    np.testing.assert_allclose(fall[:2], 0.0, atol=1e-12)


def test_mass_damping_slows_motion_exponentially():
    sim = simulation(SHEET.replace("[process]", '[process]\nmass_damping = "200 1/s"'))
    sim.state.velocity[0] = 1.0
    energy = 0.5 * sim.model.nodes.mass.sum()
    sim.state.work[EXTERNAL] = energy
    sim.advance_to(10e-3)
    np.testing.assert_allclose(sim.state.velocity[0], np.exp(-2.0), rtol=1e-3)
    balance = sim.energy()
    assert balance["damping"] == pytest.approx(energy * (1.0 - np.exp(-4.0)), rel=1e-3)
    assert abs(balance["balance_error"]) < 1e-3 * energy


def test_damping_of_the_unsteady_motion_leaves_a_steady_one():
    """v' = -α (v - w), τ w' = v - w from v = 1, w = 0: v - w dies out, and v goes to 1/(1 + α τ).

    What is lost went into the companion, ½ α τ m w², and into the dashpot.
    """
    rate, time = 200.0, 5e-3
    table = f'[process]\nmass_damping = "{rate} 1/s"\ndamping_average = "{time} s"'
    sim = simulation(SHEET.replace("[process]", table))
    sim.state.velocity[0] = 1.0
    energy = 0.5 * sim.model.nodes.mass.sum()
    sim.state.work[EXTERNAL] = energy
    sim.advance_to(2e-3)
    difference = np.exp(-(rate + 1.0 / time) * 2e-3)
    speed = 1.0 - rate / (rate + 1.0 / time) * (1.0 - difference)
    np.testing.assert_allclose(sim.state.velocity[0], speed, rtol=1e-3)
    np.testing.assert_allclose(sim.state.mean_velocity[0], speed - difference, rtol=1e-3)
    sim.advance_to(0.1)
    np.testing.assert_allclose(sim.state.velocity[0], 1.0 / (1.0 + rate * time), rtol=1e-3)
    balance = sim.energy()
    lost = energy * (1.0 - 1.0 / (1.0 + rate * time) ** 2)
    assert balance["damping"] == pytest.approx(lost, rel=2e-3)
    assert abs(balance["balance_error"]) < 1e-3 * energy


def test_without_mass_damping_no_mean_velocity_is_kept():
    table = '[process]\ndamping_average = "1 ms"'
    assert simulation(SHEET.replace("[process]", table)).state.mean_velocity.shape == (3, 0)


# --- landing on times, repeats --------------------------------------------------------------------


def test_advance_lands_on_the_time_asked_for():
    sim = simulation(SHEET)
    for time in (1e-3, 1e-3 + 1e-9, 1.23456789e-3, 0.1 * 0.03):
        sim.advance_to(time)
        assert sim.time == time
    steps = sim.state.step_count
    sim.advance_to(1e-3)  # in the past
    for time in (math.nan, math.inf):
        with pytest.raises(InputError, match="advance_to: needs a time"):
            sim.advance_to(time)
    assert (sim.time, sim.state.step_count) == (0.1 * 0.03, steps)


def test_prescribed_tools_follow_their_motion_exactly():
    sim = simulation(PRESSED)
    for time in (2.5e-3, 5e-3):
        sim.advance_to(time)
        s = time / 10e-3
        travel = 2e-3 * s**3 * (10 - 15 * s + 6 * s**2)
        assert sim.state.tool_travel[0] == pytest.approx(travel, rel=1e-9)


def assert_identical(state, other):
    for name, array in state.as_dict().items():
        np.testing.assert_array_equal(array, getattr(other, name), err_msg=name)


@pytest.fixture(scope="module")
def pressed():
    """State after 4 ms of a run in one go, and copies of it on the way."""
    sim = simulation(PRESSED)
    copies = []
    sim.advance_to(4e-3, on_chunk=lambda sim: copies.append(sim.state.copy()))
    return sim.state, copies


def test_the_pressed_sheet_uses_every_part_of_the_loop(pressed):
    state, copies = pressed
    assert len(copies) > 10
    assert state.position.shape[1] > 3 * NODE_CHUNK
    assert (state.penetration_max > 0.0).all()
    work = np.delete(state.work, PLY_REFRESH)  # there is one sheet
    assert (work != 0.0).all()
    assert abs(state.stick).max() > 0.0


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_restored_run_is_bit_identical(pressed, share):
    """From any copy on the way, in a new simulation or in one that went astray before."""
    state, copies = pressed
    copy = copies[int(share * len(copies))]
    before = copy.copy()
    fresh = simulation(PRESSED)
    fresh.restore(copy)
    fresh.advance_to(4e-3)
    assert_identical(fresh.state, state)
    assert_identical(copy, before)

    astray = simulation(PRESSED)
    astray.state.tool_input[1, 1] = 10.0
    astray.advance_to(1e-3)
    astray.restore(copy)
    astray.advance_to(4e-3)
    assert_identical(astray.state, state)


def test_looking_at_a_run_does_not_change_it(pressed):
    state, _ = pressed
    sim = simulation(PRESSED)

    def look(sim):
        sim.energy()
        sim.snapshot()

    sim.advance_to(4e-3, on_chunk=look)
    assert_identical(sim.state, state)


def test_what_a_renewal_puts_in_is_counted_as_the_steps_see_it():
    """ΔU - ½ dt v·Δf: the forces that come with it have not yet moved anything."""
    sim = simulation(SHEET)
    x, velocity = sim.state.position, np.zeros_like(sim.state.position)
    velocity[2] = 5.0 * np.cos(200.0 * x[0]) * np.cos(150.0 * x[1])
    sim.set_velocity(velocity)
    sim.advance_to(2e-4)
    state, body = sim.state, sim.model.only_body()
    past, booked = state.history.copy(), state.work[RENEWAL]
    state.counters[RENEWED] = 0
    sim.prepare_steps()
    put_in = booked - state.work[RENEWAL]
    before, after = (
        sum(body.stored_energy(state.position, history)) for history in (past, state.history)
    )
    old, new = (
        corner_forces(sim.model, state.position, history.copy())
        for history in (past, state.history)
    )
    half_step = 0.5 * state.clock[LAST_STEP] * state.velocity
    lag = np.sum((new - old) * half_step.T[body.mesh.elements])
    assert abs(lag) > 1e-3 * abs(after - before)
    assert put_in - (after - before) == pytest.approx(-lag, rel=0.05)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
def test_threads_do_not_change_a_bit(pressed):
    state, _ = pressed
    before = numba.get_num_threads()
    results = []
    for count in (1, 2):
        numba.set_num_threads(count)
        sim = simulation(PRESSED)
        sim.advance_to(4e-3)
        results.append(sim.state)
    numba.set_num_threads(before)
    assert_identical(*results)
    assert_identical(results[0], state)
