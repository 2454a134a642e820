"""Stages that end at rest, and what results say of stages."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from lcmchain.coupling.forming_fields import forming_datasets
from lcmchain.fields.stages import springback, stage_summary
from lcmchain.fmu.forming.part import with_present
from lcmchain.judgements.quasi_static import rest_warnings
from lcmchain.pipeline import run
from lcmchain.report.chapters import stage_chapters
from lcmchain.scene import scene_from_text
from lcmchain.solver.rest import _stop
from lcmchain.solver.simulation import Simulation
from lcmchain.state import EXTERNAL, REST_ENTRIES, REST_LEFT, REST_SCALE, REST_STOPS

MS = 1e-3

# A strip that is clamped at one end, bent by a weight at the other, and let go.
BENT = """
title = "bent strip"
process = { frames = 24 }
output = { pictures = false, vtu = false }
blank = { size = ["60 mm", "20 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }

[[grippers]]
name = "clamp"
box = ["-30 -10 -1 mm", "-20 10 1 mm"]
hold = "xyz"

[[grippers]]
name = "weight"
box = ["30 -10 -1 mm", "30 10 1 mm"]
direction = [0, 0, -1]
force = "20 mN"
stages = ["bend"]

[[stages]]
name = "bend"
time = "60 ms"
mass_damping = "100 1/s"

[[stages]]
name = "release"
time = "400 ms"
rest = true
"""


def tip(simulation):
    """Return by how much the end of the strip hangs down [m]."""
    grip = next(grip for grip in simulation.model.grips if grip.name == "weight")
    return float(grip.place[2] - simulation.state.position[2, grip.nodes] @ grip.weights)


@pytest.fixture(scope="module")
def released():
    """The simulation of the strip at its end, its frames, and what it hung down before [m]."""
    scene = scene_from_text(BENT)
    simulation = Simulation.from_scene(scene)
    frames, bent, steps = (simulation.snapshot(),), 0.0, []
    for time in scene.frame_times[1:]:
        simulation.advance_to(float(time))
        frames = (*frames, simulation.snapshot())
        steps.append(simulation.state.step_count)
        if simulation.model.stage == 0:
            bent = tip(simulation)
    return scene, simulation, frames, bent, steps


def test_a_strip_springs_back_as_an_elastic_one(released):
    """All of what a weight has bent it: nothing else holds an elastic strip down."""
    scene, simulation, frames, bent, _ = released
    assert bent > 1e-3
    assert abs(tip(simulation)) < 0.02 * bent
    datasets = forming_datasets(scene, simulation, frames)
    found = stage_summary(simulation.model, simulation.state, datasets)
    # the best fit of both shapes takes part of the turn about the clamp off
    assert 0.1 * bent < found["springback_max_m"] < bent
    rest = found["stages"][1]["rest"]
    assert rest["reached_s"] is not None and rest["energy_part"] <= 1e-4
    assert rest_warnings(found) == []


def test_rest_takes_no_more_steps_and_closes_the_balance(released):
    _, simulation, _, _, steps = released
    assert steps[-1] == steps[-2]  # the time that is left passes without any
    assert simulation.time == pytest.approx(0.46)
    energy = simulation.energy()
    assert energy["kinetic"] == 0.0
    # to the rounding of what is stored: 3e-4 without what changes between a step and its stop
    assert abs(energy["balance_error"]) < 2e-5 * energy["external"]
    samples = simulation.state.samples
    assert int(simulation.state.counters[6]) == len(samples)
    assert np.all(np.diff(samples[:, 0]) > 0.0)


def test_results_say_which_stage_a_frame_belongs_to(released):
    scene, simulation, frames, _, _ = released
    datasets = forming_datasets(scene, simulation, frames)
    stage = datasets["/history"]["stage"]
    assert stage.attrs["flag_meanings"] == "bend release"
    of_frames = stage.values.tolist()
    assert of_frames == sorted(of_frames) and set(of_frames) == {0, 1}
    border = datasets["/history"]["time"].values[of_frames.index(1) - 1]
    assert border == pytest.approx(60 * MS)
    values = datasets["/"]["springback"].values
    assert not values[: of_frames.index(1)].any() and values[-1].max() > 1e-4
    found = stage_summary(simulation.model, simulation.state, datasets)
    headings = [(name, dict(rows)) for name, rows, _ in stage_chapters(found, datasets)]
    assert [name for name, _ in headings] == ["1. bend", "2. release"]
    assert "reached after" in headings[1][1]["rest"] and "springback" in headings[1][1]


def test_a_unit_saves_frames_at_the_borders_it_meets(released):
    scene, simulation, _, _, _ = released
    other = Simulation.from_scene(scene)
    kept = ()
    for time in (0.0, 20 * MS, 60 * MS, 61 * MS):
        other.advance_to(time)
        kept = with_present(kept, other, scene)
    assert 60 * MS in [frame.time for frame in kept]


def test_springback_leaves_out_how_a_part_moves_as_a_body():
    rng = np.random.default_rng(5)
    points = rng.random((20, 3))
    turn, _ = np.linalg.qr(rng.random((3, 3)))
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    assert springback(points, points @ turn + [1.0, 2.0, 3.0]).max() < 1e-12
    assert springback(points, points * [1.0, 1.0, 1.2]).max() > 0.01


def test_a_run_that_is_killed_in_each_stage_resumes_to_the_same_bits(tmp_path, released):
    """Its process ends between two checkpoints: what it has made since then is lost."""
    scene, simulation, frames, _, _ = released

    class Killed(Exception):
        pass

    times = iter((30 * MS, 75 * MS))
    until = [next(times)]

    def kill(time, total, text):
        if "forming" in text and until and time > until[0]:
            until[:] = [next(times)] if until[0] < 50 * MS else []
            raise Killed

    for resume in (False, True):
        with pytest.raises(Killed):
            run(scene, tmp_path, resume=resume, progress=kill, threads=1)
    result = run(scene, tmp_path, resume=True, threads=1)
    sheet = result.datasets["/"]
    assert np.array_equal(
        sheet["displacement_z"].values, forming_datasets(scene, simulation, frames)["/"][
            "displacement_z"].values
    )  # fmt: skip
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["step_count"] == simulation.state.step_count
    assert [stage["name"] for stage in summary["stages"]] == ["bend", "release"]
    assert 'id="stages"' in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_stage_that_was_stopped_on_its_way_is_not_told_to_be_restless():
    rest = {"reached_s": None, "energy_part": 0.1, "wanted": 1e-4, "stops": 3, "ended": True}
    (told,) = rest_warnings({"stages": [{"name": "release", "rest": rest}]})
    assert "release" in told
    assert rest_warnings({"stages": [{"name": "release", "rest": rest | {"ended": False}}]}) == []


def test_a_stage_that_ends_just_after_a_stop_tells_the_peak_of_that_stop():
    """The swing that has only begun has no peak yet, and would pass for rest."""
    stage = SimpleNamespace(
        name="release", start=0.0, end=1.0, tools_at_work=(), absent=None, rest_energy=1e-4
    )
    model = SimpleNamespace(stages=[stage], stage=0, tool_names=())
    rest = np.zeros((1, REST_ENTRIES))
    rest[0, REST_SCALE], rest[0, REST_LEFT] = 1e-3, 1e-5
    state = SimpleNamespace(time=1.0, rest=rest)
    found = stage_summary(model, state, {"/": {}})["stages"][0]["rest"]
    assert found["reached_s"] is None and found["energy_part"] == pytest.approx(0.01)


def test_a_stage_without_time_for_a_swing_is_told_so():
    rest = {"reached_s": None, "energy_part": 0.0, "wanted": 1e-4, "stops": 0, "ended": True}
    (told,) = rest_warnings({"stages": [{"name": "release", "rest": rest}]})
    assert "too little time" in told and "came to" not in told


def test_a_sheet_starts_from_a_stop_with_half_a_step():
    """Velocities of 1/2 and 3/2 of a step times the acceleration follow, not 1 and 2."""
    simulation = Simulation.from_scene(scene_from_text(BENT))
    simulation.advance_to(60.5 * MS)
    model, state = simulation.model, simulation.state
    step = 0.2 * state.last_step  # short: the fastest vibrations do not turn
    _stop(model, state, simulation.stored_energy)
    first, second = (one_step(simulation, step) for _ in range(2))
    assert np.sum(first * second) == pytest.approx(3.0 * np.sum(first**2), rel=0.1)


def one_step(simulation, step):
    """Make one step [s] and return the velocities [m/s]."""
    count = simulation.state.step_count
    simulation.advance_to(simulation.time + step)
    assert simulation.state.step_count == count + 1
    return simulation.state.velocity.copy()


def test_stops_keep_the_balance_of_fast_vibrations():
    """What the first step after a stop takes is booked."""
    simulation = Simulation.from_scene(scene_from_text(BENT))
    simulation.advance_to(60.5 * MS)
    model, state = simulation.model, simulation.state
    stored = simulation.stored_energy()
    noise = 0.5 * np.random.default_rng(3).standard_normal(state.velocity.shape)
    state.velocity += noise * model.nodes.free
    given = 0.5 * float(np.sum(model.nodes.mass * np.sum(state.velocity**2, axis=0)))
    state.work[EXTERNAL] += given
    assert given > stored  # or the swing of the strip would hide it
    simulation.advance_to(60.6 * MS)
    start = simulation.energy()["balance_error"]
    for time in np.linspace(61.0, 90.0, 30) * MS:
        simulation.advance_to(float(time))
        assert simulation.stored_energy() < 1.5 * given
    rest = state.rest[1]
    assert rest[REST_STOPS] > 5
    # the peak of the last stop, without which a swing that begins would pass for rest
    assert rest[REST_LEFT] > model.present_stage.rest_energy * rest[REST_SCALE] > 0.0
    assert abs(simulation.energy()["balance_error"] - start) < 1e-2 * given
