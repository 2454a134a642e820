"""Holes, darts and slits: the mesh covers what is left, and no cell lies across a cut."""

import math
import warnings

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.mesh.blank import Blank, build_blank
from lcmchain.mesh.cells import boundary_edges
from lcmchain.mesh.contours import contours_of
from lcmchain.mesh.lines import pieces_along
from lcmchain.mesh.places import Places, Where
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text

THICKNESS = 1e-3
LONGEST_SHARE = 1.2  # step of whole elements over that of the mesh


def circle(radius, middle=(0.0, 0.0), count=48):
    angle = 2.0 * np.pi * np.arange(count) / count
    return tuple(zip(middle[0] + radius * np.cos(angle), middle[1] + radius * np.sin(angle)))


def rectangle(width, height, middle=(0.0, 0.0)):
    x, y = 0.5 * width, 0.5 * height
    corners = ((-x, -y), (x, -y), (x, y), (-x, y))
    return tuple((middle[0] + a, middle[1] + b) for a, b in corners)


def four(dart):
    """A dart and its mirror images."""
    return tuple(
        tuple((sx * x, sy * y) for x, y in dart) for sx in (1.0, -1.0) for sy in (1.0, -1.0)
    )


RECTANGLE = {"holes": (rectangle(0.06, 0.043, (0.01, 0.02)),)}
TRIANGLE = {"holes": (((0.02, -0.06), (0.08, -0.03), (0.04, 0.05)),)}
TWO = {"holes": (rectangle(0.05, 0.05, (-0.07, 0.0)), rectangle(0.04, 0.06, (0.05, 0.02)))}
DART = {"darts": (((-0.15, 0.02), (-0.07, 0.0), (-0.15, -0.02)),)}
NARROW = {"darts": (((-0.15, 0.005), (-0.0534, 0.0011), (-0.15, -0.005)),)}
DIAGONAL = {"darts": four(((0.15, 0.12), (0.07, 0.07), (0.12, 0.15)))}
NOTCH = {"slits": (((-0.15, 0.02), (0.0, 0.02)),)}
INNER = {"slits": (((-0.05, 0.02), (0.07, 0.063)),)}
BENT = {"slits": (((-0.15, 0.0213), (0.0, 0.03), (0.03, 0.09)),)}
ALL = {
    "holes": (rectangle(0.05, 0.03, (0.0, -0.05)),),
    "darts": (
        ((0.16, -0.02), (0.06, 0.0), (0.16, 0.02)),
        ((-0.02, 0.15), (0.0, 0.1), (0.01, 0.15)),
    ),
    "slits": (((-0.1, -0.1), (-0.09, 0.05)), ((-0.15, 0.1), (-0.06, 0.11))),
}
CASES = {
    "rectangle": RECTANGLE, "triangle": TRIANGLE, "two holes": TWO, "dart": DART,
    "narrow dart": NARROW, "diagonal darts": DIAGONAL, "slit from the rim": NOTCH,
    "slit inside": INNER, "bent slit": BENT, "all": ALL,
}  # fmt: skip
LOOPS = {"rectangle": 2, "triangle": 2, "two holes": 3, "slit inside": 2, "all": 3}


def blank_of(*, degrees=0.0, edge_length=5e-3, size=(0.3, 0.3), **cuts):
    return Blank(size=size, edge_length=edge_length, fibre_angle=math.radians(degrees), **cuts)


def cells_of(mesh):
    """Cells of the mid-surface as polygons."""
    return shapely.polygons(mesh.mid_surface_positions[mesh.faces][..., :2])


def loops_of(mesh):
    places = Places(mesh.mid_surface_positions, mesh.sheet_faces, {}, {})
    return places.loops


#: Cases whose meshes at 45 degrees take longest; all are cut at 20 degrees too.
LONG_AT_45 = ("two holes", "narrow dart", "bent slit", "all")


