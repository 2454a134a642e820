"""What the check says of tools at the start: true gaps, sides of surfaces, a picture in errors."""

from __future__ import annotations

import math
import warnings

import meshio
import numpy as np
import pytest
from PIL import Image
from rich.console import Console

from lcmchain.check import check_scene
from lcmchain.check.tools_at_start import gaps_of_sheets, require_no_initial_overlap, smallest_gap
from lcmchain.cli import main
from lcmchain.errors import InputError
from lcmchain.mesh.blank import build_blank
from lcmchain.model import build_model
from lcmchain.report.start import draw_initial
from lcmchain.scene import read_scene
from lcmchain.tools import gaps
from lcmchain.tools.surfaces.triangle_distance import ExactDistance
from lcmchain.tools.table import OVERLAP_TOLERANCE, build_tool_table

TOP = 1.004  # of the blank [mm]
SCENE = """
title = "a sharp tool"
[process]
time = "40 ms"
[blank]
size = ["60 mm", "60 mm"]
edge_length = "10 mm"
height = "0.502 mm"
[material]
preset = "MD600"
[[tools]]
name = "bed"
shape = {{ type = "plate", side = "below" }}
[[tools]]
name = "punch"
shape = {{ {shape} }}
position = "{x} {y} {z} mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "0.2 mm" }}
"""
STL = 'type = "surface_mesh", file = "tool.stl", length_unit = "mm", spacing = "1 mm"'
SPHERE = 'type = "sphere_capped_punch", radius = "30 mm"'


def pyramid():
    """Tip down at the origin, base 20 mm above it, normals outwards."""
    points = np.array([[-8, -8, 20], [8, -8, 20], [8, 8, 20], [-8, 8, 20], [0, 0, 0]], float)
    return points, np.array([[0, 1, 2], [0, 2, 3], [1, 0, 4], [2, 1, 4], [3, 2, 4], [0, 3, 4]])


def scene_at(folder, shape=STL, x=3.1, y=2.2, z=1.2, mesh=None):
    points, triangles = pyramid() if mesh is None else mesh
    meshio.Mesh(points, [("triangle", triangles)]).write(folder / "tool.stl")
    path = folder / "scene.toml"
    path.write_text(SCENE.format(shape=shape, x=x, y=y, z=z), encoding="utf-8")
    return read_scene(path)


def gap_of_punch(scene):
    blank = build_blank(scene.blank, scene.material.thickness)
    directory = scene.source.directory
    table = build_tool_table(scene.tools, directory, 0.1, blank=blank.node_positions)
    return gaps_of_sheets(scene.tools, [(blank, 0.0)], table, directory)[1]


@pytest.mark.parametrize("shape", [STL, SPHERE])
@pytest.mark.parametrize("x, y", [(3.1, 2.2), (-3.7, 21.3), (29.9, -12.0)])
def test_gap_is_that_between_the_nodes_too(tmp_path, shape, x, y):
    """A tip or a cap above the middle of a face comes closer than to any node."""
    gap = gap_of_punch(scene_at(tmp_path, shape, x, y, TOP + 0.2))
    assert gap.gap == pytest.approx(0.2e-3, abs=1e-9)
    np.testing.assert_allclose(gap.position, [1e-3 * x, 1e-3 * y, 1e-3 * TOP], atol=1e-6)
    assert gap.at_nodes > 0.25e-3


@pytest.mark.parametrize("height", [0.02, 3.0, 20.0, 300.0])
def test_gap_of_a_surface_mesh_is_exact_at_any_distance(tmp_path, height):
    """The distance field knows a lower bound only beyond a few spacings."""
    gap = gap_of_punch(scene_at(tmp_path, x=0.0, y=0.0, z=TOP + height))
    assert gap.gap == pytest.approx(1e-3 * height, abs=1e-9)


def test_gap_beside_the_blank_is_that_of_its_rim(tmp_path):
    # the ridge of the base, 8 mm from the axis, 20 mm above the tip, passes the rim at x = 30 mm
    scene = scene_at(tmp_path, x=40.0, y=0.0, z=TOP - 20.0)
    assert gap_of_punch(scene).gap == pytest.approx(2e-3, abs=1e-8)


@pytest.mark.parametrize("depth", [0.5e-2, 2e-2, 0.3])
def test_a_tip_between_the_nodes_is_an_overlap(tmp_path, depth):
    """No node is in the tool; deeper than 1 % of the thickness is refused even so."""
    scene = scene_at(tmp_path, z=TOP - depth * TOP)
    gap = gap_of_punch(scene)
    assert gap.gap == pytest.approx(-1e-3 * depth * TOP, abs=1e-9)
    assert gap.at_nodes > 0.5e-3
    if depth <= OVERLAP_TOLERANCE:
        check_scene(scene)
        return
    with pytest.raises(InputError, match=r"reaches .* into the blank .* at \(3.1, 2.2, ") as error:
        check_scene(scene)
    assert error.value.key == 'tools[1] "punch".position'


