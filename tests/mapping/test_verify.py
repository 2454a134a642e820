"""The error that a mapping adds: the estimate against the true error of known functions."""

import json

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.coupling.permeability import PermeabilityLaw, principal_permeabilities
from lcmchain.mapping import TargetMesh, compute_weights, map_file, read_sheet, transfer
from lcmchain.mapping.surfaces.averages import angles_between
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.mapping.verify import (
    as_target,
    means_of_parts,
    refined_sheet,
    refined_surface,
    refined_target,
    verify,
)

RADIUS = 0.1


def dome(points):
    height = np.sqrt(RADIUS**2 - (points**2).sum(axis=1, keepdims=True))
    return np.concatenate([points, height], axis=1)


def smooth(places):
    """A thickness [m] that is a smooth function of the direction from the dome's centre."""
    x, y, z = (places / np.linalg.norm(places, axis=1)[:, None]).T
    return 1e-3 * (1.0 + 0.3 * np.sin(8.0 * x + 1.0) * np.cos(6.0 * y) + 0.2 * z)


def on_sphere(surface, levels):
    """Parts of faces, whose nodes lie on the dome, and the face of each."""
    parent = np.arange(surface.face_count)
    for _ in range(levels):
        surface, part = refined_surface(surface)
        length = np.linalg.norm(surface.points, axis=1)[:, None]
        surface, parent = Surface(RADIUS * surface.points / length, surface.faces), parent[part]
    return surface, parent


def exact_means(surface, function=smooth, levels=3):
    """Means of a function (F,) over the parts of the dome behind faces, by 64 parts of each."""
    fine, parent = on_sphere(surface, levels)
    values = function(fine.centroids)
    return np.bincount(parent, values * fine.areas) / np.bincount(parent, fine.areas)


def exact_contents(surface, function=smooth, levels=3):
    """What the dome behind faces holds of a function, per area of the faces."""
    fine, parent = on_sphere(surface, levels)
    return np.bincount(parent, function(fine.centroids) * fine.areas) / surface.areas


def meshes(make, source, target, triangles=True, shape=dome):
    """Sheet and shell target on two grids of so many cells over a shape."""
    points, quads = make.grid(source, source, (-0.06, -0.06), (0.06, 0.06), jitter=0.1)
    other, cells = make.grid(target, target, (-0.05, -0.05), (0.05, 0.05), jitter=0.1, seed=5)
    cells = make.triangles_of(cells) if triangles else cells
    kind = "triangle" if triangles else "quad"
    return shape(points), quads, TargetMesh(shape(other), ((kind, cells),), {})


def verified(sheet, target, **how):
    """The estimate, and what was mapped."""
    weights = compute_weights(sheet, target, **how)

    def weigh(one, other):
        return compute_weights(one, other, **how, maximum_distance=weights.maximum_distance)

    mapped = transfer(sheet, target, weights)
    return verify(sheet, target, weights, mapped, weigh), mapped


# --- refinement and reconstruction ----------------------------------------------------------------


def mixed(make, cells=8):
    """Plate of quadrilaterals on the left and triangles on the right."""
    points, quads = make.grid(cells, cells, jitter=0.2)
    right = points[quads].mean(axis=1)[:, 0] > 0.5
    triangles = make.triangles_of(quads[right])
    faces = np.concatenate(
        [quads[~right], np.hstack([triangles, np.full((len(triangles), 1), -1)])]
    )
    return make.lifted(points), faces


def test_four_parts_of_every_face_cover_it_and_share_their_edges(make):
    surface = Surface(*mixed(make))
    fine, parent = refined_surface(surface)
    assert fine.face_count == 4 * surface.face_count
    np.testing.assert_allclose(np.bincount(parent, fine.areas), surface.areas, rtol=1e-12)
    np.testing.assert_array_equal(fine.is_quadrilateral, surface.is_quadrilateral[parent])
    assert np.all(fine.normals[:, 2] > 0.999)
    # 8 x 8 cells: 17 x 17 nodes of a grid, and one amid the diagonal of each halved cell
    assert len(np.unique(fine.faces[fine.faces >= 0])) == len(fine.points) == 17 * 17
    edges = np.roll(fine.triangle_corners, -1, axis=1) - fine.triangle_corners
    bounding = (fine.edge_bounds_sheet * np.linalg.norm(edges, axis=2)).sum()
    np.testing.assert_allclose(bounding, 4.0, rtol=1e-12)  # only the rim of the plate is open


