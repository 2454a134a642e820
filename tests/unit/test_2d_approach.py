"""`element = "membrane-shell"`: what a scene may ask for, what a run writes and leaves out."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import meshio
import numpy as np
import pytest

from lcmchain.check import check_scene
from lcmchain.errors import InputError, SimulationError
from lcmchain.fields import (
    fibre_mass,
    read_forming,
    read_group,
    sheet_areas,
    sheet_faces,
    sheet_positions,
)
from lcmchain.fields.sheet import face_centres
from lcmchain.mapping import map_file
from lcmchain.model import build_model
from lcmchain.pipeline import run
from lcmchain.scene import MembraneShellElement, read_scene, scene_from_text, scene_json_schema
from lcmchain.solver.simulation import Simulation

EXAMPLES = Path(__file__).parents[2] / "examples"
DOME = """
title = "dome"
element = "membrane-shell"
process = { time = "20 ms", frames = 3, mass_damping = "500 1/s" }
blank = { size = ["60 mm", "60 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
contact = { friction = 0.157 }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "20 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "6 mm" }

[[tools]]
name = "die"
shape = { type = "plate_with_hole", hole_radius = "22 mm", fillet_radius = "6 mm", side = "below" }
"""
# what needs a thickness
LEFT_OUT = "thickness fibre_volume_fraction compaction_pressure permeability_1".split()
STEEL = (
    'material = { law = "isotropic", thickness = "1 mm", density = "7800 kg/m^3", '
    'young_modulus = "210 GPa", poisson_ratio = 0.3 }'
)
NO_FILES = ["output.pictures=false", "output.vtu=false"]


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return run(scene_from_text(DOME), tmp_path_factory.mktemp("dome"))


# --- scene ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text, overrides",
    [
        (DOME, ()),
        (DOME.replace('element = "membrane-shell"', ""), ["element=membrane-shell"]),
        (DOME.replace('"membrane-shell"', '{ type = "membrane-shell" }'), ()),
        (DOME.replace('"membrane-shell"', '{ hourglass = "published" }'),
         ["element=membrane-shell"]),
    ],
)  # fmt: skip
def test_element_is_named_in_the_scene_or_on_the_command_line(text, overrides):
    scene = scene_from_text(text, None, overrides)
    assert isinstance(scene.element, MembraneShellElement)
    assert ("element.type", "membrane-shell") in scene.source.given
    defaulted = [key for key, _ in scene.source.defaulted if key.startswith("element.")]
    assert defaulted == ["element.bending"] and scene.element.bending


@pytest.mark.parametrize(
    "old, new, key, words",
    [
        ('"membrane-shell"', '"membrane"', "element.type", 'did you mean "membrane-shell"'),
        ('"membrane-shell"', "3", "element", "must be a table"),
        ('"membrane-shell"', '{ type = "membrane-shell", cross_terms = true }',
         "element.cross_terms", 'belongs to "solid-shell"'),
        ('"membrane-shell"', '{ cross_term = true }', "element.cross_term", '"cross_terms"'),
        ('material = { preset = "MD600" }', STEEL, "material.law", '"fabric" only'),
        ("[[tools]]\nname = \"die\"",
         '[permeability]\nlaw = "gebart"\nfibre_radius = "3.5 um"\n[[tools]]\nname = "die"',
         "permeability", "thickness.*permeability=none"),
    ],
)  # fmt: skip
def test_wrong_entries_are_named(old, new, key, words):
    assert old in DOME
    with pytest.raises(InputError, match=words) as caught:
        scene_from_text(DOME.replace(old, new))
    assert caught.value.key == key


def test_the_main_example_takes_it_once_permeability_is_taken_back():
    path = EXAMPLES / "hemisphere_holder" / "scene.toml"
    with pytest.raises(InputError, match="permeability=none"):
        read_scene(path, ["element=membrane-shell"])
    scene = read_scene(path, ["element=membrane-shell", "permeability=none"])
    assert scene.permeability is None and len(scene.mapping) == 2


def test_json_schema_offers_both_elements_by_name_and_as_tables():
    schema = scene_json_schema()
    name, *tables = schema["properties"]["element"]["anyOf"]
    assert name == {"type": "string", "enum": ["solid-shell", "membrane-shell", "kinematic"]}
    solid, triangles, net = (schema["$defs"][t["$ref"].rsplit("/", 1)[1]] for t in tables)
    assert "type" not in solid.get("required", [])
    assert triangles["required"] == ["type"] and list(triangles["properties"]) == [
        "type", "bending"
    ]  # fmt: skip
    assert net["required"] == ["type"] and list(net["properties"]) == ["type"]


# --- check ----------------------------------------------------------------------------------------


def test_check_tells_what_is_simulated_and_what_is_not():
    scene = scene_from_text(DOME)
    report = check_scene(scene)
    effects = {effect.name: effect for effect in report.effects}
    absent = ("thickness", "compaction", "transverse shear", "hourglass control", "enhanced strain")
    assert not any(effects[name].active for name in absent)
    assert effects["bending"].active and effects["friction on die"].active
    assert any("predicts no thickness" in warning for warning in report.warnings)
    assert (report.element_count, report.node_count) == (288, 169)
    simulation = Simulation.from_scene(scene)
    assert simulation.model.element_count == report.element_count
    simulation.advance_to(1e-6)
    assert simulation.critical_step() == pytest.approx(report.estimate.critical_step, rel=0.05)
    assert report.estimate.controlled_by == "in-plane stiffness"


# --- result ---------------------------------------------------------------------------------------


def test_summary_names_what_is_missing(result):
    summary = json.loads((result.folder / "summary.json").read_text())
    assert any("predicts no thickness" in warning for warning in summary["warnings"])
    assert not [key for key in summary if key.startswith(("thickness", "fibre_volume"))]
    assert "compaction" not in summary["effects"] and "bending" in summary["effects"]
    assert summary["energy"]["hourglass"] == 0.0
    assert summary["balance_error_max"] < 1e-3
    assert max(summary["penetration_max_m"].values()) < 1e-5
    assert summary["fibre_mass_kg"] == pytest.approx(0.6 * 0.06**2, rel=1e-12)
    assert abs(summary["fibre_mass_error"]) < 1e-12
    assert summary["step_control"].keys() <= {"in-plane stiffness", "contact stiffness"}


def test_file_holds_triangles_without_thickness(result):
    path = result.folder / "forming.nc"
    sheet = read_forming(path)
    assert sheet["sheet_face_nodes"].shape == (288, 3)
    assert not set(LEFT_OUT) & set(sheet.variables)
    assert "no thickness" in sheet.attrs["comment"]
    with pytest.raises(InputError, match="solid"):
        read_group(path, "solid")
    for name in ("shear_angle", "fibre_strain_1", "areal_fibre_mass", "fibre_direction_2_z"):
        assert np.isfinite(sheet[name].values).all(), name
    assert np.abs(sheet["fibre_strain_1"].values).max() < 0.01
    assert np.abs(sheet["shear_angle"].values[-1]).max() > np.radians(2.0)


def test_fields_are_those_of_the_deformed_triangles(result):
    """Recomputed from the corners: fibres are the legs of the triangles."""
    sheet = result.datasets["/"]
    faces, last = sheet_faces(sheet)[:, :3], sheet.isel(time=-1)
    reference = sheet_positions(sheet, 0)[faces]
    formed = sheet_positions(sheet)[faces]
    for number, axis in (("1", 0), ("2", 1)):
        sides, images = (np.roll(x, -1, axis=1) - x for x in (reference, formed))
        leg = np.argmax(np.abs(sides[..., axis]) - 2.0 * np.abs(sides[..., 1 - axis]), axis=1)
        pick = np.arange(len(faces)), leg
        sign = np.sign(sides[pick][:, axis])[:, None]
        length = np.linalg.norm(images[pick], axis=1)
        direction = sign * images[pick] / length[:, None]
        stored = np.stack([last[f"fibre_direction_{number}_{a}"].values for a in "xyz"], axis=1)
        np.testing.assert_allclose(stored, direction, atol=1e-9)
        np.testing.assert_allclose(last[f"fibre_strain_{number}"], length / 5e-3 - 1, atol=1e-9)
    directions = [
        np.stack([last[f"fibre_direction_{n}_{a}"].values for a in "xyz"], axis=1) for n in "12"
    ]
    cosine = np.einsum("fi,fi->f", *directions)
    np.testing.assert_allclose(np.sin(last["shear_angle"]), cosine, atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(np.cross(formed[:, 1] - formed[:, 0], formed[:, 2] - formed[:, 0]), axis=1),
        2.0 * sheet_areas(sheet),
    )
    assert fibre_mass(sheet) == pytest.approx(fibre_mass(sheet, 0), rel=1e-12)
    np.testing.assert_allclose(face_centres(sheet, formed=True), formed.mean(axis=1), atol=1e-15)


def test_xugrid_and_ugrid_checks_read_the_file(result):
    xugrid = pytest.importorskip("xugrid")
    with xugrid.open_dataset(result.folder / "forming.nc") as dataset:
        grid = dataset.ugrid.grid
        assert (grid.n_face, grid.n_node, grid.n_max_node_per_face) == (288, 169, 3)
        assert dataset["shear_angle"].ugrid.grid is not None
    checks = pytest.importorskip("ugrid_checks.check")
    checker = checks.check_dataset(str(result.folder / "forming.nc"), print_summary=False)
    assert checker.logger.N_FAILURES + checker.logger.N_WARNINGS == 0, checker.checking_report()


def test_vtk_reads_the_file(result):
    pytest.importorskip("vtkmodules")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIONetCDF import vtkNetCDFUGRIDReader

    reader = vtkNetCDFUGRIDReader()
    reader.SetFileName(str(result.folder / "forming.nc"))
    reader.UpdateInformation()
    reader.UpdateTimeStep(20e-3)
    grid = reader.GetOutput()
    assert (grid.GetNumberOfCells(), grid.GetNumberOfPoints()) == (288, 169)
    angles = vtk_to_numpy(grid.GetCellData().GetArray("shear_angle"))
    np.testing.assert_array_equal(angles, result.datasets["/"]["shear_angle"].values[-1])


def test_vtu_holds_the_triangles(result):
    mesh = meshio.read(result.folder / "forming.vtu")
    assert [(block.type, len(block.data)) for block in mesh.cells] == [("triangle", 288)]
    np.testing.assert_allclose(mesh.points, sheet_positions(result.datasets["/"]))
    assert "shear_angle" in mesh.cell_data and "thickness" not in mesh.cell_data
    assert (result.folder / "forming.pvd").is_file()


def test_pictures_show_what_there_is(result):
    names = {path.name for path in result.folder.glob("*.png")}
    assert names == {
        "shear_angle.png", "wrinkle_height.png", "fibre_directions.png", "tools.png",
        "sections.png", "energy.png", "force.png", "force_over_travel.png",
    }  # fmt: skip


def test_mapping_carries_what_exists_and_says_what_is_missing(result, tmp_path):
    points = np.array([[x, y, 0.0] for y in (-10.0, 0.0, 10.0) for x in (-10.0, 0.0, 10.0)])
    points[:, 2] = -5.0
    cells = [[i, i + 1, i + 4, i + 3] for i in (0, 1, 3, 4)]
    meshio.write(tmp_path / "target.vtu", meshio.Mesh(points, [("quad", cells)]))
    report = map_file(
        result.folder / "forming.nc",
        tmp_path / "target.vtu",
        tmp_path / "mapped.nc",
        kind="structure",
        length_unit="mm",
    )
    assert any("no thickness" in warning for warning in report.warnings)
    assert {"shear_angle", "fibre_direction_1", "areal_fibre_mass"} <= set(report.fields)
    assert "thickness" not in report.fields


# --- run ------------------------------------------------------------------------------------------


def test_resumed_run_is_bit_identical(result, tmp_path, monkeypatch):
    """From the checkpoint of the second frame, in a new simulation."""
    scene = scene_from_text(DOME, None, NO_FILES)
    advance, calls = Simulation.advance_to, []

    def stop_in_the_second_frame(self, time, on_chunk=None):
        calls.append(time)
        if len(calls) == 2:
            raise KeyboardInterrupt
        advance(self, time, on_chunk)

    monkeypatch.setattr(Simulation, "advance_to", stop_in_the_second_frame)
    with pytest.raises(KeyboardInterrupt):
        run(scene, tmp_path)
    monkeypatch.undo()
    resumed = run(scene, tmp_path, resume=True).datasets["/"]
    for name, variable in result.datasets["/"].data_vars.items():
        assert variable.values.tobytes() == resumed[name].values.tobytes(), name


def test_mirror_images_agree(result):
    """Diagonals, contact and time integration keep the symmetry of the process."""
    sheet = result.datasets["/"]
    initial, formed = sheet_positions(sheet, 0), sheet_positions(sheet)
    for axis in (0, 1):
        sign = np.where(np.arange(3) == axis, -1.0, 1.0)
        order = [np.argmin(np.sum((initial - p) ** 2, axis=1)) for p in initial * sign]
        np.testing.assert_allclose(formed[order], formed * sign, atol=1e-9)


def test_contact_keeps_half_a_thickness_between_tool_and_nodes(result):
    """The mid-surface lies t/2 below the punch's sphere and above the die, up to penetrations."""
    punch, die = (result.summary["penetration_max_m"][tool] for tool in ("punch", "die"))
    assert 0.0 < max(punch, die) < 1e-5
    formed = sheet_positions(result.datasets["/"])
    pole = formed[np.argmin(np.sum(formed[:, :2] ** 2, axis=1))]
    assert -1e-9 < pole[2] - (0.502e-3 - 6e-3) < punch + 1e-9
    flange = np.linalg.norm(formed[:, :2], axis=1) > 0.0285
    assert formed[flange, 2].min() > 0.502e-3 - die - 1e-9


def test_collapsed_triangle_is_named():
    simulation = Simulation(build_model(scene_from_text(DOME)))
    model, state = simulation.model, simulation.state
    a, b, c = model.only_body().mesh.elements[100]
    state.position[:, c] = 0.98 * state.position[:, b] + 0.02 * state.position[:, a]
    with pytest.raises(SimulationError, match=r"triangle \d+ is collapsed .*edge_length"):
        simulation.advance_to(1e-4)
