"""A press that closes until its stop holds it, or until the sheet presses back with a force."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.check.tool_strokes import closing_tools
from lcmchain.errors import InputError
from lcmchain.fields.loads import tool_stops
from lcmchain.fields.saved import Histories
from lcmchain.judgements.contact import stop_warnings
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.state import STOPPED_TIME

MS = 1e-3
THICKNESS = 1.004e-3
GAP = 0.7e-3  # that the press force leaves, by the law [m]
STOP = 0.25e-3  # travel to a stop before that [m]
FAR = 6e-3  # travel in which the tool touches nothing [m]
PLATES = """
process = {{ {process} }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }}
material = {{ preset = "MD600" }}
contact = {{ depth = "zero" }}

[[tools]]
name = "lower"
shape = {{ type = "plate", side = "below" }}

[[tools]]
name = "upper"
shape = {{ type = "plate", side = "above" }}
position = "0 0 {height} mm"
motion = {motion}
"""
FULL = '{ type = "stroke", direction = [0, 0, -1], distance = "0.35 mm" }'
STAGED = """
[[stages]]
name = "close"
time = "20 ms"
motions.upper = {close}

[[stages]]
name = "hold"
time = "2 ms"

[[stages]]
name = "open"
time = "4 ms"
motions.upper = {{ type = "stroke", direction = [0, 0, 1], distance = "0.2 mm" }}
"""


def plates(motion='{ type = "fixed" }', height=1.004, process='time = "20 ms"', stages=""):
    text = PLATES.format(motion=motion, height=height, process=process) + stages
    return Simulation.from_scene(scene_from_text(text))


def guided(stop=None, force=None, damping=500.0):
    held = "" if stop is None else f', stop = "{1e3 * stop} mm"'
    return (
        f'{{ type = "guided", direction = [0, 0, -1], force = "{force or press_force()} N", '
        f'mass = "0.1 kg", gravity = false, damping = "{damping} N*s/m", ramp = "10 ms"{held} }}'
    )


def stroke(force, distance=0.35e-3):
    return (
        f'{{ type = "stroke", direction = [0, 0, -1], distance = "{1e3 * distance} mm", '
        f'until_force = "{force} N" }}'
    )


def of_law(gap):
    """Force of the sheet at a gap [m], by its law [N]."""
    law = plates().model.only_body("a test").material
    return float(law.compaction_pressure(gap / THICKNESS)) * 400e-6


def press_force():
    return of_law(GAP)


@pytest.fixture(scope="module")
def stopped():
    """Press at its stop, and its state while the load was still growing there."""
    simulation = plates(guided(STOP))
    simulation.advance_to(12 * MS)
    between = simulation.state.copy()
    simulation.advance_to(20 * MS)
    return simulation, between


def test_a_stop_beyond_reach_changes_no_bit():
    """And the press force alone closes the plates to the gap of the law."""
    free, far = plates(guided()), plates(guided(0.5e-3))
    for simulation in (free, far):
        simulation.advance_to(20 * MS)
    np.testing.assert_array_equal(free.state.position, far.state.position)
    assert far.state.tool_travel[1] == free.state.tool_travel[1]
    assert far.energy() == free.energy()
    assert THICKNESS - far.state.tool_travel[1] == pytest.approx(GAP, rel=5e-3)
    assert tool_stops(far.model, far.state) == {} and not far.state.tool_stop_impulse.any()


def test_a_stop_that_is_reached_first_holds_the_gap_and_takes_the_rest_of_the_force(stopped):
    simulation, _ = stopped
    state = simulation.state
    assert state.tool_travel[1] == pytest.approx(STOP, abs=1e-15)
    assert np.ptp(state.position[2]) == pytest.approx(THICKNESS - STOP, rel=1e-3)
    sheet, press = state.tool_force[1, 2], press_force()
    assert sheet == pytest.approx(of_law(THICKNESS - STOP), rel=0.02)
    assert 0.1 * press < state.tool_stop_force[1] < 0.9 * press
    assert sheet + state.tool_stop_force[1] == pytest.approx(press, rel=1e-9)
    assert state.tool_stop_force[0] == 0.0


def test_the_balance_holds_over_the_stop(stopped):
    simulation, _ = stopped
    energy = simulation.energy()
    assert abs(energy["balance_error"]) < 1e-3 * energy["external"]
    # at rest: what the press has done is in the sheet and in the damper
    kept = energy["internal"] + energy["hourglass"] + energy["contact"] + energy["damping"]
    assert energy["external"] == pytest.approx(kept, rel=2e-3)


def test_a_tool_that_falls_on_its_stop_loses_its_motion_and_no_energy_is_left():
    """The sheet is far away: all that the press has put in was motion and the damper's."""
    simulation = plates(guided(0.5 * FAR, force=6.0, damping=5.0), height=1.004 + 1e3 * FAR)
    while simulation.state.tool_travel[1] < 0.4 * FAR:
        simulation.advance_to(simulation.time + 0.1 * MS)
    moving = simulation.energy()
    assert moving["kinetic"] > 0.1 * moving["external"]
    assert moving["balance_error"] == pytest.approx(0.0, abs=1e-3 * moving["external"])
    simulation.advance_to(20 * MS)
    energy = simulation.energy()
    assert simulation.state.tool_travel[1] == pytest.approx(0.5 * FAR, rel=1e-12)
    assert energy["kinetic"] < 1e-12 * energy["damping"]
    assert energy["balance_error"] == pytest.approx(0.0, abs=1e-9 * moving["external"])
    assert energy["external"] == pytest.approx(energy["damping"], rel=1e-9)
    # all the load over the time is what the stop and the damper took: nothing moves at the end
    load = 6.0 * (20 * MS - 10 * MS / 2)
    taken = simulation.state.tool_stop_impulse[1] + 5.0 * 0.5 * FAR
    assert taken == pytest.approx(load, rel=1e-3)


