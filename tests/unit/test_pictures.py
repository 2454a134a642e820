"""Pictures: they exist, show what they should, and their geometry is right."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread

from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries, build_datasets
from lcmchain.mesh.blank import build_blank
from lcmchain.report import draw_initial, draw_result
from lcmchain.report.renderer import (
    axes_at,
    draw_colour_bar,
    draw_facets,
    draw_fibres,
    even_places,
    fit_axis,
)
from lcmchain.report.style import CAPTIONS, SHOWN, colour_scale, new_figure, save
from lcmchain.report.view import (
    FROM_ABOVE,
    View,
    boundary_edges,
    contour_edges,
    fronts_and_backs,
    oblique,
    painting_order,
    section,
)
from lcmchain.scene import scene_from_text

SCENE = """
title = "Dome"
[process]
time = "20 ms"
[blank]
size = ["60 mm", "40 mm"]
edge_length = "5 mm"
fibre_angle = "45 deg"
[material]
preset = "MD600"
"""
SHEAR, THICKNESS, FRACTION, WRINKLES, RISK, SPRINGBACK = SHOWN


@pytest.fixture(scope="module")
def scene():
    return scene_from_text(SCENE)


@pytest.fixture(scope="module")
def blank(scene):
    return build_blank(scene.blank, scene.material.thickness)


def result(scene, blank, height, tools=True):
    x, y, z = blank.node_positions.T
    formed = np.stack([x, y, z + height * np.exp(-(x**2 + y**2) / 0.015**2)], axis=1)
    count = 2 if tools else 0
    return build_datasets(
        scene,
        blank,
        FrameSeries(
            time=np.array([0.0, 0.02]),
            positions=np.stack([blank.node_positions, formed]),
            tool_travel=np.array([[0.0, 0.0], [0.01, 0.0]])[:, :count],
            tool_force=np.ones((2, count, 3)),
            energy={"kinetic": np.array([0.0, 1e-4]), "internal": np.array([0.0, 2e-2])},
            tool_names=("punch", "die")[:count],
        ),
    )


def coloured(path):
    """Share of the pixels that have a colour."""
    pixels = imread(path)[..., :3]
    return float((np.ptp(pixels, axis=-1) > 0.1).mean())


# --- files ----------------------------------------------------------------------------------------


@pytest.mark.usefixtures("fine_pictures")
def test_pictures_of_a_result(scene, blank, tmp_path):
    files = draw_result(tmp_path, result(scene, blank, 0.012))
    assert [file.name for file in files] == [
        "shear_angle.png",
        "thickness.png",
        "fibre_volume_fraction.png",
        "wrinkle_height.png",
        "fibre_directions.png",
        "sections.png",
        "energy.png",
        "force.png",
        "force_over_travel.png",
    ]
    assert {file.name for file in files} <= set(CAPTIONS)
    for file in files:
        height, width = imread(file).shape[:2]
        assert width > 1200
        assert height > 500
    assert coloured(tmp_path / "thickness.png") > 0.1


def test_a_colour_is_a_value(scene, blank, tmp_path):
    """The unsheared blank is white, the sheared one is not."""
    datasets = result(scene, blank, 0.012)
    for frame, folder in ((0, "start"), (1, "end")):
        draw_result(tmp_path / folder, datasets, frame)
    start = coloured(tmp_path / "start" / "shear_angle.png")
    assert coloured(tmp_path / "end" / "shear_angle.png") > start + 0.05


def test_without_tools_there_is_no_force(scene, blank, tmp_path):
    files = draw_result(tmp_path, result(scene, blank, 0.005, tools=False))
    names = {file.name for file in files}
    assert not names & {"force.png", "force_over_travel.png", "tools.png"}
    assert not (tmp_path / "force.png").exists()


def test_where_no_tool_moves_there_is_no_force_over_travel(scene, blank, tmp_path):
    datasets = result(scene, blank, 0.005)
    history = datasets["/history"]
    for name in ("tool_travel", "history_tool_travel"):
        if name in history:
            history[name][:] = 0.0
    names = {file.name for file in draw_result(tmp_path, datasets)}
    assert "force.png" in names and "force_over_travel.png" not in names
    assert not (tmp_path / "force_over_travel.png").exists()


def test_picture_of_the_start(blank, tmp_path):
    square = 0.1 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
    plate = ("plate", square - [0, 0, 0.001], np.array([[0, 1, 2], [0, 2, 3]]))
    far = ("far", square + [9, 0, 0], np.array([[0, 1, 2], [0, 2, 3]]))  # outside the picture
    draw_initial(tmp_path / "bare.png", blank)
    draw_initial(tmp_path / "initial.png", blank, [plate, far], title="a scene")
    assert coloured(tmp_path / "initial.png") > coloured(tmp_path / "bare.png") > 0.001


def test_unwritable_picture_is_an_input_error(scene, blank, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        draw_result(tmp_path / "file", result(scene, blank, 0.01))
    with pytest.raises(InputError, match="cannot be written"):
        draw_initial(tmp_path / "file" / "initial.png", blank)


# --- colours --------------------------------------------------------------------------------------


def test_shear_colours_are_symmetric():
    scale = colour_scale(np.array([-3.0, 1.0, 41.3]), SHEAR)
    assert (scale.norm.vmin, scale.norm.vmax) == (-45.0, 45.0)


@pytest.mark.parametrize(("largest", "limit"), [(0.88, 0.9), (4.07, 4.5), (0.003, 0.1), (0.0, 0.1)])
def test_wrinkle_colours_end_at_round_heights(largest, limit):
    norm = colour_scale(np.array([-0.6 * largest, largest]), WRINKLES).norm
    assert (norm.vmin, norm.vmax) == pytest.approx((-limit, limit))


def test_a_few_outliers_do_not_flatten_the_colours():
    values = np.full(5000, 1.0) + np.linspace(-0.1, 0.1, 5000)
    values[0] = -40.0
    assert colour_scale(values, THICKNESS).norm.vmin > 0.8


@pytest.mark.parametrize("values", [np.full(9, 1.004), np.zeros(9), np.full(9, np.nan)])
def test_constant_and_missing_values_have_a_scale(values):
    for shown in SHOWN:
        norm = colour_scale(values, shown).norm
        assert norm.vmin <= norm.vmax
        assert math.isfinite(norm.vmin)


def test_scale_from_a_given_value():
    fraction = replace(FRACTION, lowest=0.0)
    norm = colour_scale(np.array([0.3, 0.5]), fraction).norm
    assert (norm.vmin, norm.vmax) == (0.0, 0.5)
    assert colour_scale(np.array([0.3, 0.5]), FRACTION).norm.vmin == pytest.approx(0.3)


def test_a_small_risk_has_pale_colours():
    """The last colour is that of wrinkles which are to be expected, or of a larger risk."""
    for largest, last in ((0.0, 1.0), (0.003, 1.0), (2.0, 2.0)):
        norm = colour_scale(np.array([0.0, largest]), RISK).norm
        assert (norm.vmin, norm.vmax) == (0.0, last)


def test_values_in_words():
    assert SHEAR.text(-2.54) == "\N{MINUS SIGN}2.5°"
    assert SHEAR.text(-0.04) == "0.0°"
    assert THICKNESS.text(0.95) == "0.950 mm"
    assert FRACTION.text(0.5) == "0.500"
    assert [shown.axis_label for shown in SHOWN] == [
        "shear angle [°]",
        "thickness [mm]",
        "fibre volume fraction",
        "height of wrinkles [mm]",
        "wrinkle risk",
        "springback [mm]",
    ]


@pytest.mark.parametrize(
    ("values", "extend"),
    [([0.0, 1.0], "neither"), ([-1.0, 1.0], "min"), ([0.0, 2.0], "max"), ([-1.0, 2.0], "both")],
)
def test_arrows_of_a_colour_bar(values, extend):
    figure = new_figure(2.0, 2.0)
    axis = axes_at(figure, 0.5, 0.5, 0.2, 1.0)
    colours = colour_scale(np.array([0.0, 1.0]), FRACTION)
    draw_colour_bar(figure, axis, colours, np.array(values), FRACTION)
    assert colours.colorbar.extend == extend
    words = {text.get_text().replace("\N{MINUS SIGN}", "-") for text in axis.texts}
    assert words == {f"max {values[1]:.3f}", f"min {values[0]:.3f}"}


# --- facets and fibres ----------------------------------------------------------------------------


@pytest.mark.usefixtures("fine_pictures")
def test_what_lies_in_front_hides_what_lies_behind(tmp_path):
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    stack = np.stack([square + [0, 0, 0.1], square])  # the first one is in front, from above
    red_and_blue = np.array([[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]])
    middles = {}
    for name, view in (("above", FROM_ABOVE), ("below", oblique(from_below=True))):
        figure = new_figure(1.0, 1.0)
        axis = axes_at(figure, 0.0, 0.0, 1.0, 1.0)
        draw_facets(axis, stack, view, red_and_blue, shaded=False)
        fit_axis(axis, view.on_screen(square), 0.0)
        axis.set_axis_off()
        save(figure, tmp_path / f"{name}.png")
        middles[name] = imread(tmp_path / f"{name}.png")[100, 100, :3].tolist()
    assert middles == {"above": [1.0, 0.0, 0.0], "below": [0.0, 0.0, 1.0]}


def test_hidden_rim_stays_hidden():
    """The rim is painted among the facets: before those in front of it, after its neighbours."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    axis = axes_at(new_figure(1.0, 1.0), 0.0, 0.0, 1.0, 1.0)
    corners = np.stack([square, square + [0, 0, 1]])
    rim = square[[[0, 1], [1, 2], [2, 3], [3, 0]]]
    draw_facets(axis, corners, FROM_ABOVE, np.ones((2, 4)), rim=rim)
    (collection,) = axis.collections
    assert collection.get_linewidths() == pytest.approx([0.22, 0.8, 0.8, 0.8, 0.8, 0.22])


