"""The expected cost of a run: what changes the step on the way, and the speed of the machine."""

from __future__ import annotations

import json

import numpy as np
import pytest

from lcmchain.check import estimate_run, expected_cost
from lcmchain.check.expected_cost import (
    contact_between_plies,
    contact_omega2,
    omega2_over_time,
    plate_distance,
)
from lcmchain.compilation.threads import worthwhile_threads
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

PLATES = """
process = { time = "20 ms", step_safety = 0.9 }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
contact = { penalty = "1 N/mm^3" }

[[tools]]
name = "lower"
shape = { type = "plate", side = "below" }

[[tools]]
name = "upper"
shape = { type = "plate", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "table", direction = [0, 0, -1], times = "0 10 20 ms", travel = "0 0.45 0 mm" }
"""


def model_of(text, *overrides):
    return build_model(scene_from_text(text, overrides=overrides))


def test_compaction_between_plates_follows_from_their_motion():
    model = model_of(PLATES)
    travel = np.linspace(0.0, 0.45e-3, 101)[:, None] * [0.0, 1.0]
    assert plate_distance(model, travel) == pytest.approx(1.004e-3 - travel[:, 1], abs=1e-12)
    in_plane, over_thickness = omega2_over_time(model, 0.0)
    assert (in_plane == in_plane[0]).all()
    # the manual's figure: the thickness wave limits the step to 3.4 us at 0.55 mm
    assert 2.0 / np.sqrt(over_thickness.max()) == pytest.approx(3.4e-6, rel=0.05)
    assert np.argmax(over_thickness) == 50
    flat = 20e-3 / (0.9 * 2.0 / np.sqrt(in_plane[0] + contact_omega2(model)))
    estimate = estimate_run(model)
    assert flat < estimate.step_count < 1.1 * flat
    assert estimate.range == (estimate.step_count,) * 2  # shear shortens no step of whole elements


def test_stiff_contacts_and_light_tools_shorten_the_step():
    model = model_of(PLATES, "contact.penalty=1000 N/mm^3")
    areal_mass = model.only_body().material.areal_mass
    assert contact_omega2(model) == pytest.approx(1e12 / (0.5 * areal_mass), rel=1e-12)
    assert estimate_run(model).controlled_by == "contact stiffness"
    guided = model_of(
        PLATES,
        'tools.upper.motion={ type = "guided", direction = [0, 0, -1], mass = "1 g" }',
    )
    more = contact_omega2(guided) - contact_omega2(model_of(PLATES))
    assert more == pytest.approx(1e9 * 0.02**2 / 1e-3, rel=1e-9)


PLIES = """
layup = "[0/90, 45/-45]"
process = { time = "20 ms", step_safety = 0.9 }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
[[interfaces]]
friction = 0.2
"""
FILM = '[{ type = "viscous_film", viscosity = "50 Pa*s", thickness = "0.05 mm" }]'


def test_plies_and_films_shorten_the_expected_step_as_they_do_in_the_solver():
    """The first step of a run, at rest: springs of the plies, and a film whose speed lags."""
    steps = {}
    for name, laws in (("dry", "[]"), ("film", FILM)):
        model = model_of(PLIES, f"interfaces.0.laws={laws}")
        estimate, simulation = estimate_run(model), Simulation(model)
        omega2, element, code = simulation._highest_frequency()
        solved, cause = simulation._step_of(omega2, element, code)
        assert estimate.critical_step == pytest.approx(solved, rel=0.02)
        steps[name] = estimate
        assert ("damping by" in cause) == ("damping by" in estimate.controlled_by)
    assert steps["film"].critical_step < 0.3 * steps["dry"].critical_step
    assert steps["film"].step_count > 3 * steps["dry"].step_count
    assert steps["film"].controlled_by == "damping by viscous film between plies"
    alone = PLIES.partition("[[")[0].replace(", 45/-45", "")
    alone = estimate_run(model_of(alone))
    assert alone.critical_step > steps["dry"].critical_step


def test_the_damping_of_a_film_is_the_same_in_finer_elements():
    model = model_of(PLIES, f"interfaces.0.laws={FILM}")
    coarse, fine = contact_between_plies(model), contact_between_plies(model, 3.0)
    assert fine.omega2 == pytest.approx(9.0 * coarse.omega2)
    finer = model_of(PLIES, f"interfaces.0.laws={FILM}", 'blank.edge_length="2.5 mm"')
    carried, built = contact_between_plies(model, 2.0), contact_between_plies(finer)
    assert carried.omega2 == pytest.approx(built.omega2, rel=0.05)
    assert carried.rate == pytest.approx(built.rate, rel=0.02)


def test_shear_shortens_the_steps_of_triangles():
    estimate = estimate_run(model_of(PLATES, "element=membrane-shell"))
    least, most = estimate.range
    assert least < estimate.step_count < most < 1.3 * least


def test_speed_is_that_of_the_fastest_of_the_last_runs_here(monkeypatch, tmp_path):
    monkeypatch.setattr(expected_cost, "user_cache_path", lambda *_, **__: tmp_path)
    model = model_of(PLATES)
    assumed = expected_cost.machine_speed(model)
    assert assumed.source == "assumed"
    threads = worthwhile_threads(model.element_count)
    expected_cost.record_speed(model, threads, 100, 1.0)  # too short to say anything
    assert expected_cost.machine_speed(model) == assumed
    for seconds in (3.0, 2.0, 50.0):
        expected_cost.record_speed(model, threads, 10_000, seconds)
    found = expected_cost.machine_speed(model)
    assert found.seconds_per_element_step == pytest.approx(2.0 / 10_000 / model.element_count)
    assert "last runs here" in found.source
    estimate = estimate_run(model)
    per_step = model.element_count * found.seconds_per_element_step
    assert estimate.seconds == pytest.approx(estimate.step_count * per_step)
    # other kernels, threads and sizes are not mistaken for these
    expected_cost.record_speed(model, threads + 1, 10_000, 1e-3)
    assert expected_cost.machine_speed(model) == found
    triangles = model_of(PLATES, "element=membrane-shell")
    assert expected_cost.machine_speed(triangles).source == "assumed"
    with_resin = build_model(scene_from_text(PLATES), pore_pressure=True)
    assert expected_cost.machine_speed(with_resin).source.startswith("assumed, without the flow")


@pytest.mark.parametrize("content", ["", "[1, 2]", '{"x": 1}', "{", json.dumps({"a": [1e9, "b"]})])
def test_a_spoilt_file_of_speeds_is_no_error(monkeypatch, tmp_path, content):
    monkeypatch.setattr(expected_cost, "user_cache_path", lambda *_, **__: tmp_path)
    (tmp_path / expected_cost.FILE).write_text(content, encoding="utf-8")
    assert expected_cost.machine_speed(model_of(PLATES)).source == "assumed"
