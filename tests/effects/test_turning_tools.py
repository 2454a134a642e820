"""Tools that turn about an axis: where they are, what they do to the sheet, and its moment."""

from __future__ import annotations

import math
import zipfile

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from lcmchain.check.tool_strokes import closing_tools, require_space, tools_out_of_reach
from lcmchain.errors import InputError
from lcmchain.fields.dataset import model_datasets
from lcmchain.fields.saved import FrameSeries, Histories, history_dataset, tool_places
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.conduct import Status
from lcmchain.fmu.forming.variables import MEANS, variables_of
from lcmchain.fmu.instances import open_unit
from lcmchain.model import build_model
from lcmchain.report.html import tool_data
from lcmchain.scene import read_scene, scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.tools.distance import gaps, signed_distance
from lcmchain.tools.table import build_tool_table, placed, placement, turning
from lcmchain.tools.tool import Tool

MS = 1e-3
FRICTION = 0.3
SHEET = """
process = {{ {process} }}
blank = {{ size = [{size}], edge_length = "10 mm", height = "0.502 mm", \
fibre_angle = "{fibres} deg" }}
material = {{ preset = "MD600" }}
contact = {{ friction = {friction}, depth = "free", penalty = "10 N/mm^3" }}

[[tools]]
name = "wing"
shape = {{ type = "plate", side = "below" }}
position = "0 0 {height} mm"
motion = {motion}

[[grippers]]
name = "clamp"
box = {box}
hold = "{hold}"
"""
FOLD = 30.0  # [degrees]


def turn(axis, angle, point="0 0 0 mm", **others):
    text = "".join(f', {name} = "{value}"' for name, value in others.items())
    return f'{{ type = "turn", axis = {axis}, point = "{point}", angle = "{angle} deg"{text} }}'


def text_of(
    motion, *, along="x", hold="xyz", friction=0.0, gravity="true", stages="", more="", box=None,
    time="100 ms", height=0.0,
):  # fmt: skip
    """A strip along an axis, clamped where that is negative, on a plate."""
    size = '"80 mm", "20 mm"' if along == "x" else '"20 mm", "80 mm"'
    held = {"x": '["-50 -20 -1 mm", "0 20 2 mm"]', "y": '["-20 -50 -1 mm", "20 0 2 mm"]'}[along]
    process = f'gravity = {gravity}, mass_damping = "300 1/s"'
    process += "" if stages else f', time = "{time}", frames = 21'
    return SHEET.format(
        process=process, size=size, fibres=0 if along == "x" else 90, friction=friction,
        motion=motion, hold=hold, box=box or held, height=height,
    ) + stages + more  # fmt: skip


def sheet(motion, **others):
    return Simulation.from_scene(scene_from_text(text_of(motion, **others)))


@pytest.fixture(scope="module")
def folded():
    """A strip that a wing has folded up, with moment and angle after every twentieth of it."""
    simulation = sheet(turn([0, 1, 0], -FOLD))
    return simulation, followed(simulation)


def followed(simulation, count=200):
    course = []
    for time in np.linspace(0.0, 100 * MS, count + 1)[1:]:
        simulation.advance_to(float(time))
        state = simulation.state
        course.append([state.tool_travel[0], state.tool_moment[0], state.tool_work[0]])
    return np.array(course)


