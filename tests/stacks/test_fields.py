"""Fields of a stack in a result: columns through the plies, plies by themselves, VTU, summary."""

from dataclasses import replace

import meshio
import numpy as np
import pytest

from lcmchain.fields import FrameSeries, write_vtu
from lcmchain.fields.dataset import SHEET, LaidSheet, SheetFrames, sheets_datasets
from lcmchain.fields.sheet import sheet_areas, sheet_positions
from lcmchain.fields.stack import PLY, StackedPly, columns_of, plies_of, ply_names, ply_sheet
from lcmchain.fields.summary import field_summary, stack_summary
from lcmchain.fields.wrinkles import lifted_off
from lcmchain.mesh.mid_surface import MidSurfaceMesh
from lcmchain.report.numbers import key_numbers, ply_numbers
from lcmchain.tools import build_tool_table

SCENE = """
material = { preset = "MD600" }
[[plies]]
size = ["160 mm", "160 mm"]
edge_length = "8 mm"
[[plies]]
size = ["60 mm", "60 mm"]
edge_length = "5 mm"
center = ["20 mm", "0 mm"]
fibre_angle = "30 deg"
name = "patch"
[[plies]]
size = ["160 mm", "160 mm"]
edge_length = "10 mm"
fibre_angle = "45 deg"
"""
T = 1.004e-3  # of MD600 [m]
#: Thickness of the laid plies over the initial one, see conftest.
PRESSED = 0.9


@pytest.fixture(scope="module")
def scene(scene_of):
    return scene_of(SCENE)


@pytest.fixture(scope="module")
def groups(scene, laid):
    return laid(scene)


def patch_covers(sheet):
    """Faces whose centres lay over the patch, those within 0.1 mm of its rim left out."""
    centres = sheet_positions(sheet, 0)[sheet["sheet_face_nodes"].values[:, :3]].mean(axis=1)
    off = np.abs(centres[:, :2] - [0.02, 0.0]).max(axis=1)
    return off < 0.0299, off > 0.0301


@pytest.mark.parametrize("frame", [0, 1])
def test_columns_add_up_what_lies_over_each_other(groups, frame):
    """Flat and on the dome, whose normals meet the plies under and over each place."""
    sheet = groups[SHEET]
    inside, outside = patch_covers(sheet)
    rim = np.isclose(np.abs(sheet_positions(sheet, 0)).max(), 0.08)
    assert rim
    count = sheet["stack_ply_count"].values[frame]
    plies = sheet[PLY].values
    # at the rim of the dome normals of facets may pass the other ply
    centres = sheet_positions(sheet, 0)[sheet["sheet_face_nodes"].values[:, :3]].mean(axis=1)
    away = np.abs(centres[:, :2]).max(axis=1) < 0.07
    on_patch = plies == 1
    np.testing.assert_array_equal(count[on_patch], 3.0)
    large = away & ~on_patch
    thrice, twice = count[large & inside], count[large & outside]
    assert (thrice == 3.0).mean() > 0.95
    assert (twice == 2.0).mean() > 0.98
    thickness = sheet["stack_thickness"].values[frame]
    np.testing.assert_allclose(thickness, count * T * (PRESSED if frame else 1.0), rtol=1e-12)


def test_the_fibre_volume_fraction_of_a_stack_is_that_of_all_fibres_in_all_thickness(groups):
    sheet = groups[SHEET]
    mass = sheet["stack_areal_fibre_mass"].values
    expected = mass / 1810.0 / sheet["stack_thickness"].values
    np.testing.assert_allclose(sheet["stack_fibre_volume_fraction"], expected, rtol=1e-12)
    np.testing.assert_allclose(mass[0], 0.6 * sheet["stack_ply_count"].values[0], rtol=1e-12)