@pytest.mark.parametrize("short", [5e-8, 1.3e-7, 1e-6])
def test_a_cut_from_the_rim_reaches_it_although_its_coordinates_are_rounded(short):
    """As of 3.14961 in, half of which is written as 1.5748 in."""
    x = 0.04 - short
    cuts = {"slits": (((x, 0.0), (0.02, 0.0)),), "darts": (((x, 0.03), (0.02, 0.02), (x, 0.01)),)}
    for kind, cut in cuts.items():
        mesh = build_blank(blank_of(edge_length=6e-3, size=(0.08, 0.1), **{kind: cut}), THICKNESS)
        exact = tuple(tuple((0.04 if a == x else a, b) for a, b in line) for line in cut)
        whole = build_blank(
            blank_of(edge_length=6e-3, size=(0.08, 0.1), **{kind: exact}), THICKNESS
        )
        assert mesh.pair_count == whole.pair_count, "a bridge is left at the rim"
        assert np.abs(mesh.node_positions - whole.node_positions).max() <= short


@pytest.mark.parametrize(
    ("name", "degrees"),
    [
        pytest.param(
            name, degrees, marks=[pytest.mark.slow] * (degrees == 45.0 and name in LONG_AT_45)
        )
        for name in CASES
        for degrees in (0.0, 20.0, 45.0)
    ],
)
def test_the_mesh_covers_what_holes_darts_and_slits_leave(name, degrees):
    spec = blank_of(degrees=degrees, **CASES[name])
    mesh, contours = build_blank(spec, THICKNESS), contours_of(spec)[0]
    assert mesh.area == pytest.approx(contours.polygon.area, rel=1e-12)
    assert mesh.outline_area == pytest.approx(contours.polygon.area, rel=1e-13)
    points = mesh.mid_surface_positions[:, :2]
    # every corner has a node, and every free edge lies on a contour
    assert cKDTree(points).query(contours.points)[0].max() < 1e-12
    middles = points[boundary_edges(mesh.faces)].mean(axis=1)
    assert shapely.distance(contours.lines, shapely.points(middles)).max() < 1e-9
    assert len(loops_of(mesh)) == LOOPS.get(name, 1)
    # no cell lies across a cut
    inner = shapely.buffer(cells_of(mesh), -1e-6)
    assert not shapely.intersects(inner, contours.lines).any()
    assert mesh.step_ratio <= (1.3 if name == "bent slit" else LONGEST_SHARE)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 45.0])
@pytest.mark.parametrize("radius", [0.02, 0.031, 0.06])
def test_a_round_hole_is_cut_as_an_outline_is(radius, degrees):
    spec = blank_of(degrees=degrees, holes=(circle(radius, (0.01, 0.02), 120),))
    mesh = build_blank(spec, THICKNESS)
    assert mesh.step_ratio <= LONGEST_SHARE
    # chords of an edge or so: second order in the edge length
    missing = (mesh.area - mesh.outline_area) / (np.pi * radius**2)
    assert 0.0 < missing < (5e-3 / radius) ** 2
    assert len(loops_of(mesh)) == 2


def test_lips_of_a_slit_have_nodes_of_their_own_at_the_same_places():
    """Along a fibre nothing is moved: the mesh is that of the whole blank with nodes doubled."""
    slit = build_blank(blank_of(slits=(((-0.15, 0.0), (0.05, 0.0)),)), THICKNESS)
    whole = build_blank(blank_of(), THICKNESS)
    assert slit.pair_count == whole.pair_count + 40  # 40 edges, the tip stays one node
    assert slit.element_count == whole.element_count
    assert slit.step_ratio == 1.0
    points = slit.mid_surface_positions
    found = cKDTree(points).query_pairs(1e-12)
    assert len(found) == 40
    for first, second in found:
        assert points[first, 1] == pytest.approx(0.0, abs=1e-12)
        sides = [
            np.sign(points[slit.faces[(slit.faces == n).any(axis=1)], 1].mean())
            for n in (first, second)
        ]
        assert sides[0] == -sides[1] != 0.0