def test_a_sheet_of_membrane_shells_has_the_same_gaps(tmp_path):
    """Its nodes lie within the sheet, but the tools meet its faces."""
    scene = scene_at(tmp_path, z=TOP - 0.3)
    membranes = read_scene(tmp_path / "scene.toml", ['element.type="membrane-shell"'])
    model = build_model(membranes)
    with pytest.raises(InputError, match="reaches 0.3 mm into the blank"):
        require_no_initial_overlap(membranes, model.tools)
    assert not model.only_body().mesh.has_thickness
    assert build_model(scene).only_body().mesh.has_thickness


def test_what_lies_far_behind_an_open_skin_is_free(tmp_path):
    """As for the solver: a skin is solid behind it down to the end of its band only."""
    at = np.linspace(-40.0, 40.0, 9)
    x, y = (grid.ravel() for grid in np.meshgrid(at, at, indexing="ij"))
    first = np.array([i * 9 + j for i in range(8) for j in range(8)])
    a, b, c, d = first, first + 9, first + 10, first + 1
    up = np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))
    scene = scene_at(tmp_path, x=0, y=0, z=0, mesh=(np.stack([x, y, 0 * x], 1), up))
    table = build_tool_table(scene.tools, tmp_path, 0.1)
    exact = ExactDistance(scene.tools[1].shape.surface_mesh(tmp_path))
    height = 1e-3 * np.array([7.0, 0.5, -0.5, -3.0, -10.0])
    points = np.stack([0 * height, 0 * height, height], axis=1)
    found = exact(points, gaps(table, 1, points, 0.0), 1e-3)
    np.testing.assert_allclose(found, [*height[:4], 10e-3], atol=1e-9)


def test_a_field_that_rounds_into_the_blank_is_named(tmp_path):
    """At an inner corner the grid rounds the tool into the blank, which its surface leaves free."""
    # a channel 59.9 mm wide would overlap; one of 60.1 mm fits, but not on a grid of 4 mm
    half, deep = 30.05, 12.0
    profile = np.array([(-60, 0), (-half, 0), (-half, deep), (half, deep), (half, 0), (60, 0)])
    along = np.array([-45.0, 45.0])
    points = np.array([(x, y, z) for x, z in profile for y in along])
    strips = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(5)]
    triangles = np.array([t for a, b, c, d in strips for t in ((a, b, c), (a, c, d))])
    shape = STL.replace("1 mm", "4 mm")
    scene = scene_at(tmp_path, shape, 0, 0, TOP - deep + 0.02, (points, triangles))
    gap = gap_of_punch(scene)
    assert gap.gap == pytest.approx(0.02e-3, abs=1e-8)
    assert gap.at_nodes < -0.1e-3
    with pytest.raises(InputError, match="inner corner; give its shape a smaller spacing"):
        check_scene(scene)


@pytest.mark.parametrize("seed", range(6))
def test_smallest_gap_to_spheres(tmp_path, seed):
    """A sphere anywhere around the blank; the exact distance is that of its centre to a box."""
    rng = np.random.default_rng(seed)
    blank = build_blank(scene_at(tmp_path).blank, 1e-3 * TOP)
    centre = rng.uniform([-0.05, -0.05, -0.01], [0.05, 0.05, 0.01])
    centre[2] += math.copysign(1e-3, centre[2])
    foot = np.clip(centre, blank.node_positions.min(axis=0), blank.node_positions.max(axis=0))
    radius = rng.uniform(0.1, 0.99) * float(np.linalg.norm(centre - foot))

    def distance(points):
        return np.linalg.norm(points - centre, axis=1) - radius

    gap, place = smallest_gap(distance, blank)
    # side walls of the blank have no faces here: a centre beside it sees the nearer rim
    level = blank.node_positions[:, 2]
    foot[2] = min((level.min(), level.max()), key=lambda z: abs(z - centre[2]))
    assert gap == pytest.approx(np.linalg.norm(centre - foot) - radius, abs=1e-8)
    np.testing.assert_allclose(place, foot, atol=1e-4)


def test_the_check_tells_what_surfaces_are_and_what_was_turned(tmp_path):
    points, triangles = pyramid()
    scene = scene_at(tmp_path, z=TOP - 0.004, mesh=(points, triangles[:, ::-1]))
    report = check_scene(scene)
    console = Console(width=160)
    with console.capture() as shown:
        for table in report.tables():
            console.print(table)
    rows = [" ".join(line.split()) for line in shown.get().splitlines()]
    assert "punch 6 closed outwards 6 with their part" in rows
    assert "punch touches 3.1, 2.2, 1.0" in rows
    assert any("6 of 6 triangles had normals" in warning for warning in report.warnings)
    # what touches at nodes begins its contact deeper, and the check says so
    scene = scene_at(tmp_path, 'type = "plate", side = "above"', z=TOP - 0.004)
    report = check_scene(scene)
    assert report.initial_overlap == pytest.approx([0.0, 4e-6], abs=1e-12)
    with console.capture() as shown:
        for table in report.tables():
            console.print(table)
    assert "touches; contact begins 4 um deeper" in shown.get()