def test_parts_of_targets_know_their_cells(make):
    points, faces = mixed(make)
    target, face = as_target(Surface(points, faces))
    expected = Surface(points, faces).centroids[face]
    np.testing.assert_allclose(target.surface.centroids, expected, atol=1e-15)
    fine, parent = refined_target(target)
    areas = np.bincount(parent, fine.surface.areas, minlength=target.cell_count)
    np.testing.assert_allclose(areas, target.surface.areas, rtol=1e-12)
    apart = np.linalg.norm(fine.centroids - target.centroids[parent], axis=1)
    assert np.all(apart < target.surface.face_radii[parent])
    solid = TargetMesh(np.eye(4, 3), (("tetra", np.array([[0, 1, 2, 3]])),), {})
    assert refined_target(solid)[0] is solid


def test_quadratics_are_exact_on_any_plane_mesh(make):
    points, faces = mixed(make)
    surface = Surface(points, faces)
    fine, parent = refined_surface(surface)

    def quadratic(places):
        x, y, _ = places.T
        return 1.0 + 2.0 * x - y + 3.0 * x * x - 4.0 * x * y + 0.5 * y * y

    # means of a quadratic are those of its values amid the edges of triangles
    def means(one):
        corners = one.triangle_corners
        middles = 0.5 * (corners + np.roll(corners, 1, axis=1))
        values = quadratic(middles.reshape(-1, 3)).reshape(-1, 3).mean(axis=1)
        area = 0.5 * np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        total = np.bincount(one.triangle_face, area * values)
        return total / np.bincount(one.triangle_face, area)

    found = means_of_parts(surface, fine, parent, means(surface)[:, None])[:, 0]
    np.testing.assert_allclose(found, means(fine), atol=1e-8)


def test_repeated_nodes_are_one_place_and_a_lonely_face_keeps_its_mean(make):
    points, faces = mixed(make)
    surface = Surface(points, faces)
    values = np.sin(5.0 * surface.centroids[:, :1])
    fine, parent = refined_surface(surface)
    expected = means_of_parts(surface, fine, parent, values)
    closed = np.where(faces < 0, faces[:, 2:3], faces)
    apart = np.where(faces < 0, -1, np.arange(faces.size).reshape(faces.shape))
    torn = Surface(points[closed].reshape(-1, 3), apart)
    found = means_of_parts(torn, refined_surface(torn)[0], parent, values)
    np.testing.assert_allclose(found, expected, atol=1e-10)
    alone = Surface(points, faces[:1])
    found = means_of_parts(alone, *refined_surface(alone), np.array([[3.0]]))
    np.testing.assert_allclose(found, 3.0, rtol=1e-12)


def test_means_of_parts_converge_with_third_order_on_a_dome(make):
    errors = []
    for cells in (12, 24, 48):
        points, quads = make.grid(cells, cells, (-0.06, -0.06), (0.06, 0.06), jitter=0.1)
        surface = Surface(dome(points), quads)
        fine, parent = refined_surface(surface)
        given = exact_means(surface)
        found = means_of_parts(surface, fine, parent, given[:, None])[:, 0]
        kept = np.bincount(parent, found * fine.areas) / np.bincount(parent, fine.areas)
        np.testing.assert_allclose(kept, given, rtol=1e-12)
        errors.append(np.sqrt(np.mean((found - exact_means(fine, levels=2)) ** 2)))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(rates > 2.7), (errors, rates)


# --- the estimate ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "order"), [("overlap", 1), ("overlap", 2), ("closest", 2)])
@pytest.mark.parametrize(
    ("source", "target", "triangles"), [(30, 16, True), (30, 50, True), (30, 27, False)]
)
def test_the_estimate_is_the_true_error_within_a_factor_of_two(
    make, method, order, source, target, triangles
):
    """On coarser, finer and equal targets, of states and of contents."""
    points, quads, mesh = meshes(make, source, target, triangles)
    surface = Surface(points, quads)
    result = make.forming_result(
        points,
        quads,
        thickness=exact_means(surface),
        areal_fibre_mass=600.0 * exact_contents(surface),
    )
    found, mapped = verified(read_sheet(result), mesh, method=method, order=order)
    expected = {
        "thickness": exact_means(mesh.surface),
        "areal_fibre_mass": 600.0 * exact_contents(mesh.surface),
    }
    for name, true in expected.items():
        error = np.abs(mapped.scalars[name] - true)
        estimate, of_field = found.cells[name], found.fields[name]
        assert 0.5 < of_field.root_mean_square / np.sqrt(np.mean(error**2)) < 2.0
        assert 0.5 < of_field.worst / error.max() < 2.0
        assert estimate[of_field.worst_cell] == of_field.worst == estimate.max()
        assert np.corrcoef(estimate, error)[0, 1] > 0.4  # and it is large where the error is
    assert (of_field.units, found.fields["thickness"].units) == ("kg m-2", "m")


