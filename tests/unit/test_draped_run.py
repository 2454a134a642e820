"""`element = "kinematic"` and the preview of check: choices, files, what is said and refused."""

import json
import warnings
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

from lcmchain.check import check_scene
from lcmchain.draping import drape, is_drapable
from lcmchain.draping.laid import fibre_coordinates, net_lines, places_between
from lcmchain.draping.net import PLACED
from lcmchain.draping.result import draped_datasets
from lcmchain.draping.start import seed_of
from lcmchain.draping.surface import draped_surface, level
from lcmchain.errors import InputError, SimulationError
from lcmchain.fields import fibre_mass, read_forming, sheet_positions
from lcmchain.mapping import map_file
from lcmchain.mesh.blank import build_blank
from lcmchain.pipeline import run
from lcmchain.scene import on_rung, read_scene, scene_from_text
from lcmchain.tools import build_tool_table

EXAMPLES = Path(__file__).parents[2] / "examples"
DOME = """
title = "dome"
element = "kinematic"
process = { time = "20 ms", frames = 3 }
blank = { size = ["60 mm", "60 mm"], edge_length = "2.5 mm", height = "0.502 mm" }
material = { preset = "MD600" }

[permeability]
law = "gebart"
fibre_radius = "3.5 um"

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "20 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "15 mm" }

[[tools]]
name = "die"
shape = { type = "plate_with_hole", hole_radius = "22 mm", fillet_radius = "6 mm", side = "below" }
"""
NO_FILES = ["output.pictures=false", "output.report=false"]


def scene(*overrides, text=DOME):
    return scene_from_text(text, None, overrides)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return run(scene("output.pictures=true"), tmp_path_factory.mktemp("draped"))


def test_a_run_leaves_the_files_of_a_forming_run(result):
    names = {path.name for path in result.folder.iterdir()}
    assert {"forming.nc", "forming.vtu", "forming.pvd", "report.html", "summary.json",
            "shear_angle.png", "thickness.png", "tools.png"} <= names  # fmt: skip
    assert not names & {"force.png", "energy.png", "force_over_travel.png"}
    sheet = read_forming(result.folder / "forming.nc")
    assert sheet.attrs["state"] == "complete"
    assert "constant volume" in sheet.attrs["comment"]
    assert "wrinkle_height" not in sheet
    mesh = meshio.read(result.folder / "forming.vtu")
    assert {block.type for block in mesh.cells} == {"quad"}


def test_thickness_keeps_the_volume_and_fibres_keep_their_length(result):
    sheet = result.datasets["/"]
    shear = sheet["shear_angle"].values[-1]
    thickness = sheet["thickness"].values[-1]
    assert np.degrees(np.abs(shear).max()) > 20.0
    assert np.allclose(sheet["thickness"].values[0], 1.004e-3)
    stretch = [1.0 + sheet[f"fibre_strain_{i}"].values[-1] for i in (1, 2)]
    assert np.allclose(thickness * np.cos(shear) * stretch[0] * stretch[1], 1.004e-3, rtol=1e-10)
    fraction = sheet["fibre_volume_fraction"].values
    assert np.allclose(fraction, 0.6 / (1810.0 * 1.004e-3), rtol=1e-3) and np.ptp(fraction) == 0.0
    assert fibre_mass(sheet) == pytest.approx(fibre_mass(sheet, 0), rel=1e-12)
    assert "permeability_1" in sheet


def test_the_summary_says_the_model_and_what_it_cannot_predict(result):
    summary = json.loads((result.folder / "summary.json").read_text())
    assert summary["model"] == "kinematic" and summary["state"] == "complete"
    assert summary["effects"][0] == "kinematic draping"
    assert "punch_force_max_N" not in summary and "energy" not in summary
    assert any("no forces, no wrinkles" in text for text in summary["warnings"])
    assert summary["draping"]["seed_place_m"][2] == pytest.approx(0.502e-3 - 15e-3)
    shear = np.abs(result.datasets["/"]["shear_angle"].values[-1]).max()
    assert summary["shear_angle_max_rad"] == pytest.approx(shear)