def red(path) -> float:
    """Share of the pixels that have the colour of the marks."""
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    return float((np.abs(pixels - (0xD1, 0x00, 0x1F)).max(axis=2) < 30).mean())


def test_an_overlap_is_drawn_and_the_error_names_the_picture(tmp_path, capsys):
    scene_at(tmp_path, z=TOP - 0.3)
    with pytest.raises(SystemExit) as stopped:
        main(["check", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "out")])
    assert stopped.value.code == 2
    picture = tmp_path / "out" / "initial.png"
    message = " ".join(capsys.readouterr().err.split())
    assert "into the blank" in message
    assert "initial.png shows the start" in message
    marked = red(picture)
    assert marked > 1e-4
    check_scene(scene_at(tmp_path, z=TOP + 0.3), tmp_path / "out")
    assert red(picture) < 0.1 * marked


def test_a_tool_that_cannot_be_used_is_left_out_of_the_picture(tmp_path):
    angle = np.linspace(0.0, 2.0 * math.pi, 40, endpoint=False)
    rims = []
    for width in (-5.0, 5.0):
        r = 20.0 + width * np.cos(0.5 * angle)
        rims.append(
            np.stack((r * np.cos(angle), r * np.sin(angle), width * np.sin(0.5 * angle)), 1)
        )
    a, b = np.arange(40), np.arange(40) + 40
    c, d = np.append(b[1:], 0), np.append(a[1:], 40)
    moebius = np.concatenate(rims), np.concatenate((np.stack((a, d, c), 1), np.stack((a, c, b), 1)))
    with pytest.raises(InputError, match="Moebius.*initial.png shows the start"):
        check_scene(scene_at(tmp_path, z=30, mesh=moebius), tmp_path)
    assert (tmp_path / "initial.png").stat().st_size > 10_000


def test_a_tool_outside_the_picture_leaves_it_without_a_warning(tmp_path):
    points, triangles = pyramid()
    blank = build_blank(scene_at(tmp_path).blank, 1e-3 * TOP)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        draw_initial(tmp_path / "far.png", blank, [("far", points + 10.0, triangles)])
    assert (tmp_path / "far.png").stat().st_size > 10_000


def test_a_picture_that_cannot_be_written_hides_no_error(tmp_path):
    scene = scene_at(tmp_path, z=TOP - 0.3)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="into the blank"):
        check_scene(scene, tmp_path / "file")


def test_a_tool_in_another_unit_is_told(tmp_path):
    """20 mm read as 20 m beside a blank of 60 mm."""
    in_metres = STL.replace(
        'length_unit = "mm", spacing = "1 mm"', 'length_unit = "m", spacing = "1 m"'
    )
    report = check_scene(scene_at(tmp_path, in_metres, z=2000.0))
    (told,) = [text for text in report.warnings if "as large as the blank" in text]
    assert "333 times" in told and 'length_unit (now "m", more likely "mm"' in told
    report = check_scene(scene_at(tmp_path))
    assert not any("as large as the blank" in text for text in report.warnings)


SLOPE = 'type = "plate", side = "above"'


@pytest.mark.parametrize("family, overlap", [("solid-shell", 0.0), ("membrane-shell", 0.067)])
def test_a_slope_is_judged_as_the_contact_of_the_elements_sees_it(tmp_path, family, overlap):
    """A plate at 30 degrees that touches the rim of the upper face.

    The mid-surface keeps half the thickness h away along the normal: h/2 (1 - cos 30) is missing.
    """
    scene_at(tmp_path, SLOPE, x=-30.0, y=0.0, z=TOP)
    tilted = f"tools.punch.axis=[{-math.sin(math.pi / 6)}, 0, {math.cos(math.pi / 6)}]"
    scene = read_scene(tmp_path / "scene.toml", [tilted, f'element.type="{family}"'])
    model = build_model(scene)
    tool_gap = gaps(
        model.tools, 1, np.ascontiguousarray(model.only_body().mesh.node_positions), 0.0
    )
    of_contact = float((tool_gap - model.nodes.offset).min())
    assert of_contact == pytest.approx(-1e-3 * overlap * TOP, abs=1e-6)
    if not overlap:
        assert check_scene(scene) is not None
        return
    for judge in (check_scene, lambda s: require_no_initial_overlap(s, model.tools)):
        with pytest.raises(InputError, match="reaches 0.0673 mm into the blank.*mid-surface"):
            judge(scene)


def test_gaps_of_a_mid_surface_are_those_of_its_contact(tmp_path):
    """Level tools: the same as of the faces, at nodes and at tips between them."""
    for shape in (STL, SPHERE):
        scene = scene_at(tmp_path, shape, z=TOP + 0.2)
        blank = build_blank(scene.blank, scene.material.thickness)
        table = build_tool_table(scene.tools, tmp_path, 0.1, blank=blank.node_positions)
        found = gaps_of_sheets(scene.tools, [(blank, 0.5e-3 * TOP)], table, tmp_path)
        assert [gap.gap for gap in found] == pytest.approx([0.0, 0.2e-3], abs=1e-9)
