"""Rigid tools: signed distances against independent geometry, distance fields, and motion."""

import math
import warnings
from pathlib import Path
from typing import Literal, get_args

import meshio
import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import Point, Polygon

from lcmchain.errors import InputError
from lcmchain.jit import entry
from lcmchain.packs import PACK, load_vector
from lcmchain.scene import Tool
from lcmchain.tools import (
    FIXED,
    GUIDED,
    PRESCRIBED,
    ToolWarning,
    build_tool_table,
    gaps,
    prescribed_travel,
    signed_distance,
    tool_surface,
)
from lcmchain.tools.motion import Motion
from lcmchain.tools.pack_distance import (
    DISTANCE_PACKS,
    keep_distance,
    pack_distance,
)
from lcmchain.tools.profiles import NO_LEVEL_PART
from lcmchain.tools.shapes import Shape
from lcmchain.tools.surfaces.distance_field import BAND, build_distance_field
from lcmchain.tools.surfaces.reading import read_surface

HERE = Path(".")


def table_of_type(union, type, **entries):
    """Table of a scene without its checks, so that the builders' own are seen."""
    (kind,) = (
        k
        for k in get_args(get_args(union)[0])
        if k.model_fields["type"].annotation == Literal[type]
    )
    return kind.model_construct(type=type, **entries)


def motion_of(type, **entries):
    return table_of_type(Motion, type, **entries)


AT_REST = motion_of("fixed")

SPHERE_CAPPED = {"type": "sphere_capped_punch", "radius": 0.075}
HOLE_PLATE = {"type": "plate_with_hole", "hole_radius": 0.077, "fillet_radius": 0.01}
ROLLER = {"type": "cylinder", "radius": 0.02, "edge_radius": 0.0, "length": None}
PUCK = {"type": "cylinder", "radius": 0.03, "edge_radius": 0.004, "length": 0.02}
SHARP_PUCK = {"type": "cylinder", "radius": 0.03, "edge_radius": 0.0, "length": 0.02}
CONE = {"type": "cone", "half_angle": math.radians(25.0), "tip_radius": 0.008}
SHARP_CONE = {"type": "cone", "half_angle": math.radians(25.0), "tip_radius": 0.0}

CUT_CONE = {**CONE, "height": 0.02}
CUT_SHARP_CONE = {**SHARP_CONE, "height": 0.02}

# A closed cross-section with convex and concave corners, and a groove in an endless die.
L_SECTION = [(0.01, 0.0), (0.07, 0.0), (0.07, 0.03), (0.04, 0.03), (0.04, 0.06), (0.01, 0.06)]
L_RING = {
    "type": "revolved_profile",
    "points": [*L_SECTION, L_SECTION[0]],
    "fillet_radii": (),
    "solid": "left",
}
L_BEAM = {**L_RING, "type": "extruded_profile"}
GROOVE = {
    "type": "extruded_profile",
    "points": [(-0.05, 0.0), (-0.02, 0.0), (0.0, -0.03), (0.02, 0.0), (0.05, 0.0)],
    "fillet_radii": (0.0, 0.005, 0.004, 0.005, 0.0),
    "solid": "right",
}

ANALYTIC = {
    "plate": {"type": "plate", "side": "below"},
    "plate above": {"type": "plate", "side": "above"},
    "sphere-capped punch": SPHERE_CAPPED,
    "plate with hole": {**HOLE_PLATE, "side": "below"},
    "holder with hole": {**HOLE_PLATE, "side": "above"},
    "sharp hole": {**HOLE_PLATE, "side": "below", "fillet_radius": 0.0},
    "roller": ROLLER,
    "puck": PUCK,
    "sharp puck": SHARP_PUCK,
    "cone": CONE,
    "sharp cone": SHARP_CONE,
    "cut cone": CUT_CONE,
    "cut sharp cone": CUT_SHARP_CONE,
    "ring": L_RING,
    "beam": L_BEAM,
    "groove": GROOVE,
}


def make_tool(shape, *, motion=AT_REST, position=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)):
    return Tool.model_construct(
        name="tool",
        shape=table_of_type(Shape, **shape),
        position=position,
        axis=axis,
        motion=motion,
        friction=None,
    )


def table_of(*shapes, directory=HERE, **place):
    return build_tool_table([make_tool(shape, **place) for shape in shapes], directory, 0.1)


def distances_and_normals(table, points, travel=0.0, tool=0):
    rows = np.array([signed_distance(table, tool, *point, travel) for point in points])
    return rows[:, 0], rows[:, 1:]


def random_points(count, reach=0.12, seed=0):
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 3))


def distance_to_polyline(points, curve):
    """Unsigned distance from points [n, 2] to a polyline [m, 2], by the densest brute force."""
    start, step = curve[:-1], np.diff(curve, axis=0)
    to_point = points[:, None] - start
    along = np.einsum("nmi,mi->nm", to_point, step) / np.einsum("mi,mi->m", step, step)
    foot = np.clip(along, 0.0, 1.0)[:, :, None] * step
    return np.linalg.norm(to_point - foot, axis=2).min(axis=1)


# --- exact distances of the analytic shapes -------------------------------------------------------


@pytest.mark.parametrize("side, sign", [("below", 1.0), ("above", -1.0)])
def test_distance_to_plate_is_height(side, sign):
    table = table_of({"type": "plate", "side": side}, position=(0.1, 0.2, 0.3))
    points = random_points(50)
    distance, normals = distances_and_normals(table, points)
    np.testing.assert_allclose(distance, sign * (points[:, 2] - 0.3), atol=1e-16)
    np.testing.assert_array_equal(normals, np.tile([0.0, 0.0, sign], (50, 1)))


def test_distance_to_sphere_capped_punch():
    radius = SPHERE_CAPPED["radius"]
    points = random_points(500, reach=0.2)
    r, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    exact = np.where(z < radius, np.hypot(r, z - radius), r) - radius
    np.testing.assert_allclose(gaps(table_of(SPHERE_CAPPED), 0, points, 0.0), exact, atol=1e-15)


def test_distance_to_cylinders():
    points = random_points(500)
    r, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    np.testing.assert_allclose(gaps(table_of(ROLLER), 0, points, 0.0), r - 0.02, atol=1e-15)
    outside = np.hypot(np.maximum(r - 0.03, 0.0), np.maximum(np.abs(z - 0.01) - 0.01, 0.0))
    inside = np.minimum(np.maximum(r - 0.03, np.abs(z - 0.01) - 0.01), 0.0)
    distance = gaps(table_of(SHARP_PUCK), 0, points, 0.0)
    np.testing.assert_allclose(distance, outside + inside, atol=1e-15)
    # Rounded: the smaller puck, grown by the edge radius.
    outside = np.hypot(np.maximum(r - 0.026, 0.0), np.maximum(np.abs(z - 0.01) - 0.006, 0.0))
    inside = np.minimum(np.maximum(r - 0.026, np.abs(z - 0.01) - 0.006), 0.0)
    distance = gaps(table_of(PUCK), 0, points, 0.0)
    np.testing.assert_allclose(distance, outside + inside - 0.004, atol=1e-15)