def test_the_result_is_mapped_like_that_of_a_simulation(result, tmp_path):
    sheet = result.datasets["/"]
    points = sheet_positions(sheet)
    faces = sheet["sheet_face_nodes"].values[100:300].astype(int)
    meshio.write(tmp_path / "target.vtu", meshio.Mesh(points, [("quad", faces)]))
    map_file(result.folder / "forming.nc", tmp_path / "target.vtu", tmp_path / "out.vtu",
             kind="infiltration")  # fmt: skip
    mapped = meshio.read(tmp_path / "out.vtu").cell_data
    assert np.allclose(
        mapped["shear_angle"][0], sheet["shear_angle"].values[-1][100:300], atol=2e-2
    )


# --- surface and seed -----------------------------------------------------------------------------


def test_the_sheet_lies_on_the_punch_and_in_the_plane_of_the_blank_beside_it():
    found = drape(scene())
    radius = np.linalg.norm(found.positions[:, :2], axis=1)
    flange = radius > 30e-3
    assert flange.any() and np.allclose(found.positions[flange, 2], 0.502e-3, atol=1e-12)
    centre = np.array([0.0, 0.0, 1.004e-3 - 15e-3 + 20e-3])
    pole = radius < 8e-3
    distance = np.linalg.norm(found.positions[pole] - centre, axis=1)
    assert np.allclose(distance, 20.502e-3, rtol=1e-10)
    assert "an edge of 6.502 mm" in found.surface


def test_the_edge_is_rounded_as_the_scene_says():
    sharp = drape(scene("draping.edge_radius=0 mm"))
    round_ = drape(scene("draping.edge_radius=5 mm"))
    assert sharp.is_whole and round_.is_whole
    assert sharp.positions[:, 2].max() == pytest.approx(0.502e-3, abs=1e-12)
    wall = draped_surface(
        scene("draping.edge_radius=5 mm"), round_.tools, round_.mesh.node_positions
    )
    values = [abs(level(wall, *point)[0]) for point in round_.positions[::7]]
    assert max(values) < 1e-12
    tangents = np.array([level(wall, *point)[1:] for point in round_.positions[::7]])
    assert np.linalg.norm(tangents, axis=1).min() > 0.5


def test_a_named_tool_is_draped_alone():
    found = drape(scene("draping.surface=die", 'draping.seed=["25 mm", "25 mm"]'))
    assert found.surface == "die"
    flat = np.linalg.norm(found.positions[:, :2], axis=1) > 29e-3
    assert np.allclose(found.positions[flat, 2], 0.502e-3, atol=1e-12)
    assert np.nanmin(found.positions[:, 2]) < 0.4e-3


def test_the_seed_is_where_the_punch_touches_first_or_where_the_scene_says():
    moved = scene('tools.punch.position=["4 mm", "2.5 mm", "1.004 mm"]')
    found = drape(moved)
    assert np.allclose(found.seed, [5e-3, 2.5e-3], atol=1.3e-3)
    given = drape(scene('draping.seed=["7 mm", "-3 mm"]'))
    assert np.allclose(given.seed, [7e-3, -3e-3])
    assert np.allclose(given.place[:2], given.seed, atol=1e-9)
    lines = net_lines(
        blank := build_blank(scene().blank, 1e-3), fibre_coordinates(blank, given.seed), 2.5e-3
    )
    assert lines.u[lines.i0] == 0.0 and lines.v[lines.j0] == 0.0


def test_the_net_turns_with_its_angle():
    straight, turned = drape(scene()), drape(scene("draping.angle=90 deg"))
    assert np.allclose(turned.positions[:, 0], -straight.positions[:, 1], atol=1e-12)
    assert np.allclose(np.abs(turned.shear_angle), np.abs(straight.shear_angle), atol=1e-9)


