"""Closest projection and intersection areas against dense sampling and an independent geometry."""

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.mapping.surfaces.intersection import overlaps
from lcmchain.mapping.surfaces.search import closest_points
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.mapping.target import CellPolygons

coordinate = st.floats(-1.0, 1.0, allow_nan=False)
three_points = st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=3)


def triangle_surface(corners):
    return Surface(np.array(corners, dtype=float), np.array([[0, 1, 2, -1]]))


def test_closest_point_is_never_beaten_by_dense_samples(make):
    points, quads = make.grid(4, 4, (-1.0, -1.0), (1.0, 1.0), jitter=0.3)
    surface = Surface(make.bowl(points), quads)
    queries = np.random.default_rng(1).uniform(-1.5, 1.5, (40, 3))
    found = closest_points(surface, queries, 10.0)
    s, t = (c.ravel() for c in np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 60)))
    inside = s + t <= 1.0
    weight = np.stack([1 - s - t, s, t], axis=1)[inside]
    samples = np.einsum("sk,tki->tsi", weight, surface.triangle_corners).reshape(-1, 3)
    sampled = np.array([np.linalg.norm(samples - q, axis=1).min() for q in queries])
    assert np.all(found.distance <= sampled + 1e-12)
    assert np.all(found.distance >= sampled - 0.02)  # spacing of the samples
    np.testing.assert_allclose(np.linalg.norm(queries - found.foot, axis=1), found.distance)


def test_points_are_beside_the_sheet_only_beyond_its_edge(make):
    points, quads = make.grid(5, 5, jitter=0.2)
    surface = Surface(make.lifted(points), quads)
    queries = np.array(
        [[0.5, 0.5, 0.1], [0.001, 0.5, -0.1], [1.2, 0.5, 0.0], [-0.1, -0.1, 0.2], [0.5, 0.5, 9.0]]
    )
    found = closest_points(surface, queries, 1.0)
    np.testing.assert_array_equal(found.beside, [False, False, True, True, True])
    np.testing.assert_allclose(found.distance[:3], [0.1, 0.1, 0.2], atol=1e-12)
    assert found.face[4] == -1 and found.distance[4] >= 1.0


def test_repeated_nodes_do_not_make_an_edge(make):
    points, quads = make.grid(4, 4)
    apart = make.lifted(points)[quads].reshape(-1, 3)  # as an STL file stores facets
    faces = np.arange(len(apart)).reshape(-1, 4)
    bounds = Surface(apart, faces).edge_bounds_sheet
    assert bounds.sum() == 16


@given(three_points, three_points)
def test_overlap_of_two_triangles_is_that_of_shapely(cell, face):
    surface = triangle_surface([[x, y, 0.05] for x, y in face])
    target = triangle_surface([[x, y, 0.0] for x, y in cell])
    exact = shapely.Polygon(cell).intersection(shapely.Polygon(face)).area
    if min(surface.areas[0], target.areas[0]) < 1e-3:
        return
    polygons = CellPolygons(
        np.array([0, 3]), target.corners[0, :3], target.centroids, target.normals, target.areas
    )
    found = overlaps(surface, polygons, 0.1)
    np.testing.assert_allclose(found.area.sum(), exact, atol=1e-12)
    np.testing.assert_allclose(found.part.sum() * surface.areas[0], exact, atol=1e-12)
    np.testing.assert_allclose(np.abs(found.height[found.area > 1e-9]), 0.05, rtol=1e-6)


def test_a_reflex_cell_is_covered_once(make):
    cell = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, 0.3, 0.0], [0.0, 1.0, 0.0]])
    for turn in range(4):
        target = Surface(np.roll(cell, turn, axis=0), np.array([[0, 1, 2, 3]]))
        points, quads = make.grid(3, 3, (-1.0, -1.0), (2.0, 2.0))
        polygons = CellPolygons(
            np.array([0, 4]), target.corners[0], target.centroids, target.normals, target.areas
        )
        found = overlaps(Surface(make.lifted(points), quads), polygons, 0.1)
        np.testing.assert_allclose(found.area.sum(), 0.3, rtol=1e-12)


def test_intersections_of_two_plates_fill_both(make):
    points, quads = make.grid(9, 7, jitter=0.3, seed=1)
    other, cells = make.grid(5, 8, jitter=0.3, seed=2)
    source, target = Surface(make.lifted(points), quads), Surface(make.lifted(other), cells)
    polygons = CellPolygons(
        4 * np.arange(len(cells) + 1),
        target.corners.reshape(-1, 3),
        target.centroids,
        target.normals,
        target.areas,
    )
    found = overlaps(source, polygons, 0.1)
    np.testing.assert_allclose(np.bincount(found.cell, found.area), target.areas, rtol=1e-12)
    np.testing.assert_allclose(np.bincount(found.face, found.area), source.areas, rtol=1e-12)
    np.testing.assert_allclose(np.bincount(found.face, found.part), 1.0, rtol=1e-12)
    for k in range(0, len(found.area), 10):
        cell = shapely.Polygon(target.corners[found.cell[k], :, :2])
        face = shapely.Polygon(source.corners[found.face[k], :, :2])
        np.testing.assert_allclose(found.area[k], cell.intersection(face).area, atol=1e-14)
