"""The blank mesh covers its outline, follows the fibres, and refuses what it cannot mesh."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon, points

from lcmchain.errors import InputError
from lcmchain.mesh.blank import build_blank
from lcmchain.mesh.outline import polygon_area

THICKNESS = 1.004e-3
LONGEST_SHARE = 1.2  # step of whole elements over that of the mesh

L_SHAPE = ((0.0, 0.0), (0.30, 0.0), (0.30, 0.10), (0.10, 0.10), (0.10, 0.25), (0.0, 0.25))
STAR = tuple(
    (
        0.1 * (1.0 if k % 2 else 0.4) * math.cos(k * math.pi / 5),
        0.1 * (1.0 if k % 2 else 0.4) * math.sin(k * math.pi / 5),
    )
    for k in range(10)
)


def blank_spec(*, size=None, outline=None, edge_length=5e-3, degrees=0.0, height=0.0):
    return SimpleNamespace(
        size=size,
        rim=outline,
        drawing=None,
        cuts={},
        courses=None,
        edge_length=edge_length,
        fibre_angle=math.radians(degrees),
        height=height,
    )


def corner_jacobians(blank):
    """Twice the area of the two edges at every corner [m2]; zero at repeated nodes only."""
    corner = blank.mid_surface_positions[blank.faces][..., :2]
    after = np.roll(corner, -1, axis=1) - corner
    before = corner - np.roll(corner, 1, axis=1)
    return before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]


def centre_jacobian(blank):
    """Determinant of the isoparametric map at the centre of the hexahedra [m3]."""
    node = blank.node_positions[blank.elements]
    sign = np.array(
        [[-1, 1, 1, -1, -1, 1, 1, -1], [-1, -1, 1, 1, -1, -1, 1, 1], [-1, -1, -1, -1, 1, 1, 1, 1]]
    )
    return np.linalg.det(np.einsum("ak,ekx->eax", sign / 8.0, node))


def boundary_edges(blank):
    """Edges with a single face, shape (edges, 2), in pair numbering."""
    faces = blank.faces
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges = np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() == 2
    return edges[count == 1]


def assert_sound(blank):
    """What holds for every blank, whatever its outline."""
    pairs = blank.pair_count
    assert np.array_equal(blank.node_positions[:pairs, :2], blank.node_positions[pairs:, :2])
    assert np.array_equal(blank.elements[:, 4:], blank.elements[:, :4] + pairs)
    assert np.array_equal(np.unique(blank.elements), np.arange(blank.node_count))
    assert blank.elements.dtype == np.int64
    jacobians = corner_jacobians(blank)
    assert (jacobians[~blank.is_triangle] > 0.0).all()
    assert (jacobians[blank.is_triangle][:, 1] > 0.0).all()
    assert (centre_jacobian(blank) > 0.0).all()
    boundary_edges(blank)


def assert_covers(blank, outline, tolerance=1e-12):
    """All of the area and nothing else: the mesh's own boundary lies on the outline."""
    assert blank.area == pytest.approx(abs(polygon_area(np.array(outline))), rel=tolerance)
    ring = Polygon(outline).exterior
    middles = blank.mid_surface_positions[boundary_edges(blank)][..., :2].mean(axis=1)
    assert ring.distance(points(middles)).max() < 1e-9


def rectangle(width, height):
    x, y = 0.5 * width, 0.5 * height
    return ((-x, -y), (x, -y), (x, y), (-x, y))


def test_square_of_the_hemisphere_has_3600_equal_elements():
    blank = build_blank(blank_spec(size=(0.3, 0.3), height=0.02), THICKNESS)
    assert blank.element_count == 3600
    assert blank.node_count == 2 * 61 * 61
    assert not blank.is_triangle.any()
    assert blank.element_areas == pytest.approx(np.full(3600, 25e-6), rel=1e-12)
    assert blank.node_positions.min(axis=0) == pytest.approx(
        [-0.15, -0.15, 0.02 - 0.5 * THICKNESS], rel=1e-14
    )
    assert blank.node_positions.max(axis=0) == pytest.approx(
        [0.15, 0.15, 0.02 + 0.5 * THICKNESS], rel=1e-14
    )
    assert centre_jacobian(blank) == pytest.approx(25e-6 * THICKNESS / 8.0, rel=1e-12)
    assert_sound(blank)