def flat_ply(size, height, thickness, mass=1.0, density=2000.0, corner=0.0):
    """One square face at a height."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * size + corner
    return StackedPly(
        faces=np.array([[0, 1, 2, 3]]),
        positions=np.column_stack([corners, np.full(4, height)])[None],
        thickness=None if thickness is None else np.array([[thickness]]),
        initial_thickness=thickness or 1e-3,
        areal_mass=np.array([[mass]]),
        fibre_density=density,
    )


def test_different_fabrics_count_by_their_own_density():
    (below, _) = columns_of(
        [flat_ply(1.0, 0.0, 1e-3, 1.0, 2000.0), flat_ply(1.0, 1e-3, 3e-3, 2.0, 1000.0)]
    )
    assert below.thickness[0, 0] == pytest.approx(4e-3)
    assert below.areal_mass[0, 0] == pytest.approx(3.0)
    assert below.fibre_volume_fraction[0, 0] == pytest.approx((1 / 2000 + 2 / 1000) / 4e-3)


def test_a_ply_that_ends_beside_a_face_or_lies_far_off_is_not_counted():
    base = flat_ply(1.0, 0.0, 1e-3)
    beside, far, near = (
        flat_ply(1.0, 1e-3, 1e-3, corner=0.51),
        flat_ply(1.0, 0.1, 1e-3),
        flat_ply(1.0, -1.9e-3, 1e-3),
    )
    assert columns_of([base, beside])[0].ply_count[0, 0] == 1
    assert columns_of([base, far])[0].ply_count[0, 0] == 1
    assert columns_of([base, near])[0].ply_count[0, 0] == 2


def test_a_ply_without_thickness_leaves_the_count_and_the_mass():
    below, above = columns_of([flat_ply(1.0, 0.0, 1e-3), flat_ply(1.0, 1e-3, None)])
    for columns in (below, above):
        assert columns.thickness is None
        assert columns.fibre_volume_fraction is None
        assert (columns.ply_count[0, 0], columns.areal_mass[0, 0]) == (2, 2.0)


def test_columns_tell_on_which_side_of_a_ply_the_others_lie():
    plies = [flat_ply(1.0, 3e-4 * level, 1e-4 * (level + 1)) for level in range(3)]
    plies[0] = replace(plies[0], is_film=True)
    beside = [(c.below[0, 0], c.above[0, 0]) for c in columns_of(plies)]
    np.testing.assert_allclose(beside, [(0.0, 5e-4), (1e-4, 3e-4), (3e-4, 0.0)], atol=1e-15)
    later = replace(plies[2], there=np.array([False]))
    assert columns_of([*plies[:2], later])[1].above[0, 0] == 0.0


def test_a_ply_between_another_and_a_tool_leaves_no_room_for_a_wrinkle(scene_of):
    """Both plies wave alike, their crests 0.3 mm above the plate: so high are the wrinkles."""
    amplitude, room = 1e-3, 0.3e-3
    scene = scene_of(
        'layup = "[0/90, 0/90]"\nmaterial = { preset = "MD600" }\n'
        'blank = { size = ["120 mm", "40 mm"], edge_length = "4 mm" }\n'
        '[[tools]]\nname = "plate"\nshape = { type = "plate", side = "below" }\n'
    )
    tools = build_tool_table(scene.tools, None, 0.01)
    sheets, positions = {}, []
    for level, ply in enumerate(scene.stack):
        mesh = MidSurfaceMesh.of_blank(ply.build_blank())
        waves = mesh.node_positions.copy()
        waves[:, 2] = room + (level + 0.5) * T
        waves[:, 2] -= amplitude * (1.0 - np.cos(2.0 * np.pi * waves[:, 0] / 0.04))
        both = np.stack([waves, waves])
        lifted = lifted_off(mesh, both, 0.05, tools=tools, travel=np.zeros((2, 1)))
        given = {"thickness": np.full((2, mesh.element_count), T)}
        none = np.empty((2, 0, mesh.element_count))
        sheets[ply.name] = SheetFrames(
            LaidSheet(mesh, ply.built_material()), both, none, given, None, lifted, 0.05
        )
        positions.append(both)
    frames = FrameSeries(np.array([0.0, 0.01]), np.concatenate(positions, axis=1),
                         np.zeros((2, 1)), np.zeros((2, 1, 3)), tool_names=("plate",))  # fmt: skip
    groups = sheets_datasets(scene, sheets, frames)
    for name, own in plies_of(groups):
        height = own[SHEET]["wrinkle_height"].values[-1]
        crests = np.isclose(np.abs(sheets[name].mesh.node_positions[:, 0]), 0.04)
        assert height[crests] == pytest.approx(room, abs=0.05 * T), name
    assert sheets["ply_2"].wrinkles.height.max() == pytest.approx(amplitude, rel=0.1)


def test_every_ply_reads_as_a_result_with_one_sheet(groups, scene):
    assert ply_names(groups[SHEET]) == ("ply_1", "patch", "ply_3")
    whole = groups[SHEET]
    for number, (name, own) in enumerate(plies_of(groups)):
        faces = whole[PLY].values == number
        sheet = own[SHEET]
        np.testing.assert_allclose(sheet_areas(sheet), sheet_areas(whole)[faces])
        np.testing.assert_array_equal(sheet["shear_angle"], whole["shear_angle"].values[:, faces])
        assert ply_sheet(groups, name).identical(sheet)
    alone = {SHEET: own[SHEET], "/history": groups["/history"]}
    assert ply_names(alone[SHEET]) == ()
    assert list(plies_of(alone)) == []
    assert stack_summary(alone) == {}


def test_the_summary_tells_each_ply_and_the_stack(groups):
    found = stack_summary(groups)
    assert list(found["plies"]) == ["ply_1", "patch", "ply_3"]
    masses = [ply["fibre_mass_kg"] for ply in found["plies"].values()]
    assert masses == pytest.approx([0.6 * 0.16**2, 0.6 * 0.06**2, 0.6 * 0.16**2])
    stack = found["stack"]
    assert stack["ply_count"] == 3
    assert stack["fibre_mass_kg"] == pytest.approx(sum(masses))
    assert stack["thickness_max_m"] == pytest.approx(3 * PRESSED * T)
    largest = max(ply["shear_angle_max_rad"] for ply in found["plies"].values())
    assert found["plies"]["patch"]["shear_angle_max_rad"] < 0.5 * largest
    assert field_summary(groups)["shear_angle_max_rad"] == largest


def test_vtu_holds_all_plies_with_their_numbers(groups, tmp_path):
    write_vtu(tmp_path / "stack.vtu", groups)
    mesh = meshio.read(tmp_path / "stack.vtu")
    sheet = groups[SHEET]
    order = np.concatenate(mesh.cell_data["element"]).astype(int)
    assert sorted(order) == list(range(sheet.sizes["sheet_face"]))
    np.testing.assert_array_equal(np.concatenate(mesh.cell_data["ply"]), sheet[PLY].values[order])
    for name in ("shear_angle", "stack_thickness"):
        values = np.concatenate(mesh.cell_data[name])
        np.testing.assert_allclose(values, sheet[name].values[-1][order])
    assert PLY not in mesh.cell_data
    # each cell lies where its face does
    faces = sheet["sheet_face_nodes"].values
    middles = [mesh.points[block.data].mean(axis=1) for block in mesh.cells]
    corners = sheet_positions(sheet)[np.where(faces < 0, faces[:, :1], faces)]
    is_triangle = faces[:, 3] < 0
    expected = np.where(
        is_triangle[:, None], corners[:, :3].mean(axis=1), corners.mean(axis=1)
    )[order]  # fmt: skip
    np.testing.assert_allclose(np.concatenate(middles), expected, atol=1e-12)


def test_terminal_and_report_say_each_ply_and_the_stack(groups):
    summary = field_summary(groups) | stack_summary(groups)
    numbers = {number.name: number.in_words for number in key_numbers(summary)}
    assert numbers["Thickness of the stack"].startswith(f"{2e3 * PRESSED * T:.3f} to ")
    assert "Thickness of a ply" in numbers
    rows = {number.name: number.in_words for number in ply_numbers(summary)}
    assert list(rows) == ["Ply ply_1", "Ply patch", "Ply ply_3"]
    angle = np.degrees(summary["plies"]["patch"]["shear_angle_max_rad"])
    assert f"up to {angle:.1f} deg" in rows["Ply patch"]
    alone = field_summary({SHEET: ply_sheet(groups, "patch"), "/history": groups["/history"]})
    assert ply_numbers(alone) == []
    assert "Thickness" in [number.name for number in key_numbers(alone)]