def test_a_run_goes_on_at_its_stop_bit_for_bit(stopped):
    simulation, between = stopped
    assert between.tool_stopped[1, 0, STOPPED_TIME] < 12 * MS
    again = plates(guided(STOP))
    again.restore(between)
    again.advance_to(20 * MS)
    for name in again.state.names():
        np.testing.assert_array_equal(getattr(again.state, name), getattr(simulation.state, name))


def test_histories_and_summary_tell_of_the_stop(stopped):
    simulation, _ = stopped
    (stop,) = tool_stops(simulation.model, simulation.state)["tool_stops"]["upper"]
    assert stop["travel_m"] == pytest.approx(STOP, rel=0.05)
    assert 1 * MS < stop["time_s"] < 19 * MS
    histories = Histories.from_state(simulation.model, simulation.state)
    before = histories.time < stop["time_s"] - MS
    force = histories.tool_stop_force[:, 1]
    assert before.any() and not force[before].any()
    assert force[-1] == pytest.approx(simulation.state.tool_stop_force[1], rel=1e-3)


def test_a_stroke_ends_where_the_sheet_presses_back_with_its_force():
    """Then the tool stays, whatever way is left of its stroke."""
    simulation = plates(stroke(press_force()))
    simulation.advance_to(20 * MS)
    state = simulation.state
    (stop,) = tool_stops(simulation.model, state)["tool_stops"]["upper"]
    assert state.tool_travel[1] == stop["travel_m"] < 0.345e-3
    assert THICKNESS - stop["travel_m"] == pytest.approx(GAP, rel=5e-3)
    # the depths of the nodes still go to zero behind it, and the force grows to that of the gap
    assert press_force() <= state.tool_force[1, 2] < 1.04 * press_force()
    assert state.tool_force[1, 2] == pytest.approx(of_law(THICKNESS - stop["travel_m"]), rel=0.02)
    assert state.tool_velocity[1] == 0.0
    energy = simulation.energy()
    assert abs(energy["balance_error"]) < 1e-3 * energy["internal"]
    assert list(stop_warnings(simulation.model, state)) == []


def test_a_force_that_never_comes_is_told():
    simulation = plates(stroke(10.0 * press_force()))
    simulation.advance_to(20 * MS)
    assert simulation.state.tool_travel[1] == pytest.approx(0.35e-3, rel=1e-12)
    (told,) = stop_warnings(simulation.model, simulation.state)
    assert "upper went its whole stroke of 0.35 mm" in told and "tools.upper.motion" in told


def test_stages_count_from_where_a_force_has_stopped_the_tool():
    simulation = plates(process="", stages=STAGED.format(close=stroke(press_force())))
    simulation.advance_to(20 * MS)
    closed = float(simulation.state.tool_travel[1])
    assert THICKNESS - closed == pytest.approx(GAP, rel=5e-3)
    simulation.advance_to(22 * MS)
    assert simulation.state.tool_travel[1] == closed
    simulation.advance_to(26 * MS)
    assert simulation.state.tool_travel[1] == pytest.approx(closed - 0.2e-3, rel=1e-9)
    (stop,) = tool_stops(simulation.model, simulation.state)["tool_stops"]["upper"]
    assert stop["stage"] == "close" and stop["travel_m"] == closed


def test_a_stop_stays_where_it_is_over_the_stages_of_a_tool():
    """One whose load goes on: the stop counts from where it came to work."""
    stages = '[[stages]]\nname = "one"\ntime = "10 ms"\n[[stages]]\nname = "two"\ntime = "10 ms"\n'
    simulation = plates(guided(STOP), process="", stages=stages)
    simulation.advance_to(10 * MS)
    assert simulation.state.tool_travel[1] > 0.2 * STOP
    simulation.advance_to(20 * MS)
    assert simulation.state.tool_travel[1] == pytest.approx(STOP, abs=1e-15)
    # against the first direction of travel as well
    back = guided(0.1e-3).replace("[0, 0, -1]", "[0, 0, 1]")
    simulation = plates(process="", stages=STAGED.format(close=stroke(press_force())).replace(
        '{ type = "stroke", direction = [0, 0, 1], distance = "0.2 mm" }', back))  # fmt: skip
    simulation.advance_to(22 * MS)
    closed = float(simulation.state.tool_travel[1])
    simulation.advance_to(26 * MS)
    assert simulation.state.tool_travel[1] == pytest.approx(closed - 0.1e-3, rel=1e-9)
    assert simulation.state.tool_stop_force[1] < 0.0


def test_how_far_a_force_lets_a_tool_go_is_not_known_beforehand():
    """So that a stroke through the other tool is no error of ``check``."""
    for motion, count in ((stroke(1.0, distance=2e-3), 0), (FULL, 1)):
        scene = scene_from_text(PLATES.format(motion=motion, height=1.004, process='time = "1 s"'))
        model = plates(motion).model
        meshes = [body.mesh for body in model.bodies]
        assert len(closing_tools(scene, meshes, model)) == count


def test_a_gripper_has_no_force_that_ends_its_stroke():
    gripper = f'\n[[grippers]]\nname = "clamp"\nrim = true\nhold = "xyz"\nmotion = {stroke(1.0)}\n'
    text = PLATES.format(motion='{ type = "fixed" }', height=1.004, process='time = "1 s"')
    with pytest.raises(InputError, match=r"clamp.*until_force.*release_force"):
        scene_from_text(text + gripper)
