"""A process without a time: its pace follows the sheet, and what it does to tools and loads."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from lcmchain.compilation.threads import available_threads, use_threads
from lcmchain.effects.process.pace import (
    AVERAGING,
    FALL,
    GROWTH,
    KINETIC_PART,
    SLOWEST,
    PaceLaw,
    next_pace,
    pace_law,
)
from lcmchain.effects.supports import Support, translation
from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries, Histories, model_datasets
from lcmchain.fields.loads import force_parts
from lcmchain.materials.shear_waves import shear_energy, shear_wave_speeds
from lcmchain.model import build_model
from lcmchain.scene import process as process_module
from lcmchain.scene import scene_from_text
from lcmchain.scene.process import AVERAGING_PART, DAMPING_TIMES_TIME, PERIODS
from lcmchain.solver import simulation as simulation_module
from lcmchain.solver.simulation import Simulation
from lcmchain.state import PACE, SHEET_TIME, STEPS, TIME

SCENE = """
process = {{ {process} }}
blank = {{ size = ["60 mm", "40 mm"], edge_length = "5 mm", height = "0.502 mm" }}
material = {{ preset = "MD600" }}
contact = {{ friction = 0.157 }}

[[tools]]
name = "punch"
shape = {{ type = "sphere_capped_punch", radius = "15 mm" }}
position = "0 0 1.004 mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "6 mm"{motion} }}