@pytest.mark.parametrize("side", ["below", "above"])
@pytest.mark.parametrize("fillet", [0.01, 0.0])
def test_distance_to_plate_with_hole_by_brute_force(side, fillet):
    hole = HOLE_PLATE["hole_radius"]
    up = 1.0 if side == "below" else -1.0
    angle = np.linspace(0.5 * math.pi, math.pi, 2001)
    curve = np.concatenate(
        (
            [(50.0, 0.0)],
            np.stack((np.cos(angle), np.sin(angle)), axis=1) * fillet + (hole + fillet, -fillet),
            [(hole, -50.0)],
        )
    )
    curve = curve[np.concatenate(([True], np.linalg.norm(np.diff(curve, axis=0), axis=1) > 0.0))]
    points = random_points(400, reach=0.15)
    r, z = np.hypot(points[:, 0], points[:, 1]), up * points[:, 2]
    corner = (r < hole + fillet) & (z > -fillet)
    off_corner = np.hypot(r - hole - fillet, z + fillet) < fillet
    solid = (r > hole) & (z < 0.0) & (~corner | off_corner)
    exact = np.where(solid, -1.0, 1.0) * distance_to_polyline(np.stack((r, z), axis=1), curve)
    table = table_of({**HOLE_PLATE, "fillet_radius": fillet, "side": side})
    np.testing.assert_allclose(gaps(table, 0, points, 0.0), exact, atol=1e-9)


def test_infinite_ends_of_plate_with_hole():
    table = table_of({**HOLE_PLATE, "side": "below"})
    assert signed_distance(table, 0, 3e4, 0.0, 0.2, 0.0) == (0.2, 0.0, 0.0, 1.0)
    assert signed_distance(table, 0, 0.07, 0.0, -2e5, 0.0)[0] == pytest.approx(0.007, abs=1e-15)
    assert signed_distance(table, 0, 5.0, 0.0, -4.0, 0.0)[0] == -4.0


@pytest.mark.parametrize("tip", [0.008, 0.0])
def test_distance_to_cone_by_brute_force(tip):
    half_angle = CONE["half_angle"]
    turn = np.linspace(-0.5 * math.pi, -half_angle, 2001)
    cap = tip * np.stack((np.cos(turn), 1.0 + np.sin(turn)), axis=1) if tip else np.zeros((1, 2))
    flank = cap[-1] + 50.0 * np.array([math.sin(half_angle), math.cos(half_angle)])
    curve = np.concatenate((cap, [flank]))
    points = random_points(400)
    r, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    apex = tip - tip / math.sin(half_angle)
    solid = r < np.tan(half_angle) * (z - apex)
    solid &= (np.hypot(r, z - tip) < tip) | (z > cap[-1, 1])
    exact = np.where(solid, -1.0, 1.0) * distance_to_polyline(np.stack((r, z), axis=1), curve)
    table = table_of({**CONE, "tip_radius": tip})
    np.testing.assert_allclose(gaps(table, 0, points, 0.0), exact, atol=1e-9)


def test_distance_to_a_cut_cone_by_hand():
    table = table_of(CUT_SHARP_CONE)
    rim, end = 0.02 * math.tan(CONE["half_angle"]), 0.02
    # below the apex, above and below the flat end on the axis, beside and off the rim
    points = [
        (0, 0, -0.001),
        (0, 0, 0.03),
        (0, 0, 0.019),
        (0.03, 0, end),
        (rim + 3e-3, 0, end + 4e-3),
    ]
    exact = [0.001, 0.01, -0.001, 0.03 - rim, 0.005]
    np.testing.assert_allclose(gaps(table, 0, np.array(points, float), 0.0), exact, atol=1e-15)


@pytest.mark.parametrize("solid", ["left", "right"])
@pytest.mark.parametrize("kind", ["revolved_profile", "extruded_profile"])
@pytest.mark.parametrize("fillet", [0.0, 0.004])
def test_distance_to_closed_profile(kind, solid, fillet):
    section = Polygon(L_SECTION)
    if fillet:  # shapely rounds the convex, then the concave corners
        for growth in (-fillet, 2.0 * fillet, -fillet):
            section = section.buffer(growth, quad_segs=400)
    shape = {**L_RING, "type": kind, "fillet_radii": [fillet] * 7, "solid": solid}
    points = random_points(400, reach=0.1)
    across = np.hypot(points[:, 0], points[:, 1]) if kind[0] == "r" else points[:, 0]
    plane = [Point(x, z) for x, z in zip(across, points[:, 2])]
    inside = -1.0 if solid == "left" else 1.0  # the section runs counter-clockwise
    exact = [
        (inside if section.contains(p) else -inside) * section.boundary.distance(p) for p in plane
    ]
    distance = gaps(table_of(shape), 0, points, 0.0)
    np.testing.assert_allclose(distance, exact, atol=1e-7 if fillet else 1e-15)


def test_sign_at_acute_corners():
    # A needle of 10 degrees: the tip's neighbourhood lies behind one flank's line, in front of the
    # other's. Slightly outside beside the tip must be outside, inside the notch inside.
    needle = [(-1.0, math.tan(math.radians(5.0))), (0.0, 0.0), (-1.0, -math.tan(math.radians(5.0)))]
    shape = {"type": "extruded_profile", "points": needle, "fillet_radii": (), "solid": "right"}
    angle = np.radians(np.arange(-84.0, 85.0, 4.0))
    around = np.stack((np.cos(angle), np.zeros_like(angle), np.sin(angle)), axis=1)
    np.testing.assert_allclose(gaps(table_of(shape), 0, around, 0.0), 1.0, atol=1e-15)
    notch = table_of({**shape, "solid": "left"})
    np.testing.assert_allclose(gaps(notch, 0, around, 0.0), -1.0, atol=1e-15)


def test_straight_points_and_axis_lines_change_nothing():
    points = random_points(200)
    plain = gaps(table_of(SHARP_PUCK), 0, points, 0.0)
    extra = [(0, 0), (0.01, 0), (0.03, 0), (0.03, 0.02), (0.0, 0.02), (0.0, 0.01), (0, 0)]
    for shift in range(6):  # wherever the closed path starts
        ring = extra[shift:-1] + extra[: shift + 1]
        shape = {"type": "revolved_profile", "points": ring, "fillet_radii": (), "solid": "left"}
        np.testing.assert_allclose(gaps(table_of(shape), 0, points, 0.0), plain, atol=1e-15)


def test_open_end_towards_the_axis_stops_there():
    # A disc given from r = 10 mm outwards is closed to the axis, not beyond.
    points = [(0.01, 0.0), (0.03, 0.0), (0.03, 0.02), (0.01, 0.02)]
    shape = {"type": "revolved_profile", "points": points, "fillet_radii": (), "solid": "left"}
    where = random_points(200)
    disc, puck = (gaps(table_of(s), 0, where, 0.0) for s in (shape, SHARP_PUCK))
    np.testing.assert_allclose(disc, puck, atol=1e-15)


