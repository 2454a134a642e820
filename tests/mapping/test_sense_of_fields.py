"""What depends on the side of the target's normals, and what does not."""

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from lcmchain.mapping import TargetMesh, compute_weights, map_file, read_sheet, transfer

SHEAR = np.radians(25.0)


@pytest.fixture
def bowl(make):
    """Points, faces and families of a bowl of 100 mm, sheared by 25 degrees."""
    points, quads = make.grid(14, 14, (-0.05, -0.05), (0.05, 0.05), jitter=0.1)
    points = make.bowl(points, depth=6.0)
    return points, quads, *make.families(points, quads, SHEAR)


def result_of(make, points, quads, first, second):
    return make.forming_result(
        points, quads, shear_angle=SHEAR, fibre_direction_1=first, fibre_direction_2=second,
        areal_fibre_mass=0.6,
    )  # fmt: skip


@pytest.fixture
def cells(make):
    points, quads = make.grid(9, 9, (-0.04, -0.04), (0.04, 0.04), jitter=0.1, seed=9)
    return make.bowl(points, depth=6.0), quads


def onto(source, points, quads):
    sheet, target = read_sheet(source), TargetMesh(points, (("quad", quads),), {})
    return transfer(sheet, target, compute_weights(sheet, target)), target


def angle_between_axes(mapped, normals):
    """Right angle minus that from the axis of fibre 1 to that of fibre 2 about the normals."""
    first, second = (mapped.directions[f"fibre_direction_{k}"].direction for k in "12")
    sine = np.einsum("ci,ci->c", np.cross(first, second), normals)
    return np.arctan(np.einsum("ci,ci->c", first, second) / sine)


def test_the_shear_angle_is_that_about_the_normal_of_the_cell(make, bowl, cells):
    """It is the angle that a reader finds from the mapped fibres, from whatever side."""
    points, quads = cells
    for turned in (quads, quads[:, ::-1]):
        mapped, target = onto(result_of(make, *bowl), points, turned)
        expected = angle_between_axes(mapped, target.surface.normals)
        np.testing.assert_allclose(mapped.scalars["shear_angle"], expected, atol=np.radians(1.5))
    up, down = (onto(result_of(make, *bowl), points, c)[0] for c in (quads, quads[:, ::-1]))
    np.testing.assert_allclose(up.scalars["shear_angle"], SHEAR, rtol=1e-12)
    np.testing.assert_allclose(down.scalars["shear_angle"], -SHEAR, rtol=1e-12)
    for name in ("areal_fibre_mass", "thickness", "fibre_volume_fraction"):
        np.testing.assert_allclose(down.scalars[name], up.scalars[name], rtol=1e-12)
    for name, family in up.directions.items():
        np.testing.assert_allclose(down.directions[name].direction, family.direction, atol=1e-12)


def test_heads_of_fibres_and_turns_of_the_part_leave_the_shear_angle(make, bowl, cells):
    points, quads, first, second = bowl
    signs = np.random.default_rng(1).choice([-1.0, 1.0], (2, len(quads), 1))
    whole = onto(result_of(make, *bowl), *cells)[0].scalars["shear_angle"]
    flipped = result_of(make, points, quads, signs[0] * first, signs[1] * second)
    np.testing.assert_allclose(onto(flipped, *cells)[0].scalars["shear_angle"], whole, rtol=1e-12)
    turn = Rotation.from_rotvec([3.0, 0.4, -0.2])  # nearly upside down
    turned = result_of(make, *(turn.apply(a) if a.shape[1] == 3 else a for a in bowl))
    found = onto(turned, turn.apply(cells[0]), cells[1])[0].scalars["shear_angle"]
    np.testing.assert_allclose(found, whole, rtol=1e-12)


def test_files_say_about_which_normal_and_mixed_normals_are_told(
    make, bowl, cells, write_mesh, tmp_path
):
    points, quads = cells
    mixed = quads.copy()
    mixed[:20] = quads[:20, ::-1]
    report = map_file(result_of(make, *bowl), write_mesh(points, [("quad", mixed)]),
                      tmp_path / "m.nc", picture=False)  # fmt: skip
    assert report.opposite_normals == 20
    (warning,) = [text for text in report.warnings if "lower side" in text]
    assert "of 20 cells" in warning and "those of 61" in warning
    with xr.open_dataset(tmp_path / "m.nc") as dataset:
        assert "normal of the cell" in dataset["shear_angle"].attrs["comment"]
        assert (dataset["shear_angle"].values < 0).sum() == 20
    for faces, count in ((quads, 0), (quads[:, ::-1], 81)):
        report = map_file(result_of(make, *bowl), write_mesh(points, [("quad", faces)]),
                          tmp_path / "m.nc", picture=False)  # fmt: skip
        assert report.opposite_normals == count
        assert not any("lower side" in text for text in report.warnings)


def test_alignment_of_each_family_is_a_field(make, write_mesh, tmp_path):
    """1 where the fibres of a cell are parallel; where two directions meet at 60 degrees, 3/4."""
    points, quads = make.grid(20, 10, (-0.1, 0.0), (0.1, 0.1))
    points = make.lifted(points)
    right = points[quads].mean(axis=1)[:, 0] > 0.0
    turn = np.where(right, np.radians(60.0), 0.0)
    first = np.stack([np.cos(turn), np.sin(turn), np.zeros(len(turn))], axis=1)
    second = np.broadcast_to([0.0, 1.0, 0.0], first.shape)
    source = result_of(make, points, quads, first, second)
    coarse = np.array([[-0.1, 0, 0], [-0.05, 0, 0], [0.05, 0, 0], [0.1, 0, 0],
                       [-0.1, 0.1, 0], [-0.05, 0.1, 0], [0.05, 0.1, 0], [0.1, 0.1, 0]])  # fmt: skip
    target = write_mesh(coarse, [("quad", [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6]])])
    map_file(source, target, tmp_path / "m.nc", picture=False)
    with xr.open_dataset(tmp_path / "m.nc") as dataset:
        found = dataset["fibre_direction_1_alignment"]
        np.testing.assert_allclose(found, [1.0, 0.75, 1.0], rtol=1e-12)
        assert found.attrs["units"] == "1" and "eigenvalue" in found.attrs["comment"]
        np.testing.assert_allclose(dataset["fibre_direction_2_alignment"], 1.0, rtol=1e-12)


def test_a_mapped_file_is_mapped_further(make, bowl, cells, write_mesh, tmp_path):
    points, quads = cells
    flipped = write_mesh(points, [("quad", quads[:, ::-1])])
    map_file(result_of(make, *bowl), flipped, tmp_path / "m.nc", picture=False)
    map_file(tmp_path / "m.nc", write_mesh(points, [("quad", quads)], "up.vtu"), tmp_path / "n.nc",
             picture=False)  # fmt: skip
    with xr.open_dataset(tmp_path / "n.nc") as dataset:  # about the normals of the first target
        np.testing.assert_allclose(dataset["shear_angle"].values, SHEAR, rtol=1e-12)
        assert dataset["fibre_direction_1_alignment"].min() > 0.99
