"""A blank that is laid in courses: its pieces, their joints, and what readers make of them.

Nothing is formed here: strips are laid by hand, so that every gap is known.
"""

import meshio
import numpy as np
import pytest
import xarray as xr
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lcmchain.check import check_scene
from lcmchain.draping import drape
from lcmchain.errors import InputError
from lcmchain.fields.courses import joint_gaps, joint_nodes, joint_widths
from lcmchain.fields.stack import ply_sheet
from lcmchain.judgements.crossings import joint_warnings
from lcmchain.mapping import MappingOptions, map_file
from lcmchain.mesh.courses import Courses, outlines_of
from lcmchain.mesh.mid_surface import MidSurfaceMesh, triangulate
from lcmchain.scene import on_rung, scene_from_text

SCENE = """
title = "strips"
[process]
time = "10 ms"
frames = 2
[blank]
size = ["60 mm", "48 mm"]
edge_length = "2 mm"
{more}
[material]
preset = "MD600"
"""
JOINTS = 'courses = { joints = ["-4 mm", "6 mm"] }'
TOOL = """
[draping]
surface = "tool"
[[tools]]
name = "tool"
position = "0 0 -20 mm"
shape = { type = "plate", side = "below" }
"""
#: Edges of the strips across fibre 1 [m].
EDGES = (-24e-3, -4e-3, 6e-3, 24e-3)


def scene_of(more=JOINTS, *overrides, tail=""):
    return scene_from_text(SCENE.format(more=more) + tail, overrides=overrides)


def mesh_of(more=JOINTS):
    return scene_of(more).stack[0].build_blank()


