"""One tool, one mass: the energies of central differences to round-off, and contact in closed form.

A sheet of triangles that moves as a whole is one mass m on the springs of the tools that it
touches: every node has the same ratio of contact stiffness to mass, and the elements are not
strained. With a constant step dt the scheme conserves, for linear springs that stay closed,

    K + U + D - W = const, with K = ½ m v(n-½) v(n+½) and U = ½ k g(n)²,

where the work W and dissipation D of a force F are sums of F(n) ½ (Δx(n-1) + Δx(n)). Summed over
the steps up to n, they are ahead of the energies at n by the half step ½ F(n) Δx(n).
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", section 6.2.3 (energy balance).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from lcmchain.effects.friction import friction, friction_loss
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.state import EXTERNAL, State

GRAVITY = 9.81
AREAL_MASS = 0.6
AREA = 0.01**2
MASS = AREAL_MASS * AREA
HALF_THICKNESS = 0.502e-3
PENALTY = 1e7  # [Pa/m]
STIFFNESS = PENALTY * AREA
FREQUENCY = math.sqrt(PENALTY / AREAL_MASS)
SUNK = AREAL_MASS * GRAVITY / PENALTY  # under its own weight
TANGENTIAL = 0.5  # contact.tangential_ratio

SHEET = """
title = "one mass"
element = "{element}"
[process]
time = "1 s"
gravity = {gravity}
mass_damping = "{mass_damping} 1/s"
[blank]
size = ["10 mm", "10 mm"]
edge_length = "5 mm"
height = "0.502 mm"
[material]
preset = "MD600"
[contact]
damping_ratio = {damping}
friction = {friction}
penalty = "{penalty} N/mm^3"
"""
BED = """
[[tools]]
name = "bed"
shape = {{ type = "plate", side = "below" }}
motion = {motion}
"""
WEIGHT = """
[[tools]]
name = "weight"
shape = {{ type = "plate", side = "above" }}
position = "0 0 {height} mm"
motion = {{ type = "guided", direction = [0, 0, -1], mass = "{mass} kg", {options} }}
"""
FIXED = '{ type = "fixed" }'


def simulation(
    *tools, gravity=False, damping=0.0, friction=0.0, mass_damping=0.0, penalty=PENALTY,
    element="membrane-shell",
):  # fmt: skip
    sheet = SHEET.format(
        element=element,
        gravity=str(gravity).lower(),
        damping=damping,
        friction=friction,
        mass_damping=mass_damping,
        penalty=1e-9 * penalty,
    )
    return Simulation.from_scene(scene_from_text(sheet + "".join(tools)))


def bed(motion=FIXED):
    return BED.format(motion=motion)


def stroke(direction, distance, duration):
    return (
        f'{{ type = "stroke", direction = {direction}, distance = "{distance} m", '
        f'end = "{duration} s" }}'
    )


def near(value, relative):
    """Without the absolute tolerance of 1e-12 that is pytest's default: energies here are below."""
    return pytest.approx(value, rel=relative, abs=0.0)


@dataclass
class Course:
    """Energies, states and velocities before each step of a simulation, step by step."""

    dt: float
    energies: list[dict[str, float]]
    states: list[State]  # after each step
    old: list[np.ndarray]  # velocity of the sheet before each step, (3,)
    tool_old: list[np.ndarray]

    def velocity(self, n):
        """Velocity of the sheet after step n."""
        return self.states[n].velocity.mean(axis=1)

    def mean(self, n):
        """Velocity of the sheet at the time of the energies of step n."""
        return 0.5 * (self.old[n] + self.velocity(n))

    def series(self, name):
        return np.array([energy[name] for energy in self.energies])


