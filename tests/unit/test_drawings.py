"""Drawings: contours with holes and slits from DXF, in any unit, and what is wrong is named."""

import math

import ezdxf
import numpy as np
import pytest
import shapely

from lcmchain.errors import InputError
from lcmchain.mesh.drawing import read_drawing
from lcmchain.provenance import run_fingerprint
from lcmchain.scene import read_scene

SCENE = """
[process]
time = "10 ms"
[blank]
edge_length = "5 mm"
drawing = {{ file = "part.dxf"{more} }}
[material]
preset = "MD600"
"""


def drawing_of(draw, unit=4):
    """A drawing in some unit (4: mm), drawn by a function of its modelspace."""
    document = ezdxf.new()
    document.units = unit
    draw(document.modelspace(), document)
    return document


def rounded_plate(space, scale=1.0, layer="0"):
    """200 x 100 with one corner rounded by 20, of four lines in any order and sense, and an arc."""
    own = {"layer": layer}
    x, y, r = 200 * scale, 100 * scale, 20 * scale
    space.add_line((0, 0), (x, 0), dxfattribs=own)
    space.add_line((0, y), (x - r, y), dxfattribs=own)
    space.add_arc((x - r, y - r), r, 0, 90, dxfattribs=own)
    space.add_line((x, y - r), (x, 0), dxfattribs=own)
    space.add_line((0, y), (0, 0), dxfattribs=own)


PLATE = 0.2 * 0.1 - (1.0 - 0.25 * math.pi) * 0.02**2


def read(document, tmp_path, *, name="part.dxf", form="asc", **options):
    path = tmp_path / name
    document.saveas(path, fmt=form)
    given = {
        "layer": None, "slit_layer": None, "length_unit": None, "sagitta": 2e-5, "gap": 1e-5,
    } | options  # fmt: skip
    return read_drawing(path, **given)


def area(drawn):
    return shapely.Polygon(drawn.rim, drawn.holes).area


@pytest.mark.parametrize("form", ["asc", "bin"])
@pytest.mark.parametrize(("unit", "scale"), [(4, 1.0), (6, 1e-3), (5, 0.1), (1, 1 / 25.4)])
def test_lines_and_arcs_are_joined_to_a_contour_in_the_unit_of_the_drawing(
    tmp_path, unit, scale, form
):
    document = drawing_of(lambda space, _: rounded_plate(space, scale), unit)
    drawn = read(document, tmp_path, form=form, name="drawing.txt")  # told by its content
    # chords of the arc leave at most two thirds of the sagitta on average
    assert 0.0 < PLATE - area(drawn) < 0.5 * math.pi * 0.02 * 2e-5
    assert drawn.holes == () and drawn.slits == () and drawn.left_out == ""


def test_curves_stay_within_the_sagitta_and_turn_by_no_corner(tmp_path):
    def draw(space, _):
        rounded_plate(space)
        space.add_circle((60, 50), 25)
        space.add_circle((100, 20), 2)
        space.add_ellipse((140, 50), (20, 0), 0.5)
        space.add_lwpolyline([(100, 70, 0, 0, 1), (110, 70, 0, 0, 1)], close=True)

    drawn = read(drawing_of(draw), tmp_path, sagitta=1e-5)
    large, small, oval, bulge = sorted(drawn.holes, key=lambda h: -shapely.Polygon(h).area)[:1] + [
        next(h for h in drawn.holes if abs(shapely.Polygon(h).centroid.x - x) < 1e-4)
        for x in (0.1, 0.14, 0.105)
    ]
    for hole, middle, radius in (
        (large, (0.06, 0.05), 0.025),
        (small, (0.1, 0.02), 0.002),
        (bulge, (0.105, 0.07), 0.005),
    ):
        assert np.hypot(*(hole - middle).T) == pytest.approx(radius, rel=1e-9)
        middles = 0.5 * (hole + np.roll(hole, -1, axis=0))
        assert radius - np.hypot(*(middles - middle).T).min() < 1e-5
        side = np.roll(hole, -1, axis=0) - hole
        turn = np.diff(np.unwrap(np.arctan2(side[:, 1], side[:, 0])))
        assert np.abs(turn).max() < math.radians(11.0)
    angle = np.linspace(0.0, 2.0 * np.pi, 1000)
    curve = shapely.points(0.14 + 0.02 * np.cos(angle), 0.05 + 0.01 * np.sin(angle))
    assert shapely.distance(shapely.LinearRing(oval), curve).max() < 1e-5
    expected = PLATE - math.pi * (0.025**2 + 0.002**2 + 0.02 * 0.01 + 0.005**2)
    assert area(drawn) == pytest.approx(expected, abs=1e-5 * 0.5)