[[tools]]
name = "die"
shape = {{ type = "plate_with_hole", hole_radius = "17 mm", fillet_radius = "3mm", side = "below" }}
{more}
"""
HOLDER = """
[[tools]]
name = "holder"
shape = { type = "plate_with_hole", hole_radius = "17 mm", fillet_radius = "3 mm", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "guided", direction = [0, 0, -1], mass = "20 g"RAMP }
"""


def scene(process="frames = 3", motion="", more=""):
    return scene_from_text(SCENE.format(process=process, motion=motion, more=more))


def advanced(scene, pace=None):
    """Return a simulation at its end; with a pace of its own where one is given."""
    simulation = Simulation.from_scene(scene)
    if pace is not None:
        simulation.state.clock[PACE] = pace
    simulation.advance_to(scene.process.time)
    return simulation


@pytest.fixture(scope="module")
def found():
    return advanced(scene())


# --- the controller -------------------------------------------------------------------------------

LAW = PaceLaw(time=2.0, quasi_static=1.0, kinetic_part=0.1, floor=1.0)


def step(pace, mean, kinetic, stored, duration):
    return next_pace(LAW, pace, mean, kinetic=kinetic, stored=stored, duration=duration)


def test_a_pace_grows_and_falls_by_a_factor_in_a_part_of_the_time_at_most():
    passed = 0.01
    calm, _ = step(0.5, 0.0, 0.0, 10.0, passed * LAW.time)
    assert calm == pytest.approx(0.5 * math.exp(passed / GROWTH))
    moved, _ = step(0.5, 50.0, 50.0, 10.0, passed * LAW.time)
    assert moved == pytest.approx(0.5 * math.exp(-passed / FALL))


def test_a_pace_settles_where_the_kinetic_energy_is_at_its_bound():
    """A sheet that moves with the tools has a kinetic energy as the square of the pace."""
    pace, mean = 1.0, 0.0
    for _ in range(2000):
        pace, mean = step(pace, mean, 3.0 * pace**2, 4.0, 0.01)
    assert 3.0 * pace**2 == pytest.approx(LAW.kinetic_part * 4.0, rel=1e-3)
    assert mean == pytest.approx(3.0 * pace**2, rel=1e-2)


def test_a_pace_stays_within_its_ends():
    assert step(1.0, 0.0, 0.0, 10.0, 0.1)[0] == 1.0
    assert step(SLOWEST, 1e9, 1e9, 10.0, 0.1)[0] == SLOWEST


def test_a_sheet_that_is_only_touched_is_compared_with_the_floor():
    below = step(0.5, 0.05, 0.05, 1e-9, 0.02)[0]
    assert below > 0.5  # half the bound of the floor
    assert step(0.5, 0.2, 0.2, 1e-9, 0.02)[0] < 0.5


def test_the_mean_of_the_kinetic_energy_follows_over_its_part_of_the_time():
    kept = step(1.0, 1.0, 0.0, 1e6, AVERAGING * LAW.time)[1]
    assert kept == pytest.approx(math.exp(-1.0))


def test_a_change_of_the_pace_is_known_at_once():
    """What moves with the tools slows down with them: the mean is that at the new pace."""
    pace, mean = step(0.5, 50.0, 50.0, 10.0, 0.02)
    assert pace < 0.5
    assert mean == pytest.approx(50.0 * (pace / 0.5) ** 2)


def test_the_floor_is_a_part_of_shearing_the_sheet():
    model = build_model(scene())
    law = pace_law(model.bodies, 0.1, 2.0)
    material = model.only_body().material
    # at small angles the work is half the modulus times the square of the shear
    modulus = shear_wave_speeds(material)[0] ** 2 * material.density
    assert shear_energy(material, 1e-3) == pytest.approx(0.5e-6 * modulus, rel=0.02)
    volume = 0.06 * 0.04 * material.thickness
    assert law.floor == pytest.approx(0.012 * shear_energy(material, 0.1) * volume)
    assert (law.time, law.quasi_static) == (0.1, 2.0)
    assert law.kinetic_part == pytest.approx(KINETIC_PART / 4.0)


# --- what a pace does to a process ----------------------------------------------------------------


@pytest.fixture(scope="module")
def halved():
    """One process of 20 ms, and the same at half the pace within 10 ms: the same motion."""
    slow = advanced(scene('time = "20 ms", mass_damping = "100 1/s", frames = 3'))
    half = advanced(scene('time = "10 ms", mass_damping = "100 1/s", frames = 3'), pace=0.5)
    return slow, half


def test_at_half_the_pace_a_process_is_that_of_twice_the_time(halved):
    slow, half = halved
    assert half.time == 10e-3 and slow.time == 20e-3
    assert half.state.clock[SHEET_TIME] == pytest.approx(20e-3, rel=1e-9)
    np.testing.assert_allclose(half.state.position, slow.state.position, atol=1e-7)
    assert half.state.tool_travel[0] == pytest.approx(6e-3, rel=1e-12)
    for name in ("internal", "friction", "external"):
        assert half.energy()[name] == pytest.approx(slow.energy()[name], rel=2e-3), name


def test_forces_and_work_do_not_depend_on_the_clock_of_the_process(halved):
    """Impulses belong to the time of the process, and mean forces are what they are over it."""
    slow, half = (Histories.from_state(s.model, s.state) for s in halved)
    assert len(slow.time) == len(half.time)
    np.testing.assert_allclose(half.time, 0.5 * slow.time, atol=3e-6)
    largest = np.abs(slow.tool_force).max()
    np.testing.assert_allclose(half.tool_force, slow.tool_force, atol=0.02 * largest)
    np.testing.assert_allclose(half.tool_work, slow.tool_work, atol=2e-3 * slow.tool_work.max())


def test_a_driven_tool_moves_by_its_velocity_over_the_time_of_the_process():
    simulation = Simulation.from_scene(scene('time = "10 ms", frames = 3'))
    state = simulation.state
    state.clock[PACE], state.driven[0], state.tool_input[0, 0] = 0.25, 1, 0.1
    simulation.advance_to(1e-3)
    assert state.tool_travel[0] == pytest.approx(1e-4, rel=1e-9)
    assert state.tool_velocity[0] == pytest.approx(0.025, rel=1e-9)
    assert state.clock[SHEET_TIME] == pytest.approx(4e-3, rel=1e-9)


def test_supports_move_over_the_time_of_the_process():
    def pulled(mesh):
        rim = mesh.node_positions[:, 0]
        return [
            Support("left", np.flatnonzero(rim < -0.0299)),
            Support(
                "right",
                np.flatnonzero(rim > 0.0299),
                motion=translation((1.0, 0.0, 0.0), lambda time: 2e-6 * time / 5e-3),
            ),
        ]

    # the punch is far from the sheet; it turns, as tools do in the loop that this one is then
    stroke = 'type = "stroke", direction = [0, 0, -1], distance = "6 mm"'
    turn = 'type = "turn", axis = [0, 0, 1], point = ["0 mm", "0 mm", "0 mm"], angle = "5 deg"'
    text = scene_from_text(
        SCENE.format(
            process='time = "5 ms", mass_damping = "2000 1/s", frames = 3', motion="", more=""
        )
        .replace("0 0 1.004 mm", "0 0 20 mm")
        .replace(stroke, turn)
    )
    impulse = {}
    for pace in (1.0, 0.5):
        simulation = Simulation(build_model(text, pulled))
        simulation.state.clock[PACE] = pace
        nodes = np.flatnonzero(simulation.model.node_positions[:, 0] > 0.0299)
        for until in (2.5e-3, 5e-3):
            simulation.advance_to(until)
            moved = simulation.state.position[0, nodes] - simulation.model.node_positions[nodes, 0]
            # to a hundredth of a step
            np.testing.assert_allclose(moved, 2e-6 * until / 5e-3, rtol=1e-5)
        impulse[pace] = simulation.state.support_impulse[1, 0]
    assert impulse[0.5] == pytest.approx(impulse[1.0], rel=0.05)


def test_a_scene_with_a_time_has_no_pace():
    simulation = advanced(scene('time = "5 ms", frames = 3'))
    clock = simulation.state.clock
    assert simulation.model.pace is None and clock[PACE] == 1.0
    assert clock[SHEET_TIME] == pytest.approx(clock[TIME], rel=1e-12)
    assert Histories.from_state(simulation.model, simulation.state).sheet_time is None


#: Kinetic energy in parts of the stored one, lower than that of a process: its pace falls.
LOWER_BOUND = 0.004

# --- a pace that is found -------------------------------------------------------------------------


def test_the_time_is_so_many_periods_of_the_slowest_shear_wave():
    found = scene()
    speed = shear_wave_speeds(found.material.build())[1]
    assert found.time_is_found
    assert found.process.time == pytest.approx(PERIODS * 2.0 * 0.06 / speed)
    assert found.process.mass_damping * found.process.time == pytest.approx(DAMPING_TIMES_TIME)
    assert found.process.damping_average == pytest.approx(AVERAGING_PART * found.process.time)
    heavy = scene("mass_scaling = { factor = 9 }")
    assert heavy.process.time == pytest.approx(3.0 * found.process.time)


def test_a_law_that_is_flat_somewhere_takes_no_endless_time(monkeypatch):
    monkeypatch.setattr(process_module, "shear_wave_speeds", lambda material: (50.0, 1e-4))
    assert scene().process.time == pytest.approx(PERIODS * 2.0 * 0.06 / 10.0)


def test_a_stiff_sheet_is_not_struck_by_its_tools():
    """Its waves are fast: the mean speed of the punch sets the time."""
    steel = (
        'material = { law = "isotropic", name = "steel", thickness = "1.004 mm", '
        'density = "7800 kg/m^3", young_modulus = "200 GPa", poisson_ratio = 0.3 }'
    )
    text = SCENE.format(process="frames = 3", motion="", more="")
    found = scene_from_text(text.replace('material = { preset = "MD600" }', steel))
    assert found.process.time == pytest.approx(6e-3 / 2.0)


def test_twice_as_quasi_static_takes_twice_as_long_with_a_quarter_of_the_inertia(found):
    slow = advanced(scene("frames = 3, quasi_static = 2"))
    assert slow.model.pace.time == pytest.approx(2.0 * found.model.pace.time)
    took = [s.state.clock[SHEET_TIME] for s in (slow, found)]
    assert took[0] > 1.8 * took[1]
    moved = [Histories.from_state(s.model, s.state).energy["kinetic"].max() for s in (slow, found)]
    assert moved[0] < 0.5 * moved[1]


def bounded():
    """Return a simulation whose kinetic energy has a lower bound, so that its pace falls."""
    model = build_model(scene())
    return Simulation(replace(model, pace=model.pace._replace(kinetic_part=LOWER_BOUND)))


def test_the_pace_falls_where_the_sheet_moves_more_than_it_is_strained(found):
    """The kinetic energy is bounded once the sheet is strained; the tools arrive all the same."""
    simulation = bounded()
    simulation.advance_to(simulation.model.process_time)
    histories = Histories.from_state(simulation.model, simulation.state)
    pace = np.diff(histories.time) / np.diff(histories.sheet_time)
    assert SLOWEST <= pace.min() < 0.7 and pace.max() <= 1.0 + 1e-9
    assert largest_ratio(histories) < 2.0 * LOWER_BOUND
    assert largest_ratio(Histories.from_state(found.model, found.state)) > 2.5 * LOWER_BOUND
    assert simulation.state.tool_travel[0] == pytest.approx(6e-3, rel=1e-12)
    assert abs(simulation.energy()["balance_error"]) < 1e-3 * simulation.energy()["internal"]


def largest_ratio(histories):
    """Return the largest kinetic over internal energy of a sheet that is strained."""
    internal = histories.energy["internal"]
    strained = internal > 0.1 * internal[-1]
    return (histories.energy["kinetic"][strained] / internal[strained]).max()


def test_results_hold_the_time_of_the_sheet_and_what_hourglass_terms_take(found):
    histories = Histories.from_state(found.model, found.state)
    written = model_datasets(
        scene(),
        found.model,
        FrameSeries.from_snapshots([found.snapshot()], ["punch", "die"]),
        histories,
    )["/history"]
    np.testing.assert_array_equal(written["history_sheet_time"], histories.sheet_time)
    whole = force_parts(written, 0, -1, len(histories.time) - 1)
    hourglass = histories.energy["hourglass"][-1]
    assert whole["hourglass_N"] == pytest.approx(hourglass / 6e-3) and hourglass > 0.0


def test_the_energy_that_the_pace_follows_is_that_of_the_sheet(found, monkeypatch):
    """External work less motion, damping and friction strains the sheet and its contacts."""
    seen = {}

    def noted(law, pace, mean_kinetic, **measured):
        seen.update(measured)
        return pace, mean_kinetic

    monkeypatch.setattr(simulation_module, "next_pace", noted)
    simulation = Simulation.from_scene(scene())
    simulation.restore(found.state)
    simulation._find_pace(found.model.pace, 1e-5)
    energy = found.energy()
    stored = energy["internal"] + energy["hourglass"] + energy["contact"]
    assert seen["stored"] == pytest.approx(stored, rel=2e-3)
    assert energy["friction"] > 0.01 * stored
    assert (seen["kinetic"], seen["duration"]) == (energy["kinetic"], 1e-5)


def test_a_pace_that_is_found_has_the_same_bits_after_a_restore_and_for_any_threads(found):
    time = found.model.process_time
    try:
        use_threads(2)
        simulation = bounded()
        simulation.advance_to(0.5 * time)
        kept = simulation.state.copy()
        simulation.advance_to(0.7 * time)
        simulation.restore(kept)
        simulation.advance_to(time)
        use_threads(1)
        straight = bounded()
        for until in (0.5 * time, time):
            straight.advance_to(until)
    finally:
        use_threads(available_threads())
    assert straight.state.counters[STEPS] == simulation.state.counters[STEPS]
    assert straight.state.clock[SHEET_TIME] > 1.1 * time  # the pace fell on the way
    for name, array in straight.state.as_dict().items():
        np.testing.assert_array_equal(array, getattr(simulation.state, name), err_msg=name)


def test_the_load_of_a_guided_tool_comes_on_in_a_part_of_the_process():
    holder = scene(more=HOLDER.replace("RAMP", "")).tools[2].motion
    assert holder.ramp == pytest.approx(0.05 * scene().process.time)
    at_once = scene(more=HOLDER.replace("RAMP", ', ramp = "0 s"')).tools[2].motion
    assert at_once.ramp == 0.0


def test_what_is_found_stands_among_the_values_used():
    found = scene(more=HOLDER.replace("RAMP", ""))
    used = dict(found.source.defaulted)
    time = found.process.time
    for key, value in (
        ("process.time", f"{time:.4g} s"),
        ("process.mass_damping", f"{DAMPING_TIMES_TIME / time:.4g} 1/s"),
        ("process.damping_average", f"{AVERAGING_PART * time:.4g} s"),
        ("tools.holder.motion.ramp", f"{0.05 * time:.4g} s"),
    ):
        assert used[key] == f"{value} (found from the sheet)"
    given = scene('time = "5 ms"', more=HOLDER.replace("RAMP", ""))
    assert dict(given.source.defaulted)["tools.holder.motion.ramp"] == "0 s"


# --- where a process has a time of its own --------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"motion": ', end = "5 ms"'}, 'tools[0] "punch".motion.end', "process.time is left out"),
        ({"motion": ', start = "5 ms"'}, 'tools[0] "punch".motion.start', "a time of the process"),
        (
            {"more": HOLDER.replace("RAMP", ', ramp = "5 ms"')},
            'tools[2] "holder".motion.ramp',
            "process.time is left out",
        ),
        (
            {"more": '[[pressure]]\nname = "bag"\nface = "top"\nvalue = "1 kPa"\nramp = "5 ms"'},
            "process.time",
            'pressure.0. "bag".ramp is a time of the process',
        ),
        (
            {"more": '[output]\nhistory_interval = "1 ms"'},
            "process.time",
            "output.history_interval is a time",
        ),
        (
            {"process": 'time = "5 ms", quasi_static = 2'},
            "process.quasi_static",
            "process.time says how slow",
        ),
    ],
)
def test_times_of_a_process_without_a_time_are_named(changes, key, words):
    with pytest.raises(InputError, match=words) as caught:
        scene(**changes)
    assert caught.value.key == key


def test_a_fluid_in_the_pores_has_a_time_of_its_own():
    with pytest.raises(InputError, match="a fluid acts in the pores") as caught:
        build_model(scene(), pore_pressure=True)
    assert caught.value.key == "process.time"
    assert build_model(scene('time = "5 ms"'), pore_pressure=True).pace is None


def test_weight_alone_has_a_time_of_its_own():
    text = SCENE.format(process="gravity = true", motion="", more="")
    fixed = text.replace(
        'motion = { type = "stroke", direction = [0, 0, -1], distance = "6 mm" }', ""
    )
    with pytest.raises(InputError, match="no tool has a stroke.*time = ") as caught:
        scene_from_text(fixed)
    assert caught.value.key == "process.time"
