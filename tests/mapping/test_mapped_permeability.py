"""Permeability on a target: tensors are mapped, in the plane of each cell."""

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.coupling.permeability import PermeabilityLaw, principal_permeabilities
from lcmchain.mapping import map_file, read_sheet

LAW = PermeabilityLaw(packing="hexagonal")
VALUES = [f"permeability_{number}" for number in (1, 2, 3)]
AXES = [f"permeability_direction_{number}" for number in (1, 2, 3)]


def with_permeability(result, first, second, fraction=0.5):
    """Add what the law makes of the families (F, 3), to every saved state."""
    found = principal_permeabilities(LAW, np.full(len(first), fraction), first, second)
    changed = result.copy()
    for name, values in zip(VALUES, (found.k1, found.k2, found.k3), strict=True):
        attributes = {"units": "m2", "long_name": name, "comment": "of the test"}
        changed[name] = ("sheet_face", values, attributes)
    axes = (found.direction_1, found.direction_2, found.direction_3)
    for name, vectors in zip(AXES, axes, strict=True):
        for axis, values in zip("xyz", vectors.T, strict=True):
            changed[f"{name}_{axis}"] = ("sheet_face", values, {"units": "1", "long_name": name})
    return changed


def tensors(first, second, fraction=0.5):
    """Mean tensors (C, 3, 3) of the plies, which is what the law is made of."""
    found = principal_permeabilities(LAW, np.full(len(first), fraction), first, second)
    return tensors_of(found[:3], found[3:])


def tensors_of(values, axes):
    return sum(
        k[:, None, None] * np.einsum("ci,cj->cij", e, e) for k, e in zip(values, axes, strict=True)
    )


def mapped_onto(source, target, tmp_path, **options):
    """Values (3, C) and axes (3, C, 3) on the target, and the report."""
    report = map_file(source, target, tmp_path / "mapped.vtu", picture=False, **options)
    data = meshio.read(tmp_path / "mapped.vtu").cell_data
    values, axes = (np.array([data[name][0] for name in names]) for names in (VALUES, AXES))
    return values, axes, report


def sheared(x, largest):
    """Families whose shear angle grows from one side to the other, through zero in the middle."""
    angle = 2.0 * largest * x
    zero = np.zeros_like(angle)
    first = np.stack([np.cos(angle / 2), np.sin(angle / 2), zero], axis=1)
    return first, np.stack([np.sin(angle / 2), np.cos(angle / 2), zero], axis=1)


def test_the_tensor_is_continuous_where_the_shear_changes_its_sign(make, write_mesh, tmp_path):
    """There the axes jump by a right angle, and a mean of axes would have no meaning."""
    largest = np.radians(20.0)
    points, quads = make.grid(24, 5, (-0.5, -0.1), (0.5, 0.1), jitter=0.1)
    points = make.lifted(points)
    first, second = sheared(points[quads].mean(axis=1)[:, 0], largest)
    source = with_permeability(make.forming_result(points, quads), first, second)
    fine, cells = make.grid(17, 4, (-0.45, -0.08), (0.45, 0.08), jitter=0.1, seed=4)
    fine = make.lifted(fine)
    values, axes, _ = mapped_onto(source, write_mesh(fine, [("quad", cells)]), tmp_path)

    found = tensors_of(values, axes)
    expected = tensors(*sheared(fine[cells].mean(axis=1)[:, 0], largest))
    error = np.abs(found - expected).max(axis=(1, 2)) / values[0]
    assert error.max() < 0.02  # the shear changes by 1.7 degrees from face to face
    assert np.all(values[0] >= values[1]) and np.all(values[1] > 0.0)
    # and it did jump: the larger axis leans to either side
    assert np.unique(np.sign(axes[0, :, 0] * axes[0, :, 1])).tolist() == [-1.0, 1.0]


def rolled(points, radius):
    """Roll a plate about the y axis."""
    angle = points[:, 0] / radius
    return np.stack([radius * np.sin(angle), points[:, 1], radius * np.cos(angle)], axis=1)


def families_on(points, faces, to_generator, shear):
    """Families at an angle to the generators of a cylinder, which run along y."""
    corners = points[faces]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    along = np.broadcast_to([0.0, 1.0, 0.0], normal.shape)
    across = np.cross(normal, along)
    return tuple(
        np.cos(angle) * along + np.sin(angle) * across
        for angle in (to_generator, to_generator + np.pi / 2 - shear)
    )