def run(sim, count, share=0.5, dt=None):
    """Make steps of equal size, that share of the critical one."""
    dt = share * sim.critical_step() if dt is None else dt
    course = Course(dt, [], [], [], [])
    start = sim.state.step_count
    for n in range(1, count + 1):
        course.old.append(sim.state.velocity.mean(axis=1))
        course.tool_old.append(sim.state.tool_velocity.copy())
        sim.advance_to((start + n) * dt)
        assert sim.state.step_count == start + n
        course.energies.append(sim.energy())
        course.states.append(sim.state.copy())
    spread = np.ptp(sim.state.velocity, axis=1)
    assert spread.max() < 1e-7 * max(np.abs(sim.state.velocity).max(), 1e-3), "not one mass"
    return course


def assert_conserved(balance, scale, tolerance=1e-9):
    """The same from the second step on; the first starts with half a step from rest."""
    assert scale > 0.0
    assert np.abs(np.array(balance[1:]) - balance[1]).max() < tolerance * scale


def resting(offset=0.0, *tools, **options):
    """A sheet on a bed under its weight, ``offset`` deeper than it rests [m]."""
    sim = simulation(*(tools or (bed(),)), gravity=True, **options)
    sim.state.position[2] -= SUNK + offset
    return sim


# --- static contact -------------------------------------------------------------------------------


@pytest.mark.parametrize("element", ["membrane-shell", "solid-shell"])
def test_static_pressure_is_penalty_times_penetration(element):
    """On the area of the sheet, whatever its elements: every node has its share."""
    depth = 3e-6
    sim = simulation(bed(), element=element)
    sim.state.position[2] -= depth
    sim.advance_to(1e-9)  # one step, in which nothing moves yet
    force = PENALTY * AREA * depth
    np.testing.assert_allclose(sim.state.tool_force[0], [0.0, 0.0, -force], atol=1e-9 * force)
    assert sim.state.penetration_max[0] == near(depth, 1e-9)
    assert sim.energy()["contact"] == near(0.5 * force * depth, 1e-9)


def test_a_sheet_rests_where_the_contact_carries_its_weight():
    sim = resting()
    course = run(sim, 50)
    depth = HALF_THICKNESS - course.states[-1].position[2]
    np.testing.assert_allclose(depth, AREAL_MASS * GRAVITY / PENALTY, rtol=1e-9)
    assert sim.state.tool_force[0, 2] == near(-MASS * GRAVITY, 1e-9)
    assert abs(sim.state.velocity).max() < 1e-9 * FREQUENCY * SUNK


# --- energies of one mass -------------------------------------------------------------------------


def weight_ahead(course, n):
    """Work of gravity that is counted ahead of the energies of step n."""
    return 0.5 * course.dt * course.velocity(n)[2] * -MASS * GRAVITY


def test_kinetic_spring_and_weight_energy_of_a_sheet_on_its_contact():
    course = run(resting(0.5 * SUNK), 400)
    swing = 0.5 * STIFFNESS * (0.5 * SUNK) ** 2
    kinetic = [0.5 * MASS * course.old[n] @ course.velocity(n) for n in range(400)]
    np.testing.assert_allclose(course.series("kinetic"), kinetic, rtol=0.0, atol=1e-9 * swing)
    balance = [
        e["kinetic"] + e["contact"] - (e["external"] - weight_ahead(course, n))
        for n, e in enumerate(course.energies)
    ]
    assert course.series("kinetic").max() == near(swing, 0.01)
    assert_conserved(balance, swing)
    assert not course.series("damping").any() and not course.series("friction").any()


@pytest.mark.parametrize(("damping", "mass_damping"), [(0.2, 0.0), (0.0, 300.0)])
def test_damping_takes_what_the_motion_loses(damping, mass_damping):
    course = run(resting(0.5 * SUNK, damping=damping, mass_damping=mass_damping), 400)
    coefficient = MASS * (2.0 * damping * FREQUENCY + mass_damping)
    balance = []
    for n, e in enumerate(course.energies):
        taken_ahead = 0.5 * course.dt * course.velocity(n)[2] * coefficient * course.mean(n)[2]
        work = e["external"] - weight_ahead(course, n)
        balance.append(e["kinetic"] + e["contact"] + (e["damping"] - taken_ahead) - work)
    swing = 0.5 * STIFFNESS * (0.5 * SUNK) ** 2
    assert_conserved(balance, swing)
    taken = np.diff(course.series("damping"))
    expected = [coefficient * course.mean(n)[2] ** 2 * course.dt for n in range(1, 400)]
    np.testing.assert_allclose(taken, expected, rtol=1e-6, atol=1e-12 * swing)
    assert course.energies[-1]["damping"] > 0.1 * swing


