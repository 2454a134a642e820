"""Every entry of ``summary.json`` against values put in by hand."""

import json
import os
import socket
from datetime import datetime
from types import SimpleNamespace

import numpy as np
import pytest

from lcmchain import __version__
from lcmchain.fields import FrameSeries, build_datasets, field_summary
from lcmchain.judgements.contact import penetration_warnings
from lcmchain.judgements.quasi_static import (
    balance_remedies,
    balance_warning,
    process_time_needed,
    still_moving_warning,
)
from lcmchain.mesh.blank import build_blank
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.state import HALVINGS
from lcmchain.summary import energy_measures, run_head, run_summary

SCENE = """
title = "four elements"
process = { time = "20 ms", frames = 3 }
blank = { size = ["20 mm", "20 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }
[[tools]]
name = "die"
shape = { type = "plate", side = "below" }
[[tools]]
name = "press"
shape = { type = "plate", side = "above" }
position = "0 0 2 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "1 mm" }
"""
BAG = """
[[pressure]]
name = "bag"
face = "top"
value = "0.02 MPa"
"""
AREA = 0.02**2
# by frame, for two faces and again for the other two; the last frame does not hold the extrema
FIELDS = {
    "thickness": [[1.0e-3, 1.0e-3], [0.5e-3, 1.5e-3], [0.8e-3, 1.1e-3]],
    "shear_angle": [[0.0, 0.0], [0.9, -0.9], [0.2, -0.5]],
    "fibre_strain_1": [[0.0, 0.0], [0.1, -0.1], [0.001, -0.002]],
    "fibre_strain_2": [[0.0, 0.0], [0.1, -0.1], [0.003, -0.004]],
    "fibre_volume_fraction": [[0.33, 0.33], [0.8, 0.8], [0.4, 0.6]],
    "areal_fibre_mass": [[0.6, 0.6], [0.6, 0.6], [0.6, 0.9]],
}
FORCES = {  # on each tool; the press is loaded most in the middle of its stroke
    "die": [[0, 0, 0], [0, 0, -8.0], [0, 0, -9.0]],
    "press": [[0, 0, 0], [2.0, 3.0, 6.0], [0, 0, 1.0]],
}
ENERGY_NAMES = "kinetic internal hourglass contact friction damping external balance_error".split()
ENERGIES = [
    dict(zip(ENERGY_NAMES, values))
    for values in (
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.3, 1.0, 0.2, 0.1, 0.2, 0.3, 2.1, -0.06),
        (0.1, 3.7, 0.3, 0.2, 0.4, 0.5, 5.2, 0.04),
    )
]


@pytest.fixture(scope="module")
def scene():
    return scene_from_text(SCENE)


def frame_series(scene, *, names=("die", "press"), travel=((0.0, 0.0), (0.0, 1.0), (0.0, 1.0))):
    blank = build_blank(scene.blank, scene.material.thickness)
    frames = FrameSeries(
        time=np.array([0.0, 0.01, 0.02]),
        positions=np.stack([blank.node_positions] * 3),
        tool_travel=np.array(travel),
        tool_force=np.array([FORCES["die"], FORCES["press"]], dtype=float).swapaxes(0, 1),
        energy={name: np.array([e[name] for e in ENERGIES]) for name in ENERGIES[0]},
        tool_names=names,
    )
    return blank, frames


def datasets_of(scene, **options):
    datasets = build_datasets(scene, *frame_series(scene, **options))
    for name, values in FIELDS.items():
        datasets["/"][name][...] = np.tile(values, 2)
    datasets["/"]["wrinkle_height"].values[-1, 3:5] = 2e-4, -3e-4
    return datasets


@pytest.fixture
def datasets(scene):
    return datasets_of(scene)


def summary_of(scene, datasets, energies=ENERGIES, **changes):
    simulation = SimpleNamespace(
        model=build_model(scene),
        state=SimpleNamespace(
            step_count=1250,
            penetration_max=np.array([2e-5, 3e-5]),
            tool_stopped=np.full((2, 1, 2), np.inf),
            counters=np.where(np.arange(HALVINGS + 1) == HALVINGS, 2, 7),
        ),
        control=SimpleNamespace(history={"in-plane stiffness": 1000, "contact stiffness": 250}),
    )
    given = {"wall_s": 0.5, "compile_s": 7.5, "threads": 2} | changes
    untouched = {
        "position": simulation.model.node_positions,
        "tool_travel": np.zeros(len(simulation.model.tool_names)),
        "contact_force": np.zeros(simulation.model.node_count),
    }
    snapshots = [SimpleNamespace(time=0.0, energy=energy, **untouched) for energy in energies]
    head = run_head(scene, simulation, "abc")
    return head | run_summary(scene, simulation, snapshots, datasets, **given)