SHAPES = {
    "plate": {"type": "plate", "side": "below"},
    "ball": {"type": "sphere_capped_punch", "radius": "25 mm"},
    "profile": {
        "type": "extruded_profile", "solid": "right", "fillet_radii": "0 5 5 0 mm",
        "points": [["-60 mm", "0 mm"], ["-20 mm", "0 mm"], ["0 mm", "15 mm"], ["60 mm", "15 mm"]],
    },
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
def test_a_turned_tool_is_the_tool_placed_there(name, tmp_path):
    """Distances and normals: those of the start, at points that are turned back."""
    motion = {"type": "turn", "axis": (0.3, -1.0, 0.4), "point": (0.01, -0.02, 0.03), "angle": 0.8}
    place = {"name": "t", "shape": SHAPES[name], "position": (0.02, 0.01, 0.0), "axis": (0, 0.2, 1)}
    still = {"name": "s", "shape": SHAPES[name]}
    tools = [Tool.model_validate({**place, "motion": motion}), Tool.model_validate(place),
             Tool.model_validate(still)]  # fmt: skip
    table = build_tool_table(tools, tmp_path, 1.0)
    points = np.random.default_rng(1).uniform(-0.05, 0.05, (50, 3))
    angle = 0.8
    there = placed(table, 0, points, angle)
    assert np.linalg.norm(there - points, axis=1).max() > 0.02
    np.testing.assert_allclose(
        gaps(table, 0, there, angle), gaps(table, 1, points, 0.0), atol=1e-12
    )
    for point, turned_point in zip(points[:5], there):
        normal = signed_distance(table, 1, *point, 0.0)[1:]
        tip = placed(table, 0, np.array([point + normal]), angle)[0]
        found = signed_distance(table, 0, *turned_point, angle)[1:]
        np.testing.assert_allclose(found, tip - turned_point, atol=1e-12)
    # the others of the same table go along their direction
    alone = build_tool_table(tools[2:], tmp_path, 1.0)
    np.testing.assert_array_equal(gaps(table, 2, points, 0.01), gaps(alone, 0, points, 0.01))
    np.testing.assert_array_equal(placed(table, 2, points, 0.01), points + [0.0, 0.0, 0.01])


def test_a_wing_folds_a_strip(folded):
    """Its free part lies on the wing, at the angle of the wing."""
    simulation, course = folded
    assert simulation.state.tool_travel[0] == pytest.approx(-math.radians(FOLD), rel=1e-12)
    position = simulation.state.position
    end = simulation.model.node_positions[:, 0] > 0.0399
    x, z = position[0, end], position[2, end]
    gap = gaps(simulation.model.tools, 0, position.T, float(simulation.state.tool_travel[0]))
    assert np.abs(gap[end].min()) < 0.2e-3
    assert math.degrees(math.atan2(z.mean(), x.mean())) == pytest.approx(FOLD, abs=3.0)
    # a moment that bends it, against the turn
    assert course[-1, 1] > 0.0


def test_the_work_of_a_wing_is_its_moment_over_its_angle(folded):
    simulation, course = folded
    angle, moment, work = course.T
    by_moment = np.sum(0.5 * (moment[1:] + moment[:-1]) * -np.diff(angle))
    by_moment += -0.5 * moment[0] * angle[0]
    assert work[-1] > 0.0
    assert by_moment == pytest.approx(work[-1], rel=0.02)
    energy = simulation.energy()
    assert abs(energy["balance_error"]) < 5e-3 * energy["external"]


def test_a_wing_about_another_axis_does_the_same(folded):
    """The strip lies along y, and the axis along x: everything is turned by a right angle."""
    simulation, course = folded
    other = sheet(turn([2, 0, 0], FOLD), along="y")
    again = followed(other)
    np.testing.assert_allclose(again, course * [-1.0, -1.0, 1.0], rtol=1e-6, atol=1e-9)
    height = np.sort(simulation.state.position[2])
    np.testing.assert_allclose(np.sort(other.state.position[2]), height, atol=1e-8)


def test_a_spinning_plate_drags_by_its_friction_times_the_arms():
    """Under a sheet that cannot follow: M = μ Σ N r, and the work goes into friction."""
    everywhere = '["-50 -20 -1 mm", "50 20 2 mm"]'
    simulation = sheet(
        turn([0, 0, 1], 40.0, point="10 5 0 mm", profile="linear"), hold="xy", box=everywhere,
        friction=FRICTION,
    )  # fmt: skip
    simulation.advance_to(100 * MS)
    state = simulation.state
    arm = np.hypot(state.position[0] - 0.01, state.position[1] - 0.005)
    dragged = FRICTION * float(np.sum(state.contact_force * arm))
    assert dragged > 0.0
    assert state.tool_moment[0] == pytest.approx(-dragged, rel=0.02)
    energy = simulation.energy()
    assert state.tool_work[0] == pytest.approx(energy["friction"], rel=0.02)


def test_histories_have_angle_and_moment(folded):
    """The mean moment of an interval is its impulse over the interval; a turn is no travel."""
    simulation, course = folded
    histories = Histories.from_state(simulation.model, simulation.state)
    assert not histories.tool_travel.any()
    assert histories.tool_angle[-1, 0] == pytest.approx(-math.radians(FOLD), rel=1e-9)
    every = len(course) // len(histories.time)
    means = course[:, 1].reshape(-1, every).mean(axis=1)
    np.testing.assert_allclose(histories.tool_moment[5:, 0], means[5:], rtol=0.1, atol=2e-4)
    frames = FrameSeries.from_snapshots([simulation.snapshot()], ("wing",))
    frames.tool_turns = turning(simulation.model.tools)
    history = history_dataset(frames, histories)
    assert history["tool_travel"].values[0, 0] == 0.0
    assert tool_places(history)[0, 0] == simulation.state.tool_travel[0]
    assert history["history_tool_moment"].attrs["units"] == "N m"


def test_the_view_of_the_report_turns_the_tool(folded):
    simulation, _ = folded
    scene, start = scene_from_text(text_of(turn([0, 1, 0], -FOLD))), sheet(turn([0, 1, 0], -FOLD))
    frames = FrameSeries.from_snapshots([start.snapshot(), simulation.snapshot()], ("wing",))
    groups = model_datasets(scene, simulation.model, frames)
    (view,) = tool_data(scene, groups["/"], groups["/history"])
    for frame, angle in enumerate((0.0, -math.radians(FOLD))):
        rotation, shift = placement(simulation.model.tools, 0, angle)
        np.testing.assert_allclose(np.reshape(view["turn"][frame], (3, 3)), rotation, atol=1e-6)
        np.testing.assert_allclose(view["shift"][frame], 1e3 * shift, atol=1e-4)


STAGES = """
[[stages]]
name = "up"
time = "20 ms"
motions.wing = {up}

[[stages]]
name = "wait"
time = "5 ms"

[[stages]]
name = "back"
time = "20 ms"
motions.wing = {back}
"""


def test_turns_of_stages_add_up_and_a_run_goes_on_bit_for_bit():
    """From where the wing stands; what is turned back is a negative angle."""
    stages = STAGES.format(up=turn([0, 1, 0], -20.0), back=turn([0, 1, 0], 15.0))
    simulation = sheet('{ type = "fixed" }', stages=stages)
    simulation.advance_to(22 * MS)
    assert simulation.state.tool_travel[0] == pytest.approx(-math.radians(20.0), rel=1e-12)
    between = simulation.state.copy()
    simulation.advance_to(45 * MS)
    assert simulation.state.tool_travel[0] == pytest.approx(-math.radians(5.0), rel=1e-9)
    again = sheet('{ type = "fixed" }', stages=stages)
    again.restore(between)
    again.advance_to(45 * MS)
    for name in again.state.names():
        np.testing.assert_array_equal(getattr(again.state, name), getattr(simulation.state, name))


@pytest.mark.parametrize(
    ("motion", "stages", "said"),
    [
        (turn([0, 1, 0], 0.0), "", "wing.*angle.*is 0"),
        (turn([0, 0, 0], 1.0), "", "wing.*axis.*no direction"),
        (turn([0, 1, 0], 1.0), STAGES.format(up=turn([0, 1, 0], 1), back=turn([0, 1, 0], 1)),
         "wing.*is a turn, but the scene has stages"),
        ('{ type = "fixed" }', STAGES.format(up=turn([0, 1, 0], 1), back=turn([1, 0, 0], 1)),
         "stages.back.motions.wing.axis.*another axis"),
        ('{ type = "fixed" }', STAGES.format(up=turn([0, 1, 0], 1),
         back='{ type = "stroke", direction = [0, 0, 1], distance = "1 mm" }'),
         "stages.back.motions.wing.type.*in stages.up it turns"),
    ],
)  # fmt: skip
def test_turns_that_are_none_are_named(motion, stages, said):
    with pytest.raises(InputError, match=said):
        sheet(motion, stages=stages)


UPPER = """
[[tools]]
name = "upper"
shape = { type = "plate", side = "above" }
position = "0 0 1.004 mm"
"""


@pytest.mark.parametrize(("angle", "closed"), [(-0.5, False), (-3.0, True), (3.0, True)])
def test_a_wing_that_turns_into_another_tool_is_found(angle, closed):
    """40 mm from the hinge 0.5 degrees are 0.35 mm, 3 degrees two thicknesses."""
    simulation = sheet(turn([0, 1, 0], angle), more=UPPER)
    model = simulation.model
    scene = scene_from_text(text_of(turn([0, 1, 0], angle), more=UPPER))
    (closing,) = closing_tools(scene, [body.mesh for body in model.bodies], model)
    lost = 40e-3 * math.tan(math.radians(abs(angle)))
    assert closing.closest.gap == pytest.approx(1.004e-3 - lost, abs=2e-5)
    assert (closing.closest.gap < 0.0) == closed
    if closed:
        with pytest.raises(InputError, match=f"wing at an angle of {angle:g} degrees"):
            require_space(scene, model, [closing])


def test_a_wing_that_reaches_no_blank_is_named():
    """9 mm below it, 40 mm from the hinge: 12.7 degrees are needed."""
    for angle, touches in ((-12.0, False), (-13.5, True)):
        scene = scene_from_text(text_of(turn([0, 1, 0], angle), gravity="false", height=-9.0))
        told = tools_out_of_reach(scene, build_model(scene))
        assert told == [] if touches else "tools.wing.motion.angle" in told[0]


def test_the_unit_of_a_wing_speaks_of_angle_and_moment(tmp_path):
    path = tmp_path / "wing.toml"
    path.write_text(text_of(turn([0, 1, 0], -FOLD)), encoding="utf-8")
    by_name = {v.name: v for v in variables_of(read_scene(path))}
    units = {name: by_name[f"wing.{name}"].unit for name in ("angle", "angular_velocity", "moment")}
    assert units == {"angle": "rad", "angular_velocity": "rad/s", "moment": "N.m"}
    assert by_name["wing.position_input"].unit == "rad" and "wing.travel" not in by_name
    for fmi in (2, 3):
        built = build_fmu(path, tmp_path / f"wing{fmi}.fmu", fmi=fmi)
        assert validate_fmu(str(built)) == []
    with zipfile.ZipFile(built) as archive:
        archive.extractall(tmp_path / "unit")
    unit = open_unit(str(tmp_path / "unit" / "resources"), "wing", print, arrays=True)
    unit.set_up(0.0)
    unit.enter_initialization()
    unit.exit_initialization()
    state, impulses = unit.part.simulation.state, [0.0]
    for k in range(2):
        assert unit.step(k * 2 * MS, 2 * MS) is Status.OK
        impulses.append(float(state.tool_moment_impulse[0]))
    grown = impulses[2] - impulses[1]
    assert unit.part.outputs(MEANS)["wing.mean_moment"] == pytest.approx(grown / (2 * MS))
    assert grown != 0.0