def held_from_both_sides(damping, preload, offset):
    """A sheet between a bed and a plate that press it by ``preload``, off the middle [m]."""
    lid = WEIGHT.format(height=1.004, mass=1e3, options='force = "0 N"')
    sim = simulation(bed(), lid, damping=damping)
    sim.state.driven[1] = 1  # at rest where it is
    sim.state.tool_travel[1] = 2.0 * preload
    start = sim.state.position.copy()
    start[2] += offset - preload
    sim.state.position[:] = start
    # what loaded the springs came from outside
    held = 0.5 * STIFFNESS * ((preload - offset) ** 2 + (preload + offset) ** 2)
    sim.state.work[EXTERNAL] += held
    return sim


def test_two_tools_on_a_node_damp_what_the_motion_loses():
    """Each of them presses a hundred times as hard as what moves it: m ü + 2c u̇ + 2k u = 0."""
    damping, preload, offset = 0.2, 100.0 * SUNK, SUNK
    course = run(held_from_both_sides(damping, preload, offset), 400, share=0.8)
    dt, swing = course.dt, STIFFNESS * offset**2
    u = np.array([s.position[2].mean() - dt * s.velocity[2].mean() for s in course.states])
    u -= HALF_THICKNESS - preload
    old, new = (np.array([v[2] for v in part]) for part in (
        course.old, [course.velocity(n) for n in range(400)]
    ))  # fmt: skip
    # what the springs do not explain is the damping's
    drag = MASS * (new - old) / dt + 2.0 * STIFFNESS * u
    taken = -drag * 0.5 * (old + new) * dt
    np.testing.assert_allclose(
        np.diff(course.series("damping")), taken[1:], rtol=0.0, atol=1e-7 * swing
    )
    coefficient = 2.0 * MASS * 2.0 * damping * FREQUENCY
    error = drag + coefficient * 0.5 * (old + new)
    assert np.abs(error[1:]).max() < 0.02 * np.abs(drag[1:]).max()
    assert course.energies[-1]["damping"] == pytest.approx(swing, rel=0.03)
    assert abs(u[-1]) < 0.15 * offset


@pytest.mark.parametrize(("damping", "mass_damping"), [(0.0, 0.0), (0.2, 0.0), (0.0, 300.0)])
def test_a_damped_contact_swings_as_the_scheme_does_in_closed_form(damping, mass_damping):
    """Its positions follow z(n+1) (1+q) - z(n) (2-ω²dt²) + z(n-1) (1-q) = 0 about the rest."""
    course = run(resting(0.5 * SUNK, damping=damping, mass_damping=mass_damping), 300)
    z = np.array([state.position[2].mean() for state in course.states])
    z += SUNK - HALF_THICKNESS
    q = 0.5 * course.dt * (2.0 * damping * FREQUENCY + mass_damping)
    w2 = (FREQUENCY * course.dt) ** 2
    residual = (1.0 + q) * z[2:] - (2.0 - w2) * z[1:-1] + (1.0 - q) * z[:-2]
    assert abs(residual).max() < 1e-6 * w2 * SUNK  # positions have 1e-19 m of round-off
    # amplitudes fall by |root| = sqrt((1-q)/(1+q)) a step
    decay = ((1.0 - q) / (1.0 + q)) ** 0.5
    assert abs(z).max() < 0.51 * SUNK
    assert abs(z * decay ** -np.arange(1, 301)).max() == near(0.5 * SUNK, 0.03)