def test_a_model_of_elements_whose_fibres_meet_no_edge_warns_of_nothing():
    """At the apex of a dart an element may have no width along its fibres."""
    dart = '[["60 mm", "8 mm"], ["35 mm", "0 mm"], ["60 mm", "-8 mm"]]'
    text = (
        'process = { time = "1 ms" }\nmaterial = { preset = "MD600" }\n[blank]\n'
        f'size = ["120 mm", "100 mm"]\nedge_length = "8 mm"\ndarts = [{dart}]\n'
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        build_model(scene_from_text(text))


def test_a_drawn_in_dart_keeps_both_its_sides():
    """Narrow near its apex, a dart passes between two lattice nodes: neither side is joined."""
    spec = blank_of(**NARROW)
    mesh = build_blank(spec, THICKNESS)
    apex = np.array(NARROW["darts"][0][1])
    points = mesh.mid_surface_positions[:, :2]
    for way in np.linspace(0.02, 0.95, 30):
        across = shapely.LineString(
            [apex + way * (np.array([-0.15, y]) - apex) for y in (0.006, -0.006)]
        )
        cut = shapely.intersection(cells_of(mesh), across)
        assert shapely.length(cut).sum() < across.length - 1e-7
    assert np.hypot(*(points - apex).T).min() < 1e-12


@pytest.mark.parametrize("edge_length", [5e-3, 10e-3])
def test_a_symmetric_blank_has_a_symmetric_mesh(edge_length):
    spec = blank_of(edge_length=edge_length, holes=(circle(0.02),), **DIAGONAL)
    mesh = build_blank(spec, THICKNESS)
    points = mesh.mid_surface_positions[:, :2]
    middles = points[mesh.faces].mean(axis=1)
    for mirror in ((-1.0, 1.0), (1.0, -1.0)):
        for found in (points, middles):
            assert cKDTree(found).query(found * mirror)[0].max() < 1e-12


def test_a_rim_is_the_outer_boundary_though_a_hole_is_longer():
    """A star-shaped hole with a longer boundary than the rim around it."""
    angle = 2.0 * np.pi * np.arange(32) / 32
    radius = np.where(np.arange(32) % 2, 0.13, 0.05)
    star = tuple(zip(radius * np.cos(angle), radius * np.sin(angle)))
    mesh = build_blank(blank_of(edge_length=3e-3, holes=(star,)), THICKNESS)
    points = mesh.mid_surface_positions
    places = Places(points, mesh.sheet_faces, {}, {})
    length = [np.linalg.norm(points[e[:, 1]] - points[e[:, 0]], axis=1).sum() for e in places.loops]
    assert max(length) > 1.2 * 1.3  # longer than the rim
    rim = places.edges(Where(rim=True), "rim")
    assert np.abs(points[rim][..., :2]).max(axis=2).min() > 0.15 - 1e-9
    hole = places.edges(Where(loop=(0.05, 0.0, 0.0)), "loop")
    assert np.abs(points[hole][..., :2]).max() < 0.14
    pieces = pieces_along(hole, points, 4, 0.02, key="hole")
    assert all(len(piece) > 1 for piece in pieces)


SCENE = """
[process]
time = "10 ms"
[blank]
size = ["300 mm", "300 mm"]
edge_length = "5 mm"
{more}
[material]
preset = "MD600"
"""


def test_a_scene_has_them_and_a_ply_of_a_stack_too():
    more = """
    holes = [[["0 mm", "0 mm"], ["30 mm", "0 mm"], ["0 mm", "20 mm"]]]
    darts = [[["150 mm", "10 mm"], ["90 mm", "0 mm"], ["150 mm", "-10 mm"]]]
    slits = [[["-150 mm", "0 mm"], ["-90 mm", "0 mm"]]]
    """
    scene = scene_from_text(SCENE.format(more=more))
    left = 0.09 - 0.5 * 0.03 * 0.02 - 0.5 * 0.02 * 0.06
    assert scene.stack[0].build_blank().area == pytest.approx(left, rel=1e-12)
    stack = scene_from_text(SCENE.format(more=more), overrides=['layup="[0/90, 45/-45]"']).stack
    assert [ply.build_blank().area for ply in stack] == pytest.approx([left, left], rel=2e-4)
    assert stack.has_one_outline
    ply = stack[0]
    assert stack.thickness_at(0.005, 0.005) == stack.thickness  # in the hole: what lies beside it
    assert ply.contours.polygon.area == pytest.approx(left, rel=1e-12)


@pytest.mark.parametrize(
    ("cuts", "key", "words"),
    [
        ({"holes": (rectangle(0.02, 0.02, (0.3, 0.0)),)}, "holes[0]", "outside the outline"),
        (
            {"holes": (rectangle(0.02, 0.02, (0.15, 0.0)),)},
            "holes[0]",
            "touches or crosses the outline",
        ),
        (
            {"holes": (rectangle(0.02, 0.02, (0.14, 0.0)),)},
            "holes[0]",
            "touches or crosses the outline",
        ),
        ({"holes": (rectangle(0.4, 0.02),)}, "holes[0]", "touches or crosses the outline"),
        (
            {"holes": (rectangle(0.04, 0.04), rectangle(0.04, 0.04, (0.03, 0.0)))},
            "holes[1]",
            "touches or crosses blank.holes[0]",
        ),
        (
            {"holes": (rectangle(0.04, 0.04), rectangle(0.02, 0.02))},
            "holes[1]",
            "touches or crosses blank.holes[0]",
        ),
        (
            {"holes": (((0, 0), (0.05, 0.05), (0.05, 0), (0, 0.05)),)},
            "holes[0]",
            "intersects itself",
        ),
        ({"holes": (circle(0.001, (0.0021, 0.0017)),)}, "holes[0]", "narrower than two elements"),
        (
            {"holes": (rectangle(0.02, 0.02, (0.1385, 0.0)),)},
            "blank",
            "nearer to each other or to the rim",
        ),
        (
            {"darts": (((0.15, 0.01), (0.2, 0.0), (0.15, -0.01)),)},
            "darts[0]",
            "not inside the outline",
        ),
        (
            {"darts": (((0.14, 0.01), (0.1, 0.0), (0.15, -0.01)),)},
            "darts[0]",
            "does not reach the rim",
        ),
        ({"darts": (((0.15, 0.0), (0.1, 0.0), (0.15, 0.0)),)}, "darts[0]", "has no width"),
        (
            {
                "darts": (((0.15, 0.01), (0.0, 0.0), (0.15, -0.01)),),
                "holes": (rectangle(0.02, 0.02, (0.05, 0.0)),),
            },
            "holes[0]",
            "touches or crosses the outline",
        ),
        (
            {
                "darts": (
                    ((0.15, 0.01), (0.0, 0.0), (0.15, -0.01)),
                    ((0.01, 0.15), (0.05, -0.05), (-0.01, 0.15)),
                )
            },
            "darts[1]",
            "crosses the rim or another dart",
        ),
        ({"slits": (((-0.15, 0.0), (0.15, 0.01)),)}, "slits[0]", "divides the blank in two"),
        ({"slits": (((-0.2, 0.0), (0.2, 0.01)),)}, "slits[0]", "divides the blank in two"),
        (
            {
                "holes": (rectangle(0.04, 0.04),),
                "slits": (((-0.15, 0.0), (0.0, 0.0)), ((0.15, 0.0), (0.0, 0.0))),
            },
            "slits[1]",
            "divides the blank in two",
        ),
        ({"slits": (((0.2, 0.0), (0.3, 0.0)),)}, "slits[0]", "lies outside"),
        (
            {"slits": (((-0.15, 0.0), (0.0, 0.0)), ((-0.05, -0.05), (-0.05, 0.05)))},
            "slits[1]",
            "touches",
        ),
        ({"slits": (((0, 0), (0.05, 0.05), (0.05, 0), (0, 0.05)),)}, "slits[0]", "crosses itself"),
        ({"slits": (((0.15, 0.0), (0.15, 0.1)),)}, "slits[0]", "runs along the rim"),
    ],
)
def test_what_cannot_be_cut_is_one_clear_error(cuts, key, words):
    with pytest.raises(InputError) as caught:
        build_blank(blank_of(**cuts), THICKNESS)
    assert caught.value.key == (key if key == "blank" else f"blank.{key}")
    assert words in caught.value.message


def test_a_ply_names_its_own_entry():
    text = SCENE.replace("[blank]", "[[plies]]\nname = 'top'").format(
        more='holes = [[["0 mm", "0 mm"], ["300 mm", "0 mm"], ["0 mm", "20 mm"]]]'
    )
    with pytest.raises(InputError) as caught:
        scene_from_text(text).stack[0].build_blank()
    assert caught.value.key == 'plies[0] "top".holes[0]'
