"""Loads of the tools are summed over all steps, and histories follow from the sums."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries, Histories, model_datasets, read_group, write_forming_netcdf
from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.loads import (
    TAKEN_UP,
    SmoothCourse,
    _around,
    _end_of_stroke,
    exceeded_over,
    figure_to_quote,
    force_parts,
    force_uncertainty,
    quoted_force,
    smooth_force,
    snaps,
    snaps_text,
    tool_loads,
)
from lcmchain.fields.saved import HISTORY_FIELDS
from lcmchain.fields.sheet import edge_length, largest_turn
from lcmchain.fields.summary import field_summary
from lcmchain.mesh.hexahedron import largest_ripple
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.state import PEAK_FORCE, PEAK_TIME, SAMPLE_COLUMNS, SAMPLES

TIME = 4e-3
SCENE = """
title = "dent"
element = "membrane-shell"
process = {{ time = "4 ms", frames = 3, mass_damping = "100 1/s" }}
output = {{ history_interval = "{interval} ms" }}
blank = {{ size = ["40 mm", "40 mm"], edge_length = "5 mm", height = "0.502 mm" }}
material = {{ preset = "MD600" }}
contact = {{ friction = 0.2 }}

[[tools]]
name = "punch"
shape = {{ type = "sphere_capped_punch", radius = "20 mm" }}
position = "0 0 1.004 mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "2 mm" }}

