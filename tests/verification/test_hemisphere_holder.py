"""The main job against what a forming engineer would look at first."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lcmchain import read_scene, run
from lcmchain.check import estimate_run
from lcmchain.fields import read_forming, sheet_faces, sheet_positions
from lcmchain.judgements.grades import GOOD, NOT_JUDGED
from lcmchain.judgements.verdicts import verdicts
from lcmchain.model import build_model
from lcmchain.verification.hemisphere import flange_and_pole, mirror_difference

INITIAL_THICKNESS = 1.004e-3
SCENE = Path(__file__).parents[2] / "examples" / "hemisphere_holder" / "scene.toml"


@pytest.fixture(scope="module")
def sheet(holder_result):
    return read_forming(holder_result.folder / "forming.nc")


def test_every_field_is_finite(sheet):
    for name, variable in sheet.data_vars.items():
        if np.issubdtype(variable.dtype, np.floating):
            assert np.isfinite(variable.values).all(), name


def test_no_element_is_inverted_or_collapsed(sheet):
    assert sheet["thickness"].values.min() > 0.8 * INITIAL_THICKNESS


def test_fibres_hardly_stretch(sheet):
    for name in ("fibre_strain_1", "fibre_strain_2"):
        assert np.abs(sheet[name].values[-1]).max() < 0.003


def test_motion_has_come_to_rest(holder_result):
    assert holder_result.summary["kinetic_to_internal_end"] < 0.05
    assert holder_result.summary["kinetic_to_internal_max"] > 0.0  # reported over the stroke


def test_energy_balance_closes(holder_result):
    assert holder_result.summary["balance_error_max"] < 0.01


def test_hourglass_energy_is_small(holder_result):
    energy = holder_result.summary["energy"]
    assert energy["hourglass"] < 0.05 * energy["internal"]


@pytest.mark.parametrize("axis", [0, 1])
def test_quarters_agree(sheet, axis):
    difference = mirror_difference(sheet, axis)
    assert difference["contour"] < 0.5e-3
    assert difference["thickness"] < 0.002 * INITIAL_THICKNESS
    assert difference["shear_angle"] < np.radians(0.5)


def test_thickness_in_flange_and_at_the_pole_is_the_initial_one(sheet):
    """Section 4.2 of the paper: no significant change in the flat areas and at the centre."""
    flange, pole = flange_and_pole(sheet)
    assert flange.sum() > 500 and pole.sum() >= 4
    ratio = sheet["thickness"].values[-1] / INITIAL_THICKNESS
    assert np.abs(ratio[flange] - 1.0).max() < 0.01
    assert np.abs(ratio[pole] - 1.0).max() < 0.03


def test_sheet_thins_along_the_die_radius(sheet):
    """Section 4.2: the greatest change is a noticeable thinning in the area of the radius."""
    centres = sheet_positions(sheet)[sheet_faces(sheet)].mean(axis=1)
    radius = np.linalg.norm(centres[:, :2], axis=1)
    ratio = sheet["thickness"].values[-1] / INITIAL_THICKNESS
    at_radius = (radius > 0.072) & (radius < 0.087)
    assert 0.84 < ratio[at_radius].min() < 0.92
    assert at_radius[np.argmin(ratio)]


def test_draw_in_follows_the_fibres(sheet):
    """Fig. 7c: strong draw-in along the fibres, little at the corners."""
    outline = 1e3 * np.abs(sheet_positions(sheet))
    reference = 1e3 * np.abs(
        np.stack([sheet[f"reference_position_{axis}"].values for axis in "xy"], axis=-1)
    )
    middle = (reference[:, 0] > 149.99) & (reference[:, 1] < 0.01)
    corner = (reference > 149.99).all(axis=1)
    assert 36.0 < 150.0 - outline[middle, 0].mean() < 39.0
    assert 150.0 - outline[corner, 0].mean() < 10.0


def test_no_tool_is_penetrated(holder_result):
    assert max(holder_result.summary["penetration_max_m"].values()) < 1e-4


def test_fibre_mass_is_conserved(holder_result):
    assert holder_result.summary["fibre_mass_kg"] == pytest.approx(0.6 * 0.3 * 0.3, rel=1e-10)
    assert abs(holder_result.summary["fibre_mass_error"]) < 1e-10


def test_fibre_volume_fraction_follows_thickness_and_shear(sheet):
    """v_f = m_A / (ρ_f t cos γ) for fibres that hardly stretch (values of section 2.6)."""
    last = sheet.isel(time=-1)
    expected = 0.6 / (1810.0 * last["thickness"].values * np.cos(last["shear_angle"].values))
    np.testing.assert_allclose(last["fibre_volume_fraction"].values, expected, rtol=3e-3)


def test_punch_force_is_that_of_a_light_fabric(holder_result):
    assert 15.0 < holder_result.summary["punch_force_max_N"] < 60.0


def test_check_expects_the_steps_that_are_made(holder_result):
    estimate = estimate_run(build_model(read_scene(SCENE)))
    assert estimate.step_count == pytest.approx(holder_result.summary["step_count"], rel=0.1)


def test_summary_has_every_promised_entry(holder_result):
    summary = json.loads((holder_result.folder / "summary.json").read_text())
    promised = """lcmchain_version scene_sha256 element_count node_count step_count process_time_s
    wall_s compile_s threads us_per_element_step energy kinetic_to_internal_max thickness_min_m
    thickness_max_m shear_angle_max_rad fibre_strain_max punch_force_max_N effects warnings"""
    assert set(promised.split()) <= set(summary)
    parts = "kinetic internal hourglass contact friction damping external balance_error"
    assert set(parts.split()) == set(summary["energy"])
    assert not [warning for warning in summary["warnings"] if "structure:" not in warning]


def test_the_program_finds_a_pace_at_which_every_verdict_is_good(holder_result):
    scene = read_scene(SCENE)
    found = verdicts(holder_result.summary, scene, holder_result.datasets)
    assert {verdict.grade for verdict in found} <= {GOOD, NOT_JUDGED}, found
    summary = holder_result.summary
    assert scene.time_is_found
    assert summary["pace"]["fastest_time_s"] == scene.process.time
    assert 1.0 <= summary["pace"]["sheet_time_s"] / scene.process.time < 1.2
    assert summary["damping_to_external"] < 0.01  # it acts on vibrations alone


def test_the_force_is_that_of_a_slow_process(holder_result):
    """27.21 N in a process four times as slow (examples/quasi_static/compare.py)."""
    loads = holder_result.summary["tool_loads"]["punch"]
    assert loads["force_max_N"] == pytest.approx(27.21, rel=0.01)
    assert abs(loads["force_max_N"] - 27.21) < loads["force_uncertainty_N"] < 1.0


def test_elements_half_as_long_as_the_fillet_hardly_move_the_force(holder_result):
    """Those of 7.5 mm move it by 1.9 N (examples/hemisphere_holder/convergence.py)."""
    loads = holder_result.summary["tool_loads"]["punch"]
    assert 0.1 < loads["force_ripple_N"] < 0.5
    assert loads["force_smooth_N"] == pytest.approx(26.8, rel=0.01)  # from 7.5 to 3.75 mm
    assert loads["force_quoted_N"] == loads["force_max_N"]
    assert "snaps" not in loads


@pytest.mark.slow
def test_elements_as_long_as_the_fillet_leave_the_quoted_force_as_it_is(tmp_path):
    """Half the size on 5 mm: a crest lies at the end of the stroke; 2.5 mm lead to 13.82 N."""
    scaled = runpy.run_path(str(SCENE.parents[1] / "quasi_static" / "compare.py"))["scaled"]
    quiet = ("output.pictures=false", "mapping=[]", "permeability=none")
    result = run(read_scene(SCENE, (*quiet, *scaled(0.5, 5.0))), tmp_path)
    loads = result.summary["tool_loads"]["punch"]
    assert loads["force_max_N"] > 1.05 * 13.82
    assert loads["force_quoted_N"] == pytest.approx(13.82, rel=0.03)
    assert abs(loads["force_quoted_N"] - 13.82) < loads["force_quoted_uncertainty_N"] < 1.5
    assert result.summary["punch_force_quoted_N"] == loads["force_quoted_N"]


def test_every_promised_file_is_there(holder_result):
    names = """forming.nc forming.vtu forming.pvd summary.json shear_angle.png thickness.png
    infiltration.nc infiltration.vtu infiltration.png structure.nc structure.vtu structure.png"""
    for name in names.split():
        assert (holder_result.folder / name).stat().st_size > 0, name
    assert not (holder_result.folder / "checkpoint.npz").exists()


@pytest.mark.parametrize("target", ["infiltration", "structure"])
def test_mapped_meshes_carry_the_fields(holder_result, target):
    report = holder_result.summary["mapping"][target]
    assert report["status_count"]["unmapped"] == 0
    assert report["target_coverage"] == pytest.approx(1.0, abs=1e-9)
    assert abs(report["conservation_error"]) < 1e-10
    mapped = xr.open_dataset(holder_result.folder / f"{target}.nc", engine="netcdf4")
    names = "thickness fibre_volume_fraction fibre_direction_1_x fibre_direction_2_x"
    for name in names.split():
        assert np.isfinite(mapped[name].values).all(), name