def test_mass_damping_is_exact_step_by_step():
    sim = simulation(mass_damping=500.0)
    sim.set_velocity(np.full((3, sim.model.node_count), 0.2))
    start = sim.state.velocity[:, 0].copy()
    course = run(sim, 100)
    first, q = 0.25 * 500.0 * course.dt, 0.5 * 500.0 * course.dt  # the first step is half a step
    decay = (1.0 - first) / (1.0 + first) * ((1.0 - q) / (1.0 + q)) ** np.arange(100)
    for n in range(100):
        np.testing.assert_allclose(course.velocity(n), start * decay[n], rtol=1e-10)
        lost = 0.5 * MASS * (start @ start) * (1.0 - decay[n] ** 2)
        assert course.energies[n]["damping"] == near(lost, 1e-9)


def test_strain_energy_is_that_of_the_last_step_too():
    """Of the positions before they moved on, to which forces and kinetic energy belong."""
    sim = simulation()
    sim.set_velocity(np.random.default_rng(0).normal(scale=0.1, size=(3, sim.model.node_count)))
    other = simulation()
    dt = 0.5 * sim.critical_step()
    for n in range(1, 6):
        other.state.position[:] = sim.state.position
        sim.advance_to(n * dt)
        assert sim.energy()["internal"] == near(other.energy()["internal"], 1e-9)
    other.state.position[:] = sim.state.position
    assert sim.energy()["internal"] != near(other.energy()["internal"], 0.01)


def test_sign_of_the_balance_error():
    """Positive where energy appears that nothing has put in, and nothing else is in it."""
    sim = simulation()
    sim.state.velocity[:] = 0.05
    sim.advance_to(1e-7)
    surplus = 0.5 * MASS * 3 * 0.05**2
    assert sim.energy()["balance_error"] == near(surplus, 1e-6)
    sim = simulation()
    sim.set_velocity(np.full((3, sim.model.node_count), 0.05))
    sim.advance_to(1e-7)
    assert abs(sim.energy()["balance_error"]) < 1e-6 * surplus


# --- work of tools --------------------------------------------------------------------------------


def tool_ahead(course, n, direction, tool=0):
    """Work of a prescribed tool that is counted ahead of the energies of step n."""
    state = course.states[n]
    against = state.tool_force[tool] @ direction
    return -0.5 * against * state.tool_velocity[tool] * course.dt


def test_work_of_a_prescribed_tool():
    """A bed lifts a sheet gently enough to stay under it, and stops."""
    sim = resting(0.0, bed(stroke([0, 0, 1], 2e-6, 2e-3)))
    dt = 2e-3 / 800
    course = run(sim, 900, dt=dt)
    balance = [
        e["kinetic"] + e["contact"]
        - (e["external"] - weight_ahead(course, n) - tool_ahead(course, n, [0.0, 0.0, 1.0]))
        for n, e in enumerate(course.energies)
    ]  # fmt: skip
    lifted = MASS * GRAVITY * 2e-6
    assert_conserved(balance, lifted)
    assert sim.state.tool_travel[0] == near(2e-6, 1e-9)
    assert tool_ahead(course, 899, [0.0, 0.0, 1.0]) == 0.0  # the tool rests


def test_work_of_a_driven_tool():
    """As a master of a co-simulation drives it: by velocity."""
    sim = resting(0.0, bed(stroke([0, 0, 1], 2e-6, 2e-3)))
    sim.state.driven[0] = 1
    sim.state.tool_input[0, 0] = 2e-4
    course = run(sim, 300, dt=2.5e-6)
    assert sim.state.tool_travel[0] == near(300 * 2.5e-6 * 2e-4, 1e-9)
    balance = [
        e["kinetic"] + e["contact"]
        - (e["external"] - weight_ahead(course, n) - tool_ahead(course, n, [0.0, 0.0, 1.0]))
        for n, e in enumerate(course.energies)
    ]  # fmt: skip
    assert_conserved(balance, MASS * GRAVITY * sim.state.tool_travel[0])