[[tools]]
name = "die"
shape = {{ type = "plate_with_hole", hole_radius = "15 mm", fillet_radius = "3mm", side = "below" }}
"""


def scene(interval=0.4):
    return scene_from_text(SCENE.format(interval=interval))


def formed(interval=0.4, times=(TIME,)):
    simulation = Simulation.from_scene(scene(interval))
    for time in times:
        simulation.advance_to(time)
    return simulation


@pytest.fixture(scope="module")
def simulation():
    return formed()


@pytest.fixture(scope="module")
def histories(simulation):
    return Histories.from_state(simulation.model, simulation.state)


@pytest.fixture(scope="module")
def datasets(simulation, histories):
    frames = FrameSeries.from_snapshots([simulation.snapshot()], simulation.model.tool_names)
    return model_datasets(scene(), simulation.model, frames, histories)


@pytest.fixture(scope="module")
def history(datasets):
    return datasets[HISTORY]


# --- sums over steps ------------------------------------------------------------------------------


def test_impulse_work_and_peak_are_those_of_all_steps():
    sim = Simulation.from_scene(scene(interval=100.0))
    longest = 0.8 * sim.prepare_steps()
    impulse, work, peak = np.zeros((2, 3)), np.zeros(2), np.zeros((2, 2))
    travel, way = np.zeros(2), np.zeros(2)
    for step in range(300):
        before, now = sim.state.last_step, sim.time
        dt = longest * (0.7 if step % 3 else 1.0)
        if step % 50 == 0:
            sim.prepare_steps()
        sim.make_steps(1, dt)
        force = sim.state.tool_force
        impulse += force * 0.5 * (before + dt)
        last_way, way = way, sim.state.tool_travel - travel
        travel = sim.state.tool_travel.copy()
        along = np.sum(force * sim.model.tools.direction, axis=1)
        work -= along * 0.5 * (last_way + way)
        size = np.linalg.norm(force, axis=1)
        peak = np.where((size > peak[:, 0])[:, None], np.c_[size, 0.0 * size + now], peak)
    assert peak[0, 0] > 0.01
    np.testing.assert_allclose(sim.state.tool_impulse, impulse, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(sim.state.tool_work, work, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(sim.state.tool_peak[:, PEAK_FORCE], peak[:, 0], rtol=1e-12)
    np.testing.assert_allclose(sim.state.tool_peak[:, PEAK_TIME], peak[:, 1], rtol=1e-9)


def test_the_work_of_driven_tools_is_the_external_work(simulation):
    assert simulation.state.tool_work[1] == 0.0
    assert simulation.state.tool_work[0] == pytest.approx(simulation.energy()["external"], 1e-12)


# --- samples --------------------------------------------------------------------------------------


def test_samples_lie_at_the_steps_nearest_to_multiples_of_the_interval(simulation, histories):
    assert histories.time.size == simulation.state.counters[SAMPLES] == 10
    away = np.abs(histories.time - 0.4e-3 * np.arange(1, 11))
    assert away.max() <= 0.51 * simulation.control.step
    assert histories.time[-1] == pytest.approx(TIME, rel=1e-12)


@pytest.mark.parametrize("interval", [0.11, 100.0])
def test_samples_change_no_step(simulation, interval):
    other = formed(interval)
    for name in ("position", "velocity", "tool_impulse", "tool_work", "work", "clock"):
        assert getattr(other.state, name).tobytes() == getattr(simulation.state, name).tobytes()
    assert other.state.counters[SAMPLES] == {0.11: 37, 100.0: 1}[interval]


def test_samples_do_not_depend_on_who_asks_for_which_times(histories):
    """Frames and communication points between the samples change the steps, not what is sampled."""
    sim = formed(times=(0.3e-3, 1.7e-3, TIME))
    other = Histories.from_state(sim.model, sim.state)
    assert other.time.size == histories.time.size
    np.testing.assert_allclose(other.tool_travel, histories.tool_travel, atol=5e-6)


def test_an_interval_below_the_step_samples_every_step():
    sim = formed(interval=4.0 / 9000)
    assert sim.state.counters[SAMPLES] == sim.state.step_count < 9000


def test_a_rollback_takes_the_samples_back(simulation):
    sim = Simulation.from_scene(scene())
    sim.advance_to(1.9e-3)
    saved = sim.state.copy()
    assert saved.counters[SAMPLES] == 4
    sim.advance_to(3e-3)
    sim.restore(saved)
    assert sim.state.samples.tobytes() == saved.samples.tobytes()
    sim.advance_to(3e-3)
    once = formed(times=(1.9e-3, 3e-3))
    assert sim.state.samples.tobytes() == once.state.samples.tobytes()


def test_intervals_that_give_too_many_samples_are_refused():
    with pytest.raises(InputError, match="output.history_interval.*100,000 samples"):
        scene(interval=1e-5)


# --- histories ------------------------------------------------------------------------------------


def test_mean_forces_times_intervals_are_the_impulse(simulation, histories):
    """An interval reaches from the middle of a step to the middle of a step."""
    last = simulation.model.sample_count - 1
    middle = histories.time - 0.5 * simulation.state.samples[:, SAMPLE_COLUMNS.index("last_step")]
    length = np.diff(middle, prepend=0.0)
    total = np.einsum("h,hti->ti", length, histories.tool_force)
    np.testing.assert_allclose(total, simulation.state.tool_impulse, rtol=1e-12)
    assert length[last] == pytest.approx(0.4e-3, rel=0.01)
    size = np.linalg.norm(histories.tool_force, axis=-1)
    assert (size <= histories.tool_peak_force * (1.0 + 1e-12)).all()
    assert (histories.tool_peak_time[:, 0] <= histories.time).all()
    assert (histories.tool_peak_time[1:, 0] >= histories.time[:-1] - 1e-5).all()


def test_energies_of_the_last_sample_are_those_of_the_end(simulation, histories):
    energy = simulation.energy()
    assert set(histories.energy) == {*energy, "mass_damping"}
    for name, value in energy.items():
        assert histories.energy[name][-1] == value, name
    assert 0.0 < histories.energy["mass_damping"][-1] <= energy["damping"]


def test_the_file_holds_the_histories_with_a_time_of_their_own(datasets, histories, tmp_path):
    write_forming_netcdf(tmp_path / "forming.nc", datasets)
    history = read_group(tmp_path / "forming.nc", "history")
    assert (history.sizes["history_time"], history.sizes["time"]) == (10, 1)
    np.testing.assert_array_equal(history.indexes["history_time"], histories.time)
    with xr.open_datatree(tmp_path / "forming.nc") as tree:
        assert tree["history"].sizes["history_time"] == 10
        assert tree["history"].indexes["time"].equals(tree.indexes["time"])
    for axis, name in enumerate("xyz"):
        found = history[f"history_tool_force_{name}"]
        assert found.dims == ("history_time", "tool")
        np.testing.assert_array_equal(found, histories.tool_force[..., axis])
    # the sheet's own time stands in results whose pace is found (effects/test_pace.py)
    # and grippers in those that have some (effects/test_grippers.py)
    # and stops and turns in those of tools that have some (effects/test_tool_stops.py and
    # test_turning_tools.py)
    others = (
        "history_sheet_time", "history_gripper_force", "history_gripper_travel",
        "history_tool_angle", "history_tool_moment", "history_tool_stop_force",
    )  # fmt: skip
    for field in [f for f in HISTORY_FIELDS.values() if f.name not in others]:
        for name in field.variables:
            assert history[name].attrs["units"] == field.units
            assert history[name].attrs["comment"] == field.meaning
    for name, values in histories.energy.items():
        np.testing.assert_array_equal(history[f"history_energy_{name}"], values)


# --- loads ----------------------------------------------------------------------------------------


def test_forces_of_the_summary_are_those_of_the_histories(datasets, histories):
    summary = field_summary(datasets)
    size = np.linalg.norm(histories.tool_force, axis=-1)  # the intervals are a tenth of the time
    assert summary["punch"] == "punch"
    assert summary["punch_force_max_N"] == pytest.approx(size[:, 0].max(), rel=1e-9)
    assert summary["punch_force_peak_N"] == histories.tool_peak_force[:, 0].max()
    assert summary["punch_force_peak_N"] > summary["punch_force_max_N"]
    die = summary["tool_loads"]["die"]
    assert die["force_max_N"] == pytest.approx(size[:, 1].max(), rel=1e-9)
    assert die["force_end_N"] == pytest.approx(size[-1, 1], rel=1e-9)
    top = size[:, 1].argmax()
    assert die["force_max_time_s"] == pytest.approx(histories.time[top - 1 : top + 1].mean())
    highest = histories.tool_peak_force[:, 1].argmax()
    assert die["force_peak_time_s"] == histories.tool_peak_time[highest, 1]


def test_quoted_forces_are_means_over_a_twentieth_of_the_process():
    """Whatever the interval of the histories; samples may lie half a step beside its multiples."""
    time = np.linspace(0.0, 1.0, 101)[1:] + 1e-4 * np.resize([1.0, -1.0], 100)
    time[-1] = 1.0
    force = np.zeros((100, 2))
    force[40:45, 0] = [1.0, 2.0, 30.0, 2.0, 1.0]
    force[:, 1] = -3.0
    variables = {
        f"history_tool_force_{axis}": force if axis == "z" else 0.0 * force for axis in "xyz"
    }
    fine = xr.Dataset(
        {name: (("history_time", "tool"), values) for name, values in variables.items()},
        coords={"history_time": time},
    )
    middle, mean = quoted_force(fine)
    assert len(middle) == 96
    top = int(mean[:, 0].argmax())
    assert mean[top, 0] == pytest.approx(36.0 / 5.0, rel=0.03)
    assert middle[top] == pytest.approx(0.425, abs=1e-3)
    np.testing.assert_allclose(mean[:, 1], 3.0, rtol=1e-12)


def test_the_piece_around_the_maximum_ends_where_the_tool_rests():
    """What others do to the sheet while it stands is not its work."""
    travel = np.minimum(np.arange(1, 41) / 20.0, 1.0)  # comes to rest with sample 19
    assert _around(travel, 19) == (18, 19)
    assert _around(travel, 30) == (18, 30)
    assert _around(travel, 10) == (9, 11)


def test_the_piece_around_the_maximum_lies_on_one_way_of_a_tool_that_comes_back():
    down = np.arange(1, 41) / 40.0
    travel = np.concatenate([down, down[::-1][1:], [0.0]])  # turns with sample 39
    assert _around(travel, 39) == (38, 39)
    assert _around(travel, 40) == (39, 41)
    for sample in range(30, 50):
        first, last = _around(travel, sample)
        assert first < last, sample
        assert abs(travel[last] - travel[first]) >= 1.0 / 40.0 - 1e-12, sample


def test_the_force_over_the_stroke_ends_where_a_tool_begins_to_come_back(history, datasets):
    """All the way back its travel is 0, and no force follows from it."""
    count = history.sizes["history_time"]
    turn = count // 2
    back = history.copy(deep=True)
    back["history_tool_travel"].values[turn:, 0] = np.linspace(2e-3, 0.0, count - turn)
    back["history_tool_travel"].values[: turn + 1, 0] = np.linspace(1e-4, 2e-3, turn + 1)
    parts = tool_loads(back, datasets[SHEET])["punch"]["parts_over_stroke"]
    assert parts == force_parts(back, 0, -1, turn)


def test_the_stroke_of_a_tool_that_opens_farther_than_it_closed_ends_where_it_pressed():
    travel = np.array([0.1, 0.2, 0.3, 0.2, -0.1, -0.7])
    work = np.array([1.0, 4.0, 9.0, 5.0, 0.1, 0.1])
    for sign in (1.0, -1.0):
        assert _end_of_stroke(sign * travel, work) == 2
        # a tool that opens first, and then does its work
        assert _end_of_stroke(sign * np.array([-0.1, -0.2, 0.5, 1.0]), work[[4, 4, 0, 2]]) == 3
    # the way back of one that never goes behind its start is no stroke, whatever work it does
    assert _end_of_stroke(np.array([0.5, 1.0, 0.5, 0.0]), np.arange(4.0)) == 1


def test_parts_of_the_force_add_up_to_it(history, datasets):
    loads = tool_loads(history, datasets[SHEET])
    assert "parts_over_stroke" not in loads["die"]  # it does not move
    for which in ("parts_at_maximum", "parts_over_stroke"):
        parts = dict(loads["punch"][which])
        force, hourglass = parts.pop("force_N"), parts.pop("hourglass_N")
        assert abs(hourglass) <= abs(parts["sheet_N"])  # it is a part of what strains the sheet
        assert force > 0.1
        assert sum(parts.values()) == pytest.approx(force, rel=1e-9)
        assert abs(parts["others_N"]) < 1e-9 * force


def test_a_force_is_known_to_what_its_pace_and_its_mesh_make_of_it(history, datasets):
    """Hourglass terms and the ripple tell of the same mesh: the larger one counts."""
    parts = {"inertia_N": -0.5, "damping_N": 0.2, "hourglass_N": -0.1, "sheet_N": 9.0}
    assert force_uncertainty(parts, 0.0) == pytest.approx(0.8)
    assert force_uncertainty(parts, 0.3) == pytest.approx(1.0)
    punch = tool_loads(history, datasets[SHEET])["punch"]
    assert "force_ripple_N" not in punch  # it goes 2 mm, less far than four elements of 5 mm
    assert punch["force_uncertainty_N"] == force_uncertainty(punch["parts_at_maximum"], 0.0)
    assert punch["force_quoted_N"] == punch["force_max_N"]
    assert punch["force_quoted_uncertainty_N"] == punch["force_uncertainty_N"]


def course(x):
    """A force [N] that grows with the travel [mm], up to 60 mm."""
    return 22.0 - 0.005 * (60.0 - x) ** 2


@pytest.mark.parametrize("top", [40.0, 59.9])  # before the end of the stroke, and at it
def test_a_ripple_of_one_element_is_told_from_the_course_of_a_force(top):
    way = 60.0 * np.sin(np.linspace(0.0, 0.5 * np.pi, 150))  # the tool slows down
    ripple = 2.0 * np.cos(2.0 * np.pi * (way - top) / 5.0)
    sample = int(np.argmin(np.abs(way - top)))
    smooth, found, lobes = smooth_force(1e-3 * way, course(way) + ripple, sample, 5e-3)
    assert smooth == pytest.approx(course(way[sample]), abs=1.0)  # the force is 2 N above it
    assert 1.2 < found < 2.5
    assert 8 <= lobes <= 9  # four periods
    calm = smooth_force(1e-3 * way, course(way), sample, 5e-3)
    assert calm[:2] == pytest.approx((course(way[sample]), 0.0), abs=0.02)


@pytest.mark.parametrize("periods", [2.0, 2.3, 3.0, 4.0])
@pytest.mark.parametrize("phase", np.linspace(0.0, 2.0, 8, endpoint=False) * np.pi)
def test_the_quoted_force_is_the_course_as_near_as_the_ripple_leaves_it_known(periods, phase):
    """At the end of a stroke, where the parabola is worst, wherever the crests of a mesh lie."""
    way = np.linspace(39.9, 60.0, 202)  # a little more than four elements of 5 mm
    ripple = 2.0 * np.cos(2.0 * np.pi * periods * (way - 60.0) / 20.0 + phase)
    force = course(way) + ripple
    smooth = smooth_force(1e-3 * way, force, 201, 5e-3)
    quoted, left = figure_to_quote(force[-1], smooth, smooth.distance)
    assert quoted == pytest.approx(smooth.force) != force[-1]
    assert left == TAKEN_UP * smooth.distance
    assert abs(quoted - course(60.0)) < left


def test_the_largest_mean_is_quoted_where_nothing_goes_to_and_fro_or_by_little():
    course = SmoothCourse(90.0, 8.0, 5)
    assert figure_to_quote(100.0, course, 8.0) == (92.0, TAKEN_UP * 8.0)  # no more than the ripple
    assert figure_to_quote(100.0, course._replace(force=97.0), 8.0)[0] == 97.0
    assert figure_to_quote(100.0, course, 4.9) == (100.0, 4.9)
    assert figure_to_quote(100.0, course._replace(lobes=4), 8.0) == (100.0, 8.0)


@pytest.mark.parametrize("sharp", [0.2, 1.0, 5.0])
def test_a_force_that_rises_ever_faster_has_no_lobes_of_a_ripple(sharp):
    """Compaction: no parabola follows it, however far it lies beside one."""
    way = np.linspace(0.0, 20e-3, 400)
    force = 1.0 + 100.0 * np.exp((way - way[-1]) / (1e-3 * sharp))
    found = smooth_force(way, force, 399, 5e-3)
    assert found.distance > 1.0 and found.lobes <= 4
    assert figure_to_quote(force[-1], found, found.distance)[0] == force[-1]


def test_a_force_has_no_smooth_course_where_its_tool_turns_or_goes_less_far_than_four_elements():
    way = np.linspace(0.0, 40e-3, 81)
    force = course(1e3 * way)
    assert smooth_force(way, force, 80, 9.9e-3) is not None
    assert smooth_force(way, force, 80, 10.1e-3) is None
    turned = np.append(way, way[-2:-20:-1])
    assert smooth_force(turned, np.append(force, force[-2:-20:-1]), len(turned) - 1, 5e-3) is None


def test_links_run_over_a_radius_as_unevenly_as_bounded():
    """A taut chain slides round a fillet: the way that it gains on the arc, by the chords."""
    link, radius, bend = 0.45, 1.0, 1.3
    start = np.linspace(-link, 0.0, 400)  # of the first link, along the arc
    ends = np.clip(start[:, None] + link * np.arange(5), 0.0, bend)
    arcs = np.diff(ends, axis=1)
    gained = (arcs - 2.0 * radius * np.sin(0.5 * arcs / radius)).sum(axis=1)
    speed = np.gradient(gained, start)
    bound = largest_ripple(link / radius)
    assert 0.7 * bound < np.ptp(speed) < 1.01 * bound


def test_a_ripple_is_at_most_what_the_turn_of_the_sheet_allows(history, datasets):
    """A flat sheet under a tool that is driven far has none, however uneven its force."""
    far = history.copy(deep=True)
    for name in ("history_tool_travel", "history_tool_work"):
        far[name][:] *= 20.0
    rough = far["history_tool_force_z"].values[:, 0] * np.resize([1.0, 0.5], len(far.history_time))
    far["history_tool_force_z"][:, 0] = rough
    sheet = datasets[SHEET].copy(deep=True)
    bent = tool_loads(far, sheet)["punch"]
    turn = largest_turn(sheet)
    assert turn > 0.01
    assert bent["force_ripple_N"] == pytest.approx(0.25 * turn**2 * bent["force_max_N"])
    for axis in "xyz":
        sheet[f"displacement_{axis}"][:] = 0.0
    assert tool_loads(far, sheet)["punch"]["force_ripple_N"] == pytest.approx(0.0, abs=1e-9)


def test_the_largest_turn_is_that_between_faces_that_share_an_edge():
    """Three squares of 2 mm in a row, the second bent up by 30°, the third back by 20°."""
    angles = np.radians([0.0, 30.0, 10.0])
    line = np.cumsum(np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)]), axis=1)
    line = 2e-3 * np.concatenate([np.zeros((3, 1)), line], axis=1).T
    formed = np.concatenate([line, line + [0.0, 2e-3, 0.0]])
    flat = np.array([[2e-3 * (i % 4), 2e-3 * (i // 4), 0.0] for i in range(8)])
    faces = [[i, i + 1, i + 5, i + 4] for i in range(3)]
    variables = {"sheet_face_nodes": (("face", "corner"), faces)}
    for k, axis in enumerate("xyz"):
        variables[f"reference_position_{axis}"] = ("node", flat[:, k])
        variables[f"displacement_{axis}"] = (("time", "node"), (formed - flat)[None, :, k])
    sheet = xr.Dataset(variables)
    assert edge_length(sheet) == pytest.approx(2e-3)
    assert largest_turn(sheet) == pytest.approx(np.radians(30.0))


def stroke(samples=200, *, drop=0.0, gain=1.0, dash=1.0):
    """History of a tool whose force falls at 0.8 of the time, and whose sheet becomes faster.

    drop : of the force [N]. gain : factor of the kinetic energy while it falls; dash : of the speed
    of the tool, which the kinetic energy follows.
    """
    time = np.linspace(0.0, 1.0, samples + 1)
    snapped = (time > 0.8) & (time < 0.83)
    speed = 30.0 * time**2 * (1.0 - time) ** 2 * np.where(snapped, dash, 1.0)
    travel = 0.075 * np.cumsum(speed) / samples
    kinetic = speed**2 * np.where(snapped, gain, 1.0) + 1e-6
    force = 400.0 * travel - np.where(time > 0.8, drop, 0.0)
    tools = ("history_time", "tool")
    return xr.Dataset(
        {
            **{f"history_tool_force_{axis}": (tools, 0.0 * force[1:, None]) for axis in "xy"},
            "history_tool_force_z": (tools, -force[1:, None]),
            "history_tool_travel": (tools, travel[1:, None]),
            "history_energy_kinetic": ("history_time", kinetic[1:]),
        },
        coords={"history_time": time[1:]},
    )


def test_a_snap_is_told_by_a_force_that_falls_while_the_sheet_becomes_faster():
    (snap,) = snaps(stroke(drop=3.0, gain=2.0), 0)
    assert snap["time_s"] == pytest.approx(0.8, abs=0.02)
    assert snap["force_drop_N"] == pytest.approx(3.0, rel=0.2)
    assert snap["travel_m"] == pytest.approx(0.071, abs=0.002)
    assert "at a travel of 70.8 mm by 2.9 N" in snaps_text([snap])
    assert "more" not in snaps_text([snap] * 3)
    assert snaps_text([snap] * 5).endswith("and 2 more")


@pytest.mark.parametrize(
    "history",
    [
        stroke(),
        stroke(drop=3.0),  # an element has passed a radius
        stroke(gain=2.0),  # a flap of the sheet that no tool feels
        stroke(drop=3.0, dash=2.0),  # the tool itself is faster
        stroke(drop=0.5, gain=2.0),
        stroke(samples=20, drop=3.0, gain=2.0),  # too few samples to tell
    ],
    ids=["calm", "ripple", "flap", "faster tool", "small", "coarse"],
)
def test_what_is_no_snap(history):
    assert snaps(history, 0) == []


def test_parts_are_energies_over_the_travel(history, histories, datasets):
    whole = tool_loads(history, datasets[SHEET])["punch"]["parts_over_stroke"]
    energy, travel = histories.energy, histories.tool_travel[-1, 0]
    assert travel == pytest.approx(2e-3)
    for part, names in {
        "sheet_N": ("internal", "hourglass"),
        "friction_N": ("friction",),
        "damping_N": ("mass_damping",),
        "inertia_N": ("kinetic",),
    }.items():
        expected = sum(energy[name][-1] for name in names) / travel
        assert whole[part] == pytest.approx(expected, rel=1e-12), part
    middle = force_parts(history, 0, 3, 6)
    gained = energy["mass_damping"][6] - energy["mass_damping"][3]
    way = histories.tool_travel[6, 0] - histories.tool_travel[3, 0]
    assert middle["damping_N"] == pytest.approx(gained / way, rel=1e-12)


def test_a_ratio_is_exceeded_over_a_part_of_the_stroke(history):
    """A sample counts with the travel since the one before."""
    changed = history.copy(deep=True)
    changed["history_tool_travel"][:, 0] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]
    changed["history_energy_internal"][:] = 1.0
    changed["history_energy_hourglass"][:] = 1.0
    changed["history_energy_kinetic"][:] = 2.0 * np.array([9, 0, 3, 0, 0, 0, 0, 1, 0, 0])
    assert exceeded_over(changed, 0, 0.05) == 9.0
    assert exceeded_over(changed, 0, 0.15) == 3.0
    assert exceeded_over(changed, 0, 0.25) == 1.0
    assert exceeded_over(changed, 0, 0.35) == 0.0
    changed["history_tool_travel"][:, 0] = [1, 2, 3, 4, 5, 6, 7, 18, 19, 20]
    assert exceeded_over(changed, 0, 0.35) == 1.0
    assert exceeded_over(changed, 1, 0.25) == exceeded_over(changed, None, 0.25) == 1.0  # of time
