"""A ply in several courses: their joints on developable and curved surfaces, and their files.

On a plane and on a developable surface courses lie as their strips do in the flat blank. On a
sphere of radius R the middle lines of two strips of width w are great circles that begin w apart
and meet a quarter of the circle on; at the length s the facing edges overlap by about

    2 R asin(½ sin 2b (1 - cos(s/R))),  b = w/2R,

since an edge lies w/2 from its middle line, and the joint's middle under the longitude b.
"""

import csv
import json
import warnings

import numpy as np
import pytest
from draped_tools import CYLINDER, DOME, PLATE, PRE_SHEAR, RADIUS, text_of

from lcmchain.check import check_scene
from lcmchain.draping import drape
from lcmchain.draping.courses import joints_of
from lcmchain.errors import InputError
from lcmchain.fields import read_forming
from lcmchain.pattern.tables import rim_table
from lcmchain.pipeline import run
from lcmchain.scene import on_rung, scene_from_text

HEAD = 'title = "courses"\nelement = "kinematic"\n'
STRIP = 'blank.size=["60 mm", "48 mm"]'


def course(name, low, high, more=""):
    return f'{{name="{name}", strip=["{low} mm", "{high} mm"]{more}}}'


def courses(*entries):
    return f"draping.courses=[{', '.join(entries)}]"


BUTT = courses(course("left", -24, -4), course("middle", -4, 6), course("right", 6, 24))
LAPPED = courses(course("left", -24, 2), course("right", -4, 24))


def scene(tool, *overrides):
    return scene_from_text(HEAD + text_of(tool, edge=2), overrides=(STRIP, *overrides))


def joints(tool, *overrides):
    return joints_of(drape(scene(tool, *overrides)).courses)


@pytest.mark.parametrize("tool", [PLATE, CYLINDER])
@pytest.mark.parametrize("more", [(), (PRE_SHEAR,), ("draping.angle=30 deg",)])
def test_butt_joints_stay_closed_on_developable_surfaces(tool, more):
    """Also of nets that begin sheared, or turned on the cylinder."""
    found = joints(tool, BUTT, *more)
    assert [(joint.below, joint.above) for joint in found] == [
        ("left", "middle"),
        ("middle", "right"),
    ]
    for joint in found:
        known = joint.gap[np.isfinite(joint.gap)]
        assert known.size >= 29 and np.abs(known).max() < (1e-12 if tool is PLATE else 1.5e-5)


@pytest.mark.parametrize("tool", [PLATE, CYLINDER])
def test_an_overlap_is_that_of_the_strips_there(tool):
    """A net that begins sheared brings the edges nearer to each other by its cosine."""
    for more, width in (((), 6e-3), ((PRE_SHEAR,), 6e-3 * np.cos(np.radians(20.0)))):
        (joint,) = joints(tool, LAPPED, *more)
        assert joint.nominal == pytest.approx(-6e-3)
        gap = joint.gap[np.isfinite(joint.gap)]
        assert gap.size >= 29
        # across the cylinder it is a chord of the arc
        assert np.allclose(gap, -width, atol=1e-12 if tool is PLATE else 2e-5)


def test_fibres_across_the_blank_s_axes_are_cut_along_them():
    found = drape(
        scene(PLATE, "blank.fibre_angle=35 deg", courses(course("a", -60, 5), course("b", 5, 60)))
    )
    assert found.mesh.element_areas.sum() == pytest.approx(60e-3 * 48e-3, rel=1e-3)
    across = found.mesh.node_positions[:, :2] @ [-np.sin(np.radians(35)), np.cos(np.radians(35))]
    lower = np.unique(found.mesh.elements[found.course_of_face == 0])
    upper = np.unique(found.mesh.elements[found.course_of_face == 1])
    assert across[lower].max() == pytest.approx(5e-3, abs=1e-9)
    assert across[upper].min() == pytest.approx(5e-3, abs=1e-9)
    assert np.allclose(found.positions[:, :2], found.mesh.node_positions[:, :2], atol=1e-12)


def test_on_a_sphere_strips_overlap_as_great_circles_meet():
    narrow = courses(*(course(f"c{n}", -24 + 4 * n, -20 + 4 * n) for n in range(12)))
    found = joints(DOME, narrow)
    assert len(found) == 11
    half = 2e-3 / RADIUS
    for joint in found:
        lapped = 2.0 * RADIUS * np.arcsin(
            0.5 * np.sin(2.0 * half) * (1.0 - np.cos(joint.along / RADIUS))
        )  # fmt: skip
        assert np.allclose(-joint.gap, lapped, rtol=5e-3, atol=2e-7)
        assert lapped.max() > 0.3e-3


