"""Fields of fabrics with one, two and three families, and what reads them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from of_families import fabric, fibres, like_md600, pair, triaxial, unidirectional

from lcmchain.coupling.forming_fields import permeability_fields
from lcmchain.coupling.permeability import PermeabilityLaw, aligned_permeabilities
from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries
from lcmchain.fields.dataset import LaidSheet, SheetFrames, laid_datasets, sheets_datasets
from lcmchain.fields.sheet import (
    BUCKLES,
    families_of,
    fibre_strains,
    mesh_axes,
    sheet_faces,
    vector,
)
from lcmchain.fields.stack import ply_sheet
from lcmchain.fields.summary import field_summary
from lcmchain.fields.wrinkles import elements_per_wave
from lcmchain.report.fibre_segments import fibre_lines
from lcmchain.scene import scene_from_text

OBLIQUE = fabric(fibres(20.0, compression=10.0), fibres(-30.0), shear=[pair(1, 2)])
FABRICS = {
    "one": unidirectional(10.0), "oblique": OBLIQUE, "two": like_md600(), "three": triaxial(5.0)
}  # fmt: skip
SCENE = """
process = { time = "1 s" }
blank = { size = ["60 mm", "50 mm"], edge_length = "10 mm", fibre_angle = "25 deg" }
material = { preset = "MD600" }
"""
#: Deformation gradient of the sheet: sheared, stretched, thinner, not symmetric.
F = np.array([[1.02, 0.3, 0.0], [0.05, 0.9, 0.0], [0.0, 0.0, 0.8]])
LAY = math.radians(25.0)
GEBART = PermeabilityLaw()


def formed(material, gradient=F):
    """The sheet of a result: its start, and after a deformation gradient."""
    scene = scene_from_text(SCENE)
    blank = scene.stack[0].build_blank()
    frames = frames_of(blank, gradient)
    return blank, laid_datasets(scene, LaidSheet(blank, material.build()), frames, {})


def frames_of(blank, gradient=F):
    """The start of a blank, and the blank after a deformation gradient."""
    return FrameSeries(
        time=np.array([0.0, 1.0]),
        positions=np.stack([blank.node_positions, blank.node_positions @ gradient.T]),
        tool_travel=np.zeros((2, 0)),
        tool_force=np.zeros((2, 0, 3)),
    )


def line(degrees):
    """Unit vector of the undeformed sheet at an angle from the axis of the ply."""
    angle = LAY + math.radians(degrees)
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def between(a, b):
    """Angle from a to b about z, of lines without a sense [rad], in (0, π)."""
    return math.atan2(a[0] * b[1] - a[1] * b[0], a @ b) % math.pi


@pytest.mark.parametrize("name", FABRICS)
def test_every_family_and_no_other_leaves_with_direction_and_strain(name):
    material = FABRICS[name]
    sheet = formed(material)[1]["/"]
    angles = np.degrees(material.fibre_angles)
    assert families_of(sheet) == tuple(range(1, 1 + len(angles)))
    for number, angle in enumerate(angles, start=1):
        carried = F @ line(angle)
        length = np.linalg.norm(carried)
        found = vector(sheet, f"fibre_direction_{number}", -1)
        np.testing.assert_allclose(found, np.tile(carried / length, (len(found), 1)), atol=1e-12)
        np.testing.assert_allclose(sheet[f"fibre_strain_{number}"][-1], length - 1.0, atol=1e-12)
    assert f"fibre_direction_{len(angles) + 1}_x" not in sheet
    assert ("strain_across" in sheet) == (name == "one")
    assert ("shear_angle_23" in sheet) == (name == "three")


PAIRS = {
    "one": {"shear_angle": (10.0, 100.0)},
    "oblique": {"shear_angle": (20.0, -30.0)},
    "two": {"shear_angle": (0.0, 90.0)},
    "three": {
        "shear_angle": (5.0, 65.0), "shear_angle_23": (65.0, -55.0), "shear_angle_31": (-55.0, 5.0)
    },
}  # fmt: skip


@pytest.mark.parametrize("name", PAIRS)
def test_shear_angles_are_the_change_between_two_lines(name):
    sheet = formed(FABRICS[name])[1]["/"]
    for field, (first, second) in PAIRS[name].items():
        a, b = line(first), line(second)
        change = between(a, b) - between(F @ a, F @ b)
        np.testing.assert_allclose(sheet[field][0], 0.0, atol=1e-12)
        np.testing.assert_allclose(sheet[field][-1], change, atol=1e-12)


def test_a_single_family_tells_how_its_gaps_open():
    sheet = formed(FABRICS["one"])[1]["/"]
    stretch = np.linalg.norm(F @ line(100.0))
    np.testing.assert_allclose(sheet["strain_across"][-1], stretch - 1.0, atol=1e-12)


def test_the_compression_of_fibres_that_buckle_is_no_strain_that_breaks_them():
    squeezed = np.diag([0.9, 0.9, 1.0])
    groups = formed(OBLIQUE, squeezed)[1]
    strains = fibre_strains(groups["/"])[:, -1]
    assert groups["/"]["fibre_strain_1"].attrs[BUCKLES] == 1
    np.testing.assert_allclose(strains, 0.0, atol=1e-12)
    stiff = formed(FABRICS["three"], squeezed)[1]
    assert BUCKLES not in stiff["/"]["fibre_strain_1"].attrs
    np.testing.assert_allclose(fibre_strains(stiff["/"])[:, -1], 0.1, atol=1e-12)
    assert field_summary(stiff)["fibre_strain_max"] == pytest.approx(0.1)
    assert field_summary(groups)["fibre_strain_max"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", FABRICS)
def test_the_mesh_keeps_its_axes_whatever_the_families(name):
    blank, groups = formed(FABRICS[name])
    first, second = mesh_axes(groups["/"])
    np.testing.assert_allclose(first, blank.fibre_direction_1, atol=1e-12)
    np.testing.assert_allclose(second, blank.fibre_direction_2, atol=1e-12)
    assert np.isinf(elements_per_wave(groups["/"])).all()


@pytest.mark.parametrize("name", FABRICS)
def test_drawn_lines_lie_along_every_family(name):
    sheet = formed(FABRICS[name])[1]["/"]
    points = vector(sheet, "reference_position") + vector(sheet, "displacement", -1)
    found = fibre_lines(sheet, points)
    assert [number for number, _ in found] == list(families_of(sheet))
    for number, pieces in found:
        assert len(pieces) > 20
        way = pieces[:, 1] - pieces[:, 0]
        way /= np.linalg.norm(way, axis=1)[:, None]
        along = vector(sheet, f"fibre_direction_{number}", -1)[0]
        off = np.abs(np.abs(way @ along) - 1.0)
        # edges of the mesh next to the cut are moved aside
        assert (np.median(off) if name == "two" else off.max()) < 1e-9


def test_drawn_lines_end_at_the_lips_of_an_open_slit():
    cut = SCENE.replace('"50 mm"]', '"50 mm"], slits = [[["30 mm", "0 mm"], ["-10 mm", "0 mm"]]]')
    scene = scene_from_text(cut.replace('"10 mm"', '"5 mm"'))
    blank = scene.stack[0].build_blank()
    fields = LaidSheet(blank, FABRICS["three"].build())
    sheet = laid_datasets(scene, fields, frames_of(blank), {})["/"]
    points, faces = vector(sheet, "reference_position").copy(), sheet_faces(sheet)
    upper = np.unique(faces[points[faces, 1].mean(axis=1) > 0.0])
    points[upper, 1] += 0.2 * np.maximum(points[upper, 0] + 0.01, 0.0)  # 8 mm at the rim
    for _, pieces in fibre_lines(sheet, points):
        length = np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1)
        assert len(pieces) > 20 and length.max() < 2.2 * np.median(length)


def test_plies_with_other_families_lie_in_one_stack():
    """A unidirectional ply below a woven one: what one of them lacks is nan in the root group."""
    text = SCENE.replace("[material]", "").replace(', fibre_angle = "25 deg"', "")
    scene = scene_from_text(text + 'layup = "[25, 25]"')
    sheets, frames = {}, None
    for ply, table in zip(scene.stack, (FABRICS["one"], scene.material), strict=True):
        blank = ply.build_blank()
        frames = frames_of(blank)
        none = np.empty((2, 0, blank.element_count))
        sheets[ply.name] = SheetFrames(
            LaidSheet(blank, table.build()), frames.positions, none, {}, None, None, np.nan
        )
    groups = sheets_datasets(scene, sheets, frames)
    root = groups["/"]
    assert families_of(root) == (1, 2)
    woven = root["body"].values == 1
    assert np.isnan(root["fibre_strain_2"].values[:, ~woven]).all()
    assert np.isfinite(root["fibre_strain_2"].values[:, woven]).all()
    assert BUCKLES not in root["fibre_strain_1"].attrs
    assert BUCKLES in groups["/ply_1"]["fibre_strain_1"].attrs
    assert all(np.isfinite(axis).all() for axis in mesh_axes(root))
    first, second = mesh_axes(ply_sheet(groups, "ply_1"))
    np.testing.assert_allclose(first @ line(0.0), 1.0)
    np.testing.assert_allclose(second @ line(90.0), 1.0)
    found = permeability_fields(GEBART, root)
    k1, k2 = (found[f"permeability_{k}"][0][-1] for k in (1, 2))
    one, two = permeabilities(FABRICS["one"])[0], permeabilities(FABRICS["two"])[0]
    np.testing.assert_allclose(k1[~woven], one[0], rtol=1e-9)
    np.testing.assert_allclose(k2[woven], two[1], rtol=1e-9)


# --- permeability ---------------------------------------------------------------------------------


def permeabilities(material, gradient=F, law=GEBART):
    sheet = formed(material, gradient)[1]["/"]
    found = permeability_fields(law, sheet)
    values = [found[f"permeability_{k}"][0][-1, 0] for k in (1, 2, 3)]
    axes = [found[f"permeability_direction_{k}"][-1, 0] for k in (1, 2, 3)]
    fraction = float(sheet["fibre_volume_fraction"][-1, 0])
    return values, axes, [float(k) for k in aligned_permeabilities(law, fraction)]


def test_a_single_family_conducts_along_and_across_its_fibres():
    (k1, k2, k3), axes, (along, across) = permeabilities(FABRICS["one"])
    assert (k1, k2, k3) == pytest.approx((along, across, across))
    carried = F @ line(10.0)
    assert abs(axes[0] @ carried) == pytest.approx(np.linalg.norm(carried))
    assert abs(axes[2][2]) == pytest.approx(1.0)


def test_three_families_conduct_as_the_mean_of_their_plies():
    (k1, k2, k3), axes, (along, across) = permeabilities(FABRICS["three"])
    mean = np.zeros((3, 3))
    for angle in (5.0, 65.0, -55.0):
        a = F @ line(angle)
        a /= np.linalg.norm(a)
        mean += (across * np.eye(3) + (along - across) * np.outer(a, a)) / 3.0
    tensor = k1 * np.outer(axes[0], axes[0]) + k2 * np.outer(axes[1], axes[1])
    np.testing.assert_allclose(tensor[:2, :2], mean[:2, :2], rtol=1e-9)
    assert k1 > k2 and k3 == pytest.approx(across)
    (k1, k2, _), _, _ = permeabilities(FABRICS["three"], np.diag([1.0, 1.0, 0.9]))
    assert k1 == pytest.approx(k2)


def test_two_families_at_a_right_angle_conduct_as_a_fabric_does():
    ours = permeabilities(FABRICS["two"])
    sheet = formed(scene_from_text(SCENE).material)[1]["/"]
    theirs = permeability_fields(GEBART, sheet)
    for k in (1, 2, 3):
        assert ours[0][k - 1] == pytest.approx(theirs[f"permeability_{k}"][0][-1, 0], rel=1e-12)


def test_a_measured_law_knows_one_or_two_families():
    text = (
        SCENE
        + """
[permeability]
law = "constant"
k1 = "3e-10 m^2"
k2 = "1e-10 m^2"
k3 = "1e-11 m^2"
"""
    )
    law = scene_from_text(text).permeability
    sheet = formed(FABRICS["one"])[1]["/"]
    found = permeability_fields(law, sheet)
    assert found["permeability_1"][0][-1, 0] == pytest.approx(3e-10)
    assert found["permeability_2"][0][-1, 0] == pytest.approx(1e-10)
    sheet = formed(FABRICS["three"])[1]["/"]
    with pytest.raises(InputError, match="one or two families carry along") as caught:
        permeability_fields(law, sheet)
    assert caught.value.key == "permeability.law"