def test_there_and_back_alone_would_see_no_error_on_a_finer_mesh(make):
    """The closest face of a finer mesh gives every face its own value again, and yet is wrong."""
    points, quads, mesh = meshes(make, 20, 55)
    sheet = read_sheet(make.forming_result(points, quads, thickness=smooth))
    found = verified(sheet, mesh, method="closest", order=1)[0].fields["thickness"]
    assert found.there_and_back < 0.1 * found.root_mean_square
    coarse = verified(sheet, meshes(make, 20, 7)[2])[0].fields["thickness"]
    assert coarse.there_and_back > 3.0 * coarse.root_mean_square  # what coarse cells cannot hold


def test_constant_fields_have_no_error(make):
    points, quads, mesh = meshes(make, 12, 9)
    found, _ = verified(read_sheet(make.forming_result(points, quads, thickness=1e-3)), mesh)
    assert found.fields["thickness"].worst < 1e-15
    assert found.fields["thickness"].there_and_back_worst < 1e-15


def directions_on_dome(places):
    """Two families that turn by 60 degrees over the dome and are sheared unevenly."""
    normal = places / np.linalg.norm(places, axis=1)[:, None]
    across = np.cross([0.0, 1.0, 0.0], normal)
    across /= np.linalg.norm(across, axis=1)[:, None]
    along = np.cross(normal, across)
    turn = RADIUS * (8.0 * normal[:, 0] + 5.0 * normal[:, 1])
    shear = 0.3 + 4.0 * RADIUS * normal[:, 0]
    return tuple(
        np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * along
        for angle in (turn, turn + np.pi / 2 - shear)
    )


def exact_directions(surface):
    """Principal axes of the mean tensors over the dome behind faces, in the faces' planes."""
    fine, parent = on_sphere(surface, 3)
    found = []
    for family in directions_on_dome(fine.centroids):
        tensors = np.zeros((surface.face_count, 3, 3))
        np.add.at(tensors, parent, np.einsum("p,pi,pj->pij", fine.areas, family, family))
        axis = np.linalg.eigh(tensors)[1][:, :, 2]
        axis -= np.einsum("fi,fi->f", axis, surface.normals)[:, None] * surface.normals
        found.append(axis / np.linalg.norm(axis, axis=1)[:, None])
    return found


def tensors(found):
    """Permeability (C, 3, 3) of principal values and directions."""
    return sum(
        k[:, None, None] * np.einsum("ci,cj->cij", e, e)
        for k, e in zip(found[:3], found[3:], strict=True)
    )


LAW = PermeabilityLaw(packing="hexagonal")


def permeability_of(first, second):
    return principal_permeabilities(LAW, np.full(len(first), 0.5), first, second)


@pytest.mark.parametrize("order", [1, 2])
def test_errors_of_directions_and_of_the_permeability_are_estimated(make, order):
    """The senses of the directions are random: they mean nothing."""
    points, quads, mesh = meshes(make, 24, 31)
    flips = np.random.default_rng(4).choice([-1.0, 1.0], (2, len(quads), 1))
    families = [f * d for f, d in zip(flips, exact_directions(Surface(points, quads)))]
    first, second = families
    result = with_permeability(
        make.forming_result(points, quads, fibre_direction_1=first, fibre_direction_2=second),
        permeability_of(first, second),
    )
    found, mapped = verified(read_sheet(result), mesh, order=order)
    expected = exact_directions(mesh.surface)
    for number, true in enumerate(expected, start=1):
        name = f"fibre_direction_{number}"
        error = angles_between(mapped.directions[name].direction, true)
        of_field = found.fields[name]
        assert of_field.units == "rad"
        assert 0.5 < of_field.root_mean_square / np.sqrt(np.mean(error**2)) < 2.0
        assert 0.5 < of_field.worst / error.max() < 2.0
    values = [mapped.scalars[f"permeability_{k}"] for k in (1, 2, 3)]
    axes = [mapped.axes[f"permeability_direction_{k}"] for k in (1, 2, 3)]
    difference = tensors([*values, *axes]) - tensors(permeability_of(*expected))
    error = np.abs(np.linalg.eigvalsh(difference)).max(axis=1)
    of_field = found.fields["permeability"]
    assert of_field.units == "m2" and "permeability_1" not in found.fields
    # The law of mean directions is not the mean of the law: that is in this error, not in the
    # estimate, and of second order.
    assert 0.3 < of_field.root_mean_square / np.sqrt(np.mean(error**2)) < 2.0
    assert of_field.there_and_back > 0.0


