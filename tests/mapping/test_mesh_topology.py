"""Edges, neighbours and coinciding nodes of a mesh against plain Python."""

from collections import defaultdict

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.mapping.surfaces.intersection import WORK, clip
from lcmchain.mapping.surfaces.surface import places_of, winding

FACES = st.lists(
    st.lists(st.integers(0, 7), min_size=3, max_size=4, unique=True), min_size=1, max_size=12
)


@given(FACES)
def test_neighbours_and_bounds_of_any_faces(lists):
    """Also of edges with three faces, which are neighbours of none and bound nothing."""
    faces = np.array([face + [-1] * (4 - len(face)) for face in lists])
    users = defaultdict(list)
    for number, face in enumerate(lists):
        for column, start in enumerate(face):
            users[frozenset((start, face[(column + 1) % len(face)]))].append(
                (number, column, start)
            )
    found = winding(faces)
    seen = np.zeros(faces.shape, dtype=bool)
    for uses in users.values():
        for number, column, _ in uses:
            seen[number, column] = True
            others = [use for use in uses if use[:2] != (number, column)]
            assert found.bounds[number, column] == (not others)
            expected = others[0][0] if len(others) == 1 else -1
            assert found.neighbours[number, column] == expected
        if len(uses) == 2 and found.two_sided[found.piece[uses[0][0]]]:
            (one, _, start), (other, _, begin) = uses
            assert (found.side[one] == found.side[other]) == (start != begin)
    assert np.all(found.neighbours[~seen] == -1) and not found.bounds[~seen].any()


@given(st.lists(st.tuples(*[st.integers(-3, 3)] * 3), min_size=1, max_size=60))
def test_points_at_one_place_share_its_number(steps):
    steps = np.array(steps)
    rng = np.random.default_rng(len(steps))
    points = 1e-3 * (steps + 0.2 * rng.uniform(-1.0, 1.0, steps.shape))
    _, expected = np.unique(steps, axis=0, return_inverse=True)
    found = places_of(points, 1e-3)
    same = expected.reshape(-1, 1) == expected.reshape(1, -1)
    np.testing.assert_array_equal(found[:, None] == found[None, :], same)
    assert list(dict.fromkeys(found)) == list(range(found.max() + 1))  # as they first occur


@given(st.lists(st.floats(-1.5, 1.5), min_size=8, max_size=8), st.integers(3, 4))
def test_the_four_triangles_of_a_triangle_share_out_a_polygon(values, corners):
    """A triangle cut in four: areas and first moments of the parts add up to those of the whole."""
    rng = np.random.default_rng(abs(hash(tuple(values))) % 2**32)
    centre = np.array(values[:2])
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
    radii = 0.2 + np.abs(values[2 : 2 + corners])
    polygon = centre + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    length, tip = 1.3, np.array([0.4, 0.9])

    def overlap(first, second, third):
        along = (second - first) / np.linalg.norm(second - first)
        across = np.array([-along[1], along[0]])
        frame = np.stack([along, across])
        work = np.zeros(WORK)
        work[0, :corners] = (polygon - first) @ frame.T
        size = np.linalg.norm(second - first)
        area, x, y = clip(work, corners, size, *(frame @ (third - first)))
        return np.array([area, *(area * (first + frame.T @ [x, y]))])

    a, b, c = np.zeros(2), np.array([length, 0.0]), tip
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    parts = overlap(a, ab, ca) + overlap(ab, b, bc) + overlap(ca, bc, c) + overlap(bc, ca, ab)
    np.testing.assert_allclose(parts, overlap(a, b, c), rtol=1e-10, atol=1e-12)