def test_no_point_falls_between_a_line_and_its_fillet():
    # On the common normal of a line and an arc, rounding may put a point beyond the end of both.
    rng = np.random.default_rng(7)
    for _ in range(60):
        slopes = rng.uniform(0.3, 1.2, 2)
        corner = rng.uniform(-0.3, 0.3, 2)
        ends = corner + [(-0.1, -0.1 * slopes[0]), (0.1, -0.1 * slopes[1])]
        points = [ends[0], corner, ends[1]]
        shape = {"type": "extruded_profile", "points": points, "solid": "right"}
        table = table_of({**shape, "fillet_radii": (0.0, rng.uniform(0.01, 0.03), 0.0)})
        for start, end, piece in ((0, 1, 1), (1, 2, 1)):
            tangent = (points[end] - points[start]) / np.linalg.norm(points[end] - points[start])
            centre = table.segments[piece, 1:3]
            normal = np.array([-tangent[1], tangent[0]])
            joint = points[1] + tangent * np.dot(centre - points[1], tangent)
            height = np.linspace(-0.008, 0.1, 50)
            plane = joint + height[:, None] * normal
            where = np.insert(plane, 1, 0.0, axis=1)
            np.testing.assert_allclose(gaps(table, 0, where, 0.0), height, atol=1e-15)


def test_every_registered_shape_is_tested_here():
    registered = {
        choice
        for shape in get_args(get_args(Shape)[0])
        for choice in get_args(shape.model_fields["type"].annotation)
    }
    assert registered == {shape["type"] for shape in ANALYTIC.values()} | {"surface_mesh"}


# --- properties of every signed distance ----------------------------------------------------------


@pytest.mark.parametrize("name", ANALYTIC)
def test_normal_leads_to_the_closest_point(name):
    table = table_of(ANALYTIC[name])
    points = random_points(400)
    distance, normals = distances_and_normals(table, points)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-14)
    foot = points - distance[:, None] * normals
    np.testing.assert_allclose(gaps(table, 0, foot, 0.0), 0.0, atol=1e-14)


@pytest.mark.parametrize("name", ANALYTIC)
def test_normal_is_gradient_of_distance(name):
    table = table_of(ANALYTIC[name])
    points = random_points(300)
    _, normals = distances_and_normals(table, points)
    step = 1e-6
    one_sided = np.empty((2, *points.shape))
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        middle = gaps(table, 0, points, 0.0)
        one_sided[0, :, axis] = (gaps(table, 0, points + shift, 0.0) - middle) / step
        one_sided[1, :, axis] = (middle - gaps(table, 0, points - shift, 0.0)) / step
    smooth = (
        np.abs(one_sided[0] - one_sided[1]).max(axis=1) < 1e-2
    )  # not where two parts are as close
    assert smooth.mean() > 0.95
    np.testing.assert_allclose(normals[smooth], one_sided.mean(axis=0)[smooth], atol=1e-6)


@pytest.mark.parametrize("name", ANALYTIC)
@given(
    p=st.tuples(*[st.floats(-0.2, 0.2)] * 3),
    step=st.tuples(*[st.floats(-0.05, 0.05)] * 3),
)
def test_distance_changes_by_at_most_the_way(name, p, step):
    table = TABLES[name]
    q = np.add(p, step)
    change = signed_distance(table, 0, *p, 0.0)[0] - signed_distance(table, 0, *q, 0.0)[0]
    assert abs(change) <= np.linalg.norm(np.subtract(p, q)) + 1e-15


TABLES = {name: table_of(shape) for name, shape in ANALYTIC.items()}

DIRECTION = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


@pytest.mark.parametrize("name", ANALYTIC)
@given(axis=DIRECTION, position=st.tuples(*[st.floats(-0.5, 0.5)] * 3), travel=st.floats(-0.1, 0.1))
def test_distance_moves_and_turns_with_the_tool(name, axis, position, travel):
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    motion = motion_of(
        type="stroke", direction=2.0 * direction, distance=1.0, profile="smooth", start=0.0, end=1.0
    )
    table = table_of(ANALYTIC[name], axis=axis, position=position, motion=motion)
    local = random_points(10, seed=3)
    # Local axes as documented: z the axis, y across global x.
    z = np.array(axis) / np.linalg.norm(axis)
    across = np.cross(z, [1.0, 0.0, 0.0])
    if np.linalg.norm(across) < 1e-6:
        return
    y = across / np.linalg.norm(across)
    axes = np.array([np.cross(y, z), y, z])
    points = local @ axes + np.array(position) + travel * direction
    distance, normals = distances_and_normals(table, points, travel)
    expected, expected_normals = distances_and_normals(TABLES[name], local)
    np.testing.assert_allclose(distance, expected, atol=1e-14)
    np.testing.assert_allclose(normals, expected_normals @ axes, atol=1e-11)
    np.testing.assert_allclose(gaps(table, 0, points, travel), distance, atol=1e-16)


@entry
def find_distances(table, position, out):
    """Write gaps and normals (4, n) at places (3, n), pack by pack."""
    work = np.empty(DISTANCE_PACKS * PACK)
    for first in range(0, out.shape[1], PACK):
        count = min(PACK, out.shape[1] - first)
        gap, normal = pack_distance(table, 0, load_vector(position, first, count), 0.0, work, 0)
        keep_distance(gap, normal, work, 0)
        for row in range(DISTANCE_PACKS):
            out[row, first : first + count] = work[row * PACK : row * PACK + count]


def distances_of_packs(table, points):
    """As distances_and_normals, from the packs of nodes that the solver takes."""
    out = np.full((DISTANCE_PACKS, len(points)), np.nan)
    find_distances(table, np.ascontiguousarray(points.T), out)
    return out[0], out[1:].T


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.3, -0.5, 0.8)])
@pytest.mark.parametrize("name", ANALYTIC)
def test_packs_of_nodes_find_the_same_distance(name, axis):
    """One point at a time and many at once: two ways to write the same."""
    table = table_of(ANALYTIC[name], axis=axis, position=(0.01, -0.02, 0.005))
    points = np.vstack([random_points(300), [[0.01, -0.02, 0.005 + 0.01]]])
    gap, normal = distances_and_normals(table, points)
    packed_gap, packed_normal = distances_of_packs(table, points)
    np.testing.assert_allclose(packed_gap, gap, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(packed_normal, normal, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ANALYTIC)
def test_level_parts_change_no_bit(name):
    table = TABLES[name]
    without = table._replace(level_part=np.array([NO_LEVEL_PART]))
    random = np.random.default_rng(11)
    for centre in random.uniform(-0.12, 0.12, (400, 3)):
        centre *= random.choice([0.1, 0.5, 1.0])
        centre[2] *= random.choice([0.1, 0.5, 1.0])
        points = centre + random.uniform(-0.006, 0.006, (PACK, 3)) * [1.0, 1.0, 0.2]
        for found, known in zip(
            distances_of_packs(table, points), distances_of_packs(without, points)
        ):
            np.testing.assert_array_equal(found, known)


def test_level_parts_of_profiles():
    level = {name: table.level_part[0].tolist() for name, table in TABLES.items()}
    inf = math.inf
    assert level["plate with hole"] == pytest.approx([0.087, inf, 0.0, 1.0, inf])
    assert level["holder with hole"] == pytest.approx([0.087, inf, 0.0, -1.0, inf])
    assert level["sharp hole"] == pytest.approx([0.077, inf, 0.0, 1.0, inf])
    assert level["puck"] == pytest.approx([-inf, 0.026, 0.0, -1.0, 0.01])
    assert level["ring"] == pytest.approx([0.04, 0.07, 0.0, -1.0, 0.015])
    for name in ("sphere-capped punch", "roller", "cone", "plate"):
        assert level[name] == list(NO_LEVEL_PART)


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0)])
def test_local_axes_are_right_handed(axis):
    rotation = table_of(GROOVE, axis=axis).rotation[0]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_array_equal(rotation[2], axis)