def test_elements_fit_a_rectangle_that_the_edge_length_does_not_divide():
    blank = build_blank(blank_spec(size=(0.101, 0.053), edge_length=5e-3), THICKNESS)
    assert blank.element_count == 20 * 11
    assert blank.element_areas == pytest.approx(0.101 / 20 * 0.053 / 11, rel=1e-12)
    assert_covers(blank, rectangle(0.101, 0.053))


def test_bias_blank_has_diagonals_that_fit_its_sides():
    blank = build_blank(blank_spec(size=(0.32, 0.16), degrees=45.0), THICKNESS)
    across, along = 23, 46  # sides over the cell diagonal: 160 mm and 320 mm over 6.96 mm
    assert blank.is_triangle.sum() == 2 * (across + along)
    assert (~blank.is_triangle).sum() == 2 * across * along - (across + along)
    cell = 0.5 * (0.16 / across) ** 2  # square over its diagonal
    assert blank.element_areas[~blank.is_triangle] == pytest.approx(cell, rel=1e-9)
    assert blank.element_areas[blank.is_triangle] == pytest.approx(0.5 * cell, rel=1e-9)
    assert_covers(blank, rectangle(0.32, 0.16))
    assert_sound(blank)


@pytest.mark.parametrize("degrees", [0.0, 90.0, 45.0, 30.0, -17.0, 123.0])
@pytest.mark.parametrize("outline", [L_SHAPE, L_SHAPE[::-1], STAR], ids=["L", "clockwise", "star"])
def test_polygons_are_covered_at_any_fibre_angle(outline, degrees):
    blank = build_blank(blank_spec(outline=outline, degrees=degrees), THICKNESS)
    assert_sound(blank)
    if outline is STAR:
        # Its tips are narrower than an element.
        assert blank.area == pytest.approx(blank.outline_area, rel=0.01)
    else:
        assert_covers(blank, outline)


def test_aligned_polygon_is_meshed_with_quadrilaterals_only():
    blank = build_blank(blank_spec(outline=L_SHAPE), THICKNESS)
    assert blank.element_count == 60 * 20 + 20 * 30
    assert not blank.is_triangle.any()
    # Steps that the edge length does not divide still get a lattice line.
    uneven = ((0, 0), (0.103, 0), (0.103, 0.04), (0.0415, 0.04), (0.0415, 0.087), (0, 0.087))
    blank = build_blank(blank_spec(outline=uneven), THICKNESS)
    assert not blank.is_triangle.any()
    assert_covers(blank, uneven)


def test_round_outline_converges_with_the_edge_length():
    angle = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    ellipse = np.column_stack([0.1 * np.cos(angle), 0.07 * np.sin(angle)])
    missing = []
    for edge_length in (10e-3, 5e-3, 2.5e-3):
        blank = build_blank(
            blank_spec(outline=ellipse, degrees=20.0, edge_length=edge_length), THICKNESS
        )
        assert_sound(blank)
        missing.append(1.0 - blank.area / blank.outline_area)
    assert 0.0 < missing[0] < 0.01
    rates = np.log2(np.array(missing[:-1]) / missing[1:])
    assert (rates > 1.5).all()  # chords of a smooth curve: second order


@given(
    width=st.floats(0.03, 0.2),
    height=st.floats(0.03, 0.2),
    degrees=st.floats(-180.0, 180.0),
    edge_length=st.sampled_from([4e-3, 5e-3, 7e-3]),
)
def test_rectangles_are_covered_exactly_at_any_angle(width, height, degrees, edge_length):
    blank = build_blank(
        blank_spec(size=(width, height), degrees=degrees, edge_length=edge_length), THICKNESS
    )
    assert_sound(blank)
    assert_covers(blank, rectangle(width, height))
    # No element much smaller than asked for: it would cut the stable time step of the whole blank.
    assert blank.step_ratio <= LONGEST_SHARE
    edges = np.linalg.norm(np.diff(blank.mid_surface_positions[boundary_edges(blank)], axis=1))
    assert edges.min() > 0.4 * edge_length
    assert blank.element_areas.min() > 0.2 * edge_length**2


