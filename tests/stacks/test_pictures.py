"""Pictures of a stack."""

import numpy as np
import pytest
from matplotlib.image import imread
from PIL import Image

from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.stack import PLY
from lcmchain.fields.stages import STAGE, STAGE_NAME, stage_variable
from lcmchain.report import draw_result, draw_stack, run_pictures
from lcmchain.report.html import view_data
from lcmchain.report.pictures import _from_back_to_front
from lcmchain.report.run_pictures import draw_animation, draw_stages
from lcmchain.report.sections import Plane
from lcmchain.report.stack_pictures import _base_of, _Line
from lcmchain.report.start import MOST_PLIES_SHOWN, _shown_plies
from lcmchain.report.style import CAPTIONS, SHOWN, colour_scale, shades_of
from lcmchain.report.view import FROM_ABOVE, oblique

SCENE = """
material = { preset = "MD600" }
[[plies]]
size = ["120 mm", "120 mm"]
edge_length = "20 mm"
[[plies]]
size = ["120 mm", "120 mm"]
edge_length = "20 mm"
fibre_angle = "45 deg"
"""


WITH_FILM = """
materials.film = { law = "neo-hooke", shear_modulus = "0.4 MPa", thickness = "0.5 mm", \
density = "1100 kg/m^3" }
material = { preset = "MD600" }
[[plies]]
size = ["120 mm", "120 mm"]
edge_length = "20 mm"
[[plies]]
size = ["160 mm", "160 mm"]
edge_length = "20 mm"
material = "film"
film = true
"""


@pytest.fixture(scope="module")
def scene(scene_of):
    return scene_of(SCENE)


@pytest.fixture(scope="module")
def groups(scene, laid):
    return laid(scene)


def test_a_stack_is_drawn_ply_by_ply_and_every_picture_has_a_caption(groups, tmp_path):
    files = draw_result(tmp_path, groups)
    names = {file.name for file in files}
    assert {
        "stack_thickness.png", "stack_fibre_volume_fraction.png", "plies_shear_angle.png",
        "plies_thickness.png", "plies_fibre_directions.png", "exploded.png", "sections.png",
    } <= names  # fmt: skip
    assert "thickness.png" not in names, "one sheet's picture, on which plies hide each other"
    assert names <= set(CAPTIONS)
    for file in files:
        assert imread(file)[..., :3].std() > 0.01, file.name


def test_plies_in_courses_are_drawn_with_their_joints(scene_of, laid, tmp_path):
    text = SCENE.replace('fibre_angle = "45 deg"', 'courses = { joints = ["10 mm"], gap = "2 mm" }')
    files = draw_result(tmp_path, laid(scene_of(text)))
    (picture,) = (file for file in files if "courses" in file.name)
    assert picture.name == "plies_courses.png" and picture.name in CAPTIONS
    assert imread(picture)[..., :3].std() > 0.01


def test_stages_and_films_of_a_run_show_the_fabric_not_the_film_over_it(
    scene_of, laid, tmp_path, monkeypatch
):
    """A film has no shear angle: drawn with the others it would lie over them in black."""
    groups = laid(scene_of(WITH_FILM))
    stage = stage_variable(("time",), np.zeros(groups[SHEET].sizes["time"]), ["draw"])
    history = groups[HISTORY].assign({STAGE: stage, STAGE_NAME: (STAGE_NAME, ["draw"])})
    drawn = []
    monkeypatch.setattr(run_pictures, "draw_field", lambda path, sheet, *_: drawn.append(sheet))
    draw_stages(tmp_path, {**groups, HISTORY: history}, None, ())
    assert drawn[0].sizes["sheet_face"] == 36
    assert np.isfinite(drawn[0]["shear_angle"].values).all()
    bare = groups[SHEET].drop_vars("shear_angle")
    files = draw_stages(tmp_path, {**groups, SHEET: bare, HISTORY: history}, None, ())
    assert len(drawn) == 1 and [file.stem for file in files] == ["stage_1_draw_sections"]
    monkeypatch.undo()
    draw_animation(tmp_path / "film.gif", groups[SHEET], history, "shear_angle")
    with Image.open(tmp_path / "film.gif") as film:
        film.seek(1)  # the sheet on the dome
        pixels = np.asarray(film.convert("RGB")).astype(int)
    coloured = np.ptp(pixels[:, : int(0.8 * pixels.shape[1])], axis=-1) > 60  # left of the bar
    assert coloured.mean() > 0.03, "no film hides the fabric"


