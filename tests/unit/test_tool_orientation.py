"""Normals of surface meshes are turned into free space: closed parts, cavities, open skins."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mesh.search import closest_point_of_triangle
from lcmchain.tools import ToolWarning, build_tool_table, gaps
from lcmchain.tools.shapes import SurfaceMesh
from lcmchain.tools.surfaces.distance_field import build_distance_field
from lcmchain.tools.surfaces.reading import read_surface
from lcmchain.tools.surfaces.solids import oriented
from lcmchain.tools.surfaces.triangle_distance import closest_places, triangle_tree
from lcmchain.tools.tool import Tool

FILE = Path("tool.stl")


def box(size, centre=(0.0, 0.0, 0.0)):
    """Closed box with outward normals."""
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [(a, b, c) for a, b, c, _ in quads] + [(a, c, d) for a, _, c, d in quads]
    return (corners - 0.5) * size + centre, np.array(triangles)


def together(*meshes):
    starts = np.cumsum([0, *(len(points) for points, _ in meshes)])
    triangles = [own + start for (_, own), start in zip(meshes, starts)]
    return np.concatenate([points for points, _ in meshes]), np.concatenate(triangles)


def dish(cells=16, radius=0.08, half=0.03):
    """Square skin, a part of a sphere with its lowest point at the origin; normals downwards."""
    at = np.linspace(-half, half, cells + 1)
    x, y = (grid.ravel() for grid in np.meshgrid(at, at, indexing="ij"))
    points = np.stack([x, y, radius - np.sqrt(radius**2 - x**2 - y**2)], axis=1)
    first = np.array([i * (cells + 1) + j for i in range(cells) for j in range(cells)])
    a, b, c, d = first, first + cells + 1, first + cells + 2, first + 1
    return points, np.concatenate((np.stack((a, c, b), axis=1), np.stack((a, d, c), axis=1)))


def sheet_at(bottom, thickness=0.001, half=0.05):
    at = np.linspace(-half, half, 21)
    x, y = (grid.ravel() for grid in np.meshgrid(at, at))
    return np.concatenate(
        [np.stack([x, y, np.full_like(x, z)], axis=1) for z in (bottom, bottom + thickness)]
    )


def turned(triangles):
    return triangles[:, ::-1]


def square_hole(half=0.055, radius=0.015, fillet=0.005, steps=9, depth=0.06, width=0.14):
    """Skin of a die with a square hole: wall with an open rim below, rounded edge, plate."""
    places, outward = [], []
    for quarter in range(4):
        middle = 0.5 * np.pi * (quarter + 0.5)
        centre = np.sign([np.cos(middle), np.sin(middle)]) * (half - radius)
        for angle in np.linspace(0.5 * np.pi * quarter, 0.5 * np.pi * (quarter + 1), steps):
            outward.append(np.array([np.cos(angle), np.sin(angle)]))
            places.append(centre + radius * outward[-1])
    arc = np.linspace(0.0, 0.5 * np.pi, 9)
    profile = [(0.0, -depth), *zip(fillet * (1 - np.cos(arc)), fillet * (np.sin(arc) - 1))]
    profile.append((width, 0.0))
    points = np.array(
        [[[*(p + way * n), z] for way, z in profile] for p, n in zip(places, outward)]
    )
    count, rows = len(places), len(profile)
    number = np.arange(count * rows).reshape(count, rows)
    after = np.roll(number, -1, axis=0)
    a, b, c, d = (n.ravel() for n in (number[:, :-1], after[:, :-1], after[:, 1:], number[:, 1:]))
    return points.reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def test_the_rim_of_a_skin_may_bend(tmp_path):
    """Below the corners of the hole a back node lies one spacing off the rim, its neighbour two."""
    points, triangles = square_hole()
    meshio.Mesh(points, [("triangle", triangles)]).write(tmp_path / "die.stl")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToolWarning)
        surface = read_surface(tmp_path / "die.stl", "m", sheet_at(0.0))
        field = build_distance_field(surface, None, key="shape")
    assert field.spacing == pytest.approx(1.714e-3, rel=1e-3)


def same_normals(points, one, other):
    def normals(triangles):
        a, b, c = points[triangles].transpose(1, 0, 2)
        return np.cross(b - a, c - a)

    return np.allclose(normals(one), normals(other))


def field_gaps(points, triangles, where, blank=None, tmp_path=None, spacing=0.001):
    """Gaps of a tool of the solver."""
    import meshio

    meshio.Mesh(points, [("triangle", triangles)]).write(tmp_path / "tool.stl")
    shape = SurfaceMesh.model_construct(
        type="surface_mesh", file="tool.stl", length_unit="m", spacing=spacing
    )
    tool = Tool.model_construct(name="tool", shape=shape, position=(0.0, 0.0, 0.0), friction=None)
    table = build_tool_table([tool], tmp_path, 0.1, blank=blank)
    return gaps(table, 0, np.array(where, dtype=float), 0.0)


def test_a_right_surface_is_left_without_a_word():
    for mesh, blank in ((box((0.06, 0.04, 0.03)), None), (dish(), sheet_at(-0.002))):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            triangles, orientation = oriented(*mesh, FILE, blank)
        assert triangles is mesh[1]
        assert orientation.against_neighbours == orientation.with_part == 0


def test_a_cavity_is_free_whatever_its_normals_say(tmp_path):
    inner = box((0.03, 0.02, 0.02))
    island = box((0.01, 0.01, 0.01))
    for flips in ((False, False, False), (True, False, True), (True, True, True)):
        parts = [box((0.06, 0.05, 0.05)), inner, island]
        mesh = together(
            *[(p, turned(t) if flip else t) for (p, t), flip in zip(parts, flips, strict=True)]
        )
        with pytest.warns(ToolWarning, match="had normals that point into the solid"):
            triangles, orientation = oriented(*mesh, FILE)
        assert (orientation.closed, orientation.open) == (3, 0)
        assert orientation.reasons == ("outwards", "into cavities")
        right = together(parts[0], (inner[0], turned(inner[1])), island)
        assert same_normals(mesh[0], triangles, right[1])
        with pytest.warns(ToolWarning):
            gap = field_gaps(*mesh, [(0, 0, 0.0235), (0, 0, 0.009), (0, 0, 0.0035)],
                             tmp_path=tmp_path, spacing=0.0005)  # fmt: skip
        np.testing.assert_allclose(gap, [-0.0015, 0.001, -0.0015], atol=1e-5)


def test_bodies_beside_each_other_are_no_cavities():
    # the corner of an L-shaped body's box holds the other, which is not inside
    mesh = together(box((0.02, 0.02, 0.02)), box((0.01, 0.01, 0.01), (0.03, 0.0, 0.0)))
    triangles, orientation = oriented(mesh[0], mesh[1], FILE)
    assert orientation.reasons == ("outwards",)
    assert np.array_equal(triangles, mesh[1])


@pytest.mark.parametrize(
    "centre",
    [(0.0, 0.0, 0.01), (0.0, 0.0, -0.001), (0.03, 0.02, 0.01), (0.0, 0.0, 0.025001)],
    ids=["sunk", "deep", "corner", "touching"],
)
def test_solids_that_overlap_or_touch_are_named_with_what_to_do(tmp_path, centre):
    mesh = together(box((0.06, 0.05, 0.03)), box((0.02, 0.02, 0.02), centre))
    mesh = mesh if centre != (0.0, 0.0, -0.001) else together(
        box((0.06, 0.05, 0.03)), box((0.01, 0.01, 0.035), centre)
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # none is turned inside out
        with pytest.raises(InputError) as error:
            field_gaps(*mesh, [(0, 0, 0)], tmp_path=tmp_path)
    text = str(error.value)
    assert "two solids of the file overlap or touch near" in text
    assert "one from (-0.03, -0.025, -0.015) m to (0.03, 0.025, 0.015) m" in text
    assert "Boolean union" in text and "entry [[tools]] of its own" in text


def test_a_tenth_of_the_facets_turned_and_the_rest_inside_out(tmp_path):
    points, triangles = dish()
    wrong = turned(triangles).copy()
    chosen = np.random.default_rng(3).choice(len(wrong), len(wrong) // 10, replace=False)
    wrong[chosen] = turned(wrong[chosen])
    blank = sheet_at(-0.002)
    with pytest.warns(ToolWarning) as said:
        result, orientation = oriented(points, wrong, FILE, blank)
    assert same_normals(points, result, triangles)
    assert orientation.against_neighbours == len(chosen) == 51
    assert orientation.with_part == len(triangles) == 512
    assert [f"{n} of 512" in str(w.message) for n, w in zip((51, 512), said)] == [True, True]
    with pytest.warns(ToolWarning):
        gap = field_gaps(points, wrong, [(0, 0, -0.002), (0, 0, 0.002)], blank, tmp_path)
    np.testing.assert_allclose(gap, [0.002, -0.002], atol=1e-4)


@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("bottom", [-0.0011, -0.05, 0.03, 0.0120001])
def test_an_open_skin_is_free_on_the_side_of_the_blank(bottom, inverted):
    """The blank lies below the dish, or above its rim (11.96 mm high): then the inside is free."""
    points, downwards = dish()
    right = downwards if bottom < 0.0 else turned(downwards)
    given = turned(right) if inverted else right
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToolWarning)
        triangles, orientation = oriented(points, given, FILE, sheet_at(bottom))
    assert same_normals(points, triangles, right)
    assert orientation.reasons == ("to the side of the blank",)
    assert orientation.with_part == (len(given) if inverted else 0)


def test_a_skin_that_the_blank_touches_is_told_by_the_other_face():
    at = np.linspace(-0.06, 0.06, 13)
    x, y = (grid.ravel() for grid in np.meshgrid(at, at, indexing="ij"))
    points = np.stack([x, y, 1e-9 * np.random.default_rng(0).normal(size=x.size)], axis=1)
    first = np.array([i * 13 + j for i in range(12) for j in range(12)])
    up = np.concatenate(
        [np.stack([first, first + 13, first + 14], axis=1),
         np.stack([first, first + 14, first + 1], axis=1)]
    )  # fmt: skip
    for given in (up, turned(up)):
        for bottom, right in ((0.0, up), (-1e-5, up), (-0.001, turned(up))):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ToolWarning)
                triangles, _ = oriented(points, given, FILE, sheet_at(bottom))
            assert same_normals(points, triangles, right)


def test_a_skin_through_the_blank_is_left_with_a_warning():
    points, triangles = dish()
    points = points[:, [0, 2, 1]]  # upright: half of the blank lies before it, half behind
    with pytest.warns(ToolWarning, match="both sides of the open surface"):
        result, orientation = oriented(points, triangles, FILE, sheet_at(0.0))
    assert np.array_equal(result, triangles)
    assert orientation.reasons == ("as in the file (open)",)


def test_the_far_wall_of_an_open_shell_follows_the_near_one():
    """A dish of two skins without a rim between them: the blank sees the lower one only."""
    outer = dish()
    inner = outer[0] + (0.0, 0.0, 0.004), turned(outer[1])
    points, right = together(outer, inner)
    for given in (right, turned(right)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ToolWarning)
            triangles, orientation = oriented(points, given, FILE, sheet_at(-0.02, half=0.02))
        assert same_normals(points, triangles, right)
        assert orientation.open == 2


def test_patches_that_share_no_vertices_are_told_one_by_one():
    left, right = dish(), dish()
    points, given = together(
        (left[0] - (0.0301, 0.0, 0.0), left[1]), (right[0] + (0.0301, 0.0, 0.0), turned(right[1]))
    )
    with pytest.warns(ToolWarning, match="512 of 1024 .* to the side of the blank"):
        triangles, _ = oriented(points, given, FILE, sheet_at(-0.003, half=0.06))
    assert same_normals(points, triangles, together(left, right)[1])


def test_a_mould_around_the_blank_stays_hollow():
    points, outward = box((0.2, 0.2, 0.05))
    blank = sheet_at(-0.001)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        triangles, orientation = oriented(points, turned(outward), FILE, blank)
    assert triangles.shape == outward.shape and same_normals(points, triangles, turned(outward))
    assert orientation.reasons == ("to the blank, which lies inside",)
    # given as a solid, it is one: the blank inside is an overlap, not a mould
    assert oriented(points, outward, FILE, blank)[1].reasons == ("outwards",)
    # and a box that the blank sticks out of is no mould
    with pytest.warns(ToolWarning, match="outwards"):
        oriented(points, turned(outward), FILE, sheet_at(-0.001, half=0.11))


def test_closest_places_are_those_of_all_triangles():
    rng = np.random.default_rng(5)
    sizes = 10.0 ** rng.uniform(-3.0, 0.0, (700, 1, 1))
    corners = rng.uniform(-1.0, 1.0, (700, 1, 3)) + sizes * rng.normal(size=(700, 3, 3))
    points = rng.uniform(-2.0, 2.0, (300, 3))
    for some in (corners, corners[:1], corners[:9]):
        found = closest_places(triangle_tree(some), points)
        for p, point in enumerate(points):
            feet = np.array([closest_point_of_triangle(t, *point)[:3] for t in some])
            distance = np.linalg.norm(point - feet, axis=1)
            assert found.distance[p] == pytest.approx(distance.min(), rel=1e-12)
            assert distance[found.triangle[p]] == pytest.approx(distance.min(), rel=1e-12)
            np.testing.assert_allclose(found.foot[p], feet[found.triangle[p]], atol=1e-12)
            feature = closest_point_of_triangle(some[found.triangle[p]], *point)[3]
            assert found.feature[p] == feature
    assert math.isfinite(found.distance.max())