@pytest.mark.parametrize("name", ANALYTIC)
def test_distance_on_the_axis_of_revolution(name):
    for z in (-0.05, -1e-9, 0.0, 1e-9, 0.01, 0.075, 0.3):
        gap, *normal = signed_distance(TABLES[name], 0, 0.0, 0.0, z, 0.0)
        assert math.isfinite(gap)
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        near = signed_distance(TABLES[name], 0, 1e-120, -1e-130, z, 0.0)[0]
        assert near == pytest.approx(gap, abs=1e-15)


def test_normal_at_pole_and_centre_of_a_punch():
    assert signed_distance(TABLES["sphere-capped punch"], 0, 0, 0, 0, 0.0) == (0.0, 0.0, 0.0, -1.0)
    gap, *normal = signed_distance(TABLES["sphere-capped punch"], 0, 0, 0, 0.075, 0.0)
    assert gap == -0.075
    assert np.linalg.norm(normal) == pytest.approx(1.0)


def test_hot_function_counts_no_references():
    # One pair of counts per array of the table and call costs more than the distance itself.
    options = {**signed_distance.targetoptions, "cache": False}  # cached code cannot be inspected
    options.pop("nopython")
    fresh = numba.njit(**options)(signed_distance.py_func)
    fresh(TABLES["cone"], 0, 0.0, 0.0, 0.0, 0.0)
    (code,) = fresh.inspect_llvm().values()
    compiled = code[code.index("define") : code.index("define", code.index("define") + 1)]
    assert "sqrt" in compiled  # the function itself, with what it calls
    assert "NRT_incref" not in compiled


def test_every_scene_has_one_table_type(tmp_path):
    write_mesh(tmp_path / "tool.stl", *box_mesh())
    mesh = {"type": "surface_mesh", "file": "tool.stl", "length_unit": "m", "spacing": 0.01}
    table = motion_of(type="table", direction=(0, 0, 1), times=(0, 1), travel=(0, 1))
    scenes = [
        [],
        [make_tool(SPHERE_CAPPED)],
        [make_tool(mesh), make_tool(L_BEAM, motion=table)],
    ]
    types = {numba.typeof(build_tool_table(tools, tmp_path, 0.1)) for tools in scenes}
    assert len(types) == 1


def test_tools_of_a_scene_do_not_mix():
    shapes = list(ANALYTIC.values())
    table = table_of(*shapes)
    points = random_points(30)
    for tool, shape in enumerate(shapes):
        np.testing.assert_array_equal(
            gaps(table, tool, points, 0.0), gaps(table_of(shape), 0, points, 0.0)
        )


# --- wrong profiles -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "points, radii, says",
    [
        ([(0, 0), (0.05, 0), (0.05, 0.02)], [0, 0.06, 0], "does not fit"),
        ([(0, 0), (0.05, 0), (0.05, 0.01), (0.09, 0.01)], [0, 0.006, 0.006, 0], "does not fit"),
        ([(0, 0), (0.05, 0), (0.05, 0)], None, "same point"),
        ([(0, 0), (0.05, 0), (0.02, 0)], None, "turns back"),
        ([(0, 0), (0.05, 0), (0.05, 0.02)], [0, -0.01, 0], "negative"),
        ([(0, 0), (0.05, 0), (0.05, 0.02)], [0, 0.01], "one per point"),
        ([(0, 0), (-0.05, 0.02)], None, "r >= 0"),
        ([(0, 0), (0, 0.02)], None, "on the axis"),
        ([(0.01, 0)], None, "two points"),
        ([(0, 0), (0.05, 0), (0.05, 0.02)], [0, 0, 0.01], "infinity"),
        ([(0.05, 0), (0.05, 0.05), (0.02, 0.05), (0.02, 0.02), (0.08, 0.02)], None, "crosses"),
    ],
)
def test_wrong_profiles_are_named(points, radii, says):
    shape = {"type": "revolved_profile", "points": points, "fillet_radii": radii, "solid": "left"}
    with pytest.raises(InputError, match=says) as error:
        table_of(SPHERE_CAPPED, shape)
    assert error.value.key.startswith('tools[1] "tool".shape.')


def test_a_line_of_a_thousand_kilometres_and_the_way_back_has_a_fillet():
    """The cosine between both is rounded to one; the angle is not zero."""
    points = [(0, -9e-3), (0.02, -9e-3), (1e6, 0), (0.3, 0)]
    shape = {"type": "revolved_profile", "points": points, "solid": "right"}
    table_of(SPHERE_CAPPED, shape | {"fillet_radii": [0, 3e-3, 3e-3, 0]})


# --- motion ---------------------------------------------------------------------------------------

SMOOTH_ENTRIES = {
    "type": "stroke",
    "direction": (0, 0, -2),
    "distance": 0.075,
    "profile": "smooth",
    "start": 0.01,
    "end": None,
}
SMOOTH_STROKE = motion_of(**SMOOTH_ENTRIES)


def test_smooth_stroke_starts_and_ends_at_rest():
    table = table_of(SPHERE_CAPPED, motion=SMOOTH_STROKE)
    assert table.motion_kind[0] == PRESCRIBED
    np.testing.assert_array_equal(table.direction[0], [0.0, 0.0, -1.0])
    for time, travel in ((-1.0, 0.0), (0.01, 0.0), (0.1, 0.075), (7.0, 0.075)):
        assert prescribed_travel(table, 0, time) == (pytest.approx(travel, abs=1e-17), 0.0)
    assert prescribed_travel(table, 0, 0.055)[0] == pytest.approx(0.0375)
    # Acceleration vanishes at the ends: the velocity starts with the square of the time.
    early, earlier = prescribed_travel(table, 0, 0.0102)[1], prescribed_travel(table, 0, 0.0101)[1]
    assert early / earlier == pytest.approx(4.0, rel=0.01)
    late, later = prescribed_travel(table, 0, 0.0998)[1], prescribed_travel(table, 0, 0.0999)[1]
    assert late / later == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize(
    "motion",
    [
        SMOOTH_STROKE,
        motion_of(**{**SMOOTH_ENTRIES, "profile": "linear"}),
        motion_of(
            type="table", direction=(1, 0, 0), times=(0.01, 0.03, 0.04, 0.08), travel=(0, 1, -2, 3)
        ),
    ],
)
def test_velocity_is_the_rate_of_travel(motion):
    table = table_of(SPHERE_CAPPED, motion=motion)
    for time in np.linspace(0.0013, 0.1187, 101):
        step = 1e-7
        ahead, behind = (prescribed_travel(table, 0, time + s)[0] for s in (step, -step))
        velocity = prescribed_travel(table, 0, time)[1]
        assert velocity == pytest.approx((ahead - behind) / (2 * step), rel=1e-6, abs=1e-8)


