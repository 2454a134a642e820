"""Bands and lines of a node field: they cover the mesh once and lie where the level is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcmchain.coupling.infiltration.picture import contours, triangles_around_centres

LEVELS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])


def areas(polygons):
    """Areas of plane polygons (P, K, 3) in the plane z = 0 or any other."""
    turned = np.roll(polygons, -1, axis=1)
    return 0.5 * np.linalg.norm(np.cross(polygons, turned).sum(axis=1), axis=1)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from([0.0, 0.1, 0.25, 0.4, 0.5, 0.8, 1.0]), min_size=3, max_size=3))
def test_bands_cover_a_triangle_once(values):
    corners = np.array([[[0.0, 0, 0], [2, 0, 1], [0, 1, 3]]])
    found = contours(corners, np.array([values]), LEVELS)
    assert areas(found.polygons).sum() == pytest.approx(areas(corners)[0], rel=1e-6)
    assert (found.triangle == 0).all() and len(found.empty) == 0


def test_area_of_a_band_of_a_linear_field():
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    found = contours(corners, np.array([[0.0, 1.0, 0.0]]), LEVELS)  # the field is x
    exact = [0.5 * ((1 - low) ** 2 - (1 - high) ** 2) for low, high in zip(LEVELS, LEVELS[1:])]
    assert areas(found.polygons)[np.argsort(found.band)] == pytest.approx(exact, rel=1e-6)
    assert sorted(set(np.round(found.lines[..., 0], 6).ravel())) == [0.25, 0.5, 0.75]


def test_what_has_no_value_is_empty():
    corners = np.zeros((2, 3, 3))
    found = contours(corners, np.array([[0.1, np.nan, 0.2], [0.1, 0.1, 0.1]]), LEVELS)
    assert found.empty_triangle.tolist() == [0] and set(found.triangle) == {1}


def test_quadrilaterals_are_divided_around_their_centre():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]])
    cells = np.array([[0, 1, 2, 3], [1, 4, 2, -1]])
    corners, values, owner = triangles_around_centres(points, cells, points[:, 0])
    assert np.bincount(owner).tolist() == [4, 1]
    assert areas(corners).sum() == pytest.approx(1.5)
    assert values == pytest.approx(corners[..., 0])


@pytest.mark.parametrize("value", [0.0, 3.0, 1e5])
def test_a_constant_field_is_one_band(value):
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    with np.errstate(all="raise"):
        found = contours(corners, np.full((1, 3), value), value + np.array([-2.0, -1.0, 1.0]))
    assert areas(found.polygons)[found.band == 1].sum() == pytest.approx(0.5, rel=1e-6)
    assert np.isfinite(found.polygons).all() and len(found.lines) == 0