def test_a_guided_tool_alone():
    """Weight, force and damper: ½ M v² + D - W = 0 after every step, from the first one on."""
    mass, force, damper, ramp = 0.02, 3.0, 4.0, 5e-4
    options = f'force = "{force} N", damping = "{damper} N s/m", ramp = "{ramp} s"'
    sim = simulation(WEIGHT.format(height=50.0, mass=mass, options=options))
    course = run(sim, 400)
    load = mass * GRAVITY + force
    expected = 0.0
    for n, e in enumerate(course.energies):
        old, new = course.tool_old[n][0], course.states[n].tool_velocity[0]
        assert e["kinetic"] == pytest.approx(0.5 * mass * old * new, rel=1e-10, abs=1e-18)
        scale = 0.5 * mass * new**2 + e["damping"]
        assert 0.5 * mass * new**2 + e["damping"] == pytest.approx(e["external"], abs=1e-10 * scale)
        s = min(n * course.dt / ramp, 1.0)
        interval = course.dt if n else 0.5 * course.dt
        expected += load * s**3 * (10 - 15 * s + 6 * s**2) * 0.5 * (old + new) * interval
        assert e["external"] == pytest.approx(expected, rel=1e-9, abs=1e-18)
    assert e["damping"] > 0.05 * e["external"]


def test_a_guided_tool_on_the_sheet():
    """A weight on the sheet on a bed: three energies more, and the same balance."""
    mass = 1e-3
    weight = WEIGHT.format(height=1.004, mass=mass, options='force = "0 N"')
    sim = resting(0.0, bed(), weight)
    load = mass * GRAVITY
    # a little deeper than where both rest: they swing, and both contacts stay closed
    sim.state.position[2] -= load / STIFFNESS
    sim.state.tool_travel[1] = SUNK + 2.3 * load / STIFFNESS
    course = run(sim, 400)
    balance, touched = [], True
    for n, e in enumerate(course.energies):
        state = course.states[n]
        tool_ahead_ = 0.5 * course.dt * state.tool_velocity[1] * load
        work = e["external"] - weight_ahead(course, n) - tool_ahead_
        balance.append(e["kinetic"] + e["contact"] - work)
        touched = touched and state.tool_force[1, 2] > 0.0
    assert touched and course.series("kinetic").max() > 0.0
    assert_conserved(balance, course.series("kinetic").max())
    # action and reaction: the sum of all impulses is the momentum
    momentum = MASS * course.velocity(399)[2] - mass * course.states[-1].tool_velocity[1]
    forces = np.array([s.tool_force[0, 2] for s in course.states])
    impulse = -forces.sum() - 0.5 * -forces[0] - 399.5 * (MASS * GRAVITY + load)
    assert momentum == pytest.approx(impulse * course.dt, abs=1e-9 * abs(forces).sum() * course.dt)


# --- friction -------------------------------------------------------------------------------------


def test_a_sticking_sheet_keeps_the_energy_of_its_friction_springs():
    """A bed moves sideways under a sheet that sticks: springs in both directions."""
    way = 0.5e-6
    sim = resting(0.0, bed(stroke([1, 0, 0], way, 1e-3)), friction=0.9)
    course = run(sim, 500, dt=1e-3 / 400)
    balance = []
    for n, e in enumerate(course.energies):
        stick = course.states[n].stick[0]
        shares = sim.model.nodes.area
        sideways = 0.5 * TANGENTIAL * PENALTY * np.sum(shares * np.sum(stick**2, axis=0))
        upright = 0.5 * STIFFNESS * SUNK**2
        assert e["contact"] == near(upright + sideways, 1e-9)
        work = e["external"] - weight_ahead(course, n) - tool_ahead(course, n, [1.0, 0.0, 0.0])
        balance.append(e["kinetic"] + e["contact"] - work)
    assert_conserved(balance, course.series("kinetic").max())
    # nothing slides: no more than the rounding of what the springs hold
    held = course.series("contact").max() - 0.5 * STIFFNESS * SUNK**2
    assert np.abs(course.series("friction")).max() < 1e-9 * held
    assert sim.state.position[0].mean() == near(way, 0.7)  # it came along


