"""Borders of stages: what comes to work, what leaves, and that no energy is lost on the way."""

from __future__ import annotations

import numpy as np
import pytest
from staged_strip import simulation_of, staged

from lcmchain.errors import SimulationError
from lcmchain.model import build_model
from lcmchain.solver.simulation import Simulation
from lcmchain.state import STAGE

MS = 1e-3


def balance(simulation):
    energy = simulation.energy()
    return energy["balance_error"], energy["contact"]


def test_two_stages_together_are_one_stroke():
    """The second one counts from the travel of the first, in time and in way."""
    half = "motions.punch={type='stroke', direction=[0,0,-1], distance='0.1 mm', profile='linear'}"
    two = simulation_of(
        "press", "hold", overrides=[f"stages.press.{half}", f"stages.hold.{half}",
                                    "stages.hold.time='4 ms'"],
    )  # fmt: skip
    stroke = "{type='stroke', direction=[0,0,-1], distance='0.2 mm', profile='linear'}"
    one = simulation_of(
        "press", overrides=[f"stages.press.motions.punch={stroke}", "stages.press.time='8 ms'"]
    )
    for simulation in (one, two):
        simulation.advance_to(4 * MS)
        simulation.advance_to(8 * MS)
    assert two.state.tool_travel[1] == pytest.approx(0.2e-3, rel=1e-12)
    assert two.state.step_count == one.state.step_count
    moved = np.abs(one.state.position - one.model.node_positions.T).max()
    assert moved > 1e-4
    assert np.abs(two.state.position - one.state.position).max() < 1e-9 * moved


def test_a_tool_that_leaves_takes_its_contact_energy_along():
    """Held for a while and then away at once: the balance stays, by the energy that was stored."""
    simulation = simulation_of("press", "hold", "release")
    simulation.advance_to(5 * MS)
    before, stored = balance(simulation)
    external = simulation.energy()["external"]
    assert stored > 1e-4
    simulation.advance_to(5.02 * MS)
    after, _ = balance(simulation)
    # half of the springs are the punch's; what those of the die give back stays in the balance
    assert external - simulation.energy()["external"] == pytest.approx(0.5 * stored, rel=0.02)
    assert abs(after - before) < 0.06 * stored
    assert np.all(simulation.state.tool_force[1] == 0.0) and not simulation.state.stick[1].any()
    assert simulation.state.tool_travel[1] == pytest.approx(0.2e-3)


def test_an_elastic_sheet_between_plates_returns_to_its_thickness():
    """Pressed, held, released to rest; all borders together leave the balance closed."""
    simulation = simulation_of("press", "hold", "release")
    simulation.advance_to(5 * MS)
    stored = simulation.energy()["internal"]
    mesh = simulation.model.only_body().mesh

    def thickness():
        lower, upper = mesh.elements[:, :4], mesh.elements[:, 4:]
        return (simulation.state.position[2, upper] - simulation.state.position[2, lower]).mean(1)

    assert thickness().max() < 0.87e-3
    simulation.advance_to(105 * MS)
    np.testing.assert_allclose(thickness(), mesh.thickness, rtol=2e-3)
    energy = simulation.energy()
    assert energy["internal"] < 1e-3 * stored
    assert abs(energy["balance_error"]) < 0.02 * stored


def test_a_tool_that_comes_to_work_inside_the_sheet_is_named():
    simulation = simulation_of("hold", "press", overrides=[
        "tools.punch.stages=['press']", "tools.punch.position='0 0 0.8 mm'"])  # fmt: skip
    with pytest.raises(SimulationError) as error:
        simulation.advance_to(2 * MS)
    message = str(error.value)
    assert 'the stage "press" cannot begin at 1.0000 ms' in message
    assert "punch reaches 0.204 mm into the sheet at (" in message
    # a touch within the tolerance is none
    simulation = simulation_of("hold", "press", overrides=[
        "tools.punch.stages=['press']", "tools.punch.position='0 0 1.0 mm'"])  # fmt: skip
    simulation.advance_to(1.1 * MS)
    assert simulation.state.tool_start[1] == pytest.approx([0.0, 4e-6], rel=1e-6)
    assert simulation.model.tools.initial_overlap[1] == pytest.approx(4e-6)


def test_a_guided_tool_presses_by_its_load_and_is_held_afterwards():
    """Its load comes on when its stage begins; the motion that it has at the end is booked."""
    simulation = simulation_of("hold", "weigh", "release")
    simulation.advance_to(1 * MS)
    assert simulation.state.tool_travel[2] == 0.0
    simulation.advance_to(1.2 * MS)
    assert 0.0 < simulation.state.tool_force[2, 2] < 0.5
    simulation.advance_to(5 * MS)
    weight = 2.0 + 0.01 * 9.81
    assert simulation.state.tool_force[2, 2] == pytest.approx(weight, rel=0.05)
    travel, before = simulation.state.tool_travel[2], balance(simulation)[0]
    stored = simulation.energy()["contact"] + simulation.energy()["internal"]
    simulation.advance_to(5.1 * MS)
    assert simulation.state.tool_travel[2] == travel and simulation.state.tool_velocity[2] == 0.0
    assert abs(balance(simulation)[0] - before) < 0.02 * stored


