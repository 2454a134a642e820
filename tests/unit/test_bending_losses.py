"""Bending that loses energy: friction and rates in closed form, energies, and what is refused."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from without_damping_bound import require_blows_up

from lcmchain.check import check_scene
from lcmchain.compilation.threads import use_threads
from lcmchain.coupons.pure_bending import bent_ends, pure_bending
from lcmchain.coupons.result import write_coupon
from lcmchain.coupons.specimen import Loop
from lcmchain.effects.supports import Support
from lcmchain.errors import InputError
from lcmchain.identification.from_file import identify_bending_loop_file
from lcmchain.materials import laws
from lcmchain.materials.features.bending_losses import BendingLosses, DirectionLosses
from lcmchain.materials.features.rheology import Friction, Relaxation
from lcmchain.materials.law import (
    bending_bound,
    bending_stiffness,
    bending_stress,
    bending_viscosity,
    evolved_bending,
    history_count,
    knows_step,
    own_memory,
    stored_bending,
    with_bending_losses,
)
from lcmchain.mesh.blank import build_blank
from lcmchain.model import assemble_sheet, build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.statics import StaticProblem

THICKNESS = 1.004e-3  # of MD600 [m]
FRICTION = Friction(0.02, 4.0)  # [N], [1/m]
BOTH = BendingLosses(
    (
        DirectionLosses(FRICTION, 3e-4, (Relaxation(0.01, 0.02), Relaxation(0.004, 1.0))),
        DirectionLosses(Friction(0.01, 2.0), 0.0, (Relaxation(0.02, 0.1),)),
    ),
    THICKNESS,
)
RUBBED = """
[material.bending]
friction_1 = { moment = "0.02 N", curvature = "4 1/m" }
"""


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


def followed(losses, curvature, size=0.0):
    """Return the memory (steps, numbers) along curvatures (steps, 2)."""
    memory, rows = np.zeros(len(losses.memory)), []
    for now in curvature:
        memory = losses.in_step(now, memory, size)
        rows.append(memory)
    return np.array(rows)


def column(losses, rows, name):
    return rows[:, [entry.name for entry in losses.memory].index(name)]


def along_first(course):
    return np.column_stack([course, np.zeros(len(course))])


def only_friction(friction=FRICTION):
    return BendingLosses((DirectionLosses(friction), DirectionLosses()), THICKNESS)


# --- friction -------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 7, 400])
def test_friction_comes_to_its_limit_and_turns_round_whatever_the_steps(count):
    """First loading and the way back in closed form, with one step for each or with many."""
    losses = only_friction()
    there, back = np.linspace(0.0, 10.0, count + 1)[1:], np.linspace(10.0, -3.0, count + 1)[1:]
    rows = followed(losses, along_first(np.concatenate([there, back])))
    moment = column(losses, rows, "bending_friction_moment_1")
    first = 0.02 * -np.expm1(-there / 4.0)
    np.testing.assert_allclose(moment[:count], first, rtol=1e-12)
    turned = -0.02 + (first[-1] + 0.02) * np.exp(-(10.0 - back) / 4.0)
    np.testing.assert_allclose(moment[count:], turned, rtol=1e-11)


def test_a_closed_loop_loses_its_area_and_no_step_size_changes_that():
    """4 M_y (A - κ_f tanh(A/κ_f)): that of dry friction less what the presliding gives back."""
    losses, amplitude = only_friction(), 15.0
    expected = 4.0 * 0.02 * (amplitude - 4.0 * math.tanh(amplitude / 4.0))
    assert FRICTION.loop_loss(amplitude) == pytest.approx(expected, rel=1e-12)
    for count in (1, 50):
        half = np.linspace(amplitude, -amplitude, count + 1)[1:]
        course = np.concatenate([[amplitude], *[half, -half] * 3])
        rows = followed(losses, along_first(course))
        lost = THICKNESS * column(losses, rows, "bending_friction_loss")
        assert lost[-1] - lost[-1 - 2 * count] == pytest.approx(expected, rel=1e-4)
        assert np.diff(lost).min() >= 0.0
    # a loop by its points: the area that the moments enclose
    fine = np.linspace(amplitude, -amplitude, 4_001)
    rows = followed(losses, along_first(np.concatenate([fine, -fine, fine, -fine])))
    moment = column(losses, rows, "bending_friction_moment_1")[-2 * fine.size :]
    assert abs(np.trapezoid(moment, np.concatenate([fine, -fine]))) == pytest.approx(
        expected, rel=1e-4
    )


def test_what_is_let_go_stays_bent_as_the_law_says():
    """Bent to κ, then to M = 0: B κ_s = M_y (1 - (2 - exp(-κ/κ_f)) exp(-(κ - κ_s)/κ_f))."""
    stiffness, bent = 2e-3, 12.0
    back = np.linspace(bent, 0.0, 200_001)
    moment = (
        stiffness * back
        + column(
            losses := only_friction(),
            followed(losses, along_first(np.array([bent, *back[::100]]))),
            "bending_friction_moment_1",
        )[1:].repeat(100)[: back.size]
    )
    set_in = back[np.argmax(moment <= 0.0)]
    residual = 0.02 * (1.0 - (2.0 - math.exp(-bent / 4.0)) * math.exp(-(bent - set_in) / 4.0))
    assert stiffness * set_in == pytest.approx(residual, rel=0.02)
    assert 0.1 * bent < set_in < bent


# --- rates ----------------------------------------------------------------------------------------


def test_a_held_strip_relaxes_by_the_exponentials():
    terms = (Relaxation(0.01, 0.02), Relaxation(0.004, 0.5))
    losses = BendingLosses((DirectionLosses(None, 0.0, terms), DirectionLosses()), THICKNESS)
    memory = losses.in_step([5.0, 0.0], np.zeros(len(losses.memory)), 0.0)  # in no time
    rows, size = [], 1e-3
    for _ in range(500):
        memory = losses.in_step([5.0, 0.0], memory, size)
        rows.append(memory)
    times = size * np.arange(1, 501)
    expected = 5.0 * (0.01 * np.exp(-times / 0.02) + 0.004 * np.exp(-times / 0.5))
    moment = column(losses, np.array(rows), "viscous_bending_moment_1")
    np.testing.assert_allclose(moment, expected, rtol=1e-9)


def test_the_work_of_the_rates_is_what_is_stored_and_lost():
    rng = np.random.default_rng(3)
    knots = rng.uniform(-10.0, 10.0, (9, 2))
    knots[0] = 0.0
    grid = np.linspace(0.0, 8.0, 8001)
    course = np.column_stack([np.interp(grid, np.arange(9), own) for own in knots.T])[1:]
    losses = BendingLosses(
        tuple(DirectionLosses(None, own.viscosity, own.terms) for own in BOTH.directions), THICKNESS
    )
    rows = followed(losses, course, 1e-4)
    work, stored = 0.0, 0.0
    for number, own in enumerate(losses.directions, 1):
        moment = np.concatenate([[0.0], column(losses, rows, f"viscous_bending_moment_{number}")])
        way = np.diff(course[:, number - 1], prepend=0.0)
        work += np.sum(0.5 * (moment[1:] + moment[:-1]) * way)
        for k, term in enumerate(own.terms, 1):
            last = column(losses, rows, f"relaxing_bending_moment_{number}_{k}")[-1]
            stored += last**2 / (2.0 * term.modulus)
    lost = THICKNESS * column(losses, rows, "viscous_bending_loss")[-1]
    assert lost + stored == pytest.approx(work, rel=1e-9)
    assert lost > 0.5 * work


# --- the law --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["friction", "both"])
def test_the_compiled_law_is_the_plain_one(kind):
    fabric = scene("").material.build()
    losses = BOTH if kind == "both" else only_friction()
    sheet = {"thickness": THICKNESS, "areal_mass": 0.6, "fibre_density": 1800.0}
    own = type(fabric)(fabric.law, **sheet, bending_losses=losses)
    law, height = own.law, 0.45e-3
    name = {"friction": "FrictionBending", "both": "FrictionRelaxing2Bending"}[kind] + "FabricLaw"
    assert type(law).__name__ == name and pickle.loads(pickle.dumps(type(law))) is type(law)
    assert history_count(law) == len(losses.memory) and knows_step(law) == (kind == "both")
    before = followed(losses, np.array([[3.0, -5.0], [2.0, -6.0]]), 1e-3)[-1]
    curvature = np.array([1.2, 4.0])  # back along the one, on along the other
    E = (*(curvature * height), 0.01, 0.02, -0.03, 0.04)
    for size in (2e-4, 0.0):
        step = (size, 0.5) if kind == "both" else ()
        history = (*before, *step)
        after = losses.in_step(curvature, before, size)
        S = bending_stress(law, bending_stiffness(law), E, 1.0 / height)
        found = with_bending_losses(law, S, E, 1.0 / height, history)
        more = height * losses.per_stiffness * losses.moments(after)
        np.testing.assert_allclose(np.array(found[:2]) - S[:2], more, rtol=1e-9)
        assert found[2:] == tuple(S[2:])
        np.testing.assert_allclose(
            evolved_bending(law, E, 1.0 / height, history), after, rtol=1e-9, atol=1e-15
        )
        stored = 0.0
        for number, direction in enumerate(losses.directions, 1):
            parts = [direction.friction] if direction.friction else []
            names = [f"bending_friction_moment_{number}"] if parts else []
            names += [f"relaxing_bending_moment_{number}_{k + 1}" for k in range(9)]
            for part, moment in zip([*parts, *direction.terms], names):
                stored += column(losses, after[None], moment)[0] ** 2 / part.modulus
        end = (*after, *step)
        assert stored_bending(law, end) == pytest.approx(losses.per_stiffness * stored, rel=1e-9)
    stiff = np.array(bending_bound(law)) - bending_stiffness(law)
    np.testing.assert_allclose(stiff[:2], losses.glassy_moduli(), rtol=1e-9)
    turned = 2.0 * 0.02 / 4.0 + (0.014 if kind == "both" else 0.0)
    assert stiff[0] == pytest.approx(turned * losses.per_stiffness, rel=1e-9)
    if kind == "both":
        np.testing.assert_allclose(bending_viscosity(law), losses.viscosities(), rtol=1e-12)
    else:
        assert bending_viscosity(law) is None


def test_memories_of_a_fabric_stand_one_behind_the_other():
    """Set, shear that depends on its rate, friction of bending by a curve: each finds its own."""
    fabric = scene("""
