"""Registration: how a target lies to the sheet, and the rigid motion between the two."""

import json
from dataclasses import replace

import meshio
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lcmchain.errors import InputError
from lcmchain.mapping import TargetMesh, map_file, read_sheet
from lcmchain.mapping.registration import registered, registration_of
from lcmchain.mapping.surfaces.surface import Surface

TURN, SHIFT = np.radians([0.6, -0.8, 0.5]), np.array([0.4e-3, -0.7e-3, 0.5e-3])


def waves(points):
    """A part without symmetry, 100 mm wide, with slopes up to 40 degrees."""
    x, y = points.T
    z = 0.012 * np.sin(60.0 * x + 0.4) * np.cos(45.0 * y) + 0.008 * np.sin(50.0 * (x + y))
    return np.stack([x, y, z], axis=1)


def dome(points):
    """Part of a sphere of 90 mm radius around the origin."""
    return np.concatenate(
        [points, np.sqrt(0.09**2 - (points**2).sum(axis=1, keepdims=True))], axis=1
    )


def moved(points, turn=TURN, shift=SHIFT):
    centre = points.mean(axis=0)
    return Rotation.from_rotvec(turn).apply(points - centre) + centre + shift


@pytest.fixture
def pair(make):
    """Sheet of 1 mm thickness on a shape, and points and cells of a target over part of it."""

    def made(shape, cells=20, half=0.035):
        points, quads = make.grid(cells, cells, (-0.05, -0.05), (0.05, 0.05), jitter=0.1)
        first, second = make.families(shape(points), quads)
        sheet = make.forming_result(
            shape(points), quads, fibre_direction_1=first, fibre_direction_2=second,
            areal_fibre_mass=lambda c: 0.6 + 2.0 * c[:, 0],
        )  # fmt: skip
        other, target = make.grid(17, 19, (-half, -half), (half, half), jitter=0.1, seed=9)
        return sheet, shape(other), make.triangles_of(target)

    return made


def shell(points, cells):
    return TargetMesh(points, (("triangle", cells),), {})


def test_a_known_motion_is_recovered_on_a_part_without_symmetry(pair):
    """To 0.03 mm of the 1.3 mm by which the nodes were moved; facets of 5 mm leave 0.02 mm."""
    result, points, cells = pair(waves)
    sheet = read_sheet(result)
    away = moved(points)
    found = registration_of(sheet, shell(away, cells))
    assert found.determined == 6 and found.compared == 1.0
    back = registered(shell(away, cells), found).points
    assert np.linalg.norm(away - points, axis=1).mean() > 0.9e-3
    assert np.linalg.norm(back - points, axis=1).max() < 0.03e-3
    assert np.linalg.norm(Rotation.from_rotvec(TURN).as_matrix() @ found.matrix - np.eye(3)) < 1e-3
    assert found.root_mean_square_after < 0.03 * found.root_mean_square
    # where it lies already, nothing moves it
    still = registration_of(sheet, shell(points, cells))
    assert still.root_mean_square < 0.02e-3
    assert np.linalg.norm(still.moved(points) - points, axis=1).max() < 0.02e-3
    assert still.warnings() == []


def test_repeated_nodes_are_one_place(pair):
    """As in files written face by face: the sheet is as curved as with shared nodes."""
    result, points, cells = pair(waves)
    sheet = read_sheet(result)
    surface = sheet.surface
    torn = Surface(surface.corners.reshape(-1, 3), np.arange(4 * len(surface.faces)).reshape(-1, 4))
    for target in (shell(points, cells), shell(moved(points), cells)):
        found = registration_of(replace(sheet, surface=torn), target)
        expected = registration_of(sheet, target)
        for one, other in ((found.shift, expected.shift), (found.rotation, expected.rotation)):
            np.testing.assert_allclose(one, other, atol=1e-9)


def test_what_does_not_belong_to_the_sheet_does_not_pull(pair):
    """A flange of the target, a sixth of it, stands 8 mm off: the rest lies right all the same."""
    result, points, cells = pair(waves)
    flange = points.copy()
    flange[points[:, 0] > 0.024, 2] += 0.008
    away = moved(flange)
    found = registration_of(read_sheet(result), shell(away, cells))
    plain = points[:, 0] < 0.015
    assert np.linalg.norm(found.moved(away) - flange, axis=1)[plain].max() < 0.25e-3


@pytest.mark.parametrize(("shape", "turns"), [("flat", 2), ("dome", 0)])
def test_a_target_does_not_slide_along_what_the_distances_leave_open(pair, make, shape, turns):
    """A plane fixes one shift and two turns, a sphere three shifts; noise does not add motions."""
    result, points, cells = pair({"flat": make.lifted, "dome": dome}[shape])
    noise = 0.02e-3 * np.random.default_rng(2).standard_normal(points.shape)
    found = registration_of(read_sheet(result), shell(points + noise, cells))
    assert found.determined == 3
    assert np.linalg.norm(found.moved(points) - points, axis=1).max() < 0.02e-3
    away = moved(points)
    found = registration_of(read_sheet(result), shell(away, cells))
    assert found.determined == 3
    assert found.root_mean_square > 0.3e-3 and found.root_mean_square_after < 0.01e-3
    if shape == "flat":
        np.testing.assert_allclose(found.moved(away)[:, 2], 0.0, atol=1e-9)
        np.testing.assert_allclose(found.rotation[:2], -TURN[:2], atol=1e-4)
        assert abs(found.rotation[2]) < 1e-6
        # along the plane only what turning it takes, not the shift of 0.8 mm
        assert np.linalg.norm(found.shift[:2]) < 1e-6
    else:
        centre = found.moved(Rotation.from_rotvec(TURN).apply(np.zeros((1, 3)) - points.mean(0))
                             + points.mean(0) + SHIFT)[0]  # fmt: skip
        assert np.linalg.norm(centre) < 0.02e-3  # of the sphere