@pytest.mark.parametrize("arrows", [True, False])
def test_fibres_lie_around_their_places(arrows):
    axis = axes_at(new_figure(1.0, 1.0), 0.0, 0.0, 1.0, 1.0)
    places = np.array([[1.0, 2.0], [3.0, 5.0]])
    direction = np.array([[0.6, 0.8, 0.0], [0.0, 0.6, 0.8]])  # the second one is steep
    draw_fibres(axis, places, direction, 2.0, "k", arrows=arrows)
    (drawn,) = axis.collections
    flat = np.stack([drawn.U, drawn.V], axis=1)
    np.testing.assert_allclose(flat, [[1.2, 1.6], [0.0, 1.2]])
    np.testing.assert_allclose(np.asarray(drawn.get_offsets()) + 0.5 * flat, places)
    assert (drawn.headlength > 0.0) == arrows


@pytest.mark.parametrize("corners", [4, 3])
def test_even_places_fill_a_mesh_and_nothing_else(corners):
    """Of an L of 30 x 30 cells, quadrilaterals or triangles, all places but those in the corner."""
    x, y = (c.ravel() + 0.5 for c in np.meshgrid(np.arange(30.0), np.arange(30.0)))
    inside = (x < 15.0) | (y < 15.0)
    centres = np.stack([x[inside], y[inside]], axis=1)
    if corners == 3:
        centres = np.concatenate([centres - 1.0 / 6.0, centres + 1.0 / 6.0])
    places, nearest, spacing = even_places(centres, across=10)
    assert len(places) == 75
    assert spacing == pytest.approx(np.ptp(centres) / 10)
    assert not ((places > 16.0).all(axis=1)).any()
    assert np.linalg.norm(centres[nearest] - places, axis=1).max() < 0.8


