"""Fields at the nodes of targets."""

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.mapping import TargetMesh, compute_weights, map_file, read_sheet
from lcmchain.mapping.fields import transfer_to_nodes


def shell(points, cells):
    return TargetMesh(points, (({3: "triangle", 4: "quad"}[cells.shape[1]], cells),), {})


def test_linear_fields_are_exact_at_nodes_and_constant_ones_anywhere(make):
    points, quads = make.grid(9, 8, jitter=0.3, seed=1)
    other, cells = make.grid(11, 13, (0.1, 0.1), (0.9, 0.9), jitter=0.3, seed=2)
    surface = shell(make.lifted(points), quads).surface
    slope = np.array([0.3, -0.2, 0.0])
    linear = 1.0 + surface.centroids @ slope
    sheet = read_sheet(make.forming_result(make.lifted(points), quads, thickness=linear))
    target = shell(make.lifted(other), cells)
    found = transfer_to_nodes(sheet, target, compute_weights(sheet, target)).scalars
    np.testing.assert_allclose(found["thickness"], 1.0 + target.points @ slope, rtol=1e-12)
    np.testing.assert_allclose(found["fibre_volume_fraction"], 0.5, rtol=1e-13)


def test_nodes_take_from_the_wall_of_their_cells(make):
    """Two plates closer than an edge; nodes that no cell uses have no values."""
    points, quads = make.grid(8, 8)
    gap = 0.05
    both = np.concatenate([make.lifted(points), make.lifted(points) + [0.0, 0.0, gap]])
    faces = np.concatenate([quads, quads[:, ::-1] + len(points)])  # they show different sides
    wall = np.repeat([0.3, 0.6], len(quads))
    sheet = read_sheet(make.forming_result(both, faces, fibre_volume_fraction=wall))
    other, cells = make.grid(5, 5)
    lower = make.lifted(other) + [0.0, 0.0, 0.6 * gap]  # nearer to the upper one
    upper = make.lifted(other) + [0.0, 0.0, 1.6 * gap]
    nodes = np.concatenate([lower, upper, [[0.5, 0.5, 0.0]]])
    target = shell(nodes, np.concatenate([cells, cells[:, ::-1] + len(other)]))
    # joined at one edge, the two are one piece, as the walls of a U
    weights = compute_weights(sheet, target, maximum_distance=2.0 * gap)
    found = transfer_to_nodes(sheet, target, weights).scalars["fibre_volume_fraction"]
    assert np.isnan(found[-1])
    assert set(np.round(found[: len(other)], 12)) <= {0.3, 0.6}
    by_cell = weights.average_matrix @ wall
    for cell, value in zip(target.corners, by_cell, strict=True):
        np.testing.assert_allclose(found[cell], value, rtol=1e-12)


def test_directions_at_nodes_are_unit_vectors_along_the_fibres(make):
    points, quads = make.grid(20, 20, (-0.05, -0.05), (0.05, 0.05))
    points = make.bowl(points, depth=3.0)
    first, second = make.families(points, quads, shear=0.4)
    result = make.forming_result(points, quads, fibre_direction_1=first, fibre_direction_2=second)
    sheet = read_sheet(result)
    other, cells = make.grid(13, 13, (-0.04, -0.04), (0.04, 0.04))
    target = shell(make.bowl(other, depth=3.0), cells)
    found = transfer_to_nodes(sheet, target, compute_weights(sheet, target)).directions
    one, two = (found[f"fibre_direction_{number}"].direction for number in (1, 2))
    np.testing.assert_allclose(np.linalg.norm(one, axis=1), 1.0, rtol=1e-12)
    angle = np.arccos(np.abs(np.einsum("ni,ni->n", one, two)))
    assert angle == pytest.approx(np.pi / 2 - 0.4, abs=2e-3)


def test_values_at_nodes_leave_with_the_files(make, write_mesh, tmp_path):
    points, quads = make.grid(9, 9)
    first, _ = make.families(make.lifted(points), quads)
    result = make.forming_result(
        make.lifted(points), quads, thickness=lambda c: 1.0 + c[:, 0], fibre_direction_1=first
    )
    other, cells = make.grid(5, 6, (0.1, 0.1), (0.9, 0.9))
    mesh = write_mesh(make.lifted(other), [("quad", cells)])
    map_file(result, mesh, tmp_path / "m.nc", nodes=True, picture=False)
    with xr.open_dataset(tmp_path / "m.nc") as dataset:
        found = dataset["thickness_at_nodes"]
        assert found.attrs["location"] == "node" and found.attrs["units"] == "m"
        assert "contents are not kept" in found.attrs["comment"]
        np.testing.assert_allclose(found.values, 1.0 + other[:, 0], rtol=1e-12)
        assert "--nodes" in dataset.attrs["history"]
    data = meshio.read(tmp_path / "m.vtu").point_data
    np.testing.assert_allclose(data["thickness_at_nodes"], 1.0 + other[:, 0], rtol=1e-12)
    assert data["fibre_direction_1_at_nodes"].shape == (len(other), 3)
    with pytest.raises(InputError, match="of one saved state"):
        map_file(result, mesh, tmp_path / "m.nc", nodes=True, all_frames=True, picture=False)