def test_splines_blocks_and_layers(tmp_path):
    def draw(space, document):
        block = document.blocks.new("PLATE")
        rounded_plate(block)
        space.add_blockref("PLATE", (100, 0), dxfattribs={"layer": "CUT", "rotation": 90})
        space.add_spline(
            [(20, 100), (40, 120), (60, 100), (40, 80), (20, 100)], dxfattribs={"layer": "CUT"}
        )
        space.add_line((-50, -50), (400, 300), dxfattribs={"layer": "FRAME"})
        space.add_text("part 7", dxfattribs={"layer": "CUT"})
        space.add_line((50, 0), (50, 20), dxfattribs={"layer": "SLIT"})
        space.add_line((50, 20), (60, 40), dxfattribs={"layer": "SLIT"})

    drawn = read(drawing_of(draw), tmp_path, layer="cut", slit_layer="SLIT")
    assert shapely.Polygon(drawn.rim).area == pytest.approx(PLATE, abs=1e-6)
    assert len(drawn.holes) == 1 and shapely.Polygon(drawn.holes[0]).area > 0.5 * 0.04**2
    assert len(drawn.slits) == 1
    assert drawn.slits[0] == pytest.approx(np.array([[50, 0], [50, 20], [60, 40]]) * 1e-3)
    assert drawn.left_out == "1 TEXT"


def test_a_scene_is_drawn_and_keeps_its_own_cuts_beside(tmp_path):
    def draw(space, _):
        rounded_plate(space)
        space.add_circle((60, 50), 15)
        space.add_line((150, 0), (150, 40), dxfattribs={"layer": "SLIT"})
        space.add_point((1, 1))

    drawing_of(draw).saveas(tmp_path / "part.dxf")
    more = ', slit_layer = "SLIT"'
    cuts = (
        '\nholes = [[["10 cm", "2 cm"], ["12 cm", "2 cm"], ["12 cm", "4 cm"], ["10 cm", "4 cm"]]]'
    )
    text = SCENE.format(more=more).replace("[material]", cuts + "\n[material]")
    (tmp_path / "scene.toml").write_text(text)
    scene = read_scene(tmp_path / "scene.toml")
    ply = scene.stack[0]
    mesh = ply.build_blank()
    left = PLATE - 0.02**2 - math.pi * 0.015**2
    assert mesh.outline_area == pytest.approx(left, abs=2e-6)
    assert mesh.area == pytest.approx(left, rel=2e-3)
    assert len(ply.contours.slits) == 1 and len(ply.contours.rings) == 3
    assert any("left out: 1 POINT" in text for text in ply.remarks(mesh))
    assert scene.source.files == [("blank.drawing.file", "part.dxf")]
    # another edge length reads nothing anew
    (tmp_path / "part.dxf").unlink()
    assert scene.with_longer_edges(1.5).stack[0].contours.area == ply.contours.area
    assert scene.alone(ply).stack[0].contours.area == ply.contours.area