def test_sliding_dissipates_what_the_sheet_loses():
    friction = 0.157
    sim = resting(friction=friction)
    velocity = np.zeros((3, sim.model.node_count))
    velocity[0] = 0.05
    sim.set_velocity(velocity)
    course = run(sim, 600)
    force = friction * MASS * GRAVITY
    slides = slice(100, None)  # the friction springs are at their limit
    pulls = np.array([state.tool_force[0, 0] for state in course.states])
    np.testing.assert_allclose(pulls[slides], force, rtol=1e-8)
    total = course.series("kinetic") + course.series("friction") + course.series("contact")
    energy = 0.5 * MASS * 0.05**2
    np.testing.assert_allclose(total[slides], total[100], rtol=0.0, atol=1e-9 * energy)
    lost = course.series("kinetic")[100] - course.series("kinetic")[-1]
    assert lost > 0.05 * energy
    way = course.states[-2].position[0].mean() - course.states[99].position[0].mean()
    assert lost == near(force * way, 1e-8)


def test_a_node_that_lifts_off_loses_the_energy_of_its_friction_spring():
    sim = simulation(bed(), friction=0.9)
    sim.state.position[2] -= 2e-6
    velocity = np.zeros((3, sim.model.node_count))
    velocity[0], velocity[2] = 1e-3, 5e-3
    sim.set_velocity(velocity)
    course = run(sim, 400)
    held = [bool(state.stick.any()) for state in course.states]
    off = held.index(False, held.index(True))  # the step that finds the sheet off the bed
    stick = course.states[off - 1].stick[0]
    stored = 0.5 * TANGENTIAL * PENALTY * np.sum(sim.model.nodes.area * np.sum(stick**2, axis=0))
    # the force of the step before has acted over half of the way out
    way = course.states[off - 1].last_step * course.states[off - 1].velocity
    work = 0.5 * TANGENTIAL * PENALTY * np.sum(sim.model.nodes.area * np.sum(stick * way, axis=0))
    friction = course.series("friction")
    assert stored > 0.0 and abs(work) > 1e-3 * stored
    assert friction[off] - friction[off - 1] == near(stored + work, 1e-9)
    assert course.energies[off]["contact"] == 0.0
    assert friction[-1] == friction[off]


def test_friction_springs_turn_with_the_tool():
    """What leaves the tangent plane is lost; the rest pulls back."""
    stick, normal = (3e-6, 4e-6, 7e-6), (0.0, 0.0, 1.0)
    elastic, force = friction(stick, (1e-6, -2e-6, 0.0), normal, 2e3, 1.0)
    np.testing.assert_allclose(elastic, [4e-6, 2e-6, 0.0], atol=1e-18)
    np.testing.assert_allclose(force, [-8e-3, -4e-3, 0.0], atol=1e-15)
    # at a standstill the turn alone takes energy: half of the force acted before, along no way
    still, _ = friction(stick, (0.0,) * 3, normal, 2e3, 1.0)
    assert friction_loss(stick, still, (0.0,) * 3, 2e3) == near(0.5 * 2e3 * 7e-6**2, 1e-12)


def test_friction_beyond_the_limit_slides():
    """The spring keeps what the limit holds, and sliding takes limit times way."""
    slip, normal = (3e-6, 4e-6, 0.0), (0.0, 0.0, 1.0)
    elastic, force = friction((0.0,) * 3, slip, normal, 2e3, 6e-3)
    np.testing.assert_allclose(elastic, [1.8e-6, 2.4e-6, 0.0], atol=1e-18)
    np.testing.assert_allclose(force, [-3.6e-3, -4.8e-3, 0.0], atol=1e-15)
    # of the first step the force acts over half; half of that does not stay in the spring
    stored = 0.5 * 2e3 * 3e-6**2
    assert friction_loss((0.0,) * 3, elastic, slip, 2e3) == near(0.5 * 6e-3 * 5e-6 - stored, 1e-12)
    again, _ = friction(elastic, slip, normal, 2e3, 6e-3)
    assert friction_loss(elastic, again, slip, 2e3) == near(6e-3 * 5e-6, 1e-12)


# --- stable step ----------------------------------------------------------------------------------