law = "fabric-with-set"
compaction.permanent_set = 0.3
viscous = { viscosity = "2000 Pa*s", maxwell = [{ modulus = "0.05 MPa", relaxation_time = "1 s" }] }
[material.bending]
curve_1 = { curvature = "2 5 1/m", moment = "0.2 0.3 N" }
friction_1 = { moment = "0.02 N", curvature = "4 1/m" }
""").material.build()
    names = [entry.name for entry in fabric.law.remembers]
    assert names[0] == "largest_compaction_strain" and names[1] == "shear_strain_before"
    assert names[4:7] == ["relaxing_moment_1", "curvature_before_1", "curvature_before_2"]
    history = np.arange(len(names), dtype=float)
    assert own_memory(fabric.law, fabric.viscous.memory, history).tolist() == [1.0, 2.0, 3.0, 4.0]
    assert fabric.viscous_energy(history[:, None])[0] == 3.0
    lost = fabric.dissipated_energy(np.where(history == 0.0, -0.1, history)[:, None])
    assert lost[0] == pytest.approx(
        history[-1] + fabric.dissipated_energy(np.where(history == 0.0, -0.1, 0.0)[:, None])[0]
    )
    assert type(fabric.law).__module__ == laws.__name__


# --- scenes ---------------------------------------------------------------------------------------


def test_what_does_not_know_the_friction_refuses_it_by_name():
    rubbed = scene()
    with pytest.raises(InputError, match="material.bending: .* without thickness"):
        build_model(scene(RUBBED, 'time = "1 ms"', "element=membrane-shell"))
    model = assemble_sheet(build_blank(rubbed.blank, 1e-3), rubbed.material.build())
    with pytest.raises(InputError, match="material.bending: .* static solver does not follow"):
        StaticProblem(model=model, held=np.ones((3, model.node_count), dtype=bool))
    stroke = '\n[[tools]]\nname = "p"\nshape = { type = "plate", side = "above" }\n'
    stroke += 'position = "0 0 1.004 mm"\n'
    stroke += 'motion = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm" }'
    viscous = '\n[material.bending.viscous_1]\nviscosity = "1 kPa*s"\n'
    with pytest.raises(InputError, match="process.time: is missing, and the bending of the fabric"):
        scene(viscous + stroke, "")
    assert scene(RUBBED + stroke, "").time_is_found


def test_check_names_the_effects_and_what_limits_the_step():
    report = check_scene(scene(RUBBED + 'viscous_2 = { viscosity = "1 kPa*s" }'))
    effects = {effect.key: effect for effect in report.effects}
    assert effects["bending_friction"].active
    assert "along fibres 1 up to 0.02 N within 4 1/m" in effects["bending_friction"].reason
    assert effects["viscous_bending"].active
    assert "fibres 2 dashpot" in effects["viscous_bending"].reason
    assert not effects["memory"].active and not effects["viscous_shear"].active
    assert any("viscous bending takes process.time" in text for text in report.warnings)
    off = scene(RUBBED, 'time = "1 ms"', "effects.bending_friction=off")
    assert history_count(off.material.build().law) == 0
    # 1/3 η/ρ (2/L)² of rectangles bounds the step by 2 over it
    body = build_model(scene('bending.viscous_1 = { viscosity = "500 kPa*s" }')).only_body()
    rate = body.reference_frequencies().damping_rate
    assert rate == pytest.approx(5e5 / 3.0 * 4.0 / (597.6 * 1e-4), rel=1e-3)
    stiff = check_scene(scene('bending.viscous_1 = { viscosity = "500 kPa*s" }'))
    assert stiff.estimate.controlled_by == "damping by the viscosity of the fabric"


# --- in the solver --------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_strip_that_is_bent_and_back_follows_the_law(tmp_path):
    """Kawabata's loop of friction: moments within 1 %, the loss of all of it within 0.5 %.

    ``identify bending-loop`` finds the law of the simulated loop again.
    """
    own = only_friction()
    result = pure_bending(scene().material, cycles=1)
    assert max(abs(one.relative) for one in result.comparisons) < 0.01
    energy = result.figures["energy"]
    assert abs(energy["balance_error"]) < 1e-4 * energy["external"]
    fine = np.concatenate(
        [np.linspace(0, 20, 999), np.linspace(20, -20, 999), np.linspace(-20, 20, 999)]
    )
    lost = column(own, followed(own, along_first(fine)), "bending_friction_loss")[-1]
    assert energy["inelastic"] == pytest.approx(lost * THICKNESS * 0.02**2, rel=5e-3)
    write_coupon(tmp_path, result)
    found = identify_bending_loop_file(tmp_path / "curve.csv", {})
    stiffness = scene().material.build().law.B11 * THICKNESS**3 / 12.0
    assert found["stiffness"].value == pytest.approx(stiffness, rel=0.01)
    assert found["friction_moment"].value == pytest.approx(FRICTION.limit, rel=0.01)
    assert found["friction_curvature"].value == pytest.approx(FRICTION.length, rel=0.03)


@pytest.mark.slow
def test_bending_at_a_rate_takes_what_its_work_does_not_store():
    """Kelvin-Voigt and a Maxwell element by a curve: moments; dissipated = work within 0.1 %."""
    entries = """