@pytest.fixture
def cylinder(make):
    """Source on 16 facets of a quarter of a cylinder, sheared by 30 degrees."""
    points, quads = make.grid(16, 6, (-0.08, -0.05), (0.08, 0.05))
    points = rolled(points, 0.1)
    first, second = families_on(points, quads, 0.4, np.radians(30.0))
    return with_permeability(make.forming_result(points, quads), first, second)


def test_bends_of_the_target_change_no_value(make, write_mesh, cylinder, tmp_path):
    points, quads = make.grid(5, 4, (-0.07, -0.04), (0.07, 0.04))
    points = rolled(points, 0.1)
    values, axes, _ = mapped_onto(cylinder, write_mesh(points, [("quad", quads)]), tmp_path)
    given = np.array([cylinder[name].values[0] for name in VALUES])
    np.testing.assert_allclose(values, np.tile(given[:, None], 20), rtol=1e-11)
    expected = tensors(*families_on(points, quads, 0.4, np.radians(30.0)))
    np.testing.assert_allclose(tensors_of(values, axes), expected, atol=1e-11 * given[0])


def test_the_axes_leave_in_the_netcdf_file(make, write_mesh, cylinder, tmp_path):
    points, quads = make.grid(5, 4, (-0.07, -0.04), (0.07, 0.04))
    mapped_onto(cylinder, write_mesh(rolled(points, 0.1), [("quad", quads)]), tmp_path)
    with xr.open_dataset(tmp_path / "mapped.nc") as dataset:
        axes = np.array([[dataset[f"{name}_{a}"].values for a in "xyz"] for name in AXES])
        assert all(dataset[f"{name}_x"].attrs["units"] == "1" for name in AXES)
    identity = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, 20))
    np.testing.assert_allclose(np.einsum("kic,lic->klc", axes, axes), identity, atol=1e-12)


def test_signs_of_the_axes_mean_nothing(make, write_mesh, cylinder, tmp_path):
    flipped = cylinder.copy(deep=True)
    signs = np.random.default_rng(3).choice([-1.0, 1.0], (3, flipped.sizes["sheet_face"]))
    for name, sign in zip(AXES, signs, strict=True):
        for axis in "xyz":
            flipped[f"{name}_{axis}"].values *= sign
    points, quads = make.grid(5, 4, (-0.07, -0.04), (0.07, 0.04), jitter=0.1)
    target = write_mesh(rolled(points, 0.1), [("quad", quads)])
    values, axes, _ = mapped_onto(cylinder, target, tmp_path)
    again, turned, _ = mapped_onto(flipped, target, tmp_path)
    np.testing.assert_allclose(again, values, rtol=1e-12)
    np.testing.assert_allclose(np.abs(np.einsum("kci,kci->kc", axes, turned)), 1.0, rtol=1e-12)


def test_solid_cells_take_the_axis_through_the_sheet(make, write_mesh, cylinder, tmp_path):
    points, quads = make.grid(16, 6, (-0.08, -0.05), (0.08, 0.05))
    faces = np.hstack([quads, quads + len(points)])
    points = np.concatenate([rolled(points, 0.0995), rolled(points, 0.1005)])
    target = write_mesh(points, [("hexahedron", faces)])
    values, axes, _ = mapped_onto(cylinder, target, tmp_path)
    given = np.array([cylinder[name].values[0] for name in VALUES])
    np.testing.assert_allclose(values, np.tile(given[:, None], 96), rtol=0.02)
    sheet = read_sheet(cylinder).surface.normals  # the cells lie over the faces, one by one
    np.testing.assert_allclose(np.abs(np.einsum("ci,ci->c", axes[2], sheet)), 1.0, atol=1e-3)


def test_faces_beyond_the_law_leave_their_cells_without_permeability(
    make, write_mesh, cylinder, tmp_path
):
    holed = cylinder.copy(deep=True)
    for name in VALUES:
        holed[name].values[40] = np.nan
    points, quads = make.grid(16, 6, (-0.08, -0.05), (0.08, 0.05))  # the same faces
    target = write_mesh(rolled(points, 0.1), [("quad", quads)])
    values, axes, report = mapped_onto(holed, target, tmp_path)
    assert np.isnan(values[:, 40]).all() and np.isnan(axes[:, 40]).all()
    lost = np.isnan(values).any(axis=0)
    assert lost.sum() < 10  # the face and what of its neighbours reaches into it by a rounding
    assert np.isfinite(axes[:, ~lost]).all()
    (warning,) = [text for text in report.warnings if "no permeability" in text]
    assert warning.startswith(f"{lost.sum()} cells")
