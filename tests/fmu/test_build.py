"""The unit as a file: what it declares, what it holds, and how building it fails."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from lcmchain.errors import InputError
from lcmchain.fmu.build import build_fmu, model_identifier
from lcmchain.fmu.variables import forming_variables
from lcmchain.tools.motion import FIXED, GUIDED, PRESCRIBED

ELEMENT_COUNT = 400

TETRAHEDRON = """solid punch
facet normal 0 0 -1
outer loop
vertex 0 0 5
vertex 0 10 5
vertex 10 0 5
endloop
endfacet
facet normal 0 -1 0
outer loop
vertex 0 0 5
vertex 10 0 5
vertex 0 0 15
endloop
endfacet
facet normal -1 0 0
outer loop
vertex 0 0 5
vertex 0 0 15
vertex 0 10 5
endloop
endfacet
facet normal 1 1 1
outer loop
vertex 10 0 5
vertex 0 10 5
vertex 0 0 15
endloop
endfacet
endsolid punch
"""


def test_fmpy_finds_no_problem_in_the_model_description(unit):
    assert validate_fmu(str(unit)) == []


def test_interface_is_that_of_the_scene(unit):
    description = read_model_description(str(unit))
    by_name = {v.name: v for v in description.modelVariables}
    assert len(by_name) == len(description.modelVariables)

    inputs = {v.name for v in description.modelVariables if v.causality == "input"}
    assert inputs == {
        "punch.drive",
        "punch.velocity_input",
        "'blank-holder'.drive",
        "'blank-holder'.velocity_input",
        "'blank-holder'.force_input",
    }
    assert {v.name for v in description.modelVariables if v.causality == "parameter"} == {
        "threads",
        "out_dir",
    }
    for field, unit_name in (("thickness", "m"), ("fibre_volume_fraction", "1")):
        names = [name for name in by_name if name.startswith(f"{field}[")]
        assert names == [f"{field}[{i}]" for i in range(1, ELEMENT_COUNT + 1)]
        assert {by_name[name].unit for name in names} == {unit_name}
    for tool in ("punch", "die", "'blank-holder'"):
        units = [by_name[f"{tool}.{name}"].unit for name in ("travel", "velocity", "force")]
        assert units == ["m", "m/s", "N"]
    newton = next(u for u in description.unitDefinitions if u.name == "N").baseUnit
    assert (newton.kg, newton.m, newton.s) == (1, 1, -2)

    abilities = description.coSimulation
    assert abilities.canGetAndSetFMUstate
    assert abilities.canSerializeFMUstate
    assert abilities.canHandleVariableCommunicationStepSize
    experiment = description.defaultExperiment
    assert float(experiment.stopTime) == 3e-3
    assert float(experiment.stepSize) == pytest.approx(1e-3)


def test_outputs_depend_on_no_input_at_the_same_time(unit):
    description = read_model_description(str(unit))
    assert all(unknown.dependencies == [] for unknown in description.outputs)


def test_fields_are_single_variables_of_the_definition():
    tools = [("punch", PRESCRIBED), ("die", FIXED), ("holder", GUIDED)]
    variables = forming_variables(tools, 9, has_fibre_volume_fraction=True)
    assert [(v.name, v.size) for v in variables if v.size] == [
        ("thickness", 9),
        ("fibre_volume_fraction", 9),
    ]
    without = forming_variables(tools, 9, has_fibre_volume_fraction=False)
    assert {v.name for v in variables} - {v.name for v in without} == {
        "fibre_volume_fraction",
        "fibre_volume_fraction_min",
        "fibre_volume_fraction_max",
    }
    assert not [v.name for v in variables if v.causality == "input" and "die" in v.name]


def test_same_scene_gives_the_same_guid_and_another_scene_another(scene_file, unit, tmp_path):
    def guid(path):
        return read_model_description(str(path)).guid

    assert guid(build_fmu(scene_file, tmp_path / "again.fmu")) == guid(unit)
    other = tmp_path / "other.toml"
    other.write_text(scene_file.read_text().replace("0.157", "0.2"))
    assert guid(build_fmu(other, tmp_path / "other.fmu")) != guid(unit)


def test_building_leaves_the_process_as_it_was(scene_file, tmp_path):
    path, modules = list(sys.path), set(sys.modules)
    build_fmu(scene_file, tmp_path / "dome.fmu")
    assert sys.path == path
    assert not {name for name in set(sys.modules) - modules if "forming_unit" in name}


def test_unit_holds_the_files_that_the_scene_names(scene_file, tmp_path):
    for folder in ("scene", "scene/meshes", "elsewhere"):
        (tmp_path / folder).mkdir()
    (tmp_path / "scene/meshes/inner.stl").write_text(TETRAHEDRON)
    (tmp_path / "elsewhere/outer.stl").write_text(TETRAHEDRON)
    text = scene_file.read_text()
    for name, file in (("inner", "meshes/inner.stl"), ("outer", "../elsewhere/outer.stl")):
        text += f"""