[material.bending]
curve_1 = { curvature = "5 20 1/m", moment = "0.016 0.04 N" }
viscous_1 = { viscosity = "2 kPa*s", maxwell = [{ modulus = "40 MPa", relaxation_time = "50 ms" }] }
"""
    result = pure_bending(scene(entries).material, cycles=1, edge_length=0.01)
    of_loop = [one for one in result.comparisons if "bent back at 10" not in one.quantity]
    assert max(abs(one.relative) for one in of_loop) < 0.01
    energy = result.figures["energy"]
    spent = energy["internal"] + energy["hourglass"] + energy["damping"] + energy["kinetic"]
    assert energy["viscous"] == pytest.approx(energy["external"] - spent, rel=1e-3)
    assert energy["viscous"] > 0.3 * energy["external"]


def bent(the_scene, curvature, ramp):
    """Return a simulation of a strip that is bent within a time [s] and then held."""
    loop = Loop([0.0, curvature], ramp)
    held = type("Held", (), {"travel": staticmethod(lambda time: loop.travel(min(time, ramp)))})
    return Simulation(build_model(the_scene, bent_ends(held)))


@pytest.mark.slow
def test_a_bent_strip_relaxes_in_the_solver_and_ends_bit_identical():
    """Moment of a held strip by the exponentials within 0.5 %; restored, and with two threads."""
    terms = """