@given(degrees=st.floats(-180.0, 180.0))
def test_interior_edges_run_along_the_fibres(degrees):
    blank = build_blank(blank_spec(size=(0.1, 0.08), degrees=degrees), THICKNESS)
    angle = math.radians(degrees)
    fibre_1 = np.array([math.cos(angle), math.sin(angle), 0.0])
    fibre_2 = np.array([-math.sin(angle), math.cos(angle), 0.0])
    count = blank.element_count
    assert blank.fibre_direction_1 == pytest.approx(np.tile(fibre_1, (count, 1)), abs=1e-12)
    assert blank.fibre_direction_2 == pytest.approx(np.tile(fibre_2, (count, 1)), abs=1e-12)
    on_outline = np.zeros(blank.pair_count, dtype=bool)
    on_outline[boundary_edges(blank)] = True
    interior = ~on_outline[blank.faces].any(axis=1)
    assert interior.sum() > 0.5 * count
    corner = blank.mid_surface_positions[blank.faces[interior]]
    for node, along in ((1, fibre_1), (3, fibre_2)):
        edge = corner[:, node] - corner[:, 0]
        assert np.linalg.norm(edge - (edge @ along)[:, None] * along, axis=1).max() < 1e-12
        assert (edge @ along > 0.0).all()


def test_quarter_turn_gives_the_same_cells():
    straight = build_blank(blank_spec(size=(0.1, 0.06)), THICKNESS)
    turned = build_blank(blank_spec(size=(0.1, 0.06), degrees=90.0), THICKNESS)
    assert turned.element_count == straight.element_count
    assert np.array_equal(
        np.unique(np.round(turned.mid_surface_positions, 9), axis=0),
        np.unique(np.round(straight.mid_surface_positions, 9), axis=0),
    )
    assert np.array_equal(turned.fibre_direction_1[0], [0.0, 1.0, 0.0])


@pytest.mark.parametrize("degrees", [0.0, 30.0])
@pytest.mark.parametrize("size", [(0.3, 0.2), (0.2, 0.3)])
def test_numbers_follow_the_lines_across_the_sheet(degrees, size):
    """A line ends before the next one begins, and lines lie side by side along the longer side."""
    edge_length = 5e-3
    blank = build_blank(blank_spec(size=size, degrees=degrees), THICKNESS)
    directions = np.array([blank.fibre_direction_1[0], blank.fibre_direction_2[0]])
    corners = blank.mid_surface_positions[blank.faces] @ directions.T
    is_whole = np.ptp(corners, axis=1).round(6) == np.median(
        np.ptp(corners, axis=1).round(6), axis=0
    )
    places = corners.mean(axis=1)[is_whole.all(axis=1)]  # those that the outline does not cut
    longer = int(np.ptp(places[:, 1]) > np.ptp(places[:, 0]))
    line = np.round((places[:, longer] - places[0, longer]) / edge_length).astype(int)
    assert line[0] == 0 and (np.diff(line) >= 0).all() and (np.diff(line) <= 1).all()
    same = np.diff(line) == 0
    assert (np.diff(places[:, 1 - longer])[same] > 0.9 * edge_length).all()
    # the nodes of elements that follow each other are not far from each other either
    assert np.ptp(blank.faces, axis=1).max() <= 2 * np.bincount(line).max() + 4