def test_a_course_that_is_turned_opens_a_gap():
    """Turned about its seed: the distance from its edge grows with the way along it."""
    turn = np.radians(4.0)
    (joint,) = joints(PLATE, courses(course("a", -24, 4), course("b", 4, 24, ', angle="4 deg"')))
    away = joint.along * np.sin(turn) + 10e-3 * (np.cos(turn) - 1.0)
    known = np.isfinite(joint.gap)
    assert known.sum() >= 28
    assert np.allclose(joint.gap[known], away[known], atol=1e-12)
    assert joint.extremes[0] < -1e-3 and joint.extremes[1] > 1e-3
    assert joint.in_words().startswith("overlap up to 1.98 mm and gap up to 2.07 mm")


def test_a_course_begins_where_it_is_told():
    placed = drape(scene(PLATE, courses(
        course("a", -24, 0),
        course("b", 0, 24, ', seed=["6 mm", "0 mm"], place=["6 mm", "3 mm", "0 mm"], '
               'pre_shear="10 deg"'),
    )))  # fmt: skip
    assert np.allclose(placed.courses[1].start.place[:2], [6e-3, 3e-3])
    (joint,) = joints_of(placed.courses)
    assert np.allclose(joint.gap[np.isfinite(joint.gap)], 3e-3, atol=1e-12)
    shear = placed.shear_angle
    assert np.allclose(shear[placed.course_of_face == 0], 0.0, atol=1e-12)
    assert np.allclose(shear[placed.course_of_face == 1], np.radians(10.0), atol=1e-12)


def test_a_course_follows_a_line_of_its_own():
    line = ", ".join(
        f'["{x} mm", "{12 + 0.002 * x * x:.6f} mm", "0 mm"]' for x in range(-32, 33, 4)
    )
    found = drape(
        scene(PLATE, courses(course("a", -24, 0), course("b", 0, 24, f", start_line=[{line}]")))
    )
    own = found.courses[1]
    middle = own.net_places[:, np.argmin(np.abs(own.net_places[15, :, 1] - 12e-3))]
    assert np.allclose(middle[:, 1], 12e-3 + 2.0 * middle[:, 0] ** 2, atol=1e-9)
    assert np.allclose(found.shear_angle[found.course_of_face == 0], 0.0, atol=1e-12)
    assert np.degrees(found.shear_angle.max()) > 5.0


# --- files ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return run(scene(DOME, BUTT), tmp_path_factory.mktemp("courses"))


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_run_tells_courses_and_gaps_in_its_fields(result):
    sheet = read_forming(result.folder / "forming.nc")
    numbers = sheet["course"].values[-1]
    assert sheet["course"].attrs["flag_meanings"] == "left middle right"
    areas = [(numbers == n).sum() * 4e-6 for n in range(3)]
    assert np.allclose(areas, [60e-3 * w for w in (20e-3, 10e-3, 18e-3)])
    gap = sheet["joint_gap"].values
    first, second = joints_of(drape(scene(DOME, BUTT)).courses)
    assert np.allclose(gap[-1, first.nodes], first.gap, equal_nan=True)
    assert np.allclose(gap[-1, second.nodes], second.gap, equal_nan=True)
    assert np.isfinite(gap[0]).sum() == first.nodes.size + second.nodes.size
    assert not any("passes through itself" in text for text in result.summary["warnings"])
    with pytest.raises(InputError, match="several courses"):
        rim_table(sheet)