[material.bending]
friction_1 = { moment = "0.02 N", curvature = "4 1/m" }
viscous_1 = { maxwell = [{ modulus = "60 MPa", relaxation_time = "20 ms" }] }
"""
    the_scene = scene(terms, 'time = "60 ms", mass_damping = "100 1/s"')
    simulation, times = bent(the_scene, 10.0, 0.02), (0.03, 0.04, 0.06)
    body, found = simulation.model.only_body(), []
    losses = body.material.bending_losses
    path = np.linspace(0.0, 0.06, 6001)
    loop = Loop([0.0, 10.0], 0.02)
    memory, expected = np.zeros(len(losses.memory)), []
    for time in path[1:]:
        memory = losses.in_step([loop.travel(min(time, 0.02)), 0.0], memory, 1e-5)
        if min(abs(time - own) for own in times) < 1e-7:
            expected.append(column(losses, memory[None], "viscous_bending_moment_1")[0])
    for time in times:
        simulation.advance_to(time)
        if time == 0.03:
            half_way = simulation.state.copy()
        past = body.element_history(simulation._history(body))
        own = own_memory(body.material.law, losses.memory, past).T
        found.append(-column(losses, own, "viscous_bending_moment_1").mean())  # bent upwards
    np.testing.assert_allclose(found, expected, rtol=5e-3)
    again = bent(the_scene, 10.0, 0.02)
    again.restore(half_way)
    for time in times[1:]:
        again.advance_to(time)
    threads = bent(the_scene, 10.0, 0.02)
    try:
        use_threads(2, 10**6)
        for time in times:
            threads.advance_to(time)
    finally:
        use_threads(1, 1)
    for other in (again, threads):
        for name, array in other.state.as_dict().items():
            np.testing.assert_array_equal(array, getattr(simulation.state, name), err_msg=name)


@pytest.mark.slow
def test_nothing_is_lost_in_a_rigid_motion():
    """A bent strip that is turned by half a turn keeps its moments and loses nothing."""
    the_scene = scene(process='time = "20 ms"')
    simulation = Simulation(build_model(the_scene))
    x, _, z = simulation.model.node_positions.T
    rate = math.pi / 0.02
    simulation.set_velocity(rate * np.array([z - z.mean(), np.zeros_like(z), -x]))
    simulation.advance_to(0.02)
    energy = simulation.energy()
    assert energy["inelastic"] < 1e-9 * energy["kinetic"]


@pytest.mark.slow
def test_a_stiff_dashpot_limits_the_step_and_damps():
    the_scene = scene('bending.viscous_1 = { viscosity = "200 kPa*s" }', 'time = "1 ms"')
    simulation = Simulation(build_model(the_scene))
    body = simulation.model.only_body()
    step = simulation.prepare_steps()
    assert simulation.control.cause == "damping by the viscosity of the fabric"
    rate = body.damping_rate(simulation.state.position, simulation._history(body))
    assert rate == pytest.approx(body.reference_frequencies().damping_rate, rel=1e-6)
    assert step == pytest.approx(0.9 * 2.0 / rate, rel=0.01)
    rng = np.random.default_rng(5)
    speed = rng.uniform(-0.05, 0.05, simulation.state.velocity.shape)
    simulation.set_velocity(speed)
    simulation.advance_to(2e-4)
    energy = simulation.energy()
    assert energy["viscous"] > 0.01 * energy["external"]
    assert abs(energy["balance_error"]) < 0.05 * energy["external"]
    require_blows_up(the_scene, speed)


@pytest.mark.slow
def test_a_strip_that_is_let_go_keeps_the_curvature_of_the_law():
    """Bent to 12 1/m, led back to 5 1/m and let go, damped: no moment, within 3 % of the set."""
    text = 'time = "0.5 s", mass_damping = "20000 1/s"'
    loop = Loop([0.0, -12.0, -5.0], 0.05)
    led = type("Led", (), {"travel": staticmethod(lambda t: loop.travel(min(t, loop.duration)))})
    held = Simulation(build_model(scene(RUBBED, text), bent_ends(led)))
    held.advance_to(loop.duration)
    free = Simulation(build_model(scene(RUBBED, text), lambda blank: bent_ends(led)(blank)[:1]))
    for name in ("position", "history", "work"):
        getattr(free.state, name)[:] = getattr(held.state, name)
    free.advance_to(0.5)
    body, losses = free.model.only_body(), only_friction()
    past = body.element_history(free._history(body))
    own = own_memory(body.material.law, losses.memory, past).T
    stays = column(losses, own, "curvature_before_1")
    rubs = column(losses, own, "bending_friction_moment_1")
    back = np.linspace(12.0, 0.0, 2001)
    rubbed = followed(losses, along_first(np.array([12.0, *back])))[1:]
    stiffness = body.material.law.B11 * THICKNESS**3 / 12.0
    total = stiffness * back + column(losses, rubbed, "bending_friction_moment_1")
    np.testing.assert_allclose(stiffness * stays + rubs, 0.0, atol=0.01 * 0.02)
    np.testing.assert_allclose(stays, np.interp(0.0, total[::-1], back[::-1]), rtol=0.03)


@pytest.mark.slow
def test_a_strip_under_a_constant_moment_creeps(loaded):
    """Kelvin-Voigt: κ = m/B (1 - exp(-B t/η)), within 0.5 %; what is lost is work less stored."""
    viscosity, stress = 2e6, 400.0
    the_scene = scene(f'bending.viscous_1 = {{ viscosity = "{viscosity} Pa*s" }}', 'time = "80 ms"')

    def clamp(blank):
        x = blank.node_positions[:, 0]
        return [Support("clamp", np.flatnonzero(x < x.min() + 1e-9), "xyz")]

    model = build_model(the_scene, clamp)
    body = model.only_body()
    x, y, z = model.node_positions.T
    # a couple of forces along x at the free end, a linear stress over the thickness
    share = np.where(np.abs(y) > 5e-3, 0.5, 1.0) * 0.01
    moment = stress * THICKNESS**2 / 6.0  # per width
    side = np.sign(z - z.mean())
    along = np.where(x > x.max() - 1e-9, -side * share * moment / THICKNESS, 0.0)
    simulation = Simulation(loaded(model, np.array([along, np.zeros_like(x), np.zeros_like(x)])))
    stiffness = body.material.law.B11
    lost = []
    for until in (0.02, 0.04, 0.08):
        simulation.advance_to(until)
        past = body.element_history(simulation._history(body))
        own = own_memory(body.material.law, body.material.bending_losses.memory, past).T
        bent = column(body.material.bending_losses, own, "curvature_before_1").mean()
        expected = 12.0 * moment / THICKNESS**3 / stiffness
        expected *= -math.expm1(-stiffness * until / viscosity)
        assert abs(bent) == pytest.approx(expected, rel=5e-3)
        lost.append(simulation.energy()["viscous"])
    energy = simulation.energy()
    spent = energy["internal"] + energy["hourglass"] + energy["kinetic"]
    assert energy["viscous"] == pytest.approx(energy["external"] - spent, rel=1e-3)
    assert np.all(np.diff(lost) > 0.0)
