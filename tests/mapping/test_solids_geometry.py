"""Columns of a sheet and their overlaps with solid cells, against independent geometry."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from lcmchain.mapping.solids.columns import (
    columns_of,
    node_normals,
    own_reach,
    touching,
    tree_of,
    upright_reach,
)
from lcmchain.mapping.solids.overlap import overlaps
from lcmchain.mapping.solids.tetrahedra import (
    HEXAHEDRON,
    MOST_CORNERS,
    clip_tetrahedron,
    clip_triangle,
    solids,
    solids_of_cells,
    tetrahedron_planes,
)
from lcmchain.mapping.surfaces.surface import Surface

CUBE = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float
)


def clipped(tetrahedron, planes):
    """Volume and first moments of a tetrahedron inside half spaces."""
    moments = np.empty(4)
    work = (
        np.empty((MOST_CORNERS, 3)), np.empty((MOST_CORNERS, 3), np.int64),
        np.empty(MOST_CORNERS), np.empty(MOST_CORNERS, np.int64),
    )  # fmt: skip
    clip_tetrahedron(tetrahedron, planes, len(planes), *work, moments)
    return moments


def test_clipped_tetrahedra_are_those_of_qhull():
    generator = np.random.default_rng(0)
    planes, own = np.empty((4, 4)), np.empty((4, 4))
    compared = 0
    for _ in range(150):
        first, second = generator.normal(size=(2, 4, 3))
        if np.linalg.det(first[1:] - first[0]) < 0.0:
            first[[0, 1]] = first[[1, 0]]
        tetrahedron_planes(*second, planes)
        tetrahedron_planes(*first, own)
        half_spaces = -np.vstack([planes, own])
        lengths = np.linalg.norm(half_spaces[:, :3], axis=1, keepdims=True)
        inside = linprog(
            [0, 0, 0, -1], A_ub=np.hstack([half_spaces[:, :3], lengths]), b_ub=-half_spaces[:, 3],
            bounds=[(None, None)] * 3 + [(0, None)],
        )  # fmt: skip
        moments = clipped(first, planes)
        if inside.status != 0 or inside.x[3] < 1e-3:
            assert abs(moments[0]) < 1e-4
            continue
        body = ConvexHull(HalfspaceIntersection(half_spaces, inside.x[:3]).intersections)
        parts = body.points[body.simplices] - inside.x[:3]
        volumes = np.abs(np.linalg.det(parts)) / 6.0
        centroid = inside.x[:3] + volumes @ parts.sum(axis=1) / 4.0 / volumes.sum()
        assert moments[0] == pytest.approx(body.volume, rel=1e-10)
        np.testing.assert_allclose(moments[1:] / moments[0], centroid, atol=1e-9)
        compared += 1
    assert compared > 30


def test_a_clipped_triangle_is_the_part_inside():
    planes = np.empty((4, 4))
    tetrahedron_planes(*np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]), planes)
    triangle = np.array([[-1.0, -1.0, 0.25], [3.0, -1.0, 0.25], [-1.0, 3.0, 0.25]])
    centroid = np.empty(3)
    area = clip_triangle(triangle, planes, np.empty((2, 16, 3)), np.empty(16), centroid)
    assert area == pytest.approx(0.5 * 0.75**2, rel=1e-12)
    np.testing.assert_allclose(centroid, [0.25, 0.25, 0.25], rtol=1e-12)


def test_the_tree_finds_every_box_that_touches():
    generator = np.random.default_rng(1)
    for count in (1, 3, 500):
        low = generator.uniform(size=(count, 3))
        high = low + generator.uniform(0.0, 0.2, (count, 3)) ** 3  # sizes of all orders
        start, found = touching(tree_of(low, high), low[:40], high[:40])
        for query in range(min(count, 40)):
            every = np.all((low <= high[query]) & (high >= low[query]), axis=1)
            own = found[start[query] : start[query + 1]]
            np.testing.assert_array_equal(own, np.flatnonzero(every))


def test_the_volume_of_a_hexahedron_is_that_of_its_shape_functions():
    """Integrated by 2 x 2 x 2 Gauss points, as a finite element program does; also inside out."""
    corners = CUBE + np.random.default_rng(2).uniform(-0.2, 0.2, CUBE.shape)
    sign = 2.0 * CUBE - 1.0
    volume = 0.0
    for point in sign / np.sqrt(3.0):
        factors = 1.0 + sign * point
        gradient = np.stack(
            [sign[:, a] * np.prod(np.delete(factors, a, axis=1), axis=1) / 8.0 for a in range(3)]
        )
        volume += np.linalg.det(gradient @ corners)
    mirrored = corners[[4, 5, 6, 7, 0, 1, 2, 3]]
    cells = solids(np.stack([corners, mirrored]), np.array([HEXAHEDRON, HEXAHEDRON]))
    np.testing.assert_allclose(cells.volumes, volume, rtol=1e-13)
    np.testing.assert_array_equal(cells.weight, [0.5, -0.5])


@pytest.mark.parametrize("kind", ["hexahedron", "wedge", "tetra", "pyramid"])
def test_columns_fill_every_cell_once(make, kind):
    """Also where both meshes have warped sides: no gap and no overlap between the columns."""
    points, quads = make.grid(9, 8, (-0.6, -0.6), (0.6, 0.6), jitter=0.2)
    twisted = make.bowl(points) + [0.0, 0.0, 0.2] * np.prod(points, axis=1, keepdims=True)
    columns = columns_of(Surface(twisted, quads), 0.15)
    other, cells = make.grid(7, 6, (-0.4, -0.4), (0.4, 0.4), jitter=0.2, seed=1)

    def shape(p, z):
        return make.bowl(p) + [0.0, 0.0, 0.2] * np.prod(p, axis=1, keepdims=True) + [0.0, 0.0, z]

    nodes, corners = make.bricks(other, cells, (-0.03, 0.0, 0.04), shape, kind)
    filled = np.pad(corners, ((0, 0), (0, 8 - corners.shape[1])), constant_values=-1)
    target = solids_of_cells(nodes, filled)
    found = overlaps(target, columns)
    covered = np.bincount(found.cell, weights=found.volume) / target.volumes
    np.testing.assert_allclose(covered, 1.0, rtol=1e-12)
    count = len(target.volumes)
    for axis in range(3):
        moment = np.bincount(found.cell, found.volume * found.centroid[:, axis], count)
        low, high = target.low[:, axis], target.high[:, axis]
        assert np.all((moment / target.volumes > low) & (moment / target.volumes < high))


def test_normals_of_nodes_do_not_depend_on_how_faces_are_split(make):
    """Three faces meet at the corner of a cube: one of them as two triangles weighs as much."""
    faces = np.array([[0, 3, 2, 1], [0, 1, 5, 4], [0, 4, 7, 3]])
    whole = node_normals(CUBE, faces)
    split = np.array([[0, 3, 2, 2], [0, 2, 1, 1], [0, 1, 5, 4], [0, 4, 7, 3]])
    np.testing.assert_allclose(whole[0], -np.ones(3) / np.sqrt(3.0), rtol=1e-14)
    np.testing.assert_allclose(node_normals(CUBE, split)[0], whole[0], rtol=1e-14)


def test_a_sheet_reaches_half_way_to_its_next_wall(make):
    points, quads = make.grid(8, 8, jitter=0.1)
    gap = 0.03
    below, above = make.lifted(points), make.lifted(points) + [0.0, 0.0, gap]
    nodes = np.concatenate([below, above])
    faces = np.concatenate([quads, quads + len(points)])
    normals = np.tile([0.0, 0.0, 1.0], (len(nodes), 1))
    found = own_reach(nodes, normals, faces, 0.1)
    count = len(points)
    np.testing.assert_allclose(found[:count], [[0.1, 0.5 * gap]] * count, rtol=1e-12)
    np.testing.assert_allclose(found[count:], [[0.5 * gap, 0.1]] * count, rtol=1e-12)


def test_columns_end_before_they_turn_over(make):
    """Inside a cylinder at nine tenths of its radius, outside nowhere."""
    radius = 0.2
    points, quads = make.grid(40, 4, (-1.2, 0.0), (1.2, 0.4))
    angle, width = points.T
    arc = np.stack([radius * np.sin(angle), width, radius * np.cos(angle)], axis=1)
    normals = np.stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)], axis=1)
    found = upright_reach(arc, normals, quads, np.full((len(arc), 2), 1.0))
    np.testing.assert_allclose(found, [[0.9 * radius, 1.0]] * len(arc), rtol=1e-9)