def test_tabulated_travel_passes_its_points():
    times, travel = (0.0, 0.01, 0.04), (0.0, 0.02, 0.05)
    motion = motion_of(type="table", direction=(0, 0, 1), times=times, travel=travel)
    other = motion_of(type="table", direction=(0, 0, 1), times=(0.0, 1.0), travel=(5.0, 6.0))
    tools = [make_tool(PUCK, motion=m) for m in (other, motion, AT_REST)]
    table = build_tool_table(tools, HERE, 0.1)
    for time, expected in zip(times, travel):
        assert prescribed_travel(table, 1, time)[0] == pytest.approx(expected, abs=1e-17)
    assert prescribed_travel(table, 1, 0.025) == (pytest.approx(0.035), pytest.approx(1.0))
    assert prescribed_travel(table, 0, 0.5)[0] == 5.5
    assert prescribed_travel(table, 2, 0.5) == (0.0, 0.0)
    assert table.motion_kind.tolist() == [PRESCRIBED, PRESCRIBED, FIXED]


def test_guided_tool_data():
    motion = motion_of(
        type="guided",
        direction=(0, 3, -4),
        mass=1.7,
        force=20.0,
        gravity=True,
        damping=5.0,
        ramp=0.01,
    )
    table = table_of(PUCK, motion=motion)
    assert table.motion_kind[0] == GUIDED
    assert (table.mass[0], table.force[0], table.damping[0]) == (1.7, 20.0, 5.0)
    assert table.gravity_along[0] == pytest.approx(0.8 * 9.81)
    assert prescribed_travel(table, 0, 0.05) == (0.0, 0.0)
    motion = motion.model_copy(update={"gravity": False})
    assert table_of(PUCK, motion=motion).gravity_along[0] == 0.0


def test_tools_of_a_scene_file():
    shapes = [shape for shape in ANALYTIC.values() if "solid" not in shape] + [GROOVE]
    motions = [
        {"type": "fixed"},
        {"type": "stroke", "direction": (0, 0, -1), "distance": 0.075},
        {"type": "table", "direction": (0, 0, 1), "times": (0.0, 0.1), "travel": (0.0, 0.05)},
        {"type": "guided", "direction": (0, 0, -1), "mass": 1.7},
    ]
    tools = [
        Tool.model_validate({"name": f"tool{i}", "shape": shape, "motion": motions[i % 4]})
        for i, shape in enumerate(shapes)
    ]
    table = build_tool_table(tools, HERE, 0.1)
    points = random_points(20)
    for i, shape in enumerate(shapes):
        expected = gaps(table_of(shape), 0, points, 0.0)
        np.testing.assert_array_equal(gaps(table, i, points, 0.0), expected)
    assert [prescribed_travel(table, i, 0.1)[0] for i in range(4)] == [0.0, 0.075, 0.05, 0.0]
    assert table.gravity_along[3] == 9.81
    assert table.motion_kind[:4].tolist() == [FIXED, PRESCRIBED, PRESCRIBED, GUIDED]


GUIDED_ENTRIES = {"type": "guided", "direction": (0, 0, -1), "mass": 2.0}
TABLE_ENTRIES = {"type": "table", "direction": (0, 0, 1), "times": (0.0, 0.1), "travel": (0, 1)}


@pytest.mark.parametrize(
    ("entries", "moves"),
    [
        ({"type": "fixed"}, False),
        ({"type": "stroke", "direction": (0, 0, -1), "distance": 0.075}, True),
        (TABLE_ENTRIES, True),
        (GUIDED_ENTRIES, True),
        ({**GUIDED_ENTRIES, "direction": (1, 0, 0)}, False),  # the weight acts across
        ({**GUIDED_ENTRIES, "gravity": False, "force": -3.0}, True),
        ({**GUIDED_ENTRIES, "gravity": False}, False),
    ],
)
def test_what_moves_a_tool(entries, moves):
    tool = Tool.model_validate({"name": "tool", "shape": SPHERE_CAPPED, "motion": entries})
    assert tool.motion.moves is moves


def test_load_of_a_guided_tool():
    entries = {**GUIDED_ENTRIES, "force": 3.0}
    tool = Tool.model_validate({"name": "tool", "shape": SPHERE_CAPPED, "motion": entries})
    assert tool.motion.load == 3.0 + 2.0 * 9.81


def test_table_that_goes_on_after_the_process_is_remarked():
    tool = Tool.model_validate({"name": "tool", "shape": SPHERE_CAPPED, "motion": TABLE_ENTRIES})
    assert tool.motion.remarks("tool", 0.1) == []
    (remark,) = tool.motion.remarks("tool", 0.09)
    assert 'motion table of "tool" goes on' in remark


def test_friction_of_a_tool_or_of_the_scene():
    own, default = make_tool(PUCK).model_copy(update={"friction": 0.3}), make_tool(PUCK)
    table = build_tool_table([own, default], HERE, 0.1, default_friction=0.157)
    assert table.friction.tolist() == [0.3, 0.157]


@pytest.mark.parametrize(
    "changes, key",
    [
        ({"end": 0.005}, "motion.end"),
        ({"direction": (0, 0, 0)}, "motion.direction"),
        ({"profile": "fast"}, "motion.profile"),
        ({"type": "table", "times": (0, 2, 1), "travel": (0, 1, 2)}, "motion.times[2]"),
        ({"type": "table", "times": (0, 2), "travel": (0, 1, 2)}, "motion.travel"),
    ],
)
def test_wrong_motions_are_named(changes, key):
    with pytest.raises(InputError) as error:
        table_of(PUCK, motion=motion_of(**{**SMOOTH_ENTRIES, **changes}))
    assert error.value.key == f'tools[0] "tool".{key}'


# --- surface meshes -------------------------------------------------------------------------------


def box_mesh(size=(0.06, 0.04, 0.03)):
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [(a, b, c) for a, b, c, _ in quads] + [(a, c, d) for a, _, c, d in quads]
    return (corners - 0.5) * size, np.array(triangles)


def box_distance(points, size=(0.06, 0.04, 0.03)):
    q = np.abs(points) - 0.5 * np.array(size)
    return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)


