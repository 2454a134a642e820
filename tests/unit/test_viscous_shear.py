"""Shear that depends on its rate: closed forms, energies, steps, and what is refused."""

from __future__ import annotations

import math
import pickle
import runpy
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from without_damping_bound import require_blows_up

from lcmchain.check import check_scene
from lcmchain.compilation.threads import use_threads
from lcmchain.coupling.solids.stack_compaction import at_rest
from lcmchain.coupons.bias_extension import bias_extension
from lcmchain.coupons.picture_frame import picture_frame
from lcmchain.effects.supports import Support
from lcmchain.errors import InputError
from lcmchain.materials import laws
from lcmchain.materials.fabric import FabricLaw
from lcmchain.materials.features.temperature_field import arrhenius_factor
from lcmchain.materials.features.viscous_shear import Relaxation, ViscousShear
from lcmchain.materials.law import (
    Remembered,
    Step,
    evolved_history,
    history_count,
    load_history,
    load_past,
    membrane_response,
    store_history,
    viscosity,
)
from lcmchain.mesh.blank import build_blank
from lcmchain.model import assemble_sheet, build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.statics import StaticProblem

SCENE = """
process = {{ {process} }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "10 mm", height = "0.502 mm" }}

[material]
preset = "MD600"
{material}
"""
VISCOUS = """
[material.viscous]
viscosity = "2000 Pa*s"
maxwell = [
  { modulus = "0.05 MPa", relaxation_time = "10 ms" },
  { modulus = "0.2 MPa", relaxation_time = "100 ms" },
]
"""
EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "viscous"
CROSS = ViscousShear(
    viscosity=3e3,
    infinite_viscosity=40.0,
    time_constant=0.02,
    exponent=0.35,
    terms=(Relaxation(2e5, 0.02), Relaxation(1e5, 3.0), Relaxation(5e4, 1e-4)),
)


def scene(material=VISCOUS, process='time = "20 ms"', *overrides, more=""):
    return scene_from_text(
        SCENE.format(process=process, material=material) + more, overrides=overrides
    )


def steady_stress(viscous, angle, rate):
    """Return what comes to S12 [Pa] at angles [rad] that grew from 0 at a rate [1/s]."""
    moment = viscous.viscosity_at(rate) * rate
    for term in viscous.terms:
        moment = moment - term.modulus * term.time * rate * np.expm1(-angle / (rate * term.time))
    return moment / np.cos(angle)


def driven(viscous, strains, size):
    """Return the memory (steps, 3 + n) along shear strains that steps of a size lead to."""
    memory = np.zeros(len(viscous.memory))
    rows = []
    for g in strains:
        memory = viscous.in_step(g, memory, size)
        rows.append(memory)
    return np.array(rows)


# --- the law --------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["fabric", "fabric-with-set"])
def test_the_compiled_law_is_the_plain_one(law):
    """Stress and memory of a step, of a fabric that also remembers its set or does not."""
    kind = 'law = "fabric-with-set"\ncompaction.permanent_set = 0.3\n'
    material = scene(kind if law == "fabric-with-set" else "").material.build()
    sheet = {"thickness": 1e-3, "areal_mass": 0.6, "fibre_density": 1800.0, "viscous": CROSS}
    if law == "fabric-with-set":
        material = type(material)(FabricLaw(*material.law[:18]), 0.3, **sheet)
    else:
        material = type(material)(material.law, **sheet)
    base = [-0.2] if law == "fabric-with-set" else []
    E = np.array([1e-3, 0.0, -0.1, 0.42, 0.0, 0.0])
    own = np.array([0.4, 2e4, 3.0, 1e4, -2e3, 5e2])
    for step in (Step(1e-3, 0.1), Step(2e-6, 0.1), Step(0.0, 0.1), Step(30.0, 31.0)):
        history = (*base, *own, *step)
        S, C = membrane_response(material.law, tuple(E), history)
        still = (*base, E[3], *np.zeros(5), *step)
        S_elastic, C_elastic = membrane_response(material.law, tuple(E), still)
        expected = CROSS.in_step(E[3], own, step.size)
        assert S[3] - S_elastic[3] == pytest.approx(expected[1], rel=1e-9)
        assert material.rate_stress(E, np.array(history[:-2]), step)[3] == expected[1]
        assert S[:3] == S_elastic[:3]
        after = evolved_history(material.law, tuple(E), history)
        assert after[: len(base)] == tuple(base)
        assert after[len(base) :] == pytest.approx(tuple(expected), rel=1e-9)
        # Maxwell elements are springs for a step in no time
        middle = 1.0 - (0.5 * (E[3] + own[0])) ** 2
        glassy = membrane_response(material.law, tuple(E), (*base, *own, *step))[1][3]
        assert glassy - material.stress_and_tangent(E)[1][3, 3] == pytest.approx(
            CROSS.glassy_modulus / middle, rel=1e-9
        )
    bounds = viscosity(material.law, tuple(E), history)
    assert bounds[3] == pytest.approx(3e3 / (1.0 - 0.42**2), rel=1e-12)
    assert material.viscosity(E).tolist() == [0.0, 0.0, 0.0, pytest.approx(bounds[3]), 0.0, 0.0]


