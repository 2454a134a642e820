"""Warnings where a result leaves what fibres and shear law allow."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lcmchain.fields import FrameSeries, build_datasets, model_datasets
from lcmchain.judgements.fields import field_warnings
from lcmchain.mesh.blank import build_blank
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text

SCENE = """
title = "four elements"
process = { time = "20 ms", frames = 3 }
blank = { size = ["20 mm", "20 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }
"""


def frames_of(mesh):
    return FrameSeries(
        time=np.array([0.0, 0.01, 0.02]),
        positions=np.stack([mesh.node_positions] * 3),
        tool_travel=np.zeros((3, 0)),
        tool_force=np.zeros((3, 0, 3)),
        history=np.zeros((3, 0)),
    )


@pytest.fixture
def scene():
    return scene_from_text(SCENE)


@pytest.fixture
def sheet(scene):
    blank = build_blank(scene.blank, scene.material.thickness)
    return build_datasets(scene, blank, frames_of(blank))["/"]


def warnings_of(scene, sheet):
    return field_warnings(sheet, scene.material.build())


def test_packed_fibres_are_told_with_place_shear_thickness_and_share(scene, sheet):
    """The worst element of any frame, and all that were above 0.9 in any."""
    fraction, angle = sheet["fibre_volume_fraction"].values, sheet["shear_angle"].values
    fraction[:] = 0.9  # not above
    assert warnings_of(scene, sheet) == []
    fraction[1, 3], fraction[2, 1] = 0.97, 0.95
    angle[1, 3], sheet["thickness"].values[1, 3] = math.radians(-48.5), 0.81e-3
    (warning,) = warnings_of(scene, sheet)
    for words in (
        "exceeds 0.9 in 2 elements (50.00% of the area)",
        "up to 0.97 in element 3 at (5.0, 5.0, 0.0) mm at 10 ms",
        "shear angle 48.5 deg",
        "thickness 0.810 mm",
    ):
        assert words in warning, warning


def test_shear_beyond_the_measured_range_is_told_with_its_share(scene, sheet):
    angle = sheet["shear_angle"].values
    angle[:] = math.radians(59.9)
    assert warnings_of(scene, sheet) == []
    angle[1, 0] = math.radians(-64.2)
    angle[2, 2] = math.radians(61.0)
    angle[2, 0] = 0.0
    (warning,) = warnings_of(scene, sheet)
    for words in (
        "exceeds 60 deg, up to which the shear law was measured",
        "in 2 elements (50.00% of the area)",
        "up to 64.2 deg in element 0 at (-5.0, -5.0, 0.0) mm at 10 ms",
        "extrapolated",
        "locking_angle",
    ):
        assert words in warning, warning


def test_a_law_without_a_range_warns_of_none(sheet):
    sheet["shear_angle"].values[:] = 1.4
    scene = scene_from_text(SCENE)
    material = scene.material.build()
    material.shear_range = None
    assert field_warnings(sheet, material) == []


def test_the_range_of_a_scene_replaces_that_of_the_preset(sheet):
    scene = scene_from_text(SCENE.replace('"MD600"', '"MD600", membrane.shear_range = "35 deg"'))
    sheet["shear_angle"].values[2, 1] = math.radians(40.0)
    (warning,) = warnings_of(scene, sheet)
    assert "exceeds 35 deg" in warning and "1 element (25.00% of the area)" in warning


def test_triangles_are_packed_at_their_initial_thickness():
    scene = scene_from_text(SCENE + 'element = "membrane-shell"\n')
    model = build_model(scene)
    sheet = model_datasets(scene, model, frames_of(model.only_body().mesh))["/"]
    assert len(field_warnings(sheet, model.only_body().material)) == 1  # predicts no thickness
    sheet["areal_fibre_mass"].values[2, 5] = 0.92 * 1810.0 * 1.004e-3
    warning = field_warnings(sheet, model.only_body().material)[1]
    assert "1 element (12.50% of the area), up to 0.92 in element 5" in warning
    assert "at the initial thickness" in warning