def sphere_mesh(radius, subdivisions):
    """Octahedron whose triangles are split in four and pushed onto the sphere."""
    points = [np.eye(3)[i] * s for i in range(3) for s in (1, -1)]
    triangles = [
        (0, 2, 4),
        (2, 1, 4),
        (1, 3, 4),
        (3, 0, 4),
        (2, 0, 5),
        (1, 2, 5),
        (3, 1, 5),
        (0, 3, 5),
    ]
    points, triangles = np.array(points), np.array(triangles)
    for _ in range(subdivisions):
        corners = points[triangles]
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        a, b, c = corners.transpose(1, 0, 2)
        ab, bc, ca = middles.transpose(1, 0, 2)
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        soup = np.concatenate([np.stack(part, axis=1) for part in parts]).reshape(-1, 3)
        soup /= np.linalg.norm(soup, axis=1, keepdims=True)
        points, index = np.unique(soup.round(12), axis=0, return_inverse=True)
        triangles = index.reshape(-1, 3)
    return radius * points, triangles


def write_mesh(file, points, triangles, **options):
    meshio.Mesh(points, [("triangle", triangles)]).write(file, **options)
    return file


def mesh_table(tmp_path, points, triangles, spacing, name="tool.stl", **place):
    write_mesh(tmp_path / name, points, triangles)
    shape = {"type": "surface_mesh", "file": name, "length_unit": "m", "spacing": spacing}
    return table_of(shape, directory=tmp_path, **place)


def test_sphere_field_converges(tmp_path):
    radius = 0.05
    mesh = sphere_mesh(radius, 6)
    direction = random_points(400, seed=1)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    height = np.random.default_rng(2).uniform(-0.004, 0.004, 400)
    points = (radius + height)[:, None] * direction
    errors, tilts = [], []
    for spacing in (0.024, 0.012):  # finer ones meet the facets of the mesh
        table = mesh_table(tmp_path, *mesh, spacing)
        distance, normals = distances_and_normals(table, points)
        errors.append(np.abs(distance - height).max())
        tilts.append(np.linalg.norm(normals - direction, axis=1).max())
    assert errors[1] < 3e-5
    assert errors[0] / errors[1] > 2.0**2.5
    assert tilts[1] < 0.01
    assert tilts[0] / tilts[1] > 2.0**1.5


def test_box_field_is_exact_but_for_its_edges(tmp_path):
    rng = np.random.default_rng(4)
    points = rng.uniform(-1.0, 1.0, (3000, 3)) * (0.034, 0.024, 0.019)
    exact = box_distance(points)
    # Away from the planes on which two faces are equally close (edges and the inner medial planes).
    depth = np.sort(np.abs(points) - np.array([0.03, 0.02, 0.015]), axis=1)
    worst = []
    for spacing in (0.002, 0.001):
        distance, normals = distances_and_normals(
            mesh_table(tmp_path, *box_mesh(), spacing), points
        )
        near = np.abs(exact) < 2.5 * spacing
        plane = near & (depth[:, 2] - depth[:, 1] > 4.0 * spacing) & (depth[:, 1] < -4.0 * spacing)
        assert plane.sum() > 20
        np.testing.assert_allclose(distance[plane], exact[plane], atol=1e-8)
        faces = (np.abs(points) - (0.03, 0.02, 0.015)).argmax(axis=1)[plane]
        expected = np.eye(3)[faces] * np.sign(points[plane])
        np.testing.assert_allclose(normals[plane], expected, atol=1e-5)
        worst.append(np.abs(distance - exact)[near].max() / spacing)
    assert max(worst) < 0.35  # edges are rounded over a part of one spacing


def test_field_far_away_is_a_lower_bound(tmp_path):
    table = mesh_table(tmp_path, *box_mesh(), 0.002)
    points = random_points(4000, reach=0.2, seed=5)
    points = np.concatenate((points, random_points(4000, reach=0.035, seed=6)))
    exact = box_distance(points)
    distance, normals = distances_and_normals(table, points)
    far = np.abs(exact) > BAND * 0.002
    assert (np.sign(distance[far]) == np.sign(exact[far])).all()
    assert (np.abs(distance[far]) <= np.abs(exact[far]) + 1e-9).all()
    # ... and a useful one: a node one tool length away need not be looked at for long.
    assert (distance > 0.5 * exact - 0.006)[exact > 0.0].all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)


def test_loops_over_nodes_read_the_same_field(tmp_path):
    table = mesh_table(tmp_path, *box_mesh(), 0.002, axis=(0.3, -0.5, 0.8))
    points = random_points(300, reach=0.06)
    gap, normal = distances_and_normals(table, points)
    packed_gap, packed_normal = distances_of_packs(table, points)
    np.testing.assert_allclose(packed_gap, gap, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(packed_normal, normal, rtol=0.0, atol=1e-12)


def test_normals_of_a_field_do_not_jump(tmp_path):
    table = mesh_table(tmp_path, *sphere_mesh(0.05, 4), 0.003)
    angle = np.linspace(0.0, 1.0, 20001)
    way = 0.0505 * np.stack((np.cos(angle), np.sin(angle), 0.3 * angle), axis=1)
    way *= (0.0505 / np.linalg.norm(way, axis=1))[:, None]
    distance, normals = distances_and_normals(table, way)
    turn = np.linalg.norm(np.diff(normals, axis=0), axis=1)
    assert turn.max() < 4.0 * np.median(turn)
    assert np.abs(np.diff(distance)).max() < 1e-6


def test_field_turns_and_moves_with_the_tool(tmp_path):
    axis, position = (1.0, 2.0, 2.0), (0.1, -0.2, 0.05)
    mesh = sphere_mesh(0.05, 4)[0] + (0.0, 0.0, 0.01), sphere_mesh(0.05, 4)[1]
    table = mesh_table(tmp_path, *mesh, 0.003, axis=axis, position=position)
    centre = np.array(position) + 0.01 * np.array(axis) / 3.0
    points = centre + random_points(100, reach=0.03) + np.array([0.0, 0.04, 0.0])
    exact = np.linalg.norm(points - centre, axis=1) - 0.05
    near = np.abs(exact) < 0.006
    distance, normals = distances_and_normals(table, points[near])
    np.testing.assert_allclose(distance, exact[near], atol=2e-4)
    outward = (points - centre)[near] / np.linalg.norm(points - centre, axis=1)[near][:, None]
    np.testing.assert_allclose(normals, outward, atol=0.03)


def open_plate(cells=12, size=0.06):
    """Horizontal skin at z = 0 that faces upwards."""
    at = np.linspace(-0.5, 0.5, cells + 1) * size
    points = np.array([(x, y, 0.0) for x in at for y in at])
    first = np.array([i * (cells + 1) + j for i in range(cells) for j in range(cells)])
    a, b, c, d = first, first + cells + 1, first + cells + 2, first + 1
    return points, np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))