@pytest.mark.parametrize("rate", [0.1, 3.0, 80.0])
def test_shear_at_a_constant_rate_has_the_stress_of_the_closed_form(rate):
    size = 1e-3 / rate
    angles = size * rate * np.arange(1, 801)
    stress = driven(CROSS, np.sin(angles), size)[:, 1]
    # that of a step is the one half way
    expected = steady_stress(CROSS, angles, rate)
    np.testing.assert_allclose(stress[5:], expected[5:], rtol=1.5e-3)
    by_hand = sum(t.modulus * t.time * (1.0 - math.exp(-0.4 / rate / t.time)) for t in CROSS.terms)
    by_hand += 40.0 + (3e3 - 40.0) / (1.0 + (0.02 * rate) ** 0.65)
    assert expected[399] == pytest.approx(by_hand * rate / math.cos(0.4), rel=1e-9)


def test_a_held_shear_relaxes_by_the_exponentials():
    viscous = ViscousShear(terms=(Relaxation(2e5, 0.02), Relaxation(1e5, 0.5)))
    angle, size = 0.3, 1e-4
    strains = np.full(5000, math.sin(angle))
    memory = np.array([0.0, 0.0, 0.0, 0.0, 0.0])
    memory = viscous.in_step(strains[0], memory, 0.0)  # in no time
    turn = math.sin(angle) / math.sqrt(1.0 - (0.5 * math.sin(angle)) ** 2)
    assert memory[3:] == pytest.approx([2e5 * turn, 1e5 * turn], rel=1e-12)
    times = size * np.arange(1, 5001)
    stress = []
    for g in strains:
        memory = viscous.in_step(g, memory, size)
        stress.append(memory[1])
    expected = 2e5 * np.exp(-times / 0.02) + 1e5 * np.exp(-times / 0.5)
    np.testing.assert_allclose(stress, turn * expected / math.cos(angle), rtol=1e-9)
    # all that was stored is lost in the end
    assert memory[2] == pytest.approx(
        (2e5 + 1e5) * turn**2 / 2.0 - viscous.stored(memory[3:]), rel=1e-2
    )


def test_work_is_what_is_stored_and_lost_and_nothing_is_gained():
    """Along a wild path: the work of the mean stresses, to rounding; and the loss never falls."""
    rng = np.random.default_rng(2)
    knots = rng.uniform(-0.7, 0.7, 12)
    strains = np.interp(np.linspace(0.0, 11.0, 20000), np.arange(12), knots) - knots[0]
    rows = driven(CROSS, strains, 1e-5)
    stress = np.concatenate([[0.0], rows[:, 1]])
    work = np.cumsum(0.5 * (stress[1:] + stress[:-1]) * np.diff(strains, prepend=0.0))
    stored = CROSS.stored(rows[:, 3:].T)
    np.testing.assert_allclose(stored + rows[:, 2], work, rtol=1e-9, atol=1e-9 * work.max())
    assert np.diff(rows[:, 2]).min() > -1e-6 * work.max()
    assert rows[-1, 2] > 0.5 * work[-1]


