"""Fibre lines, transparent tools, sections, marks, force over travel, and the film."""

import importlib.util
import math
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from matplotlib.image import imread
from PIL import Image

from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries, build_datasets
from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.sheet import reference_positions, sheet_faces
from lcmchain.fields.summary import punch_index
from lcmchain.mesh.blank import build_blank
from lcmchain.mesh.mid_surface import triangulate
from lcmchain.report import draw_result, plots, sections
from lcmchain.report.drawn_tools import BEHIND, DepthBuffer, RunTools, draw_tool, hidden_and_seen
from lcmchain.report.fibre_segments import even_choice, fibre_segments
from lcmchain.report.pictures import draw_fibre_directions
from lcmchain.report.renderer import axes_at, fit_axis, mark_extremes
from lcmchain.report.run_pictures import draw_animation, draw_run, require_film
from lcmchain.report.sections import Plane, cut_sheet, default_planes, draw_sections
from lcmchain.report.style import CAPTIONS, SHOWN, caption_of, new_figure
from lcmchain.report.view import FROM_ABOVE, oblique
from lcmchain.scene import scene_from_text
from lcmchain.tools.table import build_tool_table

SCENE = """
title = "Dome"
[process]
time = "20 ms"
[blank]
size = ["60 mm", "40 mm"]
edge_length = "2 mm"
fibre_angle = "ANGLE deg"
[material]
preset = "MD600"
[[tools]]
name = "die"
shape = { type = "plate", side = "below" }
position = "0 0 -2 mm"
[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "15 mm" }
position = "0 0 3 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "1 mm" }
"""
HEIGHT = 1e-3


def scene_at(angle, text=""):
    return scene_from_text(text + SCENE.replace("ANGLE", str(angle)))


@pytest.fixture(scope="module")
def scene():
    return scene_at(0)


@pytest.fixture(scope="module")
def blank(scene):
    return build_blank(scene.blank, scene.material.thickness)


def result(scene, mesh, height=HEIGHT):
    """Three frames: flat, half and whole of a bump, the thickness kept; the punch travels 1 mm."""
    x, y, z = mesh.node_positions.T
    bump = np.exp(-(x**2 + y**2) / 0.02**2)
    share = np.array([0.0, 0.5, 1.0])
    return build_datasets(
        scene,
        mesh,
        FrameSeries(
            time=0.02 * share,
            positions=np.stack([np.stack([x, y, z + s * height * bump], axis=1) for s in share]),
            tool_travel=np.stack([0.0 * share, 1e-3 * share], axis=1),
            tool_force=np.stack([np.outer(share, [0, 0, -2.0]), np.outer(share, [0, 0, 3.0])], 1),
            energy={"internal": share},
            tool_names=("die", "punch"),
        ),
    )


@pytest.fixture(scope="module")
def datasets(scene, blank):
    return result(scene, blank)


@pytest.fixture(scope="module")
def tools(scene, blank):
    table = build_tool_table(scene.tools, scene.source.directory, scene.process.time)
    return RunTools.of_scene(scene, table, blank.node_positions)


# --- fibre lines ----------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0, 30, 45])
@pytest.mark.parametrize("split", [False, True])
def test_fibre_lines_follow_the_fibres_and_are_few(angle, split):
    scene = scene_at(angle, 'element = "membrane-shell"\n' if split else "")
    mesh = build_blank(scene.blank, scene.material.thickness)
    sheet = result(scene, triangulate(mesh) if split else mesh)[SHEET]
    points = reference_positions(sheet)
    for family, nodes in enumerate(fibre_segments(sheet, most=11)):
        along = points[nodes[:, 1]] - points[nodes[:, 0]]
        fibre = np.radians(angle + 90.0 * family)
        unit = along / np.linalg.norm(along, axis=1)[:, None]
        cosine = unit @ [math.cos(fibre), math.sin(fibre), 0.0]
        assert cosine.min() > math.cos(math.radians(30.0))  # where a slanted edge moves nodes
        assert np.median(cosine) == pytest.approx(1.0, abs=1e-12)
        across = points[nodes[:, 0]] @ [-math.sin(fibre), math.cos(fibre), 0.0]
        places, counts = np.unique(np.round(across / 1e-5), return_counts=True)
        lines = places[counts > 3]  # without nodes that the edge has moved aside
        lines = lines[np.abs(lines) <= min(lines[-1], -lines[0]) + 1.0]  # and ends in corners
        assert 6 <= len(lines) <= 11
        np.testing.assert_allclose(lines, -lines[::-1], atol=1.0)  # symmetric to the middle
        assert np.ptp(np.diff(lines)) <= 2.0  # evenly spaced