def test_half_a_thickness_off_is_a_uniform_mean_and_no_warning(pair, make):
    """A target on the lower face of the sheet, as one meshed on the tool is."""
    result, points, cells = pair(dome)
    lower = points * (1.0 - 0.5e-3 / 0.09)
    found = registration_of(read_sheet(result), shell(lower, cells))
    np.testing.assert_allclose(found.signed_mean, -0.5e-3, rtol=5e-3)
    np.testing.assert_allclose(found.root_mean_square, 0.5e-3, rtol=5e-3)
    assert found.warnings() == []
    upper = points * (1.0 + 0.7e-3 / 0.09)
    found = registration_of(read_sheet(result), shell(upper, cells))
    np.testing.assert_allclose(found.signed_mean, 0.7e-3, rtol=5e-3)
    (warning,) = found.warnings()
    assert (
        "0.70" in warning
        and "mm above the sheet" in warning
        and "half the sheet's thickness of 1 mm" in warning
    )


def test_solids_are_compared_by_their_centroids(pair):
    result, points, _ = pair(dome)
    quads = np.arange(18 * 20).reshape(18, 20)
    quads = np.stack(
        [c.ravel() for c in (quads[:-1, :-1], quads[1:, :-1], quads[1:, 1:], quads[:-1, 1:])],
        axis=1,
    )
    both = np.concatenate([points * (1 - 1e-3 / 0.09), points])  # its middle is half a mm below
    solid = TargetMesh(both, (("hexahedron", np.hstack([quads, quads + len(points)])),), {})
    found = registration_of(read_sheet(result), solid)
    np.testing.assert_allclose(found.signed_mean, -0.5e-3, rtol=0.1)  # flat cells cut the dome


def test_a_tilted_target_is_told_and_mapped_where_it_belongs(pair, write_mesh, tmp_path):
    """Fields arrive as on the target that was never moved, turned with it."""
    result, points, cells = pair(waves)
    right = write_mesh(points, [("triangle", cells)], "right.vtu")
    options = {"picture": False, "kind": "structure", "maximum_distance": 0.02}
    map_file(result, right, tmp_path / "r.nc", **options)
    expected = meshio.read(tmp_path / "r.vtu").cell_data

    turn, shift = np.radians([2.0, -3.0, 1.5]), np.array([1e-3, -2e-3, 4e-3])
    away = moved(points, turn, shift)
    wrong = write_mesh(away, [("triangle", cells)], "wrong.vtu")
    report = map_file(result, wrong, tmp_path / "w.nc", **options)
    (warning,) = [text for text in report.warnings if "--register" in text]
    assert "Turned by 3.9" in warning and "degrees" in warning and "half the sheet's" in warning
    assert not report.registered and report.registration["root_mean_square"] > 2e-3

    off = meshio.read(tmp_path / "w.vtu").cell_data["areal_fibre_mass"][0]
    assert np.abs(off - expected["areal_fibre_mass"][0]).max() > 8e-3

    report = map_file(result, wrong, tmp_path / "w.nc", register=True, **options)
    assert report.registered and not any("--register" in text for text in report.warnings)
    assert "mapped as if turned by 3.9" in report.summary()
    assert json.loads((tmp_path / "w.json").read_text())["registration"] == report.registration
    found = meshio.read(tmp_path / "w.vtu")
    np.testing.assert_allclose(found.points, away, atol=1e-15)  # its own coordinates
    assert report.status_count["inside"] == len(cells)
    np.testing.assert_allclose(found.cell_data["thickness"][0], expected["thickness"][0], rtol=2e-4)
    # What is left of the offset changes the areas of cells against those of the sheet.
    np.testing.assert_allclose(
        found.cell_data["areal_fibre_mass"][0], expected["areal_fibre_mass"][0], rtol=4e-3
    )
    forward = Rotation.from_rotvec(turn)
    for name in ("fibre_direction_1", "fibre_direction_2"):
        aligned = np.einsum("ci,ci->c", found.cell_data[name][0],
                            forward.apply(expected[name][0]))  # fmt: skip
        assert np.degrees(np.arccos(np.clip(aligned, -1, 1))).max() < 0.2
    assert "--register" in report_history(tmp_path / "w.nc")


def report_history(path):
    import xarray as xr

    with xr.open_dataset(path) as dataset:
        return dataset.attrs["history"]


def test_unmapped_cells_of_a_shifted_target_name_the_motion(pair, write_mesh, tmp_path):
    result, points, cells = pair(waves)
    wrong = write_mesh(moved(points, np.zeros(3), [0, 0, 0.008]), [("triangle", cells)])
    with pytest.raises(InputError, match=r"no sheet within .* shifted by .*-8\.0.* --register"):
        map_file(result, wrong, tmp_path / "m.nc", picture=False)
    report = map_file(result, wrong, tmp_path / "m.nc", register=True, picture=False)
    assert report.status_count["unmapped"] == 0


def test_a_target_of_another_part_cannot_be_registered(pair, make, write_mesh, tmp_path):
    result, points, cells = pair(waves)
    other = points * [1.0, 1.0, -1.0]  # its mirror image
    with pytest.raises(InputError, match="cannot be registered: .* different shapes"):
        map_file(result, write_mesh(other, [("triangle", cells)]), tmp_path / "m.nc", register=True)
    far = write_mesh(points + 5.0, [("triangle", cells)])
    with pytest.raises(InputError, match="cannot be registered: it does not lie over the sheet"):
        map_file(result, far, tmp_path / "m.nc", register=True)
    assert not list(tmp_path.glob("m.*"))