def test_faces_without_a_value_are_white():
    shown = SHOWN[0]
    values = np.array([0.0, np.nan, 1.0])
    assert shades_of(colour_scale(values, shown), values)[1].tolist() == [1.0, 1.0, 1.0, 1.0]


def test_what_lies_nearer_to_the_viewer_is_painted_later(groups):
    sheet = groups[SHEET]
    for view, first in ((FROM_ABOVE, 0), (oblique(from_below=True), 1)):
        plies = [sheet[PLY].values[faces] for faces in _from_back_to_front(sheet, view, -1)]
        assert [set(own) for own in plies] == [{first}, {1 - first}]


def test_the_start_shows_every_ply_once(scene, scene_of, tmp_path):
    plies = [(ply.name, ply.build_blank()) for ply in scene.stack]
    draw_stack(tmp_path / "initial.png", plies)
    assert imread(tmp_path / "initial.png")[..., :3].std() > 0.01
    many = [(f"{name}_{n}", mesh) for n in range(MOST_PLIES_SHOWN) for name, mesh in plies]
    shown, left_out = _shown_plies(many)
    assert ([number for number, *_ in shown], left_out) == ([1, 2], 2 * MOST_PLIES_SHOWN - 2)
    assert _shown_plies(plies)[1] == 0


def test_an_unrolled_line_tells_length_and_side():
    """A quarter of a circle: what lies on it becomes straight, what lies outside is above."""
    angle = np.linspace(0.0, 0.5 * np.pi, 2001)
    arc = 2.0 * np.column_stack([-np.cos(angle), np.sin(angle)])
    line = _Line(arc)
    assert line.length == pytest.approx(np.pi, rel=1e-6)
    on, outside, inside = (factor * arc[[500, 1000]] for factor in (1.0, 1.1, 0.9))
    along = [np.pi / 4, np.pi / 2]
    np.testing.assert_allclose(line.unrolled(on), np.column_stack([along, [0, 0]]), atol=1e-5)
    np.testing.assert_allclose(line.unrolled(outside)[:, 1], 0.2, atol=1e-5)
    np.testing.assert_allclose(line.unrolled(inside)[:, 1], -0.2, atol=1e-5)
    back = line.places(np.array(along), np.array([0.2]))[0]
    np.testing.assert_allclose(back, outside, atol=2e-3)


def test_a_section_is_unrolled_along_the_ply_that_covers_most_of_it():
    """Not along a patch below the others, whose length shows nothing of these."""

    def strip(start, end, z):
        x = np.linspace(start, end, 5)
        return tuple(np.column_stack([x, 0.0 * x, 0.0 * x + z + side]) for side in (-5e-4, 5e-4))

    plane = Plane.through(np.zeros(3), np.array([0.0, 1.0, 0.0]))
    patch, base, upper = strip(0.02, 0.05, 0.0), strip(-0.1, 0.1, 1e-3), strip(-0.102, 0.102, 2e-3)
    plies = [("patch", [patch]), ("base", [base]), ("upper", [upper])]
    name, found, line = _base_of(plane, plies)
    assert name == "base", "of plies as long as each other, but for a bend, the lowest"
    assert found is base and line.length == pytest.approx(0.2)
    assert _base_of(plane, plies[::2])[0] == "upper"
    assert _base_of(plane, [("patch", [])]) is None


def test_the_view_of_the_report_knows_the_plies(groups):
    view = view_data(groups[SHEET])
    lower, upper = view["plies"]
    assert (lower["name"], upper["name"]) == ("ply_1", "ply_2")
    assert lower["faces"][0] == lower["nodes"][0] == 0
    assert lower["faces"][1] == upper["faces"][0]
    assert lower["nodes"][1] == upper["nodes"][0]
    assert upper["faces"][1] == groups[SHEET].sizes["sheet_face"]