def test_open_skin_is_solid_behind_and_free_beside(tmp_path):
    spacing = 0.002
    table = mesh_table(tmp_path, *open_plate(), spacing)
    over = np.array([(x, 0.011, 0.0) for x in np.linspace(-0.025, 0.025, 21)])
    for height in (-0.005, -0.001, 0.0, 0.001, 0.005):
        distance, normals = distances_and_normals(table, over + (0.0, 0.0, height))
        np.testing.assert_allclose(distance, height, atol=1e-8)
        np.testing.assert_allclose(normals, np.tile([0.0, 0.0, 1.0], (21, 1)), atol=1e-6)
    # Behind the skin it is solid down to where the band ends, and free from there on.
    down = -np.linspace(0.0, 7.0, 141) * spacing
    behind = gaps(table, 0, np.stack((0.003 + 0.0 * down, 0.0 * down, down), axis=1), 0.0)
    solid = behind < 0.0
    np.testing.assert_allclose(behind[solid], down[solid], atol=1e-8)
    assert solid[1:61].all() and not solid[101:].any() and np.count_nonzero(np.diff(solid)) == 2
    # A sheet that hangs down over the edge, or passes far behind the skin, touches nothing.
    hanging = np.array([(0.03 + 2.5 * spacing, 0.0, z) for z in np.linspace(-0.02, 0.01, 61)])
    assert (gaps(table, 0, hanging, 0.0) >= 0.0).all()
    assert (gaps(table, 0, over - (0.0, 0.0, (BAND + 1.0) * spacing), 0.0) >= 0.0).all()


def test_cracks_between_patches_do_not_leak(tmp_path):
    # Two skins that share an edge but no vertices, with a gap of a tenth of a spacing.
    left, right = open_plate(12, 0.06), open_plate(7, 0.06)
    points = np.concatenate((left[0] - (0.03, 0.0, 0.0), right[0] + (0.0302, 0.0, 0.0)))
    triangles = np.concatenate((left[1], right[1] + len(left[0])))
    table = mesh_table(tmp_path, points, triangles, 0.002)
    x = np.linspace(-0.01, 0.01, 201)
    for height in (-0.004, -0.001, 0.001, 0.004):
        way = np.stack((x, np.full(201, 0.003), np.full(201, height)), axis=1)
        distance, normals = distances_and_normals(table, way)
        np.testing.assert_allclose(distance, height, atol=1e-4)
        assert (normals[:, 2] > 0.99).all()


def test_sign_beyond_an_acute_crack(tmp_path):
    # The flanks of a wedge of 30 degrees meet at the y axis without sharing a vertex. A point
    # beside the tip is as close to both, but only one of them knows that it is outside.
    at = np.linspace(-0.03, 0.03, 13)
    slope = math.tan(math.radians(15.0))
    points, triangles = [], []
    for sign in (1.0, -1.0):
        start = len(points)
        points += [(1e-6 * sign - x, y, sign * slope * x) for x in (0.0, 0.03) for y in at]
        for i in range(start, start + 12):
            strip = [(i, i + 14, i + 13), (i, i + 1, i + 14)]
            triangles += strip if sign > 0.0 else [triangle[::-1] for triangle in strip]
    table = mesh_table(tmp_path, np.array(points), np.array(triangles), 0.001)
    angle = np.radians(np.arange(-85.0, 86.0, 5.0))
    around = 0.002 * np.stack((np.cos(angle), 0.0 * angle, np.sin(angle)), axis=1)
    np.testing.assert_allclose(gaps(table, 0, around, 0.0), 0.002, atol=2e-4)


def test_sign_beyond_a_vertex_of_uneven_triangles(tmp_path):
    # A spike one of whose faces is cut into forty triangles: they must not outvote the others.
    turn = np.radians(np.concatenate((np.linspace(0.0, 90.0, 41), [180.0, 270.0])))
    rim = np.stack((np.cos(turn), np.sin(turn), np.full_like(turn, -3.0)), axis=1)
    rim[1:40, :2] = rim[0, :2] + np.linspace(0.0, 1.0, 41)[1:40, None] * (rim[40] - rim[0])[:2]
    points = 0.01 * np.concatenate(([(0.0, 0.0, 0.0)], rim))
    around = np.arange(1, len(points))
    triangles = np.stack((np.zeros_like(around), around, np.roll(around, -1)), axis=1)
    table = mesh_table(tmp_path, points, triangles, 0.0005)
    where = random_points(4000, reach=0.002, seed=8)
    # Closest to the tip: behind the plane through the tip across each of the four ridges.
    ridges = points[[1, 41, 42, 43]] / np.linalg.norm(points[1])
    where = where[(where @ ridges.T < -1e-4).all(axis=1)]
    exact = np.linalg.norm(where, axis=1)
    where, exact = where[exact > 0.0008], exact[exact > 0.0008]
    assert len(where) > 100
    distance = gaps(table, 0, where, 0.0)
    near = exact < 0.0012
    np.testing.assert_allclose(distance[near], exact[near], atol=1e-4)
    assert (distance > 0.0).all()


def test_turned_triangles_are_turned_back(tmp_path):
    points, triangles = sphere_mesh(0.05, 3)
    expected = mesh_table(tmp_path, points, triangles, 0.004)
    triangles = triangles.copy()
    triangles[::5] = triangles[::5, ::-1]
    with pytest.warns(ToolWarning, match=r"103 of 512 triangles were turned"):
        table = mesh_table(tmp_path, points, triangles, 0.004)
    where = random_points(200, reach=0.06)
    np.testing.assert_allclose(gaps(table, 0, where, 0.0), gaps(expected, 0, where, 0.0), atol=1e-9)


def test_inward_normals_of_a_closed_surface_are_turned(tmp_path):
    points, triangles = box_mesh()
    with pytest.warns(ToolWarning, match="12 of 12 triangles .* now they point outwards"):
        table = mesh_table(tmp_path, points, triangles[:, ::-1], 0.002)
    assert signed_distance(table, 0, 0.0, 0.0, 0.012, 0.0)[0] == pytest.approx(-0.003, abs=1e-6)
    assert signed_distance(table, 0, 0.0, 0.0, 0.017, 0.0)[0] == pytest.approx(0.002, abs=1e-6)


def test_confused_sides_are_an_error(tmp_path):
    # Patches that share no vertices cannot be turned to agree: the field shows the contradiction.
    left, right = open_plate(12, 0.06), open_plate(7, 0.06)
    points = np.concatenate((left[0] - (0.03, 0.0, 0.0), right[0] + (0.0302, 0.0, 0.0)))
    triangles = np.concatenate((left[1], right[1][:, ::-1] + len(left[0])))
    with pytest.raises(InputError, match="opposite normals"):
        mesh_table(tmp_path, points, triangles, 0.002)