def test_viscosities_fall_with_the_rate_and_all_times_with_the_temperature():
    assert CROSS.viscosity_at(0.0) == 3e3
    assert CROSS.viscosity_at(-50.0) == pytest.approx(1520.0)  # half way where M rate is 1
    assert CROSS.viscosity_at(1e12) == pytest.approx(40.0, rel=1e-3)
    factor = arrhenius_factor(553.15, 563.15, 60e3)
    assert factor == pytest.approx(math.exp(60e3 / 8.314462618 * (1 / 553.15 - 1 / 563.15)))
    assert factor > 1.0
    shifted = CROSS.shifted(factor)
    # at a rate lower by the factor: the same stresses
    assert steady_stress(shifted, 0.3, 2.0 / factor) == pytest.approx(
        steady_stress(CROSS, 0.3, 2.0)
    )
    assert shifted.glassy_modulus == CROSS.glassy_modulus
    warm = scene(
        VISCOUS + 'temperature = "280 degC"\nreference_temperature = "290 degC"\n'
        'activation_energy = "60 kJ/mol"'
    ).material.build()
    assert warm.viscous == scene().material.build().viscous.shifted(factor)


# --- the protocol ---------------------------------------------------------------------------------


def test_a_law_may_remember_any_count_of_numbers_and_know_its_step():
    class Elephant(FabricLaw):
        remembers = tuple(Remembered(f"m{i}", "1", "more") for i in range(7))

    class Watch(Elephant):
        knows_step = True

    data = np.arange(40.0)
    numbers = (2.0, 7.0, 12.0, 17.0, 22.0, 27.0, 32.0)
    plain, watch = Elephant(*range(18)), Watch(*range(18))
    step = Step(0.5, 3.0)
    assert load_history(plain, data, 2, 5) == load_past(plain, data, 2, 5, step) == numbers
    assert load_history(watch, data, 2, 5) == (*numbers, 0.0, 0.0)
    assert load_past(watch, data, 2, 5, step) == (*numbers, 0.5, 3.0)
    store_history(watch, (*range(7), 8.0, 9.0), data, 1, 5)
    assert data[1:36:5].tolist() == list(range(7)) and data[36] == 36.0


def test_a_class_is_found_by_its_name_as_kernels_on_disk_look_it_up():
    law = scene().material.build().law
    assert type(law).__name__ == "Newton2FabricLaw" and history_count(law) == 5
    assert pickle.loads(pickle.dumps(type(law))) is type(law)
    assert laws.Cross7LinearLockingFabricWithSetLaw.maxwell_count == 7
    for name in ("Newton1StiffnessLaw", "Newton1", "nothing"):
        with pytest.raises(AttributeError):
            getattr(laws, name)


# --- scenes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("entries", "key", "words"),
    [
        ("", "viscous", "needs a viscosity"),
        ('cross = { time_constant = "1 s", exponent = 0.3 }', "viscous", "viscosity"),
        (
            'viscosity = "10 Pa*s"\ncross = { time_constant = "1 s", exponent = 0.3, '
            'infinite_viscosity = "20 Pa*s" }',
            "viscous.cross.infinite_viscosity",
            "more than the viscosity at rest of 10 Pa\\*s",
        ),
        ('viscosity = "10 Pa*s"\ntemperature = "280 degC"', "reference_temperature", "together"),
        ('viscosity = "10 Pa*s"\nmaxwell = [{ modulus = "1 MPa" }]', "relaxation_time", "missing"),
    ],
)
def test_a_wrong_table_is_refused(entries, key, words):
    with pytest.raises(InputError, match=words) as refused:
        scene("[material.viscous]\n" + entries)
    assert key in str(refused.value)