@pytest.mark.parametrize("count", range(1, 70))
def test_even_choices_are_symmetric(count):
    chosen = even_choice(count, 11)
    assert chosen[0] + chosen[-1] == count - 1
    assert len(set(np.diff(chosen))) <= 1
    assert 1 <= len(chosen) <= 11
    assert len(chosen) >= min(count, 4)


def test_fibres_have_their_colours_in_the_picture(datasets, tmp_path):
    draw_fibre_directions(tmp_path / "fibres.png", datasets[SHEET])
    pixels = imread(tmp_path / "fibres.png")[..., :3]
    blue = (pixels[..., 2] > pixels[..., 0] + 0.3).mean()
    orange = (pixels[..., 0] > pixels[..., 2] + 0.3).mean()
    assert min(blue, orange) > 0.01


# --- transparent tools ----------------------------------------------------------------------------


def square(z, half):
    return half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) + [0.0, 0.0, z]


@pytest.mark.parametrize(("z", "part"), [(-1.0, 0.25), (1.0, 0.0)])
def test_a_sheet_hides_the_part_of_a_tool_behind_it(z, part):
    """A square of half the width, in the middle of a tool; seen from above."""
    sheet = DepthBuffer(square(0.0, 1.0)[None], FROM_ABOVE)
    corners = square(z, 2.0)[[[0, 1, 2], [0, 2, 3]]]
    hidden, seen = hidden_and_seen(corners, FROM_ABOVE, sheet, side=1.0, size=0.05)

    def area(t):
        return 0.5 * np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum()

    assert area(hidden) + area(seen) == pytest.approx(16.0)
    assert area(hidden) == pytest.approx(16.0 * part, abs=0.3)
    if part:
        assert np.abs(hidden[..., :2]).max() < 1.0 + 0.05


@pytest.mark.parametrize(("side", "is_hidden"), [(1.0, True), (-1.0, False)])
def test_a_sheet_on_a_tool_lies_on_its_free_side(side, is_hidden):
    """Of a tool in the very plane of the sheet, the free side is behind it, the solid in front."""
    sheet = DepthBuffer(square(0.0, 1.0)[None], FROM_ABOVE)
    corners = square(0.0, 0.8)[[[0, 1, 2], [0, 2, 3]]]
    parts = hidden_and_seen(corners, FROM_ABOVE, sheet, side, size=0.05)
    assert [len(part) > 0 for part in parts] == [is_hidden, not is_hidden]


def test_the_foremost_facet_counts():
    view = oblique()
    stack = np.stack([square(0.0, 1.0), square(3.0, 1.0), square(1.0, 1.0)])
    buffer = DepthBuffer(stack, view)
    seen = buffer.depth[np.isfinite(buffer.depth)]
    top = square(3.0, 1.0) @ view.towards
    assert seen.max() == pytest.approx(top.max(), abs=0.02)
    point = np.array([[0.0, 0.0, 3.0]])
    assert buffer.hides(point, point @ view.towards - 0.1)
    assert not buffer.hides(point, point @ view.towards + 0.1)
    far = np.array([[9.0, 9.0, 9.0]])
    assert not buffer.hides(far, np.array([-99.0]))


