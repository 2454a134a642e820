"""Permeability in a forming result: values and axes of every element in every saved state."""

import numpy as np
import pytest

from lcmchain.coupling.forming_fields import permeability_fields
from lcmchain.coupling.permeability import aligned_permeabilities
from lcmchain.fields import FrameSeries, add_face_variables, build_datasets
from lcmchain.fields.sheet import vector
from lcmchain.mesh.blank import build_blank
from lcmchain.quantities.fields import FIELDS
from lcmchain.scene import scene_from_text

SCENE = """
title = "Plate"
process = { time = "20 ms" }
blank = { size = ["40 mm", "40 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }
permeability = { law = "gebart", fibre_radius = "3.5 um" }
"""
SHEAR = np.radians([0.0, 25.0, -25.0])


@pytest.fixture(scope="module")
def scene():
    return scene_from_text(SCENE)


@pytest.fixture(scope="module")
def sheet(scene):
    """A tilted sheet that is sheared to one side and to the other."""
    blank = build_blank(scene.blank, scene.material.thickness)
    x, y, z = blank.node_positions.T
    states = [np.stack([x + np.tan(angle) * y, y, z + 0.3 * x], axis=1) for angle in SHEAR]
    frames = FrameSeries(
        time=np.array([0.0, 0.01, 0.02]),
        positions=np.stack(states),
        tool_travel=np.zeros((3, 0)),
        tool_force=np.zeros((3, 0, 3)),
    )
    groups = build_datasets(scene, blank, frames)
    return add_face_variables(groups, permeability_fields(scene.permeability, groups["/"]))["/"]


def outer(vectors):
    return np.einsum("fei,fej->feij", vectors, vectors)


def test_axes_and_values_rebuild_the_tensor_of_both_plies(sheet, scene):
    along, across = aligned_permeabilities(
        scene.permeability, sheet["fibre_volume_fraction"].values
    )
    excess = (along - across)[..., None, None]
    families = [outer(vector(sheet, f"fibre_direction_{n}")) for n in (1, 2)]
    expected = across[..., None, None] * np.eye(3) + 0.5 * excess * (families[0] + families[1])
    rebuilt = sum(
        sheet[f"permeability_{n}"].values[..., None, None]
        * outer(vector(sheet, f"permeability_direction_{n}"))
        for n in (1, 2, 3)
    )
    np.testing.assert_allclose(rebuilt, expected, atol=1e-10 * along.max())
    spread = sheet["permeability_1"].values / sheet["permeability_2"].values
    assert spread[0] == pytest.approx(1.0) and np.all(spread[1:] > 1.5)


def test_the_third_axis_points_to_the_upper_side_whichever_way_the_sheet_is_sheared(sheet):
    one = np.ones_like(SHEAR)
    normals = np.stack([-0.3 * one, 0.3 * np.tan(SHEAR), one], axis=1)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    axes = vector(sheet, "permeability_direction_3")
    expected = np.broadcast_to(normals[:, None], axes.shape)
    np.testing.assert_allclose(axes, expected, atol=1e-12)
    frame = np.stack([vector(sheet, f"permeability_direction_{n}") for n in (1, 2, 3)], axis=-1)
    np.testing.assert_allclose(np.linalg.det(frame), 1.0, rtol=1e-12)


def test_every_field_says_what_it_is(sheet):
    for number in (1, 2, 3):
        about = sheet[f"permeability_{number}"].attrs
        assert about["long_name"] == f"principal permeability {number} (gebart)"
        assert (about["units"], about["mesh"], about["location"]) == ("m2", "sheet", "face")
        assert about["comment"] == FIELDS[f"permeability_{number}"].meaning
        axis = sheet[f"permeability_direction_{number}_y"].attrs
        assert (axis["units"], axis["mesh"], axis["location"]) == ("1", "sheet", "face")
        assert axis["comment"] == FIELDS[f"permeability_direction_{number}"].meaning