def test_tables_and_flat_patterns_stand_beside_them(result):
    rows = rows_of(result.folder / "draping.csv")
    assert [row["name"] for row in rows] == ["left", "middle", "right"]
    assert np.allclose([float(row["width [m]"]) for row in rows], [20e-3, 10e-3, 18e-3])
    assert np.allclose([float(row["area [m2]"]) for row in rows], [12e-4, 6e-4, 10.8e-4])
    shear = result.datasets["/"]["shear_angle"].values[-1]
    largest = max(float(row["largest shear angle [rad]"]) for row in rows)
    assert largest == pytest.approx(shear.max())
    table = rows_of(result.folder / "joints.csv")
    assert {row["below"] for row in table} == {"left", "middle"}
    told = json.loads((result.folder / "summary.json").read_text())["draping"]
    assert told["courses"] == ["left", "middle", "right"]
    least = min(float(row["gap [m]"]) for row in table if row["below"] == "left")
    assert told["joints"][0]["gap_min_m"] == pytest.approx(least) and least < -0.5e-3
    line = np.loadtxt(result.folder / "course_middle.csv", delimiter=",", skiprows=1)
    assert np.allclose(sorted(map(tuple, line)), [(-0.03, -0.004), (-0.03, 0.006),
                                                  (0.03, -0.004), (0.03, 0.006)])  # fmt: skip
    names = {path.name for path in result.folder.iterdir()}
    assert {"course_left.dxf", "courses.png", "shear_angle.png", "report.html"} <= names


def test_a_ply_of_one_piece_has_a_table_too(tmp_path):
    quiet = ("output.pictures=false", "output.report=false")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        one = run(scene(PLATE, PRE_SHEAR, *quiet), tmp_path)
    (row,) = rows_of(tmp_path / "draping.csv")
    assert float(row["mean shear angle [rad]"]) == pytest.approx(np.radians(20.0))
    assert float(row["shear angle at the seed [rad]"]) == pytest.approx(np.radians(20.0))
    assert "course" not in one.datasets["/"] and not (tmp_path / "joints.csv").exists()
    thickness = one.datasets["/"]["thickness"].values
    assert np.allclose(thickness[-1] * np.cos(np.radians(20.0)), thickness[0], rtol=1e-12)


def test_check_tells_the_joints_in_millimetres_on_any_rung():
    for rung in ("kinematic", "solid-shell"):
        rows = dict(check_scene(on_rung(scene(PLATE, LAPPED), rung)).preview)
        told = rows["joint of left and right"]
        assert told == "overlap of 6.00 mm; overlap of 6.00 mm in the flat blank"


@pytest.mark.parametrize(
    ("entries", "key", "words"),
    [
        ([courses(course("a", 0, 0))], "strip", "must end at a larger distance"),
        ([courses(course("a", -24, 0), course("a", 0, 24))], "name", "another course too"),
        ([courses(course("a", 0, 24), course("b", -24, 0))], "strip", "does not lie beyond"),
        ([courses(course("a", -24, 0), course("b", 3, 24))], "strip", "3 mm beyond the end"),
        ([courses(course("a", -24, 0))], "draping.courses", "50.0% of the blank without a course"),
        ([courses(course("a", -24, 24), course("b", 30, 40))], "strip", "6 mm beyond the end"),
        ([courses(course("a", -24, 24), course("b", 24, 30))], "strip", "cuts no piece"),
        (
            [courses(course("a", -24, 24, ', seed=["0 mm", "40 mm"]'))],
            "seed",
            "outside of the strip",
        ),
        (
            [courses(course("a", -24, 24)), 'blank.slits=[[["0 mm", "0 mm"], ["9 mm", "0 mm"]]]'],
            "draping.courses",
            "without holes, darts and slits",
        ),
        (
            [
                courses(course("a", -24, 24)),
                'draping.start_line=[["0 mm", "0 mm", "0 mm"], ["9 mm", "0 mm", "0 mm"]]',
            ],
            "start_line",
            "give each course its own",
        ),
    ],
)
def test_wrong_courses_are_refused_by_name(entries, key, words):
    with pytest.raises(InputError, match=words) as error:
        drape(scene(PLATE, *entries))
    assert key in f"{error.value}"


def test_resin_does_not_cross_joints_and_such_a_filling_is_refused():
    filling = (
        'permeability={law="gebart", fibre_radius="3.5 um"}',
        'infiltration={resin={law="constant", viscosity="0.1 Pa*s"}, time="1 s", '
        'vents=[{name="out", rim=true}], gates=[{name="in", pressure="1 bar", '
        'box=[["-31 mm", "-25 mm", "-9 mm"], ["-29 mm", "25 mm", "9 mm"]]}]}',
    )
    scene(PLATE, *filling)  # a ply of one piece is filled
    with pytest.raises(InputError, match="resin would not cross") as error:
        scene(PLATE, BUTT, *filling)
    assert "infiltration" in f"{error.value}"
