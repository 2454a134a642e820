"""Grippers: their forces in closed form, what they take from the sheet, when they let go."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eigh

from lcmchain.check.remarks import scene_warnings
from lcmchain.effects.grippers import LEAST_DISTANCE, omega2_of_grippers
from lcmchain.effects.interaction import bound
from lcmchain.effects.switches import effects_of
from lcmchain.errors import InputError
from lcmchain.fields.loads import gripper_loads
from lcmchain.fields.saved import HISTORY_FIELDS, FrameSeries, Histories, history_dataset
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.scene.rungs import on_rung
from lcmchain.solver.simulation import Simulation

STRIP = """
process = { time = "20 ms", mass_damping = "0 1/s" }
blank = { size = ["60 mm", "20 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }

[[grippers]]
name = "led"
box = ["-30 -10 -1 mm", "-30 10 1 mm"]
hold = "xyz"
motion = { type = "stroke", direction = [-1, 0, 0], distance = "2 mm" }

[[grippers]]
name = "pull"
box = ["30 -10 -1 mm", "30 10 1 mm"]
force = "5 N"
stiffness = "5 N/mm"
direction = [1, 0, 0]
"""
DAMPED = 'process.mass_damping="1000 1/s"'
LENGTH, WIDTH = 60e-3, 20e-3


def without(*entries, text=STRIP):
    """Return the scene without the last lines of some entries."""
    lines = text.splitlines()
    for entry in entries:
        number = max(i for i, line in enumerate(lines) if line.startswith(f"{entry} ="))
        del lines[number]
    return "\n".join(lines)


def simulation_of(*overrides, text=STRIP):
    return Simulation(build_model(scene_from_text(text, overrides=overrides)))


def run(*overrides, text=STRIP):
    simulation = simulation_of(*overrides, text=text)
    simulation.advance_to(simulation.model.process_time)
    return simulation


def total_momentum(simulation):
    state = simulation.state
    return (simulation.model.nodes.mass * state.velocity).sum(axis=1)


def test_a_spring_in_series_with_a_strip():
    """F0 + k u with the way that is left of the stroke, the strip's own stretch taken off."""
    simulation = run(DAMPED)
    body = simulation.model.only_body()
    along = body.material.stress_and_tangent(np.zeros(6))[1][0, 0]
    strip = along * WIDTH * body.material.thickness / LENGTH
    force = simulation.state.gripper_force[0]
    assert force[0] == pytest.approx((5.0 + 5e3 * 2e-3) / (1.0 + 5e3 / strip), rel=5e-3)
    assert np.abs(force[1:]).max() == 0.0
    travel = simulation.state.gripper_travel[0, 0]
    assert force[0] == pytest.approx(5.0 - 5e3 * travel, rel=1e-12)


def test_the_loop_with_grippers_holds_no_array_after_its_steps(references):
    simulation = run(DAMPED)
    before = references(simulation)
    simulation.make_steps(5, 1e-8)
    assert references(simulation) == before


def test_its_force_is_limited_and_never_pushes():
    limited = run(DAMPED, 'grippers.pull.largest_force="8 N"')
    assert limited.state.gripper_force[0, 0] == 8.0
    pushed = run(DAMPED, "grippers.led.motion.direction=[1, 0, 0]")
    assert pushed.state.gripper_force[0, 0] == 0.0


def test_what_grippers_give_is_the_momentum_of_the_sheet():
    """Nothing else acts: both impulses together, to the last half of a step."""
    simulation = run()
    state = simulation.state
    given = state.gripper_impulse.sum(axis=0) + state.support_impulse.sum(axis=0)
    scale = np.abs(state.gripper_impulse).max()
    assert np.abs(given - total_momentum(simulation)).max() < 1e-9 * scale
    assert scale > 0.05


def test_a_weight_over_a_pulley_works_by_the_way_to_the_pulley():
    """A pull towards an anchor: its work is force times what the distance becomes shorter."""
    simulation = simulation_of(
        'grippers.pull.anchor="50 30 20 mm"', text=without("stiffness", "direction", "motion")
    )
    simulation.advance_to(2e-3)  # the force is all there
    grip = simulation.model.grips[1]

    def to_pulley():
        state = simulation.state
        # the forces are those of the positions before the last step
        before = state.position[:, grip.nodes] - state.last_step * state.velocity[:, grip.nodes]
        return [0.05, 0.03, 0.02] - before @ grip.weights

    start, work = np.linalg.norm(to_pulley()), simulation.state.gripper_work[0]
    simulation.advance_to(20e-3)
    gained, end = simulation.state.gripper_work[0] - work, np.linalg.norm(to_pulley())
    assert start - end > 1.5e-3
    assert gained == pytest.approx(5.0 * (start - end), rel=1e-5)  # it turns
    np.testing.assert_allclose(
        simulation.state.gripper_force[0], 5.0 * to_pulley() / end, rtol=1e-9
    )


def test_near_its_anchor_a_pull_falls_with_the_distance():
    simulation = simulation_of(
        'grippers.pull.anchor="50 0 0 mm"', text=without("stiffness", "direction", "motion")
    )
    grip = simulation.model.grips[1]
    simulation.state.position[0, grip.nodes] += 20e-3 - 0.5 * LEAST_DISTANCE * 20e-3
    simulation.state.clock[0] = 15e-3  # beyond the onset
    simulation._advance(1, 1e-12)
    assert simulation.state.gripper_force[0, 0] == pytest.approx(2.5, rel=1e-9)


@pytest.mark.parametrize(
    ("entry", "limit"),
    [("release_time", "12 ms"), ("release_force", "8 N"), ("release_travel", "0.5 mm")],
)
def test_a_gripper_lets_go_and_no_energy_is_lost(entry, limit):
    simulation = run(f'grippers.pull.{entry}="{limit}"')
    state = simulation.state
    assert 0.0 < state.gripper_let_go[0] < 20e-3
    if entry == "release_time":
        assert state.gripper_let_go[0] == pytest.approx(12e-3, rel=1e-3)
    if entry == "release_force":  # the stroke has brought it to 8 N, and its pull at the start is 5
        assert state.gripper_work[0] < 0.0
    assert not state.gripper_force.any()
    energy = simulation.energy()
    supplied = max(abs(energy["external"]), abs(state.gripper_work[0]))
    assert abs(energy["balance_error"]) < 2e-3 * supplied


def test_a_gripper_that_holds_lets_go_at_a_time_or_a_force():
    held = simulation_of('grippers.led.release_time="15 ms"')
    held.advance_to(14.9e-3)
    nodes = held.model.grips[0].nodes
    assert not held.state.free[:, nodes].any()
    assert np.linalg.norm(held.state.support_force[0]) > 5.0
    held.advance_to(20e-3)
    assert held.state.support_let_go[0] == pytest.approx(15e-3, rel=1e-3)
    assert held.state.free.all()
    assert not held.state.support_force.any()
    # only the spring acts now: it draws the strip away from where the stroke would have led it
    assert held.state.position[0, nodes].mean() > -30e-3 - 1.9e-3
    by_force = run('grippers.led.release_force="8 N"')
    assert 0.0 < by_force.state.support_let_go[0] < 20e-3


def test_state_holds_all_of_it():
    """A restored run, across the release of both grippers, ends with the same bits."""
    overrides = ('grippers.led.release_time="15 ms"', 'grippers.pull.release_force="12 N"')
    whole = simulation_of(*overrides)
    whole.advance_to(8e-3)
    middle = whole.state.copy()
    whole.advance_to(20e-3)
    other = simulation_of(*overrides)
    other.advance_to(20e-3)
    other.restore(middle)
    assert not other.state.free.all()
    other.advance_to(20e-3)
    for name, array in whole.state.as_dict().items():
        np.testing.assert_array_equal(getattr(other.state, name), array, err_msg=name)


def test_the_bound_is_that_of_the_springs():
    """ω² of springs on means, by the eigenvalues of M⁻¹K, for grippers that share nodes too."""
    text = (
        STRIP
        + """
[[grippers]]
name = "corner"
box = ["10 0 -1 mm", "30 10 1 mm"]
stiffness = "2 N/mm"
anchor = "80 0 0 mm"
"""
    )
    model = build_model(scene_from_text(text))
    table = model.grippers
    state = Simulation(model).state
    mass = np.tile(model.nodes.mass, (3, 1))
    K = np.zeros((mass.size, mass.size))
    for g, toward in enumerate([[1, 0, 0], table.anchor[1] - table.place[1]]):
        unit = np.array(toward) / np.linalg.norm(toward)
        weight = np.zeros(model.node_count)
        weight[model.grips[g + 1].nodes] = model.grips[g + 1].weights
        row = np.outer(unit, weight).ravel()
        K += table.stiffness[g] * np.outer(row, row)
    exact = eigh(K, np.diag(mass.ravel()), eigvals_only=True)[-1]
    found = omega2_of_grippers(table, state.gripper_travel, state.gripper_force)
    assert exact <= found < 1.5 * exact
    told = bound(table, model, state, 1e-6)
    assert (told.omega2, told.cause) == (found, "springs of grippers")


def test_a_stiff_spring_shortens_the_step_and_stays_stable():
    soft, stiff = simulation_of(), simulation_of('grippers.pull.stiffness="1e6 N/mm"')
    assert stiff.critical_step() < 0.7 * soft.critical_step()
    stiff.advance_to(3e-3)
    energy = stiff.energy()
    assert abs(energy["balance_error"]) < 0.01 * abs(energy["external"])


FRAME = """
process = { time = "20 ms" }
blank = { size = ["60 mm", "40 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }
[[grippers]]
name = "frame"
rim = true
count = 10
width = "20 mm"
outward = true
force = "2 N"
"""


def test_grippers_along_a_rim_pull_outward_and_evenly():
    model = build_model(scene_from_text(FRAME))
    assert [grip.name for grip in model.grips][::9] == ["frame-1", "frame-10"]
    for grip in model.grips:
        assert grip.weights.sum() == pytest.approx(1.0)
        assert np.linalg.norm(grip.direction) == pytest.approx(1.0)
        on_side = np.isclose(np.abs(model.node_positions[grip.nodes, :2]), [0.03, 0.02])
        if not on_side.all(axis=1).any():  # no corner of the blank
            (axis,) = on_side.any(axis=0).nonzero()[0]
            assert grip.direction[axis] == pytest.approx(np.sign(grip.place[axis]))
    places = np.array([grip.place for grip in model.grips])
    angles = np.unwrap(np.arctan2(places[:, 1], places[:, 0]))
    assert (np.diff(angles) > 0.0).all()  # one after the other around the blank
    directions = np.array([grip.direction for grip in model.grips])
    assert np.abs(directions.sum(axis=0)).max() < 1e-12
    assert (model.grippers.node[:-1] != model.grippers.node[1:]).all()


def test_a_stack_is_gripped_in_all_plies_or_in_one():
    text = """
process = { time = "1 ms" }
layup = "[0/90, 45/-45]"
blank = { size = ["60 mm", "40 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }
grippers = [{ name = "left", box = ["-30 -5 -9 mm", "-30 5 9 mm"], hold = "x" }]
"""
    scene = scene_from_text(text)
    lower, upper = build_model(scene).bodies
    (grip,) = build_model(scene).grips
    assert (grip.nodes < upper.first_node).any()
    assert (grip.nodes >= upper.first_node).any()
    of_one = scene_from_text(text, overrides=[f'grippers.left.ply="{upper.name}"'])
    (grip,) = build_model(of_one).grips
    assert (grip.nodes >= upper.first_node).all()
    with pytest.raises(InputError, match=r'there is no ply "top"; there is '):
        build_model(scene_from_text(text, overrides=['grippers.left.ply="top"']))


def test_histories_tell_force_travel_and_when_it_let_go():
    simulation = run(DAMPED, 'grippers.pull.release_time="19 ms"', 'output.history_interval="1 ms"')
    model, state = simulation.model, simulation.state
    histories = Histories.from_state(model, state)
    assert histories.gripper_names == ("led", "pull")
    led, pull = np.moveaxis(histories.gripper_force, 1, 0)
    travel = histories.gripper_travel
    assert travel[-1, 0, 0] == pytest.approx(-2e-3, rel=1e-9)
    assert pull[10, 0] == pytest.approx(5.0 - 5e3 * travel[9:11, 1, 0].mean(), rel=2e-3)
    assert led[17, 0] == pytest.approx(-pull[17, 0], rel=0.02)
    frames = FrameSeries.from_snapshots([simulation.snapshot()], model.tool_names)
    history = history_dataset(frames, histories)
    for name in ("force", "travel"):
        field = HISTORY_FIELDS[f"history_gripper_{name}"]
        for variable in field.variables:
            assert history[variable].dims == ("history_time", "gripper")
            assert history[variable].attrs["units"] == field.units
    loads = gripper_loads(history)
    assert loads["pull"]["let_go_s"] == pytest.approx(19e-3, rel=1e-3)
    assert loads["pull"]["force_end_N"] < 0.05 * loads["pull"]["force_max_N"]
    assert loads["led"]["force_max_N"] == pytest.approx(np.abs(led[:, 0]).max(), rel=1e-6)
    assert "let_go_s" not in loads["led"]


def test_check_tells_of_them():
    model = simulation_of().model
    told = {effect.name: effect.reason for effect in effects_of(model)}
    assert told["gripper pull"] == "pulls 6 nodes by 5 N and 5000 N/m"
    assert told["gripper led"] == "leads 6 nodes"
    warnings = scene_warnings(scene_from_text(STRIP))
    assert not [text for text in warnings if "nothing moves" in text]


def test_a_net_without_forces_drops_them():
    scene = scene_from_text(STRIP)
    assert on_rung(scene, "kinematic").source.left_out == ("grippers",)


TWIST = """
blank = { size = ["60 mm", "20 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }

[[grippers]]
name = "held"
box = ["30 -10 -1 mm", "30 10 1 mm"]
hold = "xyz"

[[grippers]]
name = "turned"
box = ["-30 -10 -1 mm", "-30 10 1 mm"]
hold = "xyz"
"""
ONE_TURN = 'motion = { type = "turn", axis = [2, 0, 0], point = "0 3 0 mm", angle = "%g deg" }'
TWO_TURNS = """
[[stages]]
name = "there"
time = "20 ms"
motions.turned = { type = "turn", axis = [1, 0, 0], point = "0 3 0 mm", angle = "25 deg" }

[[stages]]
name = "on"
time = "20 ms"
motions.turned = { type = "turn", axis = [1, 0, 0], point = "0 3 0 mm", angle = "15 deg" }
"""


def about_the_strip(points, degrees):
    """Points (3, n) turned about the line along x at y = 3 mm."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    y, z = points[1] - 3e-3, points[2]
    return np.array([points[0], 3e-3 + c * y - s * z, s * y + c * z])


def test_a_gripper_leads_by_a_turn():
    """The end of a strip on a screw's way without its pitch; its moment is the work."""
    process = 'process = { time = "20 ms", mass_damping = "0 1/s" }\n'
    simulation = simulation_of(text=process + TWIST + ONE_TURN % 40.0)
    start, nodes = simulation.state.position.copy(), simulation.model.grips[1].nodes
    simulation.advance_to(simulation.model.process_time)
    found = simulation.state.position[:, nodes]
    assert np.abs(found - about_the_strip(start[:, nodes], 40.0)).max() < 1e-9
    energy = simulation.energy()
    assert energy["external"] > 1e-4
    assert abs(energy["balance_error"]) < 1e-3 * energy["external"]


def test_turns_of_a_gripper_in_stages_go_on_from_each_other():
    process = 'process = { mass_damping = "100 1/s" }\n'
    simulation = simulation_of(text=process + TWIST + TWO_TURNS)
    start, nodes = simulation.state.position.copy(), simulation.model.grips[1].nodes
    for time, angle in ((20e-3, 25.0), (40e-3, 40.0)):
        simulation.advance_to(time)
        found = simulation.state.position[:, nodes]
        assert np.abs(found - about_the_strip(start[:, nodes], angle)).max() < 1e-9


@pytest.mark.parametrize(
    ("left_out", "overrides", "message"),
    [
        (
            (),
            ['grippers.pull.box=["90 0 0 mm", "99 1 1 mm"]'],
            r'grippers\[1\] "pull".box: no node',
        ),
        (("stiffness", "force"), [], "needs a force"),
        ((), ['grippers.pull.stiffness="-1 N/mm"'], "must not be negative"),
        ((), ['grippers.pull.anchor="0 0 9 mm"'], "has direction and anchor"),
        (("direction",), [], "has none"),
        ((), ['grippers.pull.largest_force="2 N"'], "below the force at the start"),
        ((), ['grippers.pull.hold="xyz"'], "hold is given"),
        ((), ['grippers.led.hold="xx"'], "directions once each"),
        ((), ['grippers.led.hold="z"'], 'leads the place, but hold is "z"'),
        ((), ['grippers.led.release_travel="1 mm"'], "belongs to a gripper that pulls"),
        ((), ['grippers.pull.release_time="20 ms"'], "not before the end of the process"),
        (("process",), ['grippers.pull.release_time="9 ms"'], "is a time of the process"),
        ((), ["grippers.pull.count=4"], "belongs to grippers along a rim"),
        (("box",), ['grippers.pull.set="LEFT"'], "a blank has none"),
        ((), ['grippers.pull.name="led"'], "led"),
        (("direction",), ['grippers.pull.anchor="31 0 0 mm"'], "1 mm from the middle of what is"),
        (
            ("direction",),
            ["grippers.pull.outward=true", 'grippers.pull.box=["-15 -5 -1 mm", "15 5 1 mm"]'],
            "lies inside the blank",
        ),
    ],
)
def test_wrong_entries_end_in_one_message(left_out, overrides, message):
    with pytest.raises(InputError, match=message):
        build_model(scene_from_text(without(*left_out), overrides=overrides))


@pytest.mark.parametrize(
    ("entry", "message"),
    [(["count=80"], "80 pieces of 20 mm do not fit"), (["count=3", 'width="1 mm"'], "has no node")],
)
def test_pieces_of_a_rim_fit(entry, message):
    overrides = [f"grippers.frame.{text}" for text in entry]
    with pytest.raises(InputError, match=message):
        build_model(scene_from_text(FRAME, overrides=overrides))


def test_a_polygon_names_a_place():
    by_box = build_model(scene_from_text(STRIP)).grips[1]
    text = STRIP.replace('box = ["30 -10 -1 mm", "30 10 1 mm"]', "polygon = [{}]".format(
        ", ".join(f'["{x} mm", "{y} mm"]' for x, y in ((29, -10), (31, -10), (31, 10), (29, 10)))
    ))  # fmt: skip
    by_polygon = build_model(scene_from_text(text)).grips[1]
    np.testing.assert_array_equal(by_polygon.nodes, by_box.nodes)
    crossed = text.replace(
        '["31 mm", "10 mm"], ["29 mm", "10 mm"]', '["29 mm", "10 mm"], ["31 mm", "10 mm"]'
    )
    with pytest.raises(InputError, match="crosses itself"):
        build_model(scene_from_text(crossed))


def test_area_weights():
    """Corner nodes have half the area of the others on an edge of equal elements."""
    grip = build_model(scene_from_text(STRIP)).grips[1]
    np.testing.assert_allclose(np.unique(grip.weights), [1 / 8, 1 / 4])
    assert math.isclose(grip.place[0], 30e-3)


def test_names_are_told_apart():
    text = FRAME + '\n[[grippers]]\nname = "frame-3"\npoint = "0 0 0 mm"\nhold = "z"\n'
    with pytest.raises(InputError, match='makes a second gripper "frame-3"'):
        build_model(scene_from_text(text))


@pytest.mark.parametrize(("face", "nodes"), [(None, 6), ("bottom", 3), ("top", 3)])
def test_a_gripper_may_hold_one_face_alone(face, nodes):
    """As a hinge: the sheet turns about the nodes of that face."""
    chosen = "" if face is None else f'face = "{face}"\n'
    text = STRIP.replace('hold = "xyz"\n', f'hold = "xyz"\n{chosen}')
    model = build_model(scene_from_text(text))
    held = model.grips[0].nodes
    assert held.size == nodes
    height = model.node_positions[held, 2]
    assert face is None or (np.sign(height) == (1 if face == "top" else -1)).all()