def test_colours_that_are_values_are_not_tinted():
    axis = axes_at(new_figure(1.0, 1.0), 0.0, 0.0, 1.0, 1.0)
    sheet = DepthBuffer(square(0.0, 1.0)[None], FROM_ABOVE)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    for over_sheet in (True, False):
        draw_tool(
            axis, square(1.0, 0.5), triangles, FROM_ABOVE, "red", sheet, 0.1, over_sheet=over_sheet
        )
    orders = [artist.get_zorder() for artist in axis.patches if len(artist.get_path().vertices)]
    assert max(orders[: len(orders) // 2]) > BEHIND
    assert set(orders[len(orders) // 2 :]) == {BEHIND}


def test_tools_stand_where_they_have_travelled_to(tools):
    box = np.array([[-0.03, -0.03, -0.01], [0.03, 0.03, 0.02]])
    lowest = {
        name: points[:, 2].min() for name, points, _, _ in tools.within(box, np.array([0.0, 1e-3]))
    }
    assert lowest["punch"] == pytest.approx(2e-3, abs=1e-9)
    assert lowest["die"] == pytest.approx(-2e-3, abs=1e-9)


# --- sections -------------------------------------------------------------------------------------


def test_default_sections_run_along_the_fibres_through_the_middle():
    scene = scene_at(30)
    mesh = build_blank(scene.blank, scene.material.thickness)
    planes = default_planes(result(scene, mesh)[SHEET])
    for plane, angle in zip(planes, (30.0, 120.0), strict=True):
        direction = [math.cos(math.radians(angle)), math.sin(math.radians(angle)), 0.0]
        assert abs(plane.along @ direction) == pytest.approx(1.0)
        np.testing.assert_allclose(plane.up, [0.0, 0.0, 1.0], atol=1e-12)
        assert abs(plane.point @ plane.normal) < 2e-3


@pytest.mark.parametrize("normal", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (1, 2, 3)])
def test_a_plane_has_a_right_handed_frame_and_finds_its_points(normal):
    plane = Plane.through(np.array([0.1, 0.2, 0.3]), np.array(normal, dtype=float))
    frame = np.stack([plane.along, plane.up, plane.normal])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
    point = plane.place(np.array([0.5, -0.7]))
    np.testing.assert_allclose(plane.flat(point), [0.5, -0.7], atol=1e-15)
    assert (point - plane.point) @ plane.normal == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("angle", [0, 30, 45])
def test_a_cut_is_one_strip_with_the_length_and_thickness_of_the_sheet(angle):
    scene = scene_at(angle)
    mesh = build_blank(scene.blank, scene.material.thickness)
    nodes = mesh.node_positions
    bottom, top = nodes[: mesh.pair_count], nodes[mesh.pair_count :]
    plane = Plane.through(np.array([0.0, 0.004, 0.0]), np.array([0.0, 1.0, 0.0]))
    ((lower, upper),) = cut_sheet(0.5 * (bottom + top), bottom, top, mesh.faces, plane)
    np.testing.assert_allclose(upper - lower, np.tile([0, 0, mesh.thickness], (len(lower), 1)))
    assert np.ptp(lower[:, 0]) == pytest.approx(0.06, rel=1e-6)
    assert (np.diff(lower[:, 0]) >= -1e-12).all()
    np.testing.assert_allclose(lower[:, 1], 0.004, atol=1e-6)


@pytest.mark.usefixtures("fine_pictures")
def test_a_plane_beside_the_sheet_cuts_nothing(blank, datasets, tmp_path):
    middle = blank.mid_surface_positions
    plane = Plane.through(np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    assert cut_sheet(middle, middle, middle, blank.faces, plane) == []
    draw_sections(tmp_path / "none.png", datasets, [plane])
    assert imread(tmp_path / "none.png").shape[1] > 1000


def test_a_hole_between_two_parts_gives_two_strips(blank):
    x = blank.mid_surface_positions[blank.faces].mean(axis=1)[:, 0]
    middle = blank.mid_surface_positions
    plane = Plane.through(np.zeros(3), np.array([0.0, 1.0, 0.0]))
    strips = cut_sheet(middle, middle, middle, blank.faces[np.abs(x) > 0.01], plane)
    assert [round(1e3 * float(np.ptp(lower[:, 0])), 6) for lower, _ in strips] == [20.0, 20.0]


def test_the_gaps_of_an_unrolled_section(tools, blank):
    """The die lies 2 mm below the middle of the flat sheet, half its thickness nearer to its face;
    the punch is a sphere that has come down to 2 mm above it."""
    x = np.linspace(-0.01, 0.01, 21)
    half = 0.5 * blank.thickness
    lower, upper = (np.stack([x, 0 * x, 0 * x + z], axis=1) for z in (-half, half))
    die = sections._distances(tools, 0, 0.0, lower, upper, 1e3 * half + 0 * x)
    np.testing.assert_allclose(die[0], -2.0, atol=1e-9)
    assert np.isnan(die[1]).all()
    punch = sections._distances(tools, 1, 1e-3, lower, upper, 1e3 * half + 0 * x)
    assert np.isnan(punch[0]).all()
    assert punch[1][10] == pytest.approx(2.0, abs=1e-9)
    expected = np.hypot(x, 0.017 - half) - 0.015 + half
    np.testing.assert_allclose(punch[1], 1e3 * expected, atol=1e-9)


def test_where_a_distance_ends_no_surface_is_drawn():
    """Behind an open surface mesh, 4 mm deep, the distance jumps back to a bound above zero."""
    z = np.arange(-8.0, 4.0)
    distance = np.tile(np.where(z < -4.0, 4.0, z), (3, 1))
    drawn = sections._without_jumps(distance, sections.LARGEST_CHANGE)
    assert [z[i] for i in np.flatnonzero(np.isnan(drawn[1]))] == [-5.0, -4.0]
    across = sections._without_jumps(distance.T, sections.LARGEST_CHANGE)
    np.testing.assert_array_equal(across, drawn.T)
    np.testing.assert_array_equal(drawn[:, 5:], distance[:, 5:])


def test_sections_show_the_tools(datasets, tools, tmp_path):
    planes = default_planes(datasets[SHEET])
    travel = datasets[HISTORY]["tool_travel"].values[-1]
    draw_sections(tmp_path / "with.png", datasets, planes, tools, travel)
    draw_sections(tmp_path / "without.png", datasets, planes)
    with_tools, without = (
        (np.ptp(imread(tmp_path / f"{name}.png")[..., :3], axis=-1) > 0.1).mean()
        for name in ("with", "without")
    )
    assert with_tools > without + 0.01


def test_the_scene_gives_the_sections(tmp_path, blank, datasets, monkeypatch):
    scene = scene_from_text(
        SCENE.replace("ANGLE", "0")
        + '[[output.sections]]\nname = "side"\npoint = "0 5 0 mm"\nnormal = [0, 2, 0]\n'
    )
    seen = {}
    monkeypatch.setattr(
        "lcmchain.report.run_pictures.draw_sections",
        lambda path, datasets, planes, *rest: seen.update(planes=planes),
    )
    table = build_tool_table(scene.tools, scene.source.directory, scene.process.time)
    draw_run(scene, table, datasets, tmp_path, lambda text: None)
    (plane,) = seen["planes"]
    assert sections._title(plane) == "side: y = 5 mm"
    np.testing.assert_allclose(plane.point, [0.0, 0.005, 0.0])
    assert abs(plane.normal[1]) == pytest.approx(1.0)


# --- marks, captions, forces ----------------------------------------------------------------------


def test_labels_of_neighbouring_extremes_do_not_overlap():
    for places in ([[0.0, 0.0], [0.4, 0.1]], [[9.8, 9.8], [9.6, 9.9]], [[0.1, 5.0], [0.1, 5.2]]):
        figure = new_figure(3.0, 3.0)
        axis = axes_at(figure, 0.3, 0.3, 2.5, 2.5)
        axis.set_xlim(-0.5, 10.5)
        axis.set_ylim(-0.5, 10.5)
        values = np.array([1.0, -1.0])
        mark_extremes(axis, np.array(places), values, SHOWN[0])
        figure.canvas.draw()
        one, two = (text.get_window_extent() for text in axis.texts)
        assert not one.overlaps(two)
        frame = axis.get_window_extent()
        for box in (one, two):
            assert frame.x0 <= box.x0 and box.x1 <= frame.x1


@pytest.mark.parametrize("aspect", [0.2, 1.0, 5.0])
def test_labels_of_extremes_lie_within_the_map_of_a_strip(aspect):
    """Equal scales make its frame narrower than its panel, which is known when all is drawn."""
    rng = np.random.default_rng(1)
    for places in rng.random((6, 2, 2)) * [1.0, aspect]:
        figure = new_figure(11.4, 6.0)
        axis = axes_at(figure, 6.2, 0.5, 3.9, 5.0)
        fit_axis(axis, np.array([[0.0, 0.0], [1.0, aspect]]), 0.04)
        mark_extremes(axis, places, np.array([40.0, -40.0]), SHOWN[0])
        figure.canvas.draw()
        frame = axis.get_window_extent()
        one, two = (text.get_window_extent() for text in axis.texts)
        assert not one.overlaps(two)
        for box in (one, two):
            assert frame.x0 <= box.x0 and box.x1 <= frame.x1
            assert frame.y0 <= box.y0 and box.y1 <= frame.y1


def test_a_mark_stands_at_the_value_that_the_colour_bar_names():
    """Values within a thousandth of their range are not the extreme: they read otherwise."""
    thickness = next(shown for shown in SHOWN if shown.name == "thickness")
    places = np.array([[0.0, 0.0], [10.0, 10.0], [0.0, 10.0], [10.0, 0.0]])
    figure = new_figure(3.0, 3.0)
    axis = axes_at(figure, 0.3, 0.3, 2.5, 2.5)
    axis.set_xlim(-5.0, 15.0)
    axis.set_ylim(-5.0, 15.0)
    mark_extremes(axis, places, np.array([2.735, 2.732, 0.967, 0.969]), thickness)
    assert [text.get_text() for text in axis.texts] == ["max 2.735 mm", "min 0.967 mm"]


def test_of_equal_extremes_the_ones_far_apart_are_marked():
    axis = axes_at(new_figure(3.0, 3.0), 0.3, 0.3, 2.5, 2.5)
    places = np.array([[1, 1], [-1, -1], [-1, 1], [1, -1], [1.1, 0.9]], dtype=float)
    axis.set_xlim(-2, 2)
    axis.set_ylim(-2, 2)
    mark_extremes(axis, places, np.array([5.0, 5.0 - 1e-4, -5.0, -5.0, -5.0 + 1e-4]), SHOWN[0])
    marks = {tuple(line.get_xydata()[0]) for line in axis.lines}
    assert marks == {(1.0, 1.0), (1.0, -1.0)} or marks == {(1.0, 1.0), (-1.0, 1.0)}


def test_every_picture_has_a_caption(datasets, tools, tmp_path):
    files = draw_result(tmp_path, datasets, tools=tools)
    of_stack = {name for name in CAPTIONS if name.startswith(("plies_", "stack_", "exploded"))}
    asked = {"springback.png", "wrinkle_risk.png", "courses.png"}
    assert {file.name for file in files} == set(CAPTIONS) - of_stack - asked
    assert all(file.is_file() for file in files)
    assert "transparent" in caption_of("tools.png")
    assert caption_of("animation_thickness.gif").startswith("Forming")
    assert caption_of("other-part_one.png") == "other part one"


def test_forces_are_drawn_over_the_travel_of_their_own_tool(datasets, tmp_path, monkeypatch):
    """The die does not travel, and stands over the punch; means lie in the middle of intervals."""
    figures = []
    monkeypatch.setattr(plots, "save", lambda figure, path: figures.append(figure))
    history = datasets[HISTORY]
    plots.draw_force_over_travel(tmp_path / "f.png", history)
    names = ("force", "peak_force", "peak_time", "travel", "work")
    sampled = xr.Dataset(
        {f"history_tool_{name}": (("history_time", "tool"), np.array([[1.0, 2.0], [3.0, 6.0]]))
         for name in names[1:]}
        | {f"history_tool_force_{a}": (("history_time", "tool"), np.array([[0.5, 1.0], [2.0, 4.0]])
           * (a == "z")) for a in "xyz"}
        | {"tool": history["tool"], "tool_travel": history["tool_travel"]},
        coords={"history_time": [0.01, 0.02]},
    )  # fmt: skip
    plots.draw_force_over_travel(tmp_path / "f.png", sampled)
    of_frames, of_samples = (figure.axes for figure in figures)
    assert [axis.get_xlabel() for axis in of_frames] == ["travel of the punch [mm]", "travel [mm]"]
    np.testing.assert_allclose(of_frames[1].lines[0].get_xydata(), [[0, 0], [0.5, 1.5], [1, 3]])
    np.testing.assert_allclose(of_samples[1].lines[0].get_xydata(), [[1e3, 1], [4e3, 4]])
    band = of_samples[1].collections[0].get_paths()[0].vertices
    assert band[:, 1].max() == pytest.approx(6.0)


def test_forces_of_a_tool_that_turns_are_drawn_over_its_angle(datasets, tmp_path, monkeypatch):
    """Where none travels the one that turns is quoted; where all stand, time is the only axis."""
    figures = []
    monkeypatch.setattr(plots, "save", lambda figure, path: figures.append(figure))
    history = datasets[HISTORY].copy(deep=True)
    history["tool"] = ("tool", ["bed", "wing"])
    history["tool_travel"][:] = 0.0
    plots.draw_force(tmp_path / "f.png", history)
    turned = np.zeros(history["tool_travel"].shape)
    turned[:, 1] = np.linspace(0.0, np.pi / 4, len(turned))
    history["tool_angle"] = history["tool_travel"].dims, turned
    assert punch_index(history) == 1 and punch_index(history.drop_vars("tool_angle")) == 0
    plots.draw_force(tmp_path / "f.png", history)
    standing, turning = (figure.axes for figure in figures)
    assert [axis.get_xlabel() for axis in standing] == ["time [ms]"]
    assert [axis.get_xlabel() for axis in turning] == ["angle of the wing [°]", "time [ms]"]
    assert turning[0].lines[1].get_xdata()[-1] == pytest.approx(45.0)


# --- film -----------------------------------------------------------------------------------------


def test_a_gif_has_all_frames_with_one_view_and_one_scale(datasets, tools, tmp_path):
    done = []
    path = tmp_path / "film.gif"
    draw_animation(
        path, datasets[SHEET], datasets[HISTORY], "wrinkle_height", tools=tools,
        report=lambda *step: done.append(step),
    )  # fmt: skip
    assert done == [(1, 3), (2, 3), (3, 3)]
    film = Image.open(path)
    assert film.n_frames == 3
    frames = []
    for number in range(3):
        film.seek(number)
        frames.append(np.asarray(film.convert("RGB")).astype(int))
    height, width = frames[0].shape[:2]
    bar = slice(int(0.16 * height), int(0.86 * height)), slice(int(0.84 * width), width)
    assert np.array_equal(frames[0][bar], frames[2][bar])
    assert not np.array_equal(frames[0], frames[2])


@pytest.mark.skipif(importlib.util.find_spec("imageio_ffmpeg") is None, reason="no imageio-ffmpeg")
def test_an_mp4_is_a_film(datasets, tmp_path):
    import imageio_ffmpeg

    path = tmp_path / "film.mp4"
    draw_animation(path, datasets[SHEET], datasets[HISTORY], "shear_angle")
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert count >= 3
    assert seconds > 1.0


def output_of(scene, **changes):
    return scene.output.model_copy(update=changes)


def test_a_film_that_cannot_be_made_is_told_before_the_run(scene, blank, monkeypatch):
    material = scene.material.build()
    require_film(output_of(scene, animation="gif"), [(blank, material)])
    flat = [(triangulate(blank), material)]
    require_film(output_of(scene, animation_field="thickness"), flat)
    for name in ("thickness", "fibre_volume_fraction"):
        wanted = output_of(scene, animation="gif", animation_field=name)
        with pytest.raises(InputError, match="output.animation_field"):
            require_film(wanted, [(blank, material), *flat])
    wanted = output_of(scene, animation="gif", animation_field="fibre_volume_fraction")
    with pytest.raises(InputError, match="fibre_density"):
        require_film(wanted, [(blank, material), (blank, SimpleNamespace(fibre_density=None))])
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"output.animation.*imageio-ffmpeg"):
        require_film(output_of(scene, animation="mp4"), [(blank, material)])
    require_film(output_of(scene, animation="gif"), [(blank, material)])


@pytest.mark.parametrize(
    ("pictures", "animation", "expected"),
    [(False, "none", set()), (False, "gif", {"animation_thickness.gif"})],
)
def test_a_film_needs_no_pictures(scene, datasets, tools, tmp_path, pictures, animation, expected):
    changes = {"pictures": pictures, "animation": animation, "animation_field": "thickness"}
    asked = scene.model_copy(update={"output": output_of(scene, **changes)})
    said = []
    files = draw_run(asked, tools.table, datasets, tmp_path, said.append)
    assert {file.name for file in files} == expected == {file.name for file in tmp_path.iterdir()}
    assert ("drawing the film, frame 3 of 3" in said) == bool(expected)


def test_faces_of_the_cut_are_those_of_the_sheet(datasets):
    """Wedges are stored turned over; the lower faces are the faces of the sheet again."""
    scene = scene_at(45)
    mesh = build_blank(scene.blank, scene.material.thickness)
    assert mesh.is_triangle.any()
    groups = result(scene, mesh)
    lower = sections._lower_faces(groups["/solid"])
    np.testing.assert_array_equal(lower, sheet_faces(groups[SHEET]))