def pieces_of(faces):
    """Number of pieces that hang together."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    count = faces.max() + 1
    graph = coo_array((np.ones(len(ends)), ends.T), shape=(count, count))
    return connected_components(graph, directed=False)[0]


def test_the_rim_of_a_turned_blank_gives_its_courses_no_corner_twice():
    for width in (60e-3, 80e-3, 80.00009e-3):
        rim = 0.5 * np.array([[-width, -0.05], [width, -0.05], [width, 0.05], [-width, 0.05]])
        for angle in range(-90, 91, 3):
            for outline in outlines_of(rim, np.radians(angle), Courses(joints=(1e-3,))):
                sides = np.roll(outline, -1, axis=0) - outline
                assert np.hypot(*sides.T).min() > 1e-6
                assert len(outline) == 4 or angle % 90 != 0, "a corner within a straight side"


# --- the mesh -------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 35.0, 90.0])
def test_each_course_is_a_piece_between_its_joints_and_together_they_are_the_blank(angle):
    mesh = mesh_of(f'{JOINTS}\nfibre_angle = "{angle} deg"')
    assert mesh.area == pytest.approx(60e-3 * 48e-3, rel=1e-12 if angle != 35.0 else 2e-3)
    assert pieces_of(mesh.faces) == 3 and np.unique(mesh.faces).size == mesh.pair_count
    across = mesh.mid_surface_positions @ mesh.fibre_direction_2[0]
    for number in range(3):
        own = across[np.unique(mesh.faces[mesh.course == number])]
        if number > 0:
            assert own.min() == pytest.approx(EDGES[number], abs=1e-12)
        if number < 2:
            assert own.max() == pytest.approx(EDGES[number + 1], abs=1e-12)
    # the top face lies over the bottom one, as of any blank
    up = mesh.node_positions[mesh.pair_count :] - mesh.node_positions[: mesh.pair_count]
    assert np.allclose(up, [0.0, 0.0, mesh.thickness], atol=1e-15)
    assert (mesh.elements[:, 4:] == mesh.faces + mesh.pair_count).all()
    assert mesh.step_ratio < 1.2  # elements beside a joint are whole


def test_a_blank_of_one_piece_has_no_courses():
    mesh = mesh_of("")
    assert mesh.course is None and MidSurfaceMesh.of_blank(mesh).course is None
    assert joint_nodes(mesh) == []


def test_a_gap_is_left_open_half_on_either_side():
    mesh = mesh_of('courses = { joints = ["3 mm"], gap = "1 mm" }')
    assert mesh.area == pytest.approx(60e-3 * 47e-3, rel=1e-12)
    gaps = joint_gaps(mesh, mesh.mid_surface_positions[None])
    known = np.isfinite(gaps[0])
    assert known.sum() == 31 and np.allclose(gaps[0, known], 1e-3, atol=1e-12)
    assert np.allclose(mesh.mid_surface_positions[known, 1], 2.5e-3, atol=1e-12)


def test_plies_of_a_stack_have_courses_of_their_own_and_a_layup_shares_them():
    layup = scene_of(JOINTS, 'layup="[0/90, 45/-45]"').stack
    for ply in layup:
        mesh = ply.build_blank()
        assert mesh.course.max() == 2
        across = mesh.mid_surface_positions @ mesh.fibre_direction_2[0]
        low = across[np.unique(mesh.faces[mesh.course == 1])].min()
        assert low == pytest.approx(-4e-3, abs=1e-12)  # across its own fibres
    plies = """
    process = { time = "10 ms" }
    material = { preset = "MD600" }
    [[plies]]
    size = ["60 mm", "48 mm"]
    center = ["5 mm", "7 mm"]
    edge_length = "4 mm"
    fibre_angle = "90 deg"
    courses = { joints = ["10 mm"] }
    """
    (ply,) = scene_from_text(plies).stack
    mesh = ply.build_blank()
    # fibre 2 points along -x, the origin of the ply lies at 5 mm: the joint at -10 + 5 mm
    upper = joint_nodes(mesh)[0].upper
    assert np.allclose(mesh.mid_surface_positions[upper, 0], -5e-3, atol=1e-12)
    assert ply.strips["strip_1"] == pytest.approx((-35e-3, 5e-3))


@pytest.mark.parametrize(
    ("more", "key", "words"),
    [
        ('courses = { joints = ["6 mm", "-4 mm"] }', "joints[1]", "leaves no course above"),
        ('courses = { joints = ["1 mm", "2 mm"], gap = "1 mm" }', "joints[1]", "leaves no course"),
        ("courses = { joints = [] }", "joints", "at least 1"),
        ('courses = { joints = ["24 mm"] }', "joints[0]", "leaves no course beside it"),
        ('courses = { joints = ["23 mm"] }', "joints", "strip_2, which cannot be meshed"),
        (
            f'{JOINTS}\nslits = [[["-30 mm", "1 mm"], ["0 mm", "1 mm"]]]',
            "blank.courses",
            "without holes, darts and slits",
        ),
    ],
)
def test_courses_that_cannot_be_cut_are_refused_by_name(more, key, words):
    with pytest.raises(InputError) as caught:
        mesh_of(more)
    assert words in f"{caught.value}" and key in f"{caught.value}"


def test_an_outline_that_a_course_takes_two_pieces_of_is_refused():
    horns = '[["0 mm", "0 mm"], ["60 mm", "0 mm"], ["60 mm", "40 mm"], ["40 mm", "40 mm"], '
    horns += '["40 mm", "20 mm"], ["20 mm", "20 mm"], ["20 mm", "40 mm"], ["0 mm", "40 mm"]]'
    text = SCENE.replace('size = ["60 mm", "48 mm"]', f"outline = {horns}")
    text = text.format(more='courses = { joints = ["30 mm"] }')
    with pytest.raises(InputError, match="strip_2, from 30 to 40 mm along fibre 2, is not one"):
        scene_from_text(text).stack[0].build_blank()


# --- the joints of strips that are moved by hand --------------------------------------------------


def moved_strips(mesh, *ways):
    """Positions of the mid-surface with each course shifted (3,) [m]."""
    places = mesh.mid_surface(mesh.node_positions).copy()
    for number, way in enumerate(ways):
        own = np.unique(np.where(mesh.sheet_faces < 0, 0, mesh.sheet_faces)[mesh.course == number])
        places[own] += way
    return places


@pytest.mark.parametrize("kind", ["hexahedra", "faces", "triangles"])
def test_gaps_and_overlaps_are_those_of_the_strips(kind):
    mesh = mesh_of()
    change = {"hexahedra": lambda m: m, "faces": MidSurfaceMesh.of_blank, "triangles": triangulate}
    mesh = change[kind](mesh)
    away = moved_strips(mesh, (0, -3e-3, 0), (0, 0, 0), (0, -0.5e-3, 0))
    flat = moved_strips(mesh, *np.zeros((3, 3)))
    gaps = joint_gaps(mesh, np.stack([flat, away]))
    first, second = (joint.upper for joint in joint_nodes(mesh))
    assert first.size == second.size == 31
    assert np.allclose(gaps[0, [*first, *second]], 0.0, atol=1e-12)
    assert np.allclose(gaps[1, first], 3e-3, atol=1e-12)
    assert np.allclose(gaps[1, second], -0.5e-3, atol=1e-12)
    assert np.isfinite(gaps).sum() == 4 * 31


def test_a_strip_that_lifts_has_a_gap_and_one_that_slides_along_has_none():
    mesh = mesh_of()
    way = [(0, 0, 0), (4e-3, 0, 0), (4e-3, 0, 2e-3)]
    gaps = joint_gaps(mesh, moved_strips(mesh, *way)[None])[0]
    first, second = (joint.upper for joint in joint_nodes(mesh))
    known = np.isfinite(gaps[first])
    assert known.sum() == 29  # the last 4 mm of the edge face nothing
    assert np.allclose(gaps[first][known], 0.0, atol=1e-12)
    assert np.allclose(gaps[second], 2e-3, atol=1e-12)


@pytest.fixture
def shifted(placed_by_hand):
    """Make the groups of a result whose courses lie flat, then shifted."""

    def make(scene, *ways):
        return placed_by_hand(scene, lambda mesh: moved_strips(mesh, *ways))

    return make


WAYS = ((0, -3e-3, 0), (0, 0, 0), (0, -2e-3, 0))


def test_a_result_tells_courses_gaps_and_overlaps(shifted):
    sheet = shifted(scene_of(), *WAYS)["/"]
    assert sheet["course"].attrs["flag_meanings"] == "strip_1 strip_2 strip_3"
    assert [(sheet["course"].values[-1] == n).sum() for n in range(3)] == [300, 150, 270]
    open_, lapped = joint_widths(sheet)
    assert (open_.below, open_.above) == ("strip_1", "strip_2")
    assert [open_.flat, open_.least, open_.most] == pytest.approx([0.0, 3e-3, 3e-3], abs=1e-12)
    assert lapped.least == pytest.approx(-2e-3) and lapped.as_dict()["gap_max_m"] < 0.0
    assert lapped.place[1] == pytest.approx(6e-3)
    (told,) = joint_warnings(sheet, 1e-3)
    assert told.startswith("courses slide into each other: strip_2 and strip_3 overlap by up to 2 ")
    assert joint_warnings(sheet, 2.1e-3) == []


def test_a_stack_tells_them_for_each_ply(shifted):
    groups = shifted(scene_of(JOINTS, 'layup="[0/90, 90/0]"'), *WAYS)
    assert "course" not in groups["/"] and "joint_gap" not in groups["/"]
    widths = joint_widths(ply_sheet(groups, "ply_1"))
    assert [joint.most for joint in widths] == pytest.approx([3e-3, -2e-3])
    assert len(joint_widths(ply_sheet(groups, "ply_2"))) == 2


def mapped_over(groups, folder, **options):
    """Map onto cells of 1 mm around the joint at -4 mm; return their middles [mm] and the file."""
    x, y = np.meshgrid(np.arange(-10, 11) * 1e-3, np.arange(-20, 6) * 1e-3, indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    cells = np.stack([part.ravel() for part in corners], axis=1)
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    meshio.Mesh(points, [("quad", cells)]).write(folder / "target.vtu")
    options = MappingOptions(allow_unmapped=True, **options)
    map_file(groups["/"], folder / "target.vtu", folder / "mapped.nc", options)
    return 1e3 * points[cells].mean(axis=1)[:, 1], xr.load_dataset(folder / "mapped.nc")


@pytest.mark.parametrize("gap", [3e-3, 0.4e-3])
def test_an_open_joint_covers_nothing_of_a_mesh(gap, shifted, tmp_path):
    groups = shifted(scene_of(), (0, -gap, 0), (0, 0, 0), (0, 0, 0))
    middle, mapped = mapped_over(groups, tmp_path)
    over = np.clip(middle + 0.5, None, -4.0) - np.clip(middle - 0.5, -4.0 - 1e3 * gap, None)
    assert np.allclose(mapped["mapping_coverage"], 1.0 - np.clip(over, 0.0, 1.0), atol=1e-9)
    # as at a rim, cells take the values of the sheet beside them
    full = groups["/"]["areal_fibre_mass"].values[0, 0]
    assert np.allclose(mapped["areal_fibre_mass"], full, rtol=1e-9)


def test_cells_further_from_the_strips_than_is_allowed_are_unmapped(shifted, tmp_path):
    groups = shifted(scene_of(), (0, -3e-3, 0), (0, 0, 0), (0, 0, 0))
    middle, mapped = mapped_over(groups, tmp_path, maximum_distance=1e-4)
    in_gap = (middle > -7.0) & (middle < -4.0)
    assert np.array_equal(np.isnan(mapped["areal_fibre_mass"].values), in_gap)


# --- what else knows them -------------------------------------------------------------------------


def test_check_lists_courses_and_its_preview_lays_the_whole_ply():
    report = check_scene(scene_of(tail=TOOL))
    whole = check_scene(scene_of("", tail=TOOL))
    rows = [[what for what, _ in found.preview] for found in (report, whole)]
    assert rows[0] == rows[1] and "largest shear angle" in rows[0]  # no joints of strips laid
    (table,) = (t for t in report.tables() if str(t.title).startswith("Courses"))
    columns = [list(column.cells) for column in table.columns]
    assert columns[0] == ["strip_1", "strip_2", "strip_3"]
    assert columns[3] == ["20 mm", "10 mm", "18 mm"] and "butt joints" in str(table.title)


def test_a_net_follows_the_courses_of_the_ply():
    by_ply = drape(on_rung(scene_of(tail=TOOL), "kinematic"))
    strips = ", ".join(
        f'{{name="{name}", strip=["{low} mm", "{high} mm"]}}'
        for name, low, high in (("a", -24, -4), ("b", -4, 6), ("c", 6, 24))
    )
    of_net = drape(on_rung(scene_of("", f"draping.courses=[{strips}]", tail=TOOL), "kinematic"))
    assert np.array_equal(by_ply.positions, of_net.positions)
    assert [net.name for net in by_ply.courses] == ["strip_1", "strip_2", "strip_3"]


FILLED = (
    'permeability={law="gebart", fibre_radius="3.5 um"}',
    'infiltration={resin={law="constant", viscosity="0.1 Pa*s"}, time="1 s", '
    'vents=[{name="out", rim=true}], gates=[{name="in", pressure="1 bar", '
    'box=[["-31 mm", "-25 mm", "-9 mm"], ["-29 mm", "25 mm", "9 mm"]]}]}',
)


@pytest.mark.parametrize(
    ("overrides", "key", "words"),
    [
        (FILLED, "infiltration", "resin would not cross"),
        (
            ('grippers=[{name="g", rim=true, count=4, force="1 N", outward=true}]',),
            'grippers[0] "g".rim',
            "several pieces with a rim each",
        ),
        (
            ('draping.courses=[{name="a", strip=["-24 mm", "24 mm"]}]',),
            "draping.courses",
            "leave one of them out",
        ),
    ],
)
def test_what_needs_one_piece_is_refused(overrides, key, words):
    scene_of("", *overrides)  # of a ply of one piece it is allowed
    with pytest.raises(InputError, match=words) as caught:
        scene_of(JOINTS, *overrides)
    assert caught.value.key == key