def test_what_does_not_know_the_rate_refuses_it():
    stroke = '\n[[tools]]\nname = "p"\nshape = { type = "plate", side = "above" }\n'
    stroke += 'position = "0 0 1.004 mm"\n'
    stroke += 'motion = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm" }'
    with pytest.raises(InputError, match="process.time: is missing, and the shear of the fabric"):
        scene(VISCOUS, "", more=stroke)
    assert scene(VISCOUS, "", "effects.viscous_shear=off", more=stroke).time_is_found
    with pytest.raises(InputError, match="material.viscous: .*elements without thickness"):
        build_model(scene(VISCOUS, 'time = "1 ms"', "element=membrane-shell"))
    with pytest.raises(InputError, match="element.hourglass: .* knows no rate"):
        build_model(scene(VISCOUS, 'time = "1 ms"', "element.hourglass=published"))
    the_scene = scene()
    model = assemble_sheet(build_blank(the_scene.blank, 1e-3), the_scene.material.build())
    with pytest.raises(InputError, match="material.viscous: .* static solver"):
        StaticProblem(model=model, held=np.ones((3, model.node_count), dtype=bool))


def test_check_names_the_effect_and_what_limits_the_step():
    report = check_scene(scene())
    (effect,) = [own for own in report.effects if own.key == "viscous_shear"]
    assert effect.active and "2000 Pa s; relaxing 0.05 MPa in 0.01 s" in effect.reason
    assert not next(own for own in report.effects if own.key == "memory").active
    assert any("the time of the real process" in text for text in report.warnings)
    assert report.estimate.controlled_by == "in-plane stiffness"
    stiff = check_scene(scene('viscous = { viscosity = "100 kPa*s" }'))
    assert stiff.estimate.controlled_by == "damping by the viscosity of the fabric"
    # of squares of 10 mm that know nothing else: 4 η/ρ (1/L² + 1/L²) bounds the step by 2 over it
    body = build_model(scene('viscous = { viscosity = "100 kPa*s" }')).only_body()
    rate = body.reference_frequencies().damping_rate
    assert rate == pytest.approx(8.0 * 1e5 / (597.6 * 1e-4), rel=1e-4)
    assert stiff.estimate.critical_step == pytest.approx(2.0 / rate, rel=0.05)
    off = scene(VISCOUS, 'time = "1 ms"', "effects.viscous_shear=off")
    assert type(off.material.build().law) is FabricLaw
    assert not any("real process" in text for text in check_scene(off).warnings)
    assert "leaves out what the scene calls for (material.viscous)" in check_scene(off).warnings[0]


# --- in the solver --------------------------------------------------------------------------------