def test_contact_springs_and_the_damper_of_a_guided_tool_limit_the_step():
    """2/ω of all springs on a node and on the tool, and (c/M) dt/2 + ω²dt²/4 <= 1."""
    damping, mass = 0.3, 2e-4
    weight = WEIGHT.format(height=1.004, mass=mass, options='force = "0 N"')
    for penalty in (PENALTY, 1e4 * PENALTY):
        free = simulation(bed(), weight, damping=damping, penalty=penalty)
        own = (2.0 / free.critical_step()) ** 2  # no node is known to be near yet
        sim = simulation(bed(), weight, damping=damping, penalty=penalty)
        sim.advance_to(1e-9)
        on_nodes, on_tool = 2.0 * penalty / AREAL_MASS, penalty * AREA / mass
        total = own + on_nodes + on_tool
        rate = 2.0 * damping * math.sqrt(penalty * AREAL_MASS) * AREA / mass
        step = sim.critical_step()
        assert 0.25 * total * step**2 + 0.5 * rate * step == near(1.0, 1e-9)
        named = "in-plane stiffness" if penalty == PENALTY else "contact stiffness"
        assert sim.control.cause == named


# --- impact ---------------------------------------------------------------------------------------


def restitution_of(ratio):
    """Velocity after over before an impact on a linear spring and damper that never pull.

    z(t) = v/ω exp(-βt) sin ωt, until the force -m z'' vanishes at tan ωt = 2βω/(β²-ω²): the contact
    ends before the spring is relaxed, with the velocity -v exp(-βt). Source: Schwager and Pöschel,
    "Coefficient of restitution and linear-dashpot model revisited", Granular Matter 9 (2007) 465.
    """
    damped = math.sqrt(1.0 - ratio**2)
    angle = math.pi - math.atan2(2.0 * ratio * damped, damped**2 - ratio**2)
    return math.exp(-ratio / damped * angle)


def rebound(damping, share):
    speed = 0.05
    sim = simulation(bed(), damping=damping)
    dt = share * sim.critical_step()
    velocity = np.zeros((3, sim.model.node_count))
    velocity[2] = -speed
    sim.set_velocity(velocity)
    course = run(sim, math.ceil(4.5 / FREQUENCY / dt), dt=dt)
    assert sim.state.tool_force[0, 2] == 0.0, "still in contact"
    taken = sim.energy()["damping"]
    after = sim.state.velocity[2].mean()
    assert taken == near(0.5 * MASS * (speed**2 - after**2), 2e-3)
    assert course.series("contact").max() > 0.0
    return after / speed


@pytest.mark.parametrize("damping", [0.05, 0.2, 0.5])
def test_restitution_of_a_damped_impact(damping):
    """Converges to the closed form at the order of the surface's crossing, the first."""
    exact = restitution_of(damping)
    errors = [rebound(damping, share) / exact - 1.0 for share in (0.8, 0.4, 0.2)]
    assert abs(errors[-1]) < 2e-3
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 2.0, rtol=0.1)


@pytest.mark.parametrize(("share", "least", "largest"), [(0.6, -0.7, 0.1), (0.3, -0.05, 0.02)])
def test_what_a_flat_impact_changes_depends_on_the_step(share, least, largest):
    """Kinetic energy lost or gained [%], over all phases of the step at the touch, undamped."""
    speed, dt = 0.05, 0.5 * simulation(bed()).critical_step()
    changes = []
    sim = simulation(bed(), penalty=AREAL_MASS * (share / dt) ** 2)
    start = sim.state.copy()
    for phase in np.arange(12) / 12.0:
        sim.restore(start.copy())
        sim.state.position[2] += phase * speed * dt
        velocity = np.zeros((3, sim.model.node_count))
        velocity[2] = -speed
        sim.set_velocity(velocity)
        run(sim, math.ceil(4.5 / share), dt=dt)
        assert sim.state.tool_force[0, 2] == 0.0, "still in contact"
        changes.append(100.0 * ((sim.state.velocity[2].mean() / speed) ** 2 - 1.0))
    assert least < min(changes) and max(changes) < largest