def test_nodes_between_lines_lie_on_the_surface_too():
    """An outline that no lattice fits has nodes between the lines of the net."""
    outline = '[["-30 mm", "-25 mm"], ["31 mm", "-28 mm"], ["22 mm", "30 mm"], ["-27 mm", "22 mm"]]'
    text = DOME.replace('size = ["60 mm", "60 mm"]', f"outline = {outline}")
    the_scene = scene(text=text)
    found = drape(the_scene)
    blank = build_blank(the_scene.blank, 1e-3)
    lines = net_lines(blank, coordinates := fibre_coordinates(blank, found.seed), 2.5e-3)
    _, between = places_between(lines, found.net_places, coordinates, 2.5e-3)
    assert between.any() and found.is_whole
    surface = draped_surface(the_scene, found.tools, found.mesh.node_positions)
    assert max(abs(level(surface, *point)[0]) for point in found.positions) < 1e-12


def test_surface_meshes_are_draped():
    the_scene = read_scene(EXAMPLES / "stl_tool" / "scene.toml")
    found = drape(the_scene)
    assert found.is_whole
    assert 25.0 < np.degrees(found.largest_shear()[0]) < 40.0
    for axis, lengths in enumerate(found.net_lengths):
        bars = np.linalg.norm(np.diff(found.net_places, axis=axis), axis=-1)
        wanted = lengths[:, None] if axis == 0 else lengths[None, :]
        assert np.abs(bars / wanted - 1.0).max() < 1e-10


# --- what cannot be draped ------------------------------------------------------------------------


def test_a_net_that_locks_says_where_and_a_run_of_it_fails(tmp_path):
    small = scene("tools.punch.shape.radius=8 mm", "tools.punch.motion.distance=60 mm",
                  "draping.surface=punch", *NO_FILES)  # fmt: skip
    found = drape(small)
    assert not found.is_whole and (found.net_status != PLACED).any()
    with pytest.raises(SimulationError, match="ends at the point .* bars lie on each other there"):
        found.require_whole()
    with pytest.raises(SimulationError, match="have no place"):
        run(small, tmp_path)
    assert json.loads((tmp_path / "summary.json").read_text())["state"].startswith("stopped")
    assert any("a run will fail" in text for text in check_scene(small).warnings)


def test_the_locking_angle_is_the_scene_s_else_the_material_s():
    assert drape(scene()).locking_angle == pytest.approx(np.radians(60.0))
    locking = "material.membrane.locking_angle=48 deg", "material.membrane.locking_stiffness=1 MPa"
    assert drape(scene(*locking)).locking_angle == pytest.approx(np.radians(48.0))
    low = drape(scene("draping.locking_angle=10 deg"))
    shear, areas = np.abs(low.shear_angle), low.mesh.element_areas
    expected = areas[shear > np.radians(10.0)].sum() / areas.sum()
    assert low.locked_part() == pytest.approx(expected) and 0.0 < expected < 1.0


@pytest.mark.parametrize(
    ("overrides", "key", "words"),
    [
        (["draping.surface=dye"], "draping.surface", 'no tool "dye"; there are punch, die'),
        (["tools=[]"], "draping.surface", "no shaped tool has a stroke"),
        (["tools.punch.motion.direction=[1, 0, 0]"], "draping.surface", "plane of the blank"),
        (["draping.surface=die"], "draping.seed", "has no place on the surface"),
    ],
)
def test_scenes_without_a_surface_are_refused(overrides, key, words):
    with pytest.raises(InputError, match=words) as error:
        drape(scene(*overrides))
    assert error.value.key == key


def test_a_tool_under_a_load_is_no_surface():
    guided = 'tools.die.motion={type="guided", direction=[0, 0, 1], force="5 N", mass="1 kg"}'
    with pytest.raises(InputError, match="moves under a load"):
        drape(scene("draping.surface=die", guided))


# --- check ----------------------------------------------------------------------------------------


def test_check_previews_any_model_with_the_net():
    shell = on_rung(scene(), "solid-shell")
    rows = dict(check_scene(shell).preview)
    worst = np.degrees(drape(shell).largest_shear()[0])
    assert rows["largest shear angle"].startswith(f"{worst:.1f} deg at (")
    assert rows["beyond 60 deg"] == "nothing"
    assert dict(check_scene(scene()).preview)["surface"] == rows["surface"]