def test_every_entry(scene, datasets):
    summary = summary_of(scene, datasets, warnings=["a hole was closed"])
    effects = summary.pop("effects")
    found = summary.pop("warnings")
    expected = {
        "lcmchain_version": __version__,
        "title": "four elements",
        "state": "running",
        "scene_sha256": scene.source.sha256,
        "run_fingerprint": "abc",
        "model": "solid-shell",
        "left_out": [],
        "element_count": 4,
        "node_count": 18,
        "step_count": 1250,
        "process_time_s": 0.02,
        "wall_s": 0.5,
        "compile_s": 7.5,
        "threads": 2,
        "us_per_element_step": 100.0,
        "energy": ENERGIES[-1],
        "strained": True,
        "balance_error_max": 0.06 / 4.0,
        "kinetic_to_internal_max": 0.3 / 1.2,
        "kinetic_to_internal_end": 0.1 / 4.0,
        "damping_to_external": 0.5 / 5.2,
        "hourglass_to_internal": 0.3 / 3.7,
        "process_time_needed_s": process_time_needed(build_model(scene)).as_dict(),
        "thickness_min_m": 0.8e-3,
        "thickness_max_m": 1.1e-3,
        "shear_angle_max_rad": 0.5,
        "fibre_strain_max": 0.004,
        "fibre_volume_fraction_max": 0.6,
        "wrinkle_height_max_m": 3e-4,
        "fibre_mass_kg": 0.75 * AREA,
        "fibre_mass_error": 0.25,
        "punch_force_max_N": 7.0,
        "mass_added_kg": 0.0,
        "mass_added_total": 0.0,
        "mass_added_largest": 0.0,
        "fibre_modulus_factor": 1.0,
        "fibre_strain_largest": 0.1,
        "fibre_strain_allowed": 0.002,
        "fibre_modulus_factor_possible": 1.0,
        "effects_switched": {},
        "penetration_max_m": {"die": 2e-5, "press": 3e-5},
        "step_control": {"in-plane stiffness": 1000, "contact stiffness": 250},
        "step_halvings": 2,
        "mapping": {},
    }
    run = summary.pop("run")
    assert run["process"] == os.getpid() and run["host"] == socket.gethostname()
    assert abs(datetime.now().astimezone() - datetime.fromisoformat(run["started"])).days == 0
    assert set(summary) == set(expected)
    for name, value in expected.items():
        if isinstance(value, float):
            assert summary[name] == pytest.approx(value, rel=1e-12), name
        else:
            assert summary[name] == value, name
    assert {"compaction", "contact with die", "contact with press"} <= set(effects)
    assert not {"gravity", "friction on die", "mass damping"} & set(effects)
    assert found[0] == "a hole was closed"
    assert len(found) == 4 and "energy balance is off by 1.5%" in found[1]
    assert "damping takes 9.6%" in found[2] and "hourglass energy is 8.1%" in found[3]
    json.dumps(summary, allow_nan=False)


@pytest.mark.parametrize("family", [1, 2])
def test_the_largest_fibre_strain_is_that_of_either_family(datasets, family):
    for name in ("fibre_strain_1", "fibre_strain_2"):
        datasets["/"][name][...] = 0.0
    datasets["/"][f"fibre_strain_{family}"][-1] = [0.002, -0.007, 0.0, 0.001]
    assert field_summary(datasets)["fibre_strain_max"] == 0.007


def test_frames_before_the_last_can_be_asked_for(datasets):
    summary = field_summary(datasets, frame=1)
    assert summary["thickness_min_m"] == 0.5e-3 and summary["shear_angle_max_rad"] == 0.9
    assert summary["fibre_mass_error"] == pytest.approx(0.0, abs=1e-12)
    assert summary["punch_force_max_N"] == pytest.approx(7.0)  # over all frames