def test_a_gripper_grips_where_its_place_is_when_it_comes_to_work():
    """Its spring counts from there, its force comes on within a twentieth of its own stage."""
    simulation = simulation_of("press", "pull", "release", overrides=[
        "grippers.clamp.stages=['press', 'pull']", "tools.punch.stages=['after']",
        "stages.press.motions={clamp={type='stroke', direction=[1,0,0], distance='0.5 mm'}}",
        "stages.press.mass_damping='1000 1/s'",
    ])  # fmt: skip
    simulation.advance_to(4 * MS)
    assert not simulation.state.gripper_force.any()
    simulation.advance_to(4.1 * MS)
    assert 0.0 < simulation.state.gripper_force[0, 0] < 3.0
    simulation.advance_to(10 * MS)
    travel = simulation.state.gripper_travel[0, 0]
    assert simulation.state.gripper_force[0, 0] == pytest.approx(3.0 - 5e3 * travel, rel=1e-9)
    assert 2e-6 < travel < 0.1e-3  # not the way to where it grips
    before, work = balance(simulation)[0], simulation.state.gripper_work[0]
    simulation.advance_to(11 * MS)
    assert not simulation.state.gripper_force.any()
    assert abs(balance(simulation)[0] - before) < 0.01 * abs(work)


def test_a_clamp_leads_from_where_it_is_and_lets_go_at_a_border():
    simulation = simulation_of("hold", "press", "pull", "release", overrides=[
        "grippers.clamp.stages=['press', 'pull']", "tools.punch.stages=['hold']",
        "tools.punch.position='0 0 9 mm'", "tools.weight.position='0 0 9 mm'",
        "stages.press.motions={clamp={type='stroke', direction=[1,0,0], distance='0.5 mm'}}",
        "stages.pull.motions={clamp={type='stroke', direction=[1,0,0], distance='0.25 mm'}}",
    ])  # fmt: skip
    held = simulation.model.grips[0].nodes
    start = simulation.state.position[:, held].copy()
    assert simulation.state.free[:, held].all()
    simulation.advance_to(1.5 * MS)
    assert not simulation.state.free[:, held].any()
    simulation.advance_to(5 * MS)
    np.testing.assert_allclose(
        simulation.state.position[:, held] - start, [[0.5e-3], [0], [0]] * np.ones(held.size),
        atol=1e-9,
    )  # fmt: skip
    simulation.advance_to(11 * MS)
    np.testing.assert_allclose(
        simulation.state.position[0, held] - start[0], 0.75e-3, atol=1e-9
    )  # from where it was
    simulation.advance_to(12 * MS)
    assert simulation.state.free[:, held].all()
    assert simulation.energy()["balance_error"] == pytest.approx(
        0.0, abs=1e-3 * abs(simulation.energy()["external"])
    )


ALL = ("press", "hold", "pull", "release")


@pytest.fixture(scope="module")
def states():
    """States on the way through all stages, each with its time, and the last one."""
    simulation, found = simulation_of(*ALL), []
    for time in (2.0, 4.0, 4.5, 8.0, 11.0, 13.0):
        simulation.advance_to(time * MS)
        found.append(simulation.state.copy())
    return simulation.model.whole, found


def test_a_run_goes_on_from_any_stage_to_the_same_bits(states):
    model, found = states
    assert [int(state.counters[STAGE]) for state in found] == [0, 0, 1, 2, 2, 3]
    for number, state in enumerate(found[:-1]):
        simulation = Simulation(model, state.copy())
        simulation.restore(state)
        for later in found[number + 1 :]:
            simulation.advance_to(later.time)
        for name, array in found[-1].as_dict().items():
            assert np.array_equal(getattr(simulation.state, name), array), (number, name)


def test_a_rollback_across_a_border_takes_the_stage_back(states):
    model, found = states
    simulation = Simulation(model, found[0].copy())
    simulation.advance_to(4.5 * MS)
    assert simulation.model.present_stage.name == "hold"
    simulation.restore(found[0])
    assert simulation.model.present_stage.name == "press"
    simulation.advance_to(4 * MS)
    assert np.array_equal(simulation.state.position, found[1].position)


def test_pressures_count_from_when_they_come_to_work():
    """Tables of the stages alone; nothing runs."""
    tools = """
[[pressure]]
name = "bag"
face = "top"
value = "0.1 MPa"
stages = ["hold", "weigh"]

[[pressure]]
name = "film"
face = "bottom"
times = "0 1 ms"
values = "0 0.02 MPa"
"""
    model = build_model(staged("press", "hold", "weigh", "pull", tools=tools, overrides=[
        "stages.press.motions={}"]))  # fmt: skip
    press, hold, weigh, pull, _ = (stage.face_pressure for stage in model.stages)

    def at(table, time, side="top"):
        return float(np.interp(time, table.times, getattr(table, side)))

    assert at(press, 4e-3) == 0.0 and at(pull, 9.5e-3) == 0.0
    assert at(hold, 4e-3) == 0.0 and at(hold, 4.05e-3) == pytest.approx(0.05e6)
    assert at(hold, 5e-3) == at(weigh, 5e-3) == at(weigh, 9e-3) == pytest.approx(0.1e6)
    assert at(press, 0.5e-3, "bottom") == pytest.approx(0.01e6)
    assert at(pull, 12e-3, "bottom") == pytest.approx(0.02e6)