def test_what_a_drawing_holds_is_in_the_fingerprint_and_not_its_file(tmp_path):
    def fingerprint(scale):
        drawing_of(lambda space, _: rounded_plate(space, scale)).saveas(tmp_path / "part.dxf")
        (tmp_path / "scene.toml").write_text(SCENE.format(more=""))
        return read_scene(tmp_path / "scene.toml")

    known = fingerprint(1.0)
    of_known = run_fingerprint(known)
    other = run_fingerprint(fingerprint(1.01))
    assert of_known.difference(other).endswith("or of its drawings")
    assert run_fingerprint(fingerprint(1.0)) == of_known
    (tmp_path / "part.dxf").unlink()
    assert run_fingerprint(known) == of_known


def wrong_gap(space, _):
    space.add_lwpolyline([(0, 0), (100, 0), (100, 100), (0, 100), (0, 0.5)])


def wrong_crossing(space, _):
    space.add_lwpolyline([(0, 0), (100, 100), (100, 0), (0, 100)], close=True)


def wrong_branch(space, _):
    rounded_plate(space)
    space.add_line((0, 0), (50, 50))


def wrong_outer(space, _):
    rounded_plate(space)
    space.add_circle((400, 0), 20, dxfattribs={"layer": "B"})


def wrong_nest(space, _):
    rounded_plate(space)
    space.add_circle((60, 50), 20)
    space.add_circle((60, 50), 10)


def wrong_touch(space, _):
    rounded_plate(space)
    space.add_circle((0, 50), 10)


def wrong_flat(space, _):
    space.add_line((0, 0, 0), (100, 0, 5))


@pytest.mark.parametrize(
    ("draw", "options", "words"),
    [
        (wrong_gap, {}, ["not closed", 'layer "0"', "(0, 0.5) mm", "0.5 mm from the next end"]),
        (wrong_crossing, {}, ["intersects itself", 'on layer "0"', "(100, 0) mm"]),
        (wrong_branch, {}, ["branches at (0, 0) mm", "3 ends"]),
        (wrong_outer, {}, ["2 contours that lie in no other one", 'layer "B"', "(420, 0) mm"]),
        (wrong_nest, {}, ["contour in a hole", "(70, 50) mm"]),
        (wrong_touch, {}, ["cross or touch at (0, "]),
        (wrong_flat, {}, ["is not flat", "5 mm of z"]),
        (wrong_outer, {"layer": "C"}, ['nothing on a layer "C"', '"0", "B"']),
    ],
)
def test_a_wrong_drawing_is_one_error_with_layer_handle_and_place(tmp_path, draw, options, words):
    with pytest.raises(InputError) as caught:
        read(drawing_of(draw), tmp_path, **options)
    for word in words:
        assert word in caught.value.message
    assert caught.value.file is not None


def test_no_unit_and_no_drawing_are_told(tmp_path):
    document = drawing_of(lambda space, _: rounded_plate(space), unit=0)
    with pytest.raises(InputError, match="does not say its unit"):
        read(document, tmp_path)
    assert area(read(document, tmp_path, length_unit="mm")) == pytest.approx(PLATE, abs=1e-6)
    for content, words in ((b"AC1032\0\0", "DWG"), (b"solid part\n", "no DXF drawing")):
        (tmp_path / "part.dxf").write_bytes(content)
        (tmp_path / "scene.toml").write_text(SCENE.format(more=""))
        with pytest.raises(InputError, match=words) as caught:
            read_scene(tmp_path / "scene.toml")
        assert caught.value.key == "blank.drawing.file"
    (tmp_path / "part.dxf").unlink()
    with pytest.raises(InputError, match='no file "part.dxf"') as caught:
        read_scene(tmp_path / "scene.toml")
    assert caught.value.key == "blank.drawing.file"
    (tmp_path / "scene.toml").write_text(
        SCENE.format(more="").replace("[blank]", '[blank]\nsize = ["1 m", "1 m"]')
    )
    drawing_of(lambda space, _: rounded_plate(space)).saveas(tmp_path / "part.dxf")
    with pytest.raises(InputError, match="not size and drawing"):
        read_scene(tmp_path / "scene.toml")