def test_the_punch_is_the_tool_of_that_name_or_the_one_that_travels_farthest(scene):
    # backwards counts as well, and the way there, not the end
    back = ((0.0, 0.0), (-2.0, 0.5), (0.0, 1.0))
    for options, force in (
        ({}, 7.0),
        ({"names": ("punch", "press")}, 9.0),
        ({"travel": back}, 9.0),
        ({"travel": back, "names": ("die", "punch")}, 7.0),
    ):
        found = field_summary(datasets_of(scene, **options))
        assert found["punch_force_max_N"] == pytest.approx(force), options


def test_a_sheet_that_was_never_strained_has_no_ratios(scene, datasets):
    still = [ENERGIES[0] | {"kinetic": 1.0}] * 3
    assert set(energy_measures(still).values()) == {0.0}
    assert summary_of(scene, datasets, still)["kinetic_to_internal_end"] == 0.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kinetic_to_internal_end": 0.051}, "still moves at the end (kinetic 5.1%"),
        ({"penetration_max_m": {"die": 1.1e-4, "press": 0.0}}, "reached 0.11 mm into die"),
    ],
)
def test_what_makes_a_result_questionable_is_said(changes, words):
    sound = {
        "kinetic_to_internal_end": 0.049,
        "penetration_max_m": {"die": 0.99e-4, "press": 0.0},
    }
    assert still_moving_warning(sound) + penetration_warnings(sound, 1e-3) == []
    changed = sound | changes
    (warning,) = still_moving_warning(changed) + penetration_warnings(changed, 1e-3)
    assert words in warning


def test_the_scale_of_the_balance_is_named(scene):
    assert balance_warning({"balance_error_max": 0.0099}, scene) == []
    (small,) = balance_warning({"balance_error_max": 0.011}, scene)
    assert "energy balance is off by 1.1%" in small
    still = {"balance_error_max": 0.5}
    (strained,) = balance_warning(still | {"strained": True}, scene)
    (never,) = balance_warning(still | {"strained": False}, scene)
    assert "50.0% of the largest internal energy" in strained
    assert "50.0% of the largest part of the balance (the sheet is not strained)" in never


def test_the_remedy_of_a_balance_fits_the_scene(scene):
    """What is off already is not to be left off; what strikes the tools is to be slowed."""

    def told(changed, **measures):
        measures = {"balance_error_max": 0.05} | measures
        (warning,) = balance_warning(measures, changed)
        keys = balance_remedies(measures, changed)
        assert all(key in warning for key in keys)
        return keys

    hit = {"kinetic_to_internal_over_tenth_of_stroke": 6.0}
    # a press that is led, as printed, and a bag without a press
    assert told(scene) == ["process.step_safety"]
    assert told(scene, **hit) == ["process.time", "process.step_safety"]
    printed = scene.element.model_copy(update={"cross_terms": True})
    printed = scene.model_copy(update={"element": printed})
    assert told(printed) == ["element.cross_terms", "process.step_safety"]
    bag = scene_from_text(SCENE.partition("[[tools]]")[0] + BAG)
    assert told(bag, **hit) == ["pressure.ramp", "process.mass_damping", "process.step_safety"]
    (warning,) = balance_warning({"balance_error_max": 0.05} | hit, bag)
    assert "cross_terms" not in warning and "slow the sheet with pressure.ramp" in warning


def test_a_balance_that_is_wrong_is_told_of_a_sheet_that_was_never_strained():
    """As of a run that a guard stopped in a contact, with half of the work gone."""
    idle = 1e-6
    frame = ENERGIES[0] | {"internal": 1e-9, "damping": 6.5e-5, "external": 1.25e-4}
    found = energy_measures([ENERGIES[0], frame | {"balance_error": -6e-5}], idle)
    assert found["balance_error_max"] == pytest.approx(6e-5 / 1.25e-4)
    assert found["kinetic_to_internal_max"] == found["kinetic_to_internal_end"] == 0.0
    # the work that a strained sheet has taken says nothing more
    strained = frame | {"internal": 2e-6, "balance_error": 1e-8}
    assert energy_measures([strained], idle)["balance_error_max"] == pytest.approx(0.5e-2)
    # rounding at rest
    still = ENERGIES[0] | {"external": 1e-15, "kinetic": 3e-16, "balance_error": 7e-16}
    assert set(energy_measures([still], idle).values()) == {0.0}