def test_perturbation_moves_inner_nodes_only_and_is_repeatable():
    spec = blank_spec(size=(0.1, 0.08), degrees=30.0)
    plain = build_blank(spec, THICKNESS)
    moved = build_blank(spec, THICKNESS, perturbation=0.2, seed=3)
    again = build_blank(spec, THICKNESS, perturbation=0.2, seed=3)
    other = build_blank(spec, THICKNESS, perturbation=0.2, seed=4)
    assert np.array_equal(moved.node_positions, again.node_positions)
    assert not np.array_equal(moved.node_positions, other.node_positions)
    shift = np.linalg.norm(moved.mid_surface_positions - plain.mid_surface_positions, axis=1)
    outer = np.unique(boundary_edges(plain))
    assert (shift[outer] == 0.0).all()
    assert 0.5e-3 < shift.max() <= 0.2 * 5e-3 * math.sqrt(2.0)
    assert moved.area == pytest.approx(plain.area, rel=1e-12)
    assert_sound(moved)


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"edge_length": 0.2}, "blank.edge_length", "larger than the blank"),
        ({"edge_length": 0.08}, "blank.edge_length", "fewer than two elements"),
        ({"edge_length": 1e-6}, "blank.edge_length", "more than the 2000000"),
        ({"edge_length": -1.0}, "blank.edge_length", "positive"),
        ({"size": (0.1, -0.1)}, "blank.size", "positive"),
        ({"outline": ((0, 0), (1, 1), (1, 0), (0, 1))}, "blank.outline", "intersects itself"),
        (
            {"outline": ((0, 0), (1, 0), (1, 1), (0.5, 0), (0, 1))},
            "blank.outline",
            "intersects itself",
        ),
        ({"outline": ((0, 0), (1, 1), (0.5, 0.5))}, "blank.outline", "folds back"),
        ({"outline": ((0, 0), (1, 0), (1, 0), (0, 1))}, "blank.outline", "repeats"),
        ({"outline": ((0, 0), (1, 0))}, "blank.outline", "at least three"),
        ({"outline": ((0, 0), (1, 0), (0, math.nan))}, "blank.outline", "finite"),
        (
            {  # two squares joined by a strip of 2 mm
                "outline": (
                    *((0, 0), (0.1, 0), (0.1, 0.049), (0.2, 0.049), (0.2, 0), (0.3, 0)),
                    *((0.3, 0.1), (0.2, 0.1), (0.2, 0.051), (0.1, 0.051), (0.1, 0.1), (0, 0.1)),
                )
            },
            "blank.outline",
            "narrower than two elements",
        ),
    ],
)
def test_wrong_blanks_are_refused_by_key(changes, key, words):
    values = {"size": (0.1, 0.1)} | changes
    if "outline" in changes:
        values["size"] = None
    with pytest.raises(InputError, match=words) as raised:
        build_blank(blank_spec(**values), THICKNESS)
    assert raised.value.key == key


def test_closing_point_may_be_written():
    square = ((0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1))
    assert build_blank(blank_spec(outline=(*square, square[0])), THICKNESS).element_count == 400


def test_perturbation_out_of_range_is_refused():
    with pytest.raises(InputError, match="perturbation"):
        build_blank(blank_spec(size=(0.1, 0.1)), THICKNESS, perturbation=0.6)


@st.composite
def stars(draw):
    """Outlines about a centre, convex or not, without tips narrower than an element."""
    count = draw(st.integers(4, 8))

    def several(least, most):
        return np.array(draw(st.lists(st.floats(least, most), min_size=count, max_size=count)))

    angles = 2.0 * math.pi * (np.arange(count) + several(0.0, 0.5)) / count
    radii = several(0.05, 0.1)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])


@given(
    outline=stars(),
    degrees=st.floats(-180.0, 180.0),
    edge_length=st.sampled_from([4e-3, 5e-3, 7e-3]),
)
@settings(max_examples=60)
def test_polygons_keep_the_step_of_whole_elements(outline, degrees, edge_length):
    blank = build_blank(
        blank_spec(outline=outline, degrees=degrees, edge_length=edge_length), THICKNESS
    )
    assert_sound(blank)
    assert blank.step_ratio <= LONGEST_SHARE
    assert blank.area == pytest.approx(blank.outline_area, rel=5e-3)


def test_a_tip_narrower_than_an_element_is_told_of():
    arrow = ((-0.1, -0.06), (0.1, -0.06), (0.1, -0.002), (0.16, 0.0), (0.1, 0.002), (0.1, 0.06))
    blank = build_blank(blank_spec(outline=(*arrow, (-0.1, 0.06))), THICKNESS)
    assert_sound(blank)
    assert blank.step_ratio <= LONGEST_SHARE
    missing = 1.0 - blank.area / blank.outline_area
    assert 0.001 < missing < 0.006  # the tip is 0.5 % of the area
    (remark,) = blank.remarks()
    assert f"{-100.0 * missing:+.2f} %" in remark and "narrower than an element" in remark
    # a sharp one that widens soon gets a triangle
    wedge = build_blank(blank_spec(outline=((0, 0), (0.2, -0.01), (0.2, 0.03))), THICKNESS)
    assert_covers(wedge, ((0, 0), (0.2, -0.01), (0.2, 0.03)))
    assert wedge.step_ratio <= LONGEST_SHARE
    assert wedge.remarks() == []