def test_one_element_has_one_place():
    places, nearest, spacing = even_places(np.array([[3.0, 4.0]]))
    assert (places.tolist(), nearest.tolist(), spacing) == ([[3.0, 4.0]], [0], 1.0)


# --- geometry of the views ------------------------------------------------------------------------


@pytest.mark.parametrize("view", [FROM_ABOVE, oblique(), oblique(from_below=True)])
def test_views_are_not_mirrored(view: View):
    axes = np.stack([view.right, view.up, view.towards])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_from_below_is_from_below():
    assert oblique().towards[2] > 0.0 > oblique(from_below=True).towards[2]


def test_what_is_in_front_is_painted_last():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    stack = np.stack([square + [0, 0, z] for z in (0.5, -1.0, 2.0)])
    assert painting_order(stack, FROM_ABOVE).tolist() == [1, 0, 2]
    assert painting_order(stack, oblique(from_below=True)).tolist() == [2, 0, 1]


def test_rim_of_a_blank(scene):
    blank = build_blank(
        scene.blank.model_copy(update={"fibre_angle": 0.0}), scene.material.thickness
    )
    ends = blank.mid_surface_positions[boundary_edges(blank.faces)]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(0.2)


def test_rim_of_a_blank_with_triangles(blank):
    assert blank.is_triangle.any()
    ends = blank.mid_surface_positions[boundary_edges(blank.faces)]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(0.2, rel=1e-6)


def cube():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners, np.array([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])])


def sphere(count=40):
    theta, phi = np.meshgrid(
        np.linspace(0, np.pi, count + 1), np.linspace(0, 2 * np.pi, 2 * count, endpoint=False),
        indexing="ij",
    )  # fmt: skip
    points = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    ).reshape(-1, 3)
    index = np.arange(len(points)).reshape(theta.shape)
    a, b = index[:-1], index[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    quads = np.stack([a, b, c, d], axis=-1).reshape(-1, 4)
    return points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def test_edges_of_a_cube_are_drawn_and_its_diagonals_are_not():
    segments = contour_edges(*cube(), oblique())
    assert len(segments) == 12
    np.testing.assert_allclose(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1), 1.0)


def test_contour_of_a_sphere_is_a_circle():
    view = oblique()
    points, triangles = sphere()
    radius = np.linalg.norm(view.on_screen(contour_edges(points, triangles, view)), axis=-1)
    assert radius.min() > 0.95


def test_front_of_a_cube_covers_its_outline():
    """From above, front and back of the unit cube are one unit square each."""
    areas = []
    for corners in fronts_and_backs(*cube(), FROM_ABOVE):
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        areas.append(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    assert sorted(areas) == pytest.approx([-1.0, 1.0])


def test_cut_through_a_sphere_is_a_circle():
    segments = section(*sphere(), y=0.6)
    radius = np.linalg.norm(segments.reshape(-1, 2), axis=1)
    np.testing.assert_allclose(radius, 0.8, atol=5e-3)
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum()
    assert length == pytest.approx(2 * math.pi * 0.8, rel=5e-3)