def test_check_says_in_seconds_how_long_the_net_took(monkeypatch):
    """Compiling for the first time takes some of them."""

    def slowly(*arguments, **options):
        return replace(drape(*arguments, **options), wall_s=22.42)

    monkeypatch.setattr("lcmchain.check.report.drape", slowly)
    assert dict(check_scene(scene()).preview)["laid in"] == "22.4 s"


@pytest.mark.parametrize("back", [10.0, 0.0, -5.0])
def test_a_punch_that_is_drawn_back_has_formed_the_sheet_where_it_turned(back):
    """Whether it stops halfway, where it began, or beyond that on the other side."""
    table = (
        f'type = "table", direction = [0, 0, -1], times = "0 10 20 ms", travel = "0 15 {back} mm"'
    )
    returning = scene(f"tools.punch.motion={{ {table} }}")
    tools = build_tool_table(returning.tools, None, returning.process.time)
    assert is_drapable(returning, tools)
    formed, led = drape(returning), drape(scene())
    assert formed.surface == led.surface
    np.testing.assert_allclose(formed.positions, led.positions, atol=1e-12)


def test_what_the_net_does_not_reach_is_not_called_sheared():
    small = scene("tools.punch.shape.radius=8 mm", "tools.punch.motion.distance=60 mm",
                  "draping.surface=punch")  # fmt: skip
    draped, rows = drape(small), dict(check_scene(small).preview)
    unplaced, beyond = draped.unplaced_part(), draped.locked_part() - draped.unplaced_part()
    assert 0.05 < unplaced < 0.95 and beyond < draped.locked_part()
    assert rows["not laid"].startswith(f"{unplaced:.1%} of the area: the net of punch")
    assert rows["beyond 60 deg"] == f"{beyond:.1%} of the area"
    assert f"of the {1.0 - unplaced:.1%} of the area that it covers" in rows["largest shear angle"]