def test_one_sided_surface_is_an_error(tmp_path):
    angle = np.linspace(0.0, 2.0 * math.pi, 40, endpoint=False)
    rims = []
    for width in (-0.01, 0.01):
        r = 0.05 + width * np.cos(0.5 * angle)
        rims.append(
            np.stack((r * np.cos(angle), r * np.sin(angle), width * np.sin(0.5 * angle)), 1)
        )
    a, b = np.arange(40), np.arange(40) + 40
    c, d = np.append(b[1:], 0), np.append(a[1:], 40)  # the strip closes with its rims swapped
    triangles = np.concatenate((np.stack((a, d, c), axis=1), np.stack((a, c, b), axis=1)))
    with pytest.raises(InputError, match="Moebius"):
        mesh_table(tmp_path, np.concatenate(rims), triangles, 0.002)


def test_edges_of_three_triangles_are_reported(tmp_path):
    points, triangles = box_mesh()
    points = np.concatenate((points, [(0.05, 0.0, 0.0)]))
    fin = [triangles[0][0], triangles[0][1], 8]
    with pytest.warns(ToolWarning, match="1 edges belong to more than two"):
        read_surface(write_mesh(tmp_path / "fin.stl", points, np.vstack((triangles, fin))), "m")


def test_degenerate_and_repeated_triangles_are_left_out(tmp_path):
    points, triangles = box_mesh()
    triangles = np.vstack((triangles, triangles[:2], [[0, 1, 1], [2, 2, 2]]))
    with pytest.warns(ToolWarning, match="2 triangles without area and 2 repeated"):
        surface = read_surface(write_mesh(tmp_path / "tool.ply", points, triangles), "m")
    assert len(surface.triangles) == 12
    assert np.all(surface.edge_use == 2)


@pytest.mark.parametrize("binary", [True, False])
def test_stl_vertices_are_welded(tmp_path, binary):
    points, triangles = sphere_mesh(50.0, 3)
    file = write_mesh(tmp_path / "sphere.stl", points, triangles, binary=binary)
    surface = read_surface(file, "mm")
    assert (len(surface.points), len(surface.triangles)) == (len(points), len(triangles))
    assert np.all(surface.edge_use == 2)
    np.testing.assert_allclose(np.linalg.norm(surface.points, axis=1), 0.05, rtol=1e-5)


def test_quadrilaterals_of_other_formats(tmp_path):
    corners, _ = box_mesh()
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    meshio.Mesh(corners, [("quad", quads), ("line", [(0, 1)])]).write(tmp_path / "box.vtu")
    surface = read_surface(tmp_path / "box.vtu", "m")
    assert len(surface.triangles) == 12
    field = build_distance_field(surface, 0.002, key="shape")
    assert field.coefficients.dtype == np.float32


@pytest.mark.parametrize(
    "name, content, says",
    [
        ("absent.stl", None, "no such file"),
        ("empty.stl", b"", "empty"),
        ("blank.stl", b"solid nothing\nendsolid nothing\n", "no triangles"),
        ("words.stl", b"solid this is\nnot a mesh at all\n", "cannot be read"),
        ("broken.stl", b"binary junk \x00\xff" * 30, "no triangles"),
        ("broken.vtu", b"<VTKFile>", "cannot be read"),
        ("unknown.xyz123", b"data", "the content is no mesh of a format that is known"),
        (
            "line.stl",
            b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 2 0 0\n"
            b"endloop\nendfacet\nendsolid a\n",
            "no triangle has an area",
        ),
        (
            "nan.stl",
            b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex nan 0 0\nvertex 2 1 0\n"
            b"endloop\nendfacet\nendsolid a\n",
            "not finite",
        ),
    ],
)
def test_unusable_files_are_named(tmp_path, capsys, name, content, says):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    shape = {"type": "surface_mesh", "file": name, "length_unit": "mm", "spacing": None}
    with pytest.raises(InputError, match=says) as error:
        table_of(shape, directory=tmp_path)
    assert name in str(error.value)
    assert capsys.readouterr() == ("", "")


def test_truncated_binary_stl_is_an_error(tmp_path):
    file = write_mesh(tmp_path / "cut.stl", *sphere_mesh(0.05, 2), binary=True)
    file.write_bytes(file.read_bytes()[:-70])
    with pytest.raises(InputError, match="cannot be read"):
        read_surface(file, "m")


def test_volume_mesh_and_wrong_unit_are_errors(tmp_path):
    file = tmp_path / "solid.vtu"
    meshio.Mesh(np.vstack((np.zeros(3), np.eye(3))), [("tetra", [[0, 1, 2, 3]])]).write(file)
    with pytest.raises(InputError, match="no triangles or quadrilaterals \\(tetra\\)"):
        read_surface(file, "m")
    with pytest.raises(InputError, match="length_unit"):
        read_surface(write_mesh(tmp_path / "box.stl", *box_mesh()), "kg")


def test_spacing_is_checked_against_the_tool(tmp_path):
    surface = read_surface(write_mesh(tmp_path / "box.stl", *box_mesh()), "m")
    with pytest.raises(InputError, match="million nodes") as error:
        build_distance_field(surface, 2e-5, key="tools[0].shape")
    assert error.value.key == "tools[0].shape.spacing"
    with pytest.warns(ToolWarning, match="smaller spacing"):  # a wall thinner than two spacings
        points, triangles = box_mesh((0.06, 0.04, 0.001))
        thin = read_surface(write_mesh(tmp_path / "thin.stl", points, triangles), "m")
        build_distance_field(thin, 0.002, key="tools[0].shape")


def test_automatic_spacing_suits_the_tool(tmp_path):
    surface = read_surface(write_mesh(tmp_path / "box.stl", *box_mesh()), "m")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        field = build_distance_field(surface, None, key="shape")
    assert 1e6 < field.coefficients.size < 4e6


# --- drawing --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ANALYTIC)
@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 2, -2)])
def test_drawn_surface_lies_on_the_tool(name, axis):
    tool = make_tool(ANALYTIC[name], axis=axis, position=(0.01, 0.0, 0.02))
    table = build_tool_table([tool], HERE, 0.1)
    box = np.array([[-0.12, -0.1, -0.11], [0.13, 0.12, 0.1]])
    points, faces = tool_surface(tool, HERE, box)
    assert len(faces) > 0
    assert (points >= box[0] - 1e-12).all() and (points <= box[1] + 1e-12).all()
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1)
    middles = corners.mean(axis=1)
    distance, outward = distances_and_normals(table, middles)
    assert np.abs(distance).max() < 5e-4  # chords of the circles
    clear = area > 1e-8
    aligned = np.einsum("ij,ij->i", normals, outward)[clear] / area[clear]
    assert aligned.min() > 0.9


def test_drawn_mesh_stands_where_the_tool_is(tmp_path):
    write_mesh(tmp_path / "box.stl", *box_mesh())
    shape = {"type": "surface_mesh", "file": "box.stl", "length_unit": "m", "spacing": None}
    tool = make_tool(shape, position=(0.0, 0.0, 1.0), axis=(0.0, 1.0, 0.0))
    points, faces = tool_surface(tool, tmp_path, 0.5)
    assert len(faces) == 12
    np.testing.assert_allclose(points.max(axis=0), [0.03, 0.015, 1.02], atol=1e-8)
    assert tool_surface(tool, tmp_path, [[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]])[1].shape == (0, 3)