def frame(angle, half_side=0.01):
    """Hold the rim of the sheet in a frame whose angle [rad] follows a function of time."""

    def hinged(time):
        c, s = math.cos(0.5 * angle(time)), math.sin(0.5 * angle(time))
        return np.array([[c, s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])

    def supports(blank):
        rim = (np.abs(blank.node_positions[:, :2]) > half_side - 1e-9).any(axis=1)
        return [Support("frame", np.flatnonzero(rim), "xy", motion=hinged)]

    return supports


def sheared(the_scene, rate, until):
    """Return a simulation of a frame that shears at a rate [1/s] until a time [s]."""
    angle = lambda time: rate * min(time, until)  # noqa: E731
    simulation = Simulation(build_model(the_scene, frame(angle)))
    x, y, _ = simulation.model.node_positions.T
    simulation.set_velocity(0.5 * rate * np.array([y, x, np.zeros_like(x)]))
    return simulation


def work_by_closed_form(material, rate, first, last):
    """Return the work per volume [J/m³] of shear at a rate between two angles [rad]."""
    points, weights = leggauss(8)
    angle = 0.5 * (first + last) + 0.5 * (last - first) * points
    strain = np.zeros((8, 6))
    strain[:, 3] = np.sin(angle)
    stress = material.stress_and_tangent(strain)[0][:, 3]
    stress += steady_stress(material.viscous, angle, rate)
    return 0.5 * (last - first) * float(np.dot(weights, stress * np.cos(angle)))


@pytest.mark.slow
@pytest.mark.parametrize("rate", [1.0, 10.0, 50.0])
def test_a_picture_frame_follows_the_closed_form_at_any_speed(rate):
    largest = 0.5
    time = largest / rate
    the_scene = scene(VISCOUS, f'time = "{time} s"')
    simulation = sheared(the_scene, rate, time)
    body = simulation.model.only_body()
    angles, work = np.linspace(0.0, largest, 11), [0.0]
    for angle in angles[1:]:
        simulation.advance_to(float(angle / rate))
        work.append(simulation.energy()["external"])
    for first, last, done in zip(angles, angles[1:], np.diff(work)):
        expected = body.volume * work_by_closed_form(body.material, rate, first, last)
        assert done == pytest.approx(expected, rel=0.01)
    energy = simulation.energy()
    assert energy["viscous"] > 0.3 * energy["external"]
    # what is lost is the work less what is stored: of the law itself, and of the Maxwell elements
    past = body.element_history(simulation._history(body))
    strain = np.zeros(6)
    strain[3] = math.sin(largest)
    elastic = body.material.membrane_energy(strain) * body.volume
    relaxing = body.material.viscous.stored(past[3:]).mean() * body.volume
    assert energy["internal"] == pytest.approx(elastic + relaxing, rel=2e-3)
    lost = work[-1] - energy["internal"] - energy["kinetic"]
    assert energy["viscous"] == pytest.approx(lost, rel=1e-3)
    assert abs(energy["balance_error"]) < 1e-3 * energy["external"]


def test_a_closure_presses_the_fabric_without_its_rates():
    wet = at_rest(scene().material)
    assert type(wet.law) is FabricLaw and history_count(wet.law) == 0
    assert wet.law == at_rest(scene("").material).law


def test_coupons_refuse_what_their_reference_does_not_know():
    wet, dry = scene().material, scene("").material
    with pytest.raises(InputError, match="material.viscous: .* use lcmchain coupon picture-frame"):
        bias_extension(wet)
    with pytest.raises(InputError, match="--hold: lets the fabric relax, but its shear does not"):
        picture_frame(dry, hold=0.1)


@pytest.mark.slow
def test_the_coupon_follows_a_machine_that_stops():
    thinning = VISCOUS.replace(
        "\nmaxwell", "\ncross = { time_constant = '0.1 s', exponent = 0.3 }\nmaxwell"
    )
    result = picture_frame(
        scene(thinning).material, shear_angle=0.785, edge_length=0.05, speed=0.2, hold=0.3
    )
    pulled = [own for own in result.comparisons if "after the stop" not in own.quantity]
    held = [own for own in result.comparisons if "after the stop" in own.quantity]
    assert len(pulled) == 4 and len(held) > 5
    assert max(abs(own.relative) for own in pulled) < 0.01
    assert max(abs(own.relative) for own in held) < 0.005
    forces = [own.value for own in held]
    assert forces[0] > 1.05 * forces[-1] and np.all(np.diff(forces) < 0.0)


@pytest.mark.slow
def test_a_held_frame_relaxes():
    rate, largest = 50.0, 0.4
    ramp = largest / rate
    simulation = sheared(scene(VISCOUS, 'time = "208 ms"'), rate, ramp)
    body, viscous = simulation.model.only_body(), simulation.model.only_body().material.viscous
    # struck at the end of the ramp, the sheet swings; after 20 ms the damping of the fabric is done
    for time in (0.028, 0.058, 0.108, 0.208):
        simulation.advance_to(time)
        past = body.element_history(simulation._history(body))
        held = sum(
            term.modulus * term.time * rate * -math.expm1(-ramp / term.time)
            * math.exp(-(time - ramp) / term.time)
            for term in viscous.terms
        )  # fmt: skip
        np.testing.assert_allclose(past[1], held / math.cos(largest), rtol=5e-3)


@pytest.mark.slow
def test_a_sheet_under_a_constant_load_creeps(loaded):
    """Kelvin-Voigt: η γ' = τ cos(γ/2) - s0 sin γ cos γ under dead shear tractions τ."""
    traction, modulus, resistance = 4e4, 1e5, 2e3
    the_scene = scene(
        f'membrane.shear_polynomial = ["{modulus} Pa", "0 Pa", "0 Pa", "0 Pa", "0 Pa"]\n'
        f'viscous = {{ viscosity = "{resistance} Pa*s" }}',
        'time = "40 ms"',
    )
    model = build_model(the_scene, lambda blank: [Support("table", np.arange(18), "z")])
    x, y, _ = model.node_positions.T
    # along the sides, per layer of nodes: half an edge at corners, a whole one between
    share = 0.5 * traction * 1.004e-3 * 0.01
    ends = [np.where(np.abs(along) > 5e-3, 0.5, 1.0) for along in (x, y)]
    force = share * np.array([np.sign(y) * ends[0], np.sign(x) * ends[1], np.zeros_like(x)])
    simulation = Simulation(loaded(model, force))
    body = model.only_body()
    angle = np.linspace(0.0, 0.41, 20001)
    speed = traction * np.cos(0.5 * angle) - modulus * np.sin(angle) * np.cos(angle)
    pieces = 2.0 * np.diff(angle) / (speed[1:] + speed[:-1])
    time = resistance * np.concatenate([[0.0], np.cumsum(pieces)])
    for until in (0.005, 0.01, 0.02, 0.04):
        simulation.advance_to(until)
        past = body.element_history(simulation._history(body))
        assert math.asin(past[0, 0]) == pytest.approx(np.interp(until, time, angle), rel=5e-3)
    energy = simulation.energy()
    assert energy["viscous"] == pytest.approx(
        energy["external"] - energy["internal"] - energy["kinetic"], rel=1e-3
    )


@pytest.mark.slow
def test_a_stiff_dashpot_limits_the_step_and_damps():
    the_scene = scene('viscous = { viscosity = "200 kPa*s" }', 'time = "1 ms"')
    simulation = Simulation(build_model(the_scene))
    body = simulation.model.only_body()
    step = simulation.prepare_steps()
    assert simulation.control.cause == "damping by the viscosity of the fabric"
    rate = body.damping_rate(simulation.state.position, simulation._history(body))
    assert rate == pytest.approx(body.reference_frequencies().damping_rate, rel=1e-6)
    assert step == pytest.approx(0.9 * 2.0 / rate, rel=0.01)
    rng = np.random.default_rng(5)
    speed = rng.uniform(-0.05, 0.05, simulation.state.velocity.shape)
    speed[2] = 0.0
    simulation.set_velocity(speed)
    simulation.advance_to(3e-4)
    energy = simulation.energy()
    assert energy["viscous"] > 0.1 * energy["external"]
    assert abs(energy["balance_error"]) < 0.05 * energy["external"]
    # without the damping rate in the bound it would blow up
    require_blows_up(the_scene, speed)


@pytest.mark.slow
def test_a_run_is_bit_identical_with_its_memory():
    """For any number of threads, from a restored state, and not without the memory."""

    def begun():
        return sheared(scene(VISCOUS, 'time = "10 ms"', "blank.edge_length=1 mm"), 50.0, 0.01)

    simulation = begun()
    simulation.advance_to(4e-3)
    half_way = simulation.state.copy()
    simulation.advance_to(6e-3)
    again, threads = begun(), begun()
    again.restore(half_way)
    again.advance_to(6e-3)
    try:
        use_threads(2, 10**6)
        threads.advance_to(4e-3)
        threads.advance_to(6e-3)
    finally:
        use_threads(1, 1)
    for other in (again, threads):
        for name, array in other.state.as_dict().items():
            np.testing.assert_array_equal(array, getattr(simulation.state, name), err_msg=name)
    again.restore(half_way)
    again.state.history[:] = 0.0
    again.advance_to(6e-3)
    assert not np.array_equal(again.state.position, simulation.state.position)


@pytest.mark.slow
def test_the_example_resists_a_faster_punch_by_more(tmp_path):
    """The force above that of the dry fabric, and what is lost to the rate."""
    compare = runpy.run_path(str(EXAMPLE / "compare.py"))
    force, lost = {}, {}
    for name, time in (("wet", 400.0), ("wet", 100.0), ("dry", 100.0)):
        cells = [cell.strip() for cell in compare["row"](name, time, tmp_path, 10.0).split("|")]
        force[name, time], lost[name, time] = float(cells[3]), float(cells[5])
    slow, fast = force["wet", 400.0], force["wet", 100.0]
    dry = force["dry", 100.0]
    assert dry < slow < fast and fast - dry > 2.0 * (slow - dry)
    assert lost["dry", 100.0] == 0.0 and lost["wet", 100.0] > lost["wet", 400.0] > 0.1