def test_an_open_mould_that_passes_all_of_the_blank_leaves_no_plane_around_it(tmp_path):
    """Behind an open surface is no solid: the blank's plane seemed free there, and was draped."""
    line = np.linspace(-0.04, 0.04, 33)
    x, y = (c.ravel() for c in np.meshgrid(line, line, indexing="ij"))
    points = np.stack([x, y, 0.008 * np.exp(-(x**2 + y**2) / 0.015**2)], axis=1)
    node = np.arange(len(points)).reshape(33, 33)
    quads = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], -1)
    triangles = quads[..., [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    meshio.Mesh(points, [("triangle", triangles)]).write(tmp_path / "mould.stl")
    mould = 'shape = {{ type = "surface_mesh", file = "mould.stl", length_unit = "m" }}\n{}'
    moving = 'motion = { type = "stroke", direction = [0, 0, -1], distance = "8 mm" }\n'
    text = DOME.split("[[tools]]")[0].replace('"0.502 mm"', '"8.6 mm"') + "".join(
        f'[[tools]]\nname = "{name}"\n' + mould.format(rest)
        for name, rest in (("lower", ""), ("upper", f'position = "0 0 9.2 mm"\n{moving}'))
    )
    closing = scene_from_text(text, tmp_path / "scene.toml")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        both = {
            name: drape(scene_from_text(text, tmp_path / "scene.toml", overrides))
            for name, overrides in (("upper", []), ("lower", ["draping.surface=lower"]))
        }
    assert closing.tools[1].name == "upper" and both["upper"].surface.startswith("upper at")
    assert "plane of the blank" not in both["upper"].surface
    angles = {name: np.degrees(found.largest_shear()[0]) for name, found in both.items()}
    assert angles["lower"] > 5.0 and angles["upper"] == pytest.approx(angles["lower"], rel=0.15)


def test_an_open_punch_drapes_as_the_solid_one_does(tmp_path):
    """Far behind the skin of a punch is no solid: the net began in the plane of the blank there."""
    way, around = np.meshgrid(np.linspace(0.0, 1.0, 33), np.linspace(0.0, 2 * np.pi, 49)[:-1])
    # pole to wall: a quarter of a circle, then straight up
    angle = np.minimum(2.0 * way, 1.0) * np.pi / 2
    rise = np.maximum(2.0 * way - 1.0, 0.0) * 0.02
    r, z = 0.02 * np.sin(angle), 0.02 * (1.0 - np.cos(angle)) + rise
    points = np.stack([r * np.cos(around), r * np.sin(around), z], -1).reshape(-1, 3)
    node = np.arange(len(points)).reshape(way.shape)
    quads = np.stack([node, np.roll(node, -1, 0)], -1)
    quads = np.stack([quads[:, :-1, 0], quads[:, 1:, 0], quads[:, 1:, 1], quads[:, :-1, 1]], -1)
    triangles = quads[..., [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    triangles = triangles[[len(set(map(tuple, points[t]))) == 3 for t in triangles]]
    meshio.Mesh(points, [("triangle", triangles)]).write(tmp_path / "punch.stl")
    skin = 'type = "surface_mesh", file = "punch.stl", length_unit = "m"'
    text = DOME.replace('type = "sphere_capped_punch", radius = "20 mm"', skin)
    edge = ["draping.edge_radius=2 mm"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        opened = drape(scene_from_text(text, tmp_path / "scene.toml", edge))
    solid = drape(scene(*edge))
    assert opened.unplaced_part() == solid.unplaced_part() == 0.0
    assert opened.positions[:, 2].min() == pytest.approx(solid.positions[:, 2].min(), abs=1e-4)
    assert opened.largest_shear()[0] == pytest.approx(solid.largest_shear()[0], rel=0.05)


def test_check_says_nothing_where_there_is_nothing_to_drape():
    plates = DOME.replace('type = "sphere_capped_punch", radius = "20 mm"',
                          'type = "plate", side = "above"')  # fmt: skip
    short = "tools.punch.motion.distance='0.2 mm'"
    flat = on_rung(scene(short, text=plates), "solid-shell")
    tools = build_tool_table(flat.tools, None, flat.process.time)
    assert not is_drapable(flat, tools)
    assert check_scene(flat).preview == []


def test_a_wrong_draping_entry_is_an_error_of_check_on_any_rung():
    with pytest.raises(InputError, match='no tool "dye"'):
        check_scene(on_rung(scene("draping.surface=dye"), "solid-shell"))


def test_the_seed_is_a_place_that_the_tool_touches():
    """Two ridges touch at once: the middle between them is touched by none."""
    ridges = ('type = "extruded_profile", solid = "left", points = ["-40 20 mm", "-10 0 mm", '
              '"0 10 mm", "10 0 mm", "40 20 mm"]')  # fmt: skip
    text = DOME.replace('type = "sphere_capped_punch", radius = "20 mm"', ridges)
    two = scene_from_text(text)
    blank = build_blank(two.blank, two.material.thickness)
    tools = build_tool_table(two.tools, None, 0.02, blank=blank.node_positions)
    seed = seed_of(two, blank, tools)
    assert abs(seed[0]) == pytest.approx(10e-3, abs=1e-9) and abs(seed[1]) < 1e-9
    again = seed_of(two, blank, tools)
    assert (seed == again).all()
    dome = seed_of(scene(), blank, build_tool_table(scene().tools, None, 0.02))
    assert np.allclose(dome, 0.0, atol=1e-12)


def test_a_net_tells_the_wrinkle_risk_by_its_nearness_of_locking(result):
    """Of the other parts it knows nothing; the angle is that of the summary."""
    quiet = result.datasets["/"]
    assert not any(name.startswith("wrinkle_risk") for name in quiet)
    asked = scene("output.wrinkle_risk=true", "draping.locking_angle=30 deg", *NO_FILES)
    sheet = draped_datasets(asked, drape(asked))["/"]
    assert {name for name in sheet if name.startswith("wrinkle_risk")} == {
        "wrinkle_risk", "wrinkle_risk_locking",
    }  # fmt: skip
    nearness = np.abs(np.degrees(sheet["shear_angle"].values)) / 30.0
    np.testing.assert_allclose(sheet["wrinkle_risk"].values, nearness, rtol=1e-9, atol=1e-12)