def with_permeability(result, found):
    for name, values in zip("123", found[:3], strict=True):
        result[f"permeability_{name}"] = ("sheet_face", values, {"units": "m2"})
    for name, vectors in zip("123", found[3:], strict=True):
        for axis, values in zip("xyz", vectors.T, strict=True):
            result[f"permeability_direction_{name}_{axis}"] = "sheet_face", values, {"units": "1"}
    return result


def test_parts_of_the_sheet_have_unit_directions_and_axes(make):
    points, quads, _ = meshes(make, 12, 9)
    first, second = exact_directions(Surface(points, quads))
    found = permeability_of(first, second)
    result = make.forming_result(points, quads, fibre_direction_1=first)
    fine = refined_sheet(read_sheet(with_permeability(result, found)))
    np.testing.assert_allclose(
        np.linalg.norm(fine.directions["fibre_direction_1"], axis=1), 1.0, rtol=1e-12
    )
    squared = np.einsum("cki,cli->ckl", fine.permeability.axes, fine.permeability.axes)
    np.testing.assert_allclose(squared, np.broadcast_to(np.eye(3), squared.shape), atol=1e-12)
    assert np.all(fine.permeability.values[:, 0] >= fine.permeability.values[:, 1])
    parent = np.repeat(np.arange(len(quads)), 4)
    np.testing.assert_allclose(fine.permeability.values[:, 2], found.k3[parent], rtol=1e-2)


# --- the stage ------------------------------------------------------------------------------------


@pytest.mark.parametrize("cells", ["triangle", "hexahedron"])
def test_errors_leave_as_fields_numbers_and_picture(make, write_mesh, tmp_path, cells):
    points, quads, mesh = meshes(make, 20, 12, triangles=cells == "triangle")
    first, second = exact_directions(Surface(points, quads))
    result = make.forming_result(
        points, quads, thickness=smooth, areal_fibre_mass=0.6, fibre_direction_1=first,
        fibre_direction_2=second,
    )  # fmt: skip
    nodes, table = mesh.points, mesh.blocks[0][1]
    if cells == "hexahedron":
        nodes = np.concatenate([nodes * 0.996, nodes * 1.004])
        table = np.hstack([table, table + len(mesh.points)])
    target = write_mesh(nodes, [(cells, table)])
    report = map_file(result, target, tmp_path / "m.nc", verify=True, thickness_limit=1.0)
    assert report.files["errors"] == "m_errors.png" and (tmp_path / "m_errors.png").is_file()
    assert set(report.verification) == {
        "thickness", "fibre_volume_fraction", "areal_fibre_mass", "fibre_direction_1",
        "fibre_direction_2",
    }  # fmt: skip
    found = report.verification["thickness"]
    assert json.loads((tmp_path / "m.json").read_text())["verification"]["thickness"] == found
    assert (found["there_and_back"] is None) == (cells == "hexahedron")
    assert 1e-6 < found["worst"] < 1e-4
    with xr.open_dataset(tmp_path / "m.nc") as dataset:
        errors = dataset["thickness_mapping_error"]
        assert errors.attrs["units"] == "m" and "twice finer" in errors.attrs["comment"]
        assert float(errors.max()) == found["worst"] == errors.values[found["worst_cell"]]
        assert dataset["fibre_direction_1_mapping_error"].attrs["units"] == "rad"
        assert "--verify" in dataset.attrs["history"]
    data = meshio.read(tmp_path / "m.vtu").cell_data
    assert data["areal_fibre_mass_mapping_error"][0].shape == (mesh.cell_count,)
    again = map_file(result, target, tmp_path / "m.nc", picture=False, thickness_limit=1.0)
    assert again.verification is None
    with xr.open_dataset(tmp_path / "m.nc") as dataset:
        assert not any("mapping_error" in str(name) for name in dataset)