[[tools]]
name = "{name}"
shape = {{ type = "surface_mesh", file = "{file}", length_unit = "mm", spacing = "0.5 mm" }}
"""
    scene = tmp_path / "scene/scene.toml"
    scene.write_text(text)
    built = build_fmu(scene, tmp_path / "a unit.fmu")
    with zipfile.ZipFile(built) as archive:
        names = set(archive.namelist())
        assert archive.read("resources/scene/meshes/inner.stl").decode() == TETRAHEDRON
        (moved,) = (name for name in names if name.endswith("outer.stl"))
        assert moved.startswith("resources/scene/")
        overrides = json.loads(archive.read("resources/unit.json"))["overrides"]
    assert overrides == [f'tools[4].shape.file="{moved.removeprefix("resources/scene/")}"']
    description = read_model_description(str(built))
    assert description.coSimulation.modelIdentifier == "a_unit"
    assert {"binaries/linux64/a_unit.so", "binaries/win64/a_unit.dll"} <= names
    assert str(tmp_path) not in json.dumps(overrides)


@pytest.mark.parametrize(
    ("name", "identifier"), [("dome", "dome"), ("2 layers", "_2_layers"), ("höhe-1", "h_he_1")]
)
def test_model_identifier_is_one_of_the_c_language(name, identifier):
    assert model_identifier(name) == identifier


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('{ type = "sphere_capped_punch", radius = "25 mm" }',
         '{ type = "surface_mesh", file = "absent.stl", length_unit = "mm" }', "absent.stl"),
        ('position = "0 0 1.004 mm"', 'position = "0 0 0 mm"', "into the blank"),
        ('edge_length = "5 mm"', "edge_length = 5", "edge_length"),
    ],
)  # fmt: skip
def test_wrong_scene_is_told_and_leaves_the_old_unit(scene_file, tmp_path, old, new, told):
    scene = tmp_path / "dome.toml"
    scene.write_text(scene_file.read_text().replace(old, new))
    out = tmp_path / "dome.fmu"
    out.write_text("an older unit")
    with pytest.raises(InputError, match=told):
        build_fmu(scene, out)
    assert out.read_text() == "an older unit"
    assert {path.name for path in tmp_path.iterdir()} == {"dome.toml", "dome.fmu"}


def test_name_of_the_unit_must_end_in_fmu(scene_file, tmp_path):
    with pytest.raises(InputError, match=r"\.fmu"):
        build_fmu(scene_file, tmp_path / "dome.zip")


def test_unit_without_lcmchain_says_what_to_install():
    entry = Path(__file__).parents[2] / "fmu" / "unit_entry.py"
    program = f"import runpy; runpy.run_path({str(entry)!r})"
    # Isolated and without site-packages: a Python that has the standard library only.
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", program], capture_output=True, text=True, env={}
    )
    assert done.returncode != 0
    assert "ImportError: this unit needs lcmchain" in done.stderr


def test_unit_of_the_2d_approach_forms_without_thickness(scene_file, tmp_path):
    """No variable promises what `element = "membrane-shell"` does not predict."""
    text = scene_file.read_text(encoding="utf-8")
    (tmp_path / "flat.toml").write_text('element = "membrane-shell"\n' + text, encoding="utf-8")
    unit = build_fmu(tmp_path / "flat.toml", tmp_path / "flat.fmu")
    names = {v.name for v in read_model_description(str(unit)).modelVariables}
    assert not [name for name in names if name.startswith(("thickness", "fibre_volume_fraction"))]
    outputs = ["punch.force", "shear_angle_max", "internal_energy", "hourglass_energy"]
    result = simulate_fmu(
        str(unit), stop_time=1e-3, output_interval=5e-4, output=outputs, validate=False
    )
    assert result["hourglass_energy"][-1] == 0.0
    assert result["shear_angle_max"][-1] > 0.0 and result["internal_energy"][-1] > 0.0
    assert result["punch.force"][-1] < 0.0
